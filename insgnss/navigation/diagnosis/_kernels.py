"""What constants that the filter takes as known do to its innovations (Y.1)."""

from ...base.compilation import njit
from ..filter.codes import ABSENT, ACCEL0, AIDING_ERROR, DRIFT_CODE, IMU0, N_NAV
from ..filter.kernels.update import one_after_another, take_off, weigh


@njit(cache=True, nogil=True, allocates=False)
def follow_constants(
    dt,
    dtheta,
    dvel,
    stop,
    time,
    rate,
    F,
    D,
    H,
    K,
    S,
    y,
    used,
    begin,
    like,
    factor,
    since,
    jump,
    U,
    information,
    vector,
    top,
    V,
    scaled,
    value,
):
    """Follow the errors that constants leave in the filter over a block of epochs.

    Parameters
    ----------
    dt, dtheta, dvel : ndarray
        As in `IntegrationIntervals`.
    stop, time, rate : ndarray
        As in `Epochs`, of the m epochs of the block.
    F, D, H, K, S, y, used : ndarray
        As in `FilterHistory`.
    begin : int
        The first epoch to be passed.
    like : ndarray
        (c,) the state, counted from the first of navigation, whose column each constant has, or
        ABSENT for one that is a state itself.
    factor : ndarray
        (c,) what the column is multiplied with, as of a state: DRIFT_CODE, the channel whose
        measured value it is, or AIDING_ERROR for nothing.
    since : ndarray
        (c,) s since the start, from which on an AIDING_ERROR acts: a step.
    jump : ndarray
        (c, 9) errors of navigation that it leaves besides, at the first epoch from then on.
    U : ndarray
        (n, c) errors of the states that a unit of each constant leaves, taken on in place.
    information, vector : ndarray
        (c, c) and (c,) added to in place (Y.2).
    top, V, scaled, value : ndarray
        (9, c), (3, c), (3, c) and (6,) scratch.
    """
    n, count = U.shape
    wide = H.shape[2]
    for e in range(begin, stop.size):
        if e > 0:
            total = 0.0
            value[:] = 0.0
            for i in range(stop[e - 1], stop[e]):
                total += dt[i]
                for c in range(3):
                    value[c] += dtheta[i, c]
                    value[ACCEL0 + c] += dvel[i, c]
            for r in range(N_NAV):
                row = top[r]
                for a in range(count):
                    row[a] = 0.0
                for k in range(n):
                    t = F[e, r, k]
                    if t != 0.0:
                        for a in range(count):
                            row[a] += t * U[k, a]
            for a in range(count):
                f = factor[a]
                if like[a] != ABSENT and f != DRIFT_CODE and f != AIDING_ERROR:
                    mean = value[f] / total
                    for r in range(N_NAV):
                        top[r, a] += mean * F[e, r, like[a]]
            for r in range(N_NAV):
                for a in range(count):
                    U[r, a] = top[r, a]
            for r in range(IMU0, n):
                d = D[e, r - IMU0]
                if d != 1.0:
                    for a in range(count):
                        U[r, a] *= d
            for a in range(count):
                if factor[a] == AIDING_ERROR and time[e - 1] < since[a] <= time[e]:
                    for r in range(N_NAV):
                        U[r, a] += jump[a, r]
        for first in range(0, S.shape[1], 3):
            if S[e, first] <= 0.0:
                continue
            h, gain, leading = H[e, first : first + 3], K[e, first : first + 3], used[first]
            weigh(U, h, leading, V)
            for a in range(count):
                if like[a] != ABSENT and like[a] < min(wide, leading):
                    f = factor[a]
                    if f == DRIFT_CODE:
                        for i in range(3):
                            V[i, a] += time[e] * h[i, like[a]]
                    elif f == AIDING_ERROR:
                        if time[e] >= since[a]:
                            for i in range(3):
                                V[i, a] += h[i, like[a]]
                    elif f < ACCEL0:
                        for i in range(3):
                            V[i, a] += rate[e, f] * h[i, like[a]]
            one_after_another(h, gain, leading, V)
            take_off(gain, V, count, U)
            for i in range(3):
                row = V[i]
                t, inv = y[e, first + i] / S[e, first + i], 1.0 / S[e, first + i]
                for a in range(count):
                    vector[a] += t * row[a]
                    scaled[i, a] = -inv * row[a]
            take_off(scaled, V, count, information)
