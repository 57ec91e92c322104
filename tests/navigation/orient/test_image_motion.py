"""Velocity and angular rate of the images, by central differences of true poses."""

from dataclasses import replace

import numpy as np
from flown import NO_GATE, fly, start_near, without_noise

from insgnss.geodesy.frames import TangentPlane
from insgnss.geodesy.rotation import vector_from_rotation
from insgnss.navigation.filter.solution import solve
from insgnss.navigation.filter.trajectory import trajectory
from insgnss.navigation.orient.exterior import exterior_orientation
from insgnss.records import CameraEvents
from insgnss.records.cameras.mounting import Mounting
from insgnss.simulation import flights
from insgnss.simulation.layout import PLANS
from insgnss.simulation.scenario import Rig, true_eo, true_trajectory

STEP_S = 1e-3
ALIGNED = np.array([0.1, 0.1, 0.1, 0.1, 0.1, 0.1, *np.radians([0.5, 0.5, 1.0])])
RIG = Rig(imu_m=(0.9, -0.8, 0.7))  # 1.4 m from the projection centre
CHANGES = {"start_in_air": True, "line_length_m": 40.0}


def by_differences(
    flight: flights.FlightMotion, plane: TangentPlane
) -> tuple[np.ndarray, np.ndarray]:
    """Velocity, m/s, and rate, rad/s, (n, 3), of what poses do within 2 ms around the exposures."""
    before, after = (
        true_eo(replace(flight, time=flight.time + step), RIG, plane) for step in (-STEP_S, STEP_S)
    )
    turn = after.C_mc @ np.swapaxes(before.C_mc, 1, 2)
    velocity = (after.position_m - before.position_m) / (2.0 * STEP_S)
    return velocity, vector_from_rotation(turn) / (2.0 * STEP_S)


def mounting(rig: Rig) -> Mounting:
    vectors = (rig.antenna_m, rig.imu_m, rig.camera_from_body, rig.boresight)
    return Mounting(*(np.array(x) for x in vectors))


def test_images_move_as_their_poses_do() -> None:
    """Oracle: central differences over the exact motion, which leave the square of 1 ms of the
    third derivative, below 1e-5; 2 km off the origin, in lines and the turns between, where the
    lever arm makes half a m/s.
    """
    flight = flights.fly(PLANS["ign8"].changed(minutes=0.7, **CHANGES), 3)
    time = flight.motion.start + np.arange(2.0, 40.0, 0.7)
    flight = replace(flight, time=time, images=tuple(str(k) for k in range(time.size)))
    frame = flight.motion.frame
    plane = TangentPlane(frame.lat + 3e-4, frame.lon, 0.0)
    velocity, rate = by_differences(flight, plane)
    exact = true_trajectory(flight.motion, time, 2008)
    exact = replace(exact, rate_b=flight.motion.omega_lb_b(time))
    events = CameraEvents(flight.images, time, 2008)
    oriented = exterior_orientation(exact, events, mounting(RIG), plane)
    for eo in (true_eo(flight, RIG, plane), oriented):
        assert eo.velocity_mps is not None
        assert eo.rate_radps is not None
        assert np.abs(eo.velocity_mps - velocity).max() < 1e-5
        assert np.abs(eo.rate_radps - rate).max() < 1e-5
        arm = eo.C_mc @ RIG.C_cb @ RIG.camera_lever_b
        assert np.abs(np.cross(rate, arm)).max() > 0.5
    unknown = exterior_orientation(replace(exact, rate_b=None), events, mounting(RIG), plane)
    assert unknown.velocity_mps is None
    assert unknown.rate_radps is None


def test_images_of_a_solution_move_as_the_true_ones() -> None:
    """Oracle: central differences of the true poses. The IMU is exact but for its samples of 5 ms;
    fixes of 1 to 2 cm leave less than 5 cm/s of a velocity and 2 mrad/s of a bias.
    """
    at_s = np.arange(2.0, 28.0, 0.7)
    flown = without_noise(fly(30.0, 3, gate=NO_GATE, events_s=at_s, line_length_m=40.0))
    solution = solve(flown.problem, start_near(flown, ALIGNED))
    path = trajectory(solution, solution.event_epochs, 2008, events=True)
    plane = flown.sim.tangent_plane
    events = CameraEvents(tuple(str(k) for k in range(path.time.size)), path.time, 2008)
    eo = exterior_orientation(path, events, mounting(RIG), plane)
    flight = replace(flown.sim.flight, time=path.time, images=eo.images)
    velocity, rate = by_differences(flight, plane)
    assert eo.velocity_mps is not None
    assert eo.rate_radps is not None
    assert np.abs(eo.velocity_mps - velocity).max() < 0.05
    assert np.abs(eo.rate_radps - rate).max() < 2e-3
