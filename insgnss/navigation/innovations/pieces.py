"""Pieces of a solution, and a solution without the time-correlated error of its fixes."""

from dataclasses import replace
from typing import Any

import numpy as np

from ...records import Array
from ...records.states import CORRELATED_ERROR
from ..filter.codes import BIAS, DRIFT_CODE, IMU0
from ..filter.layout import StateLayout
from ..filter.problem import sub_problem
from ..filter.solution import Solution

SHORTEST_S, FEWEST_FIXES_MOVING = 20.0, 60  # of a segment in motion, and its fixes


def moving_parts(solution: Solution, stationary: Array) -> list[Solution]:
    """Cut a solution into its segments in motion: engines stand still in stationary periods.

    Parameters
    ----------
    solution : Solution
        A solved segment.
    stationary : ndarray, (k, 2)
        Begin and end of the stationary periods, s, GPST.

    Returns
    -------
    list of Solution
        Segments of `SHORTEST_S` and `FEWEST_FIXES_MOVING` fixes and more.
    """
    time, fix = solution.time, solution.problem.epochs.has_position
    resting = np.zeros(time.size, dtype=np.bool_)
    for begin, end in stationary:
        resting |= (time >= begin) & (time <= end)
    edge = np.flatnonzero(np.diff(np.concatenate([[1], resting.astype(np.int64), [1]])))
    parts = []
    for first, stop in edge.reshape(-1, 2):
        fixes = first + np.flatnonzero(fix[first:stop])
        if fixes.size >= FEWEST_FIXES_MOVING and time[fixes[-1]] - time[fixes[0]] >= SHORTEST_S:
            parts.append(sub_solution(solution, int(fixes[0]), int(fixes[-1])))
    return parts


def sub_solution(solution: Solution, first: int, last: int) -> Solution:
    """Return the epochs first..last as a solution of their own, its constants as they are there."""
    epochs = slice(first, last + 1)
    problem = sub_problem(solution.problem, first, last)
    x = solution.x[epochs].copy()
    layout = problem.layout
    if layout.rate >= 0:  # time begins anew
        x[:, layout.offset] += x[:, layout.rate] * solution.problem.epochs.time[first]
    arrays = {
        k: getattr(solution, k)[epochs]
        for k in ("nav", "filter_sigma", "innovation", "innovation_sigma", "nis", "verdict")
    }
    for s in np.flatnonzero(layout.factor == DRIFT_CODE):
        bias = (layout.channel == layout.channel[s]) & (layout.factor == BIAS) & (layout.beta == 0)
        if bias.any():
            x[:, np.argmax(bias)] += x[:, s] * solution.problem.epochs.time[first]
    covariances = solution.covariances.piece(first, last)
    return replace(solution, problem=problem, x=x, covariances=covariances, **arrays)


def without_correlated(solution: Solution) -> Solution:
    """Remove the states of the fixes' time-correlated (Gauss-Markov) error from a solution.

    Parameters
    ----------
    solution : Solution
        A solution with such states.

    Returns
    -------
    Solution
        The same without them, the fixes' sigmas taken as white.
    """
    layout = solution.problem.layout
    gone = np.arange(layout.gm, layout.gm + 3)
    states: dict[str, Any] = {
        k: np.delete(getattr(layout, k), gone)
        for k in ("channel", "factor", "beta", "drive", "sigma0")
    }
    kept = tuple(state for state in layout.states if state.group != CORRELATED_ERROR)
    bare: StateLayout = replace(layout, states=kept, white_scale=(1.0, 1.0, 1.0), **states)
    return replace(
        solution,
        problem=replace(solution.problem, layout=bare),
        x=np.delete(solution.x, gone, axis=1),
        covariances=solution.covariances.without(IMU0 + gone),
    )
