"""Copies within kernels, element by element.

`to[:] = source` does the same, but numba compiles into it the text of its complaint about shapes
that differ, by functions of strings: with it the kernels of a first run took a sixth longer.
"""

from ....base.compilation import njit


@njit(cache=True, allocates=False)
def copy_vector(source, to):
    """Copy the elements of a vector.

    Parameters
    ----------
    source : ndarray
        (k,) what is copied.
    to : ndarray
        (k,) at least, filled in place.
    """
    for k in range(source.size):
        to[k] = source[k]


@njit(cache=True, allocates=False)
def copy_matrix(source, to):
    """Copy the elements of a matrix.

    Parameters
    ----------
    source : ndarray
        (k, l) what is copied.
    to : ndarray
        (k, l) at least, whose first rows and columns are filled in place.
    """
    for r in range(source.shape[0]):
        for c in range(source.shape[1]):
            to[r, c] = source[r, c]
