"""The remedies for a segment, in their order: what is tried where its models do not hold.

A `Case` is a segment on its way to a solution. Each of `REMEDIES` has a condition, an action that
returns the case after it, and a sentence for the history; whoever solves segments walks the list.
Remedies that need another problem take the alignment from the search: this room does not align.

One remedy needs the recording, and so is left to the caller. As a state the time offset d moves a
fix by v d; what that leaves out is a d^2 / 2. An offset beyond `LARGE_S` is therefore taken into
the stamps (`offset_to_apply`), and the rest is estimated again.
"""

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from ...base.errors import DataError
from ...records import Finding
from ...records.verdicts import Estimate
from ..filter.filter import gate_from_sigma
from ..filter.layout import FixErrors
from ..filter.problem import EstimationProblem, InitialState
from ..filter.solution import Solution, solve
from ..innovations.incorrect_values import (
    contradicting_sensor,
    suspicious,
    withhold_incorrect_values,
)
from ..noise_model.model import NoiseModel
from .candidates import ErrorModel, LayoutFactory, with_layout
from .constants import STRONG
from .decision import diagnose, step_under
from .drift import hidden_drift
from .estimated import constant, fix_counts
from .evidence import (
    ErrorModelSearch,
    check_biases_in_innovations,
    follows,
    with_turn_on,
    without_turn_on,
)
from .failure import explain_failure, rescue
from .incorrect_fixes import (
    AS_FLOAT,
    ENLARGED,
    LEFT_OUT,
    FloatSpells,
    float_spells,
    incorrect_check,
    undecided_spells,
    with_steps,
    withhold_incorrect_fixes,
)
from .sensitivity import Sensitivity
from .sensor_dynamics import OpenedFlight, opened_flight, without_gate
from .time_correlated import code_errors, code_message

OPEN_GATE_SIGMA = 30.0  # where nothing else has a solution
OPEN_CLOCK_RATE = 5e-4  # of a logger that counts its own milliseconds
MOST_MOVES = 4  # solutions again with moved stamps, at most
CERTAIN_OFFSET_SIGMAS = 2.0  # sigmas of the offset
# in -2 log L, that a spell of float fixes costs: its onset, time and the components of its step
OF_SPELL = 30.0
LARGE_S = 0.005  # s, of an offset: below it the neglected a d^2 / 2 is under 0.1 mm


@dataclass(frozen=True)
class Case:
    """A segment on its way to a solution.

    Parameters
    ----------
    problem : EstimationProblem
        The problem as the remedies so far have left it.
    errors : FixErrors
        The errors of the fixes that are states of the problem.
    search : ErrorModelSearch
        What the search for an error model may vary.
    noise : NoiseModel
        The noise model of the samples.
    layout_under : callable
        Gives the layout factory of the flight under another noise model.
    accept : tuple of str
        Names of contradictions that the flight file accepts.
    moving : bool
        Whether the IMU moves; the constants of one that stands at a known place are not searched.
    start : InitialState or None
        The initial state; None where there is none, or before it is found.
    how : str
        How the solution was found, in words.
    solution : Solution or None
        The solution; None before there is one.
    failure : DataError or None
        Why there is none.
    refused : tuple, or None
        A contradiction that ends the run, the remark that follows it, and the checks to accept.
    followed : Sensitivity or None
        What went along with the first filter pass.
    other_model : bool
        Whether a remedy changed the error model; no other one is searched then.
    checks : tuple of Finding
        What the solution says of the flight file.
    history : tuple of str
        What was done after the solution, sentence by sentence.
    constants : tuple of Estimate
        What the segment alone says of the constants of its fixes.
    opened : OpenedFlight or None
        What it says where every fix is used; None before that is needed.
    """

    problem: EstimationProblem
    errors: FixErrors
    search: ErrorModelSearch
    noise: NoiseModel
    layout_under: Callable[[NoiseModel], LayoutFactory]
    accept: tuple[str, ...] = ()
    moving: bool = True
    start: InitialState | None = None
    how: str = ""
    solution: Solution | None = None
    failure: DataError | None = None
    refused: tuple[Finding, str, tuple[str, ...]] | None = None
    followed: Sensitivity | None = None
    other_model: bool = False
    checks: tuple[Finding, ...] = ()
    history: tuple[str, ...] = ()
    constants: tuple[Estimate, ...] = ()
    opened: OpenedFlight | None = None

    @property
    def failed(self) -> bool:
        """Whether alignment or filter found no solution, and no remedy so far."""
        return self.failure is not None

    @property
    def loses_fixes(self) -> bool:
        """Whether the filter has no solution, or its covariance was reset after rejected fixes."""
        if self.solution is None:
            return self.start is not None
        return fix_counts(self.solution.verdict)[2] > 0


@dataclass(frozen=True)
class Remedy:
    """One entry of `REMEDIES`.

    Parameters
    ----------
    name : str
        What it takes for the cause.
    condition : callable
        Whether a case calls for it.
    action : callable
        Returns the case with it; None where it is no remedy.
    sentence : callable
        What the history says of the case with it; "" for nothing.
    """

    name: str
    condition: Callable[[Case], bool]
    action: Callable[[Case], Case | None]
    sentence: Callable[[Case], str] = lambda _: ""

    def applied(self, case: Case) -> Case:
        """Return the case after this remedy; the case itself where it is none.

        Parameters
        ----------
        case : Case
            The segment before.

        Returns
        -------
        Case
            The segment after.
        """
        remedied = self.action(case) if self.condition(case) else None
        if remedied is None:
            return case
        sentence = self.sentence(remedied)
        return replace(remedied, how=f"{remedied.how}; {sentence}") if sentence else remedied


def offset_to_apply(solution: Solution) -> float:
    """Return the estimated time offset of the fixes where it is too large to be left to the state.

    Parameters
    ----------
    solution : Solution
        The solved flight.

    Returns
    -------
    float
        What is to be added to the stamps, s; zero where the offset is not estimated, smaller than
        `LARGE_S` or than `CERTAIN_OFFSET_SIGMAS` of its sigmas.
    """
    state = solution.problem.layout.offset
    if state < 0:
        return 0.0
    offset, sigma = constant(solution, state)
    return offset if abs(offset) > max(LARGE_S, CERTAIN_OFFSET_SIGMAS * sigma) else 0.0


def _with_code_errors(case: Case) -> Case | None:
    """Give code solutions the errors that the data show."""
    search, start = case.search, case.start
    assert start is not None
    try:
        errors = code_errors(
            case.problem, start, search.layout_factory, case.errors, search.progress
        )
    except DataError as error:
        return replace(case, start=None, failure=error)
    if errors is None:
        return None
    problem, start = with_layout(case.problem, start, search.layout_factory(errors))
    search = replace(search, requested_errors=errors, time_correlated=False)
    return replace(case, problem=problem, start=start, errors=errors, search=search)


def _filter_case(case: Case) -> Case:
    """Filter and smooth with what is followed beside the first pass."""
    search, start = case.search, case.start
    assert start is not None
    followed = search.followed(case.problem) if case.moving else None
    follower = None if followed is None else followed.through
    case = replace(case, followed=followed)
    try:
        solution = solve(
            case.problem, start, search.second_pass, search.progress, follower=follower
        )
    except DataError as error:
        return replace(case, failure=error)
    return replace(case, solution=solution)


def _with_late_sensor(case: Case) -> Case | None:
    """Correct a sensor that follows the motion late, or worse in turns, and so loses the fixes.

    Constants and clocks must lose over the same fixes, with an open gate.
    """
    search, start = case.search, case.start
    assert start is not None
    opened = opened_flight(search, (case.problem, start))
    if opened is None:
        return None
    case = replace(case, opened=opened)
    least = max(STRONG, 0.5 * (opened.misfit - opened.of_constants))
    for trial in opened.beyond(least):
        corrected = replace(trial.posed[0], gate=case.problem.gate)
        problem = replace(corrected, huber_threshold=case.problem.huber_threshold)
        try:
            solution = solve(
                problem, start, search.second_pass, search.progress, about=trial.solution
            )
        except DataError:
            return case
        if follows(solution) and not fix_counts(solution.verdict)[2]:
            case = replace(case, problem=problem, solution=solution, failure=None)
            return replace(case, checks=(*case.checks, trial.check()))
    return case


def _without_incorrect_fixes(case: Case) -> Case | None:
    """Withhold the fixes of spells that stand apart from the rest, or take them as float ones."""
    search, start, done = case.search, case.start, LEFT_OUT
    assert start is not None
    search.progress("which fixes stand apart")
    problem, spells = withhold_incorrect_fixes(case.problem, start)
    floating = None if spells else float_spells(problem, start, search.layout_factory, case.errors)
    errors = case.errors
    if floating is not None and not _rival_explains(case, floating):
        problem, start, errors, spells = floating
        search, done = replace(search, requested_errors=errors), AS_FLOAT
    # a step whose level nothing tells is carried by the covariance, and not left out
    elif not spells and not (case.solution and undecided_spells(case.solution)):
        problem, spells = withhold_incorrect_fixes(problem, start, closing=False)
    if not spells:
        return None
    try:
        solution = solve(problem, start, search.second_pass, search.progress)
    except DataError:
        return None
    note = incorrect_check(problem, spells, done)
    case = replace(case, problem=problem, errors=errors, search=search, start=start)
    return replace(case, solution=solution, failure=None, checks=(*case.checks, note))


def _rival_explains(case: Case, floating: FloatSpells) -> bool:
    """Tell whether constants, a clock or a late sensor explain steps better than float fixes.

    All are compared over the same fixes, with an open gate.
    """
    search, start = case.search, case.start
    assert start is not None
    problem, start_of_float, errors, spells = floating
    of_float = without_gate(problem), start_of_float
    least = search.misfit_of(of_float, ErrorModel(errors)) + OF_SPELL * len(spells)
    opened = case.opened or opened_flight(search, (case.problem, start))
    if opened is None or opened.of_constants < least:
        return True
    try:
        as_float = solve(problem, start_of_float, "off", search.progress)
    except DataError:
        return True
    posed, model = (case.problem, start), search.requested_model
    if step_under(search, posed, model, as_float) is not None:
        return True
    return bool(opened.beyond(0.5 * (opened.misfit - least)))


def _without_incorrect_values(case: Case) -> Case | None:
    """Leave out values of further sensors that stand apart from the flight without them."""
    search, start, solution = case.search, case.start, case.solution
    assert start is not None
    assert solution is not None
    if not suspicious(solution):
        return None
    search.progress("which values of further sensors stand apart")
    bare = solution.problem.without_measurements
    try:
        alone = solve(bare, start, "off", separations=0, about=solution)
        if case.moving:
            alone = diagnose(case.search, start, alone).solution
        result = withhold_incorrect_values(
            solution,
            alone,
            lambda problem: solve(problem, start, search.second_pass, about=solution),
        )
    except DataError:
        return None
    if result is None:
        return None
    solution, finding = result
    if finding.verdict == "contradiction" and finding.name not in case.accept:
        return replace(case, refused=(finding, "", (finding.name,)))
    checks = (*case.checks, finding)
    return replace(case, problem=solution.problem, solution=solution, checks=checks)


def _explain_failure(case: Case) -> Case | None:
    """Refuse a failure whose cause the flight shows: a constant of the flight file."""
    case.search.progress("what would explain it")
    if case.problem.measurements and (wrong := _wrong_sensor(case)) is not None:
        return replace(case, refused=(wrong, "", ()))
    if without_turn_on(case.noise) and (biases := _biases(case)) is not None:
        return replace(case, refused=(biases, "", ()))
    cause = explain_failure(case.search, case.problem)
    if cause is None:
        return None
    return replace(case, refused=(cause, f"; as stated, {case.failure}", ()))


def _wrong_sensor(case: Case) -> Finding | None:
    """Return which further sensor a failure is due to, where the flight is solved without them."""
    if case.start is None:
        return None
    try:
        alone = solve(case.problem.without_measurements, case.start, separations=0)
    except DataError:
        return None
    return contradicting_sensor(case.problem, alone)


def _with_open_gate(case: Case) -> Case | None:
    """Solve with an open gate first, and close it about that solution.

    A start that is far off, or an estimated offset of many times what a fix claims, has the gate
    reject what would put it right. None where the closed gate rejects it still.
    """
    search, errors, gate = case.search, case.errors, case.problem.gate
    search.progress("once more with an open gate")
    if errors.clock_rate is not None:
        errors = replace(errors, clock_rate=OPEN_CLOCK_RATE)
    layout = search.layout_factory(errors)
    open_gate = replace(case.problem, layout=layout, gate=gate_from_sigma(OPEN_GATE_SIGMA))
    gated = replace(open_gate, gate=gate)
    try:
        start, how = case.search.align(open_gate)
        first = solve(open_gate, start, search.second_pass, search.progress, separations=0)
        solution = solve(gated, start, search.second_pass, search.progress, about=first)
    except DataError:
        return None
    case = replace(case, problem=gated, errors=errors, failure=None)
    return replace(case, start=start, how=how, solution=solution)


def _with_other_model(case: Case) -> Case | None:
    """Solve with another error model of the sensors, where that follows the fixes."""
    case.search.progress("another error model of IMU or fixes")
    try:
        start, how = case.search.align(replace(case.problem, gate=np.inf))
    except DataError:
        return None
    rescued = rescue(case.search, case.problem, start)
    if rescued is None:
        return None
    case = replace(case, failure=None, checks=rescued.checks, other_model=True)
    how = "; ".join((how, *rescued.history))
    return replace(case, start=start, how=how, solution=rescued.solution)


def _biases(case: Case) -> Finding | None:
    """Check whether the innovations show the turn-on biases that the noise model lacks."""
    search = case.search
    search.progress("turn-on biases, which the noise model lacks")
    layout = case.layout_under(with_turn_on(case.noise))(case.errors)
    problem = replace(case.problem, layout=layout)
    return check_biases_in_innovations(
        case.noise,
        case.solution,
        lambda: solve(problem, case.search.align(problem)[0], search.second_pass, separations=0),
    )


def _with_missing_biases(case: Case) -> Case | None:
    """Refuse a noise model that lacks the turn-on biases, unless the flight file accepts it."""
    biases = _biases(case)
    if biases is None:
        return None
    if biases.name not in case.accept:
        return replace(case, refused=(biases, "", (biases.name,)))
    return replace(case, checks=(biases, *case.checks))


def _with_error_model(case: Case) -> Case:
    """Go on with the error model that explains the innovations."""
    before, start = case.solution, case.start
    assert before is not None
    assert start is not None
    diagnosis = diagnose(case.search, start, before, case.followed)
    drift = hidden_drift(before, diagnosis.solution, diagnosis.checks)
    return replace(
        case,
        solution=diagnosis.solution,
        checks=(*case.checks, *diagnosis.checks, *([] if drift is None else [drift])),
        history=diagnosis.history,
        constants=diagnosis.constants,
    )


def _with_undecided_steps(case: Case) -> Case:
    """Enlarge the covariance where nothing tells which of two levels of the fixes is right."""
    solution, notes = case.solution, list[Finding]()
    assert solution is not None
    if undecided := undecided_spells(solution):
        solution = with_steps(solution, undecided)
        notes.append(incorrect_check(solution.problem, tuple(undecided), ENLARGED))
    return replace(case, solution=solution, checks=(*case.checks, *notes))


REMEDIES: tuple[Remedy, ...] = (
    Remedy(
        "errors of code solutions",
        lambda case: not case.failed and case.search.time_correlated,
        _with_code_errors,
        lambda case: "" if case.failed else code_message(case.errors),
    ),
    # no remedy itself: the one above changes what is filtered, those below look at the outcome
    Remedy("filter and smooth", lambda case: not case.failed, _filter_case),
    Remedy(
        "a sensor that follows the motion late",
        lambda case: case.loses_fixes and case.moving,
        _with_late_sensor,
    ),
    Remedy("incorrect fixes", lambda case: case.loses_fixes, _without_incorrect_fixes),
    Remedy(
        "incorrect values of further sensors",
        lambda case: not case.failed and bool(case.problem.measurements),
        _without_incorrect_values,
    ),
    Remedy("a wrong constant, which is refused", lambda case: case.failed, _explain_failure),
    Remedy(
        "a gate too narrow for the start",
        lambda case: case.failed,
        _with_open_gate,
        lambda _: "solved first without an innovation gate, then with the gate about that solution",
    ),
    Remedy("another error model, against failure", lambda case: case.failed, _with_other_model),
    Remedy(
        "turn-on biases that the noise model lacks",
        lambda case: not case.failed and bool(without_turn_on(case.noise)),
        _with_missing_biases,
    ),
    Remedy(
        "another error model",
        lambda case: not case.failed and case.moving and not case.other_model,
        _with_error_model,
    ),
    Remedy("steps of the fixes", lambda case: not case.failed, _with_undecided_steps),
)
"""In order. The first that refuses a contradiction ends the walk; a case that has failed after the
last has no solution.
"""
