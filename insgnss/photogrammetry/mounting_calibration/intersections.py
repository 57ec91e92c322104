"""Points of a block: where images of known poses see them, and where they were surveyed."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from ...base.errors import DataError, InputError
from ...geodesy.frames import TangentPlane
from ...io.formats.blocks.ground_points import read_ground_points
from ...io.formats.blocks.joined import match_names
from ...io.formats.blocks.measured_block import MeasuredBlock
from ...io.formats.returned.crs import stated_crs
from ...records.block import Array, BrownCamera
from ...records.cameras.camera import rays_of
from ...records.rows import rows_of
from ..lever_arm.materialisation import intersected_target
from .options import PlaceOptions
from .poses import Positions, placed_positions
from .records import CameraPoses


@dataclass(frozen=True)
class Intersection:
    """A point that images of known poses see.

    Parameters
    ----------
    position : ndarray, (3,)
        In the frame of the poses.
    cov : ndarray, (3, 3)
        Its covariance; by the variance factor where rays miss each other by more.
    factor : float
        That factor.
    miss_px : float
        By how much the rays miss it, pixels.
    images : int
        How many see it.
    """

    position: Array
    cov: Array
    factor: float
    miss_px: float
    images: int


def intersect_point(
    poses: CameraPoses, block: MeasuredBlock, name: str, cameras: Sequence[BrownCamera], kind: str
) -> Intersection | None:
    """Intersect a point of a block from the images that have a pose.

    Parameters
    ----------
    poses : CameraPoses
        Their poses.
    block : MeasuredBlock
        Image observations.
    name : str
        Of the point.
    cameras : sequence of BrownCamera
        One of all images, or those of the block.
    kind : str
        What the point is called in a refusal.

    Returns
    -------
    Intersection or None
        None where fewer than two images see it.

    Raises
    ------
    InputError
        Its rays do not meet before the cameras.
    """
    observed = block.measured.observations
    pose = match_names(block.measured.images, poses.images)[observed.image]
    use = (observed.point == block.measured.points.index(name)) & (pose >= 0)
    if use.sum() < 2:
        return None
    camera = cameras[int(block.camera[observed.image[use][0]]) if len(cameras) > 1 else 0]
    sigma_px, k = float(np.median(observed.sigma_px[use])), pose[use]
    try:
        P, cov, factor = intersected_target(
            poses.position[k],
            poses.C_rc[k],
            rays_of(camera, observed.uv[use]),
            sigma_px / camera.of("f"),
        )
    except DataError as refusal:
        raise InputError(f"{poses.source}: {kind} {name}: {refusal}") from None
    miss_px = float(np.sqrt(factor)) * sigma_px
    return Intersection(P, cov * max(factor, 1.0), factor, miss_px, k.size)


def surveyed_points(
    path: Path,
    cameras: Path,
    camera: CameraPoses,
    places: PlaceOptions,
    plane: TangentPlane | None,
) -> Positions:
    """Return ground control in the axes of the antenna positions.

    Parameters
    ----------
    path : Path
        Its file, or that of the poses.
    cameras : Path
        File of the poses.
    camera : CameraPoses
        The poses, with what their program knows of ground points.
    places : PlaceOptions
        CRS of the points.
    plane : TangentPlane or None
        Axes of the antenna positions; None where these have no place on the Earth.

    Returns
    -------
    Positions
        Points that are no check points.

    Raises
    ------
    InputError
        There is none, or its CRS is not known.
    """
    crs = places.crs
    if path.resolve() == cameras.resolve() and camera.block is not None:
        ground, crs = camera.block.ground, crs or camera.block.crs
    else:
        ground, crs = read_ground_points(path), crs or stated_crs(path)
    if ground is None or ground.check.all():
        raise InputError.in_file(path, "has no ground control; leave --ground out")
    ground = replace(ground, **rows_of(ground, ~ground.check, vars(ground)))
    if plane is not None and crs is None:
        raise InputError.in_file(
            path, "antenna positions are on the Earth; give the CRS of the points, --crs"
        )
    return placed_positions(path, ground, "" if plane is None else crs or "", places.geoid, plane)
