"""Consistency over many flights: errors are as large as their covariance says, of the filter, the
smoother and the biases.

Each flight gives one epoch, so that the errors are independent. Every flight has its own gusts, IMU
errors (Table 5 with turn-on biases), fixes, and a start drawn from its own covariance.
`scripts/monte_carlo_nees.py` repeats it at size, alignment included.
"""

from dataclasses import replace

import numpy as np
import pytest
from flown import NO_GATE, Flown, error_of, fly, start_near
from scipy.stats import chi2

from insgnss.navigation.filter.filter import make_history, run_filter
from insgnss.navigation.filter.solution import solve

FLIGHTS, SECONDS, AT_S = 50, 36.0, 24.0333
SIGMA = np.array([0.5, 0.5, 0.5, 0.3, 0.3, 0.3, *np.radians([0.5, 0.5, 1.0])])


def normalised(error, P) -> float:
    """Error squared over its covariance."""
    return float(error @ np.linalg.solve(P, error))


def one_flight(seed: int) -> tuple[np.ndarray, np.ndarray]:
    """NEES of filter (9), smoother (9) and biases (6); and the smoother's nine errors over their
    sigmas.
    """
    flown = fly(SECONDS, seed, imu_hz=100.0, extra=np.array([AT_S]))
    draw = np.random.default_rng(1000 + seed).standard_normal(9)
    start = start_near(flown, SIGMA, draw * SIGMA)
    history = make_history(flown.problem.epochs, flown.problem.layout)
    run_filter(flown.problem, start, history)
    k, truth = int(flown.extra_epochs[0]), flown.true_nav(flown.extra_epochs)
    filtered = error_of(history.nav[[k]], truth)[0] - history.m[k, :9]
    solution = solve(flown.problem, start)
    smoothed = error_of(solution.nav[[k]], truth)[0]
    P = solution.nav_covariance()[k]
    nees = [
        normalised(filtered, history.P[k, :9, :9]),
        normalised(smoothed, P),
        bias_nees(flown, solution, k),
    ]
    return np.array(nees), smoothed / np.sqrt(np.diag(P))


def bias_nees(flown: Flown, solution, k: int) -> float:
    """Of the six channel biases against the slow errors that the simulator added."""
    truth = flown.sim.truth
    row = np.searchsorted(truth.trajectory.time, solution.time[k])
    M = flown.problem.layout.channel_sum()
    error = np.concatenate([truth.gyro_bias[row], truth.accel_bias[row]]) - M @ solution.x[k]
    return normalised(error, M @ solution.covariance(np.array([k]))[0, 9:, 9:] @ M.T)


@pytest.fixture(scope="module")
def flights() -> tuple[np.ndarray, np.ndarray]:
    nees, scaled = zip(*(one_flight(seed) for seed in range(FLIGHTS)), strict=True)
    return np.array(nees), np.array(scaled)


@pytest.mark.parametrize(
    ("column", "freedom"), [(0, 9), (1, 9), (2, 6)], ids=["filter", "smoother", "biases"]
)
def test_nees_lies_within_its_bounds(flights, column, freedom):
    """Oracle: chi-square; the sum over N flights lies within the two-sided 99 % bounds of N times 9
    (6) degrees of freedom.
    """
    low, high = chi2.ppf([0.005, 0.995], FLIGHTS * freedom)
    assert low < flights[0][:, column].sum() < high


def test_every_component_is_as_large_as_its_sigma(flights):
    """Oracle: chi-square of N degrees of freedom for each of nine components; 99.9 % bounds each,
    99 % together.
    """
    low, high = chi2.ppf([0.0005, 0.9995], FLIGHTS)
    squares = (flights[1] ** 2).sum(axis=0)
    assert (squares > low).all()
    assert (squares < high).all()


def test_errors_have_no_common_sign(flights):
    """Oracle: the mean of N independent normalised errors has a sigma of 1/sqrt(N); 3.5 of it for
    nine components.
    """
    assert (np.abs(flights[1].mean(axis=0)) < 3.5 / np.sqrt(FLIGHTS)).all()


def test_a_filter_that_believes_in_better_fixes_is_caught():
    """Oracle: chi-square; fixes claimed to be twice as good as they are must break the bound, or
    the tests above say nothing.
    """
    nees = []
    for seed in range(15):
        flown = fly(SECONDS, seed, imu_hz=100.0, extra=np.array([AT_S]))
        cov = 0.25 * flown.problem.epochs.position_cov
        problem = replace(
            flown.problem, epochs=flown.problem.epochs._replace(position_cov=cov), gate=NO_GATE
        )
        solution = solve(problem, start_near(flown, SIGMA))
        k = int(flown.extra_epochs[0])
        nees.append(
            normalised(
                error_of(solution.nav[[k]], flown.true_nav([k]))[0], solution.nav_covariance()[k]
            )
        )
    assert sum(nees) > chi2.ppf(0.995, 15 * 9)
