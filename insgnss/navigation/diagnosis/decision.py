"""The decision: which error model is adopted; what it says of the flight file stands in `advice`.

`diagnose` looks at a solution, `explain_failure` at a problem that has none.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import Literal

import numpy as np

from ...base.beside import Beside
from ...base.errors import DataError
from ...records import Finding
from ...records.cameras.mounting import Mounting
from ...records.verdicts import Estimate
from ..filter.codes import COVARIANCE_RESET, NOT_MEASURED, POSITION
from ..filter.layout import FixErrors, StateLayout
from ..filter.problem import EstimationProblem, InitialState
from ..filter.solution import Solution, solve
from .advice import LEVER_ARM, OFFSET, RATE, advice, message, unseen, variance_check
from .candidates import (
    AS_STATED,
    FAR,
    ErrorModel,
    LayoutFactory,
    guesses,
    widened,
    with_constants,
    with_every_constant,
    with_larger_white_share,
    with_layout,
    with_time_correlated_error,
)
from .clock_step import find_clock_step, step_check
from .constants import (
    OF_FIXES,
    STRONG,
    ConstantsEvidence,
    Hypothesis,
    constants_evidence,
    followed_constants,
    settled_evidence,
)
from .estimated import constant
from .evidence import (
    GAIN,
    follows,
    liveliest_window,
    loses_fixes,
    minus_two_log_likelihood,
    misfit,
)
from .sensitivity import Sensitivity
from .time_correlated import time_correlated_error
from .variances import FAMILIES, LEAST_PROMISE, OF_IMU, VarianceSearch, with_variances

FEWEST_FIXES = 60  # below which the innovations are not looked at
OF_CLOCK = (OFFSET, RATE)  # groups that a step of a clock is taken for
ROUNDS = 3  # of winners that are adopted one after the other
CORRELATED_PARAMETERS = 4  # white and correlated share, correlation time, ratio of heights
SLOW_PARAMETERS = 1  # correlation time
# of its log evidence, that a remedy gains in `misfit` at least, but for what each group that is
# left open costs it: twice the logarithm of what the flight reduces its sigma by
EXPLAINED, OPEN = 0.25, 5.0
# shares of the gain of a time-correlated error: of one that loses no fixes, and of one that does
LEAST_OF_GAIN, MOST_OF_GAIN = 0.5, 0.9
TRIES = 6  # of a time-correlated error, each with a larger white share than the one before

SecondPass = Literal["auto", "on", "off"]
Posed = tuple[EstimationProblem, InitialState]


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
        Of the adopted solution, as `navigation.filter.solution.solve` takes it.
    progress : callable
        Receives the name of each step.
    variances : bool
        Whether variances compete; `tune` estimates them by itself.
    requested : tuple of str
        Beginnings of the names of constants that the flight file has estimated; they are not
        suspected.
    events_with_fixes : bool
        Whether the clock of the fixes stamps the exposures.
    exposures : bool
        Whether there are any, whose place depends on that of the IMU in the mounting.
    """

    requested_errors: FixErrors
    layout_factory: LayoutFactory
    mounting: Mounting
    time_correlated: bool
    second_pass: SecondPass
    progress: Callable[[str], None]
    requested: tuple[str, ...] = ()
    variances: bool = True
    events_with_fixes: bool = False
    exposures: bool = False

    @property
    def exact(self) -> tuple[str, ...]:
        """Beginnings of the names of constants that the flight file states as exact."""
        of_arm = self.mounting.antenna_sigma_m == 0.0 and LEVER_ARM not in self.requested
        return (LEVER_ARM,) if of_arm else ()

    def layout(self, model: ErrorModel) -> StateLayout:
        """Return the error states of an error model."""
        return self.layout_factory(model.fixes, model.imu)

    def constants(
        self, problem: EstimationProblem, start: InitialState, model: ErrorModel
    ) -> ConstantsEvidence | None:
        """Return what a flight says of its constants under an error model."""
        wide = self.layout(with_every_constant(model))
        own = self.layout(model)
        return constants_evidence(problem, start, own, wide, self.requested, self.exact)

    def followed(self, problem: EstimationProblem) -> Sensitivity | None:
        """Return what is to go along with the first pass over a flight.

        What it finds of the constants may spare the pass of `constants`; None where there are too
        few fixes for it, or where they cannot be followed.
        """
        if np.count_nonzero(problem.epochs.has_position) < FEWEST_FIXES:
            return None
        wide = self.layout(with_every_constant(ErrorModel(self.requested_errors)))
        return followed_constants(problem, wide)

    def of_fixes(self, model: ErrorModel) -> LayoutFactory:
        """Return the error states as a function of those of the fixes, with the model's IMU."""
        return lambda fixes: self.layout_factory(fixes, model.imu)


@dataclass(frozen=True)
class Diagnosis:
    """The outcome of a search.

    Parameters
    ----------
    solution : Solution
        The solution to go on with.
    checks : tuple of Finding
        What it says of the flight file.
    history : tuple of str
        What was done, sentence by sentence.
    constants : tuple of Estimate
        What the flight alone says of the constants of its fixes.
    """

    solution: Solution
    checks: tuple[Finding, ...] = ()
    history: tuple[str, ...] = ()
    constants: tuple[Estimate, ...] = ()


def diagnose(
    search: ErrorModelSearch,
    start: InitialState,
    solution: Solution,
    followed: Sensitivity | None = None,
) -> Diagnosis:
    """Look for the error model that explains the innovations of a solution.

    Constants (`constants`), variances (`variances`) and a time-correlated error of the fixes
    (`time_correlated`) compete by the logarithm of their evidence. The winner is adopted, the
    flight is solved again with it, and what is left is judged again, until nothing gains. A
    constant or a variance that leaves more to be explained than it explains is not adopted.

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
    if np.count_nonzero(solution.verdict[:, POSITION] != NOT_MEASURED) < FEWEST_FIXES:
        return Diagnosis(solution)
    posed = solution.problem, start
    here = _State(solution, ErrorModel(search.requested_errors))
    constants = None
    for _ in range(ROUNDS):
        search.progress("what the innovations say of the constants")
        settled = settled_evidence(here.solution, followed, search.requested, search.exact)
        constants = settled or search.constants(*posed, here.model) or constants
        there = _next(search, posed, here, constants)
        if there is None:
            break
        here = there
    step = _clock_step(search, posed, here)
    if step is not None:  # what was adopted instead is no finding of its own
        return Diagnosis(here.solution, (step,), here.history)
    if constants is None:
        return Diagnosis(here.solution, here.checks, here.history)
    middle_s = 0.5 * float(posed[0].epochs.time[-1])
    seen = unseen(here.solution, constants, search.events_with_fixes)
    checks = (*here.checks, *([seen] if seen else []))
    return Diagnosis(here.solution, checks, here.history, constants.estimates(middle_s))


@dataclass(frozen=True)
class _State:
    """Where the search stands: what is adopted, what it says, and what has been tried in vain."""

    solution: Solution
    model: ErrorModel
    checks: tuple[Finding, ...] = ()
    history: tuple[str, ...] = ()
    attempted: frozenset[str] = frozenset()


Candidate = tuple[float, Callable[[], _State | None]]
"""Log evidence, and what adopts it; None where the flight has no solution with it."""


def _clock_step(search: ErrorModelSearch, posed: Posed, here: _State) -> Finding | None:
    """Say that a clock steps, where an offset or a rate of it was adopted or is requested.

    So may what reset the covariance: fixes that went on elsewhere along the flight.
    """
    of_clock = any(group.startswith(OF_CLOCK) for group in (*here.attempted, *search.requested))
    if not of_clock and _resets(here.solution) == 0:
        return None
    models = dict.fromkeys((ErrorModel(search.requested_errors), here.model))
    steps = (_step_under(search, posed, model, here.solution) for model in models)
    return next((step for step in steps if step is not None), None)


def _step_under(
    search: ErrorModelSearch, posed: Posed, model: ErrorModel, against: Solution | None
) -> Finding | None:
    """Say that a clock steps, if that explains more under an error model than another solution."""
    layout = search.layout(with_constants(model, OF_CLOCK[:1], FAR))
    step = find_clock_step(*posed, layout, against, search.second_pass, search.progress)
    return None if step is None else step_check(step)


def _next(
    search: ErrorModelSearch, posed: Posed, here: _State, constants: ConstantsEvidence | None
) -> _State | None:
    """Return the state after the winner has been adopted; None where nothing gains."""
    suspected = None if constants is None else constants.strongest()
    correlates = search.time_correlated and "time-correlated" not in here.attempted
    suspicious = _looked_at(search, here) if correlates else None
    variances = VarianceSearch(here.solution, search.progress)
    promising = search.variances and bool(variances.promising())
    remedied = None
    if (
        constants is not None
        and suspected is not None
        and not here.attempted & set(suspected.groups)
    ):
        remedied = _with_constants(search, posed, here, constants, suspected)
        after = promising and remedied is not None
        left = _left(search, remedied.solution, OF_IMU) if after and remedied else 0.0
        if left > suspected.evidence:
            remedied = None  # a remedy that leaves more than it explains is none
        elif left < LEAST_PROMISE and remedied is not None:
            return _as_allowed(here, remedied, constants, suspected)
    candidates = [_variance(search, posed, here, variances)] if promising else []
    if suspicious is not None:
        candidates.append(_time_correlated(search, posed, here, variances, suspicious))
    if constants is not None and suspected is not None and remedied is not None:
        allowed = _as_allowed(here, remedied, constants, suspected)
        candidates.append((suspected.evidence, lambda: allowed))
    ranked = sorted(filter(None, candidates), key=lambda one: -one[0])
    return next((state for _, adopt in ranked if (state := adopt()) is not None), None)


def _with_constants(
    search: ErrorModelSearch,
    posed: Posed,
    here: _State,
    constants: ConstantsEvidence,
    suspected: Hypothesis,
) -> _State | None:
    """Adopt suspected constants as states; None where the flight has no solution with them."""
    search.progress(f"filter, with {', '.join(suspected.groups)} estimated")
    rivals = constants.rivals(suspected)
    groups = _together(suspected, rivals)
    model = with_constants(here.model, groups, suspected.factor)
    solution = _solved(search, posed, model)
    if solution is None or _resets(solution) >= _resets(here.solution) > 0:
        return None  # what lost the fixes is no constant
    gain = misfit(here.solution) - misfit(solution) + OPEN * len(groups)
    if gain < EXPLAINED * suspected.evidence:
        return None  # the wide pass lost its way, in an outage say: the remedy explains less
    solved = _as_solved(suspected, solution)
    checks = advice(search.mounting, solution, solved, rivals, search.exposures)
    sentence = f"estimated, log evidence {suspected.evidence:.0f}: {', '.join(suspected.groups)}"
    attempted = here.attempted | set(suspected.groups)
    return _State(solution, model, (*here.checks, *checks), (*here.history, sentence), attempted)


def _as_allowed(
    here: _State, remedied: _State, constants: ConstantsEvidence, suspected: Hypothesis
) -> _State:
    """Return a remedied state, or what it says alone where it estimates what is stated as exact."""
    if not constants.denied(suspected):
        return remedied
    names = [group for group in suspected.groups if group.startswith(constants.exact)]
    sentence = (
        f"stated as exact and not estimated, log evidence {suspected.evidence:.0f}:"
        f" {', '.join(names)}"
    )
    new = remedied.checks[len(here.checks) :]
    checks = (*here.checks, *(check for check in new if check.name.startswith(constants.exact)))
    history = (*here.history, sentence)
    return replace(here, checks=checks, history=history, attempted=remedied.attempted)


def _variance(
    search: ErrorModelSearch, posed: Posed, here: _State, variances: VarianceSearch
) -> Candidate | None:
    """Return the strongest family of variances; None where there is none."""
    winner = variances.strongest()
    if winner is None or winner.family in here.attempted:
        return None
    model = with_variances(here.model, winner)
    if model is None:
        return None

    def adopt() -> _State | None:
        search.progress(f"filter, with larger {winner.family}")
        solution = _solved(search, posed, model)
        if solution is None or _left(search, solution) > winner.evidence:
            return None
        check = variance_check(winner)
        history = (*here.history, f"{check.name}: {check.found}")
        attempted = here.attempted | {winner.family}
        return _State(solution, model, (*here.checks, check), history, attempted)

    return winner.evidence, adopt


def _looked_at(search: ErrorModelSearch, here: _State) -> "Beside[bool]":
    """Begin to look whether the innovations are coloured, beside the search for variances."""
    fixes, layout_factory = here.model.fixes, search.of_fixes(here.model)
    return Beside(lambda: is_suspicious(here.solution, layout_factory, fixes))


def _time_correlated(
    search: ErrorModelSearch,
    posed: Posed,
    here: _State,
    variances: VarianceSearch,
    suspicious: "Beside[bool]",
) -> Candidate | None:
    """Return the time-correlated GNSS error; None where the innovations show none."""
    fixes = here.model.fixes
    if fixes.gm_sigma is not None:
        return None
    if not suspicious.result():
        # what larger noise of the IMU leaves is no error of the fixes
        imu = here.model.imu
        alone = (imu.white_noise, imu.driving_noise) == (
            AS_STATED.white_noise,
            AS_STATED.driving_noise,
        )
        slow = variances.slow_error(search.of_fixes(here.model), fixes) if alone else None
        if slow is None:
            return None
        model = replace(here.model, fixes=slow)
        evidence = variances.evidence_of(search.layout(model), SLOW_PARAMETERS)
        return max(evidence, 0.0), lambda: _adopted(search, posed, here, model)
    search.progress("the innovations are not white: errors of the fixes")
    errors = time_correlated_error(here.solution, search.of_fixes(here.model), fixes)
    if errors is None:
        return None
    model = replace(here.model, fixes=errors)
    evidence = variances.evidence_of(search.layout(model), CORRELATED_PARAMETERS)
    return max(evidence, 0.0), lambda: _adopted(search, posed, here, model)


def _solved(search: ErrorModelSearch, posed: Posed, model: ErrorModel) -> Solution | None:
    """Solve again with another error model; None where there is no solution."""
    again = widened(*with_layout(*posed, search.layout(model)), posed[0].layout)
    try:
        return solve(*again, search.second_pass, search.progress)
    except DataError:
        return None


def is_suspicious(solution: Solution, layout_factory: LayoutFactory, errors: FixErrors) -> bool:
    """Tell whether a time-correlated GNSS error explains the liveliest window better.

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
        Whether it gains `evidence.GAIN` in (C.1); never where one is estimated already.
    """
    if errors.gm_sigma is not None:
        return False
    problem, start = liveliest_window(solution)
    candidates = [errors]
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
) -> Finding | None:
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
    Finding or None
        What contradicts the flight file; None where nothing explains the failure.
    """
    search.progress("what the fixes say with an open gate")
    open_gate = replace(problem, gate=np.inf)
    try:
        start = align(open_gate)
    except DataError:
        return None
    shown = _shown_by(search, open_gate, start)
    if shown is None:
        return None
    suspected, rivals = shown
    quiet = replace(search, second_pass="off", progress=lambda _: None)
    model = ErrorModel(search.requested_errors)
    model = with_constants(model, suspected.groups, suspected.factor)
    candidate = _solved(quiet, (problem, start), model)
    if candidate is not None and not follows(candidate):
        candidate = None
    if any(group.startswith(OF_CLOCK) for group in suspected.groups):
        own = ErrorModel(search.requested_errors)
        step = _step_under(search, (problem, start), own, candidate)
        if step is not None:
            return step
    if candidate is None:
        return None
    solved = _as_solved(suspected, candidate)
    checks = advice(search.mounting, candidate, solved, rivals, search.exposures)
    return next((check for check in checks if check.verdict == "contradiction"), None)


def rescue(
    search: ErrorModelSearch, problem: EstimationProblem, start: InitialState
) -> tuple[Solution, tuple[Finding, ...]] | None:
    """Look for the error of the IMU with which a flight has a solution that has none without.

    Scale factors and misalignments are tried first, where the evidence is for them; larger noise,
    which would take them for vibration, after.

    Parameters
    ----------
    search : ErrorModelSearch
        What the search may vary.
    problem, start : EstimationProblem, InitialState
        The problem that has no solution with the requested errors, and its initial state.

    Returns
    -------
    tuple of Solution and tuple of Finding, or None
        The solution with these states or larger variances, and what says so; None where neither is
        a remedy.
    """
    calibrated = _with_errors_of_imu(search, problem, start)
    if calibrated is not None or not search.variances:
        return calibrated
    model = ErrorModel(search.requested_errors)
    try:
        shown = solve(replace(problem, gate=np.inf), start, "off", search.progress, separations=0)
        for _ in range(ROUNDS):
            winner = VarianceSearch(shown, search.progress).strongest()
            larger = None if winner is None else with_variances(model, winner)
            if winner is None or larger is None:
                return None
            model, check = larger, variance_check(winner)
            solution = _solved(search, (problem, start), model)
            if solution is not None and follows(solution):
                return solution, (check,)
            again = widened(*with_layout(problem, start, search.layout(model)), problem.layout)
            shown = solve(replace(again[0], gate=np.inf), again[1], "off", search.progress, 0)
    except DataError:
        return None
    return None


def _with_errors_of_imu(
    search: ErrorModelSearch, problem: EstimationProblem, start: InitialState
) -> tuple[Solution, tuple[Finding, ...]] | None:
    """Solve with the scale factors or misalignments that an open gate shows; None without."""
    open_gate = replace(problem, gate=np.inf)
    shown = _shown_by(search, open_gate, start)
    if shown is None or any(group.startswith(OF_FIXES) for group in shown[0].groups):
        return None
    suspected, rivals = shown
    model = with_constants(ErrorModel(search.requested_errors), _together(suspected, rivals))
    search.progress(f"filter, with {', '.join(suspected.groups)} estimated")
    posed = widened(*with_layout(open_gate, start, search.layout(model)), problem.layout)
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
    constants = search.constants(problem, start, ErrorModel(search.requested_errors))
    suspected = None if constants is None else constants.strongest()
    if constants is None or suspected is None or suspected.wide_evidence < STRONG:
        return None
    return suspected, constants.rivals(suspected)


def _together(suspected: Hypothesis, rivals: Sequence[Hypothesis]) -> tuple[str, ...]:
    """Return the groups of a hypothesis and of what the flight does not tell from it.

    They are estimated together, and so in the covariance.
    """
    return tuple(dict.fromkeys(g for one in (suspected, *rivals) for g in one.groups))


def _left(
    search: ErrorModelSearch, solution: Solution, families: Sequence[str] = tuple(FAMILIES)
) -> float:
    """Return what other variances still promise to explain of a solution's innovations."""
    return VarianceSearch(solution, search.progress).left(families)


def _resets(solution: Solution) -> int:
    """Return how often the covariance was reset after rejected fixes."""
    return int(np.count_nonzero(solution.verdict[:, POSITION] == COVARIANCE_RESET))


def _as_solved(suspected: Hypothesis, solution: Solution) -> Hypothesis:
    """Return a hypothesis with the values of the solution where they are far from the flight file.

    The evidence is linear in them, and an error of metres is not.
    """
    if suspected.factor == 1.0:
        return suspected
    names = solution.problem.layout.names
    pairs = np.array([constant(solution, names.index(name)) for name in suspected.names])
    return replace(suspected, value=pairs[:, 0], sigma=pairs[:, 1])


def _adopted(search: ErrorModelSearch, posed: Posed, here: _State, model: ErrorModel) -> _State:
    """Solve again with a time-correlated GNSS error.

    As long as that loses fixes, it is tried with a larger white share. Where the one that loses
    none has less than half of the gain in `misfit`, which charges each lost fix, what is lost are
    jumps of the fixes themselves: then the largest share is taken that keeps most of the gain.
    """
    before, attempted = misfit(here.solution), here.attempted | {"time-correlated"}
    most, keeps_most, adopted = 0.0, None, None
    for _ in range(TRIES):
        search.progress("filter, with a time-correlated GNSS error")
        again = _solved(search, posed, model)
        if again is not None:
            gain = before - misfit(again)
            if follows(again) and gain > 0.0 and gain >= MOST_OF_GAIN * most:
                most, keeps_most = max(most, gain), (model, again)
            if not loses_fixes(again, here.solution):
                adopted = (model, again) if gain >= LEAST_OF_GAIN * most else keeps_most
                break
        model = replace(model, fixes=with_larger_white_share(model.fixes))
    else:
        sentence = f"{message(model.fixes)}; given up, the filter loses fixes with it"
        return replace(here, history=(*here.history, sentence), attempted=attempted)
    if adopted is None:
        sentence = f"{message(model.fixes)}; given up, it explains the whole flight no better"
        return replace(here, history=(*here.history, sentence), attempted=attempted)
    history = (*here.history, message(adopted[0].fixes))
    return _State(adopted[1], adopted[0], here.checks, history, attempted)
