"""Calibration from stationary periods in many positions."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.stats import chi2
from turned import (
    ACCEL,
    FACES,
    GRAVITY,
    GYRO,
    HEIGHT,
    LATITUDE,
    positions,
    recorded,
    turned_by_hand,
)

from insgnss.base.errors import DataError
from insgnss.geodesy.rotation import rotation_from_rpy
from insgnss.navigation.prepare.stationarity import StationaryPeriods, stationary_periods
from insgnss.noise.multi_position.calibration import (
    calibrate_accelerometers,
    calibrate_gyroscopes,
    calibrate_multi_position,
    distinct_positions,
    find_turns,
    local_gravity,
)
from insgnss.noise.multi_position.result import USUAL_SIZES, sizes
from insgnss.records.states import State


@pytest.fixture(scope="module")
def ideal():
    return turned_by_hand(positions())


def rested(angles, sigma, samples, seed):
    """Stationary periods alone, in given positions, of exact gravity and white noise."""
    rng = np.random.default_rng(seed)
    k = len(angles)
    force = -GRAVITY * rotation_from_rpy(angles)[:, 2, :]
    mean = force @ ACCEL.response.T + ACCEL.bias + rng.normal(0.0, sigma / np.sqrt(samples), (k, 3))
    time = np.arange(k)[:, None] * 10.0 + [0.0, 5.0]
    ones = np.ones((k, 3))
    return StationaryPeriods(time, 0 * ones, mean, 1e-3 * ones, sigma * ones, np.full(k, samples))


def accel_truth():
    E = ACCEL.response - np.eye(3)
    return np.concatenate([ACCEL.bias, np.diag(E), [E[1, 0], E[2, 0], E[2, 1]]])


def gyro_truth():
    return np.concatenate([GYRO.bias, (GYRO.response - np.eye(3)).ravel()])


def within(nees, d, n):
    """Two-sided 99 % bounds of the mean of n chi-squares of d degrees of freedom."""
    low, high = chi2.ppf([0.005, 0.995], n * d) / n
    return low < np.mean(nees) < high


@pytest.mark.slow
def test_ideal_readings_give_the_calibration_back(ideal):
    """Oracle: exact motion; what remains is the interpolation of turns between samples of 10 ms."""
    got = calibrate_multi_position(recorded(ideal, 0, gyro=0.0, accel=0.0), float(LATITUDE), HEIGHT)
    assert got.positions >= 20
    np.testing.assert_allclose(got.accel.values, accel_truth(), rtol=0, atol=2e-6)
    np.testing.assert_allclose(got.gyro.values, gyro_truth(), rtol=0, atol=2e-6)


def test_standard_errors_of_the_accelerometers_are_those_of_the_errors():
    """Oracle: Monte Carlo; 60 sets of 18 positions; NEES of nine parameters within 99 % of
    chi-square.
    """
    angles, truth = positions(18), accel_truth()
    nees = []
    for seed in range(60):
        got = calibrate_accelerometers(rested(angles, 5e-3, 500, seed), GRAVITY, 0.0)
        error = truth - got.values
        nees.append(error @ np.linalg.solve(got.covariance, error))
    assert within(nees, 9, 60), np.mean(nees)


@pytest.mark.slow
def test_standard_errors_of_the_gyroscopes_are_those_of_the_errors(ideal):
    """Oracle: Monte Carlo over exact motion with white noise; 16 recordings; NEES of twelve
    parameters within 99 % of chi-square.
    """
    nees, both = [], []
    for seed in range(16):
        got = calibrate_multi_position(recorded(ideal, seed), float(LATITUDE), HEIGHT)
        error = gyro_truth() - got.gyro.values
        nees.append(error @ np.linalg.solve(got.gyro.covariance, error))
        error = accel_truth() - got.accel.values
        both.append(error @ np.linalg.solve(got.accel.covariance, error))
    assert within(nees, 12, 16), np.mean(nees)
    assert np.mean(both) < chi2.ppf(0.995, 16 * 9) / 16, np.mean(both)


@pytest.mark.slow
def test_biases_that_wander_between_positions_are_in_the_standard_errors(ideal):
    """Oracle: Monte Carlo; a bias of its own in each position (0.01 m/s^2, 20 deg/h), which is no
    white noise; 12 recordings.

    A variance factor of 15 degrees of freedom makes NEES / p follow Fisher's F, of mean 1.15 and,
    of 12, a spread of 0.2.
    """
    nees = []
    for seed in range(12):
        imu, rng = recorded(ideal, seed), np.random.default_rng(1000 + seed)
        position = np.minimum(np.arange(imu.time.size) // 690, 23)  # 5 s and 1.9 s at 100 Hz
        gyro, accel = rng.normal(0.0, 1e-4, (24, 3)), rng.normal(0.0, 0.01, (24, 3))
        got = calibrate_multi_position(
            replace(imu, gyro=imu.gyro + gyro[position], accel=imu.accel + accel[position]),
            float(LATITUDE),
            HEIGHT,
        )
        pairs = (
            (accel_truth() - got.accel.values, got.accel.covariance),
            (gyro_truth() - got.gyro.values, got.gyro.covariance),
        )
        nees.append([e @ np.linalg.solve(cov, e) / e.size for e, cov in pairs])
    mean = np.mean(nees, axis=0)
    assert (mean > 0.6).all(), mean
    assert (mean < 1.7).all(), mean


def test_six_faces_reach_the_closed_form():
    """Oracle: b = (a+ + a-) / 2 and s = (a+ - a-) / 2g - 1, their Cramer-Rao bounds sigma / sqrt(2)
    and sigma / (sqrt(2) g).
    """
    up = np.concatenate([np.eye(3), -np.eye(3)])
    b, s = np.array([0.1, -0.2, 0.05]), np.array([2e-3, -3e-3, 1e-3])
    mean = GRAVITY * up * (1.0 + s) + b
    sigma, ones = 1e-3, np.ones((6, 3))
    time = np.arange(6)[:, None] * 10.0 + [0.0, 5.0]
    got = calibrate_accelerometers(
        StationaryPeriods(time, 0 * ones, mean, ones, 0.02 * ones, np.full(6, 400)), GRAVITY, 0.0
    )
    np.testing.assert_allclose(got.values[:6], np.concatenate([b, s]), rtol=0, atol=1e-7)
    np.testing.assert_allclose(got.sigma[:3], sigma / np.sqrt(2.0), rtol=5e-3)
    np.testing.assert_allclose(got.sigma[3:6], sigma / np.sqrt(2.0) / GRAVITY, rtol=5e-3)
    verdicts = [p.verdict for p in got.parameters]
    assert verdicts[:6] == ["observed"] * 6
    assert verdicts[6:] == ["not observed"] * 3
    assert len(got.blind) == 3
    assert all("misalignment" in words and "scale" not in words for words in got.blind)


def test_an_axis_never_turned_over_is_named():
    """Oracle: with z always up within 60 deg, bias z and scale z are one unknown: gravity's
    projection varies with neither alone.
    """
    rng = np.random.default_rng(1)
    angles = np.column_stack(
        [rng.uniform(-0.2, 0.2, 12), rng.uniform(-0.2, 0.2, 12), rng.uniform(-3, 3, 12)]
    )
    got = calibrate_accelerometers(rested(angles, 5e-3, 500, 1), GRAVITY, 0.0)
    verdict = {p.name: p.verdict for p in got.parameters}
    assert verdict["bias z"] == verdict["scale_factor z"] == "not observed"
    assert any("bias z" in words and "scale_factor z" in words for words in got.blind)


def test_unknown_gravity_is_the_scale_factors_error():
    """Oracle: f grows with g: 0.02 / 9.81 on each scale factor, correlated by one."""
    near, far = (
        calibrate_accelerometers(rested(positions(), 5e-3, 500, 2), GRAVITY, sigma)
        for sigma in (0.0, 0.02)
    )
    np.testing.assert_allclose(far.sigma[3:6], 0.02 / GRAVITY, rtol=0.02)
    assert far.correlation[3, 4] > 0.99
    np.testing.assert_allclose(far.sigma[:3], near.sigma[:3], rtol=1e-9)
    assert local_gravity(None, 0.0) == (9.80665, 0.02)


def test_the_jacobian_of_a_turn_is_its_derivative(ideal):
    """Oracle: central difference through the kernel, over one turn."""
    from insgnss.navigation.innovations._kernels import propagate_turn

    imu = recorded(ideal, 4)
    turn = find_turns(imu, stationary_periods(imu))[5]

    def carried(p):
        Rt, J = np.empty((3, 3)), np.empty((3, 12))
        propagate_turn(
            turn.delta, turn.dt, np.linalg.inv(np.eye(3) + p[3:].reshape(3, 3)), p[:3], Rt, J
        )
        return Rt, J

    p = gyro_truth()
    Rt, J = carried(p)
    for j in range(12):
        h = np.zeros(12)
        h[j] = 1e-5
        dR = (carried(p + h)[0] - carried(p - h)[0]) @ Rt.T / 2e-5
        psi = -np.array([dR[2, 1] - dR[1, 2], dR[0, 2] - dR[2, 0], dR[1, 0] - dR[0, 1]]) / 2.0
        np.testing.assert_allclose(J[:, j], psi, atol=2e-4 * max(1.0, np.abs(psi).max()))


def test_gyroscopes_without_turns_have_their_bias_only(ideal):
    """Oracle: at rest a scale factor of a gyro acts on nothing but the Earth's rate."""
    imu = recorded(ideal, 5)
    found = stationary_periods(imu)
    got = calibrate_gyroscopes(
        found, [], calibrate_accelerometers(found, GRAVITY, 0.0), float(LATITUDE)
    )
    assert [p.verdict for p in got.parameters] == ["observed"] * 3 + ["not observed"] * 9
    assert np.abs(got.values[:3] - GYRO.bias).max() < 5e-5


def test_what_the_model_lacks_widens_the_standard_errors(ideal):
    """Oracle: a quadratic error of 0.05 m/s^2 at one g, which the model has not: residuals beyond
    white noise.
    """
    clean, crooked = (
        calibrate_multi_position(recorded(ideal, 6, wander=w), float(LATITUDE), HEIGHT).accel
        for w in (0.0, 0.05)
    )
    assert clean.variance_factor["gravity"] < 2.0
    assert crooked.variance_factor["gravity"] > 100.0
    assert (crooked.sigma[:3] > 5.0 * clean.sigma[:3]).all()


def test_too_few_positions_are_counted():
    """Oracle: six faces, ten times each."""
    periods = rested(np.tile(FACES, (10, 1)), 5e-3, 500, 0)
    assert distinct_positions(periods) == 6
    imu = turned_by_hand(FACES, hold_s=3.0)
    with pytest.raises(
        DataError, match=r"hand: 6 positions found in 6 stationary periods, 9 needed"
    ):
        calibrate_multi_position(recorded(imu, 0))


def test_gyros_of_other_axes_are_no_calibration(ideal):
    """Oracle: gyros that turn about other axes than the accelerometers cannot carry gravity."""
    imu = recorded(ideal, 0)
    with pytest.raises(
        DataError,
        match=r"hand: the gyros miss the vertical by .* deg \(limit 1\.1 deg\) after 23 turns",
    ):
        calibrate_multi_position(replace(imu, gyro=imu.gyro[:, [1, 2, 0]]))
    with pytest.raises(
        DataError, match=r"hand: the result is no calibration .*matrix: differs from identity by"
    ):
        calibrate_multi_position(replace(imu, accel=imu.accel * [1.12, 1.12, 0.95]))


def test_what_is_shown(ideal):
    """Oracle: 1 mg = 9.80665e-3 m/s^2, 1 deg/h = 4.848e-6 rad/s; the file holds the estimate."""
    got = calibrate_multi_position(recorded(ideal, 7))
    rows = {(p.sensor, p.name): p for p in got.parameters}
    value, sigma, unit = rows["accel", "bias x"].shown
    assert unit == "mg"
    assert value == pytest.approx(0.12 / 9.80665e-3, abs=0.5)
    assert rows["gyro", "bias y"].shown[0] == pytest.approx(-0.007 * 206264.806, abs=20.0)
    assert sigma < 1.0
    assert rows["accel", "scale_factor z"].verdict == "not observed"  # for want of the latitude
    np.testing.assert_array_equal(
        sizes(USUAL_SIZES, [State("bias", "x", "rad/s"), State("scale_factor", "x")]), [2e-4, 1e-3]
    )
    np.testing.assert_array_equal(got.calibration.accel.bias, got.accel.values[:3])
    assert got.calibration.gyro.response[0, 1] == got.gyro.values[4]
    assert "24 stationary periods in 22 positions, 23 turns between them" in got.summary()
    document = got.as_dict()
    assert document["gyro"]["parameters"][0]["name"] == "bias x"
    np.testing.assert_allclose(np.diag(document["accel"]["correlation"]), 1.0)
