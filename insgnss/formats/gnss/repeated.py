"""Rows that hold the last fix until the next one comes, against positions that are rounded.

Loggers that write a row for every IMU sample repeat each fix: positions then change at every k-th
row, however far the receiver has moved, and jump by what it has moved since. A receiver that hovers
repeats positions too where they are rounded to more than they scatter: they change at any row, by
one step of the rounding, and at every row as soon as it moves.
"""

import numpy as np

from ...records import Array

HALF = 0.5  # of the rows, that repeat where fixes are held
JUMP = 3.5  # steps of the rounding, beyond which a change is motion
FEWEST_JUMPS = 10
REGULAR = 0.8  # of the intervals between changes, that are multiples of one
ROUGHLY = 0.1  # of that one


def holds_fixes(lat: Array, lon: Array) -> bool:
    """Whether rows hold the last fix until the next one comes.

    Parameters
    ----------
    lat, lon : ndarray, shape (n,)
        In any unit.

    Returns
    -------
    bool
    """
    step = np.abs(np.diff(np.column_stack([lat, lon]), axis=0))
    changed = (step != 0.0).any(axis=1)
    if not changed.size or changed.mean() >= 1.0 - HALF:
        return False
    steps = np.maximum(*(_in_steps(column) for column in step.T))
    jumps = np.flatnonzero(steps[:-1] > JUMP)
    if jumps.size >= FEWEST_JUMPS:
        return bool(changed[jumps + 1].mean() < HALF)
    between = np.diff(np.flatnonzero(changed))
    if between.size < FEWEST_JUMPS:
        return bool(steps.max(initial=0.0) > JUMP)
    unit = max(float(np.quantile(between, 0.1)), 1.0)
    off = np.abs(between - unit * np.rint(between / unit))
    return bool(unit > 1.0 and (off <= ROUGHLY * unit).mean() > REGULAR)


def _in_steps(step: Array) -> Array:
    """Changes in units of the smallest one."""
    moved = step[step > 0.0]
    return step / moved.min() if moved.size else step
