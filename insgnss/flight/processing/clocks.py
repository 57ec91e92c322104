"""The clock of a run: which sensor the flight file's offsets move, so that products are in GPST.

`gnss.time_offset_s` is the difference of two clocks. Of less than `WHOLE_S` it is a latency of the
fixes, which are moved. More is a difference of scale or of zero: UTC, a time zone, a clock that
counts since power-up. Then the sensors are moved whose clock is not GPST, so that trajectory,
images and every other product count GPST whichever of both the key names:

- the IMU and what stands on its clock, by the offset reversed, where the fixes say their week, or
  where neither the IMU's stamps count from an epoch nor the offset is that of fixes in UTC (+18 s
  today) or since power-up (more than any time zone) beside an IMU in GPST;
- the fixes otherwise.

A barometer and other sensors move with the IMU unless more of their values lie within the recording
as they stand.

What the filter estimates of such a difference, a latency of milliseconds, is taken off the times of
trajectory and images where the fixes count GPST (`on_gpst`).
"""

from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np

from ...geodesy.gpstime import LEAP_NOW_S
from ...io.exposures.rig import ClockOffsets
from ...io.formats import split_unit
from ...navigation.diagnosis.estimated import constant
from ...navigation.filter.event_clock import delay_at
from ...records import Array, GnssFixes
from ..config.flight_file import Flight
from .segment import Segment

WHOLE_S = 0.5  # half of the smallest difference of scales, a leap second: latencies are below
FOUND_SIGMAS = 3.0  # of an offset, below which stamps stay on their grid: it may be noise
UNITS_SINCE_EPOCH = ("unix", "gps")  # units of time that count from an epoch begin so
# formats whose week is the flight file's unless their stamps count from an epoch: tables of any
# program
TABLES = ("gnss_text", "matlab", "npy")
FARTHEST_ZONE_S = 14.5 * 3600.0  # a time zone is at most 14 h off; in a week most times are later
LEAST_LEAP_S = 13.0  # GPST - UTC from 1999 on: no GNSS recording of a drone is older


def clock_offsets(flight: Flight, gnss: GnssFixes) -> ClockOffsets:
    """Return what is added to the stamps of each sensor, so that all count GPST.

    Parameters
    ----------
    flight : Flight
        The flight file, with `imu.time_offset_s` and `gnss.time_offset_s`.
    gnss : GnssFixes
        The fixes as their file has them.

    Returns
    -------
    ClockOffsets
        Their differences are those of the flight file.
    """
    imu_s, gnss_s = flight.imu.time_offset_s, flight.gnss.time_offset_s
    if abs(gnss_s) < WHOLE_S or not _fixes_are_gpst(flight, gnss):
        return ClockOffsets(imu_s, gnss_s, 0.0)
    return ClockOffsets(imu_s - gnss_s, 0.0, -gnss_s)


def fixes_say_gpst(flight: Flight, gnss: GnssFixes) -> bool:
    """Tell whether the stamps of a file of fixes are GPST by its format, to their last digit.

    Parameters
    ----------
    flight : Flight
        The flight file.
    gnss : GnssFixes
        The fixes as their file has them.

    Returns
    -------
    bool
        Of raw observations, and of a format that says its date, as it says its scale then.
    """
    of_file = flight.gnss.raw is not None or isinstance(flight.gnss.file, Path)
    return of_file and _is_dated(flight, gnss)


def unstated_offset(time: Array, offsets: ClockOffsets, span_s: Array) -> float:
    """Return what is added to the stamps of a sensor of which nothing says whose clock it has.

    Parameters
    ----------
    time : ndarray, (n,)
        Its stamps, s of the recording's week.
    offsets : ClockOffsets
        What is added to the stamps of other sensors.
    span_s : ndarray, (2,)
        First and last sample of the recording, s.
    """
    as_stated, moved = (
        np.sum((time + s >= span_s[0]) & (time + s <= span_s[1])) for s in (0.0, offsets.unstated)
    )
    return offsets.unstated if moved >= as_stated else 0.0


def on_gpst(time: Array, segments: Sequence[Segment]) -> Array:
    """Return instants on the clock of fixes in GPST.

    Parameters
    ----------
    time : ndarray, (n,)
        Instants within the segments on the clock that these were solved on, s.
    segments : sequence of Segment
        The solved segments, which estimate how both clocks differ.

    Returns
    -------
    ndarray, (n,)
        The same instants, s.
    """
    out = np.array(time)
    for segment in segments:
        solution = segment.solution
        rows = np.flatnonzero((time >= solution.time[0]) & (time <= solution.time[-1]))
        out[rows] -= segment.time_offset_s
        offset = solution.problem.layout.offset
        if offset >= 0 and (segment.time_offset_s or _is_found(*constant(solution, offset))):
            out[rows] -= delay_at(solution, time[rows])
    return out


def _is_found(value: float, sigma: float) -> bool:
    """Tell whether a flight finds an offset, rather than what noise makes of its prior."""
    return abs(value) > FOUND_SIGMAS * sigma


def _is_dated(flight: Flight, gnss: GnssFixes) -> bool:
    of_table = gnss.source_format in TABLES and flight.gps_week is not None
    says = not of_table or _counts_from_epoch(flight.gnss.units)
    return gnss.gps_week is not None and flight.gnss.columns is None and says


def _counts_from_epoch(units: Mapping[str, str] | None) -> bool:
    return split_unit((units or {}).get("time", "s"))[1].startswith(UNITS_SINCE_EPOCH)


def _fixes_are_gpst(flight: Flight, gnss: GnssFixes) -> bool:
    """Tell whether the fixes count GPST before `gnss.time_offset_s` is added."""
    if _is_dated(flight, gnss):
        return True  # a format that says its date says its scale, and is read as GPST
    if _counts_from_epoch(flight.imu.units):
        return False
    offset_s = flight.gnss.time_offset_s
    of_utc = LEAST_LEAP_S - WHOLE_S < offset_s < LEAP_NOW_S + WHOLE_S
    return not of_utc and offset_s < FARTHEST_ZONE_S
