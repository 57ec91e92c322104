"""One clock for all sensors: seconds of one GPS week, and the span that IMU and GNSS share."""

from dataclasses import replace
from typing import TypeVar

import numpy as np

from ..base.errors import DataError, InputError
from ..geodesy.gpstime import WEEK_S, weeks_apart
from ..records import BarometerHeights, CameraEvents, GnssFixes, ImuSamples

Timed = TypeVar("Timed", ImuSamples, GnssFixes, CameraEvents, BarometerHeights)
NO_WEEK = 0  # in the place of a week that nothing gives; no flight file may hold it
SHORTEST_S = 10.0
LONG_S = 43200.0  # of recordings: between longer ones whole weeks are no finding, ms look like them


def common_clock(
    imu: ImuSamples, gnss: GnssFixes, events: CameraEvents | None, gps_week: int | None
) -> tuple[ImuSamples, GnssFixes, CameraEvents | None, int]:
    """Put the times of all records into seconds of one week.

    Parameters
    ----------
    imu : ImuSamples
    gnss : GnssFixes
    events : CameraEvents or None
    gps_week : int or None
        The week; None takes the first one that a record has. A record without a week is taken to be
        of that week.

    Returns
    -------
    tuple of ImuSamples, GnssFixes, CameraEvents or None, int
        The records and the week.

    Raises
    ------
    InputError
        Where no record has a week and none is given.
    """
    weeks = [r.gps_week for r in (imu, gnss, events) if r is not None and r.gps_week is not None]
    week = gps_week if gps_week is not None else (weeks[0] if weeks else None)
    if week is None:
        raise InputError(
            f"{imu.source}: no file gives the GPS week; give gps_week in the flight file"
        )
    return (
        in_week(imu, week),
        in_week(gnss, week),
        None if events is None else in_week(events, week),
        week,
    )


def in_week(record: Timed, week: int) -> Timed:
    """Return the record with its times in seconds of `week`.

    A record without a week of its own is taken to be of that week.
    """
    if record.gps_week in (None, week):
        return replace(record, gps_week=week)
    return replace(record, time=record.time + (record.gps_week - week) * WEEK_S, gps_week=week)


def common_span(
    imu: ImuSamples, gnss: GnssFixes, start: float | None, end: float | None
) -> tuple[float, float]:
    """Find the span that IMU and GNSS share.

    Parameters
    ----------
    imu : ImuSamples
    gnss : GnssFixes
    start, end : float or None, s
        Limits of the flight; None where there is none.

    Returns
    -------
    tuple of float, s
        The first fix within the IMU recording and the end of the recording, both cut to [start,
        end].

    Raises
    ------
    InputError
        Where IMU and GNSS do not overlap.
    DataError
        Where they overlap by less than `SHORTEST_S`.
    """
    lo = max(imu.time[0], -np.inf if start is None else start)
    hi = min(imu.time[-1], np.inf if end is None else end)
    inside = gnss.time[(gnss.time >= lo) & (gnss.time <= hi)]
    spans = (
        f"{gnss.source}: fixes from {gnss.time[0]:.1f} to {gnss.time[-1]:.1f} s, {imu.source}:"
        f" samples from {imu.time[0]:.1f} to {imu.time[-1]:.1f} s of week {imu.gps_week}"
    )
    for key, value in (("start_tow", start), ("end_tow", end)):
        spans += "" if value is None else f", {key} = {value:.1f} s"
    if gnss.time[-1] < lo or gnss.time[0] > hi:
        apart = float(gnss.time[0] + gnss.time[-1] - imu.time[0] - imu.time[-1]) / 2.0
        slack = float(gnss.time[-1] - gnss.time[0] + imu.time[-1] - imu.time[0]) / 2.0
        if slack < LONG_S and (weeks := weeks_apart(apart, slack)):
            raise InputError(f"{spans}: they are {weeks} apart; give all times as of one week")
        raise InputError(
            f"{spans}: they do not overlap; check gps_week, the day, start_tow and end_tow,"
            " time_offset_s, seconds against milliseconds"
        )
    length = inside[-1] - inside[0] if inside.size else 0.0
    if inside.size < 2 or length < SHORTEST_S:
        fixes = f"{inside.size} fix{'' if inside.size == 1 else 'es'}"
        raise DataError(
            f"{spans}: {fixes} over {length:.1f} s in common (limit {SHORTEST_S:.0f} s); give the"
            " whole recordings, or check their clocks"
        )
    return float(inside[0]), float(hi)


def cut_fixes(gnss: GnssFixes, lo: float, hi: float) -> GnssFixes:
    """Return the fixes within [lo, hi], s."""
    first, last = np.searchsorted(gnss.time, lo), np.searchsorted(gnss.time, hi, side="right")
    return gnss[int(first) : int(last)]


def cut_samples(imu: ImuSamples, lo: float, hi: float) -> ImuSamples:
    """Return the samples within [lo, hi], s; all of them where fewer than two lie within."""
    first, last = np.searchsorted(imu.time, [lo, hi])
    if last - first < 2:
        return imu
    return replace(
        imu, time=imu.time[first:last], gyro=imu.gyro[first:last], accel=imu.accel[first:last]
    )


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
    return take_events(events, np.flatnonzero(keep))


def take_events(events: CameraEvents, indices: np.ndarray) -> CameraEvents:
    """Return the events of the indices `indices`."""
    return events[indices]


def refuse_outside(events: CameraEvents, lo: float, hi: float) -> None:
    """Raise InputError where an exposure lies outside [lo, hi], s."""
    outside = np.flatnonzero((events.time < lo) | (events.time > hi))
    if outside.size:
        k = int(outside[0])
        middle = 0.5 * (lo + hi)
        apart = weeks_apart(float(events.time[k]) - middle, min(0.5 * (hi - lo), LONG_S))
        if apart:
            raise InputError(
                f"{events.source}: image {events.images[k]} at {events.time[k]:.3f} s is {apart}"
                f" apart from the flight, {lo:.3f} to {hi:.3f} s of IMU and GNSS ({outside.size} of"
                f" {len(events.images)} images); give all times as of one week"
            )
        raise InputError(
            f"{events.source}: image {events.images[k]} at {events.time[k]:.3f} s is outside the"
            f" flight, {lo:.3f} to {hi:.3f} s of IMU and GNSS ({outside.size} of"
            f" {len(events.images)} images); check the time scale of the events (UTC is 18 s behind"
            " GPS time) or remove these lines"
        )
