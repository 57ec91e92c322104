"""Decisions of a run that numbers make: what is refused, what is told, what is taken into the
stamps.
"""

import warnings
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from pyproj.transformer import TransformerGroup

from insgnss import load_flight
from insgnss.base.errors import DataError, InputError
from insgnss.flight.config.flight_file import Output
from insgnss.flight.processing.checks import (
    check_mountings,
    check_stationary,
    refuse_contradictions,
    refuse_unobservable,
    refuse_unreachable_crs,
)
from insgnss.flight.processing.input_files import stationary_fixes
from insgnss.flight.processing.orientation.poses import tangent_plane
from insgnss.flight.processing.recording import read_recording
from insgnss.flight.processing.segment_checks import check_motion
from insgnss.io.exposures.rig import event_clock
from insgnss.navigation.diagnosis.remedies import offset_to_apply
from insgnss.navigation.filter.codes import REJECTED, USED, VELOCITY_CONSTRAINT
from insgnss.records import Check, GnssFixes, ImuSamples, Trajectory
from insgnss.records.cameras.mounting import Mounting

FLIGHT: Any = SimpleNamespace(
    path=Path("flight.toml"),
    imu=SimpleNamespace(file=Path("imu.csv"), noise="navchip"),
    filter=SimpleNamespace(non_holonomic=True),
    camera=SimpleNamespace(),
    accept=(),
    tangent_plane=None,
)


def test_a_crs_whose_grid_is_missing_stops_before_the_flight_is_solved() -> None:
    """Oracle: PROJ's own list of grids, of which none comes with it; the same flight in UTM goes
    on, and so does one that writes nothing in a CRS.
    """
    fixes = GnssFixes(
        np.array([0.0, 1.0]),
        np.radians([51.5, 51.5]),
        np.radians([-0.1, -0.1]),
        np.array([50.0, 60.0]),
        np.broadcast_to(np.eye(3), (2, 3, 3)),
    )

    def flight(crs: str | None, formats: tuple[str, ...]) -> Any:
        output = Output(crs=crs, formats=formats)
        given = SimpleNamespace(datum=None, epoch=None)
        return SimpleNamespace(
            path=Path("flight.toml"), output=output, gnss=given, camera=SimpleNamespace()
        )

    refuse_unreachable_crs(flight(None, ("metashape",)), fixes)
    refuse_unreachable_crs(flight("EPSG:32630", ("metashape",)), fixes)
    refuse_unreachable_crs(flight("EPSG:27700", ("eo_local_plane",)), fixes)
    refuse_unreachable_crs(flight("EPSG:4937", ("metashape", "eo_local_plane")), fixes)
    with pytest.raises(InputError, match=r"flight\.toml: output\.crs: .*ITRF2020, which moves"):
        refuse_unreachable_crs(flight("EPSG:9989", ("metashape",)), fixes)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        there = TransformerGroup("EPSG:4937", "EPSG:27700", allow_ballpark=False).transformers
    if there:
        pytest.skip("the grid of the British datum is installed")
    with pytest.raises(InputError, match=r"flight\.toml: output\.crs: CRS EPSG:27700.*pyproj sync"):
        refuse_unreachable_crs(flight("EPSG:27700", ("metashape",)), fixes)


def path_of(sigma_deg: list[float]) -> Trajectory:
    """A trajectory whose heading has these standard deviations, its tilt a tenth of a degree."""
    n = len(sigma_deg)
    cov = np.zeros((n, 9, 9))
    cov[:, range(8), range(8)] = np.radians(0.1) ** 2
    cov[:, 8, 8] = np.radians(sigma_deg) ** 2
    one = np.zeros(n)
    C_nb = np.tile(np.eye(3), (n, 1, 1))
    return Trajectory(np.arange(n) + 1.0, one, one, one, np.zeros((n, 3)), C_nb, cov, 2008)


def test_attitude_that_half_of_the_rows_do_not_have_is_refused() -> None:
    """Oracle: 10 deg in the median, the limit that the refusal names."""
    refuse_unobservable(FLIGHT, path_of([9.0, 9.5, 90.0]))
    with pytest.raises(
        DataError, match=r"its standard deviation is 11 deg in the median \(limit 10\)"
    ):
        refuse_unobservable(FLIGHT, path_of([1.0, 11.0, 12.0]))


def test_motion_that_is_not_as_said_is_a_contradiction() -> None:
    """Oracle: most of the measurements used; 50 of 100 rejected are not yet most, 51 are."""

    def verdict(rejected: int) -> str:
        rows = np.zeros((200, 4), dtype=np.int64)
        rows[:100, VELOCITY_CONSTRAINT] = USED
        rows[:rejected, VELOCITY_CONSTRAINT] = REJECTED
        recording: Any = None
        solved: Any = [SimpleNamespace(solution=SimpleNamespace(verdict=rows))]
        (check,) = check_motion(FLIGHT, recording, solved)
        assert check.found.startswith(f"{rejected} of 100 ")
        return check.verdict

    assert verdict(50) == "ok"
    assert verdict(51) == "contradiction"


@pytest.mark.parametrize(
    ("offset_s", "sigma_s", "moved"),
    [(0.006, 0.001, True), (0.004, 0.001, False), (0.006, 0.0031, False), (-0.02, 0.001, True)],
)
def test_a_time_offset_is_taken_into_the_stamps(
    offset_s: float, sigma_s: float, moved: bool
) -> None:
    """Oracle: more than 5 ms and two sigma (a d^2 / 2 of what is left is below 0.1 mm), signed."""
    variance = np.zeros((2, 11))
    variance[-1, 10] = sigma_s**2
    problem = SimpleNamespace(layout=SimpleNamespace(offset=1))
    x = np.array([[0.0, 9.0], [0.0, offset_s]])
    solution: Any = SimpleNamespace(problem=problem, x=x, variance=variance.__getitem__)
    assert offset_to_apply(solution) == (offset_s if moved else 0.0)
    problem.layout.offset = -1
    assert offset_to_apply(solution) == 0.0


def test_a_contradiction_is_refused_unless_it_is_accepted() -> None:
    """Oracle: the words of the refusal, and the name in `accept`."""
    bad = Check("GNSS clock", "0.2 s late", "none", "contradiction", "check it")
    refuse_contradictions(FLIGHT, (replace(bad, verdict="note"),))
    with pytest.raises(InputError, match=r"GNSS clock: 0\.2 s late.*accept = \[\"GNSS clock\"\]"):
        refuse_contradictions(FLIGHT, (bad,))
    accepting: Any = SimpleNamespace(path=FLIGHT.path, accept=("GNSS clock",))
    refuse_contradictions(accepting, (bad,))


def test_an_imu_that_is_said_to_stand_must_do_so_for_most_of_the_time() -> None:
    """Oracle: 80 %, by hand, of 100 s."""
    imu = ImuSamples(np.array([0.0, 100.0]), np.zeros((2, 3)), np.zeros((2, 3)))
    assert check_stationary(imu, np.array([[0.0, 50.0], [60.0, 91.0]])).verdict == "ok"
    assert check_stationary(imu, np.array([[0.0, 79.0]])).verdict == "contradiction"


def test_fixes_of_a_known_place() -> None:
    """Oracle: by hand; one a second, variances of the given standard deviations."""
    imu = ImuSamples(np.array([5.0, 8.5]), np.zeros((2, 3)), np.zeros((2, 3)))
    fixes = stationary_fixes((46.5, 6.5, 400.0), (0.1, 0.2, 0.3), imu)
    assert fixes.time.tolist() == [5.0, 6.0, 7.0, 8.0]
    assert np.allclose(np.degrees([fixes.lat[0], fixes.lon[0]]), [46.5, 6.5], rtol=0, atol=1e-12)
    assert np.allclose(fixes.cov_ned[3], np.diag([0.01, 0.04, 0.09]), rtol=1e-12)


@pytest.mark.parametrize(
    ("imu_m", "turn_deg", "verdict"),
    [
        *((2.9, 9.9, "ok"), (3.1, 0.0, "note"), (0.1, 10.1, "note"), (0.0, 0.0, "note")),
        *((29.9, 0.0, "note"), (30.1, 0.0, "contradiction")),
    ],
)
def test_long_lever_arms_and_large_boresights_are_told(
    imu_m: float, turn_deg: float, verdict: str
) -> None:
    """Oracle: 3 m and 10 deg, the limits of the note, 30 m, that of a contradiction; and none of
    either, which is told as well.
    """
    c, s = np.cos(np.radians(turn_deg)), np.sin(np.radians(turn_deg))
    mounting = Mounting(
        antenna_m=[imu_m, 0.0, 0.0],
        imu_m=[imu_m, 0.0, 0.0],
        boresight=[[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]],
    )
    camera = SimpleNamespace(names=("camera_1",), further=())
    flight: Any = SimpleNamespace(mountings=(mounting,), camera=camera)
    check = check_mountings(flight)[0]
    assert check.verdict == verdict
    assert f"{turn_deg:.2f} deg" in check.found or turn_deg == 0.0


def test_origin_of_the_tangent_plane_is_the_first_fix_rounded() -> None:
    """Oracle: a hundredth of a degree and the ellipsoid, by hand; else the flight file's."""
    fixes: Any = SimpleNamespace(lat=np.radians([46.5678, 1.0]), lon=np.radians([-6.5432, 2.0]))
    plane = tangent_plane(FLIGHT, fixes)
    assert np.allclose(np.degrees([plane.lat, plane.lon]), [46.57, -6.54], rtol=0, atol=1e-12)
    assert plane.height == 0.0
    given: Any = SimpleNamespace(tangent_plane=SimpleNamespace(origin=(0.8, 0.1, 400.0)))
    plane = tangent_plane(given, fixes)
    assert (plane.lat, plane.lon, plane.height) == (0.8, 0.1, 400.0)


@pytest.mark.parametrize(
    ("clock", "own_s", "of"),
    [("auto", 0.0, "IMU's"), ("imu", 0.125, "IMU's"), ("receiver", 0.25, "receiver's")],
)
def test_time_offsets_are_added_to_the_stamps_of_their_sensor(
    tmp_path: Path, clock: str, own_s: float, of: str
) -> None:
    """Oracle: the stamps, by hand; data_specs/flight_file.md, "added to the stamps"; events move
    with the clock that they are said to be of, and where fixes are moved later, with these.
    """
    time = 1000.0 + 0.02 * np.arange(1001)
    rows = "".join(f"{t:.2f},0,0,0,0,0,-9.8\n" for t in time)
    (tmp_path / "imu.csv").write_text("tow,gx,gy,gz,ax,ay,az\n" + rows)
    fixes = "".join(f"{1001 + k}.0 46.5 6.5 400.0 0.02 0.02 0.03\n" for k in range(15))
    (tmp_path / "gnss.txt").write_text(fixes)
    (tmp_path / "events.txt").write_text("a.tif 1005.0\nb.tif 1010.0\n")
    (tmp_path / "flight.toml").write_text(
        'gps_week = 2008\n[imu]\nfile = "imu.csv"\ntime_offset_s = 0.125\n'
        '[gnss]\nfile = "gnss.txt"\ntime_offset_s = 0.25\n'
        f'[camera]\nevents = "events.txt"\ntime_offset_s = -0.0625\nclock = "{clock}"\n'
    )
    recording = read_recording(load_flight(tmp_path / "flight.toml"))
    assert recording.imu.time[0] == pytest.approx(1000.125, abs=1e-9)
    assert recording.gnss.time[0] == pytest.approx(1001.25, abs=1e-9)
    assert recording.events is not None
    assert recording.events.time[0] == pytest.approx(1004.9375 + own_s, abs=1e-9)
    (check,) = [check for check in recording.checks if check.name == "camera events"]
    assert f"of the {of} clock" in check.found
    again = recording.moved(0.5)
    assert again.gnss.time[0] == pytest.approx(1001.75, abs=1e-9)
    assert again.events is not None
    further = 0.5 if clock == "receiver" else 0.0
    assert again.events.time[0] - recording.events.time[0] == pytest.approx(further, abs=1e-9)


def test_events_that_the_receiver_wrote_are_of_its_clock(tmp_path: Path) -> None:
    """Oracle: what each file is: a rover's RINEX and a .MRK beside it or beside positions of RTKLIB
    keep the receiver's stamps; a log, a text and arrays may have any.
    """
    head = b"%  GPST   latitude(deg) longitude(deg)  height(m)   Q  ns   sdn(m)   sde(m)   sdu(m)\n"
    files = {
        "a.MRK": b"1\t5.0\t[2024]\t0,N\t0,E\t0,V\t1.0,Lat\t2.0,Lon\t3.0,Ellh\n",
        "a.pos": head,
        "a.txt": b"a.tif 5.0\n",
        "fixes.txt": b"5.0 46.5 6.5 400.0 0.02 0.02 0.03\n",
        "a.nmea": b"$GNGGA,1\n",
    }
    for name, content in files.items():
        (tmp_path / name).write_bytes(content)
    raw = SimpleNamespace()

    def clock(events: str | None, fixes: str | None, said: str = "auto") -> str:
        camera = SimpleNamespace(events=events and tmp_path / events, clock=said)
        gnss = SimpleNamespace(
            file=None if fixes is None else tmp_path / fixes, raw=raw if fixes is None else None
        )
        return event_clock(camera, gnss)  # type: ignore[arg-type]

    assert {clock(None, None), clock("a.MRK", None), clock("a.MRK", "a.pos")} == {"receiver"}
    others = [("a.txt", None), ("a.txt", "a.pos"), ("a.MRK", "fixes.txt"), ("a.MRK", "a.nmea")]
    assert {clock(*pair) for pair in others} == {"imu"}
    assert (clock("a.txt", "fixes.txt", "receiver"), clock(None, None, "imu")) == (
        "receiver",
        "imu",
    )
