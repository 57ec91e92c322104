"""The decision: which error model is adopted, and what contradicts the flight file.

`diagnose` looks at a solution, `explain_failure` at a problem that has none.
"""

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Literal

import numpy as np

from ..base.errors import DataError
from ..navigation.codes import NOT_MEASURED, POSITION
from ..navigation.layout import FixErrors
from ..navigation.problem import EstimationProblem, InitialState
from ..navigation.solution import Solution, solve
from ..orient.mounting import Mounting
from ..records import Check
from .advice import contradictions, message
from .candidates import (
    LayoutFactory,
    guesses,
    with_larger_white_share,
    with_layout,
    with_lever_arm_and_time_offset,
    with_time_correlated_error,
)
from .evidence import GAIN, liveliest_window, loses_fixes, minus_two_log_likelihood, misfit
from .time_correlated import time_correlated_error

FEWEST_FIXES = 60  # below which the innovations are not looked at
TRIES = 6  # of a time-correlated error, each with a larger white share than the one before

SecondPass = Literal["auto", "on", "off"]


@dataclass(frozen=True)
class ErrorModelSearch:
    """What the search may vary, and how its candidates are solved.

    Parameters
    ----------
    requested_errors : FixErrors
        The errors of the fixes that the flight file asks for.
    layout_factory : LayoutFactory
        The error states of the flight as a function of those of its fixes.
    mounting : Mounting
        The mounting of the flight file, with which estimates are compared.
    time_correlated : bool
        Whether a time-correlated GNSS error may be adopted.
    second_pass : str
        Of the adopted solution, as `navigation.solution.solve` takes it.
    progress : callable
        Receives the name of each step.
    """

    requested_errors: FixErrors
    layout_factory: LayoutFactory
    mounting: Mounting
    time_correlated: bool
    second_pass: SecondPass
    progress: Callable[[str], None]

    def contradictions(self, solution: Solution) -> list[Check]:
        """Compare lever arm and time offset of a solution with those that are taken as known."""
        errors = self.requested_errors
        lever_known, offset_known = errors.lever_arm_m is None, errors.time_offset_s is None
        return contradictions(solution, self.mounting, lever_known, offset_known)


@dataclass(frozen=True)
class Diagnosis:
    """The outcome of a search.

    Parameters
    ----------
    solution : Solution
        The solution to go on with.
    checks : tuple of Check
        What it says of the flight file.
    history : tuple of str
        What was done, sentence by sentence.
    """

    solution: Solution
    checks: tuple[Check, ...] = ()
    history: tuple[str, ...] = ()


def diagnose(search: ErrorModelSearch, start: InitialState, solution: Solution) -> Diagnosis:
    """Look for the error model that explains the innovations of a solution.

    Where they show a time-correlated GNSS error and nothing forbids it, the flight is solved again
    with it. Where they show more, lever arm and time offset are estimated, and compared with the
    flight file.

    Parameters
    ----------
    search : ErrorModelSearch
        What the search may vary.
    start : InitialState
        The initial state of the solution's problem.
    solution : Solution
        The solution with the requested errors.

    Returns
    -------
    Diagnosis
        The solution itself where its innovations are as they should be.
    """
    requested, layout_factory = search.requested_errors, search.layout_factory
    if not is_suspicious(solution, layout_factory, requested):
        return Diagnosis(solution)
    suspected, correlated = with_lever_arm_and_time_offset(requested), None
    if search.time_correlated:
        search.progress("the innovations are not white: errors of the fixes")
        correlated = time_correlated_error(solution, layout_factory, suspected)
    adopted = requested
    if correlated is not None:
        suspected = correlated
        adopted = replace(
            correlated,
            lever_arm_m=requested.lever_arm_m,
            time_offset_s=requested.time_offset_s,
            clock_rate=requested.clock_rate,
        )
    checks: list[Check] = []
    if suspected != adopted:
        search.progress("lever arm and clock of the fixes")
        layout = layout_factory(suspected)
        try:
            candidate = solve(*with_layout(solution.problem, start, layout), "off", separations=0)
            checks = search.contradictions(candidate)
        except DataError:
            pass  # the search is not the result
    if correlated is None:
        return Diagnosis(solution, tuple(checks))
    return replace(_adopted(search, start, solution, adopted), checks=tuple(checks))


def is_suspicious(solution: Solution, layout_factory: LayoutFactory, errors: FixErrors) -> bool:
    """Tell whether another error model explains the innovations of the liveliest window better.

    Parameters
    ----------
    solution : Solution
        The solved flight.
    layout_factory : LayoutFactory
        The error states of the flight as a function of those of its fixes.
    errors : FixErrors
        What is estimated already.

    Returns
    -------
    bool
        Whether lever arm and time offset, or a time-correlated GNSS error, gain `evidence.GAIN` in
        (C.1).
    """
    if np.count_nonzero(solution.verdict[:, POSITION] != NOT_MEASURED) < FEWEST_FIXES:
        return False
    problem, start = liveliest_window(solution)
    candidates = [errors, with_lever_arm_and_time_offset(errors)]
    if errors.gm_sigma is None:
        candidates += [with_time_correlated_error(errors, *guess) for guess in guesses(problem)]
    cost = [
        minus_two_log_likelihood(*with_layout(problem, start, layout_factory(candidate)))
        for candidate in candidates
    ]
    return cost[0] - min(cost[1:]) > GAIN


def explain_failure(
    search: ErrorModelSearch,
    problem: EstimationProblem,
    align: Callable[[EstimationProblem], InitialState],
) -> Check | None:
    """Look for the lever arm or time offset without which a flight has no solution.

    Parameters
    ----------
    search : ErrorModelSearch
        What the search may vary.
    problem : EstimationProblem
        The problem that has no solution with the requested errors.
    align : callable
        Gives the initial state of a problem, or raises DataError.

    Returns
    -------
    Check or None
        What contradicts the flight file; None where nothing explains the failure.
    """
    suspected = with_lever_arm_and_time_offset(search.requested_errors)
    if suspected == search.requested_errors:
        return None
    problem = replace(problem, layout=search.layout_factory(suspected))
    try:
        candidate = solve(problem, align(problem), "off", separations=0)
    except DataError:
        return None
    checks = search.contradictions(candidate)
    return checks[0] if checks else None


def _adopted(
    search: ErrorModelSearch, start: InitialState, solution: Solution, errors: FixErrors
) -> Diagnosis:
    """Solve again with a time-correlated GNSS error.

    As long as that loses fixes, it is tried with a larger white share.
    """
    for _ in range(TRIES):
        search.progress("filter, with a time-correlated GNSS error")
        layout = search.layout_factory(errors)
        try:
            again = solve(
                *with_layout(solution.problem, start, layout), search.second_pass, search.progress
            )
        except DataError:
            errors = with_larger_white_share(errors)
            continue
        if loses_fixes(again, solution):
            errors = with_larger_white_share(errors)
        elif misfit(again) > misfit(solution):
            reason = "given up, it explains the whole flight no better"
            return Diagnosis(solution, (), (f"{message(errors)}; {reason}",))
        else:
            return Diagnosis(again, (), (message(errors),))
    reason = "given up, the filter loses fixes with it"
    return Diagnosis(solution, (), (f"{message(errors)}; {reason}",))
