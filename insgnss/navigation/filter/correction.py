"""What information about the events, such as that of images, makes of the states at all epochs.

The smoothed errors of a flight are normal with the covariance S over all epochs, a Markov chain,
which is never formed. Let y_j = T_j x_j be what is wanted of event j, C the covariance of all y
(B.8), and let further observations of the y, such as of images, move them by mu and leave the
covariance V. All that these add to the chain is, exactly,

    lambda = C^-1 mu,      M = C^-1 - C^-1 V C^-1                                             (B.10)

and the states at any epoch are moved, and their covariance becomes smaller, by

    d_k = X_k lambda,      P_s,k <- P_s,k - X_k M X_k',      X_k = cov_s(x_k, y)              (B.11)

X_k b, for the columns b of lambda or of a root of M, comes from one pass forwards and one
backwards over what the filter leaves. Forwards, the filter of data that are zero, whose P stays as
it was:

    d <- Phi d,  at a measurement d <- (1 - k h) d,  at event j d <- d + P T_j' b_j         (B.12)

and backwards, from zero behind the last epoch, with the innovation nu = -h d of each scalar,

    d_k = d + P r,    at event j r <- r + T_j' b_j,    at a measurement
    r <- r + h' (nu / S - k' r),    to the epoch before r <- Phi' r                           (B.13)

Both go block by block, and each block is filtered again for either (`blocks.BlockAgain`).

Cucci, Rehak and Skaloud (2017) "Bundle adjustment with raw inertial observations in UAV
applications", for what is gained; Bryson and Frazier (1963) for the form of the passes.
"""

from collections.abc import Iterator

import numpy as np

from ...records import Array
from .blocks import BlockAgain
from .codes import IMU, IMU0, NAV
from .kernels.records import FilterHistory


def corrections(
    again: BlockAgain, epoch: np.ndarray, information: Array
) -> Iterator[tuple[int, int, Array]]:
    """Yield what information at some epochs makes of the states at all of them (B.11).

    Parameters
    ----------
    again : BlockAgain
        What passes the blocks of the solution again.
    epoch : ndarray
        (e,) increasing epochs of the events.
    information : Array
        (e, n, w) T_j' b_j of each event, for w columns at once.

    Yields
    ------
    first, last : int
        The first epoch of a block and the first behind it; the last block comes first.
    moved : Array
        (last - first, n, w) X_k b.
    """
    n, width = information.shape[1:]
    at_event = dict(zip(epoch.tolist(), information, strict=True))
    starts, d = [], np.zeros((n, width))
    for b in range(len(again.checkpoints)):
        starts.append(d)
        records, front, begin = again.records(b)
        d = _forwards(records, front, begin, at_event, d)[0][-1]
    r = np.zeros((n, width))
    for b in reversed(range(len(starts))):
        records, front, begin = again.records(b)
        moved, innovations = _forwards(records, front, begin, at_event, starts[b])
        r = _backwards(records, front, begin, at_event, moved, innovations, r)
        yield front + begin, front + len(moved), moved[begin:]


def _forwards(
    records: FilterHistory, front: int, begin: int, at_event: dict[int, Array], d: Array
) -> tuple[Array, Array]:
    """Return d of the epochs of a block (B.12), and the innovations (k, nz, w) there."""
    count, nz = records.S.shape
    out, nu = np.zeros((count, *d.shape)), np.zeros((count, nz, d.shape[1]))
    d = d.copy()
    for e in range(begin, count):
        if front + e > 0:
            top = records.F[e] @ d
            d[IMU] *= records.D[e][:, None]
            d[NAV] = top
        for i in np.flatnonzero(records.S[e] > 0.0):
            used = records.used[i]
            nu[e, i] = -records.H[e, i, :used] @ d[:used]
            d += np.outer(records.K[e, i], nu[e, i])
        if front + e in at_event:
            d += records.P[e] @ at_event[front + e]
        out[e] = d
    return out, nu


def _backwards(
    records: FilterHistory,
    front: int,
    begin: int,
    at_event: dict[int, Array],
    moved: Array,
    nu: Array,
    r: Array,
) -> Array:
    """Take d to the smoothed one in place (B.13); return r before the block."""
    r = r.copy()
    for e in reversed(range(begin, len(moved))):
        moved[e] += records.P[e] @ r
        if front + e in at_event:
            r += at_event[front + e]
        for i in np.flatnonzero(records.S[e] > 0.0)[::-1]:
            used = records.used[i]
            t = nu[e, i] / records.S[e, i] - records.K[e, i] @ r
            r[:used] += np.outer(records.H[e, i, :used], t)
        if front + e > 0:
            of_nav = records.F[e].T @ r[NAV]
            r[IMU] *= records.D[e][:, None]
            r[NAV] = of_nav[NAV]
            r[IMU] += of_nav[IMU0:]
    return r
