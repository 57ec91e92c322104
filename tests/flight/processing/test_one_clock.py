"""Products count GPST, whatever the clock of each sensor and whichever key says how they differ."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

import insgnss
from insgnss.flight.processing.clocks import clock_offsets, unstated_offset
from insgnss.io.exposures.instants import on_clock
from insgnss.io.exposures.rig import CameraExposures, ClockOffsets
from insgnss.records import CameraEvents

LEAP_S = 18.0


@pytest.fixture(scope="module")
def sim():
    return insgnss.simulate("ign8", 3.0, imu_rate_hz=50.0, seed=53)


def estimated(sim, imu_s=0.0, gnss_s=0.0, events_s=0.0, **changes):
    """The flight with the stamps of its sensors moved."""
    plane = sim.tangent_plane
    return insgnss.estimate(
        replace(sim.imu, time=sim.imu.time + imu_s),
        replace(sim.gnss, time=sim.gnss.time + gnss_s),
        replace(sim.events, time=sim.events.time + events_s),
        mounting=sim.mounting,
        tangent_plane=(*np.degrees([plane.lat, plane.lon]), plane.height),
        **changes,
    )


@pytest.fixture(scope="module")
def right(sim):
    return estimated(sim)


MOVED = {
    # stamps of IMU, fixes and events moved by (s), the key that says so, and the clock of events
    "IMU in UTC": ((-LEAP_S, 0.0, -LEAP_S), {"gnss__time_offset_s": -LEAP_S}),
    "IMU in UTC by its own key": ((-LEAP_S, 0.0, 0.0), {"imu__time_offset_s": LEAP_S}),
    "IMU in UTC, receiver's events": (
        (-LEAP_S, 0.0, 0.0),
        {"gnss__time_offset_s": -LEAP_S, "camera__clock": "receiver"},
    ),
    "IMU in local time, an hour ahead": ((3600.0, 0.0, 3600.0), {"gnss__time_offset_s": 3600.0}),
    "IMU since power-up": ((-200000.0, 0.0, -200000.0), {"gnss__time_offset_s": -200000.0}),
    "IMU since power-up, events in GPST": (
        (-200000.0, 0.0, 0.0),
        {"gnss__time_offset_s": -200000.0},
    ),
}


@pytest.mark.slow
@pytest.mark.parametrize("case", MOVED)
def test_the_clock_of_a_sensor_leaves_products_as_they_are(sim, right, case):
    """Oracle: the flight of sensors that all count GPST: time and place of images and trajectory,
    to what the flight leaves open of the latency of its fixes, far below a millisecond."""
    (imu_s, gnss_s, events_s), keys = MOVED[case]
    result = estimated(sim, imu_s, gnss_s, events_s, **keys)
    if "camera__clock" in keys or "events in GPST" in case:  # moved by the latency of the fixes
        right = estimated(sim, camera__clock="receiver")
    assert result.eo.images == right.eo.images
    assert np.abs(result.eo.time - right.eo.time).max() < 5e-4
    assert np.abs(result.eo.position_m - right.eo.position_m).max() < 2e-4
    assert np.abs(result.trajectory.time - right.trajectory.time).max() < 5e-4
    assert np.abs(result.trajectory.height - right.trajectory.height).max() < 2e-4
    said = "to GPST, the clock of the fixes" in " ".join(result.report["history"])
    assert said is ("gnss__time_offset_s" in keys)


def flight_with(imu_s=0.0, gnss_s=0.0, columns=None, week=None, imu_units=None, gnss_units=None):
    imu = SimpleNamespace(time_offset_s=imu_s, units=imu_units)
    gnss = SimpleNamespace(time_offset_s=gnss_s, columns=columns, units=gnss_units)
    return SimpleNamespace(imu=imu, gnss=gnss, gps_week=week)


@pytest.mark.parametrize(
    ("gnss_s", "week", "columns", "expected"),
    [
        (-0.12, 2200, None, ClockOffsets(0.25, -0.12, 0.0)),  # a latency is of the fixes
        (18.0, None, "t x y z", ClockOffsets(0.25, 18.0, 0.0)),  # UTC fixes, IMU in GPST
        (18.0, 2200, None, ClockOffsets(-17.75, 0.0, -18.0)),  # of a format that says GPST
        (-18.0, None, "t x y z", ClockOffsets(18.25, 0.0, 18.0)),
        (7200.0, None, None, ClockOffsets(-7199.75, 0.0, -7200.0)),
        (205190.0, None, None, ClockOffsets(0.25, 205190.0, 0.0)),  # fixes since power-up
        (-205190.0, None, None, ClockOffsets(205190.25, 0.0, 205190.0)),  # an IMU since power-up
    ],
)
def test_which_sensor_is_moved(gnss_s, week, columns, expected):
    """Oracle: by hand: GPST is 18 s ahead of UTC; the difference of both clocks stays."""
    flight = flight_with(0.25, gnss_s, columns)
    fixes = SimpleNamespace(gps_week=week, source_format="")
    assert clock_offsets(flight, fixes) == expected
    assert expected.gnss - expected.imu == pytest.approx(gnss_s - 0.25)


@pytest.mark.parametrize("units", [None, {"time": "unix"}])
@pytest.mark.parametrize("form", ["gnss_text", "rtklib_pos"])
def test_a_week_of_the_flight_file_is_no_date_of_a_table(units, form):
    """Oracle: by hand: fixes 18 s late are UTC where their table has no epoch; `.pos` says GPST."""
    flight, fixes = flight_with(0.0, 18.0, week=2200, gnss_units=units), SimpleNamespace()
    fixes.gps_week, fixes.source_format = 2200, form
    moved = form == "gnss_text" and units is None
    assert clock_offsets(flight, fixes).gnss == (18.0 if moved else 0.0)
    of_imu = flight_with(0.0, 7200.0, week=2200, gnss_units=units, imu_units={"time": "unix_ms"})
    assert clock_offsets(of_imu, fixes).gnss == (7200.0 if moved else 0.0)


@pytest.mark.parametrize(
    ("first_s", "expected"), [(205200.0, 0.0), (10.0, 205190.0), (205190.0, 0.0), (5.0, 205190.0)]
)
def test_another_sensor_moves_with_the_imu_unless_it_fits_better(first_s, expected):
    """Oracle: by hand: an IMU of power-up, moved to 205200 s, and sensors on it or not."""
    span, offsets = np.array([205200.0, 205300.0]), ClockOffsets(205190.0, 0.0, 205190.0)
    assert unstated_offset(first_s + np.arange(90.0), offsets, span) == expected


def test_exposures_that_only_fit_the_clock_of_the_fixes_are_of_it():
    """Oracle: by hand: a recording from 1000 to 1100 s, its IMU moved by 500 s."""
    for time, expected in ((1050.0, 1050.0), (550.0, 1050.0), (20.0, 520.0)):
        events = CameraEvents(("a.tif",), np.array([time]), 2200, "e.txt")
        cameras = [CameraExposures("camera_1", events)]
        options = SimpleNamespace(all_of_rig=[SimpleNamespace(time_offset_s=0.0, clock="auto")])
        offsets = ClockOffsets(500.0, 0.0, 500.0)
        (camera,) = on_clock(cameras, options, offsets, 2200, np.array([1000.0, 1100.0]))
        assert camera.events.time[0] == expected
