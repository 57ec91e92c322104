"""What becomes of a flight that has no solution: its cause in the flight file, or in the IMU."""

from dataclasses import replace

import numpy as np

from ...base.errors import DataError
from ...records import Finding
from ...records.states import OF_FIXES
from ..filter.problem import EstimationProblem, InitialState
from ..filter.solution import Solution, solve
from .advice import advice, variance_check
from .candidates import widened, with_constants
from .constants import STRONG, Hypothesis
from .decision import OF_CLOCK, ROUNDS, as_solved, step_under, together
from .drift import bias_step_candidate, courses_beside, least_misfit, slow_bias_candidate
from .evidence import ErrorModelSearch, follows
from .variances import VarianceSearch, with_variances


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
    Check or None
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
    if _biases_step(search, problem, start, suspected.evidence):
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


def _biases_step(
    search: ErrorModelSearch, problem: EstimationProblem, start: InitialState, evidence: float
) -> bool:
    """Return whether a step of the biases gives a solution, and has more evidence."""
    try:
        shown = solve(replace(problem, gate=np.inf), start, "off", search.progress)
    except DataError:
        return False
    step = bias_step_candidate(search, search.requested_model, (problem, start), shown)
    if step is None or step.evidence <= evidence:
        return False
    stepped = step.solved(search)
    return stepped is not None and follows(stepped[0])


def rescue(
    search: ErrorModelSearch, problem: EstimationProblem, start: InitialState
) -> tuple[Solution, tuple[Finding, ...]] | None:
    """Look for the error of the IMU with which a flight has a solution that has none without.

    Scale factors and misalignments are tried first, where the evidence is for them; slow biases and
    larger noise, which would take them for vibration, after.

    Parameters
    ----------
    search : ErrorModelSearch
        What the search may vary.
    problem, start : EstimationProblem, InitialState
        The problem that has no solution with the requested errors, and its initial state.

    Returns
    -------
    tuple of Solution and tuple of Check, or None
        The solution with these states or larger variances, and what says so; None where neither is
        a remedy.
    """
    calibrated = _with_errors_of_imu(search, problem, start)
    if calibrated is not None or not search.variances:
        return calibrated
    model = search.requested_model
    try:
        shown = solve(replace(problem, gate=np.inf), start, "off", search.progress)
        for _ in range(ROUNDS):
            variances = VarianceSearch(shown, search.progress)
            winner = variances.strongest()
            slow = slow_bias_candidate(search, model, problem, variances)
            step = bias_step_candidate(search, model, (problem, start), shown)
            stronger = [
                one
                for one in (slow, step)
                if one is not None and (winner is None or one.evidence > winner.evidence)
            ]
            if step is not None and slow is None:
                stronger += courses_beside(search, model, problem, step)
            explained = least_misfit(search, stronger)
            if explained is not None and follows(explained[2]):
                return explained[2], (explained[0].check(explained[2]),)
            larger = None if winner is None else with_variances(model, winner, search.drafted)
            if winner is None or larger is None:
                return None
            model, check = larger, variance_check(winner, search.claims, search.drafted)
            solution = search.solved((problem, start), model)
            if solution is not None and follows(solution):
                return solution, (check,)
            problem_again, start_again = widened(problem, start, search.layout(model))
            opened = replace(problem_again, gate=np.inf)
            shown = solve(opened, start_again, "off", search.progress)
    except DataError:
        return None
    return None


def _with_errors_of_imu(
    search: ErrorModelSearch, problem: EstimationProblem, start: InitialState
) -> tuple[Solution, tuple[Finding, ...]] | None:
    """Solve with the scale factors or misalignments that an open gate shows; None without."""
    open_gate = replace(problem, gate=np.inf)
    shown = _shown_by(search, open_gate, start)
    if shown is None or not set(OF_FIXES).isdisjoint(shown[0].groups):
        return None
    suspected, rivals = shown
    model = with_constants(search.requested_model, together(suspected, rivals))
    search.progress(f"filter, with {', '.join(map(str, suspected.groups))} estimated")
    posed = widened(open_gate, start, search.layout(model))
    try:
        first = solve(*posed, search.second_pass, search.progress, separations=0)
        gated = replace(posed[0], gate=problem.gate)
        solution = solve(gated, posed[1], search.second_pass, search.progress, about=first)
    except DataError:
        return None
    if not follows(solution):
        return None
    return solution, tuple(advice(search.mounting, solution, suspected, rivals))


def _shown_by(
    search: ErrorModelSearch, problem: EstimationProblem, start: InitialState
) -> tuple[Hypothesis, list[Hypothesis]] | None:
    """Return the constants that a problem shows to be wrong, and their rivals; None without."""
    constants = search.constants(problem, start, search.requested_model)
    suspected = None if constants is None else constants.strongest()
    if constants is None or suspected is None or suspected.wide_evidence < STRONG:
        return None
    return suspected, constants.rivals(suspected)
