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
from dataclasses import replace

import numpy as np

from ...records import Array
from .blocks import BlockAgain
from .codes import N_NAV
from .kernels.records import FilterHistory
from .kernels.transitions import correct_backwards, correct_forwards
from .smoother import numbered
from .solution import Solution, moved_by, solve


def corrected(solution: Solution, events: np.ndarray, moment: Array, root: Array) -> Solution:
    """Return a solution that knows what further observations say of its events (B.11).

    Parameters
    ----------
    solution : Solution
        The smoothed flight, with its increments.
    events : ndarray
        (e,) the increasing events that they are of.
    moment : Array
        (e, n) T_j' lambda_j.
    root : Array
        (e, n, w) T_j' of the columns of a root of M; what M has beside it, covariances keep.

    Returns
    -------
    Solution
        Moved, with smaller covariances; without its chain, which further observations tie.
    """
    again, before = solution.covariances.again, solution.covariances
    assert again is not None, "the increments are gone"
    epoch = solution.event_epochs
    delta = np.empty((solution.time.size, moment.shape[1]))
    nav, kept = before.nav.copy(), before.kept.copy()
    at_event = np.empty((epoch.size, N_NAV, root.shape[2]))
    information = np.concatenate([moment[:, :, None], root], axis=2)
    of_nav, of_all = np.tril_indices(N_NAV), np.tril_indices(moment.shape[1])
    for first, last, of_block in corrections(again, epoch[events], information):
        for error in before.shared:
            inside = error.within(epoch[events])
            shared = slice(max(error.first - first, 0), max(error.last + 1 - first, 0))
            of_block[shared, error.block] += error.cov @ information[inside, error.block].sum(
                axis=0
            )
        delta[first:last], less = of_block[:, :, 0], of_block[:, :, 1:]
        of_navigation = less[:, :N_NAV]
        nav[first:last] -= (of_navigation @ np.swapaxes(of_navigation, 1, 2))[:, *of_nav]
        begin, end = np.searchsorted(before.rows, (first, last))
        whole = less[before.rows[begin:end] - first]
        kept[begin:end] -= (whole @ np.swapaxes(whole, 1, 2))[:, *of_all]
        inside = (epoch >= first) & (epoch < last)
        at_event[inside] = of_navigation[epoch[inside] - first]
    cross = solution.event_cross.copy()
    cross[1:] -= at_event[:-1] @ np.swapaxes(at_event[1:], 1, 2)
    covariances = replace(before, nav=nav, kept=kept)
    nominal, x = moved_by(solution.nav, solution.x, delta)
    return replace(
        solution, nav=nominal, x=x, covariances=covariances, event_cross=cross, chain=None
    )


def smoothed_about(solution: Solution, about: Solution) -> Solution:
    """Return a solution of the same data, linearised about another one.

    Parameters
    ----------
    solution : Solution
        The smoothed flight, with its increments.
    about : Solution
        One of the same epochs and states, such as a corrected one.

    Returns
    -------
    Solution
        What the data of the flight alone say.
    """
    again = solution.covariances.again
    assert again is not None, "the increments are gone"
    alone = solve(solution.problem, again.start, "off", about=about)
    return alone.enlarged(solution.covariances.shared)


def corrections(
    again: BlockAgain, epoch: np.ndarray, information: Array
) -> Iterator[tuple[int, int, Array]]:
    """Return what information at some epochs makes of the states at all of them (B.11).

    Parameters
    ----------
    again : BlockAgain
        What passes the blocks of the solution again.
    epoch : ndarray
        (e,) increasing epochs of the events.
    information : Array
        (e, n, w) T_j' b_j of each event, for w columns at once.

    Returns
    -------
    iterator of tuple
        First epoch of a block, the first behind it, and (last - first, n, w) X_k b of its epochs,
        which the next block takes the place of; the last block comes first.
    """
    n, width = information.shape[1:]
    slot = numbered(again.problem.epochs.stop.size, epoch)
    d, start = np.zeros((again.size + 1, n, width)), np.zeros((n, width))
    rows, r = np.empty((again.size + 1, again.used.size, width)), np.zeros((n, width))

    def forwards(b: int) -> tuple[FilterHistory, np.ndarray, int, int]:
        records, _, front, begin = again.records(b)
        events = slot[front : front + len(records.m)]
        d[0] = starts[b]
        correct_forwards(records, events, information, begin, d, rows)
        return records, events, front, begin

    starts = [start]
    for b in range(len(again.checkpoints)):
        _, events, _, _ = forwards(b)
        starts.append(d[events.size - 1].copy())
    for b in reversed(range(len(again.checkpoints))):
        records, events, front, begin = forwards(b)
        correct_backwards(records, events, information, begin, d, rows, r)
        yield front + begin, front + events.size, d[begin : events.size]
