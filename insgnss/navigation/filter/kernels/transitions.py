"""The transition of all errors from each event to the next, with all updates on the way (B.8)."""

import numpy as np

from ....base.compilation import njit
from ..codes import ABSENT, IMU0, N_NAV
from .copies import copy_matrix
from .update import one_after_another, take_off, weigh


@njit(cache=True, error_model="numpy", fastmath={"contract"})
def event_transitions(event, F, D, H, K, S, used, begin, M, begun, out):
    """Multiply transitions and updates between events, from the first event to the last.

    Parameters
    ----------
    event : ndarray
        (m,) number of the event of each epoch, or ABSENT.
    F, D, H, K, S, used : ndarray
        As in `FilterHistory`.
    begin : int
        The first epoch to be passed.
    M : ndarray
        (n, n) product so far, taken on in place; before the first event the unit matrix.
    begun : ndarray
        (1,) int, whether there was an event before, set in place.
    out : ndarray
        (events, n, n) filled in place: takes the error after the event before to that after this
        one; of the first the unit matrix.
    """
    n = K.shape[2]
    top, rows = np.zeros((N_NAV, n)), np.zeros((3, n))
    for e in range(begin, event.size):
        if begun[0] != 0:
            np.dot(F[e], M, top)
            copy_matrix(top, M)
            for s in range(IMU0, n):
                if D[e, s - IMU0] != 1.0:
                    for c in range(n):
                        M[s, c] *= D[e, s - IMU0]
            for i in range(0, K.shape[1], 3):
                if S[e, i] > 0.0:
                    h, gain = H[e, i : i + 3], K[e, i : i + 3]
                    weigh(M, h, used[i], rows)
                    one_after_another(h, gain, used[i], rows)
                    take_off(gain, rows, n, M)
        if event[e] != ABSENT:
            copy_matrix(M, out[event[e]])
            M[:] = 0.0
            for r in range(n):
                M[r, r] = 1.0
            begun[0] = 1
