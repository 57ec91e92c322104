"""A clock of the IMU that was set ahead in flight is told from a pause of the recording."""

from dataclasses import replace

import numpy as np
import pytest

from insgnss.navigation.recognise.claims import check_set_clock
from insgnss.simulation.scenario import ImuOptions, simulate_flight


@pytest.fixture(scope="module")
def flown():
    return simulate_flight("ign8", 4.0, seed=5, imu=ImuOptions(rate_hz=50.0), start_in_air=True)


@pytest.mark.slow
@pytest.mark.parametrize("by_s", [1.7, 3.7, 12.3, 3600.0])
@pytest.mark.parametrize("right", ["before", "after"])
def test_a_clock_that_is_set_ahead_is_named_with_its_step(flown, by_s, right):
    """Oracle: the step that was planted, on the side whose stamps it was planted in."""
    imu, row = flown.imu, len(flown.imu) // 2
    wrong = np.arange(len(imu)) >= row if right == "before" else np.arange(len(imu)) < row
    moved = replace(imu, time=imu.time + wrong * (by_s if right == "before" else -by_s))
    check = check_set_clock(moved, flown.gnss)
    assert check is not None
    assert check.verdict == "contradiction"
    assert f"was set by {by_s:+.3f} s between" in check.found
    side, sign = ("after", -1.0) if right == "before" else ("up to", 1.0)
    assert f"add {sign * by_s:+.3f} s to the stamps {side}" in check.advice


@pytest.mark.slow
@pytest.mark.parametrize("seconds", [1.5, 4.0, 30.0])
def test_a_pause_is_none(flown, seconds):
    """Oracle: the recording without some seconds; its clock is right throughout."""
    imu, half = flown.imu, np.median(flown.imu.time)
    kept = np.abs(imu.time - half) > 0.5 * seconds
    paused = replace(imu, time=imu.time[kept], gyro=imu.gyro[kept], accel=imu.accel[kept])
    assert check_set_clock(paused, flown.gnss) is None
    assert check_set_clock(imu, flown.gnss) is None
    late = flown.gnss[flown.gnss.time < half]  # the fixes end before the pause does
    assert check_set_clock(paused, late) is None
