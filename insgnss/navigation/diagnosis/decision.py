"""The decision: which error model is adopted; what it says of the flight file stands in `advice`.

`diagnose` looks at a solution; a problem that has none is looked at in `failure`.
"""

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, replace

from ...base.beside import Beside
from ...records import Finding
from ...records.states import CLOCK_RATE, OF_LEVER_ARM, TIME_OFFSET, State
from ...records.verdicts import Estimate
from ..filter.layout import SLOW_STATE
from ..filter.problem import InitialState
from ..filter.smoother import SharedError
from ..filter.solution import Solution
from ..innovations.withheld import predicts
from .advice import (
    advice,
    as_solved,
    message,
    swing_check,
    together,
    unseen_constants,
    variance_check,
)
from .candidates import FAR_FACTOR, ErrorModel, with_constants, with_larger_white_share
from .clock_step import find_clock_step, step_check
from .constants import (
    OTHERS,
    ConstantsEvidence,
    Hypothesis,
    settled_evidence,
)
from .drift import (
    BIAS_STEP,
    SlowBiasCandidate,
    bias_step_candidate,
    courses_beside,
    least_misfit,
    slow_bias_candidate,
)
from .estimated import constant, fix_counts, missing_rate
from .evidence import (
    FEWEST_FIXES,
    ErrorModelSearch,
    Posed,
    follows,
    loses_fixes,
    misfit,
)
from .sensitivity import Sensitivity
from .sensor_dynamics import (
    DYNAMICS,
    DynamicsTrial,
    arm_has_moved,
    lag_beside_arm,
    late_sensors,
)
from .time_correlated import is_suspicious, time_correlated_error
from .variances import BIAS_NOISE, LEAST_PROMISE, OF_IMU, VarianceSearch, with_variances

OF_CLOCK = (TIME_OFFSET, CLOCK_RATE)  # constants that a step of a clock is taken for
LATE_SENSORS = tuple(one.name for one in DYNAMICS)  # and so are delays of a sensor
BESIDE_ARM = "lag beside the lever arm"
# attempted: then no lag is looked for in what the state of the lever arm has taken
AS_ARM = (*OF_LEVER_ARM, BESIDE_ARM, *(one.name for one in DYNAMICS if one.of_motion))
BESIDE_OFFSET = "rate beside the time offset"
ROUNDS = 3  # of winners that are adopted one after the other
CORRELATED_PARAMETERS = 4  # white and correlated share, correlation time, ratio of heights
SLOW_PARAMETERS = 1  # correlation time
# of its log evidence, that a remedy gains in `misfit` at least, but for what each group that is
# left open costs it: twice the logarithm of what the flight reduces its sigma by
EXPLAINED_SHARE, OPEN = 0.25, 5.0
# shares of the gain of a time-correlated error: of one that loses no fixes, and of one that does
LEAST_OF_GAIN, MOST_OF_GAIN = 0.5, 0.9
TRIES = 6  # of a time-correlated error, each with a larger white share than the one before


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
    if fix_counts(solution.verdict)[0] < FEWEST_FIXES:
        return Diagnosis(solution)
    posed = solution.problem, start
    state = Stage(solution, search.requested_model)
    constants = None
    for _ in range(ROUNDS):
        search.progress("what the innovations say of the constants")
        settled = settled_evidence(state.solution, followed, search.requested, search.exact)
        constants = settled or search.constants(*posed, state.model) or constants
        following = next_state(search, posed, state, constants)
        if following is None:
            break
        state, posed = following, following.posed or posed
    step = _clock_step(search, posed, state)
    if step is not None:  # what was adopted instead is no finding of its own
        return Diagnosis(state.solution, (step,), state.history)
    solution = state.solution.enlarged(state.shared) if state.shared else state.solution
    if constants is None:
        return Diagnosis(solution, state.checks, state.history)
    middle_s = 0.5 * float(posed[0].epochs.time[-1])
    unseen_errors = unseen_constants(state.solution, constants, search.events_with_fixes)
    checks = (*state.checks, *([unseen_errors] if unseen_errors else []))
    return Diagnosis(solution, checks, state.history, constants.estimates(middle_s))


@dataclass(frozen=True)
class Stage:
    """Where the search stands: what is adopted, what it says, and what has been tried in vain.

    `posed` is the problem with another start, where what is adopted has aligned it anew;
    `variances` the search on its solution, where that has been linearised already; `shared` what
    the positions share besides.
    """

    solution: Solution
    model: ErrorModel
    checks: tuple[Finding, ...] = ()
    history: tuple[str, ...] = ()
    attempted: frozenset[State | str] = frozenset()
    posed: Posed | None = None
    variances: VarianceSearch | None = None
    shared: tuple[SharedError, ...] = ()

    def after_trial(
        self,
        names: Iterable[State | str],
        checks: Sequence[Finding] = (),
        sentence: str = "",
        adopted: tuple[Solution, ErrorModel] | None = None,
        posed: Posed | None = None,
        variances: VarianceSearch | None = None,
        shared: tuple[SharedError, ...] = (),
    ) -> "Stage":
        """Return the state after something was tried: what it says, and what is adopted with it."""
        sentence = sentence or "; ".join(f"{check.name}: {check.found}" for check in checks)
        if adopted is None:
            adopted, posed, variances = (self.solution, self.model), self.posed, self.variances
        every, history = (*self.checks, *checks), (*self.history, sentence)
        attempted, every_error = self.attempted | set(names), (*self.shared, *shared)
        return Stage(*adopted, every, history, attempted, posed, variances, every_error)


Candidate = tuple[float, Callable[[], Stage | None]]
"""Log evidence, and what adopts it; None where the flight has no solution with it."""


def _clock_step(search: ErrorModelSearch, posed: Posed, state: Stage) -> Finding | None:
    """Say that a clock steps, where an offset or a rate of it was adopted or is requested.

    So may what reset the covariance: fixes that went on elsewhere along the flight.
    """
    requested = TIME_OFFSET.group in search.requested
    attempted = not state.attempted.isdisjoint((*OF_CLOCK, *LATE_SENSORS))
    if not requested and not attempted and _resets(state.solution) == 0:
        return None
    models = dict.fromkeys((search.requested_model, state.model))
    steps = (step_under(search, posed, model, state.solution) for model in models)
    return next((step for step in steps if step is not None), None)


def step_under(
    search: ErrorModelSearch, posed: Posed, model: ErrorModel, against: Solution | None
) -> Finding | None:
    """Say that a clock steps, if that explains more under an error model than another solution.

    Parameters
    ----------
    search : ErrorModelSearch
        What the search may vary.
    posed : tuple of EstimationProblem and InitialState
        The problem and its initial state.
    model : ErrorModel
        The error model.
    against : Solution or None
        The other solution.

    Returns
    -------
    Finding or None
        None where nothing steps.
    """
    layout = search.layout(with_constants(model, OF_CLOCK[:1], FAR_FACTOR))
    step = find_clock_step(*posed, layout, against, search.second_pass, search.progress)
    return None if step is None else step_check(step)


def next_state(
    search: ErrorModelSearch, posed: Posed, state: Stage, constants: ConstantsEvidence | None
) -> Stage | None:
    """Return the state after the winner has been adopted; None where nothing gains."""
    suspected = None if constants is None else constants.strongest()
    suspicious: Beside[bool] | None = None
    if search.time_correlated and "time-correlated" not in state.attempted:
        fixes, of_fixes = state.model.fixes, search.of_fixes(state.model)
        suspicious = Beside(lambda: is_suspicious(state.solution, of_fixes, fixes))
    variances = state.variances or VarianceSearch(state.solution, search.progress, search.claims)
    promising = search.variances and bool(variances.promising())
    slow = _slow_bias(search, posed, state, variances)
    of_delay: Candidate | None = None
    of_constants: Candidate | None = None
    if constants and suspected and not state.attempted & set(suspected.groups):
        evidence = max(0.0, _of_lost_fixes(search, posed, state, suspected))
        before = state.model, state.solution, state.attempted
        delays = late_sensors(search, posed, *before, evidence - OTHERS)
        delay = next((one for one in delays if one.evidence > evidence + OTHERS), None)
        remedied = None
        if delay is None:
            remedied = _with_constants(search, posed, state, constants, suspected, delays)
        else:
            corrected = _without_delay(state, delay)
            of_delay = delay.evidence, lambda: corrected
        unexplained = 0.0
        if promising and remedied is not None:
            after = VarianceSearch(remedied.solution, search.progress, search.claims)
            unexplained, remedied = after.left(OF_IMU), replace(remedied, variances=after)
        # a remedy that leaves more than it explains is none
        if remedied is not None and unexplained <= suspected.evidence:
            allowed = _as_allowed(state, remedied, constants, suspected)
            if unexplained < LEAST_PROMISE and (slow is None or slow[0] < suspected.evidence):
                return allowed
            of_constants = suspected.evidence, lambda: allowed
    elif state.attempted.isdisjoint(AS_ARM) and arm_has_moved(state.solution):
        of_delay = _beside_arm(search, posed, state)
    elif BESIDE_OFFSET not in state.attempted and (rate := missing_rate(state.solution)):
        of_delay = 0.0, lambda: _beside_offset(search, posed, state, rate)
    variance = _variance(search, posed, state, variances) if promising else None
    candidates = [slow, variance, of_delay]
    if suspicious is not None:
        candidates.append(_time_correlated(search, posed, state, variances, suspicious))
    candidates.append(of_constants)
    ranked = sorted(filter(None, candidates), key=lambda one: -one[0])
    return next((adopted for _, adopt in ranked if (adopted := adopt()) is not None), None)


def _of_lost_fixes(
    search: ErrorModelSearch, posed: Posed, state: Stage, suspected: Hypothesis
) -> float:
    """Return the evidence of a hypothesis; by the misfit, where that has lost fixes, if smaller."""
    if _resets(state.solution) == 0:
        return suspected.evidence
    solution = search.solved(posed, with_constants(state.model, suspected.groups, suspected.factor))
    gain = 0.0 if solution is None else 0.5 * (misfit(state.solution) - misfit(solution))
    return min(suspected.evidence, gain)


def _without_delay(state: Stage, delay: DynamicsTrial) -> Stage:
    """Return the state without the delay of a sensor."""
    adopted, shared = (delay.solution, state.model), (delay.shared_error(state.solution),)
    names, checks = [delay.dynamics.name], [delay.check()]
    return state.after_trial(names, checks, adopted=adopted, posed=delay.posed, shared=shared)


def _beside_arm(search: ErrorModelSearch, posed: Posed, state: Stage) -> Candidate | None:
    """Return a lag of the fixes in place of a lever arm that a state has taken (R.1)."""
    lag = lag_beside_arm(search, posed, state.model, state.solution)
    if lag is None:
        return None
    if lag.evidence > 0.0:
        return lag.evidence, lambda: _without_delay(state, lag)
    shared = (lag.shared_error(state.solution, adopted=False),)
    sentence = f"the covariance allows for a rival of the estimated lever arm: {lag.sentence}"
    return 0.0, lambda: state.after_trial([BESIDE_ARM], sentence=sentence, shared=shared)


def _beside_offset(
    search: ErrorModelSearch, posed: Posed, state: Stage, rate: float
) -> Stage | None:
    """Estimate a rate with a time offset that a state has taken: the mean of a rate is one."""
    model = replace(state.model, fixes=replace(state.model.fixes, clock_rate=rate))
    solution = search.solved(posed, model)
    if solution is None:
        return None
    offset, sigma = constant(state.solution, state.solution.problem.layout.offset)
    sentence = (
        f"the time stamps of the fixes were early by {1e3 * offset:+.1f} +- {1e3 * sigma:.1f} ms, "
        f"which is corrected; a clock rate of {1e6 * rate:.0f} ppm is allowed for as well"
    )
    return state.after_trial([BESIDE_OFFSET], (), sentence, (solution, model))


def _with_constants(
    search: ErrorModelSearch,
    posed: Posed,
    state: Stage,
    constants: ConstantsEvidence,
    suspected: Hypothesis,
    delays: Sequence[DynamicsTrial],
) -> Stage | None:
    """Adopt suspected constants as states; None where the flight has no solution with them."""
    search.progress(f"filter, with {', '.join(map(str, suspected.groups))} estimated")
    rivals = constants.rivals(suspected)
    groups = together(suspected, rivals)
    model = with_constants(state.model, groups, suspected.factor)
    solution = search.solved(posed, model)
    if solution is None or _resets(solution) >= _resets(state.solution) > 0:
        return None  # what lost the fixes is no constant
    families = {one.of_all_axes if one.sensor else one for one in groups}  # rivals open many axes
    gain = misfit(state.solution) - misfit(solution) + OPEN * len(families)
    if gain < EXPLAINED_SHARE * suspected.evidence:
        return None  # the wide pass lost its way, in an outage say: the remedy explains less
    solved = as_solved(suspected, solution)
    sentences = [one.sentence for one in delays]
    checks = advice(search.mounting, solution, solved, rivals, search.exposures, sentences)
    which = ", ".join(map(str, suspected.groups))
    sentence = f"estimated, log evidence {suspected.evidence:.0f}: {which}"
    return state.after_trial(suspected.groups, checks, sentence, (solution, model))


def _as_allowed(
    state: Stage, remedied: Stage, constants: ConstantsEvidence, suspected: Hypothesis
) -> Stage:
    """Return a remedied state, or what it says alone where it estimates what is stated as exact."""
    if not constants.denied(suspected):
        return remedied
    names = [str(one) for one in suspected.groups if one.group in constants.exact]
    sentence = (
        f"stated as exact and not estimated, log evidence {suspected.evidence:.0f}:"
        f" {', '.join(names)}"
    )
    new = remedied.checks[len(state.checks) :]
    checks = [check for check in new if check.name in constants.exact]
    return state.after_trial(suspected.groups, checks, sentence)


def _variance(
    search: ErrorModelSearch, posed: Posed, state: Stage, variances: VarianceSearch
) -> Candidate | None:
    """Return the strongest family of variances; None where there is none."""
    winner = variances.strongest()
    if winner is None or winner.family in state.attempted:
        return None
    if search.time_correlated:  # else the sigmas are taken at their word
        winner = variances.narrowed(winner, search.of_fixes(state.model), state.model.fixes)
    model = with_variances(state.model, winner, search.drafted)
    if model is None:
        return None

    def adopt() -> Stage | None:
        search.progress(f"filter, with other {winner.family}")
        solution = search.solved(posed, model)
        if solution is None:
            return None
        after = VarianceSearch(solution, search.progress, search.claims)
        unpredicted = winner.narrowed and not predicts(solution, search.align)
        if unpredicted or after.left() > winner.evidence:
            return None
        checks, adopted = [variance_check(winner, search.claims, search.drafted)], (solution, model)
        checks += [] if search.drafted else swing_check(winner, model.fixes)
        return state.after_trial([winner.family], checks, adopted=adopted, variances=after)

    return winner.evidence, adopt


def _slow_bias(
    search: ErrorModelSearch, posed: Posed, state: Stage, variances: VarianceSearch
) -> Candidate | None:
    """Return the slow bias of the IMU, or the step of it, that explains more; None without."""
    slow = step = None
    if (
        search.variances
        and SLOW_STATE not in state.attempted
        and BIAS_NOISE in variances.promising()
    ):
        slow = slow_bias_candidate(search, state.model, posed[0], variances)
    if search.variances and BIAS_STEP not in state.attempted:
        step = bias_step_candidate(search, state.model, posed, state.solution)
    suspects = [one for one in (slow, step) if one is not None]
    if not suspects:
        return None

    def adopt() -> Stage | None:
        beside: list[SlowBiasCandidate] = []
        if step is not None and slow is None and SLOW_STATE not in state.attempted:
            beside = courses_beside(search, state.model, posed[0], step)
        explained = least_misfit(search, [*suspects, *beside])
        if explained is None:
            return None
        best, again, solution = explained
        gain = misfit(state.solution) - misfit(solution)
        if gain < EXPLAINED_SHARE * best.evidence:
            return None
        if best in beside:
            best = replace(best, evidence=0.5 * gain)
        adopted = solution, best.model
        return state.after_trial([best.kind], [best.check(solution)], adopted=adopted, posed=again)

    return max(one.evidence for one in suspects), adopt


def _time_correlated(
    search: ErrorModelSearch,
    posed: Posed,
    state: Stage,
    variances: VarianceSearch,
    suspicious: "Beside[bool]",
) -> Candidate | None:
    """Return the time-correlated GNSS error; None where the innovations show none."""
    fixes = state.model.fixes
    if fixes.gm_sigma is not None:
        return None
    if not suspicious.result():
        # what larger noise of the IMU leaves is no error of the fixes
        imu = state.model.imu
        alone = (imu.white_noise, imu.driving_noise) == ((1.0, 1.0), (1.0, 1.0))
        errors = variances.slow_error(search.of_fixes(state.model), fixes) if alone else None
        parameters = SLOW_PARAMETERS
    else:
        search.progress("the innovations are not white: errors of the fixes")
        errors = time_correlated_error(state.solution, search.of_fixes(state.model), fixes)
        errors = errors and variances.averaged(search.of_fixes(state.model), errors)
        parameters = CORRELATED_PARAMETERS
    if errors is None:
        return None
    model = replace(state.model, fixes=errors)
    evidence = variances.evidence_of(search.layout(model), parameters)
    return max(evidence, 0.0), lambda: _adopt_slow_error(search, posed, state, model)


def _resets(solution: Solution) -> int:
    """Return how often the covariance was reset after rejected fixes."""
    return fix_counts(solution.verdict)[2]


def _adopt_slow_error(
    search: ErrorModelSearch, posed: Posed, state: Stage, model: ErrorModel
) -> Stage:
    """Solve again with a time-correlated GNSS error.

    As long as that loses fixes, it is tried with a larger white share. Where the one that loses
    none has less than half of the gain in `misfit`, which charges each lost fix, what is lost are
    jumps of the fixes themselves: then the largest share is taken that keeps most of the gain.
    """
    before, name = misfit(state.solution), "time-correlated"
    most, keeps_most, adopted = 0.0, None, None
    reason = "with this error the filter rejects fixes"
    for _ in range(TRIES):
        search.progress("filter, with a time-correlated GNSS error")
        again = search.solved(posed, model)
        if again is not None:
            gain = before - misfit(again)
            if follows(again) and gain > 0.0 and gain >= MOST_OF_GAIN * most:
                most, keeps_most = max(most, gain), (model, again)
            if not loses_fixes(again, state.solution):
                adopted = (model, again) if gain >= LEAST_OF_GAIN * most else keeps_most
                reason = "this error explains the whole flight no better"
                break
        model = replace(model, fixes=with_larger_white_share(model.fixes))
    if adopted is None:
        sentence = f"{message(model.fixes)}; not adopted, since {reason}"
        return state.after_trial([name], (), sentence)
    model, solution = adopted
    return state.after_trial([name], (), message(model.fixes), (solution, model))
