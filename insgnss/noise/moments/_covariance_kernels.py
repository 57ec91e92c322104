"""Kernels of `haar_covariance`: the lag covariance of two Haar levels, and its weighted sum over
all lags. Labels as there.
"""

import math

import numpy as np

from ...base.compilation import njit
from ...records import Array

DIRECT = 16  # lags of the innermost panels, which are summed one by one
_HALF_NODES = np.array(
    [0.1834346424956498, 0.525532409916329, 0.7966664774136267, 0.9602898564975363]
)  # Gauss-Legendre, 8 nodes
_NODES = 8  # of the rule: twice `_HALF_NODES`


@njit(cache=True)
def _sinh_less(z: float) -> float:
    """sinh z - z for z >= 0."""
    if z >= 1.0:
        return math.sinh(z) - z
    z2, total = z * z, 1.0
    for k in range(16, 2, -2):
        total = 1.0 + total * z2 / (k * (k + 1.0))
    return z * z2 / 6.0 * total


@njit(cache=True)
def _psi(y: float, u: float, P: float, B: float) -> float:
    """Odd part of one Gauss-Markov process (H.5)."""
    return P * _sinh_less(u * y) - 0.25 * B * y


@njit(cache=True)
def _polynomials(h: float, m_j: float, m_k: float, a_1: float, a_3: float) -> float:
    """Sum of (H.4) for a_1 y + a_3 y^3."""
    total, y = 0.0, m_j - h
    if y >= m_k:
        total = 6.0 * a_3 * m_k * m_k * y
    else:
        for b in range(-1, 2):
            z = y + b * m_k
            if z > 0.0:
                total += (1.0 if b else -2.0) * z * (a_1 + a_3 * z * z)
    if h < m_k:
        z = m_k - h
        total -= 2.0 * z * (a_1 + a_3 * z * z)
    return 2.0 * total


@njit(cache=True)
def _slow(h: float, m_j: float, m_k: float, u: float, P: float, B: float) -> float:
    """(H.4, H.5) of a Gauss-Markov process whose correlation time is longer than the averaging time
    m_j.
    """
    s_j, s_k = 2.0 * math.sinh(0.5 * u * m_j), 2.0 * math.sinh(0.5 * u * m_k)
    base = -P * (s_j * s_k) ** 2 * math.exp(-u * h)
    total, y = 0.0, m_j - h
    if y >= m_k:
        total = P * s_k * s_k * math.sinh(u * y)
    else:
        for b in range(-1, 2):
            z = y + b * m_k
            if z > 0.0:
                total += (1.0 if b else -2.0) * _psi(z, u, P, B)
    if h < m_k:
        total -= 2.0 * _psi(m_k - h, u, P, B)
    return base + 2.0 * total


@njit(cache=True)
def _row(y: float, m_k: float, u: float, P: float, B: float, c: float) -> float:
    """Second difference of P exp(-u|y|) + (c/2)|y| at spacing m_k (H.6)."""
    x = u * m_k
    if y >= m_k:
        return P * math.expm1(-x) ** 2 * math.exp(-u * (y - m_k))
    if x < 1.0:
        return P * (2.0 * math.sinh(0.5 * x)) ** 2 * math.exp(-u * y) - 2.0 * _psi(m_k - y, u, P, B)
    return P * (math.exp(-x - u * y) - 2.0 * math.exp(-u * y) + math.exp(u * y - x)) + c * (m_k - y)


@njit(cache=True)
def lag_covariance(h: float, m_j: float, m_k: float, a_1: float, a_3: float, gm: Array) -> float:
    """Covariance of W_j and W_k, without quantization, at centre distance h >= 0, for m_j >= m_k
    (H.2).

    a_1, a_3 : polynomial part of K (H.3).   gm : (processes, 4) u, and sigma^2 times P, B and c
                                             (G.1).
    """
    total = _polynomials(h, m_j, m_k, a_1, a_3)
    for i in range(gm.shape[0]):
        u, P, B, c = gm[i, 0], gm[i, 1], gm[i, 2], gm[i, 3]
        if u * m_j < 1.0:
            total += _slow(h, m_j, m_k, u, P, B)
        else:
            rows = (
                _row(h + m_j, m_k, u, P, B, c)
                - 2.0 * _row(h, m_k, u, P, B, c)
                + _row(abs(h - m_j), m_k, u, P, B, c)
            )
            total -= rows
    return total / (4.0 * m_j * m_k)


@njit(cache=True)
def _term(h: float, M: float, C: float, m_j: float, m_k: float, drift: float) -> float:
    """Summand of (H.1): overlap times 2 C^2 + 4 mu_j mu_k C."""
    return (M - max(0.0, h - (m_j - m_k))) * (2.0 * C * C + 4.0 * drift * drift * m_j * m_k * C)


@njit(cache=True)
def _panel(
    first: float,
    size: int,
    M: float,
    m_j: float,
    m_k: float,
    a_1: float,
    a_3: float,
    gm: Array,
    drift: float,
) -> float:
    """Sum over the lags first, first + 1, ... (size of them), by the Gauss rule of the discrete sum
    (H.7).
    """
    total = 0.0
    if size <= DIRECT:
        for i in range(size):
            h = first + i
            total += _term(h, M, lag_covariance(h, m_j, m_k, a_1, a_3, gm), m_j, m_k, drift)
        return total
    centre, half, inverse = first + 0.5 * (size - 1), 0.5 * size, 1.0 / (float(size) * size)
    for node in _HALF_NODES:
        t, weight = node, 0.0
        for _ in range(5):
            before, p, d_before, d, norm = 0.0, 1.0, 0.0, 0.0, float(size)
            for k in range(_NODES):
                beta = k * k * (1.0 - k * k * inverse) / (4.0 * k * k - 1.0)
                if k:
                    norm *= beta
                before, p, d_before, d = p, t * p - beta * before, d, p + t * d - beta * d_before
            weight = norm / (before * d)
            step = p / d
            t -= step
            if abs(step) < 1e-12:
                break
        for side in (-1.0, 1.0):
            h = centre + side * half * t
            total += weight * _term(
                h, M, lag_covariance(h, m_j, m_k, a_1, a_3, gm), m_j, m_k, drift
            )
    return total


@njit(cache=True)
def _sum_between_breaks(
    lo: float,
    hi: float,
    M: float,
    m_j: float,
    m_k: float,
    a_1: float,
    a_3: float,
    gm: Array,
    drift: float,
) -> float:
    """Sum over the lags strictly between two breaks; panels grow from both ends to the middle."""
    total, left, right, size = 0.0, lo + 1.0, hi - 1.0, DIRECT
    while left <= right:
        take = min(size, int(right - left) + 1)
        total += _panel(left, take, M, m_j, m_k, a_1, a_3, gm, drift)
        left += take
        take = min(size, int(right - left) + 1)
        if take > 0:
            total += _panel(right - take + 1.0, take, M, m_j, m_k, a_1, a_3, gm, drift)
            right -= take
        size = int(left - lo) - 1
    return total


@njit(cache=True)
def pair_covariance(
    n: int,
    m_j: float,
    m_k: float,
    a_1: float,
    a_3: float,
    quantized: float,
    gm: Array,
    drift: float,
) -> float:
    """(H.1) for m_j >= m_k."""
    M, M_k = n - 2.0 * m_j + 1.0, n - 2.0 * m_k + 1.0
    end = M + m_j - m_k  # the first lag without overlap
    breaks = np.array([0.0, m_k, m_j - m_k, m_j, m_j + m_k, end])
    breaks.sort()
    total, last = 0.0, -1.0
    for h in breaks:
        if h == last or h > end:
            continue
        if last >= 0.0:
            total += 2.0 * _sum_between_breaks(last, h, M, m_j, m_k, a_1, a_3, gm, drift)
        C, hits = lag_covariance(h, m_j, m_k, a_1, a_3, gm), 0.0
        for a in range(-1, 2):
            for b in range(-1, 2):
                if h + a * m_j + b * m_k == 0.0:
                    hits += (1.0 if a else -2.0) * (1.0 if b else -2.0)
        C += quantized * hits / (4.0 * m_j * m_k)
        total += (2.0 if h > 0.0 else 1.0) * _term(h, M, C, m_j, m_k, drift)
        last = h
    return total / (M * M_k)


@njit(cache=True, nogil=True)
def all_pairs(
    n: int, m: Array, a_1: float, a_3: float, quantized: float, gm: Array, drift: float, out: Array
) -> None:
    """Fill the symmetric matrix over the averaging factors `m`, in any order."""
    for j in range(m.size):
        for k in range(j + 1):
            large, small = max(m[j], m[k]), min(m[j], m[k])
            out[j, k] = pair_covariance(n, large, small, a_1, a_3, quantized, gm, drift)
            out[k, j] = out[j, k]
