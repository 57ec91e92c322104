"""The smoothed covariances of a flight: what is kept of them, and where the rest comes from.

Of every epoch the navigation block is kept, of chosen ones the whole matrix, both as lower
triangles; any other whole matrix is worked out again with its block (`navigation.filter.blocks`).
"""

from dataclasses import dataclass, replace

import numpy as np

from ...records import Array
from .blocks import BlockAgain
from .codes import N_NAV
from .smoother import SharedError, diagonal, unpacked

COVARIANCES_AT_A_TIME = 4096  # covariances that are unpacked, or turned, at a time


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
            out[rows] = unpacked(self.nav[epochs[rows]])
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
        out = unpacked(self._triangles(epochs))
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
                "the increments were not kept: covariances exist only at Solution.rows"
            )
        out = np.empty((wanted.size, self.kept.shape[1]))
        out[kept] = self.kept[slot[kept]]
        out[~kept] = self.again.triangles(wanted[~kept])
        return out

    def _add_shared(self, cov: Array, epochs: np.ndarray) -> None:
        """Add what no state describes to covariances (k, n, n) of some epochs, in slot."""
        for error in self.shared:
            cov[error.within(epochs + self.first), error.block, error.block] += error.cov
