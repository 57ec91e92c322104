"""Motions that are right and unusual are not refused; the same with a fault planted are."""

from dataclasses import replace

import numpy as np
import pytest
from air_motions import circles, multirotor

import insgnss
from insgnss.geodesy.rotation import rotation_from_rpy, vector_from_rotation
from insgnss.navigation.recognise.plausibility import check_heading, check_recording
from insgnss.navigation.recognise.propulsion import propulsion
from insgnss.simulation.ground import drive
from insgnss.simulation.raw_gnss.receiver import GnssOptions
from insgnss.simulation.scenario import ImuOptions, observe


def contradictions(imu, gnss):
    """Name and words of what is contradicted."""
    checks = check_recording(imu, np.eye(3), gnss, None, None)
    return {c.name: f"{c.found}; {c.advice}" for c in checks if c.verdict == "contradiction"}


@pytest.fixture(scope="module", params=[30.0, 45.0])
def circling(request):
    flight = circles(2.0, seed=5, bank_deg=request.param)
    return observe(flight, 5, imu=ImuOptions(rate_hz=50.0), truth_hz=1.0)


def assert_honest(sim):
    """No error of position and velocity at 1 Hz is beyond 4.5 sigma (of 1000 normal ones the
    largest is once in 150 runs), their squares are near one (a hover of 45 s has few of its own).
    """
    result = insgnss.estimate(sim.imu, sim.gnss, mounting=sim.mounting, trajectory_hz=1.0)
    own, motion = result.trajectory, sim.flight.motion
    there = motion.frame.position_from_geodetic(own.lat, own.lon, own.height)
    velocity = np.einsum("nij,nj->ni", motion.C_nl(own.time), motion.velocity(own.time))
    error = np.hstack([motion.position(own.time) - there, velocity - own.velocity_ned])
    z = error / np.sqrt(np.diagonal(own.cov, axis1=1, axis2=2))[:, :6]
    assert np.abs(z).max() < 4.5
    assert 0.3 < np.mean(z**2) < 2.0
    return result


class TestCircles:
    """A bank of 30 and 45 deg all the time: g / cos(bank), and turns that do not correlate."""

    def test_they_are_accepted_with_errors_inside_their_sigmas(self, circling):
        """Oracle: the simulator's truth."""
        assert_honest(circling)

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


class TestNoses:
    """A multirotor leans to change its speed; its nose may point anywhere (R.11)."""

    @pytest.mark.parametrize(
        "style", [pytest.param("sideways", marks=pytest.mark.slow), "backward", "hover"]
    )
    def test_a_multirotor_is_accepted_with_errors_inside_their_sigmas(self, style):
        """Oracle: the simulator's truth; the nose is off the course as the style says."""
        flight = multirotor(2.5, style, seed=3)
        sim = observe(flight, 3, imu=ImuOptions(rate_hz=50.0), truth_hz=1.0)
        checks = {check.name: check for check in assert_honest(sim).checks}
        if style != "hover":
            assert checks["recognised axes"].verdict == "note"
            assert "leans to change its speed" in checks["recognised axes"].found

    @pytest.mark.parametrize(("lean", "slope"), [(0.0, 1.0), (1.0, 0.0)], ids=["pushed", "leaning"])
    def test_slope_of_a_push_and_of_a_lean(self, lean, slope):
        """Oracle: a speed that swings; level and pushed the accelerometers feel all of it, leaned
        by atan(a / g) nothing.
        """
        time = np.arange(0.0, 60.0, 0.2)
        gained = 1.5 * np.sin(0.5 * time)
        force = np.column_stack([gained, 0.0 * time, np.full(time.size, -9.81)])
        pitch = -lean * np.arctan(gained / 9.81)
        C_nb = rotation_from_rpy(np.column_stack([0.0 * time, pitch, 0.0 * time]))
        found = propulsion(time, C_nb, force, np.array([1.0, 0.0, 0.0]))
        assert found.slope == pytest.approx(slope, abs=0.02)
        assert (found.leans, found.pushed) == (bool(lean), not lean)
        assert found.nose_is_free(20.0) == bool(lean)

    def test_who_shows_neither_is_an_aircraft_where_it_is_fast(self):
        """Oracle: no change of speed at all."""
        time = np.arange(10.0)
        level = np.tile([0.0, 0.0, -9.81], (10, 1))
        found = propulsion(time, np.tile(np.eye(3), (10, 1, 1)), level, np.array([1.0, 0.0, 0.0]))
        assert found.nose_is_free(8.0)
        assert not found.nose_is_free(13.0)

    def test_a_fast_multirotor_across_its_course_is_none_of_the_axes(self):
        """Oracle: the simulator's truth at 12 m/s, its nose 90 deg off; a car whose axes are turned
        by as much is contradicted.
        """
        flight = multirotor(2.0, "sideways", seed=3, speed_ms=12.0)
        assert heading_check(flight.motion, np.eye(3)).verdict == "note"
        turned = np.array([[0.0, 1.0, 0.0], [-1.0, 0.0, 0.0], [0.0, 0.0, 1.0]])
        motion = drive(3.0, seed=1).motion
        assert heading_check(motion, turned).verdict == "contradiction"
        assert heading_check(motion, np.eye(3)).verdict == "ok"

    def test_pure_hover_says_how_well_its_heading_is_known(self):
        """Oracle: three quarters of a minute in one place and with one heading. Fixes of 2 cm see
        it sway by 15 cm, and the truth lies within 4 sigma of more than half a degree; those of
        40 cm do not, which one line says with the number.
        """
        flight = multirotor(0.75, "hover", seed=3)
        sim = observe(flight, 3, imu=ImuOptions(rate_hz=50.0), truth_hz=1.0)
        own = assert_honest(sim).trajectory
        true = flight.motion.C_nl(own.time) @ flight.motion.C_lb(own.time)
        psi = vector_from_rotation(true @ np.swapaxes(own.C_nb, 1, 2))[:, 2]
        sigma = np.sqrt(own.cov[:, 8, 8])
        assert np.degrees(sigma).min() > 0.5
        assert np.abs(psi / sigma).max() < 4.0
        poor = GnssOptions(sigma_m=(0.4, 0.4, 0.6))
        sim = observe(flight, 3, imu=ImuOptions(50.0, "consumer"), gnss=poor, truth_hz=1.0)
        with pytest.raises(insgnss.DataError, match=r"heading not observable: .* deg only"):
            insgnss.estimate(sim.imu, sim.gnss, mounting=sim.mounting, noise="consumer")


def test_a_hover_in_one_rounded_place_is_no_dead_column():
    """Oracle: within a metre a latitude of five decimals is always the same; on a kilometre's way
    it is not.
    """
    sim = observe(multirotor(0.75, "hover", seed=3), 3, imu=ImuOptions(50.0), truth_hz=1.0)
    same = replace(sim.gnss, lat=np.full_like(sim.gnss.lat, np.radians(46.57)))
    assert "GNSS position" not in contradictions(sim.imu, same)
    away = replace(same, lon=same.lon + np.linspace(0.0, 1e-4, same.lon.size))
    assert "latitude must change" in contradictions(sim.imu, away)["GNSS position"]


def heading_check(motion, C_turn):
    """The check of a true trajectory at 1 Hz whose body axes are turned."""
    time = np.arange(motion.start, motion.end)
    C_nb = motion.C_lb(time) @ C_turn
    return check_heading(time, C_nb, motion.velocity(time), np.eye(3))
