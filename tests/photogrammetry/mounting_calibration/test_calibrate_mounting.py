"""`insgnss calibrate mounting` on a simulated flight: files in, a mounting that process takes."""

import json
import shutil
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from insgnss.cli import main
from insgnss.flight.config.block_file import load_block
from insgnss.flight.config.load import load_flight
from insgnss.flight.processing.pipeline import process
from insgnss.geodesy.rotation import (
    CV_RUB,
    opk_from_rotation,
    rotation_from_vector,
    vector_from_rotation,
)
from insgnss.io.formats.bundle.micmac import read_micmac_xml, write_micmac_xml
from insgnss.io.formats.orientation.mounting_file import read_mounting_file
from insgnss.navigation.orient.frame import in_frame
from insgnss.photogrammetry.adjust.adjustment import adjust_problem
from insgnss.photogrammetry.adjust.aerial import BORESIGHT, CAMERA_LEVER_ARM, EXPOSURE_DELAY
from insgnss.photogrammetry.adjust.precision import precision_of
from insgnss.photogrammetry.adjust.unknowns import POSE
from insgnss.photogrammetry.block_adjustment.aerial.control import Control, control_of
from insgnss.photogrammetry.block_adjustment.inputs import inputs_of
from insgnss.photogrammetry.block_adjustment.solve import set_up
from insgnss.photogrammetry.mounting_calibration.block_poses import block_poses
from insgnss.photogrammetry.mounting_calibration.in_flight import calibrate_mounting
from insgnss.photogrammetry.mounting_calibration.options import Assumptions
from insgnss.photogrammetry.mounting_calibration.poses import read_camera_poses
from insgnss.photogrammetry.mounting_calibration.records import CameraPoses, CovariantPoses
from insgnss.photogrammetry.mounting_calibration.solution import solve
from insgnss.report.charts.files import charts_of
from insgnss.simulation.dataset import write_dataset
from insgnss.simulation.image_block import BlockOptions
from insgnss.simulation.sensors import Rig

WRONG_M, DELAY_S = np.array([0.03, -0.03, 0.0]), 0.017


@pytest.fixture(scope="module")
def flown(tmp_path_factory) -> Path:
    """Return a flight whose file has no bore-sight, a wrong lever arm and a wrong delay."""
    directory = tmp_path_factory.mktemp("mounting") / "flight"
    wrong = {
        "mounting": {
            "antenna_m": list(np.array(Rig().antenna_m) + WRONG_M),
            "antenna_sigma_m": 0.05,
            "boresight": np.eye(3).tolist(),
        },
        "camera": {"time_offset_s": -DELAY_S},
    }
    write_dataset(
        directory,
        minutes=5.0,
        imu_rate=100.0,
        seed=11,
        start_in_air=True,
        block=BlockOptions(tie_points=30.0, control=10, check=5),
        flight_file=wrong,
    )
    return directory


def write_poses(directory: Path, path: Path, seed: int = 3) -> None:
    """Write the true poses with errors of 1 cm and 0.003 deg, as insgnss adjust writes them."""
    rng = np.random.default_rng(seed)
    with np.load(directory / "truth/eo.npz") as file:
        names, X, C = file["images"], file["position_enu"], file["C_mc"]
    X = X + 0.01 * rng.standard_normal(X.shape)
    C = rotation_from_vector(np.radians(0.003) * rng.standard_normal(X.shape)) @ C
    table = np.hstack([X, np.degrees(opk_from_rotation(C @ CV_RUB))])
    lines = ["image,x,y,z,omega,phi,kappa"]
    lines += [
        f"{n},{','.join(f'{v:.9f}' for v in row)}" for n, row in zip(names, table, strict=True)
    ]
    path.write_text("\n".join(lines) + "\n")


@pytest.mark.slow  # the flight is processed three times
def test_the_verb_finds_the_mounting_and_process_takes_it(flown, tmp_path, capsys) -> None:
    """Oracle: the rig that the flight was simulated with; 4 sigma, and bounds of the issue."""
    poses, out = tmp_path / "poses.csv", tmp_path / "mounting.toml"
    write_poses(flown, poses)
    words = ["calibrate", "mounting", str(flown), str(poses), "--out", str(out), "-q", "--json"]
    words += ["--pose-sigma", "0.0005,0.0002"]  # they were drawn one by one
    assert main(words) == 0
    said = json.loads(capsys.readouterr().out)
    found, _ = read_mounting_file(out)
    rig = Rig()
    off = found.antenna_m - np.array(rig.antenna_m)
    assert (np.abs(off) < 4.0 * found.sigma("antenna_m"))[:2].all()
    assert np.abs(off)[:2].max() < 0.01
    turn = found.camera_from_body @ np.array(rig.boresight) @ found.boresight.T
    beta = vector_from_rotation(turn @ found.camera_from_body.T)
    assert (np.abs(beta) < 4.0 * found.sigma("boresight")).all()
    assert (found.sigma("boresight") < np.radians([0.02, 0.02, 0.03])).all()
    assert abs(found.time_offset_s) < 4.0 * found.time_offset_sigma_s
    assert found.time_offset_sigma_s < 3e-4
    assert said["corrections_sigma"][-1] < 0.3
    assert "contradict the poses" in said["headline"]
    _, charts = charts_of(out.with_suffix(".html"))
    over = ["over-time-of-week", "over-speed", "over-heading", "over-turn-rate"]
    assert [chart.name for chart in charts] == over
    copied = tmp_path / "flight"
    shutil.copytree(flown, copied)
    assert main(["process", str(copied), "--mounting", str(out), "-q"]) == 0
    with np.load(copied / "truth/eo.npz") as file:
        true = dict(zip(file["images"].tolist(), file["position_enu"], strict=True))
    eo = json.loads((copied / "02_Processed/GPS-INS/eo.json").read_text())
    apart = [np.subtract(i["position_m"], true[i["image"]]) for i in eo["images"]]
    assert np.abs(np.array(apart)[:, :2]).max() < 0.03  # 0.3 m before


@pytest.mark.slow
def test_two_steps_are_one(flown) -> None:
    """Oracle: the adjustment of images, ground points and flight at once, `insgnss adjust`.

    The block without the flight, then its poses with their whole covariance beside the flight;
    0.001 deg is the bar.
    """
    flight = load_flight(flown)
    result = process(replace(flight, output=replace(flight.output, strip_covariance=True)))
    block = load_block(flown)
    open_to = replace(
        block.aerial_control,
        boresight_sigma_deg=10.0,
        time_offset_sigma_s=0.1,
        lever_arm_sigma_m=(0.3, 0.3, 0.3),
    )
    inputs = inputs_of(replace(block, aerial_control=open_to), lambda _: None)
    one = precision_of(adjust_problem(*set_up(inputs, control_of(inputs))))
    alone, _ = set_up(inputs, Control((), {}, (), "none"))
    two = precision_of(adjust_problem(alone, replace(one.result.values, blocks={})))
    order = np.argsort(inputs.eo_row)
    poses = CameraPoses(
        tuple(inputs.block.images[k] for k in order),
        two.result.values.position[order],
        two.result.values.C_mc[order],
        two.cov(*((POSE, int(k)) for k in order)),
        "plane",
    )
    posed = CovariantPoses(result.eo, result.strips, result.common, flight.mounting, -DELAY_S)
    known = Assumptions(shift_sigma_m=1e-6, frame="shift")
    solved = solve(poses, posed, inputs.eo_row[order], known)
    joint = one.result.values.blocks
    apart = vector_from_rotation(joint[BORESIGHT, 0] @ solved.boresight_change.T)
    assert np.degrees(np.abs(apart).max()) < 1e-3
    assert abs(joint[EXPOSURE_DELAY, 0][0] - solved.values[EXPOSURE_DELAY][0]) < 2e-5
    np.testing.assert_allclose(
        solved.values[CAMERA_LEVER_ARM], joint[CAMERA_LEVER_ARM, 0], atol=1e-3
    )
    together = np.sqrt(np.diag(one.cov((BORESIGHT, 0))))
    np.testing.assert_allclose(solved.sigma(BORESIGHT), together, rtol=0.05)


@pytest.mark.slow
def test_one_line_has_no_lever_arm(flown, tmp_path) -> None:
    """One heading at one speed: no component of the lever arm, and no number of it in the file."""
    path = tmp_path / "poses.csv"
    write_poses(flown, path)
    lines = path.read_text().splitlines()
    flight = load_flight(flown)
    eo = process(flight, write=False).eo
    heading = np.degrees(np.arctan2(-eo.C_mc[:, 0, 1], -eo.C_mc[:, 1, 1])) % 360.0
    first = np.abs((heading - heading[3] + 180.0) % 360.0 - 180.0) < 10.0
    end = int(np.argmin(first[3:])) + 3
    path.write_text("\n".join(lines[: 1 + end]) + "\n")
    assert end > 6
    result = calibrate_mounting(flight, path)
    judged = {c.name: c.verdict for c in result.components}
    assert {v for k, v in judged.items() if "antenna" in k} == {"not determined"}
    np.testing.assert_array_equal(result.mounting.antenna_m, flight.mounting.antenna_m)


def test_orientations_of_micmac_come_back(tmp_path) -> None:
    """Oracle: the poses that were written; 0.1 mm of four decimals."""
    from posed_flights import posed

    of = posed(seed=1)
    eo = replace(of.flight.eo, images=tuple(f"i{k}" for k in range(len(of.rows))))
    write_micmac_xml(in_frame(eo, "tangent plane"), tmp_path / "Ori-Test")
    names, X, C = read_micmac_xml(tmp_path / "Ori-Test")
    order = [names.index(name) for name in eo.images]
    np.testing.assert_allclose(X[order], eo.position_m, atol=1e-4)
    np.testing.assert_allclose(C[order], eo.C_mc, atol=1e-9)
    block = block_poses(read_camera_poses(tmp_path / "Ori-Test"), eo)
    assert block.georeferenced  # coordinates of the flight's plane
    assert "tangent plane of the flight is taken" in block.notes[0]


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (["none.csv"], "does not exist"),
        (["poses.csv", "--frame", "similarity", "--shift-sigma", "1"], "remove --frame similarity"),
        (
            ["poses.csv", "--lever-arm-sigma", "-1"],
            "--lever-arm-sigma -1.0: must be 0.0001 to 10 m",
        ),
    ],
)
def test_wrong_use_is_one_line(words, said, tmp_path, capsys) -> None:
    (tmp_path / "poses.csv").write_text("image,x,y,z,omega,phi,kappa\n")
    (tmp_path / "flight.toml").write_text("[imu]\nfile = 'none'\n")
    words = [str(tmp_path / words[0]), *words[1:]]
    try:
        code = main(["calibrate", "mounting", str(tmp_path / "flight.toml"), *words, "-q"])
    except SystemExit as stop:
        code = stop.code
    assert code in (2, 3)
    error = capsys.readouterr().err
    assert said in error or "none" in error
