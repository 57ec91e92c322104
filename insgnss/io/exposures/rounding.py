"""Stamps of exposures that a table or an array holds with too few digits for what it claims.

A table in seconds of the week cannot say how finely it is written: 205344 may be a second or an
instant. Where all stamps are multiples of one decimal step q and their intervals change by single
steps, as those of no trigger do, they were rounded or cut off to it. Which of both is not known; an
error e that is uniform within a step of a stamp that was cut off has about it

    E e^2 = q^2 / 3                                                                            (S.1)

and that of a rounded one a quarter of it, so that sqrt(S.1) is the standard deviation that both
keep. Intervals that are all the same may be those of an intervalometer that runs with the
receiver: nobody can tell, so nothing is added and a note asks.
"""

from dataclasses import replace

import numpy as np

from ...records import Array, CameraEvents, Question
from ...records.variances import decimal_step

LARGEST_S, SMALLEST_S = 1.0, 0.01  # of a step; a finer one costs 1 cm at 10 m/s
MULTIPLE_TOLERANCE_S = 1e-6  # off the multiples of a step: conversions of units, no measurement
FEWEST_STAMPS = 8  # stamps that show a step
CHANGES = 2  # intervals a step off the usual one that no trigger has


def with_stamp_rounding(events: CameraEvents) -> CameraEvents:
    """Give rounded stamps the standard deviation of their step (S.1).

    Parameters
    ----------
    events : CameraEvents

    Returns
    -------
    CameraEvents
        With a note of the step; `events` itself where there is none, or where the file says how
        well its stamps are known.
    """
    step = stamp_step(events.time)
    if step == 0.0 or events.sigma_s is not None:
        return events
    sigma, rounded = step / 3.0**0.5, _changes_by_steps(events.time, step)
    finding = f"all stamps are multiples of {step:g} s"
    if rounded:
        finding += f", rounded or cut off: standard deviation {sigma:.2g} s, added to each"
        events = replace(events, sigma_s=np.full(events.time.size, sigma))
    else:
        finding += " at equal intervals, taken as exact"
    advice = (
        f"if they were rounded, they are {10.0 * sigma:.2g} m off along the path at 10 m/s: write"
        " them with all their digits (7 decimals of a second)"
    )
    note = Question("exposure times", f"stamps finer than {SMALLEST_S:g} s").note(finding, advice)
    return replace(events, notes=(*events.notes, note))


def stamp_step(time: Array) -> float:
    """Return the step, 1, 0.1 or 0.01 s, of which all stamps are multiples; 0 where there is none.

    Parameters
    ----------
    time : ndarray, shape (n,)
        s.
    """
    if time.size < FEWEST_STAMPS:
        return 0.0
    return decimal_step(time, LARGEST_S, SMALLEST_S, MULTIPLE_TOLERANCE_S)


def _changes_by_steps(time: Array, step: float) -> bool:
    """Tell whether intervals differ from the usual one by a single step, as rounding makes them."""
    steps = np.rint(np.diff(time) / step).astype(np.int64)
    values, counts = np.unique(steps, return_counts=True)
    usual = values[counts.argmax()]
    return int((np.abs(steps - usual) == 1).sum()) >= CHANGES
