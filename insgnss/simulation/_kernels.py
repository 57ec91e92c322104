"""Compiled evaluation of a motion's inertial signals.

Rate and specific force in body axes, and their integrals over samples.

A motion is six piecewise quintics (three of position in l, then roll, pitch, yaw) over pieces of
equal length; formulas (M.n) are derived in `motion`.
"""

import math

import numpy as np

from ..base.compilation import njit
from ..geodesy._kernels import gravity_ecef


@njit(cache=True)
def inertial_signals(piece, u, C_el, origin, omega_l, lever, work, out):
    """Write omega_ib_b (rad/s) and f_b (m/s^2) at `u` seconds into one piece to out (6,).

    It follows (M.4, M.5), with the centripetal part of (M.6). piece (6, 6): coefficients [power,
    channel]; work (4, 3) scratch; C_el, origin (ECEF, m) and omega_l (rad/s) of the frame l. lever
    (3,): m, of the sensor in body axes.
    """
    p, v, f, g = work[0], work[1], work[2], work[3]
    for i in range(3):
        c0, c1, c2, c3, c4, c5 = (
            piece[0, i],
            piece[1, i],
            piece[2, i],
            piece[3, i],
            piece[4, i],
            piece[5, i],
        )
        p[i] = c0 + u * (c1 + u * (c2 + u * (c3 + u * (c4 + u * c5))))
        v[i] = c1 + u * (2.0 * c2 + u * (3.0 * c3 + u * (4.0 * c4 + u * 5.0 * c5)))
        f[i] = 2.0 * c2 + u * (6.0 * c3 + u * (12.0 * c4 + u * 20.0 * c5))
    x = origin[0] + C_el[0, 0] * p[0] + C_el[0, 1] * p[1] + C_el[0, 2] * p[2]
    y = origin[1] + C_el[1, 0] * p[0] + C_el[1, 1] * p[1] + C_el[1, 2] * p[2]
    z = origin[2] + C_el[2, 0] * p[0] + C_el[2, 1] * p[1] + C_el[2, 2] * p[2]
    gravity_ecef(x, y, z, g)
    for i in range(3):
        j, k = (i + 1) % 3, (i + 2) % 3
        f[i] += 2.0 * (omega_l[j] * v[k] - omega_l[k] * v[j])
        f[i] -= C_el[0, i] * g[0] + C_el[1, i] * g[1] + C_el[2, i] * g[2]
    angle, rate = p, v  # position and velocity are used up
    for i in range(3):
        c0, c1, c2, c3, c4, c5 = (
            piece[0, i + 3],
            piece[1, i + 3],
            piece[2, i + 3],
            piece[3, i + 3],
            piece[4, i + 3],
            piece[5, i + 3],
        )
        angle[i] = c0 + u * (c1 + u * (c2 + u * (c3 + u * (c4 + u * c5))))
        rate[i] = c1 + u * (2.0 * c2 + u * (3.0 * c3 + u * (4.0 * c4 + u * 5.0 * c5)))
    sf, cf = math.sin(angle[0]), math.cos(angle[0])
    st, ct = math.sin(angle[1]), math.cos(angle[1])
    sy, cy = math.sin(angle[2]), math.cos(angle[2])
    out[0] = rate[0] - rate[2] * st
    out[1] = rate[1] * cf + rate[2] * ct * sf
    out[2] = -rate[1] * sf + rate[2] * ct * cf
    for i in range(2):
        w = omega_l if i == 0 else f
        base = 3 * i
        if i == 1:
            out[3] = out[4] = out[5] = 0.0
        ahead, side = cy * w[0] + sy * w[1], -sy * w[0] + cy * w[1]
        below = st * ahead + ct * w[2]
        out[base] += ct * ahead - st * w[2]
        out[base + 1] += cf * side + sf * below
        out[base + 2] += -sf * side + cf * below
    along = out[0] * lever[0] + out[1] * lever[1] + out[2] * lever[2]
    square = out[0] * out[0] + out[1] * out[1] + out[2] * out[2]
    for i in range(3):
        out[i + 3] += out[i] * along - lever[i] * square


@njit(cache=True)
def sample_signals(coefficients, spacing, elapsed, C_el, origin, omega_l, lever, out):
    """Write the signals at `elapsed` (n,) s from the motion's start to out (n, 6).

    The coefficients are (pieces, 6, 6).
    """
    work = np.empty((4, 3))
    last = coefficients.shape[0] - 1
    for k in range(elapsed.size):
        i = min(max(int(elapsed[k] / spacing), 0), last)
        inertial_signals(
            coefficients[i], elapsed[k] - i * spacing, C_el, origin, omega_l, lever, work, out[k]
        )


@njit(cache=True)
def integrate_signals(
    coefficients, spacing, elapsed, nodes, weights, C_el, origin, omega_l, lever, out
):
    """Write the integrals of the signals from elapsed[k] to elapsed[k + 1] to out (n, 6).

    `elapsed` (n + 1,) is in s from the motion's start. Gauss-Legendre (nodes, weights on -1 to 1)
    on every part of an interval that lies within one piece, where the signals are analytic.
    """
    work = np.empty((4, 3))
    signal = np.empty(6)
    last = coefficients.shape[0] - 1
    i = min(max(int(elapsed[0] / spacing), 0), last)
    for k in range(elapsed.size - 1):
        out[k] = 0.0
        start = elapsed[k]
        while start < elapsed[k + 1]:
            while i < last and (i + 1) * spacing <= start:
                i += 1
            stop = elapsed[k + 1]
            if i < last:
                stop = min(stop, (i + 1) * spacing)
            half, middle = 0.5 * (stop - start), 0.5 * (stop + start) - i * spacing
            for q in range(nodes.size):
                inertial_signals(
                    coefficients[i],
                    middle + half * nodes[q],
                    C_el,
                    origin,
                    omega_l,
                    lever,
                    work,
                    signal,
                )
                for j in range(6):
                    out[k, j] += half * weights[q] * signal[j]
            start = stop
