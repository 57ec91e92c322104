"""Receiver log of NMEA 0183 sentences: positions of GGA, the date of RMC, standard deviations of GST, data_specs/nmea.md.

The height above the ellipsoid is GGA's height above mean sea level plus its geoid separation. Time of day and date are
UTC; an epoch's day counts on where the time of day falls back by more than half a day. RMC's velocity is horizontal and
carries no standard deviation, so it is not taken.
"""

import warnings
from datetime import UTC, datetime

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ..errors import InputError
from ..geodesy.gpstime import WEEK_S, gps_from_unix_utc
from ..records import GnssFixes
from ._columns import check_increasing
from ._sentences import BAD_SHARE_LIMIT, SentenceLines, Sentences, read_sentences
from ._text import InsgnssWarning, Source, number
from .gnss_text import fixes_from_columns

Array = NDArray[np.float64]
Epoch = tuple[int, float]

DAY_S = 86400.0
QUALITY_FROM_NMEA = {"1": 5, "2": 4, "4": 1, "5": 2}  # to RTKLIB's: single, DGPS, fixed, float


def read_nmea(path: Source, sigma_m: ArrayLike | None = None, gps_week: int | None = None) -> GnssFixes:
    """Read fixes in GPST. Where an epoch has no GST, sigma_m (north, east, down) stands in, or the epoch is left out.

    Raises InputError with file and line; warns (InsgnssWarning) with the counts of what was left out: lines without a right
    checksum (at most 1 %), epochs without fix, epochs without standard deviations (at most 1 %).
    """
    sentences = read_sentences(path)
    fixes, sigma, dates, n_void = _collect(sentences)
    if not fixes:
        raise InputError.at(path, None, f"no GGA sentence with a fix ({n_void} without); is it the rover's log?")
    day = _first_day(path, dates)
    missing = [epoch for epoch in fixes if epoch not in sigma]
    if missing and sigma_m is None:
        if len(missing) > BAD_SHARE_LIMIT * len(fixes):
            what = f"{len(missing)} of {len(fixes)} fixes have no GST sentence of their time; set sigma_m = [north, east, down]"
            raise InputError.at(path, int(fixes[missing[0]][0]), what)
        for epoch in missing:
            del fixes[epoch]
    _warn(path, sentences.n_bad, n_void, len(missing) if sigma_m is None else 0)
    if sigma_m is not None:
        sigma.update(dict.fromkeys(missing, tuple(np.asarray(sigma_m, dtype=np.float64).tolist())))
    lines = SentenceLines(str(path), [int(row[0]) for row in fixes.values()])
    week, midnight = gps_from_unix_utc(day + DAY_S * np.array([days for days, _ in fixes]))
    time = midnight + np.array([tod for _, tod in fixes])
    over = int(time[0] // WEEK_S)  # midnight UTC lies in the week before, in the leap seconds before the week's end
    week, time = week + over, time - over * WEEK_S
    check_increasing(lines, time)
    if gps_week is not None and week != gps_week:
        raise lines.at(0, f"GPS week {week}, but the flight is said to be of week {gps_week}; check gps_week or the file")
    table = np.array(list(fixes.values()))
    spread = np.array([sigma[epoch] for epoch in fixes])
    cols = {"tow": time, "lat": np.radians(table[:, 1]), "lon": np.radians(table[:, 2]), "h": table[:, 3], "q": table[:, 4]}
    cols |= {"sd_n": spread[:, 0], "sd_e": spread[:, 1], "sd_u": spread[:, 2]}
    return fixes_from_columns(cols, lines, str(path), week, None, None)


def _collect(
    sentences: Sentences,
) -> tuple[dict[Epoch, tuple[float, ...]], dict[Epoch, tuple[float, ...]], dict[Epoch, tuple[int, str]], int]:
    """By (days since the first, time of day): line, latitude, longitude, height, quality; standard deviations; line and date."""
    fixes: dict[Epoch, tuple[float, ...]] = {}
    sigma: dict[Epoch, tuple[float, ...]] = {}
    dates: dict[Epoch, tuple[int, str]] = {}
    days, before, n_void = 0, 0.0, 0
    for line, fields in sentences.fields(b"GGA", b"RMC", b"GST"):
        kind = fields[0][2:]
        if len(fields) < 9 or not fields[1]:
            continue
        tod = _time_of_day(fields[1], sentences.path, line)
        days += tod < before - 0.5 * DAY_S
        before, epoch = tod, (days, tod)
        if kind == "RMC" and len(fields) > 9 and fields[9]:
            dates[epoch] = (line, fields[9])
        elif kind == "GST" and all(fields[6:9]):
            sigma[epoch] = tuple(number(field, sentences.path, line) for field in fields[6:9])
        elif kind == "GGA":
            if fields[6] in ("", "0"):
                n_void += 1
                continue
            if epoch in fixes:
                raise InputError.at(sentences.path, line, f"two GGA sentences of {fields[1]} UTC; split the log by receiver")
            fixes[epoch] = _fix(fields, sentences.path, line)
    return fixes, sigma, dates, n_void


def _fix(fields: list[str], path: str, line: int) -> tuple[float, ...]:
    if len(fields) < 12 or not fields[11]:
        raise InputError.at(
            path, line, "GGA without geoid separation; the height above the ellipsoid is not known; let the receiver write it"
        )
    lat, lon = _degrees(fields[2], fields[3], "NS", path, line), _degrees(fields[4], fields[5], "EW", path, line)
    height = number(fields[9], path, line) + number(fields[11], path, line)
    return line, lat, lon, height, QUALITY_FROM_NMEA.get(fields[6], 0)


def _degrees(field: str, side: str, sides: str, path: str, line: int) -> float:
    """Degrees of dddmm.mmmm and its hemisphere."""
    minutes = number(field, path, line)
    if side not in tuple(sides):
        raise InputError.at(path, line, f"hemisphere {side!r} is neither {sides[0]} nor {sides[1]}")
    whole = minutes // 100.0
    value = whole + (minutes - 100.0 * whole) / 60.0
    return value if side == sides[0] else -value


def _time_of_day(field: str, path: str, line: int) -> float:
    if len(field) < 6:
        raise InputError.at(path, line, f"time {field!r} is not hhmmss")
    return number(field[:2], path, line) * 3600.0 + number(field[2:4], path, line) * 60.0 + number(field[4:], path, line)


def _first_day(path: Source, dates: dict[Epoch, tuple[int, str]]) -> float:
    """Unix time of the midnight before the first epoch; every RMC must agree on it."""
    if not dates:
        raise InputError.at(path, None, "no RMC sentence, so the date is not known; let the receiver write RMC beside GGA")
    first: float | None = None
    for (days, _), (line, text) in dates.items():
        try:
            year = int(text[4:6])
            midnight = datetime(year + (2000 if year < 80 else 1900), int(text[2:4]), int(text[:2]), tzinfo=UTC)
        except ValueError:
            raise InputError.at(path, line, f"date {text!r} is not ddmmyy") from None
        day = midnight.timestamp() - DAY_S * days
        if first is None:
            first = day
        elif day != first:
            raise InputError.at(path, line, f"date {text} does not follow from the dates before; split the log by day")
    assert first is not None
    return first


def _warn(path: Source, n_bad: int, n_void: int, n_without: int) -> None:
    if n_bad or n_void or n_without:
        what = f"{path}: left out {n_bad} lines without a right checksum, {n_void} epochs without fix, {n_without} without GST"
        warnings.warn(InsgnssWarning(what), stacklevel=3)
