"""Do several IMUs on one body say the same, and if not, which one is wrong.

Of every pair, the difference of the readings in body axes is averaged over `PARITY_BLOCK_S`, under
a raised cosine, which leaves no vibration (lever arms to 0.1 m do not explain what rotors do). What
may differ without a fault is taken off: a slow offset (running median and mean over
`SLOW_OFFSET_S`: biases, temperature), and a constant matrix times the signal freed of its own slow
part (scale factors, misalignments and mounting, robustly fitted, limited to `MATRIX_LIMIT` and
`TURN_LIMIT`). The rest d has the variance of both white noises over a block, and a share `DYNAMIC`
of the signal for what the matrix does not hold. Over windows of `WINDOW_BLOCKS` blocks

    q = 1/n sum d^2 / (noise + (DYNAMIC |signal|)^2),    1 if both are sound                   (J.1)

for gyros and accelerometers apart. A window contradicts where q passes `LIMIT` times the pair's
usual level (its median, at least 1), which n q ~ chi-square with n = 30 does not by chance (1e-9)
in any flight; a pair contradicts where its usual level passes `LEVEL_LIMIT`.

Which one. With three IMUs and more the faulty one is in every pair that contradicts, and the pairs
without it agree: a vote in every window, the majority of the votes decides. With two the data of
each must speak for itself: an axis that repeats one value while the other's moves, single samples
far off their neighbours, noise far beyond what is stated while the other keeps to it. A scale
factor or a bias that changes is not self-evident; the contradiction is then reported without a
name, and processing each alone may show which.
"""

from collections.abc import Sequence
from itertools import combinations

import numpy as np
from numpy.typing import NDArray

from ....records import Array, Finding, ImuSamples, Question
from ....records.interpolation import columns_at
from ....records.variances import MAD_TO_SIGMA
from ..gaps import nominal_interval
from ..stuck_channels import run_edges

PARITY_BLOCK_S = 0.1  # over which a difference is averaged (s): vibration is quicker
WINDOW_BLOCKS = 10  # blocks of a window: with three axes (J.1) has the n = 30 values of its limit
# over which an offset is slow (s): biases and temperature change no faster (chosen)
SLOW_OFFSET_S = 60.0
DYNAMIC = 0.003  # share of the signal that the matrix may leave unexplained (chosen)
MATRIX_LIMIT = 0.03  # of scale factors
# rad, of one IMU's axes against the other's: mounted askew, and not as declared
TURN_NOTE, TURN_LIMIT = 0.01, 0.1
ROOT2 = 2.0**0.5  # by which the norm of a skew matrix exceeds its angle
LIMIT = 4.0  # of (J.1) to a pair's usual level: chance reaches it once in 1e9 windows
LEVEL_LIMIT = 25.0  # of a pair's usual level: five times the stated noise all the time (chosen)
WINDOWS = 3  # contradicting windows that make a fault
# total time of a reading that repeats (s), above which its IMU is stuck (chosen)
STUCK_TOTAL_S = 0.5
STUCK_RATIO = 4.0  # of that time to the other IMU's: rounding repeats readings of both (chosen)
SPIKE_DEVIATIONS = 12.0  # robust standard deviations of a sample against its neighbours
# samples beyond `SPIKE_DEVIATIONS` that make a fault: fewer are single lost bits (chosen)
SPIKES = 5
NOISE_RATIO = 9.0  # of the variance of sample differences over the stated one, against the other's
PARITY = Question("IMU parity", "all pairs agree within their noise")


def parity_check(
    stack: Array,
    present: NDArray[np.bool_],
    time: Array,
    sigma: Array,
    imus: Sequence[ImuSamples],
    names: Sequence[str],
) -> Finding:
    """Compare readings of several IMUs in body axes at one position and on one time base.

    Parameters
    ----------
    stack : ndarray, shape (m, n, 6)
    present : ndarray of bool, shape (m, n)
        Which samples each IMU has.
    time : ndarray, shape (n,), s
    sigma : ndarray, shape (m, 2)
        Root densities of gyro and accelerometer.
    imus : sequence of ImuSamples
        The recordings themselves.
    names : sequence of str

    Returns
    -------
    Finding
        A contradiction where a pair contradicts; it names the faulty IMU where one is known.
    """
    m = len(stack)
    starts = _block_starts(time)
    nominal = nominal_interval(time)
    phase = (time - time[0]) / PARITY_BLOCK_S + 0.5 * nominal / PARITY_BLOCK_S
    bell = 1.0 - np.cos(2.0 * np.pi * phase)
    total = np.add.reduceat(bell, starts)
    mean = (
        np.stack([np.add.reduceat(bell[:, None] * x, starts, axis=0) for x in stack])
        / total[:, None]
    )
    full = np.stack([np.add.reduceat((~x).astype(np.int64), starts) == 0 for x in present])
    # of a plain mean as noisy
    duration = total**2 / np.add.reduceat(bell**2, starts) * nominal
    pairs = tuple(combinations(range(m), 2))
    results = [_pair(mean, full[i] & full[j], duration, sigma, i, j) for i, j in pairs]
    ratio, matrix = (np.stack(each) for each in zip(*results, strict=True))
    level = np.array(
        [
            [max(1.0, float(np.nanmedian(q))) if np.isfinite(q).any() else 1.0 for q in of_pair]
            for of_pair in ratio
        ]
    )
    with np.errstate(invalid="ignore"):
        contradicts = (ratio > LIMIT * level[:, :, None]).any(axis=1)
    mirrored = np.swapaxes(matrix, 2, 3)
    scale = 0.5 * (matrix + mirrored)
    turned = np.linalg.norm(0.5 * (matrix - mirrored), axis=(2, 3)) / ROOT2
    always = (
        (level > LEVEL_LIMIT).any(axis=1)
        | (np.abs(scale).max(axis=(1, 2, 3)) > MATRIX_LIMIT)
        | (turned.max(axis=1) > TURN_LIMIT)
    )
    contradicts |= always[:, None] & np.isfinite(ratio).any(axis=1)
    if (contradicts.sum(axis=1) >= WINDOWS).any():
        faulty, why = _vote(contradicts, pairs, m, names) if m > 2 else _self_evident(imus, sigma)
        windows = starts[: contradicts.shape[1] * WINDOW_BLOCKS : WINDOW_BLOCKS]
        middle = time[windows] + 0.5 * WINDOW_BLOCKS * PARITY_BLOCK_S
        return _fault(contradicts, middle, faulty, why, names)
    if not np.isfinite(ratio).any():
        return PARITY.note("less than two seconds in common")
    return _agreement(level, turned[:, 0], pairs, names)


def _block_starts(time: Array) -> NDArray[np.int64]:
    """Index of the first sample of every block that has any."""
    return np.flatnonzero(
        np.diff(np.floor((time - time[0]) / PARITY_BLOCK_S + 1e-6), prepend=-1.0) > 0.0
    )


def _pair(
    mean: Array, full: NDArray[np.bool_], duration: Array, sigma: Array, i: int, j: int
) -> tuple[Array, Array]:
    """Compare IMUs i and j: q of (J.1), (2, w), of gyros and accelerometers, and matrix (2, 3, 3).

    mean (m, b, 6) is over blocks, full (b,), duration (b,) s.
    """
    windows = max(1, len(full) // WINDOW_BLOCKS)
    ratio, matrix = np.full((2, windows), np.nan), np.zeros((2, 3, 3))
    if full.sum() < 2 * WINDOW_BLOCKS:
        return ratio, matrix
    for k, axes in enumerate((slice(0, 3), slice(3, 6))):
        one, second = mean[i, full, axes], mean[j, full, axes]
        d, signal = second - one, 0.5 * (second + one)
        d, signal = d - _slow(d), signal - _slow(signal)
        noise = np.asarray((sigma[i, k] ** 2 + sigma[j, k] ** 2) / duration[full], dtype=np.float64)
        matrix[k] = _robust_matrix(d, signal, noise)
        residual = d - signal @ matrix[k].T
        size = np.linalg.norm(signal, axis=1)
        square = np.full(len(full), np.nan)
        square[full] = np.mean(residual**2, axis=1) / (noise + (DYNAMIC * size) ** 2)
        grid = square[: windows * WINDOW_BLOCKS].reshape(windows, -1)
        enough = np.isfinite(grid).sum(axis=1) >= WINDOW_BLOCKS // 2
        ratio[k, enough] = np.nanmean(grid[enough], axis=1)
    return ratio, matrix


def _robust_matrix(d: Array, signal: Array, noise: Array) -> Array:
    """Fit K (3, 3) of d = K signal by least squares with Huber's weights.

    A priori K is zero with a sigma of 3 %, which holds it where the signal hardly moves.
    """
    weight = 1.0 / noise
    K: Array = np.zeros((3, 3))
    for _ in range(8):
        N = signal.T @ (signal * weight[:, None]) + np.eye(3) / MATRIX_LIMIT**2
        K = np.asarray(np.linalg.solve(N, signal.T @ (d * weight[:, None])).T, dtype=np.float64)
        size = np.sqrt(np.mean((d - signal @ K.T) ** 2, axis=1) / noise)
        scale = max(1.0, 1.5 * float(np.median(size)))
        weight = np.minimum(1.0, 1.5 * scale / np.maximum(size, 1e-12)) / noise
    return K


def _slow(x: Array) -> Array:
    """Slow part (b, 3): running median over `SLOW_OFFSET_S`, its running mean, interpolated.

    It is taken once a window. A median alone follows a step.
    """
    reach = round(0.5 * SLOW_OFFSET_S / PARITY_BLOCK_S)
    centres = np.arange(0, len(x) + WINDOW_BLOCKS, WINDOW_BLOCKS).clip(max=len(x) - 1)
    medians = np.stack([np.median(x[max(0, c - reach) : c + reach + 1], axis=0) for c in centres])
    span = 2 * (reach // WINDOW_BLOCKS) + 1
    padded = np.pad(medians, ((span // 2, span // 2), (0, 0)), mode="edge")
    smooth = [np.convolve(column, np.full(span, 1.0 / span), mode="valid") for column in padded.T]
    return columns_at(np.arange(float(len(x))), centres, np.stack(smooth, axis=1))


def _agreement(
    level: Array, turned: Array, pairs: tuple[tuple[int, int], ...], names: Sequence[str]
) -> Finding:
    """The check where no pair contradicts.

    level : (p, 2) of q. turned : (p,) rad, of one IMU's axes against the other's.
    """
    worst, k = np.sqrt(level.max(axis=0)), int(np.argmax(turned))
    finding = (
        f"pairs differ by {worst[0]:.1f} (gyro) and {worst[1]:.1f} (accelerometer) times their"
        " noise at most"
    )
    if turned[k] < TURN_NOTE:
        return PARITY.ok(finding)
    finding += (
        f"; {names[pairs[k][1]]} is turned by {np.degrees(turned[k]):.1f} deg against"
        f" {names[pairs[k][0]]}"
    )
    advice = "a calibration file for each IMU, with a common reference, removes this rotation"
    return PARITY.note(finding, advice)


def _vote(
    contradicts: NDArray[np.bool_], pairs: tuple[tuple[int, int], ...], m: int, names: Sequence[str]
) -> tuple[int | None, str]:
    """The faulty IMU by vote: its pairs contradict while the pairs without it agree.

    The majority of the windows that contradict decides.
    """
    has = np.array([[j in pair for pair in pairs] for j in range(m)])
    bad = contradicts.any(axis=0)
    votes = np.array(
        [
            (contradicts[has[j]].all(axis=0) & ~contradicts[~has[j]].any(axis=0)).sum()
            for j in range(m)
        ]
    )
    first = int(np.argmax(votes))
    if votes[first] > 0.5 * bad.sum() or (
        votes[first] >= WINDOWS and votes[first] > 3 * np.delete(votes, first).max()
    ):
        why = "every pair with this IMU contradicts, and the pairs without it agree"
        return first, f"{why}, in {votes[first]} of {bad.sum()} seconds"
    return None, "no single faulty IMU explains all: " + ", ".join(
        f"{name} {n} of {bad.sum()} seconds" for name, n in zip(names, votes, strict=True)
    )


def _self_evident(imus: Sequence[ImuSamples], sigma: Array) -> tuple[int | None, str]:
    """Which of two shows a fault of its own in what it recorded."""
    steps = [nominal_interval(imu.time) for imu in imus]
    readings = [
        np.hstack([imu.gyro, imu.accel]) / (dt if imu.quantity == "increments" else 1.0)
        for imu, dt in zip(imus, steps, strict=True)
    ]
    stuck = [_stuck_samples(x) * dt for x, dt in zip(readings, steps, strict=True)]
    j = int(np.argmax(stuck))
    if stuck[j] > max(STUCK_TOTAL_S, STUCK_RATIO * stuck[1 - j]):
        return j, (
            f"an axis of this IMU repeats one value for {stuck[j]:.1f} s, the other's at most for "
            f"{stuck[1 - j]:.2f} s"
        )
    spikes = [_spikes(x) for x in readings]
    j = int(np.argmax(spikes))
    if spikes[j] >= SPIKES and spikes[j] > 10 * spikes[1 - j]:
        return j, (
            f"{spikes[j]} samples of this IMU are outliers against their neighbours, "
            f"{spikes[1 - j]} of the other's"
        )
    stated = [np.repeat(2.0 * s**2 / dt, 3) for s, dt in zip(sigma, steps, strict=True)]
    noise = [
        float((np.median(np.diff(x, axis=0) ** 2, axis=0) / 0.455 / v).max())
        for x, v in zip(readings, stated, strict=True)
    ]
    j = int(np.argmax(noise))
    if noise[j] > NOISE_RATIO * max(1.0, noise[1 - j]):
        noisier, other = np.sqrt(noise[j]), np.sqrt(noise[1 - j])
        return j, (
            f"its noise is {noisier:.1f} times the stated noise, the other's {other:.1f} times"
        )
    return None, (
        "neither IMU shows a fault; a third IMU, or each IMU alone with GNSS, would show which is "
        "faulty"
    )


def _stuck_samples(x: Array) -> int:
    """Longest run of one value in any axis."""
    return max(int(np.diff(run_edges(column)).max()) for column in x.T)


def _spikes(x: Array) -> int:
    """Number of samples far from the mean of their two neighbours, which lie together."""
    deviation = x[1:-1] - 0.5 * (x[:-2] + x[2:])
    step = np.abs(x[2:] - x[:-2])
    usual = np.maximum(MAD_TO_SIGMA * np.median(np.abs(deviation), axis=0), 1e-12)
    is_spike = (np.abs(deviation) > SPIKE_DEVIATIONS * usual) & (step < np.abs(deviation))
    return int(is_spike.any(axis=1).sum())


def _fault(
    contradicts: NDArray[np.bool_],
    middle: Array,
    faulty: int | None,
    why: str,
    names: Sequence[str],
) -> Finding:
    bad = np.flatnonzero(contradicts.any(axis=0))
    span = (
        f"{bad.size} of {contradicts.shape[1]} seconds contradict, from {middle[bad[0]]:.1f} to"
        f" {middle[bad[-1]]:.1f} s"
    )
    who = f"one of {', '.join(names)} is faulty" if faulty is None else f"{names[faulty]} is faulty"
    advice = "process each alone and compare" if faulty is None else f"leave {names[faulty]} out"
    return PARITY.contradiction(f"{who}: {why}; {span}", advice)
