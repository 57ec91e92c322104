"""Raw observations of a flight file: what the engine is asked for, and what the flight gets of its answer."""

from pathlib import Path

import numpy as np
import pytest

from insgnss.flight import load_flight
from insgnss.geodesy.frames import geodetic_to_ecef
from insgnss.gnss import flown
from insgnss.gnss.ppk import PpkResult
from insgnss.recording import _read_files
from insgnss.records import CameraEvents, Check, GnssFixes

FIXES = GnssFixes(np.array([10.0, 11.0]), np.full(2, 0.8), np.full(2, 0.1), np.full(2, 500.0), np.tile(1e-4 * np.eye(3), (2, 1, 1)))
NUMBERED = Check("camera events", "no image names", "a name for each event", "note")
EVENTS = CameraEvents(("1", "2"), np.array([10.2, 10.7]), notes=(NUMBERED,))
RATE = Check("GNSS fix rate", "100 % fixed", "90 %")
FLIGHT = """gps_week = 2021
[imu]
file = "imu.csv"
[gnss]
rover = "r.obs"
base = "b.obs"
navigation = ["n.nav", "g.nav"]
base_position = [53.28, -9.05, 70.0]
base_point = "marker"
systems = "GR"
frequencies = 1
elevation_mask_deg = 12
ratio = 2.5
"""


@pytest.fixture
def asked(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> list:  # type: ignore[type-arg]
    """What the engine was asked for; it answers with `FIXES` and, where it may, `EVENTS`."""
    given = []

    def solve(inputs):  # type: ignore[no-untyped-def]
        given.append(inputs)
        events = EVENTS if inputs.events else None
        return PpkResult(FIXES, events, (RATE, NUMBERED) if events else (RATE,), "good", {}, {}, {}, "fake", 0.0)

    monkeypatch.setattr(flown, "solve_ppk", solve)
    (tmp_path / "imu.csv").write_text("tow,gx,gy,gz,ax,ay,az\n" + "".join(f"{10 + 0.01 * k:.2f},0,0,0,0,0,-9.8\n" for k in range(20)))
    for name in ("r.obs", "b.obs", "n.nav", "g.nav"):
        (tmp_path / name).write_text("RINEX\n")
    return given


def test_the_engine_is_asked_for_what_the_flight_file_says(asked: list, tmp_path: Path) -> None:  # type: ignore[type-arg]
    """Oracle: the flight file's own values."""
    (tmp_path / "flight.toml").write_text(FLIGHT)
    _, fixes, events, ppk = _read_files(load_flight(tmp_path / "flight.toml"))
    (inputs,) = asked
    assert [path.name for path in (inputs.rover, inputs.base, *inputs.navigation)] == ["r.obs", "b.obs", "n.nav", "g.nav"]
    options = inputs.options
    assert np.allclose(options.base_position_m, geodetic_to_ecef(np.radians(53.28), np.radians(-9.05), 70.0), atol=1e-6)
    assert (options.base_point, options.systems, options.frequencies) == ("marker", "GR", 1)
    assert (options.elevation_mask_deg, options.ratio) == (12.0, 2.5)
    assert fixes is FIXES
    assert events is EVENTS
    assert ppk is not None
    assert ppk.checks == (RATE,)  # the note of the events is the record's own


def test_events_of_another_file_come_first(asked: list, tmp_path: Path) -> None:  # type: ignore[type-arg]
    """Oracle: the file's two lines."""
    (tmp_path / "events.txt").write_text("image tow\na.tif 10.05\nb.tif 10.10\n")
    (tmp_path / "flight.toml").write_text(FLIGHT + '[camera]\nevents = "events.txt"\n')
    _, _, events, _ = _read_files(load_flight(tmp_path / "flight.toml"))
    assert not asked[0].events
    assert events is not None
    assert events.images == ("a.tif", "b.tif")


def test_images_name_the_rovers_events(asked: list, tmp_path: Path) -> None:  # type: ignore[type-arg]
    """Oracle: the flight file's own value."""
    (tmp_path / "names.txt").write_text("a.tif\nb.tif\n")
    (tmp_path / "flight.toml").write_text(FLIGHT + '[camera]\nimages = "names.txt"\n')
    _read_files(load_flight(tmp_path / "flight.toml"))
    assert asked[0].images.name == "names.txt"
