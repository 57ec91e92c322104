"""GPS week and time of week, UTC, and the leap seconds between them.

GPS time (GPST) counts SI seconds from 1980-01-06 00:00:00 UTC and knows no leap seconds; UTC lags
behind it by the leap seconds since then. Unix time counts UTC as if every day had 86400 s: within
an inserted leap second it repeats itself, so that one second of UTC equals the next,
here as in every Unix clock.

Time of week follows the package's rule: seconds of one week, which go on counting past its end.
Leap seconds: IERS Bulletin C up to number 72 (no leap second announced after 2017-01-01).
"""

from datetime import UTC, datetime, timedelta
from typing import Any, Literal

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ..base.errors import InputError, UsageError

Array = NDArray[np.float64]

DAY_S = 86400.0  # seconds of a day, leap seconds apart
WEEK_S = 604800.0  # seconds of a GPS week
GPS_EPOCH = datetime(1980, 1, 6, tzinfo=UTC)  # at which GPST counts zero
GPS_EPOCH_UNIX_S = 315964800.0  # Unix time (s) of that instant
SCALES = ("utc", "gpst")
NS = 1_000_000_000  # nanoseconds of a second
# s, of recordings: between longer ones whole weeks are no finding, milliseconds look like them
LEAST_WEEKS_APART_S = 43200.0

# first UTC day with GPST - UTC = 1, 2, ... 18 s
LEAP_DAYS = (
    *("1981-07-01", "1982-07-01", "1983-07-01", "1985-07-01", "1988-01-01", "1990-01-01"),
    *("1991-01-01", "1992-07-01", "1993-07-01", "1994-07-01", "1996-01-01", "1997-07-01"),
    *("1999-01-01", "2006-01-01", "2009-01-01", "2012-07-01", "2015-07-01", "2017-01-01"),
)
LEAP_NOW_S = float(len(LEAP_DAYS))  # s that GPST has been ahead of UTC since the last of them
_LEAP_UNIX_S = np.array(
    [datetime.fromisoformat(day).replace(tzinfo=UTC).timestamp() for day in LEAP_DAYS]
)
# GPST (s) of the leap seconds' ends
_LEAP_GPS_S = _LEAP_UNIX_S - GPS_EPOCH_UNIX_S + np.arange(1, len(LEAP_DAYS) + 1)


def leap_seconds(unix_utc_s: ArrayLike) -> NDArray[np.int64]:
    """Return the leap seconds GPST - UTC.

    Parameters
    ----------
    unix_utc_s : array_like, (...)
        Unix times, s.

    Returns
    -------
    ndarray of int, (...)
        Whole seconds.
    """
    return np.searchsorted(_LEAP_UNIX_S, np.asarray(unix_utc_s, dtype=np.float64), side="right")


def gps_from_unix_utc(unix_utc_s: ArrayLike) -> tuple[int, Array]:
    """Convert Unix times to GPS week and time of week.

    A float64 Unix time of our days resolves 0.24 microseconds.

    Parameters
    ----------
    unix_utc_s : array_like, (...)
        Unix times, s of UTC; one at least.

    Returns
    -------
    week : int
        GPS week of the first instant.
    tow : ndarray, (...)
        Seconds of that week, GPST, which go on counting past its end.

    Raises
    ------
    InputError
        Without any time, and for a time before 1980-01-06.
    """
    unix = np.asarray(unix_utc_s, dtype=np.float64)
    if unix.size == 0 or not unix.min() >= GPS_EPOCH_UNIX_S:
        problem = "no time" if unix.size == 0 else f"Unix time {unix.min():.3f} s"
        raise InputError(
            f"{problem}; GPS time starts at Unix time {GPS_EPOCH_UNIX_S:.0f} s (1980-01-06); check"
            " the column and its unit"
        )
    gps = unix - GPS_EPOCH_UNIX_S + leap_seconds(unix)
    week = int(gps.flat[0] // WEEK_S)
    return week, gps - week * WEEK_S


def gps_from_dates(
    dates: Any, scale: Literal["utc", "gpst"], gps_week: int | None = None
) -> tuple[int, Array]:
    """Convert the dates of numpy or pandas to GPS week and time of week.

    Whole nanoseconds are counted, so that nothing is lost but what float64 cannot hold, 0.1 ns.

    Parameters
    ----------
    dates : array_like, (n,)
        Of datetime64, `pandas.Timestamp` or `datetime`; one with a time zone is taken at UTC.
    scale : {"utc", "gpst"}
        Time scale of the dates, which no array of dates says. UTC lags by 18 s since 2017.
    gps_week : int, optional
        The week whose seconds are wanted, for arrays of one flight on both sides of a week's end;
        None: that of the first date.

    Returns
    -------
    week : int
        GPS week of the first date, or `gps_week`.
    tow : ndarray, (n,)
        Seconds of that week, GPST, which go on counting past its end.

    Raises
    ------
    InputError
        For no date, one that is missing (NaT), and one before 1980-01-06.
    UsageError
        For another scale.

    Examples
    --------
    >>> week, tow = gps_from_dates(np.array(["2018-07-03T09:00:00.25"], dtype="M8[ns]"), "utc")
    >>> week, tow.tolist()
    (2008, [205218.25])
    """
    if scale not in SCALES:
        raise UsageError(f"gps_from_dates: scale {scale!r} is none of {', '.join(SCALES)}")
    try:
        stamps = np.atleast_1d(np.asarray(dates, dtype="datetime64[ns]"))
    except (TypeError, ValueError) as error:
        raise InputError(f"gps_from_dates: not all are dates: {error}") from None
    missing = np.isnat(stamps)
    if not stamps.size or missing.any():
        problem = f"date {int(np.argmax(missing))} is missing (NaT)" if stamps.size else "no date"
        raise InputError(f"gps_from_dates: {problem}; leave out the rows without one")
    ns = stamps.astype(np.int64)
    if ns.min() < int(GPS_EPOCH_UNIX_S) * NS:
        raise InputError(
            f"gps_from_dates: {stamps[np.argmin(ns)]} lies before the start of GPS time,"
            " 1980-01-06; check the unit from which the dates were made"
        )
    leap = leap_seconds(ns // NS) if scale == "utc" else 0
    gps = ns + (leap - int(GPS_EPOCH_UNIX_S)) * NS
    week_ns = int(WEEK_S) * NS
    week = int(gps.flat[0] // week_ns) if gps_week is None else gps_week
    since = gps - week * week_ns
    return week, since // NS + (since % NS) / NS


def gps_from_calendar(when: datetime, scale: Literal["utc", "gpst"] = "utc") -> tuple[int, float]:
    """Convert a calendar date to GPS week and time of week.

    RINEX gives its dates in GPST, most other sources in UTC.

    Parameters
    ----------
    when : datetime
        The date; one without time zone is taken in `scale` as it stands.
    scale : {"utc", "gpst"}
        Time scale of the date.

    Returns
    -------
    week : int
        GPS week.
    tow : float
        Time of week, s, GPST.

    Raises
    ------
    InputError
        For a date before 1980-01-06.
    """
    stamp = when.replace(tzinfo=UTC) if when.tzinfo is None else when.astimezone(UTC)
    elapsed = stamp - GPS_EPOCH
    if elapsed < timedelta(0):
        raise InputError(
            f"{when.isoformat()} lies before the start of GPS time, 1980-01-06; check the year"
        )
    leap = int(leap_seconds(stamp.replace(microsecond=0).timestamp())) if scale == "utc" else 0
    elapsed += timedelta(seconds=leap)
    week = elapsed.days // 7
    of_week = elapsed - timedelta(weeks=week)
    return week, of_week.days * 86400.0 + of_week.seconds + of_week.microseconds * 1e-6


def calendar_from_gps(week: int, tow: float, scale: Literal["utc", "gpst"] = "utc") -> datetime:
    """Convert GPS week and time of week to a calendar date.

    Parameters
    ----------
    week : int
        GPS week.
    tow : float
        Time of week, s, GPST.
    scale : {"utc", "gpst"}
        Time scale of the date.

    Returns
    -------
    datetime
        The date to the microsecond: in UTC with its time zone, or in GPST without one.
    """
    gps = timedelta(weeks=int(week), seconds=float(tow))
    if scale == "gpst":
        return (GPS_EPOCH + gps).replace(tzinfo=None)
    leap = int(np.searchsorted(_LEAP_GPS_S, gps // timedelta(seconds=1), side="right"))
    return GPS_EPOCH + gps - timedelta(seconds=leap)


def unwrap_week(tow: ArrayLike) -> Array:
    """Let times of week count on past the end of the first one's week.

    Only a fall of more than half a week is a week's end; a smaller step back is left for the record
    to refuse.

    Parameters
    ----------
    tow : array_like, (n,)
        Times of week, s, which fall back by a week at its end.

    Returns
    -------
    ndarray, (n,)
        Seconds of the first one's week.
    """
    tow = np.asarray(tow, dtype=np.float64)
    falls = np.diff(tow) < -0.5 * WEEK_S
    return tow + WEEK_S * np.concatenate([[0.0], np.cumsum(falls)]) if falls.any() else tow.copy()


def weeks_apart(offset_s: float, slack_s: float = 60.0) -> str:
    """Say by how many whole GPS weeks two times are apart, in words.

    Parameters
    ----------
    offset_s : float
        Their difference, s.
    slack_s : float
        By how much it may differ from whole weeks, s.

    Returns
    -------
    str
        "a GPS week", "3 GPS weeks"; empty where it is none or no whole number.
    """
    weeks = round(offset_s / WEEK_S)
    if weeks == 0 or abs(offset_s - weeks * WEEK_S) > slack_s:
        return ""
    return "a GPS week" if abs(weeks) == 1 else f"{abs(weeks)} GPS weeks"
