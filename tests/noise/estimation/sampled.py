"""Covariance of a sampled noise axis from the autocovariances of its processes, and the quadratic
forms of the estimates: oracles.
"""

import math

import numpy as np

from insgnss.navigation.noise_model.model import AxisNoise, GaussMarkov

SAMPLINGS = ("point", "mean")
AXES = {
    "white": AxisNoise(white_noise=0.3),
    "quantization": AxisNoise(quantization=0.2),
    "random_walk": AxisNoise(random_walk=0.8),
    "fast_gauss_markov": AxisNoise(gauss_markov=(GaussMarkov(0.04, 1.5),)),
    "gauss_markov": AxisNoise(gauss_markov=(GaussMarkov(1.3, 1.5),)),
    "slow_gauss_markov": AxisNoise(gauss_markov=(GaussMarkov(40.0, 0.2),)),
    "all": AxisNoise(0.1, 0.02, 0.0, 0.2, 0.0, (GaussMarkov(0.4, 0.5), GaussMarkov(5.0, 0.2))),
}


def covariance(axis: AxisNoise, n: int, rate_hz: float, sampling: str) -> np.ndarray:
    """Covariance (n, n) of the samples without drift and turn-on bias, autocovariances integrated
    by hand for means.
    """
    i, j = np.indices((n, n))
    lag, first = np.abs(i - j), np.minimum(i, j)
    C = np.where(lag == 0, axis.white_noise**2 * rate_hz, 0.0)
    C += (axis.quantization * rate_hz) ** 2 * np.select([lag == 0, lag == 1], [2.0, -1.0], 0.0)
    end = 1.0 if sampling == "point" else np.where(lag == 0, 1.0 / 3.0, 0.5)
    C += axis.random_walk**2 / rate_hz * (first + end)
    for p in axis.gauss_markov:
        C += p.sigma**2 * autocorrelation(p.correlation_time_s * rate_hz, n, sampling)[lag]
    return C


def autocorrelation(T_samples: float, n: int, sampling: str) -> np.ndarray:
    """Autocovariance at lags 0 to n - 1 over the variance of the Gauss-Markov process."""
    u, lag = 1.0 / T_samples, np.arange(n)
    if sampling == "point":
        return np.exp(-u * lag)
    rho = (-math.expm1(-u) / u) ** 2 * np.exp(-u * (lag - 1.0))
    rho[0] = 2.0 * (u + math.expm1(-u)) / u**2
    return rho


def haar_filter(m: int) -> np.ndarray:
    """Difference of the means of two blocks of m samples, halved."""
    return np.repeat([-0.5, 0.5], m) / m


def haar_rows(level: int, n: int) -> np.ndarray:
    """Rows that take a series of n to its M wavelet coefficients of `level`."""
    filter_ = haar_filter(2 ** (level - 1))
    rows = np.zeros((n - filter_.size + 1, n))
    for t in range(rows.shape[0]):
        rows[t, t : t + filter_.size] = filter_
    return rows
