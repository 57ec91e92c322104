"""Rows that hold the last fix are told from positions that repeat because they are rounded."""

import numpy as np
import pytest

from insgnss.formats.gnss.repeated import holds_fixes
from insgnss.simulation.manoeuvres import multirotor
from insgnss.simulation.raw_gnss.receiver import GnssOptions
from insgnss.simulation.scenario import ImuOptions, observe


def fixes_of(minutes, rate_hz, sigma_m):
    """Latitude and longitude, deg, of a multirotor that hovers (all the time up to 0.8 min)."""
    gnss = GnssOptions(rate_hz, sigma_m=(sigma_m,) * 3)
    flight = multirotor(minutes, "hover", seed=3)
    sim = observe(flight, 3, imu=ImuOptions(20.0), gnss=gnss, truth_hz=1.0)
    return np.degrees(sim.gnss.lat), np.degrees(sim.gnss.lon)


@pytest.mark.parametrize("minutes", [0.75, 3.0])
@pytest.mark.parametrize("step", [1e-6, 1e-5])
def test_rounded_positions_are_new_fixes(minutes, step):
    """Oracle: every row is a fix of its own; more than half have the digits of the one before."""
    lat, lon = (np.round(x / step) * step for x in fixes_of(minutes, 10.0, 0.01))
    assert np.mean((np.diff(lat) == 0.0) & (np.diff(lon) == 0.0)) > 0.5
    assert not holds_fixes(lat, lon)


@pytest.mark.parametrize("minutes", [0.75, 3.0])
@pytest.mark.parametrize("step", [1e-9, 1e-7, 1e-6])
@pytest.mark.parametrize("rows", [5, 100])
def test_held_fixes_are_held(minutes, step, rows):
    """Oracle: each fix is repeated as a logger does that writes a row for every sample."""
    lat, lon = (np.repeat(np.round(x / step) * step, rows) for x in fixes_of(minutes, 5.0, 0.02))
    assert holds_fixes(lat, lon)
