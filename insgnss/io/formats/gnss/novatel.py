"""Receiver log of NovAtel and its kin in ASCII: #BESTGNSSPOSA or #BESTPOSA, data_specs/novatel.md.

A log is `#NAME,port,...,week,seconds,...;fields*crc`, its checksum the CRC-32 of what stands
between # and * that begins with zero. Other text before it in a line is passed over, as are other
logs. Heights are above mean sea level and become ellipsoidal by the undulation of the same log.
"""

import re
import zlib

import numpy as np

from ....base.errors import InputError
from ....records import Finding, GnssFixes
from ..read_options import STATED_NOTHING, ReadOptions
from ..text.layout import decode, shown
from ..text.order import note
from ..text.sentences import BAD_SHARE_LIMIT, SentenceLines
from ..text.text import Source, load, number
from .fixes import FixScales, fixes_from_columns

LOGS = ("BESTGNSSPOSA", "BESTPOSA", "RTKPOSA", "PSRPOSA")  # the first that there is
_LOG = re.compile(rf"#((?:{'|'.join(LOGS)}),[^*\n]*)(?:\*([0-9a-fA-F]{{8}}))?")
# fields before the semicolon, and behind it up to the number of satellites
HEADER_FIELDS, LEAST_FIELDS = 10, 15
WEEK, SECONDS = 5, 6  # fields of the header
# type of the position to RTKLIB's codes: the first whose letters it has
QUALITY = (
    *(("FLOAT", 2), ("INT", 1), ("FIXED", 1), ("PPP", 6), ("WAAS", 3), ("SBAS", 3)),
    *(("PSRDIFF", 4), ("SINGLE", 5), ("PSRSP", 5)),
)


def is_novatel(head: bytes) -> bool:
    """Tell whether the first bytes of a file begin with a log of NovAtel, or hold two of them."""
    text = decode(head)
    return _LOG.match(text) is not None or len(_LOG.findall(text)) > 1


def read_novatel(path: Source, options: ReadOptions = STATED_NOTHING) -> GnssFixes:
    """Read the fixes of one kind of position log, GPST.

    The note counts what was left out: logs with a wrong checksum (at most 1 %) and logs without a
    solution.

    Parameters
    ----------
    path : path
        The log.
    options : ReadOptions
        `sigma_m` of fixes that state 0.

    Returns
    -------
    GnssFixes
        The fixes.

    Raises
    ------
    InputError
        What cannot be read, with file and line.
    """
    text = decode(bytes(load(path)[0][:-1]))
    logs = [
        (line, match[1], match[2])
        for line, row in enumerate(text.split("\n"), 1)
        for match in _LOG.finditer(row)
    ]
    kind = next(name for name in LOGS if any(body.startswith(name) for _, body, _ in logs))
    logs = [log for log in logs if log[1].startswith(f"{kind},")]
    right = [log for log in logs if log[2] and int(log[2], 16) == _checksum(log[1])]
    if (wrong := len(logs) - len(right)) > BAD_SHARE_LIMIT * len(logs):
        line, body, _ = next(log for log in logs if log not in right)
        raise InputError.at_line(
            path,
            line,
            f"no right checksum in {shown('#' + body)}, as in {wrong} of {len(logs)} logs (limit"
            f" {BAD_SHARE_LIMIT:.0%}); record or copy the log again",
        )
    rows = [(line, row) for line, body, _ in right if (row := _row(path, line, body)) is not None]
    if not rows:
        problem = f"none of its {len(logs)} {kind} logs has a solution; is it the rover's log?"
        raise InputError.in_file(path, problem)
    names = ("week", "tow", "lat", "lon", "h", "sd_n", "sd_e", "sd_u", "q", "age_s", "satellites")
    cols = dict(zip(names, np.array([row for _, row in rows]).T, strict=True))
    lines = SentenceLines(str(path), [line for line, _ in rows])
    notes: tuple[Finding, ...] = ()
    if len(rows) < len(logs):
        without = len(right) - len(rows)
        finding = f"left out {wrong} logs without a right checksum, {without} without solution"
        notes = (note("GNSS rows", finding, "whole logs with a solution", "check the receiver"),)
    scales = FixScales(angle=np.pi / 180.0)
    return fixes_from_columns(cols, lines, scales, options, notes=notes)


def _checksum(body: str) -> int:
    """Return the CRC-32 of a log, from zero and without a last inversion."""
    return zlib.crc32(body.encode("latin-1", "replace"), 0xFFFFFFFF) ^ 0xFFFFFFFF


def _row(path: Source, line: int, body: str) -> tuple[float, ...] | None:
    """Return the numbers of a log with a solution, else None; InputError for what is none."""
    header, _, solution = body.partition(";")
    heading, fields = header.split(","), solution.split(",")
    if len(heading) < HEADER_FIELDS or len(fields) < LEAST_FIELDS:
        problem = f"{len(heading)} fields and {len(fields)} behind the semicolon"
        least = f"{HEADER_FIELDS} and {LEAST_FIELDS} are the least; delete the line"
        raise InputError.at_line(path, line, f"{problem}, {least}")
    if fields[0] != "SOL_COMPUTED" or fields[1] == "NONE":
        return None
    week, tow = (number(heading[k], path, line) for k in (WEEK, SECONDS))
    lat, lon, above_sea, undulation = (number(field, path, line) for field in fields[2:6])
    north, east, up = (number(field, path, line) for field in fields[7:10])
    quality = next((code for letters, code in QUALITY if letters in fields[1]), 0)
    age, satellites = (number(fields[k], path, line) for k in (11, 14))
    return (
        *(week, tow, lat, lon, above_sea + undulation, north, east, up),
        *(float(quality), age, satellites),
    )
