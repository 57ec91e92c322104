"""The time offset of a flight in report.json and season.csv, whose stamps may have been moved."""

import json
import shutil
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from oracles import oracle

from insgnss.batch.season.tables import read_season
from insgnss.records.states import AXES
from insgnss.simulation.dataset import write_dataset
from insgnss.simulation.sensors import Rig

pytestmark = pytest.mark.slow
GAP_S = (85.0, 95.0)  # after the first sample: longer than is bridged
OFFSET = "GNSS time offset"
# name: gap, ms by which the stamps are late before and after it, ms stated, whether estimated
FLIGHTS = {
    "one": (False, (0, 0), 0, True),
    "one_stated": (False, (0, 0), -50, True),
    "one_moved": (False, (10, 10), 0, True),
    "one_moved_stated": (False, (20, 20), -50, True),
    "two": (True, (0, 0), 0, True),
    "two_stated": (True, (0, 0), -50, True),
    "two_moved": (True, (10, 10), 0, True),
    "two_moved_stated": (True, (20, 20), -50, True),
    "two_apart": (True, (10, 30), 0, True),
    "one_known": (False, (10, 10), -10, False),
    "two_known": (True, (10, 10), -10, False),
    "one_refused": (False, (10, 10), 0, False),
}


def command(*words: str, cwd: Path) -> int:
    """The exit code of a command."""
    line = [sys.executable, "-m", "insgnss", *words]
    return subprocess.run(line, cwd=cwd, capture_output=True, check=False, timeout=300).returncode


def rows_where(file: Path, change: Callable[[float], str | None]) -> None:
    """Write a table again with other stamps, without the rows whose stamp becomes None."""
    kept = []
    for line in file.read_text().splitlines(keepends=True):
        stamp = line.replace(",", " ").split()[0]
        new = change(float(stamp)) if stamp[0].isdigit() else stamp
        if new is not None:
            kept.append(line.replace(stamp, new, 1))
    file.write_text("".join(kept))


def flight(of: Path, name: str) -> None:
    """A flight of `FLIGHTS` beside the one that it is made of."""
    gap, late_ms, stated_ms, estimated = FLIGHTS[name]
    root = of.with_name(name)
    shutil.copytree(of, root)
    (imu,) = (root / "01_Observations" / "IMU").rglob("*.csv")
    fixes = root / "02_Processed" / "GPS-PPK" / "AntennaPos_WGS84.txt"
    begin = float(fixes.read_text().splitlines()[1].split()[0])
    lo, hi = (begin + seconds for seconds in GAP_S)
    rows_where(fixes, lambda t: f"{t + 1e-3 * late_ms[t > lo]:.4f}")
    if gap:
        rows_where(imu, lambda t: None if lo < t < hi else f"{t:.7f}")
    file = root / "flight.toml"
    head, tail = file.read_text().split("[output]")
    head = head.replace("[gnss]\n", f"[gnss]\ntime_offset_s = {1e-3 * stated_ms}\n")
    estimate = "[filter]\ntime_offset = true\n" if estimated else ""
    file.write_text(f"{head}{estimate}[output]{tail}")


@pytest.fixture(scope="module")
def season(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, dict[str, dict[str, Any]]]:
    """The flights as `insgnss batch` leaves them, and season.csv by name."""
    oracle("distributed")
    directory = tmp_path_factory.mktemp("season")
    first = directory / "simulated"
    options = {"imu_rate": 100.0, "seed": 3, "start_in_air": True, "line_length_m": 120.0}
    write_dataset(first, "ign8", 3.0, **options)
    for name in FLIGHTS:
        flight(first, name)
    shutil.rmtree(first)
    assert command("batch", ".", cwd=directory) == 3  # one is refused
    return directory, {row["name"]: row for row in read_season(directory / "season.csv")}


def constants(directory: Path, name: str) -> dict[str, dict[str, float]]:
    """What report.json of a flight says of its constants, by name."""
    file = directory / name / "02_Processed" / "GPS-INS" / "report.json"
    return {one["name"]: one for one in json.loads(file.read_text())["constants"]}


@pytest.mark.parametrize("name", FLIGHTS)
def test_a_season_has_the_offset_that_the_stamps_have(
    season: tuple[Path, dict[str, dict[str, Any]]], name: str
) -> None:
    """Oracle: the simulator, within 4 sigma: by how much the stamps are late, and the lever arm;
    one of 10 and 30 ms in two segments is known no better than they differ.
    """
    directory, rows = season
    _, late_ms, stated_ms, _ = FLIGHTS[name]
    row = rows[name]
    assert (row["status"] == "failed") == (name == "one_refused"), row["reason"]
    for late in late_ms:
        assert abs(row["time_offset_s"] + 1e-3 * late) < 4.0 * row["time_offset_sigma_s"]
    assert (row["time_offset_sigma_s"] > 3e-3) == (late_ms[0] != late_ms[1])
    found = np.array([row[f"lever_arm_{axis}_m"] for axis in AXES])
    sigma = np.array([row[f"lever_arm_{axis}_sigma_m"] for axis in AXES])
    assert (np.abs(found - Rig().antenna_lever_b) < 4.0 * sigma).all()
    if name != "one_refused":
        one = constants(directory, name)[OFFSET]
        assert one["assumed"] == pytest.approx(1e-3 * stated_ms)
        assert one["assumed"] + one["correction"] == pytest.approx(row["time_offset_s"], abs=1e-6)


def test_process_says_what_batch_says(
    season: tuple[Path, dict[str, dict[str, Any]]],
) -> None:
    """Oracle: the reports of `insgnss batch`."""
    directory, _ = season
    name = "two_moved_stated"
    before = constants(directory, name)
    assert command("process", f"{name}/flight.toml", "-q", cwd=directory) == 0
    for one, again in zip(before.values(), constants(directory, name).values(), strict=True):
        assert again["name"] == one["name"]
        for key in ("assumed", "correction", "sigma"):
            assert again[key] == pytest.approx(one[key], rel=1e-6, abs=1e-9)
