"""The first attitude against the exact motion: in the air, from the ground, on any heading; and the
motion read backwards.
"""

from dataclasses import replace

import numpy as np
import pytest
from flown import NO_GATE, Flown, error_of, fly
from numpy.testing import assert_allclose, assert_array_equal

from insgnss.base.errors import DataError
from insgnss.geodesy.rotation import (
    rotation_from_quaternion,
    rpy_from_rotation,
    vector_from_rotation,
)
from insgnss.navigation.align.coarse import coarse_attitudes, solve_window
from insgnss.navigation.align.initial import _reverse_problem, given_attitude, initial_state
from insgnss.navigation.filter.kernels.strapdown import run_strapdown
from insgnss.navigation.filter.problem import InitialState
from insgnss.navigation.filter.solution import solve
from insgnss.navigation.filter.strapdown import free_inertial, kernel_earth, kernel_intervals
from insgnss.simulation.layout import BLOCK, CORRIDOR, Level


def turned_block(course_deg: float) -> tuple[Level, ...]:
    return tuple(replace(level, course_deg=course_deg, length_m=120.0) for level in BLOCK.levels)


def start_error(flown: Flown, start: InitialState) -> np.ndarray:
    """(9,) of the start against the exact motion."""
    return error_of(start.nav[None], flown.true_nav([0]))[0]


@pytest.mark.parametrize(
    "course",
    [
        65.0,
        *(pytest.param(course, marks=pytest.mark.slow) for course in (0.0, 130.0, 200.0, 290.0)),
    ],
)
def test_in_the_air_on_any_heading(course):
    """Oracle: exact motion, within four sigmas of the heading the alignment claims; the start's own
    sigma is ten times wider.

    Wind of 4 m/s makes the course differ from the heading by up to 16 degrees, which course =
    heading would get wrong.
    """
    flown = fly(60.0, seed=7, imu_hz=100.0, levels=turned_block(course))
    alignment = initial_state(flown.problem)
    error, sigma = start_error(flown, alignment.start), np.sqrt(np.diag(alignment.start.P))
    assert (np.abs(error[6:]) < sigma[6:9]).all()
    assert abs(error[8]) < 4.0 * alignment.heading_sigma
    assert np.degrees(alignment.heading_sigma) < 0.2
    assert (np.abs(error[:3]) < 0.1).all()
    assert (np.abs(error[3:6]) < 0.1).all()
    first, last = flown.problem.inc.marks[[0, -1]]
    assert first <= alignment.window[0] < alignment.window[1] <= last


def test_from_the_ground_the_heading_comes_from_the_first_turns():
    """Oracle: exact motion. 25 s on the ground, take-off, turns: level from the accelerometers,
    heading carried back from the air.
    """
    flown = fly(120.0, seed=4, imu_hz=100.0, start_in_air=False, ground_s=25.0)
    assert np.linalg.norm(flown.true_nav(slice(0, 200))[:, 3:6], axis=1).max() < 1e-6
    alignment = initial_state(flown.problem)
    error, sigma = start_error(flown, alignment.start), np.sqrt(np.diag(alignment.start.P))
    assert alignment.window[0] > flown.problem.inc.marks[0] + 20.0
    assert (np.abs(error[6:]) < sigma[6:9]).all()
    assert (np.abs(np.degrees(error[6:8])) < 0.3).all()
    assert abs(np.degrees(error[8])) < 1.0
    assert (np.abs(error[3:6]) < 0.05).all()


def test_the_start_is_wide_where_the_filter_will_look_again():
    """Oracle: the module's own promise: IMU states as a-priori, mean zero there, position and
    velocity opened, no cross terms.
    """
    flown = fly(60.0, seed=7, imu_hz=100.0)
    start = initial_state(flown.problem).start
    layout = flown.problem.layout
    assert_array_equal(np.diag(start.P)[9:], layout.sigma0**2)
    assert_allclose(start.x + start.mean[9:], 0.0, atol=0.0)
    assert not start.mean[:9].any()
    assert np.sqrt(np.diag(start.P)[:3]).min() >= 10.0
    assert not start.P[:9, 9:].any()
    assert np.abs(start.x).max() > 0.0


def test_solution_from_it_is_consistent():
    """Oracle: exact motion; the mean normalised square of nine correlated components over one
    flight lies between 0.4 and 2.
    """
    flown = fly(60.0, seed=8, imu_hz=100.0)
    solution = solve(flown.problem, initial_state(flown.problem).start)
    error = error_of(solution.nav, flown.true_nav())
    normalised = error**2 / np.diagonal(solution.nav_covariance(), axis1=1, axis2=2)
    assert 0.4 < normalised.mean() < 2.0


def test_coarse_attitudes_are_good_to_some_degrees():
    """Oracle: exact motion at the window's start; the claimed sigmas hold, and the first in the
    list is the most certain.
    """
    flown = fly(60.0, seed=9, imu_hz=100.0, noise="navchip")
    found = coarse_attitudes(flown.problem)
    assert [c.heading_sigma for c in found] == sorted(c.heading_sigma for c in found)
    for coarse in found[:3]:
        truth = rotation_from_quaternion(flown.true_nav([coarse.first])[:, 6:])[0]
        error = vector_from_rotation(truth @ coarse.C_lb.T)
        assert (np.abs(error) < 4.0 * np.sqrt(np.diag(coarse.cov))).all()
        assert np.abs(np.degrees(error)).max() < 6.0
        assert_allclose(coarse.velocity, flown.true_nav([coarse.first])[0, 3:6], atol=1.0)


@pytest.mark.parametrize("velocity", [False, True])
def test_wahbas_solution_of_exact_data_is_exact(velocity):
    """Oracle: exact motion with fixes 1000 times better than they are: what is left are Earth rate
    over 10 s, 0.04 deg, and (A.1)'s.

    With velocities the derivative of (A.1) comes along.
    """
    flown = fly(40.0, seed=9, noise=None, velocity=velocity)
    ep, motion = flown.problem.epochs, flown.sim.flight.motion
    lever, time = flown.problem.antenna_lever_b, flown.problem.inc.marks
    C_lb = motion.C_lb(time)
    turn = np.einsum("nij,nj->ni", C_lb, np.cross(motion.omega_lb_b(time), lever))
    exact = ep._replace(
        position=motion.position(time) + C_lb @ lever, velocity=motion.velocity(time) + turn
    )
    problem = replace(flown.problem, epochs=exact)
    at = np.flatnonzero(ep.has_position)[120:220]
    coarse = solve_window(problem, at)
    error = vector_from_rotation(C_lb[at[0]] @ coarse.C_lb.T)
    assert np.abs(np.degrees(error)).max() < 0.1
    assert_allclose(coarse.velocity, motion.velocity(time[at[:1]])[0], atol=0.02)


@pytest.mark.parametrize("seed", range(3))
def test_straight_flight_shows_no_heading(seed):
    """Oracle: a line of one minute without wind or gusts holds no acceleration, so nothing tells
    the heading.
    """
    straight = tuple(replace(level, length_m=2280.0) for level in CORRIDOR.levels)
    flown = fly(
        30.0, seed=seed, imu_hz=100.0, turbulence=0.0, levels=straight, line_length_m=2280.0
    )
    with pytest.raises(DataError, match=r"heading not observable: .*include a manoeuvre or give"):
        initial_state(flown.problem)


@pytest.mark.slow
def test_slight_gusts_give_a_heading_within_its_sigma_or_none():
    """Oracle: exact motion. Gusts of three percent of the usual move a straight flight by
    millimetres only.
    """
    straight = tuple(replace(level, length_m=2280.0) for level in CORRIDOR.levels)
    refused = 0
    for seed in range(8):
        flown = fly(
            60.0, seed=seed, imu_hz=100.0, turbulence=0.03, levels=straight, line_length_m=2280.0
        )
        try:
            alignment = initial_state(flown.problem)
        except DataError as error:
            refused += "heading not observable" in str(error)
            continue
        assert abs(start_error(flown, alignment.start)[8]) < 4.0 * alignment.heading_sigma
    assert refused > 0


@pytest.mark.parametrize("seed", [3, 8])
def test_gross_fixes_do_not_turn_the_attitude(seed):
    """Oracle: exact motion. One fix in twenty is 1 to 50 m off, which no window of a minute is
    without.
    """
    flown = fly(120.0, seed=seed, imu_hz=100.0)
    rng = np.random.default_rng(seed)
    position = flown.problem.epochs.position.copy()
    gross = np.flatnonzero(rng.random(position.shape[0]) < 0.05)
    position[gross] += rng.uniform(1.0, 50.0, (gross.size, 1)) * np.array([0.6, -0.64, 0.48])
    alignment = initial_state(
        replace(flown.problem, epochs=flown.problem.epochs._replace(position=position))
    )
    assert abs(start_error(flown, alignment.start)[8]) < 4.0 * alignment.heading_sigma
    assert np.degrees(alignment.heading_sigma) < 0.5


def test_contradicting_motion_gives_no_attitude():
    """Oracle: fixes mirrored north to south belong to no attitude."""
    flown = fly(60.0, seed=7, imu_hz=100.0)
    position = flown.problem.epochs.position.copy()
    position[:, 0] *= -1.0
    with pytest.raises(
        DataError, match="no initial attitude: GNSS and inertial motion agree in no part"
    ):
        initial_state(
            replace(flown.problem, epochs=flown.problem.epochs._replace(position=position))
        )


def test_too_few_fixes_give_no_attitude():
    """Oracle: three fixes make no window."""
    flown = fly(60.0, seed=7, imu_hz=100.0)
    has = np.zeros_like(flown.problem.epochs.has_position)
    has[:3] = True
    with pytest.raises(DataError, match="no initial attitude"):
        initial_state(
            replace(flown.problem, epochs=flown.problem.epochs._replace(has_position=has))
        )


@pytest.mark.parametrize("velocity", [False, True])
def test_given_attitude_starts_there(velocity):
    """Oracle: the angles that were given; the solution from them ends where exact motion says,
    without any alignment.
    """
    flown = fly(40.0, seed=5, imu_hz=100.0, velocity=velocity)
    frame, truth = flown.problem.frame, flown.true_nav([0])[0]
    C_ln = frame.C_ln_at(flown.problem.epochs.position[0])
    rpy = rpy_from_rotation(C_ln.T @ rotation_from_quaternion(truth[6:])) + np.radians(
        [1.0, -1.0, 3.0]
    )
    start = given_attitude(flown.problem, rpy, np.radians([1.0, 2.0, 5.0]))
    assert_allclose(
        rpy_from_rotation(C_ln.T @ rotation_from_quaternion(start.nav[6:])), rpy, rtol=0, atol=1e-12
    )
    assert_allclose(np.degrees(np.sqrt(np.diag(start.P)[6:9])), [2.0, 2.0, 5.0], rtol=1e-12)
    assert_allclose(start.nav[:3], truth[:3], atol=0.2)
    assert_allclose(start.nav[3:6], truth[3:6], atol=2.0)
    assert not start.mean.any()
    solution = solve(flown.problem, start)
    error = error_of(solution.nav, flown.true_nav())
    sigma = np.sqrt(np.diagonal(solution.nav_covariance(), axis1=1, axis2=2))
    assert ((error / sigma) ** 2).mean() < 2.0
    assert np.abs(error[:, 6:]).max() < np.radians(0.5)


@pytest.mark.slow
def test_motion_read_backwards_returns_to_its_start():
    """Oracle: the start itself, after 30 s forward and 30 s back through turns.

    The rotation composes to 1e-13 rad. Gravity is carried through a block from its other end: 0.3 m
    of 8e-9 m/s^2 a metre, twice.
    """
    flown = fly(30.0, seed=3, noise=None)
    problem = flown.problem
    forward = free_inertial(problem.inc, problem.frame, flown.true_nav([0])[0])
    back = _reverse_problem(problem, forward.shape[0] - 1)
    turned = forward[-1].copy()
    turned[3:6] *= -1.0
    out = np.empty_like(forward)
    run_strapdown(
        kernel_intervals(back.inc),
        back.inc.stop,
        turned,
        np.zeros(6),
        kernel_earth(problem.frame, backward=True),
        out,
    )
    out[:, 3:6] *= -1.0
    error = np.abs(error_of(out[::-1], forward))
    assert error[:, :3].max() < 1e-6
    assert error[:, 3:6].max() < 1e-7
    assert error[:, 6:].max() < 1e-12
    assert np.linalg.norm(forward[-1, :3] - forward[0, :3]) > 50.0


@pytest.mark.parametrize("velocity", [False, True])
def test_smoother_read_backwards_is_the_smoother(velocity):
    """Oracle: the smoother. What all data say of a state does not depend on the order in which they
    are read.

    The states start unknown at either end: the two prior sets of information, wide against the
    data, are the difference (measured 4e-4 of a sigma).
    """
    flown = fly(40.0, seed=5, imu_hz=100.0, gate=NO_GATE, velocity=velocity)
    problem, layout = flown.problem, flown.problem.layout
    n, last = layout.size, flown.problem.inc.marks.size - 1
    P = np.diag(
        np.concatenate(
            [np.full(3, 10.0), np.full(3, 5.0), np.radians([5.0, 5.0, 5.0]), layout.sigma0]
        )
        ** 2
    )
    truth = flown.true_nav()
    smoothed = solve(problem, InitialState(truth[0], np.zeros(n - 9), np.zeros(n), P), "on")
    end = truth[-1].copy()
    end[3:6] *= -1.0
    back = solve(
        _reverse_problem(problem, last), InitialState(end, np.zeros(n - 9), np.zeros(n), P), "on"
    )
    reversed_nav = back.nav[::-1].copy()
    reversed_nav[:, 3:6] *= -1.0
    sigma = np.sqrt(np.diagonal(smoothed.nav_covariance(), axis1=1, axis2=2))
    off = np.abs(error_of(reversed_nav, smoothed.nav)) / sigma
    assert off.max() < 0.005
    ratio = np.sqrt(np.diagonal(back.nav_covariance()[::-1], axis1=1, axis2=2)) / sigma
    assert_allclose(ratio, 1.0, atol=2e-3)
