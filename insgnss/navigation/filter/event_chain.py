"""The smoothed covariance between any two camera events (B.8), and what all of them share (B.9).

What is wanted of an event, such as the pose of a camera, is linear in the errors of all states at
its epoch, y_k = T_k x_k. With Y_j,k = T_j P_j M_j+1' ... M_k', which takes one product with M_k'
from event to event for all earlier events at once,

    cov_s(y_j, y_k) = Y_j,k (1 - Lambda_k P_k) T_k'

Only M_k is worked out ahead, since what it is made of is gone after the smoother: 54 ms for 9116
epochs and 34 states, 1 % of `process`. It is kept of each event, and of P_k and of the last factor
what T_k reads (`StateLayout.read_of_events`): 17 kB of 34 states. Of events that would take more
than `CHAIN_BYTES` nothing is kept: parts of the chain are worked out again from the blocks of the
filter where they are asked for (`blocks.ChainAgain`), which gives the same bits.

Constants (turn-on biases, scale factors, lever arm, time offset), slow Gauss-Markov processes and
random walks are the same, or nearly so, in all flight lines: an accelerometer bias tilts the body
in each of them. The smoothed errors of such states at a few events (nodes), c, are jointly normal
with what is wanted of every event, y_k. Hence with cov_s(c) = L L'

    y_k = A_k c' + rest_k,    c' = L^-1 c,    cov(c') = 1,    A_k = cov_s(y_k, c) L^-T       (B.9)

where cov_s(y_k, c) is that of (B.8), and rest is independent of c': cov(rest_j, rest_k) =
cov_s(y_j, y_k) - A_j A_k', what is left of the covariance once c' is known, positive semi-definite
for any choice of nodes. The choice decides what rest of different flight lines still share.
Constants have one node. Other states with correlation times above `SLOW` have nodes half of it
apart, a random walk every `WALK_S`. Of ign8 (434 images in 26 lines, 35 min) rest between lines is
below 0.0001 of the sigmas in the median and 0.31 at most (headings of lines that one turn
separates; tilts 0.12, positions 0.04). The sigma of the mean tilt comes out 0.99 to 1.00 of the
exact one, of the mean heading 1.11; with constants alone the tilt 0.76 to 0.80, of independent
lines 0.26 to 0.36. The mean position of a corridor whose fixes have errors of 300 s: 1.00, with
constants alone and of independent lines 0.66.

What epochs share that no state describes (`SharedError`) is common to them in the same sense.
"""

from collections.abc import Callable
from dataclasses import dataclass, replace
from itertools import pairwise
from typing import NamedTuple, Protocol

import numpy as np
from numpy.typing import NDArray

from ...records import Array
from .codes import N_NAV
from .kernels.records import Epochs
from .layout import StateLayout
from .smoother import EventRows, SharedError

SLOW_CORRELATION_S = 100.0  # correlation time; below, lines a turn apart share little
# interval (s) of a random walk's nodes: the figures above were reached with it (chosen)
WALK_S = 300.0
NODE_INTERVAL = 0.5  # interval between them, in correlation times
MOST_NODES = 200  # nodes of a segment; farther apart where it takes more
# what chain and whole covariances of all events may take where they are kept; of 2200 events and
# 34 states, more than a usual flight has
CHAIN_BYTES = 48_000_000
# events of a part of the chain: 17 MB of 34 states, while the blocks that two parts share, which
# are filtered twice, are few of its own
EVENTS_OF_PIECE = 1024
JITTER = (0.0, 1e-12, 1e-9)  # of the variances: bias and slow process are known by their sum


def event_bytes(layout: StateLayout) -> int:
    """Return the bytes of an event whose chain and whole covariance are kept.

    Parameters
    ----------
    layout : StateLayout
        The error states.

    Returns
    -------
    int
        Of its transition, of the rows that its pose reads, and of the packed covariance.
    """
    n = layout.size
    return 8 * (n * n + 2 * layout.read_of_events.size * n) + 4 * n * (n + 1)


def pieces_of(events: int) -> list[tuple[int, int]]:
    """Return the pieces of a chain.

    Parameters
    ----------
    events : int
        Camera events.

    Returns
    -------
    list of (int, int)
        The first event of each piece, and the first behind it.
    """
    edges = [*range(0, events, EVENTS_OF_PIECE), events]
    return list(pairwise(edges))


def events_of(epochs: Epochs) -> np.ndarray:
    """Return the epoch of each camera event.

    Parameters
    ----------
    epochs : Epochs
        The m epochs.

    Returns
    -------
    ndarray
        (events,) in the order of the events.
    """
    exposed = np.flatnonzero(epochs.event >= 0)
    return exposed[np.argsort(epochs.event[exposed])]


class EventTransitions(NamedTuple):
    """M_k of (B.8), multiplied up along the forward pass, whose records do not stay.

    Parameters
    ----------
    product : Array
        (n, n) since the latest event, before the first one the unit matrix.
    begun : ndarray
        (1,) int, whether there was one.
    of_events : Array
        (events, n, n) M_k, which takes the error after the event before to that after this one; of
        the first the unit matrix.
    since : Array
        (m, n, n) the product at each epoch of a block, where it is wanted; else without rows.
    rows : Array
        (m, nz, n) h times the product as each scalar of these epochs finds it; else one row.
    """

    product: Array
    begun: np.ndarray
    of_events: Array
    since: Array
    rows: Array

    @classmethod
    def before(cls, events: int, n: int, measured: int) -> "EventTransitions":
        """Return those before the first epoch.

        Parameters
        ----------
        events, n, measured : int
            Camera events, states, and scalars that are measured at an epoch.

        Returns
        -------
        EventTransitions
            With room for all events.
        """
        begun, room = np.zeros(1, dtype=np.int64), np.empty((events, n, n))
        return cls(np.eye(n), begun, room, room[:0], np.zeros((1, measured, n)))

    def again(self, product: Array, begun: bool, epochs: int) -> "EventTransitions":
        """Return room for a block that is passed again.

        Parameters
        ----------
        product : Array
            (n, n) before the block.
        begun : bool
            Whether an event stands before it.
        epochs : int
            Epochs of the block.

        Returns
        -------
        EventTransitions
            With what each epoch of the block leaves.
        """
        since = np.empty((epochs, *product.shape))
        rows = np.zeros((epochs, *self.rows.shape[1:]))
        count = np.array([begun], dtype=np.int64)
        return EventTransitions(product.copy(), count, self.of_events, since, rows)


@dataclass(frozen=True)
class EventChain:
    """What ties the events of a solution.

    Parameters
    ----------
    epoch : ndarray
        (events,) epoch of each event.
    transitions : Array
        (events, n, n) M_k of (B.8); of the first event the unit matrix.
    read : EventRows
        Which rows these are:
    filtered, gain : Array
        (rows, n) of P_k of the filter, and columns of the last factor of (B.8).
    shared : tuple of SharedError
        What was added to the smoothed covariance.
    """

    epoch: np.ndarray
    transitions: Array
    read: EventRows
    filtered: Array
    gain: Array
    shared: tuple[SharedError, ...] = ()

    def piece(self, first: int, last: int) -> "EventChain":
        """Return the chain of consecutive events.

        Parameters
        ----------
        first, last : int
            The first of them, and the first behind them.

        Returns
        -------
        EventChain
            Whose events count from 0; views.
        """
        events, rows = slice(first, last), slice(*self.read.begin[[first, last]])
        return replace(
            self,
            epoch=self.epoch[events],
            transitions=self.transitions[events],
            read=self.read.piece(first, last),
            filtered=self.filtered[rows],
            gain=self.gain[rows],
        )

    def product(self, T: Array, rows: Array, events: np.ndarray | int) -> Array:
        """Return T_k P_k, or T_k times the transposed last factor of (B.8).

        Parameters
        ----------
        T : Array
            (k, d, n) what is wanted of each event.
        rows : Array
            `filtered` or `gain`.
        events : ndarray or int
            (k,) the events.

        Returns
        -------
        Array
            (k, d, n).

        Raises
        ------
        ValueError
            Where T depends on a state that is not kept.
        """
        kept = self.read.state[: self.read.common]
        of_kept = T[..., kept]
        if np.count_nonzero(of_kept) < np.count_nonzero(T):
            raise ValueError(
                "the chain of events does not keep this state; see `StateLayout.read_of_events`"
            )
        slot = np.asarray(self.read.begin[events])[..., None] + np.arange(kept.size)
        return np.asarray(of_kept @ rows[slot])

    def row_of(self, event: int, state: int) -> int:
        """Return the row of `filtered` and `gain` that has a state at an event.

        Parameters
        ----------
        event, state : int
            Both counted from 0, states from those of navigation on.

        Returns
        -------
        int
            The row; ValueError where it is not kept.
        """
        begin, end = self.read.begin[event : event + 2]
        return int(begin) + self.read.state[begin:end].tolist().index(state)

    def covariance_of(self, events: np.ndarray, T: Array) -> Array:
        """Return the smoothed covariance of what is wanted of some of the events.

        Parameters
        ----------
        events : ndarray
            (k,) the events, increasing.
        T : Array
            (k, d, n) what is wanted of each of them, as the derivative by the errors of all states.

        Returns
        -------
        Array
            (k d, k d), event after event, symmetric.
        """
        k, d, n = T.shape
        start = self.product(T, self.filtered, events)
        last = self.product(T, self.gain, events)
        Y = np.empty((k * d, n))
        lower = np.zeros((k * d, k * d))  # row by row: columns would be strewn over the memory
        for a in range(k):
            own, to_here = slice(a * d, (a + 1) * d), (a + 1) * d
            for event in range(events[a - 1] + 1, events[a] + 1) if a else ():
                Y[: a * d] = Y[: a * d] @ self.transitions[event].T
            Y[own] = start[a]
            lower[own, :to_here] = last[a] @ Y[:to_here].T
            lower[own, own] *= 0.5
        cov = lower + lower.T
        self._add_shared(cov.reshape(k, d, k, d), events, T)
        return cov

    def cross(
        self, events: tuple[np.ndarray, np.ndarray], derivatives: tuple[Array, Array]
    ) -> Array:
        """Return the smoothed covariance of what is wanted of pairs of events.

        Parameters
        ----------
        events : tuple of ndarray
            (p,) each: first event of each pair, and the second, which is not before it.
        derivatives : tuple of Array
            (p, d, n) each: what is wanted of the first and of the second of each pair.

        Returns
        -------
        Array
            (p, d, d), the first of a pair by rows.
        """
        (a, b), (T_a, T_b) = events, derivatives
        Y, last = self.product(T_a, self.filtered, a), self.product(T_b, self.gain, b)
        for step in range(1, int((b - a).max(initial=0)) + 1):
            later = b - a >= step
            Y[later] = Y[later] @ np.swapaxes(self.transitions[a[later] + step], 1, 2)
        cov = Y @ np.swapaxes(last, 1, 2)
        for error in self.shared:
            inside = error.within(self.epoch[a]) & error.within(self.epoch[b])
            first, second = T_a[inside][:, :, error.block], T_b[inside][:, :, error.block]
            cov[inside] += first @ error.cov @ np.swapaxes(second, 1, 2)
        return cov

    def _add_shared(self, cov: Array, events: np.ndarray, T: Array) -> None:
        """Add what events within one spell share, to all pairs of them, in place."""
        epoch = self.epoch[events]
        for error in self.shared:
            inside = np.flatnonzero(error.within(epoch))
            derivative = T[inside][:, :, error.block]
            added = np.einsum("aix,xy,bjy->aibj", derivative, error.cov, derivative)
            cov[inside[:, None], :, inside] += added.transpose(0, 2, 1, 3)


def nodes_of(layout: StateLayout, time: Array) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """Return the nodes of the states that change slowly, or not at all.

    Parameters
    ----------
    layout : StateLayout
        The states.
    time : ndarray
        (k,) times of all events of the solution, s.

    Returns
    -------
    event, state : ndarray
        (c,) event and state of each node, events not decreasing.
    """
    if not time.size:
        return np.zeros(0, dtype=np.int64), np.zeros(0, dtype=np.int64)
    duration, wider, number = float(time[-1] - time[0]), 1.0, MOST_NODES + 1
    interval = np.full(layout.beta.size, np.inf)  # of a constant
    driven = layout.drive > 0.0
    interval[driven] = WALK_S
    decays = driven & (layout.beta > 0.0)
    interval[decays] = NODE_INTERVAL / layout.beta[decays]
    states = np.flatnonzero(layout.sigma0 > 0.0)
    states = states[~decays[states] | (layout.beta[states] * SLOW_CORRELATION_S <= 1.0)]
    while number > MOST_NODES and wider < 1e6:
        count = np.maximum(np.ceil(duration / (wider * interval[states])), 1.0).astype(np.int64)
        number, wider = int(count.sum()), 2.0 * wider
    state = np.repeat(states, count)
    share = np.concatenate([(np.arange(k) + 0.5) / k for k in count]) if states.size else count
    event = np.abs(time[:, None] - time[0] - duration * share).argmin(axis=0)
    nodes = np.unique(np.column_stack([event, N_NAV + state]), axis=0)
    return nodes[:, 0], nodes[:, 1]


class ChainInParts(Protocol):
    """What gives the chain of consecutive events: `EventChain`, or `blocks.ChainAgain`."""

    @property
    def epoch(self) -> np.ndarray:
        """The epoch of each event."""

    @property
    def shared(self) -> tuple[SharedError, ...]:
        """What was added to the smoothed covariance."""

    def piece(self, first: int, last: int) -> EventChain:
        """Return the chain of the events first..last - 1, which count from 0."""


def common_errors(
    chain: ChainInParts,
    event: NDArray[np.int64],
    state: NDArray[np.int64],
    derivatives: Callable[[slice], Array],
) -> Array:
    """Return what errors common to all events make of each (B.9).

    Parameters
    ----------
    chain : EventChain or ChainAgain
        What ties the k events.
    event, state : ndarray
        (c,) the nodes, events not decreasing.
    derivatives : callable
        T, (events, d, n), what is wanted of some events, as the derivative by the errors of all
        states.

    Returns
    -------
    Array
        (k, d, q) A_k, by errors of unit variance that are independent of each other.
    """
    k, d, c = chain.epoch.size, len(derivatives(slice(0, 1))[0]), event.size
    out = np.zeros((k, d, c + 3 * len(chain.shared)))
    cov = _of_nodes(chain, event, state, derivatives, out[:, :, :c])
    sigma = np.sqrt(np.diagonal(cov))
    correlation = cov / np.outer(sigma, sigma)
    for first, last in pieces_of(k):
        errors, T = out[first:last], derivatives(slice(first, last))
        cross = errors[:, :, :c].reshape(len(errors) * d, c)
        errors[:, :, :c] = _whiten_cross(cross / sigma, correlation).reshape(len(errors), d, c)
        for i, error in enumerate(chain.shared):
            inside = error.within(chain.epoch[first:last])
            size, axes = np.linalg.eigh(error.cov)
            root = axes * np.sqrt(np.maximum(size, 0.0))
            derivative = np.where(inside[:, None, None], T[:, :, error.block], 0.0)
            errors[:, :, c + 3 * i : c + 3 * i + 3] = derivative @ root
    return out


def _of_nodes(
    chain: ChainInParts,
    event: NDArray[np.int64],
    state: NDArray[np.int64],
    derivatives: Callable[[slice], Array],
    cross: Array,
) -> Array:
    """Return cov_s(c), (c, c), by (B.8) from node to event, and fill cov_s(y_k, c), (k, d, c)."""
    c, begin = event.size, np.searchsorted(event, np.arange(chain.epoch.size + 1))
    n, cov = derivatives(slice(0, 1)).shape[2], np.zeros((c, c))
    P, gain, back = np.zeros((c, n)), np.zeros((c, n)), np.zeros((n, c))
    pieces = pieces_of(chain.epoch.size)
    for first, last in pieces[::-1]:
        piece, T = chain.piece(first, last), derivatives(slice(first, last))
        nodes = range(begin[first], begin[last])
        rows = [piece.row_of(int(event[i]) - first, int(state[i])) for i in nodes]
        P[begin[first] : begin[last]], gain[begin[first] : begin[last]] = (
            each[rows] for each in (piece.filtered, piece.gain)
        )
        for j in range(last - 1, first - 1, -1):  # nodes at this event, and later ones
            own, later = slice(begin[j], begin[j + 1]), slice(begin[j], None)
            back[:, own] = gain[own].T
            read = piece.product(T[j - first], piece.filtered, j - first)
            cross[j, :, later] = read @ back[:, later]
            cov[own, later] = P[own] @ back[:, later]
            back[:, later] = piece.transitions[j - first].T @ back[:, later]
    ahead = np.zeros((c, n))
    for first, last in pieces:
        piece, T = chain.piece(first, last), derivatives(slice(first, last))
        for j in range(first, last):  # earlier nodes
            own, earlier = slice(begin[j], begin[j + 1]), slice(0, begin[j])
            ahead[earlier] = ahead[earlier] @ piece.transitions[j - first].T
            read = piece.product(T[j - first], piece.gain, j - first)
            cross[j, :, earlier] = read @ ahead[earlier].T
            ahead[own] = P[own]
    upper = np.triu(cov, 1)
    return upper + upper.T + np.diag(np.diagonal(cov))


def _whiten_cross(cross: Array, cov: Array) -> Array:
    """Return cross L^-T of a covariance L L' with unit diagonal, zeros where it has no digits."""
    for jitter in JITTER:
        try:
            L = np.linalg.cholesky(cov + jitter * np.eye(len(cov)))
        except np.linalg.LinAlgError:
            continue
        return np.asarray(np.linalg.solve(L, cross.T).T)
    return np.zeros_like(cross)
