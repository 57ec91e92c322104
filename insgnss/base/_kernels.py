"""Products that reach every function of BLAS which kernels call, see `linear_algebra`."""

import numpy as np

from .compilation import njit


@njit(cache=True)
def products(A, x, out, image):
    """Multiply two matrices, a matrix and a vector, and two vectors.

    Parameters
    ----------
    A : ndarray
        (n, n) the matrix.
    x : ndarray
        (n,) the vector.
    out : ndarray
        (n, n) A A, filled in place.
    image : ndarray
        (n,) A x, filled in place.

    Returns
    -------
    float
        x' x.
    """
    np.dot(A, A, out)
    np.dot(A, x, image)
    return np.dot(x, x)
