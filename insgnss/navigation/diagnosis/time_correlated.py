"""The search for the time-correlated (Gauss-Markov) GNSS error of the largest likelihood.

The white share k, the time-correlated share c (both times a ratio in height) and the correlation
time T are those that make (C.1) of `evidence` smallest over its window. The error is accepted where
it gains more than `evidence.GAIN` in -2 log L. Over such a window the fixes tell how fast the error
moves, c^2 / T, better than how far: along that ridge c and T go towards what the file claims, k^2 +
c^2 = 1, as long as the likelihood allows it and k alone does not exhaust the claim. What lasts
longer than the window (a wrong base coordinate, the ionosphere of a single-point solution) leaves
no trace in innovations.
"""

from collections.abc import Callable
from typing import Any

import numpy as np

from ...records import Array
from ..filter.layout import FixErrors
from ..filter.solution import Solution
from .candidates import (
    LayoutFactory,
    guesses,
    only_code_fixes,
    with_layout,
    with_time_correlated_error,
)
from .evidence import GAIN, IMPOSSIBLE, liveliest_window, minus_two_log_likelihood

LONGEST_S = 600.0  # bound of T; longer errors leave no trace in the innovations of a window
LEAST_WHITE = 0.2  # bound of k: a fix is not taken to be better than a fifth of its sigma
LEAST_WHITE_CODE = 0.03  # the same for code solutions
WHITE_CLAIM = 0.5  # k^2 beyond which the file's claim is of the white error alone
FAR = np.log(6.0)  # of T, where the search begins again
RIDGE = np.log(1.3)  # step of T along c^2 / T
DOUBTFUL = 1.0  # rise of -2 log L that one sigma makes
FARTHEST = 8.0  # bound of the logarithms of all parameters


def time_correlated_error(
    solution: Solution, layout_factory: LayoutFactory, errors: FixErrors
) -> FixErrors | None:
    """Find the time-correlated GNSS error that explains the innovations best.

    Parameters
    ----------
    solution : Solution
        The solved flight.
    layout_factory : LayoutFactory
        The error states of the flight as a function of those of its fixes.
    errors : FixErrors
        The errors of the fixes that are estimated in any case.

    Returns
    -------
    FixErrors or None
        `errors` with the time-correlated error and the scale of the fixes' sigmas by (C.1); None
        where they gain less than `evidence.GAIN`.
    """
    problem, start = liveliest_window(solution)
    interval_s, code = problem.aiding_interval_s, only_code_fixes(problem)
    least_white = LEAST_WHITE_CODE if code else LEAST_WHITE

    def model(p: Array) -> FixErrors:
        k, c, T, ratio = np.exp(p)
        time_s = float(np.clip(T, interval_s, LONGEST_S))
        return with_time_correlated_error(errors, max(k, least_white), c, time_s, ratio)

    def cost(p: Array) -> float:
        if np.abs(p).max() > FARTHEST:
            return IMPOSSIBLE
        return minus_two_log_likelihood(*with_layout(problem, start, layout_factory(model(p))))

    without = minus_two_log_likelihood(*with_layout(problem, start, layout_factory(errors)))
    first = min((np.log([*guess, 1.0]) for guess in guesses(problem)), key=cost)
    best = _descend(cost, first)
    # once more along the ridge: the first may have ended in a hollow
    again = _descend(cost, best.x + [0.0, 0.5 * FAR, FAR, 0.0])
    best = min(best, again, key=lambda minimum: float(minimum.fun))
    if without - best.fun < GAIN:
        return None
    return model(best.x if code else _towards_claim(cost, best.x, best.fun))


def _descend(cost: Callable[[Array], float], first: Array) -> Any:
    """Minimise `cost` of log k, c, T and the ratio of heights by the method of Nelder and Mead."""
    from scipy.optimize import minimize

    steps = [
        [0.0, 0, 0, 0],
        [-1.0, 0, 0, 0],
        [0, -1.0, 0.7, 0],
        [-0.5, 0.5, -1.5, 0],
        [-0.3, 0, 0, -0.7],
    ]
    options = {
        "initial_simplex": first + np.array(steps),
        "maxfev": 60,
        "xatol": 0.05,
        "fatol": 1.0,
    }
    return minimize(cost, first, method="Nelder-Mead", options=options)


def _towards_claim(cost: Callable[[Array], float], p: Array, least: float) -> Array:
    """Move along c^2 / T towards k^2 + c^2 = 1, as long as the cost stays near `least`."""
    while True:
        claim = np.exp(2.0 * p[0]) + np.exp(2.0 * p[1])
        step = np.sign(1.0 - claim) * np.array([0.0, 0.5 * RIDGE, RIDGE, 0.0])
        after = np.exp(2.0 * p[0]) + np.exp(2.0 * (p[1] + step[1]))
        if (
            (claim > 1.0 and np.exp(2.0 * p[0]) > WHITE_CLAIM)
            or abs(np.log(after)) > abs(np.log(claim))
            or (p + step)[2] > np.log(LONGEST_S)
            or cost(p + step) > least + DOUBTFUL
        ):
            return p
        p = p + step
