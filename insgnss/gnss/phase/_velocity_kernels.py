"""Least squares of every interval between two epochs, with rejection; equations in
:mod:`insgnss.gnss.phase.velocity`.
"""

import numpy as np
from numpy.typing import NDArray

from ...base.compilation import njit

Array = NDArray[np.float64]
Index = NDArray[np.int64]

ROBUST_STEPS = 8  # of solving with weights: towards the least sum of |r| (chosen)
# standard deviations from the robust solution, beyond which a row is left out from the start
ROBUST_LIMIT = 6.0


@njit(cache=True, error_model="numpy")
def _invert(N: Array) -> bool:
    """Replace the symmetric positive definite N (4, 4) by its inverse (Gauss-Jordan); whether it
    has one.
    """
    for k in range(4):
        pivot = N[k, k]
        if not pivot > 1e-12:
            return False
        N[k, k] = 1.0
        for j in range(4):
            N[k, j] /= pivot
        for i in range(4):
            if i != k:
                factor = N[i, k]
                N[i, k] = 0.0
                for j in range(4):
                    N[i, j] -= factor * N[k, j]
    return True


@njit(cache=True, error_model="numpy")
def _estimate(
    first: int, last: int, A: Array, y: Array, weight: Array, N: Array, b: Array, x: Array
) -> bool:
    """Fill N (4, 4) with the inverse normal matrix and x (4,) with the solution of rows first to
    last; whether there is one.
    """
    N[:] = 0.0
    b[:] = 0.0
    for i in range(first, last):
        if weight[i] > 0.0:
            for j in range(4):
                wa = weight[i] * A[i, j]
                b[j] += wa * y[i]
                for k in range(4):
                    N[j, k] += wa * A[i, k]
    if not _invert(N):
        return False
    for j in range(4):
        x[j] = N[j, 0] * b[0] + N[j, 1] * b[1] + N[j, 2] * b[2] + N[j, 3] * b[3]
    return True


@njit(cache=True, error_model="numpy")
def _residual(i: int, A: Array, y: Array, x: Array) -> float:
    return y[i] - A[i, 0] * x[0] - A[i, 1] * x[1] - A[i, 2] * x[2] - A[i, 3] * x[3]


@njit(cache=True, error_model="numpy")
def _redundancy(i: int, A: Array, weight: Array, N: Array) -> float:
    """1 - a N a^T w: the share of row i that the others check."""
    q = 0.0
    for j in range(4):
        for k in range(4):
            q += A[i, j] * N[j, k] * A[i, k]
    return max(1.0 - weight[i] * q, 0.0)


@njit(cache=True, error_model="numpy")
def _satellites(first: int, last: int, satellite: Index, weight: Array) -> int:
    """Number of different satellites among rows of positive weight; rows of one satellite stand
    together.
    """
    count, before = 0, -1
    for i in range(first, last):
        if weight[i] > 0.0 and satellite[i] != before:
            count, before = count + 1, satellite[i]
    return count


@njit(cache=True, error_model="numpy")
def _start(
    first: int,
    last: int,
    A: Array,
    y: Array,
    sigma: Array,
    weight: Array,
    N: Array,
    b: Array,
    x: Array,
) -> bool:
    """Set weights to zero where a row is far from the solution of least absolute residuals; whether
    there is one.
    """
    for i in range(first, last):
        weight[i] = 1.0 / sigma[i] ** 2
    for _ in range(ROBUST_STEPS):
        if not _estimate(first, last, A, y, weight, N, b, x):
            return False
        for i in range(first, last):
            weight[i] = 1.0 / (sigma[i] * max(abs(_residual(i, A, y, x)), sigma[i]))
    for i in range(first, last):
        weight[i] = (
            1.0 / sigma[i] ** 2 if abs(_residual(i, A, y, x)) <= ROBUST_LIMIT * sigma[i] else 0.0
        )
    return True


@njit(cache=True, error_model="numpy")
def _clean(
    first: int,
    last: int,
    A: Array,
    y: Array,
    sigma: Array,
    satellite: Index,
    limit: float,
    fewest: int,
    weight: Array,
    N: Array,
    b: Array,
    x: Array,
) -> bool:
    """Leave out the row of largest normalised residual until none exceeds `limit`; whether enough
    satellites stay.
    """
    while _satellites(first, last, satellite, weight) >= fewest:
        if not _estimate(first, last, A, y, weight, N, b, x):
            return False
        worst, largest = -1, limit
        for i in range(first, last):
            if weight[i] > 0.0:
                size = abs(_residual(i, A, y, x)) / (
                    sigma[i] * np.sqrt(max(_redundancy(i, A, weight, N), 1e-4))
                )
                if size > largest:
                    worst, largest = i, size
        if worst < 0:
            return True
        weight[worst] = 0.0
    return False


@njit(cache=True, error_model="numpy")
def _spread(
    first: int,
    last: int,
    A: Array,
    sigma: Array,
    common: Array,
    satellite: Index,
    weight: Array,
    N: Array,
    g: Array,
    M: Array,
    cov: Array,
) -> None:
    """Fill cov (4, 4) with the covariance N M N of the solution (V.4): rows of a satellite share
    the error `common`.
    """
    M[:] = 0.0
    g[:] = 0.0
    for i in range(first, last):
        if weight[i] > 0.0:
            independent = weight[i] ** 2 * (sigma[i] ** 2 - common[i] ** 2)
            for j in range(4):
                g[j] += weight[i] * common[i] * A[i, j]
                for k in range(4):
                    M[j, k] += independent * A[i, j] * A[i, k]
        if i + 1 == last or satellite[i + 1] != satellite[i]:
            for j in range(4):
                for k in range(4):
                    M[j, k] += g[j] * g[k]
            g[:] = 0.0
    cov[:] = 0.0
    for i in range(4):
        for j in range(4):
            for k in range(4):
                for h in range(4):
                    cov[i, j] += N[i, k] * M[k, h] * N[h, j]


@njit(cache=True, error_model="numpy")
def solve(
    bounds: Index,
    A: Array,
    y: Array,
    sigma: Array,
    common: Array,
    satellite: Index,
    limit: float,
    fewest: int,
    solution: Array,
    cov: Array,
    weight: Array,
    normalised: Array,
    sums: Array,
) -> None:
    """Solve the interval of rows bounds[k] to bounds[k + 1] for every k.

    A (m, 4), y (m,) m, sigma (m,) m, of which `common` (m,) is shared by the rows of a satellite;
    satellite (m,) numbers, sorted within an interval. Filled are solution (n, 4), cov (n, 4, 4),
    weight (m,), zero where left out, normalised (m,) residuals over their own standard deviation,
    and sums (n, 3): satellites, sum of weighted squares, redundancy. An interval without a solution
    has none.
    """
    N, M, b, x = np.empty((4, 4)), np.empty((4, 4)), np.empty(4), np.empty(4)
    for k in range(bounds.size - 1):
        first, last = bounds[k], bounds[k + 1]
        sums[k] = 0.0
        weight[first:last] = 1.0
        if _satellites(first, last, satellite, weight) < fewest:
            weight[first:last] = 0.0
            continue
        if not _start(first, last, A, y, sigma, weight, N, b, x) or not _clean(
            first, last, A, y, sigma, satellite, limit, fewest, weight, N, b, x
        ):
            weight[first:last] = 0.0
            continue
        sums[k, 0] = _satellites(first, last, satellite, weight)
        solution[k] = x
        _spread(first, last, A, sigma, common, satellite, weight, N, b, M, cov[k])
        for i in range(first, last):
            if weight[i] > 0.0:
                residual, redundancy = _residual(i, A, y, x), _redundancy(i, A, weight, N)
                normalised[i] = residual / (sigma[i] * np.sqrt(max(redundancy, 1e-4)))
                sums[k, 1] += residual * residual * weight[i]
                sums[k, 2] += redundancy
