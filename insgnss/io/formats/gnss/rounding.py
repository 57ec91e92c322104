"""What rounded columns of fixes hide: standard deviations printed as zero, positions that repeat.

A standard deviation printed as 0.00 beside others of 0.01 and 0.02 is smaller than half of the last
printed digit; that half is what it is at most. A zero in a column whose other values are far above
its last digit is no rounded number, but the absence of one.

A file that holds each fix until the next repeats every value of it for nearly equal numbers of
rows, or longer while the antenna stands. A position that repeats because it is rounded, of an
antenna that hovers, repeats alone, or as often for a few rows as for many.
"""

from collections.abc import Sequence

import numpy as np

from ....records import Array

MOST_DIGITS = 6  # decimals of a rounded column at most: steps below 1e-6 hide nothing of a fix
DOWN_TO = 2.5  # last digits: what the smallest positive value of a rounded column is at most
REPEATED = 0.5  # of the rows: fewer are of an antenna that stands
# of the usual run of equal rows; and how many held fixes have shorter ones
SHORT_RUN, MOST_SHORT_RUNS = 0.6, 0.1


def last_digit(values: Array) -> float | None:
    """Return the unit of the last printed digit of numbers; None where they are not rounded."""
    for digits in range(MOST_DIGITS + 1):
        scaled = values * 10.0**digits
        if (np.abs(scaled - np.round(scaled)) < 1e-6 * np.maximum(1.0, np.abs(scaled))).all():
            return float(10.0**-digits)
    return None


def floor_of_zeros(sigma: Array) -> float | None:
    """Return what the zeros among standard deviations (n,) are at most, in their unit.

    None where there are none, where something is negative, and where a zero is no rounded number.
    """
    positive = sigma[sigma > 0.0]
    if positive.size == 0 or sigma.min() != 0.0 or np.ptp(positive) == 0.0:
        return None  # one value does not show its last digit
    digit = last_digit(positive)
    return None if digit is None or positive.min() > DOWN_TO * digit else 0.5 * digit


def is_held(position: Sequence[Array], columns: Sequence[Array]) -> bool:
    """Tell whether rows repeat each fix until the next.

    Parameters
    ----------
    position : sequence of ndarray, shape (n,)
        Latitude and longitude.
    columns : sequence of ndarray, shape (n,)
        What else the fix has: height, velocity, standard deviations.
    """
    same = np.all([np.diff(column) == 0.0 for column in (*position, *columns)], axis=0)
    if same.size == 0 or same.mean() <= REPEATED:
        return False
    runs = np.diff(np.flatnonzero(~same))
    if runs.size < 2:
        return True
    usual = float(np.median(runs))
    return usual > 1.0 and bool(np.mean(runs < SHORT_RUN * usual) < MOST_SHORT_RUNS)
