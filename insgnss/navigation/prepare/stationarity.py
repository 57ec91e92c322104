"""Stationarity detection: periods of zero velocity and zero rotation, from the IMU and GNSS.

The periods found here become zero-velocity updates (ZUPT) of the filter. A sensor at rest feels a
constant. With the mean of a window unknown (it holds bias, gravity and Earth rate), the generalised
likelihood ratio of "constant" against "anything" is the variance about the window's own mean over
the sensor's noise (Skog, Haendel, Nilsson, Rantakokko 2010, with bias and attitude unknown):

    T = (1/3N) sum over samples and axes of (x - mean)^2 / sigma^2,   at rest about 1          (Z.1)

for each triad; both must be quiet. The noise is the recording's own: sigma^2 is taken from its
quietest windows, those that GNSS confirms where it can. What counts as quiet has an upper limit all
the same (`MAX_...`), so that a recording that never stands has no stationary period. White noise
makes the means of sub-windows vary by sigma^2 / n only; what they vary beyond that is slow motion:

    s^2 = var(block means) - var(samples) (blocks - 1) / samples                               (Z.2)

A smooth cruise at constant velocity looks stationary to an IMU. GNSS excludes it: the displacement
over the window, and the velocity where the receiver gives one, must be zero within three of their
standard deviations. A hovering drone is stationary for GNSS but vibrates; (Z.1) and its upper
limits exclude it. Where GNSS is absent or too poor to decide, the IMU alone decides.

Skog, Haendel, Nilsson, Rantakokko (2010) "Zero-velocity detection - an algorithm evaluation", IEEE
Trans. Biomed. Eng. 57(11).
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ...records import Array, GnssFixes, ImuSamples
from ...records.interpolation import columns_at
from .gaps import nominal_interval

# whose sums are kept (s): windows and their edges are whole numbers of it (chosen)
MOTION_BLOCK_S = 0.1
WINDOW_BLOCKS = 10  # blocks of a window: one second shows whether a vehicle sways (chosen)
EDGE_BLOCKS = 2  # cut off at both ends: motion may have begun in the window's last blocks
MIN_LENGTH_S = 1.0  # of a stationary period (s): that of a window
# of (Z.1): three times the noise of the quietest second; five times (wind, an idling engine)
STATIONARY_RATIO, RATIO_CONFIRMED = 9.0, 25.0
QUIETEST = 10  # windows that give the noise
# rad/s, m/s^2, least noise assumed: some sensors round what is small to zero
FLOOR_GYRO, FLOOR_ACCEL = 5e-4, 5e-3
# rad/s, m/s^2, standard deviation of samples: no sensor of a drone is noisier at rest
MAX_GYRO, MAX_ACCEL = 0.02, 0.3
MAX_SLOW_GYRO, MAX_SLOW_ACCEL = 3e-3, 0.05  # rad/s, m/s^2, of (Z.2)
# rad/s: of the mean rate, and of its difference to that of the other periods
MAX_BIAS, BIAS_SPREAD = 0.1, 0.01
# m/s^2, mean specific force of a sensor at rest: gravity, biases and scale factors
NORM_LOW, NORM_HIGH = 9.0, 10.6
GNSS_SIGMAS, WANDER_MS = 3.0, 0.1  # GNSS: errors of a stationary receiver wander at a few cm/s
USEFUL_MS = 1.5  # m/s, a GNSS that cannot exclude more than this confirms nothing

MOVING, UNKNOWN, CONFIRMED = -1, 0, 1  # what GNSS shows of a window


@dataclass(frozen=True, eq=False)
class StationaryPeriods:
    """The k stationary periods of a recording, with statistics of their samples.

    They stand in the order of time. Means and standard deviations are those of single samples in
    the IMU's own axes.

    Parameters
    ----------
    time : ndarray, shape (k, 2), s
        Start and end.
    gyro_mean : ndarray, shape (k, 3), rad/s
    accel_mean : ndarray, shape (k, 3), m/s^2
    gyro_std : ndarray, shape (k, 3), rad/s
    accel_std : ndarray, shape (k, 3), m/s^2
    samples : ndarray of int, shape (k,)
        Number of samples.
    """

    time: Array
    gyro_mean: Array
    accel_mean: Array
    gyro_std: Array
    accel_std: Array
    samples: NDArray[np.int64]

    def __len__(self) -> int:
        return len(self.time)

    def index_of(self, time: Array) -> NDArray[np.int64]:
        """Return the index of the period that holds each of the instants `time` (n,) s.

        It is -1 outside all of them.
        """
        if not len(self):
            return np.full(np.shape(time), -1, dtype=np.int64)
        k = np.searchsorted(self.time[:, 0], time, side="right") - 1
        return np.where((k >= 0) & (np.asarray(time) <= self.time[np.maximum(k, 0), 1]), k, -1)

    def where(self, which: NDArray[np.bool_]) -> "StationaryPeriods":
        """Return the periods for which `which` (k,) is true."""
        return StationaryPeriods(
            *(getattr(self, name)[which] for name in self.__dataclass_fields__)
        )


@dataclass(frozen=True, eq=False)
class _Sums:
    """Counts, sums and sums of squares of the samples in blocks of `length` s from `start` on.

    count is (b,); first and second are (b, 6), about `reference` (6,).
    """

    start: float
    length: float
    count: Array
    first: Array
    second: Array
    reference: Array

    def edge(self, block: NDArray[np.int64]) -> Array:
        """Times, s, at which the blocks begin."""
        return np.asarray(self.start + self.length * block, dtype=np.float64)

    def over(self, lo: NDArray[np.int64], hi: NDArray[np.int64]) -> tuple[Array, Array, Array]:
        """Number of samples (w,), mean and variance (w, 6) of windows of blocks lo to hi - 1."""
        n, s1, s2 = (_sums_between(x, lo, hi) for x in (self.count, self.first, self.second))
        per = np.maximum(n, 1.0)[:, None]
        return n, s1 / per + self.reference, np.maximum(s2 / per - (s1 / per) ** 2, 0.0)

    def between_blocks(self, lo: NDArray[np.int64], hi: NDArray[np.int64]) -> Array:
        """Variance (w, 6) of the block means of each window."""
        mean = self.first / np.maximum(self.count, 1.0)[:, None]
        n = np.maximum(_sums_between(self.count, lo, hi), 1.0)[:, None]
        middle = _sums_between(self.first, lo, hi) / n
        return np.maximum(_sums_between(self.first * mean, lo, hi) / n - middle**2, 0.0)


def stationary_periods(imu: ImuSamples, gnss: GnssFixes | None = None) -> StationaryPeriods:
    """Detect the stationary periods, of a second and longer (Z.1, Z.2).

    Parameters
    ----------
    imu : ImuSamples
        Samples in any axes.
    gnss : GnssFixes, optional
        Fixes on the same clock; they confirm that the vehicle stands and exclude a smooth cruise.

    Returns
    -------
    StationaryPeriods
    """
    sums = _block_sums(imu)
    blocks = sums.count.size
    if blocks < WINDOW_BLOCKS:
        return _periods_of(sums, np.empty((0, 2), dtype=np.int64))
    lo = np.arange(blocks - WINDOW_BLOCKS + 1)
    hi = lo + WINDOW_BLOCKS
    full = (
        _sums_between((sums.count < 0.5 * np.median(sums.count)).astype(np.float64), lo, hi) == 0.0
    )
    by_gnss = _seen_by_gnss(gnss, sums.edge(lo), sums.edge(hi))
    quiet = _quiet(sums, lo, hi, full & (by_gnss != MOVING), by_gnss)
    periods = _periods_of(sums, _runs(quiet, sums))
    time = periods.time
    stands = _seen_by_gnss(gnss, time[:, 0], time[:, 1]) != MOVING
    if stands.any():
        often = periods.samples[stands] // 50 + 1
        usual = np.median(np.repeat(periods.gyro_mean[stands], often, axis=0), axis=0)
        stands &= np.abs(periods.gyro_mean - usual).max(axis=1) < BIAS_SPREAD
    return periods.where(stands)


def _sums_between(x: Array, lo: NDArray[np.int64], hi: NDArray[np.int64]) -> Array:
    """Sums of the rows lo to hi - 1."""
    total = np.concatenate([np.zeros((1, *x.shape[1:])), np.cumsum(x, axis=0)])
    return total[hi] - total[lo]


def _block_sums(imu: ImuSamples) -> _Sums:
    """Sums over blocks of equal time, three samples or more each."""
    from ._kernels import add_up

    start, nominal = float(imu.time[0]), nominal_interval(imu.time)
    length = max(MOTION_BLOCK_S, 3.0 * nominal)
    edges = np.searchsorted(imu.time, np.arange(start, imu.time[-1] + 1e-9, length) - 1e-9)
    count = np.diff(edges).astype(np.float64)
    rate = 1.0 / nominal if imu.quantity == "increments" else 1.0
    # products with a vector: numpy's mean over so many rows of three takes twenty times as long
    mean = np.full(imu.time.size, 1.0 / imu.time.size)
    reference = np.concatenate([mean @ imu.gyro, mean @ imu.accel])
    sums = np.zeros((2, count.size, 6))
    add_up(imu.gyro, edges, reference[:3], sums[:, :, :3])
    add_up(imu.accel, edges, reference[3:], sums[:, :, 3:])
    scale = np.array([rate, rate**2])[:, None, None]
    sums *= scale
    return _Sums(start, length, count, sums[0], sums[1], rate * reference)


def _quiet(
    sums: _Sums,
    lo: NDArray[np.int64],
    hi: NDArray[np.int64],
    allowed: NDArray[np.bool_],
    by_gnss: NDArray[np.int8],
) -> NDArray[np.bool_]:
    """Which windows are stationary, of those `allowed`."""
    n, mean, variance = sums.over(lo, hi)
    white = variance * ((WINDOW_BLOCKS - 1) / np.maximum(n, 1.0))[:, None]
    slow = sums.between_blocks(lo, hi) - white
    gyro, accel = variance[:, :3].mean(axis=1), variance[:, 3:].mean(axis=1)
    norm = np.linalg.norm(mean[:, 3:], axis=1)
    candidate = (
        allowed
        & (gyro < MAX_GYRO**2)
        & (accel < MAX_ACCEL**2)
        & (norm > NORM_LOW)
        & (norm < NORM_HIGH)
    )
    candidate &= slow[:, :3].mean(axis=1) < MAX_SLOW_GYRO**2
    candidate &= slow[:, 3:].mean(axis=1) < MAX_SLOW_ACCEL**2
    candidate &= np.abs(mean[:, :3]).max(axis=1) < MAX_BIAS
    if not candidate.any():
        return candidate
    sure = candidate & (by_gnss == CONFIRMED)
    base = np.flatnonzero(sure if sure.sum() >= QUIETEST else candidate)
    gyro, accel = np.maximum(gyro, FLOOR_GYRO**2), np.maximum(accel, FLOOR_ACCEL**2)
    best = base[np.argsort(gyro[base] * accel[base], kind="stable")[:QUIETEST]]
    ratio = np.where(by_gnss == CONFIRMED, RATIO_CONFIRMED, STATIONARY_RATIO)
    return (
        candidate
        & (gyro <= ratio * np.median(gyro[best]))
        & (accel <= ratio * np.median(accel[best]))
    )


def _runs(quiet: NDArray[np.bool_], sums: _Sums) -> NDArray[np.int64]:
    """First block and block after the last (k, 2) of every long enough run of quiet windows.

    The ends of each run are cut by `EDGE_BLOCKS`.
    """
    covered = np.zeros(sums.count.size + 1)
    np.add.at(covered, np.flatnonzero(quiet), 1.0)
    np.add.at(covered, np.flatnonzero(quiet) + WINDOW_BLOCKS, -1.0)
    inside = np.concatenate([[False], np.cumsum(covered)[:-1] > 0.5, [False]])
    edges = np.flatnonzero(np.diff(inside.astype(np.int8))).reshape(-1, 2)
    edges += [EDGE_BLOCKS, -EDGE_BLOCKS]
    long = (edges[:, 1] - edges[:, 0]) * sums.length >= MIN_LENGTH_S - 1e-9
    return np.asarray(edges[long], dtype=np.int64)


def _periods_of(sums: _Sums, runs: NDArray[np.int64]) -> StationaryPeriods:
    n, mean, variance = sums.over(runs[:, 0], runs[:, 1])
    std = np.asarray(np.sqrt(variance), dtype=np.float64)
    return StationaryPeriods(
        sums.edge(runs), mean[:, :3], mean[:, 3:], std[:, :3], std[:, 3:], n.astype(np.int64)
    )


def _seen_by_gnss(gnss: GnssFixes | None, begin: Array, end: Array) -> NDArray[np.int8]:
    """MOVING, UNKNOWN or CONFIRMED stationary, (w,), in the windows begin to end, (w,) s each."""
    motion = np.full(begin.size, UNKNOWN, dtype=np.int8)
    if gnss is None or gnss.time.size < 2 or not begin.size:
        return motion
    from ...geodesy.frames import LocalFrame

    frame = LocalFrame(float(gnss.lat[0]), float(gnss.lon[0]), float(gnss.height[0]))
    position = frame.position_from_geodetic(gnss.lat, gnss.lon, gnss.height)
    sigma = np.sqrt(np.diagonal(gnss.cov_ned, axis1=1, axis2=2))
    length = (end - begin)[:, None]
    moved = columns_at(end, gnss.time, position) - columns_at(begin, gnss.time, position)
    sigmas = columns_at(begin, gnss.time, sigma), columns_at(end, gnss.time, sigma)
    speeds = [(moved / length, np.hypot(*sigmas) / length)]
    if gnss.velocity_ned is not None and gnss.velocity_cov_ned is not None:
        sigma_v = np.sqrt(np.diagonal(gnss.velocity_cov_ned, axis1=1, axis2=2))
        middle = 0.5 * (begin + end)
        velocity = columns_at(middle, gnss.time, gnss.velocity_ned)
        speeds.append((velocity, columns_at(middle, gnss.time, sigma_v)))
    covered = _windows_between_fixes(gnss.time, begin, end)
    for speed, deviation in speeds:
        useful = GNSS_SIGMAS * deviation.max(axis=1) < USEFUL_MS
        motion[covered & (motion == UNKNOWN) & useful] = CONFIRMED
        motion[covered & (np.abs(speed) > GNSS_SIGMAS * deviation + WANDER_MS).any(axis=1)] = MOVING
    return motion


def _windows_between_fixes(time: Array, begin: Array, end: Array) -> NDArray[np.bool_]:
    """Which windows lie between fixes that follow each other closely enough to interpolate."""
    long = np.concatenate(
        [[0], np.cumsum(np.diff(time) > 2.5 * max(nominal_interval(time), MOTION_BLOCK_S))]
    )
    first, last = np.searchsorted(time, begin, side="right") - 1, np.searchsorted(time, end)
    inside = (first >= 0) & (last < time.size)
    return inside & (long[np.clip(last, 0, time.size - 1)] == long[np.maximum(first, 0)])
