"""Whose clock stamps the exposures, where `insgnss inspect` can tell it."""

import tomllib
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from insgnss.flight.inspection.discovery import sources_of
from insgnss.flight.inspection.event_clock import clock_of_events
from insgnss.flight.inspection.run import inspect_files
from insgnss.flight.inspection.sources import Source
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
        sources.append(Source(role, path, ""))
    return clock_of_events(tuple(sources), imu, fixes, events)


APART = 200_000.0 + 7.0 * np.arange(1, 8) + 0.0031


@pytest.mark.parametrize(
    ("weeks", "stamps", "files", "clock", "sure"),
    [
        # samples count seconds of their own, fixes and exposures have the week
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
    source = Source("events", path, "")
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
    assert "do not tell whose clock stamps the exposures" in " ".join(text.replace("#", "").split())
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
