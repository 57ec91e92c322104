"""Files of a block file, joined to one block in the tangent plane of its aerial control."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from ...base.errors import InputError, near
from ...base.findings import Finding
from ...base.wording import some
from ...flight.config.block_file import BlockFile
from ...io.formats.blocks.camera_toml import read_camera_covariance
from ...io.formats.blocks.ground_points import GroundTable
from ...io.formats.blocks.joined import join_block, match_names
from ...io.formats.blocks.measured_block import MeasuredBlock
from ...io.formats.blocks.reading import read_measured_block
from ...io.formats.orientation.eo_json import read_one_camera
from ...io.formats.returned.cameras import read_camera
from ...records import ExteriorOrientation
from ...records.block import INTERIOR, Array, BrownCamera, ImageBlock
from ..adjust.groups import InteriorObservation, ObservationGroup, weight_of
from .aerial.positions import orientation_of
from .ground import ground_in_plane
from .mode import cameras_in_mode, file_in_mode, ground_in_mode, source_in_mode
from .parameters import UNSTATED_ARM_M
from .placing import in_own_datum, in_tangent_plane, place_images, read_distances
from .vehicle.places import Vehicle, vehicle_of

USUAL_FREE = ("f", "cx", "cy")
FEWEST_POINTS = 4
"""Of an image without aerial control: three orient it, and then nothing tells whether they do."""
SHORTEST_CONSTANT, LONGEST_CONSTANT = 0.1, 50.0  # camera constants, of the longer side of the image
SINGLE_SHARE = 0.5  # of the points measured in one image alone: names that differ by image (chosen)


@dataclass(frozen=True, eq=False)
class BlockInputs:
    """What an adjustment starts from.

    Parameters
    ----------
    file : BlockFile
        What was asked for.
    block : ImageBlock
        Images, cameras, observations, ground points, in the axes of the tangent plane; without
        aerial control in those of the ground points.
    eo : ExteriorOrientation or None
        The aerial control.
    eo_row : ndarray of int
        (n,) row of each image in it; -1 of images without aerial control.
    notes : tuple of str
        What was left out or assumed, sentence by sentence.
    further : tuple of ObservationGroup
        What earlier calibrations say of the cameras, distances, and the datum of a free network.
    vehicle : Vehicle or None
        Kinematic ground control.
    unchecked : Finding or None
        That no ground point checks where positions alone lie.
    """

    file: BlockFile
    block: ImageBlock
    eo: ExteriorOrientation | None
    eo_row: NDArray[np.int64]
    notes: tuple[str, ...]
    further: tuple[ObservationGroup, ...] = ()
    vehicle: Vehicle | None = None
    unchecked: Finding | None = None

    def of_images(self, of_eo: Array, fill: float = 0.0) -> Array:
        """Return what the aerial control has of each image of the block.

        Parameters
        ----------
        of_eo : ndarray, (m, ...)
            Values of its images.
        fill : float
            Value of images without aerial control.

        Returns
        -------
        ndarray, (n, ...)
            Values of the images of the block.
        """
        out = np.full((self.eo_row.size, *of_eo.shape[1:]), fill)
        has_pose = self.eo_row >= 0
        out[has_pose] = of_eo[self.eo_row[has_pose]]
        return out


def inputs_of(file: BlockFile, progress: Callable[[str], None]) -> BlockInputs:
    """Read and join the files of a block file.

    Parameters
    ----------
    file : BlockFile
        The block file.
    progress : callable
        Is called with the name of each step.

    Returns
    -------
    BlockInputs
        The block.

    Raises
    ------
    InputError
        A file cannot be read, or files do not belong together.
    """
    notes: list[str] = []
    file, mode = file_in_mode(file, notes), file.adjustment.mode
    progress("reading image observations")
    if file.images.file is None:
        raise InputError(
            "images.file is missing; give image observations, a table or the project of a"
            " photogrammetry program (only `insgnss adjust --plan` needs none)"
        )
    source = read_measured_block(
        file.images.file,
        file.images.format,
        sigma_px=file.images.sigma_px,
        columns=file.images.columns,
    )
    notes += source.notes
    source = _without_images(source, file.images.skip)
    source = replace(source, cameras=cameras_in_mode(file, _cameras(file, source), notes))
    if (
        source.cameras
        and len(source.camera)
        and source.camera.max(initial=0) >= len(source.cameras)
    ):
        source = replace(source, camera=np.zeros_like(source.camera))
    eo = unchecked = None
    if (poses := file.aerial_control.file) is not None:
        progress("reading aerial control")
        if file.aerial_control.positions_alone:
            eo, table, unchecked = orientation_of(file.aerial_control, source, notes)
            if mode != "direct" and table.lever_arm_m is None and table.lever_arm_sigma_m is None:
                table = replace(table, lever_arm_sigma_m=UNSTATED_ARM_M)
            file = replace(file, aerial_control=table)
        else:
            eo = read_one_camera(poses, "an adjustment")
    if file.camera.new_from:
        images = source.measured.images if eo is None else eo.images
        source = _by_part(source, file.camera.new_from, images)
    datum, ground = file.adjustment.datum, None
    if datum == "control":
        ground = ground_in_plane(file, source, eo, notes)
    else:
        _refuse_two_datums(file)
        if file.ground.file is not None or source.ground is not None:
            notes.append(f"datum {datum}: coordinates of ground points take no part")
    unchecked = unchecked if ground is None else None
    ground = ground_in_mode(file, ground, source.measured.points, notes)
    source, vehicle = _with_vehicle(file, source, ground, eo, notes, progress)
    moving = () if vehicle is None else vehicle.points
    source = _oriented_only(source_in_mode(mode, source, ground, notes, moving), eo, notes)
    if vehicle is not None:
        vehicle = vehicle.seen_in(source.measured)
    union = join_block(source, ground, eo, all_oriented=mode == "fast_at")
    for camera in union.block.cameras:
        refuse_field_of_view(camera)
    block, rows = union.block, union.eo_row
    if eo is None and not (file.ground.crs or source.crs) and not source.local:
        block = replace(block, position_m=union.position_m, C_mc=union.C_mc)  # axes of the ground
    distances = read_distances(file.ground.distances, block)
    constraints: tuple[ObservationGroup, ...] = ()
    if datum != "control" or (eo is None and union.held is not None and not len(block.control)):
        if source.geocentric:
            union = in_tangent_plane(union, notes)
        block, constraints = in_own_datum(block, union, datum, distances)
    else:
        block = place_images(block, union.position_m, union.C_mc)
    if eo is not None and (without := int((rows < 0).sum())):
        notes.append(
            f"{without} of {len(rows)} images have no aerial control,"
            f" {block.images[int(np.argmin(rows))]} first: they are oriented by image observations"
            " alone"
        )
    if eo is not None and (unseen := len(eo.images) - int((rows >= 0).sum())):
        used_rows = set(rows[rows >= 0].tolist())
        names = [name for k, name in enumerate(eo.images) if k not in used_rows]
        named = some(names)
        notes.append(f"{unseen} images of the aerial control have no image observations: {named}")
    notes += _left_out(ground, block)
    notes += _seen_once(block, moving)
    further: list[ObservationGroup] = [*observed_camera(file, block), *distances, *constraints]
    return BlockInputs(file, block, eo, rows, tuple(notes), tuple(further), vehicle, unchecked)


def _refuse_two_datums(file: BlockFile) -> None:
    """Refuse control beside a datum of the block's own."""
    for key, path in (
        ("aerial_control.file", file.aerial_control.file),
        ("vehicle.file", file.vehicle.file),
    ):
        if path is not None:
            raise InputError(
                f"{key} defines where the block lies, and so does adjustment.datum ="
                f' "{file.adjustment.datum}"; leave one of them out'
            )


def _with_vehicle(
    file: BlockFile,
    source: MeasuredBlock,
    ground: GroundTable | None,
    eo: ExteriorOrientation | None,
    notes: list[str],
    progress: Callable[[str], None],
) -> tuple[MeasuredBlock, Vehicle | None]:
    """Return the block whose images see a vehicle, and the vehicle."""
    if file.vehicle.file is None:
        return source, None
    if file.adjustment.mode == "direct":
        notes.append("mode direct: poses are held, and the vehicle takes no part")
        return source, None
    progress("reading the vehicle")
    fixed = () if ground is None else ground.points
    measured, vehicle = vehicle_of(file.vehicle, source.measured, fixed, eo, notes)
    return replace(source, measured=measured), vehicle


def observed_camera(file: BlockFile, block: ImageBlock) -> tuple[InteriorObservation, ...]:
    """Return the calibration of the camera's file as an observation of what is estimated of it.

    Parameters
    ----------
    file : BlockFile
        Says whether it is weighed.
    block : ImageBlock
        The block, of one camera.

    Returns
    -------
    tuple of InteriorObservation
        One, or none.

    Raises
    ------
    InputError
        The file has no standard deviations.
    """
    if not file.camera.weighed or file.camera.file is None:
        return ()
    P = read_camera_covariance(file.camera.file)
    if P is None:
        raise InputError.in_file(
            file.camera.file,
            "no table [sigma] with standard deviations, which camera.weighed needs; add"
            " the table, or leave camera.weighed out",
        )
    (camera,) = block.cameras
    rows = np.array([INTERIOR.index(k) for k in P.parameters if k in camera.free], dtype=np.int64)
    if not rows.size:
        return ()
    weight = weight_of(P.whole[np.ix_(rows, rows)], f"{file.camera.file}: [sigma]")
    return (InteriorObservation(0, rows, camera.interior[rows], weight),)


def refuse_field_of_view(camera: BrownCamera) -> None:
    """Refuse a camera constant that is no pixels.

    Parameters
    ----------
    camera : BrownCamera
        The camera.

    Raises
    ------
    InputError
        Its field of view cannot be.
    """
    f, size = camera.of("f"), max(camera.width, camera.height)
    if not SHORTEST_CONSTANT * size < f < LONGEST_CONSTANT * size:
        angle = 2.0 * np.degrees(np.arctan(0.5 * size / f))
        raise InputError(
            f"camera {camera.name}: camera constant f {f:g} px sees {angle:.3g} deg in images"
            f" of {size} px; f is in pixels: divide a value in millimetres by the size of a"
            " pixel"
        )


def _seen_once(block: ImageBlock, moving: Sequence[str]) -> list[str]:
    """Say that points take no part because one image alone sees them, where these are many; those
    of a vehicle do.
    """
    rays = np.bincount(block.observations.point, minlength=len(block.points))
    moving_names = set(moving)
    rays[[name in moving_names for name in block.points]] = 0
    single = int((rays == 1).sum())
    if single < SINGLE_SHARE * (rays > 0).sum():
        return []
    return [
        f"{single} of {int((rays > 0).sum())} points are measured once, in one image alone, and"
        " take no part; the same point must have the same name in every image"
    ]


def _without_images(source: MeasuredBlock, skip: Sequence[str]) -> MeasuredBlock:
    """Return the block without the observations of some images."""
    if not skip:
        return source
    images = source.measured.images
    if bad := [name for name in skip if name not in images]:
        raise InputError(
            f"images.skip: {bad[0]!r} is not an image of this block; {near(bad[0], images[:200])}"
        )
    observations = source.measured.observations
    gone = set(skip)
    skipped = np.array([name in gone for name in images])
    keep = ~skipped[observations.image]
    return replace(source, measured=replace(source.measured, observations=observations.rows(keep)))


def _oriented_only(
    source: MeasuredBlock, eo: ExteriorOrientation | None, notes: list[str]
) -> MeasuredBlock:
    """Leave images out that neither aerial control nor enough points orient."""
    images, observations = source.measured.images, source.measured.observations
    count = np.bincount(observations.image, minlength=len(images))
    few = (count > 0) & (count < FEWEST_POINTS)
    if eo is not None:
        few &= match_names(images, eo.images) < 0
    if not few.any():
        return source
    names = [images[k] for k in np.flatnonzero(few)]
    named = some(names)
    notes.append(
        f"{len(names)} images are left out, which see fewer than {FEWEST_POINTS} points and have no"
        f" aerial control: {named}"
    )
    return _without_images(source, names)


def _cameras(file: BlockFile, source: MeasuredBlock) -> tuple[BrownCamera, ...]:
    """Return the cameras, with the parameters that are estimated."""
    if file.camera.file is not None:
        cameras: tuple[BrownCamera, ...] = (read_camera(file.camera.file),)
    else:
        cameras = tuple(
            camera
            if camera.free or source.free_stated
            else replace(
                camera,
                free=tuple(n for n in INTERIOR if n in USUAL_FREE or camera.of(n) != 0.0),
            )
            for camera in source.cameras
        )
    if file.camera.free is None:
        return cameras
    return tuple(replace(camera, free=file.camera.free) for camera in cameras)


def _by_part(source: MeasuredBlock, names: Sequence[str], order: Sequence[str]) -> MeasuredBlock:
    """Return a block whose cameras have parameters of their own from some images on.

    An image that the order lacks belongs to the part of the image before it in the block.
    """
    begins = match_names(tuple(names), tuple(order))
    if (begins < 0).any():
        name = names[int(np.argmin(begins))]
        raise InputError(
            f"camera.new_from: {name!r} is no image of the block; {near(name, order[:200])}"
        )
    row = match_names(source.measured.images, tuple(order))
    latest = np.maximum.accumulate(np.where(row >= 0, np.arange(row.size), 0))
    interval = np.searchsorted(np.sort(begins), row[latest], side="right")
    pairs, camera = np.unique(
        np.column_stack([source.camera, interval]), axis=0, return_inverse=True
    )
    starts = ("", *(f" from {order[k]}" for k in np.sort(begins)))
    cameras = tuple(
        replace(source.cameras[c], name=f"{source.cameras[c].name}{starts[k]}") for c, k in pairs
    )
    return replace(source, cameras=cameras, camera=camera.reshape(-1).astype(np.int64))


def _left_out(ground: GroundTable | None, block: ImageBlock) -> list[str]:
    """Say which ground points are measured in no image."""
    if ground is None:
        return []
    names = set(block.points)
    missing = [name for name in ground.points if name not in names]
    if not missing:
        return []
    named = some(missing, 5)
    return [
        f"{len(missing)} of {len(ground.points)} ground points are measured in no image: {named}"
    ]


def with_usual_free(block: ImageBlock) -> ImageBlock:
    """Return the block with the usual parameters of its cameras estimated.

    Parameters
    ----------
    block : ImageBlock
        The block.

    Returns
    -------
    ImageBlock
        Principal point, camera constant and k1, k2, p1, p2 are free beside those that were.
    """
    free = {n for n in INTERIOR if n in USUAL_FREE or n in ("k1", "k2", "p1", "p2")}
    cameras = tuple(
        replace(c, free=tuple(n for n in INTERIOR if n in c.free or n in free))
        for c in block.cameras
    )
    return replace(block, cameras=cameras)
