"""The instants of exposures on the clock of a recording: the one place that stamps pass through.

Whose clock stamped them, the offsets that the flight file states, the week, what their digits lost,
whether names go with them (`numbering`), and the span that they have to lie in.

Stamps may lie on a grid of time: rounded, cut off, or read by a loop. A table in seconds of the
week cannot say how finely it is written: 205344 may be a second or an instant. An autopilot's loop
of 50 Hz and frames of a video leave grids that are no power of ten and begin anywhere. Where all
stamps lie on a grid of step q and their intervals change by its steps, as those of no trigger do,
they lost what lies between. Whether they were rounded or cut off is not known; an error e that is
uniform within a step of a stamp that was cut off has about it

    E e^2 = q^2 / 3                                                                            (S.1)

and that of a rounded one a quarter of it, so that sqrt(S.1) is the standard deviation that both
keep. The grid is found by the periodogram of the intervals, and judged by the chance that stamps of
no grid lie as near to one of those tried: n intervals that change, rms phase r of n stamps (cycles)

    p < trials (sqrt(2 pi e) r)^n                                                              (S.2)

Only intervals that differ from the usual one count: equal ones are those of an intervalometer,
whose stamps lie on a grid of its own and lost nothing, and pauses between lines may last any time.
Where too few differ nobody can tell, so nothing is added; on a grid of decimals a note asks.
"""

import math
from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from ...base.errors import InputError
from ...geodesy.gpstime import LEAST_WEEKS_APART_S, weeks_apart
from ...records import Array, CameraEvents, Finding, Question
from ...records.observations import in_week
from ...records.variances import decimal_step
from ..formats.text.clock import RANGES_S
from ..options.camera_options import CameraInput
from .numbering import with_numbering_note
from .rig import CameraExposures, ClockOffsets

LARGEST_S, SMALLEST_S = 1.0, 0.01  # of a step; a finer one costs 1 cm at 10 m/s
EXACT_S = 1e-6  # of the stamps on a grid of decimals: conversions of units, no measurement
FEWEST_STAMPS = 8  # stamps that show a step (chosen)
CHANGES = 2  # intervals off the usual one that no trigger has
# of the usual interval: a longer one may be a pause; and the fewest steps in one, because a trigger
# that misses images has multiples of its interval
PAUSE, FEWEST_GRID_STEPS = 1.5, 2
GRID_JITTER = 0.1  # of a step, rms: beyond it (S.2) does not hold, and no loop is that unsteady
LIKELY = 0.6  # mean cosine of the intervals' phases at GRID_JITTER is 0.67
OVERSAMPLED = 8.0  # frequencies tried in one over the longest interval
SCANNED = 300  # intervals in the periodogram; all enter the judgement
LEAST_CHANCE = 1e-4  # (S.2) of stamps that are called stamps on a grid
# multiples of a decimal step in which loops count, and the chance of intervals that change by those
# alone: where it errs, stamps that are rounded anyway get up to five times their sigma (chosen)
MULTIPLES, COARSER_CHANCE = (5.0, 4.0, 2.0), 0.02


def with_stamp_rounding(events: CameraEvents) -> CameraEvents:
    """Give stamps on a grid the standard deviation of its step (S.1).

    Parameters
    ----------
    events : CameraEvents

    Returns
    -------
    CameraEvents
        With a note of the step; `events` itself where there is none, or where the file says how
        well its stamps are known.
    """
    if events.sigma_s is not None:
        return events
    step, rounded = stamp_grid(events.time)
    if step == 0.0:
        return events
    sigma = step / 3.0**0.5
    finding = f"all stamps are multiples of {step:g} s"
    if rounded:
        if decimal_step(events.time, step, step, EXACT_S) != step:
            finding = f"all stamps lie on a grid of {step:.4g} s ({1.0 / step:.4g} Hz)"
        finding += (
            f", rounded or cut off: standard deviation {sigma:.2g} s added to each, which is"
            f" {10.0 * sigma:.2g} m along the path at 10 m/s"
        )
        advice = (
            "give stamps with all their digits, or their standard deviation in a column sigma_s"
        )
        events = replace(events, sigma_s=np.full(events.time.size, sigma))
    else:
        finding += " at equal intervals, taken as exact"
        advice = (
            f"if they were rounded, they are {10.0 * sigma:.2g} m off along the path at 10 m/s:"
            " write them with all their digits (7 decimals of a second)"
        )
    note = Question("exposure times", f"stamps finer than {SMALLEST_S:g} s").note(finding, advice)
    return replace(events, notes=(*events.notes, note))


def stamp_grid(time: Array) -> tuple[float, bool]:
    """Return the step of the grid on which stamps lie, and whether their intervals show it.

    Parameters
    ----------
    time : ndarray, shape (n,)
        s.

    Returns
    -------
    step : float
        Between `SMALLEST_S` and `LARGEST_S`; 0 where there is none.
    rounded : bool
        Whether the intervals change by its steps; else it is a decimal step, 1, 0.1 or 0.01 s, and
        an intervalometer could have made the stamps.
    """
    if time.size < FEWEST_STAMPS:
        return 0.0, False
    decimal = decimal_step(time, LARGEST_S, SMALLEST_S, EXACT_S)
    ordered = np.sort(time) - np.min(time)
    candidates = [_refined(ordered, 1.0 / f) for f in _likely_frequencies(ordered)]
    candidates = [c for c in candidates if c[1] < GRID_JITTER]
    if candidates:
        step, jitter, changes = min(
            candidates, key=lambda c: _chance_of_step(c[0], c[1], c[2], EXACT_S)
        )
        digit = max(decimal_step(time, LARGEST_S, EXACT_S, 0.1 * EXACT_S), EXACT_S)
        # stamps of few digits lie only on grids of them
        trials = LARGEST_S / decimal if decimal else max(float(ordered[-1]), 1.0) / SMALLEST_S
        if trials * _chance_of_step(step, jitter, changes, digit) < LEAST_CHANCE:
            return step, True
    if not decimal or _changes(ordered, decimal) < CHANGES:
        return decimal, False
    return _coarser(ordered, decimal), True


def _coarser(time: Array, decimal: float) -> float:
    """Return the multiple of a decimal step on whose grid all stamps lie, or the step itself, s."""
    for factor in MULTIPLES:
        step = factor * decimal
        on_grid = np.abs(time - step * np.rint(time / step)).max() < EXACT_S
        if step <= LARGEST_S and on_grid and factor ** -_changes(time, step) < COARSER_CHANCE:
            return step
    return decimal


def _chance_of_step(step: float, jitter: float, changes: int, digit: float) -> float:
    """Return (S.2) of one trial, of stamps that are multiples of `digit`, s."""
    return float(max((2.0 * np.pi * math.e) ** 0.5 * jitter, digit / step) ** changes)


def _likely_frequencies(time: Array) -> Array:
    """Return the maxima of the periodogram of the intervals, the lowest frequency first, Hz."""
    intervals = np.diff(time)
    usual = float(np.median(intervals))
    intervals = intervals[(intervals > 0.0) & (intervals < PAUSE * usual)][:SCANNED]
    if not intervals.size:
        return np.empty(0)
    step = 1.0 / (OVERSAMPLED * float(intervals.max()))
    lowest, highest = max(1.0 / LARGEST_S, FEWEST_GRID_STEPS / usual), 1.0 / SMALLEST_S
    f = np.arange(lowest - step, highest + 2.0 * step, step)
    power = sum((np.cos(2.0 * np.pi * f * d) for d in intervals), np.zeros(f.size)) / intervals.size
    inner = power[1:-1]
    peaks = (inner > LIKELY) & (inner >= power[:-2]) & (inner > power[2:])
    return f[1:-1][peaks]


def _refined(time: Array, step: float) -> tuple[float, float, int]:
    """Return a step by ever longer differences, the rms phase of the stamps on it, and changes.

    Differences of twice the length halve the error of the step that the next ones are counted by.
    """
    pairs = [time[2**k :] - time[: -(2**k)] for k in range(int(time.size - 1).bit_length())]
    differences = np.concatenate(pairs)
    half_width = PAUSE * float(np.median(np.diff(time)))
    while half_width < 2.0 * time[-1]:
        within = differences[differences <= half_width]
        count = np.rint(within / step)
        step = float(within @ within) / max(float(within @ count), 1e-12)
        half_width *= 2.0
    phase = np.exp(2j * np.pi * time / step)
    residual = np.angle(phase / np.exp(1j * np.angle(phase.mean()))) / (2.0 * np.pi)
    return step, float(np.sqrt(np.mean(residual**2))), _changes(time, step)


def _changes(time: Array, step: float) -> int:
    """Count the intervals that differ from the usual one by steps, up to half of it.

    An intervalometer that was set to another interval changes once for all that follow.
    """
    steps = np.rint(np.diff(time) / step).astype(np.int64)
    values, counts = np.unique(steps, return_counts=True)
    usual = values[counts.argmax()]
    if usual < FEWEST_GRID_STEPS:
        return 0
    differ = int((np.abs(steps - usual)[steps != usual] <= 0.5 * usual).sum())
    return min(differ, int(np.count_nonzero(np.diff(steps))))


def on_clock(
    cameras: Sequence[CameraExposures],
    options: CameraInput | None,
    offsets: ClockOffsets,
    week: int,
    span_s: Array | None = None,
) -> tuple[CameraExposures, ...]:
    """Bring the exposures to the clock of a recording, with what their stamps leave open.

    Parameters
    ----------
    cameras : sequence of CameraExposures
        The exposures as their files have them.
    options : CameraInput or None
        Table of the first camera; None without one.
    offsets : ClockOffsets
        What is added to stamps; exposures move with the clock that stamped them.
    week : int
        The GPS week whose seconds the stamps of the recording count.
    span_s : ndarray, (2,), optional
        First and last sample on the clock of the recording: where nothing says whose clock the
        exposures are of, they are not of the IMU's if they lie within the recording as they stand
        and do not as the IMU's.

    Returns
    -------
    tuple of CameraExposures
        With the standard deviations and notes of rounded stamps, and notes of numbers that lack.
    """
    of_rig = () if options is None else options.all_of_rig
    cameras, offset_s = list(cameras), [0.0] * len(cameras)
    for k, (input_options, camera) in enumerate(zip(of_rig, cameras, strict=False)):
        offset_s[k] = input_options.time_offset_s
        of_imu = input_options.clock == "imu" or (
            camera.triggered and input_options.clock == "auto" and of_rig[0].clock == "imu"
        )
        if camera.clock == "receiver":
            offset_s[k] += offsets.gnss
        elif of_imu:
            offset_s[k] += offsets.imu
        elif span_s is None or _share_within(camera, offsets.unstated, week, span_s) >= (
            _share_within(camera, 0.0, week, span_s)
        ):
            offset_s[k] += offsets.unstated
        else:
            cameras[k] = replace(camera, clock="receiver")
    moved = (c.moved(s) if s else c for c, s in zip(cameras, offset_s, strict=True))
    return tuple(
        replace(c, events=with_numbering_note(with_stamp_rounding(in_week(c.events, week))))
        for c in moved
    )


def _share_within(camera: CameraExposures, offset_s: float, week: int, span_s: Array) -> float:
    """Return the share of the exposures within a span with an offset."""
    time = in_week(camera.events, week).time + offset_s
    return float(np.mean((time >= span_s[0]) & (time <= span_s[1])))


def within(
    cameras: Sequence[CameraExposures], start: float | None, end: float | None
) -> tuple[tuple[CameraExposures, ...], list[Finding]]:
    """Return the exposures within the span that the flight file chooses.

    Parameters
    ----------
    cameras : sequence of CameraExposures
        The exposures of each camera.
    start, end : float or None, s
        Its limits; None where there is none.

    Returns
    -------
    tuple of tuple of CameraExposures and list of Finding
        The exposures within, and a note where images are left out.

    Raises
    ------
    InputError
        Where no event of a camera is left.
    """
    kept = tuple(replace(c, events=cut_events(c.events, start, end)) for c in cameras)
    count, inside = (sum(len(camera.events) for camera in each) for each in (cameras, kept))
    if inside == count:
        return kept, []
    finding = (
        f"{count - inside} of {count} images lie outside of these times and get no orientation"
    )
    return kept, [Question("start_tow, end_tow", "all images within").note(finding)]


def cut_events(events: CameraEvents, start: float | None, end: float | None) -> CameraEvents:
    """Return the events within [start, end], s, as the flight file cuts the flight.

    Raises
    ------
    InputError
        Where no event is left.
    """
    keep = (events.time >= (-np.inf if start is None else start)) & (
        events.time <= (np.inf if end is None else end)
    )
    if keep.all():
        return events
    if not keep.any():
        raise InputError(
            f"{events.source}: no image between start_tow and end_tow; correct them, or leave out"
            " [camera]"
        )
    return events[np.flatnonzero(keep)]


def refuse_outside(events: CameraEvents, lo: float, hi: float) -> None:
    """Raise InputError where an exposure lies outside [lo, hi], s."""
    outside = np.flatnonzero((events.time < lo) | (events.time > hi))
    if outside.size:
        k = int(outside[0])
        middle = 0.5 * (lo + hi)
        weeks = weeks_apart(
            float(events.time[k]) - middle, min(0.5 * (hi - lo), LEAST_WEEKS_APART_S)
        )
        if weeks:
            raise InputError(
                f"{events.source}: image {events.images[k]} at {events.time[k]:.3f} s is {weeks}"
                f" apart from the flight, {lo:.3f} to {hi:.3f} s of IMU and GNSS ({outside.size} of"
                f" {len(events.images)} images); give all times in the same GPS week"
            )
        cause = "check the time scale of the events (UTC is 18 s behind GPS time) or"
        for length in RANGES_S:
            if lo <= events.time[0] + length and events.time[-1] + length <= hi:
                cause = (
                    f"if their time counter restarted before the first event, set"
                    f" camera.time_offset_s = {length:.6f}, which puts all within the flight; else"
                )
        raise InputError(
            f"{events.source}: image {events.images[k]} at {events.time[k]:.3f} s is outside the"
            f" flight, {lo:.3f} to {hi:.3f} s of IMU and GNSS ({outside.size} of"
            f" {len(events.images)} images); {cause} remove these lines"
        )
