"""Discretisation against Van Loan's method, realisations against the covariance of the continuous
processes.
"""

import math

import numpy as np
import pytest
from filterpy.common import van_loan_discretization
from numpy.testing import assert_allclose
from scipy import stats
from scipy.signal import lfilter

from insgnss.base.errors import UsageError
from insgnss.navigation.noise_model.model import AxisNoise, GaussMarkov
from insgnss.noise.processes.realisation import (
    gauss_markov_bridge,
    gauss_markov_step,
    random_walk_step,
    simulate_noise,
)

STEPS = [
    (2.5, 0.3, 1.0),
    (0.5, 1.7, 2.0),
    (1.0, 1.0, 1.9999),
    (1.0, 1.0, 2.0001),
    (45.0, 2e-3, 0.1),
    (0.05, 1.0, 0.3),
]  # beyond dt/T = 10 Van Loan's exponential of +dt/T loses its digits


@pytest.mark.parametrize(("T", "q", "dt"), STEPS)
def test_gauss_markov_step_is_van_loans(T, q, dt):
    """Oracle: filterpy van_loan_discretization; 1e-9 is what its matrix exponential keeps."""
    phi, Q = van_loan_discretization(np.array([[-1.0 / T]]), np.array([[q]]), dt)
    assert_allclose(gauss_markov_step(T, q, dt), [phi[0, 0], Q[0, 0]], rtol=1e-9)


@pytest.mark.parametrize(("T", "q", "dt"), STEPS)
def test_the_bridge_is_van_loans(T, q, dt):
    """Oracle: filterpy van_loan_discretization of (e, integral of e), regressed on both ends."""
    _, Q = van_loan_discretization(
        np.array([[-1.0 / T, 0.0], [1.0, 0.0]]), np.array([[q], [0.0]]), dt
    )
    factor, variance = gauss_markov_bridge(T, q, dt)
    assert_allclose(factor, Q[0, 1] / Q[0, 0], rtol=1e-8)
    assert_allclose(variance, Q[1, 1] - Q[0, 1] ** 2 / Q[0, 0], rtol=1e-7)


def test_small_steps_keep_their_digits():
    """Oracle: leading terms of the Taylor series, at 500 Hz and 4737 s, where the textbook
    differences have no digit left.
    """
    T, q, dt = 4737.1, 0.33e-3, 0.002
    assert_allclose(gauss_markov_step(T, q, dt)[1], q**2 * dt * (1 - dt / T), rtol=1e-12)
    assert_allclose(gauss_markov_bridge(T, q, dt), [dt / 2, q**2 * dt**3 / 12], rtol=1e-12)


def test_random_walk_step_is_van_loans():
    """Oracle: filterpy van_loan_discretization of an integrator."""
    phi, Q = van_loan_discretization(np.zeros((1, 1)), np.array([[0.7]]), 0.3)
    assert_allclose(random_walk_step(0.7, 0.3), [phi[0, 0], Q[0, 0]], rtol=1e-12)


def mean_covariance(axis: AxisNoise, n: int, dt: float) -> np.ndarray:
    """Covariance (n, n) of the means over n intervals, by integrating the continuous
    autocovariances by hand.
    """
    i, j = np.indices((n, n))
    lag, first = np.abs(i - j), np.minimum(i, j)
    C = axis.turn_on_bias**2 + (axis.drift * dt) ** 2 * (i + 0.5) * (j + 0.5)
    C += np.where(lag == 0, axis.white_noise**2 / dt, 0.0)
    C += (axis.quantization / dt) ** 2 * np.select([lag == 0, lag == 1], [2.0, -1.0], 0.0)
    C += axis.random_walk**2 * dt * np.where(lag == 0, first + 1.0 / 3.0, first + 0.5)
    for p in axis.gauss_markov:
        u = dt / p.correlation_time_s
        same = 2.0 * (u - 1.0 + math.exp(-u)) / u**2
        C += p.sigma**2 * np.where(
            lag == 0, same, (1.0 - math.exp(-u)) ** 2 / u**2 * np.exp(-(np.maximum(lag, 1) - 1) * u)
        )
    return C


AXES = {
    "white": AxisNoise(white_noise=0.3),
    "bias": AxisNoise(turn_on_bias=2.0, white_noise=0.1),
    "gauss_markov": AxisNoise(gauss_markov=(GaussMarkov(0.4, 1.5), GaussMarkov(5.0, 0.2))),
    "random_walk": AxisNoise(random_walk=0.8),
    "drift": AxisNoise(drift=3.0, white_noise=0.1),
    "quantization": AxisNoise(quantization=0.2, white_noise=0.02),
    "all": AxisNoise(0.1, 0.02, 0.3, 0.2, 0.4, (GaussMarkov(0.4, 0.5), GaussMarkov(5.0, 0.2))),
}


@pytest.mark.parametrize("name", AXES)
def test_realisations_have_the_covariance_of_the_continuous_process(name):
    """Oracle: integrated autocovariances; each element within 5 sigma (Wishart), the whitened sum
    inside its 99.9 % chi-square bounds.
    """
    axis, n, dt, draws = AXES[name], 4, 0.25, 3000
    rng = np.random.default_rng(20180703)
    x = np.array([simulate_noise(axis, n, dt, rng) for _ in range(draws)])
    C = mean_covariance(axis, n, dt)
    S = x.T @ x / draws
    bound = 5.0 * np.sqrt((C**2 + np.outer(np.diag(C), np.diag(C))) / draws)
    assert (np.abs(S - C) < bound).all()
    whitened = np.linalg.solve(np.linalg.cholesky(C), x.T)
    low, high = stats.chi2.interval(0.999, n * draws)
    assert low < (whitened**2).sum() < high


def test_a_long_realisation_is_stationary_and_white_noise_sized():
    """Oracle: variance of the sum of independent stationary processes; bound 5 sigma from the
    effective number of samples.
    """
    process = GaussMarkov(0.05, 0.9)
    x = simulate_noise(
        AxisNoise(white_noise=0.05, gauss_markov=(process,)),
        200_000,
        0.01,
        np.random.default_rng(8),
    )
    u = 0.2
    expected = 0.05**2 / 0.01 + process.sigma**2 * 2.0 * (u - 1.0 + math.exp(-u)) / u**2
    independent = 200_000 * math.tanh(u)  # of an AR(1)'s squares: n (1 - phi^2) / (1 + phi^2)
    for part in np.split(x, 4):
        assert abs(part.var() - expected) < 5.0 * expected * math.sqrt(2.0 / (independent / 4))


def test_increments_are_means_times_the_interval():
    """Oracle: definition, on one seed; and a quantized increment sums to a bounded error."""
    axis = AXES["all"]
    mean = simulate_noise(axis, 50, 0.25, np.random.default_rng(1))
    increment = simulate_noise(axis, 50, 0.25, np.random.default_rng(1), quantity="increment")
    assert_allclose(increment, 0.25 * mean, rtol=1e-14)
    rounding = np.cumsum(
        simulate_noise(
            AxisNoise(quantization=1.0), 1000, 0.01, np.random.default_rng(2), quantity="increment"
        )
    )
    assert np.abs(rounding).max() <= math.sqrt(12.0)


def point_covariance(axis: AxisNoise, n: int, dt: float) -> np.ndarray:
    """Covariance (n, n) of the values at the ends of n intervals; white noise q^2/dt, rounding
    errors over dt.
    """
    i, j = np.indices((n, n))
    lag = np.abs(i - j)
    C = axis.turn_on_bias**2 + (axis.drift * dt) ** 2 * (i + 1.0) * (j + 1.0)
    C += np.where(lag == 0, axis.white_noise**2 / dt, 0.0)
    C += (axis.quantization / dt) ** 2 * np.select([lag == 0, lag == 1], [2.0, -1.0], 0.0)
    C += axis.random_walk**2 * dt * (np.minimum(i, j) + 1.0)
    return C + sum(p.sigma**2 * np.exp(-lag * dt / p.correlation_time_s) for p in axis.gauss_markov)


@pytest.mark.parametrize("name", AXES)
def test_values_at_the_ends_have_the_autocovariance_of_the_process(name):
    """Oracle: autocovariances; each element within 5 sigma (Wishart), the whitened sum inside its
    99.9 % chi-square bounds.
    """
    axis, n, dt, draws = AXES[name], 4, 0.25, 3000
    rng = np.random.default_rng(20180704)
    x = np.array([simulate_noise(axis, n, dt, rng, "point") for _ in range(draws)])
    C = point_covariance(axis, n, dt)
    S = x.T @ x / draws
    bound = 5.0 * np.sqrt((C**2 + np.outer(np.diag(C), np.diag(C))) / draws)
    assert (np.abs(S - C) < bound).all()
    whitened = np.linalg.solve(np.linalg.cholesky(C), x.T)
    low, high = stats.chi2.interval(0.999, n * draws)
    assert low < (whitened**2).sum() < high


def test_blocks_continue_one_long_recursion():
    """Oracle: scipy lfilter and cumsum over one long draw of the same generator; 40000 samples are
    more than two blocks.
    """
    n, dt, process = 40_000, 0.01, GaussMarkov(3.0, 0.4)
    phi, variance = gauss_markov_step(3.0, 0.4, dt)
    for quantity in ("point", "mean"):
        rng = np.random.default_rng(17)
        x = simulate_noise(
            AxisNoise(gauss_markov=(process,), random_walk=0.2), n, dt, rng, quantity
        )
        rng = np.random.default_rng(17)
        rng.standard_normal()
        w = rng.standard_normal(n + 1) * np.r_[process.sigma, np.full(n, math.sqrt(variance))]
        e = lfilter([1.0], [1.0, -phi], w)
        walk = np.r_[0.0, np.cumsum(0.2 * math.sqrt(dt) * rng.standard_normal(n + 1)[1:])]
        factor, rest = gauss_markov_bridge(3.0, 0.4, dt)
        rest = math.sqrt(rest + 0.2**2 * dt**3 / 12.0) * rng.standard_normal(n)
        mean = (factor * (e[:-1] + e[1:]) + 0.5 * dt * (walk[:-1] + walk[1:]) + rest) / dt
        assert_allclose(x, mean if quantity == "mean" else e[1:] + walk[1:], rtol=1e-11, atol=1e-13)


def test_a_silent_axis_is_silent():
    """Oracle: no process, no error."""
    assert not simulate_noise(AxisNoise(), 10, 0.01, np.random.default_rng(0)).any()


@pytest.mark.parametrize(
    ("n", "dt", "quantity"),
    [(0, 0.1, "mean"), (5, 0.0, "mean"), (5, math.nan, "mean"), (5, 0.1, "median")],
)
def test_impossible_requests_are_refused(n, dt, quantity):
    """Oracle: by contract."""
    with pytest.raises(UsageError):
        simulate_noise(AXES["white"], n, dt, np.random.default_rng(0), quantity)
