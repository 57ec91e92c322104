"""`insgnss calibrate similarity`: adjusted poses, antenna positions and ground points, as files.

Beside what the adjustment of `photogrammetry.lever_arm.similarity` says of itself, its residuals
are held against what it takes for granted: that errors of neighbouring images are independent, and
that exposures have the stamps of the antenna positions.
"""

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np

from ...base.errors import DataError, InputError
from ...base.files import picked
from ...geodesy.frames import TangentPlane
from ...geodesy.similarity import similarity
from ...io.formats.blocks.camera_toml import read_camera_toml
from ...io.formats.blocks.ground_points import read_ground_points
from ...io.formats.blocks.pose_table import NamedPositions
from ...io.formats.blocks.reading import read_measured_block
from ...records import Array
from ...records.cameras.camera import rays_of
from ...report.charts.chart import Chart
from ..lever_arm.materialisation import intersected_target
from ..lever_arm.similarity import (
    ARM,
    LONGEST_M,
    RULER_M,
    FlightPoses,
    GroundPoints,
    SimilarityLeverArm,
    similarity_lever_arm,
)
from .flight_direction import FlightDirection, flight_direction, neighbour_correlation
from .poses import (
    CameraPoses,
    PlaceOptions,
    PoseSigma,
    Positions,
    joined,
    positions_of,
    read_camera_poses,
    read_positions,
)
from .products import CalibratedMounting, calibrated, lever_arm_alone, provenance
from .readings import advice, attitude_readings, named_reading, position_readings

ANTENNA_M = (0.02, 0.03)  # horizontal, vertical, where the table has no standard deviations
SAME_AXIS = 0.5  # cosine of a camera axis and the flight direction that share their fate
LONG_M = 3.0  # along the flight direction: beyond, few aircraft have room
STAMPS = 2.0  # residuals along the flight direction over those across it: of the stamps
DOWNWARDS = -0.3  # vertical part of the mean viewing direction of what is named
TILTED_DEG, LEVEL_DEG = 20.0, 10.0  # rms tilts beyond which, and below which, a reading is named
MISS_PX, MISS_FACTOR = 5.0, 25.0  # rays to a ground point, and over their covariance: other data
ALIKE = (
    "standard errors take the poses' errors as independent: what all have alike in camera axes, as"
    " of a principal point, moves the lever arm by as much (calibrate mounting counts it)"
)
OPTIMISTIC = 0.25  # variance factor below which standard deviations are a setting


@dataclass(frozen=True)
class SimilarityOptions:
    """What the files of a flight do not say.

    Parameters
    ----------
    pose_sigma : PoseSigma
        Of poses whose file has no standard deviations.
    antenna_sigma_m : tuple of float or None
        Horizontal and vertical, in the place of what the table has.
    ground : Path or None
        Ground points.
    points : Path or None
        Image observations of ground points, where the poses' file has none.
    camera : Path or None
        camera.toml, where the poses' file has none.
    places : PlaceOptions
        CRS of antenna positions and ground points.
    photo : Path or None
        An image of the camera.
    date : str
        Of the data, ISO.
    """

    pose_sigma: PoseSigma = field(default_factory=PoseSigma)
    antenna_sigma_m: tuple[float, float] | None = None
    ground: Path | None = None
    points: Path | None = None
    camera: Path | None = None
    places: PlaceOptions = field(default_factory=PlaceOptions)
    photo: Path | None = None
    date: str = ""


def calibrate_similarity(
    cameras: Path, antenna: Path, options: SimilarityOptions
) -> CalibratedMounting:
    """Estimate the lever arm of a flight from adjusted poses in any frame.

    Parameters
    ----------
    cameras : Path
        Adjusted poses.
    antenna : Path
        Antenna positions at exposures by the names of the images, or the file of Metashape whose
        references they are.
    options : SimilarityOptions
        What the files do not say.

    Returns
    -------
    CalibratedMounting
        Each component with its verdict.

    Raises
    ------
    InputError
        A file is wrong, or they do not belong together.
    """
    camera = read_camera_poses(cameras)
    plane = camera.plane
    fixes = read_positions(antenna, options.places, plane)
    rows, own, notes = joined(camera.images, fixes.names, cameras, antenna, 1)
    notes = (*camera.notes, *notes)
    camera, order = camera.taken(rows), own
    position = fixes.position[order]
    antenna_cov, more = _antenna_cov(fixes, options, len(order), order)
    notes += more
    first = similarity(camera.position, position)
    scale = 1.0 if first is None or not first.scale > 0.0 else first.scale
    if camera.cov is None:
        notes += (f"{cameras.name} has no standard deviations: {options.pose_sigma}",)
    pose_cov = camera.with_sigma(options.pose_sigma, scale)
    poses = FlightPoses(camera.position, camera.C, pose_cov, position, antenna_cov)
    ground = GroundPoints()
    if options.ground is not None:
        ground, more = _ground(camera, cameras, fixes.plane, options, scale)
        notes += more
    result = _estimated(poses, ground, camera, cameras, antenna)
    _refuse_attitudes(result, poses, camera, cameras)
    time = None if fixes.time is None else fixes.time[order]
    result, notes = _with_correlation(result, poses, notes)
    direction = flight_direction(position, result.frame.rotation @ camera.C, time)
    if direction is not None:
        notes += (_of_direction(result, direction),)
    notes += _as_they_stand(camera, position, fixes.plane)
    notes += (ALIKE,)
    inputs = [cameras, antenna, *(p for p in (options.ground, options.points) if p is not None)]
    sensors = () if camera.block is None else camera.block.cameras
    origin = provenance(inputs, sensors, options.photo, options.date or camera.date)
    return _calibrated(result, direction, poses, notes, origin.given, camera.images, inputs)


def _antenna_cov(
    fixes: Positions, options: SimilarityOptions, n: int, rows: Any
) -> tuple[Array, tuple[str, ...]]:
    if options.antenna_sigma_m is None and fixes.cov is not None:
        return fixes.cov[rows], ()
    horizontal, vertical = options.antenna_sigma_m or ANTENNA_M
    cov = np.diag(np.square([horizontal, horizontal, vertical]))
    notes: tuple[str, ...] = ()
    if options.antenna_sigma_m is None:
        notes = (
            f"{fixes.path.name} has no standard deviations: {1e3 * horizontal:g} mm horizontal,"
            f" {1e3 * vertical:g} mm vertical",
        )
    return np.broadcast_to(cov, (n, 3, 3)).copy(), notes


def _ground(
    camera: CameraPoses,
    cameras: Path,
    plane: TangentPlane | None,
    options: SimilarityOptions,
    scale: float,
) -> tuple[GroundPoints, tuple[str, ...]]:
    """Return ground points in both frames: surveyed, and intersected from their images."""
    path = options.ground
    assert path is not None
    surveyed = _surveyed(path, cameras, camera, options.places, plane)
    block = camera.block
    if options.points is not None:
        block = read_measured_block(options.points)
    own = () if camera.block is None else camera.block.cameras
    sensors = own if options.camera is None else (read_camera_toml(options.camera),)
    if block is None or not len(block.measured.observations):
        raise InputError.at_line(
            cameras, None, "has no image observations of ground points; give them by --points"
        )
    if not sensors:
        raise InputError.at_line(
            cameras, None, "has no interior orientation; give --camera camera.toml"
        )
    seen, names = block.measured.observations, block.measured.points
    row_by_image = {name: k for k, name in enumerate(camera.images)}
    pose = np.array([row_by_image.get(name, -1) for name in block.measured.images])[seen.image]
    model, model_cov, rows, notes = [], [], [], []
    for row, name in enumerate(surveyed.names):
        if name not in names:
            continue
        use = (seen.point == names.index(name)) & (pose >= 0)
        if use.sum() < 2:
            continue
        sensor = sensors[0]
        if len(sensors) > 1:
            sensor = sensors[int(block.camera[seen.image[use][0]])]
        sigma = float(np.median(seen.sigma_px[use])) / sensor.of("f")
        k = pose[use]
        try:
            P, cov, factor = intersected_target(
                camera.position[k], camera.C[k], rays_of(sensor, seen.uv[use]), sigma
            )
        except DataError as refusal:
            raise InputError(f"{cameras}: ground point {name}: {refusal}") from None
        miss_px = np.sqrt(factor) * sigma * sensor.of("f")
        if miss_px > MISS_PX and factor > MISS_FACTOR:
            raise InputError(
                f"{cameras}: rays of {len(k)} images miss ground point {name} by {miss_px:.0f} px"
                f" rms (limit {MISS_PX:g} px): poses, camera and image observations are not of one"
                " block, or attitudes count in other angles"
            )
        # neighbouring poses have their error in common
        cov = cov * max(factor, 1.0) + (options.pose_sigma.position_m / scale) ** 2 * np.eye(3)
        model.append(P)
        model_cov.append(cov)
        rows.append(row)
    if not rows:
        raise InputError.at_line(
            path,
            None,
            f"none of its {len(surveyed.names)} points, such as {surveyed.names[0]}, is measured in"
            " two images; measure them, or leave --ground out",
        )
    if len(rows) < len(surveyed.names):
        notes.append(f"{len(rows)} of {len(surveyed.names)} ground points are measured in images")
    assert surveyed.cov is not None
    ground = GroundPoints(
        np.array(model), np.array(model_cov), surveyed.position[rows], surveyed.cov[rows]
    )
    return ground, tuple(notes)


def _surveyed(
    path: Path,
    cameras: Path,
    camera: CameraPoses,
    places: PlaceOptions,
    plane: TangentPlane | None,
) -> Positions:
    """Return ground control in the axes of the antenna positions."""
    crs = places.crs
    if path.resolve() == cameras.resolve() and camera.block is not None:
        ground, crs = camera.block.ground, crs or camera.block.crs
    else:
        ground = read_ground_points(path)
    if ground is None or ground.check.all():
        raise InputError.at_line(path, None, "has no ground control; leave --ground out")
    use = ~ground.check
    names = tuple(name for name, taken in zip(ground.points, use, strict=True) if taken)
    table = NamedPositions(names, ground.position_m[use], False, ground.cov[use])
    if plane is None:
        return Positions(path, names, table.position, table.cov)
    if crs is None:
        raise InputError.at_line(
            path, None, "antenna positions are on the Earth; give the CRS of the points, --crs"
        )
    return positions_of(path, table, replace(places, crs=crs), plane)


def _estimated(
    poses: FlightPoses, ground: GroundPoints, camera: CameraPoses, cameras: Path, antenna: Path
) -> SimilarityLeverArm:
    """Estimate the lever arm; say of what does not fit in which other way it would."""
    try:
        return similarity_lever_arm(poses, ground)
    except DataError as refusal:
        other = ""
        if len(poses.position) > 3:
            other = advice(_other_readings(poses, ground, camera, cameras, antenna))
        raise InputError(f"{cameras}, {antenna}: {refusal}{other}") from None


def _other_readings(
    poses: FlightPoses, ground: GroundPoints, camera: CameraPoses, cameras: Path, antenna: Path
) -> tuple[str, ...]:
    """Return the ways in which antenna positions, ground points or attitudes would fit."""

    def misfit(poses: FlightPoses, ground: GroundPoints) -> float:
        result = similarity_lever_arm(poses, ground)
        viewing = (result.frame.rotation @ poses.C_rc)[:, 2, 2].mean()
        return float(np.sqrt((result.residual_m**2).mean())) if viewing < DOWNWARDS else np.inf

    n, good = len(poses.antenna_m), 0.1 * LONGEST_M
    first = similarity(poses.position, poses.antenna_m)
    as_it_is = LONGEST_M
    if first is not None:
        off = first.points(poses.position) - poses.antenna_m
        as_it_is = max(as_it_is, float(np.sqrt((off**2).mean())))

    def of_axes(position: Array, rows: bool) -> dict[str, Array]:
        """Readings of positions whose scale is estimated."""
        return {
            key: value
            for key, value in position_readings(position).items()
            if "metres" not in key and "feet" not in key and (rows or "rows" not in key)
        }

    ways = []
    words = named_reading(
        as_it_is,
        of_axes(poses.antenna_m, rows=True),
        lambda value: misfit(replace(poses, antenna_m=value), ground),
        good,
    )
    if words:
        ways.append(f"of {antenna.name} {words}")
    elif len(ground.model):
        words = named_reading(
            as_it_is,
            of_axes(np.concatenate([poses.antenna_m, ground.surveyed_m]), rows=False),
            lambda value: misfit(
                replace(poses, antenna_m=value[:n]), replace(ground, surveyed_m=value[n:])
            ),
            good,
        )
        if words:
            ways.append(f"of {antenna.name} and the ground points alike {words}")
    words = named_reading(
        as_it_is,
        attitude_readings(poses.C_rc, camera.opk),
        lambda value: misfit(replace(poses, C_rc=value), ground),
        good,
    )
    if words and not any("rows" in way for way in ways):
        ways.append(f"of {cameras.name} {words}")
    return (", or ".join(ways),) if ways else ()


def _refuse_attitudes(
    result: SimilarityLeverArm, poses: FlightPoses, camera: CameraPoses, cameras: Path
) -> None:
    """Refuse attitudes of which another reading leaves the cameras level.

    A lever arm of centimetres does not show in the residuals of what attitudes it is turned by.
    """
    if result.tilt_deg < TILTED_DEG:
        return
    R = result.frame.rotation

    def tilt(C: Array) -> float:
        up = (R @ C)[:, 2]
        mean = up.mean(axis=0) / np.linalg.norm(up.mean(axis=0))
        return float(np.degrees(np.sqrt((np.cross(up, mean) ** 2).sum(axis=1).mean())))

    readings = attitude_readings(poses.C_rc, camera.opk)
    words = named_reading(result.tilt_deg, readings, tilt, LEVEL_DEG, 2.5)
    if words:
        raise InputError(
            f"{cameras}: cameras tilt by {result.tilt_deg:.0f} deg rms (limit {TILTED_DEG:g} deg"
            f" where another reading leaves {LEVEL_DEG:g}){advice((f'of {cameras.name} {words}',))}"
        )


def _with_correlation(
    result: SimilarityLeverArm, poses: FlightPoses, notes: tuple[str, ...]
) -> tuple[SimilarityLeverArm, tuple[str, ...]]:
    """Grow the standard errors where residuals of neighbouring images are alike.

    Of n values with a correlation rho of neighbours the mean has the weight of n (1 - rho) /
    (1 + rho) independent ones.
    """
    rho = neighbour_correlation(result.residual_m)
    if result.variance_factor < OPTIMISTIC:
        rms = float(np.sqrt((result.residual_m**2).mean()))
        usual = float(np.sqrt(np.median(np.trace(poses.antenna_cov, axis1=1, axis2=2)) / 3.0))
        notes += (
            f"residuals of {rms:.2g} m rms are smaller than the antenna's standard deviations say"
            f" ({usual:.2g} m): these are a setting rather than a result; give --antenna-sigma",
        )
    if not (rho > 0.0).any():
        return result, notes
    growth = (1.0 + rho) / (1.0 - rho)
    horizontal, vertical = float(growth[:2].max()), float(growth[2])
    up = np.abs(result.vertical) > 0.7
    each = np.ones(10)
    each[:3] = horizontal, horizontal, vertical
    each[ARM] = np.where(up, vertical, horizontal)
    root = np.sqrt(each)
    notes += (
        "residuals of neighbouring images are alike (correlations east, north, up "
        + ", ".join(f"{value:.2f}" for value in rho)
        + "): time-correlated errors of the fixes or a bent block; standard errors grown by"
        f" {np.sqrt(horizontal):.1f} (horizontal) and {np.sqrt(vertical):.1f} (vertical)",
    )
    return replace(result, cov=result.cov * np.outer(root, root)), notes


def _along(result: SimilarityLeverArm, direction: FlightDirection) -> tuple[float, float]:
    """Return the lever arm along the flight direction and its standard error, m."""
    f = direction.in_camera
    return float(f @ result.lever_arm_m), float(np.sqrt(f @ result.cov[ARM, ARM] @ f))


def _of_direction(result: SimilarityLeverArm, direction: FlightDirection) -> str:
    """Say what a lever arm along the flight direction may be besides."""
    value, sigma = _along(result, direction)
    along, across = direction.split_rms(result.residual_m)
    text = (
        f"along the flight direction (camera {direction.words}) the lever arm is {value:+.3f} +-"
        f" {sigma:.3f} m; a delay of the exposures is in it, which this calibration takes as zero"
    )
    if direction.speed_mps is not None:
        text += (
            f": 1 ms is {direction.speed_mps:.1f} mm at {direction.speed_mps:.1f} m/s, all of it"
            f" {1e3 * abs(value) / direction.speed_mps:.0f} ms"
        )
    if along > STAMPS * across:
        text += (
            f"; residuals along it are {along / across:.1f} times those across ({along:.2f} and"
            f" {across:.2f} m rms): stamps of the exposures scatter"
        )
    return text


def _as_they_stand(
    camera: CameraPoses, position: Array, plane: TangentPlane | None
) -> tuple[str, ...]:
    """Say how far poses with a place on the Earth are from the antenna positions."""
    if plane is None or camera.frame == "own":
        return ()
    off = camera.in_plane(plane).position - position
    words = ", ".join(
        f"{name} {m:+.2f} +- {s:.2f}"
        for name, m, s in zip(
            ("east", "north", "up"), off.mean(axis=0), off.std(axis=0, ddof=1), strict=True
        )
    )
    return (f"adjusted centres minus antenna positions, as they stand: {words} m",)


def _reasons(result: SimilarityLeverArm, direction: FlightDirection | None) -> dict[int, str]:
    """Return why components are not determined, by axis."""
    reasons = {
        axis: result.verdict(axis).partition(" not determined ")[2]
        for axis in np.flatnonzero(~result.determined).tolist()
    }
    if direction is None:
        return reasons
    value, sigma = _along(result, direction)
    along, across = direction.split_rms(result.residual_m)
    stamps = along > STAMPS * across and along**2 - across**2 > RULER_M**2
    long = abs(value) - 3.0 * sigma > LONG_M
    for axis in np.flatnonzero(np.abs(direction.in_camera) > SAME_AXIS).tolist():
        if stamps or long:
            text = (
                f"it lies along the flight direction, where residuals are {along / across:.1f}"
                " times those across"
                if stamps
                else f"{value:+.2f} m along the flight direction (limit {LONG_M:g} m)"
            )
            why = f"{text}: a delay of the exposures; calibrate mounting with the flight tells"
            reasons[axis] = f"{reasons[axis]}; {why}" if axis in reasons else f"({why})"
    return reasons


def _calibrated(
    result: SimilarityLeverArm,
    direction: FlightDirection | None,
    poses: FlightPoses,
    notes: tuple[str, ...],
    origin: dict[str, Any],
    images: Sequence[str],
    inputs: list[Path],
) -> CalibratedMounting:
    reasons = _reasons(result, direction)
    components = []
    for axis in range(3):
        value = f"{result.lever_arm_m[axis]:+.4f} +- {result.sigma_m[axis]:.4f} m"
        if direction is not None and abs(direction.in_camera[axis]) > SAME_AXIS:
            value += ", lever arm and delay of the exposures times speed as one"
        components.append(
            (f"antenna_m {'xyz'[axis]}", "not determined", reasons[axis].strip())
            if axis in reasons
            else (f"antenna_m {'xyz'[axis]}", "determined", value)
        )
    parts = result.summary().split("; ")
    headline = f"{parts[0]}; {parts[-1] if parts[-1].startswith('res') else '; '.join(parts[-2:])}"
    words = (
        f"{'xyz'[axis]} {text}" if word == "determined" else f"{'xyz'[axis]} {word} {text}"
        for axis, (_, word, text) in enumerate(components)
    )
    verdict = (headline, *(f"{name} {word}: {text}" for name, word, text in components))
    reason = ", ".join(words) if reasons else ""
    mounting, _ = lever_arm_alone(
        "calibrate similarity", result.lever_arm_m, result.cov[ARM, ARM], reason, verdict, origin
    )
    return calibrated(
        mounting,
        "Lever arm in flight",
        headline,
        components,
        notes,
        _document(result, direction, images, inputs),
        lambda: _charts(result, direction, poses),
    )


def _document(
    result: SimilarityLeverArm,
    direction: FlightDirection | None,
    images: Sequence[str],
    inputs: Sequence[Path],
) -> dict[str, Any]:
    document: dict[str, Any] = {
        **picked(result, "lever_arm_m", "sigma_m", "determined", "vertical_correlation"),
        **picked(result, "translation_correlation", "variance_factor", "factor_limit"),
        "scale": result.frame.scale,
        "images": len(images),
        "ground_points": len(result.ground_residual_m),
        "residual_rms_m": np.sqrt((result.residual_m**2).mean(axis=0)),
        "inputs": inputs,
    }
    if direction is not None:
        value, sigma = _along(result, direction)
        along, across = direction.split_rms(result.residual_m)
        document["along_flight_direction"] = {
            "lever_arm_m": value,
            "sigma_m": sigma,
            "speed_mps": direction.speed_mps,
            "residual_rms_m": along,
            "residual_across_rms_m": across,
        }
    return document


def _charts(
    result: SimilarityLeverArm, direction: FlightDirection | None, poses: FlightPoses
) -> tuple[Chart, ...]:
    from ...report.figures.mounting import Residuals, residuals

    n = len(result.residual_m)
    course = np.full(n, np.nan) if direction is None else direction.course_deg
    return residuals(Residuals(result.residual_m, course, poses.antenna_m))
