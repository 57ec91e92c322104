"""Formats and measurements that an installed package adds by its entry points."""

from pathlib import Path

import numpy as np
import pytest

import insgnss
import insgnss.flight.config.imu_options  # registers the kind of option "axes"
from insgnss.base.errors import UsageError
from insgnss.base.received.plugins import installed_plugins
from insgnss.flight.sensors.kinds import kinds, read_measurement
from insgnss.flight.sensors.options import SHIPPED, MeasurementInput
from insgnss.flight.sensors.shipped import KINDS
from insgnss.io.formats import READERS, read_imu, readers

PACKAGE = """
from pathlib import Path

import numpy as np
from insgnss import ImuSamples
from insgnss.io.formats import Reader


def read(path, options):
    rows = np.frombuffer(Path(path).read_bytes()[6:]).reshape(-1, 7)
    return ImuSamples(rows[:, 0], rows[:, 1:4], rows[:, 4:], options.quantity or "mean_rate")


LOGGER = Reader(read, "quantity gps_week", lambda head: head.startswith(b"MYLOG "))
NO_RECORD = Reader(lambda path, options: 7, "", lambda head: head.startswith(b"SEVEN"))
"""
TUTORIAL = Path(__file__).parents[3] / "docs/tutorials/own_measurement.md"
ENTRIES = """[insgnss.formats]
imu.my_logger = my_sensors:LOGGER
imu.seven = my_sensors:NO_RECORD
imu.imu_csv = my_sensors:NO_RECORD

[insgnss.measurements]
inclinometer = inclinometer:KIND
heading = my_sensors:LOGGER
"""


def installed_package(root: Path, monkeypatch: pytest.MonkeyPatch, entries: str) -> None:
    """A distribution as pip leaves it: a module, metadata and entry points."""
    about = root / "my_sensors-1.0.dist-info"
    about.mkdir()
    (about / "METADATA").write_text("Metadata-Version: 2.1\nName: my-sensors\nVersion: 1.0\n")
    (about / "entry_points.txt").write_text(entries)
    (root / "my_sensors.py").write_text(PACKAGE)
    code = TUTORIAL.read_text(encoding="utf-8").split("```python\n")
    (of_kind,) = [block.split("```")[0] for block in code if "KIND = SensorKind" in block]
    (root / "inclinometer.py").write_text(of_kind)
    monkeypatch.syspath_prepend(root)


@pytest.fixture(autouse=True)
def asked_anew():
    for cached in (installed_plugins, kinds):
        cached.cache_clear()
    yield
    for cached in (installed_plugins, kinds):
        cached.cache_clear()


def logged(path: Path, samples: insgnss.ImuSamples) -> Path:
    """The samples in the format of the package."""
    rows = np.column_stack([samples.time, samples.gyro, samples.accel])
    path.write_bytes(b"MYLOG " + rows.tobytes())
    return path


def test_an_installed_format_is_read_and_replaces_no_shipped_one(tmp_path, monkeypatch):
    """Oracle: by hand: the samples that were written; options that the format does not take are
    refused; a shipped name stays what it is; a reader that returns no samples is named.
    """
    installed_package(tmp_path, monkeypatch, ENTRIES)
    time = np.arange(50) / 100.0
    samples = insgnss.ImuSamples(time, np.ones((50, 3)), np.full((50, 3), 9.81))
    file = logged(tmp_path / "a.bin", samples)
    read = read_imu(file, quantity="instant_rate")
    np.testing.assert_array_equal(read.accel, samples.accel)
    assert read.quantity == "instant_rate"
    assert readers("imu")["imu_csv"] == READERS["imu"]["imu_csv"]
    assert list(readers("imu")) == ["my_logger", "seven", *READERS["imu"]]
    assert list(readers("gnss")) == list(READERS["gnss"])
    with pytest.raises(UsageError, match="of the format my_logger, which takes no units"):
        read_imu(file, units={"gyro": "deg/s"})
    file.write_bytes(b"SEVEN")
    with pytest.raises(UsageError, match="format seven returned int, expected ImuSamples"):
        read_imu(file)


def test_an_installed_kind_is_found_and_replaces_no_shipped_one(tmp_path, monkeypatch):
    """Oracle: by hand: the tutorial's kind reads degrees by its header and has two offsets."""
    installed_package(tmp_path, monkeypatch, ENTRIES)
    assert list(kinds()) == ["inclinometer", "heading", *SHIPPED[1:]]
    assert kinds()["heading"] is KINDS["heading"]
    (tmp_path / "x.csv").write_text("tow,pitch,roll\n10.0,-2.0,3.0\n10.5,-2.1,3.1\n")
    options = MeasurementInput(kind="inclinometer", file=tmp_path / "x.csv", sigma=0.03)
    read, _ = read_measurement(options, 2000)
    np.testing.assert_allclose(np.degrees(read.values), [[3.0, -2.0], [3.1, -2.1]])
    assert [state.name for state in read.states] == ["offset roll", "offset pitch"]


def test_a_package_that_cannot_be_imported_is_named(tmp_path, monkeypatch):
    """Oracle: by hand: entry point, module and reason in one line."""
    installed_package(tmp_path, monkeypatch, "[insgnss.formats]\nimu.gone = no_such_module:X\n")
    (tmp_path / "a.csv").write_text("1 2 3\n")
    with pytest.raises(UsageError, match=r"imu\.gone = no_such_module:X .*No module named"):
        read_imu(tmp_path / "a.csv")


@pytest.mark.slow
def test_a_flight_is_processed_from_an_installed_format(tmp_path, monkeypatch):
    """Oracle: the same flight from the shipped format, to the bit of its text."""
    root = tmp_path / "ign8"
    insgnss.simulate("ign8", 0.7, directory=root, imu_rate_hz=50.0, seed=5, start_in_air=True)
    flight = root / "flight.toml"
    expected = insgnss.process(flight, write=False)
    installed_package(tmp_path, monkeypatch, ENTRIES)
    installed_plugins.cache_clear()
    text = flight.read_text()
    table = next(line for line in text.splitlines() if line.startswith("file = "))
    file = root / table.split('"')[1]
    samples = read_imu(file, units={"gyro": "rad/s", "accel": "m/s^2"})
    logged(root / "imu.bin", samples)
    text = text.replace(table, 'file = "imu.bin"', 1)
    text = "\n".join(row for row in text.splitlines() if not row.startswith("units = { gyro"))
    flight.write_text(text)
    found = insgnss.process(flight, write=False)
    np.testing.assert_array_equal(found.trajectory.rpy, expected.trajectory.rpy)
