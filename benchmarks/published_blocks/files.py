"""A simulated published block as a data set.

block.toml  eo.json  eo_covariance.npz  image_points.csv  ground_points.csv
camera.toml                 a few pixels off, its parameters free: for self-calibration
camera_calibrated.toml      by an earlier calibration with its standard deviations, nothing free:
                            Fast AT, direct orientation
vehicle.csv  target_sizes.csv  ground_points_all.csv  block_cc.toml  block_mc.toml
    block_fc.toml           (with a vehicle: the three configurations of paper 004)
truth/eo.npz, block.npz, camera.toml, trajectory_of_vehicle.npz
README.md
"""

import os
from dataclasses import replace
from pathlib import Path

import numpy as np

from insgnss.base.errors import UsageError
from insgnss.base.files import atomic_write
from insgnss.base.output.staging import is_vacant, together
from insgnss.io.formats.blocks.camera_toml import write_camera_toml
from insgnss.io.formats.blocks.ground_points import write_ground_points
from insgnss.io.formats.blocks.image_points import write_image_points
from insgnss.io.formats.orientation.eo_covariance import FILE, write_eo_covariance
from insgnss.io.formats.orientation.eo_json import write_eo_json
from insgnss.io.formats.trajectory.trajectory_csv import write_trajectory_csv

from .road import TARGET_M, VEHICLE_ERRORS
from .survey import (
    ENDS_004,
    GCP_004,
    KINEMATIC,
    SIZE_SIGMA_PX,
    TARGET_SIZE_M,
    SimulatedSurvey,
)

BLOCK_FILES = {"cc": "conventional", "mc": "mapKITE", "fc": "full"}
"""Configurations of paper 004."""
_AXES = "tangent plane of eo.json: east, north, up, m"


def write_survey(directory: str | os.PathLike[str], made: SimulatedSurvey) -> Path:
    """Write a simulated block, whole or not at all.

    Parameters
    ----------
    directory : path
        Is made; it may exist if it is empty.
    made : SimulatedSurvey
        The block.

    Returns
    -------
    Path
        Its block.toml.

    Raises
    ------
    UsageError
        The directory is not empty or cannot be written.
    """
    target = Path(directory).resolve()
    if not is_vacant(target):
        raise UsageError(f"{target}: exists and is not an empty directory; give another one")
    with together() as staging:
        root = staging.tree(target)
        (root / "truth").mkdir()
        _write(root, made)
    return target / "block.toml"


def _write(root: Path, made: SimulatedSurvey) -> None:
    write_eo_json(made.eo, root / "eo.json")
    write_eo_covariance(made.eo, made.strips, root / FILE, made.common)
    write_image_points(made.measured, root / "image_points.csv")
    write_ground_points(made.ground, root / "ground_points.csv", [_AXES])
    write_camera_toml(made.survey.stated_camera, root / "camera.toml")
    write_camera_toml(made.calibrated, root / "camera_calibrated.toml", made.survey.calibration)
    if made.vehicle is not None:
        _write_vehicle(root, made)
    for name, text in _block_files(made).items():
        atomic_write(root / name, text)
    _write_truth(root / "truth", made)
    atomic_write(root / "README.md", _readme(made))


def _write_vehicle(root: Path, made: SimulatedSurvey) -> None:
    assert made.vehicle is not None
    assert made.sizes is not None
    write_trajectory_csv(made.vehicle.estimate, root / "vehicle.csv")
    every = replace(made.ground, check=np.zeros_like(made.ground.check))
    write_ground_points(every, root / "ground_points_all.csv", [_AXES])
    rows = (
        f"{made.truth.images[k]},{KINEMATIC}{made.truth.images[k]},{size:.4f},{SIZE_SIGMA_PX:g}\n"
        for k, size in zip(*made.sizes, strict=True)
    )
    atomic_write(root / "target_sizes.csv", ["image,point,size_px,sigma_px\n", *rows])


def _block_files(made: SimulatedSurvey) -> dict[str, str]:
    """Return the block files by their names."""
    head = (
        '[images]\nfile = "image_points.csv"\n\n[camera]\nfile = "camera.toml"\n\n'
        '[aerial_control]\nfile = "eo.json"\n'
    )
    antenna = 'control = "Ap"\n' if made.vehicle is not None else ""
    aerial = f"{antenna}boresight_sigma_deg = {3.0 if made.boresight.trace() < 3.0 else 0.0:.1f}\n"
    if made.vehicle is None:
        return {"block.toml": f'{head}{aerial}\n[ground]\nfile = "ground_points.csv"\n'}
    target = ", ".join(f"{value:g}" for value in TARGET_M)
    seen = (
        f'\n[vehicle]\nfile = "vehicle.csv"\ntarget = "{KINEMATIC}"\ntarget_m = [{target}]\n'
        f"correlated_share = {VEHICLE_ERRORS.share:g}\n"
        f"correlation_time_s = {VEHICLE_ERRORS.correlation_s:g}\n"
    )
    left_out = ", ".join(f'"{name}"' for name in GCP_004 if name not in ENDS_004)
    grounds = {
        "cc": '\n[ground]\nfile = "ground_points.csv"\n',
        "mc": f'\n[ground]\nfile = "ground_points.csv"\nskip = [{left_out}]\n{seen}',
        "fc": f'\n[ground]\nfile = "ground_points_all.csv"\n{seen}',
    }
    files = {
        f"block_{key}.toml": f"# {BLOCK_FILES[key]} configuration of paper 004\n{head}{aerial}"
        f'{ground}\n[output]\ndirectory = "adjusted_{key}"\n'
        for key, ground in grounds.items()
    }
    return {"block.toml": f"{head}{aerial}{grounds['cc']}", **files}


def _write_truth(folder: Path, made: SimulatedSurvey) -> None:
    truth, seen = made.truth, made.measured.observations
    write_camera_toml(made.survey.camera, folder / "camera.toml")
    np.savez(
        folder / "eo.npz",
        images=np.array(truth.images),
        tow=truth.time,
        position_enu=truth.position_m,
        C_mc=truth.C_mc,
        origin=truth.origin,
        boresight=made.boresight,
        pose_errors=made.pose_errors,
    )
    np.savez(
        folder / "block.npz",
        points=np.array(made.measured.points),
        position_enu=made.position_m,
        image=seen.image,
        point=seen.point,
        uv=made.uv,
        gross_error=np.zeros(len(seen), dtype=bool),
    )
    if made.vehicle is not None:
        path = made.vehicle.truth
        np.savez(
            folder / "trajectory_of_vehicle.npz",
            tow=path.time,
            lat=path.lat,
            lon=path.lon,
            h=path.height,
            v_ned=path.velocity_ned,
            C_nb=path.C_nb,
            target_enu=made.vehicle.target_m,
        )


def _readme(made: SimulatedSurvey) -> str:
    """Return what the data set is, for people."""
    survey, eo = made.survey, made.eo
    turn = np.degrees(np.arccos(np.clip((made.boresight.trace() - 1.0) / 2.0, -1.0, 1.0)))
    lasts = f"{survey.errors.share:.0%} of the variances for {survey.errors.correlation_s:g} s"
    lines = [
        f"# {survey.name}: a simulated image block",
        "",
        f"{len(eo)} images, {len(made.ground.points)} surveyed points,"
        f" {len(made.measured.observations)} measurements in images. Poses have errors of"
        f" {_text(survey.errors.position_m)} m and {_text(survey.errors.attitude_deg)} deg (east,"
        f" north, up), {lasts}.",
        f"A bore-sight of {turn:.2f} deg is in the images and not in eo.json." * int(turn > 1e-6),
        "`camera.toml` is a few pixels off and is estimated; `camera_calibrated.toml` is that of an"
        " earlier calibration: for Fast AT and direct orientation, which hold the camera, take"
        " `--camera camera_calibrated.toml`.",
        "`truth/` has poses, points, pixels without error and the true camera.",
    ]
    if made.vehicle is not None:
        lines.append(
            f"`vehicle.csv` is the trajectory of a vehicle with a target of {TARGET_SIZE_M:g} m on"
            f" its roof, {_text(TARGET_M)} m forward, right and down of it. In image 0001.jpg the"
            f" target is point {KINEMATIC}0001.jpg; `target_sizes.csv` has how large it appears."
        )
    return "\n".join(line for line in lines if line or line == lines[1]) + (
        "\n\nnext: `insgnss adjust block.toml`\n"
    )


def _text(values: tuple[float, ...]) -> str:
    return " ".join(f"{value:g}" for value in values)
