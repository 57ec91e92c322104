"""Channels that hang, told from sensors that are still or coarse."""

from dataclasses import replace

import numpy as np
import pytest
from numpy.testing import assert_array_equal

from insgnss.navigation.prepare.stuck_channels import constant_runs, without_stuck_channels
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


@pytest.mark.parametrize(("interval_s", "samples"), [(0.01, 20), (0.004, 50), (0.05, 20)])
def test_a_hang_lasts_twenty_samples_and_a_fifth_of_a_second(imu, interval_s, samples):
    """Oracle: counts by hand, two samples less and two more."""
    every = replace(imu, time=1000.0 + interval_s * np.arange(imu.time.size))
    for held, dropped in ((samples - 2, 0), (samples + 2, samples + 1)):
        out = without_stuck_channels(stuck(every, 4, 5000, 5000 + held - 1), 5.0)
        assert imu.time.size - out.time.size == dropped


def test_a_coarse_channel_hangs_for_three_times_what_chance_makes(imu):
    """Oracle: of 20 000 samples of one bit chance makes runs of log2(20000) = 14.3, three times
    which is 43.
    """
    bit = np.where(np.random.default_rng(8).uniform(size=imu.time.size) < 0.5, -0.01, 0.01)
    for held, dropped in ((40, 0), (46, 45)):
        gyro = imu.gyro.copy()
        gyro[:, 2] = bit
        gyro[5000 : 5000 + held, 2] = 0.01
        gyro[[4999, 5000 + held], 2] = -0.01
        out = without_stuck_channels(replace(imu, gyro=gyro), 5.0)
        assert imu.time.size - out.time.size == dropped


@pytest.mark.parametrize(
    ("fastest", "zeros", "dropped"),
    [(0.049, 0, 0), (0.051, 0, 99), (0.2, 190, 99), (0.2, 210, 0)],
)
def test_zeros_of_a_gyro_that_hardly_turns_or_often_reads_zero_are_no_hang(
    imu, fastest, zeros, dropped
):
    """Oracle: rates below 0.05 rad/s meanwhile; zeros at more than 1 % of 20 000 other samples."""
    gyro = imu.gyro.copy()
    gyro[5000:5100] *= fastest / np.abs(gyro[5000:5100, 1:]).max()
    gyro[5000:5100, 0] = 0.0
    gyro[6000 : 6000 + 3 * zeros : 3, 0] = 0.0
    out = without_stuck_channels(replace(imu, gyro=gyro), 5.0)
    assert imu.time.size - out.time.size == dropped


@pytest.mark.parametrize(("changes", "dropped"), [(29, 0), (31, 100)])
def test_a_channel_hangs_while_another_one_moves(imu, changes, dropped):
    """Oracle: another channel changes at 30 of 100 samples; one that never changes counts less."""
    accel = imu.accel.copy()
    accel[5000:5101] = accel[5000]
    value = np.cumsum(np.diff(np.arange(101) * changes // 100, prepend=0))
    accel[5000:5101, 1] += 0.01 * value
    accel[5000:5101, 2] += 0.01 * (np.arange(101) // 10)
    out = without_stuck_channels(replace(imu, accel=accel), 5.0)
    assert imu.time.size - out.time.size == dropped


def test_runs_are_found_at_every_phase():
    """Oracle: brute force over all starts and lengths around the limit."""
    rng = np.random.default_rng(5)
    for first in range(40):
        for length in (19, 20, 21, 47, 60):
            x = rng.standard_normal(200)
            x[first : first + length] = 1.5
            expected = [(first, first + length - 1)] if length >= 20 else []
            assert constant_runs(x, 20) == expected
