"""Images that correct the trajectory, against the adjusted block, the truth and a long outage."""

import re
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from insgnss.base.errors import InputError, UsageError
from insgnss.cli.main import main
from insgnss.flight.config.load import load_flight
from insgnss.flight.processing.pipeline import ProcessResult, process
from insgnss.geodesy.rotation import vector_from_rotation
from insgnss.photogrammetry.block_adjustment import trajectory as joint_adjustment
from insgnss.photogrammetry.block_adjustment.inputs import inputs_of
from insgnss.photogrammetry.block_adjustment.run import adjust
from insgnss.photogrammetry.block_adjustment.trajectory import corrected_trajectory, refuse_unfit
from insgnss.records import Trajectory

pytestmark = pytest.mark.slow

EARTH_M = 6.37e6  # of differences below a metre: a part in 300 of them is lost
OUTAGE = (100.0, 190.0)  # s from the first fix, over two flight lines


@pytest.fixture(scope="module")
def joint(flown, adjusted) -> ProcessResult:
    flight = load_flight(flown.directory)
    return corrected_trajectory(adjusted.solved, flight, None, lambda _: None)[0]


def errors(trajectory: Trajectory, directory: Path) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Times, errors (n, 9) in north, east, down, and their normalised squares."""
    with np.load(directory / "truth" / "trajectory.npz") as truth:
        row = np.searchsorted(truth["tow"], trajectory.time - 1e-4)
        lat, lon, height = (truth[name][row] for name in ("lat", "lon", "h"))
        v, C = truth["v_ned"][row], truth["C_nb"][row]
    north = (trajectory.lat - lat) * EARTH_M
    east = (trajectory.lon - lon) * EARTH_M * np.cos(lat)
    psi = -vector_from_rotation(C @ np.swapaxes(trajectory.C_nb, 1, 2))
    e = np.column_stack([north, east, height - trajectory.height, trajectory.velocity_ned - v, psi])
    nees = np.einsum("ni,nij,nj->n", e, np.linalg.inv(trajectory.cov), e)
    return trajectory.time - trajectory.time[0], e, nees


def test_poses_of_the_trajectory_are_those_of_the_adjusted_block(adjusted, joint):
    """Oracle: the ordinary adjustment, which weighs the same flight by lines and what they share:
    centres of all images within 0.1 of their sigmas (the bore-sight turns attitudes alone), and
    sigmas within 3 %; before, they were up to several sigma off.
    """
    values, precision = adjusted.solved.result.values, adjusted.solved.precision
    row = adjusted.solved.inputs.eo_row
    sigma = np.sqrt(np.diagonal(precision.pose_cov, axis1=1, axis2=2))[:, :3]
    after = joint.eo.position_m[row] - values.position
    before = adjusted.solved.inputs.eo.position_m[row] - values.position
    assert np.abs(after / sigma).max() < 0.1
    assert np.abs(before / sigma).max() > 1.0
    own = np.sqrt(np.diagonal(joint.eo.cov[row], axis1=1, axis2=2))[:, :3]
    np.testing.assert_allclose(own / sigma, 1.0, atol=0.03)


def test_the_corrected_trajectory_is_as_good_as_it_says(flown, joint):
    """Oracle: the truth of the simulation: the mean normalised square of nine errors is within
    0.7 to 1.3 of nine, and headings, which the images know best, have a quarter of the error.
    """
    before = process(load_flight(flown.directory), write=False).trajectory
    _, e_before, _ = errors(before, flown.directory)
    _, e, nees = errors(joint.trajectory, flown.directory)
    assert 0.7 < nees.mean() / 9.0 < 1.3
    assert np.sqrt((e[:, 8] ** 2).mean()) < 0.6 * np.sqrt((e_before[:, 8] ** 2).mean())
    cov = np.diagonal(joint.trajectory.cov, axis1=1, axis2=2)
    assert (cov < np.diagonal(before.cov, axis1=1, axis2=2) * (1.0 + 1e-6)).all()
    assert np.median(np.sqrt(cov[:, 8] / before.cov[:, 8, 8])) < 0.3


def test_an_outage_over_two_lines_is_bridged_by_images(flown, tmp_path):
    """Oracle: the truth: 90 s without fixes leave half a metre, and less than 10 cm after the
    images, with sigmas that say so; the products are those of a flight, and adjust.json says it.
    """
    copied = flown.copied(tmp_path / "flight")
    here = copied.directory
    fixes = here / "02_Processed/GPS-PPK/AntennaPos_WGS84.txt"
    lines = fixes.read_text().splitlines()
    time = np.array([np.nan if x.startswith("#") else float(x.split()[0]) for x in lines])
    since = time - np.nanmin(time)
    without = (since > OUTAGE[0]) & (since < OUTAGE[1])
    fixes.write_text("\n".join(x for x, gone in zip(lines, without, strict=True) if not gone))
    flight = load_flight(here)
    before = process(flight, force=True).trajectory
    result = adjust(copied.block, flight=flight)
    assert result.trajectory is not None
    (change,) = (note for note in result.figures["notes"] if note.startswith("images moved"))
    out = here / "02_Processed" / "Adjustment" / "trajectory"
    assert {"trajectory.sbet", "trajectory.csv", "report.json"} <= {p.name for p in out.iterdir()}
    assert change in (out / "eo.json").read_text()
    for trajectory, low, high in ((before, 0.3, 3.0), (result.trajectory.trajectory, 0.0, 0.1)):
        after_start, e, nees = errors(trajectory, here)
        inside = (after_start > OUTAGE[0]) & (after_start < OUTAGE[1])
        assert low < np.sqrt((e[inside, :2] ** 2).mean()) < high
        assert 0.2 < nees[inside].mean() / 9.0 < 1.8


def wrong_ambiguity(directory: Path) -> None:
    """Move the fixes of 45 s, over one flight line, by 38 cm."""
    moved_fixes(directory, lambda t: np.outer((t > 100.0) & (t < 145.0), (0.19, -0.15, 0.30)))


def wander(directory: Path) -> None:
    """Let the fixes wander by 30 cm over minutes, and state it."""
    period, phase = np.array([170.0, 200.0, 230.0]), np.array([4.9, 0.3, 5.8])
    moved_fixes(directory, lambda t: 0.3 * np.sin(2.0 * np.pi * t[:, None] / period + phase))
    file = directory / "flight.toml"
    file.write_text(file.read_text().replace("[gnss]", "[gnss]\ngm_sigma = 10.0"))


def warm_up(directory: Path) -> None:
    """Let biases of 150 deg/h and 5 mg fade within 90 s."""
    (file,) = (directory / "01_Observations/IMU").rglob("*.csv")
    header, *lines = file.read_text().splitlines()
    samples = np.array([[float(word) for word in line.split(",")] for line in lines])
    bias = [*(np.radians(150.0 / 3600.0) * np.array([1, -1, 1])), *(0.049 * np.array([1, 1, -1]))]
    samples[:, 1:] += np.outer(np.exp((samples[0, 0] - samples[:, 0]) / 90.0), bias)
    np.savetxt(file, samples, "%.10g", ",", header=header, comments="")


def moved_fixes(directory: Path, motion: Callable[[np.ndarray], np.ndarray]) -> None:
    """Move the fixes north, east and up by a function of the time from the first one, m."""
    file = directory / "02_Processed/GPS-PPK/AntennaPos_WGS84.txt"
    header = file.read_text().splitlines()[0]
    fixes = np.loadtxt(file)
    m = motion(fixes[:, 0] - fixes[0, 0])
    east = EARTH_M * np.cos(np.radians(fixes[:, 1]))
    fixes[:, 1:3] += np.degrees(m[:, :2] / np.column_stack([np.full_like(east, EARTH_M), east]))
    fixes[:, 3] += m[:, 2]
    np.savetxt(file, fixes, "%.6f %.10f %.10f %.4f %.5f %.5f %.5f", header=header, comments="")


@pytest.mark.parametrize(
    ("fault", "before_m", "after_m", "after_deg"),
    [
        (wrong_ambiguity, 0.1, 0.006, 0.035),
        (wander, 0.15, 0.1, 0.04),
        (warm_up, 0.0, 0.005, 0.035),
    ],
)
def test_images_correct_what_fixes_and_inertial_samples_cannot(
    flown, tmp_path, fault, before_m, after_m, after_deg
):
    """Oracle: the truth. One line of a wrong ambiguity and a warm-up come to the level of the
    undisturbed flight (4.7 mm, 0.027 deg of heading), a wander of 30 cm under its stated sigma to
    a third; in each case within the sigmas.
    """
    copied = flown.copied(tmp_path / "flight")
    fault(copied.directory)
    flight = load_flight(copied.directory)
    before = process(flight, force=True).trajectory
    _, e, _ = errors(before, copied.directory)
    horizontal, heading = np.linalg.norm(e[:, :2], axis=1), np.degrees(e[:, 8])
    assert np.sqrt((horizontal**2).mean()) > before_m
    assert np.sqrt((heading**2).mean()) > 0.05
    result = adjust(copied.block, flight=flight, write=False)
    assert result.trajectory is not None, result.refusal
    _, e, nees = errors(result.trajectory.trajectory, copied.directory)
    assert np.sqrt((e[:, :2] ** 2).sum(axis=1).mean()) < after_m
    assert np.degrees(np.sqrt((e[:, 8] ** 2).mean())) < after_deg
    assert 0.5 < nees.mean() / 9.0 < 1.4


def test_a_block_that_contradicts_itself_corrects_no_trajectory(flown, tmp_path):
    """Oracle: the rule: check points that were moved by 7 cm leave the orientation, and write no
    trajectory until the block file accepts them.
    """
    copied = flown.copied(tmp_path / "flight")
    ground = copied.directory / "01_Observations/Camera/Block/ground_points.csv"
    lines = [line.split(",") for line in ground.read_text().splitlines()]
    for line in lines:
        if line[-1] == "check":
            line[1] = f"{float(line[1]) + 0.07:.4f}"
    ground.write_text("\n".join(map(",".join, lines)))
    flight = load_flight(copied.directory)
    result = adjust(copied.block, flight=flight, write=False)
    assert result.trajectory is None
    refusal = result.refusal
    assert refusal is not None
    assert "the orientation is written, the trajectory is not" in str(refusal)
    (name,) = re.findall(r'accept = \["(.*)"\]', str(refusal))
    options = replace(copied.block.adjustment, accept=(name,))
    again = adjust(replace(copied.block, adjustment=options), flight=flight, write=False)
    assert again.refusal is None
    assert again.trajectory is not None


def test_shifts_of_lines_are_refused_beside_the_flight(flown, tmp_path, capsys):
    """Oracle: the rule: an error of the fixes is one unknown, of the flight; exit code 2."""
    here = flown.copied(tmp_path / "flight").directory
    command = ["adjust", str(here / "block.toml"), "--trajectory", str(here / "flight.toml")]
    block = here / "block.toml"
    control = "[aerial_control]\n"
    assert control in block.read_text()
    shifts = control + "shift_sigma_m = [0.1, 0.1, 0.1]\n"
    block.write_text(block.read_text().replace(control, shifts))
    assert main(command) == 2
    assert "aerial_control.shift_sigma_m" in capsys.readouterr().err


def test_a_flight_that_memory_does_not_hold_is_refused(flown, monkeypatch):
    """Oracle: by hand: 14 matrices of six numbers of each image, squared, in 8 bytes."""
    inputs, flight = inputs_of(flown.block, lambda _: None), load_flight(flown.directory)
    images = len(inputs.eo)
    needed = 14 * 8 * (6 * images) ** 2
    monkeypatch.setattr(joint_adjustment, "available", lambda: needed + 1)
    refuse_unfit(inputs, flight)
    monkeypatch.setattr(joint_adjustment, "available", lambda: needed - 1)
    with pytest.raises(UsageError, match=rf"{images} images need 0.0 GB .* are free; cut the"):
        refuse_unfit(inputs, flight)


def test_images_of_another_flight_are_refused(flown, adjusted, tmp_path):
    """Oracle: the rule: names of the images differ from those of eo.json."""
    here = flown.copied(tmp_path / "flight").directory
    events = here / "01_Observations/Camera/Data/Events.txt"
    events.write_text(events.read_text().replace("8024.tif", "9024.tif"))
    with pytest.raises(InputError, match="process the flight again"):
        corrected_trajectory(adjusted.solved, load_flight(here), None, lambda _: None)
