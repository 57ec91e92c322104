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
from dataclasses import dataclass, field
from datetime import UTC, datetime
from itertools import compress
from operator import not_

import numpy as np
from numpy.typing import ArrayLike

from ....base.errors import InputError
from ....geodesy.gpstime import DAY_S, WEEK_S, gps_from_unix_utc
from ....records import Array, Finding, GnssFixes
from ....records.observations import UNKNOWN_MPS
from ..read_options import STATED_NOTHING, ReadOptions
from ..text.clock import agree_on_week
from ..text.layout import shown
from ..text.order import note
from ..text.sentences import BAD_SHARE_LIMIT, SentenceLines, Sentences, read_sentences
from ..text.stamps import undated_rows
from ..text.text import Source, number
from .fixes import ASSUMED, NMEA_QUALITY, FixScales, fixes_from_columns

Epoch = tuple[int, float]

CORRECT = "correct or delete the sentence"
KNOT = 1852.0 / 3600.0  # m/s: an international nautical mile an hour
LEAST_FIELDS = {"GGA": 10, "RMC": 10, "GST": 9, "VTG": 6, "ZDA": 5, "GSA": 16}
KINDS = tuple(kind.encode() for kind in LEAST_FIELDS)
OF_HEADING = (b"HDT", b"THS")  # true headings of two antennas, at the time of the GGA before
# s: receivers that do not know the date say 1980-01-06 or that of a week's rollover, years ago
LEAST_UNDATED_S = 365.0 * DAY_S
CLOCK = re.compile(r"[0-9]{6}(?:\.[0-9]*)?")  # hhmmss.ss
DATE = re.compile(r"[0-9]{6}(?:[0-9]{2})?")  # ddmmyy, of ZDA ddmmyyyy


@dataclass(frozen=True)
class _Log:
    """What the sentences say, by epoch (days since the first, time of day).

    Attributes
    ----------
    fixes
        Rows of epoch, line, latitude, longitude (deg), height, quality.
    described
        Satellites, HDOP and age of the corrections, s, of each fix; not-a-number where not given.
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
    headings
        Rows of epoch, line and true heading, deg.
    undated
        Lines of the fixes before the receiver knew the date, which are left out of `fixes`.
    """

    fixes: list[tuple[Epoch, int, float, float, float, int]] = field(default_factory=list)
    described: list[tuple[float, float, float]] = field(default_factory=list)
    pdop: dict[Epoch, float] = field(default_factory=dict)
    sigma: dict[Epoch, tuple[float, ...]] = field(default_factory=dict)
    track: dict[Epoch, tuple[float, float]] = field(default_factory=dict)
    dates: dict[Epoch, tuple[int, datetime]] = field(default_factory=dict)
    void: list[int] = field(default_factory=list)
    headings: list[tuple[Epoch, int, float]] = field(default_factory=list)
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
        dated = [row[1] > first_line or row[0] == first_epoch for row in self.fixes]
        self.undated.extend(row[1] for row in compress(self.fixes, map(not_, dated)))
        self.described[:] = compress(self.described, dated)
        self.fixes[:] = compress(self.fixes, dated)
        self.headings[:] = [
            row for row in self.headings if row[1] > first_line or row[0] == first_epoch
        ]


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
    missing = [row for row in log.fixes if row[0] not in log.sigma]
    if missing and sigma_m is None and len(missing) > BAD_SHARE_LIMIT * len(log.fixes):
        message = (
            f"{len(missing)} of {len(log.fixes)} fixes have no GST sentence of their time; set"
            " sigma_m = [north, east, down]"
        )
        raise InputError.at_line(path, missing[0][1], message)
    stand_in = None if sigma_m is None else tuple(np.asarray(sigma_m, dtype=np.float64).tolist())
    taken = [k for k, row in enumerate(log.fixes) if stand_in is not None or row[0] in log.sigma]
    fixes = [log.fixes[k] for k in taken]
    lines = SentenceLines(str(path), [row[1] for row in fixes])
    week, time = _gps_time(day, [row[0] for row in fixes])
    agree_on_week(lines, week, options.gps_week)
    table = np.array([row[2:] for row in fixes])
    spread = np.array([log.sigma.get(row[0], stand_in) for row in fixes])
    cols = {
        "tow": time,
        "lat": np.radians(table[:, 0]),
        "lon": np.radians(table[:, 1]),
        "h": table[:, 2],
        "q": table[:, 3],
    }
    cols |= {"sd_n": spread[:, 0], "sd_e": spread[:, 1], "sd_u": spread[:, 2]}
    cols[ASSUMED] = np.array([row[0] not in log.sigma for row in fixes], dtype=np.float64)
    described = np.array([log.described[k] for k in taken]).reshape(-1, 3)
    cols |= dict(zip(("satellites", "hdop", "age_s"), described.T, strict=True))
    cols["pdop"] = np.array([log.pdop.get(row[0], np.nan) for row in fixes])
    notes = _left_out(sentences.n_bad, len(log.void), len(log.fixes) - len(fixes), len(log.fixes))
    notes += sentences.notes("GNSS rows")
    if log.undated:
        notes += (undated_rows("GNSS rows", len(log.undated), f"line {log.fixes[0][1]}"),)
    if sentences.unchecked:
        taken_so = ", ".join(f"{count} {kind}" for kind, count in sentences.unchecked.items())
        finding = f"all {taken_so} have a wrong checksum beside right ones of other kinds; taken"
        advice = "a program changed them without it: see whether it changed the dates"
        notes += (note("GNSS checksums", finding, "right ones", advice),)
    if options.sigma_velocity is not None and log.track:
        cols |= _velocity(fixes, log, options.sigma_velocity)
        if without := sum(row[0] not in log.track for row in fixes):
            finding = f"{without} of {len(fixes)} epochs without a course"
            notes += (note("GNSS rows", finding, "speed and course", "their velocity is not used"),)
    of_the_log = ReadOptions(gps_week=week)
    return fixes_from_columns(cols, lines, FixScales(), of_the_log, notes=notes)


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
    log = _collect(read_sentences(path), 0.0, (*KINDS, *OF_HEADING))
    if not log.headings:
        advice = "let the receiver write HDT or THS beside GGA and RMC"
        raise InputError.in_file(path, f"no HDT or THS sentence with a heading; {advice}")
    week, time = _gps_time(_first_day(path, log), [row[0] for row in log.headings])
    lines = SentenceLines(str(path), [row[1] for row in log.headings])
    return week, time, np.array([row[2] for row in log.headings]), lines


def _gps_time(first_day: float, epochs: list[Epoch]) -> tuple[int, Array]:
    """Return GPS week and seconds of it of epochs that count from a midnight, Unix time."""
    week, midnight = gps_from_unix_utc(first_day + DAY_S * np.array([days for days, _ in epochs]))
    time = midnight + np.array([tod for _, tod in epochs])
    # midnight UTC lies in the week before, in the leap seconds before the week's end
    over = int(time[0] // WEEK_S)
    return week + over, time - over * WEEK_S


def _velocity(
    fixes: list[tuple[Epoch, int, float, float, float, int]], log: _Log, sigma_velocity: ArrayLike
) -> dict[str, Array]:
    """Return columns of velocity and its standard deviations.

    Those of an epoch without a track are `UNKNOWN_MPS`.
    """
    track = np.array([log.track.get(row[0], (np.nan, np.nan)) for row in fixes])
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
    sentences: Sentences, undulation_m: float | None, kinds: tuple[bytes, ...] = KINDS
) -> _Log:
    log, days, before, epoch, path = _Log(), 0, 0.0, None, sentences.path
    for line, fields in sentences.fields(*kinds):
        kind = fields[0][2:5]
        if kind.encode() in OF_HEADING:
            valid = len(fields) > 2 and fields[1] and fields[2] != "V"
            if epoch is not None and valid:
                log.headings.append((epoch, line, number(fields[1], path, line)))
            continue
        if len(fields) < LEAST_FIELDS[kind]:
            message = f"{kind} of {len(fields)} fields, {LEAST_FIELDS[kind]} are the least"
            raise InputError.at_line(path, line, f"{message}; {CORRECT}")
        if kind == "GSA":
            if epoch is not None:
                log.pdop[epoch] = _optional(fields[15], path, line)
            continue
        if kind == "VTG":
            if epoch is not None and epoch not in log.track and fields[1] and fields[5]:
                log.track[epoch] = _track(fields[5], fields[1], path, line)
            continue
        if not fields[1]:
            continue
        tod = _time_of_day(fields[1], path, line)
        days += tod < before - 0.5 * DAY_S
        before, epoch = tod, (days, tod)
        if kind == "RMC" and fields[2] not in ("", "V"):  # A, or D of a differential fix
            if fields[9]:
                log.dates[epoch] = (line, _date(fields[9], path, line))
            if fields[7] and fields[8]:
                log.track[epoch] = _track(fields[7], fields[8], path, line)
        elif kind == "ZDA" and all(fields[2:5]):
            date = f"{fields[2]:0>2}{fields[3]:0>2}{fields[4]}"
            log.dates[epoch] = (line, _date(date, path, line))
        elif kind == "GST" and all(fields[6:9]):
            log.sigma[epoch] = tuple(number(text, path, line) for text in fields[6:9])
        elif kind == "GGA" and fields[6] in ("", "0"):
            log.void.append(line)
        elif kind == "GGA":
            log.fixes.append((epoch, line, *_fix(fields, path, line, undulation_m)))
            described = (fields[7], fields[8], fields[13] if len(fields) > 13 else "")
            satellites, hdop, age = (_optional(text, path, line) for text in described)
            log.described.append((satellites, hdop, age))
    log.leave_undated_out()
    return log


def _optional(text: str, path: str, line: int) -> float:
    """Return a number that may be absent: not-a-number for an empty field."""
    return number(text, path, line) if text else float("nan")


def _track(speed: str, course: str, path: str, line: int) -> tuple[float, float]:
    return number(speed, path, line), number(course, path, line)


def _fix(
    fields: list[str], path: str, line: int, undulation_m: float | None
) -> tuple[float, float, float, int]:
    separation = fields[11] if len(fields) > 11 else ""
    if not separation and undulation_m is None:
        message = (
            "GGA without geoid separation; the height above the ellipsoid is not known; let the"
            " receiver write it, or set undulation_m"
        )
        raise InputError.at_line(path, line, message)
    lat, lon = (
        _degrees(fields[2], fields[3], "NS", path, line),
        _degrees(fields[4], fields[5], "EW", path, line),
    )
    above = number(separation, path, line) if separation else float(undulation_m or 0.0)
    code = number(fields[6], path, line)
    if code not in NMEA_QUALITY:
        message = f"quality {shown(fields[6])} of GGA is none of 0 to {max(NMEA_QUALITY)}"
        raise InputError.at_line(path, line, f"{message}; {CORRECT}")
    return lat, lon, number(fields[9], path, line) + above, NMEA_QUALITY[int(code)]


def _degrees(field: str, side: str, sides: str, path: str, line: int) -> float:
    """Return the degrees of dddmm.mmmm and its hemisphere."""
    minutes = number(field, path, line)
    if side not in tuple(sides):
        raise InputError.at_line(
            path, line, f"hemisphere {shown(side)} is neither {sides[0]} nor {sides[1]}; {CORRECT}"
        )
    whole = minutes // 100.0
    if minutes < 0.0 or minutes - 100.0 * whole >= 60.0:
        raise InputError.at_line(path, line, f"angle {shown(field)} is not dddmm.mmmm; {CORRECT}")
    value = whole + (minutes - 100.0 * whole) / 60.0
    return value if side == sides[0] else -value


def _time_of_day(field: str, path: str, line: int) -> float:
    hour, minute, second = (
        (float(text) for text in (field[:2], field[2:4], field[4:]))
        if CLOCK.fullmatch(field)
        else (np.inf, np.inf, np.inf)
    )
    if hour > 23.0 or minute > 59.0 or second >= 61.0:
        raise InputError.at_line(path, line, f"time {shown(field)} is not hhmmss; {CORRECT}")
    return hour * 3600.0 + minute * 60.0 + second


def _date(text: str, path: str, line: int) -> datetime:
    """Midnight of ddmmyy or ddmmyyyy."""
    try:
        if not DATE.fullmatch(text):
            raise ValueError
        year = int(text[4:])
        full = year if len(text) == 8 else year + (2000 if year < 80 else 1900)
        return datetime(full, int(text[2:4]), int(text[:2]), tzinfo=UTC)
    except ValueError:
        raise InputError.at_line(
            path, line, f"date {shown(text)} is not ddmmyy; {CORRECT}"
        ) from None


def _first_day(path: Source, log: _Log) -> float:
    """Return the Unix time of the midnight before the first epoch; every date must agree on it."""
    if not log.dates:
        raise InputError.in_file(
            path,
            "no RMC or ZDA sentence, so the date is not known; let the receiver write RMC"
            " beside GGA",
        )
    first: float | None = None
    for (days, _), (line, midnight) in log.dates.items():
        day = midnight.timestamp() - DAY_S * days
        if first is None:
            first = day
        elif day != first:
            raise InputError.at_line(
                path,
                line,
                f"date {midnight:%d%m%y} does not follow from the dates before; split the log"
                " by day",
            )
    assert first is not None
    return first


def _left_out(n_bad: int, n_void: int, n_without: int, n_fixes: int) -> tuple[Finding, ...]:
    if not (n_bad or n_void or n_without):
        return ()
    finding = (
        f"left out {n_bad} lines without a right checksum, {n_void} epochs without fix, {n_without}"
        f" without GST; {n_fixes} fixes"
    )
    expected, advice = (
        "whole sentences, a fix and GST each epoch",
        "check the logger and the receiver",
    )
    return (note("GNSS rows", finding, expected, f"{advice}'s settings"),)
