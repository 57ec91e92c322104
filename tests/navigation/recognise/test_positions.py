"""Positions against the velocities beside them: which misreading of a file is told, and that
nothing is told of a file that is right.
"""

from dataclasses import replace

import numpy as np
import pytest

from insgnss.navigation.recognise.plausibility import _gnss_position
from insgnss.navigation.recognise.positions import check_velocity
from insgnss.simulation.scenario import GnssOptions, ImuOptions, simulate_flight

DEG = np.pi / 180.0


def fly(plan="ign8", sigma=(0.5, 0.5, 1.0), seed=21):
    options = GnssOptions(sigma_m=sigma, velocity_sigma_ms=(0.1, 0.1, 0.1))
    return simulate_flight(
        plan, 3.0, seed=seed, imu=ImuOptions(rate_hz=20.0), gnss=options, start_in_air=True
    ).gnss


@pytest.fixture(scope="module")
def gnss():
    return fly()


def columns(v, *order):
    return v[:, list(order)]


MISREAD = {
    "exchange their names": lambda g: replace(g, lat=g.lon, lon=g.lat),
    'angle = "rad"': lambda g: replace(g, lat=DEG * g.lat, lon=DEG * g.lon),
    'angle = "rad" } or and': lambda g: replace(g, lat=DEG * g.lon, lon=DEG * g.lat),
    "sign of the latitude": lambda g: replace(g, lat=-g.lat),
    "sign of the longitude": lambda g: replace(g, lon=-g.lon),
    'velocity = "km/h"': lambda g: replace(g, velocity_ned=3.6 * g.velocity_ned),
    'velocity = "kn"': lambda g: replace(g, velocity_ned=1.943844 * g.velocity_ned),
    'velocity = "cm/s"': lambda g: replace(g, velocity_ned=100.0 * g.velocity_ned),
    "vn and ve are exchanged": lambda g: replace(g, velocity_ned=columns(g.velocity_ned, 1, 0, 2)),
}


@pytest.mark.parametrize("advice", MISREAD)
def test_a_misreading_is_named(gnss, advice):
    """Oracle: the misreading made here."""
    check = check_velocity(MISREAD[advice](gnss))
    assert check.verdict == "contradiction"
    for part in advice.split(" or and"):
        assert part in check.advice
    assert ("exchange their names" in check.advice) == ("exchange" in advice or "or and" in advice)


def test_a_vertical_velocity_of_the_other_sense_is_named(gnss):
    """Oracle: the sign turned here; on a flight that climbs and descends."""
    t = gnss.time - gnss.time[0]
    climbing = replace(
        gnss,
        height=gnss.height + 20.0 * np.sin(0.1 * t),
        velocity_ned=gnss.velocity_ned - np.outer(2.0 * np.cos(0.1 * t), [0.0, 0.0, 1.0]),
    )
    assert check_velocity(climbing).verdict == "ok"
    check = check_velocity(replace(climbing, velocity_ned=climbing.velocity_ned * [1.0, 1.0, -1.0]))
    assert check.verdict == "contradiction"
    assert "vu instead of vd" in check.advice


@pytest.mark.parametrize(("climb", "verdict"), [(0.28, "ok"), (0.45, "contradiction")])
def test_the_sense_is_judged_of_who_climbs_fast_enough(gnss, climb, verdict):
    """Oracle: heights and vertical velocities without noise, their sense turned; 0.3 m/s."""
    t = gnss.time - gnss.time[0]
    velocity = gnss.velocity_ned.copy()
    velocity[:, 2] = climb * np.cos(0.1 * t)  # down, where the heights rise
    turned = replace(gnss, height=500.0 + 10.0 * climb * np.sin(0.1 * t), velocity_ned=velocity)
    assert check_velocity(turned).verdict == verdict


@pytest.mark.parametrize("seed", [1, 2])
@pytest.mark.parametrize("sigma", [0.02, 3.0])
def test_right_columns_are_never_contradicted(sigma, seed):
    """Oracle: the simulator; fixes of an RTK and of a single-point receiver, late by half a second,
    slow, standing, or with velocities that are of no use.
    """
    gnss = fly("ign6x1", (sigma, sigma, 2.0 * sigma), seed)
    late = replace(gnss, velocity_ned=np.roll(gnss.velocity_ned, 3, axis=0))
    slow = replace(
        gnss,
        lat=gnss.lat[0] + 0.02 * (gnss.lat - gnss.lat[0]),
        lon=gnss.lon[0] + 0.02 * (gnss.lon - gnss.lon[0]),
        velocity_ned=0.02 * gnss.velocity_ned,
    )
    rng = np.random.default_rng(seed)
    useless = replace(gnss, velocity_ned=rng.normal(0.0, 5.0, gnss.velocity_ned.shape))
    for fixes in (gnss, late, slow):
        assert check_velocity(fixes).verdict == "ok"
    assert check_velocity(useless).verdict == "note"
    still = replace(gnss, velocity_ned=0.02 * gnss.velocity_ned)
    assert check_velocity(still).verdict == "note"


@pytest.mark.parametrize("exchanged", [False, True])
def test_radians_read_as_degrees_lie_in_the_sea(gnss, exchanged):
    """Oracle: Beijing in radians is 0.70, 2.03: no land is within pi degrees of 0, 0, in either
    order.
    """
    place = (0.7017 * DEG, 2.0285 * DEG)
    lat, lon = place[::-1] if exchanged else place
    moved = replace(gnss, lat=lat + gnss.lat - gnss.lat[0], lon=lon + gnss.lon - gnss.lon[0])
    check = _gnss_position(moved)
    assert check.verdict == "contradiction"
    assert 'angle = "rad"' in check.advice
    assert ("exchanged" in check.advice) == exchanged
