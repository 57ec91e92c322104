"""Filter and smoother block by block, so that memory does not grow with what they hand each other.

The backward pass needs of every epoch what the forward pass worked out there: P, F, H and K, 13 kB
of 34 states, and nothing of it is wanted afterwards. A flight is therefore divided into blocks of
`EPOCHS_OF_BLOCK` epochs. The forward pass keeps where it stood before each block (a checkpoint:
nominal, mean, P), and the records of one block at a time. The backward pass goes from the last
block to the first; each is filtered once more from its checkpoint, which gives the same records to
the last bit, since the filter sees nothing else. Of short flights, which are often solved again and
again while a model is looked for, all records are kept.

    memory   m / EPOCHS_OF_BLOCK checkpoints, and the records of one block
    work     a short flight: nothing more; a long one: one forward pass more

That pass costs no more than its absence would. The records of a block lie in the processor's cache,
where both passes find them; to write those of a whole flight to memory and to read them back takes
13 microseconds an epoch, to filter it again 11. Nor is it done beside the backward pass over the
block behind it: two passes at once, on two cores of one processor, were as long in all.

What stays of every epoch are nominal, innovations and the navigation block of the smoothed
covariance, some 1 kB. The whole covariance is kept at chosen epochs, packed. Where another one is
asked for later, its block is passed again, from the checkpoint of the filter forwards and from that
of the smoother backwards (`BlockAgain`): some ten milliseconds. So is what ties the camera events
where these are many (`ChainAgain`).
"""

from collections.abc import Callable, Iterator

import numpy as np

from ...base.advance import through
from ...records import Array
from .codes import ABSENT, N_NAV
from .covariances import BlockAgain, ChainAgain
from .epochs import numbered_within, piece_of_epochs
from .event_chain import CHAIN_BYTES, EventChain, EventTransitions, event_bytes, events_of, nodes_of
from .filter import (
    first_state,
    forward_inputs,
    make_history,
    measured_slots,
    outages,
    refuse_divergence,
    relabel_slots,
)
from .kernels.backward import run_backward
from .kernels.blas import link_blas
from .kernels.forward import run_forward
from .kernels.records import (
    Epochs,
    FilterHistory,
    FilterState,
    IntegrationIntervals,
)
from .kernels.transitions import event_transitions
from .problem import EstimationProblem, InitialState
from .smoother import EventRows, Smoothed, SmootherState, copy_state

EPOCHS_OF_BLOCK = 256  # epochs
WHOLE_BYTES = 128_000_000  # records of a flight up to which all of them are kept
# regular epochs of which the whole covariance is kept; what a report can show
MOST_COVARIANCE_ROWS = 4000

RECORDS = ("m", "P", "F", "D", "H", "K", "W", "Qbb")

Follower = Callable[[IntegrationIntervals, Epochs, FilterHistory, int], None]
"""Called after each block of a forward pass with the increments of the flight, epochs and records
of the block, and the first epoch of it that was passed.
"""


def record_bytes(n: int, rows_measured: int, outages: bool) -> int:
    """Return the bytes that an epoch leaves for the smoother.

    Parameters
    ----------
    n : int
        States.
    rows_measured : int
        Rows of the triples that the flight measures.
    outages : bool
        Whether the process noise is kept too.

    Returns
    -------
    int
        Of m, P, F, D, H, K and, with outages, W and Qbb.
    """
    of_noise = N_NAV * n + n if outages else 0
    return 8 * (n * n + (N_NAV + 2) * n + 2 * rows_measured * n + of_noise)


class BlockwisePasses:
    """The passes over a flight, which use the same room again and again.

    Parameters
    ----------
    problem : EstimationProblem
        What is measured, and how.
    start : InitialState
        The state at the first epoch.
    rows : ndarray
        (k,) increasing epochs of which the whole smoothed covariance is wanted.
    separations : int or ndarray
        Number of epochs at which the forward/backward separation is worked out, or which.
    block : int
        Epochs of a block.
    whole_bytes : int
        What records may take where all of them are kept.
    """

    def __init__(
        self,
        problem: EstimationProblem,
        start: InitialState,
        rows: np.ndarray,
        separations: int | np.ndarray,
        block: int | None = None,
        whole_bytes: int | None = None,
    ) -> None:
        link_blas()
        whole_bytes = WHOLE_BYTES if whole_bytes is None else whole_bytes
        self.problem, self.start, self.rows, self.separations = problem, start, rows, separations
        epochs, layout = problem.epochs, problem.layout
        m = epochs.stop.size
        self.size = block or EPOCHS_OF_BLOCK
        self.first = np.arange(0, m, self.size)
        self.outages = bool((outages(epochs) != ABSENT).any())
        each = record_bytes(layout.size, measured_slots(epochs, layout)[1].size, self.outages)
        self.whole = m * each <= whole_bytes  # whether all records are kept
        # the row in front of a block is that of the epoch before it
        room = (m if self.whole else min(self.size, m)) + 1
        self.exposed = events_of(epochs)
        self.history = make_history(epochs, layout, records=room)
        self.held = ABSENT  # the block whose records are there, where not all of them are
        self.checkpoints: list[FilterState] = []
        self.adjoints: list[SmootherState] = []
        self.transitions: EventTransitions | None = None
        self.products: list[Array] = []  # of the transitions, before each block
        self.closed_loop = True
        self.read = EventRows.of(self.exposed.size)
        if problem.event_chain and keeps_events(problem):
            self.read = _event_rows(problem)
        self.row_sigma = np.empty((rows.size, layout.size))  # of the filter, at `rows`

    def _blocks(self) -> Iterator[tuple[int, int, int]]:
        """Yield number, first and end of the blocks."""
        m = self.problem.epochs.stop.size
        for b, first in enumerate(self.first.tolist()):
            yield b, first, min(first + self.size, m)

    def _of_block_views(
        self, b: int, first: int, last: int
    ) -> tuple[Epochs, FilterHistory, int, slice]:
        """Return epochs and room of a block, with the epoch before it in front, its begin, and its
        events, which count from 0 in it.
        """
        front = max(first - 1, 0)
        row = (b * self.size if self.whole else 0) + 1 - (first - front)
        history = _piece_of_history(self.history, front, last, row, self.outages)
        events = slice(*np.searchsorted(self.exposed, (first, last)).tolist())
        count = events.stop - events.start
        cross = history.cross[events] if self.whole else history.cross[:count]
        epochs = piece_of_epochs(self.problem.epochs, front, last)
        return (
            epochs._replace(event=numbered_within(epochs.event, events)),
            history._replace(cross=cross),
            first - front,
            events,
        )

    def filter(self, closed_loop: bool = True, follower: Follower | None = None) -> None:
        """Run the forward pass.

        Parameters
        ----------
        closed_loop : bool
            Feed the error estimate back into the nominal state (K.5); else the nominal of the
            history stays and is linearised about.
        follower : Follower, optional
            What goes along with it, block by block.

        Raises
        ------
        DataError
            Where the solution does not follow the fixes.
        """
        problem, history = self.problem, self.history
        state = first_state(problem, self.start, history, closed_loop)
        inputs = forward_inputs(problem, closed_loop)
        self.closed_loop, self.checkpoints = closed_loop, []
        self.products = []
        if self.read.state.size and problem.linearised:
            size = self.exposed.size, problem.layout.size, history.used.size
            self.transitions = EventTransitions.before(*size)
        unread = self.transitions is None and follower is None
        for b, first, last in through(list(self._blocks())):
            self.checkpoints.append(copy_state(state))
            if self.transitions is not None:
                self.products.append(self.transitions.product.copy())
            epochs, records, begin, events = self._of_block_views(b, first, last)
            if unread and not self.whole and last < problem.epochs.stop.size:
                records = _unread(records)
            run_forward(epochs, state, records, begin, *inputs)
            if self.transitions is not None:
                transitions = self.transitions._replace(
                    of_events=self.transitions.of_events[events]
                )
                event_transitions(epochs.event, records, begin, transitions)
            if follower is not None:
                follower(inputs[0], epochs, records, begin)
        self.held = self.first.size - 1
        refuse_divergence(problem, history)

    def smooth(self, full: bool = True) -> Smoothed:
        """Run the backward pass over what the last forward pass left.

        Parameters
        ----------
        full : bool
            Whether covariances, cross-covariances of events and separations are wanted.

        Returns
        -------
        Smoothed
            The smoothed errors.
        """
        problem = self.problem
        m, n = problem.epochs.stop.size, problem.layout.size
        smoothed = Smoothed.of(m, n, self.rows, self.read, self.separations, full)
        inputs = forward_inputs(problem, self.closed_loop)
        state, unset = SmootherState.last(n), SmootherState.last(n)
        self.adjoints = []
        for b, first, last in through(list(self._blocks())[::-1]):
            epochs, records, begin, events = self._of_block_views(b, first, last)
            if not (self.whole or self.held == b):
                run_forward(epochs, copy_state(self.checkpoints[b]), records, begin, *inputs)
                self.held = b
            self._keep_sigma(records.P[begin:], first, last)
            self.adjoints.append(_adjoint(state, unset))
            piece = smoothed.piece(first - begin, last, events)
            run_backward(epochs.event, records, full, state, begin, piece)
        self.adjoints.reverse()
        return smoothed

    def _keep_sigma(self, P: Array, first: int, last: int) -> None:
        """Keep the filter's sigmas at the rows among epochs first..last - 1 with covariances P."""
        begin, end = np.searchsorted(self.rows, (first, last))
        variance = np.diagonal(P, axis1=1, axis2=2)[self.rows[begin:end] - first]
        self.row_sigma[begin:end] = np.sqrt(variance)

    def chain(
        self, smoothed: Smoothed, again: BlockAgain | None = None
    ) -> EventChain | ChainAgain | None:
        """Return what ties the events, where the problem asks for it.

        Parameters
        ----------
        smoothed : Smoothed
            What the backward pass gave.
        again : BlockAgain, optional
            What passes blocks again; made here where it is left out.

        Returns
        -------
        EventChain, ChainAgain or None
            The second of more events than are kept; None where the problem does not ask for it.
        """
        if not (self.problem.event_chain and self.exposed.size):
            return None
        if self.transitions is None:
            return ChainAgain(again or self.again(), self.exposed, _event_rows(self.problem))
        kept = smoothed.read, smoothed.event_filter, smoothed.event_gain
        return EventChain(self.exposed, self.transitions.of_events, *kept)

    def again(self) -> BlockAgain:
        """Return what passes any block again, when the records are gone."""
        h = self.history
        nominal = None if self.closed_loop else (h.nav.copy(), h.x.copy())
        return BlockAgain(
            self.problem,
            self.size,
            tuple(self.checkpoints),
            tuple(self.adjoints),
            nominal,
            h.slot,
            h.used,
            h.outage,
            self.transitions,
            tuple(self.products),
        )


def keeps_events(problem: EstimationProblem) -> bool:
    """Return whether chain and whole covariances of the camera events are kept.

    Parameters
    ----------
    problem : EstimationProblem
        The problem.

    Returns
    -------
    bool
        Whether they take `event_chain.CHAIN_BYTES` at most.
    """
    events = np.count_nonzero(problem.epochs.event != ABSENT)
    return int(events) * event_bytes(problem.layout) <= CHAIN_BYTES


def _event_rows(problem: EstimationProblem) -> EventRows:
    """Return what the covariance between any two camera events reads of the passes."""
    exposed, layout = events_of(problem.epochs), problem.layout
    nodes = nodes_of(layout, problem.epochs.time[exposed])
    return EventRows.of(exposed.size, layout.read_of_events, nodes)


def _adjoint(state: SmootherState, unset: SmootherState) -> SmootherState:
    """Return a copy of a state; what is not set of it is that of `unset`, which all share."""
    if state.within[0]:
        return copy_state(state)
    return unset._replace(adjoint=state.adjoint.copy(), information=state.information.copy())


def _piece_of_history(
    history: FilterHistory, front: int, last: int, row: int, outages: bool
) -> FilterHistory:
    """Return the room of the epochs front..last - 1, as views.

    Parameters
    ----------
    history : FilterHistory
        The room of the flight.
    front, last : int
        The epochs.
    row : int
        The row of the records that is that of epoch `front`.
    outages : bool
        Whether the process noise has rows like the other records.

    Returns
    -------
    FilterHistory
        Arrays of last - front epochs.
    """
    count, whole = last - front, {"slot", "used", "cross"}
    if not outages:
        whole |= {"W", "Qbb"}
    parts = {
        name: each[row : row + count] if name in RECORDS else each[front:last]
        for name, each in zip(history._fields, history, strict=True)
        if name not in whole
    }
    parts["outage"] = relabel_slots(parts["outage"])
    return history._replace(**parts)


def _unread(history: FilterHistory) -> FilterHistory:
    """Return room of a single row of what nobody reads: it stays in the cache."""
    return history._replace(
        **{name: getattr(history, name)[:1] for name in RECORDS if name not in {"W", "Qbb"}}
    )
