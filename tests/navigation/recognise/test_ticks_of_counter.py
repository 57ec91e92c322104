"""Stamps that count ticks of an oscillator, no decimal part of a second, are recognised."""

from dataclasses import replace

import numpy as np
import pytest

from insgnss.flight.inspection.run import inspect_files
from insgnss.navigation.recognise.claims import ticks_of_counter, with_ticks
from insgnss.navigation.recognise.recognition import recognise
from insgnss.records import Question
from insgnss.simulation.scenario import ImuOptions, simulate_flight


@pytest.fixture(scope="module")
def flown():
    return simulate_flight("ign8", 4.0, seed=6, imu=ImuOptions(rate_hz=50.0), start_in_air=True)


def counted(flown, hertz, unit_s):
    """Samples whose stamps count ticks from a start of their own, read in a decimal unit."""
    ticks = np.round((flown.imu.time - flown.imu.time[0] + 37.25) * hertz)
    return replace(flown.imu, time=ticks * unit_s, gps_week=None)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("hertz", "unit_s"), [(1024.0, 1e-3), (25600.0, 1e-3), (32768.0, 1e-3), (2.0**20, 1e-6)]
)
def test_the_counter_is_found_in_a_decimal_unit(flown, hertz, unit_s):
    """Oracle: the ticks that the stamps were made of."""
    imu, gnss = counted(flown, hertz, unit_s), replace(flown.gnss, gps_week=None)
    found = ticks_of_counter(imu, gnss, unit_s, recognise(imu, gnss))
    assert found is not None
    assert found[0] == hertz


@pytest.mark.slow
@pytest.mark.parametrize("drift", [-2e-3, 0.0, 2e-3])
def test_a_decimal_clock_is_no_counter(flown, drift):
    """Oracle: milliseconds of a clock that is right, or as bad as a board's resonator."""
    imu = counted(flown, 1000.0 * (1.0 + drift), 1e-3)
    gnss = replace(flown.gnss, gps_week=None)
    assert ticks_of_counter(imu, gnss, 1e-3, recognise(imu, gnss)) is None


@pytest.mark.slow
def test_a_flight_file_that_claims_milliseconds_is_told_the_tick(flown):
    """Oracle: the tick, beside a contradiction of the turns that a clock 2.4 % off makes."""
    turns = Question("turn rate, gyro against GNSS course", "").contradiction("", "")
    imu, gnss = counted(flown, 1024.0, 1e-3), replace(flown.gnss, gps_week=None)
    (check,) = with_ticks([turns], imu, gnss, 1e-3)
    assert check.name == "recognised clock"
    assert "976.5625 us" in check.advice
    assert with_ticks([turns], counted(flown, 1000.0, 1e-3), gnss, 1e-3) == [turns]


@pytest.mark.slow
def test_the_draft_has_the_tick(flown, tmp_path):
    """Oracle: the unit that the stamps were made of, from files without a word of it."""
    ticks = np.round((flown.imu.time - flown.imu.time[0] + 37.25) * 25600.0)
    rows = np.column_stack([ticks, flown.imu.gyro, flown.imu.accel])
    header = "sensortime,gyr_x,gyr_y,gyr_z,acc_x,acc_y,acc_z"
    np.savetxt(tmp_path / "imu.csv", rows, ["%d", *["%.8f"] * 6], ",", "\n", header, comments="")
    fixes, degrees = flown.gnss, np.degrees
    rows = np.column_stack([fixes.time, degrees(fixes.lat), degrees(fixes.lon), fixes.height])
    np.savetxt(
        tmp_path / "gps.csv", rows, "%.9f", ",", "\n", "tow,lat_deg,lon_deg,h_ell_m", comments=""
    )
    inspection = inspect_files([tmp_path / "imu.csv", tmp_path / "gps.csv"])
    assert inspection.sources[0].keys["units"]["time"] == "39.0625 us"
    assert "explain" in inspection.sources[0].why["units"]
