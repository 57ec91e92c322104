"""Channels that hang, told from sensors that are still or coarse."""

from dataclasses import replace

import numpy as np
import pytest
from numpy.testing import assert_array_equal

from insgnss.prepare.stuck_channels import constant_runs, without_stuck_channels
from insgnss.records import ImuSamples


@pytest.fixture(scope="module")
def imu():
    rng = np.random.default_rng(3)
    time = 1000.0 + 0.01 * np.arange(20_000)
    return ImuSamples(
        time,
        0.01 * rng.standard_normal((time.size, 3)),
        [0, 0, -9.8] + 0.1 * rng.standard_normal((time.size, 3)),
    )


def stuck(imu, channel, first, last):
    values = np.hstack([imu.gyro, imu.accel])
    values[first : last + 1, channel] = values[first, channel]
    return replace(imu, gyro=values[:, :3], accel=values[:, 3:])


@pytest.mark.parametrize("channel", range(6))
def test_a_hang_becomes_a_gap_and_a_note(imu, channel):
    """Oracle: the samples that were held."""
    out = without_stuck_channels(stuck(imu, channel, 5003, 5152), 5.0)
    assert_array_equal(out.time, np.delete(imu.time, np.arange(5004, 5153)))
    assert "149 samples left out" in out.notes[0].found
    assert out.notes[0].verdict == "note"


def test_what_does_not_hang_is_left_alone(imu):
    """Oracle: noise; noise of a third of the resolution; a dead band that holds all three gyros; a
    dead sensor that another check names.
    """
    assert without_stuck_channels(imu, 5.0) is imu
    coarse = replace(imu, gyro=np.round(imu.gyro / 0.03) * 0.03)
    assert without_stuck_channels(coarse, 5.0) is coarse
    still = imu.gyro.copy()
    still[3000:4000] = 0.0
    rest = replace(imu, gyro=still)
    assert without_stuck_channels(rest, 20.0) is rest
    assert without_stuck_channels(stuck(imu, 1, 5000, 9000), 5.0).time.size == imu.time.size


def test_runs_are_found_at_every_phase():
    """Oracle: brute force over all starts and lengths around the limit."""
    rng = np.random.default_rng(5)
    for first in range(40):
        for length in (19, 20, 21, 47, 60):
            x = rng.standard_normal(200)
            x[first : first + length] = 1.5
            expected = [(first, first + length - 1)] if length >= 20 else []
            assert constant_runs(x, 20) == expected
