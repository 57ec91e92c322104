"""The one place that knows the order of the steps.

    read -> prepare -> align -> filter -> smooth -> orient -> export

`process` runs it for a flight file. `flight.inspection.described` does only the first step,
`api.demo` runs it on a flight that it simulates.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from ...base.ahead import compile_ahead
from ...base.beside import Beside
from ...base.files import json_ready
from ...base.inputs import reading, sha256
from ...base.provenance import circumstances, versions
from ...base.received.trusted import at_home
from ...base.wording import relative
from ...io.exposures.instants import refuse_outside
from ...navigation.prepare.clock import common_span
from ...navigation.recognise.plausibility import check_heading
from ...records import Diagnostics, ExteriorOrientation, Finding, Trajectory
from ...records.strips import CommonErrors, StripCovariance
from ...report.summary import run_summary
from ..config.flight_file import Flight
from ..sensors.trials import ANTENNA_PAIR
from .checks import refuse_contradictions, refuse_unobservable
from .clocks import on_gpst
from .diagnostics import constants_of, report_rows, run_diagnostics, tried_sensors
from .history import run_history
from .input_files import input_files
from .orientation.poses import at_epochs, orient_images, output_trajectory
from .orientation.strips import strip_covariances
from .products import (
    ground_below,
    output_directory,
    overwriting,
    refuse_image_names,
    write_products,
)
from .progress import Progress, StepClock, quiet
from .recording import Recording, read_recording
from .result import ProcessResult as ProcessResult
from .segment import Segment
from .segment_checks import OF_SEGMENTS, check_images
from .solve_segments import PreparedFlight, prepare_segments, solve_segments

Correction = Callable[[Flight, Recording, list[Segment]], list[Segment]]
"""Returns the solved segments of a flight with what further observations make of them."""
Comparison = Callable[[Flight, Mapping[str, Any]], dict[str, Any]]
"""Returns what a report has of earlier flights: `earlier`, or nothing."""


@at_home
def process(
    flight: Flight,
    out: Path | None = None,
    progress: Progress = quiet,
    write: bool = True,
    force: bool = False,
    correct: Correction | None = None,
    compare: Comparison | None = None,
) -> ProcessResult:
    """Process a flight: from its flight file to the orientation of every image and its report.

    Parameters
    ----------
    flight : Flight
        The flight file.
    out : Path or None
        The directory of the products in place of the flight file's.
    progress : Progress
        Receives the name of each step.
    write : bool
        Whether to write the products at all.
    force : bool
        Whether results of other measurements are overwritten.
    correct : callable, optional
        What corrects the solved segments, such as the images of a block.
    compare : callable, optional
        What compares the report with those of earlier flights.

    Returns
    -------
    ProcessResult
        The products, which are written when it returns.

    Raises
    ------
    InputError
        Where the input is wrong or contradicts itself.
    DataError
        Where the data do not support the answer.
    UsageError
        Where the products cannot go into `out`.
    """
    with reading(flight.read):
        return _process(flight, out, progress, write, force, correct, compare)


def _process(
    flight: Flight,
    out: Path | None,
    progress: Progress,
    write: bool,
    force: bool,
    correct: Correction | None,
    compare: Comparison | None,
) -> ProcessResult:
    directory = output_directory(flight, out) if write else None
    overwritten = None if directory is None or force else overwriting(flight, directory, out)
    if overwritten is not None and flight.gnss.raw is not None:
        raise overwritten  # the engine would take minutes
    clock = StepClock(progress)
    compile_ahead()

    clock.step("read")
    files = input_files(flight)
    inputs = Beside(lambda: {relative(f, flight.path.parent): sha256(f) for f in files})
    recording = read_recording(flight)
    refuse_contradictions(flight, recording.checks)
    if overwritten is not None:
        raise overwritten  # a file that is broken was said before
    if write and recording.cameras:
        refuse_image_names(flight, [i for c in recording.cameras for i in c.events.images])
    week = recording.gps_week

    clock.step("prepare")
    prepared = _prepare_segments_of(flight, recording)
    background = ground_below(flight, recording.gnss, prepared.frame) if write else None
    if not flight.filter.time_offset:  # else the fixes are moved, and prepared again
        recording = recording.without_samples()
    segments, checks = _solve(flight, recording, prepared, clock.step)  # align, filter, smooth
    del prepared
    if correct is not None:
        clock.step("correct")
        segments = correct(flight, recording, segments)

    clock.step("orient")
    rows = report_rows(segments, week)
    sampled = Trajectory.joined([row.trajectory for row in rows])
    course = (sampled.time, sampled.C_nb, sampled.velocity_ned)
    checks = (*checks, check_heading(*course, flight.imu.C_b_imu))
    refuse_contradictions(flight, checks[-1:])
    history = run_history(flight, recording, segments, checks)
    eo = orient_images(flight, recording, segments, history)
    strips: tuple[StripCovariance, ...] = ()
    common: CommonErrors | None = None
    if eo is None:
        refuse_unobservable(flight, sampled)
    elif flight.output.strip_covariance and correct is None:
        strips, common, note = strip_covariances(flight, recording, segments, eo)
        history = (*history, note)
        eo = replace(eo, history=history)

    tried_deg = tried_sensors(recording, segments)
    # what follows reads results alone; the increments of 8 hours at 500 Hz are 0.8 GB
    results = [s.without_increments() for s in segments]
    if at_epochs(flight.output.trajectory_hz):
        segments = results
    trajectory = output_trajectory(flight, segments, week)
    if recording.fixes_are_gpst:
        trajectory = replace(trajectory, time=on_gpst(trajectory.time, results))
        eo = eo and replace(eo, time=on_gpst(eo.time, results))
    segments = results
    clock.step("report")
    diagnostics = run_diagnostics(segments, rows, recording.stationary.time, checks)
    digests = inputs.result()
    report = _report(
        flight, recording, segments, diagnostics, eo, history, clock, digests, tried_deg
    )
    report |= {} if compare is None else compare(flight, report)

    result = ProcessResult(report, (), eo, trajectory, diagnostics, strips, common)
    if directory is not None:
        clock.step("write")
        written = write_products(flight, directory, result, recording, background)
        result = replace(result, files=written)
    clock.step("")
    return result


def _prepare_segments_of(flight: Flight, recording: Recording) -> PreparedFlight:
    """Pose the estimation problems of a flight."""
    if recording.cameras:
        span = common_span(recording.imu, recording.gnss, flight.start_tow, flight.end_tow)
        for camera in recording.cameras:
            refuse_outside(camera.events, *span)
    return prepare_segments(flight, recording)


def _solve(
    flight: Flight, recording: Recording, prepared: PreparedFlight, step: Progress
) -> tuple[list[Segment], tuple[Finding, ...]]:
    """Solve the segments of a flight; return them and all checks up to there."""
    segments, gaps = solve_segments(flight, recording, step, prepared)
    checks = [check for segment in segments for check in segment.checks]
    for check in OF_SEGMENTS:
        checks += check(flight, recording, segments)

    def findings() -> dict[str, Any]:
        start = min(float(segment.solution.time[0]) for segment in segments)
        return {
            "span": {"gps_week": recording.gps_week, "start_tow_s": start},
            "constants": constants_of(flight, segments),
        }

    refuse_contradictions(flight, checks, findings)
    return segments, (*recording.checks, *checks, *gaps, *check_images(recording, segments))


def _report(
    flight: Flight,
    recording: Recording,
    segments: Sequence[Segment],
    diagnostics: Diagnostics,
    eo: ExteriorOrientation | None,
    history: tuple[str, ...],
    clock: StepClock,
    inputs: dict[str, str],
    tried_deg: dict[str, float],
) -> dict[str, Any]:
    """Gather what report.json holds."""
    report = run_summary(
        diagnostics,
        eo,
        flight.resolved(),
        inputs,
        versions(),
        dict(clock.seconds),
        history,
        imu_samples=recording.sample_count,
        epochs=sum(segment.solution.time.size for segment in segments),
        series=recording.series,
        run=circumstances(),
        gps_week=recording.gps_week,
        heading_with_antennas_deg=tried_deg.pop(ANTENNA_PAIR, None),
        heading_with_sensors_deg=tried_deg,
        exposure_sigma_s=_median_stamp_sigma(recording),
    )
    report["constants"] = constants_of(flight, segments)
    ppk = recording.ppk
    if ppk is not None:
        quality = json_ready(ppk.quality)
        report["ppk"] = {"engine": ppk.engine, "verdict": ppk.verdict, "quality": quality}
    return report


def _median_stamp_sigma(recording: Recording) -> float | None:
    """Return the standard deviation of the stamps of all exposures, s, median; None: unknown."""
    sigmas = [c.events.sigma_s for c in recording.cameras if c.events.sigma_s is not None]
    return float(np.median(np.concatenate(sigmas))) if sigmas else None
