"""An image block from its plain tables: image observations, ground points, camera, first poses."""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from ...base.errors import InputError, near
from ...records.block import BrownCamera, GroundPoints, ImageBlock, ImageObservations
from ...records.solutions import ExteriorOrientation
from .ground_points import GroundTable
from .image_points import ImagePoints

BESIDE_PX = 1.0
"""By how much an observation may lie beside the image: conventions of its border differ."""


def joined(
    measured: ImagePoints,
    camera: BrownCamera,
    ground: GroundTable | None = None,
    eo: ExteriorOrientation | None = None,
) -> ImageBlock:
    """Join the tables of a block by the names of images and points.

    Parameters
    ----------
    measured : ImagePoints
        The image observations; the images of the block are those that have some.
    camera : BrownCamera
        The camera of all images.
    ground : GroundTable, optional
        Ground points in the axes of the block; those that are measured in no image are left out.
    eo : ExteriorOrientation, optional
        First values of the poses in these axes; images that it does not name have none.

    Returns
    -------
    ImageBlock
        The block.

    Raises
    ------
    InputError
        An observation that lies beside the image, or tables of which one knows no image or no
        point of the other.
    """
    _within(measured, camera)
    n = len(measured.images)
    position, C_mc = np.full((n, 3), np.nan), np.full((n, 3, 3), np.nan)
    if eo is not None:
        row_by_name = {name: k for k, name in enumerate(eo.images)}
        matches = [
            (i, row_by_name[name]) for i, name in enumerate(measured.images) if name in row_by_name
        ]
        _some(len(matches), measured.images, eo.images, "image")
        here, there = np.array(matches).T
        position[here], C_mc[here] = eo.position_m[there], eo.C_mc[there]
    control, check = _ground(measured, ground)
    return ImageBlock(
        (camera,),
        measured.images,
        np.zeros(n, dtype=np.int64),
        position,
        C_mc,
        np.zeros((n, 6), dtype=bool),
        measured.points,
        measured.observations,
        control,
        check,
    )


def _ground(measured: ImagePoints, ground: GroundTable | None) -> tuple[GroundPoints, GroundPoints]:
    """Return control and check points that are measured in some image."""
    if ground is None:
        ground = GroundTable((), np.zeros((0, 3)), np.zeros((0, 3, 3)), np.zeros(0, dtype=bool))
    row_by_name = {name: k for k, name in enumerate(measured.points)}
    point = np.array([row_by_name.get(name, -1) for name in ground.points], dtype=np.int64)
    if ground.points:
        _some(int((point >= 0).sum()), ground.points, measured.points, "ground point")

    def some(rows: NDArray[np.bool_]) -> GroundPoints:
        return GroundPoints(point[rows], ground.position_m[rows], ground.cov[rows])

    return some((point >= 0) & ~ground.check), some((point >= 0) & ground.check)


def _some(matches: int, names: Sequence[str], others: Sequence[str], kind: str) -> None:
    """Refuse tables that have no name in common."""
    if matches == 0:
        raise InputError(
            f"no {kind} of the first table is in the second: {names[0]!r} is not there;"
            f" {near(names[0], list(others)[:200])[:200]} The same names must stand in both"
        )


def _within(measured: ImagePoints, camera: BrownCamera) -> None:
    """Refuse observations beside the image: other units, another origin, another camera."""
    seen: ImageObservations = measured.observations
    beside = np.maximum(-seen.uv, seen.uv - (camera.width, camera.height)).max(axis=1)
    out = beside > BESIDE_PX
    if out.any():
        row = int(np.argmax(out))
        u, v = seen.uv[row]
        raise InputError(
            f"image {measured.images[seen.image[row]]!r}, point"
            f" {measured.points[seen.point[row]]!r}: pixel ({u:.1f}, {v:.1f}) lies beside the image"
            f" of {camera.width} x {camera.height} pixels ({int(out.sum())} of {len(out)} do);"
            " coordinates count from its upper left corner, right and down, in pixels"
        )
