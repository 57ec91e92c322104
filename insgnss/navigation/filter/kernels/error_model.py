"""The linear model of the errors between two epochs: transition and process noise.

Errors are truth minus estimate, attitude ``C(true) = exp([psi x]) C(estimate)`` in the axes of l.
With a = C_lb f, the channel errors db_g and db_a (sums of IMU error states) and white noise w:

    dp' = dv                                                                                  (E.1)
    dv' = -[a x] psi - C_lb (db_a + w_a) + G dp - 2 [Omega x] dv                              (E.2)
    psi' = -[Omega x] psi - C_lb (db_g + w_g)                                                 (E.3)

G = diag(-g/R, -g/R, 2 g/R) is the gravity gradient. The epoch's interval is cut into blocks of at
most `block` seconds. Over a block of length B the samples give S_C, the integral of C_lb, s1, that
of a, and s2, that of s1. The block's transition is

    psi <- psi - B Omega x psi
    v   <- v - s1 x psi + B (G p - 2 Omega x v)
    p   <- p + B v - s2 x psi                                                                 (E.4)

and a unit constant error of gyro axis i (column e of S_C) and of accelerometer axis i adds

    psi: -e,  v: s1 x e / 2,  p: B s1 x e / 6          and          v: -e,  p: -B e / 2       (E.5)

times the mean of the state over the block, (1 - exp(-beta B)) / (beta B). What (E.4, E.5) leave out
within one block is a relative 1e-2 of terms that are themselves small; across blocks the
composition is exact. The joint covariance of the navigation errors with the IMU states driven since
the last epoch, W = [Q_nn Q_nb] and the diagonal Q_bb, goes along:

    W <- Phi W Phi' + block noise
    Q_bb <- d^2 Q_bb + drive (1 - d^2) / (2 beta),   d = exp(-beta B)                         (E.6)
    block noise: white noise integrated once (psi, v), twice (p of accelerometers, v of gyros),
    three times (p of gyros); driving noise q of a state with column c: c c' q B/3 on Q_nn, c q B/2
    on
    Q_nb                                                                                      (E.7)

An interval of length B that the IMU did not see, bridged by increments of variance q in channel i
with column c_i of (E.5), adds

    c_i c_i' q / B^2  on Q_nn                                                                 (E.8)

At an epoch before which the constant bias of channel i may step, with variance v_i,

    v_i  on Q_bb of that bias                                                                 (E.9)
"""

import numpy as np

from ....base.compilation import njit
from ..codes import (
    ACCEL0,
    AX,
    AY,
    AZ,
    BIAS,
    IMU0,
    N_CHANNELS,
    N_NAV,
    PX,
    PY,
    PZ,
    VEL0,
    VX,
    VY,
    VZ,
)
from .error_states import block_states, later
from .strapdown import EARTH_RADIUS_M, strapdown_block

GRAVITY = 9.8  # m/s^2, for its gradient alone


@njit(cache=True, allocates=False)
def apply_nav_rows(A, columns, B, s1, s2, side, o):
    """Apply the block's 9 x 9 transition (E.4) to rows in place: A[:, :columns] <- F_block A.

    Parameters
    ----------
    A : ndarray
        (9, k) rows of the navigation errors, changed in place.
    columns : int
        Number of leading columns that are changed.
    B : float
        Length of the block, s.
    s1, s2 : ndarray
        (3,) integrals of the specific force in l: m/s, m.
    side : float
        Horizontal gravity gradient, -g/R, 1/s^2.
    o : ndarray
        (3,) rotation of the Earth in l, rad/s.
    """
    down = -2.0 * side
    for j in range(columns):
        p0, p1, p2 = A[PX, j], A[PY, j], A[PZ, j]
        v0, v1, v2 = A[VX, j], A[VY, j], A[VZ, j]
        a0, a1, a2 = A[AX, j], A[AY, j], A[AZ, j]
        A[PX, j] = p0 + B * v0 - (s2[1] * a2 - s2[2] * a1)
        A[PY, j] = p1 + B * v1 - (s2[2] * a0 - s2[0] * a2)
        A[PZ, j] = p2 + B * v2 - (s2[0] * a1 - s2[1] * a0)
        A[VX, j] = v0 - (s1[1] * a2 - s1[2] * a1) + B * (side * p0 - 2.0 * (o[1] * v2 - o[2] * v1))
        A[VY, j] = v1 - (s1[2] * a0 - s1[0] * a2) + B * (side * p1 - 2.0 * (o[2] * v0 - o[0] * v2))
        A[VZ, j] = v2 - (s1[0] * a1 - s1[1] * a0) + B * (down * p2 - 2.0 * (o[0] * v1 - o[1] * v0))
        A[AX, j] = a0 - B * (o[1] * a2 - o[2] * a1)
        A[AY, j] = a1 - B * (o[2] * a0 - o[0] * a2)
        A[AZ, j] = a2 - B * (o[0] * a1 - o[1] * a0)


@njit(cache=True, allocates=False)
def channel_columns(integrals, B, column):
    """Compute the effect of a unit constant error of each channel over the block (E.5).

    Parameters
    ----------
    integrals : BlockIntegrals
        The integrals of the block, from `strapdown_block`.
    B : float
        Length of the block, s.
    column : ndarray
        (9, 6) the effect, filled in place.
    """
    s1, C = integrals.s1, integrals.C
    for a in range(3):
        e0, e1, e2 = C[0, a], C[1, a], C[2, a]
        t0 = s1[1] * e2 - s1[2] * e1
        t1 = s1[2] * e0 - s1[0] * e2
        t2 = s1[0] * e1 - s1[1] * e0
        column[PX, a], column[PY, a], column[PZ, a] = B / 6.0 * t0, B / 6.0 * t1, B / 6.0 * t2
        column[VX, a], column[VY, a], column[VZ, a] = 0.5 * t0, 0.5 * t1, 0.5 * t2
        column[AX, a], column[AY, a], column[AZ, a] = -e0, -e1, -e2
        column[PX, ACCEL0 + a], column[PY, ACCEL0 + a], column[PZ, ACCEL0 + a] = (
            -0.5 * B * e0,
            -0.5 * B * e1,
            -0.5 * B * e2,
        )
        column[VX, ACCEL0 + a], column[VY, ACCEL0 + a], column[VZ, ACCEL0 + a] = -e0, -e1, -e2
        column[AX, ACCEL0 + a], column[AY, ACCEL0 + a], column[AZ, ACCEL0 + a] = 0.0, 0.0, 0.0


@njit(cache=True, allocates=False)
def add_white_noise(Q, integrals, B, white, v9):
    """Add the white gyro and accelerometer noise of one block to Q[:9, :9] (E.7).

    Parameters
    ----------
    Q : ndarray
        (9, k) process noise, changed in place.
    integrals : BlockIntegrals
        The integrals of the block, from `strapdown_block`.
    B : float
        Length of the block, s.
    white : ndarray
        (6,) PSD of the channels' white noise, (rad/s)^2/Hz and (m/s^2)^2/Hz.
    v9 : ndarray
        (9,) scratch.
    """
    s1, C = integrals.s1, integrals.C
    for a in range(3):
        e0, e1, e2 = -C[0, a] / B, -C[1, a] / B, -C[2, a] / B
        q = white[a]
        if q > 0.0:
            f0 = -(s1[1] * e2 - s1[2] * e1)
            f1 = -(s1[2] * e0 - s1[0] * e2)
            f2 = -(s1[0] * e1 - s1[1] * e0)
            v9[PX], v9[PY], v9[PZ] = f0, f1, f2
            v9[VX], v9[VY], v9[VZ] = f0, f1, f2
            v9[AX], v9[AY], v9[AZ] = e0, e1, e2
            for r in range(N_NAV):
                for c in range(N_NAV):
                    both = r // 3 + c // 3  # groups of three: position 0, velocity 1, psi 2
                    if both == 0:
                        k = B * B * B / 20.0
                    elif both == 1:
                        k = B * B / 8.0
                    elif both == 2:
                        k = B / 3.0 if r // 3 == 1 else B * B / 6.0
                    elif both == 3:
                        k = B / 2.0
                    else:
                        k = B
                    Q[r, c] += q * k * v9[r] * v9[c]
        q = white[ACCEL0 + a]
        if q > 0.0:
            v9[0], v9[1], v9[2] = e0, e1, e2
            for r in range(3):
                for c in range(3):
                    k = q * v9[r] * v9[c]
                    Q[r, c] += k * B * B * B / 3.0
                    Q[r, VEL0 + c] += k * B * B / 2.0
                    Q[VEL0 + r, c] += k * B * B / 2.0
                    Q[VEL0 + r, VEL0 + c] += k * B


@njit(cache=True, allocates=False)
def add_channel_sums(W, share, channel, group):
    """Add up columns of [Q_nn Q_nb] by channel: group <- sum over the states of share W.

    Parameters
    ----------
    W : ndarray
        (9, n) process noise [Q_nn Q_nb].
    share : ndarray
        (ns,) factor of each state behind those of navigation; zero of what is no error of the IMU.
    channel : ndarray
        (ns,) channel of each state.
    group : ndarray
        (6, 9) the sums, filled in place.
    """
    group[:] = 0.0
    for s in range(channel.size):
        w, to = share[s], group[channel[s]]
        if w != 0.0:
            for r in range(N_NAV):
                to[r] += w * W[r, IMU0 + s]


@njit(cache=True, allocates=False)
def step_covariance(W, Qbb, B, model, component, work, side, o, first):
    """Take the process noise W = [Q_nn Q_nb] and the diagonal Q_bb over one more block (E.6).

    Parameters
    ----------
    W : ndarray
        (9, n) process noise [Q_nn Q_nb], changed in place.
    Qbb : ndarray
        (ns,) variances of the states behind those of navigation, changed in place.
    B : float
        Length of the block, s.
    model : StateModel
        The error states behind those of navigation.
    component : int
        The component of the noise.
    work : IntervalWork
        Integrals, weights and columns of the block, and scratch.
    side : float
        Horizontal gravity gradient, -g/R, 1/s^2.
    o : ndarray
        (3,) rotation of the Earth in l, rad/s.
    first : bool
        Whether W and Q_bb are zero before the block.
    """
    ns = model.channel.size
    column, group, X, share = work.column, work.group, work.X, work.share
    weight, mean, decay, integrals = work.weight, work.mean, work.decay, work.integrals
    s1, s2, driven, v9 = integrals.s1, integrals.s2, work.driven, work.v9
    channel, drive = model.channel, model.drive[component]
    for s in range(ns):
        share[s] = weight[s] * mean[s]
    if not first:
        add_channel_sums(W, share, channel, group)
        for r in range(N_NAV):
            of, to = W[r], X[r]
            for c in range(N_NAV + ns):
                to[c] = of[c]
        apply_nav_rows(X, N_NAV + ns, B, s1, s2, side, o)
        for r in range(N_NAV):
            to = X[r]
            for c in range(N_CHANNELS):
                t, row = column[r, c], group[c]
                for k in range(N_NAV):
                    to[k] += t * row[k]
        for s in range(ns):
            w = share[s] * Qbb[s]
            if w != 0.0:
                c = channel[s]
                for r in range(N_NAV):
                    X[r, IMU0 + s] += column[r, c] * w
        add_channel_sums(X, share, channel, group)
        for r in range(N_NAV):  # the transpose, which is symmetric when all is added up
            for k in range(N_NAV):
                W[k, r] = X[r, k]
        apply_nav_rows(W, N_NAV, B, s1, s2, side, o)
        for r in range(N_NAV):
            to = W[r]
            for c in range(N_CHANNELS):
                t, row = column[r, c], group[c]
                for k in range(N_NAV):
                    to[k] += t * row[k]
        for r in range(N_NAV):
            to, of = W[r, IMU0:], X[r, IMU0:]
            for s in range(ns):
                to[s] = decay[s] * of[s]
    driven[:] = 0.0
    for s in range(ns):
        driven[channel[s]] += weight[s] * weight[s] * drive[s]
    for c in range(N_CHANNELS):
        t = driven[c] * B / 3.0
        if t > 0.0:
            for r in range(N_NAV):
                v9[r] = column[r, c]
            for r in range(N_NAV):
                u, to = t * v9[r], W[r]
                for k in range(N_NAV):
                    to[k] += u * v9[k]
    for s in range(ns):
        t = 0.5 * B * weight[s] * drive[s]
        if t != 0.0:
            c = channel[s]
            for r in range(N_NAV):
                W[r, IMU0 + s] += t * column[r, c]
    for s in range(ns):
        d = decay[s]
        if model.beta[s] > 0.0:
            Qbb[s] = d * d * Qbb[s] + drive[s] * (1.0 - d * d) / (2.0 * model.beta[s])
        else:
            Qbb[s] += drive[s] * B
    add_white_noise(W, integrals, B, model.white[component], v9)


@njit(cache=True, allocates=False)
def linearise(intervals, i0, i1, course, nav, x, model, earth, F, D, W, Qbb, work):
    """Propagate the nominal over integration intervals, and fill transition and process noise.

    Parameters
    ----------
    intervals : IntegrationIntervals
        The body increments.
    i0, i1 : int
        The integration intervals i0..i1 - 1 are passed.
    course : BiasCourse
        At the first of the intervals.
    nav : ndarray
        (10,) nominal position (m), velocity (m/s) and quaternion q_lb in l, propagated in place.
    x : ndarray
        (ns,) nominal values of the other states, propagated in place.
    model : StateModel
        The error states behind those of navigation.
    earth : Earth
        The local frame l.
    F : ndarray
        (9, n) navigation rows of the transition matrix, filled in place.
    D : ndarray
        (ns,) diagonal of the transition matrix behind them, filled in place.
    W : ndarray
        (q, 9, n) process noise [Q_nn Q_nb] of each component of the noise, filled in place.
    Qbb : ndarray
        (q, ns) its diagonal behind them, filled in place.
    work : IntervalWork
        Scratch.
    """
    ns = model.channel.size
    o = earth.rate_l
    F[:] = 0.0
    W[:] = 0.0
    Qbb[:] = 0.0
    for r in range(N_NAV):
        F[r, r] = 1.0
    D[:] = 1.0
    total = 0.0
    for i in range(i0, i1):
        total += intervals.dt[i]
    blocks = int(np.ceil(total / model.block - 1e-6))
    target = total / max(blocks, 1)
    column, weight, mean, decay = work.column, work.weight, work.mean, work.decay
    integrals, channel = work.integrals, model.channel
    s1, s2 = integrals.s1, integrals.s2
    side = -GRAVITY / EARTH_RADIUS_M
    a = i0
    done = 0.0
    while a < i1:
        b = a
        B = 0.0
        while b < i1 and (b == a or B + 0.5 * intervals.dt[b] < target):
            B += intervals.dt[b]
            b += 1
        has_scale = block_states(intervals, a, b, B, later(course, done), x, model, work)
        strapdown_block(intervals, a, b, B, nav, earth, work.bias, work.scale, has_scale, integrals)
        channel_columns(integrals, B, column)
        first = a == i0
        apply_nav_rows(F, N_NAV if first else N_NAV + ns, B, s1, s2, side, o)
        for s in range(ns):
            work.share[s] = weight[s] * mean[s] * D[s]
        for r in range(N_NAV):
            of = column[r]
            for s in range(ns):
                F[r, IMU0 + s] += of[channel[s]] * work.share[s]
        for k in range(len(W)):
            step_covariance(W[k], Qbb[k], B, model, k, work, side, o, first)
        for s in range(ns):
            D[s] *= decay[s]
            x[s] *= decay[s]
        done += B
        a = b


@njit(cache=True, allocates=False)
def add_gap_noise(W, column, B, variance):
    """Add the noise of increments that were made up over a gap of the IMU (E.8).

    Parameters
    ----------
    W : ndarray
        (9, n) process noise [Q_nn Q_nb], changed in place.
    column : ndarray
        (9, 6) effect of a unit error of each channel over the block.
    B : float
        Length of the gap, s.
    variance : ndarray
        (6,) variance of the made-up increments, rad^2 and m^2/s^2.
    """
    for c in range(N_CHANNELS):
        q = variance[c] / (B * B)
        for r in range(N_NAV):
            for k in range(N_NAV):
                W[r, k] += q * column[r, c] * column[k, c]


@njit(cache=True, allocates=False)
def add_bias_step(Qbb, model, variance):
    """Add the variance of a step of the constant biases (E.9).

    Parameters
    ----------
    Qbb : ndarray
        (ns,) diagonal of the process noise behind the navigation states, changed in place.
    model : StateModel
        The error states behind those of navigation.
    variance : ndarray
        (6,) of the step of each channel's bias, (rad/s)^2 and (m/s^2)^2.
    """
    for s in range(Qbb.size):
        if model.factor[s] == BIAS and model.beta[s] == 0.0:
            Qbb[s] += variance[model.channel[s]]
