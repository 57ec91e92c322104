"""Stamps of a sensor that runs evenly, printed with too few digits, spread evenly again.

A sensor samples evenly, its clock wanders by a few parts in a million, and a logger prints its
stamps in whole milliseconds: at 128 Hz they step by 8 and 7 ms in turns. Rates and forces are then
taken over intervals that are wrong by a seventh. A straight line through some seconds of stamps
knows the instants to a few hundredths of the last digit,

    t = a + T k over `FITTED_SPAN_S` (k counts samples),   |stamp - t| <= half of the digit

and where the rounding explains every stamp, these instants take the place of the stamps. Where it
does not, because a sensor samples unevenly or a logger stamps late, they stay as they are.

Stamps whose digit is the interval itself, 10 ms at 100 Hz, skip one instant and repeat the next
where the sensor is a little late: all rows are there, and the stamp between is put where it was.
"""

import numpy as np
from numpy.typing import NDArray

from ....records import Finding
from .order import note

Array = NDArray[np.float64]

DIGITS_S = (1e-1, 1e-2, 1e-3, 1e-4)  # last printed digits (s) that can matter at the rates of IMUs
COARSE, TOO_COARSE = 0.02, 0.45  # of the interval: digits that matter, and that hide a sample
# of a line: longer than the beat of most rates with a millisecond; fewest stamps that are spread
FITTED_SPAN_S, LEAST_STAMPS = 20.0, 40
PAIRED = 0.95  # of the repeated stamps: those beside a skipped one
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
    out = time.copy()
    off = np.zeros(time.size)
    for first, last in zip([0, *ends], [*ends, time.size], strict=True):
        if last - first >= LEAST_STAMPS:
            out[first:last] = _line(time[first:last], interval)
            off[first:last] = np.abs(out[first:last] - time[first:last])
    if np.mean(off > MOST_RESIDUAL_DIGITS * digit) > ODD or not (np.diff(out) > 0.0).all():
        return time, ()
    rate = f"an even {1.0 / interval:.6g} Hz"
    finding = f"stamps rounded to {1e3 * digit:g} ms at {rate} were spread evenly"
    advice = "log more digits where the logger can; all stamps may be late by half of that digit"
    return out, (note("IMU rows", finding, "stamps of more digits than the rate needs", advice),)


def unrepeated(time: Array) -> tuple[Array, tuple[Finding, ...]]:
    """Return stamps (n,), s, without repetitions beside a skipped stamp, and the note on them.

    They stay as they are where more repeat than that explains.
    """
    repeats = np.flatnonzero(time[1:] == time[:-1])
    if time.size < LEAST_STAMPS or not repeats.size:
        return time, ()
    step = np.diff(time)
    usual = float(np.median(step))
    skips = np.abs(np.pad(step, 1) - 2.0 * usual) < 0.5 * usual  # at i + 1 that of step i
    skip_before, skip_after = skips[repeats], skips[repeats + 2]
    if usual <= 0.0 or np.mean(skip_before | skip_after) < PAIRED:
        return time, ()
    out = time.copy()
    out[repeats[skip_before]] -= usual
    out[repeats[skip_after & ~skip_before] + 1] += usual
    finding = f"{int((skip_before | skip_after).sum())} stamps repeat beside one that is skipped"
    advice = "they were put there: log more digits where the logger can"
    return out, (note("IMU rows", finding, "stamps of more digits than the rate needs", advice),)


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
