"""Numba kernels of the navigation core. Mathematics: `strapdown` (S), `error_model` (E), `filter` (K), `smoother` (B).

Everything is written into arrays that the callers own; nothing is allocated inside the epoch loops.
Names: `nav` is (10,): position, velocity in l and the quaternion q_lb; `x` the IMU error states; `n` = 9 + states.
"""

from typing import NamedTuple

import numpy as np

from ..compilation import njit
from ..geodesy._kernels import gravity_ecef, quat_to_matrix


class Segments(NamedTuple):
    """Body increments between consecutive time marks; every epoch of the filter is a mark."""

    dt: np.ndarray  # (s,) s
    dtheta: np.ndarray  # (s, 3) rad
    dvel: np.ndarray  # (s, 3) m/s


class Earth(NamedTuple):
    """The local frame l as the kernels see it."""

    origin_ecef: np.ndarray  # (3,) m
    C_el: np.ndarray  # (3, 3)
    rate_l: np.ndarray  # (3,) rad/s, Earth rotation in l


class ImuModel(NamedTuple):
    """IMU error states as arrays, see `layout`."""

    channel: np.ndarray  # (ns,) 0..2 gyro x y z, 3..5 accelerometer x y z
    factor: np.ndarray  # (ns,) -1: constant one, -2: seconds since the start, -3: nothing, 0..5: the measured channel of that number
    beta: np.ndarray  # (ns,) 1/s, inverse correlation time, 0 for none
    drive: np.ndarray  # (ns,) PSD of the driving noise
    white: np.ndarray  # (6,) PSD of the white noise of each channel
    block: float  # s, length over which the transition is built as one step
    lever: int  # first of the three states of the antenna's lever arm, or -1
    offset: int  # the state of the fixes' time offset, or -1
    rate: int  # the state of its rate, or -1
    coloured: np.ndarray  # (2,) first of the three states of the correlated error of all fixes and of those of group 1, or -1
    scale: np.ndarray  # (2, 3) of the standard deviations of the uncorrelated error of each group


class Work(NamedTuple):
    """Scratch of one interval."""

    decay: np.ndarray  # (ns,) of the block
    mean: np.ndarray  # (ns,) mean over the block of a state that starts at one
    last_block: np.ndarray  # (1,) s, the block length that decay and mean hold for
    weight: np.ndarray  # (ns,)
    bias: np.ndarray  # (2, 6) at the start and at the end of the block
    scale: np.ndarray  # (6, 6)
    column: np.ndarray  # (9, 6) effect of a unit error of each channel over the block
    group: np.ndarray  # (9, 6)
    X: np.ndarray  # (9, n)
    Y: np.ndarray  # (9, 9)
    v9: np.ndarray  # (9,)


@njit(cache=True)
def make_work(ns):
    n = 9 + ns
    return Work(
        np.zeros(ns),
        np.zeros(ns),
        np.full(1, -1.0),
        np.zeros(ns),
        np.zeros((2, 6)),
        np.zeros((6, 6)),
        np.zeros((9, 6)),
        np.zeros((9, 6)),
        np.zeros((9, n)),
        np.zeros((9, 9)),
        np.zeros(9),
    )


@njit(cache=True)
def rotate_left(nav, a, b, c):
    """q_lb <- exp([a b c]) q_lb, normalised."""
    s = 0.25 * (a * a + b * b + c * c)
    r = np.sqrt(s)
    cw = np.cos(r)
    k = 0.5 * (np.sin(r) / r if r > 1e-8 else 1.0 - s / 6.0)
    w, x, y, z = nav[6], nav[7], nav[8], nav[9]
    a *= k
    b *= k
    c *= k
    qw = cw * w - a * x - b * y - c * z
    qx = cw * x + a * w + b * z - c * y
    qy = cw * y - a * z + b * w + c * x
    qz = cw * z + a * y - b * x + c * w
    m = 1.0 / np.sqrt(qw * qw + qx * qx + qy * qy + qz * qz)
    nav[6], nav[7], nav[8], nav[9] = qw * m, qx * m, qy * m, qz * m


@njit(cache=True)
def gravity_l(px, py, pz, earth, g_e, g_l):
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


@njit(cache=True)
def strapdown_block(seg, i0, i1, B, nav, earth, bias, scale, has_scale, sums):
    """Carry `nav` over segments i0..i1-1 (S.1-S.6); `bias` (2, 6) runs linearly over the block of length B.

    sums (5, 3) receives, row by row: integral of C_lb (3 rows), of the specific force in l, and of that once more.
    """
    px, py, pz, vx, vy, vz, w, x, y, z = nav[0], nav[1], nav[2], nav[3], nav[4], nav[5], nav[6], nav[7], nav[8], nav[9]
    ox, oy, oz = earth.rate_l[0], earth.rate_l[1], earth.rate_l[2]
    g_e = sums[3]
    g_l = sums[4]
    gravity_l(px, py, pz, earth, g_e, g_l)
    ax, ay, az = px, py, pz
    gx0, gy0, gz0 = g_l[0], g_l[1], g_l[2]
    down = 2.0 * gz0 / 6.37e6
    side = -gz0 / 6.37e6
    for r in range(5):
        for c in range(3):
            sums[r, c] = 0.0
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
        h = seg.dt[i]
        k = (tau + 0.5 * h) / B
        tau += h
        px_ = seg.dtheta[i, 0]
        py_ = seg.dtheta[i, 1]
        pz_ = seg.dtheta[i, 2]
        ux = seg.dvel[i, 0]
        uy = seg.dvel[i, 1]
        uz = seg.dvel[i, 2]
        if has_scale:
            e0 = e1 = e2 = e3 = e4 = e5 = 0.0
            for j in range(6):
                mj = seg.dtheta[i, j] if j < 3 else seg.dvel[i, j - 3]
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
        # (S.3) velocity increment in the body axes of the segment's start, Horner form of the rotation series
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
        # C_lb at the segment's start
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
            f00, f01, f02, f10, f11, f12, f20, f21, f22 = m00, m01, m02, m10, m11, m12, m20, m21, m22
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
        # (S.5) gravity and Coriolis at the middle of the segment
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
            k = 0.5 * (1.0 - s * (1.0 / 6.0 - s * (1.0 / 120.0 - s * (1.0 / 5040.0 - s / 362880.0))))
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
    nav[0], nav[1], nav[2], nav[3], nav[4], nav[5] = px, py, pz, vx, vy, vz
    nav[6], nav[7], nav[8], nav[9] = w, x, y, z
    # integral of C: left Riemann sum plus half the change over a segment makes it the trapezoid
    hh = 0.5 * h_last
    sums[0, 0] = c00 + hh * (1.0 - 2.0 * (y * y + z * z) - f00)
    sums[0, 1] = c01 + hh * (2.0 * (x * y - w * z) - f01)
    sums[0, 2] = c02 + hh * (2.0 * (x * z + w * y) - f02)
    sums[1, 0] = c10 + hh * (2.0 * (x * y + w * z) - f10)
    sums[1, 1] = c11 + hh * (1.0 - 2.0 * (x * x + z * z) - f11)
    sums[1, 2] = c12 + hh * (2.0 * (y * z - w * x) - f12)
    sums[2, 0] = c20 + hh * (2.0 * (x * z - w * y) - f20)
    sums[2, 1] = c21 + hh * (2.0 * (y * z + w * x) - f21)
    sums[2, 2] = c22 + hh * (1.0 - 2.0 * (x * x + y * y) - f22)
    sums[3, 0], sums[3, 1], sums[3, 2] = s1x, s1y, s1z
    sums[4, 0], sums[4, 1], sums[4, 2] = s2x, s2y, s2z


@njit(cache=True)
def apply_nav_rows(A, columns, B, s1, s2, side, o):
    """A[:, :columns] <- F_block A: the 9 x 9 block transition (E.4) on the rows position, velocity, psi of A."""
    down = -2.0 * side
    for j in range(columns):
        p0, p1, p2 = A[0, j], A[1, j], A[2, j]
        v0, v1, v2 = A[3, j], A[4, j], A[5, j]
        a0, a1, a2 = A[6, j], A[7, j], A[8, j]
        A[0, j] = p0 + B * v0 - (s2[1] * a2 - s2[2] * a1)
        A[1, j] = p1 + B * v1 - (s2[2] * a0 - s2[0] * a2)
        A[2, j] = p2 + B * v2 - (s2[0] * a1 - s2[1] * a0)
        A[3, j] = v0 - (s1[1] * a2 - s1[2] * a1) + B * (side * p0 - 2.0 * (o[1] * v2 - o[2] * v1))
        A[4, j] = v1 - (s1[2] * a0 - s1[0] * a2) + B * (side * p1 - 2.0 * (o[2] * v0 - o[0] * v2))
        A[5, j] = v2 - (s1[0] * a1 - s1[1] * a0) + B * (down * p2 - 2.0 * (o[0] * v1 - o[1] * v0))
        A[6, j] = a0 - B * (o[1] * a2 - o[2] * a1)
        A[7, j] = a1 - B * (o[2] * a0 - o[0] * a2)
        A[8, j] = a2 - B * (o[0] * a1 - o[1] * a0)


@njit(cache=True)
def channel_columns(sums, B, column):
    """(E.5): what a unit constant error of each of the six channels does to position, velocity, psi over the block."""
    s1 = sums[3]
    for a in range(3):
        e0, e1, e2 = sums[0, a], sums[1, a], sums[2, a]
        t0 = s1[1] * e2 - s1[2] * e1
        t1 = s1[2] * e0 - s1[0] * e2
        t2 = s1[0] * e1 - s1[1] * e0
        column[0, a], column[1, a], column[2, a] = B / 6.0 * t0, B / 6.0 * t1, B / 6.0 * t2
        column[3, a], column[4, a], column[5, a] = 0.5 * t0, 0.5 * t1, 0.5 * t2
        column[6, a], column[7, a], column[8, a] = -e0, -e1, -e2
        column[0, 3 + a], column[1, 3 + a], column[2, 3 + a] = -0.5 * B * e0, -0.5 * B * e1, -0.5 * B * e2
        column[3, 3 + a], column[4, 3 + a], column[5, 3 + a] = -e0, -e1, -e2
        column[6, 3 + a], column[7, 3 + a], column[8, 3 + a] = 0.0, 0.0, 0.0


@njit(cache=True)
def add_white_noise(Q, sums, B, white, v9):
    """(E.7): white gyro and accelerometer noise of one block into Q[:9, :9]."""
    s1 = sums[3]
    for a in range(3):
        e0, e1, e2 = -sums[0, a] / B, -sums[1, a] / B, -sums[2, a] / B
        q = white[a]
        if q > 0.0:
            f0 = -(s1[1] * e2 - s1[2] * e1)
            f1 = -(s1[2] * e0 - s1[0] * e2)
            f2 = -(s1[0] * e1 - s1[1] * e0)
            v9[0], v9[1], v9[2], v9[3], v9[4], v9[5], v9[6], v9[7], v9[8] = f0, f1, f2, f0, f1, f2, e0, e1, e2
            for r in range(9):
                for c in range(9):
                    kind = r // 3 + c // 3
                    if kind == 0:
                        k = B * B * B / 20.0
                    elif kind == 1:
                        k = B * B / 8.0
                    elif kind == 2:
                        k = B / 3.0 if r // 3 == 1 else B * B / 6.0
                    elif kind == 3:
                        k = B / 2.0
                    else:
                        k = B
                    Q[r, c] += q * k * v9[r] * v9[c]
        q = white[3 + a]
        if q > 0.0:
            v9[0], v9[1], v9[2] = e0, e1, e2
            for r in range(3):
                for c in range(3):
                    k = q * v9[r] * v9[c]
                    Q[r, c] += k * B * B * B / 3.0
                    Q[r, 3 + c] += k * B * B / 2.0
                    Q[3 + r, c] += k * B * B / 2.0
                    Q[3 + r, 3 + c] += k * B


@njit(cache=True)
def step_covariance(W, Qbb, sums, B, imu, work, side, o):
    """(E.6): W = [Q_nn | Q_nb] and the diagonal Q_bb over one more block."""
    ns = imu.channel.size
    column, group, X, Y = work.column, work.group, work.X, work.Y
    group[:] = 0.0
    for s in range(ns):
        c = imu.channel[s]
        w = work.weight[s] * work.mean[s]
        for r in range(9):
            group[r, c] += w * W[r, 9 + s]
    X[:] = W
    apply_nav_rows(X, 9 + ns, B, sums[3], sums[4], side, o)
    for r in range(9):
        for k in range(9):
            t = 0.0
            for c in range(6):
                t += column[r, c] * group[k, c]
            X[r, k] += t
    for s in range(ns):
        c = imu.channel[s]
        w = work.weight[s] * work.mean[s] * Qbb[s]
        for r in range(9):
            X[r, 9 + s] += column[r, c] * w
    group[:] = 0.0
    for s in range(ns):
        c = imu.channel[s]
        w = work.weight[s] * work.mean[s]
        for r in range(9):
            group[r, c] += w * X[r, 9 + s]
    for r in range(9):
        for k in range(9):
            Y[k, r] = X[r, k]
    apply_nav_rows(Y, 9, B, sums[3], sums[4], side, o)
    for r in range(9):
        for k in range(9):
            t = Y[k, r]
            for c in range(6):
                t += group[r, c] * column[k, c]
            W[r, k] = t
    for c in range(6):
        t = 0.0
        for s in range(ns):
            if imu.channel[s] == c:
                t += work.weight[s] * work.weight[s] * imu.drive[s]
        if t > 0.0:
            t *= B / 3.0
            for r in range(9):
                for k in range(9):
                    W[r, k] += t * column[r, c] * column[k, c]
    for s in range(ns):
        c = imu.channel[s]
        d = work.decay[s]
        t = 0.5 * B * work.weight[s] * imu.drive[s]
        for r in range(9):
            W[r, 9 + s] = d * X[r, 9 + s] + t * column[r, c]
        if imu.beta[s] > 0.0:
            Qbb[s] = d * d * Qbb[s] + imu.drive[s] * (1.0 - d * d) / (2.0 * imu.beta[s])
        else:
            Qbb[s] += imu.drive[s] * B
    add_white_noise(W, sums, B, imu.white, work.v9)


@njit(cache=True)
def block_states(seg, i0, i1, B, elapsed, x, imu, work):
    """Decay, mean weight and coupling of each IMU state over the block, and the channel biases at its two ends."""
    ns = imu.channel.size
    if abs(B - work.last_block[0]) > 1e-10:
        for s in range(ns):
            b = imu.beta[s] * B
            work.decay[s] = np.exp(-b)
            work.mean[s] = -np.expm1(-b) / b if b > 1e-6 else 1.0 - 0.5 * b
        work.last_block[0] = B
    work.bias[:] = 0.0
    has_scale = False
    for s in range(ns):
        f = imu.factor[s]
        c = imu.channel[s]
        if f == -1:
            work.weight[s] = 1.0
            work.bias[0, c] += x[s]
            work.bias[1, c] += x[s] * work.decay[s]
        elif f == -2:
            work.weight[s] = elapsed + 0.5 * B
            work.bias[0, c] += x[s] * elapsed
            work.bias[1, c] += x[s] * (elapsed + B)
        elif f == -3:
            work.weight[s] = 0.0
        else:
            if not has_scale:
                work.scale[:] = 0.0
                has_scale = True
            t = 0.0
            for i in range(i0, i1):
                t += seg.dtheta[i, f] if f < 3 else seg.dvel[i, f - 3]
            work.weight[s] = t / B
            work.scale[c, f] += x[s]
    return has_scale


@njit(cache=True)
def linearise(seg, i0, i1, elapsed, nav, x, imu, earth, F, D, W, Qbb, sums, work):
    """Carry nav and x over segments i0..i1-1 and accumulate transition F (9, n), D (ns,) and noise W (9, n), Qbb (ns,)."""
    ns = imu.channel.size
    o = earth.rate_l
    F[:] = 0.0
    W[:] = 0.0
    Qbb[:] = 0.0
    for r in range(9):
        F[r, r] = 1.0
    D[:] = 1.0
    total = 0.0
    for i in range(i0, i1):
        total += seg.dt[i]
    blocks = int(np.ceil(total / imu.block - 1e-6))
    target = total / max(blocks, 1)
    side = -9.8 / 6.37e6
    a = i0
    done = 0.0
    while a < i1:
        b = a
        B = 0.0
        while b < i1 and (b == a or B + 0.5 * seg.dt[b] < target):
            B += seg.dt[b]
            b += 1
        has_scale = block_states(seg, a, b, B, elapsed + done, x, imu, work)
        strapdown_block(seg, a, b, B, nav, earth, work.bias, work.scale, has_scale, sums)
        channel_columns(sums, B, work.column)
        apply_nav_rows(F, 9 + ns, B, sums[3], sums[4], side, o)
        for s in range(ns):
            c = imu.channel[s]
            w = work.weight[s] * work.mean[s] * D[s]
            for r in range(9):
                F[r, 9 + s] += work.column[r, c] * w
        step_covariance(W, Qbb, sums, B, imu, work, side, o)
        for s in range(ns):
            D[s] *= work.decay[s]
            x[s] *= work.decay[s]
        done += B
        a = b


@njit(cache=True)
def predict_covariance(P, F, D, W, Qbb, X, nine):
    """P <- Phi P Phi' + Q with Phi = [F; 0 D] and Q = [W; Q_bb]."""
    n = P.shape[0]
    np.dot(F, P, X)
    np.dot(X, F.T, nine)
    for r in range(9):
        for c in range(r, 9):
            t = nine[r, c] + W[r, c]
            P[r, c] = t
            P[c, r] = t
    for r in range(9):
        for c in range(9, n):
            t = X[r, c] * D[c - 9] + W[r, c]
            P[r, c] = t
            P[c, r] = t
    for r in range(9, n):
        d = D[r - 9]
        for c in range(9, n):
            P[r, c] *= d * D[c - 9]
        P[r, r] += Qbb[r - 9]


@njit(cache=True)
def cholesky3(R, L):
    """Lower Cholesky factor of a 3 x 3; False where it is not positive definite."""
    for r in range(3):
        for c in range(r + 1):
            t = R[r, c]
            for k in range(c):
                t -= L[r, k] * L[c, k]
            if r == c:
                if t <= 0.0:
                    return False
                L[r, r] = np.sqrt(t)
            else:
                L[r, c] = t / L[c, c]
    return True


@njit(cache=True)
def forward_solve3(L, A):
    """A <- L^-1 A for A (3, m)."""
    for j in range(A.shape[1]):
        for r in range(3):
            t = A[r, j]
            for k in range(r):
                t -= L[r, k] * A[k, j]
            A[r, j] = t / L[r, r]


@njit(cache=True)
def antenna(nav, x, lever, imu, total, C):
    """C_lb, and the lever arm with its states added into total (3,)."""
    quat_to_matrix(nav[6:], C)
    for i in range(3):
        total[i] = lever[i]
        if imu.lever >= 0:
            total[i] += x[imu.lever + i]


@njit(cache=True)
def fix_delay(x, elapsed, imu):
    """By how much a fix was taken later than it is stamped."""
    d = x[imu.offset]
    if imu.rate >= 0:
        d += elapsed * x[imu.rate]
    return d


@njit(cache=True)
def position_rows(nav, x, elapsed, lever, imu, accel, omega, z, sigma, group, C, H, nu):
    """(K.1): innovation of the antenna position and its derivative. H (3, n), nu (3, 1).

    accel, omega (3,): acceleration of the IMU in l and rate of the body, for the velocity at the fix's own time.
    sigma (3,): what the correlated errors of the fix are counted in.
    """
    total = nu[:, 1]
    antenna(nav, x, lever, imu, total, C)
    H[:] = 0.0
    a0 = C[0, 0] * total[0] + C[0, 1] * total[1] + C[0, 2] * total[2]
    a1 = C[1, 0] * total[0] + C[1, 1] * total[1] + C[1, 2] * total[2]
    a2 = C[2, 0] * total[0] + C[2, 1] * total[1] + C[2, 2] * total[2]
    nu[0, 0] = z[0] - nav[0] - a0
    nu[1, 0] = z[1] - nav[1] - a1
    nu[2, 0] = z[2] - nav[2] - a2
    H[0, 0] = H[1, 1] = H[2, 2] = 1.0
    minus_skew(H, 6, a0, a1, a2)
    if imu.lever >= 0:
        for r in range(3):
            for c in range(3):
                H[r, 9 + imu.lever + c] = C[r, c]
    if imu.offset >= 0:
        d = fix_delay(x, elapsed, imu)
        l0 = omega[1] * total[2] - omega[2] * total[1]
        l1 = omega[2] * total[0] - omega[0] * total[2]
        l2 = omega[0] * total[1] - omega[1] * total[0]
        for r in range(3):
            v = nav[3 + r] + C[r, 0] * l0 + C[r, 1] * l1 + C[r, 2] * l2
            nu[r, 0] -= v * d + 0.5 * accel[r] * d * d
            H[r, 3 + r] = d
            H[r, 9 + imu.offset] = v + accel[r] * d
            if imu.rate >= 0:
                H[r, 9 + imu.rate] = elapsed * H[r, 9 + imu.offset]
    for kind in range(group + 1):
        first = imu.coloured[kind]
        if first >= 0:
            for r in range(3):
                nu[r, 0] -= sigma[r] * x[first + r]
                H[r, 9 + first + r] = sigma[r]


@njit(cache=True)
def minus_skew(H, column, a0, a1, a2):
    H[0, column + 1], H[0, column + 2] = a2, -a1
    H[1, column], H[1, column + 2] = -a2, a0
    H[2, column], H[2, column + 1] = a1, -a0


@njit(cache=True)
def body_rate(nav, x, elapsed, rate, imu, earth, C, omega, gain):
    """Rate of the body against the Earth, omega (3,), from the measured one, and gain (ns,): minus its derivative, on its own axis."""
    quat_to_matrix(nav[6:], C)
    o = earth.rate_l
    for i in range(3):
        omega[i] = rate[i] - (C[0, i] * o[0] + C[1, i] * o[1] + C[2, i] * o[2])
    for s in range(imu.channel.size):
        c = imu.channel[s]
        f = imu.factor[s]
        if c > 2 or f == -3:
            u = 0.0
        elif f == -1:
            u = 1.0
        elif f == -2:
            u = elapsed
        else:
            u = rate[f]
        gain[s] = u
        if u != 0.0:
            omega[c] -= x[s] * u


@njit(cache=True)
def velocity_rows(nav, x, elapsed, lever, imu, accel, omega, gain, z, C, H, nu):
    """(K.2): innovation of the antenna velocity; omega, gain as `body_rate` leaves them."""
    total = nu[:, 1]
    antenna(nav, x, lever, imu, total, C)
    H[:] = 0.0
    for s in range(imu.channel.size):
        u = gain[s]
        if u == 0.0:
            continue
        c = imu.channel[s]
        if c == 0:
            e0, e1, e2 = 0.0, -total[2], total[1]
        elif c == 1:
            e0, e1, e2 = total[2], 0.0, -total[0]
        else:
            e0, e1, e2 = -total[1], total[0], 0.0
        for r in range(3):
            H[r, 9 + s] = -u * (C[r, 0] * e0 + C[r, 1] * e1 + C[r, 2] * e2)
    l0 = omega[1] * total[2] - omega[2] * total[1]
    l1 = omega[2] * total[0] - omega[0] * total[2]
    l2 = omega[0] * total[1] - omega[1] * total[0]
    a0 = C[0, 0] * l0 + C[0, 1] * l1 + C[0, 2] * l2
    a1 = C[1, 0] * l0 + C[1, 1] * l1 + C[1, 2] * l2
    a2 = C[2, 0] * l0 + C[2, 1] * l1 + C[2, 2] * l2
    nu[0, 0] = z[0] - nav[3] - a0
    nu[1, 0] = z[1] - nav[4] - a1
    nu[2, 0] = z[2] - nav[5] - a2
    H[0, 3] = H[1, 4] = H[2, 5] = 1.0
    minus_skew(H, 6, a0, a1, a2)
    if imu.lever >= 0:
        for r in range(3):
            H[r, 9 + imu.lever] = C[r, 1] * omega[2] - C[r, 2] * omega[1]
            H[r, 10 + imu.lever] = C[r, 2] * omega[0] - C[r, 0] * omega[2]
            H[r, 11 + imu.lever] = C[r, 0] * omega[1] - C[r, 1] * omega[0]
    if imu.offset >= 0:
        for r in range(3):
            nu[r, 0] -= accel[r] * fix_delay(x, elapsed, imu)
            H[r, 9 + imu.offset] = accel[r]
            if imu.rate >= 0:
                H[r, 9 + imu.rate] = elapsed * accel[r]


@njit(cache=True)
def still_rows(nav, H, nu):
    """(K.8): the velocity is zero."""
    H[:] = 0.0
    for r in range(3):
        nu[r, 0] = -nav[3 + r]
        H[r, 3 + r] = 1.0


@njit(cache=True)
def wheel_rows(nav, C, H, nu):
    """(K.9): no velocity across the body's forward axis. The first row is empty."""
    quat_to_matrix(nav[6:], C)
    H[:] = 0.0
    nu[0, 0] = 0.0
    v0, v1, v2 = nav[3], nav[4], nav[5]
    for r in range(1, 3):
        c0, c1, c2 = C[0, r], C[1, r], C[2, r]
        nu[r, 0] = -(c0 * v0 + c1 * v1 + c2 * v2)
        H[r, 3], H[r, 4], H[r, 5] = c0, c1, c2
        H[r, 6] = c1 * v2 - c2 * v1
        H[r, 7] = c2 * v0 - c0 * v2
        H[r, 8] = c0 * v1 - c1 * v0


@njit(cache=True)
def turn_rows(imu, earth, C, omega, gain, H, nu):
    """(K.10): the body does not turn; omega, gain of the mean rate over the stillness as `body_rate` leaves them."""
    H[:] = 0.0
    o = earth.rate_l
    for r in range(3):
        nu[r, 0] = omega[r]
        c0, c1, c2 = C[0, r], C[1, r], C[2, r]
        H[r, 6] = c1 * o[2] - c2 * o[1]
        H[r, 7] = c2 * o[0] - c0 * o[2]
        H[r, 8] = c0 * o[1] - c1 * o[0]
    for s in range(imu.channel.size):
        if gain[s] != 0.0:
            H[imu.channel[s], 9 + s] = gain[s]


@njit(cache=True)
def open_gap(W, column, B, variance):
    """(E.8): the increments over an interval of length B were not measured; `variance` (6,) is that of what stands in for them."""
    for c in range(6):
        q = variance[c] / (B * B)
        for r in range(9):
            for k in range(9):
                W[r, k] += q * column[r, c] * column[k, c]


@njit(cache=True)
def innovation_test(P, H, nu, m, R, used, S, L, out):
    """Normalised innovation squared of a triple; raw innovation and its sigma into out (2, 3)."""
    for r in range(3):
        t = nu[r, 0]
        for k in range(used):
            t -= H[r, k] * m[k]
        out[0, r] = t
    for r in range(3):
        for c in range(r + 1):
            t = R[r, c]
            for i in range(used):
                if H[r, i] != 0.0:
                    a = 0.0
                    for k in range(used):
                        a += P[i, k] * H[c, k]
                    t += H[r, i] * a
            S[r, c] = t
            S[c, r] = t
    if not cholesky3(S, L):
        return np.inf
    y0 = out[0, 0] / L[0, 0]
    y1 = (out[0, 1] - L[1, 0] * y0) / L[1, 1]
    y2 = (out[0, 2] - L[2, 0] * y0 - L[2, 1] * y1) / L[2, 2]
    for r in range(3):
        out[1, r] = np.sqrt(S[r, r])
    return y0 * y0 + y1 * y1 + y2 * y2


@njit(cache=True)
def reopen(P, out, lost_s):
    """(K.7): add the size of the innovation out[0] to position, what it makes over the lost time to velocity and tilt."""
    for i in range(3):
        d = out[0, i]
        P[i, i] += d * d
        P[3 + i, 3 + i] += (d / lost_s) ** 2
    d = (out[0, 0] ** 2 + out[0, 1] ** 2) / (4.9 * lost_s * lost_s) ** 2
    d = min(d, 3e-4)
    for i in range(6, 9):
        P[i, i] += d


@njit(cache=True)
def scalar_update(P, m, h, nu, used, K, cross, follow):
    """(K.4) with one scalar of unit variance: gain into K; its innovation variance and innovation are returned.

    K[r] K[c] is the same product either way round, so that P stays symmetric.
    """
    n = P.shape[0]
    S = 1.0
    for r in range(n):
        t = 0.0
        for k in range(used):
            t += P[r, k] * h[k]
        K[r] = t
    y = nu
    for k in range(used):
        S += h[k] * K[k]
        y -= h[k] * m[k]
    inv = 1.0 / S
    root = np.sqrt(inv)
    for r in range(n):
        m[r] += K[r] * inv * y
        K[r] *= root
    for r in range(n):
        t = K[r]
        row = P[r]
        for c in range(n):
            row[c] -= t * K[c]
    for r in range(n):
        K[r] *= root
    if follow:
        for r in range(9):
            t = 0.0
            for k in range(used):
                t += cross[r, k] * h[k]
            for c in range(n):
                cross[r, c] -= t * K[c]
    return S, y


@njit(cache=True)
def feed_back(nav, x, m):
    """(K.5): move the error estimate into the nominal state."""
    for i in range(6):
        nav[i] += m[i]
    rotate_left(nav, m[6], m[7], m[8])
    for s in range(x.size):
        x[s] += m[9 + s]
    m[:] = 0.0


@njit(cache=True)
def state_difference(nav_a, x_a, nav_b, x_b, out):
    """out = a minus b as an error vector: a = b + out, for attitude q_a = exp(out) q_b."""
    for i in range(6):
        out[i] = nav_a[i] - nav_b[i]
    w, x, y, z = nav_b[6], -nav_b[7], -nav_b[8], -nav_b[9]
    a, b, c, d = nav_a[6], nav_a[7], nav_a[8], nav_a[9]
    qw = a * w - b * x - c * y - d * z
    qx = a * x + b * w + c * z - d * y
    qy = a * y - b * z + c * w + d * x
    qz = a * z + b * y - c * x + d * w
    if qw < 0.0:
        qw, qx, qy, qz = -qw, -qx, -qy, -qz
    s = np.sqrt(qx * qx + qy * qy + qz * qz)
    k = 2.0 if s < 1e-10 else 2.0 * np.arctan2(s, qw) / s
    out[6], out[7], out[8] = k * qx, k * qy, k * qz
    for s in range(x_a.size):
        out[9 + s] = x_a[s] - x_b[s]


class Epochs(NamedTuple):
    """The filter's epochs: instants at which something is measured or wanted."""

    stop: np.ndarray  # (m,) number of segments before the epoch
    time: np.ndarray  # (m,) s since the start
    has_position: np.ndarray  # (m,) bool
    position: np.ndarray  # (m, 3) antenna in l
    position_cov: np.ndarray  # (m, 3, 3) in l
    has_velocity: np.ndarray  # (m,) bool
    velocity: np.ndarray  # (m, 3)
    velocity_cov: np.ndarray  # (m, 3, 3)
    rate: np.ndarray  # (m, 3) measured gyro rate at the epoch
    event: np.ndarray  # (m,) number of the camera event at the epoch, or -1
    sigma: np.ndarray  # (m, 3) m, of the fix in steps of two: what its correlated errors are counted in
    group: np.ndarray  # (m,) of the fix: 0 usual, 1 with errors that stay (float, code)
    gap: np.ndarray  # (m, 6) variance of the increments since the epoch before where they were bridged (rad^2, m^2/s^2), else 0
    motion: np.ndarray  # (m,) what is known of the motion: 0 nothing, 1 still, 2 no side-slip
    motion_cov: np.ndarray  # (m, 3, 3) of (K.8) in l, of (K.9) in body axes, m^2/s^2
    still_rate: np.ndarray  # (m, 3) mean gyro rate of a stillness that ends here
    still_var: np.ndarray  # (m,) its variance in each axis, 0 where there is none


class Store(NamedTuple):
    """What the forward pass leaves at each epoch; post: after the update at that epoch."""

    nav: np.ndarray  # (m, 10) nominal, post
    x: np.ndarray  # (m, ns) nominal, post
    m: np.ndarray  # (m, n) error estimate about the nominal, post (zero after feedback)
    P: np.ndarray  # (m, n, n) post; the smoother writes its own covariance over it
    sigma: np.ndarray  # (m, n) of the filter, post
    F: np.ndarray  # (m, 9, n) from the previous epoch to this one
    D: np.ndarray  # (m, ns)
    H: np.ndarray  # (m, nz, most columns used) whitened rows
    K: np.ndarray  # (m, nz, n) gains of the scalar updates
    S: np.ndarray  # (m, nz) innovation variances of the scalar updates, 0 where there was none
    y: np.ndarray  # (m, nz) scalar innovations
    innovation: np.ndarray  # (m, nz) of the triples as measured, before the update
    innovation_sigma: np.ndarray  # (m, nz)
    nis: np.ndarray  # (m, 4) normalised innovation squared of each kind of triple, NaN where there was none
    verdict: np.ndarray  # (m, 4) 0 nothing measured, 1 used, 2 rejected, 3 used after a reopening (K.7)
    slot: np.ndarray  # (4,) first row of each kind of triple (position, velocity, motion, turn) in the arrays of nz rows, or -1
    used: np.ndarray  # (nz,) number of leading columns of H that may differ from zero
    cross: np.ndarray  # (events, 9, n) of the previous event's navigation error with this event's full error, post


@njit(cache=True)
def measured_triple(kind, e, ep, nav, x, lever, accel, imu, earth, C, omega, gain, H, nu, R):
    """Innovation nu[:, 0], derivative H (3, n) and covariance R of what epoch e measures of one kind; False where it does not.

    kind: 0 position, 1 velocity, 2 motion, 3 turn.   accel (3,): of the IMU in l.   C, omega, gain: scratch.
    """
    if kind == 0:
        if not ep.has_position[e]:
            return False
        if imu.offset >= 0:
            body_rate(nav, x, ep.time[e], ep.rate[e], imu, earth, C, omega, gain)
        R[:] = ep.position_cov[e]
        group = ep.group[e]
        position_rows(nav, x, ep.time[e], lever, imu, accel, omega, ep.position[e], ep.sigma[e], group, C, H, nu)
        for i in range(3):
            for j in range(3):
                R[i, j] *= imu.scale[group, i] * imu.scale[group, j]
    elif kind == 1:
        if not ep.has_velocity[e]:
            return False
        body_rate(nav, x, ep.time[e], ep.rate[e], imu, earth, C, omega, gain)
        velocity_rows(nav, x, ep.time[e], lever, imu, accel, omega, gain, ep.velocity[e], C, H, nu)
        R[:] = ep.velocity_cov[e]
    elif kind == 2:
        if ep.motion[e] == 0:
            return False
        if ep.motion[e] == 1:
            still_rows(nav, H, nu)
        else:
            wheel_rows(nav, C, H, nu)
        R[:] = ep.motion_cov[e]
    else:
        if ep.still_var[e] == 0.0:
            return False
        body_rate(nav, x, ep.time[e], ep.still_rate[e], imu, earth, C, omega, gain)
        turn_rows(imu, earth, C, omega, gain, H, nu)
        R[:] = 0.0
        for i in range(3):
            R[i, i] = ep.still_var[e]
    return True


@njit(cache=True)
def run_forward(seg, ep, imu, earth, lever, nav0, x0, m0, P0, closed, gate, doubt, hold, reset, store):
    """Extended Kalman filter over the whole flight (K.1-K.6).

    closed: the error estimate is fed back after every update once psi is known better than `hold` (rad), and the nominal is what
    the strapdown makes of it.
    doubt: NIS from which on a measurement is taken with a larger covariance (K.11).
    reset: seconds of rejected fixes after which position, velocity and psi are opened again (K.7).
    Otherwise the nominal at every epoch is the one already in `store` (re-linearisation about an earlier result).
    """
    count = ep.stop.size
    ns = imu.channel.size
    n = 9 + ns
    wide = store.H.shape[2]
    work = make_work(ns)
    sums = np.zeros((5, 3))
    X = np.zeros((9, n))
    W = np.zeros((9, n))
    Qbb = np.zeros(ns)
    P = P0.copy()
    m = m0.copy()
    m_new = np.zeros(n)
    cross = np.zeros((9, n))
    follow = False
    fed = False
    lost = -1
    nav = nav0.copy()
    x = x0.copy()
    C = np.zeros((3, 3))
    R = np.zeros((3, 3))
    L = np.zeros((3, 3))
    S3 = np.zeros((3, 3))
    H = np.zeros((3, n))
    nu = np.zeros((3, 2))
    accel = np.zeros(3)
    omega = np.zeros(3)
    gain = np.zeros(ns)
    gap = np.zeros(n)
    nine = np.zeros((9, 9))
    for e in range(count):
        if e > 0:
            if not closed:
                nav[:] = store.nav[e - 1]
                x[:] = store.x[e - 1]
            F = store.F[e]
            D = store.D[e]
            length = ep.time[e] - ep.time[e - 1]
            for i in range(3):
                accel[i] = nav[3 + i]
            linearise(seg, ep.stop[e - 1], ep.stop[e], ep.time[e - 1], nav, x, imu, earth, F, D, W, Qbb, sums, work)
            for i in range(3):
                accel[i] = (nav[3 + i] - accel[i]) / length
            if ep.gap[e, 0] > 0.0:
                open_gap(W, work.column, work.last_block[0], ep.gap[e])
            predict_covariance(P, F, D, W, Qbb, X, nine)
            if closed:
                gap[:] = 0.0
            else:
                state_difference(nav, x, store.nav[e], store.x[e], gap)
            if not (closed and fed):
                for r in range(9):
                    t = gap[r]
                    for k in range(n):
                        t += F[r, k] * m[k]
                    m_new[r] = t
                for s in range(ns):
                    m_new[9 + s] = gap[9 + s] + D[s] * m[9 + s]
                m[:] = m_new
            if follow:
                np.dot(cross, F.T, nine)
                for r in range(9):
                    for c in range(9):
                        cross[r, c] = nine[r, c]
                    for c in range(9, n):
                        cross[r, c] *= D[c - 9]
        if not closed:
            nav[:] = store.nav[e]
            x[:] = store.x[e]
        for kind in range(4):
            store.verdict[e, kind] = 0
            b = store.slot[kind]
            if b < 0:
                continue
            if not measured_triple(kind, e, ep, nav, x, lever, accel, imu, earth, C, omega, gain, H, nu, R):
                continue
            used = store.used[b]
            for i in range(3):
                store.S[e, b + i] = 0.0
            # velocity comes after position: its nominal is still the one before feedback, m carries the rest
            out = X[:2, :3]
            nis = innovation_test(P, H, nu, m, R, used, S3, L, out)
            store.nis[e, kind] = nis
            for i in range(3):
                store.innovation[e, b + i] = out[0, i]
                store.innovation_sigma[e, b + i] = out[1, i]
            if nis > gate:
                store.verdict[e, kind] = 2
                if kind > 0:
                    continue
                if lost < 0:
                    lost = e
                if ep.time[e] - ep.time[lost] < reset or nis == np.inf:
                    continue
                reopen(P, out, reset)
                store.verdict[e, kind] = 3
            else:
                store.verdict[e, kind] = 1
                if nis > doubt:
                    R *= nis / doubt
            if kind == 0:
                lost = -1
            cholesky3(R, L)
            forward_solve3(L, H)
            forward_solve3(L, nu)
            for i in range(3):
                store.H[e, b + i] = H[i, :wide]
                S, y = scalar_update(P, m, H[i], nu[i, 0], used, store.K[e, b + i], cross, follow)
                store.S[e, b + i] = S
                store.y[e, b + i] = y
        fed = fed or max(P[6, 6], P[7, 7], P[8, 8]) < hold * hold
        if closed and fed:
            feed_back(nav, x, m)
        store.nav[e] = nav
        store.x[e] = x
        store.m[e] = m
        store.P[e] = P
        for k in range(n):
            store.sigma[e, k] = np.sqrt(P[k, k])
        if ep.event[e] >= 0:
            store.cross[ep.event[e]] = cross
            cross[:] = P[:9]
            follow = True


@njit(cache=True)
def run_backward(ep, store, full, delta, event_cross, keep, keep_information, keep_adjoint):
    """Modified Bryson-Frazier smoother (B.1-B.5). delta (m, n): smoothed error estimate about the nominal.

    full: also replace store.P by the smoothed covariance and fill event_cross (events, 9, 9).
    keep (m,): slot of keep_information (slots, n, n) and keep_adjoint (slots, n) that takes Lambda and lambda at the epoch, or -1.
    """
    count = ep.stop.size
    nz, n = store.H.shape[1], store.m.shape[1]
    ns = n - 9
    lam = np.zeros(n)
    new = np.zeros(n)
    Lam = np.zeros((n, n))
    A = np.zeros((n, n))
    B = np.zeros((n, n))
    M = np.zeros((9, n))
    G = np.zeros((9, n))
    g = np.zeros(n)
    for e in range(count - 1, -1, -1):
        P = store.P[e]
        if keep[e] >= 0:
            keep_information[keep[e]] = Lam
            keep_adjoint[keep[e]] = lam
        for r in range(n):
            t = store.m[e, r]
            for c in range(n):
                t += P[r, c] * lam[c]
            delta[e, r] = t
        if full:
            np.dot(Lam, P, A)
            if ep.event[e] >= 0:
                cross = store.cross[ep.event[e]]
                np.dot(cross, A, M)
                for r in range(9):
                    for c in range(9):
                        event_cross[ep.event[e], r, c] = cross[r, c] - M[r, c]
            np.dot(P, A, B)
            for r in range(n):
                for c in range(n):
                    P[r, c] -= 0.5 * (B[r, c] + B[c, r])
        for i in range(nz - 1, -1, -1):
            S = store.S[e, i]
            if S <= 0.0:
                continue
            h = store.H[e, i]
            k = store.K[e, i]
            used = store.used[i]
            t = store.y[e, i] / S
            for r in range(n):
                t -= k[r] * lam[r]
            for r in range(used):
                lam[r] += h[r] * t
            if full:
                t = 1.0 / S
                for r in range(n):
                    a = 0.0
                    for c in range(n):
                        a += Lam[r, c] * k[c]
                    g[r] = a
                    t += a * k[r]
                for r in range(used):
                    for c in range(n):
                        Lam[r, c] -= h[r] * g[c]
                for r in range(n):
                    for c in range(used):
                        Lam[r, c] -= g[r] * h[c]
                for r in range(used):
                    for c in range(used):
                        Lam[r, c] += t * h[r] * h[c]
        if e == 0:
            break
        F = store.F[e]
        D = store.D[e]
        for c in range(n):
            t = 0.0
            for r in range(9):
                t += F[r, c] * lam[r]
            if c >= 9:
                t += D[c - 9] * lam[c]
            new[c] = t
        lam[:] = new
        if full:
            # Phi' Lambda Phi with Phi = [F; 0 D]: M = Lambda_nn F + Lambda_nb D, then F' M + D Lambda_bn F + D Lambda_bb D
            for r in range(9):
                row = G[r]
                for c in range(n):
                    row[c] = 0.0
                for k in range(9):
                    t = 0.5 * Lam[r, k]
                    for c in range(n):
                        row[c] += t * F[k, c]
                for s in range(ns):
                    row[9 + s] += Lam[r, 9 + s] * D[s]
            np.dot(F.T, G, A)
            for r in range(n):
                if r >= 9:
                    for c in range(9, n):
                        A[r, c] += 0.5 * Lam[r, c] * (D[r - 9] * D[c - 9])
            for r in range(n):
                for c in range(n):
                    Lam[r, c] = A[r, c] + A[c, r]


@njit(cache=True)
def run_strapdown(seg, stops, nav0, bias, earth, out):
    """Free-inertial navigation with a constant bias (6,); the state at each of `stops` segments into out (k, 10)."""
    nav = nav0.copy()
    sums = np.zeros((5, 3))
    b2 = np.zeros((2, 6))
    b2[0] = bias
    b2[1] = bias
    scale = np.zeros((6, 6))
    a = 0
    for k in range(stops.size):
        while a < stops[k]:
            b = a
            B = 0.0
            while b < stops[k] and (b == a or B < 0.02):
                B += seg.dt[b]
                b += 1
            strapdown_block(seg, a, b, B, nav, earth, b2, scale, False, sums)
            a = b
        out[k] = nav


@njit(cache=True)
def run_between(seg, stop, nav, bias, earth, out):
    """From every epoch's state (m, 10) with its channel bias (m, 6) segment by segment to the next; out (stop[-1] - stop[0], 10).

    The last row of each interval is the state carried to the next epoch, not that epoch's own.
    """
    state = np.zeros(10)
    sums = np.zeros((5, 3))
    b2 = np.zeros((2, 6))
    scale = np.zeros((6, 6))
    for e in range(stop.size - 1):
        state[:] = nav[e]
        b2[0] = bias[e]
        b2[1] = bias[e]
        for i in range(stop[e], stop[e + 1]):
            strapdown_block(seg, i, i + 1, seg.dt[i], state, earth, b2, scale, False, sums)
            out[i - stop[0]] = state
