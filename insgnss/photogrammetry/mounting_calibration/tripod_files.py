"""`insgnss calibrate tripod`: poses of setups and pins of a tachymeter, as files."""

from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from ...base.errors import DataError, InputError
from ...base.files import pick_attributes
from ...geodesy.conventions import Change
from ...geodesy.explain import explain
from ...geodesy.readings import advice, of_attitudes, of_positions, suspected_readings
from ...records import Array
from ...report.charts.chart import Chart
from ..lever_arm.records import LONGEST_LEVER_ARM_M, RULER_M, PosedAntennas
from ..lever_arm.tripod import TripodLeverArm, setup_lever_arms, tripod_lever_arm
from .options import PlaceOptions, TripodOptions
from .poses import (
    Positions,
    join_by_name,
    read_camera_poses,
    read_positions,
)
from .products import CalibratedMounting, of_lever_arm, provenance
from .records import CameraPoses

MISFIT_M, MISFIT_FACTOR = 0.02, 25.0  # scatter of setups, and over their covariances: other data


def calibrate_tripod(poses: Path, pins: Path, options: TripodOptions) -> CalibratedMounting:
    """Estimate the lever arm from camera to antenna of setups on a tripod.

    Parameters
    ----------
    poses : Path
        Camera poses, one a setup.
    pins : Path
        Tips of the pin in the antenna's place, by the names of the poses.
    options : TripodOptions
        What the files do not say.

    Returns
    -------
    CalibratedMounting
        The lever arm with its verdict.

    Raises
    ------
    InputError
        A file is wrong, or both do not belong together.
    """
    camera, pin = _in_one_frame(read_camera_poses(poses), pins, options)
    first, second, notes = join_by_name(camera.images, pin.names, poses, pins, 1)
    notes = (*camera.notes, *notes)
    camera = camera.taken(first)
    if pin.cov is None:
        notes += (f"{pins.name} has no standard deviations: {1e3 * options.pin_sigma_m:g} mm",)
    if camera.cov is None:
        notes += (f"{poses.name} has no standard deviations: {options.sigma_of_poses}",)
    setups = PosedAntennas(
        camera.position,
        camera.C_rc,
        camera.with_sigma(options.sigma_of_poses),
        pin.position[second],
        pin.with_sigma(options.pin_sigma_m)[second],
    )
    result = _estimated(setups, poses, pins, camera.opk)
    inputs = (poses, pins)
    origin = provenance(inputs, camera.cameras, options.photo, options.date or camera.date)
    verdict = result.summary().split("; ")
    return of_lever_arm(
        "tripod",
        "Lever arm from a tripod",
        (result.lever_arm_m, result.cov),
        _undetermined(result),
        (),
        verdict,
        (*verdict[1:], *notes),
        _document(result, camera.images, inputs),
        lambda: _charts(result, setups, camera.images),
        origin,
    )


def _in_one_frame(
    camera: CameraPoses, pins: Path, places: PlaceOptions
) -> tuple[CameraPoses, Positions]:
    """Return poses and pins in the same axes.

    Raises
    ------
    InputError
        One of them has a place on the Earth and the other has none.
    """
    pin = read_positions(pins, places, camera.plane)
    if pin.plane is None and camera.frame == "geocentric":
        problem = "are local coordinates, the poses geocentric; give the CRS of the pins, --crs"
        raise InputError.in_file(pins, problem)
    if pin.plane is not None:
        return camera.in_plane(pin.plane), pin
    return camera, pin


def _estimated(setups: PosedAntennas, poses: Path, pins: Path, opk: Array | None) -> TripodLeverArm:
    """Estimate the lever arm; refuse what no tripod is, with the way in which it would fit."""
    far = np.linalg.norm(setups.antenna_m - setups.position, axis=1)
    try:
        result = tripod_lever_arm(setups)
    except DataError as refusal:
        raise InputError(f"{poses}, {pins}: {refusal}") from None
    scatter = _scatter(setups)
    bad = scatter > MISFIT_M and result.variance_factor > MISFIT_FACTOR  # NaN of one setup
    if far.max() <= LONGEST_LEVER_ARM_M and not bad:
        return result
    readings = _other_readings(setups, opk, poses.name, pins.name)
    if far.max() > LONGEST_LEVER_ARM_M:
        row = int(np.argmax(far))
        raise InputError(
            f"{pins}: the pin of setup {row + 1} is {far[row]:.2f} m from the camera of"
            f" {poses.name} (limit {LONGEST_LEVER_ARM_M:g} m): another unit, or other axes than"
            f" those of the"
            f" poses{readings}"
        )
    raise InputError(
        f"{poses}, {pins}: lever arms of {len(far)} setups scatter by {1e3 * scatter:.0f} mm (limit"
        f" {1e3 * MISFIT_M:g} mm), {np.sqrt(result.variance_factor):.0f} times what their standard"
        f" deviations say: poses and pins are not of the same setups, axes and scale{readings}"
    )


def _scatter(setups: PosedAntennas) -> float:
    """Return the rms distance of the setups' lever arms from their median, m."""
    each = np.einsum("nji,nj->ni", setups.C_rc, setups.antenna_m - setups.position)
    deviation = np.linalg.norm(each - np.median(each, axis=0), axis=1)
    # with one setup nothing scatters: a lever arm that is too long then stands for it
    return (
        float(np.sqrt((deviation**2).mean())) if len(each) > 1 else float(np.linalg.norm(each[0]))
    )


def _other_readings(setups: PosedAntennas, opk: Array | None, poses: str, pins: str) -> str:
    """Return the ways in which pins or poses would fit, in words."""

    def misfit(value: PosedAntennas) -> float:
        arm = np.linalg.norm(value.antenna_m - value.position, axis=1).max()
        return _scatter(value) if arm < LONGEST_LEVER_ARM_M else max(float(arm), _scatter(value))

    def of(name: str) -> Callable[[PosedAntennas, Change], PosedAntennas]:
        return lambda data, change: data.changed(change, name)

    candidates = [
        *suspected_readings(pins, of_positions(rows=len(setups.antenna_m) > 2), of("antenna_m")),
        *suspected_readings(poses, of_attitudes(opk), of("C_rc")),
        *suspected_readings(poses, of_positions(rows=False), of("position")),
    ]
    return advice(explain(setups, candidates, misfit, MISFIT_M))


def _undetermined(result: TripodLeverArm) -> str:
    """Say why the lever arm is not determined; empty where it is."""
    used = int((~result.outlier).sum())
    if used < 2:
        return (
            f"from one setup [{', '.join(f'{v:+.4f}' for v in result.lever_arm_m)}] m, which"
            " nothing checks; add two setups, turned against it"
        )
    if result.sigma_m.max() > RULER_M:
        return (
            f"standard error {result.sigma_m.max():.3f} m (limit {RULER_M:g} m, a ruler does"
            " better): better poses, or more setups"
        )
    return ""


def _document(
    result: TripodLeverArm, names: Sequence[str], inputs: tuple[Path, ...]
) -> dict[str, Any]:
    return {
        **pick_attributes(
            result, "lever_arm_m", "sigma_m", "spread_m", "variance_factor", "factor_limit"
        ),
        "cov_m2": result.cov,
        "attitude_span_deg": result.attitude_span_deg,
        "setups": [
            {"setup": name, "lever_arm_m": each, "left_out": bool(out)}
            for name, each, out in zip(names, result.each_m, result.outlier, strict=True)
        ],
        "inputs": inputs,
    }


def _charts(result: TripodLeverArm, setups: PosedAntennas, names: Sequence[str]) -> Sequence[Chart]:
    from ...report.figures.mounting import Scatter, scatter_panel

    each, cov = setup_lever_arms(setups)
    sigma = np.sqrt(np.diagonal(cov, axis1=1, axis2=2))
    data = Scatter(tuple(names), each, sigma, result.outlier, result.lever_arm_m, result.sigma_m)
    return [scatter_panel(data, "setup", "Lever arm of each setup, in camera axes")]
