"""Circles and multirotors: forces and noses are what the formulae of their module say."""

import numpy as np
import pytest
from air_motions import circles, multirotor

from insgnss.base.errors import UsageError

G = 9.81


@pytest.mark.parametrize("bank", [30.0, 45.0])
def test_a_circle_has_the_force_of_its_bank(bank):
    """Oracle: g / cos(bank), its speed over the turn rate, tan(bank) g / V; gusts average out."""
    motion = circles(2.0, seed=4, bank_deg=bank, speed_ms=16.0).motion
    time = np.arange(motion.start, motion.end, 0.25)
    force = np.median(np.linalg.norm(motion.inertial(time)[1], axis=1))
    assert force == pytest.approx(G / np.cos(np.radians(bank)), rel=0.02)
    roll, _, yaw = motion.angles(time).T
    assert np.degrees(np.median(np.abs(roll))) == pytest.approx(bank, abs=2.0)
    rate = abs(yaw[-1] - yaw[0]) / (time[-1] - time[0])
    assert rate == pytest.approx(G * np.tan(np.radians(bank)) / 16.0, rel=0.02)


@pytest.mark.parametrize(("style", "off"), [("sideways", 90.0), ("backward", 180.0)])
def test_a_multirotor_leans_to_accelerate_with_its_nose_off_its_course(style, off):
    """Oracle: the angle between nose and course that the style names, and a force along -z within
    what the drag takes off it, however hard it accelerates.
    """
    motion = multirotor(2.0, style, seed=2, wind_ms=0.0).motion
    time = np.arange(motion.start, motion.end, 0.25)
    velocity, yaw = motion.velocity(time), motion.angles(time)[:, 2]
    fast = np.hypot(*velocity.T[:2]) > 5.0
    between = np.degrees(yaw - np.arctan2(velocity[:, 1], velocity[:, 0]))[fast]
    assert np.abs((between - off + 180.0) % 360.0 - 180.0).max() < 30.0
    force = motion.inertial(time)[1]
    assert np.linalg.norm(motion.position(time, 2), axis=1).max() > 3.0
    assert np.abs(force[:, :2]).max() < 0.3 * 8.0
    assert fast.mean() > 0.3


def test_a_hovering_multirotor_stands_most_of_the_time():
    """Oracle: legs of 8 to 16 s between a minute of hovering; where it hovers its nose holds."""
    motion = multirotor(4.0, "hover", seed=1).motion
    time = np.arange(motion.start, motion.end, 0.5)
    slow = np.linalg.norm(motion.velocity(time), axis=1) < 1.0
    assert 0.6 < slow.mean() < 0.95
    with pytest.raises(UsageError, match="none of sideways"):
        multirotor(2.0, "upside down")
    with pytest.raises(UsageError, match="half a minute"):
        circles(0.4)
