"""Spectrum of the IMU in straight flight: what the airframe adds, and how much of it is white noise
to a filter.

Straight, level segments at constant speed are found from the smoothed trajectory; the mean
periodogram of their samples (Welch 1967, Hann windows of `WELCH_WINDOW_S`, half overlapping, a
line taken off each) is given as a root density in the convention of the noise model: two-sided, so
that white noise q of the model is a level line at q,

    q(f) = sqrt(S(f) / 2),  S one-sided, the integral of S over 0 to rate/2 being the variance (W.1)

A line of a propeller or an engine stands above the median of its neighbourhood (half an octave on
both sides). Its variance is what stands above that floor; integrated by the filter it swings the
angle or the velocity by

    rms / (2 pi f)                                                                             (W.2)

and goes no further, where white noise goes on to wander with the root of time. Counted as white
noise all the same, it raises the mean density between `LOWEST_HZ` and rate/2; both means are given,
with and without lines. The frequency of a line may be an alias: from one at f +- rate a sensor that
samples without averaging shows the same.

What the filter needs is the density at the frequencies that it does not follow the fixes at, about
a hertz and less, where the motion of the vehicle hides it. White noise cannot be larger than the
density in any band, so the least octave mean above `LOWEST_HZ` is an upper limit of it. Where the
highest octaves are level, as noise that is white makes them, their mean is the white noise itself,
unless the vehicle truly trembles as evenly.
"""

from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from ....navigation.filter.codes import VEL
from ....navigation.filter.solution import Solution
from ....navigation.prepare.gaps import nominal_interval
from ....records import Array, ImuSamples
from ....records.states import CHANNELS

WELCH_WINDOW_S = 4.0  # of a periodogram: 0.25 Hz between its frequencies
SHORTEST_SEGMENT_S = 8.0  # of straight flight: three windows that overlap by half
COURSE_GRID_S, COURSE_SMOOTH_S = 0.5, 2.0  # of the course and speed that show straight flight
# turn; climb and change of speed a second over speed; speed
STRAIGHT_RAD_S, LEVEL_SLOPE, STEADY_SPEED, MOVING_MS = np.radians(5.0), 0.2, 0.1, 1.0
# above the vehicle's motion; of the rate, below what filters of sensors cut
LOWEST_HZ, HIGHEST = 2.0, 0.25
# that a bin of a level floor is taken for a line; of power, to a floor that is not level
LINE_CHANCE, LINE_POWER_RATIO = 1e-6, 3.0
# of a line's power, to that beside it; of the power of octaves that are level
PEAK, EVEN_POWER = 2.0, 0.2


@dataclass(frozen=True)
class SpectralLine:
    """A spectral line of one channel.

    Parameters
    ----------
    channel : str
        Name of the channel.
    frequency_hz : float
        Its centre, Hz.
    rms : float
        Root mean square, rad/s or m/s^2.
    swing : float
        Amplitude after integration (W.2), rad or m/s.
    above_floor : float
        Ratio of its highest bin to the floor, in density.
    """

    channel: str
    frequency_hz: float
    rms: float
    swing: float
    above_floor: float


@dataclass(frozen=True)
class StraightFlight:
    """Root densities of the six channels (body axes) in straight flight.

    X stands for rad/s (gyros) and m/s^2 (accelerometers).

    Parameters
    ----------
    rate_hz : float
        Sampling rate, Hz.
    segments : ndarray, (k, 2)
        Begin and end of the segments used, s.
    windows : int
        Number of averaged periodograms.
    frequency_hz : ndarray, (n,)
        Frequencies, Hz.
    density, floor : ndarray, (6, n)
        Root density and the median of its neighbourhood, X/sqrt(Hz).
    lines : tuple of SpectralLine
        Lines above the floor.
    mean_with_lines, mean_without_lines : ndarray, (6,)
        Mean densities over `LOWEST_HZ` to rate/2, X/sqrt(Hz).
    upper_limit : ndarray, (6,)
        Least octave mean, an upper limit of white noise, X/sqrt(Hz).
    level, level_from_hz : ndarray, (6,)
        Mean of the highest octaves where two and more are level, and where that begins; NaN where
        they are not.
    lowest_hz : float
        Frequency below which the vehicle's own motion hides the noise, Hz.
    """

    rate_hz: float
    segments: Array
    windows: int
    frequency_hz: Array
    density: Array
    floor: Array
    lines: tuple[SpectralLine, ...]
    mean_with_lines: Array
    mean_without_lines: Array
    upper_limit: Array
    level: Array
    level_from_hz: Array
    lowest_hz: float = LOWEST_HZ

    @property
    def duration_s(self) -> float:
        """The length of all segments, s."""
        return float(np.sum(self.segments[:, 1] - self.segments[:, 0]))


def straight_segments(solution: Solution) -> Array:
    """Find the straight, level segments at constant speed.

    Parameters
    ----------
    solution : Solution
        A smoothed solution.

    Returns
    -------
    ndarray, (k, 2)
        Begin and end of segments of `SHORTEST_SEGMENT_S` and longer, s.
    """
    time = solution.time
    v = solution.nav[:, VEL]
    if time[-1] - time[0] < SHORTEST_SEGMENT_S:
        return np.zeros((0, 2))
    grid = np.arange(time[0], time[-1], COURSE_GRID_S)
    width = round(COURSE_SMOOTH_S / COURSE_GRID_S)
    kernel = np.ones(width) / width
    mean = np.column_stack(
        [np.convolve(np.interp(grid, time, c), kernel, mode="same") for c in v.T]
    )
    speed = np.linalg.norm(mean, axis=1)
    course = np.unwrap(np.arctan2(mean[:, 1], mean[:, 0]))
    straight = speed > MOVING_MS
    least_speed = np.maximum(speed, MOVING_MS)
    straight &= np.abs(np.gradient(course, COURSE_GRID_S)) < STRAIGHT_RAD_S
    straight &= (np.abs(mean[:, 2]) < LEVEL_SLOPE * least_speed) & (
        np.abs(np.gradient(speed, COURSE_GRID_S)) < STEADY_SPEED * least_speed
    )
    straight[:width] = straight[-width:] = False
    edge = np.flatnonzero(np.diff(np.concatenate([[0], straight.astype(np.int64), [0]]))).reshape(
        -1, 2
    )
    segments = (
        np.column_stack([grid[edge[:, 0]], grid[edge[:, 1] - 1]]) if edge.size else np.zeros((0, 2))
    )
    return segments[segments[:, 1] - segments[:, 0] >= SHORTEST_SEGMENT_S]


def straight_flight(imu: ImuSamples, C_b_imu: Array, segments: Array) -> StraightFlight | None:
    """Estimate the spectrum of the samples within straight segments.

    Parameters
    ----------
    imu : ImuSamples
        Samples of the IMU.
    C_b_imu : ndarray, (3, 3)
        Rotation of the samples' axes into the body frame.
    segments : ndarray, (k, 2)
        Begin and end of the segments, s.

    Returns
    -------
    StraightFlight or None
        None where no segment holds a window without gaps.
    """
    from scipy.signal import get_window

    dt = nominal_interval(imu.time)
    n = round(WELCH_WINDOW_S / dt)
    window = get_window("hann", n)
    power = np.zeros((6, n // 2 + 1))
    windows = 0
    used_segments = []
    for begin, end in segments:
        samples = slice(*np.searchsorted(imu.time, [begin, end]))
        time = imu.time[samples]
        x = np.hstack([imu.gyro[samples] @ C_b_imu.T, imu.accel[samples] @ C_b_imu.T]) / (
            dt if imu.quantity == "increments" else 1.0
        )
        windows_before = windows
        for start in range(0, time.size - n + 1, n // 2):
            if time[start + n - 1] - time[start] > (n - 0.5) * dt:
                continue  # a gap
            power += _periodogram(x[start : start + n], window, dt)
            windows += 1
        if windows > windows_before:
            used_segments.append((begin, end))
    if not windows:
        return None
    frequency = np.asarray(np.fft.rfftfreq(n, dt)[1:-1], dtype=np.float64)
    S = power[:, 1:-1] / windows
    freedom = _degrees_of_freedom(windows)
    floor = _noise_floor(frequency, S, freedom)
    above = floor * _line_ratio(freedom) < S
    lines = [
        line
        for channel, *of_channel in zip(CHANNELS, S, floor, above, strict=True)
        for line in _spectral_lines(" ".join(channel), frequency, *of_channel)
    ]
    without = np.where(_with_neighbouring_bins(above), np.minimum(S, floor), S)
    band = frequency >= LOWEST_HZ
    quietest, level, begin = _octave_levels(frequency, without, HIGHEST / dt)
    return StraightFlight(
        rate_hz=1.0 / dt,
        segments=np.array(used_segments),
        windows=windows,
        frequency_hz=frequency,
        density=np.sqrt(0.5 * S),
        floor=np.sqrt(0.5 * floor),
        lines=tuple(sorted(lines, key=lambda line: (line.channel, -line.rms))),
        mean_with_lines=np.sqrt(0.5 * S[:, band].mean(axis=1)),
        mean_without_lines=np.sqrt(0.5 * without[:, band].mean(axis=1)),
        upper_limit=np.sqrt(0.5 * quietest),
        level=np.sqrt(0.5 * level),
        level_from_hz=begin,
    )


def _periodogram(x: Array, window: Array, dt: float) -> Array:
    """Return the one-sided power (6, n // 2 + 1) of x (n, 6), a straight line taken off."""
    t = np.arange(len(x)) - 0.5 * (len(x) - 1)
    x = x - x.mean(axis=0) - np.outer(t, t @ x / (t @ t))
    return 2.0 * dt / np.sum(window**2) * np.abs(np.fft.rfft(x * window[:, None], axis=0).T) ** 2


def _degrees_of_freedom(windows: int) -> float:
    """Return the degrees of freedom of a mean of `windows` periodograms: half-overlapping Hann
    windows share (1/6)^2 of their power (Welch 1967).
    """
    return 2.0 * windows / (1.0 + (1.0 - 1.0 / windows) / 18.0)


def _noise_floor(frequency: Array, S: Array, freedom: float) -> Array:
    """Return the median (6, n) over half an octave on both sides, as a mean: that of chi-square is
    above its median.
    """
    from scipy.special import chdtri

    mean = freedom / float(chdtri(freedom, 0.5))
    low = np.searchsorted(frequency, frequency / np.sqrt(2.0))
    high = np.searchsorted(frequency, frequency * np.sqrt(2.0), side="right")
    return mean * np.array(
        [[np.median(row[a:b]) for a, b in zip(low, high, strict=True)] for row in S]
    )


def _line_ratio(freedom: float) -> float:
    """Return the ratio to the floor that a bin of a level spectrum exceeds with the chance
    `LINE_CHANCE`.
    """
    from scipy.special import chdtri

    return max(LINE_POWER_RATIO, float(chdtri(freedom, LINE_CHANCE)) / freedom)


def _with_neighbouring_bins(above: np.ndarray) -> np.ndarray:
    """Return the bins (6, n) of lines and one on both sides, into which the window smears them."""
    out = above.copy()
    out[:, 1:] |= above[:, :-1]
    out[:, :-1] |= above[:, 1:]
    return out


def _spectral_lines(
    channel: str, frequency: Array, S: Array, floor: Array, above: np.ndarray
) -> list[SpectralLine]:
    """Return the lines: runs of bins above the floor and above the band of the vehicle's motion, a
    bin on both sides taken along.
    """
    step = frequency[1] - frequency[0]
    runs = np.flatnonzero(
        np.diff(np.concatenate([[0], (above & (frequency >= LOWEST_HZ)).astype(np.int64), [0]]))
    ).reshape(-1, 2)
    lines = []
    for start, stop in runs:
        bins = slice(max(start - 1, 0), stop + 1)
        if S[bins].max() < PEAK * max(S[bins.start], S[min(stop, S.size - 1)]):
            continue  # the flank of the vehicle's motion
        excess = np.maximum(S[bins] - floor[bins], 0.0)
        centre = float(np.sum(frequency[bins] * excess) / np.sum(excess))
        rms = float(np.sqrt(np.sum(excess) * step))
        lines.append(
            SpectralLine(
                channel,
                centre,
                rms,
                rms / (2.0 * np.pi * centre),
                float(np.sqrt(np.max(S[bins] / floor[bins]))),
            )
        )
    return lines


def _octave_levels(frequency: Array, S: Array, highest: float) -> tuple[Array, Array, Array]:
    """Of the octaves from `highest` down to `LOWEST_HZ`: least mean power, that of the level ones
    and where these begin; (6,) each.
    """
    edges = highest * 0.5 ** np.arange(max(1.0, np.floor(np.log2(highest / LOWEST_HZ))) + 1.0)
    means = np.array(
        [S[:, (frequency >= a) & (frequency < b)].mean(axis=1) for b, a in pairwise(edges)]
    )
    level = np.full(6, np.nan)
    begin = np.full(6, np.nan)
    for c, mean in enumerate(means.T):
        count = int(np.argmax(np.append(np.abs(mean / mean[0] - 1.0) > EVEN_POWER, True)))
        if count > 1:
            level[c] = S[c, (frequency >= edges[count]) & (frequency < highest)].mean()
            begin[c] = edges[count]
    return means.min(axis=0), level, begin
