"""Motions that are right and unusual are not refused; the same with a fault planted are."""

from dataclasses import replace

import numpy as np
import pytest

import insgnss
from insgnss.recognise.plausibility import check_recording
from insgnss.simulation.manoeuvres import circles
from insgnss.simulation.scenario import ImuOptions, observe


def contradictions(imu, gnss, events=None):
    """Name and words of what is contradicted."""
    checks = check_recording(imu, np.eye(3), gnss, events, None)
    return {c.name: f"{c.found}; {c.advice}" for c in checks if c.verdict == "contradiction"}


@pytest.fixture(scope="module", params=[30.0, 45.0])
def circling(request):
    flight = circles(2.0, seed=5, bank_deg=request.param)
    return observe(flight, 5, imu=ImuOptions(rate_hz=50.0), truth_hz=1.0)


class TestCircles:
    """A bank of 30 and 45 deg all the time: g / cos(bank), and turns that do not correlate."""

    def test_they_are_accepted_with_errors_inside_their_sigmas(self, circling):
        """Oracle: the simulator's truth at 1 Hz: no error beyond 4.5 sigma (of 1400 a normal one
        reaches 4 in one run of ten, 4.5 in one of a hundred), squares near one.
        """
        sim = circling
        result = insgnss.estimate(sim.imu, sim.gnss, mounting=sim.mounting, trajectory_hz=1.0)
        own, motion = result.trajectory, sim.flight.motion
        there = motion.frame.position_from_geodetic(own.lat, own.lon, own.height)
        velocity = np.einsum("nij,nj->ni", motion.C_nl(own.time), motion.velocity(own.time))
        error = np.hstack([motion.position(own.time) - there, velocity - own.velocity_ned])
        z = error / np.sqrt(np.diagonal(own.cov, axis1=1, axis2=2))[:, :6]
        assert np.abs(z).max() < 4.5
        assert 0.5 < np.mean(z**2) < 2.0

    def test_no_check_of_the_recording_contradicts(self, circling):
        """Oracle: nothing is wrong."""
        assert not contradictions(circling.imu, circling.gnss)

    def test_faults_are_still_told(self, circling):
        """Oracle: what was planted: gyros in degrees, gyros of the other sense, force in g."""
        imu, gnss, name = circling.imu, circling.gnss, "turn rate, gyro against GNSS course"
        told = contradictions(replace(imu, gyro=np.degrees(imu.gyro)), gnss)
        assert 'imu.units gyro = "deg/s"' in told[name]
        told = contradictions(replace(imu, gyro=-imu.gyro), gnss)
        assert "turn the other way" in told[name]
        for factor in (1.0 / 9.80665, 9.80665, 1.35):
            told = contradictions(replace(imu, accel=factor * imu.accel), gnss)
            assert "specific force" in told
