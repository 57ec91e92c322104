"""The smoothed covariances of a flight: what is kept of them, and where the rest comes from.

Of every epoch the navigation block is kept, of chosen ones the whole matrix, both as lower
triangles; any other whole matrix is worked out again with its block (`BlockAgain`), and so is what
ties many camera events (`ChainAgain`).
"""

from dataclasses import dataclass, replace

import numpy as np

from ...records import Array
from .codes import N_NAV
from .epochs import numbered_within, piece_of_epochs
from .event_chain import EventChain, EventTransitions
from .filter import forward_inputs, history_room, relabel_slots
from .kernels.backward import run_backward
from .kernels.forward import run_forward
from .kernels.records import FilterHistory, FilterState
from .kernels.transitions import event_transitions
from .problem import EstimationProblem, InitialState
from .smoother import (
    EventRows,
    SharedError,
    Smoothed,
    SmootherState,
    copy_state,
    diagonal,
    unpack_triangles,
)

NO_EVENTS = slice(0, 0)  # of a block that is filtered again without its events
COVARIANCES_AT_A_TIME = 4096  # covariances that are unpacked, or turned, at a time


@dataclass(frozen=True)
class BlockAgain:
    """Passes a block of a solved flight again, for the covariance of epochs where it was not kept.

    Parameters
    ----------
    problem : EstimationProblem
        What was solved.
    size : int
        Epochs of a block.
    checkpoints : tuple of FilterState
        The filter before each block.
    adjoints : tuple of SmootherState
        The smoother behind each block.
    nominal : tuple of Array, or None
        (m, 10) and (m, ns) about which the last pass was linearised; None where that was the
        filter's own.
    slot, used, outage : ndarray
        As in `FilterHistory`.
    transitions : EventTransitions or None
        M_k of all events, where the chain of events is kept.
    products : tuple of Array
        Those before each block, since the event before.
    """

    problem: EstimationProblem
    size: int
    checkpoints: tuple[FilterState, ...]
    adjoints: tuple[SmootherState, ...]
    nominal: tuple[Array, Array] | None
    slot: np.ndarray
    used: np.ndarray
    outage: np.ndarray
    transitions: EventTransitions | None
    products: tuple[Array, ...]

    def triangles(self, rows: np.ndarray) -> Array:
        """Return the smoothed covariance of the errors of all states at some epochs.

        Parameters
        ----------
        rows : ndarray
            (k,) the epochs.

        Returns
        -------
        Array
            (k, n (n + 1) / 2) lower triangles.
        """
        n = self.problem.layout.size
        out = np.empty((rows.size, n * (n + 1) // 2))
        block = rows // self.size
        for b in np.unique(block).tolist():
            own = np.flatnonzero(block == b)
            wanted, inverse = np.unique(rows[own], return_inverse=True)
            out[own] = self._of_block(b, wanted)[inverse]
        return out

    @property
    def start(self) -> InitialState:
        """The state at the first epoch, about the nominal of the last pass."""
        first = self.checkpoints[0]
        nav, x = first.nav, first.x
        if self.nominal is not None:
            nav, x = (each[0] for each in self.nominal)
        return InitialState(nav, x, first.m, first.P)

    def records(
        self, b: int, events: slice = NO_EVENTS
    ) -> tuple[FilterHistory, np.ndarray, int, int]:
        """Filter a block again from its checkpoint.

        Parameters
        ----------
        b : int
            The block.
        events : slice
            Camera events that are wanted; none where it is left out.

        Returns
        -------
        history : FilterHistory
            What the filter leaves of its epochs, with that of the epoch before it in front.
        event : ndarray
            The number of the event of each of these epochs, from 0 for the first that is wanted, or
            ABSENT.
        front : int
            The epoch of the first row.
        begin : int
            The first row of the block's own.
        """
        epochs, n = self.problem.epochs, self.problem.layout.size
        first = b * self.size
        last, front = min(first + self.size, epochs.stop.size), max(first - 1, 0)
        block_epochs = piece_of_epochs(epochs, front, last)
        block_epochs = block_epochs._replace(event=numbered_within(block_epochs.event, events))
        outage = relabel_slots(self.outage[front:last])
        count = last - front, n, last - front
        room = history_room(
            *count, self.slot, self.used, outage, last - front, events.stop - events.start
        )
        if self.nominal is not None:
            room.nav[:], room.x[:] = (each[front:last] for each in self.nominal)
        inputs = forward_inputs(self.problem, self.nominal is None)
        run_forward(block_epochs, copy_state(self.checkpoints[b]), room, first - front, *inputs)
        return room, block_epochs.event, front, first - front

    def _of_block(self, b: int, rows: np.ndarray) -> Array:
        """Return the triangles of increasing epochs of a block."""
        room, event, front, begin = self.records(b)
        count, n = room.m.shape
        smoothed = Smoothed.of(count, n, rows - front, EventRows.of(0), 0)
        run_backward(event, room, True, copy_state(self.adjoints[b]), begin, smoothed)
        return smoothed.kept


@dataclass(frozen=True)
class ChainAgain:
    """The chain of more events than are kept: its parts are worked out again.

    Parameters
    ----------
    again : BlockAgain
        Passes the blocks.
    epoch : ndarray
        (events,) epoch of each event.
    read : EventRows
        What is wanted of P_k and of the last factor of (B.8).
    shared : tuple of SharedError
        What was added to the smoothed covariance.
    """

    again: BlockAgain
    epoch: np.ndarray
    read: EventRows
    shared: tuple[SharedError, ...] = ()

    def piece(self, first: int, last: int) -> EventChain:
        """Return the chain of consecutive events, to the bit as it would have been kept.

        Parameters
        ----------
        first, last : int
            The first of them, and the first behind them.

        Returns
        -------
        EventChain
            Whose events count from 0.
        """
        before = max(first - 1, 0)  # M_k begins at the event before
        blocks = (self.epoch[[before, last - 1]] // self.again.size).tolist()
        chain, _ = self._worked_out(before, last, range(blocks[0], blocks[1] + 1))
        return chain.piece(first - before, last - before)

    def whole(self) -> tuple[EventChain, BlockAgain]:
        """Return the chain of all events, to the bit as it would have been kept.

        Returns
        -------
        chain : EventChain
            17 kB an event of 34 states.
        again : BlockAgain
            What passes the blocks again, with the transitions of all events.
        """
        return self._worked_out(0, self.epoch.size, range(len(self.again.checkpoints)))

    def _worked_out(self, first: int, last: int, blocks: range) -> tuple[EventChain, BlockAgain]:
        """Return the chain of the events first..last - 1, whose M_k begin at the first of them, and
        the transitions along the blocks.
        """
        again, events = self.again, slice(first, last)
        n, read = again.problem.layout.size, self.read.piece(first, last)
        transitions = EventTransitions.before(last - first, n, again.used.size)
        rows = Smoothed.of(again.size + 1, n, np.zeros(0, dtype=np.int64), read, 0)
        products = []
        for b in blocks:
            products.append(transitions.product.copy())
            room, event, _, begin = again.records(b, events)
            event_transitions(event, room, begin, transitions)
            piece = rows.piece(0, event.size, slice(0, last - first))
            run_backward(event, room, True, copy_state(again.adjoints[b]), begin, piece)
        kept = transitions.of_events, read, rows.event_filter, rows.event_gain
        chain = EventChain(self.epoch[events], *kept, self.shared)
        return chain, replace(again, transitions=transitions, products=tuple(products))


@dataclass(frozen=True)
class SmoothedCovariances:
    """Smoothed covariances at the m epochs of a solution, or of a part of it.

    Parameters
    ----------
    nav : Array
        (m, 45) lower triangles of the navigation blocks.
    rows : ndarray
        (k,) increasing epochs of the whole solution of which all of it is kept.
    kept : Array
        (k, n (n + 1) / 2) its lower triangles.
    row_sigma : Array
        (k, n) standard deviations of the forward filter at these epochs.
    again : BlockAgain or None
        Works out the others; None where the increments are gone.
    size : int
        Number of states.
    first : int
        Epoch of the whole solution with which a part begins.
    states : ndarray or None
        Rows and columns that are left of the n, all of navigation among them; None for all.
    shared : tuple of SharedError
        Errors that no state describes, added to those of their epochs.
    """

    nav: Array
    rows: np.ndarray
    kept: Array
    row_sigma: Array
    again: BlockAgain | None
    size: int
    first: int = 0
    states: np.ndarray | None = None
    shared: tuple[SharedError, ...] = ()

    @property
    def own_rows(self) -> np.ndarray:
        """The epochs, counted from those of the part, of which all is kept."""
        return (self.rows - self.first)[self._rows_within]

    @property
    def _rows_within(self) -> np.ndarray:
        """Which of `rows` lie in the part."""
        return (self.rows >= self.first) & (self.rows < self.first + len(self.nav))

    @property
    def filter_sigma(self) -> Array:
        """Standard deviations of the errors of all states in the filter at `own_rows`, (k, n)."""
        sigma = self.row_sigma[self._rows_within]
        return sigma if self.states is None else sigma[:, self.states]

    def of_navigation(self, index: np.ndarray | slice) -> Array:
        """Return the covariance of position, velocity and attitude errors.

        Parameters
        ----------
        index : ndarray or slice
            (k,) the epochs.

        Returns
        -------
        Array
            (k, 9, 9) in l.
        """
        epochs = np.arange(len(self.nav))[index]
        out = np.empty((epochs.size, N_NAV, N_NAV))
        for begin in range(0, epochs.size, COVARIANCES_AT_A_TIME):
            rows = slice(begin, begin + COVARIANCES_AT_A_TIME)
            out[rows] = unpack_triangles(self.nav[epochs[rows]])
        self._add_shared(out, epochs)
        return out

    def whole(self, index: np.ndarray, states: np.ndarray | None = None) -> Array:
        """Return the covariance of the errors of all states.

        Parameters
        ----------
        index : ndarray
            (k,) the epochs.
        states : ndarray, optional
            (n,) the rows and columns that are wanted; all where it is left out.

        Returns
        -------
        Array
            (k, n, n) in l.
        """
        epochs = np.arange(len(self.nav))[index]
        if states is not None:
            pieces = np.array_split(epochs, -(-epochs.size // COVARIANCES_AT_A_TIME) or 1)
            of_states = [self.whole(piece)[:, states[:, None], states] for piece in pieces]
            return np.concatenate(of_states)
        out = unpack_triangles(self._triangles(epochs))
        if self.states is not None:
            out = out[:, self.states[:, None], self.states]
        self._add_shared(out, epochs)
        return out

    def variance(self, index: np.ndarray) -> Array:
        """Return the variances of the errors of all states.

        Parameters
        ----------
        index : ndarray
            (k,) the epochs.

        Returns
        -------
        Array
            (k, n) in l.
        """
        epochs = np.arange(len(self.nav))[index]
        out = diagonal(self._triangles(epochs))
        if self.states is not None:
            out = out[:, self.states]
        for error in self.shared:
            out[error.within(epochs + self.first), error.block] += np.diag(error.cov)
        return out

    def variance_of(self, index: np.ndarray, A: Array) -> Array:
        """Return the variances of linear combinations A e of the errors e of all states.

        Parameters
        ----------
        index : ndarray
            (k,) the epochs.
        A : ndarray
            (q, n) the combinations.

        Returns
        -------
        Array
            (k, q), those of the diagonals of A P A', without the matrices P.
        """
        epochs = np.arange(len(self.nav))[index]
        whole = A
        if self.states is not None:
            whole = np.zeros((len(A), self.size))
            whole[:, self.states] = A
        row, column = np.tril_indices(self.size)
        factor = whole[:, row] * whole[:, column] * np.where(row == column, 1.0, 2.0)
        out = np.asarray(self._triangles(epochs) @ factor.T)
        for error in self.shared:
            derivative = A[:, error.block]
            out[error.within(epochs + self.first)] += np.diag(derivative @ error.cov @ derivative.T)
        return out

    def piece(self, first: int, last: int) -> "SmoothedCovariances":
        """Return those of consecutive epochs.

        Parameters
        ----------
        first, last : int
            The first and the last epoch, both included.

        Returns
        -------
        SmoothedCovariances
            Whose epochs count from the first.
        """
        return replace(self, nav=self.nav[first : last + 1], first=self.first + first)

    def without(self, states: np.ndarray) -> "SmoothedCovariances":
        """Return those without some states.

        Parameters
        ----------
        states : ndarray
            Counted from the first of navigation, of which none may go.

        Returns
        -------
        SmoothedCovariances
            The same otherwise.
        """
        chosen = self.states
        if chosen is None:
            chosen = np.arange(self.size)
        return replace(self, states=np.delete(chosen, states))

    def enlarged(self, shared: tuple[SharedError, ...]) -> "SmoothedCovariances":
        """Return those of epochs that share further errors.

        Parameters
        ----------
        shared : tuple of SharedError
            Their epochs are counted as those of these covariances are.

        Returns
        -------
        SmoothedCovariances
            The same otherwise.
        """
        moved = tuple(
            replace(error, first=error.first + self.first, last=error.last + self.first)
            for error in shared
        )
        return replace(self, shared=(*self.shared, *moved))

    def _triangles(self, epochs: np.ndarray) -> Array:
        """Return lower triangles, (k, n (n + 1) / 2), kept or worked out again."""
        wanted = epochs + self.first
        slot = np.searchsorted(self.rows, wanted)
        kept = np.zeros(wanted.size, dtype=np.bool_)
        inside = slot < self.rows.size
        kept[inside] = self.rows[slot[inside]] == wanted[inside]
        if kept.all():
            return self.kept[slot]
        if self.again is None:
            raise ValueError(
                "the increments were not kept, so covariances exist only at Solution.rows"
            )
        out = np.empty((wanted.size, self.kept.shape[1]))
        out[kept] = self.kept[slot[kept]]
        out[~kept] = self.again.triangles(wanted[~kept])
        return out

    def _add_shared(self, cov: Array, epochs: np.ndarray) -> None:
        """Add what no state describes to covariances (k, n, n) of some epochs, in slot."""
        for error in self.shared:
            cov[error.within(epochs + self.first), error.block, error.block] += error.cov
