"""Positions with too few digits: their step is found, its variance added, and nothing else is."""

from dataclasses import replace

import numpy as np
import pytest
from air_motions import multirotor

import insgnss
from insgnss.navigation.prepare.fix_covariance.decision import rounding_step, with_rounding
from insgnss.records import GnssFixes
from insgnss.simulation.raw_gnss.receiver import GnssOptions
from insgnss.simulation.scenario import ImuOptions, observe

METRES = 111_200.0  # of a degree


def rounded(fixes, step_deg, step_m):
    """The fixes with positions to that many digits."""
    lat, lon = (
        np.radians(np.round(np.degrees(angle) / step_deg) * step_deg)
        for angle in (fixes.lat, fixes.lon)
    )
    return replace(fixes, lat=lat, lon=lon, height=np.round(fixes.height / step_m) * step_m)


def hovering(sigma_m, seed=3):
    """A multirotor over one place for two and a half minutes."""
    gnss = GnssOptions(sigma_m=(sigma_m, sigma_m, 1.5 * sigma_m))
    flight = multirotor(2.5, "hover", seed=seed)
    return observe(flight, seed, imu=ImuOptions(rate_hz=50.0), gnss=gnss, truth_hz=1.0)


@pytest.mark.parametrize("step", [1e-7, 1e-6, 1e-5])
def test_step_of_decimal_numbers(step):
    """Oracle: numpy's rounding; without it there is no step."""
    values = 47.123 + 1e-4 * np.random.default_rng(1).standard_normal(3000)
    there = np.round(values / step) * step
    assert rounding_step(there, METRES) == pytest.approx(step, rel=1e-9)
    assert rounding_step(values, METRES) == 0.0


def test_a_rounding_is_added_once_for_a_run_of_equal_fixes():
    """Oracle: (Q.1): a millimetre of sigma, heights to a decimetre, of which the first thirty are
    equal; latitude and longitude have all their digits.
    """
    fixes = hovering(0.001).gnss[:60]
    height = np.round(np.concatenate([np.full(30, 510.0), 510.0 + 0.1 * np.arange(1, 31)]), 1)
    got = with_rounding(replace(fixes, height=height))
    added = np.diagonal(got.cov_ned - fixes.cov_ned, axis1=1, axis2=2)
    np.testing.assert_allclose(added[:30, 2], 30.0 * 0.01 / 12.0, rtol=1e-9)
    np.testing.assert_allclose(added[30:, 2], 0.01 / 12.0, rtol=1e-9)
    np.testing.assert_allclose(added[:, :2], 0.0)
    assert "0 / 0 / 10 cm" in got.notes[-1].found


def test_a_rounding_counts_from_three_tenths_of_the_sigma_on():
    """Oracle: 10 cm / sqrt(12) = 28.9 mm is 0.3 of 96.2 mm."""
    height = np.round(510.0 + np.random.default_rng(4).normal(size=60), 1)
    angle = 0.8 + 1e-6 * np.random.default_rng(5).normal(size=60)
    for sigma_m, added in ((0.095, True), (0.0975, False)):
        cov = np.tile(sigma_m**2 * np.eye(3), (60, 1, 1))
        fixes = GnssFixes(np.arange(60.0), angle, angle, height, cov)
        assert (with_rounding(fixes) is not fixes) == added


def test_a_run_adds_35_centimetres_at_most():
    """Oracle: 30 equal heights to a metre add (1 m)^2 / 12 thirty times over, or 0.35 m."""
    height = np.concatenate([np.full(30, 510.0), 511.0 + np.arange(30.0)])
    angle = 0.8 + 1e-6 * np.random.default_rng(5).normal(size=60)
    fixes = GnssFixes(np.arange(60.0), angle, angle, height, np.tile(1e-4 * np.eye(3), (60, 1, 1)))
    added = (with_rounding(fixes).cov_ned - fixes.cov_ned)[:, 2, 2]
    np.testing.assert_allclose(added, np.repeat([0.35**2, 1.0 / 12.0], 30), rtol=1e-9)


def test_fine_digits_are_left_alone():
    """Oracle: a step of 1.1 cm adds 3.2 mm, a sixth of 2 cm; of 5 mm it is two thirds."""
    fixes = hovering(0.02).gnss
    assert with_rounding(rounded(fixes, 1e-7, 0.01)).cov_ned is fixes.cov_ned
    fixes = hovering(0.005).gnss
    assert with_rounding(rounded(fixes, 1e-7, 0.01)).notes[-1].verdict == "note"


def test_decimetres_of_a_hovering_copter_are_accepted_with_honest_sigmas():
    """Oracle: the simulator's truth. Positions of 2 cm are printed to 11 cm, and half of them
    repeat the one before; claimed as they are, alignments of such flights had found no fix that
    agrees with another, or errors of 4 sigma.
    """
    sim = hovering(0.02)
    fixes = rounded(sim.gnss, 1e-6, 0.1)
    assert np.mean((np.diff(fixes.lat) == 0.0) & (np.diff(fixes.lon) == 0.0)) > 0.4
    own = insgnss.estimate(sim.imu, fixes, mounting=sim.mounting, trajectory_hz=1.0).trajectory
    motion = sim.flight.motion
    there = motion.frame.position_from_geodetic(own.lat, own.lon, own.height)
    z = (motion.position(own.time) - there) / np.sqrt(np.diagonal(own.cov, axis1=1, axis2=2))[:, :3]
    assert np.abs(z).max() < 4.5
    assert np.mean(z**2) < 2.0
