"""Symmetric matrices of which only an envelope is stored: Cholesky factor, solution, inverse.

Images along a corridor have points in common with their neighbours only. When the images stand in
such an order, the normal matrix is zero far from its diagonal, but for the columns of what all
images share: cameras, mounting, strips. These come last, as a border. The columns before it, the
window, are cut into panels; that of the columns j_0 to j_1 holds the rows j_0 to e, beyond which
nothing stands below these columns, and the rows of the border:

                    j_0  j_1      e       window   border
    columns j_0     [L_11                                ]
         to j_1     [L_21 ........        0        ......]

Factorisation, S = L L^T, takes one panel after the other; what it leaves of later columns,
-L_21 L_21^T, is a dense matrix over the rows of one panel, the front. Within the same envelope
stand all entries of S^-1 that are needed: those of images that share a point or a group, and of all
unknowns with the border. From the last panel to the first, with G = L_21 L_11^-1 (Takahashi et al.
1973, by blocks)

    Z_21 = -Z_22 G,    Z_11 = L_11^-T L_11^-1 - G^T Z_21                                  (J.11)

where Z_22, S^-1 over the rows of L_21, is known by then. A dense matrix is a border without window,
and its factorisation and inverse are LAPACK's. Which of them costs less is predicted from the
sizes of the panels (`envelope_of`).

Source: George and Liu (1981), Computer Solution of Large Sparse Positive Definite Systems, 4 and 5.
"""

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from ...base.errors import UsageError
from ...records.block import Array
from .kernels.elimination import EntryPlaces, add_between, take_between

Rows = NDArray[np.int64]

PANELS = (4, 8, 16, 32, 64)
"""Images in a panel, of which the cheapest number is taken."""
COPY, PANEL = 32.0, 1e6
"""What copying one entry of a front and taking up one panel cost, in floating-point operations."""


@dataclass(frozen=True, eq=False)
class Envelope:
    """What is stored of a symmetric matrix, and where.

    Parameters
    ----------
    size : int
        Columns.
    panels : ndarray of int
        (p, 3) first column, column after the last, row after the last of the window, of each panel;
        the last one is the border.
    """

    size: int
    panels: Rows

    @property
    def window(self) -> int:
        """Number of columns before the border."""
        return int(self.panels[-1, 0])

    @cached_property
    def starts(self) -> Rows:
        """(p + 1,) where each panel starts, and how many numbers are stored."""
        width = self.panels[:, 1] - self.panels[:, 0]
        height = self.panels[:, 2] - self.panels[:, 0] + self.size - self.window
        return np.concatenate([[0], np.cumsum(width * height)]).astype(np.int64)

    @cached_property
    def places(self) -> EntryPlaces:
        """Where entries stand, as the kernels take it."""
        first, stop, last = self.panels.T
        panel = np.repeat(np.arange(len(self.panels)), stop - first)
        column = np.arange(self.size) - first[panel]
        height = (last - first)[panel] + self.size - self.window
        inner = self.starts[panel] + column * height - first[panel]
        return EntryPlaces(self.window, inner, inner + last[panel] - self.window)

    @cached_property
    def end(self) -> Rows:
        """(u,) row after the last of the window that each column holds."""
        return np.repeat(self.panels[:, 2], self.panels[:, 1] - self.panels[:, 0])

    def rows(self, k: int) -> Rows:
        """Return the rows of a panel.

        Parameters
        ----------
        k : int
            The panel.

        Returns
        -------
        ndarray of int
            Rows of the matrix.
        """
        first, _, last = self.panels[k]
        return np.concatenate([np.arange(first, last), np.arange(self.window, self.size)])

    def panel(self, stored: Array, k: int) -> Array:
        """Return a panel as a matrix, columns first.

        Parameters
        ----------
        stored : ndarray
            The matrix.
        k : int
            The panel.

        Returns
        -------
        ndarray, (rows, columns)
            A view.
        """
        first, stop, last = (int(x) for x in self.panels[k])
        shape = (last - first + self.size - self.window, stop - first)
        return stored[self.starts[k] : self.starts[k + 1]].reshape(shape, order="F")

    def holds(self, columns: Rows) -> bool:
        """Tell whether all entries between some columns are stored.

        Parameters
        ----------
        columns : ndarray of int
            The columns.

        Returns
        -------
        bool
            Whether they are.
        """
        inside = columns[columns < self.window]
        return not inside.size or bool(inside.max() < self.end[inside.min()])

    def _check(self, columns: Rows) -> None:
        if not self.holds(columns):
            raise UsageError("Envelope: these columns have entries that are not stored")

    def add(self, stored: Array, columns: Rows, N: Array) -> None:
        """Add a symmetric matrix between some columns.

        Parameters
        ----------
        stored : ndarray
            The matrix that is added to.
        columns : ndarray of int
            (n,) columns, each once.
        N : ndarray, (n, n)
            What is added.
        """
        self._check(columns)
        add_between(self.places, columns, N, stored)

    def entries(self, stored: Array, columns: Rows) -> Array:
        """Return the entries between some columns.

        Parameters
        ----------
        stored : ndarray
            The matrix.
        columns : ndarray of int
            (n,) columns.

        Returns
        -------
        ndarray, (n, n)
            The entries.

        Raises
        ------
        UsageError
            Some are not stored.
        """
        self._check(columns)
        out = np.empty((len(columns),) * 2)
        take_between(self.places, columns, stored, out)
        return out

    def diagonal(self, stored: Array) -> Array:
        """Return the diagonal.

        Parameters
        ----------
        stored : ndarray
            The matrix.

        Returns
        -------
        ndarray, (u,)
            The diagonal.
        """
        k = np.arange(self.size)
        return stored[k + np.where(k < self.window, self.places.inner, self.places.outer)]


def dense(size: int) -> Envelope:
    """Return the envelope of a dense matrix.

    Parameters
    ----------
    size : int
        Columns.

    Returns
    -------
    Envelope
        One panel.
    """
    return Envelope(size, np.array([[0, size, 0]], dtype=np.int64))


def envelope_of(size: int, reach: Rows) -> tuple[Envelope, float]:
    """Return the envelope that costs least, of a dense matrix if that does.

    Parameters
    ----------
    size : int
        Columns; the first six for each image.
    reach : ndarray of int
        (n,) last image that has something in common with each image, in their order.

    Returns
    -------
    envelope : Envelope
        What to store.
    operations : float
        What a factorisation costs, in floating-point operations.
    """
    n = len(reach)
    best, least = dense(size), size**3 / 3.0 + PANEL
    for images in PANELS:
        first = np.arange(0, n, images)
        stop = np.minimum(first + images, n)
        # images of a panel, and those that reach beyond them from before
        last = np.maximum.accumulate(np.maximum.reduceat(reach, first) + 1) if n else first
        border = np.array([[6 * n, size, 6 * n]])
        panels = np.vstack([6 * np.column_stack([first, stop, last]), border])
        width = (panels[:, 1] - panels[:, 0]).astype(np.float64)
        below = panels[:, 2] - panels[:, 1] + float(size - 6 * n)
        below[-1] = 0.0
        work = width**3 / 3.0 + below * width**2 + below**2 * width + COPY * below**2 + PANEL
        if work.sum() < least:
            best, least = Envelope(size, panels.astype(np.int64)), float(work.sum())
    return best, least


@dataclass(frozen=True, eq=False)
class Factor:
    """Cholesky factor of a scaled matrix, D S D + lambda I = L L^T.

    Parameters
    ----------
    envelope : Envelope
        What is stored.
    stored : ndarray
        L, above its diagonal whatever.
    scale : ndarray, (u,)
        D; zero of a column that is left out, which then is that of a unit matrix.
    """

    envelope: Envelope
    stored: Array
    scale: Array

    def solved(self, right: Array, scaled: bool = False) -> Array:
        """Solve a system of equations.

        Parameters
        ----------
        right : ndarray, (u,) or (u, m)
            Right-hand sides.
        scaled : bool
            Whether the scaled matrix is meant.

        Returns
        -------
        ndarray, (u,) or (u, m)
            The solutions; zero of columns that are left out, of the matrix itself.
        """
        from scipy.linalg import blas

        x = right.reshape(len(right), -1).copy()
        if not scaled:
            x *= self.scale[:, None]
        for k, (first, stop, _) in enumerate(self.envelope.panels):
            panel, width = self.envelope.panel(self.stored, k), stop - first
            if width:
                y = blas.dtrsm(1.0, panel[:width], x[first:stop], lower=1)
                x[first:stop] = y
                if len(panel) > width:
                    x[self.envelope.rows(k)[width:]] -= panel[width:] @ y
        for k in reversed(range(len(self.envelope.panels))):
            first, stop, _ = self.envelope.panels[k]
            panel, width = self.envelope.panel(self.stored, k), stop - first
            if width:
                y = x[first:stop]
                if len(panel) > width:
                    y = y - panel[width:].T @ x[self.envelope.rows(k)[width:]]
                x[first:stop] = blas.dtrsm(1.0, panel[:width], y, lower=1, trans_a=1)
        if not scaled:
            x *= self.scale[:, None]
        return np.asarray(x.reshape(right.shape))

    def inverted(self) -> Array:
        """Compute the entries of S^-1 within the envelope (J.11), in the place of L.

        Returns
        -------
        ndarray
            S^-1 as it is stored; zero in rows and columns that are left out.
        """
        from scipy.linalg import lapack

        envelope, stored = self.envelope, self.stored
        border = envelope.size - envelope.window
        # S^-1 over the rows of the panel after this one
        front, front_end = np.zeros((0, 0)), envelope.window
        for k in reversed(range(len(envelope.panels))):
            first, stop, last = envelope.panels[k]
            panel, width = envelope.panel(stored, k), int(stop - first)
            if k == len(envelope.panels) - 1:
                if width:
                    _into(panel, lapack.dpotri(panel, lower=1, overwrite_c=1)[0])
                if k:
                    front = np.tril(panel) + np.tril(panel, -1).T
                continue
            inverse, _ = lapack.dtrtri(panel[:width], lower=1)
            inverse = np.tril(inverse)
            G = panel[width:] @ inverse
            inside, held = int(last - stop), len(front) - border
            if last < front_end:
                keep = np.r_[0:inside, held : held + border]
                front = front[np.ix_(keep, keep)]
            below = -(front @ G)
            own = inverse.T @ inverse - G.T @ below
            panel[:width], panel[width:] = own, below
            larger = np.empty((len(panel),) * 2, order="F")
            larger[:width, :width], larger[width:, width:] = own, front
            larger[width:, :width], larger[:width, width:] = below, below.T
            front, front_end = larger, last
        _scale(envelope, stored, self.scale)
        return stored


def factorise_envelope(
    envelope: Envelope, stored: Array, scale: Array, damping: float
) -> tuple[Factor, int]:
    """Factorise a symmetric matrix, in its place.

    Parameters
    ----------
    envelope : Envelope
        What is stored.
    stored : ndarray
        S; L is written there.
    scale : ndarray, (u,)
        D, zero of columns to leave out.
    damping : float
        lambda.

    Returns
    -------
    factor : Factor
        L of D S D + lambda I.
    column : int
        First column that is not positive definite, and the factor is worth nothing; else -1.
    """
    from scipy.linalg import blas, lapack

    _scale(envelope, stored, scale)
    factor, left_out = Factor(envelope, stored, scale), scale == 0.0
    border = envelope.size - envelope.window
    front = np.zeros((0, 0))
    for k, (first, stop, last) in enumerate(envelope.panels):
        panel, width = envelope.panel(stored, k), int(stop - first)
        if not width:
            continue
        own = np.arange(width)
        panel[own, own] += damping
        panel[own[left_out[first:stop]], own[left_out[first:stop]]] = 1.0
        if k:
            panel += front[:, :width]
        square = panel if len(panel) == width else panel[:width]
        L, info = lapack.dpotrf(square, lower=1, clean=0, overwrite_a=1)
        if info > 0:
            return factor, int(first + info - 1)
        _into(square, L)
        if k == len(envelope.panels) - 1:
            break
        # the front of the next panel: what is left of this one, and rows that are new
        inside, following = int(last - stop), int(envelope.panels[k + 1, 2] - stop)
        larger = np.zeros((following + border,) * 2, order="F")
        if k:
            after = front[width:, width:]
            larger[:inside, :inside] = after[:inside, :inside]
            larger[following:, :inside] = after[inside:, :inside]
            larger[following:, following:] = after[inside:, inside:]
        if len(panel) > width:
            below = blas.dtrsm(1.0, L, panel[width:], side=1, lower=1, trans_a=1)
            panel[width:] = below
            rest = np.zeros((following + border, width), order="F")
            rest[:inside], rest[following:] = below[:inside], below[inside:]
            larger = blas.dsyrk(-1.0, rest, beta=1.0, c=larger, lower=1, overwrite_c=1)
        front = larger
    return factor, -1


def _into(view: Array, result: Array) -> None:
    """Write what LAPACK returns where it has not been written already."""
    if not np.may_share_memory(view, result):
        view[:] = result


def _scale(envelope: Envelope, stored: Array, scale: Array) -> None:
    """Scale rows and columns of a matrix in its place."""
    for k, (first, stop, _) in enumerate(envelope.panels):
        panel = envelope.panel(stored, k)
        panel *= scale[first:stop]
        panel *= scale[envelope.rows(k)][:, None]
