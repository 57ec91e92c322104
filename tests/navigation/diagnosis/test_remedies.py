"""The list of remedies: which of them a segment calls for, and what each leaves in the history."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from flown import fly, start_near

from insgnss.base.errors import DataError
from insgnss.navigation.diagnosis.evidence import ErrorModelSearch
from insgnss.navigation.diagnosis.incorrect_fixes import float_spells
from insgnss.navigation.diagnosis.remedies import REMEDIES, Case, Remedy, _rival_explains
from insgnss.navigation.filter.codes import COVARIANCE_RESET, USED
from insgnss.navigation.filter.filter import gate_from_sigma
from insgnss.navigation.filter.layout import FixErrors, state_layout
from insgnss.navigation.noise_model.model import load_noise_model

UNAIDED = SimpleNamespace(measurements=())
AIDED = SimpleNamespace(measurements=("heading",))


def case(**changes) -> Case:
    """A segment of which no remedy has run; the conditions look at its outcome alone."""
    search = SimpleNamespace(time_correlated=True)
    return replace(
        Case(UNAIDED, None, search, load_noise_model("navchip"), None, start=object()),
        **changes,
    )


def solved(verdict: int) -> SimpleNamespace:
    """A solution with one verdict on all fixes."""
    return SimpleNamespace(verdict=np.full((5, 3), verdict))


OF_SOLUTION = ["another error model", "steps of the fixes"]
OF_LOST_FIXES = ["a sensor that follows the motion late", "incorrect fixes"]
FAILED = ["a wrong constant, which is refused", "a gate too narrow for the start"]
FAILED += ["another error model, against failure"]


@pytest.mark.parametrize(
    ("changes", "expected"),
    [
        ({"solution": solved(USED)}, OF_SOLUTION),
        ({"solution": solved(USED), "moving": False}, OF_SOLUTION[1:]),
        ({"solution": solved(USED), "other_model": True}, OF_SOLUTION[1:]),
        ({"solution": solved(COVARIANCE_RESET)}, [*OF_LOST_FIXES, *OF_SOLUTION]),
        (
            {"solution": solved(USED), "problem": AIDED},
            ["incorrect values of further sensors", *OF_SOLUTION],
        ),
        ({"failure": DataError("lost"), "problem": AIDED}, [*OF_LOST_FIXES, *FAILED]),
        ({"failure": DataError("lost")}, [*OF_LOST_FIXES, *FAILED]),
        ({"failure": DataError("no attitude"), "start": None}, FAILED),
    ],
)
def test_which_remedies_the_outcome_of_the_filter_calls_for(changes, expected):
    """Oracle: the order in which remedies are to be tried, written down by hand."""
    after_filter = REMEDIES[2:]
    assert [r.name for r in after_filter if r.condition(case(**changes))] == expected


def test_what_is_tried_before_the_first_solution():
    """Oracle: errors of code solutions change what is filtered, so they come first."""
    first = [remedy.name for remedy in REMEDIES if remedy.condition(case())][:2]
    assert first == ["errors of code solutions", "filter and smooth"]


def test_a_remedy_says_what_it_did_and_one_that_is_none_leaves_the_case():
    """Oracle: the history, in words; the case itself, by identity."""
    before = case(how="aligned")
    no_cause = Remedy("x", lambda _: False, lambda c: replace(c, how="?"))
    no_remedy = Remedy("x", lambda _: True, lambda _: None, lambda _: "never")
    assert no_cause.applied(before) is before
    assert no_remedy.applied(before) is before
    remedy = Remedy("x", lambda _: True, lambda c: replace(c, moving=False), lambda _: "rescued")
    assert remedy.applied(before).how == "aligned; rescued"
    assert not remedy.applied(before).moving


def test_a_constant_that_is_wrong_is_no_float_solution():
    """Oracle: what was planted: fixes that step by 0.7 m and converge over 15 s, and an antenna
    that is 1 m elsewhere, which float solutions of that size would hide.
    """
    flown = fly(240.0, seed=3, imu_hz=50.0, gate=gate_from_sigma(5.0))
    noise = load_noise_model("navchip")
    start = start_near(flown, np.array([0.1] * 3 + [0.05] * 3 + [0.01] * 3))

    def layout(fixes, imu=None):
        of_imu = {} if imu is None else {"scale_factor": imu.scale_factor is not None}
        return state_layout(noise if imu is None else imu.of(noise), fixes=fixes, **of_imu)

    def rival_of(problem, apart):
        search = ErrorModelSearch(
            FixErrors(), layout, None, True, "off", lambda _: None, lambda _: None
        )
        return _rival_explains(Case(problem, FixErrors(), search, noise, None, start=start), apart)

    epochs = flown.problem.epochs
    passed = epochs.time - 70.0
    position = epochs.position.copy()
    on = epochs.has_position & (passed > 0.0)
    position[on] += np.exp(-passed[on, None] / 15.0) * np.array([0.4, -0.3, 0.5])
    stepping = replace(flown.problem, epochs=epochs._replace(position=position))
    apart = float_spells(stepping, start, layout, FixErrors())
    assert apart is not None
    assert not rival_of(stepping, apart)
    # antenna 1 m elsewhere; all fixes float by as much explain more than any late sensor does
    arm = flown.problem.antenna_lever_b + np.array([0.0, 1.0, 0.0])
    as_float = epochs._replace(group=np.ones_like(epochs.group), sigma=np.ones_like(epochs.sigma))
    floating = replace(apart[0], antenna_lever_b=arm, epochs=as_float)
    assert rival_of(replace(flown.problem, antenna_lever_b=arm), (floating, *apart[1:]))
