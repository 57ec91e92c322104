"""Gaps of the IMU: bridged where the recording shows how well that can be done, else cut.

An interval longer than `LEAST_GAP_INTERVALS` nominal ones lacks samples. Up to `BRIDGE_S` it is
bridged by the mean of the rates at its two ends (`increments`). What the body did meanwhile is
unknown, but the minute around the gap shows how far such a bridge is off: over every interval of
the same length that has its samples, the bridge is compared with what the sensors saw,

    d = (x[j] + x[j + k]) L / 2  -  sum of the increments from j to j + k                      (G.1)

and the mean square of d, channel by channel, is the variance that the filter adds
(`navigation.filter.kernels.error_model`, E.8). A standing vehicle is bridged to the noise of its
sensors, a turning one to degrees. Longer gaps divide the recording into segments that are aligned,
filtered and smoothed each on its own.
"""

import numpy as np

from ...base.errors import DataError
from ...records import Array, ImuSamples

# nominal intervals: a longer step lacks a sample at least, and stamps jitter by less than half of
# one
LEAST_GAP_INTERVALS = 1.5
# beyond it a turning drone's attitude would be known to tens of degrees, where linear theory ends
BRIDGE_S = 1.0
# on both sides of a gap (s): the minute that shows how far a bridge is off (chosen)
NEIGHBOURHOOD_S = 30.0
LEAST_COMPARISONS = 20  # comparisons below which the whole recording serves
# s: longer steps are pauses of the recording; no logger holds samples back for so long
PAUSE_S = 10.0
# gaps longer than this get an epoch at either end, so that what bridges them is a step of its own
EDGE_S = 0.1


def nominal_interval(time: Array) -> float:
    """Return the median sample interval, s."""
    step = np.diff(time[: min(time.size, 200_001)])
    return float(np.median(step))


def in_bunches(time: Array, nominal: float) -> str:
    """Return the intervals of stamps that come in bunches, pauses apart; else an empty text."""
    step = np.diff(time)
    mean = float(np.mean(step[step <= max(PAUSE_S, 3.0 * nominal_interval(time))]))
    return f"median interval {nominal:.3g} s, mean {mean:.3g} s" if nominal < 0.5 * mean else ""


def sample_lengths(time: Array) -> Array:
    """Return the time that each sample integrates, (n,) s; after a gap it is the nominal one."""
    nominal = nominal_interval(time)
    step = np.diff(time, prepend=time[0] - nominal)
    return np.where(step > LEAST_GAP_INTERVALS * nominal, nominal, step)


def find_gaps(time: Array, nominal: float) -> list[tuple[float, float]]:
    """Find every interval longer than `LEAST_GAP_INTERVALS` nominal ones.

    Returns
    -------
    list of tuple of float, s
        The time of the last sample before each gap, and its length.
    """
    step = np.diff(time)
    return [
        (float(time[i]), float(step[i]))
        for i in np.flatnonzero(step > LEAST_GAP_INTERVALS * nominal)
    ]


def limit(nominal: float) -> float:
    """Return the longest gap that is bridged, s."""
    return max(BRIDGE_S, 3.0 * nominal)


def segments(time: Array, lo: float, hi: float) -> list[tuple[float, float]]:
    """Return begin and end, s, of the segments of [lo, hi] between gaps that are not bridged."""
    nominal = nominal_interval(time)
    cuts = [
        (t, t + length)
        for t, length in find_gaps(time, nominal)
        if length > limit(nominal) and t + length > lo and t < hi
    ]
    edges = [lo, *(x for cut in cuts for x in cut), hi]
    return [(a, b) for a, b in zip(edges[::2], edges[1::2], strict=True) if b > a]


def edges(time: Array, lo: float, hi: float) -> Array:
    """Return the instants, s, at both ends of every gap of [lo, hi] longer than `EDGE_S`."""
    gaps = [g for g in find_gaps(time, nominal_interval(time)) if g[1] > EDGE_S]
    return np.array([x for t, length in gaps for x in (t, t + length) if lo < x < hi])


def bridged_variance(
    imu: ImuSamples, C_b_imu: Array, gaps: list[tuple[float, float]], marks: Array
) -> Array:
    """Return the variance of the increments that bridged gaps add.

    Parameters
    ----------
    imu : ImuSamples
        Samples in the sensor's axes.
    C_b_imu : ndarray, shape (3, 3)
        IMU axes to body.
    gaps : list of tuple of float, s
        Begin and length of the gaps.
    marks : ndarray, shape (m,), s

    Returns
    -------
    ndarray, shape (m, 6), rad^2 and m^2/s^2
        Variance since the mark before, in body axes; 0 where no gap is bridged.

    Raises
    ------
    DataError
        Where the gaps come so often that the recording has no unbroken interval as long as they
        are.
    """
    out = np.zeros((marks.size, 6))
    if not gaps:
        return out
    recording = _Seen(imu, C_b_imu)
    for t, length in gaps:
        first, last = np.searchsorted(marks, t, side="right"), np.searchsorted(marks, t + length)
        rows = np.arange(max(int(first), 1), min(int(last) + 1, marks.size))
        overlap = np.minimum(marks[rows], t + length) - np.maximum(marks[rows - 1], t)
        out[rows] += recording.variance(t, length) * np.maximum(overlap, 0.0)[:, None] / length
    return out


class _Seen:
    """Rates and summed increments of a recording in body axes."""

    def __init__(self, imu: ImuSamples, C_b_imu: Array) -> None:
        self.time, self.nominal = imu.time, nominal_interval(imu.time)
        scale = 1.0 / self.nominal if imu.quantity == "increments" else 1.0
        self.rate = scale * np.hstack([imu.gyro @ C_b_imu.T, imu.accel @ C_b_imu.T])
        self.sum = np.cumsum(self.rate * self.nominal, axis=0)
        self._known: dict[tuple[int, int], Array] = {}

    def variance(self, t: float, length: float) -> Array:
        """Return the mean square (6,) of (G.1) around `t`, once for each length and half minute.

        Raises DataError where there is nothing to compare.
        """
        k = max(round(length / self.nominal), 2)
        key = (k, int((t - self.time[0]) / NEIGHBOURHOOD_S))
        if key not in self._known:
            around = [t - NEIGHBOURHOOD_S, t + length + NEIGHBOURHOOD_S]
            first, last = np.searchsorted(self.time, around)
            near = self._misses(k, int(first), int(last))
            if near.shape[0] < LEAST_COMPARISONS:
                near = self._misses(k, 0, self.time.size)
            if not near.shape[0]:
                raise DataError(
                    f"gap of {length:.3f} s at {t:.3f} s: no gap-free part of the recording is"
                    " long enough to show how well this gap is bridged; record without gaps"
                )
            self._known[key] = np.mean(near**2, axis=0)
        return self._known[key]

    def _misses(self, k: int, first: int, last: int) -> Array:
        j = np.arange(first, max(last - k, first), max(1, k // 4), dtype=np.int64)
        length = self.time[np.minimum(j + k, self.time.size - 1)] - self.time[j]
        j = j[np.abs(length - k * self.nominal) < 0.6 * self.nominal]
        bridge = 0.5 * (self.rate[j] + self.rate[j + k]) * (k * self.nominal)
        return bridge - (self.sum[j + k] - self.sum[j])
