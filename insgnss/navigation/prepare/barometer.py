"""Heights of a barometer as the filter takes them: one a second, on the level of the fixes.

A barometer samples ten times a second and more, but its errors (gusts, the air of the propellers)
stay for about one: the mean of each second is one measurement, at the mean of its stamps. Its level
is that of the weather, of the geoid or of the place where it was switched on. The median of its
difference from the fixes takes most of that off, and the filter's bias (K.12) has the rest.
"""

import numpy as np

from ...base.errors import InputError
from ...records import Array, BarometerHeights, GnssFixes, ImuSamples
from .clock import common_span, unit_of_stamps

# over which heights are averaged (s): gusts and propellers err alike for about as long
AVERAGING_S = 1.0


def level_heights(barometer: BarometerHeights, fixes: GnssFixes, lo: float, hi: float) -> Array:
    """Return one height a second on the level of the fixes.

    Parameters
    ----------
    barometer : BarometerHeights
        The heights, in seconds of the same week as the fixes.
    fixes : GnssFixes
        The fixes.
    lo, hi : float
        The span that is wanted, s.

    Returns
    -------
    ndarray, shape (k, 2)
        Time, s, and height above the ellipsoid, m; none where the barometer has no sample between
        `lo` and `hi`.
    """
    inside = (barometer.time >= lo) & (barometer.time <= hi)
    time, height = barometer.time[inside], barometer.height[inside]
    if time.size == 0:
        return np.zeros((0, 2))
    second = np.floor((time - lo) / AVERAGING_S).astype(np.int64)
    first = np.flatnonzero(np.diff(second, prepend=-1))
    count = np.diff(np.append(first, time.size))
    means = [np.add.reduceat(values, first) / count for values in (time, height)]
    of_fixes = np.interp(means[0], fixes.time, fixes.height)
    return np.column_stack([means[0], means[1] + np.median(of_fixes - means[1])])


def refuse_apart(barometer: BarometerHeights, imu: ImuSamples, fixes: GnssFixes) -> None:
    """Raise InputError where a barometer and the IMU share no time: of the IMU, if it is alone."""
    if barometer.time[-1] < imu.time[0] or barometer.time[0] > imu.time[-1]:
        common_span(imu, fixes, None, None)
        unit = unit_of_stamps(barometer.time, imu.time, "heights", "samples")
        raise InputError(
            f"{barometer.source}: heights from {barometer.time[0]:.1f} to {barometer.time[-1]:.1f}"
            f" s, {imu.source}: samples from {imu.time[0]:.1f} to {imu.time[-1]:.1f} s of week"
            f" {imu.gps_week}: they do not overlap{unit}; check barometer.time_offset_s and"
            " gps_week"
        )
