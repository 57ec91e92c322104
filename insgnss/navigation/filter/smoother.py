"""Fixed-interval smoother with full covariance: modified Bryson-Frazier.

It gives the same means and covariances as the Rauch-Tung-Striebel recursion, x_s = x + G (x_s' -
x'), without its n x n inverse at every epoch, and it needs no invertible covariance (a constant
bias has no process noise). With the adjoint lambda and its covariance Lambda after epoch k (both
zero after the last), x, P the filter's result after the update at k:

    x_s = x + P lambda,      P_s = P - P Lambda P                                             (B.1)
    through a scalar update: lambda <- lambda + h' (nu / S - k' lambda)                       (B.2)
                             Lambda <- (1 - k h)' Lambda (1 - k h) + h' h / S                 (B.3)
    to the epoch before:     lambda <- Phi' lambda,   Lambda <- Phi' Lambda Phi               (B.4)

Lambda is the inverse of the covariance of the difference between what the later data say of the
state and what the earlier data say, and Lambda^-1 lambda is that difference: the forward/backward
separation with its covariance comes at no cost.

The covariance between the errors at an event j and at the next event k > j: the filter tracks C =
cov(x_j, x_k) given the data up to k (C <- C Phi', C <- C (1 - k h)'); the later data see x_k only,
hence

    cov_s(x_j, x_k) = C - C Lambda_k P_k                                                      (B.5)

Through an outage the filter's variance grows until nearly all of it goes again with the next fix:
P - P Lambda P is the difference of two large numbers, and after two minutes on a MEMS IMU a
millimetre is 1e-10 of them. There, where less than `kernels.backward.CANCELLED` of a variance
stays, the covariance is that of Rauch, Tung and Striebel, as a sum of squares that has nothing to
lose, and with it that of events:

    C = P Phi' (Phi P Phi' + Q)^-1
    P_s = (1 - C Phi) P (1 - C Phi)' + C (Q + P_s') C'                                        (B.6)
    cov_s(x_j, x_k) = cov(x_j, x_k) P_k^-1 P_s,k                                              (B.7)

Between any two events j < k, not neighbours alone, the errors of all n states are followed: M_k,
the product of (1 - k h) and Phi over the epochs after event k - 1 up to event k, takes x_k-1 to
x_k, and what the later data add stands on the right as in (B.5), or (B.7) within an outage,

    cov_s(x_j, x_k) = P_j M_j+1' ... M_k' (1 - Lambda_k P_k)                                  (B.8)

(`event_chain`). The chain of neighbours' blocks of (B.5) is none of it: position, velocity and psi
alone are no Markov process beside biases and errors of the fixes.

The means keep (B.1), whose terms are far smaller. `filter.OUTAGE_S` says between which fixes the
process noise Q is kept for it.

Bierman (1973) "Fixed interval smoothing with discrete measurements"; Fraser and Potter (1969) for
the two-filter view.
"""

from dataclasses import dataclass, field
from typing import NamedTuple, TypeVar

import numpy as np
from numpy.typing import NDArray

from ...records import Array
from .codes import ABSENT, N_NAV, NAV, POS
from .kernels.records import FilterState

TINY = 1e-300  # keeps a division by zero away
# relative eigenvalue of the information from which on a direction is determined
LEAST_EIGENVALUE = 1e-10
# squared share of a state in directions that are not, above which it is not
MOST_UNDETERMINED_SHARE = 1e-6


@dataclass(frozen=True)
class SharedError:
    """An error of navigation that epochs share and no state describes.

    Parameters
    ----------
    first, last : int
        Epochs, the last one included.
    cov : Array
        (3, 3) covariance in l: m^2 of positions, rad^2 of attitudes.
    block : slice
        The states of navigation that it is of, POS or PSI of `navigation.filter.codes`.
    """

    first: int
    last: int
    cov: Array
    block: slice = field(default_factory=lambda: POS)

    def within(self, epoch: np.ndarray) -> NDArray[np.bool_]:
        """Return which epochs share it.

        Parameters
        ----------
        epoch : ndarray
            (k,) epochs, counted as `first` and `last`.

        Returns
        -------
        ndarray
            (k,) bool.
        """
        return np.asarray((epoch >= self.first) & (epoch <= self.last))


class SmootherState(NamedTuple):
    """The smoother between two epochs.

    Parameters
    ----------
    adjoint : ndarray
        (n,) lambda of (B.1).
    information : ndarray
        (n, n) Lambda.
    within : ndarray
        (1,) int, whether the interval up to the epoch after lies within an outage; only then the
        rest is set.
    later : ndarray
        (n, n) smoothed covariance at the epoch after.
    F, D, W, Qbb : ndarray
        Transition and process noise up to it, as in `FilterHistory`.
    """

    adjoint: np.ndarray
    information: np.ndarray
    within: np.ndarray
    later: np.ndarray
    F: np.ndarray
    D: np.ndarray
    W: np.ndarray
    Qbb: np.ndarray

    @classmethod
    def last(cls, n: int) -> "SmootherState":
        """Return the smoother at the end of a flight, where no data are to come.

        Parameters
        ----------
        n : int
            Number of states.

        Returns
        -------
        SmootherState
            All zero.
        """
        ns = n - N_NAV
        return cls(
            np.zeros(n),
            np.zeros((n, n)),
            np.zeros(1, dtype=np.int64),
            np.zeros((n, n)),
            np.zeros((N_NAV, n)),
            np.zeros(ns),
            np.zeros((N_NAV, n)),
            np.zeros(ns),
        )


NO_STATES = np.zeros(0, dtype=np.int64)  # where the covariance between events is not wanted


class EventRows(NamedTuple):
    """The states of which the rows of P_k, and columns of the last factor of (B.8), are kept.

    Parameters
    ----------
    begin : ndarray
        (events + 1,) the first row of each event.
    state : ndarray
        (rows,) the state of each.
    common : int
        Number of states that lead at every event, the same at all.
    """

    begin: np.ndarray
    state: np.ndarray
    common: int

    @classmethod
    def of(
        cls,
        events: int,
        common: np.ndarray = NO_STATES,
        nodes: tuple[np.ndarray, np.ndarray] | None = None,
    ) -> "EventRows":
        """Return rows of some states at all events, and of others at a few.

        Parameters
        ----------
        events : int
            Camera events.
        common : ndarray
            States that are kept at all of them; none where it is left out.
        nodes : tuple of ndarray, optional
            (c,) event and (c,) state of what is kept besides.

        Returns
        -------
        EventRows
            Event after event.
        """
        event, state = np.repeat(np.arange(events), common.size), np.tile(common, events)
        if nodes is not None:
            event, state = np.concatenate([event, nodes[0]]), np.concatenate([state, nodes[1]])
        order = np.argsort(event, kind="stable")
        begin = np.searchsorted(event[order], np.arange(events + 1))
        return cls(begin, state[order], common.size)

    def piece(self, first: int, last: int) -> "EventRows":
        """Return the rows of consecutive events.

        Parameters
        ----------
        first, last : int
            The first of them, and the first behind them.

        Returns
        -------
        EventRows
            Of events that count from 0.
        """
        begin = self.begin[first : last + 1]
        return EventRows(begin - begin[0], self.state[begin[0] : begin[-1]], self.common)


class Smoothed(NamedTuple):
    """What the backward pass gives at the m epochs: room that `kernels.backward` fills in place.

    Parameters
    ----------
    delta : Array
        (m, n) smoothed error estimate about the nominal of the history.
    nav_cov : Array
        (m, 45) lower triangle of the smoothed covariance of the navigation errors, row by row, of a
        full run only (else without rows).
    slot : ndarray
        (m,) the slot that takes the whole covariance of an epoch, or ABSENT.
    kept : Array
        (slots, n (n + 1) / 2) its lower triangle, row by row.
    event_cross : Array
        (events, 9, 9) covariance of the navigation errors of the event before with those of this
        one (of the first: zero).
    read : EventRows
        The rows of the following.
    event_filter, event_gain : Array
        (rows, n) of the covariance P_k of the filter, post, and columns of what later data make of
        it on its right, 1 - Lambda P or P^-1 P_s, the last factor of (B.8).
    keep : ndarray
        (m,) the slot that takes lambda and Lambda of the epoch, where the forward/backward
        separation is wanted, or ABSENT.
    information, adjoint : Array
        (slots, n, n) Lambda and (slots, n) lambda there, of the data behind the epoch.
    """

    delta: Array
    nav_cov: Array
    slot: np.ndarray
    kept: Array
    event_cross: Array
    read: EventRows
    event_filter: Array
    event_gain: Array
    keep: np.ndarray
    information: Array
    adjoint: Array

    @classmethod
    def of(
        cls,
        m: int,
        n: int,
        rows: np.ndarray,
        read: EventRows,
        separations: int | np.ndarray,
        full: bool = True,
    ) -> "Smoothed":
        """Return room for m epochs of n states.

        Parameters
        ----------
        m, n : int
            Epochs and states.
        rows : ndarray
            (k,) epochs of which the whole covariance is wanted.
        read : EventRows
            What the covariance between any two camera events takes (B.8).
        separations : int or ndarray
            Number of epochs at which the forward/backward separation is worked out, or which.
        full : bool
            Whether there are covariances at all.

        Returns
        -------
        Smoothed
            Arrays.
        """
        chosen = np.zeros(0, dtype=np.int64)
        if full and isinstance(separations, np.ndarray):
            chosen = separations
        elif full and separations:
            chosen = np.unique(np.linspace(1, max(m - 2, 1), min(separations, m)).astype(np.int64))
        rows, read_rows = (rows, read.state.size) if full else (rows[:0], 0)
        return cls(
            np.empty((m, n)),
            np.empty((m if full else 0, N_NAV * (N_NAV + 1) // 2)),
            number_rows(m, rows),
            np.empty((rows.size, n * (n + 1) // 2)),
            np.zeros((read.begin.size - 1, N_NAV, N_NAV)),
            read,
            np.empty((read_rows, n)),
            np.empty((read_rows, n)),
            number_rows(m, chosen),
            np.zeros((chosen.size, n, n)),
            np.zeros((chosen.size, n)),
        )

    @property
    def rows(self) -> np.ndarray:
        """The epochs (k,) of which the whole covariance is kept."""
        return np.flatnonzero(self.slot != ABSENT)

    @property
    def P(self) -> Array | None:
        """Smoothed covariance (k, n, n) at `rows`; None after a run without covariances."""
        return unpack_triangles(self.kept) if self.rows.size else None

    @property
    def separation_epoch(self) -> np.ndarray:
        """The epochs (s,) at which the forward/backward separation was worked out."""
        return np.flatnonzero(self.keep != ABSENT)

    def piece(self, first: int, last: int, events: slice) -> "Smoothed":
        """Return the room of some consecutive epochs.

        Parameters
        ----------
        first, last : int
            The first of them, and the first behind them.
        events : slice
            The events among them, which count from 0 in the piece.

        Returns
        -------
        Smoothed
            Views; what is neither by epochs nor by events is the whole.
        """
        rows, begin = slice(first, last), self.read.begin
        return self._replace(
            delta=self.delta[rows],
            nav_cov=self.nav_cov[rows],
            slot=self.slot[rows],
            keep=self.keep[rows],
            event_cross=self.event_cross[events],
            read=self.read._replace(begin=begin[events.start : events.stop + 1]),
        )

    def separations(self) -> tuple[Array, Array]:
        """Return backward minus forward of the navigation states, and its standard deviation.

        Returns
        -------
        separation, sigma : Array
            (s, 9) at `separation_epoch`; NaN where the later data do not determine it.
        """
        scale = np.sqrt(np.maximum(np.diagonal(self.information, axis1=1, axis2=2), TINY))
        w, V = np.linalg.eigh(self.information / (scale[:, :, None] * scale[:, None, :]))
        observable = w > LEAST_EIGENVALUE
        inverse_w = np.where(observable, 1.0 / np.where(observable, w, 1.0), 0.0)
        inverse = (V * inverse_w[:, None, :]) @ np.swapaxes(V, -1, -2)
        value = np.einsum("sij,sj->si", inverse, self.adjoint / scale) / scale
        sigma = np.sqrt(np.maximum(np.diagonal(inverse, axis1=1, axis2=2), 0.0)) / scale
        determined = (
            np.sum(np.where(observable[:, None, :], 0.0, V**2), axis=2) < MOST_UNDETERMINED_SHARE
        )
        return np.where(determined, value, np.nan)[:, NAV], np.where(determined, sigma, np.nan)[
            :, NAV
        ]


def number_rows(m: int, rows: np.ndarray) -> np.ndarray:
    """Return the number of each epoch among some of them.

    Parameters
    ----------
    m : int
        Epochs.
    rows : ndarray
        (k,) increasing epochs.

    Returns
    -------
    ndarray
        (m,) 0..k - 1, or ABSENT.
    """
    out = np.full(m, ABSENT, dtype=np.int64)
    out[rows] = np.arange(rows.size)
    return out


def unpack_triangles(triangle: Array) -> Array:
    """Return symmetric matrices.

    Parameters
    ----------
    triangle : Array
        (k, n (n + 1) / 2) their lower triangles, row by row.

    Returns
    -------
    Array
        (k, n, n).
    """
    n = _size_of(triangle)
    row, column = np.tril_indices(n)
    slot = np.empty((n, n), dtype=np.int64)
    slot[row, column] = slot[column, row] = np.arange(row.size)
    return triangle[:, slot]


def diagonal(triangle: Array) -> Array:
    """Return the diagonals (k, n) of symmetric matrices.

    Parameters
    ----------
    triangle : Array
        (k, n (n + 1) / 2) their lower triangles, row by row.

    Returns
    -------
    Array
        (k, n).
    """
    return triangle[:, np.cumsum(np.arange(1, _size_of(triangle) + 1)) - 1]


def _size_of(triangle: Array) -> int:
    """Return n of lower triangles (k, n (n + 1) / 2)."""
    return int(np.sqrt(2 * triangle.shape[1]))


State = TypeVar("State", FilterState, "SmootherState")


def copy_state(state: State) -> State:
    """Return a state with arrays of its own.

    Parameters
    ----------
    state : FilterState or SmootherState
        The state.

    Returns
    -------
    FilterState or SmootherState
        A copy.
    """
    return type(state)(*(each.copy() for each in state))
