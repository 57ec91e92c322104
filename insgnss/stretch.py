"""One stretch of a flight, between gaps that are not bridged: prepare -> align -> filter -> smooth, and what the result says of it.

A flight is one stretch unless its IMU has gaps longer than `prepare.gaps` bridges; then each part is a flight of its own.
"""

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from .config.flight_file import Flight
from .errors import DataError, InputError
from .recording import Progress, Recording, check_turn_on, sentence, with_turn_on, without_turn_on
from .records import Check, GnssFixes

if TYPE_CHECKING:
    from .calibrate.fixes import LayoutWith
    from .geodesy.frames import LocalFrame
    from .navigation.filter import Problem, Start
    from .navigation.layout import FixErrors
    from .navigation.solution import Solution

EPOCH_HZ = 10.0  # outputs at a higher rate are recovered between the epochs
SHIFTS, SHIFT_SIGMAS = 4, 2.0
SHIFT_S = 0.005  # a time offset beyond it is taken into the stamps and estimated again: what is left of a d^2 / 2 is below 0.1 mm


@dataclass(frozen=True)
class Stretch:
    """A solved stretch. grid : epochs of the output grid.   at_event : which of the recording's exposures it holds.

    history : what was done, sentence by sentence.   checks : what the solution says of the flight file.
    time_offset_s : by how much the stamps of the fixes were moved before the solution.
    """

    solution: "Solution"
    fixes: GnssFixes
    grid: np.ndarray
    at_event: np.ndarray
    history: tuple[str, ...]
    checks: tuple[Check, ...] = ()
    time_offset_s: float = 0.0


@dataclass(frozen=True)
class _Prepared:
    """A span ready to be solved. asked : errors of the fixes that are states.   make : the layout of states for such errors."""

    problem: "Problem"
    asked: "FixErrors"
    make: "LayoutWith"
    fixes: GnssFixes
    grid: np.ndarray
    at_event: np.ndarray


def solve_stretches(flight: Flight, recording: Recording, step: Progress) -> tuple[list[Stretch], list[Check]]:
    """The stretches of a flight that can be solved, and, where the IMU has gaps, the check that says what became of the others.

    Raises InputError and DataError as `solve_stretch` does; where no stretch can be solved, that of the longest.
    """
    from .geodesy.frames import LocalFrame
    from .prepare.clock import common_span
    from .prepare.gaps import stretches

    lo, hi = common_span(recording.imu, recording.gnss, flight.start_tow, flight.end_tow)
    first = int(np.searchsorted(recording.gnss.time, lo))
    frame = LocalFrame(*(float(x[first]) for x in (recording.gnss.lat, recording.gnss.lon, recording.gnss.height)))
    spans = stretches(recording.imu.time, lo, hi)
    solved: list[Stretch] = []
    failed: list[tuple[tuple[float, float], DataError]] = []
    for span in spans:
        own = flight if span == spans[0] else replace(flight, initial=None)  # a given attitude is that of the flight's first fix
        try:
            _refuse_short(recording, span)
            solved.append(solve_stretch(own, recording, span, frame, step))
        except DataError as error:
            failed.append((span, error))
    if not solved:
        raise max(failed, key=lambda f: f[0][1] - f[0][0])[1]
    return solved, [_check_stretches(solved, failed)] if len(spans) > 1 else []


def solve_stretch(flight: Flight, recording: Recording, span: tuple[float, float], frame: "LocalFrame", step: Progress) -> Stretch:
    """Everything from the recording to the smoothed states within `span` (first and last instant, s).

    Raises InputError and DataError where the data contradict themselves or do not support the answer.
    """
    shift, solved = 0.0, _solve(flight, recording, span, frame, step, 0.0)
    for _ in range(SHIFTS):
        late = _late(solved.solution)
        if late == 0.0:
            break
        shift += late
        step(f"the fixes moved by {shift:+.4f} s")
        moved = replace(recording, gnss=replace(recording.gnss, time=recording.gnss.time + shift))
        solved = replace(_solve(flight, moved, span, frame, step, -shift), time_offset_s=shift)
    return solved


def _late(solution: "Solution") -> float:
    """Estimated time offset of the fixes where it is told and too large to be left to the state, else 0."""
    offset = solution.problem.layout.offset
    if offset < 0:
        return 0.0
    late, sigma = float(solution.x[-1, offset]), float(np.sqrt(solution.P[-1, 9 + offset, 9 + offset]))
    return late if abs(late) > max(SHIFT_S, SHIFT_SIGMAS * sigma) else 0.0


def _solve(
    flight: Flight, recording: Recording, span: tuple[float, float], frame: "LocalFrame", step: Progress, expected_offset: float
) -> Stretch:
    from .navigation.solution import solve

    step("prepare")
    prepared = _prepare(flight, recording, span, frame)
    step("align")
    try:
        start, how = _align(flight, prepared.problem)
        layout = prepared.problem.layout
        if layout.offset >= 0:  # the prior belongs to the offset of the file's stamps, before they were moved
            mean = start.mean.copy()
            mean[9 + layout.offset] += expected_offset
            start = replace(start, mean=mean)
        solution = solve(prepared.problem, start, flight.filter.second_pass, step)
    except DataError as error:
        step("what would explain it")
        if biased := _biased(flight, recording, prepared, None, step):
            raise InputError(f"{flight.path}: {sentence(biased[0])}") from None
        _explain(flight, prepared, error)
        raise
    biased = _biased(flight, recording, prepared, solution, step)
    if biased and biased[0].name not in flight.accept:
        raise InputError(f'{flight.path}: {sentence(biased[0])}; accept = ["{biased[0].name}"] in the flight file overrules')
    solution, checks, said = _examined(flight, prepared, start, solution, step)
    return Stretch(solution, prepared.fixes, prepared.grid, prepared.at_event, (how, *said), (*biased, *checks))


def _prepare(flight: Flight, recording: Recording, span: tuple[float, float], frame: "LocalFrame") -> _Prepared:
    """The estimation problem of a span, the fixes and exposures in it, and the epochs of the output grid."""
    from .navigation.filter import Problem, at_rest, gate_from_sigma, make_epochs, on_wheels
    from .prepare.clock import cut_fixes
    from .prepare.gaps import edges
    from .prepare.increments import body_increments, merge_marks

    lo, hi = span
    fixes = cut_fixes(recording.gnss, lo, hi)
    lo = float(fixes.time[0])
    exposure = np.zeros(0) if recording.events is None else recording.events.time
    at_event = np.flatnonzero((exposure >= lo) & (exposure <= hi))
    rate = min(flight.output.trajectory_hz or EPOCH_HZ, EPOCH_HZ)
    grid_time = lo + np.arange(int((hi - lo) * rate + 1e-6) + 1) / rate
    marks, (at_fix, exposed, at_grid, _) = merge_marks(fixes.time, exposure[at_event], grid_time, edges(recording.imu.time, lo, hi))
    inc = body_increments(recording.imu, recording.C_b_imu, marks)
    asked, make = _fix_errors(flight, fixes), layout_with(flight, recording)
    layout = make(asked)
    epochs = make_epochs(inc, at_fix, fixes, exposed, frame)
    if len(recording.rests):
        epochs = at_rest(epochs, inc, recording.rests.time, layout)
    if flight.filter.non_holonomic:
        epochs = on_wheels(epochs)
    interval = float(np.median(np.diff(fixes.time)))
    gate = gate_from_sigma(flight.gnss.gate_sigma)
    doubt = gate_from_sigma(DOUBT_SIGMA) if flight.filter.robust else np.inf
    problem = Problem(inc, epochs, frame, layout, flight.mounting.antenna_lever_b, gate, interval, doubt=doubt)
    return _Prepared(problem, asked, make, fixes, at_grid, at_event)


DOUBT_SIGMA = 2.0
TRIES = 6  # of correlated errors, each less sure of the fixes than the one before
LASTING_WHITE = 0.3  # of the sigma of a fix whose error stays: what changes from fix to fix


def layout_with(flight: Flight, recording: Recording) -> "LayoutWith":
    """The error states of a flight as a function of those of its fixes."""
    from .navigation.layout import state_layout

    options = flight.filter
    return lambda fixes: state_layout(recording.noise, options.scale_factor, options.misalignment, fixes)


def _fix_errors(flight: Flight, fixes: GnssFixes) -> "FixErrors":
    """Errors of the fixes that the flight file asks for, and those of float fixes among fixed ones."""
    from .calibrate.fixes import CLOCK_RATE
    from .navigation.filter import lasting_errors
    from .navigation.layout import FixErrors

    f, g = flight.filter, flight.gnss
    staying, time_s = lasting_errors(fixes)
    return FixErrors(
        f.lever_arm_sigma_m if f.lever_arm else None,
        f.time_offset_sigma_s if f.time_offset else None,
        CLOCK_RATE if f.time_offset else None,
        None if isinstance(g.gm_sigma, str) else (g.gm_sigma,) * 3,
        g.correlation_time_s,
        (g.white_scale,) * 3,
        1.0 if g.gm_sigma != "off" and staying.any() else None,
        time_s,
        LASTING_WHITE if g.gm_sigma != "off" else g.white_scale,
    )


def _align(flight: Flight, problem: "Problem") -> "tuple[Start, str]":
    from .align.initial import given_attitude, initial_state

    if flight.initial is not None:
        given = flight.initial
        rpy = np.radians([given.roll_deg, given.pitch_deg, given.heading_deg])
        return given_attitude(problem, rpy, np.radians(given.sigma_deg)), "initial attitude from the flight file"
    alignment = initial_state(problem)
    first, last = alignment.window
    sigma = np.degrees(alignment.heading_sigma)
    return alignment.start, (
        f"initial attitude from the motion between {first:.1f} and {last:.1f} s (heading to {sigma:.2f} deg there), "
        "filtered back to the first fix"
    )


def _examined(
    flight: Flight, prepared: _Prepared, start: "Start", solution: "Solution", step: Progress
) -> "tuple[Solution, tuple[Check, ...], tuple[str, ...]]":
    """The solution, solved again with correlated errors of the fixes where the innovations show them and nothing forbids it.

    Where they show more, lever arm and time offset are estimated beside the flight file's and compared with them.
    """
    from .calibrate.fixes import (
        contradictions,
        correlated_error,
        less_sure,
        loses_fixes,
        misfit,
        suspects,
        suspicious,
        with_layout,
    )
    from .navigation.solution import solve

    asked, make = prepared.asked, prepared.make
    if flight.gnss.stationary is not None or not suspicious(solution, make, asked):
        return solution, (), ()
    searched = suspects(asked)
    problem, found = solution.problem, None
    if flight.gnss.gm_sigma == "auto":
        step("the innovations are not white: errors of the fixes")
        found = correlated_error(solution, make, searched)
    if found is not None:
        searched = found
        asked = replace(found, lever_arm_m=asked.lever_arm_m, time_offset_s=asked.time_offset_s, clock_rate=asked.clock_rate)
    checks: list[Check] = []
    if searched != asked:
        step("lever arm and clock of the fixes")
        try:
            tried = solve(*with_layout(problem, start, make(searched)), "off", separations=0)
            checks = contradictions(tried, flight.mounting, asked.lever_arm_m is None, asked.time_offset_s is None)
        except DataError:
            pass  # the search is not the result
    if found is None:
        return solution, tuple(checks), ()
    for _ in range(TRIES):
        step("filter, with correlated errors of the fixes")
        try:
            again = solve(*with_layout(problem, start, make(asked)), flight.filter.second_pass, step)
        except DataError:
            asked = less_sure(asked)
            continue
        if loses_fixes(again, solution):
            asked = less_sure(asked)
        elif misfit(again) > misfit(solution):
            return solution, tuple(checks), (f"{_told(asked)}; given up, they explain the whole flight no better",)
        else:
            return again, tuple(checks), (_told(asked),)
    return solution, tuple(checks), (f"{_told(asked)}; given up, the filter loses fixes with them",)


def _biased(flight: Flight, recording: Recording, prepared: _Prepared, solution: "Solution | None", step: Progress) -> tuple[Check, ...]:
    """A contradiction where the noise model has no turn-on bias and the innovations show one, beyond `GAIN` in (C.1), else none.

    solution : without turn-on biases, None where there is none.
    """
    from .calibrate.fixes import GAIN, misfit
    from .navigation.solution import solve

    if not without_turn_on(recording.noise):
        return ()
    step("turn-on biases, which the noise model lacks")
    biased = layout_with(flight, replace(recording, noise=with_turn_on(recording.noise)))(prepared.asked)
    problem = replace(prepared.problem, layout=biased)
    try:
        tried = solve(problem, _align(flight, problem)[0], flight.filter.second_pass, separations=0)
    except DataError:
        return ()
    gain = np.inf if solution is None else misfit(solution) - misfit(tried)
    if gain <= GAIN:
        return ()
    told = "no solution without them" if solution is None else f"-2 log L falls by {gain:.0f} with them, limit {GAIN:g}"
    check = check_turn_on(recording.noise)
    return (replace(check, found=f"{check.found}, and the innovations show them ({told})", verdict="contradiction"),)


def _explain(flight: Flight, prepared: _Prepared, error: DataError) -> None:
    """Raise InputError with the lever arm or time offset that explains `error`, where the flight shows one."""
    from .calibrate.fixes import contradictions, suspects
    from .navigation.solution import solve

    asked = prepared.asked
    searched = suspects(asked)
    if searched == asked:
        return
    problem = replace(prepared.problem, layout=prepared.make(searched))
    try:
        tried = solve(problem, _align(flight, problem)[0], "off", separations=0)
    except DataError:
        return
    found = contradictions(tried, flight.mounting, asked.lever_arm_m is None, asked.time_offset_s is None)
    if found:
        raise InputError(f"{flight.path}: {sentence(found[0])}; as the flight file is, {error}") from None


def _told(found: "FixErrors") -> str:
    lasting, white = (" / ".join(f"{x:.2f}" for x in values) for values in (found.correlated or (), found.scale))
    return (
        f"correlated innovations: errors of the fixes estimated, in standard deviations of the file (N / E / D), as {lasting} that "
        f"last for {found.correlation_time_s:.1f} s and {white} that do not"
    )


def _refuse_short(recording: Recording, span: tuple[float, float]) -> None:
    """Raise DataError where a stretch holds too few fixes."""
    from .prepare.clock import SHORTEST_S

    at = recording.gnss.time[(recording.gnss.time >= span[0]) & (recording.gnss.time <= span[1])]
    length = float(at[-1] - at[0]) if at.size else 0.0
    if at.size < 2 or length < SHORTEST_S:
        raise DataError(f"{at.size} fixes over {length:.1f} s, limit {SHORTEST_S:.0f} s")


def check_images(recording: Recording, solved: list[Stretch]) -> list[Check]:
    """Which exposures have no orientation."""
    if recording.events is None:
        return []
    images = recording.events.images
    lost = np.setdiff1d(np.arange(len(images)), np.concatenate([part.at_event for part in solved]))
    if not lost.size:
        return []
    names = ", ".join(images[k] for k in lost[:5]) + (", ..." if lost.size > 5 else "")
    found = f"{lost.size} of {len(images)} have no orientation: {names}"
    return [
        Check(
            "images", found, "all images within the stretches", "note", "they lie in a gap, before the first fix or in a stretch left out"
        )
    ]


def check_motion(flight: Flight, solved: list[Stretch]) -> list[Check]:
    """Whether the vehicle moves as it is said to: most of what is measured of the motion itself must pass its test."""
    from .navigation.filter import MOTION, NOTHING, REJECTED

    verdict = np.concatenate([part.solution.verdict[:, MOTION] for part in solved])
    offered, rejected = int((verdict != NOTHING).sum()), int((verdict == REJECTED).sum())
    if offered == 0:
        return []
    found = f"{rejected} of {offered} measurements of rest or of wheels rejected"
    key = "filter.non_holonomic = false" if flight.filter.non_holonomic else 'filter.zero_velocity = "off"'
    bad = rejected > 0.5 * offered
    return [Check("motion", found, "most of them used", "contradiction" if bad else "ok", f"it does not move so: {key}" if bad else "")]


def _check_stretches(solved: list[Stretch], failed: list[tuple[tuple[float, float], DataError]]) -> Check:
    """What the gaps of the IMU made of the flight."""
    from .prepare.gaps import BRIDGE_S

    kept = ", ".join(f"{part.solution.time[0]:.1f} to {part.solution.time[-1]:.1f} s" for part in solved)
    found = f"the flight falls into stretches of their own, {kept}"
    if failed:
        found += "; left out: " + ", ".join(f"{lo:.1f} to {hi:.1f} s ({error})" for (lo, hi), error in failed)
    return Check("IMU gaps", found, f"no gap over {BRIDGE_S:g} s", "note", "images in a gap or in a stretch left out have no orientation")
