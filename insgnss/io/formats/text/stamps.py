"""Stamps of an even sensor: what printing and loggers do to them, undone where it is certain.

What clocks and counters do to them stands in `clock`.

Digits. A sensor samples evenly, its clock wanders by a few parts in a million, and a logger prints
its stamps in whole milliseconds: at 128 Hz they step by 8 and 7 ms in turns. Rates and forces are
then taken over intervals that are wrong by a seventh. A straight line through some seconds of
stamps knows the instants to a few hundredths of the last digit,

    t = a + T k over `FITTED_SPAN_S` (k counts samples),   |stamp - t| <= half of the digit

and where the rounding explains every stamp, these instants take the place of the stamps. Where it
does not, because a sensor samples unevenly or a logger stamps late, they stay as they are.

Delays. Stamps that scatter about the line over the count of the rows, or come in bunches, are of a
logger that is late, not of lost samples (`without_jitter`).

Stamps whose digit is the interval itself, 10 ms at 100 Hz, skip one instant and repeat the next
where the sensor is a little late: all rows are there, and the stamp between is put where it was.
"""

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from ....records import Array, Finding
from .order import note

Notes = tuple[Finding, ...]

LEVEL_ROWS = 40  # rows on either side of a step whose median shows it, whatever single stamps do
LEAST_LEVEL_ROWS = 5  # rows of a side: fewer are rows out of place (chosen)

DIGITS_S = (1e-1, 1e-2, 1e-3, 1e-4)  # last printed digits (s) that can matter at the rates of IMUs
COARSE, TOO_COARSE = 0.02, 0.45  # of the interval: digits that matter, and that hide a sample
# of a line: longer than the beat of most rates with a millisecond; fewest stamps that are spread
FITTED_SPAN_S, LEAST_STAMPS = 20.0, 40
PAIRED = 0.95  # of the repeated stamps: those beside a skipped one
MOST_SENSORS = 3  # rows of each stamp that may be of as many sensors in one file
# of the rows: those with a stamp of their own where the rest tell a rate above the stamps' digit;
# more are single contradictions, half of them a second sensor (chosen)
MOST_SHARED = 0.95
MEAN_ROWS = 200  # rows of a mean interval: many times the rows that a driver hands over at once
# share of the steps that are no single interval, from which they are jitter: of fewer each is a
# gap or a row out of order (`order`)
LEAST_JITTERY = 0.01
# standard deviations of the steps that stamps scatter about the line: 0.7 if each is late by
# chance, 1 in bunches of ten, ten times as much if the intervals themselves vary (chosen)
MOST_WALK, MOST_DELAY = 1.2, 8.0
# of the steps: fewer are of a sensor that samples unevenly, or of a broken recording
LEAST_EVEN_SHARE = 0.98
MOST_RESIDUAL_DIGITS = 0.6  # of the digit: what rounding and the line leave at most
STAMPS_AT_A_TIME = 1 << 14  # stamps that are looked at together, which a processor's cache holds
ODD = 1e-3  # share of the stamps that may lie beyond


def spread_evenly(time: Array) -> tuple[Array, tuple[Finding, ...]]:
    """Return stamps (n,), s, spread evenly where they are rounded, with the note on it.

    Parameters
    ----------
    time : ndarray, shape (n,), s
        In the order of the file.
    """
    if time.size < LEAST_STAMPS:
        return time, ()
    digit = _last_digit(time)
    if digit == 0.0:
        return time, ()
    usual = float(np.median(np.diff(time), overwrite_input=True))
    if (time[1:] <= time[:-1]).any() or not COARSE * usual < digit < TOO_COARSE * usual:
        return time, ()
    step = np.diff(time)
    near = np.abs(step - usual) < 1.5 * digit
    interval = float(np.mean(step[near]))
    if (
        near.mean() < LEAST_EVEN_SHARE or np.ptp(step[near]) < 0.5 * digit
    ):  # uneven, or as even as can be
        return time, ()
    ends = np.flatnonzero(~near) + 1
    out = _lines(time, ends, interval)
    distance = np.abs(out - time)
    if np.mean(distance > MOST_RESIDUAL_DIGITS * digit) > ODD or not (np.diff(out) > 0.0).all():
        return time, ()
    rate = f"an even {1.0 / interval:.6g} Hz"
    finding = f"stamps rounded to {1e3 * digit:g} ms at {rate} were spread evenly"
    advice = "log more digits if the logger can; all stamps may be late by half of the last digit"
    return out, (note("IMU rows", finding, "stamps of more digits than the rate needs", advice),)


def without_repetitions(
    time: Array, same: Callable[[int, int], bool] = lambda i, k: False, name: str = "IMU rows"
) -> tuple[Array, tuple[Finding, ...]]:
    """Return stamps (n,), s, without repetitions beside skipped stamps, and their note `name`.

    Rows that a driver hands over at once have the stamp of the last of them. The stamps stay as
    they are where more repeat than that explains, or where most rows repeat with all their values.
    """
    repeats = time[1:] == time[:-1]
    if time.size < LEAST_STAMPS or not repeats.any() or _of_several_sensors(time):
        return time, ()
    if np.mean([same(k, k + 1) for k in np.flatnonzero(repeats).tolist()]) > 0.5:
        return time, ()
    usual = _mean_interval(time)
    run = np.concatenate([[0], np.cumsum(~repeats)])  # of rows of one stamp, each row's
    length = np.bincount(run)
    stamp = time[np.cumsum(length) - 1]
    # of bunches the first one counts back as the others do; else a row at an end is double
    in_bunches = np.median(length) > 1.0
    step = np.concatenate([[np.inf if in_bunches else 0.0], np.diff(stamp), [0.0]])
    skip_before = step[:-1] > (length - 0.5) * usual
    skip_after = (length == 2) & (step[1:] > 1.5 * usual) & ~skip_before
    mended = (length > 1) & (skip_before | skip_after)
    if usual <= 0.0 or mended.sum() < PAIRED * (length > 1).sum():
        return time, ()
    after = np.cumsum(length)[run] - 1 - np.arange(time.size)  # rows of the stamp after each
    out = time - usual * after * (mended & skip_before)[run]
    out[np.cumsum(length)[mended & skip_after] - 1] += usual
    finding = f"{int((length - 1)[mended].sum())} stamps occur twice beside a missing stamp"
    advice = "such rows got the missing stamps; if the logger can, log more digits or sensor time"
    return out, (note(name, finding, "stamps of more digits than the rate needs", advice),)


def without_jitter(time: Array) -> tuple[Array, tuple[Finding, ...]]:
    """Return stamps (n,), s, of an even sensor without the logger's delays, and the note on them.

    A logger that stamps when it gets round to it, or a bus that hands rows over in bunches, leaves
    steps that look like lost samples and like rows out of order. The count of the rows shows that
    none is lost: where their stamps scatter about a line over the count and do not walk away from
    it, the line takes their place, from one real gap to the next. A sensor that samples unevenly
    walks away.

    Parameters
    ----------
    time : ndarray, shape (n,), s
        In the order of the file.
    """
    if time.size < LEAST_STAMPS or _share_uneven(time, _mean_interval(time)) < LEAST_JITTERY:
        return time, ()
    interval, stamps = _mean_interval(time), np.unique(time)
    shared = stamps.size <= MOST_SHARED * time.size
    if _of_several_sensors(time) or stamps.size < LEAST_STAMPS or 2 * stamps.size == time.size:
        return time, ()
    if not shared and _share_uneven(stamps, interval) < LEAST_JITTERY:
        return time, ()  # rows out of order, or double
    ends = _gaps(time, interval)
    out = _lines(time, ends, interval)
    delay, step = time - out, np.delete(np.diff(time), ends - 1)
    scatter = float(np.std(step))
    if (
        np.std(delay) > MOST_WALK * scatter
        or np.abs(delay).max() > MOST_DELAY * scatter
        or not (np.diff(out) > 0.0).all()
    ):
        return time, ()
    finding = (
        f"stamps that scatter by {1e3 * np.std(delay):.2g} ms about an even"
        f" {1.0 / interval:.6g} Hz were spread evenly"
    )
    advice = "let the sensor stamp its samples; now all stamps may have the logger's mean delay"
    return out, (note("IMU rows", finding, "stamps of the sensor's clock", advice),)


def _mean_interval(time: Array) -> float:
    """Interval of the rows, s, whatever their jitter: the median of means over some of them."""
    rows = min(MEAN_ROWS, time.size // 2)
    return float(np.median(time[rows:] - time[:-rows])) / rows


def _share_uneven(time: Array, interval: float) -> float:
    """Share of the steps that are no single interval."""
    return float(np.mean(np.abs(np.diff(time) - interval) > 0.5 * interval))


def _gaps(time: Array, interval: float) -> NDArray[np.intp]:
    """Rows of jittery stamps before which samples are lost: the level of the stamps rises there."""
    step = np.diff(time)
    excess = time - interval * np.arange(time.size)
    single = step[np.abs(step - interval) < 20.0 * interval]
    jitter = min(float(np.std(single)) / interval, 3.0) if single.size else 3.0
    rows = int(max(LEVEL_ROWS, 16 * LEVEL_ROWS * jitter**2))
    k = np.flatnonzero(step > 1.5 * interval) + 1
    k = k[(k >= LEAST_LEVEL_ROWS) & (k <= time.size - LEAST_LEVEL_ROWS)]
    rise = np.array(
        [
            np.median(excess[row : row + rows]) - np.median(excess[max(row - rows, 0) : row])
            for row in k.tolist()
        ]
    )
    k = k[rise > 0.6 * interval]
    ends: list[int] = []
    for near in np.split(k, np.flatnonzero(np.diff(k) > rows) + 1) if k.size else []:
        distance = np.abs(near - np.mean(near)) / rows
        ends.append(int(near[np.argmax(step[near - 1] / interval - 4.0 * distance)]))
    return np.array(ends, dtype=np.intp)


def _of_several_sensors(time: Array) -> bool:
    """Whether all stamps occur twice, or three times: the rows may be of so many sensors."""
    length = np.diff(np.flatnonzero(np.concatenate([[True], time[1:] != time[:-1], [True]])))[1:-1]
    return bool(length.size and 1 < length[0] <= MOST_SENSORS and (length == length[0]).all())


def _last_digit(time: Array) -> float:
    """Unit of the last printed digit, s; 0 where it is finer than any that matters."""
    whole = np.floor(time[0])
    for digit in DIGITS_S:
        for first in range(0, time.size, STAMPS_AT_A_TIME):
            ticks = (time[first : first + STAMPS_AT_A_TIME] - whole) / digit
            if (np.abs(ticks - np.round(ticks)) >= 2e-3).any():
                break
        else:
            return digit
    return 0.0


def _lines(time: Array, ends: NDArray[np.intp], interval: float) -> Array:
    """Return stamps on lines between ends; those of few rows stay."""
    out = time.copy()
    for first, last in zip([0, *ends], [*ends, time.size], strict=True):
        if last - first >= LEAST_STAMPS:
            out[first:last] = _line(time[first:last], interval)
    return out


def _line(time: Array, interval: float) -> Array:
    """Line through the neighbours of each stamp, at it; at the ends the first and the last one."""
    n = time.size
    k = np.arange(n, dtype=np.float64)
    rest = time - time[0] - interval * k
    width = min(2 * int(0.5 * FITTED_SPAN_S / interval) + 1, n if n % 2 else n - 1)
    half = width // 2
    total, moment = (np.concatenate([[0.0], np.cumsum(values)]) for values in (rest, rest * k))
    middle = np.clip(np.arange(n), half, n - 1 - half)
    lo, hi = middle - half, middle + half + 1
    mean = (total[hi] - total[lo]) / width
    slope = (moment[hi] - moment[lo] - middle * width * mean) / (width * (width**2 - 1) / 12.0)
    return np.asarray(time[0] + interval * k + mean + slope * (k - middle))
