"""What information about the events, such as that of images, makes of the states at all epochs.

The smoothed errors of a flight are normal with the covariance S over all epochs, a Markov chain,
which is never formed. Let y_j = T_j x_j be what is wanted of event j, C the covariance of all y
(B.8), and let further observations of the y, such as of images, move them by mu and leave the
covariance V. All that these add to the chain is, exactly,

    lambda = C^-1 mu,      M = C^-1 - C^-1 V C^-1                                             (B.10)

and the states at any epoch are moved, and their covariance becomes smaller, by

    d_k = X_k lambda,      P_s,k <- P_s,k - X_k M X_k',      X_k = cov_s(x_k, y)              (B.11)

With d that of the filter of data that are zero, whose P stays as it was,

    d <- Phi d,  at a measurement d <- (1 - k h) d,  at event j d <- d + P T_j' b_j         (B.12)

and r that goes backwards, from zero behind the last epoch, with the innovation nu = -h d of each
scalar,

    X_k b = d + P r,    at event j r <- r + T_j' b_j,    at a measurement
    r <- r + h' (nu / S - k' r),    to the epoch before r <- Phi' r                           (B.13)

Images bring hundreds of columns b. From one event j to the next, d and r of every epoch are
multiples of d_j after event j and of r_j+1 before it, n numbers each, so that both passes carry
2 n columns, however many b has, and (B.12), (B.13) themselves go from event to event:

    d = Psi d_j,    r = Omega d_j + Theta r_j+1,    X_k b = [Psi + P Omega, P Theta] z_j      (B.14)

with z_j = (d_j, r_j+1), of which covariances take the product z_j z_j', as small as z_j has rows.
Each block of epochs is filtered again (`covariances.BlockAgain`), the last one first.

Cucci, Rehak and Skaloud (2017) "Bundle adjustment with raw inertial observations in UAV
applications", for what is gained; Bryson and Frazier (1963) for the form of the passes.
"""

from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np

from ...records import Array
from .codes import ABSENT, N_NAV
from .covariances import BlockAgain, ChainAgain
from .event_chain import EventChain
from .kernels.transitions import correct_backwards, event_transitions
from .smoother import SharedError, number_rows
from .solution import Solution, moved_by, solve


def correct_solution(
    solution: Solution, derivatives: Array, moment: Array, root: Array
) -> Solution:
    """Return a solution that knows what further observations say of its events (B.11).

    Parameters
    ----------
    solution : Solution
        The smoothed flight, with its increments and the chain of its events.
    derivatives : Array
        (e, d, n) T_j of all events.
    moment : Array
        (e, d) lambda_j; zero of an event that they are not of.
    root : Array
        (e, d, w) a root of M; what M has beside it, covariances keep.

    Returns
    -------
    Solution
        Moved, with smaller covariances; without its chain, which further observations tie.
    """
    again, chain, before = solution.covariances.again, solution.chain, solution.covariances
    assert again is not None, "the increments are gone"
    assert chain is not None, "the chain of events was not asked for"
    if isinstance(chain, ChainAgain):
        chain, again = chain.whole()
    delta = np.empty((solution.time.size, derivatives.shape[2]))
    nav, kept, cross = before.nav.copy(), before.kept.copy(), solution.event_cross.copy()
    of_nav, of_all = (np.tril_indices(size) for size in (N_NAV, delta.shape[1]))
    whole = number_rows(delta.shape[0], before.rows)
    b = np.concatenate([moment[:, :, None], root], axis=2)
    following: Array = np.zeros((0, 0))
    for piece in corrections(again, chain, derivatives, b):
        epochs = slice(piece.first, piece.last)
        delta[epochs] = piece.mean(piece.z[:, 0])
        if not root.size:
            continue
        Z = piece.z[:, 1:]
        square = Z @ Z.T
        X = piece.multiples(slice(None), N_NAV)
        nav[epochs] -= _covariances(X, square)[:, *of_nav]
        rows = np.flatnonzero(whole[epochs] != ABSENT)
        X_all = piece.multiples(rows, delta.shape[1])
        kept[whole[epochs][rows]] -= _covariances(X_all, square)[:, *of_all]
        j = piece.event
        if j >= 0 and chain.epoch[j] == piece.first:
            if following.size:
                behind = piece.at_next(chain.transitions[j + 1], following)
                cross[j + 1] -= X[0] @ square @ behind.T
            following = piece.P[0]
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


@dataclass(frozen=True, eq=False)
class Piece:
    """Epochs of one block between two events, and what stands at these (B.14).

    Parameters
    ----------
    first, last : int
        The first epoch, and the first behind them.
    event : int
        The event at or before them; -1 before the first.
    P, since, back : Array
        (k, n, n) covariance of the filter, (k, n, n) Psi and (k, n, 2 n) [Omega, Theta].
    z : Array
        (2 n + s, w) d_j, r_j+1, and what each of `shared` adds.
    shared : tuple of SharedError
        Errors that epochs share and no state describes.
    """

    first: int
    last: int
    event: int
    P: Array
    since: Array
    back: Array
    z: Array
    shared: tuple[SharedError, ...]

    def multiples(self, rows: slice | np.ndarray, states: int) -> Array:
        """Return the leading rows of [Psi + P Omega, P Theta], and of what is shared.

        Parameters
        ----------
        rows : slice or ndarray
            The epochs, counted from the first one.
        states : int
            How many rows, those of navigation first.

        Returns
        -------
        Array
            (k, states, 2 n + s).
        """
        of_states = self.P[rows, :states] @ self.back[rows]
        of_states[:, :, : self.since.shape[1]] += self.since[rows, :states]
        epochs = np.arange(self.first, self.last)[rows]
        return np.concatenate([of_states, _shares(self.shared, epochs, states)], axis=2)

    def at_next(self, transition: Array, P: Array) -> Array:
        """Return the rows of navigation of the event behind.

        Parameters
        ----------
        transition, P : Array
            (n, n) M_j+1 of (B.8), and the covariance of the filter there.

        Returns
        -------
        Array
            (9, 2 n + s).
        """
        (shared,) = _shares(self.shared, np.array([self.last]), N_NAV)
        return np.hstack([transition[:N_NAV], P[:N_NAV], shared])

    def mean(self, z: Array) -> Array:
        """Return what one column of z makes of all states.

        Parameters
        ----------
        z : Array
            (2 n + s,) the column.

        Returns
        -------
        Array
            (k, n).
        """
        n = self.P.shape[1]
        shared = _shares(self.shared, np.arange(self.first, self.last), n) @ z[2 * n :]
        r = self.back @ z[: 2 * n]
        return np.asarray(self.since @ z[:n] + (self.P @ r[:, :, None])[:, :, 0] + shared)


def corrections(again: BlockAgain, chain: EventChain, T: Array, b: Array) -> Iterator[Piece]:
    """Return what information about the events makes of the states at all epochs (B.11).

    Parameters
    ----------
    again : BlockAgain
        What passes the blocks of the solution again.
    chain : EventChain
        What ties the events.
    T : Array
        (e, d, n) what the information of each event is of.
    b : Array
        (e, d, w) the information, w columns at once.

    Returns
    -------
    iterator of Piece
        The last epochs first; the next block takes the place of their arrays.
    """
    assert again.transitions is not None, "the chain of events was not kept"
    n, width = T.shape[2], b.shape[2]
    filtered = chain.product(T, chain.filtered, np.arange(len(T)))
    d = np.swapaxes(filtered, 1, 2) @ b
    for j in range(1, len(d)):
        d[j] += chain.transitions[j] @ d[j - 1]
    added = np.zeros((3 * len(chain.shared), width))
    for k, error in enumerate(chain.shared):
        inside = error.within(chain.epoch)
        of_error = np.tensordot(T[inside][:, :, error.block], b[inside], ((0, 1), (0, 1)))
        added[3 * k : 3 * k + 3] = error.cov @ of_error
    event = number_rows(again.problem.epochs.stop.size, chain.epoch)
    r, back = np.zeros((n, 2 * n)), np.empty((again.size + 1, n, 2 * n))
    z = np.vstack([d[-1], np.zeros((n, width)), added])
    for number in reversed(range(len(again.checkpoints))):
        records, _, front, begin = again.records(number)
        event_at = event[front : front + len(records.m)]
        begun = bool(chain.epoch[0] < front + begin)
        transitions = again.transitions.again(again.products[number], begun, event_at.size)
        event_transitions(event_at, records, begin, transitions)
        correct_backwards(event_at, records, begin, transitions, r, back)
        cuts = np.unique(
            [begin, *(np.flatnonzero(event_at[begin:] != ABSENT) + begin), event_at.size]
        )
        for first, last in zip(cuts[-2::-1].tolist(), cuts[:0:-1].tolist(), strict=True):
            j = int(np.searchsorted(chain.epoch, front + first, side="right")) - 1
            P, since, r_of = (x[first:last] for x in (records.P, transitions.since, back))
            yield Piece(front + first, front + last, j, P, since, r_of, z, chain.shared)
            if event_at[first] != ABSENT:
                r_event = T[j].T @ b[j] + back[first] @ z[: 2 * n]
                z = np.vstack([d[j - 1] if j else np.zeros((n, width)), r_event, added])


def _covariances(X: Array, square: Array) -> Array:
    """Return X S X' of each of k matrices (k, r, c); X S of all of them is one product."""
    return np.asarray((X.reshape(-1, X.shape[2]) @ square).reshape(X.shape) @ X.swapaxes(1, 2))


def _shares(shared: tuple[SharedError, ...], epochs: np.ndarray, states: int) -> Array:
    """Return (k, states, s) which states of some epochs have which component of shared errors."""
    out = np.zeros((epochs.size, states, 3 * len(shared)))
    for k, error in enumerate(shared):
        out[error.within(epochs), error.block, 3 * k : 3 * k + 3] = np.eye(3)
    return out
