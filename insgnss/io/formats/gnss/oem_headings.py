"""Headings of two antennas in ASCII logs of NovAtel's and Unicore's receivers, measurement.md.

A log is a line `#NAME,header;body*crc` of HEADINGA, HEADING2A, DUALANTENNAHEADINGA (NovAtel;
Unicore has HEADINGA too) or UNIHEADINGA (Unicore). The body begins alike in all of them:

    solution status, position type, length m, heading deg, pitch deg, reserved, sigma heading deg

and the header has GPS week and seconds behind the state of the clock, UNIHEADINGA milliseconds.
The checksum is CRC-32 with the polynomial of zlib, begun with 0 and not inverted.
"""

import zlib

import numpy as np

from ....base.errors import InputError
from ....geodesy.gpstime import WEEK_S
from ....records import Array, Finding
from ..text.layout import shown
from ..text.order import note, refuse_rows
from ..text.sentences import BAD_SHARE_LIMIT, SentenceLines
from ..text.text import Source, load, number

NAMES = ("#HEADINGA", "#HEADING2A", "#DUALANTENNAHEADINGA", "#UNIHEADINGA")
MILLISECONDS = "#UNIHEADINGA"  # whose header has its week one field further left, and ms
FIELDS = 7, 7  # of header and body that are read, at least
ADVICE = "let the receiver log HEADING2A or UNIHEADINGA, and copy the log whole"


def is_oem_log(head: bytes) -> bool:
    """Tell whether the first bytes of a file hold such a log."""
    return any(f"{name},".encode() in head for name in NAMES)


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
    sentences = bytes(load(path)[0]).decode("ascii", "replace").split("\n")
    rows: list[list[float]] = []
    lines: list[int] = []
    without, damaged = 0, []
    for line, sentence in enumerate(sentences, start=1):
        name = sentence.partition(",")[0]
        if name not in NAMES:
            continue
        content, _, checksum = sentence.strip().rpartition("*")
        header, _, body = content.partition(";")
        head, fields = header.split(","), body.split(",")
        crc = zlib.crc32(content[1:].encode("ascii", "replace"), 0xFFFFFFFF) ^ 0xFFFFFFFF
        if checksum.lower() != f"{crc:08x}" or (len(head), len(fields)) < FIELDS:
            damaged.append(line)
            continue
        if fields[0] != "SOL_COMPUTED" or not head[3 + (name != MILLISECONDS)].startswith("FINE"):
            without += 1
            continue
        week, seconds = head[4:6] if name == MILLISECONDS else head[5:7]
        rows.append([number(text, str(path), line) for text in (week, seconds, *fields[3:7:3])])
        rows[-1][1] *= 1e-3 if name == MILLISECONDS else 1.0
        lines.append(line)
    if len(damaged) > BAD_SHARE_LIMIT * (len(damaged) + len(rows) + without):
        wrong = shown(sentences[damaged[0] - 1].partition(",")[0])
        message = f"no right checksum in {wrong}, as in {len(damaged)} lines"
        limit = f"limit {BAD_SHARE_LIMIT:.0%}"
        raise InputError.at_line(path, damaged[0], f"{message} ({limit}); copy the log again")
    if not rows:
        raise InputError.in_file(path, f"no heading with a solution; {ADVICE}")
    week, time, heading, sigma = np.array(rows).T
    source = SentenceLines(str(path), lines)
    refuse_rows(
        source,
        ~(sigma > 0.0),
        "standard deviation {:g} deg of the heading; a standard deviation must be greater than"
        " zero; set up the antennas' baseline in the receiver",
        sigma,
    )
    notes: tuple[Finding, ...] = ()
    if damaged or without:
        message = f"left out {len(damaged)} damaged lines, {without} without a solution"
        notes = (note("measurement rows", f"{message}; {len(rows)} headings", "a solution each"),)
    return int(week[0]), time + WEEK_S * (week - week[0]), heading, source, sigma, notes
