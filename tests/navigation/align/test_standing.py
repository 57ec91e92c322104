"""Attitude of a vehicle at rest: gyrocompassing where the gyros know the Earth's rotation, level
where not.
"""

from dataclasses import replace

import numpy as np
import pytest
from numpy.testing import assert_allclose

from insgnss.base.errors import DataError
from insgnss.geodesy.earth import EARTH_RATE, normal_gravity
from insgnss.geodesy.frames import LocalFrame
from insgnss.geodesy.rotation import (
    rotation_from_quaternion,
    rotation_from_rpy,
    vector_from_rotation,
)
from insgnss.navigation.align.initial import initial_state
from insgnss.navigation.align.standing import longest_rest, standing_attitude
from insgnss.navigation.filter.epochs import make_epochs, with_zupt
from insgnss.navigation.filter.filter import gate_from_sigma
from insgnss.navigation.filter.layout import state_layout
from insgnss.navigation.filter.problem import EstimationProblem
from insgnss.navigation.noise_model.model import AxisNoise, NoiseModel
from insgnss.navigation.prepare.increments import body_increments, merge_marks
from insgnss.records import GnssFixes, ImuSamples, Increments

LAT, LON, HEIGHT = np.radians(46.5), np.radians(6.5), 500.0
DEG_H = np.radians(1.0) / 3600.0
SECONDS, RATE = 300.0, 100.0


def noise(bias_deg_h: float) -> NoiseModel:
    gyro = AxisNoise(turn_on_bias=bias_deg_h * DEG_H, white_noise=np.radians(0.01) / 60.0)
    return NoiseModel(
        "made up", "test", (gyro,) * 3, (AxisNoise(turn_on_bias=1e-3, white_noise=1e-4),) * 3
    )


def standing(rpy_deg, model: NoiseModel, seed: int) -> tuple[EstimationProblem, np.ndarray]:
    """A sensor at rest for five minutes, its errors drawn from the model, and its exact attitude
    C_nb.
    """
    rng = np.random.default_rng(seed)
    time = 1000.0 + np.arange(int(SECONDS * RATE) + 1) / RATE
    C_nb = rotation_from_rpy(np.radians(rpy_deg))
    earth = EARTH_RATE * np.array([np.cos(LAT), 0.0, -np.sin(LAT)])
    gravity = np.array([0.0, 0.0, float(normal_gravity(LAT, HEIGHT))])
    triads = []
    for truth, axes in ((C_nb.T @ earth, model.gyro), (-C_nb.T @ gravity, model.accel)):
        bias = rng.standard_normal(3) * [a.turn_on_bias for a in axes]
        white = rng.standard_normal((time.size, 3)) * [a.white_noise * np.sqrt(RATE) for a in axes]
        triads.append(truth + bias + white)
    imu = ImuSamples(time, *triads, gps_week=2000)
    fix = time[:: int(RATE)]
    cov = np.broadcast_to(0.01 * np.eye(3), (fix.size, 3, 3))
    fixes = GnssFixes(
        fix, np.full(fix.size, LAT), np.full(fix.size, LON), np.full(fix.size, HEIGHT), cov
    )
    marks, (at_fix,) = merge_marks(fix)
    inc, frame, layout = (
        body_increments(imu, np.eye(3), marks),
        LocalFrame(LAT, LON, HEIGHT),
        state_layout(model),
    )
    epochs = make_epochs(inc, at_fix, fixes, np.zeros(0, dtype=np.int64), frame)
    epochs = with_zupt(epochs, inc, np.array([[time[0], time[-1]]]), layout)
    return (
        EstimationProblem(inc, epochs, frame, layout, np.zeros(3), gate_from_sigma(5.0), 1.0),
        C_nb,
    )


@pytest.mark.parametrize("heading", [0.0, 137.0, -60.0])
def test_good_gyros_find_north_at_rest(heading):
    """Oracle: the attitude that was made, within four of the sigmas claimed; 0.1 deg/h over Omega
    cos 46.5 deg is 0.55 deg.
    """
    problem, C_nb = standing((2.0, -3.0, heading), noise(0.1), 5)
    found = standing_attitude(problem)
    assert found is not None
    assert_allclose(found.heading_sigma, 0.1 * DEG_H / (EARTH_RATE * np.cos(LAT)), rtol=0.2)
    start = initial_state(problem).start
    error = vector_from_rotation(C_nb @ rotation_from_quaternion(start.nav[6:]).T)
    assert (np.abs(error[:2]) < 4.0 * found.tilt_sigma).all()
    assert abs(error[2]) < 4.0 * found.heading_sigma
    sigma = np.sqrt(np.diag(start.P)[6:9])
    assert (np.abs(error) < sigma).all()


@pytest.mark.parametrize("heading", [0.0, 137.0, -60.0])
def test_triad_of_exact_readings_is_exact(heading):
    """Oracle: the attitude that was made, from gravity and the Earth's rate alone, before
    any filter; and the heading's sigma, that of the gyros over the level part of the Earth's rate.
    """
    C_nb, n, h = rotation_from_rpy(np.radians([2.0, -3.0, heading])), 600, 0.1
    rate = C_nb.T @ [EARTH_RATE * np.cos(LAT), 0.0, -EARTH_RATE * np.sin(LAT)]
    force = -C_nb.T @ [0.0, 0.0, float(normal_gravity(LAT, HEIGHT))]
    stop = np.arange(0, n + 1, 10)
    turn, push = (np.tile(v * h, (n, 1)) for v in (rate, force))
    inc = Increments(
        np.full(n, h), turn, push, 1000.0 + h * stop, stop, np.tile(rate, (stop.size, 1)), h
    )
    one, model = np.ones(stop.size), noise(0.1)
    cov = np.broadcast_to(0.01 * np.eye(3), (stop.size, 3, 3))
    fixes = GnssFixes(inc.marks, LAT * one, LON * one, HEIGHT * one, cov)
    frame, layout = LocalFrame(LAT, LON, HEIGHT), state_layout(model)
    epochs = make_epochs(inc, np.arange(stop.size), fixes, np.zeros(0, dtype=np.int64), frame)
    epochs = with_zupt(epochs, inc, inc.marks[[0, -1]][None], layout)
    found = standing_attitude(
        EstimationProblem(inc, epochs, frame, layout, np.zeros(3), gate_from_sigma(5.0), 1.0)
    )
    assert found is not None
    assert_allclose(found.C_lb, C_nb, rtol=0, atol=1e-9)
    unknown = np.hypot(0.1 * DEG_H, np.radians(0.01) / 60.0 / np.sqrt(60.0))
    assert_allclose(found.heading_sigma, unknown / (EARTH_RATE * np.cos(LAT)), rtol=1e-6)


def test_gyrocompassing_is_consistent():
    """Oracle: chi-square of the heading error over its sigma in 40 draws, two-sided 99 % bounds
    0.52 to 1.67 of the mean square.
    """
    squares = []
    for seed in range(40):
        problem, C_nb = standing((1.0, 2.0, 9.0 * seed), noise(0.2), seed)
        found = standing_attitude(problem)
        squares.append((vector_from_rotation(C_nb @ found.C_lb.T)[2] / found.heading_sigma) ** 2)
    assert 0.52 < np.mean(squares) < 1.67


def test_poor_gyros_give_the_level_and_say_that_they_give_no_heading():
    """Oracle: the roll and pitch that were made; 100 deg/h is seven times what the Earth turns."""
    problem, _ = standing((2.0, -3.0, 40.0), noise(100.0), 5)
    told = (
        r"heading not observable: standing, roll 2\.0\d and pitch -[23]\.\d\d deg \(sigma 0\.00\d+"
        r" deg\), heading from .* \(sigma 180 deg\)"
    )
    with pytest.raises(DataError, match=told):
        initial_state(problem)


def test_the_longest_rest_is_taken():
    """Oracle: the rests that were declared."""
    problem, _ = standing((0.0, 0.0, 0.0), noise(0.1), 1)
    marks, epochs = (
        problem.inc.marks,
        problem.epochs._replace(
            constraint=np.zeros(problem.epochs.constraint.size, dtype=np.int64)
        ),
    )
    rests = np.array([[marks[5], marks[40]], [marks[60], marks[140]]])
    rested = replace(problem, epochs=with_zupt(epochs, problem.inc, rests, problem.layout))
    assert longest_rest(rested) == (60, 140)
    short = with_zupt(epochs, problem.inc, rests[:1] - [[0.0, 20.0]], problem.layout)
    assert longest_rest(replace(problem, epochs=short)) is None
