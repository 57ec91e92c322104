"""Files of a block file, joined to one block in the tangent plane of its aerial control."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from ...base.errors import InputError, InsgnssError, near
from ...base.findings import Finding
from ...base.tables import Columns
from ...base.units import FOOT_M
from ...base.wording import some
from ...flight.config.block_file import BlockFile
from ...geodesy.datums import fitting_crs
from ...geodesy.frames import TangentPlane
from ...io.formats.blocks.camera_toml import read_camera_covariance
from ...io.formats.blocks.ground_points import GroundAxes, GroundTable, read_ground_points
from ...io.formats.blocks.joined import joined, matched
from ...io.formats.blocks.measured_block import MeasuredBlock
from ...io.formats.blocks.reading import read_measured_block, recognised
from ...io.formats.orientation.eo_json import read_one_camera
from ...io.formats.origins import origin_in, statement_of
from ...io.formats.returned.cameras import read_camera
from ...records import ExteriorOrientation
from ...records.block import INTERIOR, BrownCamera, ImageBlock
from ..adjust.groups import InteriorObservation, ObservationGroup, weight_of
from .aerial.positions import orientation_of
from .mode import cameras_in_mode, file_in_mode, ground_in_mode, source_in_mode
from .placing import in_own_datum, in_tangent_plane, placed, read_distances
from .vehicle.places import Vehicle, vehicle_of

USUAL_FREE = ("f", "cx", "cy")
FEWEST_POINTS = 4
"""Of an image without aerial control: three orient it, and then nothing tells whether they do."""
SHORTEST_CONSTANT, LONGEST_CONSTANT = 0.1, 50.0  # camera constants, of the longer side of the image
SINGLE_SHARE = 0.5  # of the points measured in one image alone: names that differ by image (chosen)
# largest distance of the middle of ground points from that of the images (m) at which another CRS
# is named for them: blocks are smaller, and zones differ by more
NEAR_GROUND_M = 5e3
METRES_OF_RADIAN = 6.4e6  # radius by which degrees are compared with it
FAR_GROUND_M = 100e3
"""Ground points farther from the images than this stand in other axes."""


@dataclass(frozen=True, eq=False)
class Inputs:
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


def inputs_of(file: BlockFile, progress: Callable[[str], None]) -> Inputs:
    """Read and join the files of a block file.

    Parameters
    ----------
    file : BlockFile
        The block file.
    progress : callable
        Is called with the name of each step.

    Returns
    -------
    Inputs
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
            "images.file is missing: image observations, a table or the project of a photogrammetry"
            " program; `insgnss adjust --plan` goes without"
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
            file = replace(file, aerial_control=table)
        else:
            eo = read_one_camera(poses, "an adjustment")
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
    union = joined(source, ground, eo, all_oriented=mode == "fast_at")
    for camera in union.block.cameras:
        refuse_field_of_view(camera)
    block, rows = union.block, union.eo_row
    if eo is None and crs_of(file, source) is None and not source.local:
        block = replace(block, position_m=union.position_m, C_mc=union.C_mc)  # axes of the ground
    distances = read_distances(file.ground.distances, block)
    constraints: tuple[ObservationGroup, ...] = ()
    if datum != "control" or (eo is None and union.held is not None and not len(block.control)):
        if source.geocentric:
            union = in_tangent_plane(union, notes)
        block, constraints = in_own_datum(block, union, datum, distances)
    else:
        block = placed(block, union.position_m, union.C_mc)
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
    further: tuple[ObservationGroup, ...] = (*calibrated(file, block), *distances, *constraints)
    return Inputs(file, block, eo, rows, tuple(notes), further, vehicle, unchecked)


def _refuse_two_datums(file: BlockFile) -> None:
    """Refuse control beside a datum of the block's own."""
    for key, path in (
        ("aerial_control.file", file.aerial_control.file),
        ("vehicle.file", file.vehicle.file),
    ):
        if path is not None:
            raise InputError(
                f'{key} says where the block lies, and adjustment.datum = "{file.adjustment.datum}"'
                " too; leave one of them out"
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


def calibrated(file: BlockFile, block: ImageBlock) -> tuple[InteriorObservation, ...]:
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
            "no [sigma], which camera.weighed asks for; write it, or leave camera.weighed out",
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
            f" of {size} px; f counts in pixels: of millimetres divide by the size of a pixel"
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
        raise InputError(f"images.skip: {bad[0]!r} is no image of it; {near(bad[0], images[:200])}")
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
        few &= matched(images, eo.images) < 0
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


def ground_in_plane(
    file: BlockFile,
    source: MeasuredBlock | None,
    eo: ExteriorOrientation | None,
    notes: list[str],
) -> GroundTable | None:
    """Return the ground points in the axes of the block.

    Parameters
    ----------
    file : BlockFile
        Says where they are and in which CRS.
    source : MeasuredBlock, optional
        What the photogrammetry program has of them.
    eo : ExteriorOrientation, optional
        Whose tangent plane has the axes of the block.
    notes : list of str
        Gets a sentence where something was assumed.

    Returns
    -------
    GroundTable or None
        The points; None where there are none.

    Raises
    ------
    InputError
        They are not where the images are, or a name is unknown.
    """
    ground, crs, path = None, None, file.images.file
    if source is not None:
        ground, crs = source.ground, source.crs
    if file.ground.file is not None:
        path = file.ground.file
        ground, crs = ground_of(path, file.ground.columns)
    if ground is None or not ground.points:
        return None
    crs = file.ground.crs or crs
    ground = _roles(file, ground)
    if eo is None:
        return ground if crs is None else _in_own_plane(ground, crs, file.ground.geoid, notes)
    plane = TangentPlane(*eo.origin)
    if crs is None and file.aerial_control.positions_alone:
        raise InputError.in_file(
            path,
            "does not say in which CRS its ground points are, and without a flight there is no"
            " tangent plane that they could stand in; name it by ground.crs or --crs, such as"
            ' EPSG:2056+5728, or by the origin of their plane, "origin 46.57 6.54 deg 0 m"',
        )
    as_read = ground
    axes = None if crs is None else GroundAxes(crs, file.ground.geoid, eo.datum, eo.epoch)
    if axes is not None:
        ground = ground.in_plane(axes, plane)
        notes += [axes.unit_note] if axes.unit_note else []
    away = np.linalg.norm(
        ground.position_m[:, :2] - np.median(eo.position_m[:, :2], axis=0), axis=1
    )
    if (away > FAR_GROUND_M).any():
        k = int(np.argmax(away))
        x, y, z = ground.position_m[k]
        if axes is None:
            fits = _fitting(as_read, plane, eo) or "such as EPSG:2056"
            advice = f"they stand in a CRS: name it by ground.crs or --crs, {fits}"
        else:
            advice = (
                _exchanged_positions(file, as_read, axes, eo)
                or _otherwise_near(as_read, axes, plane, eo)
                or f"{crs} is not their CRS; name the right one, with its zone"
            )
        raise InputError.in_file(
            path,
            f"point {ground.points[k]!r} ({x:.0f}, {y:.0f}, {z:.0f}) lies {away[k] / 1e3:.0f} km"
            f" from the images; {advice}",
        )
    return ground


def _exchanged_positions(
    file: BlockFile, ground: GroundTable, axes: GroundAxes, eo: ExteriorOrientation
) -> str:
    """Say that images lie near the points with latitude and longitude exchanged; empty if not."""
    path = file.aerial_control.file
    if path is None or not file.aerial_control.positions_alone:
        return ""
    try:
        lat, lon, _ = axes.geodetic(np.median(ground.position_m, axis=0, keepdims=True))
    except InsgnssError:
        return ""
    away = np.hypot(lat[0] - eo.origin[1], lon[0] - eo.origin[0])
    if away * METRES_OF_RADIAN > FAR_GROUND_M:
        return ""
    return f"those of {path.name} have latitude and longitude exchanged: exchange them there"


def _otherwise_near(
    ground: GroundTable, axes: GroundAxes, plane: TangentPlane, eo: ExteriorOrientation
) -> str:
    """Return how points of a CRS lie near the images when read otherwise; empty if in no way."""
    foot = FOOT_M if (axes.unit_m == 1.0).all() else 1.0 / FOOT_M
    readings = (
        (np.eye(3)[[1, 0, 2]], "with easting and northing exchanged: exchange the columns"),
        (
            foot * np.eye(3),
            f"if their numbers are {'feet' if foot < 1.0 else 'metres'}: name the CRS that counts"
            " in them",
        ),
    )
    for reading, advice in readings:
        try:
            position = ground.position_m @ reading.T
            placed = replace(ground, position_m=position).in_plane(axes, plane)
        except InsgnssError:
            continue
        away = placed.position_m[:, :2] - np.median(eo.position_m[:, :2], axis=0)
        if (np.linalg.norm(away, axis=1) < FAR_GROUND_M).all():
            return f"they lie there {advice}"
    fits = _fitting(ground, plane, eo)
    return f"{axes.crs} is not their CRS; {fits}" if fits else ""


def _fitting(ground: GroundTable, plane: TangentPlane, eo: ExteriorOrientation) -> str:
    """Return in which CRSs the numbers of points lie near the images; empty if in none."""
    lat, lon, _ = plane.geodetic_from_position(np.median(eo.position_m, axis=0, keepdims=True))
    crs = fitting_crs(
        ground.position_m, float(lat[0]), float(lon[0]), NEAR_GROUND_M, eo.datum, eo.epoch
    )
    return f"their numbers fit {crs}" if crs else ""


def crs_of(file: BlockFile, source: MeasuredBlock) -> str | None:
    """Return the CRS of the ground points, None where they stand in the axes of the block."""
    return file.ground.crs or source.crs


def ground_of(path: Path, columns: Columns) -> tuple[GroundTable | None, str | None]:
    """Return ground points and their CRS from a table, or from a file of a program.

    Parameters
    ----------
    path : Path
        The file.
    columns : sequence or mapping, optional
        Columns of a table.

    Returns
    -------
    ground : GroundTable or None
        The points; None where the file has none.
    crs : str or None
        Their CRS, where the file says it.

    Raises
    ------
    InputError
        The file cannot be read.
    """
    if path.is_dir() or recognised(path) not in ("image_points", "bingo"):
        source = read_measured_block(path)
        return source.ground, source.crs
    plane = origin_in(path)
    return read_ground_points(path, columns), None if plane is None else statement_of(plane)


def _roles(file: BlockFile, ground: GroundTable) -> GroundTable:
    """Return the points without those that are left out, and with check points by name."""
    for key in ("check", "skip"):
        for name in getattr(file.ground, key):
            if name not in ground.points:
                raise InputError(
                    f"ground.{key}: {name!r} is no ground point; {near(name, ground.points[:200])}"
                )
    check = ground.check | np.array([name in file.ground.check for name in ground.points])
    keep = np.flatnonzero([name not in file.ground.skip for name in ground.points])
    names = tuple(ground.points[k] for k in keep)
    return replace(
        ground,
        points=names,
        position_m=ground.position_m[keep],
        cov=ground.cov[keep],
        check=check[keep],
    )


def _in_own_plane(
    ground: GroundTable, crs: str, geoid: Path | None, notes: list[str]
) -> GroundTable:
    """Return points of a CRS in a tangent plane at their middle, where nothing else gives one."""
    axes = GroundAxes(crs, geoid)
    notes += [axes.unit_note] if axes.unit_note else []
    lat, lon, h = axes.geodetic(ground.position_m.mean(axis=0, keepdims=True))
    plane = TangentPlane(float(lat[0]), float(lon[0]), float(h[0]))
    notes.append(
        f"axes are those of the tangent plane with {statement_of(plane)}, the middle of the ground"
        " points"
    )
    return ground.in_plane(axes, plane)


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
