"""The checks of the solved segments: fixes against the solution and against their own sigmas, the
vehicle's motion, the heights of a barometer, and the images that they leave out.
"""

from collections.abc import Iterator, Sequence
from dataclasses import replace

import numpy as np

from ...base.errors import DataError
from ...base.findings.remedies import SetKey, Step
from ...base.units import DEG
from ...navigation.diagnosis.candidates import with_layout
from ...navigation.diagnosis.evidence import liveliest_window
from ...navigation.filter.codes import (
    BAROMETER_ROW,
    N_KINDS,
    NAV,
    NOT_MEASURED,
    POS,
    POSITION_ROW,
    REJECTED,
    USED,
    VEL,
    VELOCITY_CONSTRAINT,
)
from ...navigation.filter.event_clock import event_delay
from ...navigation.filter.filter import make_history, run_filter
from ...navigation.filter.kernels.records import FilterHistory
from ...navigation.filter.layout import StateLayout
from ...navigation.filter.problem import EstimationProblem, InitialState
from ...navigation.filter.solution import Solution
from ...navigation.innovations.residuals import worst_piece
from ...records import Finding, Question
from ...records.states import State
from ...report.rules.wording import NED_NAMES, millimetres
from ...report.statistics import Z_CONFIDENCE, lag_one, residual_limit
from ..config.flight_file import Flight
from .checks import of_camera
from .estimation_problem import layout_factory, requested_errors
from .recording import Recording
from .segment import Segment

MOST_REJECTED_FIXES = 0.5
"""Share of rejected measurements of the motion or of a barometer that contradicts what is said."""

AS_CLAIMED = (0.8, 1.25)
"""Mean NIS per degree of freedom of fixes whose sigmas are right to a tenth."""

WHITE_LAG = 0.1
"""Lag-one autocorrelation of white innovations, at most, where chance does not allow more."""

LEAST_VALUES = 30
"""Values of a measurement from which on their scatter, to 13 % by chance, is judged."""

LEAST_SCATTER = 0.3
"""Times the sigmas that values scatter at least; sigmas three times as wide have another unit."""

MOST_STATE_SIGMAS = 4.5
"""Sigmas, of both together, between a constant of a sensor as stated and as the flight has it."""

MOST_PULL_SIGMAS = 1.0
"""Sigmas that what is stated of such a constant may move its estimate; less is harmless."""

LEAST_TRACE = 1e-4
"""Information of a flight on a constant, in that of its prior, which rounding leaves in digits."""

MUCH_WIDER = 1.5
"""Ratio of position sigmas that matters to their user."""

CLOCKS_MATTER_M, CLOCKS_MATTER_SIGMA = 0.02, 3.0
"""How far, in metres and in median sigmas, the two clocks put an exposure apart that it matters."""

LEAST_WITHIN = 0.5
"""Share of the exposures that lie within the flight by a clock that may be theirs (chosen)."""

MOST_IMAGES_LISTED = 5
"""Images that a check names."""


def check_exposure_clock(
    flight: Flight, recording: Recording, segments: Sequence[Segment]
) -> Iterator[Finding]:
    """Ask whose clock stamps the exposures, where the clocks differ and nobody has said it.

    No data of a flight tell it: exposures of the receiver's clock that are taken as stamped by the
    IMU's are off by what the fixes were moved by, times the speed.

    Parameters
    ----------
    flight : Flight
        The flight file.
    recording : Recording
        Its records.
    segments : sequence of Segment
        The solved segments.

    Yields
    ------
    Finding
        A note for each camera with `camera.clock = "auto"` that was taken as the IMU's and has
        exposures further apart than `CLOCKS_MATTER_M` and `CLOCKS_MATTER_SIGMA`.
    """
    cameras = () if flight.camera is None else flight.camera.all_of_rig
    first, last = segments[0].solution.time[0], segments[-1].solution.time[-1]
    for k, (options, exposures) in enumerate(zip(cameras, recording.cameras, strict=False)):
        if options.clock != "auto" or exposures.clock != "imu":
            continue
        apart_m, within = [0.0], []
        for segment in segments:
            solution, instant = segment.solution, segment.exposed[k].instant
            moved = flight.gnss.time_offset_s + segment.time_offset_s + event_delay(solution)
            speed = np.linalg.norm(solution.nav[solution.event_epochs, VEL], axis=1)
            apart_m += (np.abs(moved) * speed)[instant].tolist()
            stamps = (solution.time[solution.event_epochs] + moved)[instant]
            within += ((stamps >= first) & (stamps <= last)).tolist()
        if np.mean(within or [True]) < LEAST_WITHIN:
            continue  # stamps of the receiver's clock would not be of this flight
        if max(apart_m) <= CLOCKS_MATTER_M:
            continue
        sigma = [
            np.sqrt(s.variance(s.event_epochs)[:, POS].max(axis=1))
            for s in (segment.solution for segment in segments)
        ]
        limit = max(CLOCKS_MATTER_M, CLOCKS_MATTER_SIGMA * float(np.median(np.concatenate(sigma))))
        if max(apart_m) > limit:
            check = Question(
                "exposure clock", f"either clock gives the same images within {1e3 * limit:.0f} mm"
            ).note(
                "the IMU's clock was assumed; with the receiver's clock the images would move by "
                f"up to {max(apart_m):.2f} m, and no data of the flight show which clock is right",
                Step(
                    'set {} if the receiver stamps the exposures, "imu" if the IMU does',
                    SetKey("camera.clock", "receiver"),
                ),
            )
            rig = len(recording.cameras) > 1
            yield of_camera(check, exposures.name) if rig else check


def check_residuals(
    flight: Flight, recording: Recording, segments: Sequence[Segment]
) -> Iterator[Finding]:
    """Check the fixes against the smoothed solution, minute by minute.

    Parameters
    ----------
    flight : Flight
        The flight file.
    segments : sequence of Segment
        The solved segments.

    Yields
    ------
    Finding
        The check "fixes minus solution", a note where the mean of a minute is beyond what the
        sigmas of solution and fixes allow it; nothing where no fix was used, or where the fixes are
        a given place.
    """
    pieces = [piece for segment in segments for piece in segment.residuals]
    if flight.gnss.stationary is not None or not pieces:
        return
    limit = residual_limit(3 * len(pieces))
    worst, axis, sigmas = worst_piece(pieces)
    expected = f"at most {limit:.1f} sigma in each of {len(pieces)} pieces"
    yield Question("fixes minus solution", expected).note(
        f"mean of {worst.begin_s:.1f} to {worst.end_s:.1f} s: fixes minus solution "
        f"{millimetres(1e3 * worst.mean_m[axis])} {NED_NAMES[axis]}, {sigmas:.1f} sigma",
        "do not rely on positions or sigmas there: the solution departs from the fixes",
        when=sigmas > limit,
    )


def check_file_sigmas(
    flight: Flight, recording: Recording, segments: Sequence[Segment]
) -> Iterator[Finding]:
    """Note where larger errors of the fixes were adopted than their sigmas needed.

    Parameters
    ----------
    flight : Flight
        The flight file.
    recording : Recording
        The recording.
    segments : sequence of Segment
        The solved segments; the longest is looked at.

    Yields
    ------
    Finding
        The note "sigmas of the fixes" where the flight file leaves their errors to the data and the
        sigmas of the file, as those of white errors, would have done.
    """
    segment = max(segments, key=lambda segment: segment.solution.time.size)
    if flight.gnss.stationary is not None or flight.gnss.gm_sigma != "auto":
        return
    if any(check.name == "incorrect fixes" for each in segments for check in each.checks):
        return  # the sigmas of the file are wrong in these spells
    white = replace(
        requested_errors(flight, segment.fixes),
        gm_sigma=None,
        white_scale=(1.0, 1.0, 1.0),
        unfixed_gm_sigma=None,
        unfixed_white_scale=1.0,
    )
    wider = wider_than_needed(
        segment.solution, layout_factory(flight, recording.noise, recording.measurements)(white)
    )
    if wider is None:
        return
    ratio, factor = wider
    yield Question("sigmas of the fixes", "errors that the innovations prove").note(
        "the flight fits the sigmas of the file as those of white noise (NIS per degree of freedom"
        f" {ratio:.2f}) but cannot exclude slow errors; these are assumed for safety and make"
        f" position sigmas {factor:.1f} times as large as white noise would",
        Step(
            "compare the images with check points; only where they are as good as white fixes"
            " promise, set {}",
            SetKey("gnss.gm_sigma", "off"),
        ),
    )


def wider_than_needed(solution: Solution, white: StateLayout) -> tuple[float, float] | None:
    """Tell whether a solution has larger errors of the fixes than their innovations need.

    The liveliest window of the flight is filtered with the errors of the solution, and with the
    sigmas of the file as those of white errors.

    Parameters
    ----------
    solution : Solution
        The solved segment.
    white : StateLayout
        The error states without time-correlated errors of the position fixes.

    Returns
    -------
    tuple of float or None
        Mean NIS per degree of freedom with white errors, and the ratio of the position sigmas;
        None where the innovations are not those of white errors, or the sigmas hardly differ.
    """
    posed = liveliest_window(solution)
    layout = posed[0].layout
    if layout.gm < 0 and layout.unfixed_gm < 0 and max(layout.white_scale) <= 1.0:
        return None
    adopted, alone = _filter_window(*posed), _filter_window(*with_layout(*posed, white))
    if adopted is None or alone is None:
        return None
    later = slice(alone.sigma.shape[0] // 2, None)  # without the start
    factor = float(np.median(adopted.sigma[later, POS] / alone.sigma[later, POS]))
    used = alone.verdict[:, POSITION_ROW] == USED
    if factor < MUCH_WIDER or np.count_nonzero(used) < np.count_nonzero(
        alone.verdict[:, POSITION_ROW] != NOT_MEASURED
    ):
        return None
    ratio = float(np.mean(alone.nis[used, POSITION_ROW])) / 3.0
    normalised = alone.innovation[used, :3] / alone.innovation_sigma[used, :3]
    bound = max(WHITE_LAG, Z_CONFIDENCE / np.sqrt(len(normalised)))
    white_noise = bool((np.abs(lag_one(normalised)) < bound).all())
    return (ratio, factor) if AS_CLAIMED[0] < ratio < AS_CLAIMED[1] and white_noise else None


def _filter_window(problem: EstimationProblem, start: InitialState) -> FilterHistory | None:
    """Filter a window; None where the filter diverges."""
    history = make_history(problem.epochs, problem.layout, smoothed=False)
    try:
        run_filter(problem, start, history)
    except DataError:
        return None
    return history


def check_motion(
    flight: Flight, recording: Recording, segments: Sequence[Segment]
) -> Iterator[Finding]:
    """Check whether the vehicle moves as it is said to.

    Parameters
    ----------
    flight : Flight
        The flight file.
    segments : sequence of Segment
        The solved segments.

    Yields
    ------
    Finding
        The check "motion" where anything is measured of the motion itself: most of it must pass its
        test.
    """
    constrained = flight.filter.non_holonomic
    key = SetKey(
        *(("filter.non_holonomic", False) if constrained else ("filter.zero_velocity", "off"))
    )
    measured = "zero-velocity updates or non-holonomic constraints"
    remedy = Step("if the vehicle does not move as assumed, set {}", key)
    yield from _mostly_used("motion", segments, VELOCITY_CONSTRAINT, measured, remedy)


def check_barometer(
    flight: Flight, recording: Recording, segments: Sequence[Segment]
) -> Iterator[Finding]:
    """Check whether the heights of a barometer follow the flight.

    Parameters
    ----------
    segments : sequence of Segment
        The solved segments.

    Yields
    ------
    Finding
        The check "barometer" where there is one: most of its heights must pass their test.
    """
    remedy = Step(
        "the barometer's heights do not follow the flight; check {barometer.columns}, "
        "time_offset_s (UTC is 18 s behind GPS time) and sigma_m, or leave out [barometer]"
    )
    yield from _mostly_used("barometer", segments, BAROMETER_ROW, "heights", remedy)


def check_measurements(
    flight: Flight, recording: Recording, segments: Sequence[Segment]
) -> Iterator[Finding]:
    """Check whether measurements given by their prediction agree with the flight.

    Parameters
    ----------
    recording : Recording
        The recording.
    segments : sequence of Segment
        The solved segments.

    Yields
    ------
    Finding
        The check "measurements" of each: some values must lie within the flight, and most of them
        must pass their test.
    """
    for kind, measurement in enumerate(recording.measurements, start=N_KINDS):
        offered, rejected = offered_and_rejected(segments, kind)
        solutions = [segment.solution for segment in segments]
        nis = np.concatenate([s.nis[s.verdict[:, kind] == USED, kind] for s in solutions])
        finding = f"{measurement.name}: {rejected} of {offered} values rejected"
        bad, ratio = not offered or rejected > MOST_REJECTED_FIXES * offered, 1.0
        question = Question("measurements", "some values within the flight, most of which are used")
        remedy = Step("check clock, units, sign and `predict` of this measurement, or leave it out")
        if not offered:
            time, first, last = measurement.time, solutions[0].time[0], solutions[-1].time[-1]
            finding = (
                f"{measurement.name}: none of the {time.size} values lies within the flight, TOW "
                f"{first:.1f} to {last:.1f} s; the values are of {time[0]:.1f} to {time[-1]:.1f} s"
            )
            remedy = Step(
                "give the times of the values in seconds of the GPS week of the flight, GPST"
            )
        if nis.size:
            ratio = float(np.sqrt(nis.mean() / measurement.values.shape[1]))
            finding += f"; the other values scatter {ratio:.2f} times as much as their sigmas state"
            finding += "".join(_moving_states(solutions, measurement.name))
        judged = nis.size >= LEAST_VALUES
        wide, narrow = judged and ratio**2 > AS_CLAIMED[1], judged and ratio < LEAST_SCATTER
        deviating = [text for s in solutions for text in _deviating_states(s, measurement.name)]
        if deviating and not bad:
            bad, finding = True, f"{measurement.name}: {deviating[0]}"
            question = Question("measurements", f"within {MOST_STATE_SIGMAS:g} sigmas")
            remedy = Step(
                "measure this constant again and correct the values, or give it a larger sigma"
            )
        if wide and not bad:
            larger = Step(
                "multiply the standard deviations of the values by this factor, or add the "
                "missing error states; otherwise the sigmas of the images are too small"
            )
            yield question.note(finding, larger)
        elif narrow and not bad:
            units = Step(
                "check the units of the sensor's sigma and of the sigmas of its states, such as "
                "deg given as rad; now the sensor has almost no effect on the solution"
            )
            yield question.note(finding, units)
        else:
            yield question.contradiction(finding, remedy, when=bad)


def _moving_states(solutions: Sequence[Solution], measurement: str) -> Iterator[str]:
    """Say between which values the states of a measurement run that are no constants."""
    layout = solutions[0].problem.layout
    for s, state in enumerate(layout.states):
        if state.group == measurement and layout.drive[s] > 0.0:
            unit, factor = _shown_unit(state)
            low = factor * min(float(one.x[:, s].min()) for one in solutions)
            high = factor * max(float(one.x[:, s].max()) for one in solutions)
            yield f"; the state {state.axis} varies from {low:.3g} to {high:.3g} {unit}".rstrip()


def _shown_unit(state: State) -> tuple[str, float]:
    """Return the unit that a state is shown in, degrees of an angle, and its factor from SI."""
    return ("deg", 1.0 / DEG) if state.unit == "rad" else (state.unit, 1.0)


def _deviating_states(solution: Solution, measurement: str) -> list[str]:
    """Name constants of a measurement that the flight puts far from what is stated of them.

    What the flight says without the prior is its information less that of the prior.
    """
    layout, texts = solution.problem.layout, []
    variance = solution.variance(np.array([0]))[0, NAV.stop :]
    for s, state in enumerate(layout.states):
        if state.group != measurement or layout.drive[s] > 0.0:
            continue
        prior, information = layout.sigma0[s], 1.0 / variance[s] - 1.0 / layout.sigma0[s] ** 2
        if information * prior**2 < LEAST_TRACE:
            continue
        value, sigma = solution.x[0, s] / variance[s] / information, information**-0.5
        pull = abs(value - solution.x[0, s]) / np.sqrt(variance[s])
        if pull > MOST_PULL_SIGMAS and abs(value) > MOST_STATE_SIGMAS * np.hypot(sigma, prior):
            unit, factor = _shown_unit(state)
            numbers = f"{factor * value:.3g} +- {factor * sigma:.2g} {unit}".rstrip()
            texts.append(
                f"{state.axis} is {numbers} by this flight, but 0 +- {factor * prior:.2g} is stated"
            )
    return texts


def _mostly_used(
    name: str, segments: Sequence[Segment], kind: int, measured: str, remedy: Step
) -> Iterator[Finding]:
    """Check that most measurements of a kind pass their test; nothing where there are none."""
    offered, rejected = offered_and_rejected(segments, kind)
    if offered:
        yield Question(name, "most of them used").contradiction(
            f"{rejected} of {offered} {measured} rejected",
            remedy,
            when=rejected > MOST_REJECTED_FIXES * offered,
        )


def offered_and_rejected(segments: Sequence[Segment], kind: int) -> tuple[int, int]:
    """Return how many measurements of a kind of `navigation.filter.codes` there were, and were
    rejected.

    Parameters
    ----------
    segments : sequence of Segment
        The solved segments.
    kind : int
        The kind.

    Returns
    -------
    tuple of int
        All of them, and the rejected ones.
    """
    verdict = np.concatenate([segment.solution.verdict[:, kind] for segment in segments])
    return int((verdict != NOT_MEASURED).sum()), int((verdict == REJECTED).sum())


def check_images(recording: Recording, segments: Sequence[Segment]) -> Iterator[Finding]:
    """Note the exposures that have no orientation.

    Parameters
    ----------
    recording : Recording
        The recording.
    segments : sequence of Segment
        The solved segments.

    Yields
    ------
    Finding
        The note "images" where there are such.
    """
    images: list[str] = []
    missing: list[str] = []
    for k, camera in enumerate(recording.cameras):
        oriented = np.concatenate([segment.exposed[k].rows for segment in segments])
        without = np.setdiff1d(np.arange(len(camera.events)), oriented)
        missing += [camera.events.images[row] for row in without]
        images += camera.events.images
    if missing:
        names = ", ".join(missing[:MOST_IMAGES_LISTED])
        names += ", ..." if len(missing) > MOST_IMAGES_LISTED else ""
        yield Question("images", "all images within the segments").note(
            f"{len(missing)} of {len(images)} have no orientation: {names}",
            "these images lie in a gap, before the first fix or in an unsolved segment",
        )


OF_SEGMENTS = (
    check_residuals,
    check_file_sigmas,
    check_motion,
    check_barometer,
    check_measurements,
    check_exposure_clock,
)
"""What is checked of solved segments before contradictions stop a run."""
