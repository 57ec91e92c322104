"""Numba kernels of the recogniser: propagated specific force, and its products with GNSS.

The products are those with the GNSS accelerations over many lags. Mathematics: the package's
docstring. The kernels are apart from those of `prepare` because the estimation uses none of them.
"""

import math

import numpy as np
from numpy.typing import NDArray

from ...base.compilation import njit

Array = NDArray[np.float64]


@njit(cache=True, allocates=False)
def propagate(dtheta: Array, dvel: Array, step: float, C: Array, V: Array, S: Array) -> None:
    """Propagate attitude C (n + 1, 3, 3) and integrals V, S (n + 1, 3) of the specific force (R.1).

    They are against the first instant, in the axes of that instant. dtheta, dvel (n, 3) are rad and
    m/s over intervals of `step` s, in the sensor's axes.
    """
    for r in range(3):
        for c in range(3):
            C[0, r, c] = 1.0 if r == c else 0.0
        V[0, r] = S[0, r] = 0.0
    for i in range(dtheta.shape[0]):
        x, y, z = dtheta[i, 0], dtheta[i, 1], dtheta[i, 2]
        u, v, w = dvel[i, 0], dvel[i, 1], dvel[i, 2]
        u, v, w = u + 0.5 * (y * w - z * v), v + 0.5 * (z * u - x * w), w + 0.5 * (x * v - y * u)
        angle2 = x * x + y * y + z * z
        if angle2 < 1e-6:
            s, k = 1.0 - angle2 / 6.0, 0.5 - angle2 / 24.0
        else:
            angle = math.sqrt(angle2)
            s, k = math.sin(angle) / angle, (1.0 - math.cos(angle)) / angle2
        r00, r11, r22 = (
            1.0 - k * (y * y + z * z),
            1.0 - k * (x * x + z * z),
            1.0 - k * (x * x + y * y),
        )
        r01, r10 = k * x * y - s * z, k * x * y + s * z
        r02, r20 = k * x * z + s * y, k * x * z - s * y
        r12, r21 = k * y * z - s * x, k * y * z + s * x
        for r in range(3):
            a, b, c2 = C[i, r, 0], C[i, r, 1], C[i, r, 2]
            d = a * u + b * v + c2 * w
            V[i + 1, r] = V[i, r] + d
            S[i + 1, r] = S[i, r] + step * (V[i, r] + 0.5 * d)
            C[i + 1, r, 0] = a * r00 + b * r10 + c2 * r20
            C[i + 1, r, 1] = a * r01 + b * r11 + c2 * r21
            C[i + 1, r, 2] = a * r02 + b * r12 + c2 * r22


@njit(cache=True, allocates=False)
def interpolate(instant: float, X: Array, dX: Array, step: float, out: Array) -> None:
    """Interpolate X (n, 3) with derivative dX by cubic Hermite polynomials, into out (3,).

    `instant`, s after the first row, lies inside.
    """
    i = min(max(int(instant / step), 0), X.shape[0] - 2)
    p = instant / step - i
    q = 1.0 - p
    h0, h1 = q * q * (1.0 + 2.0 * p), p * p * (3.0 - 2.0 * p)
    g0, g1 = p * q * q * step, -p * p * q * step
    for c in range(3):
        out[c] = h0 * X[i, c] + h1 * X[i + 1, c] + g0 * dX[i, c] + g1 * dX[i + 1, c]


@njit(cache=True, allocates=False)
def differences(
    cell: Array,
    coef: Array,
    X: Array,
    dX: Array,
    E: Array,
    step: float,
    a: Array,
    da: Array,
    D: Array,
) -> None:
    """Sum differences of X, of its derivative dX and of E, with derivatives dX and E of the former.

    `cell` (k, 3) are the nodes in rows of X (n, 3) and E (n, 3, 3), coef (k, 3) their coefficients.
    Into a, da (k, 3) and D (k, 3, 3); X between its rows by cubic Hermite polynomials.
    """
    for i in range(cell.shape[0]):
        for c in range(3):
            a[i, c] = da[i, c] = 0.0
            for r in range(3):
                D[i, c, r] = 0.0
        for n in range(3):
            j = min(max(int(cell[i, n]), 0), X.shape[0] - 2)
            p, t = cell[i, n] - j, coef[i, n]
            q = 1.0 - p
            h0, h1 = t * q * q * (1.0 + 2.0 * p), t * p * p * (3.0 - 2.0 * p)
            g0, g1 = t * step * p * q * q, -t * step * p * p * q
            q *= t
            p *= t
            for c in range(3):
                a[i, c] += h0 * X[j, c] + h1 * X[j + 1, c] + g0 * dX[j, c] + g1 * dX[j + 1, c]
                da[i, c] += q * dX[j, c] + p * dX[j + 1, c]
                for r in range(3):
                    D[i, c, r] += q * E[j, c, r] + p * E[j + 1, c, r]


@njit(cache=True, allocates=False)
def scan(
    nodes: Array,
    coef: Array,
    z: Array,
    weight: Array,
    window: NDArray[np.int64],
    lags: Array,
    X: Array,
    dX: Array,
    broken: Array,
    start: float,
    step: float,
    x: Array,
    a: Array,
    out: Array,
) -> None:
    """Sum over each window at each lag (R.4), into out (lags, windows, 16).

    The sums are weighted z a' (9), z z, a a, z (3), 1, and a count; x and a are scratch (3,).
    """
    end = step * (X.shape[0] - 1)
    for j in range(lags.size):
        for i in range(nodes.shape[0]):
            first, last = nodes[i, 0] + lags[j] - start, nodes[i, 2] + lags[j] - start
            if first < 0.0 or last > end:
                continue
            if broken[min(int(last / step) + 1, broken.size - 1)] - broken[int(first / step)] > 0.0:
                continue
            a[0] = a[1] = a[2] = 0.0
            for n in range(3):
                if coef[i, n] != 0.0:
                    interpolate(nodes[i, n] + lags[j] - start, X, dX, step, x)
                    for c in range(3):
                        a[c] += coef[i, n] * x[c]
            row = out[j, window[i]]
            for r in range(3):
                for c in range(3):
                    row[3 * r + c] += weight[i] * z[i, r] * a[c]
                row[9] += weight[i] * z[i, r] * z[i, r]
                row[10] += weight[i] * a[r] * a[r]
                row[11 + r] += weight[i] * z[i, r]
            row[14] += weight[i]
            row[15] += 1.0
