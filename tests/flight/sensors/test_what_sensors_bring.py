"""What a further sensor brings: a tunnel with an odometer, a start and long lines with antennas.

A hovering copter with a magnetometer stands in `tests/navigation/filter/test_linearised.py`.
"""

import numpy as np
import pytest

import insgnss
from insgnss.records import Trajectory

EARTH_M = 6.37e6


def heading(motion: insgnss.Motion, states: np.ndarray) -> np.ndarray:
    return motion.roll_pitch_heading[:, 2]


def velocity(motion: insgnss.Motion, states: np.ndarray) -> np.ndarray:
    return motion.velocity_body * (1.0 + states * [1.0, 0.0, 0.0])


def estimated(sim, gnss, *measurements) -> Trajectory:
    return insgnss.estimate(
        *(sim.imu, gnss, sim.events),
        mounting=sim.mounting,
        noise="consumer",
        measurements=measurements,
    ).trajectory


@pytest.mark.slow
@pytest.mark.parametrize("seed", [3, 4])
def test_an_odometer_carries_a_car_through_a_tunnel_of_a_minute(seed):
    """Oracle: the true place: below 0.25 m at the worst instead of above 0.5 m; the scale factor of
    1 % that was put in, to four sigmas of the positions.
    """
    sim = insgnss.simulate("car", 4.0, imu_rate_hz=50.0, seed=seed, noise="consumer")
    begin = sim.gnss.time[0] + 120.0
    gnss = sim.gnss[np.flatnonzero(np.abs(sim.gnss.time - begin - 30.0) > 30.0)]
    path = sim.truth.trajectory[10:-10:4]
    values = np.einsum("kji,kj->ki", path.C_nb, path.velocity_ned) * [1.01, 1.0, 1.0]
    values += 0.05 * np.random.default_rng(seed).standard_normal(values.shape)
    wheel = insgnss.Measurement(
        *("odometer", path.time, values, 0.05, velocity), states=[insgnss.OwnState("scale", 0.02)]
    )
    worst = []
    for measurements in ((), (wheel,)):
        found = estimated(sim, gnss, *measurements)
        found = found.at(found.time[np.abs(found.time - begin - 30.0) < 30.0])
        truth = sim.truth.trajectory.at(found.time)
        east = (found.lon - truth.lon) * np.cos(truth.lat)
        errors = EARTH_M * np.hypot(found.lat - truth.lat, east)
        sigma = np.sqrt(found.cov[:, 0, 0] + found.cov[:, 1, 1])
        assert (errors < 4.0 * sigma).all()
        worst.append(errors.max())
    assert worst[0] > 0.5
    assert worst[1] < 0.25


@pytest.mark.slow
def test_two_antennas_know_the_heading_on_the_ground_and_on_long_lines():
    """Oracle: sigmas of the heading with and without 0.2 deg of antennas 1 m apart, whose errors
    they cover.
    """
    sim = insgnss.simulate("ign8", 4.0, imu_rate_hz=50.0, seed=3, noise="consumer")
    path = sim.truth.trajectory[10:-10:5]
    noisy = path.rpy[:, 2] + np.radians(0.2) * np.random.default_rng(1).standard_normal(len(path))
    antennas = insgnss.Measurement(
        *("antennas", path.time, noisy, np.radians(0.2), heading), period=2.0 * np.pi
    )
    alone, equipped = estimated(sim, sim.gnss), estimated(sim, sim.gnss, antennas)
    sigmas = [np.degrees(np.sqrt(one.cov[:, 8, 8])) for one in (alone, equipped)]
    on_ground = equipped.time < equipped.time[0] + 30.0
    exact = sim.truth.trajectory.at(equipped.time)
    turn = np.einsum("kj,kj->k", equipped.C_nb[:, 1], exact.C_nb[:, 0])
    assert (np.abs(turn) < 4.5 * np.radians(sigmas[1])).all()
    assert np.median(sigmas[1][on_ground]) < 0.5 * np.median(sigmas[0][on_ground])
    assert np.median(sigmas[1][~on_ground]) < 0.5 * np.median(sigmas[0][~on_ground])
