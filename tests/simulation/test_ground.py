"""Vehicles on the ground: no side slip, stops that are stops, dynamics within their gait."""

import numpy as np
import pytest
from numpy.testing import assert_allclose

from insgnss.base.errors import UsageError
from insgnss.simulation.dataset import write_simulated
from insgnss.simulation.flights import FlightMotion
from insgnss.simulation.ground import CAR, drive, walk
from insgnss.simulation.scenario import observe, simulate_flight
from insgnss.simulation.sensors import ImuOptions


@pytest.fixture(scope="module")
def car() -> FlightMotion:
    return drive(5.0, seed=1)


def state(flight):
    """Times, velocity in body axes (n, 3), speed (n,)."""
    time = np.arange(flight.motion.start, flight.motion.end - 0.01, 0.02)
    velocity = flight.motion.velocity(time)
    return (
        time,
        np.einsum("nji,nj->ni", flight.motion.C_lb(time), velocity),
        np.linalg.norm(velocity, axis=1),
    )


@pytest.mark.parametrize("seed", [1, 2, 3])
def test_a_car_moves_where_it_points(seed):
    """Oracle: velocity in body axes; the constraint that a filter may use is good to 1 cm/s across,
    but for the roughness of the road.

    A height of 1.2 mm over 0.12 s makes 1 cm/s up and down, rolled by some degrees a tenth of it
    across.
    """
    _, v_b, speed = state(drive(5.0, seed=seed))
    assert np.abs(v_b[:, 1]).max() < 0.01
    assert np.abs(v_b[:, 2]).max() < 0.04
    assert v_b[:, 2].std() < 0.012
    assert v_b[:, 0].min() > -0.01
    assert speed.max() == pytest.approx(CAR.speed_ms, abs=0.1)


def test_a_stop_is_a_stop(car):
    """Oracle: velocity and rate; it stands for 15 s first, and at its halts for seconds,
    exactly.
    """
    time, _, speed = state(car)
    rest = speed < 1e-9
    assert rest[time < car.motion.start + 12.0].all()
    runs = (
        np.diff(np.flatnonzero(np.diff(np.concatenate([[0], rest.astype(int), [0]]))))[::2] * 0.02
    )
    assert (runs > 4.0).sum() >= 3
    assert np.abs(car.motion.omega_lb_b(time[rest])).max() < 1e-2
    still = rest & (
        np.convolve(rest, np.ones(301), "same") > 300.5
    )  # three seconds from both ends of a stop
    assert still.any()
    assert np.abs(car.motion.velocity(time[still])).max() < 1e-9


def test_the_dynamics_are_those_of_a_car(car):
    """Oracle: the gait: acceleration along within 1.5, across within 2.5 m/s^2, both smoothed, and
    turns to both sides.
    """
    time, v_b, _ = state(car)
    acceleration = np.einsum("nji,nj->ni", car.motion.C_lb(time), car.motion.position(time, 2))
    assert np.abs(acceleration[:, 0]).max() < 1.6
    assert 1.0 < np.abs(acceleration[:, 1]).max() < 2.7
    yaw_rate = car.motion.omega_lb_b(time)[:, 2]
    assert yaw_rate.min() < -0.2
    assert yaw_rate.max() > 0.2
    assert_allclose(
        acceleration[:, 1], yaw_rate * v_b[:, 0], atol=0.05
    )  # what a turn costs, and nothing else


def test_a_walk_sways_and_steps():
    """Oracle: a walking person: under 2 m/s, steps at 1.8 Hz in the height, a body that does not
    point where it goes.
    """
    flight = walk(3.0, seed=1)
    time, v_b, speed = state(flight)
    assert 1.0 < np.median(speed[speed > 0.3]) < 1.8
    moving = speed > 1.0
    assert 0.05 < np.abs(np.arctan2(v_b[moving, 1], v_b[moving, 0])).mean() < 0.5
    height = flight.motion.position(time, 2)[:, 2]
    power = np.abs(np.fft.rfft(height * np.hanning(height.size))) ** 2
    assert np.fft.rfftfreq(height.size, 0.02)[np.argmax(power)] == pytest.approx(1.8, abs=0.15)
    assert (speed[time < flight.motion.start + 12.0] < 1e-9).all()


def test_a_drive_is_recorded_like_a_flight(car, tmp_path):
    """Oracle: the files; the same seed gives the same drive, another one another."""
    data = write_simulated(tmp_path / "car", observe(car, 1, imu=ImuOptions(50.0)))
    assert (data.directory / "01_Observations/IMU/Data/Pre_calibrated/f1_1_sob.csv").is_file()
    assert "# drive (simulated)" in (data.directory / "FLIGHT.md").read_text()
    assert np.array_equal(drive(5.0, seed=1).motion.control, car.motion.control)
    assert not np.array_equal(drive(5.0, seed=2).motion.control[:100], car.motion.control[:100])


@pytest.mark.parametrize("arguments", [{"minutes": 0.0}, {"minutes": 3.0, "stand_s": -1.0}])
def test_a_drive_that_is_none_is_refused(arguments):
    """Oracle: the contract."""
    with pytest.raises(UsageError, match="more than half a minute"):
        drive(**arguments)


def test_journeys_are_simulated_by_name_and_an_unknown_name_lists_them() -> None:
    """Oracle: the motion itself; names by hand."""
    drove = simulate_flight("car", 1.0, seed=1, imu=ImuOptions(50.0), stand_s=5.0)
    expected = drive(1.0, seed=1, stand_s=5.0).motion.control
    np.testing.assert_array_equal(drove.flight.motion.control, expected)
    with pytest.raises(UsageError, match="known are ign8, ign6x1, car, walk"):
        simulate_flight("boat")
    with pytest.raises(UsageError, match="car: there is no wind_ms"):
        simulate_flight("car", 1.0, wind_ms=3.0)
