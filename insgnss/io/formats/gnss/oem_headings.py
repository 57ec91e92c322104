"""Headings of two antennas in ASCII logs of NovAtel's and Unicore's receivers, measurement.md.

A log is a line `#NAME,header;body*crc` of HEADINGA, HEADING2A, DUALANTENNAHEADINGA (NovAtel;
Unicore has HEADINGA too) or UNIHEADINGA (Unicore). The body begins alike in all of them:

    solution status, position type, length m, heading deg, pitch deg, reserved, sigma heading deg

and the header has GPS week and seconds behind the state of the clock, UNIHEADINGA milliseconds.
The checksum is CRC-32 with the polynomial of zlib, begun with 0 and not inverted.
"""

import numpy as np

from ....base.errors import InputError
from ....geodesy.gpstime import WEEK_S
from ....records import Array, Finding
from ..text.layout import decode
from ..text.order import note, refuse_rows
from ..text.sentences import SentenceLines
from ..text.text import Source, load
from .novatel import OemLog, solved_logs

HEADING_LOGS = ("HEADINGA", "HEADING2A", "DUALANTENNAHEADINGA", "UNIHEADINGA")
MILLISECONDS = "UNIHEADINGA"  # whose header has its week one field further left, and ms
FIELDS_BEFORE_HEADING = 7, 7  # fields of header and body: the least, those that are read
LOG_HEADINGS = "let the receiver log HEADING2A or UNIHEADINGA, and copy the log whole"


def is_oem_log(head: bytes) -> bool:
    """Tell whether the first bytes of a file hold such a log."""
    return any(f"#{name},".encode() in head for name in HEADING_LOGS)


def read_oem_headings(
    path: Source,
) -> tuple[int, Array, Array, SentenceLines, Array, tuple[Finding, ...]]:
    """Read the headings of a log, without those of no solution.

    Parameters
    ----------
    path : path
        The log, in which lines of other kinds may stand.

    Returns
    -------
    tuple
        GPS week, seconds of it (GPST), headings and their standard deviations, deg, between which
        stand the lines; behind, the note on lines that were left out.

    Raises
    ------
    InputError
        What cannot be read, with file and line; a log without a heading, or of too many damaged
        lines.
    """
    text = decode(bytes(load(path)[0][:-1]))
    logs, left_out = solved_logs(
        path,
        text,
        HEADING_LOGS,
        FIELDS_BEFORE_HEADING,
        lambda log: log.header[_week_of(log) - 1].startswith("FINE"),
    )
    if not logs:
        raise InputError.in_file(path, f"no heading with a solution; {LOG_HEADINGS}")
    rows = [
        [log.line.value(text) for text in (*log.header[_week_of(log) :][:2], *log.body[3:7:3])]
        for log in logs
    ]
    week, time, heading, sigma = np.array(rows).T
    time = time * np.array([1e-3 if log.name == MILLISECONDS else 1.0 for log in logs])
    lines = SentenceLines(str(path), [log.line.number for log in logs])
    refuse_rows(
        lines,
        ~(sigma > 0.0),
        "standard deviation {:g} deg of the heading; a standard deviation must be greater than"
        " zero; set up the antennas' baseline in the receiver",
        sigma,
    )
    notes = tuple(note("measurement rows", finding, "a solution each") for finding in left_out)
    return int(week[0]), time + WEEK_S * (week - week[0]), heading, lines, sigma, notes


def _week_of(log: OemLog) -> int:
    """Return the field of a header that holds the GPS week; the time stands behind it."""
    return 4 if log.name == MILLISECONDS else 5
