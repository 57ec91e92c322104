"""`insgnss calibrate similarity`: adjusted poses, antenna positions and ground points, as files.

Beside what the adjustment of `photogrammetry.lever_arm.similarity` says of itself, its residuals
are held against what it takes for granted: that errors of neighbouring images are independent, and
that exposures have the stamps of the antenna positions.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from ...base.errors import DataError, InputError
from ...base.files import pick_attributes
from ...base.units import FOOT_M
from ...geodesy.conventions import Change
from ...geodesy.explain import explain
from ...geodesy.frames import TangentPlane
from ...geodesy.readings import advice, of_attitudes, of_positions, suspected_readings
from ...geodesy.similarity import similarity
from ...io.formats.blocks.reading import read_measured_block
from ...io.formats.returned.cameras import read_camera
from ...records import Array
from ...report.charts.chart import Chart
from ..comparison.hints import Hints
from ..lever_arm.angle_readings import better_angles
from ..lever_arm.flight_direction import (
    FlightDirection,
    flight_direction,
    misread_angles,
    neighbour_correlation,
)
from ..lever_arm.records import LONGEST_LEVER_ARM_M, RULER_M, PosedAntennas
from ..lever_arm.similarity import (
    ARM_AT,
    PairedPoints,
    SimilarityLeverArm,
    similarity_lever_arm,
    tilt_of,
)
from .intersections import intersect_point, surveyed_points
from .options import SimilarityOptions
from .poses import (
    Positions,
    compared_with,
    join_by_name,
    read_camera_poses,
    read_positions,
    refuse_distant,
)
from .products import (
    DETERMINED,
    NOT_DETERMINED,
    CalibratedMounting,
    of_lever_arm,
    provenance,
)
from .records import CameraPoses

ANTENNA_SIGMAS_M = (0.02, 0.03)  # horizontal, vertical, where the table has no standard deviations
SAME_AXIS = 0.5  # cosine of a camera axis and the flight direction that share their fate
LONG_M = 3.0  # along the flight direction: beyond, few aircraft have room
STAMPS = 2.0  # residuals along the flight direction over those across it: of the stamps
DOWNWARDS = -0.3  # vertical part of the mean viewing direction of what is named
TILTED_DEG, LEVEL_DEG = 20.0, 10.0  # rms tilts beyond which, and below which, a reading is named
MISS_PX, MISS_FACTOR = 5.0, 25.0  # rays to a ground point, and over their covariance: other data
ALIKE = (
    "standard errors take the poses' errors as independent: an error common to all poses in"
    " camera axes, as of a principal point, moves the lever arm by as much (calibrate"
    " mounting accounts for it)"
)
SAME_SCALE = 3e-3  # of the scale to that of a foot: a block of a free net has it once in a hundred
OPTIMISTIC = 0.25  # variance factor below which standard deviations are a setting


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
    hints = Hints(crs=options.crs, geoid=options.geoid, shift=options.shift)
    camera = read_camera_poses(cameras, hints, only=False)
    plane = camera.plane
    fixes = read_positions(antenna, options, plane)
    rows, antenna_rows, notes = join_by_name(camera.images, fixes.names, cameras, antenna, 1)
    notes = (*camera.notes, *notes)
    camera, order = camera.taken(rows), antenna_rows
    position = fixes.position[order]
    antenna_cov, more = _antenna_cov(fixes, options)
    notes += more
    first = similarity(camera.position, position)
    scale = 1.0 if first is None or not first.scale > 0.0 else first.scale
    if camera.cov is None:
        notes += (f"{cameras.name} has no standard deviations: {options.sigma_of_poses}",)
    pose_cov = camera.with_sigma(options.sigma_of_poses, scale)
    poses = PosedAntennas(camera.position, camera.C_rc, pose_cov, position, antenna_cov[order])
    ground = PairedPoints()
    compared: Callable[[], str] = str  # without a place there is nothing to compare
    if options.ground is not None:
        ground, more = _ground(camera, cameras, fixes.plane, options, scale)
        notes += more
    if fixes.plane is not None:
        notes += refuse_distant(camera, hints, position, fixes.plane, str(antenna))
        compared = partial(compared_with, camera, hints, position, fixes.plane, str(antenna))
    result = _estimated(poses, ground, camera, (cameras, antenna), compared)
    _refuse_attitudes(result, poses, camera, cameras)
    time = None if fixes.time is None else fixes.time[order]
    result, notes = _with_correlation(result, poses, notes)
    C_mc = result.frame.rotation @ camera.C_rc
    notes += misread_angles(
        C_mc, result.frame.rotation, camera.opk, (position, time), cameras.name
    ) or better_angles(poses, ground, camera.opk, _growth(result).max(), cameras.name)
    direction = flight_direction(position, C_mc, time)
    along_flight = None if direction is None else _AlongFlight.of(result, direction)
    if along_flight is not None:
        notes += (along_flight.note,)
    notes += _of_feet(result.frame.scale, antenna.name)
    notes += (*_as_they_stand(camera, position, fixes.plane), ALIKE)
    inputs = [cameras, antenna, *(p for p in (options.ground, options.points) if p is not None)]
    origin = provenance(inputs, camera.cameras, options.photo, options.date or camera.date)
    return _calibrated(result, along_flight, poses, notes, origin, inputs)


def _antenna_cov(fixes: Positions, options: SimilarityOptions) -> tuple[Array, tuple[str, ...]]:
    """Return the covariances of the antenna positions, and what was taken for granted of them."""
    horizontal, vertical = options.antenna_sigma_m or ANTENNA_SIGMAS_M
    stated = (horizontal, horizontal, vertical)
    if options.antenna_sigma_m is not None:
        return replace(fixes, cov=None).with_sigma(stated), ()
    note = (
        f"{fixes.path.name} has no standard deviations: {1e3 * horizontal:g} mm horizontal,"
        f" {1e3 * vertical:g} mm vertical"
    )
    return fixes.with_sigma(stated), (note,) if fixes.cov is None else ()


def _ground(
    camera: CameraPoses,
    cameras: Path,
    plane: TangentPlane | None,
    options: SimilarityOptions,
    scale: float,
) -> tuple[PairedPoints, tuple[str, ...]]:
    """Return ground points in both frames: surveyed, and intersected from their images."""
    path = options.ground
    assert path is not None
    surveyed = surveyed_points(path, cameras, camera, options, plane)
    block = camera.block
    if options.points is not None:
        block = read_measured_block(options.points)
    sensors = camera.cameras if options.camera is None else (read_camera(options.camera),)
    if block is None or not len(block.measured.observations):
        raise InputError.in_file(
            cameras, "has no image observations of ground points; give them by --points"
        )
    if not sensors:
        raise InputError.in_file(cameras, "has no interior orientation; give --camera camera.toml")
    model, model_cov, rows, notes = [], [], [], []
    for row, name in enumerate(surveyed.names):
        if name not in block.measured.points:
            continue
        point = intersect_point(camera, block, name, sensors, "ground point")
        if point is None:
            continue
        if point.miss_px > MISS_PX and point.factor > MISS_FACTOR:
            raise InputError(
                f"{cameras}: rays of {point.images} images miss ground point {name} by"
                f" {point.miss_px:.0f} px rms (limit {MISS_PX:g} px): poses, camera and image"
                " observations are not of one block, or attitudes count in other angles"
            )
        model.append(point.position)
        # neighbouring poses have their error in common
        model_cov.append(point.cov + (options.sigma_of_poses.position_m / scale) ** 2 * np.eye(3))
        rows.append(row)
    if not rows:
        raise InputError.in_file(
            path,
            f"none of its {len(surveyed.names)} points, such as {surveyed.names[0]}, is measured in"
            " two images; measure them, or leave --ground out",
        )
    if len(rows) < len(surveyed.names):
        notes.append(f"{len(rows)} of {len(surveyed.names)} ground points are measured in images")
    assert surveyed.cov is not None
    ground = PairedPoints(
        np.array(model), np.array(model_cov), surveyed.position[rows], surveyed.cov[rows]
    )
    return ground, tuple(notes)


def _estimated(
    poses: PosedAntennas,
    ground: PairedPoints,
    camera: CameraPoses,
    files: tuple[Path, Path],
    compared: Callable[[], str],
) -> SimilarityLeverArm:
    """Estimate the lever arm; say of what does not fit in which other way it would.

    Poses and antenna positions stand in `files`; `compared` says how their places differ.
    """
    try:
        return similarity_lever_arm(poses, ground)
    except DataError as refusal:
        names = (files[0].name, files[1].name)
        reading = _other_readings(poses, ground, camera, *names) if len(poses.position) > 3 else ""
        reading = reading or f"; {compared()}".rstrip("; ")
        raise InputError(f"{files[0]}, {files[1]}: {refusal}{reading}") from None


def _other_readings(
    poses: PosedAntennas, ground: PairedPoints, camera: CameraPoses, cameras: str, antenna: str
) -> str:
    """Return the ways in which antenna positions, ground points or attitudes would fit."""

    def misfit(data: tuple[PosedAntennas, PairedPoints]) -> float:
        result = similarity_lever_arm(*data)
        viewing = (result.frame.rotation @ data[0].C_rc)[:, 2, 2].mean()
        return float(np.sqrt((result.residual_m**2).mean())) if viewing < DOWNWARDS else np.inf

    Paired = tuple[PosedAntennas, PairedPoints]

    def of_antenna(data: Paired, change: Change) -> Paired:
        return data[0].changed(change, "antenna_m"), data[1]

    def of_survey(data: Paired, change: Change) -> Paired:
        return of_antenna(data, change)[0], replace(data[1], surveyed_m=change(data[1].surveyed_m))

    def of_cameras(data: Paired, change: Change) -> Paired:
        return data[0].changed(change, "C_rc"), data[1]

    candidates = [  # without units: the scale is estimated
        *suspected_readings(antenna, of_positions(units=False), of_antenna),
        *suspected_readings(cameras, of_attitudes(camera.opk), of_cameras),
    ]
    if len(ground.model):
        each = f"each of {antenna} and the ground points"
        candidates += suspected_readings(each, of_positions(units=False, rows=False), of_survey)
    return advice(explain((poses, ground), candidates, misfit, 0.1 * LONGEST_LEVER_ARM_M))


def _refuse_attitudes(
    result: SimilarityLeverArm, poses: PosedAntennas, camera: CameraPoses, cameras: Path
) -> None:
    """Refuse attitudes of which another reading leaves the cameras level.

    A lever arm of centimetres does not show in the residuals of what attitudes it is turned by.
    """
    if result.tilt_deg < TILTED_DEG:
        return
    R = result.frame.rotation

    candidates = suspected_readings(
        cameras.name, of_attitudes(camera.opk), lambda C, change: change(C)
    )
    explanation = explain(poses.C_rc, candidates, lambda C: tilt_of(R @ C)[1], LEVEL_DEG)
    if explanation is not None:
        raise InputError(
            f"{cameras}: cameras tilt by {result.tilt_deg:.0f} deg rms (limit {TILTED_DEG:g} deg"
            f" where another reading leaves {LEVEL_DEG:g}){advice(explanation)}"
        )


def _with_correlation(
    result: SimilarityLeverArm, poses: PosedAntennas, notes: tuple[str, ...]
) -> tuple[SimilarityLeverArm, tuple[str, ...]]:
    """Grow the standard errors where residuals of neighbouring images are alike.

    Of n values with a correlation rho of neighbours the mean has the weight of n (1 - rho) /
    (1 + rho) independent ones.
    """
    if result.variance_factor < OPTIMISTIC:
        rms = float(np.sqrt((result.residual_m**2).mean()))
        factor = 1.0 / np.sqrt(result.variance_factor)
        notes += (
            f"residuals of {rms:.2g} m rms are {factor:.1f} times smaller than the standard"
            " deviations of poses and antenna positions allow; the standard errors are too large by"
            " as much: state those of the antenna (--antenna-sigma), or correct those of the poses",
        )
    rho, growth = neighbour_correlation(result.residual_m), _growth(result)
    if not (rho > 0.0).any():
        return result, notes
    horizontal, vertical = float(growth[:2].max()), float(growth[2])
    up = np.abs(result.vertical) > 0.7
    each = np.ones(10)
    each[:3] = horizontal, horizontal, vertical
    each[ARM_AT] = np.where(up, vertical, horizontal)
    root = np.sqrt(each)
    notes += (
        "residuals of neighbouring images are alike (correlations east, north, up "
        + ", ".join(f"{value:.2f}" for value in rho)
        + "): time-correlated errors of the fixes or a bent block; standard errors grown by"
        f" {np.sqrt(horizontal):.1f} (horizontal) and {np.sqrt(vertical):.1f} (vertical)",
    )
    return replace(result, cov=result.cov * np.outer(root, root)), notes


def _growth(result: SimilarityLeverArm) -> Array:
    """Return by how much the variance of a mean grows as neighbouring residuals are alike (3,)."""
    rho = neighbour_correlation(result.residual_m)
    return (1.0 + rho) / (1.0 - rho)


@dataclass(frozen=True, eq=False)
class _AlongFlight:
    """The lever arm along the flight direction, where a delay of the exposures looks as it does.

    Parameters
    ----------
    direction : FlightDirection
        The direction.
    value, sigma : float
        Of the lever arm along it, m.
    along, across : float
        Rms residuals along and across it, m.
    """

    direction: FlightDirection
    value: float
    sigma: float
    along: float
    across: float

    @classmethod
    def of(cls, result: SimilarityLeverArm, direction: FlightDirection) -> "_AlongFlight":
        """Return that of an adjustment."""
        value, sigma = direction.lever_arm(result.lever_arm_m, result.cov[ARM_AT, ARM_AT])
        return cls(direction, value, sigma, *direction.split_rms(result.residual_m))

    @property
    def note(self) -> str:
        """What the lever arm may be besides."""
        speed = self.direction.speed_mps
        text = (
            f"along the flight direction (camera {self.direction.words}) the lever arm is"
            f" {self.value:+.3f} +- {self.sigma:.3f} m; a delay of the exposures is in it, which"
            " this calibration takes as zero"
        )
        if speed is not None:
            text += (
                f": 1 ms is {speed:.1f} mm at {speed:.1f} m/s, all of it"
                f" {1e3 * abs(self.value) / speed:.0f} ms"
            )
        if self.along > STAMPS * self.across:
            text += (
                f"; residuals along it are {self.along / self.across:.1f} times those across"
                f" ({self.along:.2f} and {self.across:.2f} m rms): stamps of the exposures scatter"
            )
        return text

    @property
    def refusal(self) -> str:
        """Why the components along it are not determined; empty where they may be."""
        along, across = self.along, self.across
        stamps = along > STAMPS * across and along**2 - across**2 > RULER_M**2
        long = abs(self.value) - 3.0 * self.sigma > LONG_M
        if not (stamps or long):
            return ""
        text = (
            f"it lies along the flight direction, where residuals are {along / across:.1f} times"
            " those across"
            if stamps
            else f"{self.value:+.2f} m along the flight direction (limit {LONG_M:g} m)"
        )
        return (
            f"{text}: a delay of the exposures; calibrate mounting, which uses the flight,"
            " estimates the delay"
        )


def _of_feet(scale: float, antenna: str) -> tuple[str, ...]:
    """Ask whether antenna positions are feet where they are as many times as far apart as poses."""
    if abs(FOOT_M * scale - 1.0) > SAME_SCALE:
        return ()
    return (
        f"positions of {antenna} are {scale:.4f} times as far apart as the poses: are they feet?"
        f" The lever arm is too long by this factor if so; multiply them by {FOOT_M}",
    )


def _as_they_stand(
    camera: CameraPoses, position: Array, plane: TangentPlane | None
) -> tuple[str, ...]:
    """Say how far poses with a place on the Earth are from the antenna positions."""
    if plane is None or camera.frame == "own":
        return ()
    difference = camera.in_plane(plane).position - position
    text = ", ".join(
        f"{name} {m:+.2f} +- {s:.2f}"
        for name, m, s in zip(
            ("east", "north", "up"),
            difference.mean(axis=0),
            difference.std(axis=0, ddof=1),
            strict=True,
        )
    )
    return (f"adjusted centres minus antenna positions, as they stand: {text} m",)


def _components(
    result: SimilarityLeverArm, along_flight: _AlongFlight | None
) -> list[tuple[str, str, str]]:
    """Return name, verdict and value, or why there is none, of each axis."""
    components = []
    for axis, name in enumerate("xyz"):
        why = result.why_undetermined(axis)
        value = f"{result.lever_arm_m[axis]:+.4f} +- {result.sigma_m[axis]:.4f} m"
        if along_flight is not None and abs(along_flight.direction.in_camera[axis]) > SAME_AXIS:
            value += ", lever arm and delay of the exposures times speed as one"
            if refusal := along_flight.refusal:
                why = f"{why}; {refusal}" if why else f"({refusal})"
        word = NOT_DETERMINED if why else DETERMINED
        components.append((f"antenna_m {name}", word, why.strip() or value))
    return components


def _calibrated(
    result: SimilarityLeverArm,
    along_flight: _AlongFlight | None,
    poses: PosedAntennas,
    notes: tuple[str, ...],
    origin: dict[str, Any],
    inputs: list[Path],
) -> CalibratedMounting:
    components = _components(result, along_flight)
    each = (
        f"{name[-1]} {text}" if word == DETERMINED else f"{name[-1]} {word} {text}"
        for name, word, text in components
    )
    whole = all(word == DETERMINED for _, word, _ in components)
    return of_lever_arm(
        "similarity",
        "Lever arm in flight",
        (result.lever_arm_m, result.cov[ARM_AT, ARM_AT]),
        "" if whole else ", ".join(each),
        components,
        (
            f"{result.basis}; {result.fit}",
            *(f"{name} {word}: {text}" for name, word, text in components),
        ),
        notes,
        _document(result, along_flight, inputs),
        lambda: _charts(result, along_flight, poses),
        origin,
    )


def _document(
    result: SimilarityLeverArm, along_flight: _AlongFlight | None, inputs: Sequence[Path]
) -> dict[str, Any]:
    document: dict[str, Any] = {
        **pick_attributes(result, "lever_arm_m", "sigma_m", "determined", "vertical_correlation"),
        **pick_attributes(result, "translation_correlation", "variance_factor", "factor_limit"),
        "scale": result.frame.scale,
        "images": len(result.residual_m),
        "ground_points": len(result.ground_residual_m),
        "residual_rms_m": np.sqrt((result.residual_m**2).mean(axis=0)),
        "inputs": inputs,
    }
    if along_flight is not None:
        document["along_flight_direction"] = {
            "lever_arm_m": along_flight.value,
            "sigma_m": along_flight.sigma,
            "speed_mps": along_flight.direction.speed_mps,
            "residual_rms_m": along_flight.along,
            "residual_across_rms_m": along_flight.across,
        }
    return document


def _charts(
    result: SimilarityLeverArm, along_flight: _AlongFlight | None, poses: PosedAntennas
) -> tuple[Chart, ...]:
    from ...report.figures.mounting import Residuals, residuals

    n = len(result.residual_m)
    course = np.full(n, np.nan) if along_flight is None else along_flight.direction.course_deg
    return residuals(Residuals(result.residual_m, course, poses.antenna_m))
