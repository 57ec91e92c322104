"""Writing of RINEX 2.11.

Observations with external events, and the navigation of GPS (`.n`) and of GLONASS (`.g`).

Columns are those of the format's tables A1 and A2 (observations), A3 and A4 (GPS), A10 and A11
(GLONASS); RINEX 2.11 of 2012:

    epoch          1X,I2.2,4(1X,I2),F11.7,2X,I1,I3,12(A1,I2), continued in column 33 for each
                   further twelve satellites
    observations   m(F14.3,I1,I1), five a line: number, loss of lock, C/N0 indicator; blank where
                   missing
    GPS            I2,1X,I2.2,4(1X,I2),F5.1,3D19.12, and seven lines of 3X,4D19.12
    GLONASS        the same with the epoch in UTC, and three lines of 3X,4D19.12, in km

An external event (flag 5) stands before the first epoch that is not earlier, in the time of the
observations' stamps. The C/N0 indicator of a phase is that of its band's S, dB-Hz, in the steps of
RINEX 3: min(max(int(S / 6), 1), 9). A number of 0.000 reads as missing, by the format's own rule.
Numbers become digits some epochs at a time, so that memory does not grow with the file.
"""

import os
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from datetime import datetime, timedelta

import numpy as np
from numpy.typing import NDArray

from ...base.advance import through
from ...base.errors import UsageError
from ...base.files import atomic_write
from ...geodesy.gpstime import GPS_EPOCH, WEEK_S, calendar_from_gps, leap_seconds
from ...gnss.rinex.navigation_message import (
    AF0,
    AF1,
    ORBIT_PLACES,
    SOW,
    STATE,
    TOC,
    TOE,
    Navigation,
)

Array = NDArray[np.float64]
File = str | os.PathLike[str]

RINEX_211 = "2.11"
# of an observation; observations a line; satellites a line of the epoch
OBSERVATION_COLUMNS, PER_LINE, NAMES_PER_LINE = 16, 5, 12
LARGEST_MILLI, SMALLEST_MILLI = 9_999_999_999_999, -999_999_999_999  # thousandths that F14.3 holds
TICKS_PER_S, WHOLE_DAY_S = 10_000_000, 86400  # resolution of the stamps
URA_M, FIT_INTERVAL_H = 2.0, 4.0  # accuracy and validity that the messages claim
_CHUNK = 256  # epochs formatted at once
_EPOCH_DAY = np.datetime64(GPS_EPOCH.date(), "D")


@dataclass(frozen=True, eq=False)
class ObservationTable:
    """What a receiver observed in n epochs.

    It has m rows, one for each satellite of an epoch, of k observations.

    Parameters
    ----------
    time : (n,) s, GPST of `gps_week` by the receiver's clock, increasing.
    epoch : (m,) place in `time`, not decreasing.
    satellite : (m,) such as "G05".
    types : (k) names of RINEX 2, such as "L1".
    values : (m, k) m, cycles, Hz, dB-Hz; NaN: missing.
    loss_of_lock : (m, k) 0 to 7.
    events : (e,) s as `time`, not decreasing, of external events.
    event_records : lines of at most 60 characters for each event, written as comments behind it; ()
        for none at all.
    """

    gps_week: int
    time: Array
    epoch: NDArray[np.int64]
    satellite: NDArray[np.str_]
    types: tuple[str, ...]
    values: Array
    loss_of_lock: NDArray[np.int8]
    events: Array = field(default_factory=lambda: np.empty(0))
    event_records: tuple[tuple[str, ...], ...] = ()

    def __post_init__(self) -> None:
        m, k = self.epoch.size, len(self.types)
        if not (
            self.satellite.shape == (m,) and self.values.shape == self.loss_of_lock.shape == (m, k)
        ):
            shapes = f"{self.satellite.shape}, {self.values.shape} and {self.loss_of_lock.shape}"
            raise UsageError(
                f"observations: satellites, values and loss of lock of shapes {shapes}; expected"
                f" ({m},), ({m}, {k}) twice"
            )
        if (
            self.time.size == 0
            or (np.diff(_ticks(self.time)) <= 0).any()
            or (np.diff(self.events) < 0).any()
        ):
            raise UsageError(
                "observations: no epoch, or times of epochs or events that fall; put them in order"
            )
        if m and (
            (np.diff(self.epoch) < 0).any()
            or not 0 <= self.epoch[0] <= self.epoch[-1] < self.time.size
        ):
            raise UsageError(
                f"observations: rows must follow their epochs, 0 to {self.time.size - 1}"
            )
        if self.event_records and len(self.event_records) != self.events.size:
            raise UsageError(
                f"observations: records of {len(self.event_records)} events, but there are"
                f" {self.events.size}"
            )


@dataclass(frozen=True)
class Station:
    """What a header says of a receiver.

    Parameters
    ----------
    position_m : (3) m ECEF of the antenna, approximate or known; the antenna has no offsets.
    """

    marker: str
    position_m: tuple[float, ...]
    receiver: str = "simulated"
    interval_s: float | None = None


def write_observations(path: File, station: Station, table: ObservationTable) -> None:
    """Write a RINEX 2.11 observation file; whole or not at all.

    Raises
    ------
    UsageError
        Where it cannot be written, or a number is beyond its 14 columns (add or take off whole
        cycles from a phase).
    """
    atomic_write(path, _observation_lines(path, station, table))


def _observation_lines(path: File, station: Station, table: ObservationTable) -> Iterator[bytes]:
    yield _observation_header(station, table).encode("ascii")
    n = table.time.size
    rows = np.searchsorted(table.epoch, np.arange(n + 1))
    heads = [stamp.encode("ascii") for stamp in _stamps(table.gps_week, table.time)]
    events = _event_records(table)
    # the epoch that an event stands before
    behind = np.searchsorted(_ticks(table.time), _ticks(table.events))
    first_event = np.searchsorted(behind, np.arange(n + 2))
    for first in through(range(0, n, _CHUNK)):
        last = min(first + _CHUNK, n)
        chunk = slice(rows[first], rows[last])
        body = _rows(path, table, chunk)
        names = np.ascontiguousarray(table.satellite[chunk], dtype="S3")
        parts: list[bytes] = []
        for k in range(first, last):
            parts += events[first_event[k] : first_event[k + 1]]
            span = slice(rows[k] - rows[first], rows[k + 1] - rows[first])
            parts += [_epoch_lines(heads[k], names[span].tobytes()), body[span].tobytes()]
        yield b"".join(parts)
    yield b"".join(events[first_event[n] :])


def _observation_header(station: Station, table: ObservationTable) -> str:
    first = calendar_from_gps(table.gps_week, 0.0, "gpst") + timedelta(
        microseconds=int(_ticks(table.time[:1])[0]) // 10
    )
    seconds = (int(_ticks(table.time[:1])[0]) % (60 * TICKS_PER_S)) / TICKS_PER_S
    systems = set(table.satellite.astype("U1").tolist())
    kind = "M (MIXED)" if len(systems) != 1 else systems.pop()
    groups = [table.types[k : k + 9] for k in range(0, len(table.types), 9)]
    counts = [f"{len(table.types):6d}", *[" " * 6] * (len(groups) - 1)]
    lines = [
        _record(f"{RINEX_211:>9}{'':11}{'OBSERVATION DATA':<20}{kind:<20}", "RINEX VERSION / TYPE"),
        _program(first),
        _record(station.marker, "MARKER NAME"),
        _record(f"{'insgnss':<20}simulation", "OBSERVER / AGENCY"),
        _record(f"{'0':<20}{station.receiver:<20}", "REC # / TYPE / VERS"),
        _record(f"{'0':<20}NONE", "ANT # / TYPE"),
        _record("".join(f"{x:14.4f}" for x in station.position_m), "APPROX POSITION XYZ"),
        _record(f"{0.0:14.4f}" * 3, "ANTENNA: DELTA H/E/N"),
        _record(f"{1:6d}{1:6d}", "WAVELENGTH FACT L1/2"),
        *(
            _record(n + "".join(f"{t:>6}" for t in group), "# / TYPES OF OBSERV")
            for n, group in zip(counts, groups, strict=True)
        ),
        *(
            []
            if station.interval_s is None
            else [_record(f"{station.interval_s:10.3f}", "INTERVAL")]
        ),
        _record(
            f"{first.year:6d}{first.month:6d}{first.day:6d}{first.hour:6d}{first.minute:6d}"
            f"{seconds:13.7f}{'':5}GPS",
            "TIME OF FIRST OBS",
        ),
        _record(f"{_leap(first):6d}", "LEAP SECONDS"),
        _record("", "END OF HEADER"),
    ]
    return "".join(lines)


def _record(text: str, label: str) -> str:
    return f"{text:<60.60}{label:<20}\n"


def _program(when: datetime) -> str:
    """The record of the program.

    The file is dated by its content, so that the same content is the same file.
    """
    month = ("JAN", "FEB", "MAR", "APR", "MAY", "JUN", "JUL", "AUG", "SEP", "OCT", "NOV", "DEC")[
        when.month - 1
    ]
    date = f"{when.day:02d}-{month}-{when.year % 100:02d} {when.hour:02d}:{when.minute:02d}"
    return _record(f"{'insgnss simulate':<20}{'simulation':<20}{date:<20}", "PGM / RUN BY / DATE")


def _leap(gpst: datetime) -> int:
    """GPST - UTC, s, at a date without time zone."""
    return int(leap_seconds(gpst.replace(tzinfo=GPS_EPOCH.tzinfo).timestamp()))


def _ticks(time: Array) -> NDArray[np.int64]:
    return np.rint(np.asarray(time) * TICKS_PER_S).astype(np.int64)


def _stamps(gps_week: int, time: Array) -> list[str]:
    """Columns 1 to 26 of the line of an epoch or event at `time` (n,), s of the week."""
    day, ticks_of_day = np.divmod(_ticks(time), WHOLE_DAY_S * TICKS_PER_S)
    date = (_EPOCH_DAY + (7 * gps_week + day)).astype(object).tolist()
    minute, second = np.divmod(ticks_of_day, 60 * TICKS_PER_S)
    return [
        f" {d.year % 100:02d} {d.month:2d} {d.day:2d} {m // 60:2d}"
        f" {m % 60:2d}{s / TICKS_PER_S:11.7f}"
        for d, m, s in zip(date, minute.tolist(), second.tolist(), strict=True)
    ]


def _epoch_lines(stamp: bytes, names: bytes) -> bytes:
    """The line of an epoch and its continuations; names : of its satellites, three letters each."""
    size = 3 * NAMES_PER_LINE
    more = [b" " * 32 + names[k : k + size] + b"\n" for k in range(size, len(names), size)]
    return b"".join([stamp, b"  0%3d" % (len(names) // 3), names[:size], b"\n", *more])


def _event_records(table: ObservationTable) -> list[bytes]:
    """The lines of each event."""
    records = table.event_records or ((),) * table.events.size
    if long := [
        text for lines in records for text in lines if len(text) > 60 or not text.isascii()
    ]:
        raise UsageError(f"event record {long[0]!r}; it has at most 60 characters, all ASCII")
    return [
        f"{stamp}  5{len(lines):3d}\n{''.join(_record(text, 'COMMENT') for text in lines)}".encode(
            "ascii"
        )
        for stamp, lines in zip(_stamps(table.gps_week, table.events), records, strict=True)
    ]


def _rows(path: File, table: ObservationTable, chunk: slice) -> NDArray[np.uint8]:
    """The lines of these rows: (m, size of a satellite's lines) letters."""
    values, k = table.values[chunk], len(table.types)
    observed = np.isfinite(values)
    number = np.rint(np.where(observed, values, 0.0) * 1e3)
    if (beyond := (number > LARGEST_MILLI) | (number < SMALLEST_MILLI)).any():
        row, column = np.argwhere(beyond)[0]
        epoch, name = table.epoch[chunk][row], table.types[column]
        entry = (
            f"{table.satellite[chunk][row]} {name} {values[row, column]:.3f} at"
            f" {table.time[epoch]:.3f} s"
        )
        raise UsageError(
            f"{path}: {entry} is beyond the 14 columns of RINEX 2.11; take whole cycles off the"
            " phases"
        )
    letters = np.full((len(values), k, OBSERVATION_COLUMNS), ord(" "), dtype=np.uint8)
    _put_numbers(letters, number.astype(np.int64))
    lock = table.loss_of_lock[chunk]
    letters[:, :, 14] = np.where(lock > 0, ord("0") + lock, ord(" "))
    for column, name in enumerate(table.types):
        band = f"S{name[1:]}"
        if name.startswith("L") and band in table.types:
            strength = values[:, table.types.index(band)] // 6.0
            digit = ord("0") + np.clip(np.nan_to_num(strength), 1, 9).astype(np.uint8)
            letters[:, column, 15] = np.where(np.isfinite(strength), digit, ord(" "))
    letters[~observed] = ord(" ")
    return _lines(letters)


def _put_numbers(letters: NDArray[np.uint8], thousandths: NDArray[np.int64]) -> None:
    """F14.3 of `thousandths` (m, k) into the first 14 of letters (m, k, 16), which are blank."""
    remaining = np.abs(thousandths)
    first = np.full(remaining.shape, 9)  # column of the first digit
    for column in (13, 12, 11, *range(9, -1, -1)):
        shown = (remaining > 0) | (column >= 9)
        first[shown & (column < 9)] = column
        remaining, digit = np.divmod(remaining, 10)
        letters[:, :, column] = np.where(shown, ord("0") + digit, ord(" "))
    letters[:, :, 10] = ord(".")
    row, k = np.nonzero(thousandths < 0)
    letters[row, k, first[row, k] - 1] = ord("-")


def _lines(letters: NDArray[np.uint8]) -> NDArray[np.uint8]:
    """Letters (m, k, 16) as lines of five observations, all lines of a row behind each other."""
    m, k, _ = letters.shape
    parts = []
    for start in range(0, k, PER_LINE):
        parts += [
            letters[:, start : start + PER_LINE].reshape(m, -1),
            np.full((m, 1), ord("\n"), dtype=np.uint8),
        ]
    return np.concatenate(parts, axis=1)


def write_navigation(gps_path: File, glonass_path: File, navigation: Navigation) -> None:
    """Write the messages of GPS and of GLONASS as RINEX 2.11 navigation files.

    Each file is written whole or not at all.

    What the table of messages does not hold is nominal: a satellite is healthy, claims 2 m, has no
    group delay and a fit interval of four hours; its issue of data follows from the time of
    ephemeris.

    Raises
    ------
    UsageError
        Where a file cannot be written.
    """
    first = calendar_from_gps(navigation.gps_week, float(navigation.table[:, TOC].min()), "gpst")
    for path, letter, label, message in (
        (gps_path, "G", "N: GPS NAV DATA", _gps_message),
        (glonass_path, "R", "G: GLONASS NAV DATA", _glonass_message),
    ):
        head = (
            _record(f"{RINEX_211:>9}{'':11}{label}", "RINEX VERSION / TYPE")
            + _program(first)
            + _record(f"{_leap(first):6d}", "LEAP SECONDS")
            + _record("", "END OF HEADER")
        )
        rows = np.flatnonzero(navigation.satellite.astype("U1") == letter)
        atomic_write(path, head + "".join(message(navigation, row) for row in rows.tolist()))


def _gps_message(navigation: Navigation, k: int) -> str:
    """Message `k` of the table, eight lines."""
    message = navigation.table[k]
    numbers = [0.0] * 28
    for column, position in ORBIT_PLACES.items():
        numbers[position] = float(message[column])
    issue = float(int(message[SOW]) // 900 % 256)
    numbers[3] = issue
    numbers[21] = navigation.gps_week + message[TOE] // WEEK_S
    numbers[23], numbers[26] = URA_M, issue
    numbers[27:] = [message[SOW] - 7200.0, FIT_INTERVAL_H]
    return _message(
        navigation.satellite[k],
        calendar_from_gps(navigation.gps_week, message[TOC], "gpst"),
        numbers,
    )


def _glonass_message(navigation: Navigation, k: int) -> str:
    """Message `k` of the table, four lines."""
    message = navigation.table[k]
    when = calendar_from_gps(navigation.gps_week, message[TOC], "utc")
    frame = (3600 * when.hour + 60 * when.minute + when.second - 900) % WHOLE_DAY_S
    state = message[STATE : STATE + 9].reshape(3, 3) * 1e-3  # position, velocity, acceleration
    numbers = [float(message[AF0]), float(message[AF1]), float(frame)]
    for axis, last in enumerate((0.0, float(navigation.channel[k]), 0.0)):
        numbers += [*state[:, axis].tolist(), last]
    return _message(navigation.satellite[k], when, numbers)


def _message(satellite: str, when: datetime, numbers: Sequence[float]) -> str:
    """Lines of a message: its clock's epoch with three numbers, then four numbers a line."""
    seconds = when.second + 1e-6 * when.microsecond
    date = (
        f"{when.year % 100:02d} {when.month:2d} {when.day:2d} {when.hour:2d}"
        f" {when.minute:2d}{seconds:5.1f}"
    )
    text = [f"{number:19.12E}".replace("E", "D") for number in numbers]
    groups = [text[:3], *(text[k : k + 4] for k in range(3, len(text), 4))]
    starts = [f"{int(satellite[1:]):2d} {date}", *["   "] * (len(groups) - 1)]
    return "".join(
        start + "".join(group) + "\n" for start, group in zip(starts, groups, strict=True)
    )
