"""Errors that are carried through transitions and updates: from each event to the next (B.8), and
forwards and backwards from information about the events (B.12, B.13).
"""

import numpy as np

from ....base.compilation import njit
from ..codes import ABSENT, IMU0, N_NAV
from .copies import copy_matrix
from .prediction import predict_errors
from .update import one_after_another, take_off, weigh


@njit(cache=True, allocates=False)
def update_errors(H, K, S, used, M, rows):
    """Multiply errors by the updates of an epoch in place: M <- (1 - k h) M, one after another.

    Parameters
    ----------
    H, K, S, used : ndarray
        As in `FilterHistory`, of the epoch.
    M : ndarray
        (n, c) columns of errors, changed in place.
    rows : ndarray
        (nz, c) h M as each scalar finds it, filled in place where there is one.
    """
    for i in range(0, S.size, 3):
        if S[i] > 0.0:
            h, gain, hM = H[i : i + 3], K[i : i + 3], rows[i : i + 3]
            weigh(M, h, used[i], hM)
            one_after_another(h, gain, used[i], hM)
            take_off(gain, hM, M.shape[1], M)


@njit(cache=True, error_model="numpy", fastmath={"contract"})
def event_transitions(event, history, begin, transitions):
    """Multiply transitions and updates between events, from the first event to the last.

    Parameters
    ----------
    event : ndarray
        (m,) number of the event of each epoch, or ABSENT.
    history : FilterHistory
        What the forward pass left.
    begin : int
        The first epoch to be passed.
    transitions : EventTransitions
        Those of the epochs before (`navigation.filter.event_chain`), taken on in place.
    """
    h, M, begun = history, transitions.product, transitions.begun
    n = M.shape[0]
    top, rows = np.zeros((N_NAV, n)), np.zeros((h.used.size, n))
    for e in range(begin, event.size):
        if begun[0] != 0:
            predict_errors(h.F[e], h.D[e], M, top)
            update_errors(h.H[e], h.K[e], h.S[e], h.used, M, rows)
        if event[e] != ABSENT:
            copy_matrix(M, transitions.of_events[event[e]])
            M[:] = 0.0
            for r in range(n):
                M[r, r] = 1.0
            begun[0] = 1


@njit(cache=True, error_model="numpy", fastmath={"contract"})
def correct_forwards(history, slot, information, begin, d, rows):
    """Run the filter of data that are zero, with information about the events (B.12).

    Parameters
    ----------
    history : FilterHistory
        What the filter leaves of the epochs of a block.
    slot : ndarray
        (m,) which of `information` stands at an epoch, or ABSENT.
    information : ndarray
        (e, n, c) T_j' b_j of the events, for c columns at once.
    begin : int
        The first epoch to be passed, as of `run_forward`.
    d : ndarray
        (m, n, c) filled in place, from that of the epoch before `begin`, or of the first epoch.
    rows : ndarray
        (m, nz, c) h d as each scalar finds it, filled in place.
    """
    h = history
    top, added = np.zeros((N_NAV, d.shape[2])), np.zeros(d.shape[1:])
    for e in range(begin, slot.size):
        if e > 0:
            copy_matrix(d[e - 1], d[e])
            predict_errors(h.F[e], h.D[e], d[e], top)
        update_errors(h.H[e], h.K[e], h.S[e], h.used, d[e], rows[e])
        if slot[e] != ABSENT:
            np.dot(h.P[e], information[slot[e]], added)
            d[e] += added


@njit(cache=True, error_model="numpy", fastmath={"contract"})
def correct_backwards(history, slot, information, begin, d, rows, r):
    """Take what `correct_forwards` gave to the smoothed errors in place (B.13).

    Parameters
    ----------
    history, slot, information, begin, d, rows
        As there.
    r : ndarray
        (n, c) behind the last epoch, taken on in place to the epoch before `begin`.
    """
    h, columns = history, r.shape[1]
    added, t = np.zeros(r.shape), np.zeros(columns)
    for e in range(slot.size - 1, begin - 1, -1):
        np.dot(h.P[e], r, added)
        d[e] += added
        if slot[e] != ABSENT:
            r += information[slot[e]]
        for i in range(h.used.size - 1, -1, -1):
            if h.S[e, i] <= 0.0:
                continue
            for c in range(columns):
                t[c] = -rows[e, i, c] / h.S[e, i]
            for k in range(r.shape[0]):
                gain, row = h.K[e, i, k], r[k]
                for c in range(columns):
                    t[c] -= gain * row[c]
            for k in range(h.used[i]):
                weight, row = h.H[e, i, k], r[k]
                if weight != 0.0:
                    for c in range(columns):
                        row[c] += weight * t[c]
        if e > 0:
            np.dot(h.F[e].T, r[:N_NAV], added)
            copy_matrix(added[:N_NAV], r)
            for s in range(IMU0, r.shape[0]):
                for c in range(columns):
                    r[s, c] = r[s, c] * h.D[e, s - IMU0] + added[s, c]
