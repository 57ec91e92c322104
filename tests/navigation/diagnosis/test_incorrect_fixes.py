"""Spells of incorrect fixes: which are withheld, and what they cost where nothing tells."""

from dataclasses import replace

import numpy as np
import pytest
from flown import fly, start_near

from insgnss.navigation.diagnosis.incorrect_fixes import (
    ENLARGED,
    LEFT_OUT,
    LONGEST_SPELL_S,
    FixSpell,
    float_spells,
    incorrect_check,
    spells_apart,
    undecided_spells,
    with_steps,
    withhold_incorrect_fixes,
)
from insgnss.navigation.diagnosis.incorrect_fixes import _withheld as withheld_fixes
from insgnss.navigation.filter.codes import COVARIANCE_RESET, POSITION_ROW, REJECTED
from insgnss.navigation.filter.filter import gate_from_sigma
from insgnss.navigation.filter.layout import FixErrors, state_layout
from insgnss.navigation.filter.solution import solve
from insgnss.navigation.noise_model.model import load_noise_model

STEP = np.array([0.4, -0.3, 0.5])


@pytest.fixture(scope="module")
def flown():
    """Two minutes with fixes at 10 Hz."""
    at_s = np.arange(5.0, 118.0, 5.0)
    return fly(120.0, seed=3, imu_hz=100.0, gate=gate_from_sigma(5.0), events_s=at_s)


def start(flown):
    """The truth, within 10 cm, 5 cm/s, 0.5 deg and 1 deg of heading."""
    return start_near(flown, np.array([0.1] * 3 + [0.05] * 3 + list(np.radians([0.5, 0.5, 1.0]))))


def with_spells(flown, *spans):
    """The problem with the fixes of some seconds off by STEP."""
    epochs = flown.problem.epochs
    position = epochs.position.copy()
    for first, last in spans:
        position[(epochs.time > first) & (epochs.time < last)] += STEP
    return replace(flown.problem, epochs=epochs._replace(position=position))


def bounds(problem, spells):
    return [tuple(np.round(problem.epochs.time[[s.first, s.last]], 1)) for s in spells]


@pytest.mark.parametrize("spans", [[(50, 65)], [(30, 35), (80, 90)], [(-1, 12)], [(105, 130)]])
def test_spells_are_found_and_withheld(flown, spans):
    """Oracle: what was planted, in the middle and at either end; the true motion."""
    problem = with_spells(flown, *spans)
    withheld, spells = withhold_incorrect_fixes(problem, start(flown))
    found = bounds(problem, spells)
    assert len(found) == len(spans)
    for (first, last), span, spell in zip(found, spans, spells, strict=True):
        assert first == pytest.approx(max(span[0], 0.0), abs=0.25)
        assert last == pytest.approx(min(span[1], problem.epochs.time[-1]), abs=0.25)
        assert np.abs(spell.step - STEP).max() < 0.15
    solution = solve(withheld, start(flown))
    assert not np.any(solution.verdict[:, POSITION_ROW] == COVARIANCE_RESET)
    inside = withheld.epochs.withheld & withheld.epochs.has_position
    assert (solution.verdict[inside, POSITION_ROW] == REJECTED).all()
    check = incorrect_check(withheld, spells, LEFT_OUT)
    assert check.verdict == "note"
    assert "these fixes are left out" in check.found


@pytest.mark.parametrize("length_s", [20.0, 66.0])
def test_fixes_that_wander_are_withheld(flown, length_s):
    """Oracle: what was planted: fixes that wander by hundreds of metres, longer than a spell of one
    level may last, too.
    """
    if length_s > LONGEST_SPELL_S:
        flown = fly(240.0, seed=3, imu_hz=50.0, gate=gate_from_sigma(5.0))
    epochs = flown.problem.epochs
    position, since = epochs.position.copy(), epochs.time - 50.0
    bad = (since > 0.0) & (since < length_s)
    position[bad] += np.sin(since[bad, None]) * [200.0, -300.0, 100.0]
    problem = replace(flown.problem, epochs=epochs._replace(position=position))
    assert withhold_incorrect_fixes(problem, start(flown))[1] == ()
    withheld, spells = withhold_incorrect_fixes(problem, start(flown), closing=False)
    assert len(spells) >= 1
    assert withheld.epochs.withheld[bad].mean() > 0.95
    assert withheld.epochs.withheld[~bad].mean() < 0.05
    solution = solve(withheld, start(flown))
    assert not np.any(solution.verdict[:, POSITION_ROW] == COVARIANCE_RESET)


def of_fixes(errors):
    return state_layout(load_noise_model("navchip"), fixes=errors)


def with_steps_at(flown, time_s, *steps):
    """The problem whose fixes step at 70 and 190 s and converge over a time."""
    epochs = flown.problem.epochs
    position = epochs.position.copy()
    for since, step in zip((70.0, 190.0), steps, strict=False):
        passed = epochs.time - since
        on = epochs.has_position & (passed > 0.0)
        position[on] += np.exp(-passed[on, None] / time_s) * step
    return replace(flown.problem, epochs=epochs._replace(position=position))


@pytest.mark.parametrize("time_s", [6.0, 15.0])
def test_float_solutions_that_claim_to_be_fixed_have_an_error_of_their_own(time_s):
    """Oracle: what was planted: fixes that step by 0.7 m twice, each elsewhere, and converge; the
    true motion, within 4 sigma. Steps of metres are no float solutions.
    """
    flown = fly(300.0, seed=3, imu_hz=50.0, gate=gate_from_sigma(5.0))
    other = np.roll(STEP, 1)
    problem = with_steps_at(flown, time_s, STEP, other)
    found = float_spells(problem, start(flown), of_fixes, FixErrors())
    assert found is not None
    converging, first, _, spells = found
    assert [round(problem.epochs.time[s.first]) for s in spells] == [70, 190]
    for spell, step in zip(spells, (STEP, other), strict=True):
        np.testing.assert_allclose(spell.step, step, atol=0.2 * np.linalg.norm(STEP))
    solution = solve(converging, first)
    error = solution.nav[:, :3] - flown.true_nav()[:, :3]
    sigma = np.sqrt(np.diagonal(solution.nav_covariance(), axis1=1, axis2=2)[:, :3])
    assert np.abs(error / sigma).max() < 4.0
    assert 0.2 < np.mean(np.square(error / sigma)) < 2.5
    far = with_steps_at(flown, time_s, 6.0 * STEP, 6.0 * other)
    assert float_spells(far, start(flown), of_fixes, FixErrors()) is None


def test_a_level_that_lasts_is_no_float_solution():
    """Oracle: what was planted: a step that nothing takes back and that does not converge."""
    flown = fly(300.0, seed=3, imu_hz=50.0, gate=gate_from_sigma(5.0))
    lasting = with_steps_at(flown, 1e9, STEP)
    assert float_spells(lasting, start(flown), of_fixes, FixErrors()) is None


@pytest.mark.parametrize(("since", "in_doubt"), [(60, [0.0, 60.1]), (75, [75.1])])
def test_of_one_step_the_longer_side_is_believed_if_it_is_much_longer(flown, since, in_doubt):
    """Oracle: what was planted: a step after 60 and after 75 of 120 s."""
    solution = solve(with_spells(flown, (since, 130)), start(flown))
    spells = undecided_spells(solution)
    firsts = sorted(float(solution.problem.epochs.time[one.first]) for one in spells)
    assert firsts == pytest.approx(in_doubt, abs=0.25)


@pytest.mark.parametrize("spans", [[], [(40, 80)]])
def test_what_is_right_or_too_long_is_left_alone(flown, spans):
    """Oracle: nothing planted; a third of the fixes, of which nobody knows that they are wrong."""
    problem = with_spells(flown, *spans)
    same, spells = withhold_incorrect_fixes(problem, start(flown))
    assert same is problem
    assert spells == ()


def test_a_step_that_is_not_taken_back_is_no_spell(flown):
    """Oracle: fixes that step by as much as is not taken back, which the IMU alone would allow
    after 20 s without them.
    """
    problem = with_spells(flown, (50, 70.05))
    position = problem.epochs.position.copy()
    position[problem.epochs.time > 70.05] += 0.6 * STEP
    problem = replace(problem, epochs=problem.epochs._replace(position=position))
    assert withhold_incorrect_fixes(problem, start(flown))[1] == ()


def test_what_cannot_be_decided_is_in_the_covariance(flown):
    """Oracle: (S.1) by hand; a spell of 40 of 120 s that is used."""
    problem = with_spells(flown, (40, 80))
    solution = solve(problem, start(flown))
    before = solution.nav_covariance()[:, :3, :3]
    spells = spells_apart(problem, solution)
    assert bounds(problem, spells) == [pytest.approx((40.1, 79.9), abs=0.25)]
    alone = solution.chain
    priced = with_steps(solution, spells)
    assert alone.shared == ()
    added = priced.nav_covariance()[:, :3, :3] - before
    inside = (problem.epochs.time > 41) & (problem.epochs.time < 79)
    assert np.abs(added[inside] - np.outer(STEP, STEP)).max() < 0.15
    assert np.abs(added[problem.epochs.time < 39]).max() == 0.0
    # until the filter follows the next level, a second later; and by what one fix tells of the step
    resets = problem.epochs.time[solution.verdict[:, POSITION_ROW] == COVARIANCE_RESET]
    before_it = (problem.epochs.time > 80.1) & (problem.epochs.time < resets[1] - 0.05)
    assert resets[1] > 80.9
    assert np.count_nonzero(before_it) > 5
    assert np.abs(added[before_it] - np.outer(STEP, STEP)).max() < 0.15
    assert np.abs(added[problem.epochs.time > resets[1] - 0.05]).max() == 0.0
    least = np.linalg.eigvalsh(added[inside][0])[0]
    assert 0.01**2 < least < 0.1**2
    # exposures within the spell share the step, others do not
    at = priced.event_epochs
    T = np.tile(np.eye(9, solution.problem.layout.size), (at.size, 1, 1))
    k = at.size
    with_step, without = (
        chain.covariance_of(np.arange(len(T)), T).reshape(k, 9, k, 9).transpose(0, 2, 1, 3)
        for chain in (priced.chain, alone)
    )
    own = np.einsum("aaij->aij", with_step)
    sigma = np.sqrt(np.diagonal(own, axis1=1, axis2=2))
    of_own = sigma[:, :, None] * sigma[:, None, :]
    assert np.abs((own - priced.nav_covariance()[at]) / of_own).max() < 1e-9
    next_one = with_step[np.arange(k - 1), np.arange(1, k)]
    of_next = sigma[:-1, :, None] * sigma[1:, None, :]
    assert np.abs((next_one - priced.event_cross[1:]) / of_next).max() < 1e-9
    shared = np.abs((with_step - without)[:, :, :3, :3] - np.outer(STEP, STEP)).max(axis=(2, 3))
    exposed = problem.epochs.time[at]
    within = np.flatnonzero((exposed > 41) & (exposed < 79))
    assert within.size > 3
    assert shared[np.ix_(within, within)].max() < 0.15
    assert not (with_step - without)[within[0], exposed < 39].any()
    assert ENLARGED in incorrect_check(problem, tuple(spells), ENLARGED).found


def test_a_step_within_what_fixes_claim_is_no_spell(flown):
    """Oracle: three standard deviations of a fix. A code solution of 2 m steps by half a metre."""
    epochs = flown.problem.epochs
    cov = epochs.position_cov * (2.0 / np.sqrt(epochs.position_cov[0, 0, 0])) ** 2
    of_code = replace(flown.problem, epochs=epochs._replace(position_cov=cov))
    spell = spells_of(STEP)
    assert withheld_fixes(flown.problem, spell, np.inf) is not None
    assert withheld_fixes(of_code, spell, np.inf) is None
    assert withheld_fixes(of_code, spells_of(20.0 * STEP), np.inf) is not None


def spells_of(step):
    return [FixSpell(100, 130, step, np.full(3, 0.03))]
