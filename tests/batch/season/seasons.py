"""Seasons for tests: rows as reports would give them, very short flights in directories, and
`insgnss batch` as a process.
"""

import shutil
import subprocess
import sys
from datetime import UTC, datetime, timedelta
from pathlib import Path
from typing import Any

import numpy as np

from insgnss.batch.season.row import ROW_COLUMNS
from insgnss.records.states import AXES
from insgnss.simulation.dataset import write_dataset

START = datetime(2026, 3, 1, tzinfo=UTC)
SIGMA_M = 0.004
INSGNSS = [sys.executable, "-m", "insgnss"]


def row(k: int, rng: np.random.Generator | None = None, **values: Any) -> dict[str, Any]:
    """The row of a good flight `k` of wing3, a flight every four days; `rng` draws its errors."""
    draw = (lambda: 0.0) if rng is None else (lambda: float(rng.normal()))
    made: dict[str, Any] = dict.fromkeys(ROW_COLUMNS)
    made |= {"name": f"f{k:03d}", "flight": f"f{k:03d}/flight.toml", "equipment": "wing3"}
    made |= {"date_utc": (START + timedelta(days=4 * k)).strftime("%Y-%m-%dT%H:%M:%SZ")}
    made |= {"status": "done", "judgement": "good", "reason": "", "images": 3, "limits": ""}
    made |= {"version": "0.1.0", "inputs_sha256": "0" * 64, "seconds": 1.25}
    made |= {"report": f"f{k:03d}/out/report.html", "nis_ratio": 1.0, "duration_s": 60.0}
    for axis in "enu":
        made[f"sigma_{axis}_mm"], made[f"sigma_att_{axis}_deg"] = 3.0, 0.01
    for axis in AXES:
        made[f"lever_arm_{axis}_m"] = 0.1 + SIGMA_M * draw()
        made[f"lever_arm_{axis}_sigma_m"] = SIGMA_M
    made |= {"time_offset_s": 3e-4 * draw(), "time_offset_sigma_s": 3e-4}
    return made | values


def short_flight(directory: Path) -> Path:
    """A flight of 72 s at 50 Hz with three images, and its equipment beside it as wing3.toml."""
    root = directory / "f000"
    write_dataset(root, "ign8", 1.2, imu_rate=50.0, seed=11, start_in_air=True, line_length_m=120.0)
    head, mounting = (root / "flight.toml").read_text().split("[mounting]")
    mounting, plane = mounting.split("[tangent_plane]")
    (directory / "wing3.toml").write_text(f"[mounting]{mounting}")
    text = f'include = "../wing3.toml"\n{head}[tangent_plane]{plane}'
    (root / "flight.toml").write_text(text)
    return root


def copies(of: Path, count: int) -> list[Path]:
    """The same flight in other directories beside it, a week apart."""
    made = [of]
    for k in range(1, count):
        made.append(of.with_name(f"f{k:03d}"))
        shutil.copytree(of, made[-1])
        file = made[-1] / "flight.toml"
        file.write_text(file.read_text().replace("2008", str(2008 + k)))
    return made


def broken(flight: Path) -> None:
    """The IMU of a flight upside down, as its flight file has it."""
    file = flight / "flight.toml"
    axes = 'axes = "forward right down"'
    assert axes in file.read_text()
    file.write_text(file.read_text().replace(axes, 'axes = "right forward up"'))


def batch(*words: object, cwd: Path) -> subprocess.CompletedProcess[str]:
    command = [*INSGNSS, "batch", *map(str, words)]
    return subprocess.run(
        command, cwd=cwd, capture_output=True, text=True, check=False, timeout=500
    )


def started(cwd: Path, *words: object) -> subprocess.Popen[str]:
    """A run whose standard output is read line by line; its workers are in its own session."""
    return subprocess.Popen(
        [*INSGNSS, "batch", *map(str, words)],
        cwd=cwd,
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        start_new_session=True,
    )
