"""First values of poses from a program's own axes: a similarity to those of the block.

The program's axes are any (of its own, of a grid, geocentric). Images that both know, and ground
control points that its rays intersect, give

    X = T + s R X'                                                                         (S.1)

R is that of the attitudes of common images; without three of them (S.1) is fitted to three ground
points or more. First values need no more: the adjustment does the rest.
"""

from dataclasses import dataclass, replace

import numpy as np

from ..adjust.start import directions, intersected
from ..geodesy.rotation import nearest_rotation
from ..records.block import Array, ImageBlock

FEWEST = 3
FLAT = 1e-3  # second singular value over the first: points on a line give no rotation about it


@dataclass(frozen=True, eq=False)
class Similarity:
    """Seven parameters (S.1): translation (3,) m, rotation (3, 3), scale."""

    translation: Array
    rotation: Array
    scale: float

    def positions(self, X: Array) -> Array:
        """Return positions (n, 3) in the axes of the block."""
        return np.asarray(self.translation + self.scale * X @ self.rotation.T)


def placed(block: ImageBlock, position: Array, C: Array) -> ImageBlock:
    """Return a block whose images without first values have those of a program.

    Parameters
    ----------
    block : ImageBlock
        The block; images with first values keep them.
    position, C : ndarray
        (n, 3) and (n, 3, 3) poses of its images in the program's axes; NaN where there are none.

    Returns
    -------
    ImageBlock
        The same otherwise; as it was where nothing ties both axes.
    """
    own = np.isfinite(position).all(axis=1) & np.isfinite(C).all(axis=(1, 2))
    missing = own & ~block.oriented
    if not missing.any():
        return block
    common = own & block.oriented
    fitted = None
    if common.sum() >= FEWEST:
        R = nearest_rotation(np.einsum("nij,nkj->ik", block.C_mc[common], C[common]))
        fitted = similarity(position[common], block.position_m[common], R)
    elif len(block.control) >= FEWEST:
        seen = block.observations
        X = intersected(position, C, directions(block), seen.image, seen.point, len(block.points))[
            block.control.point
        ]
        good = np.isfinite(X).all(axis=1)
        if good.sum() >= FEWEST:
            fitted = similarity(X[good], block.control.position_m[good])
    if fitted is None:
        return block
    new_position, new_C = np.array(block.position_m), np.array(block.C_mc)
    new_position[missing] = fitted.positions(position[missing])
    new_C[missing] = fitted.rotation @ C[missing]
    return replace(block, position_m=new_position, C_mc=new_C)


def similarity(X: Array, Y: Array, rotation: Array | None = None) -> Similarity | None:
    """Fit Y = T + s R X by least squares (Umeyama 1991).

    Parameters
    ----------
    X, Y : ndarray, (n, 3)
        Points in both axes.
    rotation : ndarray, (3, 3), optional
        R, where it is known.

    Returns
    -------
    Similarity or None
        None where points do not determine it.
    """
    x, y = X - X.mean(axis=0), Y - Y.mean(axis=0)
    if rotation is None:
        U, size, Vt = np.linalg.svd(y.T @ x)
        if size[1] < FLAT * size[0]:
            return None
        rotation = U @ np.diag([1.0, 1.0, np.linalg.det(U @ Vt)]) @ Vt
    turned = x @ rotation.T
    if not (spread := float((turned**2).sum())) > 0.0:
        return None
    scale = float((turned * y).sum()) / spread
    if not scale > 0.0:
        return None
    return Similarity(Y.mean(axis=0) - scale * rotation @ X.mean(axis=0), rotation, scale)
