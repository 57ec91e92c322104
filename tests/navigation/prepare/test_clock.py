"""One clock: GPS weeks, the common span, the cut of the fixes. Oracle
throughout: a calendar of round numbers.
"""

import numpy as np
import pytest
from numpy.testing import assert_array_equal

from insgnss.base.errors import DataError, InputError
from insgnss.navigation.prepare.barometer import refuse_apart
from insgnss.navigation.prepare.clock import common_span, common_week, cut_fixes
from insgnss.records import BarometerHeights, GnssFixes, ImuSamples
from insgnss.records.observations import in_week


def imu(start: float, end: float, week: int | None = None) -> ImuSamples:
    time = np.arange(start, end + 1e-9, 0.5)
    return ImuSamples(
        time, np.zeros((time.size, 3)), np.zeros((time.size, 3)), gps_week=week, source="imu.csv"
    )


def gnss(start: float, end: float, week: int | None = None, velocity: bool = False) -> GnssFixes:
    time = np.arange(start, end + 1e-9, 1.0)
    n = time.size
    cov = np.tile(np.eye(3), (n, 1, 1))
    speed = (np.column_stack([time, time, time]), cov) if velocity else (None, None)
    return GnssFixes(
        time,
        time / 1e6,
        time / 1e6,
        time,
        cov,
        *speed,
        quality=np.arange(n),
        gps_week=week,
        source="gnss.txt",
    )


def test_other_weeks_are_brought_to_the_first_known_one():
    """Oracle: a week has 604 800 s; a flight over midnight of Saturday goes on counting."""
    i, g = imu(604790.0, 604810.0, 2008), gnss(0.0, 20.0, 2009)
    assert common_week(i, g, None, 2009) == 2008
    i, g = in_week(i, 2008), in_week(g, 2008)
    assert (i.gps_week, g.gps_week) == (2008, 2008)
    assert_array_equal(i.time[[0, -1]], [604790.0, 604810.0])
    assert_array_equal(g.time[[0, -1]], [604800.0, 604820.0])


def test_a_record_without_week_is_of_the_others():
    """Oracle: only the GNSS knows its week, or only the events, whose week is given beside."""
    assert common_week(imu(0.0, 20.0), gnss(0.0, 20.0, 2100), None, 2101) == 2100
    assert common_week(imu(0.0, 20.0), gnss(0.0, 20.0), None, 2101) == 2101
    assert in_week(imu(0.0, 20.0), 2100).gps_week == 2100
    assert_array_equal(in_week(imu(0.0, 20.0), 2100).time, imu(0.0, 20.0).time)


def test_the_given_week_rules():
    """Oracle: records of week 2009 told in seconds of week 2008."""
    assert common_week(imu(0.0, 20.0, 2009), gnss(0.0, 20.0), 2008) == 2008
    assert in_week(imu(0.0, 20.0, 2009), 2008).time[0] == 604800.0


def test_no_week_anywhere_is_refused():
    """Oracle: nothing says the week."""
    with pytest.raises(InputError, match=r"imu\.csv: no file gives the GPS week; give gps_week"):
        common_week(imu(0.0, 20.0), gnss(0.0, 20.0), None)


@pytest.mark.parametrize(
    ("start", "end", "expected"),
    [
        (None, None, (105.0, 150.0)),
        (110.5, None, (111.0, 150.0)),
        (None, 140.2, (105.0, 140.2)),
        (0.0, 1e6, (105.0, 150.0)),
    ],
)
def test_span_is_first_fix_within_the_imu_to_the_end(start, end, expected):
    """Oracle: IMU from 104.5 to 150 s, fixes at full seconds from 90 to 200 s."""
    assert common_span(imu(104.5, 150.0, 2008), gnss(90.0, 200.0), start, end) == expected


@pytest.mark.parametrize(
    ("first", "last", "start", "end"),
    [(0.0, 100.0, None, None), (160.0, 300.0, None, None), (90.0, 200.0, 210.0, None)],
)
def test_no_overlap_is_wrong_input(first, last, start, end):
    """Oracle: IMU from 104.5 to 150 s; fixes before it, after it, and before the start that is
    asked for.
    """
    with pytest.raises(InputError, match="they do not overlap; check gps_week"):
        common_span(imu(104.5, 150.0, 2008), gnss(first, last), start, end)


@pytest.mark.parametrize(
    ("ratio", "words"),
    [
        (25.6, r"samples last 25\.6 times as long as the fixes.*samples is to be 0\.03906 times"),
        (1e-3, "samples last 1/1000 as long as the fixes.*samples is to be 1000 times"),
        (3.0, "they do not overlap; check gps_week"),
    ],
)
def test_the_unit_that_would_fit_is_told(ratio, words):
    """Oracle: stamps of one recording multiplied; three times as long is a logger left on."""
    with pytest.raises(InputError, match=words):
        common_span(imu(0.0, 1000.0 * ratio, 2008), gnss(100000.0, 101000.0), None, None)


@pytest.mark.parametrize(
    ("first", "last", "start", "end", "found"),
    [
        (145.0, 300.0, None, None, r"6 fixes over 5\.0 s"),
        (90.0, 200.0, 120.0, 124.5, r"5 fixes over 4\.0 s"),
        (150.0, 300.0, None, None, r"1 fix over 0\.0 s"),
    ],
)
def test_too_short_an_overlap_does_not_support_an_answer(first, last, start, end, found):
    """Oracle: the full seconds between 145 and 150 s, between 120 and 124.5 s, and at 150 s; IMU
    from 104.5 to 150 s.
    """
    with pytest.raises(DataError, match=found):
        common_span(imu(104.5, 150.0, 2008), gnss(first, last), start, end)


def test_ten_seconds_in_common_are_enough():
    """Oracle: ten seconds from 140 to 150 s, nine from 141 s."""
    assert common_span(imu(104.5, 150.0, 2008), gnss(140.0, 300.0), None, None) == (140.0, 150.0)
    with pytest.raises(DataError, match=r"10 fixes over 9\.0 s in common \(limit 10 s\)"):
        common_span(imu(104.5, 150.0, 2008), gnss(141.0, 300.0), None, None)


@pytest.mark.parametrize(("hours", "words"), [(11.9, "they are a GPS week"), (12.1, "do not over")])
def test_a_week_between_recordings_of_half_a_day_is_told(hours, words):
    """Oracle: 604 800 s between recordings of the same length."""
    length = 3600.0 * hours
    with pytest.raises(InputError, match=words):
        common_span(imu(0.0, length, 2008), gnss(604800.0, 604800.0 + length), None, None)


def test_cut_keeps_every_field_of_the_fixes_within():
    """Oracle: the rows of 10 to 12 s, both ends included; fields that are absent stay so."""
    cut = cut_fixes(gnss(0.0, 20.0, 2008, velocity=True), 10.0, 12.0)
    assert_array_equal(cut.time, [10.0, 11.0, 12.0])
    assert_array_equal(cut.quality, [10, 11, 12])
    assert_array_equal(cut.height, cut.time)
    assert_array_equal(cut.velocity_ned[:, 0], cut.time)
    assert cut.velocity_cov_ned.shape == cut.cov_ned.shape == (3, 3, 3)
    assert (cut.gps_week, cut.source) == (2008, "gnss.txt")
    bare = cut_fixes(gnss(0.0, 20.0), 10.0, 12.0)
    assert bare.velocity_ned is None
    assert bare.velocity_cov_ned is None


def test_an_imu_alone_on_another_clock_is_not_taken_for_a_barometer():
    """Oracle: fixes and heights of one clock, samples of another."""
    heights = BarometerHeights(np.arange(200.0, 300.0), np.full(100, 5.0), 2008, "baro.csv")
    with pytest.raises(InputError, match=r"gnss\.txt: fixes from 200\.0 to 300\.0 s, imu\.csv"):
        refuse_apart(heights, imu(0.0, 100.0, 2008), gnss(200.0, 300.0))
    with pytest.raises(
        InputError, match=r"baro\.csv: .*heights last 9 times as long as the samples"
    ):
        refuse_apart(heights, imu(0.0, 11.0, 2008), gnss(0.0, 11.0))
