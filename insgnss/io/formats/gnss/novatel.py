"""Receiver log of NovAtel and its kin in ASCII: #BESTGNSSPOSA or #BESTPOSA, data_specs/novatel.md.

A log is `#NAME,port,...,week,seconds,...;fields*crc`, its checksum the CRC-32 of what stands
between # and * that begins with zero. Other text before it in a line is passed over, as are other
logs. Heights are above mean sea level and become ellipsoidal by the undulation of the same log.
"""

import re
import zlib
from collections.abc import Callable, Collection
from typing import NamedTuple

import numpy as np

from ....base.errors import InputError
from ....records import GnssFixes
from ..read_options import STATED_NOTHING, ReadOptions
from ..text.layout import decode, quote
from ..text.order import note
from ..text.sentences import BAD_SHARE_LIMIT, SentenceLines
from ..text.text import FileLine, Source, load
from ..text.units import DEG
from .fixes import FixScales, fixes_from_columns

LOGS = ("BESTGNSSPOSA", "BESTPOSA", "RTKPOSA", "PSRPOSA")  # the first that there is
# fields before and behind the semicolon: up to the number of satellites
LEAST_POSITION_FIELDS = 10, 15
WEEK, SECONDS_FIELD = 5, 6  # fields of the header, from 0: NovAtel's manual
# type of the position to RTKLIB's codes: the first whose letters it has
QUALITY_OF_TYPE = (
    *(("FLOAT", 2), ("INT", 1), ("FIXED", 1), ("PPP", 6), ("WAAS", 3), ("SBAS", 3)),
    *(("PSRDIFF", 4), ("SINGLE", 5), ("PSRSP", 5)),
)


class OemLog(NamedTuple):
    """A log: where it stands, its name, and its fields before and behind the semicolon."""

    line: FileLine
    name: str
    header: list[str]
    body: list[str]


def _pattern(names: Collection[str]) -> re.Pattern[str]:
    """Return the pattern of logs of these names: what the checksum is of, and the checksum."""
    return re.compile(rf"#((?:{'|'.join(names)}),[^*\n]*)(?:\*([0-9a-fA-F]{{8}}))?")


def is_novatel(head: bytes) -> bool:
    """Tell whether the first bytes of a file begin with a log of NovAtel, or hold two of them."""
    text, pattern = decode(head), _pattern(LOGS)
    return pattern.match(text) is not None or len(pattern.findall(text)) > 1


def solved_logs(
    path: Source,
    text: str,
    names: Collection[str],
    least: tuple[int, int],
    is_solved: Callable[[OemLog], bool],
) -> tuple[list[OemLog], tuple[str, ...]]:
    """Return the logs of some names that have a right checksum and a solution.

    Parameters
    ----------
    path, text
        The file and what it holds.
    names : collection of str
        Names of the logs.
    least : tuple of int
        Fields of header and body that are read, at least.
    is_solved : function
        Whether a log has a solution.

    Returns
    -------
    list of OemLog
        The logs.
    tuple of str
        How many were left out, where there are any.

    Raises
    ------
    InputError
        More than 1 % of wrong checksums, or a log of too few fields.
    """
    matches = [
        (FileLine(path, number), match[1], match[2])
        for number, row in enumerate(text.split("\n"), 1)
        for match in _pattern(names).finditer(row)
    ]
    right = [match for match in matches if match[2] and int(match[2], 16) == _checksum(match[1])]
    if (wrong := len(matches) - len(right)) > BAD_SHARE_LIMIT * len(matches):
        line, content, _ = next(match for match in matches if match not in right)
        raise line.error(
            f"no right checksum in {quote('#' + content)}, as in {wrong} of {len(matches)} logs"
            f" (limit {BAD_SHARE_LIMIT:.0%}); record or copy the log again"
        )
    logs = [_fields(line, content, least) for line, content, _ in right]
    solved = [log for log in logs if log.body[0] == "SOL_COMPUTED" and is_solved(log)]
    without = f"{wrong} logs without a right checksum, {len(logs) - len(solved)} without solution"
    return solved, (f"left out {without}",) if len(solved) < len(matches) else ()


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
    kind = next(name for name in LOGS if f"#{name}," in text)
    logs, left_out = solved_logs(
        path, text, (kind,), LEAST_POSITION_FIELDS, lambda log: log.body[1] != "NONE"
    )
    if not logs:
        count = text.count(f"#{kind},")
        problem = f"none of its {count} {kind} logs has a solution; is it the rover's log?"
        raise InputError.in_file(path, problem)
    names = ("week", "tow", "lat", "lon", "h", "sd_n", "sd_e", "sd_u", "q", "age_s", "satellites")
    cols = dict(zip(names, np.array([_row(log) for log in logs]).T, strict=True))
    lines = SentenceLines(str(path), [log.line.number for log in logs])
    expected, advice = "whole logs with a solution", "check the receiver"
    notes = tuple(note("GNSS rows", finding, expected, advice) for finding in left_out)
    return fixes_from_columns(cols, lines, FixScales(angle=DEG), options, notes=notes)


def _checksum(content: str) -> int:
    """Return the CRC-32 of a log, from zero and without a last inversion."""
    return zlib.crc32(content.encode("latin-1", "replace"), 0xFFFFFFFF) ^ 0xFFFFFFFF


def _fields(line: FileLine, content: str, least: tuple[int, int]) -> OemLog:
    """Return the fields of a log; InputError for too few."""
    header, _, body = content.partition(";")
    log = OemLog(line, header.partition(",")[0], header.split(","), body.split(","))
    if len(log.header) < least[0] or len(log.body) < least[1]:
        problem = f"{len(log.header)} fields before and {len(log.body)} after the semicolon"
        raise line.error(f"{problem}, at least {least[0]} and {least[1]} needed; delete the line")
    return log


def _row(log: OemLog) -> tuple[float, ...]:
    """Return the numbers of a log; InputError for what is none."""
    numbers = [log.line.value(log.header[k]) for k in (WEEK, SECONDS_FIELD)]
    lat, lon, above_sea, undulation = map(log.line.value, log.body[2:6])
    sigmas = map(log.line.value, log.body[7:10])
    quality = next((code for letters, code in QUALITY_OF_TYPE if letters in log.body[1]), 0)
    age, satellites = (log.line.value(log.body[k]) for k in (11, 14))
    return (*numbers, lat, lon, above_sea + undulation, *sigmas, float(quality), age, satellites)
