"""First values of poses from a program's own axes: a similarity to those of the block.

The program's axes are any (of its own, of a grid, geocentric). Images that both know, and ground
control points that its rays intersect, give

    X = T + s R X'                                                                         (S.1)

R is that of the attitudes of common images; without three of them (S.1) is fitted to three ground
points or more. First values need no more: the adjustment does the rest.
"""

from dataclasses import replace

import numpy as np

from ...geodesy.rotation import nearest_rotation
from ...geodesy.similarity import similarity
from ...records.block import Array, ImageBlock
from ..adjust.start import directions, intersected

FEWEST_COMMON = 3  # images, or ground points: fewer leave a similarity (S.1) a rotation


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
    has_pose = np.isfinite(position).all(axis=1) & np.isfinite(C).all(axis=(1, 2))
    missing = has_pose & ~block.oriented
    if not missing.any():
        return block
    common = has_pose & block.oriented
    fitted = None
    if common.sum() >= FEWEST_COMMON:
        R = nearest_rotation(np.einsum("nij,nkj->ik", block.C_mc[common], C[common]))
        fitted = similarity(position[common], block.position_m[common], R)
    elif len(block.control) >= FEWEST_COMMON:
        obs = block.observations
        X = intersected(position, C, directions(block), obs.image, obs.point, len(block.points))[
            block.control.point
        ]
        good = np.isfinite(X).all(axis=1)
        if good.sum() >= FEWEST_COMMON:
            fitted = similarity(X[good], block.control.position_m[good])
    if fitted is None:
        return block
    new_position, new_C = np.array(block.position_m), np.array(block.C_mc)
    new_position[missing] = fitted.points(position[missing])
    new_C[missing] = fitted.rotation @ C[missing]
    return replace(block, position_m=new_position, C_mc=new_C)
