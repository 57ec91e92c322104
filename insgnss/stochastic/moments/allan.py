r"""Allan, modified Allan and Hadamard deviation of a rate, overlapping, with intervals that know
the kind of noise.

With S the cumulated samples (S(0) = 0), m the averaging factor, tau = m / rate and N = n + 1:

    Allan      avar = 1 / (2 m^2 (N - 2m)) sum over t of (S(t + 2m) - 2 S(t + m) + S(t))^2     (A.1)
    modified   mvar = 1 / (2 m^4 (N - 3m + 1)) sum over t
               of (sum over i = t .. t + m - 1 of the same difference)^2                       (A.2)
    Hadamard   hvar = 1 / (6 m^2 (N - 3m)) sum over t
               of (S(t + 3m) - 3 S(t + 2m) + 3 S(t + m) - S(t))^2                              (A.3)

The modified variance distinguishes white noise from what falls faster (quantization), the Hadamard
variance is blind to a linear drift and exists for noise down to f^-4. The interval takes edf
var_hat / var as chi-square; the equivalent degrees of freedom follow from the kind of noise
(`edf`), which is named by the caller or found at every tau (Riley and Greenhall 2004, Power law
noise identification using the lag 1 autocorrelation): the means over m samples, their straight line
taken off, are differenced d times until their lag-1 autocorrelation r gives rho = r / (1 + r) <
1/4; the spectrum of the rate is near f^alpha there with

    alpha = -2 (rho + d)                                                                       (A.4)

At tau that leave fewer than 30 means the kind of the tau before is kept. Definitions: IEEE Std
1139-2008; Riley, NIST SP 1065 (2008).
"""

import math
from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ...base.errors import DataError, UsageError
from ...records import chi_square_interval
from ._kernels import modified_power, second_difference_power, third_difference_power
from .edf import Kind, degrees_of_freedom, lowest_alpha
from .wavelet import cumulated

Array = NDArray[np.float64]
Spacing = Literal["octave", "decade"] | int

NOISES = {  # exponent alpha of the rate's spectrum f^alpha
    "quantization": 2,
    "flicker_phase": 1,
    "white_noise": 0,
    "flicker": -1,
    "random_walk": -2,
    "flicker_walk": -3,
    "random_run": -4,
}
LEAST_MEANS = 30  # for the lag-1 autocorrelation
_KINDS: tuple[Kind, ...] = ("allan", "modified", "hadamard")


@dataclass(frozen=True, eq=False)
class Deviation:
    """Deviation of one axis over averaging time, X, with its 95 % interval; arrays (k,).

    kind : "allan", "modified" or "hadamard".
    edf : equivalent degrees of freedom.
    alpha : exponent of the noise that they are for.
    """

    kind: Kind
    tau_s: Array
    deviation: Array
    low: Array
    high: Array
    edf: Array
    alpha: NDArray[np.int64]
    rate_hz: float
    samples: int


def allan_deviation(
    x: ArrayLike,
    rate_hz: float,
    *,
    kind: Kind = "allan",
    spacing: Spacing = "octave",
    noise: str | int | None = None,
) -> Deviation:
    """Overlapping deviation of x (n,), rate samples in X, at all averaging times of the spacing,
    with 95 % intervals (A.1 to A.3).

    spacing : "octave" (m = 1, 2, 4 ...), "decade" (1, 2, 4, 10 ...), or how many to an octave.
    noise : name of `NOISES` or its exponent, for all averaging times; found by itself where None
        (A.4).

    Raises what `wavelet_variance` raises, and DataError where there are too few samples to find the
    noise.
    """
    if kind not in _KINDS:
        raise UsageError(f"kind {kind!r}; known are {', '.join(_KINDS)}")
    s = cumulated(x, rate_hz)
    n = s.size - 1
    m = averaging_factors(n, kind, spacing)
    variance = _variances(s, m, kind)
    if variance.min() <= 0.0:
        raise DataError(
            f"no variance at {m[np.argmin(variance)] / rate_hz:g} s; the series is periodic or"
            " constant but for its ends"
        )
    alpha = _identified(s, m, kind) if noise is None else np.full(m.size, _named(noise, kind))
    edf = np.array(
        [degrees_of_freedom(kind, int(a), int(each), n) for a, each in zip(alpha, m, strict=True)]
    )
    low, high = chi_square_interval(variance, edf)
    return Deviation(
        kind,
        m / rate_hz,
        np.sqrt(variance),
        np.sqrt(low),
        np.sqrt(high),
        edf,
        alpha,
        float(rate_hz),
        n,
    )


def averaging_factors(samples: int, kind: Kind, spacing: Spacing) -> NDArray[np.int64]:
    """Factors m from 1 to the last of which the deviation exists, growing by `spacing` (see
    `allan_deviation`).
    """
    most = {"allan": samples // 2, "modified": (samples + 2) // 3, "hadamard": samples // 3}[kind]
    if spacing == "decade":
        grid = np.outer(10.0 ** np.arange(math.ceil(math.log10(most)) + 1), [1.0, 2.0, 4.0]).ravel()
    elif spacing == "octave" or (
        isinstance(spacing, int) and not isinstance(spacing, bool) and spacing >= 1
    ):
        each = 1 if spacing == "octave" else spacing
        grid = 2.0 ** (np.arange(each * most.bit_length()) / each)
    else:
        raise UsageError(
            f"spacing {spacing!r} is neither 'octave' nor 'decade' nor a number of averaging times"
            " to an octave"
        )
    m = np.unique(np.rint(grid).astype(np.int64))
    return m[m <= most]


def _variances(s: Array, m: NDArray[np.int64], kind: Kind) -> Array:
    """(A.1), (A.2) or (A.3)."""
    size, power = s.size, np.empty(m.size)
    if kind == "modified":
        return np.array(
            [
                modified_power(s, each) / (2.0 * float(each) ** 4 * (size - 3 * each + 1))
                for each in m
            ]
        )
    if kind == "allan":
        second_difference_power(s, m, np.ones_like(m), power)
        return np.asarray(power / (2.0 * m**2 * (size - 2 * m)))
    third_difference_power(s, m, power)
    return np.asarray(power / (6.0 * m**2 * (size - 3 * m)))


def _identified(s: Array, m: NDArray[np.int64], kind: Kind) -> NDArray[np.int64]:
    """(k,) exponents of (A.4), those beyond what the deviation exists for taken as the nearest for
    which it does.
    """
    if s.size - 1 < LEAST_MEANS:
        raise DataError(
            f"{s.size - 1} samples; at least {LEAST_MEANS} are needed to identify the kind of"
            " noise, or name it"
        )
    alpha, last = np.empty(m.size, dtype=np.int64), 0
    for k, each in enumerate(m):
        if (s.size - 1) // each >= LEAST_MEANS:
            last, _ = identify_noise(np.diff(s[::each]), 3 if kind == "hadamard" else 2)
        alpha[k] = min(max(last, lowest_alpha(kind)), 2)
    return alpha


def _named(noise: str | int, kind: Kind) -> int:
    alpha = NOISES.get(noise) if isinstance(noise, str) else noise
    if alpha is None or alpha not in NOISES.values():
        raise UsageError(f"noise {noise!r}; known are {', '.join(NOISES)}")
    if alpha < lowest_alpha(kind):
        raise UsageError(
            f"noise {noise!r}: the {kind} deviation does not exist for it; use 'hadamard'"
        )
    return alpha


def identify_noise(means: Array, most_differences: int) -> tuple[int, float]:
    """Exponent alpha of the spectrum f^alpha of means (k,) of rate samples, to the integer and as
    found (A.4).
    """
    t = np.arange(means.size) - 0.5 * (means.size - 1)
    y = means - means.mean()
    y -= (t @ y) / (t @ t) * t
    for d in range(most_differences + 1):
        y = np.diff(y) if d else y
        y = y - y.mean()
        r = float(y[1:] @ y[:-1]) / float(y @ y)
        rho = r / (1.0 + r)
        if rho < 0.25:
            break
    return -round(2.0 * rho) - 2 * d, -2.0 * (rho + d)
