"""Likelihood of the innovations and its slopes against the density of all measurements at once, the
filter itself and differences.
"""

from dataclasses import replace

import numpy as np
import pytest
from flown import NO_GATE, Flown, fly, start_near
from linearised_interval import linearise_interval
from numpy.testing import assert_allclose, assert_array_equal

from insgnss.base.errors import UsageError
from insgnss.navigation.filter.filter import (
    INCREMENT_BLOCK_S,
    gate_from_sigma,
    make_history,
    run_filter,
)
from insgnss.navigation.filter.layout import FixErrors, state_layout
from insgnss.navigation.filter.problem import InitialState
from insgnss.navigation.filter.solution import Solution, solve
from insgnss.navigation.filter.strapdown import kernel_earth, kernel_intervals
from insgnss.navigation.innovations.likelihood import (
    LIKELIHOOD_PARAMETERS,
    LinearSegment,
    available,
    evaluate,
    linear_segment,
)
from insgnss.navigation.noise_model.model import (
    AxisNoise,
    GaussMarkov,
    NoiseModel,
    load_noise_model,
)
from insgnss.simulation.raw_gnss.receiver import GnssOptions

SIGMA = np.array([0.5, 0.5, 0.5, 0.3, 0.3, 0.3, *np.radians([1.0, 1.0, 5.0])])
CORRELATED = FixErrors(
    lever_arm_m=0.1,
    gm_sigma=(1.0, 1.0, 1.5),
    correlation_time_s=5.0,
    unfixed_gm_sigma=0.7,
    unfixed_correlation_time_s=3.0,
    velocity_gm_sigma_mps=0.05,
    velocity_correlation_time_s=2.0,
)
NAMES = tuple(name for name in LIKELIHOOD_PARAMETERS if name != "white_noise")
THETA = np.log([1.5, 0.7, 1.3, 0.8, 1.2, 0.9, 1.4, 1.2, 0.8])  # in the order of NAMES


def scaled(factors: np.ndarray) -> NoiseModel:
    """A noise model of every kind of driven state, with NAMES' factors on its four densities."""
    gyro = AxisNoise(
        5e-5 * factors[0], 0.0, 5e-4, 1e-6 * factors[2], 0.0, (GaussMarkov(2.5, 8e-5 * factors[2]),)
    )
    accel = AxisNoise(
        5e-4 * factors[1], 0.0, 2e-2, 0.0, 0.0, (GaussMarkov(40.0, 6e-4 * factors[3]),)
    )
    return NoiseModel("every kind", "made up", (gyro,) * 3, (accel,) * 3)


def solution_of(flown: Flown) -> Solution:
    return solve(flown.problem, start_near(flown, SIGMA), separations=0)


@pytest.fixture(scope="module")
def short() -> Solution:
    """Three seconds with positions of two groups, velocities and their correlated errors."""
    layout = state_layout(scaled(np.ones(len(NAMES))), fixes=CORRELATED)
    flown = fly(3.0, seed=3, imu_hz=100.0, velocity=True, layout=layout, gate=NO_GATE)
    epochs = flown.problem.epochs
    group = (np.arange(epochs.time.size) // 5) % 2
    problem = replace(flown.problem, epochs=epochs._replace(group=group))
    return solution_of(replace(flown, problem=problem))


@pytest.fixture(scope="module")
def disturbed() -> Solution:
    """Twenty seconds whose fixes are outliers now and then."""
    gnss = GnssOptions(outlier_fraction=0.05, outlier_m=(1.0, 3.0))
    return solution_of(fly(20.0, seed=4, imu_hz=100.0, gate=gate_from_sigma(5.0), gnss=gnss))


def density_of_all(
    solution: Solution, segment: LinearSegment, theta: np.ndarray
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Mean, covariance and values of all measurements of a segment, as one normal density."""
    factors = np.exp(theta)
    correlated = tuple(c * factors[6] for c in CORRELATED.gm_sigma or ())
    problem, n = solution.problem, solution.problem.layout.size
    fixes = replace(
        CORRELATED,
        gm_sigma=correlated,
        unfixed_gm_sigma=factors[7] * (CORRELATED.unfixed_gm_sigma or 0.0),
        velocity_gm_sigma_mps=factors[8] * (CORRELATED.velocity_gm_sigma_mps or 0.0),
    )
    layout = state_layout(scaled(factors), fixes=fixes)
    imu, lin = layout.kernel_model(INCREMENT_BLOCK_S, problem.aiding_interval_s), segment.linear
    intervals, earth, stop = (
        kernel_intervals(problem.inc),
        kernel_earth(problem.frame),
        problem.inc.stop,
    )
    mean, P = segment.linear.mean0.copy(), segment.linear.P0.sum(axis=0)
    P[9:, 9:] = np.diag(layout.sigma0**2)
    cross, rows, means, noise = np.zeros((0, n)), np.zeros((0, 0)), [], []
    z = []
    for e in range(stop.size):
        if e > 0:
            step = linearise_interval(
                intervals,
                stop[e - 1],
                stop[e],
                solution.nav[e - 1],
                solution.x[e - 1],
                imu,
                earth,
                problem.epochs.time[e - 1],
            )
            mean, P, cross = (
                step.Phi @ mean + lin.gap[e],
                step.Phi @ P @ step.Phi.T + step.Q,
                cross @ step.Phi.T,
            )
        for j in np.flatnonzero(lin.there[e]):
            H = lin.H[e, j]
            rows = np.block([[rows, cross @ H.T], [H @ cross.T, H @ P @ H.T]])
            cross = np.vstack([cross, H @ P])
            means.append(H @ mean)
            z.append(lin.nu[e, j, :, 0])
            noise.append(lin.R[e, j] * factors[4 + j] ** 2)
    for k, R in enumerate(noise):
        rows[3 * k : 3 * k + 3, 3 * k : 3 * k + 3] += R
    return np.concatenate(means), rows, np.concatenate(z)


@pytest.mark.parametrize("theta", [np.zeros(len(NAMES)), THETA], ids=["static", "scaled"])
def test_cost_is_the_density_of_all_measurements_at_once(short, theta):
    """Oracle: one normal density of 62 triples, its covariance from transitions and noise of a
    model that has the factors itself.
    """
    segment = linear_segment(short, NAMES)
    assert np.count_nonzero(segment.linear.there) > 55
    mean, covariance, z = density_of_all(short, segment, theta)
    cost = np.linalg.slogdet(covariance)[1] + (z - mean) @ np.linalg.solve(covariance, z - mean)
    assert evaluate([segment], theta).cost == pytest.approx(cost, abs=1e-5)


def test_slopes_of_some_factors_are_those_that_all_have(short):
    """Oracle: the slopes of all factors, which are held against differences."""
    segment, free = linear_segment(short, NAMES), np.arange(len(NAMES)) % 2 == 1
    every, some = evaluate([segment], THETA), evaluate([segment], THETA, free)
    assert some.cost == every.cost
    assert_array_equal(some.gradient[free], every.gradient[free])
    assert_array_equal(some.information[np.ix_(free, free)], every.information[np.ix_(free, free)])
    assert np.isnan(some.gradient[~free]).all()
    assert np.isnan(some.information[~free]).all()


def test_two_segments_count_twice(short):
    """Oracle: independent data multiply their densities."""
    segment = linear_segment(short, NAMES)
    one, two = evaluate([segment], THETA), evaluate([segment, segment], THETA)
    assert two.cost == pytest.approx(2.0 * one.cost)
    assert_allclose(two.gradient, 2.0 * one.gradient)
    assert len(two.white) == 2 * len(one.white)


def test_gradient_is_the_derivative_of_the_cost(short):
    """Oracle: central difference; its own error is of the third derivative, 1e-6 of the second one
    or so.
    """
    segment, h = linear_segment(short, NAMES), 1e-4
    at = evaluate([segment], THETA)
    numeric = [
        (evaluate([segment], THETA + h * d).cost - evaluate([segment], THETA - h * d).cost)
        / (2.0 * h)
        for d in np.eye(len(NAMES))
    ]
    assert_allclose(at.gradient, numeric, rtol=1e-5, atol=1e-5)


def test_expected_information_is_that_of_the_density_of_all_measurements(short):
    """Oracle: tr(C^-1 C_i C^-1 C_j) of the one normal density; no draws, so that nothing is left to
    chance.

    C is linear in the squares of the factors, so that a factor of 100 gives the derivative C_i
    exactly. The information (L.5) is a constant and a quadratic form of the measurements about
    their mean, since y' is linear in them: its expectation is the constant and the sum of what each
    column of L adds to it, C = L L'. Both sides agree to 1e-9, what the condition of C, 1e7,
    leaves.
    """
    segment, factor = linear_segment(short, NAMES), 100.0
    mean, C, _ = density_of_all(short, segment, np.zeros(len(NAMES)))
    scaled_C = [density_of_all(short, segment, np.log(factor) * d)[1] for d in np.eye(len(NAMES))]
    slopes = [np.linalg.solve(C, 2.0 * (other - C) / (factor**2 - 1.0)) for other in scaled_C]
    theory = np.array([[np.sum(a * b.T) for a in slopes] for b in slopes])
    constant = evaluate([measured(segment, mean)], np.zeros(len(NAMES))).information
    expected = constant.copy()
    for column in np.linalg.cholesky(C).T:
        expected += (
            evaluate([measured(segment, mean + column)], np.zeros(len(NAMES))).information
            - constant
        )
    scale = np.sqrt(np.diag(theory))
    assert_allclose(
        expected / np.outer(scale, scale), theory / np.outer(scale, scale), rtol=0, atol=1e-7
    )
    share = np.diag(constant) / np.diag(theory)
    assert share.min() < 0.1  # both terms of (L.5) count
    assert share.max() > 0.8


def measured(segment: LinearSegment, z: np.ndarray) -> LinearSegment:
    """The segment with other measurements, in the order of `density_of_all`."""
    nu = segment.linear.nu.copy()
    nu[..., 0][segment.linear.there] = z.reshape(-1, 3)
    return replace(segment, linear=segment.linear._replace(nu=nu))


def test_innovations_are_those_of_the_filter(disturbed):
    """Oracle: the filter's own pass about the same nominal, outliers rejected as it does."""
    segment = linear_segment(disturbed, ("gyro.white_noise", "fixes.position"))
    at = evaluate([segment], np.zeros(2))
    problem = disturbed.problem
    history = make_history(problem.epochs, problem.layout)
    history.nav[:], history.x[:] = disturbed.nav, disturbed.x
    run_filter(
        problem,
        InitialState(
            disturbed.nav[0], disturbed.x[0], segment.linear.mean0, segment.linear.P0.sum(axis=0)
        ),
        history,
        closed_loop=False,
    )
    used = history.verdict[:, 0] == 1
    assert at.rejected == np.count_nonzero(history.verdict[:, 0] == 2) > 3
    assert_allclose(at.white, history.y[used, :3] / np.sqrt(history.S[used, :3]), rtol=0, atol=1e-9)
    assert_allclose(at.nis, history.nis[history.verdict[:, 0] > 0, 0], rtol=1e-9)


def test_rejected_fixes_cost_their_gate(disturbed):
    """Oracle: (C.1) on the filter's own store."""
    segment = linear_segment(disturbed, ("fixes.position",))
    problem, theta = disturbed.problem, np.log([1.3])
    wide = replace(problem, layout=replace(problem.layout, white_scale=(1.3, 1.3, 1.3)))
    history = make_history(wide.epochs, wide.layout)
    history.nav[:], history.x[:] = disturbed.nav, disturbed.x
    run_filter(
        wide,
        InitialState(
            disturbed.nav[0], disturbed.x[0], segment.linear.mean0, segment.linear.P0.sum(axis=0)
        ),
        history,
        closed_loop=False,
    )
    used, lost = history.verdict[:, 0] == 1, history.verdict[:, 0] == 2
    log_R = np.linalg.slogdet(1.3**2 * problem.epochs.position_cov[used | lost])[1]
    S, y = history.S[used, :3], history.y[used, :3]
    told = np.sum(log_R) + np.sum(np.log(S) + y**2 / S) + lost.sum() * problem.gate
    assert evaluate([segment], theta).cost == pytest.approx(told, rel=1e-10)


def test_parameters_are_those_that_the_flight_has(short, disturbed):
    """Oracle: the states and measurements of the two flights, and the rule of one factor for one
    density.
    """
    assert set(available(short.problem.layout, velocity=True)) == set(LIKELIHOOD_PARAMETERS)
    plain = available(state_layout(load_noise_model("consumer")), velocity=False)
    assert "fixes.velocity" not in plain
    assert "fixes.correlated" not in plain
    with pytest.raises(UsageError, match=r"fixes\.velocity"):
        linear_segment(disturbed, ("fixes.velocity",))
    with pytest.raises(UsageError, match="both"):
        linear_segment(disturbed, ("white_noise", "gyro.white_noise"))
