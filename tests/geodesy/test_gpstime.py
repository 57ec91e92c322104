"""GPS time against published weeks, leap seconds of the IERS and datetime arithmetic."""

import zoneinfo
from datetime import UTC, datetime, timedelta, timezone

import numpy as np
import pandas
import pytest
from numpy.testing import assert_allclose

from insgnss.base.errors import InputError, UsageError
from insgnss.base.units import time_zone
from insgnss.geodesy import gpstime


@pytest.mark.parametrize(
    ("date", "tai_minus_utc"),
    [
        *(
            ("1980-01-06", 19),
            ("1981-06-30", 19),
            ("1981-07-01", 20),
            ("1985-07-01", 23),
            ("1988-01-01", 24),
            ("1990-01-01", 25),
        ),
        *(
            ("1992-07-01", 27),
            ("1994-07-01", 29),
            ("1997-07-01", 31),
            ("1999-01-01", 32),
            ("2005-12-31", 32),
            ("2006-01-01", 33),
        ),
        *(
            ("2009-01-01", 34),
            ("2012-07-01", 35),
            ("2015-06-30", 35),
            ("2015-07-01", 36),
            ("2016-12-31", 36),
            ("2017-01-01", 37),
        ),
    ],
)
def test_leap_seconds_are_those_of_the_iers(date, tai_minus_utc):
    """Oracle: TAI - UTC of IERS Bulletin C; GPST is TAI - 19 s."""
    unix = datetime.fromisoformat(date).replace(tzinfo=UTC).timestamp()
    assert gpstime.leap_seconds(unix) == tai_minus_utc - 19


@pytest.mark.parametrize(
    ("utc", "week", "tow"),
    [
        (datetime(1980, 1, 6), 0, 0.0),
        (
            datetime(1999, 8, 21, 23, 59, 47),
            1024,
            0.0,
        ),  # first roll-over of the ten-bit week (ICD-GPS-200)
        (datetime(2019, 4, 6, 23, 59, 42), 2048, 0.0),  # second roll-over
        (
            datetime(2018, 7, 3, 7, 0, 0, 250000),
            2008,
            2 * 86400 + 7 * 3600 + 18.25,
        ),  # Tuesday of formats.md A.9
        (datetime(2019, 4, 6, 23, 59, 41, 999999), 2047, 604799.999999),
    ],
)
def test_published_weeks(utc, week, tow):
    """Oracle: published starts of GPS weeks and the leap seconds then in force; a microsecond is
    what datetime holds.
    """
    found = gpstime.gps_from_calendar(utc)
    assert found[0] == week
    assert_allclose(found[1], tow, rtol=0, atol=1e-9)
    assert gpstime.calendar_from_gps(week, tow) == utc.replace(tzinfo=UTC)
    unix_week, unix_tow = gpstime.gps_from_unix_utc(utc.replace(tzinfo=UTC).timestamp())
    assert unix_week == week
    assert_allclose(unix_tow, tow, rtol=0, atol=2.5e-7)  # resolution of a float64 Unix time


def test_calendar_in_gps_time_has_no_leap_seconds():
    """Oracle: datetime arithmetic from the epoch, as RINEX epochs are meant."""
    when = datetime(2018, 7, 3, 7, 0, 18, 125)
    week, tow = gpstime.gps_from_calendar(when, scale="gpst")
    assert datetime(1980, 1, 6) + timedelta(weeks=week, seconds=tow) == when
    assert gpstime.calendar_from_gps(week, tow, scale="gpst") == when
    assert gpstime.calendar_from_gps(week, tow) == (when - timedelta(seconds=18)).replace(
        tzinfo=UTC
    )


def test_time_zones_are_converted():
    """Oracle: datetime: 9:00 in a zone two hours east is 7:00 UTC."""
    east = timezone(timedelta(hours=2))
    assert gpstime.gps_from_calendar(
        datetime(2018, 7, 3, 9, tzinfo=east)
    ) == gpstime.gps_from_calendar(datetime(2018, 7, 3, 7))


def test_no_second_is_lost_at_a_leap_second():
    """Oracle: counting; GPST runs on, two seconds from 23:59:59 to 00:00:00 on 31 December 2016."""
    before = gpstime.gps_from_calendar(datetime(2016, 12, 31, 23, 59, 59))
    after = gpstime.gps_from_calendar(datetime(2017, 1, 1))
    assert before[0] == after[0] == 1930
    assert after[1] - before[1] == 2.0
    assert gpstime.calendar_from_gps(*before) == datetime(2016, 12, 31, 23, 59, 59, tzinfo=UTC)
    assert gpstime.calendar_from_gps(*after) == datetime(2017, 1, 1, tzinfo=UTC)


def test_unix_times_over_a_weeks_end_go_on_counting():
    """Oracle: the package's time convention; Saturday 23:59:40 UTC on, in steps of one second."""
    start = datetime(2018, 7, 7, 23, 59, 40, tzinfo=UTC).timestamp()
    week, tow = gpstime.gps_from_unix_utc(start + np.arange(5.0))
    assert week == 2008
    assert_allclose(tow, 604798.0 + np.arange(5.0), rtol=0, atol=1e-6)


def test_week_end_is_unwrapped_and_a_clock_error_is_not():
    """Oracle: a clock that counts on, folded; a step back of 3 s stays for the record."""
    counting = 604790.0 + 100000.0 * np.arange(20)
    folded = counting % gpstime.WEEK_S
    assert_allclose(gpstime.unwrap_week(folded), counting, rtol=0, atol=1e-9)
    assert_allclose(gpstime.unwrap_week([10.0, 7.0, 8.0]), [10.0, 7.0, 8.0], rtol=0, atol=0)
    assert gpstime.unwrap_week([]).size == 0


@pytest.mark.parametrize("scale", ["utc", "gpst"])
def test_arrays_of_dates_are_those_of_the_calendar(scale):
    """Oracle: `gps_from_calendar` date by date (of published weeks), over a leap second and the end
    of a week; nanoseconds by hand.
    """
    start = np.datetime64("2016-12-31T23:59:58", "ns")
    for dates in (start + np.arange(4) * np.timedelta64(1, "s"), np.array(["2018-07-07T23:59:50"])):
        week, tow = gpstime.gps_from_dates(dates, scale)
        for date, second in zip(np.atleast_1d(dates).astype("M8[us]"), tow, strict=True):
            own, expected = gpstime.gps_from_calendar(date.astype(datetime), scale)
            assert second + week * gpstime.WEEK_S == expected + own * gpstime.WEEK_S
    fine = np.datetime64("2018-07-03T09:00:00.123456789", "ns")
    assert gpstime.gps_from_dates([fine], "gpst")[1][0] == 205200.123456789
    assert gpstime.gps_from_dates([fine], "gpst", gps_week=2007)[1][0] > gpstime.WEEK_S
    aware = [datetime(2018, 7, 3, 11, tzinfo=timezone(timedelta(hours=2)))]
    assert gpstime.gps_from_dates(pandas.DatetimeIndex(aware), "gpst")[1].tolist() == [205200.0]


@pytest.mark.parametrize(
    ("dates", "scale", "said"),
    [
        ([np.datetime64("NaT")], "utc", "date 0 is missing"),
        (np.array([], dtype="M8[ns]"), "utc", "no date"),
        ([np.datetime64("1970-01-01")], "utc", "1980-01-06"),
        (["noon"], "utc", "not all are dates"),
        ([np.datetime64("2018-07-03")], "local", "none of utc, gpst"),
    ],
)
def test_what_is_no_date_of_gps_is_refused(dates, scale, said):
    """Oracle: by contract."""
    with pytest.raises((InputError, UsageError), match=said):
        gpstime.gps_from_dates(dates, scale)


def test_times_before_gps_are_refused():
    """Oracle: by contract; the message says when GPS time starts."""
    with pytest.raises(InputError, match="1980-01-06"):
        gpstime.gps_from_calendar(datetime(1970, 1, 1))
    for wrong in (0.0, [np.nan], []):
        with pytest.raises(InputError, match="1980-01-06"):
            gpstime.gps_from_unix_utc(wrong)


@pytest.mark.parametrize(
    ("name", "hour", "shown"),
    [("UTC", 9, "UTC"), ("+05:30", 14, "UTC+05:30"), ("utc-03:00", 6, "UTC-03:00")],
)
def test_time_zones_by_offset_and_by_name(name: str, hour: int, shown: str) -> None:
    """Oracle: arithmetic of hours."""
    local = datetime(2018, 7, 3, 9, 5, tzinfo=UTC).astimezone(time_zone(name))
    assert (local.hour, f"{local:%Z}") == (hour, shown)


def test_a_zone_by_its_name_has_summer_time() -> None:
    """Oracle: central European summer time is two hours ahead."""
    if "Europe/Zurich" not in zoneinfo.available_timezones():
        pytest.skip("this machine has no data base of time zones")
    local = datetime(2018, 7, 3, 9, 5, tzinfo=UTC).astimezone(time_zone("Europe/Zurich"))
    assert (local.hour, f"{local:%Z}") == (11, "CEST")


@pytest.mark.parametrize("name", ["", "Mars/Base", "+25:00", "2 hours", "../etc/passwd"])
def test_what_is_no_time_zone_is_refused(name: str) -> None:
    """Oracle: the message names both forms."""
    with pytest.raises(UsageError, match=r"Europe/Zurich.*02:00"):
        time_zone(name)
