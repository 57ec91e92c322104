"""A drift of some seconds that larger noise of a whole flight has smoothed over.

Fixes that drift by centimetres a second for half a minute (an ambiguity that converges), or an IMU
that is warmed, put a step into the separation of backward and forward velocities at either end:
many sigmas there, none elsewhere. Larger noise explains such innovations by the likelihood as well,
of the whole flight, and hides the step; a noise that is larger would separate them everywhere.
"""

from collections.abc import Sequence

import numpy as np

from ...records import Finding, Question
from ..filter.solution import Solution

APART = 6.0  # sigmas: of a thousand normal variables the largest is beyond once in a million
USUAL, FEW = 3.0, 0.2  # sigmas that noise leaves behind now and then; share of the epochs beyond
LARGER_NOISE = ("IMU noise", "GNSS sigmas")  # names of checks
AXES = ("N", "E", "D")
STATES = ("position", "velocity", "attitude")


def hidden_drift(
    before: Solution, adopted: Solution, adopted_checks: Sequence[Finding]
) -> Finding | None:
    """Say where forward and backward disagreed before another error model was adopted.

    Parameters
    ----------
    before : Solution
        The solution with the errors of the flight file.
    adopted : Solution
        The solution that is gone on with.
    adopted_checks : sequence of Finding
        What its error model says of the flight file.

    Returns
    -------
    Finding or None
        A note; None where they disagree nowhere, still do, or do so throughout, and where no larger
        noise was adopted: a constant, a time offset say, explains such instants.
    """
    if not {check.name for check in adopted_checks} & set(LARGER_NOISE):
        return None
    ratio = _ratios(before)
    if adopted is before or not ratio.size or ratio.max() <= APART:
        return None
    if _ratios(adopted).max(initial=0.0) > APART:
        return None  # which the report says
    if np.mean(ratio.max(axis=1) > USUAL) > FEW:
        return None
    k, column = np.unravel_index(int(np.argmax(ratio)), ratio.shape)
    time = float(np.abs(before.problem.inc.marks[before.separation_epoch[k]]))
    return Question("drift", f"below {APART:g} sigmas").note(
        f"before larger errors were adopted forward and backward disagreed by"
        f" {ratio[k, column]:.1f} sigmas in {STATES[int(column) // 3]} {AXES[int(column) % 3]} at"
        f" TOW {time:.1f} s, and agreed elsewhere: about then the fixes or the IMU drifted for"
        " seconds or minutes, which the adopted noise holds in the mean only",
        "look at the quality of the fixes there; do not rely on the sigmas of images near it",
    )


def _ratios(solution: Solution) -> np.ndarray:
    """Separations in their sigmas, (epochs, 9), 0 where they are not known."""
    apart, sigma = solution.separation, solution.separation_sigma
    determined = np.isfinite(apart) & np.isfinite(sigma) & (sigma > 0.0)
    return np.abs(np.divide(apart, sigma, out=np.zeros_like(apart), where=determined))
