"""White and time-correlated errors of code solutions: the data tell which."""

from dataclasses import replace

import numpy as np
import pytest
from flown import fly, start_near

from insgnss.navigation.diagnosis.time_correlated import code_errors, code_message
from insgnss.navigation.filter.layout import FixErrors, state_layout
from insgnss.navigation.filter.solution import solve
from insgnss.navigation.noise_model.model import load_noise_model

SIGMA_M, SIGMA_MPS = np.array([1.5, 1.5, 3.0]), 0.08
CODE = FixErrors(unfixed_gm_sigma=1.0, unfixed_correlation_time_s=600.0, unfixed_white_scale=1.0)
SECONDS = 180.0


@pytest.fixture(scope="module")
def flown():
    return fly(SECONDS, seed=4, imu_hz=100.0, velocity=True)


def layout(errors):
    return state_layout(load_noise_model("navchip"), fixes=errors)


def lasting(time: np.ndarray, time_s: float, draw: np.random.Generator) -> np.ndarray:
    """Gauss-Markov errors (n, 3) of unit sigma."""
    a = np.exp(-np.diff(time, prepend=time[0]) / time_s)
    e = draw.standard_normal((time.size, 3))
    for k in range(1, time.size):
        e[k] = a[k] * e[k - 1] + np.sqrt(1.0 - a[k] ** 2) * e[k]
    return e


def coded(flown, white: float, time_s: float, bias_mps: float = 0.0, seed: int = 1):
    """The problem with fixes of metres: a white share, the rest lasting, velocities with a lasting
    error; all as their sigmas claim.
    """
    draw = np.random.default_rng(seed)
    ep = flown.problem.epochs
    at = np.flatnonzero(ep.has_position)
    position, cov = ep.position.copy(), ep.position_cov.copy()
    velocity, velocity_cov = ep.velocity.copy(), ep.velocity_cov.copy()
    share = np.sqrt(1.0 - white**2)
    motion = flown.sim.flight.motion
    time = flown.problem.inc.marks[at]
    lever = motion.C_lb(time) @ flown.problem.antenna_lever_b
    e = white * draw.standard_normal((at.size, 3)) + share * lasting(time, time_s, draw)
    position[at] = motion.position(time) + lever + SIGMA_M * e
    cov[at] = np.diag(SIGMA_M**2)
    velocity[at] += bias_mps * lasting(time, 60.0, draw)
    velocity_cov[at] = np.diag([SIGMA_MPS**2] * 3)
    epochs = ep._replace(
        position=position,
        position_cov=cov,
        velocity=velocity,
        velocity_cov=velocity_cov,
        sigma=np.where(ep.has_position[:, None], SIGMA_M, 0.0),
        group=np.ones_like(ep.group),
    )
    problem = replace(flown.problem, epochs=epochs, layout=layout(CODE))
    own = replace(flown, problem=problem)
    return problem, start_near(own, np.array([2.0] * 3 + [0.3] * 3 + [0.01, 0.01, 0.03]))


def found(problem, start):
    errors = code_errors(problem, start, layout, CODE, lambda _: None)
    assert errors is not None
    return errors


@pytest.mark.slow
def test_white_fixes_are_not_time_correlated(flown):
    """Oracle: what was planted; the sigma of a white share of 1800 fixes is 2 %."""
    errors = found(*coded(flown, 1.0, 60.0))
    assert errors.unfixed_white_scale == pytest.approx(1.0, abs=0.05)
    assert errors.unfixed_gm_sigma is None
    assert "none time-correlated" in code_message(errors)


@pytest.mark.slow
@pytest.mark.parametrize(("white", "time_s"), [(0.3, 20.0), (0.05, 100.0)])
def test_shares_and_time_are_what_was_planted(flown, white, time_s):
    """Oracle: what was planted; the rate of a Gauss-Markov process is known to some percent from
    1800 increments, within 30 % beside the motion that it has to be told from.
    """
    errors = found(*coded(flown, white, time_s))
    assert errors.unfixed_white_scale == pytest.approx(white, rel=0.15)
    assert errors.unfixed_gm_sigma == pytest.approx(np.sqrt(1.0 - white**2), rel=0.05)
    assert errors.unfixed_correlation_time_s == pytest.approx(time_s, rel=0.3)


@pytest.mark.slow
def test_velocities_that_are_biased_do_not_carry_the_positions_off(flown):
    """Oracle: fixes less solution, by eighths of the run, within the claimed sigma; velocities with
    a time-correlated error of 0.2 m/s.
    """
    problem, start = coded(flown, 0.1, 300.0, bias_mps=0.2)
    errors = found(problem, start)
    assert errors.velocity_gm_sigma_mps == pytest.approx(0.2, rel=0.6)
    solution = solve(*posed(problem, start, errors))
    at = np.flatnonzero(problem.epochs.has_position)
    time = problem.inc.marks[at]
    lever = flown.sim.flight.motion.C_lb(time) @ problem.antenna_lever_b
    off = problem.epochs.position[at] - solution.nav[at, :3] - lever
    sigma = np.sqrt(solution.variance(at)[:, :3])
    for rows in np.array_split(np.arange(at.size), 8):
        assert (np.abs(off[rows].mean(axis=0)) < sigma[rows].mean(axis=0)).all()


def posed(problem, start, errors):
    from insgnss.navigation.diagnosis.candidates import with_layout

    return with_layout(problem, start, layout(errors))


def test_fixed_solutions_are_left_alone(flown):
    """Oracle: the group of the fixes."""
    problem = replace(flown.problem, layout=layout(CODE))
    start = start_near(replace(flown, problem=problem), np.full(9, 0.1))
    assert code_errors(problem, start, layout, CODE, lambda _: None) is None
