"""Similarity of two Cartesian frames, in closed form.

    Y = T + s R X                                                                              (S.1)

With the cross-covariance of centred points, sum y x^T = U D V^T, least squares give
R = U diag(1, 1, det(U V^T)) V^T, s = sum y^T R x / sum x^T x and T from the means (Umeyama 1991).
A rigid transformation is the same with s = 1.
"""

from dataclasses import dataclass

import numpy as np

from .rotation import Array, nearest_rotation

# second singular value over the first: points on a line give no rotation about it
LEAST_SINGULAR_RATIO = 1e-3


@dataclass(frozen=True, eq=False)
class Similarity:
    """Seven parameters (S.1) from one frame to another.

    Parameters
    ----------
    translation : ndarray, (3,)
        T, m.
    rotation : ndarray, (3, 3)
        R, from the axes of X to those of Y.
    scale : float
        s, metres for each unit of X.
    """

    translation: Array
    rotation: Array
    scale: float

    def points(self, X: Array) -> Array:
        """Take points to the other frame.

        Parameters
        ----------
        X : ndarray, (..., 3)
            Points.

        Returns
        -------
        ndarray, (..., 3)
            Y of (S.1).
        """
        return np.asarray(self.translation + self.scale * X @ self.rotation.T)


def similarity(
    X: Array, Y: Array, rotation: Array | None = None, rigid: bool = False
) -> Similarity | None:
    """Fit (S.1) by unweighted least squares.

    Parameters
    ----------
    X, Y : ndarray, (n, 3)
        Points in both frames.
    rotation : ndarray, (3, 3), optional
        R, where it is known.
    rigid : bool
        Whether the scale is one.

    Returns
    -------
    Similarity or None
        None where points do not determine it.
    """
    x = X - X.mean(axis=0)
    y = Y - Y.mean(axis=0)
    if rotation is None:
        U, singular, Vt = np.linalg.svd(y.T @ x)
        if not singular[1] > LEAST_SINGULAR_RATIO * singular[0]:
            return None
        rotation = U @ np.diag([1.0, 1.0, np.linalg.det(U @ Vt)]) @ Vt
    rotated = x @ rotation.T
    spread = float((rotated**2).sum())
    if not spread > 0.0:
        return None
    scale = 1.0 if rigid else float((rotated * y).sum()) / spread
    if not scale > 0.0:
        return None
    return Similarity(Y.mean(axis=0) - scale * rotation @ X.mean(axis=0), rotation, scale)


def similarity_of_poses(X: Array, C: Array, Y: Array, C_y: Array) -> Similarity | None:
    """Fit (S.1) to places; where they stand on a line, with the rotation that attitudes give.

    Parameters
    ----------
    X, C : ndarray
        (n, 3) places and (n, 3, 3) attitudes of cameras in the first frame.
    Y, C_y : ndarray
        Of the same cameras in the second; a bore-sight between C and C_y goes into R.

    Returns
    -------
    Similarity or None
        None where all places are one.
    """
    fitted = similarity(X, Y)
    return fitted or similarity(X, Y, nearest_rotation(np.einsum("nij,nkj->ik", C_y, C)))
