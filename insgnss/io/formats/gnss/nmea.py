"""Receiver log of NMEA 0183: GGA, RMC, GST, VTG and ZDA of any talker, data_specs/nmea.md.

The height above the ellipsoid is GGA's height above mean sea level plus its geoid separation. Time
of day and date are UTC; what stands before the receiver knew the date, a year and more before the
last one, is left out; an epoch's day counts on where the time of day falls back by more than half
a day. Speed s over ground and course c, of RMC or of a VTG that follows its epoch, give the
horizontal velocity, vn = s cos c, ve = s sin c, where the caller gives a standard deviation for it:
NMEA has none. The vertical velocity, and the horizontal one of an epoch without a course, is
unknown (`UNKNOWN_MPS`).
"""

import re
from collections.abc import Sequence
from dataclasses import dataclass, field
from datetime import UTC, datetime
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from ....base.errors import InputError
from ....geodesy.gpstime import DAY_S, WEEK_S, gps_from_unix_utc
from ....records import Array, Finding, GnssFixes
from ....records.observations import UNKNOWN_MPS
from ..read_options import STATED_NOTHING, ReadOptions
from ..text.clock import agree_on_week, undated_rows
from ..text.layout import quote
from ..text.order import note
from ..text.sentences import BAD_SHARE_LIMIT, SentenceLines, Sentences, read_sentences
from ..text.text import FileLine, Source
from ..text.units import DEG
from .fixes import ASSUMED, FIX_SIGMAS, NMEA_QUALITY, FixScales, fixes_from_columns

Epoch = tuple[int, float]

CORRECT = "correct or delete the sentence"
KNOT = 1852.0 / 3600.0  # m/s: an international nautical mile an hour
LEAST_SENTENCE_FIELDS = {"GGA": 10, "RMC": 10, "GST": 9, "VTG": 6, "ZDA": 5, "GSA": 16}
SENTENCE_KINDS = tuple(kind.encode() for kind in LEAST_SENTENCE_FIELDS)
OF_HEADING = (b"HDT", b"THS")  # true headings of two antennas, at the time of the GGA before
# s: receivers that do not know the date say 1980-01-06 or that of a week's rollover, years ago
LEAST_UNDATED_S = 365.0 * DAY_S
NMEA_CLOCK = re.compile(r"[0-9]{6}(?:\.[0-9]*)?")  # hhmmss.ss
NMEA_DATE = re.compile(r"[0-9]{6}(?:[0-9]{2})?")  # ddmmyy, of ZDA ddmmyyyy


class _GgaFix(NamedTuple):
    """A GGA with a fix: degrees, metres above the ellipsoid, age of the corrections, s.

    What it does not say of the solution is not-a-number.
    """

    epoch: Epoch
    line: int
    lat: float
    lon: float
    h: float
    q: int
    satellites: float
    hdop: float
    age_s: float


class _Heading(NamedTuple):
    """A true heading, deg."""

    epoch: Epoch
    line: int
    heading: float


@dataclass(frozen=True)
class _Log:
    """What the sentences say, by epoch (days since the first, time of day).

    Attributes
    ----------
    fixes, headings
        In the order of the file.
    pdop
        Of the last GSA behind an epoch's GGA or RMC.
    sigma
        Standard deviations.
    track
        Speed and course.
    dates
        Lines and dates.
    void
        Lines of the epochs without fix.
    undated
        Lines of the fixes before the receiver knew the date, which are left out of `fixes`.
    """

    fixes: list[_GgaFix] = field(default_factory=list)
    pdop: dict[Epoch, float] = field(default_factory=dict)
    sigma: dict[Epoch, tuple[float, ...]] = field(default_factory=dict)
    track: dict[Epoch, tuple[float, float]] = field(default_factory=dict)
    dates: dict[Epoch, tuple[int, datetime]] = field(default_factory=dict)
    void: list[int] = field(default_factory=list)
    headings: list[_Heading] = field(default_factory=list)
    undated: list[int] = field(default_factory=list)

    def leave_undated_out(self) -> None:
        """Leave out what stands before the date was known: dates a year before the last one."""
        dates = list(self.dates.items())
        days = [midnight.timestamp() - DAY_S * day for (day, _), (_, midnight) in dates]
        early = [day < days[-1] - LEAST_UNDATED_S for day in days]
        if not any(early):
            return
        first = early.index(False)
        first_epoch, (first_line, _) = dates[first]
        for epoch, _ in dates[:first]:
            del self.dates[epoch]

        def is_dated(row: _GgaFix | _Heading) -> bool:
            return row.line > first_line or row.epoch == first_epoch

        self.undated.extend(row.line for row in self.fixes if not is_dated(row))
        self.fixes[:] = filter(is_dated, self.fixes)
        self.headings[:] = filter(is_dated, self.headings)


def read_nmea(path: Source, options: ReadOptions = STATED_NOTHING) -> GnssFixes:
    """Read fixes in GPST.

    The notes count what was left out: lines without a right checksum (at most 1 %), epochs without
    fix, epochs without standard deviations (at most 1 %); and sentences of a kind whose checksums
    are all wrong, which are taken.

    Parameters
    ----------
    path : path
        The log.
    options : ReadOptions
        `sigma_m` of epochs without GST, which are left out without it; `sigma_velocity`, which
        takes the velocity of RMC or VTG; `undulation_m` of a GGA without geoid separation.

    Returns
    -------
    GnssFixes
        The fixes.

    Raises
    ------
    InputError
        What cannot be read, with file and line.
    """
    sentences = read_sentences(path)
    log, sigma_m = _collect(sentences, options.undulation_m), options.sigma_m
    if not log.fixes:
        raise InputError.in_file(
            path, f"no GGA sentence with a fix ({len(log.void)} without); is it the rover's log?"
        )
    day = _first_day(path, log)
    missing = [row for row in log.fixes if row.epoch not in log.sigma]
    if missing and sigma_m is None and len(missing) > BAD_SHARE_LIMIT * len(log.fixes):
        message = (
            f"{len(missing)} of {len(log.fixes)} fixes have no GST sentence of their time; set"
            " sigma_m = [north, east, down]"
        )
        raise InputError.at_line(path, missing[0].line, message)
    stand_in = None if sigma_m is None else tuple(np.asarray(sigma_m, dtype=np.float64).tolist())
    fixes = [row for row in log.fixes if stand_in is not None or row.epoch in log.sigma]
    lines = SentenceLines(str(path), [row.line for row in fixes])
    week, time = _gps_time(day, fixes)
    agree_on_week(lines, week, options.gps_week)
    spread = np.array([log.sigma.get(row.epoch, stand_in) for row in fixes])
    table = np.array([row[2:] for row in fixes])
    cols = {"tow": time, **dict(zip(_GgaFix._fields[2:], table.T, strict=True))}
    cols |= dict(zip(FIX_SIGMAS, spread.T, strict=True))
    cols[ASSUMED] = np.array([row.epoch not in log.sigma for row in fixes], dtype=np.float64)
    cols["pdop"] = np.array([log.pdop.get(row.epoch, np.nan) for row in fixes])
    notes = _left_out(sentences.n_bad, len(log.void), len(log.fixes) - len(fixes), len(log.fixes))
    notes += sentences.notes("GNSS rows")
    if log.undated:
        notes += (undated_rows("GNSS rows", len(log.undated), f"line {log.fixes[0].line}"),)
    if sentences.unchecked:
        taken_so = ", ".join(f"{count} {kind}" for kind, count in sentences.unchecked.items())
        finding = f"all checksums of {taken_so} are wrong, of other kinds right; these were used"
        advice = "a program changed these sentences, not their checksums; check their dates"
        notes += (note("GNSS checksums", finding, "right checksums", advice),)
    if options.sigma_velocity is not None and log.track:
        cols |= _velocity(fixes, log, options.sigma_velocity)
        if without := sum(row.epoch not in log.track for row in fixes):
            finding = f"{without} of {len(fixes)} epochs without a course"
            notes += (note("GNSS rows", finding, "speed and course", "their velocity is not used"),)
    scales, of_the_log = FixScales(angle=DEG), ReadOptions(gps_week=week)
    return fixes_from_columns(cols, lines, scales, of_the_log, notes=notes)


def read_headings(path: Source) -> tuple[int, Array, Array, SentenceLines]:
    """Read the true headings of HDT or THS, each at the time of the GGA, RMC or ZDA before it.

    Parameters
    ----------
    path : path
        The log.

    Returns
    -------
    tuple of int, ndarray, ndarray and SentenceLines
        GPS week, seconds of it (GPST), headings, deg, and their lines.

    Raises
    ------
    InputError
        What cannot be read, with file and line; a log without such a sentence or without a date.
    """
    log = _collect(read_sentences(path), 0.0, (*SENTENCE_KINDS, *OF_HEADING))
    if not log.headings:
        advice = "let the receiver write HDT or THS beside GGA and RMC"
        raise InputError.in_file(path, f"no HDT or THS sentence with a heading; {advice}")
    week, time = _gps_time(_first_day(path, log), log.headings)
    lines = SentenceLines(str(path), [row.line for row in log.headings])
    return week, time, np.array([row.heading for row in log.headings]), lines


def _gps_time(first_day: float, rows: Sequence[_GgaFix | _Heading]) -> tuple[int, Array]:
    """Return GPS week and seconds of it of rows whose epochs count from a midnight, Unix time."""
    days, tod = np.array([row.epoch for row in rows]).T
    week, midnight = gps_from_unix_utc(first_day + DAY_S * days)
    time = midnight + tod
    # midnight UTC lies in the week before, in the leap seconds before the week's end
    over = int(time[0] // WEEK_S)
    return week + over, time - over * WEEK_S


def _velocity(fixes: list[_GgaFix], log: _Log, sigma_velocity: ArrayLike) -> dict[str, Array]:
    """Return columns of velocity and its standard deviations.

    Those of an epoch without a track are `UNKNOWN_MPS`.
    """
    track = np.array([log.track.get(row.epoch, (np.nan, np.nan)) for row in fixes])
    speed, course = track[:, 0] * KNOT, np.radians(track[:, 1])
    has_track = np.isfinite(speed)
    north, east, _ = np.broadcast_to(np.asarray(sigma_velocity, dtype=np.float64), 3).tolist()
    zero = np.zeros(speed.size)
    cols = {
        "vn": np.where(has_track, speed * np.cos(course), 0.0),
        "ve": np.where(has_track, speed * np.sin(course), 0.0),
        "vd": zero,
    }
    return cols | {
        "sd_vn": np.where(has_track, north, UNKNOWN_MPS),
        "sd_ve": np.where(has_track, east, UNKNOWN_MPS),
        "sd_vd": zero + UNKNOWN_MPS,
    }


def _collect(
    sentences: Sentences, undulation_m: float | None, kinds: tuple[bytes, ...] = SENTENCE_KINDS
) -> _Log:
    log, days, before, epoch = _Log(), 0, 0.0, None
    for line, fields in sentences.fields(*kinds):
        kind = fields[0][2:5]
        if kind.encode() in OF_HEADING:
            valid = len(fields) > 2 and fields[1] and fields[2] != "V"
            if epoch is not None and valid:
                log.headings.append(_Heading(epoch, line.number, line.value(fields[1])))
            continue
        if len(fields) < LEAST_SENTENCE_FIELDS[kind]:
            message = f"{kind} of {len(fields)} fields; {LEAST_SENTENCE_FIELDS[kind]} are needed"
            raise line.error(f"{message}; {CORRECT}")
        if kind == "GSA":
            if epoch is not None:
                log.pdop[epoch] = _optional(fields[15], line)
            continue
        if kind == "VTG":
            if epoch is not None and epoch not in log.track and fields[1] and fields[5]:
                log.track[epoch] = line.value(fields[5]), line.value(fields[1])
            continue
        if not fields[1]:
            continue
        tod = _time_of_day(fields[1], line)
        days += tod < before - 0.5 * DAY_S
        before, epoch = tod, (days, tod)
        if kind == "RMC" and fields[2] not in ("", "V"):  # A, or D of a differential fix
            if fields[9]:
                log.dates[epoch] = (line.number, _date(fields[9], line))
            if fields[7] and fields[8]:
                log.track[epoch] = line.value(fields[7]), line.value(fields[8])
        elif kind == "ZDA" and all(fields[2:5]):
            date = f"{fields[2]:0>2}{fields[3]:0>2}{fields[4]}"
            log.dates[epoch] = (line.number, _date(date, line))
        elif kind == "GST" and all(fields[6:9]):
            log.sigma[epoch] = tuple(map(line.value, fields[6:9]))
        elif kind == "GGA" and fields[6] in ("", "0"):
            log.void.append(line.number)
        elif kind == "GGA":
            log.fixes.append(_fix(epoch, fields, line, undulation_m))
    log.leave_undated_out()
    return log


def _optional(text: str, line: FileLine) -> float:
    """Return a number that may be absent: not-a-number for an empty field."""
    return line.value(text) if text else float("nan")


def _fix(epoch: Epoch, fields: list[str], line: FileLine, undulation_m: float | None) -> _GgaFix:
    separation = fields[11] if len(fields) > 11 else ""
    if not separation and undulation_m is None:
        raise line.error(
            "GGA without geoid separation; the height above the ellipsoid is not known; let the"
            " receiver write the geoid separation, or set undulation_m"
        )
    lat = _degrees(fields[2], fields[3], "NS", line)
    lon = _degrees(fields[4], fields[5], "EW", line)
    above = line.value(separation) if separation else float(undulation_m or 0.0)
    code = line.value(fields[6])
    if code not in NMEA_QUALITY:
        message = f"quality {quote(fields[6])} of GGA is none of 0 to {max(NMEA_QUALITY)}"
        raise line.error(f"{message}; {CORRECT}")
    height, quality = line.value(fields[9]) + above, NMEA_QUALITY[int(code)]
    described = (fields[7], fields[8], fields[13] if len(fields) > 13 else "")
    satellites, hdop, age = (_optional(text, line) for text in described)
    return _GgaFix(
        epoch=epoch,
        line=line.number,
        lat=lat,
        lon=lon,
        h=height,
        q=quality,
        satellites=satellites,
        hdop=hdop,
        age_s=age,
    )


def _degrees(field: str, side: str, sides: str, line: FileLine) -> float:
    """Return the degrees of dddmm.mmmm and its hemisphere."""
    minutes = line.value(field)
    if side not in tuple(sides):
        problem = f"hemisphere {quote(side)} is neither {sides[0]} nor {sides[1]}"
        raise line.error(f"{problem}; {CORRECT}")
    whole = minutes // 100.0
    if minutes < 0.0 or minutes - 100.0 * whole >= 60.0:
        raise line.error(f"angle {quote(field)} is not dddmm.mmmm; {CORRECT}")
    value = whole + (minutes - 100.0 * whole) / 60.0
    return value if side == sides[0] else -value


def _time_of_day(field: str, line: FileLine) -> float:
    is_clock = NMEA_CLOCK.fullmatch(field) is not None
    hour, minute, second = (
        map(float, (field[:2], field[2:4], field[4:])) if is_clock else [np.inf] * 3
    )
    if hour > 23.0 or minute > 59.0 or second >= 61.0:
        raise line.error(f"time {quote(field)} is not hhmmss; {CORRECT}")
    return hour * 3600.0 + minute * 60.0 + second


def _date(text: str, line: FileLine) -> datetime:
    """Midnight of ddmmyy or ddmmyyyy."""
    try:
        if not NMEA_DATE.fullmatch(text):
            raise ValueError
        year = int(text[4:])
        full = year if len(text) == 8 else year + (2000 if year < 80 else 1900)
        return datetime(full, int(text[2:4]), int(text[:2]), tzinfo=UTC)
    except ValueError:
        raise line.error(f"date {quote(text)} is not ddmmyy; {CORRECT}") from None


def _first_day(path: Source, log: _Log) -> float:
    """Return the Unix time of the midnight before the first epoch; every date must agree on it."""
    if not log.dates:
        advice = "let the receiver write RMC beside GGA"
        raise InputError.in_file(
            path, f"no RMC or ZDA sentence, so the date is not known; {advice}"
        )
    first_days = []
    for (days, _), (line, midnight) in log.dates.items():
        first_days.append(midnight.timestamp() - DAY_S * days)
        if first_days[-1] != first_days[0]:
            problem = f"date {midnight:%d%m%y} does not follow from the dates before"
            raise InputError.at_line(path, line, f"{problem}; split the log by day")
    return first_days[0]


def _left_out(n_bad: int, n_void: int, n_without: int, n_fixes: int) -> tuple[Finding, ...]:
    if not (n_bad or n_void or n_without):
        return ()
    finding = (
        f"left out {n_bad} lines without a right checksum, {n_void} epochs without fix, {n_without}"
        f" of {n_fixes} fixes without GST"
    )
    expected = "whole sentences, a fix and GST each epoch"
    advice = "check the logger and the receiver's settings"
    return (note("GNSS rows", finding, expected, advice),)
