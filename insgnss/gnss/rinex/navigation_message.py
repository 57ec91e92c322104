"""Broadcast ephemerides of RINEX navigation files into one table of messages: GPS, QZSS, Galileo,
BeiDou, GLONASS.

Read are RINEX 2 (GPS `.n`, GLONASS `.g`), RINEX 3 (one system or mixed) and of RINEX 4 the messages
that RINEX 3 has (`navigation_4`), plain or packed (gzip; others through hatanaka). Messages of SBAS
and NavIC are left out and counted, as are those of satellites that call themselves unhealthy (GPS,
QZSS, BeiDou and GLONASS by their health word, Galileo by the bits of the signal whose message it
is). Times become GPST seconds of one GPS week: those of GPS, QZSS and Galileo as they stand, BeiDou
time + 14 s, GLONASS from UTC by the leap seconds. The week of a time of ephemeris is the one that
brings it nearest to the time of clock; the week number of the message, of which writers make
different things, is not used.

RINEX 2.11, tables A4 and A10; RINEX 3.04, tables A5 to A15. Where Galileo's I/NAV and F/NAV give
the same elements they differ in the clock by the delay between the bands; I/NAV stands first.
"""

import math
import re
from collections import Counter
from collections.abc import Iterable, Iterator
from dataclasses import dataclass, field, replace
from datetime import datetime, timedelta
from itertools import pairwise
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from ...base.errors import InputError
from ...base.files import lines_of
from ...base.inputs import read_bytes
from ...base.unpacking import unpack
from ...geodesy.gpstime import WEEK_S, gps_from_calendar
from ...io.formats.text.layout import float_of, quote
from .navigation_4 import as_rinex_3
from .systems import BEIDOU_LAG_S, CONSTANTS, is_geostationary
from .through_georinex import messages_of_sp3

Array = NDArray[np.float64]
Source = str | Path

# columns of a message; of GLONASS the nine from STATE on are position, velocity, acceleration of
# Sun and Moon (m, m/s, m/s^2)
KIND, TOE, TOC, AF0, AF1, AF2 = 0, 1, 2, 3, 4, 5
# Kepler elements and their rates
ROOT_A, ECC, M0, DELTA_N, I0, I_DOT, NODE0, NODE_DOT, PERIGEE = 6, 7, 8, 9, 10, 11, 12, 13, 14
CUC, CUS, CRC, CRS, CIC, CIS = 15, 16, 17, 18, 19, 20  # corrections by cosine and sine
MU, RATE, SOW = 21, 22, 23  # `CONSTANTS` of the system, and seconds of the week
MESSAGE_VALUES = 24  # of a message in the table
STATE = 6  # first of the nine of GLONASS
KEPLER, GEOSTATIONARY, GLONASS = 0.0, 1.0, 2.0  # what KIND holds

# place of each Kepler element among the numbers of a RINEX message, the clock's three first
ORBIT_PLACES = {
    AF0: 0,
    AF1: 1,
    AF2: 2,
    CRS: 4,
    DELTA_N: 5,
    M0: 6,
    CUC: 7,
    ECC: 8,
    CUS: 9,
    ROOT_A: 10,
    SOW: 11,
    CIC: 12,
    NODE0: 13,
}
ORBIT_PLACES |= {CIS: 14, I0: 15, CRC: 16, PERIGEE: 17, NODE_DOT: 18, I_DOT: 19}
SOURCE, HEALTH = 20, 24  # their places among the numbers of a Galileo message
LINES = {"G": 8, "J": 8, "E": 8, "C": 8, "R": 4}
SYSTEMS_LEFT_OUT = {"S": "SBAS", "I": "NavIC"}
CHANNEL, CHANNEL_RANGE = 10, (-7, 24)  # of GLONASS: place and range; those up to 24 until 1998
SPARE = {"G": (28, 29, 30), "J": (28, 29, 30), "E": (22, 28, 29, 30), "C": (20, 22, 29, 30)}
SPARE |= {"R": (14,)}  # places of numbers that neither this package nor the engine needs
# distances of GLONASS from the Earth's centre (m), roots of the semi-major axes of others (m^1/2)
# and their eccentricities: none of a navigation satellite lies outside
GLONASS_RADIUS_M, ROOT_A_LIMITS, MOST_ECCENTRICITY = (2.4e7, 2.7e7), (5e3, 7e3), 0.5
SHORTEST = 23  # columns before a message's first number; a shorter line begins none
# words that a message must have: their place among its numbers, and their range
CHECKED_ORBIT = {
    "R": ((CHANNEL, "the frequency number", *CHANNEL_RANGE),),
    "E": ((SOURCE, "the data source", 0, 1023), (HEALTH, "the health", 0, 511)),
}
SP3 = re.compile(r"#[a-d][PV]\d{4} ")  # the first line of precise orbits
FITTED = "messages fitted to precise orbits (SP3)"
EPOCH_STAMP = re.compile(r"\s*(?:[0-9]{1,4}\s+){5}[0-9]{1,2}(?:\.[0-9]*)?\s*")
F_NAV = 0b10  # bit of the data source: a message of F/NAV, from E5a
# of F/NAV: E5a; of I/NAV: E1-B and E5b
GALILEO_UNHEALTHY = {True: 0b000_111_000, False: 0b111_000_111}


@dataclass(frozen=True, eq=False)
class Navigation:
    """Broadcast messages, sorted by time of ephemeris.

    Parameters
    ----------
    satellite : ndarray of str, shape (k,)
        Such as "G05".
    table : ndarray, shape (k, MESSAGE_VALUES)
        Elements, times in GPST seconds of `gps_week`.
    channel : ndarray of int, shape (k,)
        Frequency number of a GLONASS satellite, else 0.
    gps_week : int
        Week of the times.
    source : str
        Files of the messages.
    left_out : tuple
        Messages that were not taken, by reason, with counts.
    mended : tuple
        Fields that do not stand as they must and were read all the same, by kind, with counts.
    """

    satellite: NDArray[np.str_]
    table: Array
    channel: NDArray[np.int64]
    gps_week: int
    source: str = ""
    left_out: tuple[tuple[str, int], ...] = ()
    mended: tuple[tuple[str, int], ...] = ()

    def of_week(self, gps_week: int) -> "Navigation":
        """Return the same messages with their times in seconds of another GPS week."""
        table = self.table.copy()
        table[:, [TOE, TOC]] += (self.gps_week - gps_week) * WEEK_S
        return replace(self, table=table, gps_week=gps_week)

    def channels(self) -> dict[str, int]:
        """Return the frequency number of each GLONASS satellite, of its last message."""
        glonass = self.table[:, KIND] == GLONASS
        return {
            str(code): int(k)
            for code, k in zip(self.satellite[glonass], self.channel[glonass], strict=True)
        }


@dataclass(frozen=True)
class _Message:
    satellite: str
    toc: datetime
    values: list[float]
    line: int


def read_navigation(paths: Source | Iterable[Source]) -> Navigation:
    """Read the messages of one or several navigation files of RINEX 2, 3 or 4.

    Raises
    ------
    InputError
        With file and line for a file that is no navigation file, is cut short, or holds an
        impossible element.
    """
    paths = [paths] if isinstance(paths, str | Path) else list(paths)
    left_out, mended = Counter[str](), Counter[str]()
    rows: list[tuple[str, Array, int]] = []
    week = None
    for path in paths:
        text = _NavigationText.of(path)
        left_out.update(text.left_out)
        mended.update(text.mended)
        for message in text.messages:
            system = message.satellite[0]
            if system in SYSTEMS_LEFT_OUT:
                left_out[SYSTEMS_LEFT_OUT[system]] += 1
                continue
            _check_words(path, message)
            if not _is_healthy(message):
                left_out["unhealthy"] += 1
            else:
                week = gps_from_calendar(message.toc, "gpst")[0] if week is None else week
                channel = int(message.values[CHANNEL]) if system == "R" else 0
                rows.append((message.satellite, _table_row(path, message, week), channel))
    source = " ".join(str(path) for path in paths)
    if week is None:
        raise InputError(
            f"{source or 'navigation'}: no message of a healthy satellite (GPS, Galileo, GLONASS,"
            " BeiDou, QZSS); give the broadcast ephemerides of the day"
        )
    rows.sort(key=lambda row: row[1][TOE])
    satellite, table, channels = (np.array(column) for column in zip(*rows, strict=True))
    counts = (tuple(sorted(count.items())) for count in (left_out, mended))
    return Navigation(satellite, table, channels, week, source, *counts)


def navigation_bytes(path: Source) -> bytes:
    """Return a navigation file as the engine reads it: unpacked, RINEX 4 and what is no RINEX as
    RINEX 3.04, odd fields as they are read.
    """
    text = _NavigationText.of(path)
    body = [line for line in text.lines[text.start :] if line.strip()]
    return "".join(f"{line}\n" for line in (*text.lines[: text.start], *body)).encode("latin-1")


FIELD, STAMP_WIDTH = 19, 20  # characters of a number (D19.12) and of the stamp before the first
BYTE = 256.0  # that a channel of GLONASS is too large by where its 8 bits are read without sign


@dataclass(frozen=True)
class _NavigationText:
    """Lines of a file of RINEX 2 or 3, or of one of other form that was brought into it.

    Those of `messages` begin a message, `system` is that of RINEX 2, `left_out` and `mended` count
    what was not taken and what was read though it does not stand as it must.
    """

    path: Source
    lines: list[str]
    version: float
    system: str
    start: int
    left_out: Counter[str]
    mended: Counter[str]
    messages: list[_Message] = field(default_factory=list)

    @classmethod
    def of(cls, path: Source) -> "_NavigationText":
        """Read the file and its messages."""
        left_out = Counter[str]()
        mended = Counter[str]()
        content = _read_text(path)
        lines = lines_of(content)
        if SP3.match(content):
            fitted, left_out = messages_of_sp3(path, content)
            lines = [*fitted]
            mended[FITTED] = sum(line[:1] != " " for line in fitted)
        version, system, start = _read_header(path, lines)
        if version >= 4.0:
            lines, left_out = as_rinex_3(path, lines, start)
        text = cls(path, lines, version, system, start, left_out, mended)
        text.messages.extend(text.parsed())
        return text

    def parsed(self) -> Iterator[_Message]:
        """Give the messages, and write what is mended into the lines."""
        path, lines, version = self.path, self.lines, self.version
        starts = [i for i in range(self.start, len(lines)) if lines[i][:3].strip()]
        for torn in [i for i in starts[1:-1] if len(lines[i].rstrip()) < SHORTEST]:
            starts.remove(torn)
            lines[torn] = ""
            self.mended["pieces of a line"] += 1
        for row, stop in pairwise([*starts, len(lines)]):
            line = lines[row]
            system, number = (line[0], line[1:3]) if version >= 3.0 else (self.system, line[:2])
            satellite = system + number.replace(" ", "0")
            is_known = system in (*LINES, *SYSTEMS_LEFT_OUT) and satellite[1:].isdigit()
            if not is_known or not satellite.isascii():
                message = f"{line[:8]!r} begins no message of a known satellite"
                raise InputError.at_line(path, row + 1, f"{message}; is the file damaged?")
            if system in SYSTEMS_LEFT_OUT:
                yield _Message(satellite, datetime.min, [], row + 1)
                continue
            needed = LINES[system]
            if stop - row < needed:
                message = (
                    f"message of {satellite} has {stop - row} lines of {needed}; the file is cut"
                    " short or damaged, fetch it again"
                )
                raise InputError.at_line(path, row + 1, message)
            width = _prefix_width(version)
            fields = [line[width + FIELD * k : width + FIELD * (k + 1)] for k in range(3)]
            for continuation in lines[row + 1 : row + needed]:
                fields += [
                    continuation[width + FIELD * (k - 1) : width + FIELD * k] for k in range(4)
                ]
            values = [self.number(row, k, field, satellite) for k, field in enumerate(fields)]
            toc = _calendar_date(path, row + 1, line[width - STAMP_WIDTH : width])
            yield _Message(satellite, toc, values, row + 1)

    def number(self, start: int, k: int, field: str, satellite: str) -> float:
        """Return number k of a satellite's message that begins at line `start` (from 0).

        A spare one that is no number is left out, and a channel of GLONASS of 8 bits without sign
        gets its own.
        """
        row = start + (k + 1) // 4
        column = _prefix_width(self.version) + FIELD * ((k + 1) % 4 - 1)
        end = column + FIELD
        mended = ""
        if k in SPARE.get(satellite[0], ()) and field.strip() and _value(field) is None:
            self.mended["spare fields that are no number"] += 1
            mended = " " * FIELD
        elif (satellite[0], k) == ("R", CHANNEL):
            channel = _value(field)
            if channel is not None and BYTE + CHANNEL_RANGE[0] <= channel < BYTE:
                self.mended["channels of GLONASS that are written as channel + 256"] += 1
                mended = f"{channel - BYTE:19.12E}"
        if mended:
            line = f"{self.lines[row]:{end}}"
            self.lines[row] = line[:column] + mended + line[end:]
        return _number(self.path, start, k, mended or field)


def _prefix_width(version: float) -> int:
    """Return the characters before the first number of a message: satellite and stamp."""
    return 23 if version >= 3.0 else 22


def _read_text(path: Source) -> str:
    """Return the text of a navigation file, unpacked; InputError where it cannot be read."""
    try:
        return unpack(path, read_bytes(path)).decode("latin-1")
    except FileNotFoundError:
        problem = "no such file; check the path of the navigation file"
        raise InputError.in_file(path, problem) from None
    except OSError as error:
        raise InputError.unread(path, error) from None


def _read_header(path: Source, lines: list[str]) -> tuple[float, str, int]:
    """Return version, system of a RINEX 2 file, and the index of the line after the header."""
    first = lines[0] if lines else ""
    if first[60:80].strip() != "RINEX VERSION / TYPE" or first[20:21] not in "NGH":
        message = "no RINEX navigation file (RINEX VERSION / TYPE with N or G), nor SP3"
        raise InputError.at_line(
            path, 1, f"{message}; were rover, base and navigation files exchanged?"
        )
    version = _number(path, 0, 0, first[:9].strip())
    if not 2.0 <= version < 5.0:
        message = f"RINEX {version:.2f}; 2, 3 and 4 are read, convert it to 3.04"
        raise InputError.at_line(path, 1, message)
    if version < 3.0 and first[20] == "H":
        message = "messages of SBAS satellites alone; give GPS or GLONASS messages"
        raise InputError.at_line(path, 1, message)
    end = next((i for i, line in enumerate(lines) if line[60:80].strip() == "END OF HEADER"), None)
    if end is None:
        message = "the header has no end; the file is cut short, fetch it again"
        raise InputError.at_line(path, len(lines), message)
    return version, "R" if first[20] == "G" else "G", end + 1


def _number(path: Source, begin: int, k: int, field: str) -> float:
    """Return number k of the message that begins at line `begin` (from 0).

    A blank one, which only a spare field may be, is not-a-number.
    """
    if not field.strip():
        return math.nan
    value = _value(field)
    if value is not None:
        return value
    message = f"{quote(field)} is no number; is the file damaged?"
    raise InputError.at_line(path, begin + 1 + (k + 1) // 4, message)


def _value(field: str) -> float | None:
    """Return a number with an exponent of Fortran or of C, None for what is none."""
    return float_of(field.strip().replace("D", "E").replace("d", "e"))


def _calendar_date(path: Source, line: int, field: str) -> datetime:
    """Return the date of year, month, day, hour, minute, second.

    Two digits of the year from 80 on are of the last century.
    """
    try:
        if not EPOCH_STAMP.fullmatch(field):
            raise ValueError
        year, month, day, hour, minute = (int(number) for number in field.split()[:5])
        second = float(field.split()[5])
        year += 0 if year > 99 else 1900 if year >= 80 else 2000
        if hour > 24 or minute > 60 or second > 61.0:
            raise ValueError
        return datetime(year, month, day) + timedelta(hours=hour, minutes=minute, seconds=second)
    except ValueError:
        problem = f"{quote(field.strip())} is no date and time of a clock; is the file damaged?"
        raise InputError.at_line(path, line, problem) from None


def _check_words(path: Source, message: _Message) -> None:
    """Raise InputError where a word of bits or a number of a channel is none that there can be."""
    for number, word, low, high in CHECKED_ORBIT.get(message.satellite[0], ()):
        value = message.values[number]
        if not (low <= value <= high and value == int(value)):
            line = message.line + (number + 1) // 4
            shown_value = "blank" if math.isnan(value) else f"{value:g}"
            problem = f"message of {message.satellite}: {word} is {shown_value}"
            problem += f"; a whole number from {low} to {high} is expected, fetch the file again"
            raise InputError.at_line(path, line, f"{problem} or delete the message")


def _is_healthy(message: _Message) -> bool:
    """Return whether a message says that its satellite is healthy."""
    system = message.satellite[0]
    values = message.values
    if system == "R":
        return values[6] == 0.0
    if system == "E":
        return not int(values[HEALTH]) & GALILEO_UNHEALTHY[bool(int(values[SOURCE]) & F_NAV)]
    return values[HEALTH] == 0.0


def _table_row(path: Source, message: _Message, week: int) -> Array:
    """Return the message as a row of the table (values,), its times in s of `week`."""
    system = message.satellite[0]
    values = message.values
    row = np.zeros(MESSAGE_VALUES)
    toc_week, toc = gps_from_calendar(message.toc, "utc" if system == "R" else "gpst")
    if system == "R":
        row[KIND] = GLONASS
        row[AF0], row[AF1] = values[:2]
        kilometres = [values[3 + 4 * axis + order] for order in range(3) for axis in range(3)]
        row[STATE : STATE + 9] = 1e3 * np.array(kilometres)
        row[TOC] = row[TOE] = toc + (toc_week - week) * WEEK_S
    else:
        row[[*ORBIT_PLACES]] = [values[column] for column in ORBIT_PLACES.values()]
        row[KIND] = GEOSTATIONARY if is_geostationary(message.satellite) else KEPLER
        row[MU], row[RATE] = CONSTANTS[system]
        since = (row[SOW] - toc + 0.5 * WEEK_S) % WEEK_S - 0.5 * WEEK_S
        lag = BEIDOU_LAG_S if system == "C" else 0.0
        row[TOC] = toc + (toc_week - week) * WEEK_S + lag
        row[TOE] = row[TOC] + since
    _check_orbit(path, message, row)
    return row


def _check_orbit(path: Source, message: _Message, row: Array) -> None:
    """Raise InputError where an element is missing or out of all bounds."""
    satellite = message.satellite
    if not np.isfinite(row).all():
        problem = (
            f"navigation message of {satellite} lacks a value; the file is damaged, fetch it again"
        )
        raise InputError.at_line(path, message.line, problem)
    if satellite[0] == "R":
        size = float(np.linalg.norm(row[STATE : STATE + 3]))
        low, high = GLONASS_RADIUS_M
        quantity = "distance from the Earth's centre, m"
    else:
        size = float(row[ROOT_A])
        low, high = ROOT_A_LIMITS
        quantity = "root of the semi-major axis, m^1/2"
    eccentric = satellite[0] != "R" and not 0.0 <= row[ECC] < MOST_ECCENTRICITY
    if not low < size < high or eccentric:
        problem = f"{quantity}, {size:g} (eccentricity {row[ECC]:g}) is no orbit"
        raise InputError.at_line(path, message.line, f"message of {satellite}: {problem}")
