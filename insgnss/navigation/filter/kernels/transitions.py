"""Errors that are carried through transitions and updates: from each event to the next (B.8), and
back from information behind each epoch (B.13).
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
    h, M, begun, since = history, transitions.product, transitions.begun, transitions.since
    n = M.shape[0]
    top = np.zeros((N_NAV, n))
    for e in range(begin, event.size):
        if begun[0] != 0:
            predict_errors(h.F[e], h.D[e], M, top)
            rows = transitions.rows[min(e, transitions.rows.shape[0] - 1)]
            update_errors(h.H[e], h.K[e], h.S[e], h.used, M, rows)
        if event[e] != ABSENT:
            copy_matrix(M, transitions.of_events[event[e]])
            M[:] = 0.0
            for r in range(n):
                M[r, r] = 1.0
            begun[0] = 1
        if e < since.shape[0]:
            copy_matrix(M, since[e])


@njit(cache=True, error_model="numpy", fastmath={"contract"})
def correct_backwards(event, history, begin, transitions, r, back):
    """Carry r of (B.13) to each epoch, as a multiple of d at the event before and r at the next.

    Parameters
    ----------
    event, history, begin, transitions
        As there, with the records of all epochs.
    r : ndarray
        (n, 2 n) behind the last epoch, taken on in place to the epoch before `begin`.
    back : ndarray
        (m, n, 2 n) of each epoch, filled in place.
    """
    h, (n, columns) = history, r.shape
    added, t = np.zeros(r.shape), np.zeros(columns)
    for e in range(event.size - 1, begin - 1, -1):
        copy_matrix(r, back[e])
        if event[e] != ABSENT:
            r[:] = 0.0
            for k in range(n):
                r[k, n + k] = 1.0
        for i in range(h.used.size - 1, -1, -1):
            if h.S[e, i] <= 0.0:
                continue
            t[n:] = 0.0
            for c in range(n):
                t[c] = -transitions.rows[e, i, c] / h.S[e, i]
            for k in range(n):
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
            for s in range(IMU0, n):
                for c in range(columns):
                    r[s, c] = r[s, c] * h.D[e, s - IMU0] + added[s, c]
