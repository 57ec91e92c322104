"""An image block from what its sources know: image observations, cameras, ground points, poses."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import PurePosixPath

import numpy as np
from numpy.typing import NDArray

from ....base.errors import InputError, near
from ....records.block import Array, BrownCamera, GroundPoints, ImageBlock, ImageObservations
from ....records.solutions import ExteriorOrientation
from .ground_points import GroundTable
from .image_points import ImagePoints
from .measured_block import MeasuredBlock, no_poses

BESIDE_PX = 1.0
"""By how much an observation may lie beside the image: conventions of its border differ."""

MANY = 200
"""Of so many observations the part of the format says something in which they lie."""
# shares of the image's sides: points of a block lie neither in so small a corner nor in a quarter
CORNER, QUARTER_TURN_SHARE = 0.05, 0.52


@dataclass(frozen=True, eq=False)
class JoinedBlock:
    """A block, and where its images stand in the orientation that it was joined with.

    Parameters
    ----------
    block : ImageBlock
        The block.
    eo_row : ndarray of int
        (n,) row of each image in the orientation; -1 of those that it does not have.
    position_m, C_mc : ndarray
        (n, 3) and (n, 3, 3) poses of its images in the axes of their program; NaN where it has
        none.
    held : ndarray of bool, optional
        (n, 6) which components of these poses the program's own datum holds.
    """

    block: ImageBlock
    eo_row: NDArray[np.int64]
    position_m: Array
    C_mc: Array
    held: NDArray[np.bool_] | None = None


def join_block(
    source: MeasuredBlock,
    ground: GroundTable | None = None,
    eo: ExteriorOrientation | None = None,
    all_oriented: bool = False,
) -> JoinedBlock:
    """Join what is known of a block by the names of images and points.

    Names of images are the same where they differ by directory, ending or case alone, as those of
    photographs and of their events do.

    Parameters
    ----------
    source : MeasuredBlock
        Image observations, cameras and poses.
    ground : GroundTable, optional
        Ground points in the axes of the block; those that are measured in no image are left out.
    eo : ExteriorOrientation, optional
        First values of the poses in these axes.
    all_oriented : bool
        Whether images of the orientation in which nothing was measured are images of the block;
        they have the first camera.

    Returns
    -------
    JoinedBlock
        The block; other images without observations are left out.

    Raises
    ------
    InputError
        No camera, an observation that lies beside its image, or tables of which one knows no image
        or no point of the other.
    """
    source = _without_empty_images(source)
    if eo is not None and all_oriented:
        source = _with_oriented(source, eo)
    measured = source.measured
    n = len(measured.images)
    if not source.cameras:
        raise InputError(
            "no camera: the file of image observations holds none; give a camera file"
            " (data_specs/camera_toml.md)"
        )
    _within(measured, source.cameras, source.camera)
    position, C_mc = no_poses(n)
    row = np.full(n, -1, dtype=np.int64)
    if eo is not None:
        row = match_names(measured.images, eo.images)
        _some(
            int((row >= 0).sum()),
            measured.images,
            eo.images,
            "image of the image observations is in the orientation",
        )
        oriented = row >= 0
        position[oriented], C_mc[oriented] = eo.position_m[row[oriented]], eo.C_mc[row[oriented]]
    control, check = _ground(measured, ground)
    block = ImageBlock(
        cameras=source.cameras,
        images=measured.images,
        camera=source.camera,
        position_m=position,
        C_mc=C_mc,
        held=np.zeros((n, 6), dtype=bool),
        points=measured.points,
        observations=measured.observations,
        control=control,
        check=check,
    )
    return JoinedBlock(block, row, source.position_m, source.C_mc, source.held)


def match_names(names: Sequence[str], choices: Sequence[str]) -> NDArray[np.int64]:
    """Return the row of each name among other names.

    Parameters
    ----------
    names, choices : sequence of str
        Names of images.

    Returns
    -------
    ndarray of int, (n,)
        Rows of `choices`: of the same name, else of the only one that differs by directory, ending
        or case alone, or by outer directories; -1 where there is none.

    Raises
    ------
    InputError
        Two names that would stand for one image.
    """
    exact = {name: k for k, name in enumerate(choices)}
    by_stem: dict[str, list[int]] = {}
    for k, name in enumerate(choices):
        by_stem.setdefault(_stem(name), []).append(k)
    rows = np.full(len(names), -1, dtype=np.int64)
    for i, name in enumerate(names):
        candidates = by_stem.get(_stem(name), [])
        if len(candidates) > 1:
            parts = _parts(name)
            candidates = [k for k in candidates if _one_ends_the_other(parts, _parts(choices[k]))]
        rows[i] = exact.get(name, candidates[0] if len(candidates) == 1 else -1)
    taken = rows[rows >= 0]
    if np.unique(taken).size < taken.size:
        twice = int(taken[np.argmax(np.bincount(taken)[taken] > 1)])
        same = [names[i] for i in np.flatnonzero(rows == twice)[:2]]
        raise InputError(
            f"images {same[0]!r} and {same[1]!r} both match the name {choices[twice]!r}; rename one"
        )
    return rows


def _parts(name: str) -> tuple[str, ...]:
    """Return directories and name without ending, in lower case."""
    return PurePosixPath(name.replace("\\", "/").lower()).with_suffix("").parts


def _one_ends_the_other(first: tuple[str, ...], second: tuple[str, ...]) -> bool:
    n = min(len(first), len(second))
    return first[-n:] == second[-n:]


def _stem(name: str) -> str:
    return PurePosixPath(name.replace("\\", "/")).stem.lower()


def _without_empty_images(source: MeasuredBlock) -> MeasuredBlock:
    """Return the block without images in which nothing was measured."""
    every = source.measured.observations
    keep = np.unique(every.image)
    if keep.size == 0:
        raise InputError("no image observation at all; give a table or project that has some")
    if keep.size == len(source.measured.images):
        return source
    new = np.full(len(source.measured.images), -1, dtype=np.int64)
    new[keep] = np.arange(keep.size)
    images = tuple(source.measured.images[k] for k in keep)
    observations = replace(every, image=new[every.image])
    return replace(
        source,
        camera=source.camera[keep],
        measured=replace(source.measured, images=images, observations=observations),
        position_m=source.position_m[keep],
        C_mc=source.C_mc[keep],
        held=None if source.held is None else source.held[keep],
    )


def _with_oriented(source: MeasuredBlock, eo: ExteriorOrientation) -> MeasuredBlock:
    """Return the block with the images that only the orientation has."""
    oriented = match_names(source.measured.images, eo.images)
    missing = np.setdiff1d(np.arange(len(eo.images)), oriented)
    names = tuple(eo.images[k] for k in missing)
    position, C_mc = no_poses(missing.size)
    return replace(
        source,
        camera=np.concatenate([source.camera, np.zeros(missing.size, dtype=np.int64)]),
        measured=replace(source.measured, images=(*source.measured.images, *names)),
        position_m=np.vstack([source.position_m, position]),
        C_mc=np.concatenate([source.C_mc, C_mc]),
    )


def _ground(measured: ImagePoints, ground: GroundTable | None) -> tuple[GroundPoints, GroundPoints]:
    """Return control and check points that are measured in some image."""
    if ground is None:
        ground = GroundTable((), np.zeros((0, 3)), np.zeros((0, 3, 3)), np.zeros(0, dtype=bool))
    row_by_name = {name: k for k, name in enumerate(measured.points)}
    point = np.array([row_by_name.get(name, -1) for name in ground.points], dtype=np.int64)
    if ground.points:
        _some(
            int((point >= 0).sum()),
            ground.points,
            measured.points,
            "ground point is measured in any image",
        )

    def some(rows: NDArray[np.bool_]) -> GroundPoints:
        return GroundPoints(point[rows], ground.position_m[rows], ground.cov[rows])

    return some((point >= 0) & ~ground.check), some((point >= 0) & ground.check)


def _some(matches: int, names: Sequence[str], choices: Sequence[str], missing: str) -> None:
    """Refuse tables that have no name in common."""
    if matches == 0:
        close = near(names[0], list(choices)[:200])
        if not close.startswith("did"):
            close = f"there are {', '.join(map(repr, list(choices)[:3]))} ..."
        raise InputError(
            f"no {missing}: {names[0]!r} is missing; {close}{'' if close.endswith('?') else ';'}"
            " both files must use the same names"
        )


def _within(
    measured: ImagePoints, cameras: Sequence[BrownCamera], camera: NDArray[np.int64]
) -> None:
    """Refuse observations beside the image: other units, another origin, another camera."""
    marks: ImageObservations = measured.observations
    size: Array = np.array([(c.width, c.height) for c in cameras], dtype=np.float64)
    limit: Array = size[camera[marks.image]]
    beside = np.maximum(-marks.uv, marks.uv - limit).max(axis=1)
    out = beside > BESIDE_PX
    if out.any():
        row = int(np.argmax(out))
        u, v = marks.uv[row]
        width, height = limit[row]
        raise InputError(
            f"image {measured.images[marks.image[row]]!r}, point"
            f" {measured.points[marks.point[row]]!r}: pixel ({u:.1f}, {v:.1f}) lies outside the"
            f" image of {width:.0f} x {height:.0f} pixels ({int(out.sum())} of {len(out)} do);"
            f" {_within_as(marks.uv, limit)}give pixels from the image's upper left corner, x right"
            " and y down"
        )
    if len(out) >= MANY:
        _spread(marks.uv, limit)


def _within_as(uv: Array, size: Array) -> str:
    """Say as what all observations would lie within their images."""
    span = uv.max(axis=0) - uv.min(axis=0)
    if len(uv) >= MANY and (span < CORNER * size.min(axis=0)).all():
        return (
            f"all {len(uv)} lie within {span[0]:.3g} x {span[1]:.3g}, as millimetres or normalised"
            " coordinates from the middle of the image would; "
        )
    up = np.array([1.0, -1.0])
    for text, corrected in (
        ("x and y were exchanged, or images or camera file turned by 90 deg", uv[:, ::-1]),
        ("they counted from the middle of the image", uv + 0.5 * size),
        ("they counted from the middle of the image, y upwards", uv * up + 0.5 * size),
        ("y counted upwards from below it", uv * up),
    ):
        if not ((corrected < -BESIDE_PX) | (corrected > size + BESIDE_PX)).any():
            return f"all of them lie within as if {text}; "
    for times in (0.5, 0.25):
        if not (uv * times > size + BESIDE_PX).any() and (uv > -BESIDE_PX).all():
            return (
                f"all of them lie within an image of {1 / times:g} times the size: the camera file"
                " belongs to other images; "
            )
    return ""


def _spread(uv: Array, size: Array) -> None:
    """Refuse many observations that all lie in one corner: other units, another camera."""
    low, high = uv.min(axis=0), uv.max(axis=0)
    finding = (
        f"all {len(uv)} image observations lie within x {low[0]:.4g} to {high[0]:.4g} and y"
        f" {low[1]:.4g} to {high[1]:.4g} of images of {size[0, 0]:.0f} x {size[0, 1]:.0f} pixels"
    )
    if (high - low < CORNER * size.min(axis=0)).all():
        raise InputError(
            f"{finding}; they look like millimetres or normalised coordinates: give pixels"
        )
    if (high < QUARTER_TURN_SHARE * size.min(axis=0)).all():
        raise InputError(
            f"{finding}, its upper left quarter; the camera file is of other images (of twice the"
            " size, or of another camera): give f, cx, cy, width and height in pixels of these"
        )
