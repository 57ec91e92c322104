"""The program itself, ended by a signal at its steps: one line, an exit code, the files before."""

import os
import signal
import subprocess
import sys
from pathlib import Path

import pytest

from insgnss.simulation.dataset import write_dataset

pytestmark = [
    pytest.mark.slow,
    pytest.mark.skipif(os.name != "posix", reason="signals of POSIX"),
]
PRODUCTS = ("EO_local-plane.txt", "eo.json", "report.json", "report.html", "trajectory.csv")


@pytest.fixture(scope="module")
def flight(tmp_path_factory: pytest.TempPathFactory) -> Path:
    root = tmp_path_factory.mktemp("interrupted") / "ign8"
    write_dataset(root, "ign8", 2.5, imu_rate=100.0, seed=11, start_in_air=True)
    return root / "flight.toml"


def ended(command: list[str], step: str, number: int, cwd: Path) -> tuple[int, str]:
    """Exit code and standard error of a command that gets a signal at a step of its."""
    process = subprocess.Popen(
        [sys.executable, "-m", "insgnss", *command],
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        cwd=cwd,
    )
    assert process.stdout is not None
    for line in process.stdout:
        if step in line:
            process.send_signal(number)
            break
    else:
        process.kill()
        pytest.fail(f"no step {step}: {process.communicate()[1]}")
    return process.wait(timeout=120), process.communicate()[1]


def content(root: Path) -> dict[str, bytes]:
    return {path.name: path.read_bytes() for path in root.iterdir()}


@pytest.mark.parametrize(
    ("step", "number", "code", "word"),
    [
        ("read", signal.SIGTERM, 143, "terminated"),
        ("filter", signal.SIGINT, 130, "interrupted"),
        ("smooth", signal.SIGHUP, 129, "terminated"),
        ("orient", signal.SIGTERM, 143, "terminated"),
    ],
)
def test_process_leaves_the_files_before(
    flight: Path, tmp_path: Path, step: str, number: int, code: int, word: str
) -> None:
    """Oracle: bytes of files that stood there, and a directory that did not."""
    out = tmp_path / "out"
    for directory in (None, out):
        if directory is not None:
            out.mkdir()
            for name in PRODUCTS[:3]:
                (out / name).write_text("{}" if name == "report.json" else "before")
        before = content(out) if directory else {}
        got, errors = ended(
            ["process", str(flight), "--out", str(out), "--force"], step, number, tmp_path
        )
        assert (got, errors) == (code, f"insgnss: error: {word}\n")
        assert out.exists() == (directory is not None)
        assert (content(out) if out.exists() else {}) == before
        assert [path for path in tmp_path.iterdir() if path != out] == []


def test_simulate_leaves_no_directory(tmp_path: Path) -> None:
    """Oracle: an empty directory afterwards."""
    command = ["simulate", "new/flight", "--minutes", "3"]
    got, errors = ended(command, "simulating", signal.SIGTERM, tmp_path)
    assert (got, errors) == (143, "insgnss: error: terminated\n")
    assert not list(tmp_path.iterdir())
