"""Direct sensor orientation: points from poses that are held, with the covariance of these poses.

Poses and cameras x have the cofactors Q that observation groups alone give them: aerial control,
and the calibration of a camera where it is weighed. A point is intersected from its rays, weighed
as image observations; with V and W of (J.6), and T = W V^-1, its error is that of its rays less
T^T dx, so that

    Q_pp = V^-1 + T^T Q T,    Q_pq = T_p^T Q T_q                                             (J.19)

for one point and for two of them: (J.7) with Q in the place of S^-1. Image observations do not
improve the poses, and their residuals have more than their own errors. With H = B V^-1 B^T of a
point, B and A whitened derivatives of its rays by the point and by x,

    E[e e^T] = (I - H) (I + A Q A^T) (I - H)                                                 (J.20)

whose diagonal stands where an adjustment has redundancy numbers: a variance component near one says
that rays meet as well as the covariance of the poses promises. Gross errors are judged by it too,
in units of the median: an error that all poses share makes all residuals larger or smaller.
"""

from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from ...records.block import Array, whitened
from .adjustment import Adjusted, adjust_problem, residuals_px
from .kernels import points, posterior
from .normals import Problem, assemble_normals, factorise_normals, problem_of
from .outliers import LIMIT_W, MEDIAN_SIZE, MOST_REJECTIONS, left_alone, worst_of_points
from .precision import Precision, cofactors_from, test_statistics
from .unknowns import Unknowns


def intersected_points(
    problem: Problem,
    values: Unknowns,
    limit_w: float = LIMIT_W,
    keep_all: bool = False,
    progress: Callable[[str], None] = lambda _: None,
) -> tuple[Precision, NDArray[np.int64]]:
    """Intersect all points from held poses, and reject gross errors of image observations.

    Parameters
    ----------
    problem : Problem
        Image observations, and the groups that say how well poses are known.
    values : Unknowns
        The poses, first values of points, and of the blocks of groups.
    limit_w : float
        Largest standardised residual that is accepted.
    keep_all : bool
        Whether nothing is rejected.
    progress : callable, optional
        Is called with the name of each round.

    Returns
    -------
    precision : Precision
        Points, covariances, expected squares of residuals.
    rejected : ndarray of int
        Rows of the image observations that were rejected.

    Raises
    ------
    DataError
        An image has no pose, or groups do not determine the poses.
    """
    block, blocks = problem.block, values.blocks
    cameras = tuple(replace(camera, free=()) for camera in block.cameras)
    held = problem_of(replace(block, held=np.ones_like(block.held), cameras=cameras))
    active = held.rays.active.copy()
    values = replace(values, blocks={})
    for k in range(MOST_REJECTIONS + 1):
        progress(f"intersecting, round {k + 1}: {int((~active).sum())} observations rejected")
        intersected = adjust_problem(held.with_active(active), values)
        with_groups = replace(
            intersected,
            problem=problem.with_active_of(intersected.problem),
            values=replace(intersected.values, blocks=blocks),
        )
        precision = direct_precision(with_groups)
        w = np.abs(precision.w[held.order])
        scale = max(1.0, float(np.nanmedian(w)) / MEDIAN_SIZE) if np.isfinite(w).any() else 1.0
        worst = worst_of_points(held, w, limit_w * scale) & active
        # what is rejected has no part in the precision: after the last round nothing more is
        if keep_all or not worst.any() or k == MOST_REJECTIONS:
            break
        active &= ~worst
        active &= ~left_alone(held, active)
    return precision, np.sort(held.order[held.rays.active & ~active])


def without_rays(problem: Problem) -> Problem:
    """Return a problem in which no image observation takes part.

    Parameters
    ----------
    problem : Problem
        The observations.

    Returns
    -------
    Problem
        The same otherwise.
    """
    return problem.with_active(np.zeros(problem.rays.active.size, dtype=bool))


def direct_precision(result: Adjusted) -> Precision:
    """Compute what is known of points that were intersected from held poses (J.19, J.20).

    Parameters
    ----------
    result : Adjusted
        Points at their places, image observations that take part, and the groups that say how well
        poses are known.

    Returns
    -------
    Precision
        Its redundancy numbers are expected squares of whitened residuals (J.20).

    Raises
    ------
    DataError
        The groups do not determine the poses.
    """
    problem, values = result.problem, result.values
    alone = without_rays(problem)
    shown = problem.filled(values)
    Q = cofactors_from(alone, shown, factorise_normals(alone, assemble_normals(alone, shown)))
    m = len(problem.block.points)
    point = np.full((m, 3, 3), np.nan)
    expected = np.full_like(problem.rays.uv, np.nan)
    scratch = points.scratch_for(problem.rays, len(values.interior))
    arguments = (problem.rays, shown.kernel_values(), np.zeros((m, 3, 3)), np.zeros((m, 3)))
    places = problem.layout.envelope.places
    cofactors = np.full_like(problem.rays.weight, np.nan)
    posterior.posterior(*arguments, scratch, places, Q.stored, point, cofactors)
    posterior.expected_squares(*arguments, scratch, places, Q.stored, expected)
    square = np.empty_like(expected)
    square[problem.order] = expected
    e = whitened(problem.block.observations.whitening, residuals_px(result))
    tests = tuple(test_statistics(result, group, Q, point, 1.0) for group in problem.groups)
    none = np.full_like(square, np.inf)
    return Precision(result, 1.0, Q, point, square, e / np.sqrt(square), none, tests)


def joint_covariance(problem: Problem, values: Unknowns, chosen: Sequence[int]) -> Array:
    """Compute the covariance of several intersected points together (J.19).

    Parameters
    ----------
    problem : Problem
        Image observations that take part, and the groups that say how well poses are known.
    values : Unknowns
        Poses, and points at their places.
    chosen : sequence of int
        The points.

    Returns
    -------
    ndarray, (3 m, 3 m)
        Their covariance, m^2.

    Raises
    ------
    DataError
        The groups do not determine the poses.
    """
    alone, m = without_rays(problem), len(problem.block.points)
    shown = values.with_points(np.where(np.isfinite(values.point), values.point, 0.0))
    scratch = points.scratch_for(problem.rays, len(values.interior))
    of_points = np.zeros((m, 3, 3)), np.zeros((m, 3))
    T = np.zeros((problem.layout.size, 3 * len(chosen)))
    out = np.zeros((3 * len(chosen), 3 * len(chosen)))
    for k, p in enumerate(chosen):
        points.take_own(*of_points, p, scratch)
        _, n = points.linearise_point(problem.rays, shown.kernel_values(), p, scratch)
        inverse, columns = np.linalg.inv(scratch.V), slice(3 * k, 3 * k + 3)
        out[columns, columns] = inverse
        np.add.at(T[:, columns], scratch.row[:n], scratch.W[:n] @ inverse)
    factor = factorise_normals(alone, assemble_normals(alone, shown))
    return np.asarray(out + T.T @ factor.solved(T))
