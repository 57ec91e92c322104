"""The history of a run: what was done, sentence by sentence, as its products carry it."""

from collections.abc import Iterable, Iterator, Sequence

import numpy as np

from ...base import __version__
from ...io.exposures.rig import ClockOffsets
from ...io.options.camera_options import CameraInput
from ...navigation.diagnosis.estimated import state_verdicts
from ...navigation.filter.codes import (
    BAROMETER_ROW,
    COVARIANCE_RESET,
    POSITION_ROW,
    USED,
    VELOCITY_CONSTRAINT,
)
from ...navigation.filter.event_clock import event_delay
from ...records import Finding
from ..config.flight_file import Flight
from .recording import Recording
from .segment import Segment
from .segment_checks import offered_and_rejected

AIDS = {
    VELOCITY_CONSTRAINT: "zero-velocity updates and non-holonomic constraints",
    BAROMETER_ROW: "heights of the barometer",
}


def run_history(
    flight: Flight, recording: Recording, segments: Sequence[Segment], checks: Iterable[Finding]
) -> tuple[str, ...]:
    """Say what was done.

    Parameters
    ----------
    flight : Flight
        The flight file.
    recording : Recording
        The recording.
    segments : sequence of Segment
        The solved segments.
    checks : iterable of Finding
        All checks of the run.

    Returns
    -------
    tuple of str
        The sentences.
    """
    lever = flight.mounting.antenna_lever_b
    first, later = segments[0], segments[1:]
    gap_count = sum(len(segment.solution.problem.inc.gaps) for segment in segments)
    overruled = [check for check in checks if check.verdict == "contradiction"]
    return (
        _filter(segments, recording.gps_week),
        _fixes(flight, segments),
        recording.covariances,
        (
            f"lever arm from IMU to antenna applied, forward right down: {lever[0]:.4f} "
            f"{lever[1]:.4f} {lever[2]:.4f} m"
        ),
        f"noise model {flight.imu.noise}; IMU axes {flight.imu.axes}; {'; '.join(first.history)}",
        *(f"segment from {s.solution.time[0]:.1f} s on: {'; '.join(s.history)}" for s in later),
        *_aids(segments),
        *([recording.turn_on] if recording.turn_on else []),
        *_clocks(recording.offsets),
        *_estimates(segments),
        *_events(flight, recording, segments),
        f"{gap_count} IMU gaps bridged; heights ellipsoidal (WGS84)",
        "lever arm IMU to camera and bore-sight applied",
        *(f"contradiction overruled by the flight file: {c.name}: {c.found}" for c in overruled),
    )


def _filter(segments: Sequence[Segment], gps_week: int) -> str:
    passes = max(segment.solution.passes for segment in segments)
    return (
        f"insgnss {__version__}; smoothed solution of {segments[0].solution.problem.layout.size} "
        f"states, {passes} filter pass{'es' if passes > 1 else ''}; GPST week {gps_week}"
    )


def _fixes(flight: Flight, segments: Sequence[Segment]) -> str:
    verdict = np.concatenate([segment.solution.verdict[:, POSITION_ROW] for segment in segments])
    used = int(np.isin(verdict, (USED, COVARIANCE_RESET)).sum())
    resets = int((verdict == COVARIANCE_RESET).sum())
    fixes = sum(segment.fixes.time.size for segment in segments)
    return (
        f"GNSS: {used} of {fixes} fixes used, innovation gate {flight.gnss.gate_sigma:g} sigma, "
        f"{resets} covariance reset{'' if resets == 1 else 's'} after rejected fixes"
    )


def _aids(segments: Sequence[Segment]) -> Iterator[str]:
    for kind, name in AIDS.items():
        offered, rejected = offered_and_rejected(segments, kind)
        if offered:
            yield f"{name}: {offered} offered, {offered - rejected} used"


def _events(flight: Flight, recording: Recording, segments: Sequence[Segment]) -> Iterator[str]:
    """Say whose clock stamps the exposures, and by how much they were moved with it."""
    if flight.camera is None:
        return
    for k, (options, exposures) in enumerate(
        zip(flight.camera.all_of_rig, recording.cameras, strict=False)
    ):
        which = f" of {exposures.name}" if len(recording.cameras) > 1 else ""
        yield from _clock(recording.offsets, options, exposures.clock, which, segments, k)


def _clock(
    offsets: ClockOffsets,
    camera: CameraInput,
    clock: str,
    which: str,
    segments: Sequence[Segment],
    number: int,
) -> Iterator[str]:
    """Say it of one camera."""
    how = f"camera.clock = {camera.clock}"
    if clock == "imu":
        moved = ", stamps not moved"
        if camera.clock != "auto":
            moved = f", moved by {offsets.imu:+.4f} s"
        yield (f"camera events{which} on the IMU's clock ({how}){moved if offsets.imu else ''}")
        return
    moves = [
        offsets.gnss + segment.time_offset_s + event_delay(segment.solution)[exposed.instant]
        for segment in segments
        if (exposed := segment.exposed[number]).rows.size
    ]
    if moves:
        ms = 1e3 * np.concatenate(moves)
        yield (
            f"camera events{which} on the receiver's clock ({how}), moved with the fixes by "
            f"{ms.min():+.3f} to {ms.max():+.3f} ms"
        )


def _clocks(offsets: ClockOffsets) -> Iterator[str]:
    """Say that the IMU was moved onto the clock of the fixes."""
    if offsets.unstated:
        yield (
            f"time stamps of the IMU moved by {offsets.imu:+.4f} s to GPST, the clock of the "
            "fixes (gnss.time_offset_s); all products count GPST"
        )


def _estimates(segments: Sequence[Segment]) -> Iterator[str]:
    """Say by how much the stamps were moved, and what the longest segment estimates."""
    for segment in segments:
        if segment.time_offset_s:
            yield f"time stamps of the fixes moved by {segment.time_offset_s:+.4f} s"
    longest = max(segments, key=lambda segment: segment.solution.time.size)
    for state in state_verdicts(longest.solution, longest.time_offset_s, longest.stated):
        yield (
            f"estimated: {state.name} {state.value:.4g} +- {state.sigma:.2g}, "
            f"{'' if state.observed else 'not '}observed by this flight"
        )
