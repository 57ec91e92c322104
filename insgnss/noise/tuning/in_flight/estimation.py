"""Noise of the IMU from a flight itself: from its flight file to an accepted noise model.

The flight is solved as `process` would, with the static model of its flight file. The innovations
between the stationary periods then show how much larger the noise is in flight
(`navigation.innovations.innovation_noise`). A time-correlated error of the fixes that the solution
adopted on its own is questioned: noise of the IMU that is larger than the model says makes
innovations correlated, too. Both explanations are tried, and the correlated error stays where it
gains more than `GAIN_OF_CORRELATION` beside free noise of the IMU.

The static model gives way where the gain in likelihood is significant, nothing that is held is
ruled out, what was estimated leaves the innovations white, their normalised square (NIS) comes no
further from one, and no more fixes are rejected, which solving the flight again with the model
found shows as `process` will find it. The spectrum of the IMU in straight flight is evidence of
another kind: white noise above its quietest octave stands in for errors that wander more slowly,
which the static model lacks, and is not accepted.
"""

import math
from collections.abc import Callable, Sequence
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from ....base.errors import InputError, InsgnssError, UsageError
from ....flight.config.flight_file import Flight
from ....flight.processing.checks import refusal
from ....flight.processing.progress import quiet
from ....flight.processing.recording import Recording, read_recording
from .files import model_in_flight, plan_model_file, write
from .result import FlightTuning
from .words import TUNED, Beyond, beyond_spectrum, chance_of, longer_flight

if TYPE_CHECKING:
    from ....flight.processing.segment import Segment
    from ....navigation.filter.solution import Solution
    from ....navigation.innovations.innovation_noise import InFlightNoise

Progress = Callable[[str], None]

OUTPUT_HZ = 2.0  # of the output grid, which nobody looks at
NEARER = 2.0  # standard deviations of the mean NIS by which it may be further from one


def tune_flight(
    flight: Flight,
    out: Path | None = None,
    parameters: Sequence[str] | None = None,
    progress: Progress = quiet,
    force: bool = False,
) -> FlightTuning:
    """Estimate noise of a flight's IMU from the innovations of its filter, and judge it.

    It is written where it is accepted; a table (.json) and the spectrum (.png) stand beside it and
    are written in any case.

    Parameters
    ----------
    flight : Flight
        The flight.
    out : Path, optional
        The noise-model file, by default in_flight_noise.toml beside the flight file.
    parameters : sequence of str, optional
        Some of gyro.white_noise, accel.white_noise (these by default), white_noise (one factor for
        both), gyro.driving_noise and accel.driving_noise.
    progress : callable
        Takes a line on each step.
    force : bool
        Overwrite files.

    Returns
    -------
    FlightTuning
        The estimate, its verdict and the files written.

    Raises
    ------
    InputError
        For wrong input.
    UsageError
        For an unknown parameter, or files of other recordings.
    DataError
        Where the flight determines nothing.
    """
    chosen = chosen_parameters(parameters)
    target = plan_model_file(flight, out, force)
    if flight.imu.further:
        raise InputError(
            f"{flight.path}: imu.further: the noise of several combined IMUs cannot be"
            " distinguished; use `tune_each`, which tunes each IMU alone"
        )
    return write(estimate(flight, chosen, progress), flight, target)


def chosen_parameters(parameters: Sequence[str] | None) -> tuple[str, ...]:
    """Return the parameters to estimate, by default white noise.

    Raises
    ------
    UsageError
        For an unknown parameter, and for one given twice.
    """
    from ....navigation.innovations.innovation_noise import ESTIMATED_BY_DEFAULT
    from ....navigation.innovations.likelihood import IMU_PARAMETERS, one_factor_each

    chosen = tuple(dict.fromkeys(parameters or ESTIMATED_BY_DEFAULT))
    for name in chosen:
        if name not in IMU_PARAMETERS:
            raise UsageError(
                f"noise parameter {name!r} is unknown; use some of {', '.join(IMU_PARAMETERS)}"
            )
    one_factor_each(chosen)
    return chosen


def estimate(flight: Flight, chosen: tuple[str, ...], progress: Progress) -> FlightTuning:
    """Estimate the noise of a flight with one IMU; nothing is written.

    Parameters
    ----------
    flight : Flight
        The flight.
    chosen : tuple of str
        Parameters to estimate.
    progress : callable
        Takes a line on each step.

    Returns
    -------
    FlightTuning
        The estimate and its verdict.

    Raises
    ------
    InputError, DataError
        As `tune_flight` does.
    """
    from ....flight.processing.solve_segments import solve_segments
    from .straight_flight import straight_flight, straight_segments

    progress("read")
    recording = _read_without_exposures(flight)
    # its noise is what is looked for: nothing else may take a share of it
    flight = replace(flight, filter=replace(flight.filter, adaptive_noise="off"))
    light = replace(flight, output=replace(flight.output, trajectory_hz=OUTPUT_HZ))
    solved, gaps = solve_segments(light, recording, progress)
    moving = [piece for segment in solved for piece in _moving_parts(segment, recording)]
    noise, dropped = _estimate_noise(flight, moving, chosen, progress)
    model = model_in_flight(flight, recording, noise)
    offered, rejected_before = _rejections(solved)
    rejected_after = rejected_before
    if noise.significant and noise.white:
        progress("solve again")
        rejected_after = _count_rejections_with(
            light, replace(recording, noise=model), offered, progress
        )
    progress("spectrum")
    straight = np.concatenate([straight_segments(segment.solution) for segment in solved])
    spectrum = straight_flight(recording.imu, recording.C_b_imu, straight)
    accepted, reasons = _judge(
        noise, rejected_before, rejected_after, beyond_spectrum(spectrum, model, noise)
    )
    notes = tuple(check.found for check in gaps)
    return FlightTuning(
        name=flight.name,
        accepted=accepted,
        reasons=reasons,
        noise=noise,
        static=recording.noise,
        model=model,
        lost_before=rejected_before,
        lost_after=rejected_after,
        straight=spectrum,
        dropped_correlated=dropped,
        notes=notes,
    )


def _read_without_exposures(flight: Flight) -> Recording:
    """Return the recording without its exposures. Raises InputError where its checks contradict the
    flight file.
    """
    if flight.gnss.stationary is not None:
        raise InputError(
            f"{flight.path}: gnss.stationary: a stationary IMU has no flight; `insgnss tune` takes"
            " its recording as a static one"
        )
    recording = read_recording(flight)
    contradictions = [
        check
        for check in recording.checks
        if check.verdict == "contradiction" and check.name not in flight.accept
    ]
    if contradictions:
        raise refusal(flight, contradictions[0], overruled=[contradictions[0].name])
    return replace(recording, cameras=())


def _moving_parts(segment: "Segment", recording: Recording) -> "list[Solution]":
    from ....navigation.innovations.pieces import moving_parts

    return moving_parts(segment.solution, recording.stationary.time)


def _estimate_noise(
    flight: Flight, parts: "list[Solution]", chosen: Sequence[str], progress: Progress
) -> "tuple[InFlightNoise, bool]":
    """Return the estimate, and whether it goes without the correlated error of the fixes that the
    solution adopted on its own.
    """
    from ....navigation.innovations.innovation_noise import GAIN_OF_CORRELATION, in_flight_noise
    from ....navigation.innovations.pieces import without_correlated

    adopted = [piece.problem.layout.gm >= 0 for piece in parts]
    if not any(adopted) or flight.gnss.gm_sigma != "auto":
        return in_flight_noise(parts, chosen, progress), False
    without_gm = [
        without_correlated(piece) if has else piece
        for piece, has in zip(parts, adopted, strict=True)
    ]
    white = in_flight_noise(without_gm, chosen, progress)
    if not all(adopted):
        return white, True
    with_gm = in_flight_noise(parts, chosen, progress)
    if white.at_best.cost - with_gm.at_best.cost < GAIN_OF_CORRELATION:
        return white, True
    return with_gm, False


def _rejections(solved: "list[Segment]") -> tuple[int, int]:
    """Count the fixes offered, and those rejected or used only after a covariance reset."""
    from ....navigation.filter.codes import COVARIANCE_RESET, NOT_MEASURED, POSITION_ROW, REJECTED

    verdict = np.concatenate([segment.solution.verdict[:, POSITION_ROW] for segment in solved])
    return int(np.count_nonzero(verdict != NOT_MEASURED)), int(
        np.isin(verdict, (REJECTED, COVARIANCE_RESET)).sum()
    )


def _count_rejections_with(
    flight: Flight, recording: Recording, offered: int, progress: Progress
) -> int:
    """Count the fixes of `offered` that are rejected with another noise.

    All those of a segment that cannot be solved with it count.
    """
    from ....flight.processing.solve_segments import solve_segments

    try:
        solved, _ = solve_segments(flight, recording, progress)
        offered_again, rejections = _rejections(solved)
    except InsgnssError:
        return offered
    return rejections + max(offered - offered_again, 0)


def _judge(
    noise: "InFlightNoise", lost_before: int, lost_after: int, beyond: Sequence[Beyond] = ()
) -> tuple[bool, tuple[str, ...]]:
    """Return whether the estimate replaces the static model, and why, sentence by sentence.

    beyond : white noise that the spectrum rules out.
    """
    from ....navigation.diagnosis.evidence import MORE_LOST
    from ....navigation.innovations.innovation_noise import SIGNIFICANT_CHANCE

    if not noise.free:
        undetermined = tuple(
            f"{TUNED[name]} not determined by this flight: {why}" for name, why in noise.held
        )
        return False, (*undetermined, *(_reasons_against(noise, ()) if noise.asks_for_more else ()))
    gain = (
        f"-2 log L falls by {noise.gain:.1f} with {noise.free}"
        f" factor{'s' if noise.free > 1 else ''}, chance {chance_of(noise.chance)}"
    )
    reasons = [f"{gain} (limit {SIGNIFICANT_CHANCE:g})"]
    if not noise.significant:
        return False, (*reasons, *longer_flight(noise))
    doubts = _reasons_against(noise, beyond)
    if doubts:
        return False, (*reasons, *doubts)
    before, after = noise.compared
    slack = NEARER * math.sqrt(2.0 / (3.0 * max(before.fixes, 1)))
    nearer = abs(after.nis - 1.0) <= abs(before.nis - 1.0) + slack
    reasons.append(
        f"NIS {before.nis:.3f} before, {after.nis:.3f} after"
        + (", the fixes scaled as estimated" if noise.scaled else "")
    )
    keeps_fixes = lost_after <= lost_before + MORE_LOST * before.fixes
    reasons.append(f"{lost_before} of {before.fixes} fixes rejected before, {lost_after} after")
    return nearer and keeps_fixes, tuple(reasons)


def _reasons_against(noise: "InFlightNoise", beyond: Sequence[Beyond]) -> list[str]:
    """Return why the factors stand for something other than white noise, sentence by sentence."""
    from ....navigation.innovations.innovation_noise import WHITE_ENOUGH

    doubts = []
    if noise.asks_for_more:
        undetermined = " and ".join(TUNED[name] for name, _ in noise.held)
        doubts.append(
            f"but the innovations rule out {undetermined} as the static model has it, by"
            f" {noise.loss:.1f} in -2 log L, and determine no other value"
        )
    for name, ratio in beyond:
        doubts.append(
            f"but {TUNED[name]} would be {ratio:.1f} times the quietest octave of straight flight,"
            " which white noise cannot be"
        )
    if doubts:
        doubts.append(
            "the drifts of the static model are not those of this IMU: name the noise model of a"
            " sensor of its kind in imu.noise, or tune its recordings at rest, and then repeat"
            " this command"
        )
    if not noise.white:
        whiteness = noise.at_best.whiteness
        doubts.append(
            f"but the innovations stay correlated, {np.abs(whiteness.lag_one).max():.2f} from fix"
            f" to fix and {whiteness.together.max():.2f} over {whiteness.lags} fixes (limit"
            f" {WHITE_ENOUGH:g}): they have"
            " another cause than white errors and IMU noise, such as fixes that the receiver has"
            " filtered, and the factors would absorb it"
        )
    return doubts
