"""Samples of a stuck (frozen) channel: one number again and again while its neighbours move.

A sensor whose noise is finer than its resolution repeats a value with a probability p, which the
recording itself shows; in n samples the longest run to be expected is log n / log(1 / p). A run
that is three times as long, while another channel of the triad changes, is a register that was not
renewed. Its samples are no measurements: they are left out, which makes a gap of them (`gaps`), and
counted. Gyros of some devices read exactly zero as long as they hardly turn; such a dead band is no
stuck channel. A channel that is stuck for longer than `STUCK_S` is a dead sensor, for
a person to look at.
"""

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from ...records import Array, ImuSamples, Question
from .gaps import nominal_interval

STUCK_S = 5.0  # of a run: beyond it the channel is dead, and its samples are kept to be looked at
LEAST_SAMPLES = 20  # of a run of one reading, whatever chance makes (chosen)
# of that run (s): what is lost in a shorter one does not turn a drone far (chosen)
LEAST_RUN_S = 0.2
CHANCE_RUNS = 3.0  # times the longest run that chance makes
DEAD_BAND, DEAD_BAND_SHARE = 0.05, 0.01  # rad/s; share of the samples
MOVES = 0.3  # share of the samples at which another channel of the triad changes
MOST_PROBED = 200_000  # samples that show how often a value repeats (chosen)
CHANNEL_NAMES = (
    "gyro x",
    "gyro y",
    "gyro z",
    "accelerometer x",
    "accelerometer y",
    "accelerometer z",
)


def run_edges(column: np.ndarray) -> NDArray[np.int64]:
    """Return where each run of equal values begins, and the number of values at the end."""
    changes = np.flatnonzero(column[1:] != column[:-1]) + 1
    return np.concatenate([[0], changes, [column.size]])


def constant_runs(column: Array, shortest: int) -> list[tuple[int, int]]:
    """Find every run of `shortest` equal values and more.

    Returns
    -------
    list of tuple of int
        First and last sample of each run.
    """
    step = max(shortest // 2, 1)
    probe = column[::step]
    same = np.flatnonzero(probe[1:] == probe[:-1])
    runs: list[tuple[int, int]] = []
    for k in same.tolist():
        if runs and k * step <= runs[-1][1]:
            continue
        lo, hi = max(0, (k - 2) * step), min(column.size, (k + 3) * step)
        value = column[k * step]
        while lo > 0 and column[lo] == value:
            lo = max(0, lo - 2 * step)
        while hi < column.size and column[hi - 1] == value:
            hi = min(column.size, hi + 2 * step)
        unlike = np.flatnonzero(column[lo:hi] != value) + lo
        first = int(unlike[unlike < k * step].max()) + 1 if (unlike < k * step).any() else lo
        last = int(unlike[unlike > k * step].min()) - 1 if (unlike > k * step).any() else hi - 1
        if last - first + 1 >= shortest:
            runs.append((first, last))
    return runs


def without_stuck_channels(imu: ImuSamples, longest_s: float) -> ImuSamples:
    """Leave out the samples at which a channel is stuck.

    Parameters
    ----------
    imu : ImuSamples
    longest_s : float, s
        A longer run is kept: that channel is dead.

    Returns
    -------
    ImuSamples
        The samples that are left, with a note that names the runs; `imu` itself where there are
        none.
    """
    dt = nominal_interval(imu.time)
    drop = np.zeros(imu.time.size, dtype=np.bool_)
    runs = []
    for channel, name in enumerate(CHANNEL_NAMES):
        triad, c = (imu.gyro if channel < 3 else imu.accel), channel % 3
        for first, last in constant_runs(triad[:, c], _shortest(triad[:, c], dt)):
            neighbours = np.delete(triad[first : last + 1], c, axis=1)
            moves = np.mean(np.diff(neighbours, axis=0) != 0.0, axis=0).max()
            length = imu.time[last] - imu.time[first]
            idle = channel < 3 and dead_band(imu, c, first, last)
            if moves > MOVES and length <= longest_s and not idle:
                drop[first + 1 : last + 1] = True
                runs.append(f"{name} from {imu.time[first]:.2f} s for {length:.2f} s")
    if not runs:
        return imu
    finding = (
        f"{int(drop.sum())} samples left out where a channel is stuck:"
        f" {', '.join(runs[:5])}{', ...' if runs[5:] else ''}"
    )
    note = Question("IMU rows", "every channel renewed with every sample").note(
        finding, "look at the sensor's connection and logger"
    )
    return replace(imu[~drop], notes=(*imu.notes, note))


def dead_band(imu: ImuSamples, channel: int, first: int, last: int) -> bool:
    """Whether a gyro reads exactly zero because it hardly turns, as some devices make it.

    That is so where it reads zero often, or while none of the gyros turns.
    """
    column = imu.gyro[:, channel]
    per_second = 1.0 / nominal_interval(imu.time) if imu.quantity == "increments" else 1.0
    if column[first] != 0.0:
        return False
    often = (np.count_nonzero(column == 0.0) - (last - first + 1)) > DEAD_BAND_SHARE * column.size
    return bool(often or np.abs(imu.gyro[first : last + 1]).max() * per_second < DEAD_BAND)


def _shortest(column: Array, dt: float) -> int:
    """Samples of a run that chance does not make."""
    probed = column[:MOST_PROBED]
    p = min(max(float(np.mean(probed[1:] == probed[:-1])), 1e-6), 0.999)
    expected = np.log(max(column.size, 2)) / np.log(1.0 / p)
    return int(max(LEAST_SAMPLES, LEAST_RUN_S / dt, CHANCE_RUNS * expected))
