"""Biases that step at an instant: its evidence, when it is found, and what the images are worth."""

from dataclasses import replace

import numpy as np
import pytest
from flown import NO_GATE, fly, start_near

import insgnss
from insgnss.geodesy.rotation import vector_from_rotation
from insgnss.navigation.diagnosis.drift import SLOW_BIAS_PRIOR, step_evidence, with_bias_step
from insgnss.navigation.filter.problem import InitialState
from insgnss.navigation.filter.solution import solve
from insgnss.navigation.innovations.likelihood import evaluate, linear_segment

DEG_H, MG = np.radians(1.0) / 3600.0, 9.80665e-3
SIGMA = np.array([0.5, 0.5, 0.5, 0.3, 0.3, 0.3, *np.radians([1.0, 1.0, 5.0])])


@pytest.mark.slow
@pytest.mark.parametrize(
    ("motion", "seed", "gyro", "accel", "at_s", "words"),
    [
        ("ign6x1", 711, 150.0, 5.0, None, "(when the motors start)"),
        ("ign6x1", 711, 2000.0, 5.0, None, "(when the motors start)"),  # no fix follows
        ("ign8", 701, 150.0, 5.0, None, "(when the motors start)"),
        ("ign8", 700, 2000.0, 0.0, 150.0, " s, log evidence"),
        ("ign6x1", 712, 150.0, 5.0, 150.0, " s, log evidence"),
    ],
)
def test_a_step_is_named_and_the_images_are_honest(motion, seed, gyro, accel, at_s, words):
    """Oracle: the exact motion and what was planted: six biases that step in proportion 1, -0.7,
    0.5; the instant to half a second, the largest to a quarter and 50 deg/h.
    """
    sim = insgnss.simulate(motion, 6.0, imu_rate_hz=100.0, seed=seed)
    moves = np.linalg.norm(sim.truth.trajectory.velocity_ned, axis=1) > 0.2
    start = sim.truth.trajectory.time[np.argmax(moves)]
    instant = start if at_s is None else sim.imu.time[0] + at_s
    shape = (sim.imu.time > instant)[:, None] * np.array([1.0, -0.7, 0.5])
    imu = replace(
        sim.imu,
        gyro=sim.imu.gyro + gyro * DEG_H * shape,
        accel=sim.imu.accel + accel * MG * shape,
    )
    plane = sim.tangent_plane
    result = insgnss.estimate(
        *(imu, sim.gnss, sim.events),
        mounting=replace(sim.mounting, antenna_sigma_m=0.005),
        tangent_plane=(*np.degrees([plane.lat, plane.lon]), plane.height),
    )
    (check,) = [check for check in result.checks if check.name == "IMU bias step"]
    assert words in check.found
    assert {"IMU noise", "IMU warm-up"}.isdisjoint(check.name for check in result.checks)
    size, rest = check.found.removeprefix("the biases step by about ").split(" deg/h", 1)
    assert float(size) == pytest.approx(gyro, abs=50.0 + 0.02 * gyro)
    time = float(rest.split("TOW ")[1].split(" s")[0])
    assert time == pytest.approx(instant, abs=0.5)
    at = [sim.truth.eo.images.index(name) for name in result.eo.images]
    turn = sim.truth.eo.C_mc[at] @ np.swapaxes(result.eo.C_mc, -1, -2)
    error = np.hstack(
        [result.eo.position_m - sim.truth.eo.position_m[at], vector_from_rotation(turn)]
    )
    z = error / np.sqrt(np.diagonal(result.eo.cov, axis1=1, axis2=2))
    assert np.abs(z).max() < 4.0
    assert np.mean(z**2) < 2.0


@pytest.mark.slow
def test_the_warm_up_of_a_long_flight_is_no_step():
    """Oracle: the exact motion and what was planted: 500 deg/h and 15 mg that fade over 30 s, of
    which the liveliest five minutes of twelve hold nothing.
    """
    sim = insgnss.simulate("ign8", 12.0, imu_rate_hz=100.0, seed=713)
    course = np.exp(-(sim.imu.time - sim.imu.time[0]) / 30.0)[:, None] * np.array([1.0, -0.7, 0.5])
    imu = replace(
        sim.imu,
        gyro=sim.imu.gyro + 500.0 * DEG_H * course,
        accel=sim.imu.accel + 15.0 * MG * course,
    )
    result = insgnss.estimate(imu, sim.gnss, sim.events, mounting=sim.mounting)
    names = {check.name for check in result.checks}
    assert "IMU warm-up" in names
    assert "IMU bias step" not in names
    (check,) = [check for check in result.checks if check.name == "IMU warm-up"]
    assert "warms up over about 30 s" in check.found
    path = result.trajectory
    true = sim.truth.trajectory.at(path.time)
    turn = vector_from_rotation(true.C_nb @ np.swapaxes(path.C_nb, -1, -2))
    assert np.abs(turn[:, :2] / np.sqrt(path.cov[:, [6, 7], [6, 7]])).max() < 4.0


def test_the_evidence_is_that_of_the_filter_with_the_step():
    """Oracle: half the difference of -2 log L of the innovations, with the variance of a step at
    one epoch and without it, less the logarithm of the number of epochs.
    """
    flown = fly(5.0, seed=5, gate=NO_GATE)
    problem, chosen = flown.problem, np.array([15, 25, 40])
    solution = solve(problem, start_near(flown, SIGMA), "off", separations=0)
    segment = linear_segment(solution, ())
    start = InitialState(solution.nav[0], solution.x[0], segment.linear.mean0, segment.linear.P0[0])
    same = solve(problem, start, "off", separations=chosen, about=solution)
    nothing = evaluate([segment], np.zeros(0)).cost
    for epoch, evidence in zip(chosen, step_evidence(same), strict=True):
        stepped = replace(solution, problem=with_bias_step(problem, np.array([epoch])))
        gain = 0.5 * (nothing - evaluate([linear_segment(stepped, ())], np.zeros(0)).cost)
        assert evidence + np.log(solution.time.size) == pytest.approx(gain, abs=1e-3)
    spread = with_bias_step(problem, np.array([5, 6]))
    np.testing.assert_allclose(spread.epochs.bias_step.sum(axis=0), SLOW_BIAS_PRIOR**2)
