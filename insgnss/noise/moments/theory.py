r"""What each noise process does to a sampled series: its Haar wavelet variance.

Parameters are the continuous-time ones of `AxisNoise` (X = rad/s or m/s^2), the series has `rate`
samples a second, and a sample is

    "point"   the value of the process at the sample time: what an AR(1) with phi = exp(-1/(rate T))
              and cumulated innovations are
    "mean"    the mean of the process over the interval that ends there: what an IMU gives that
              integrates internally

White noise is of variance q^2 rate in both, quantization the first difference of a white sequence
of standard deviation Q rate, and the drift a line of known slope w. m = 2^(j-1) samples at level j,
s^2 = q^2/rate is the variance of a random walk's innovation, b = Q rate. Variances in X^2, half
those of Allan over m samples:

    white         q^2 rate / (2 m)
    quantization  3 b^2 / (2 m^2)
    walk, point   s^2 (2 m^2 + 1) / (12 m)
    walk, mean    s^2 m / 6
    drift         w^2 m^2 / (4 rate^2)
    Gauss-Markov  `gauss_markov`

Guerrier et al. (2013), "Wavelet-variance-based estimation for composite stochastic processes", J.
Am. Stat. Assoc. 108, 1021, give them for "point", IEEE Std 952 annex C Allan's for "mean".
"""

from typing import Literal

import numpy as np
from numpy.typing import ArrayLike

from ...base.errors import UsageError
from ...navigation.noise_model.model import AxisNoise
from ...records import Array
from ..processes.gauss_markov import check_rate, gauss_markov_haar, is_point

__all__ = ["Sampling", "gauss_markov_haar", "haar_variance", "haar_variance_parts"]

Sampling = Literal["point", "mean"]


def haar_variance(
    axis: AxisNoise, level: ArrayLike, rate_hz: float, sampling: Sampling = "point"
) -> Array:
    """Return the Haar wavelet variance that a noise model has.

    Parameters
    ----------
    axis : noise of the axis, X = rad/s or m/s^2.
    level : whole numbers from 1; the filter of a level has 2^level samples.
    rate_hz : samples a second.
    sampling : what a sample is of the continuous process, "point" or "mean".

    Returns
    -------
    The variances, X^2, of the shape of `level`.

    Raises
    ------
    UsageError : a level is no whole number from 1, or the rate is not positive.
    """
    parts = haar_variance_parts(axis, level, rate_hz, sampling)
    return sum(parts.values(), np.zeros(np.shape(level)))


def haar_variance_parts(
    axis: AxisNoise, level: ArrayLike, rate_hz: float, sampling: Sampling = "point"
) -> dict[str, Array]:
    """Return the Haar wavelet variances, X^2, by process: "white_noise", "quantization",
    "random_walk", "drift", "gauss_markov_1", ..., those that the axis has.
    """
    levels = np.asarray(level, float)
    invalid = levels[~((levels >= 1.0) & (levels == np.floor(levels)) & np.isfinite(levels))]
    if invalid.size:
        raise UsageError(f"level {invalid.flat[0]:g}; give whole numbers from 1")
    m, point = 2.0 ** (levels - 1.0), is_point(sampling)
    check_rate(rate_hz)
    parts = {}
    if axis.white_noise:
        parts["white_noise"] = axis.white_noise**2 * rate_hz * (0.5 / m)
    if axis.quantization:
        parts["quantization"] = (axis.quantization * rate_hz) ** 2 * (1.5 / m**2)
    if axis.random_walk:
        walk = (2.0 * m**2 + 1.0) / (12.0 * m) if point else m / 6.0
        parts["random_walk"] = axis.random_walk**2 / rate_hz * walk
    if axis.drift:
        parts["drift"] = 0.25 * (axis.drift / rate_hz * m) ** 2
    for i, process in enumerate(axis.gauss_markov, start=1):
        unit_variance, _ = gauss_markov_haar(process.correlation_time_s * rate_hz, levels, sampling)
        parts[f"gauss_markov_{i}"] = process.sigma**2 * unit_variance
    return parts
