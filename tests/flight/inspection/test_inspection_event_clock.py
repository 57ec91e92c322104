"""Whose clock stamps the exposures, where `insgnss inspect` can tell it."""

import tomllib
from dataclasses import replace
from datetime import datetime, timedelta
from pathlib import Path

import numpy as np
import pytest

from insgnss.api.verbs import simulate
from insgnss.flight.inspection.discovery import discover, sources_of
from insgnss.flight.inspection.event_clock import SCALE_OPEN, clock_of_events, scale_of_dates
from insgnss.flight.inspection.run import inspect_files
from insgnss.flight.inspection.sources import InputSource
from insgnss.geodesy.gpstime import calendar_from_gps
from insgnss.io.formats import read_events
from insgnss.records import CameraEvents, GnssFixes, ImuSamples
from insgnss.simulation.dataset import write_dataset

IMU_TIME = 200_000.0 + 0.01 * np.arange(6000) + 1e-4 * np.sin(np.arange(6000))


def told(imu_week, gnss_week, events_week, stamps, files=("imu", "gnss", "events"), tmp=None):
    time = 200_000.0 + np.arange(60.0)
    zeros = np.zeros((6000, 3))
    imu = ImuSamples(IMU_TIME, zeros, zeros + 9.8, gps_week=imu_week)
    fixes = GnssFixes(
        time, time * 0.0, time * 0.0, time * 0.0, np.tile(np.eye(3), (60, 1, 1)), gps_week=gnss_week
    )
    events = CameraEvents(tuple(map(str, range(len(stamps)))), stamps, events_week)
    sources = []
    for role, name in zip(("imu", "gnss", "events"), files, strict=True):
        path = tmp / f"{name}.txt"
        path.write_text("1 2\n")
        sources.append(InputSource(role, path, ""))
    return clock_of_events(tuple(sources), imu, fixes, events)


APART = 200_000.0 + 7.0 * np.arange(1, 8) + 0.0031


@pytest.mark.parametrize(
    ("weeks", "stamps", "files", "clock", "sure"),
    [
        # samples only count seconds of their own, fixes and exposures have the week
        ((None, 2000, 2000), APART, ("imu", "gnss", "events"), "receiver", True),
        # the stamps of samples, none of which is a round number
        ((2000, 2000, 2000), IMU_TIME[500::700], ("imu", "gnss", "events"), "imu", True),
        ((None, None, None), APART, ("log", "gnss", "log"), "imu", True),
        ((None, None, None), APART, ("imu", "log", "log"), "receiver", True),
        # nothing tells it
        ((2000, 2000, 2000), APART, ("imu", "gnss", "events"), "receiver", False),
        ((None, None, None), APART, ("imu", "gnss", "events"), "receiver", False),
    ],
)
def test_what_tells_the_clock(tmp_path, weeks, stamps, files, clock, sure):
    found = told(*weeks, stamps, files, tmp_path)
    assert (found[0], found[2]) == (clock, sure)


def test_round_stamps_are_no_evidence(tmp_path):
    """Stamps rounded to the interval of an even IMU are those of samples by chance."""
    even = 200_000.0 + 0.01 * np.arange(6000)
    zeros = np.zeros((6000, 3))
    imu = ImuSamples(even, zeros, zeros + 9.8, gps_week=2000)
    events = CameraEvents(tuple("abcdefg"), even[300::900], 2000)
    fixes = GnssFixes(
        even[::100], *np.zeros((3, 60)), np.tile(np.eye(3), (60, 1, 1)), gps_week=2000
    )
    path = tmp_path / "x.txt"
    path.write_text("1 2\n")
    source = InputSource("events", path, "")
    files = [replace(source, path=Path(tmp_path / name)) for name in ("a", "b")]
    assert not clock_of_events((*files, source), imu, fixes, events)[2]


def test_the_draft_says_that_it_is_not_told(tmp_path):
    """The simulated data set: exposures in GPS time beside samples in GPS time."""
    place = tmp_path / "set"
    write_dataset(place, minutes=3.0, imu_rate=50.0, seed=4)
    (place / "flight.toml").unlink()
    found = inspect_files([place])
    assert found.draft is not None
    text = found.draft.text(place)
    assert '# clock = "receiver"' in text
    assert "do not show which clock stamps the exposures" in " ".join(text.replace("#", "").split())
    assert "clock" not in tomllib.loads(text)["camera"]


@pytest.mark.parametrize(("zone", "stated"), [("Z", True), ("", False)])
def test_a_table_of_names_and_dates_is_drafted_as_exposures(tmp_path, zone, stated):
    """Oracle: the names that were written; a scale that the file does not state is left open, and
    dates without names are no exposures.
    """
    lines = [f"DSC {k}.JPG,2018-07-03 10:20:{k:02d}.25{zone}" for k in range(10, 40)]
    path = tmp_path / "events.csv"
    path.write_text("filename,date-time\n" + "\n".join(lines) + "\n")
    (source,) = sources_of(path)
    assert (source.role, source.what) == ("events", "exposures with their dates, 30 of them")
    assert source.keys == ({} if stated else {"time_scale": "utc"})
    path.write_text("\n".join(line.partition(",")[2] for line in lines) + "\n")
    assert sources_of(path) == []


def test_the_draft_of_dates_has_a_camera(tmp_path):
    """Oracle: the exposures of the simulated data set, as a geotagging tool lists them."""
    place = tmp_path / "set"
    write_dataset(place, minutes=3.0, imu_rate=50.0, seed=4)
    (place / "flight.toml").unlink()
    events = next(place.rglob("Events.txt"))
    week = read_events(events, gps_week=2008)
    stamps = [calendar_from_gps(2008, tow).strftime("%Y-%m-%d %H:%M:%S.%f") for tow in week.time]
    rows = (f"{name},{stamp}\n" for name, stamp in zip(week.images, stamps, strict=True))
    events.with_suffix(".csv").write_text("filename,date-time\n" + "".join(rows))
    events.unlink()
    found = inspect_files([place])
    assert found.draft is not None
    text = found.draft.text(place)
    assert tomllib.loads(text)["camera"]["events"].endswith("Events.csv")
    assert '# time_scale = "utc"' in text
    assert np.abs(found.events.time - week.time).max() < 1e-5


T0 = datetime(2018, 7, 3, 9, 1, 34, 857678)
NAMES = [f"DSC{k:05d}.JPG" for k in range(40)]
DATES = [f"{T0 + timedelta(seconds=1.7 * k)}" for k in range(40)]
TOW_MS = [f"{1e3 * (205312.857678 + 1.7 * k):.3f}" for k in range(40)]
TOW = [f"{205312.857678 + 1.7 * k:.6f}" for k in range(40)]


@pytest.mark.parametrize(
    ("header", "columns", "taken"),
    [
        ("filename,gps_datetime", (NAMES, DATES), None),
        ("camera,file,gps_datetime", (["A7"] * 40, NAMES, DATES), "file gps_datetime"),
        ("Bild,Aufnahmezeit", (NAMES, TOW), "Bild Aufnahmezeit"),
        ("pic,created_s,shutter", (NAMES, TOW, TOW), "pic shutter"),
        ("seq,time_of_exposure", (map(str, range(40)), TOW), "seq time_of_exposure"),
        ("name,gps_week,gps_tow", (NAMES, ["2008"] * 40, TOW), "name gps_tow gps_week"),
        ("jpg,gps_week,gps_tow(ms)", (NAMES, ["2008"] * 40, TOW_MS), "jpg gps_tow(ms) gps_week"),
        ("", (TOW, NAMES), "[2] [1]"),
        ("Photo,Day,Clock", (NAMES, *zip(*map(str.split, DATES), strict=True)), "Photo Day Clock"),
    ],
)
def test_a_column_of_names_and_one_of_times_are_exposures(tmp_path, header, columns, taken):
    """Oracle: the names and stamps that were written, and the columns that hold them."""
    path = tmp_path / "photos.csv"
    rows = [",".join(row) for row in zip(*columns, strict=True)]
    path.write_text("\n".join([*([header] if header else []), *rows]) + "\n")
    (source,) = sources_of(path)
    assert source.role == "events"
    named = source.keys.get("columns")
    assert (named and set(named.values())) == (taken and set(taken.split()))
    scale = source.keys.get("time_scale")
    events = read_events(path, **({"columns": named} if named else {}), time_scale=scale)
    assert len(events.images) == 40
    np.testing.assert_allclose(np.diff(events.time), 1.7, atol=1e-5)


@pytest.mark.parametrize("header", ["image,one,two", "image,duration,weight"])
def test_a_table_of_images_without_a_time_is_left_out_with_its_columns(tmp_path, header):
    """Oracle: two columns that could be the time alike, and none that could."""
    values = [TOW, TOW] if "one" in header else [["a"] * 40, ["b"] * 40]
    path = tmp_path / "photos.csv"
    path.write_text("\n".join([header, *map(",".join, zip(NAMES, *values, strict=True))]) + "\n")
    (left,) = discover([tmp_path]).left_out
    assert "none of 'image'" in left[1]


@pytest.mark.slow
@pytest.mark.parametrize("scale", ["utc", "gpst", "utc+02:00", "open"])
def test_the_scale_of_dates_is_that_in_which_they_lie_on_lines(tmp_path, scale):
    """Oracle: the scale in which a corridor's exposures were written; a camera that exposes in
    turns as well leaves it open.
    """
    sim = simulate("ign6x1", minutes=4.0, imu_rate_hz=20.0)
    zone = 7200.0 * (scale == "utc+02:00")
    kind = "gpst" if scale == "gpst" else "utc"
    time = sim.events.time
    time = (
        np.linspace(sim.gnss.time[600], sim.gnss.time[-1], time.size) if scale == "open" else time
    )
    stamps = [calendar_from_gps(2008, tow + zone, kind) for tow in time]
    path = tmp_path / "photos.csv"
    rows = zip(sim.events.images, stamps, strict=True)
    path.write_text("file,when\n" + "".join(f"{n},{s:%Y-%m-%d %H:%M:%S.%f}\n" for n, s in rows))
    (source,) = sources_of(path)
    events = read_events(path, time_scale="utc")
    found, read = scale_of_dates(source, events, sim.gnss)
    if scale == "open":
        assert found is source
        return
    assert (found.keys["time_scale"], found.why["time_scale"] == SCALE_OPEN) == (scale, False)
    np.testing.assert_allclose(read.time, time, atol=1e-5)
