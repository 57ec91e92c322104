"""An equipment that loosens from flight to flight: simulated sensors to season.csv and page."""

import json
import re
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from insgnss.batch.season.tables import read_season
from insgnss.batch.season.trends import FEWEST_FLIGHTS
from insgnss.simulation.dataset import write_dataset
from insgnss.simulation.sensors import Rig

RATE_MM = -7.0  # a week: the antenna rises, as its mast does not hold
WEEKS_A_MONTH = 30.4375 / 7.0


def rig(k: int, rate_mm: float) -> Rig:
    """The mounting of flight k: as Table 1 has it but for the antenna's height above the camera."""
    x, y, z = Rig().antenna_m
    return Rig(antenna_m=(x, y, z + 1e-3 * rate_mm * k))


def season(directory: Path, equipment: str, rate_mm: float, seed: int) -> None:
    """A flight a week of 72 s, 50 Hz, whose flight files share the mounting of the first."""
    for k in range(FEWEST_FLIGHTS):
        root = directory / f"{equipment}_{k}"
        write_dataset(
            *(root, "ign8", 1.2),
            imu_rate=50.0,
            seed=seed + k,
            rig=rig(k, rate_mm),
            start_in_air=True,
            line_length_m=120.0,
        )
        head, mounting = (root / "flight.toml").read_text().split("[mounting]")
        mounting, plane = mounting.split("[tangent_plane]")
        if k == 0:
            (directory / f"{equipment}.toml").write_text(f"[mounting]{mounting}")
        head = head.replace("gps_week = 2008", f"gps_week = {2008 + k}")
        text = f'include = "../{equipment}.toml"\n{head}[tangent_plane]{plane}'
        (root / "flight.toml").write_text(text)


@pytest.mark.slow
def test_a_lever_arm_that_drifts_is_named_with_its_rate_and_a_constant_one_is_not(
    tmp_path: Path,
) -> None:
    """Oracle: the lever arms of the simulated sensors, 7 mm a week, and the same of two seasons;
    flights that are refused for what the equipment has become belong to it as well.
    """
    season(tmp_path, "wing3", RATE_MM, 300)
    season(tmp_path, "wing4", 0.0, 400)
    command = [sys.executable, "-m", "insgnss", "batch", ".", "--json"]
    done = subprocess.run(
        command, cwd=tmp_path, capture_output=True, text=True, check=False, timeout=300
    )
    assert done.returncode == 3, done.stderr
    rows = read_season(tmp_path / "season.csv")
    refused = [row for row in rows if row["status"] == "failed"]
    assert 2 <= len(refused) <= 6
    for row in refused:
        assert row["name"].startswith("wing3_")
        assert (
            "antenna lever arm: the vector from the IMU to the antenna is off by down -0.0"
            in row["reason"]
        )
    for row in rows:  # each flight by itself, in sigmas of three components
        equipment, k = row["name"].split("_")
        true = rig(int(k), RATE_MM if equipment == "wing3" else 0.0).antenna_lever_b
        axes = ("forward", "right", "down")
        found = np.array([row[f"lever_arm_{axis}_m"] for axis in axes])
        sigma = np.array([row[f"lever_arm_{axis}_sigma_m"] for axis in axes])
        assert (np.abs(found - true) < 4.0 * sigma).all(), (row["name"], found - true, sigma)

    page = (tmp_path / "index.html").read_text().replace("±", "+-")
    named = re.findall(r"[Tt]he ([\w ]+) of (wing\d) (drifts|differs)", page)
    assert set(named) == {("antenna lever arm down", "wing3", "drifts")}
    rate = re.search(r"drifts by (\S+) \+- (\S+) mm a month", page)
    assert rate is not None
    monthly, sigma_mm = map(float, rate.groups())
    assert abs(monthly - WEEKS_A_MONTH * RATE_MM) < 2.5 * sigma_mm
    assert sigma_mm < 0.2 * abs(monthly)
    odd = [t for t in json.loads(done.stdout)["trends"] if t["finding"] in ("drift", "scatter")]
    assert [t["text"].removeprefix("the") in page for t in odd] == [True]
