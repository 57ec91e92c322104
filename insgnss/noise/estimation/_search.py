"""Kernels of the search for correlation times: non-negative least squares, and descent between the
times of a grid.

Given the times, the weighted fit is least squares in non-negative variances x, so a choice of times
has one value. With columns of unit length in the rows of A, H = A A' and b = A y:

    Q(times) = y'y - max over x >= 0 of (2 b'x - x'H x),
    and the maximum is b'x where it is reached                                                 (S.1)

Columns change smoothly with log T, over a factor of three or more. Between candidate times, of
which there are twelve a decade, they are interpolated by cubic polynomials from values and
derivatives at both (to a part in a million), so that the minimum over continuous times costs
microseconds. A position on the grid is an index with fraction. Matrix products are written out:
matrices have a few rows.
"""

import math

import numpy as np

from ...base.compilation import njit
from ...records import Array

# squared length that columns before it leave of a unit column; below, it is rounding
_PIVOT = 1e-13
_GRADIENT = 1e-14  # of |y|; below, a variance of zero may stay so
_STRIDE = 6.0  # candidates, half a decade: longest step of a descent
# of Q, gain of a step after which a descent ends; Newton's method on the exact columns does the
# rest
_LEAST_GAIN = 1e-9


@njit(cache=True)
def nonnegative(H: Array, b: Array, x: Array, work: Array) -> float:
    """b'x at the maximum of (S.1): active sets of Lawson and Hanson (1974), chapter 23, after a
    trial with all columns in use.

    H (p, p), b (p,) : inner products.   x (p,) : result.   work (p + 2, p) : scratch.
    """
    p = b.size
    # state: 1 in use, 0 at zero, -1 refused as dependent on those in use
    z, state = work[p], work[p + 1]
    for i in range(p):
        x[i], state[i] = 0.0, 1.0
    done = _solve(H, b, state, z, work)
    for i in range(p):
        done = done and z[i] > 0.0
    if done:
        for i in range(p):
            x[i] = z[i]
    else:
        _active_sets(H, b, state, x, z, work)
    value = 0.0
    for i in range(p):
        value += b[i] * x[i]
    return value


@njit(cache=True)
def _active_sets(H: Array, b: Array, state: Array, x: Array, z: Array, work: Array) -> None:
    """Takes in, one by one, the column whose variance gains most, and gives up those that reach
    zero.
    """
    p = b.size
    for i in range(p):
        state[i] = 0.0
    for _ in range(4 * p):
        best, entering = _GRADIENT, -1
        for i in range(p):
            if state[i] == 0.0:
                w = b[i]
                for j in range(p):
                    w -= H[i, j] * x[j]
                if w > best:
                    best, entering = w, i
        if entering < 0:
            break
        state[entering] = 1.0
        if not _solve(H, b, state, z, work) or z[entering] <= 0.0:
            state[entering] = -1.0
            continue
        _step_back(H, b, state, x, z, work)
        for i in range(p):
            if state[i] < 0.0:
                state[i] = 0.0


@njit(cache=True)
def _step_back(H: Array, b: Array, state: Array, x: Array, z: Array, work: Array) -> None:
    """From x towards the unconstrained solution z, giving up the columns that reach zero on the
    way.
    """
    p = b.size
    while True:
        step, first = 1.0, -1
        for i in range(p):
            if state[i] > 0.0 and z[i] < 0.0 and x[i] / (x[i] - z[i]) < step:
                step, first = x[i] / (x[i] - z[i]), i
        if first < 0:
            break
        for i in range(p):
            if state[i] > 0.0:
                x[i] += step * (z[i] - x[i])
        x[first], state[first] = 0.0, 0.0
        _solve(H, b, state, z, work)
    for i in range(p):
        x[i] = z[i] if state[i] > 0.0 else 0.0


@njit(cache=True)
def _solve(H: Array, b: Array, state: Array, z: Array, L: Array) -> bool:
    """Solution z (p,) of H z = b over the columns in use, zero for the others, by Cholesky; False
    where they are dependent.
    """
    p = b.size
    for i in range(p):
        z[i] = 0.0
        if state[i] <= 0.0:
            continue
        for j in range(i + 1):
            if state[j] <= 0.0:
                continue
            s = H[i, j]
            for k in range(j):
                if state[k] > 0.0:
                    s -= L[i, k] * L[j, k]
            if i > j:
                L[i, j] = s / L[j, j]
            elif not s >= _PIVOT:
                return False
            else:
                L[i, i] = math.sqrt(s)
        s = b[i]
        for k in range(i):
            if state[k] > 0.0:
                s -= L[i, k] * z[k]
        z[i] = s / L[i, i]
    for i in range(p - 1, -1, -1):
        if state[i] > 0.0:
            for k in range(i + 1, p):
                if state[k] > 0.0:
                    z[i] -= L[k, i] * z[k]
            z[i] /= L[i, i]
    return True


@njit(cache=True)
def _dot(a: Array, b: Array) -> float:
    total = 0.0
    for m in range(a.size):
        total += a[m] * b[m]
    return total


@njit(cache=True)
def _copy(a: Array, b: Array) -> None:
    for m in range(a.size):
        b[m] = a[m]


@njit(cache=True)
def _interpolate(position: float, D: Array, slope: Array, d: Array, d1: Array, d2: Array) -> None:
    """Write column d (M,) at a grid position and its first two derivatives by it."""
    i = min(int(position), D.shape[0] - 2)
    s = position - i
    for m in range(d.size):
        rise = D[i + 1, m] - D[i, m]
        u, v = slope[i, m] - rise, slope[i + 1, m] - rise
        d[m] = D[i, m] + s * (rise + (1.0 - s) * ((1.0 - s) * u - s * v))
        d1[m] = rise + (1.0 - s) * (1.0 - 3.0 * s) * u + s * (3.0 * s - 2.0) * v
        d2[m] = (6.0 * s - 4.0) * u + (6.0 * s - 2.0) * v


@njit(cache=True)
def profile(positions: Array, linear: Array, D: Array, slope: Array, y: Array, gain: Array) -> None:
    """Write b'x of (S.1) with one more process at each candidate into gain (t,).

    The others are those at `positions` (K,) on the grid and those without a time.

    linear (L, M), D (t, M) : unit columns of processes without a time and of the candidates; slope
        (t, M) : derivative of D a candidate.
    """
    fixed, last = linear.shape[0], linear.shape[0] + positions.size
    A, unused = np.empty((last + 1, y.size)), np.empty((2, y.size))
    H, b, x, work = (
        np.empty((last + 1, last + 1)),
        np.empty(last + 1),
        np.empty(last + 1),
        np.empty((last + 3, last + 1)),
    )
    for i in range(last):
        if i < fixed:
            _copy(linear[i], A[i])
        else:
            _interpolate(positions[i - fixed], D, slope, A[i], unused[0], unused[1])
    for i in range(last):
        b[i] = _dot(A[i], y)
        for j in range(last):
            H[i, j] = _dot(A[i], A[j])
    for c in range(D.shape[0]):
        for j in range(last):
            H[last, j] = _dot(D[c], A[j])
            H[j, last] = H[last, j]
        H[last, last], b[last] = 1.0, _dot(D[c], y)
        gain[c] = nonnegative(H, b, x, work)


@njit(cache=True)
def _evaluate(
    positions: Array,
    D: Array,
    slope: Array,
    y: Array,
    A: Array,
    A1: Array,
    A2: Array,
    H: Array,
    x: Array,
    r: Array,
) -> float:
    """Return Q at `positions` (K,) on the grid.

    It fills the last K columns of A (p, M), A1, A2 (K, M), H (p, p), the variances x and the
    residual r (M,).
    """
    p = A.shape[0]
    fixed = p - positions.size
    b, work = np.empty(p), np.empty((p + 2, p))
    for k in range(positions.size):
        _interpolate(positions[k], D, slope, A[fixed + k], A1[k], A2[k])
    for i in range(p):
        b[i] = _dot(A[i], y)
        for j in range(i + 1):
            H[i, j] = _dot(A[i], A[j])
            H[j, i] = H[i, j]
    nonnegative(H, b, x, work)
    for m in range(y.size):
        r[m] = y[m]
        for i in range(p):
            r[m] -= x[i] * A[i, m]
    return _dot(r, r)


@njit(cache=True)
def _curvature(
    A: Array, A1: Array, A2: Array, H: Array, x: Array, r: Array, g: Array, G: Array
) -> None:
    """Half the gradient g (K,) and Hessian G (K, K), by the places, of the minimum over the
    variances (M.2, M.3 of `_matching`).
    """
    p, K = A.shape[0], A1.shape[0]
    fixed = p - K
    state, work, z, B = np.empty(p), np.empty((p + 2, p)), np.empty((K, p)), np.empty((K, p))
    for i in range(p):
        state[i] = 1.0 if x[i] > 0.0 else 0.0
    for k in range(K):
        slope = _dot(A1[k], r)
        g[k] = -x[fixed + k] * slope
        for i in range(p):
            B[k, i] = x[fixed + k] * _dot(A[i], A1[k])
        B[k, fixed + k] -= slope
        _solve(H, B[k], state, z[k], work)
    for k in range(K):
        for l in range(K):
            G[k, l] = x[fixed + k] * x[fixed + l] * _dot(A1[k], A1[l]) - _dot(B[k], z[l])
        G[k, k] -= x[fixed + k] * _dot(A2[k], r)


@njit(cache=True)
def _move(
    positions: Array, g: Array, G: Array, damping: float, last: float, trial: Array, work: Array
) -> bool:
    """Make a damped Newton step from `positions` (K,) to `trial`; False where none leads downhill.

    Positions that the gradient holds at an end stay.
    """
    K = positions.size
    state, step, size = work[K], work[K + 1], 0.0
    for k in range(K):
        held = (
            g[k] == 0.0
            or (positions[k] <= 0.0 and g[k] > 0.0)
            or (positions[k] >= last and g[k] < 0.0)
        )
        state[k] = 0.0 if held else 1.0
        size = size if held else max(size, abs(G[k, k]))
    if size == 0.0:
        return False
    damped, down = np.empty((K, K)), np.empty(K)
    for k in range(K):
        for l in range(K):
            damped[k, l] = G[k, l] / size
        damped[k, k] += damping
        down[k] = -g[k] / size
    if not _solve(damped, down, state, step, work):
        return False
    largest = 0.0
    for k in range(K):
        largest = max(largest, abs(step[k]))
    shrink = _STRIDE / largest if largest > _STRIDE else 1.0
    for k in range(K):
        trial[k] = min(max(positions[k] + shrink * step[k], 0.0), last)
    return True


@njit(cache=True)
def settle(positions: Array, linear: Array, D: Array, slope: Array, y: Array) -> float:
    """Descend from `positions` (K,) to a minimum of Q, in place, and return Q.

    linear, D, slope, y are as in `profile`.
    """
    fixed, K, M = linear.shape[0], positions.size, y.size
    p, last = fixed + K, D.shape[0] - 1.0
    A, A1, A2, H, x, r = (
        np.empty((p, M)),
        np.empty((K, M)),
        np.empty((K, M)),
        np.empty((p, p)),
        np.empty(p),
        np.empty(M),
    )
    g, G, trial, work = np.empty(K), np.empty((K, K)), np.empty(K), np.empty((K + 2, K))
    for i in range(fixed):
        _copy(linear[i], A[i])
    value, damping = _evaluate(positions, D, slope, y, A, A1, A2, H, x, r), 1e-3
    for _ in range(60):
        _curvature(A, A1, A2, H, x, r, g, G)
        after = value
        for _ in range(12):
            if _move(positions, g, G, damping, last, trial, work):
                after = _evaluate(trial, D, slope, y, A, A1, A2, H, x, r)
                if after < value:
                    break
            damping *= 6.0
        if after >= value:
            break
        gain, value = value - after, after
        for k in range(K):
            positions[k] = trial[k]
        damping = max(0.1 * damping, 1e-9)
        if gain <= _LEAST_GAIN * value:
            break
    return value
