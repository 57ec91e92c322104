"""The list of remedies: which of them a segment calls for, and what each leaves in the history."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from insgnss.base.errors import DataError
from insgnss.navigation.diagnosis.remedies import REMEDIES, Case, Remedy
from insgnss.navigation.filter.codes import COVARIANCE_RESET, USED
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
FAILED = ["a wrong constant, which is refused", "a gate too narrow for the start"]
FAILED += ["another error model, against failure"]


@pytest.mark.parametrize(
    ("changes", "expected"),
    [
        ({"solution": solved(USED)}, OF_SOLUTION),
        ({"solution": solved(USED), "moving": False}, OF_SOLUTION[1:]),
        ({"solution": solved(USED), "other_model": True}, OF_SOLUTION[1:]),
        ({"solution": solved(COVARIANCE_RESET)}, ["incorrect fixes", *OF_SOLUTION]),
        (
            {"solution": solved(USED), "problem": AIDED},
            ["incorrect values of further sensors", *OF_SOLUTION],
        ),
        ({"failure": DataError("lost"), "problem": AIDED}, ["incorrect fixes", *FAILED]),
        ({"failure": DataError("lost")}, ["incorrect fixes", *FAILED]),
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
