"""Errors of the fixes: found where a flight has them, and where it has not, not."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from flown import Flown, error_of, fly, start_near
from numpy.testing import assert_array_equal

from insgnss.navigation.diagnosis import decision
from insgnss.navigation.diagnosis.candidates import ErrorModel, with_layout
from insgnss.navigation.diagnosis.estimated import state_verdicts
from insgnss.navigation.diagnosis.time_correlated import is_suspicious, time_correlated_error
from insgnss.navigation.filter.layout import FixErrors, state_layout
from insgnss.navigation.filter.solution import Solution, solve
from insgnss.navigation.noise_model.model import load_noise_model
from insgnss.simulation.raw_gnss.receiver import GnssOptions

SIGMA = np.array([0.5, 0.5, 0.5, 0.3, 0.3, 0.3, *np.radians([1.0, 1.0, 5.0])])
NAVCHIP = load_noise_model("navchip")
NONE = FixErrors()
EVERYTHING = FixErrors(lever_arm_m=0.3, time_offset_s=0.2)


def layout_factory(fixes: FixErrors):
    return state_layout(NAVCHIP, fixes=fixes)


def solved(flown: Flown, fixes: FixErrors = NONE, lever=(0.0, 0.0, 0.0)) -> Solution:
    """The flight with the antenna where it is not, by `lever`, and the states of `fixes`."""
    problem = replace(
        flown.problem,
        layout=layout_factory(fixes),
        antenna_lever_b=flown.problem.antenna_lever_b - np.array(lever),
    )
    return solve(problem, start_near(replace(flown, problem=problem), SIGMA), separations=0)


@pytest.fixture(scope="module")
def clean() -> Flown:
    return fly(100.0, seed=21)


def test_a_flight_without_such_errors_is_not_suspected(clean):
    """Oracle: white fixes of the simulator."""
    assert not is_suspicious(solved(clean), layout_factory, FixErrors())


def test_a_lever_arm_that_is_estimated_is_judged_by_its_sigma(clean):
    """Oracle: the simulator's lever arm, the problem lacks 0.2 m forward and 0.15 m down."""
    lever = np.array([0.2, 0.0, 0.15])
    estimated = solved(clean, EVERYTHING, lever)
    first = estimated.problem.layout.lever
    sigma = np.sqrt(estimated.variance(np.array([-1]))[0, 9 + first : 12 + first])
    assert (np.abs(estimated.x[-1, first : first + 3] - lever) < 3.5 * sigma).all()
    verdicts = {v.name: v for v in state_verdicts(estimated)}
    assert verdicts["antenna lever arm forward"].observed == bool(sigma[0] < 0.1)
    assert verdicts["antenna lever arm forward"].moves_m == pytest.approx(sigma[0])


@pytest.mark.slow
def test_correlated_errors_are_found_and_make_the_sigmas_honest():
    """Oracle: exact motion; a Gauss-Markov error of 3 cm and 15 s, which white fixes of that size
    turn into errors of many sigma.

    Over 100 s there are seven correlation times: mean squares over the nine states within 0.3 and
    3.
    """
    options = GnssOptions(
        sigma_m=(0.01, 0.01, 0.01), correlated_sigma_m=(0.03, 0.03, 0.03), correlation_time_s=15.0
    )
    flown = fly(100.0, seed=23, gnss=options)
    plain = solved(flown)
    assert is_suspicious(plain, layout_factory, FixErrors())
    found = time_correlated_error(plain, layout_factory, FixErrors())
    assert found is not None
    assert found.gm_sigma is not None
    claimed = np.sqrt(0.01**2 + 0.03**2)
    assert 0.015 < found.gm_sigma[0] * claimed < 0.06
    assert 0.005 < found.white_scale[0] * claimed < 0.015
    assert 4.0 < found.correlation_time_s < 60.0
    again = solved(flown, found)
    squares = [
        np.mean(
            error_of(s.nav, flown.true_nav())[:, :3] ** 2
            / np.diagonal(s.nav_covariance(), axis1=1, axis2=2)[:, :3]
        )
        for s in (plain, again)
    ]
    assert squares[0] > 5.0
    assert 0.3 < squares[1] < 3.0


def test_states_keep_their_place_and_value_in_another_layout(clean):
    """Oracle: the states."""
    problem, start = clean.problem, start_near(clean, SIGMA)
    start = replace(start, x=np.arange(start.x.size, dtype=float))
    wide, wide_start = with_layout(
        problem, start, layout_factory(FixErrors(lever_arm_m=0.2, gm_sigma=(1.0, 1.0, 1.0)))
    )
    for s, state in enumerate(wide.layout.states):
        if state in problem.layout.states:
            k = problem.layout.states.index(state)
            assert wide_start.x[s] == start.x[k]
            assert wide_start.P[9 + s, 9 + s] == start.P[9 + k, 9 + k]
        else:
            assert wide_start.P[9 + s, 9 + s] == wide.layout.sigma0[s] ** 2
    assert_array_equal(wide_start.P[:9, :9], start.P[:9, :9])


@pytest.mark.parametrize(
    ("tries", "taken"),
    [
        ([(100.0, True), (90.0, False)], 1),  # loses none
        ([(100.0, True), (92.0, True), (40.0, False)], 1),  # would pay with the gain
        ([(100.0, True), (92.0, True), (-5.0, False)], 1),
        ([(100.0, True), (60.0, False)], 1),
        ([(-5.0, False)], None),  # explains nothing
        ([(100.0, True)] * 6, None),  # loses fixes with any
    ],
)
def test_how_white_a_time_correlated_error_leaves_the_fixes(monkeypatch, tries, taken):
    """Oracle: the rule in words. Gain in -2 log L and whether fixes are lost, of tries with ever
    larger white shares; a recorded walk lost 0.9 of the gain, and had twice its sigmas, for one
    covariance reset.
    """
    model = ErrorModel(FixErrors(gm_sigma=(1.0, 1.0, 1.0), white_scale=(0.2, 0.2, 0.2)))
    before = SimpleNamespace(gain=0.0)
    solutions = [SimpleNamespace(gain=gain, loses=loses) for gain, loses in tries]
    left = iter(solutions)
    monkeypatch.setattr(decision, "misfit", lambda solution: -solution.gain)
    monkeypatch.setattr(decision, "loses_fixes", lambda solution, _: solution.loses)
    monkeypatch.setattr(decision, "follows", lambda _: True)
    search = SimpleNamespace(progress=lambda _: None, solved=lambda *_: next(left))
    here = decision.Stage(before, ErrorModel(FixErrors()))
    after = decision._adopt_slow_error(search, None, here, model)
    assert after.solution is (before if taken is None else solutions[taken])
    if taken is None:
        assert "not adopted" in after.history[0]
    else:
        assert after.model.fixes.white_scale == pytest.approx((0.2 * 1.6**taken,) * 3)
