"""Symmetric matrices by their lower triangles, row by row: half of the memory."""

import numpy as np

from ...records import Array


def unpacked(triangle: Array) -> Array:
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
