"""Gross errors of image observations: robust weights first, then tests, one observation at a time.

A few gross errors of many pixels hide each other and bend the whole block. So the block is adjusted
with Huber's weights of a robust scale first (the median of the whitened residuals' lengths), and
what lies far off then does not take part. After that Baarda's w decides: of each object point the
observation with the largest w beyond the limit is rejected, all others are adjusted again, and so
on until none is left. Of three rays that contradict each other nothing tells which one is wrong,
and two that are left would fit whatever they are: such a point is rejected with all of its rays,
unless a group observes it. What was rejected is in the result.
"""

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from ..records.block import Array
from .kernels import collinearity
from .adjustment import Adjusted, adjusted
from .normals import Problem
from .precision import Precision, precision_of
from .unknowns import POINT, Unknowns

LIMIT_W = 4.0
"""Of a thousand good observations one in fifteen is rejected by it."""
HUBER = 2.0
FAR = 12.0
"""Units of the robust scale beyond which an observation does not start: seven standard deviations,
as residuals are smaller than errors."""
ROBUST_ROUNDS, MOST_REJECTIONS = 6, 20
MEDIAN_LENGTH = 1.1774  # of two standard normal components


@dataclass(frozen=True, eq=False)
class Cleaned:
    """An adjustment without gross errors.

    Parameters
    ----------
    precision : Precision
        The adjustment, with its tests.
    rejected : ndarray of int
        Rows of the image observations that were rejected, in the order of the block's.
    """

    precision: Precision
    rejected: NDArray[np.int64]

    @property
    def result(self) -> Adjusted:
        """The adjustment."""
        return self.precision.result


def without_outliers(
    problem: Problem, values: Unknowns, limit_w: float = LIMIT_W, scale: float | None = None
) -> Cleaned:
    """Adjust a block and reject gross errors of its image observations.

    Parameters
    ----------
    problem : Problem
        The observations.
    values : Unknowns
        First values.
    limit_w : float
        Largest standardised residual that is accepted.
    scale : float, optional
        Variance of unit weight for the tests; by default that of the adjustment.

    Returns
    -------
    Cleaned
        The adjustment and what was rejected.

    Raises
    ------
    DataError
        As `adjusted`.
    """
    given = problem.rays
    active = given.active.copy()
    for _ in range(ROBUST_ROUNDS):
        result = adjusted(problem.with_active(active), values)
        off, unit = _lengths(result, given)
        values = _kept_values(result, values)
        # Huber's weight; of what cannot be seen now, and perhaps later, the given one
        factor = np.where(np.isfinite(off), np.minimum(1.0, HUBER * unit / off), 1.0)
        weight = given.weight * np.sqrt(factor)[:, None]
        change = np.abs(weight / problem.rays.weight - 1.0).max(initial=0.0)
        problem = replace(problem, rays=problem.rays._replace(weight=weight))
        if change < 0.05:
            break
    off, unit = _lengths(result, given)
    active &= ~(off > FAR * unit)
    active &= ~_left_alone(problem, active)
    problem = replace(problem, rays=given)
    for _ in range(MOST_REJECTIONS):
        result = adjusted(problem.with_active(active), values)
        values = _kept_values(result, values)
        precision = precision_of(result, scale)
        worst = _worst_of_points(problem, precision.w[problem.order], limit_w)
        if not worst.any():
            break
        active &= ~worst
        active &= ~_left_alone(problem, active)
    rejected = np.sort(problem.order[given.active & ~active])
    return Cleaned(precision, rejected)


def _lengths(result: Adjusted, given: collinearity.Rays) -> tuple[Array, float]:
    """Return the lengths of the whitened residuals (n,), and their robust unit."""
    e = np.empty_like(given.uv)
    collinearity.residuals(given, result.values.kernel_values(), e)
    off = np.linalg.norm(e * given.weight, axis=1)
    part_of = result.problem.rays.active & np.isfinite(off)
    unit = float(np.median(off[part_of])) / MEDIAN_LENGTH if part_of.any() else 1.0
    return np.maximum(off, 1e-12), max(unit, 1e-12)


def _kept_values(result: Adjusted, before: Unknowns) -> Unknowns:
    """Return adjusted values; points that did not take part keep their first ones."""
    point = result.values.point
    return result.values.with_points(np.where(np.isnan(point), before.point, point))


def _left_alone(problem: Problem, active: NDArray[np.bool_]) -> NDArray[np.bool_]:
    """Return the rays of points that rejections left two of at most, and that no group observes."""
    m = problem.rays.start.size - 1
    point = np.repeat(np.arange(m), np.diff(problem.rays.start))
    left = np.bincount(point[active], minlength=m)
    alone = (left <= 2) & (left < np.bincount(point[problem.rays.active], minlength=m))
    for group in problem.groups:
        alone[[row for name, row in group.keys if name == POINT]] = False
    return np.asarray(active & alone[point])


def _worst_of_points(problem: Problem, w: Array, limit: float) -> NDArray[np.bool_]:
    """Return which observation of each point has the largest w beyond the limit."""
    size = np.nan_to_num(np.abs(w)).max(axis=1)
    point = np.repeat(np.arange(problem.rays.start.size - 1), np.diff(problem.rays.start))
    largest = np.zeros(problem.rays.start.size - 1)
    np.maximum.at(largest, point, size)
    return np.asarray((size > limit) & (size == largest[point]))
