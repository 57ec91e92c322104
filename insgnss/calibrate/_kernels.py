"""Numba kernel that carries a vector through a turn with its sensitivity to the gyro calibration. Mathematics: `multi_position`."""

import numpy as np
from numba import njit


@njit(cache=True)
def minus_half_turn(x, y, z, A):
    """A (3, 3) = exp(-[d x] / 2), d = (x, y, z)."""
    x, y, z = -0.5 * x, -0.5 * y, -0.5 * z
    t2 = x * x + y * y + z * z
    if t2 > 1e-8:
        t = np.sqrt(t2)
        s, c = np.sin(t) / t, (1.0 - np.cos(t)) / t2
    else:
        s, c = 1.0 - t2 / 6.0, 0.5 - t2 / 24.0
    A[0, 0], A[0, 1], A[0, 2] = 1.0 - c * (y * y + z * z), c * x * y - s * z, c * x * z + s * y
    A[1, 0], A[1, 1], A[1, 2] = c * x * y + s * z, 1.0 - c * (x * x + z * z), c * y * z - s * x
    A[2, 0], A[2, 1], A[2, 2] = c * x * z - s * y, c * y * z + s * x, 1.0 - c * (x * x + y * y)


@njit(cache=True)
def multiply(C, A, out):
    """out = C A, (3, 3)."""
    for i in range(3):
        for j in range(3):
            out[i, j] = C[i, 0] * A[0, j] + C[i, 1] * A[1, j] + C[i, 2] * A[2, j]


@njit(cache=True)
def carry(delta, dt, M, bias, Rt, J):
    """Turn of calibrated increments, axes at its start into axes at its end: Rt (3, 3), and J (3, 12) of (P.4).

    delta : (n, 3) raw increments, rad.   dt : (n,) s.   M : (3, 3).   bias : (3,) rad/s.
    """
    A, C = np.empty((3, 3)), np.empty((3, 3))
    d, x = np.empty(3), np.empty(3)
    Rt[:] = np.eye(3)
    J[:] = 0.0
    for k in range(delta.shape[0] - 1, -1, -1):
        for i in range(3):
            x[i] = delta[k, i] - bias[i] * dt[k]
        for i in range(3):
            d[i] = M[i, 0] * x[0] + M[i, 1] * x[1] + M[i, 2] * x[2]
        minus_half_turn(d[0], d[1], d[2], A)
        multiply(Rt, A, C)
        for i in range(3):
            for a in range(3):
                g = C[i, 0] * M[0, a] + C[i, 1] * M[1, a] + C[i, 2] * M[2, a]
                J[i, a] -= g * dt[k]
                for b in range(3):
                    J[i, 3 + 3 * a + b] -= g * d[b]
        multiply(C, A, Rt)
