"""Whether products are in force, read from report.json alone; without processing anything."""

import hashlib
import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from insgnss import __version__
from insgnss.base.files import json_ready
from insgnss.batch.season.work import names_of_changed, report_in_force
from insgnss.flight.config.load import load_flight


@pytest.fixture
def flight(tmp_path: Path) -> Path:
    """A flight file with an equipment, and a report as `process` would have left it."""
    (tmp_path / "wing.toml").write_text("[gnss]\ngate_sigma = 4\n")
    (tmp_path / "imu.csv").write_text("1\n")
    (tmp_path / "gnss.txt").write_text("2\n")
    text = 'include = "wing.toml"\n[imu]\nfile = "imu.csv"\n[gnss]\nfile = "gnss.txt"\n'
    (tmp_path / "flight.toml").write_text(text)
    names = ("flight.toml", "wing.toml", "imu.csv", "gnss.txt")
    report: dict[str, Any] = {
        "inputs_sha256": {
            name: hashlib.sha256((tmp_path / name).read_bytes()).hexdigest() for name in names
        },
        "flight": json_ready(load_flight(tmp_path).resolved()),
        "versions": {"insgnss": __version__},
        "constants": [],
        "exports": [{"file": "eo.json"}],
        "products_sha256": {
            name: hashlib.sha256(b"").hexdigest() for name in ("eo.json", "trajectory.csv")
        },
    }
    (tmp_path / "out").mkdir()
    for name, content in (
        ("report.json", json.dumps(report)),
        ("report.html", ""),
        ("eo.json", ""),
        ("trajectory.csv", ""),
    ):
        (tmp_path / "out" / name).write_text(content)
    return tmp_path


def in_force(flight: Path) -> bool:
    return report_in_force(load_flight(flight), flight / "out") is not None


def write(name: str, text: str) -> Callable[[Path], object]:
    return lambda root: (root / name).write_text(text)


@pytest.mark.parametrize(
    "change",
    [
        write("imu.csv", "3\n"),
        write("wing.toml", "[gnss]\ngate_sigma = 6\n"),
        write("wing.toml", "[gnss]\ngate_sigma = 4\n# another line\n"),
        lambda root: (root / "out" / "eo.json").unlink(),
        lambda root: (root / "out" / "trajectory.csv").unlink(),
        lambda root: (root / "out" / "report.html").unlink(),
        write("out/report.json", "{"),
        lambda root: (root / "out" / "report.json").write_text(
            (root / "out" / "report.json").read_text().replace(f'"{__version__}"', '"0.0.1"')
        ),
    ],
)
def test_any_change_ends_it(flight: Path, change: Callable[[Path], object]) -> None:
    """Oracle: what was changed: an input, an option, a shared file, a product, the version."""
    assert in_force(flight)
    change(flight)
    assert not in_force(flight)


def test_a_product_that_somebody_changed_is_known_by_its_hash(flight: Path) -> None:
    """Oracle: what was changed. It may be on purpose, and ends nothing."""
    report, out = json.loads((flight / "out" / "report.json").read_text()), flight / "out"
    assert names_of_changed(report, out) == ()
    (out / "trajectory.csv").write_text("an edit\n")
    assert in_force(flight)
    assert names_of_changed(report, out) == ("trajectory.csv",)
