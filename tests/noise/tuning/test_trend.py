"""The warm-up test against simulated noise, with and without a trend."""

import numpy as np
from numpy.testing import assert_allclose

from insgnss.navigation.noise_model.model import AxisNoise, GaussMarkov, load_noise_model
from insgnss.noise.processes.realisation import simulate_noise
from insgnss.noise.tuning.trend import covariance_of_means, warm_up

DEG_H = np.pi / 180.0 / 3600.0
K, LENGTH = 128, 14400.0


def test_covariance_of_means_is_that_of_simulated_ones():
    """Oracle: 10000 simulated series of six means; an element's Monte Carlo error is sqrt((V_ii
    V_jj + V_ij^2) / 10000), five of them.
    """
    axis = AxisNoise(
        1e-4,
        quantization=3e-4,
        random_walk=4e-6,
        gauss_markov=(GaussMarkov(7.0, 3e-5), GaussMarkov(700.0, 3e-6)),
    )
    rng = np.random.default_rng(7)
    x = np.array([simulate_noise(axis, 6, 5.0, rng) for _ in range(10_000)])
    V = covariance_of_means(axis, 6, 5.0)
    error = np.sqrt((np.outer(np.diag(V), np.diag(V)) + V**2) / len(x))
    assert (np.abs(x.T @ x / len(x) - V) < 5.0 * error).all()
    drift = AxisNoise(drift=1e-6)
    assert_allclose(covariance_of_means(drift, 3, 2.0), 1e-12 * np.outer([1, 3, 5], [1, 3, 5]))


def test_noise_alone_makes_no_trend():
    """Oracle: p-values are uniform under the null hypothesis; of 100, 10 +- 3 are below a tenth
    (four sigma).
    """
    axis = load_noise_model("navchip").gyro[0]
    rng = np.random.default_rng(3)
    found = [
        warm_up(simulate_noise(axis, K, LENGTH / K, rng), LENGTH, axis, rng) for _ in range(100)
    ]
    assert abs(sum(trend.by_chance < 0.1 for trend in found) - 10) <= 12
    assert sum(trend.is_there for trend in found) <= 3


def test_a_warm_up_is_found_with_its_size_and_time():
    """Oracle: the decay put in, 300 deg/h settling with ten minutes, against slow noise of 61
    deg/h.
    """
    axis = load_noise_model("navchip").gyro[0]
    rng = np.random.default_rng(5)
    t = (np.arange(K) + 0.5) * LENGTH / K
    trend = warm_up(
        simulate_noise(axis, K, LENGTH / K, rng) + 300.0 * DEG_H * np.exp(-t / 600.0),
        LENGTH,
        axis,
        rng,
    )
    assert trend.is_there
    assert abs(trend.amplitude / DEG_H - 300.0) < 4.0 * trend.sigma / DEG_H
    assert 300.0 < trend.time_s < 1200.0
    line = warm_up(
        simulate_noise(axis, K, LENGTH / K, rng) + 800.0 * DEG_H * t / LENGTH, LENGTH, axis, rng
    )
    assert line.is_there
    assert abs(line.amplitude / DEG_H) > 300.0
