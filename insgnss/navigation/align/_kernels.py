"""Numba kernel of the coarse alignment. Mathematics: `coarse`."""

import numpy as np

from ...base.compilation import njit


@njit(cache=True)
def relative_motion(dt, dtheta, dvel, stop, out):
    """Integrate specific force in the axes of the body at the first mark (A.1).

    Parameters
    ----------
    dt : ndarray, (n,)
        Lengths of the integration intervals, s.
    dtheta, dvel : ndarray, (n, 3)
        Increments of angle, rad, and velocity, m/s, in body axes.
    stop : ndarray of int, (m,)
        Number of integration intervals before each mark.
    out : ndarray, (m, 15)
        Integral of the specific force, m/s, the integral of that, m, and C_b0b row by row, written
        here.
    """
    w, x, y, z = 1.0, 0.0, 0.0, 0.0
    v = np.zeros(3)
    s = np.zeros(3)
    a = np.zeros(3)
    i = stop[0]
    for k in range(stop.size):
        while i < stop[k]:
            h = dt[i]
            p0, p1, p2 = dtheta[i, 0], dtheta[i, 1], dtheta[i, 2]
            u0 = dvel[i, 0] + 0.5 * (p1 * dvel[i, 2] - p2 * dvel[i, 1])
            u1 = dvel[i, 1] + 0.5 * (p2 * dvel[i, 0] - p0 * dvel[i, 2])
            u2 = dvel[i, 2] + 0.5 * (p0 * dvel[i, 1] - p1 * dvel[i, 0])
            t0 = 2.0 * (y * u2 - z * u1)
            t1 = 2.0 * (z * u0 - x * u2)
            t2 = 2.0 * (x * u1 - y * u0)
            a[0] = u0 + w * t0 + y * t2 - z * t1
            a[1] = u1 + w * t1 + z * t0 - x * t2
            a[2] = u2 + w * t2 + x * t1 - y * t0
            for c in range(3):
                s[c] += h * (v[c] + 0.5 * a[c])
                v[c] += a[c]
            r = 0.25 * (p0 * p0 + p1 * p1 + p2 * p2)
            cw = 1.0 - r * (0.5 - r / 24.0)
            m = 0.5 * (1.0 - r * (1.0 / 6.0 - r / 120.0))
            p0, p1, p2 = m * p0, m * p1, m * p2
            qw = w * cw - x * p0 - y * p1 - z * p2
            qx = w * p0 + x * cw + y * p2 - z * p1
            qy = w * p1 - x * p2 + y * cw + z * p0
            qz = w * p2 + x * p1 - y * p0 + z * cw
            m = 1.0 / np.sqrt(qw * qw + qx * qx + qy * qy + qz * qz)
            w, x, y, z = qw * m, qx * m, qy * m, qz * m
            i += 1
        for c in range(3):
            out[k, c] = v[c]
            out[k, 3 + c] = s[c]
        out[k, 6] = 1.0 - 2.0 * (y * y + z * z)
        out[k, 7] = 2.0 * (x * y - w * z)
        out[k, 8] = 2.0 * (x * z + w * y)
        out[k, 9] = 2.0 * (x * y + w * z)
        out[k, 10] = 1.0 - 2.0 * (x * x + z * z)
        out[k, 11] = 2.0 * (y * z - w * x)
        out[k, 12] = 2.0 * (x * z - w * y)
        out[k, 13] = 2.0 * (y * z + w * x)
        out[k, 14] = 1.0 - 2.0 * (x * x + y * y)
