r"""Haar wavelet variance of a series, with its interval, and the same robustly.

At level j, with m = 2^(j - 1), the coefficients of the maximal-overlap Haar transform without those
that reach over the ends are

    W_j(t) = (mean of x(t + m .. t + 2m) - mean of x(t .. t + m)) / 2,      t = 0 .. n - 2m    (W.1)

so that with the cumulated series S, S(0) = 0, W_j(t) = (S(t + 2m) - 2 S(t + m) + S(t)) / (2m). All
levels come from the one S, blocks of t at a time; taking the mean off x first keeps S small and
leaves (W.1) as it is. The discrete transform ("dwt") keeps t = 0, 2m, 4m ... only. The estimate
over the M_j coefficients and its relation to the Allan variance over m samples are

    nu_j = mean of W_j^2,      avar(m / rate) = 2 nu_j                                         (W.2)

There are J = floor(log2 n) - 1 levels where no other number is requested, as R package wv has it:
the last has n/2 coefficients or more. The interval takes eta nu_hat / nu as chi-square with eta
degrees of freedom (Percival 1995, his eta_3; also in R package wv):

    eta = max(M_j / 2^j, 1)                                                                    (W.3)

which is cautious: it counts segments that do not overlap. Coefficients of the discrete transform
do not overlap, there eta = M_j. The numbers of R package wv for "dwt" are of orthonormal
coefficients, 2^j times these.

Robust: the biweight M-estimate of scale of Mondal and Percival (2012) and Guerrier and Molinari
(2016). nu solves

    mean of psi(W / sqrt(nu)) = a(c),      psi(r) = r^2 (1 - r^2/c^2)^4 for |r| < c, else 0    (W.4)

a(c) is the mean of psi for normal W. With y = W^2/(c^2 nu) it reads: mean of y (1 - y)^4 over y < 1
= a(c) / c^2. The logarithm of nu has in independent normal coefficients the variance 4 Q/(n M^2), Q
= var psi and M = E[(r^2 - 1) psi], against 2/n for the plain mean: c follows from the wanted
efficiency M^2/(2 Q), 4.40 for 0.6. With moments mu_2k = E[r^2k; |r| < c] = (2k - 1)!! P(k + 1/2,
c^2/2), P the regularised incomplete gamma function, expanding the powers of (1 - r^2/c^2) gives

    E psi   = sum_i C(4, i) (-c^-2)^i mu_(2 + 2i),
    E psi^2 = sum_i C(8, i) (-c^-2)^i mu_(4 + 2i)                                              (W.5)

The robust interval widens that of the plain estimate, relative to the estimate, by
1/sqrt(efficiency) on either side. At the last two or three levels only a handful of coefficients is
independent, the majority that (W.4) follows is a matter of chance, and the estimate may be many
times smaller than the plain one: levels above floor(log2 n) - 3 are better left out of a robust
fit.
"""

import math
import os
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from typing import Any, Literal

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ...base.errors import DataError, InputError, InsgnssError, UsageError
from ...records import Array, WaveletVariance, chi_square_interval
from ._kernels import biweight_mean, copy_sum, cumulate, haar_squares, second_difference_power

__all__ = [
    "WaveletVariance",
    "cumulative_sum",
    "default_levels",
    "wavelet_variance",
    "wavelet_variances",
]

Decomposition = Literal["modwt", "dwt"]

_THREADS = 2  # most at once (chosen)
_EFFICIENCIES = (0.2, 0.99)  # for which the constant c is searched: near 1 c has no bound
_SAMPLE = 10_000  # coefficients that the search for the robust solution starts with


def default_levels(samples: int) -> int:
    """Number of levels J = floor(log2 n) - 1, exact powers of two included: at least half of the
    series' length in coefficients.
    """
    return int(samples).bit_length() - 2


def wavelet_variance(
    x: ArrayLike,
    rate_hz: float,
    *,
    levels: int | None = None,
    robust: bool = False,
    efficiency: float = 0.6,
    decomposition: Decomposition = "modwt",
) -> WaveletVariance:
    """Return the Haar wavelet variance of one axis with 95 % intervals (W.1 to W.5).

    Parameters
    ----------
    x : (n,) rate samples, X = rad/s or m/s^2, without gaps.
    rate_hz : samples a second.
    levels : J, the variances are those of levels 1 to J; None: floor(log2 n) - 1.
    robust : whether a few disturbances shall not move it.
    efficiency : of the robust estimate against the plain one in normal noise, 0.2 to 0.99.
    decomposition : "modwt" (overlapping filters) or "dwt".

    Returns
    -------
    The variances at all levels.

    Raises
    ------
    InputError : a value is not finite.
    DataError : there are fewer than 4 samples, the series is constant, or coefficients are mostly
        zero where a robust estimate is asked for.
    UsageError : an option makes no sense.

    Examples
    --------
    >>> import insgnss, numpy as np
    >>> axis = insgnss.AxisNoise(white_noise=1e-3)
    >>> x = insgnss.simulate_noise(axis, 4096, 0.01, np.random.default_rng(1))
    >>> curve = insgnss.wavelet_variance(x, 100.0)
    >>> bool(abs(curve.variance[0] / insgnss.haar_variance(axis, 1, 100.0) - 1.0) < 0.1)
    True
    """
    if decomposition not in ("modwt", "dwt"):
        raise UsageError(f"decomposition {decomposition!r} is neither 'modwt' nor 'dwt'")
    s = cumulative_sum(x, rate_hz)
    n = s.size - 1
    most = n.bit_length() - 1
    if levels is not None and not 1 <= levels <= most:
        raise UsageError(f"{levels} levels of {n} samples; give 1 to {most}")
    level = np.arange(1, (default_levels(n) if levels is None else levels) + 1)
    m = 2 ** (level - 1)
    overlap = decomposition == "modwt"
    stride = np.ones_like(m) if overlap else 2 * m
    count = n - 2 * m + 1 if overlap else n // (2 * m)
    power = np.empty(level.size)
    second_difference_power(s, m, stride, power)
    variance = power / (4.0 * m * m * count)
    if variance.min() <= 0.0:
        raise DataError(
            f"no variance at level {level[np.argmin(variance)]}; the series is periodic or constant"
            " but for its ends"
        )
    low, high = chi_square_interval(
        variance, np.maximum(count / 2.0**level, 1.0) if overlap else count.astype(np.float64)
    )
    if robust:
        estimate = _robust_variances(s, m, stride, count, efficiency)
        low, high = _robust_interval(estimate, low / variance, high / variance, efficiency)
        variance = estimate
    return WaveletVariance(
        level=level,
        variance=variance,
        low=low,
        high=high,
        count=count,
        rate_hz=float(rate_hz),
        samples=n,
        robust=robust,
        decomposition=decomposition,
    )


def wavelet_variances(
    x: ArrayLike,
    rate_hz: float,
    *,
    levels: int | None = None,
    robust: bool = False,
    efficiency: float = 0.6,
    decomposition: Decomposition = "modwt",
) -> tuple[WaveletVariance, ...]:
    """`wavelet_variance` of every column of x (n, k), two columns at a time. Errors name the
    column, counted from 1.
    """
    columns = np.asarray(x)
    if columns.ndim != 2:
        raise UsageError(f"samples of shape {columns.shape}; columns (n, k) are expected")
    options: dict[str, Any] = {
        "levels": levels,
        "robust": robust,
        "efficiency": efficiency,
        "decomposition": decomposition,
    }

    def one(k: int) -> WaveletVariance:
        try:
            return wavelet_variance(columns[:, k], rate_hz, **options)
        except InsgnssError as error:
            raise type(error)(f"column {k + 1}: {error}") from None

    return in_threads(one, columns.shape[1])


def in_threads(work: Callable[[int], Any], count: int) -> tuple[Any, ...]:
    """work(0), ..., work(count - 1), as many at a time as there are processors, at most two."""
    if count < 2:
        return tuple(work(k) for k in range(count))
    with ThreadPoolExecutor(min(_THREADS, os.cpu_count() or 1)) as pool:
        return tuple(pool.map(work, range(count)))


_SCANNED = 100  # factors k of a scan for the solution (chosen)
_NEWTON_STEPS, _STRIDE = 30, 0.3  # at most, and the largest of log k (chosen)
_CONVERGED = 1e-12  # relative, of a solution k: rounding
_TOP_TOLERANCE = 1e-6  # relative, of the k of a maximum: there the mean is flat


def cumulative_sum(x: ArrayLike, rate_hz: float) -> Array:
    """Return the cumulated sum (n + 1,) of x (n,) less its mean, from 0.

    It refuses series of which no variance can be taken (see `wavelet_variance`).
    """
    series = np.asarray(x, dtype=np.float64)
    if not (0.0 < rate_hz < math.inf):
        raise UsageError(f"rate {rate_hz} Hz; it must be greater than zero")
    if series.ndim != 1:
        raise UsageError(f"a series of shape {series.shape}; one axis (n,) is expected")
    if series.size < 4:
        raise DataError(
            f"{series.size} samples; at least 4 are needed, and hours of them for slow processes"
        )
    s = np.empty(series.size + 1)
    total, is_constant = copy_sum(series, s)
    if not math.isfinite(total):
        not_finite = ~np.isfinite(series)
        if not not_finite.any():
            raise InputError(f"samples of up to {np.abs(series).max():g} overflow; check the unit")
        raise InputError(
            f"sample {int(np.argmax(not_finite)) + 1} of {series.size} is"
            f" {series[np.argmax(not_finite)]}; fill or cut such gaps first"
        )
    if is_constant:
        raise DataError(
            f"all {series.size} samples are {series[0]:g}, a dead channel; choose the columns that"
            " hold the sensor"
        )
    cumulate(s, total / series.size)
    return s


def _robust_interval(
    estimate: Array, low: Array, high: Array, efficiency: float
) -> tuple[Array, Array]:
    """The plain interval, given relative to its estimate, widened about the robust one.

    Where that would reach below zero, as at levels with one or two degrees of freedom, the lower
    end is half of the estimate, or the smallest lower end of the levels before if that is less: so
    in R package wv, whose figures these are to compare with.
    """
    wider = math.sqrt(1.0 / efficiency)
    bottom = estimate * (1.0 - (1.0 - low) * wider)
    for k in np.flatnonzero(bottom <= 0.0):
        bottom[k] = min(0.5 * estimate[k], bottom[:k].min(initial=math.inf))
    return bottom, estimate * (1.0 + (high - 1.0) * wider)


def _robust_variances(
    s: Array,
    m: NDArray[np.int64],
    stride: NDArray[np.int64],
    count: NDArray[np.int64],
    efficiency: float,
) -> Array:
    """Return the solutions (J,), X^2, of (W.4)."""
    c, a = biweight_constants(efficiency)
    squares = np.empty(count[0])
    out = np.empty(m.size)
    for j in range(m.size):
        q = squares[: count[j]]
        haar_squares(s, m[j], stride[j], q)
        out[j] = _biweight_scale(q, a / c**2, j + 1) / c**2
    return out


def _biweight_scale(q: Array, target: float, level: int) -> float:
    """Return 1/k for the smallest k that makes the mean of y (1 - y)^4, y = k q, equal to `target`.

    The mean rises with k from zero, may rise and fall for outliers, rises when the bulk of the
    coefficients comes near y = 1/5, where its top is, and falls. A scan of some coefficients from
    the left, where the mean is surely smaller, finds the place, and Newton's method in log k on all
    of them the solution. Few independent coefficients, at the longest scales, may leave none: then
    the nearest k.
    """
    subsample = q[:: -(-q.size // _SAMPLE)].copy()
    middle = float(np.median(subsample))
    if middle == 0.0:
        raise DataError(
            f"level {level}: most coefficients are zero, as of a coarsely quantized channel, so"
            " that the robust variance does not exist; leave out robust"
        )
    lowest = target / float(subsample.mean())
    k = np.geomspace(lowest, max(2.0 * lowest, 1.0 / middle), _SCANNED)
    value = np.array([biweight_mean(subsample, trial)[0] for trial in k])
    i = int(np.argmax(value >= target)) or int(np.argmax(value))
    solution = _solve_by_newton(q, k[i], target)
    if solution is None:
        solution = _solve_in_bracket(q, k[max(i - 1, 0)], k[min(i + 1, _SCANNED - 1)], target)
    return 1.0 / solution


def _solve_by_newton(q: Array, k: float, target: float) -> float | None:
    """Return the k near a first one at which the mean of `biweight_mean` rises through `target`.

    It is None where the mean does not rise.
    """
    for _ in range(_NEWTON_STEPS):
        value, slope = biweight_mean(q, k)
        if slope <= 0.0:
            return None
        step = min(max((target - value) / slope, -_STRIDE), _STRIDE)
        k *= math.exp(step)
        if abs(step) < _CONVERGED:
            return k
    return None


def _solve_in_bracket(q: Array, low: float, high: float, target: float) -> float:
    """Return the k from `low` to `high` at which the mean is `target`, or the k of its maximum."""
    from scipy.optimize import brentq, fminbound

    top = float(fminbound(lambda k: -biweight_mean(q, k)[0], low, high, xtol=_TOP_TOLERANCE * low))
    if biweight_mean(q, low)[0] < target <= biweight_mean(q, top)[0]:
        return float(
            brentq(lambda k: biweight_mean(q, k)[0] - target, low, top, xtol=_CONVERGED * low)
        )
    return top


def biweight_constants(efficiency: float) -> tuple[float, float]:
    """c, and the mean a(c) of psi for normal coefficients, of a wanted efficiency, 0.2 to 0.99
    (W.4, W.5).
    """
    from scipy.optimize import brentq

    if not _EFFICIENCIES[0] <= efficiency <= _EFFICIENCIES[1]:
        raise UsageError(
            f"efficiency {efficiency} of the robust estimate; give {_EFFICIENCIES[0]} to"
            f" {_EFFICIENCIES[1]}"
        )

    def excess(c: float) -> float:
        mean, square, score = _biweight_moments(c)
        return 0.5 * score**2 / (square - mean**2) - efficiency

    c = float(brentq(excess, 3.0, 20.0, xtol=1e-14, rtol=1e-14))
    return c, _biweight_moments(c)[0]


def _biweight_moments(c: float) -> tuple[float, float, float]:
    """Return E psi, E psi^2 and E[(r^2 - 1) psi] of a standard normal r (W.5)."""
    from scipy.special import binom, gammainc

    k = np.arange(1, 11)
    moment = np.cumprod(2.0 * k - 1.0) * gammainc(k + 0.5, 0.5 * c * c)  # mu_2, mu_4, ..., mu_20
    power = (-1.0 / c**2) ** np.arange(9)
    four = binom(4, np.arange(5)) * power[:5]
    eight = binom(8, np.arange(9)) * power
    mean = float(four @ moment[:5])
    return mean, float(eight @ moment[1:10]), float(four @ moment[1:6]) - mean
