"""The strapdown (S): the nominal state, and the integrals that the error model needs."""

import numpy as np

from ....base.compilation import njit
from ....geodesy._kernels import gravity_ecef
from ..codes import ACCEL0, N_CHANNELS, N_NOMINAL, PX, PY, PZ, QW, QX, QY, QZ, VX, VY, VZ
from .copies import copy_vector
from .records import make_integrals

EARTH_RADIUS_M = 6.37e6  # for the gradient of gravity alone
FREE_BLOCK_S = 0.02  # s, length of the blocks of a free-inertial run


@njit(cache=True, allocates=False)
def rotate_left(nav, a, b, c):
    """Rotate the attitude from the left in place: q_lb <- exp([a b c]) q_lb, normalised.

    Parameters
    ----------
    nav : ndarray
        (10,) nominal, whose quaternion is changed.
    a, b, c : float
        Rotation vector in l, rad.
    """
    s = 0.25 * (a * a + b * b + c * c)
    r = np.sqrt(s)
    cw = np.cos(r)
    k = 0.5 * (np.sin(r) / r if r > 1e-8 else 1.0 - s / 6.0)
    w, x, y, z = nav[QW], nav[QX], nav[QY], nav[QZ]
    a *= k
    b *= k
    c *= k
    qw = cw * w - a * x - b * y - c * z
    qx = cw * x + a * w + b * z - c * y
    qy = cw * y - a * z + b * w + c * x
    qz = cw * z + a * y - b * x + c * w
    m = 1.0 / np.sqrt(qw * qw + qx * qx + qy * qy + qz * qz)
    nav[QW], nav[QX], nav[QY], nav[QZ] = qw * m, qx * m, qy * m, qz * m


@njit(cache=True, allocates=False)
def gravity_l(px, py, pz, earth, g_e, g_l):
    """Compute gravity in the axes of l.

    Parameters
    ----------
    px, py, pz : float
        Position in l, m.
    earth : Earth
        The local frame l.
    g_e : ndarray
        (3,) scratch, gravity in ECEF.
    g_l : ndarray
        (3,) gravity in l, m/s^2, filled in place.
    """
    C = earth.C_el
    o = earth.origin_ecef
    gravity_ecef(
        o[0] + C[0, 0] * px + C[0, 1] * py + C[0, 2] * pz,
        o[1] + C[1, 0] * px + C[1, 1] * py + C[1, 2] * pz,
        o[2] + C[2, 0] * px + C[2, 1] * py + C[2, 2] * pz,
        g_e,
    )
    for i in range(3):
        g_l[i] = C[0, i] * g_e[0] + C[1, i] * g_e[1] + C[2, i] * g_e[2]


@njit(cache=True, allocates=False)
def strapdown_block(intervals, i0, i1, B, nav, earth, bias, scale, has_scale, integrals):
    """Integrate the nominal over a block of integration intervals (S.1-S.6).

    Parameters
    ----------
    intervals : IntegrationIntervals
        The body increments.
    i0, i1 : int
        The integration intervals i0..i1 - 1 are passed.
    B : float
        Length of the block, s.
    nav : ndarray
        (10,) nominal position (m), velocity (m/s) and quaternion q_lb in l, propagated in place.
    earth : Earth
        The local frame l.
    bias : ndarray
        (2, 6) biases at the start and at the end of the block, linear between: rad/s, m/s^2.
    scale : ndarray
        (6, 6) scale factors and misalignments.
    has_scale : bool
        Whether `scale` is taken off.
    integrals : BlockIntegrals
        Filled in place.
    """
    px, py, pz = nav[PX], nav[PY], nav[PZ]
    vx, vy, vz = nav[VX], nav[VY], nav[VZ]
    w, x, y, z = nav[QW], nav[QX], nav[QY], nav[QZ]
    ox, oy, oz = earth.rate_l[0], earth.rate_l[1], earth.rate_l[2]
    g_e, g_l = integrals.s1, integrals.s2  # scratch, until the integrals are known
    gravity_l(px, py, pz, earth, g_e, g_l)
    ax, ay, az = px, py, pz
    gx0, gy0, gz0 = g_l[0], g_l[1], g_l[2]
    down = 2.0 * gz0 / EARTH_RADIUS_M
    side = -gz0 / EARTH_RADIUS_M
    s1x = s1y = s1z = s2x = s2y = s2z = 0.0
    c00 = c01 = c02 = c10 = c11 = c12 = c20 = c21 = c22 = 0.0
    b0 = bias[0]
    b1 = bias[1]
    tau = 0.0
    first = True
    h_last = 0.0
    m00 = m01 = m02 = m10 = m11 = m12 = m20 = m21 = m22 = 0.0
    f00 = f01 = f02 = f10 = f11 = f12 = f20 = f21 = f22 = 0.0
    for i in range(i0, i1):
        h = intervals.dt[i]
        k = (tau + 0.5 * h) / B
        tau += h
        px_ = intervals.dtheta[i, 0]
        py_ = intervals.dtheta[i, 1]
        pz_ = intervals.dtheta[i, 2]
        ux = intervals.dvel[i, 0]
        uy = intervals.dvel[i, 1]
        uz = intervals.dvel[i, 2]
        if has_scale:
            e0 = e1 = e2 = e3 = e4 = e5 = 0.0
            for j in range(N_CHANNELS):
                mj = intervals.dtheta[i, j] if j < ACCEL0 else intervals.dvel[i, j - ACCEL0]
                e0 += scale[0, j] * mj
                e1 += scale[1, j] * mj
                e2 += scale[2, j] * mj
                e3 += scale[3, j] * mj
                e4 += scale[4, j] * mj
                e5 += scale[5, j] * mj
            px_ -= e0
            py_ -= e1
            pz_ -= e2
            ux -= e3
            uy -= e4
            uz -= e5
        px_ -= (b0[0] + k * (b1[0] - b0[0])) * h
        py_ -= (b0[1] + k * (b1[1] - b0[1])) * h
        pz_ -= (b0[2] + k * (b1[2] - b0[2])) * h
        ux -= (b0[3] + k * (b1[3] - b0[3])) * h
        uy -= (b0[4] + k * (b1[4] - b0[4])) * h
        uz -= (b0[5] + k * (b1[5] - b0[5])) * h
        # (S.3) velocity increment in the axes of the interval's start, Horner form of the series
        tx = py_ * uz - pz_ * uy
        ty = pz_ * ux - px_ * uz
        tz = px_ * uy - py_ * ux
        rx = ux / 6.0 + tx / 24.0
        ry = uy / 6.0 + ty / 24.0
        rz = uz / 6.0 + tz / 24.0
        tx = py_ * rz - pz_ * ry + 0.5 * ux
        ty = pz_ * rx - px_ * rz + 0.5 * uy
        tz = px_ * ry - py_ * rx + 0.5 * uz
        ux += py_ * tz - pz_ * ty
        uy += pz_ * tx - px_ * tz
        uz += px_ * ty - py_ * tx
        # C_lb at the interval's start
        m00 = 1.0 - 2.0 * (y * y + z * z)
        m01 = 2.0 * (x * y - w * z)
        m02 = 2.0 * (x * z + w * y)
        m10 = 2.0 * (x * y + w * z)
        m11 = 1.0 - 2.0 * (x * x + z * z)
        m12 = 2.0 * (y * z - w * x)
        m20 = 2.0 * (x * z - w * y)
        m21 = 2.0 * (y * z + w * x)
        m22 = 1.0 - 2.0 * (x * x + y * y)
        if first:
            f00, f01, f02 = m00, m01, m02
            f10, f11, f12 = m10, m11, m12
            f20, f21, f22 = m20, m21, m22
            first = False
        c00 += h * m00
        c01 += h * m01
        c02 += h * m02
        c10 += h * m10
        c11 += h * m11
        c12 += h * m12
        c20 += h * m20
        c21 += h * m21
        c22 += h * m22
        lx = m00 * ux + m01 * uy + m02 * uz
        ly = m10 * ux + m11 * uy + m12 * uz
        lz = m20 * ux + m21 * uy + m22 * uz
        # (S.4) the frame turns by half the Earth's rotation while the increment builds up
        hh = 0.5 * h
        dx = lx - hh * (oy * lz - oz * ly)
        dy = ly - hh * (oz * lx - ox * lz)
        dz = lz - hh * (ox * ly - oy * lx)
        s2x += s1x * h + hh * dx
        s2y += s1y * h + hh * dy
        s2z += s1z * h + hh * dz
        s1x += dx
        s1y += dy
        s1z += dz
        # (S.5) gravity and Coriolis at the middle of the interval
        gx = gx0 + side * (px + hh * vx - ax)
        gy = gy0 + side * (py + hh * vy - ay)
        gz = gz0 + down * (pz + hh * vz - az)
        qx = vx + 0.5 * (dx + gx * h)
        qy = vy + 0.5 * (dy + gy * h)
        qz = vz + 0.5 * (dz + gz * h)
        nx = vx + dx + h * (gx - 2.0 * (oy * qz - oz * qy))
        ny = vy + dy + h * (gy - 2.0 * (oz * qx - ox * qz))
        nz = vz + dz + h * (gz - 2.0 * (ox * qy - oy * qx))
        px += hh * (vx + nx)
        py += hh * (vy + ny)
        pz += hh * (vz + nz)
        vx, vy, vz = nx, ny, nz
        # (S.2) attitude: q <- q(-Omega h) q q(phi)
        s = 0.25 * (px_ * px_ + py_ * py_ + pz_ * pz_)
        if s < 0.01:
            cw = 1.0 - s * (0.5 - s * (1.0 / 24.0 - s * (1.0 / 720.0 - s / 40320.0)))
            k = 0.5 * (
                1.0 - s * (1.0 / 6.0 - s * (1.0 / 120.0 - s * (1.0 / 5040.0 - s / 362880.0)))
            )
        else:
            r = np.sqrt(s)
            cw = np.cos(r)
            k = 0.5 * np.sin(r) / r
        a, b, c = k * px_, k * py_, k * pz_
        tw = w * cw - x * a - y * b - z * c
        tx = w * a + x * cw + y * c - z * b
        ty = w * b - x * c + y * cw + z * a
        tz = w * c + x * b - y * a + z * cw
        a, b, c = -hh * ox, -hh * oy, -hh * oz
        w = tw - a * tx - b * ty - c * tz
        x = tx + a * tw + b * tz - c * ty
        y = ty - a * tz + b * tw + c * tx
        z = tz + a * ty - b * tx + c * tw
        h_last = h
    m = 1.0 / np.sqrt(w * w + x * x + y * y + z * z)
    w *= m
    x *= m
    y *= m
    z *= m
    nav[PX], nav[PY], nav[PZ] = px, py, pz
    nav[VX], nav[VY], nav[VZ] = vx, vy, vz
    nav[QW], nav[QX], nav[QY], nav[QZ] = w, x, y, z
    # integral of C: left Riemann sum plus half the change over an interval makes it the trapezoid
    C = integrals.C
    hh = 0.5 * h_last
    C[0, 0] = c00 + hh * (1.0 - 2.0 * (y * y + z * z) - f00)
    C[0, 1] = c01 + hh * (2.0 * (x * y - w * z) - f01)
    C[0, 2] = c02 + hh * (2.0 * (x * z + w * y) - f02)
    C[1, 0] = c10 + hh * (2.0 * (x * y + w * z) - f10)
    C[1, 1] = c11 + hh * (1.0 - 2.0 * (x * x + z * z) - f11)
    C[1, 2] = c12 + hh * (2.0 * (y * z - w * x) - f12)
    C[2, 0] = c20 + hh * (2.0 * (x * z - w * y) - f20)
    C[2, 1] = c21 + hh * (2.0 * (y * z + w * x) - f21)
    C[2, 2] = c22 + hh * (1.0 - 2.0 * (x * x + y * y) - f22)
    s1, s2 = integrals.s1, integrals.s2
    s1[0], s1[1], s1[2] = s1x, s1y, s1z
    s2[0], s2[1], s2[2] = s2x, s2y, s2z


@njit(cache=True)
def run_strapdown(intervals, stops, nav0, bias, earth, out):
    """Run free-inertial navigation with a constant bias.

    Parameters
    ----------
    intervals : IntegrationIntervals
        The body increments.
    stops : ndarray
        (k,) numbers of integration intervals after which the state is wanted.
    nav0 : ndarray
        (10,) nominal position (m), velocity (m/s) and quaternion q_lb in l at the start.
    bias : ndarray
        (6,) constant biases, rad/s and m/s^2, body axes.
    earth : Earth
        The local frame l.
    out : ndarray
        (k, 10) the states, filled in place.
    """
    nav = nav0.copy()
    integrals = make_integrals()
    b2 = np.zeros((2, N_CHANNELS))
    b2[0] = bias
    b2[1] = bias
    scale = np.zeros((N_CHANNELS, N_CHANNELS))
    a = 0
    for k in range(stops.size):
        while a < stops[k]:
            b = a
            B = 0.0
            while b < stops[k] and (b == a or B < FREE_BLOCK_S):
                B += intervals.dt[b]
                b += 1
            strapdown_block(intervals, a, b, B, nav, earth, b2, scale, False, integrals)
            a = b
        copy_vector(nav, out[k])


@njit(cache=True)
def run_between(intervals, stop, nav, bias, earth, out):
    """Propagate each epoch's state to the next epoch, interval by interval.

    Parameters
    ----------
    intervals : IntegrationIntervals
        The body increments.
    stop : ndarray
        (m,) number of integration intervals before each epoch.
    nav : ndarray
        (m, 10) states of the epochs.
    bias : ndarray
        (m, 6) biases from each epoch on, rad/s and m/s^2.
    earth : Earth
        The local frame l.
    out : ndarray
        (stop[-1] - stop[0], 10) the state after each interval, filled in place; the last one before
        an epoch is the propagated state, not that epoch's own.
    """
    state = np.zeros(N_NOMINAL)
    integrals = make_integrals()
    b2 = np.zeros((2, N_CHANNELS))
    scale = np.zeros((N_CHANNELS, N_CHANNELS))
    for e in range(stop.size - 1):
        copy_vector(nav[e], state)
        copy_vector(bias[e], b2[0])
        copy_vector(bias[e], b2[1])
        for i in range(stop[e], stop[e + 1]):
            strapdown_block(
                intervals, i, i + 1, intervals.dt[i], state, earth, b2, scale, False, integrals
            )
            copy_vector(state, out[i - stop[0]])
