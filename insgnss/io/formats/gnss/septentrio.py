"""Attitudes in the text that Septentrio's sbf2asc makes of a receiver's SBF log, measurement.md.

    -4 time heading pitch roll error mode satellites      AttEuler, deg
    -5 time var(heading) var(pitch) var(roll) error       AttCovEuler, deg^2

stand in lines of 14 fields among those of other blocks; the time counts from the beginning of GPST.
Mode 2 has heading and pitch of two antennas with fixed ambiguities and a roll of 0, mode 4 all
three angles; 1 and 3 are the same with float ambiguities.
"""

import re

import numpy as np

from ....base.errors import InputError
from ....geodesy.gpstime import WEEK_S
from ....records import Array, Finding
from ..text.order import note
from ..text.sentences import SentenceLines
from ..text.text import FileLine, Source, decode_text, numbered_lines

ROW = re.compile(rb"^-[45] +\d{9,10}\.\d+ ", re.MULTILINE)
ANGLE_COLUMNS = ("heading", "pitch", "roll")
DO_NOT_USE = -1e10  # deg: the receiver has -2e10 in place of a value that it does not know
FIXED_MODES = (2, 4)  # of two and of three antennas: angles of float ambiguities are degrees off
FIELDS_READ = 8  # of a line: the least, because zeros stand behind the error of its variances


def is_sbf_text(head: bytes) -> bool:
    """Tell whether the first bytes of a file hold such a line."""
    return ROW.search(head) is not None


def read_sbf_attitudes(
    path: Source, *angles: str
) -> tuple[int, Array, Array, SentenceLines, Array | None, tuple[Finding, ...]]:
    """Read attitudes with fixed ambiguities.

    Parameters
    ----------
    path : path
        The text.
    *angles : str
        Which of `ANGLE_COLUMNS` are wanted.

    Returns
    -------
    tuple
        GPS week, seconds of it (GPST), angles, deg, and their lines; standard deviations, deg, None
        of a text without variances; the note on lines that were left out.

    Raises
    ------
    InputError
        A line that was cut or has no number where one should be; a text without such attitudes.
    """
    rows: dict[str, list[list[float]]] = {"-4": [], "-5": []}
    for number, text in numbered_lines(decode_text(path)):
        fields = text.split()
        if not fields or fields[0] not in rows:
            continue
        line = FileLine(str(path), number)
        if len(fields) < FIELDS_READ:
            problem = f"{len(fields)} fields, expected 14; copy the file whole"
            raise InputError.at_line(path, number, problem)
        rows[fields[0]].append([number, *(line.value(one) for one in fields[1:FIELDS_READ])])
    attitudes, variances = (np.array(rows[tag]).reshape(-1, FIELDS_READ) for tag in ("-4", "-5"))
    columns = [2 + ANGLE_COLUMNS.index(angle) for angle in angles]
    modes = FIXED_MODES[1:] if "roll" in angles else FIXED_MODES
    usable = (attitudes[:, 5] == 0.0) & np.isin(attitudes[:, 6], modes)
    usable &= (attitudes[:, columns] > DO_NOT_USE).all(axis=1)
    sigma = None
    if variances.size:
        positive = variances[(variances[:, columns] > 0.0).all(axis=1)]
        _, with_variances, of_it = np.intersect1d(
            attitudes[:, 1], positive[:, 1], return_indices=True
        )
        sigma = np.full((len(attitudes), len(columns)), np.nan)
        sigma[with_variances] = np.sqrt(positive[of_it][:, columns])
        usable &= np.isfinite(sigma).all(axis=1)
        sigma = sigma[usable]
    if not usable.any():
        advice = "; two antennas give no roll, take kind heading" if "roll" in angles else ""
        problem = f"none of {usable.size} attitudes has fixed ambiguities and no error"
        raise InputError.in_file(path, f"{problem} (AttEuler, mode {modes[0]}){advice}")
    notes: tuple[Finding, ...] = ()
    if not usable.all():
        finding = f"left out {np.count_nonzero(~usable)} of {usable.size} attitudes"
        notes = (note("measurement rows", finding, "fixed ambiguities, no error, with variances"),)
    number, time = attitudes[usable, :2].T
    week = int(time[0] // WEEK_S)
    lines = SentenceLines(str(path), number.astype(np.int64).tolist())
    return week, time - WEEK_S * week, attitudes[usable][:, columns], lines, sigma, notes
