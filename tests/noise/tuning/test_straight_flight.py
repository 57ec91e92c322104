"""Spectrum in straight flight: levels and lines that were put in, and its segments."""

from dataclasses import replace

import numpy as np
import pytest
from flown import fly, start_near
from numpy.testing import assert_allclose

from insgnss.navigation.filter.solution import Solution, solve
from insgnss.noise.tuning.in_flight.straight_flight import (
    LOWEST_HZ,
    straight_flight,
    straight_segments,
)
from insgnss.records import ImuSamples

RATE, SECONDS, Q_GYRO, Q_ACCEL = 200.0, 120.0, 5e-5, 5e-4
WHOLE = np.array([[1.0, 119.0]])
RIGHT_DOWN = np.array(
    [[0.0, 1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, -1.0]]
)  # samples' axes to body: x and y change places
SIGMA = np.array([0.5, 0.5, 0.5, 0.3, 0.3, 0.3, *np.radians([1.0, 1.0, 5.0])])


def samples(seed: int = 0, line: tuple[float, float] = (50.0, 0.0)) -> ImuSamples:
    """White noise on a constant and a slope; a line of (frequency, amplitude) in m/s^2 on the
    accelerometer's x.
    """
    rng = np.random.default_rng(seed)
    time = np.arange(1, int(RATE * SECONDS) + 1) / RATE
    gyro = Q_GYRO * np.sqrt(RATE) * rng.standard_normal((time.size, 3)) + 0.01
    accel = (
        Q_ACCEL * np.sqrt(RATE) * rng.standard_normal((time.size, 3))
        + [0.1, 0.2, -9.8]
        + 1e-3 * time[:, None]
    )
    accel[:, 0] += line[1] * np.sin(2.0 * np.pi * line[0] * time)
    return ImuSamples(time, gyro, accel, "mean_rate", gps_week=2000)


def test_white_noise_is_a_level_line_at_its_root_density():
    """Oracle: the density it was drawn with; of 58 windows a mean over a hundred and more bins is
    known to 1 %, over the ten of the lowest octave to 2.5 %."""
    found = straight_flight(samples(), np.eye(3), WHOLE)
    assert found is not None
    level = np.repeat([Q_GYRO, Q_ACCEL], 3)
    assert found.lines == ()
    assert found.windows == 58
    assert found.duration_s == 118.0
    assert_allclose(found.mean_with_lines, level, rtol=0.02)
    assert_allclose(found.mean_without_lines, level, rtol=0.02)
    assert_allclose(found.upper_limit, level, rtol=0.08)
    assert_allclose(found.level, level, rtol=0.02)
    assert found.level_from_hz == pytest.approx(
        np.full(6, 3.125)
    )  # four octaves below a quarter of the rate
    above = found.frequency_hz > LOWEST_HZ
    assert_allclose(np.median(found.floor[:, above], axis=1), level, rtol=0.03)


def test_the_floor_of_a_single_window_is_a_mean_and_no_median():
    """Oracle: the density that was drawn: a periodogram is chi-square of two degrees of freedom,
    its median 0.69 of its mean.

    The mean over six channels and a hundred bins and more is known to 4 %.
    """
    found = [
        straight_flight(samples(seed), np.eye(3), np.array([[10.0, 14.1]])) for seed in range(10)
    ]
    assert all(f is not None and f.windows == 1 for f in found)
    above = found[0].frequency_hz > 10.0
    power = (
        np.mean([f.floor[:, above] ** 2 for f in found], axis=(0, 2))
        / np.repeat([Q_GYRO, Q_ACCEL], 3) ** 2
    )
    assert power.mean() == pytest.approx(1.0, abs=0.08)


def test_a_line_is_found_with_frequency_amplitude_and_what_it_does():
    """Oracle: amplitude over root two, and its integral; the mean density counts it as a^2 / 2 of
    variance, the limit does not.
    """
    f, a = 47.3, 0.2
    found = straight_flight(samples(1, (f, a)), RIGHT_DOWN, WHOLE)
    assert found is not None
    (line,) = found.lines
    assert line.channel == "accel y"  # of the body
    assert line.frequency_hz == pytest.approx(f, abs=0.1)
    assert line.rms == pytest.approx(a / np.sqrt(2.0), rel=0.02)
    assert line.swing == pytest.approx(a / np.sqrt(2.0) / (2.0 * np.pi * f), rel=0.02)
    counted = np.sqrt(Q_ACCEL**2 + 0.5 * (0.5 * a**2) / (RATE / 2.0 - LOWEST_HZ))
    assert found.mean_with_lines[4] == pytest.approx(counted, rel=0.03)
    assert found.mean_without_lines[4] == pytest.approx(Q_ACCEL, rel=0.04)
    assert found.upper_limit[4] == pytest.approx(Q_ACCEL, rel=0.06)


def test_noise_that_is_not_white_has_no_level_but_a_limit():
    """Oracle: a running mean of four samples has the power (sin(4 w) / (4 sin w))^2, w = pi f /
    rate, none at a quarter of the rate.
    """
    rates = samples(3)
    smooth = np.apply_along_axis(np.convolve, 0, rates.gyro, np.full(4, 0.25), mode="same")
    found = straight_flight(replace(rates, gyro=smooth), np.eye(3), WHOLE)
    assert found is not None
    assert np.isnan(found.level[:3]).all()
    assert np.isfinite(found.level[3:]).all()
    w = np.pi * np.linspace(25.0, 50.0, 500) / RATE
    assert_allclose(
        found.upper_limit[:3],
        Q_GYRO * np.sqrt(np.mean((np.sin(4.0 * w) / (4.0 * np.sin(w))) ** 2)),
        rtol=0.05,
    )


def test_increments_are_the_same_and_gaps_are_left_out():
    """Oracle: the mean rates that the increments are of, and the windows that a gap leaves."""
    rates = samples(2)
    whole = straight_flight(rates, np.eye(3), WHOLE)
    increments = replace(
        rates, gyro=rates.gyro / RATE, accel=rates.accel / RATE, quantity="increments"
    )
    same = straight_flight(increments, np.eye(3), WHOLE)
    assert whole is not None
    assert same is not None
    assert_allclose(same.density, whole.density, rtol=1e-9)
    keep = (rates.time < 60.0) | (rates.time > 61.0)
    gapped = straight_flight(
        replace(rates, time=rates.time[keep], gyro=rates.gyro[keep], accel=rates.accel[keep]),
        np.eye(3),
        WHOLE,
    )
    assert gapped is not None
    assert 53 <= gapped.windows <= 56
    assert straight_flight(rates, np.eye(3), np.zeros((0, 2))) is None
    assert straight_flight(rates, np.eye(3), np.array([[10.0, 12.0]])) is None


@pytest.fixture(scope="module")
def lines_and_turns() -> Solution:
    flown = fly(90.0, seed=7, imu_hz=100.0, line_length_m=250.0)
    return solve(flown.problem, start_near(flown, SIGMA), separations=0)


def test_segments_are_straight_and_there_are_some(lines_and_turns):
    """Oracle: the course of the velocity itself; lines of 250 m at 14 m/s last for 18 s."""
    s = lines_and_turns
    segments = straight_segments(s)
    assert len(segments) >= 2
    assert (segments[:, 1] - segments[:, 0]).min() >= 8.0
    course = np.unwrap(np.arctan2(s.nav[:, 4], s.nav[:, 3]))
    for begin, end in segments:
        inside = (s.time >= begin) & (s.time <= end)
        assert np.degrees(np.ptp(course[inside])) < 30.0
    total = np.sum(segments[:, 1] - segments[:, 0])
    assert total < 0.9 * (s.time[-1] - s.time[0])
