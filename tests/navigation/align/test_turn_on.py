"""The bias at turn-on."""

import numpy as np
import pytest
from scipy.stats import chi2

from insgnss.base.errors import DataError
from insgnss.geodesy.earth import EARTH_RATE, normal_gravity
from insgnss.geodesy.rotation import rotation_from_rpy
from insgnss.navigation.align.turn_on import turn_on_bias
from insgnss.navigation.prepare.stationarity import StationaryPeriods, stationary_periods
from insgnss.simulation.scenario import ImuOptions, simulate_flight

LATITUDE, HEIGHT = 0.81, 500.0
GYRO_PRIOR, ACCEL_PRIOR = np.full(3, 5e-4), np.full(3, 0.03)
GYRO_STD, ACCEL_STD, SAMPLES = 5e-4, 5e-3, 4000


def at_rest(rpy, gyro_bias, accel_bias, rng=None, k=1):
    """Stationary periods of a body, by (U.1, U.2) and with noise of the means."""
    C_nb = rotation_from_rpy(rpy)
    gyro = C_nb.T @ (EARTH_RATE * np.array([np.cos(LATITUDE), 0.0, -np.sin(LATITUDE)])) + gyro_bias
    accel = C_nb.T @ np.array([0.0, 0.0, -float(normal_gravity(LATITUDE, HEIGHT))])
    noise = np.zeros((2, k, 3)) if rng is None else rng.normal(size=(2, k, 3)) / np.sqrt(SAMPLES)
    accel = accel * (
        1.0 if rng is None else 1.0 + rng.normal(0.0, 5e-4) / 9.81
    )  # gravity is not quite the normal one
    ones = np.ones((k, 3))
    time = np.arange(k)[:, None] * 50.0 + [0.0, 40.0]
    return StationaryPeriods(
        time,
        gyro + GYRO_STD * noise[0],
        accel + accel_bias + ACCEL_STD * noise[1],
        GYRO_STD * ones,
        ACCEL_STD * ones,
        np.full(k, SAMPLES),
    )


def estimate(periods):
    return turn_on_bias(periods, np.eye(3), LATITUDE, HEIGHT, GYRO_PRIOR, ACCEL_PRIOR)


def test_errors_are_as_large_as_the_covariance_says():
    """Oracle: Monte Carlo over biases, attitudes and headings; NEES of three gyros and three
    accelerometers within 99 % of chi-square.
    """
    rng = np.random.default_rng(8)
    n = 200
    nees = np.empty((n, 2))
    for row in nees:
        gyro, accel = rng.normal(0.0, GYRO_PRIOR), rng.normal(0.0, ACCEL_PRIOR)
        rpy = np.array([*rng.normal(0.0, 0.1, 2), rng.uniform(-np.pi, np.pi)])
        got = estimate(at_rest(rpy, gyro, accel, rng))
        for j, (error, cov) in enumerate(
            ((gyro - got.gyro, got.gyro_cov), (accel - got.accel, got.accel_cov))
        ):
            row[j] = error @ np.linalg.solve(cov, error)
    low, high = chi2.ppf([0.005, 0.995], 3 * n) / n
    assert (nees.mean(axis=0) > low * 0.95).all(), nees.mean(
        axis=0
    )  # a circle's spread is narrower than a Gaussian's at the tails
    assert (nees.mean(axis=0) < high).all(), nees.mean(axis=0)


def test_what_a_level_stand_tells():
    """Oracle: (U.1, U.2) by hand; level at unknown heading: vertical gyro to white noise,
    horizontal to the Earth's rate over sqrt 2.
    """
    gyro, accel = np.array([3e-4, -2e-4, 1e-4]), np.array([0.0, 0.0, 0.02])
    got = estimate(at_rest([0.0, 0.0, 0.7], gyro, accel))
    level = np.hypot(EARTH_RATE * np.cos(LATITUDE) / np.sqrt(2.0), GYRO_STD / np.sqrt(SAMPLES))
    np.testing.assert_allclose(got.sigma[:2], level, rtol=0.01)
    assert got.sigma[2] == pytest.approx(GYRO_STD / np.sqrt(SAMPLES), rel=0.01)
    assert got.gyro[2] == pytest.approx(1e-4, abs=1e-7)
    np.testing.assert_allclose(got.sigma[3:5], 0.03, rtol=1e-6)
    assert got.sigma[5] == pytest.approx(np.hypot(5e-4, ACCEL_STD / np.sqrt(SAMPLES)), rel=0.01)
    assert got.accel == pytest.approx([0.0, 0.0, 0.02], abs=2e-5)
    assert "heading unknown" in got.summary()


def test_scattered_periods_count_for_their_scatter():
    """Oracle: means that jump by 1e-5 rad/s; the standard error of three is sqrt(sum of squares / 2
    / 3).
    """
    calm = at_rest([0.0, 0.0, 0.0], np.zeros(3), np.zeros(3), k=3)
    jump = 1e-5 * np.array([[1.0, 0, 0], [0, 0, 1.0], [-1.0, 0, -1.0]])
    shaken = StationaryPeriods(
        calm.time,
        calm.gyro_mean + jump,
        calm.accel_mean,
        calm.gyro_std,
        calm.accel_std,
        calm.samples,
    )
    assert estimate(shaken).sigma[2] == pytest.approx(1e-5 / np.sqrt(3.0), rel=0.3)
    assert estimate(calm).sigma[2] == pytest.approx(GYRO_STD / np.sqrt(3 * SAMPLES), rel=0.02)


def test_the_stand_of_a_simulated_flight():
    """Oracle: the simulator's own slow errors, NavChip noise; three sigma, the wander of the stand
    (a Gauss-Markov of 2.5 s) added.
    """
    flown = simulate_flight(
        "ign8", 3.0, seed=5, imu=ImuOptions(rate_hz=100.0, axes="right backward down")
    )
    found = stationary_periods(flown.imu, flown.gnss)
    C = np.array([[0.0, -1, 0], [1, 0, 0], [0, 0, 1]])
    got = turn_on_bias(found, C, float(flown.gnss.lat[0]), 500.0, GYRO_PRIOR, ACCEL_PRIOR)
    stand = found.index_of(flown.truth.trajectory.time) == 0
    truth = np.concatenate(
        [flown.truth.gyro_bias[stand].mean(axis=0), flown.truth.accel_bias[stand].mean(axis=0)]
    )
    error = np.concatenate([got.gyro, got.accel]) - truth
    assert (np.abs(error) < 3.0 * got.sigma + 2e-5).all(), error / got.sigma


def test_no_rest_and_no_single_attitude_are_refused():
    """Oracle: the house rule."""
    one, other = (at_rest([roll, 0.0, 0.0], np.zeros(3), np.zeros(3)) for roll in (0.0, 0.3))
    both = StationaryPeriods(
        *(
            np.concatenate([getattr(one, n), getattr(other, n)])
            for n in StationaryPeriods.__dataclass_fields__
        )
    )
    with pytest.raises(DataError, match=r"tilted by 8\.\d deg \(limit 5 deg\)"):
        estimate(both)
    with pytest.raises(DataError, match="no stationary period"):
        estimate(one.where(one.time[:, 0] >= 1e6))
