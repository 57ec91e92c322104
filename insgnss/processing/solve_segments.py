"""Each segment of a flight, solved: prepare -> align -> filter -> smooth.

A flight is one segment unless its IMU has gaps longer than `prepare.gaps` bridges; then each
segment is solved on its own.
"""

from collections.abc import Callable, Iterable
from dataclasses import dataclass, replace

import numpy as np

from ..align.initial import given_attitude, initial_state
from ..base.errors import DataError
from ..config.flight_file import Flight
from ..diagnosis.candidates import with_layout
from ..diagnosis.code_errors import code_errors, code_message
from ..diagnosis.decision import ErrorModelSearch, diagnose, explain_failure, rescue
from ..diagnosis.drift import hidden_drift
from ..diagnosis.incorrect_fixes import (
    Spell,
    incorrect_check,
    undecided_spells,
    with_steps,
    withhold_incorrect_fixes,
)
from ..diagnosis.sensitivity import Sensitivity
from ..diagnosis.time_offset import ROUNDS, offset_to_apply
from ..diagnosis.turn_on_bias import check_biases_in_innovations, with_turn_on, without_turn_on
from ..geodesy.frames import LocalFrame
from ..navigation.codes import COVARIANCE_RESET, NAV, POSITION
from ..navigation.filter import gate_from_sigma
from ..navigation.problem import EstimationProblem, InitialState
from ..navigation.solution import Solution, solve
from ..prepare import gaps
from ..prepare.clock import SHORTEST_S, common_span
from ..records import Check
from ..records.verdicts import ConstantEstimate
from .checks import check_segments, refusal
from .estimation_problem import (
    PreparedSegment,
    forecast_of,
    layout_factory,
    prepare_segment,
    refuse_beyond_memory,
    stated_constants,
)
from .progress import Progress
from .recording import Recording
from .segment import Segment

OPEN_GATE_SIGMA = 30.0  # where nothing else has a solution
OPEN_CLOCK_RATE = 5e-4  # of a logger that counts its own milliseconds


@dataclass(frozen=True)
class PreparedFlight:
    """The segments of a flight, ready to be solved.

    Parameters
    ----------
    frame : LocalFrame
        The local frame of the flight.
    spans : tuple of tuple of float
        First and last instant of each segment, s.
    segments : tuple of PreparedSegment or DataError
        Each of them, or why it cannot be prepared.
    """

    frame: LocalFrame
    spans: tuple[tuple[float, float], ...]
    segments: tuple[PreparedSegment | DataError, ...]


def prepare_segments(flight: Flight, recording: Recording) -> PreparedFlight:
    """Pose the estimation problems of all segments; the samples are not needed afterwards.

    Parameters
    ----------
    flight : Flight
        The flight file.
    recording : Recording
        The recording.

    Returns
    -------
    PreparedFlight
        The segments between gaps that are not bridged.

    Raises
    ------
    InputError, DataError
        Where IMU and GNSS do not overlap, or memory does not hold the flight.
    """
    fixes = recording.gnss
    lo, hi = common_span(recording.imu, fixes, flight.start_tow, flight.end_tow)
    first = int(np.searchsorted(fixes.time, lo))
    frame = LocalFrame(*(float(x[first]) for x in (fixes.lat, fixes.lon, fixes.height)))
    refuse_beyond_memory(forecast_of(flight, recording, lo, hi))
    spans = gaps.segments(recording.imu.time, lo, hi)
    segments: list[PreparedSegment | DataError] = []
    for span in spans:
        try:
            _refuse_short(recording, span)
            segments.append(prepare_segment(flight, recording, span, frame))
        except DataError as error:
            segments.append(error)
    return PreparedFlight(frame, tuple(spans), tuple(segments))


def solve_segments(
    flight: Flight, recording: Recording, step: Progress, prepared: PreparedFlight | None = None
) -> tuple[list[Segment], list[Check]]:
    """Solve every segment of a flight that can be solved.

    Parameters
    ----------
    flight : Flight
        The flight file.
    recording : Recording
        The recording.
    step : Progress
        Receives the name of each step.
    prepared : PreparedFlight, optional
        Its segments; without it they are prepared here. With it the recording may be one
        `without_samples` where no time offset is estimated.

    Returns
    -------
    tuple of list of Segment and list of Check
        The solved segments, and, where the IMU has gaps, the check that says what became of the
        rest.

    Raises
    ------
    InputError, DataError
        As `solve_segment` does; where no segment can be solved, the error of the longest.
    """
    if prepared is None:
        step("prepare")
        prepared = prepare_segments(flight, recording)
    spans, frame = prepared.spans, prepared.frame
    solved: list[Segment] = []
    failures: list[tuple[tuple[float, float], DataError]] = []
    for span, segment in zip(spans, prepared.segments, strict=True):
        # a given attitude is that of the flight's first fix
        own = flight if span == spans[0] else replace(flight, initial=None)
        if isinstance(segment, DataError):
            failures.append((span, segment))
            continue
        try:
            solved.append(solve_segment(own, recording, segment, span, frame, step))
        except DataError as error:
            failures.append((span, error))
    if not solved:
        longest = max(failures, key=lambda failure: failure[0][1] - failure[0][0])[1]
        raise DataError(f"{longest}{_noted(recording.checks)}")
    return solved, [check_segments([s.solution.time for s in solved], failures)] if len(
        spans
    ) > 1 else []


def _noted(checks: Iterable[Check]) -> str:
    """What the checks of a recording found odd, to be said beside its failure.

    What recognises units and axes by the motion says nothing more where there is none.
    """
    odd = [
        f"{check.name}: {check.found}"
        for check in checks
        if check.verdict != "ok" and not check.name.startswith("recognised")
    ]
    return f"; noted before: {'; '.join(odd)}" if odd else ""


def solve_segment(
    flight: Flight,
    recording: Recording,
    prepared: PreparedSegment,
    span: tuple[float, float],
    frame: LocalFrame,
    step: Progress,
) -> Segment:
    """Solve one segment, from its estimation problem to the smoothed states.

    A large estimated time offset goes into the stamps of the fixes, and of camera events of their
    clock, and the segment is solved again.

    Parameters
    ----------
    flight : Flight
        The flight file.
    recording : Recording
        The recording.
    prepared : PreparedSegment
        The segment.
    span : (float, float)
        First and last instant of the segment, s.
    frame : LocalFrame
        The local frame of the flight.
    step : Progress
        Receives the name of each step.

    Returns
    -------
    Segment
        The solved segment.

    Raises
    ------
    InputError, DataError
        Where the data contradict themselves or do not support the answer.
    """
    moved_s, solved = 0.0, _solve(flight, recording, prepared, step)
    # an offset that nobody asked for is a contradiction, and not taken in silence
    for _ in range(ROUNDS if flight.filter.time_offset else 0):
        offset = offset_to_apply(solved.solution)
        if offset == 0.0:
            break
        moved_s += offset
        step(f"the fixes moved by {moved_s:+.4f} s")
        step("prepare")
        moved = recording.moved(moved_s)
        prepared = replace(prepare_segment(flight, moved, span, frame), moved_s=moved_s)
        solved = _solve(flight, moved, prepared, step)
    return solved


def _search(
    flight: Flight, recording: Recording, prepared: PreparedSegment, step: Progress
) -> ErrorModelSearch:
    """Return what the search for the error model of a segment may vary."""
    return ErrorModelSearch(
        prepared.requested_errors,
        prepared.layout_factory,
        flight.mounting,
        flight.gnss.gm_sigma == "auto",
        flight.filter.second_pass,
        step,
        _requested(flight),
        flight.filter.adaptive_noise == "auto",
        recording.of_receiver,
        recording.events is not None,
    )


def _solve(
    flight: Flight, recording: Recording, prepared: PreparedSegment, step: Progress
) -> Segment:
    """Align, filter and smooth a segment, and look for its error model."""
    search = _search(flight, recording, prepared, step)
    step("align")
    spells: tuple[Spell, ...] = ()
    noisy: tuple[Check, ...] = ()
    followed = None
    try:
        start, how = _align(flight, prepared.problem, prepared.moved_s)
        if search.time_correlated:
            prepared, start, of_code = _with_code_errors(prepared, start, step)
            search = replace(
                search,
                requested_errors=prepared.requested_errors,
                time_correlated=of_code is None,
            )
            how = how if of_code is None else f"{how}; {of_code}"
        if flight.gnss.stationary is None:
            followed = search.followed(prepared.problem)
        prepared, spells, solution = _filtered(flight, prepared, start, step, followed)
    except DataError as error:
        step("what would explain it")
        _refuse_what_explains(flight, recording, prepared, search, error)
        step("once more with an open gate")
        opened = _with_open_gate(flight, prepared, step)
        if opened is not None:
            prepared, start, how, solution = opened
        else:
            step("other errors of the IMU, or larger noise")
            rescued = _rescued(flight, prepared, search)
            if rescued is None:
                raise
            start, how, solution, noisy = rescued
    biases = _missing_biases(flight, recording, prepared, solution, step)
    if biases is not None and biases.name not in flight.accept:
        remark = f'; accept = ["{biases.name}"] in the flight file overrules'
        raise refusal(flight, biases, remark)
    checks = () if biases is None else (biases,)
    history: tuple[str, ...] = (how,)
    checks = (*checks, *noisy)
    constants: tuple[ConstantEstimate, ...] = ()
    if flight.gnss.stationary is None and not noisy:
        diagnosis = diagnose(search, start, solution, followed)
        drift = hidden_drift(solution, diagnosis.solution, diagnosis.checks)
        solution, constants = diagnosis.solution, diagnosis.constants
        checks, history = (*checks, *diagnosis.checks), (*history, *diagnosis.history)
        checks = checks if drift is None else (*checks, drift)
    if spells:
        checks = (*checks, incorrect_check(solution.problem, spells, True))
    if priced := undecided_spells(solution):
        solution = with_steps(solution, priced)
        checks = (*checks, incorrect_check(solution.problem, tuple(priced), False))
    return Segment(
        solution,
        prepared.fixes,
        prepared.grid,
        prepared.at_event,
        prepared.exposed,
        history,
        checks,
        time_offset_s=prepared.moved_s,
        stated=stated_constants(flight),
        requested=_requested(flight),
        constants=constants,
    )


def _with_open_gate(
    flight: Flight, prepared: PreparedSegment, step: Progress
) -> tuple[PreparedSegment, InitialState, str, Solution] | None:
    """Solve with an open gate first, and close it about that solution.

    A start that is far off, or an estimated offset of many times what a fix claims, has the gate
    reject what would put it right. None where the closed gate rejects it still.
    """
    errors = prepared.requested_errors
    if errors.clock_rate is not None:
        errors = replace(errors, clock_rate=OPEN_CLOCK_RATE)
    layout = prepared.layout_factory(errors)
    gate = prepared.problem.gate
    open_gate = replace(prepared.problem, layout=layout, gate=gate_from_sigma(OPEN_GATE_SIGMA))
    try:
        start, how = _align(flight, open_gate, prepared.moved_s)
        first = solve(open_gate, start, flight.filter.second_pass, step, separations=0)
        gated = replace(open_gate, gate=gate)
        solution = solve(gated, start, flight.filter.second_pass, step, about=first)
    except DataError:
        return None
    prepared = replace(prepared, problem=gated, requested_errors=errors)
    how = f"{how}; solved with an open gate first, which was closed about that solution"
    return prepared, start, how, solution


def _rescued(
    flight: Flight, prepared: PreparedSegment, search: ErrorModelSearch
) -> tuple[InitialState, str, Solution, tuple[Check, ...]] | None:
    """Solve with other errors of the IMU or larger noise, where that follows the fixes."""
    try:
        open_gate = replace(prepared.problem, gate=np.inf)
        start, how = _align(flight, open_gate, prepared.moved_s)
    except DataError:
        return None
    rescued = rescue(search, prepared.problem, start)
    if rescued is None:
        return None
    solution, checks = rescued
    how = "; ".join((how, *(f"{check.name}: {check.found}" for check in checks)))
    return start, how, solution, checks


def _with_code_errors(
    prepared: PreparedSegment, start: InitialState, step: Progress
) -> tuple[PreparedSegment, InitialState, str | None]:
    """Give code solutions the errors that the data show, and say which."""
    factory, requested = prepared.layout_factory, prepared.requested_errors
    errors = code_errors(prepared.problem, start, factory, requested, step)
    if errors is None:
        return prepared, start, None
    problem, start = with_layout(prepared.problem, start, factory(errors))
    prepared = replace(prepared, problem=problem, requested_errors=errors)
    return prepared, start, code_message(errors)


def _filtered(
    flight: Flight,
    prepared: PreparedSegment,
    start: InitialState,
    step: Progress,
    followed: Sensitivity | None,
) -> tuple[PreparedSegment, tuple[Spell, ...], Solution]:
    """Filter and smooth a segment, without the fixes of spells that stand apart from the rest."""
    failure, second_pass = None, flight.filter.second_pass
    try:
        follower = None if followed is None else followed.through
        solution = solve(prepared.problem, start, second_pass, step, follower=follower)
        if not np.any(solution.verdict[:, POSITION] == COVARIANCE_RESET):
            return prepared, (), solution
    except DataError as error:
        failure = error
    step("which fixes stand apart")
    problem, spells = withhold_incorrect_fixes(prepared.problem, start)
    if spells:
        try:
            again = solve(problem, start, second_pass, step)
            return replace(prepared, problem=problem), spells, again
        except DataError:
            pass
    if failure is not None:
        raise failure
    return prepared, (), solution


def _requested(flight: Flight) -> tuple[str, ...]:
    """Return the beginnings of the names of constants that the flight file has estimated."""
    options = flight.filter
    lever_arm = ("antenna lever arm",) if options.lever_arm else ()
    return lever_arm + (("GNSS time offset", "GNSS clock rate") if options.time_offset else ())


def _align(flight: Flight, problem: EstimationProblem, moved_s: float) -> tuple[InitialState, str]:
    """Return the initial state of a problem, and how it was found.

    The prior of a time offset belongs to the stamps of the file, before they were moved.
    """
    if flight.initial is not None:
        given = flight.initial
        rpy = np.radians([given.roll_deg, given.pitch_deg, given.heading_deg])
        start = given_attitude(problem, rpy, np.radians(given.sigma_deg))
        start = _expecting(start, problem.layout.offset, -moved_s)
        return start, "initial attitude from the flight file"
    alignment = initial_state(problem)
    first, last = alignment.window
    sigma = np.degrees(alignment.heading_sigma)
    return (
        _expecting(alignment.start, problem.layout.offset, -moved_s),
        (
            f"initial attitude from the motion between {first:.1f} and {last:.1f} s (heading to "
            f"{sigma:.2f} deg there), filtered back to the first fix"
        ),
    )


def _expecting(start: InitialState, offset_state: int, offset_s: float) -> InitialState:
    """Return a start that expects a time offset, s, where that is a state."""
    if offset_state < 0:
        return start
    mean = start.mean.copy()
    mean[NAV.stop + offset_state] += offset_s
    return replace(start, mean=mean)


def _aligned_by(flight: Flight, moved_s: float) -> Callable[[EstimationProblem], InitialState]:
    """Return what gives the initial state of a problem of this flight, its fixes moved."""
    return lambda problem: _align(flight, problem, moved_s)[0]


def _refuse_what_explains(
    flight: Flight,
    recording: Recording,
    prepared: PreparedSegment,
    search: ErrorModelSearch,
    error: DataError,
) -> None:
    """Raise InputError with the cause of `error`, where the flight shows one."""
    biases = _missing_biases(flight, recording, prepared, None, search.progress)
    if biases is not None:
        raise refusal(flight, biases) from None
    align = _aligned_by(flight, prepared.moved_s)
    cause = explain_failure(search, prepared.problem, align)
    if cause is not None:
        raise refusal(flight, cause, f"; as the flight file is, {error}") from None


def _missing_biases(
    flight: Flight,
    recording: Recording,
    prepared: PreparedSegment,
    solution: Solution | None,
    step: Progress,
) -> Check | None:
    """Check whether the innovations show the turn-on biases that the noise model lacks."""
    noise = recording.noise
    if not without_turn_on(noise):
        return None
    step("turn-on biases, which the noise model lacks")
    layout = layout_factory(flight, with_turn_on(noise))(prepared.requested_errors)
    problem = replace(prepared.problem, layout=layout)
    align, second_pass = _aligned_by(flight, prepared.moved_s), flight.filter.second_pass
    return check_biases_in_innovations(
        noise, solution, lambda: solve(problem, align(problem), second_pass, separations=0)
    )


def _refuse_short(recording: Recording, span: tuple[float, float]) -> None:
    """Raise DataError where a segment holds too few fixes."""
    time = recording.gnss.time[(recording.gnss.time >= span[0]) & (recording.gnss.time <= span[1])]
    length = float(time[-1] - time[0]) if time.size else 0.0
    if time.size < 2 or length < SHORTEST_S:
        raise DataError(
            f"{time.size} fixes over {length:.1f} s, limit {SHORTEST_S:.0f} s; see gaps"
            " and clocks of both sensors with `insgnss inspect`, or record longer without gaps"
        )
