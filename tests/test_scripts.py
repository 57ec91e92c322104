"""The stories of scripts/, run in small as a user runs them; each carries its own assertion."""

import subprocess
import sys
from pathlib import Path

import pytest
from oracles import oracle

SCRIPTS = Path(__file__).parents[1] / "scripts"
PRODUCTS = {
    "EO_local-plane.txt",
    "metashape.csv",
    "metashape_import.py",
    "eo.json",
    "eo_covariance.npz",
    "trajectory.sbet",
    "trajectory.smrmsg",
    "trajectory.csv",
    "report.html",
    "report.json",
}


def run(script: str, out: Path) -> subprocess.CompletedProcess[str]:
    command = [sys.executable, "-W", "error", str(SCRIPTS / script), "--quick", "--out", str(out)]
    return subprocess.run(
        command, capture_output=True, text=True, stdin=subprocess.DEVNULL, timeout=300, check=False
    )


@pytest.fixture(scope="module")
def story_1(
    tmp_path_factory: pytest.TempPathFactory,
) -> tuple[Path, subprocess.CompletedProcess[str]]:
    out = tmp_path_factory.mktemp("story_1")
    return out, run("01_produce_eo.py", out)


def assert_is_picture(path: Path) -> None:
    head = path.read_bytes()
    assert head.startswith(b"\x89PNG\r\n\x1a\n")
    assert head.endswith(b"IEND\xaeB`\x82")


@pytest.mark.slow
def test_produce_eo(story_1: tuple[Path, subprocess.CompletedProcess[str]]) -> None:
    """Oracle: the simulated truth, in the script's own assertion; design.md 6 for the products."""
    out, done = story_1
    assert done.returncode == 0, done.stderr
    assert {path.name for path in out.iterdir()} == PRODUCTS | {"produce_eo.png", "flight_quick"}
    assert_is_picture(out / "produce_eo.png")


@pytest.mark.slow
def test_produce_eo_refuses_a_truth_that_the_sigmas_do_not_explain(
    story_1: tuple[Path, subprocess.CompletedProcess[str]],
) -> None:
    """Oracle: a truth moved north by 5 cm, ten standard deviations and more."""
    out, done = story_1
    assert done.returncode == 0, done.stderr
    truth = out / "flight_quick" / "truth" / "EO_local-plane.txt"
    lines = truth.read_text().splitlines()
    moved = [
        line if line.startswith("#") else " ".join(_north(line.split(), 0.05)) for line in lines
    ]
    truth.write_text("\n".join(moved) + "\n")
    again = run("01_produce_eo.py", out)
    assert again.returncode == 1
    assert "AssertionError: normalised errors" in again.stderr


def _north(fields: list[str], by: float) -> list[str]:
    return [*fields[:2], f"{float(fields[2]) + by:.4f}", *fields[3:]]


@pytest.mark.slow
def test_export_metashape(tmp_path: Path) -> None:
    """Oracle: re-projection by scipy and PROJ, in the script's own assertion."""
    done = run("02_export_metashape.py", tmp_path)
    assert done.returncode == 0, done.stderr
    assert "agree to" in done.stdout
    assert_is_picture(tmp_path / "export_metashape.png")


@pytest.mark.slow
def test_tune_from_static_recordings(tmp_path: Path) -> None:
    """Oracle: the simulated noise, in the script's own assertion."""
    done = run("03_tune_from_static_recordings.py", tmp_path)
    assert done.returncode == 0, done.stderr
    assert {"navchip.toml", "navchip.json", "navchip.html"} <= {
        path.name for path in tmp_path.iterdir()
    }
    assert_is_picture(tmp_path / "tune_from_static.png")


@pytest.mark.slow
def test_compare_noise_models(tmp_path: Path) -> None:
    """Oracle: the simulated model and a recording that no model has seen, in the script's own
    assertion.
    """
    done = run("04_compare_noise_models.py", tmp_path)
    assert done.returncode == 0, done.stderr
    assert "WN+2GM" in done.stdout
    assert_is_picture(tmp_path / "compare_models.png")


@pytest.mark.slow
def test_relative_control_in_pycolmap(tmp_path: Path) -> None:
    """Oracle: the simulated poses, in the script's own assertion."""
    oracle("pyceres")
    done = run("06_relative_control_in_pycolmap.py", tmp_path)
    assert done.returncode == 0, done.stderr
    pictures = list(tmp_path.glob("*.png"))
    assert pictures
    assert_is_picture(pictures[0])


@pytest.mark.slow
def test_tune_on_a_flight(tmp_path: Path) -> None:
    """Oracle: the simulated vibration, in the script's own assertion."""
    done = run("05_tune_on_a_flight.py", tmp_path)
    assert done.returncode == 0, done.stderr
    pictures = list(tmp_path.glob("*.png"))
    assert pictures
    assert_is_picture(pictures[0])


@pytest.mark.slow
@pytest.mark.parametrize(
    ("script", "picture"),
    [
        ("07_boresight_unknown.py", "boresight_unknown.png"),
        ("08_corridor_without_ground_control.py", "corridor.png"),
        ("10_orthophoto_at_once.py", "orthophoto.png"),
    ],
)
def test_aerial_control(script: str, picture: str, tmp_path: Path) -> None:
    """Oracle: the simulated block, in the script's own assertion."""
    done = run(script, tmp_path)
    assert done.returncode == 0, done.stderr
    assert "paper 003" in done.stdout
    assert_is_picture(tmp_path / picture)


@pytest.mark.slow
def test_relative_control_modes(tmp_path: Path) -> None:
    """Oracle: the modes of Table 4 and their order, on one corridor."""
    script = str(SCRIPTS / "relative_control_modes.py")
    command = [sys.executable, script, "--only", "corridor2014", "--blocks", "1"]
    command += ["--out", str(tmp_path / "runs.json")]
    done = subprocess.run(command, capture_output=True, text=True, timeout=300, check=False)
    assert done.returncode == 0, done.stdout + done.stderr
    assert "corridor2014, seed 0: 38 adjustments" in done.stdout


@pytest.mark.slow
def test_two_ground_points_and_a_vehicle(tmp_path: Path) -> None:
    """Oracle: the simulated corridor of paper 004, in the script's own assertions."""
    done = run("09_two_ground_points_and_a_vehicle.py", tmp_path)
    assert done.returncode == 0, done.stdout + done.stderr
    assert_is_picture(tmp_path / "corridor.png")


@pytest.mark.slow
def test_wrong_reality() -> None:
    """Oracle: what the campaign plants; a latency of 50 ms is refused by its name on any motion."""
    script = str(SCRIPTS / "wrong_reality.py")
    command = [sys.executable, script, "--only", "latency 50 ms", "--seeds", "1"]
    done = subprocess.run(command, capture_output=True, text=True, timeout=300, check=False)
    assert done.returncode == 0, done.stdout + done.stderr
    assert "3 runs: covered 0, culprit 3," in done.stdout


@pytest.mark.slow
def test_wrong_blocks() -> None:
    """Oracle: what the campaign plants; mirrored pixels are refused by name on both flights."""
    command = [sys.executable, str(SCRIPTS / "wrong_blocks.py"), "--only", "mirrored", "--no-good"]
    done = subprocess.run(command, capture_output=True, text=True, timeout=300, check=False)
    assert done.returncode == 0, done.stdout + done.stderr
    assert "culprit 4, covered 0, told 0, silent 0" in done.stdout


@pytest.mark.slow
def test_measured_targets() -> None:
    """Oracle: the renderer; 60 windows of each kind of target, of which none is false, within the
    script's own bars of 0.2 px rms and 0.7 to 1.5 sigma.
    """
    command = [sys.executable, str(SCRIPTS / "measured_targets.py"), "--windows", "60"]
    done = subprocess.run(
        [*command, "--seed", "5"], capture_output=True, text=True, timeout=300, check=False
    )
    assert done.returncode == 0, done.stdout + done.stderr
    assert done.stdout.count("60 windows, 0 false targets.") == 4


@pytest.mark.slow
def test_good_flights() -> None:
    """Oracle: the simulated truth, in the script's own assertion: circles at 30 and 45 deg of bank
    and multirotors that fly sideways and backwards, accepted and within 5 sigma.
    """
    command = [sys.executable, str(SCRIPTS / "good_flights.py"), "--first", "2", "--flights", "4"]
    done = subprocess.run(command, capture_output=True, text=True, timeout=300, check=False)
    assert done.returncode == 0, done.stdout + done.stderr
    assert done.stdout.count("worst") == 4 + 9  # flights, and axes
