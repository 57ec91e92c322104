r"""Haar wavelet variance of a sampled first-order Gauss-Markov process, free of cancellation for
every correlation time.

The process has the autocovariance sigma^2 exp(-|tau|/T). With u = 1/(rate T) per sample, v = u/2,
and S the cumulated samples, S has the generalised covariance (minus half the variance of S(t+h) -
S(t), up to a constant)

    K(h) = -sigma^2 (P exp(-u|h|) + (c/2) |h|),                                                (G.1)
    samples of the process ("point", an AR(1) of phi = exp(-u)):  P = 1/(4 sinh^2 v),  c = coth v
    means of the process over the intervals ("mean"):             P = 1/u^2,           c = 1/v

since minus its second difference (by integration in the second case) is the autocovariance. A
wavelet variance is the fourth difference of K at spacing m over 4 m^2, for (1, -2, 1) convolved
with itself. With x = u m, a = 1 - exp(-x) and B = 2 c - 4 u P (which is (sinh u - u)/sinh^2 v, and
0 for means) the difference is a sum of terms that are not negative:

    Haar (level j, m = 2^(j-1)), half the Allan variance:   sigma^2 (4 P f + m B) / (4 m^2)    (G.2)
    f = x - a - a^2/2,   f' = a^2                                                              (G.3)

f is the tail of the series of x = -log(1 - a) and behaves as x^3/3: it is summed as a power series
in x where the difference would cancel. The textbook form of (G.2) subtracts numbers of size 1/u^3
there. The derivative is free of the trouble too:

    d(G.2)/d log T = sigma^2 (P/m^2) (2 (1 + L) f - x a^2 - 2 x L),    L = v coth v - 1;
    means:           sigma^2 (2 f/x^2 - a^2/x)                                                 (G.4)

L comes from Lambert's continued fraction v^2/(3 + k), k = v^2/(5 + v^2/(7 + ...)); then P = ((1 +
L)^2 - v^2)/u^2 and B = (2/v)(v^2 - L (1 + L)). T in samples is 1/u, and the functions give sigma =
1. For T from 0.1 to 1e9 samples they keep 14 digits. The AR(1) case is Zhang's (2008), "Allan
variance of time series models for measurement data", Metrologia 45, 549, written so that it does
not cancel, and the case of means that of IEEE Std 952 annex C.
"""

import math

import numpy as np
from numpy.typing import ArrayLike

from ...base.compilation import njit
from ...base.errors import UsageError
from ...records import Array

SAMPLINGS = ("point", "mean")

# power series of f (G.3) in x, from the lowest power, which is 3
_F_SERIES = np.array(
    [(-1) ** (k - 1) * (2 ** (k - 1) - 2) / math.factorial(k) for k in range(3, 27)]
)
# of x; below, the series is exact to rounding, and above, the difference to some ten roundings
_F_BELOW = 0.75


@njit(cache=True)
def _polynomial(coefficients: Array, x: float) -> float:
    total = 0.0
    for k in range(coefficients.size - 1, -1, -1):
        total = total * x + coefficients[k]
    return total


@njit(cache=True)
def _lambert(v: float) -> float:
    """L of (G.4) for v < 1."""
    v2, k = v * v, 0.0
    for denominator in range(23, 3, -2):
        k = v2 / (denominator + k)
    return v2 / (3.0 + k)


@njit(cache=True)
def _coefficients(u: float, point: bool) -> tuple[float, float, float, float]:
    """P, B and c of (G.1, G.2), and L of (G.4), which means do not need."""
    v = 0.5 * u
    if not point:
        return 1.0 / (u * u), 0.0, 1.0 / v, 0.0
    if v < 1.0:
        L = _lambert(v)
        return (
            ((1.0 + L) ** 2 - v * v) / (u * u),
            2.0 / v * (v * v - L * (1.0 + L)),
            (1.0 + L) / v,
            L,
        )
    phi = math.exp(-u)
    P, c = phi / (1.0 - phi) ** 2, (1.0 + phi) / (1.0 - phi)
    return P, 2.0 * c - 4.0 * u * P, c, v * c - 1.0


@njit(cache=True)
def _f(x: float) -> tuple[float, float]:
    """f of (G.3), and a."""
    a = -math.expm1(-x)
    return (x**3 * _polynomial(_F_SERIES, x) if x < _F_BELOW else x - a - 0.5 * a * a), a


@njit(cache=True)
def _haar(u: float, m: float, point: bool) -> tuple[float, float]:
    """(G.2) and its derivative by log T (G.4)."""
    x = u * m
    f, a = _f(x)
    if not point:
        return f / (x * x), 2.0 * f / (x * x) - a * a / x
    P, B, _, L = _coefficients(u, True)
    return (4.0 * P * f + m * B) / (4.0 * m * m), P / (m * m) * (
        2.0 * (1.0 + L) * f - x * (a * a + 2.0 * L)
    )


@njit(cache=True)
def _haar_all(u: Array, m: Array, point: bool, value: Array, slope: Array) -> None:
    for i in range(u.size):
        value[i], slope[i] = _haar(u[i], m[i], point)


def is_point(sampling: str) -> bool:
    """Whether `sampling` is "point"; raises UsageError where it is neither that nor "mean"."""
    if sampling not in SAMPLINGS:
        raise UsageError(
            f"sampling {sampling!r} is neither 'point' (values at the sample times) nor 'mean'"
            " (means over the intervals)"
        )
    return sampling == "point"


def check_rate(rate_hz: float) -> None:
    """Raise UsageError for a sampling rate that is not positive and finite."""
    if not 0.0 < rate_hz < math.inf:
        raise UsageError(f"sampling rate {rate_hz:g} Hz; give a positive one")


def _flat(T_samples: ArrayLike, m: ArrayLike) -> tuple[tuple[int, ...], Array, Array]:
    """Common shape, and 1/T and m of that shape, flat."""
    T, factor = np.broadcast_arrays(np.asarray(T_samples, float), np.asarray(m, float))
    if not ((T > 0.0) & np.isfinite(T)).all():
        raise UsageError(
            f"correlation time of {T[~((T > 0.0) & np.isfinite(T))][0]:g} samples; give one that is"
            " positive and finite"
        )
    return T.shape, np.array(1.0 / T).ravel(), np.array(factor).ravel()


def gauss_markov_coefficients(
    T_samples: float, sampling: str = "point"
) -> tuple[float, float, float]:
    """P, B and c of (G.1, G.2) for unit stationary variance, T in samples."""
    P, B, c, _ = _coefficients(1.0 / T_samples, is_point(sampling))
    return P, B, c


def gauss_markov_haar(
    T_samples: ArrayLike, level: ArrayLike, sampling: str = "point"
) -> tuple[Array, Array]:
    """Haar wavelet variance (G.2) of unit stationary variance, and its derivative by log T (G.4).

    T_samples : correlation time times sampling rate, any shape.
    level : whole numbers from 1, broadcast against it; m = 2^(level-1).
    """
    shape, u, m = _flat(T_samples, np.ldexp(0.5, np.asarray(level, dtype=np.int64)))
    value, slope = np.empty(u.size), np.empty(u.size)
    _haar_all(u, m, is_point(sampling), value, slope)
    return value.reshape(shape), slope.reshape(shape)
