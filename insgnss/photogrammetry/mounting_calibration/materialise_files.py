"""`insgnss calibrate materialise`: targets on camera and receiver, as files."""

import re
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from ...base.errors import DataError, InputError, UsageError, near
from ...base.files import pick_attributes
from ...geodesy.explain import explain
from ...geodesy.readings import advice, of_positions, suspected_readings
from ...geodesy.similarity import similarity
from ...io.formats.blocks.pose_table import NamedPositions, read_position_table
from ...records import Array
from ...records.cameras.mounting import ANTENNA_SIGMA_M
from ...report.charts.chart import Chart
from ..lever_arm.difference import lever_arm_difference
from ..lever_arm.materialisation import (
    CameraTargets,
    MaterialisedLeverArm,
    ReceiverSession,
    ReceiverTargets,
    Targets,
    camera_targets,
    materialised_lever_arm,
    receiver_targets,
)
from ..lever_arm.records import RULER_M
from .intersections import intersect_point
from .options import MaterialiseOptions
from .poses import Positions, is_block, read_camera_poses
from .products import CalibratedMounting, of_lever_arm, provenance

PHASE_CENTRE_SIGMA_M = 5e-3  # where a table has no standard deviation of the phase centre
LARGEST_SENSOR_M = 3.0  # of targets on a sensor from each other: others are in another unit
CLOSE_M = 0.005  # targets that fit in another reading
TIE_POINT = re.compile(r"T_*\d+")  # names that a reader of blocks gives to points without one


def calibrate_materialise(
    camera: Path, mounted: Path, options: MaterialiseOptions
) -> CalibratedMounting:
    """Estimate the lever arm of mounted sensors by targets on both.

    Parameters
    ----------
    camera : Path
        Targets on the camera and, in the same axes, the pose of an image of its own: a table and
        `options.pose`, or a block of a photogrammetry program with both.
    mounted : Path
        Targets on camera and receiver in one block of the aircraft, of any axes and unit.
    options : MaterialiseOptions
        The sessions of the receiver, and what files do not say.

    Returns
    -------
    CalibratedMounting
        The lever arm with its verdict.

    Raises
    ------
    InputError
        A file is wrong, or they do not belong together.
    """
    _refuse_twice(
        [path for path in (mounted, *options.receiver, options.after) if path is not None]
    )
    camera_points, sessions = (
        _points(camera),
        [_session(path, options) for path in options.receiver],
    )
    if not sessions:
        raise UsageError("calibrate materialise: --receiver needs one file for each session")
    on_receiver = _common(sessions, options.antenna_name)
    receiver = _receiver(sessions, on_receiver, options)
    blocks = [_points(path) for path in (mounted, *([options.after] if options.after else []))]
    on_camera = [
        name for name in camera_points.names if all(name in block.names for block in blocks)
    ]
    on_camera = [name for name in on_camera if name not in on_receiver]
    for block in blocks:
        for kind, count in (
            ("camera", len(on_camera)),
            ("receiver", sum(name in block.names for name in on_receiver)),
        ):
            if count < 3:
                raise InputError.in_file(
                    block.path,
                    f"{count} targets of the {kind} by its names ({', '.join(block.names[:4])},"
                    " ...); a frame needs 3 that stand on no line",
                )
    used = [name for name in on_receiver if all(name in block.names for block in blocks)]
    pose, pose_cov = _own_pose(camera_points, camera, options)
    targets = camera_targets(
        _targets(camera_points, on_camera, options.target_sigma_m), *pose, pose_cov
    )
    rows = [on_receiver.index(name) for name in used]
    on_both = Targets(receiver.targets.position[rows], receiver.targets.cov[rows])
    receiver = replace(receiver, targets=on_both)
    results = [_estimated(targets, receiver, block, on_camera, used, options) for block in blocks]
    inputs = [camera, mounted, *options.receiver]
    inputs += [path for path in (options.pose, options.after) if path is not None]
    cameras = () if camera_points.poses is None else camera_points.poses.cameras
    origin = provenance(inputs, cameras, options.photo, options.date)
    difference, moved = _between(results)
    notes = (receiver.summary(), *difference)
    return _calibrated(results, receiver, moved, notes, origin, inputs)


def _refuse_twice(files: Sequence[Path]) -> None:
    """Refuse one measurement in the place of two."""
    resolved = [path.resolve() for path in files]
    twice = next((p for k, p in enumerate(files) if resolved[k] in resolved[:k]), None)
    if twice is not None:
        raise UsageError(
            f"calibrate materialise: {twice} is given twice; sessions are independent"
            " measurements, one file each"
        )


def _points(path: Path) -> Positions:
    """Return the targets of a table, or those that a block intersects."""
    if not path.exists():
        raise InputError.in_file(path, "does not exist; check the path")
    if not is_block(path):
        table = read_position_table(path)
        if table.geodetic:
            raise InputError.in_file(path, "targets stand in Cartesian axes; give x, y, z")
        _refuse_large(path, table)
        return Positions(path, table.names, table.position, table.cov)
    poses = read_camera_poses(path)
    assert poses.block is not None
    if not poses.cameras:
        raise InputError.in_file(
            path, "has no interior orientation of its camera; give a project that has one"
        )
    targets = {
        name: target
        for name in poses.block.measured.points
        if not TIE_POINT.fullmatch(name)
        and (target := intersect_point(poses, poses.block, name, poses.cameras, "target"))
    }
    if not targets:
        raise InputError.in_file(path, "no target is measured in two images; measure more of them")
    position = np.array([target.position for target in targets.values()])
    cov = np.array([target.cov for target in targets.values()])
    return Positions(path, tuple(targets), position, cov, poses=poses)


def _targets(points: Positions, names: Sequence[str], sigma_m: float) -> Targets:
    """Return some of the targets of a file, in this order."""
    rows = [points.names.index(name) for name in names]
    try:
        return Targets(points.position[rows], points.with_sigma(sigma_m)[rows])
    except DataError as refusal:
        raise InputError(f"{points.path}: {refusal}") from None


def _refuse_large(path: Path, table: NamedPositions) -> None:
    """Refuse targets in millimetres, where the table says metres by its standard deviations."""
    extent = float(np.ptp(table.position, axis=0).max())
    if table.cov is not None and extent > 1e5 * float(np.sqrt(table.cov.max())):
        raise InputError.in_file(
            path,
            f"targets are up to {extent:g} apart with standard deviations of"
            f" {np.sqrt(table.cov.max()):g}: both in one unit",
        )


def _session(path: Path, options: MaterialiseOptions) -> Positions:
    points = _points(path)
    if options.antenna_name not in points.names:
        raise InputError.in_file(
            path,
            f"no row {options.antenna_name!r} with the phase centre by GNSS;"
            f" {near(options.antenna_name, points.names)}; name it by --antenna-name",
        )
    extent = float(np.ptp(points.position, axis=0).max())
    if extent > LARGEST_SENSOR_M:
        question = ""
        if extent * 1e-3 < 1.0:
            question = "; in millimetres?"
        raise InputError.in_file(
            path,
            f"targets and phase centre are {extent:.3g} m apart (limit {LARGEST_SENSOR_M:g} m on a"
            f" receiver){question}",
        )
    return points


def _common(sessions: Sequence[Positions], antenna: str) -> list[str]:
    """Return the targets of the first session; all others must have them."""
    first = sessions[0]
    names = [name for name in first.names if name != antenna]
    for session in sessions[1:]:
        names = [name for name in names if name in session.names]
        if len(names) < 3:
            raise InputError.in_file(
                session.path,
                f"has {len(names)} targets of {first.path} by their names; 3 are needed",
            )
    return names


def _receiver(
    sessions: Sequence[Positions], names: Sequence[str], options: MaterialiseOptions
) -> ReceiverTargets:
    receivers = []
    for points in sessions:
        row = points.names.index(options.antenna_name)
        cov = points.with_sigma(PHASE_CENTRE_SIGMA_M)[row]
        targets = _targets(points, names, options.target_sigma_m)
        receivers.append(ReceiverSession(targets, points.position[row], cov))
    try:
        return receiver_targets(*receivers)
    except DataError as refusal:
        files = ", ".join(str(points.path) for points in sessions)
        raise InputError(f"{files}: {refusal}") from None


def _own_pose(
    camera_points: Positions, camera: Path, options: MaterialiseOptions
) -> tuple[tuple[Array, Array], Array]:
    """Return pose and covariance of the image that the camera itself took."""
    poses = camera_points.poses
    if options.pose is not None:
        poses = read_camera_poses(options.pose)
    if poses is None:
        raise UsageError(
            f"{camera} has targets and no camera pose; give the pose of an image that the"
            " camera itself took, in the axes of the targets: --pose POSES --image NAME"
        )
    name = options.image
    if not name and len(poses.images) == 1:
        (name,) = poses.images
    if name not in poses.images:
        shown = "none is named by --image"
        if name:
            shown = f"{name!r}; {near(name, poses.images[:200])}"
        raise UsageError(f"{poses.source}: no pose of the camera's own image: {shown}")
    one = poses.taken(np.array([poses.images.index(name)]))
    return (one.position[0], one.C_rc[0]), one.with_sigma(options.sigma_of_poses)[0]


def _estimated(
    targets: CameraTargets,
    receiver: ReceiverTargets,
    block: Positions,
    on_camera: Sequence[str],
    on_receiver: Sequence[str],
    options: MaterialiseOptions,
) -> MaterialisedLeverArm:
    rows = [block.names.index(name) for name in on_camera]
    first = similarity(block.position[rows], targets.targets.position)
    scale = 1.0 if first is None or not first.scale > 0.0 else first.scale
    sigma = options.target_sigma_m / scale
    camera_in, receiver_in = (_targets(block, names, sigma) for names in (on_camera, on_receiver))

    def fitted(position: Array) -> MaterialisedLeverArm:
        n = len(on_camera)
        return materialised_lever_arm(
            targets,
            receiver,
            replace(camera_in, position=position[:n]),
            replace(receiver_in, position=position[n:]),
        )

    whole = np.concatenate([camera_in.position, receiver_in.position])
    try:
        return fitted(whole)
    except DataError as refusal:

        def misfit(position: Array) -> float:
            return float(np.sqrt((fitted(position).residual_m ** 2).mean()))

        candidates = suspected_readings(
            block.path.name, of_positions(units=False), lambda X, change: change(X)
        )
        readings = advice(explain(whole, candidates, misfit, CLOSE_M))
        raise InputError(f"{block.path}: {refusal}{readings}") from None


def _between(results: Sequence[MaterialisedLeverArm]) -> tuple[tuple[str, ...], bool]:
    """Compare both blocks: targets and phase centre, which they share, cancel for the most part.

    Their whole covariance would call a mount that moved by millimetres the same. What a flight is
    processed with is no better than 5 mm, and less does no harm.
    """
    if len(results) < 2:
        return (), False
    before, after = results
    covs = before.block_cov, after.block_cov
    difference = lever_arm_difference(before.lever_arm_m, covs[0], after.lever_arm_m, covs[1])
    moved = not difference.agrees and difference.length_m > ANTENNA_SIGMA_M
    return (f"before and after the flight: {difference.summary()}; their mean is taken",), moved


def _lever_arm(results: Sequence[MaterialisedLeverArm]) -> tuple[Array, Array]:
    """Return the lever arm with its covariance; of two the mean, which is half of their difference
    away from each.
    """
    first = results[0]
    if len(results) < 2:
        return first.lever_arm_m, first.cov
    half = 0.5 * (results[1].lever_arm_m - first.lever_arm_m)
    return first.lever_arm_m + half, first.cov + np.outer(half, half)


def _calibrated(
    results: Sequence[MaterialisedLeverArm],
    receiver: ReceiverTargets,
    moved: bool,
    notes: Sequence[str],
    origin: dict[str, Any],
    inputs: list[Path],
) -> CalibratedMounting:
    result = results[0]
    arm, cov = _lever_arm(results)
    sigma = np.sqrt(np.diag(cov))
    reason = ""
    if moved:
        reason = (
            "the lever arms before and after the flight differ (limit"
            f" {1e3 * ANTENNA_SIGMA_M:g} mm): the mount moved"
        )
    elif sigma.max() > RULER_M:
        reason = f"standard error {sigma.max():.3f} m (limit {RULER_M:g} m)"
    verdict = f"{'before the flight: ' if len(results) > 1 else ''}{result.summary()}"
    return of_lever_arm(
        "materialise",
        "Lever arm by targets on camera and receiver",
        (arm, cov),
        reason,
        (),
        (verdict, *notes),
        notes,
        {
            "lever_arms_m": [r.lever_arm_m for r in results],
            "lever_arm_m": arm,
            "sigma_m": sigma,
            "cov_m2": cov,
            **pick_attributes(result, "two_step_m", "scale", "variance_factor", "factor_limit"),
            "phase_centres_apart_m": receiver.apart_m,
            "inputs": inputs,
        },
        lambda: _charts(results, receiver),
        origin,
    )


def _charts(results: Sequence[MaterialisedLeverArm], receiver: ReceiverTargets) -> Sequence[Chart]:
    from ...report.figures.mounting import Scatter, scatter_panel

    def scatter(each: Array, name: str, sigma: Array, mean: Array, mean_sigma: Array) -> Scatter:
        names = tuple(f"{name}{k}" for k in range(1, len(each) + 1))
        none_left_out = np.zeros(len(each), dtype=np.bool_)
        return Scatter(names, each, np.tile(sigma, (len(each), 1)), none_left_out, mean, mean_sigma)

    charts = []
    if (n := len(receiver.each_m)) > 1:
        sigma = np.sqrt(np.diag(receiver.antenna_cov))
        data = scatter(receiver.each_m, "session ", sigma * np.sqrt(n), receiver.antenna_m, sigma)
        title = "Phase centre of each session, in the frame of the first"
        charts.append(scatter_panel(data, "session", title, ("x", "y", "z")))
    none = np.zeros(3)
    data = scatter(np.concatenate([r.residual_m for r in results]), "", none, none, none)
    title = "Misclosures of the targets on camera and receiver, in camera axes"
    return [*charts, scatter_panel(data, "target", title)]
