"""A small sample of `scripts/fault_lab.py`: kills, full disks, hostile directories."""

import os
import subprocess
import sys
from pathlib import Path

import pytest

LAB = Path(__file__).parents[1] / "scripts" / "fault_lab.py"


@pytest.mark.slow
@pytest.mark.skipif(os.name != "posix", reason="signals and limits of POSIX")
def test_nothing_is_lost_and_nothing_torn_in_silence(tmp_path: Path) -> None:
    """Oracle: the bytes of the older and of the newer products, and of all other files."""
    command = [sys.executable, str(LAB), str(tmp_path / "lab"), "--seed", "5"]
    command += ["--kills", "15", "--full", "6", "--hostile", "6"]
    command += ["--only", "process", "export_opf", "tune"]
    result = subprocess.run(command, capture_output=True, text=True, timeout=600)
    assert result.returncode == 0, result.stdout + result.stderr
    assert result.stdout.endswith("\n0 defects\n")
