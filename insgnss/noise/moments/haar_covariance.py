r"""Exact covariance of the Haar wavelet variance estimates of one series of Gaussian noise.

The estimate of level j is the mean of W_j(t)^2 over the M_j = n - 2^j + 1 coefficients that need no
sample beyond the series. With m = 2^(j-1), S the cumulated samples, W_j(t) = (S(t) - 2 S(t - m) +
S(t - 2m))/(2m) is stationary for every process of `theory`, of mean mu_j = w m/(2 rate) under a
drift of known slope w, and for Gaussian W (Isserlis)

    cov(nu_j, nu_k) = 1/(M_j M_k) sum over t, s of 2 C^2 + 4 mu_j mu_k C,   C = C_jk(distance) (H.1)

In the distance h of the filters' centres C is even, and h occurs M_j times up to |h| = m_j - m_k
(m_j >= m_k), once less for each lag beyond. With K the generalised covariance of S,

    C_jk(h) = 1/(4 m_j m_k) D K(h),    D = second difference at spacing m_j
                                       times second difference at spacing m_k                  (H.2)
    white  -q^2 rate |h|/2,      random walk  q^2/rate (|h|^3 - |h|)/12 (point), without -|h|
                                              (mean),
    quantization  Q^2 rate^2 at h = 0,      Gauss-Markov  (G.1) of `gauss_markov`              (H.3)

Nine terms of size K would cancel. Instead K on the positive side is continued analytically as k(h),
D k is taken in closed form, and what K is more than k is added where the argument -y of a term is
negative; with kappa(y) = (K(y) - k(-y))/2 which is odd:

    D K(h) = D k(h) + 2 sum over y > 0 of c_a c_b kappa(y),
    y = -h + a m_j + b m_k,   c = 1, -2, 1                                                     (H.4)

For polynomials D k = 0 and kappa = K. For a Gauss-Markov process D k = -sigma^2 P (4 sinh(u m_j/2)
sinh(u m_k/2))^2 exp(-u h) and

    kappa = sigma^2 psi(y),    psi(y) = P (sinh u y - u y) - B y/4                             (H.5)

A full row of three terms (m_j - h >= m_k) is itself a closed second difference. Where u m_j >= 1
the exponentials would grow instead;
there the three differences of K at spacing m_k, at h + m_j, h and h - m_j, are closed and are
combined as they stand (H.6).

Between the breaks 0, m_k, m_j - m_k, m_j, m_j + m_k, C is a cubic plus exponentials that fall off
from the breaks. There the sum over the lags uses panels that double from both breaks to the middle,
with eight nodes each that are the Gauss rule of the *sum* over equally spaced points, the zeros of
the discrete Chebyshev polynomial (H.7): exact to degree 15, thus for all processes but
Gauss-Markov, and for these to 1e-11. A pair of levels costs some hundred panels however long the
series.

Percival (1995), "On estimation of the wavelet variance", Biometrika 82, 619, has the diagonal for
long series.
"""

import numpy as np
from numpy.typing import ArrayLike

from ...base.errors import UsageError
from ...navigation.noise_model.model import AxisNoise
from ...records import Array
from ..processes.gauss_markov import gauss_markov_coefficients, is_point
from ._covariance_kernels import all_pairs
from .theory import Sampling, haar_variance


def haar_covariance(
    axis: AxisNoise, level: ArrayLike, n: int, rate_hz: float, sampling: Sampling = "point"
) -> Array:
    """Return the exact covariance of the MODWT Haar wavelet variances of one Gaussian series.

    The drift counts as a line of known slope.

    Parameters
    ----------
    axis : AxisNoise
        Processes of the series.
    level : array_like of int, (J,)
        Levels from 1, each filter of 2^level samples inside the series.
    n : int
        Length of the series, samples.
    rate_hz : float
        Samples a second.
    sampling : {"point", "mean"}
        What a sample is of the continuous process.

    Returns
    -------
    ndarray, (J, J)
        Covariance, X^4.

    Raises
    ------
    UsageError
        For a level whose filter is longer than the series, or as `haar_variance`.
    """
    m = _averaging_factors(level, n)
    haar_variance(axis, level, rate_hz, sampling)  # refuses what is not a level or a rate
    out = np.empty((m.size, m.size))
    a_1, a_3, quantized, gm, drift = _parameters(axis, rate_hz, sampling)
    all_pairs(n, m, a_1, a_3, quantized, gm, drift, out)
    return out


def _averaging_factors(level: ArrayLike, n: int) -> Array:
    levels = np.atleast_1d(np.asarray(level, float))
    if levels.ndim != 1 or levels.size == 0:
        raise UsageError(f"levels of shape {levels.shape}; give a list of whole numbers from 1")
    if 2.0 ** levels.max() > n:
        raise UsageError(
            f"level {levels.max():g} needs {2.0 ** levels.max():g} samples, the series has {n};"
            " leave it out"
        )
    return 2.0 ** (levels - 1.0)


def _parameters(
    axis: AxisNoise, rate_hz: float, sampling: Sampling
) -> tuple[float, float, float, Array, float]:
    """a_1 and a_3 of K = a_1 |h| + a_3 |h|^3, the quantization's K(0), rows u, sigma^2 (P, B, c),
    and the drift's mu_j/m_j (H.3).
    """
    walk = axis.random_walk**2 / rate_hz / 12.0
    a_1 = -0.5 * axis.white_noise**2 * rate_hz - (walk if is_point(sampling) else 0.0)
    rows = []
    for process in axis.gauss_markov:
        T = process.correlation_time_s * rate_hz
        rows.append(
            [
                1.0 / T,
                *(process.sigma**2 * value for value in gauss_markov_coefficients(T, sampling)),
            ]
        )
    gm = np.array(rows).reshape(-1, 4)
    return a_1, walk, (axis.quantization * rate_hz) ** 2, gm, 0.5 * axis.drift / rate_hz
