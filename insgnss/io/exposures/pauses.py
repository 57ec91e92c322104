"""Whether the clock of the exposures was set on the way: an interval that no trigger leaves.

A trigger is even in time or along the path on each flight line, and an image that it misses leaves
a multiple of its interval. Where one on a straight line is none, and images behind it keep to it,
as they do not behind a late one, the camera paused or its clock was set: no data tell which, so it
is asked. So it is within a turn where the trigger is even in time there, too; a camera that waits
in turns says nothing of a step in one.
"""

import numpy as np
from numpy.typing import NDArray

from ...base.findings.remedies import SetKey, Step
from ...records import Array, CameraEvents, Finding, Question
from ...records.variances import MAD_TO_SIGMA

EXPOSURE_CLOCK = "exposure clock"  # name of the check that asks (`records.verdicts`)
# intervals of a line, from which its usual one follows, and lines without a multiple, of which more
# are the camera's way of working (chosen)
ENOUGH_INTERVALS, MOST_STEPS = 6, 2
MOST_UNEVEN = 0.03  # standard deviation of the intervals of an even trigger, of the usual one
# exposures on either side of a step that are even, at most and at least: of a late one none are
EXPOSURES_BESIDE, FEWEST_BESIDE = 5, 3
# of the usual interval, from its nearest multiple; and as a number of the intervals' standard
# deviations
OFF_MULTIPLE, OFF_SIGMAS = 0.1, 6.0


def check_even_intervals(
    events: CameraEvents, distance_m: Array, straight: NDArray[np.bool_]
) -> Finding:
    """Ask whether the clock of the exposures was set where an interval on a line is no multiple.

    Parameters
    ----------
    events : CameraEvents
        n of them.
    distance_m : ndarray, shape (n - 1,), m
        From each exposure to the next.
    straight : ndarray of bool, shape (n - 1,)
        Whether the course is known on that way and does not turn.

    Returns
    -------
    Finding
        A note with the first such interval, else "ok".
    """
    question = Question(EXPOSURE_CLOCK, "on a straight line, multiples of the usual interval")
    interval_s, of_line = np.diff(events.time), np.cumsum(~straight)
    lines = [np.flatnonzero(straight & (of_line == row)) for row in np.unique(of_line[straight])]
    lines = [rows for rows in lines if rows.size >= ENOUGH_INTERVALS]
    if _even_in_turns(interval_s, straight):
        lines = [np.arange(interval_s.size)]
    if not lines:
        return question.ok("too few exposures on straight lines to compare")
    time_ratios, distance_ratios = (
        [x[rows] / max(np.median(x[rows]), 1e-9) for rows in lines]
        for x in (interval_s, distance_m)
    )
    spread, ratios = min(
        (_spread(time_ratios), time_ratios),
        (_spread(distance_ratios), distance_ratios),
        key=lambda x: x[0],
    )
    limit = max(OFF_MULTIPLE, OFF_SIGMAS * spread)
    steps = [
        (rows, ratio, row)
        for rows, ratio in zip(lines, ratios, strict=True)
        for row in range(rows.size)
        if _is_step(ratio, row, limit)
    ]
    if spread > MOST_UNEVEN or not 0 < len(steps) <= MOST_STEPS:
        return question.ok(f"intervals even to {spread:.1%}")
    rows, ratio, index = steps[0]
    row, usual_s = int(rows[index]), float(np.median(interval_s[rows]))
    course = "on a straight line" if straight[row] else "in a turn"
    lack_s = interval_s[row] - usual_s
    pair = f"{events.images[row]} and {events.images[row + 1]}"
    finding = (
        f"{interval_s[row]:.2f} s pass between images {pair} {course}, {ratio[index]:.2f} times the"
        f" usual interval of {usual_s:.2f} s, and missed images leave a multiple; if the clock was"
        f" set there, the stamps before lack {lack_s:+.2f} s"
    )
    remedy = Step(
        "add the step to the stamps before, if the clock was set; if the camera paused, set {}",
        SetKey("accept", [EXPOSURE_CLOCK]),
    )
    return question.note(finding, remedy)


def _even_in_turns(interval_s: Array, straight: NDArray[np.bool_]) -> bool:
    """Whether a trigger is even in time in turns as well, so that a step within one shows."""
    if interval_s.size < ENOUGH_INTERVALS or straight.all():
        return False
    ratio = interval_s / max(float(np.median(interval_s)), 1e-9)
    even = np.abs(ratio - np.maximum(np.rint(ratio), 1.0)) < OFF_MULTIPLE
    return bool((~even).sum() <= MOST_STEPS and (even & ~straight).sum() >= ENOUGH_INTERVALS)


def _spread(ratios: list[Array]) -> float:
    """Standard deviation of the intervals of lines by the usual one of each, robust."""
    return MAD_TO_SIGMA * float(np.median(np.abs(np.concatenate(ratios) - 1.0)))


def _is_step(ratio: Array, interval: int, limit: float) -> bool:
    """Whether the exposures of a line behind its interval k are off those before, and all alike.

    Late images among them are no sure sign of either.
    """
    position = np.cumsum(np.concatenate([[0.0], ratio]))
    earlier, later = (
        position[max(interval + 1 - EXPOSURES_BESIDE, 0) : interval + 1],
        position[interval + 1 :],
    )
    sides = earlier - position[interval], later[:EXPOSURES_BESIDE] - position[interval + 1]
    even = all(
        steps.size >= FEWEST_BESIDE and np.abs(steps - np.rint(steps)).max() < 0.5 * limit
        for steps in sides
    )
    return even and abs(ratio[interval] - max(np.rint(ratio[interval]), 1.0)) > limit
