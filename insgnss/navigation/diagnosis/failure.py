"""What becomes of a flight that has no solution: its cause in the flight file, or in a sensor."""

from dataclasses import replace

import numpy as np

from ...base.errors import DataError
from ...records import Finding
from ..filter.problem import EstimationProblem, InitialState
from ..filter.solution import solve
from .advice import advice, as_solved
from .candidates import widen_layout, with_constants
from .constants import OTHERS, STRONG, Hypothesis
from .decision import (
    OF_CLOCK,
    ROUNDS,
    Diagnosis,
    Stage,
    next_state,
    step_under,
)
from .drift import bias_step_candidate
from .evidence import ErrorModelSearch, Posed, follows
from .sensor_dynamics import late_sensors


def explain_failure(search: ErrorModelSearch, problem: EstimationProblem) -> Finding | None:
    """Look for the lever arm or time offset without which a flight has no solution.

    Parameters
    ----------
    search : ErrorModelSearch
        What the search may vary.
    problem : EstimationProblem
        The problem that has no solution with the requested errors.

    Returns
    -------
    Finding or None
        What contradicts the flight file; None where nothing explains the failure.
    """
    search.progress("what the fixes say with an open gate")
    open_gate = replace(problem, gate=np.inf)
    try:
        start, _ = search.align(open_gate)
    except DataError:
        return None
    shown = _shown_by(search, open_gate, start)
    if shown is None:
        return None
    suspected, rivals = shown
    if _rival_wins(search, (open_gate, start), problem.gate, suspected.evidence):
        return None
    quiet = replace(search, second_pass="off", progress=lambda _: None)
    model = with_constants(search.requested_model, suspected.groups, suspected.factor)
    candidate = quiet.solved((problem, start), model)
    if candidate is not None and not follows(candidate):
        candidate = None
    if not set(OF_CLOCK).isdisjoint(suspected.groups):
        step = step_under(search, (problem, start), search.requested_model, candidate)
        if step is not None:
            return step
    if candidate is None:
        return None
    solved = as_solved(suspected, candidate)
    checks = advice(search.mounting, candidate, solved, rivals, search.exposures)
    return next((check for check in checks if check.verdict == "contradiction"), None)


def _rival_wins(search: ErrorModelSearch, posed: Posed, gate: float, evidence: float) -> bool:
    """Return whether late sensors, or a step of the biases, explain more than an evidence."""
    try:
        shown = solve(*posed, "off", search.progress)
    except DataError:
        return False
    model = search.requested_model
    if late_sensors(search, posed, model, shown, least=evidence + OTHERS):
        return True
    gated = replace(posed[0], gate=gate), posed[1]
    step = bias_step_candidate(search, model, gated, shown)
    if step is None or step.evidence <= evidence:
        return False
    stepped = step.solved(search)
    return stepped is not None and follows(stepped[0])


def rescue(
    search: ErrorModelSearch, problem: EstimationProblem, start: InitialState
) -> Diagnosis | None:
    """Look for the error model with which a flight has a solution that has none without.

    The hypotheses are those of `diagnose`, judged by a solution with an open gate.

    Parameters
    ----------
    search : ErrorModelSearch
        What the search may vary.
    problem, start : EstimationProblem, InitialState
        The problem that has no solution with the requested errors, and its initial state.

    Returns
    -------
    Diagnosis or None
        The solution with the models that were adopted, with the gate of the problem; None where
        none is a remedy.
    """
    posed = replace(problem, gate=np.inf), start
    try:
        shown = solve(*posed, "off", search.progress)
        state = Stage(shown, search.requested_model)
        for _ in range(ROUNDS):
            constants = search.constants(*posed, state.model)
            following = next_state(search, posed, state, constants)
            if following is None:
                return None
            state, posed = following, following.posed or posed
            again, first = widen_layout(*posed, search.layout(state.model))
            gated = replace(again, gate=problem.gate)
            solution = solve(
                gated, first, search.second_pass, search.progress, about=state.solution
            )
            if follows(solution):
                return Diagnosis(solution, state.checks, state.history)
    except DataError:
        return None
    return None


def _shown_by(
    search: ErrorModelSearch, problem: EstimationProblem, start: InitialState
) -> tuple[Hypothesis, list[Hypothesis]] | None:
    """Return the constants that a problem shows to be wrong, and their rivals; None without."""
    constants = search.constants(problem, start, search.requested_model)
    suspected = None if constants is None else constants.strongest()
    if constants is None or suspected is None or suspected.wide_evidence < STRONG:
        return None
    return suspected, constants.rivals(suspected)
