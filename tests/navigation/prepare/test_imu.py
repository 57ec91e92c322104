"""The door for samples: each step has been taken once, and a segment gets its increments."""

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal

from insgnss.geodesy.axes import parse_axes
from insgnss.geodesy.gpstime import WEEK_S
from insgnss.navigation.prepare.imu import Device, prepare_imu
from insgnss.records import GnssFixes, ImuSamples

RATE_HZ = 50.0


def standing(gap: tuple[float, float] = (0.0, 0.0), sign: float = 1.0) -> ImuSamples:
    """A minute at rest, z down, in week 2009; samples within `gap` are lacking."""
    time = 100.0 + np.arange(60.0 * RATE_HZ) / RATE_HZ
    rng = np.random.default_rng(3)
    gyro = 1e-4 * rng.standard_normal((time.size, 3))
    accel = sign * (np.array([0.0, 0.0, -9.81]) + 1e-3 * rng.standard_normal((time.size, 3)))
    kept = (time <= gap[0]) | (time >= gap[1])
    return ImuSamples(time[kept], gyro[kept], accel[kept], gps_week=2009, source="imu.csv")


def fixes(first: float, last: float) -> GnssFixes:
    """A fix a second at one place, seconds of week 2008."""
    time = WEEK_S + np.arange(first, last)
    n = time.size
    place = (np.full(n, 0.8), np.full(n, 0.1), np.full(n, 400.0))
    return GnssFixes(time, *place, np.tile(1e-4 * np.eye(3), (n, 1, 1)), gps_week=2008)


AXES = parse_axes("forward right down")


def test_sign_offset_and_week_are_applied_once():
    """Oracle: a week has 604 800 s; specific force of a sensor at rest points up."""
    reversed_force = standing(sign=-1.0)
    device = Device(reversed_force, AXES, accel_sign=-1.0, time_offset_s=0.25)
    imu = prepare_imu([device], fixes(100, 160), 2008)
    assert imu.samples.gps_week == 2008
    assert_array_equal(imu.samples.time, reversed_force.time + 0.25 + WEEK_S)
    assert_array_equal(imu.samples.accel, -reversed_force.accel)
    assert imu.samples.accel[:, 2].mean() == pytest.approx(-9.81, abs=1e-3)
    assert len(imu.stationary) == 1


def test_periods_without_a_fix_are_none():
    """Oracle: fixes begin after the minute at rest has ended."""
    assert len(prepare_imu([Device(standing(), AXES)], fixes(100, 160), 2008).stationary) == 1
    assert len(prepare_imu([Device(standing(), AXES)], fixes(170, 260), 2008).stationary) == 0


def test_a_segment_is_split_at_its_marks_and_at_the_ends_of_gaps():
    """Oracle: marks by hand; the velocity increments of a second at rest are those of gravity."""
    device = Device(standing(gap=(120.0, 120.5)), AXES)
    imu = prepare_imu([device], fixes(100, 160), 2008)
    lo, hi = WEEK_S + 110.0, WEEK_S + 130.0
    seconds, two = lo + np.arange(21.0), np.array([lo + 0.5, lo + 11.25])
    increments, (at_second, at_two) = imu.increments(lo, hi, seconds, two)
    assert_array_equal(increments.marks[at_second], seconds)
    assert_array_equal(increments.marks[at_two], two)
    assert increments.marks.size == 21 + 2 + 1  # the gap begins at a full second
    assert_allclose(increments.dvel[:, 2].sum(), -9.81 * 20.0, rtol=1e-4)
    assert imu.segments(lo, hi) == [(lo, hi)]


def test_a_long_gap_divides_the_recording():
    """Oracle: the ends of the gap by hand."""
    imu = prepare_imu([Device(standing(gap=(120.0, 123.0)), AXES)], fixes(100, 160), 2008)
    assert imu.segments(WEEK_S + 105.0, WEEK_S + 150.0) == [
        (WEEK_S + 105.0, WEEK_S + 120.0),
        (WEEK_S + 123.0, WEEK_S + 150.0),
    ]


def test_what_is_left_without_samples_keeps_what_they_said():
    """Oracle: identity."""
    imu = prepare_imu([Device(standing(), AXES)], fixes(100, 160), 2008)
    bare = imu.without_samples()
    assert_array_equal(bare.samples.time, imu.samples.time[[0, -1]])
    assert bare.stationary is imu.stationary
    assert len(imu.without_stationary().stationary) == 0
