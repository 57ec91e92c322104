"""Raw observations of a flight file: what the engine is asked for, and what the flight gets of its
answer.
"""

from pathlib import Path

import numpy as np
import pytest
from photographs import photograph

from insgnss import load_flight
from insgnss.base.errors import InputError
from insgnss.flight.processing.input_files import read_files
from insgnss.geodesy.frames import geodetic_to_ecef
from insgnss.gnss import from_flight_file as flown
from insgnss.gnss.covariance_model import MODEL
from insgnss.gnss.ppk import PpkInput, PpkResult
from insgnss.gnss.rinex.camera_events import RoverEvents
from insgnss.io.exposures.naming import ImageMatch
from insgnss.records import CameraEvents, Check, GnssFixes

Inputs = list[PpkInput]

FIXES = GnssFixes(
    np.array([10.0, 11.0]),
    np.full(2, 0.8),
    np.full(2, 0.1),
    np.full(2, 500.0),
    np.tile(1e-4 * np.eye(3), (2, 1, 1)),
)
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
def asked(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Inputs:
    """What the engine was asked for; it answers with `FIXES` and, where it may, `EVENTS`."""
    given: Inputs = []

    def solve(inputs):  # type: ignore[no-untyped-def]
        given.append(inputs)
        events = None if inputs.events is False else EVENTS
        return PpkResult(
            FIXES, events, (RATE, NUMBERED) if events else (RATE,), "good", {}, {}, {}, "fake", 0.0
        )

    monkeypatch.setattr(flown, "solve_ppk", solve)
    (tmp_path / "imu.csv").write_text(
        "tow,gx,gy,gz,ax,ay,az\n"
        + "".join(f"{10 + 0.01 * k:.2f},0,0,0,0,0,-9.8\n" for k in range(20))
    )
    for name in ("r.obs", "b.obs", "n.nav", "g.nav"):
        (tmp_path / name).write_text("RINEX\n")
    return given


def test_the_engine_is_asked_for_what_the_flight_file_says(asked: Inputs, tmp_path: Path) -> None:
    """Oracle: the flight file's own values."""
    (tmp_path / "flight.toml").write_text(FLIGHT)
    _, fixes, cameras, ppk = read_files(load_flight(tmp_path / "flight.toml"))
    events = cameras[0].events if cameras else None
    (inputs,) = asked
    assert [path.name for path in (inputs.rover, inputs.base, *inputs.navigation)] == [
        "r.obs",
        "b.obs",
        "n.nav",
        "g.nav",
    ]
    options = inputs.options
    assert np.allclose(
        options.base_position_m,
        geodetic_to_ecef(np.radians(53.28), np.radians(-9.05), 70.0),
        rtol=0,
        atol=1e-6,
    )
    assert (options.base_point, options.systems, options.frequencies) == ("marker", "GR", 1)
    assert (options.elevation_mask_deg, options.ratio) == (12.0, 2.5)
    assert fixes is FIXES
    assert events is EVENTS
    assert ppk is not None
    assert ppk.checks == (RATE,)  # the note of the events is the record's own


def test_nothing_is_asked_for_beyond_the_defaults(asked: Inputs, tmp_path: Path) -> None:
    """Oracle: the defaults of `PpkInput` and `EngineOptions`, which a flight file without further
    keys must not change.
    """
    (tmp_path / "flight.toml").write_text(FLIGHT.partition("base_position")[0])
    read_files(load_flight(tmp_path / "flight.toml"))
    (inputs,) = asked
    assert inputs == PpkInput(inputs.rover, inputs.base, inputs.navigation)


def test_the_frame_around_the_engine_is_asked_for(asked: Inputs, tmp_path: Path) -> None:
    """Oracle: the flight file's own values."""
    more = (
        "max_age_s = 5\ntimeout_s = 90\nacceleration_mps2 = [6, 2]\nrtklib_options = {"
        " pos2-arminfix = 10 }\n"
    )
    more += "atmosphere = { humidity = 0.4 }\n"
    more += (
        'engine = "rnx2rtkp"\nphase_velocity = false\ncovariance = { ppm = 2, floor_m = { fixed ='
        " 0.01 } }\n"
    )
    (tmp_path / "flight.toml").write_text(FLIGHT + more)
    read_files(load_flight(tmp_path / "flight.toml"))
    (inputs,) = asked
    options = inputs.options
    assert (options.engine, options.max_age_s, options.acceleration_mps2) == (
        "rnx2rtkp",
        5.0,
        (6.0, 2.0),
    )
    assert options.timeout_s == 90.0
    assert options.rtklib_options == {"pos2-arminfix": "10"}
    assert (inputs.wet_delay, inputs.atmosphere, inputs.velocity) == (
        True,
        {"humidity": 0.4},
        False,
    )
    assert (inputs.covariance.ppm, inputs.covariance.floor_m["fixed"]) == (
        (2.0, 2.0, 2.0),
        (0.01, 0.01, 0.01),
    )
    assert inputs.covariance.floor_m["float"] == MODEL.floor_m["float"]
    (tmp_path / "flight.toml").write_text(FLIGHT + "wet_delay = false\n")
    read_files(load_flight(tmp_path / "flight.toml"))
    assert not asked[1].wet_delay


def test_a_camera_without_a_file_needs_the_rovers_events(asked: Inputs, tmp_path: Path) -> None:
    """Oracle: the flight file; without [camera] the rover's events are taken where it has some."""
    (tmp_path / "flight.toml").write_text(FLIGHT)
    read_files(load_flight(tmp_path / "flight.toml"))
    (tmp_path / "flight.toml").write_text(FLIGHT + "[camera]\ntime_offset_s = 0.002\n")
    _, _, cameras, _ = read_files(load_flight(tmp_path / "flight.toml"))
    events = cameras[0].events if cameras else None
    assert [inputs.events for inputs in asked] == [None, True]
    assert asked[1].camera_delay_s == 0.0  # camera.time_offset_s is added once, by the recording
    assert events is EVENTS


def test_events_of_another_file_come_first(asked: Inputs, tmp_path: Path) -> None:
    """Oracle: the file's two lines."""
    (tmp_path / "events.txt").write_text("image tow\na.tif 10.05\nb.tif 10.10\n")
    (tmp_path / "flight.toml").write_text(FLIGHT + '[camera]\nevents = "events.txt"\n')
    _, _, cameras, _ = read_files(load_flight(tmp_path / "flight.toml"))
    events = cameras[0].events if cameras else None
    assert asked[0].events is False
    assert events is not None
    assert events.images == ("a.tif", "b.tif")


def test_images_name_the_rovers_events(asked: Inputs, tmp_path: Path) -> None:
    """Oracle: the flight file's own value."""
    (tmp_path / "names.txt").write_text("a.tif\nb.tif\n")
    (tmp_path / "flight.toml").write_text(FLIGHT + '[camera]\nimages = "names.txt"\n')
    read_files(load_flight(tmp_path / "flight.toml"))
    assert asked[0].match == ImageMatch(tmp_path / "names.txt")
    assert asked[0].rover_events == RoverEvents()
    more = (
        'skip_events = [2]\nskip_images = ["b.tif"]\nevents_containing = "cam"\ninvalid_events ='
        ' true\nimage_ending = ".tif"\n'
    )
    (tmp_path / "flight.toml").write_text(FLIGHT + '[camera]\nimages = "names.txt"\n' + more)
    read_files(load_flight(tmp_path / "flight.toml"))
    assert asked[1].match == ImageMatch(tmp_path / "names.txt", ".tif", (2,), ("b.tif",))
    assert asked[1].rover_events == RoverEvents("cam", True)


def test_the_images_own_times_tell_which_event_has_no_image(asked: Inputs, tmp_path: Path) -> None:
    """Oracle: the image that was not taken, the fourth of eight; the numbers of the images have no
    gap, the camera's clock is another.
    """
    shots = np.cumsum([0.0, 2.0, 2.3, 1.9, 2.1, 2.2, 1.8, 2.4])
    (tmp_path / "events.txt").write_text(
        "image tow\n" + "".join(f"{k} {10 + t:.6f}\n" for k, t in enumerate(shots))
    )
    (tmp_path / "photos").mkdir()
    for k, t in enumerate(np.delete(shots, 3), start=1):
        photograph(tmp_path / "photos" / f"{k}.jpg", t + 7.0)
    flight = FLIGHT + '[camera]\nevents = "events.txt"\nimages = "photos"\n'
    (tmp_path / "flight.toml").write_text(flight)
    with pytest.raises(
        InputError,
        match=(
            r"8 camera events and 7 images.* no image belongs to event 4; .* set"
            r" camera\.skip_events = \[4\]"
        ),
    ):
        read_files(load_flight(tmp_path / "flight.toml"))
    (tmp_path / "flight.toml").write_text(flight + "skip_events = [4]\n")
    _, _, cameras, _ = read_files(load_flight(tmp_path / "flight.toml"))
    events = cameras[0].events if cameras else None
    assert events is not None
    assert np.allclose(events.time, 10.0 + np.delete(shots, 3), rtol=0, atol=1e-9)


def test_images_name_the_events_of_another_file(asked: Inputs, tmp_path: Path) -> None:
    """Oracle: the lists; a count that does not fit is refused before the engine runs, with the way
    out, which then works.
    """
    (tmp_path / "Timestamp.MRK").write_text(
        "".join(f"{k}\t{10 + 0.05 * k:.6f}\t[2021]\t0,N\t0,E\t0,V\n" for k in (1, 2, 3))
    )
    (tmp_path / "names.txt").write_text("a.jpg\nc.jpg\n")
    flight = FLIGHT + '[camera]\nevents = "Timestamp.MRK"\nimages = "names.txt"\n'
    (tmp_path / "flight.toml").write_text(flight)
    with pytest.raises(
        InputError, match=r"Timestamp\.MRK: 3 camera events and 2 images.*skip_events"
    ):
        read_files(load_flight(tmp_path / "flight.toml"))
    assert asked == []
    (tmp_path / "flight.toml").write_text(flight + "skip_events = [2]\n")
    _, _, cameras, _ = read_files(load_flight(tmp_path / "flight.toml"))
    events = cameras[0].events if cameras else None
    assert events is not None
    assert events.images == ("a.jpg", "c.jpg")
    assert np.allclose(events.time, [10.05, 10.15], rtol=0, atol=1e-9)


READY = """gps_week = 2021
[imu]
file = "imu.csv"
[gnss]
file = "gnss.txt"
sigma_m = [0.02, 0.02, 0.03]
[camera]
"""


def test_images_name_the_events_of_ready_positions_by_the_same_rules(
    asked: Inputs, tmp_path: Path
) -> None:
    """Oracle: the lists; the same refusal and the same way out as with a rover, and no engine."""
    (tmp_path / "gnss.txt").write_text(
        "".join(f"{10 + 0.1 * k:.1f} 46.5 6.5 500.0\n" for k in range(3))
    )
    (tmp_path / "Timestamp.MRK").write_text(
        "".join(f"{k}\t{10 + 0.05 * k:.6f}\t[2021]\t0,N\t0,E\t0,V\n" for k in (1, 2, 3))
    )
    (tmp_path / "names.txt").write_text("a.jpg\nc.jpg\n")
    flight = READY + 'events = "Timestamp.MRK"\nimages = "names.txt"\n'
    (tmp_path / "flight.toml").write_text(flight)
    with pytest.raises(
        InputError, match=r"Timestamp\.MRK: 3 camera events and 2 images.*skip_events"
    ):
        read_files(load_flight(tmp_path / "flight.toml"))
    (tmp_path / "flight.toml").write_text(flight + "skip_events = [2]\n")
    _, fixes, cameras, ppk = read_files(load_flight(tmp_path / "flight.toml"))
    events = cameras[0].events if cameras else None
    assert (ppk, fixes.source, asked) == (None, str(tmp_path / "gnss.txt"), [])
    assert events is not None
    assert events.images == ("a.jpg", "c.jpg")
    assert np.allclose(events.time, [10.05, 10.15], rtol=0, atol=1e-9)
    assert events.notes == ()


def test_events_of_ready_positions_that_have_names_keep_them(asked: Inputs, tmp_path: Path) -> None:
    """Oracle: the file's names; images that name them again are refused."""
    (tmp_path / "gnss.txt").write_text(
        "".join(f"{10 + 0.1 * k:.1f} 46.5 6.5 500.0\n" for k in range(3))
    )
    (tmp_path / "events.txt").write_text("image tow\na.tif 10.05\nb.tif 10.10\n")
    (tmp_path / "names.txt").write_text("a.jpg\nb.jpg\n")
    (tmp_path / "flight.toml").write_text(READY + 'events = "events.txt"\nskip_events = [1]\n')
    _, _, cameras, _ = read_files(load_flight(tmp_path / "flight.toml"))
    events = cameras[0].events if cameras else None
    assert events is not None
    assert events.images == ("b.tif",)
    (tmp_path / "flight.toml").write_text(READY + 'events = "events.txt"\nimages = "names.txt"\n')
    with pytest.raises(
        InputError, match=r"events\.txt: the events already have image names \(a\.tif\)"
    ):
        read_files(load_flight(tmp_path / "flight.toml"))
