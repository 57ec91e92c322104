"""Sigmas of the fixes that were enlarged without need are told from those that had to be."""

import numpy as np
import pytest
from flown import fly, start_near

from insgnss.flight.processing.segment_checks import wider_than_needed
from insgnss.navigation.filter.layout import FixErrors, StateLayout, state_layout
from insgnss.navigation.filter.problem import EstimationProblem, InitialState
from insgnss.navigation.filter.solution import solve
from insgnss.navigation.noise_model.model import load_noise_model

ALIGNED = np.array([1.0, 1.0, 1.0, 0.5, 0.5, 0.5, *np.radians([0.5, 0.5, 1.0])])
SLOW = FixErrors(gm_sigma=(1.0, 1.0, 1.0), correlation_time_s=427.0, white_scale=(0.9,) * 3)
QUICK = FixErrors(gm_sigma=(0.95, 0.95, 0.95), correlation_time_s=5.0, white_scale=(0.3,) * 3)


def layout(fixes: FixErrors) -> StateLayout:
    return state_layout(load_noise_model("navchip"), fixes=fixes)


def posed(fixes: FixErrors, time_s: float | None) -> tuple[EstimationProblem, InitialState]:
    """A flight of white fixes, or of fixes of the same sigma that are correlated over `time_s`."""
    flown = fly(120.0, seed=8, imu_hz=100.0, layout=layout(fixes))
    start, ep = start_near(flown, ALIGNED), flown.problem.epochs
    if time_s is None:
        return flown.problem, start
    rng, rows = np.random.default_rng(5), np.flatnonzero(ep.has_position)
    a = np.exp(-np.diff(ep.time[rows], prepend=0.0) / time_s)[:, None]
    e = rng.standard_normal((rows.size, 3))
    for k in range(1, rows.size):
        e[k] = a[k] * e[k - 1] + np.sqrt(1.0 - a[k] ** 2) * e[k]
    motion, time = flown.sim.flight.motion, flown.problem.inc.marks[rows]
    antenna = motion.position(time) + motion.C_lb(time) @ flown.problem.antenna_lever_b
    sigma = np.sqrt(np.diagonal(ep.position_cov[rows], axis1=1, axis2=2))
    ep.position[rows] = antenna + sigma * e
    return flown.problem, start


def test_honest_white_sigmas_that_were_enlarged_are_seen():
    """Oracle: by construction; white fixes of true sigmas get 427 s of correlated error."""
    wider = wider_than_needed(solve(*posed(SLOW, None), "off", separations=0), layout(FixErrors()))
    assert wider is not None
    assert wider[0] == pytest.approx(1.0, abs=0.1)
    assert wider[1] > 1.5


def test_errors_that_are_correlated_are_no_needless_ones():
    """Oracle: by construction; the fixes have the time-correlated error that was adopted."""
    solution = solve(*posed(QUICK, 5.0), "off", separations=0)
    assert wider_than_needed(solution, layout(FixErrors())) is None


def test_sigmas_that_nobody_changed_are_not_looked_at():
    """Oracle: definition."""
    problem, start = posed(FixErrors(), None)
    assert wider_than_needed(solve(problem, start, "off", separations=0), problem.layout) is None
