"""BLAS for kernels without the package that it comes in.

numba takes the functions behind `np.dot` (dgemm, dgemv, ddot) from `scipy.linalg.cython_blas`, by
name, when a kernel first multiplies. Importing that module by its name imports `scipy.linalg` and
what that needs (numpy's f2py, testing and docstring parsers among it): 0.27 s of processor time, of
which a flight uses three addresses. The module itself takes 4 ms and needs nothing of its package.

Here it is loaded from its file, numba is led to take the addresses, and it is forgotten again:
whoever imports `scipy.linalg` afterwards gets all of it as ever. Where anything is not as expected
nothing is done, and numba imports what it always did. Whoever runs a kernel that multiplies asks
for it first.
"""

import sys
from contextlib import suppress
from functools import cache
from importlib.machinery import PathFinder
from importlib.util import find_spec, module_from_spec
from pathlib import Path

import numpy as np

from ....base.compilation import njit

BLAS_PACKAGE, BLAS_MODULE = "scipy.linalg", "scipy.linalg.cython_blas"


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


@cache
def link_blas() -> bool:
    """Have numba take the addresses of BLAS, once in a process.

    Returns
    -------
    bool
        Whether that was done; not where the package is imported already, or not to be found.
    """
    if BLAS_PACKAGE in sys.modules:
        return False
    with suppress(Exception):
        scipy = find_spec("scipy")
        if scipy is None or not scipy.submodule_search_locations:
            return False
        folders = [str(Path(each) / "linalg") for each in scipy.submodule_search_locations]
        spec = PathFinder.find_spec(BLAS_MODULE, folders)
        if spec is None or spec.loader is None:
            return False
        module = module_from_spec(spec)
        sys.modules[BLAS_MODULE] = module
        try:
            spec.loader.exec_module(module)
            _multiply()
        finally:
            del sys.modules[BLAS_MODULE]
        return True
    return False


def _multiply() -> None:
    """Call each function of BLAS that kernels use."""
    A = np.eye(2)
    products(A, A[0], np.empty((2, 2)), np.empty(2))
