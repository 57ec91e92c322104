"""The instants of exposures on the clock of a recording: the one place that stamps pass through.

Whose clock stamped them, the offsets that the flight file states, the week, what their digits lost
(`rounding`), whether names go with them (`numbering`), and the span that they have to lie in.
"""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from ...base.errors import InputError
from ...geodesy.gpstime import LEAST_WEEKS_APART_S, weeks_apart
from ...records import Array, CameraEvents, Finding, Question
from ...records.observations import in_week
from ..formats.text.clock import RANGES_S
from ..options.camera_options import CameraInput
from .numbering import with_numbering_note
from .rig import CameraExposures, ClockOffsets
from .rounding import with_stamp_rounding


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
