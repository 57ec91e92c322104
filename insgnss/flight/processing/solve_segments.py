"""Each segment of a flight, solved: prepare -> align -> filter -> smooth.

A flight is one segment unless its IMU has gaps longer than `navigation.prepare.gaps` bridges; then
each segment is solved on its own.
"""

from collections.abc import Iterable
from dataclasses import dataclass, replace

import numpy as np

from ...base.errors import DataError
from ...base.units import ARCSEC
from ...geodesy.frames import LocalFrame
from ...navigation.align.initial import given_attitude, initial_state
from ...navigation.align.measured import measured_attitude
from ...navigation.diagnosis.evidence import ErrorModelSearch, FixClaims
from ...navigation.diagnosis.remedies import MOST_MOVES, REMEDIES, Case, offset_to_apply
from ...navigation.filter.codes import NAV, PSI
from ...navigation.filter.problem import EstimationProblem, InitialState
from ...navigation.filter.smoother import SharedError
from ...navigation.filter.solution import Solution
from ...navigation.prepare.clock import SHORTEST_OVERLAP_S, common_span
from ...navigation.prepare.fix_covariance.numbers import claimed_scale
from ...navigation.recognise.claims import RECOGNISED
from ...records import Finding
from ...records.states import CLOCK_RATE, LEVER_ARM, TIME_OFFSET
from ..config.flight_file import Flight
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
    xi, eta = (ARCSEC * component for component in flight.gnss.deflection_arcsec)
    origin = (float(x[first]) for x in (fixes.lat, fixes.lon, fixes.height))
    frame = LocalFrame(*origin, deflection=(xi, eta))
    refuse_beyond_memory(forecast_of(flight, recording, lo, hi))
    spans = recording.prepared.segments(lo, hi)
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
) -> tuple[list[Segment], list[Finding]]:
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
    tuple of list of Segment and list of Finding
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
        of_span = flight if span == spans[0] else replace(flight, initial=None)
        if isinstance(segment, DataError):
            failures.append((span, segment))
            continue
        try:
            solved.append(solve_segment(of_span, recording, segment, span, frame, step))
        except DataError as error:
            failures.append((span, error))
    if not solved:
        longest = max(failures, key=lambda failure: failure[0][1] - failure[0][0])[1]
        raise DataError(f"{longest}{_odd_checks(recording.checks)}")
    return solved, [check_segments([s.solution.time for s in solved], failures)] if len(
        spans
    ) > 1 else []


def _odd_checks(checks: Iterable[Finding]) -> str:
    """What the checks of a recording found odd, to be said beside its failure.

    What recognises units and axes by the motion says nothing more where there is none.
    """
    notes = [
        f"{check.name}: {check.found}"
        for check in checks
        if check.verdict != "ok" and check.name not in RECOGNISED
    ]
    return f"; noted before: {'; '.join(notes)}" if notes else ""


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
    for _ in range(MOST_MOVES if flight.filter.time_offset else 0):
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
    assumed = prepared.fixes.sigma_assumed
    of_flight_file = assumed is not None and bool(assumed.all())
    return ErrorModelSearch(
        prepared.requested_errors,
        prepared.layout_factory,
        flight.mounting,
        flight.gnss.gm_sigma == "auto",
        flight.filter.second_pass,
        step,
        lambda problem: align(flight, problem, prepared.moved_s),
        _requested_groups(flight),
        flight.filter.adaptive_noise == "auto",
        recording.of_receiver,
        recording.events is not None,
        claims=FixClaims(
            claimed_scale("" if of_flight_file else prepared.fixes.source_format),
            flight.gnss.sigma_m if of_flight_file else None,
            flight.gnss.white_scale,
        ),
        drafted=recording.noise.drafted,
    )


def _solve(
    flight: Flight, recording: Recording, prepared: PreparedSegment, step: Progress
) -> Segment:
    """Align a segment, and walk the remedies, of which the filter is one entry."""
    case = Case(
        prepared.problem,
        prepared.requested_errors,
        _search(flight, recording, prepared, step),
        recording.noise,
        lambda noise: layout_factory(flight, noise, recording.measurements),
        tuple(flight.accept),
        moving=flight.gnss.stationary is None,
    )
    step("align")
    try:
        start, how = case.search.align(case.problem)
        case = replace(case, start=start, how=how)
    except DataError as error:
        case = replace(case, failure=error)
    for remedy in REMEDIES:
        case = remedy.applied(case)
        if case.refused is not None:
            raise refusal(flight, *case.refused)
    if case.solution is None:
        assert case.failure is not None
        raise case.failure
    return Segment(
        case.solution.enlarged(_plumb_line(flight, case.solution)),
        prepared.fixes,
        prepared.grid,
        prepared.at_event,
        prepared.exposed,
        (case.how, *case.history),
        case.checks,
        time_offset_s=prepared.moved_s,
        stated=stated_constants(flight),
        requested=_requested_groups(flight),
        constants=case.constants,
    )


def _plumb_line(flight: Flight, solution: Solution) -> tuple[SharedError, ...]:
    """Return what a deflection of the vertical that is not stated makes of all attitudes.

    To the IMU it is a level that leans: psi north and east take it over one to one (0.99 on a
    simulated flight; turns alone tell it from a tilt).
    """
    sigma = ARCSEC * flight.gnss.deflection_sigma_arcsec
    if sigma == 0.0:
        return ()
    cov = sigma**2 * np.diag([1.0, 1.0, 0.0])
    return (SharedError(0, solution.time.size - 1, cov, PSI),)


def _requested_groups(flight: Flight) -> tuple[str, ...]:
    """Return the groups of constants that the flight file has estimated."""
    options = flight.filter
    lever_arm = (LEVER_ARM,) if options.lever_arm else ()
    return lever_arm + ((TIME_OFFSET.group, CLOCK_RATE.group) if options.time_offset else ())


def align(
    flight: Flight, problem: EstimationProblem, moved_s: float = 0.0
) -> tuple[InitialState, str]:
    """Return the initial state of a problem, and how it was found.

    The prior of a time offset belongs to the stamps of the file, before they were moved.
    Measurements given by their prediction, which are linearised about a solution, have a say where
    the motion gives no attitude.

    Parameters
    ----------
    flight : Flight
        The flight file, which may have [initial].
    problem : EstimationProblem
        The problem.
    moved_s : float
        By how much its stamps were moved, s.

    Returns
    -------
    tuple of InitialState and str
        State and covariance at the first epoch, and the sentence of the history.

    Raises
    ------
    DataError
        Where the data do not give an attitude.
    """
    every, problem = problem, problem.without_measurements
    if flight.initial is not None:
        initial = flight.initial
        rpy = np.radians([initial.roll_deg, initial.pitch_deg, initial.heading_deg])
        start = given_attitude(problem, rpy, np.radians(initial.sigma_deg))
        start = _expecting(start, problem.layout.offset, -moved_s)
        return start, "initial attitude from the flight file"
    try:
        alignment = initial_state(problem)
    except DataError:
        measured = measured_attitude(every) if every.measurements else None
        if measured is None:
            raise
        return _expecting(measured[0], problem.layout.offset, -moved_s), measured[1]
    first, last = alignment.window
    sigma = np.degrees(alignment.heading_sigma)
    return (
        _expecting(alignment.start, problem.layout.offset, -moved_s),
        (
            f"initial attitude from the motion between {first:.1f} and {last:.1f} s (heading "
            f"sigma {sigma:.2f} deg), filtered back to the first fix"
        ),
    )


def _expecting(start: InitialState, offset_state: int, offset_s: float) -> InitialState:
    """Return a start that expects a time offset, s, where that is a state."""
    if offset_state < 0:
        return start
    mean = start.mean.copy()
    mean[NAV.stop + offset_state] += offset_s
    return replace(start, mean=mean)


def _refuse_short(recording: Recording, span: tuple[float, float]) -> None:
    """Raise DataError where a segment holds too few fixes."""
    time = recording.gnss.time[(recording.gnss.time >= span[0]) & (recording.gnss.time <= span[1])]
    length = float(time[-1] - time[0]) if time.size else 0.0
    if time.size < 2 or length < SHORTEST_OVERLAP_S:
        raise DataError(
            f"only {time.size} fixes over {length:.1f} s (limit {SHORTEST_OVERLAP_S:.0f} s); "
            "check gaps and clocks with `insgnss inspect`, or record longer without gaps"
        )
