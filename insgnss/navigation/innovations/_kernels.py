"""Numba kernels of the calibration.

A vector propagated through a turn with its sensitivity to the gyro calibration (P,
`multi_position`), and the likelihood of a segment's innovations with its slopes in the noise (L,
`likelihood`).
"""

from typing import NamedTuple

import numpy as np

from ...base.compilation import njit
from ..filter.codes import (
    ABSENT,
    COVARIANCE_RESET,
    IMU0,
    N_NAV,
    N_NOMINAL,
    NAV,
    NOT_MEASURED,
    POSITION_ROW,
    REJECTED,
    USED,
    VEL0,
)
from ..filter.kernels.copies import copy_matrix, copy_vector
from ..filter.kernels.error_model import (
    add_bias_step,
    add_gap_noise,
    linearise,
)
from ..filter.kernels.error_states import course_from
from ..filter.kernels.measurements import measured_triple
from ..filter.kernels.prediction import predict_covariance, propagate_mean
from ..filter.kernels.records import make_interval_work, make_triple
from ..filter.kernels.update import (
    cholesky,
    forward_solve3,
    innovation_test,
    reset_covariance,
    state_difference,
)


@njit(cache=True)
def minus_half_turn(x, y, z, A):
    """Write A (3, 3) = exp(-[d x] / 2), d = (x, y, z) in rad."""
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
    """Write out = C A, all (3, 3)."""
    for i in range(3):
        for j in range(3):
            out[i, j] = C[i, 0] * A[0, j] + C[i, 1] * A[1, j] + C[i, 2] * A[2, j]


@njit(cache=True)
def propagate_turn(delta, dt, M, bias, Rt, J):
    """Propagate axes through a turn of calibrated increments, with the slopes of (P.4).

    Parameters
    ----------
    delta : ndarray, (n, 3)
        Raw increments of angle, rad.
    dt : ndarray, (n,)
        Their intervals, s.
    M : ndarray, (3, 3)
        Inverse response of the gyros.
    bias : ndarray, (3,)
        Bias of the gyros, rad/s.
    Rt : ndarray, (3, 3)
        Axes at the turn's start into those at its end, written here.
    J : ndarray, (3, 12)
        Slopes of (P.4), written here.
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


class Linear(NamedTuple):
    """A segment linearised at its m epochs (L.1 to L.3).

    The noise has q components, the first the fixed one, d of them with driven states.
    """

    P0: np.ndarray  # (d, n, n) a-priori covariance, component by component
    mean0: np.ndarray  # (n,) a-priori mean about the nominal
    gate: float  # NIS above which a triple is rejected
    reset_s: float  # s of rejected fixes after which the covariance is reset
    time: np.ndarray  # (m,) s
    F: np.ndarray  # (m, 9, n) from the epoch before
    D: np.ndarray  # (m, ns)
    gap: np.ndarray  # (m, n) nominal propagated from the epoch before, less the nominal here
    Q: np.ndarray  # (m, q, 9, 9) process noise of the navigation states
    Q_cross: np.ndarray  # (m, 9, ns) with the driven states, each of one component
    of_state: np.ndarray  # (ns,) the component that drives a state, 0 for none
    Q_states: np.ndarray  # (m, d, ns) of the driven states
    kind: np.ndarray  # (k,) kinds of triples that occur
    there: np.ndarray  # (m, k) bool
    H: np.ndarray  # (m, k, 3, n)
    nu: np.ndarray  # (m, k, 3, 1) innovation of the nominal
    R: np.ndarray  # (m, k, 3, 3)
    used: np.ndarray  # (k,) leading columns of H that may differ from zero


@njit(cache=True, nogil=True, error_model="numpy")
def linearise_segment(intervals, ep, imu, earth, lever, nav, x, out):
    """Linearise a segment about its nominal, written into `out`.

    Parameters
    ----------
    intervals, ep, imu, earth, lever
        Integration intervals, epochs, state model, Earth and lever arm as the filter's kernels take
        them; the noise of the state model in q components.
    nav : ndarray, (m, 10)
        Nominal navigation states.
    x : ndarray, (m, ns)
        Nominal IMU states.
    out : Linear
        The linearised segment, written here.
    """
    n = out.F.shape[2]
    ns = n - N_NAV
    driven = out.Q_states.shape[1]
    work, triple, acceleration = make_interval_work(ns), make_triple(ns), np.zeros(3)
    q = len(imu.white)
    W, Qbb = np.zeros((q, N_NAV, n)), np.zeros((q, ns))
    nav_e, x_e = np.zeros(N_NOMINAL), np.zeros(ns)
    for e in range(ep.stop.size):
        if e > 0:
            copy_vector(nav[e - 1], nav_e)
            copy_vector(x[e - 1], x_e)
            F, D = out.F[e], out.D[e]
            first, last, course = ep.stop[e - 1], ep.stop[e], course_from(ep, e - 1)
            linearise(intervals, first, last, course, nav_e, x_e, imu, earth, F, D, W, Qbb, work)
            if ep.gap[e, 0] > 0.0:
                add_gap_noise(W[0], work.column, work.last_block[0], ep.gap[e])
            if ep.bias_step[e, 0] > 0.0:
                add_bias_step(Qbb[0], imu, ep.bias_step[e])
            for component in range(len(W)):
                copy_matrix(W[component, :, NAV], out.Q[e, component])
                if component < driven:
                    copy_vector(Qbb[component], out.Q_states[e, component])
            for s in range(ns):
                for r in range(N_NAV):
                    out.Q_cross[e, r, s] = W[out.of_state[s], r, IMU0 + s]
            state_difference(nav_e, x_e, nav[e], x[e], out.gap[e])
            for i in range(3):
                acceleration[i] = (nav_e[VEL0 + i] - nav[e - 1, VEL0 + i]) / (
                    ep.time[e] - ep.time[e - 1]
                )
        for j in range(out.kind.size):
            kind = out.kind[j]
            out.there[e, j] = measured_triple(
                kind, e, ep, nav[e], x[e], lever, acceleration, imu, earth, triple
            )
            copy_matrix(triple.H, out.H[e, j])
            copy_matrix(triple.nu, out.nu[e, j])
            copy_matrix(triple.R, out.R[e, j])


@njit(cache=True, allocates=False)
def mixed_noise(lin, e, share, W, Qbb):
    """Sum the components of the process noise at epoch e, each times its `share`."""
    W[:] = 0.0
    Qbb[:] = 0.0
    for component in range(share.size):
        v = share[component]
        if v == 0.0:
            continue
        for r in range(N_NAV):
            for c in range(N_NAV):
                W[r, c] += v * lin.Q[e, component, r, c]
        if component < lin.Q_states.shape[1]:
            for s in range(Qbb.size):
                Qbb[s] += v * lin.Q_states[e, component, s]
    for r in range(N_NAV):
        for s in range(Qbb.size):
            W[r, IMU0 + s] = share[lin.of_state[s]] * lin.Q_cross[e, r, s]


@njit(cache=True, allocates=False)
def update_with_slopes(P, m, dP, dm, h, z, r, dr, used, gain, column, slope, total):
    """Update with one scalar (K.4), and with it the slopes of (L.5) in each parameter.

    Parameters
    ----------
    P, m : ndarray, (n, n) and (n,)
        Covariance and mean, updated here.
    dP, dm : ndarray, (p, n, n) and (p, n)
        Their derivatives, updated here.
    h : ndarray, (n,)
        Row of the measurement.
    z, r : float
        Measurement and its variance.
    dr : ndarray, (p,)
        Derivatives of r.
    used : int
        Number of leading columns of h that may differ from zero.
    gain, column : ndarray, (n,)
        Scratch.
    slope : ndarray, (2, p)
        Derivatives of S and y, written here.
    total : ndarray, (p + 1, p)
        Gradient and information are added here.

    Returns
    -------
    S, y : float
        Variance of the innovation and the innovation.
    """
    n = P.shape[0]
    S, y = r, z
    gain[:] = 0.0
    for c in range(used):  # P and its derivatives are symmetric, and most of h is zero
        t = h[c]
        if t != 0.0:
            row = P[c]
            for a in range(n):
                gain[a] += t * row[a]
    for c in range(used):
        S += h[c] * gain[c]
        y -= h[c] * m[c]
    for a in range(n):
        row = P[a]
        t = gain[a] / S
        for c in range(n):
            row[c] -= t * gain[c]
    for a in range(n):
        gain[a] /= S
    for i in range(dr.size):
        slope[0, i], slope[1, i] = dr[i], 0.0
        column[:] = 0.0
        for c in range(used):
            t = h[c]
            if t != 0.0:
                row = dP[i, c]
                for a in range(n):
                    column[a] += t * row[a]
        for c in range(used):
            slope[0, i] += h[c] * column[c]
            slope[1, i] -= h[c] * dm[i, c]
        dS, dy = slope[0, i], slope[1, i]
        for a in range(n):
            dm[i, a] += (column[a] - gain[a] * dS) * (y / S) + gain[a] * dy
            row = dP[i, a]
            s, t = gain[a] * dS - column[a], gain[a]
            for c in range(n):
                row[c] += s * gain[c] - t * column[c]
    for a in range(n):
        m[a] += gain[a] * y
    for i in range(dr.size):
        total[0, i] += slope[0, i] / S * (1.0 - y * y / S) + 2.0 * y * slope[1, i] / S
        for j in range(dr.size):
            total[1 + i, j] += (
                slope[0, i] * slope[0, j] / (S * S) + 2.0 * slope[1, i] * slope[1, j] / S
            )
    return S, y


@njit(cache=True, nogil=True, error_model="numpy")
def run_linear(lin, share, of_part, scale, of_kind, total, white, nis, verdict):
    """Run a Kalman filter over a linearised segment and return (L.4).

    Parameters
    ----------
    lin : Linear
        The segment.
    share : ndarray, (q,)
        Factors of the components' variance.
    of_part : ndarray of int, (q,)
        The parameter that is half the logarithm of the component's factor, or -1.
    scale : ndarray, (k,)
        Factors of R of each kind of measurement.
    of_kind : ndarray of int, (k,)
        The parameter that is half the logarithm of the kind's factor, or -1.
    total : ndarray, (p + 1, p)
        Gradient and information (L.5) are added here.
    white : ndarray, (m, k, 3)
        Whitened innovations, NaN where there is none, written here.
    nis, verdict : ndarray, (m, k)
        Normalised innovations squared and verdicts, written here.

    Returns
    -------
    float
        -2 log L.
    """
    n = lin.F.shape[2]
    ns, p = n - N_NAV, total.shape[1]
    P0, gate, reset = lin.P0, lin.gate, lin.reset_s
    P, m, new, none = np.zeros((n, n)), lin.mean0.copy(), np.zeros(n), np.zeros(n)
    dP, dm = np.zeros((p, n, n)), np.zeros((p, n))
    W, Qbb = np.zeros((N_NAV, n)), np.zeros(ns)
    X, nine = np.zeros((N_NAV, n)), np.zeros((N_NAV, N_NAV))
    R, L, S3 = np.zeros((3, 3)), np.zeros((3, 3)), np.zeros((3, 3))
    H, HP, nu = np.zeros((3, n)), np.zeros((3, n)), np.zeros((3, 1))
    gain, column, slope, dr = np.zeros(n), np.zeros(n), np.zeros((2, p)), np.zeros(p)
    only = np.zeros(share.size)
    for component in range(len(P0)):
        P += share[component] * P0[component]
        if of_part[component] != ABSENT:
            # added to in place, see `navigation.filter.kernels.copies`
            slopes = dP[of_part[component]]
            slopes += 2.0 * share[component] * P0[component]
    cost, rejected_since = 0.0, ABSENT
    for e in range(lin.time.size):
        if e > 0:
            F, D = lin.F[e], lin.D[e]
            mixed_noise(lin, e, share, W, Qbb)
            predict_covariance(P, F, D, W, Qbb, X, nine)
            for i in range(p):
                for component in range(share.size):
                    only[component] = 2.0 * share[component] if of_part[component] == i else 0.0
                mixed_noise(lin, e, only, W, Qbb)
                predict_covariance(dP[i], F, D, W, Qbb, X, nine)
                propagate_mean(F, D, dm[i], none, new)
            propagate_mean(F, D, m, lin.gap[e], new)
        for j in range(lin.kind.size):
            verdict[e, j] = NOT_MEASURED
            white[e, j] = np.nan
            nis[e, j] = np.nan
            if not lin.there[e, j]:
                continue
            copy_matrix(lin.H[e, j], H)
            copy_matrix(lin.nu[e, j], nu)
            for a in range(3):
                for c in range(3):
                    R[a, c] = lin.R[e, j, a, c] * scale[j]
            out, used = X[:2, :3], lin.used[j]
            nis[e, j] = innovation_test(P, H, nu, m, R, used, S3, L, HP, out)
            cholesky(lin.R[e, j], L)
            log_R = 2.0 * np.log(L[0, 0] * L[1, 1] * L[2, 2])
            verdict[e, j] = USED
            if nis[e, j] > gate:
                if lin.kind[j] == POSITION_ROW and rejected_since == ABSENT:
                    rejected_since = e
                if (
                    lin.kind[j] != POSITION_ROW
                    or lin.time[e] - lin.time[rejected_since] < reset
                    or nis[e, j] == np.inf
                ):
                    verdict[e, j] = REJECTED
                    cost += gate + log_R + 3.0 * np.log(scale[j])
                    if of_kind[j] != ABSENT:
                        total[0, of_kind[j]] += 6.0
                    continue
                reset_covariance(P, out[0], reset)
                verdict[e, j] = COVARIANCE_RESET
            if lin.kind[j] == POSITION_ROW:
                rejected_since = ABSENT
            cost += log_R
            forward_solve3(L, H)
            forward_solve3(L, nu)
            dr[:] = 0.0
            if of_kind[j] != ABSENT:
                dr[of_kind[j]] = 2.0 * scale[j]
            for i in range(3):
                S, y = update_with_slopes(
                    P, m, dP, dm, H[i], nu[i, 0], scale[j], dr, used, gain, column, slope, total
                )
                white[e, j, i] = y / np.sqrt(S)
                cost += np.log(S) + y * y / S
    return cost
