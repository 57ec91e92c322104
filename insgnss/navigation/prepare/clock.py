"""One clock for all sensors: seconds of one GPS week, and the span that two of them share."""

import numpy as np

from ...base.errors import DataError, InputError
from ...geodesy.gpstime import LEAST_WEEKS_APART_S, weeks_apart
from ...records import Array, GnssFixes, ImuSamples

NO_WEEK = 0  # in the place of a week that nothing gives; no flight file may hold it
# that IMU and GNSS share (s): the shortest window of the coarse alignment
SHORTEST_OVERLAP_S = 10.0
# ratio: a recording of a flight that lasts so much longer than another has stamps of another unit;
# units that are mistaken for each other differ by 10 and more, loggers run on for less (chosen)
UNITS_APART = 8.0


def common_week(
    imu: ImuSamples, gnss: GnssFixes, gps_week: int | None, otherwise: int | None = None
) -> int:
    """Return the GPS week whose seconds all records are to count.

    Parameters
    ----------
    imu : ImuSamples
    gnss : GnssFixes
    gps_week : int or None
        The week; None takes the first one that a record has. A record without a week is taken to be
        of that week.
    otherwise : int or None
        The week of another record, such as the camera's events, where neither of both has one.

    Raises
    ------
    InputError
        Where no record has a week and none is given.
    """
    weeks = (gps_week, imu.gps_week, gnss.gps_week, otherwise)
    week = next((week for week in weeks if week is not None), None)
    if week is None:
        raise InputError(
            f"{imu.source}: no file gives the GPS week; give gps_week in the flight file"
        )
    return week


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
        Where they overlap by less than `SHORTEST_OVERLAP_S`.
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
        distance = float(gnss.time[0] + gnss.time[-1] - imu.time[0] - imu.time[-1]) / 2.0
        slack = float(gnss.time[-1] - gnss.time[0] + imu.time[-1] - imu.time[0]) / 2.0
        if slack < LEAST_WEEKS_APART_S and (weeks := weeks_apart(distance, slack)):
            raise InputError(f"{spans}: they are {weeks} apart; give all times in one week")
        raise InputError(
            f"{spans}: they do not overlap{unit_of_stamps(imu.time, gnss.time, 'samples', 'fixes')}"
            "; check gps_week, the day, start_tow and end_tow, time_offset_s, or let `insgnss"
            " inspect` find how their clocks differ"
        )
    length = inside[-1] - inside[0] if inside.size else 0.0
    if inside.size < 2 or length < SHORTEST_OVERLAP_S:
        fixes = f"{inside.size} fix{'' if inside.size == 1 else 'es'}"
        raise DataError(
            f"{spans}: {fixes} over {length:.1f} s in common (limit {SHORTEST_OVERLAP_S:.0f} s);"
            " give the whole recordings, or check their clocks"
        )
    return float(inside[0]), float(hi)


def unit_of_stamps(time: Array, other: Array, name: str, others: str) -> str:
    """Say which unit of the stamps of two recordings would make them last alike.

    Parameters
    ----------
    time, other : ndarray, shape (n,) and (k,), s
        Stamps of both.
    name, others : str
        What each recording holds, such as "samples" and "fixes".

    Returns
    -------
    str
        A clause of a message; empty where they last alike within `UNITS_APART`.
    """
    lengths_s = [float(stamps[-1] - stamps[0]) for stamps in (time, other)]
    if min(lengths_s) <= 0.0 or max(lengths_s) < UNITS_APART * min(lengths_s):
        return ""
    ratio = lengths_s[0] / lengths_s[1]
    longer = f"{ratio:.4g} times as long as" if ratio > 1.0 else f"1/{1.0 / ratio:.4g} as long as"
    return (
        f", and the {name} last {longer} the {others}: if both are whole recordings of one flight,"
        f" units.time of the {name} is to be {1.0 / ratio:.4g} times what it is, or that of the"
        f" {others} {ratio:.4g} times (25.6: counts of 39.0625 us taken for 1 ms)"
    )


def cut_fixes(gnss: GnssFixes, lo: float, hi: float) -> GnssFixes:
    """Return the fixes within [lo, hi], s."""
    first, last = np.searchsorted(gnss.time, lo), np.searchsorted(gnss.time, hi, side="right")
    return gnss[int(first) : int(last)]


def cut_samples(imu: ImuSamples, lo: float, hi: float) -> ImuSamples:
    """Return the samples within [lo, hi], s; all of them where fewer than two lie within."""
    first, last = np.searchsorted(imu.time, [lo, hi])
    if last - first < 2:
        return imu
    return imu[int(first) : int(last)]
