r"""Equivalent degrees of freedom of the Allan, modified Allan and Hadamard variance in power-law
noise.

A variance estimate V from M terms z_i^2, z stationary normal of covariance R(i), has the degrees of
freedom of the chi-square that it resembles, 2 (E V)^2 / var V:

    1/edf = (1/M) sum over |i| < M of (1 - |i|/M) (R(i)/R(0))^2                                (E.1)

Greenhall and Riley (2003, Uncertainty of stability variances based on finite differences, 35th
PTTI) evaluate it for phase noise whose frequency has the spectrum f^alpha, by the generalised
covariance of continuous phase

    s_w(t) = |t|, t^2 ln|t|, |t|^3, t^4 ln|t|, |t|^5 ...  for alpha = 2, 1, 0, -1, -2 ...,
             up to a sign that R(i)/R(0) does not see                                          (E.2)
    s_x(t) = F^2 (2 s_w(t) - s_w(t - 1/F) - s_w(t + 1/F)),
             for F without end s_w(t) of alpha + 2                                             (E.3)
    s_z(t) = differences of order 2 d of s_x at unit spacing,     d = 2 (Allan), 3 (Hadamard)  (E.4)

with t in units of tau, F = m filter steps (1 for the modified variance), S = m estimates per tau
and M terms. The sum of (E.1) is cut at J = min(M, (d + 1) S) terms, beyond which z is as good as
uncorrelated. Where J exceeds 100 it is taken as (a0 - a1/r)/r, r = M/S, with their tabulated
integrals. White phase noise (alpha = 2, quantization of an inertial sensor) is correlated at
multiples of m:

    R(k m)/R(0) = (-1)^k C(2d, d - k) / C(2d, d)                                               (E.5)
"""

import math
from typing import Literal

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
Kind = Literal["allan", "modified", "hadamard"]

MOST_TERMS = 100
ORDER: dict[str, int] = {"allan": 2, "modified": 2, "hadamard": 3}  # of the differences of phase

# Greenhall and Riley, Tables 1 and 2: (a0, a1) by alpha, for d = 2 and d = 3; Table 3: (b0, b1) of
# alpha = 1
_TABLE_MODIFIED: dict[int, dict[int, tuple[float, float]]] = {
    2: {
        2: (7.0 / 9.0, 0.5),
        1: (0.997, 0.616),
        0: (1.033, 0.607),
        -1: (1.048, 0.534),
        -2: (1.302, 0.535),
    },
}
_TABLE: dict[int, dict[int, tuple[float, float]]] = {
    2: {1: (790.0, 410.0), 0: (2.0 / 3.0, 1.0 / 3.0), -1: (0.852, 0.375), -2: (1.079, 0.368)},
    3: {
        1: (9950.0, 6520.0),
        0: (7.0 / 9.0, 0.5),
        -1: (0.997, 0.617),
        -2: (1.033, 0.607),
        -3: (1.053, 0.553),
        -4: (1.302, 0.535),
    },
}
_TABLE_FLICKER_PHASE: dict[int, tuple[float, float]] = {2: (15.23, 12.0), 3: (47.8, 40.0)}


def lowest_alpha(kind: Kind) -> int:
    """The reddest noise of which the variance exists: -2, for the Hadamard variance -4."""
    return -4 if kind == "hadamard" else -2


def degrees_of_freedom(kind: Kind, alpha: int, m: int, samples: int) -> float:
    """Equivalent degrees of freedom of the overlapping estimate at averaging factor m from n rate
    samples (E.1).

    alpha : exponent of the rate's spectrum, 2 (quantization) ... 0 (white) ... -2 (random walk), to
        -4 for the Hadamard variance.
    """
    d = ORDER[kind]
    length = m + m * d if kind == "modified" else 1 + m * d
    terms = 1 + (samples + 1 - length)  # the phase has one value more than the rate
    if kind == "modified":
        return _modified(alpha, m, terms)
    if alpha == 2:
        return _white_phase(d, m, terms)
    return _flicker_phase(d, m, terms) if alpha == 1 else _unmodified(alpha, d, m, terms)


def _modified(alpha: int, m: int, terms: int) -> float:
    d, r = 2, terms / m
    cut = min(terms, (d + 1) * m)
    if cut <= MOST_TERMS:
        return 1.0 / _basic_sum(cut, terms, m, 1.0, alpha, d)
    if r > d + 1:
        return _integral(_TABLE_MODIFIED[d][alpha], r)
    return 1.0 / _basic_sum(MOST_TERMS, MOST_TERMS, MOST_TERMS / r, 1.0, alpha, d)


def _unmodified(alpha: int, d: int, m: int, terms: int) -> float:
    """White frequency noise and redder."""
    r = terms / m
    cut = min(terms, (d + 1) * m)
    if cut <= MOST_TERMS:
        return 1.0 / _basic_sum(
            cut, terms, m, m if m * (d + 1) <= MOST_TERMS else math.inf, alpha, d
        )
    if r > d + 1:
        return _integral(_TABLE[d][alpha], r)
    return 1.0 / _basic_sum(MOST_TERMS, MOST_TERMS, MOST_TERMS / r, math.inf, alpha, d)


def _flicker_phase(d: int, m: int, terms: int) -> float:
    r = terms / m
    cut = min(terms, (d + 1) * m)
    if cut <= MOST_TERMS:
        return 1.0 / _basic_sum(cut, terms, m, m, 1, d)
    b0, b1 = _TABLE_FLICKER_PHASE[d]
    power = (b0 + b1 * math.log(m)) ** 2
    if r > d + 1:
        return power * _integral(_TABLE[d][1], r)
    step = MOST_TERMS / r
    s_z = _s_z(np.arange(MOST_TERMS) / step, step, 1, d) ** 2
    weight = 2.0 * (1.0 - np.arange(MOST_TERMS) / MOST_TERMS)
    weight[0] = 1.0
    return power * MOST_TERMS / float(weight @ s_z)


def _white_phase(d: int, m: int, terms: int) -> float:
    """(E.1) with (E.5); beyond k = d there is no correlation."""
    r = terms / m
    total = 1.0
    for k in range(1, min(math.ceil(r) - 1, d) + 1):
        total += 2.0 * (1.0 - k / r) * (math.comb(2 * d, d - k) / math.comb(2 * d, d)) ** 2
    return terms / total


def _integral(table: tuple[float, float], r: float) -> float:
    return r / (table[0] - table[1] / r)


def _basic_sum(cut: int, terms: int, stride: float, steps: float, alpha: int, d: int) -> float:
    """1/edf of (E.1), cut at `cut` terms."""
    i = np.arange(cut + 1)
    s_z = _s_z(i / stride, steps, alpha, d)
    weight = 2.0 * (1.0 - i / terms)
    weight[0] = 1.0
    weight[-1] *= 0.5
    return float(weight @ (s_z / s_z[0]) ** 2) / terms


def _s_z(t: Array, steps: float, alpha: int, d: int) -> Array:
    """(E.4)."""
    k = np.arange(-d, d + 1)
    factor = np.array([(-1.0) ** i * math.comb(2 * d, d + i) for i in k])
    return np.asarray(_s_x(t[:, None] + k, steps, alpha) @ factor)


def _s_x(t: Array, steps: float, alpha: int) -> Array:
    """(E.3)."""
    if math.isinf(steps):
        return _s_w(t, alpha + 2)
    return np.asarray(
        steps**2
        * (2.0 * _s_w(t, alpha) - _s_w(t - 1.0 / steps, alpha) - _s_w(t + 1.0 / steps, alpha))
    )


def _s_w(t: Array, alpha: int) -> Array:
    """(E.2)."""
    power = np.abs(t) ** (3 - alpha)
    if alpha % 2 == 0:
        return np.asarray(power)
    return np.asarray(power * np.log(np.where(t == 0.0, 1.0, np.abs(t))))
