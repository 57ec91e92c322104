"""The images of one point against each other."""

import numpy as np

from ...geodesy.least_squares import Equations, NormalEquations
from ...records import Array

LIMIT = 4.0  # sigmas: one good measurement in 3000 is lost
_FEWEST = 3  # images, for one of them to be told from the others


def disagreeing(differences: Array, cov: Array, by_point: Array, point_cov: Array) -> Array:
    """Return by how much the others contradict measurements of a ground point.

    Measured minus predicted pixels of one point have in common the error dX of its coordinates:
    differences = B dX + error, with the covariance of (GT.1) without the point, and that of the
    match. dX follows by least squares with the covariance of the point; the measurement that is
    worst in its own covariance leaves, and so on while one is beyond the limit and enough are left.

    Parameters
    ----------
    differences : ndarray, (n, 2)
        Measured minus predicted pixels.
    cov : ndarray, (n, 2, 2)
        Covariance of each without that of the point.
    by_point : ndarray, (n, 2, 3)
        Derivatives of the pixels by the point.
    point_cov : ndarray, (3, 3)
        Covariance of the point, m^2.

    Returns
    -------
    ndarray, (n,)
        Sigmas of the residual of each that the others contradict, NaN of those that stay; all stay
        where fewer than three images see the point.
    """
    out = np.full(len(differences), np.nan)
    prior = Equations.prior(np.zeros(3), point_cov)
    while np.isnan(out).sum() >= _FEWEST:
        size = np.full(len(differences), -np.inf)
        for k in np.flatnonzero(np.isnan(out)):  # each against what the others say
            remaining = np.flatnonzero(np.isnan(out))
            remaining = remaining[remaining != k]
            equations = Equations(differences[remaining], by_point[remaining], {"": cov[remaining]})
            normals = NormalEquations([prior, equations])
            e = differences[k] - by_point[k] @ normals.dx
            C = cov[k] + by_point[k] @ normals.cov @ by_point[k].T
            size[k] = np.sqrt(e @ np.linalg.solve(C, e))
        worst = int(size.argmax())
        if size[worst] <= LIMIT:
            break
        out[worst] = size[worst]
    return out
