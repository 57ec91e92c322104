"""Gross errors of image observations and ground control: robust weights first, then tests.

A few gross errors of many pixels hide each other and bend the whole block. So the block is adjusted
with Huber's weights of a robust scale first (the median of the whitened residuals' lengths), and
what lies far off then does not take part. After that Baarda's w decides: of each object point the
observation with the largest w beyond the limit is rejected, all others are adjusted again, and so
on until none is left. Of three rays that contradict each other nothing tells which one is wrong,
and two that are left would fit whatever they are: such a point is rejected with all of its rays,
unless a group observes it.

Ground control takes part in both: a group that observes one object point alone is one observation
of three coordinates, and is rejected as a whole where its w is larger than that of any ray, since a
bad ray to one bends its neighbours too, one group at a time. Its robust scale is that of all groups
of its name, one at least: control that claims too little is no gross error, and
`variance_components` tells of it. Two thirds of the groups of a name stay, and three where nothing
else holds the block. What was rejected is in the result.
"""

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from ...records.block import Array, whitened
from .adjustment import Adjusted, adjust_problem
from .groups import ObservationGroup, Rescaled
from .kernels import collinearity
from .normals import Problem
from .precision import Precision, precision_of
from .unknowns import POINT, POSE, Unknowns

LIMIT_W = 4.0
"""Of a thousand good observations one in fifteen is rejected by it."""
HUBER = 2.0  # units of the robust scale, from which on Huber's weights fall (chosen)
FAR_UNITS = 12.0
"""Units of the robust scale beyond which an observation does not start: seven standard deviations,
as residuals are smaller than errors."""
# most of Huber's adjustments (chosen); they end earlier where weights change by 5 %
ROBUST_ROUNDS = 6
MOST_REJECTIONS = 20  # most rounds of tests (chosen); each rejects one observation of every point
FEW_REDUNDANT, LEAST_REDUNDANCY_NUMBER = 0.1, 0.1
"""Share of redundant observations below which redundancy numbers scale the residuals, and which of
these numbers still say something."""
MEDIAN_LENGTH = 1.1774  # of two standard normal components
MEDIAN_LENGTH_3 = 1.5382  # of three
MEDIAN_SIZE = 0.6745  # of one
MOST_OF_CONTROL = 1.0 / 3.0  # share of ground control that may be rejected: most of it is right
LEAST_CONTROL = 3  # ground control points that stay where they alone give the block its datum


@dataclass(frozen=True, eq=False)
class RejectedControl:
    """Coordinates of an object point that do not agree with the block.

    Parameters
    ----------
    group : int
        Row among the groups of the problem.
    point : str
        The object point.
    w : float
        Largest standardised residual when it was rejected.
    off_m : ndarray, (3,)
        Its coordinates less those of the adjustment without it, m; NaN where nothing else observes
        the point.
    """

    group: int
    point: str
    w: float
    off_m: Array


@dataclass(frozen=True, eq=False)
class Cleaned:
    """An adjustment without gross errors.

    Parameters
    ----------
    precision : Precision
        The adjustment, with its tests.
    rejected : ndarray of int
        Rows of the image observations that were rejected, in the order of the block's.
    control : tuple of RejectedControl
        Groups of single points that were rejected, in the order of their rejection.
    """

    precision: Precision
    rejected: NDArray[np.int64]
    control: tuple[RejectedControl, ...] = ()

    @property
    def result(self) -> Adjusted:
        """The adjustment."""
        return self.precision.result


def without_outliers(
    problem: Problem,
    values: Unknowns,
    limit_w: float = LIMIT_W,
    progress: Callable[[str], None] = lambda _: None,
) -> Cleaned:
    """Adjust a block and reject gross errors of its image observations and ground control.

    Parameters
    ----------
    problem : Problem
        The observations.
    values : Unknowns
        First values.
    limit_w : float
        Largest standardised residual that is accepted.
    progress : callable, optional
        Is called with the name of each round.

    Returns
    -------
    Cleaned
        The adjustment and what was rejected.

    Raises
    ------
    DataError
        As `adjust_problem`.
    """
    problem, values, active = _robust(problem, values, progress)
    whole, left_out = problem, list[tuple[int, float]]()
    for k in range(MOST_REJECTIONS + 1):
        gone = int(problem.rays.active.sum() - active.sum())
        progress(f"tests, round {k + 1}: {gone} image observations rejected")
        result = adjust_problem(problem.with_active(active), values)
        values = result.values.completed(values)
        precision = precision_of(result)
        if k == MOST_REJECTIONS:
            break  # what is rejected has no part in the precision: nothing more is
        worst = worst_of_points(problem, precision.w[problem.order], limit_w)
        control = _worst_control(whole, precision, left_out, limit_w)
        if control is not None:
            left_out.append(control)
            rows = {row for row, _ in left_out}
            groups = tuple(g for k, g in enumerate(whole.groups) if k not in rows)
            problem = replace(problem, groups=groups)
            continue  # rays are judged again without it
        if not worst.any():
            break
        active &= ~worst
        active &= ~left_alone(problem, active)
    rejected = np.sort(problem.order[problem.rays.active & ~active])
    rejections = tuple(_rejection(whole, result, row, w) for row, w in left_out)
    return Cleaned(precision, rejected, rejections)


def _robust(
    problem: Problem, values: Unknowns, progress: Callable[[str], None]
) -> tuple[Problem, Unknowns, NDArray[np.bool_]]:
    """Adjust with Huber's weights, and return the problem with the values that they lead to, and
    which observations are not far off then.
    """
    stated_rays, groups = problem.rays, problem.groups
    active, off_groups = stated_rays.active.copy(), np.ones(len(groups))
    for k in range(ROBUST_ROUNDS):
        progress(f"robust adjustment, round {k + 1}")
        result = adjust_problem(problem.with_active(active), values)
        length, unit = _lengths(result, stated_rays)
        values = result.values.completed(values)
        # Huber's weight; of what cannot be seen now, and perhaps later, the given one
        factor = np.where(np.isfinite(length), np.minimum(1.0, HUBER * unit / length), 1.0)
        weight = stated_rays.weight * np.sqrt(factor)[:, None]
        change = np.abs(weight[:, 0] / problem.rays.weight[:, 0] - 1.0).max(initial=0.0)
        before, off_groups = off_groups, _robust_factors(groups, result.values)
        change = max(change, np.abs(np.sqrt(before / off_groups) - 1.0).max(initial=0.0))
        robust = tuple(
            Rescaled(group, float(f)) if f > 1.0 else group
            for group, f in zip(groups, off_groups, strict=True)
        )
        problem = replace(problem, rays=problem.rays._replace(weight=weight), groups=robust)
        if change < 0.05:
            break
    length, unit = _lengths(result, stated_rays)
    # which of a point's coordinates and its rays are wrong, their tests decide
    doubtful = np.zeros(len(problem.block.points), dtype=bool)
    doubtful[[groups[k].keys[0][1] for k in np.flatnonzero(off_groups > 1.0)]] = True
    active &= ~((length > FAR_UNITS * unit) & ~doubtful[problem.point])
    active &= ~left_alone(problem, active)
    return replace(problem, rays=stated_rays, groups=groups), values, active


def _of_points(groups: tuple[ObservationGroup, ...]) -> dict[str, list[int]]:
    """Return the groups that observe one object point alone, by name."""
    rows: dict[str, list[int]] = {}
    for k, group in enumerate(groups):
        if len(group.keys) == 1 and group.keys[0][0] == POINT:
            rows.setdefault(group.name, []).append(k)
    return rows


def _robust_factors(groups: tuple[ObservationGroup, ...], values: Unknowns) -> Array:
    """Return Huber's factors of the variances of groups that observe one object point, else one."""
    factor = np.ones(len(groups))
    for rows in _of_points(groups).values():
        e = [groups[k].linearised(values)[0] for k in rows]
        length = np.array([np.sqrt(r @ groups[k].weight @ r) for k, r in zip(rows, e, strict=True)])
        unit = max(1.0, float(np.median(length)) / MEDIAN_LENGTH_3)
        factor[rows] = np.maximum(1.0, length / (HUBER * unit))
    return factor


def _worst_control(
    whole: Problem, precision: Precision, left_out: list[tuple[int, float]], limit: float
) -> tuple[int, float] | None:
    """Return the group of one point with the largest w beyond the limit, and its w; None if there
    is none, or too few would be left.
    """
    gone = {row for row, _ in left_out}
    kept = [k for k in range(len(whole.groups)) if k not in gone]
    of_group = dict(zip(kept, precision.groups, strict=True))
    held = any(len(g.keys) > 1 or g.keys[0][0] == POSE for g in whole.groups) or any(
        whole.layout.held[: 6 * whole.layout.n_images]
    )
    w_of_rays = float(np.nan_to_num(np.abs(precision.w)).max(initial=0.0))
    worst: tuple[int, float] | None = None
    for rows in _of_points(whole.groups).values():
        remaining = [k for k in rows if k not in gone]
        fewest = max(len(rows) * (1.0 - MOST_OF_CONTROL), 0 if held else LEAST_CONTROL)
        if len(remaining) - 1 < fewest:
            continue
        w = np.array([np.abs(of_group[k].w).max() for k in remaining])
        spread = float(np.median(np.concatenate([np.abs(of_group[k].w) for k in remaining])))
        unit = max(1.0, spread / MEDIAN_SIZE)
        for k, size in zip(remaining, w, strict=True):
            beyond = size > limit * unit and size > w_of_rays
            if beyond and (worst is None or size > worst[1]):
                worst = (k, float(size))
    return worst


def _rejection(whole: Problem, result: Adjusted, row: int, w: float) -> RejectedControl:
    """Return what is said of a group that was rejected."""
    group = whole.groups[row]
    e, _ = group.linearised(result.values)
    return RejectedControl(row, whole.block.points[group.keys[0][1]], w, e)


def _lengths(result: Adjusted, rays: collinearity.Rays) -> tuple[Array, float]:
    """Return the lengths of the whitened residuals (n,), and their robust unit."""
    length = np.linalg.norm(whitened(rays.weight, result.values.residuals(rays)), axis=1)
    part_of = result.problem.rays.active & np.isfinite(length)
    errors = length
    if _few_redundant(result.problem):  # residuals say little of errors
        r = precision_of(result).redundancy[result.problem.order].mean(axis=1)
        part_of &= r > LEAST_REDUNDANCY_NUMBER
        errors = length / np.sqrt(np.where(part_of, r, 1.0))
    unit = float(np.median(errors[part_of])) / MEDIAN_LENGTH if part_of.any() else 1.0
    return np.maximum(length, 1e-12), max(unit, 1e-12)


def _few_redundant(problem: Problem) -> bool:
    """Whether poses and points could follow nearly every image observation."""
    n = 2 * int(problem.rays.active.sum())
    points = int((problem.determined & (problem.layout.kept < 0)).sum())
    return n - 3 * points - 6 * problem.layout.n_images < FEW_REDUNDANT * n


def left_alone(problem: Problem, active: NDArray[np.bool_]) -> NDArray[np.bool_]:
    """Return the rays of points that rejections left two of at most, and that no group observes.

    Parameters
    ----------
    problem : Problem
        The observations.
    active : ndarray of bool, (n,)
        Which of its rays are left.

    Returns
    -------
    ndarray of bool, (n,)
        Rays that could not be judged any more.
    """
    remaining = problem.with_active(active).ray_count
    alone = (remaining <= 2) & (remaining < problem.ray_count) & ~problem.observed
    return np.asarray(active & alone[problem.point])


def worst_of_points(problem: Problem, w: Array, limit: float) -> NDArray[np.bool_]:
    """Return which observation of each point has the largest w beyond the limit.

    Parameters
    ----------
    problem : Problem
        The observations.
    w : ndarray, (n, 2)
        Standardised residuals in the order of its rays.
    limit : float
        Largest one that is accepted.

    Returns
    -------
    ndarray of bool, (n,)
        One ray of a point at most.
    """
    size = np.nan_to_num(np.abs(w)).max(axis=1)
    point = problem.point
    largest = np.zeros(problem.rays.start.size - 1)
    np.maximum.at(largest, point, size)
    return np.asarray((size > limit) & (size == largest[point]))
