r"""What each noise process does to a sampled series: Allan family, Haar wavelet variance, power
spectral density.

Parameters are the continuous-time ones of `AxisNoise` (X = rad/s or m/s^2), the series has `rate`
samples a second, and a sample is

    "point"   the value of the process at the sample time: what an AR(1) with phi = exp(-1/(rate T))
              and cumulated innovations are
    "mean"    the mean of the process over the interval that ends there: what an IMU gives that
              integrates internally

White noise is of variance q^2 rate in both, quantization the first difference of a white sequence
of standard deviation Q rate, and the drift a line of known slope w. m is the averaging factor in
samples, tau = m/rate, s^2 = q^2/rate the variance of a random walk's innovation, b = Q rate.
Variances in X^2:

                 Haar nu_j, m = 2^(j-1) Allan modified Allan                     Hadamard
    white        q^2 rate / (2 m)       2 nu  q^2 rate (m^2 + 1)/(2 m^3)         q^2 rate / m
    quantization 3 b^2 / (2 m^2)        2 nu  3 b^2 / m^3                        10 b^2 / (3 m^2)
    walk, point  s^2 (2 m^2 + 1)/(12 m) 2 nu  s^2 (11 m^4 + 5 m^2 + 4)/(40 m^3)  s^2 (m^2 + 1)/(6 m)
    walk, mean   s^2 m / 6              2 nu  s^2 (33 m^4 + 5 m^2 + 2)/(120 m^3) s^2 m / 6
    drift        w^2 m^2 / (4 rate^2)   2 nu  w^2 m^2 / (2 rate^2)               0
    Gauss-Markov `gauss_markov`

The power spectral density is two-sided (X^2/Hz, its integral over -rate/2 ... rate/2 is the
variance; a one-sided one is twice that) and that of the sampled series, so with all that folds
over. With p = sin^2(pi f/rate), and P, B, c of `gauss_markov` (A = 4 P):

    white  q^2,     quantization  4 p b^2/rate,
    walk  s^2/(4 p rate) (point),  s^2 (1/(4 p) - 1/6)/rate (mean),
    Gauss-Markov  sigma^2/rate c/(1 + A p) (point),  sigma^2/rate (2/u) (1 - p B/u)/(1 + A p) with
                                                     the B and A of point (mean).

A line has no power spectral density; the drift adds nothing to it. Guerrier et al. (2013),
"Wavelet-variance-based estimation for composite stochastic processes", J. Am. Stat. Assoc. 108,
1021, give the Haar column for "point", IEEE Std 952 annex C Allan's for "mean".
"""

from collections.abc import Callable
from typing import Literal

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ...base.errors import UsageError
from ..gauss_markov import (
    check_rate,
    gauss_markov_allan,
    gauss_markov_coefficients,
    gauss_markov_haar,
    gauss_markov_hadamard,
    gauss_markov_modified,
    is_point,
)
from ..model import AxisNoise

__all__ = [
    "Sampling",
    "allan_variance",
    "gauss_markov_haar",
    "haar_variance",
    "haar_variance_parts",
    "hadamard_variance",
    "modified_allan_variance",
    "psd",
    "psd_parts",
    "variance_parts",
]

Array = NDArray[np.float64]
Sampling = Literal["point", "mean"]
Kind = Literal["allan", "modified", "hadamard"]

_GAUSS_MARKOV = {
    "allan": gauss_markov_allan,
    "modified": gauss_markov_modified,
    "hadamard": gauss_markov_hadamard,
}
_WHITE: dict[str, Callable[[Array], Array]] = {
    "allan": lambda m: 1.0 / m,
    "modified": lambda m: (m**2 + 1.0) / (2.0 * m**3),
    "hadamard": lambda m: 1.0 / m,
}
_QUANTIZATION: dict[str, Callable[[Array], Array]] = {
    "allan": lambda m: 3.0 / m**2,
    "modified": lambda m: 3.0 / m**3,
    "hadamard": lambda m: 10.0 / (3.0 * m**2),
}
_WALK: dict[tuple[str, bool], Callable[[Array], Array]] = {
    ("allan", True): lambda m: (2.0 * m**2 + 1.0) / (6.0 * m),
    ("allan", False): lambda m: m / 3.0,
    ("modified", True): lambda m: (11.0 * m**4 + 5.0 * m**2 + 4.0) / (40.0 * m**3),
    ("modified", False): lambda m: (33.0 * m**4 + 5.0 * m**2 + 2.0) / (120.0 * m**3),
    ("hadamard", True): lambda m: (m**2 + 1.0) / (6.0 * m),
    ("hadamard", False): lambda m: m / 6.0,
}


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
    return 0.5 * allan_variance(axis, _factor_of(level), rate_hz, sampling)


def haar_variance_parts(
    axis: AxisNoise, level: ArrayLike, rate_hz: float, sampling: Sampling = "point"
) -> dict[str, Array]:
    """The same by process: "white_noise", "quantization", "random_walk", "drift", "gauss_markov_1",
    ..., those that the axis has.
    """
    parts = variance_parts("allan", axis, _factor_of(level), rate_hz, sampling)
    return {name: 0.5 * variance for name, variance in parts.items()}


def allan_variance(
    axis: AxisNoise, m: ArrayLike, rate_hz: float, sampling: Sampling = "point"
) -> Array:
    """Allan variance, X^2, at averaging factors `m` (whole numbers from 1, tau = m/rate_hz), of the
    same shape.
    """
    return _total("allan", axis, m, rate_hz, sampling)


def modified_allan_variance(
    axis: AxisNoise, m: ArrayLike, rate_hz: float, sampling: Sampling = "point"
) -> Array:
    """Modified Allan variance, X^2, at averaging factors `m` (whole numbers from 1), of the same
    shape.
    """
    return _total("modified", axis, m, rate_hz, sampling)


def hadamard_variance(
    axis: AxisNoise, m: ArrayLike, rate_hz: float, sampling: Sampling = "point"
) -> Array:
    """Hadamard variance, X^2, at averaging factors `m` (whole numbers from 1), of the same shape;
    the drift does not enter.
    """
    return _total("hadamard", axis, m, rate_hz, sampling)


def variance_parts(
    kind: Kind, axis: AxisNoise, m: ArrayLike, rate_hz: float, sampling: Sampling = "point"
) -> dict[str, Array]:
    """Variances of one `kind` by process, X^2, at averaging factors `m`; names as in
    `haar_variance_parts`.

    Raises UsageError for another kind or sampling, an m that is no whole number from 1, and a rate
    that is not positive.
    """
    if kind not in _GAUSS_MARKOV:
        raise UsageError(f"variance {kind!r} is unknown; known are {', '.join(_GAUSS_MARKOV)}")
    factor, point = _whole(m, "averaging factor"), is_point(sampling)
    check_rate(rate_hz)
    parts = {}
    if axis.white_noise:
        parts["white_noise"] = axis.white_noise**2 * rate_hz * _WHITE[kind](factor)
    if axis.quantization:
        parts["quantization"] = (axis.quantization * rate_hz) ** 2 * _QUANTIZATION[kind](factor)
    if axis.random_walk:
        parts["random_walk"] = axis.random_walk**2 / rate_hz * _WALK[kind, point](factor)
    if axis.drift:
        parts["drift"] = (0.0 if kind == "hadamard" else 0.5) * (axis.drift / rate_hz * factor) ** 2
    for i, process in enumerate(axis.gauss_markov, start=1):
        unit = _GAUSS_MARKOV[kind](process.correlation_time_s * rate_hz, factor, sampling)
        parts[f"gauss_markov_{i}"] = process.sigma**2 * unit
    return parts


def psd(axis: AxisNoise, f_hz: ArrayLike, rate_hz: float, sampling: Sampling = "point") -> Array:
    """Two-sided power spectral density of the sampled series, X^2/Hz, at 0 < f_hz <= rate_hz/2, of
    the same shape.
    """
    return sum(psd_parts(axis, f_hz, rate_hz, sampling).values(), np.zeros(np.shape(f_hz)))


def psd_parts(
    axis: AxisNoise, f_hz: ArrayLike, rate_hz: float, sampling: Sampling = "point"
) -> dict[str, Array]:
    """The same by process, names as in `haar_variance_parts`; the drift, a line, has none.

    Raises UsageError for a frequency outside 0 < f_hz <= rate_hz/2.
    """
    f, point = np.asarray(f_hz, float), is_point(sampling)
    check_rate(rate_hz)
    if not ((f > 0.0) & (f <= 0.5 * rate_hz)).all():
        raise UsageError(
            f"frequencies from {f.min():g} to {f.max():g} Hz; give them above 0 and up to half the"
            f" rate, {0.5 * rate_hz:g} Hz"
        )
    p = np.sin(np.pi * f / rate_hz) ** 2
    parts = {}
    if axis.white_noise:
        parts["white_noise"] = np.full(f.shape, axis.white_noise**2)
    if axis.quantization:
        parts["quantization"] = 4.0 * axis.quantization**2 * rate_hz * p
    if axis.random_walk:
        parts["random_walk"] = (axis.random_walk / rate_hz) ** 2 * (
            0.25 / p - (0.0 if point else 1.0 / 6.0)
        )
    for i, process in enumerate(axis.gauss_markov, start=1):
        u = 1.0 / (process.correlation_time_s * rate_hz)
        P, B, c = gauss_markov_coefficients(1.0 / u)
        numerator = c if point else 2.0 / u * (1.0 - p * B / u)
        parts[f"gauss_markov_{i}"] = process.sigma**2 / rate_hz * numerator / (1.0 + 4.0 * P * p)
    return parts


def _total(kind: Kind, axis: AxisNoise, m: ArrayLike, rate_hz: float, sampling: Sampling) -> Array:
    return sum(variance_parts(kind, axis, m, rate_hz, sampling).values(), np.zeros(np.shape(m)))


def _factor_of(level: ArrayLike) -> Array:
    """Averaging factors 2^(level-1)."""
    return 2.0 ** (_whole(level, "level") - 1.0)


def _whole(values: ArrayLike, name: str) -> Array:
    array = np.asarray(values, float)
    wrong = array[~((array >= 1.0) & (array == np.floor(array)) & np.isfinite(array))]
    if wrong.size:
        raise UsageError(f"{name} {wrong.flat[0]:g}; give whole numbers from 1")
    return array
