"""The iteration: Levenberg-Marquardt on the normal equations of a block."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ...base.advance import converged_share, share
from ...base.errors import DataError
from ...records.block import UNKNOWN_M, Array
from .normals import (
    Linearised,
    Problem,
    assemble_normals,
    corrections,
    cost,
    factorise_normals,
    linearise_groups,
)
from .start import directions, intersect_rays
from .unknowns import Unknowns

# damping of Levenberg and Marquardt (chosen): the first where a place on the way is singular; below
# the second it is none, beyond the third a step moves nothing and the block does not converge
FIRST_DAMPING, LEAST_DAMPING, MOST_DAMPING = 1e-4, 1e-9, 1e10
RAISED, LOWERED = 3.0, 0.2  # a refused step after another raises twice as much (Nielsen 1999)
MOST_STEPS = 60  # of the iteration (chosen): a block that needs more does not converge
MOST_VALIDITY_ROUNDS = 4  # until the same rays are in front of their cameras (chosen)
CONVERGED_STEP = 1e-3  # standard deviations, of any unknown
CONVERGED_COST = 1e-9  # of the cost, by a refused step


@dataclass(frozen=True, eq=False)
class Adjusted:
    """The end of an iteration.

    Parameters
    ----------
    problem : Problem
        What was minimised, with the observations that took part.
    values : Unknowns
        The adjusted values.
    cost : float
        e^T P e.
    iterations : int
        Steps taken or refused.
    redundancy : int
        Observations less unknowns.
    """

    problem: Problem
    values: Unknowns
    cost: float
    iterations: int
    redundancy: int

    @property
    def sigma0(self) -> float:
        """Root of the variance of unit weight."""
        return float(np.sqrt(self.cost / self.redundancy)) if self.redundancy > 0 else np.nan


def adjust_problem(problem: Problem, values: Unknowns, enough: float = CONVERGED_STEP) -> Adjusted:
    """Adjust a block.

    Image observations that cannot take part at the first values (of a point behind its camera,
    say, because the first attitude is off) are tried again when the others have converged.

    Parameters
    ----------
    problem : Problem
        The observations.
    values : Unknowns
        First values of all unknowns; points without a first value (NaN) do not take part.
    enough : float
        Standard deviations by which the last step may move an unknown; infinite where the caller
        linearises again: then the first undamped step is the last.

    Returns
    -------
    Adjusted
        Values that have converged.

    Raises
    ------
    DataError
        An image has no first values, the observations do not determine the unknowns, or the
        iteration does not converge.
    """
    if not (finite := _images_with_pose(values)).all():
        names = [problem.block.images[i] for i in np.flatnonzero(~finite)]
        raise DataError(
            f"image {names[0]}{f' and {len(names) - 1} more' if names[1:] else ''}: initial"
            " position and attitude are missing; give them, or measure four points of known"
            " coordinates in the image"
        )
    steps = 0
    for _ in range(MOST_VALIDITY_ROUNDS):
        active = valid(problem, values)
        result = _iterate(problem.with_active(active), values, steps, enough)
        steps, values = result.iterations, result.values
        again = intersected_again(problem, values)
        if (valid(problem, again) == active).all():
            break
        values = again
    return result


def _images_with_pose(values: Unknowns) -> NDArray[np.bool_]:
    """Return which images have a pose (n,)."""
    finite = np.isfinite(values.position).all(axis=1)
    finite &= np.isfinite(values.C_mc).all(axis=(1, 2))
    return np.asarray(finite)


def intersected_again(problem: Problem, values: Unknowns) -> Unknowns:
    """Intersect points that did not take part from the poses.

    Parameters
    ----------
    problem : Problem
        The observations.
    values : Unknowns
        The poses; NaN of these points.

    Returns
    -------
    Unknowns
        The values with these points; NaN stays of those whose rays do not meet.
    """
    missing = np.isnan(values.point[:, 0])
    if not missing.any():
        return values
    obs = problem.block.observations
    rows = missing[obs.point]
    cameras = values.cameras(problem.block.cameras)
    xy = directions(problem.block, cameras, rows)
    point = intersect_rays(
        values.position, values.C_mc, xy, obs.image[rows], obs.point[rows], missing.size
    )
    return values.with_points(np.where(missing[:, None], point, values.point))


def _iterate(problem: Problem, values: Unknowns, steps: int, enough: float) -> Adjusted:
    """Iterate with the observations that are active, which are valid at the first values."""
    values = problem.filled(values)
    groups = linearise_groups(problem, values)
    now, _ = cost(problem, values, groups)
    first, freedom = now, max(redundancy_of(problem), 1)
    damping, raised, negligible, longest = 0.0, RAISED, False, 0.0
    for step in range(steps + 1, steps + MOST_STEPS + 1):
        try:
            dx, dp, predicted = _step(problem, values, damping, groups)
        except DataError:
            if damping > 0.0 or negligible:
                raise
            # a place on the way may be singular where the solution is not
            damping = FIRST_DAMPING
            dx, dp, predicted = _step(problem, values, damping, groups)
        trial = values.moved(problem.layout, dx, dp)
        ahead = linearise_groups(problem, trial)
        new, invalid = cost(problem, trial, ahead)
        accepted = invalid == 0 and new < now
        small = invalid == 0 and abs(new - now) < CONVERGED_COST * now
        ends = enough**2 * max(now / freedom, np.finfo(float).tiny)
        negligible = predicted < ends
        gain = (now - new) / predicted if predicted > 0.0 else 0.0
        longest = max(longest, predicted)
        share(converged_share(predicted, longest, ends))
        if accepted:
            values, now, groups = trial, new, ahead
        if (negligible and damping == 0.0) or (small and not accepted):
            break
        if accepted:
            damping *= max(LOWERED, 1.0 - (2.0 * min(gain, 1.0) - 1.0) ** 3)
            damping = damping if damping > LEAST_DAMPING and not negligible else 0.0
            raised = RAISED
        else:
            damping, raised = max(raised * damping, LEAST_DAMPING), 2.0 * raised
            if damping > MOST_DAMPING:
                raise DataError(_not_converged(step, first, now))
    else:
        raise DataError(_not_converged(MOST_STEPS, first, now))
    if damping > 0.0:  # a damped step has a solution where the unknowns are not determined
        factorise_normals(problem, assemble_normals(problem, values, groups=groups))
    point = np.where(problem.determined[:, None], values.point, np.nan)
    return Adjusted(problem, values.with_points(point), now, step, redundancy_of(problem))


def _step(
    problem: Problem, values: Unknowns, damping: float, groups: Linearised
) -> tuple[Array, Array, float]:
    """Return corrections of columns and points, and dx^T N dx."""
    normals = assemble_normals(problem, values, damping, groups)
    dx, dp = corrections(problem, values, normals)
    eliminated = problem.layout.kept < 0
    return dx, dp, float(normals.g @ dx + (normals.gp * dp)[eliminated].sum())


def _not_converged(steps: int, first: float, last: float) -> str:
    return (
        f"the adjustment has not converged in {steps} steps (cost {first:.4g} at first,"
        f" {last:.4g} at last); initial values are too far off, or image observations carry"
        " the name of a wrong point or image: give better poses, or leave out the"
        " observations with the largest residuals"
    )


def valid(problem: Problem, values: Unknowns) -> NDArray[np.bool_]:
    """Return which active observations can take part, in the order of rays.

    These are observations of points with a first value before the camera and within the fold of its
    polynomial, that appear less than the image's size from where they were measured, if at least
    two of them, or one and a group, see the point.

    Parameters
    ----------
    problem, values
        The observations and the first values.

    Returns
    -------
    ndarray of bool, (n,)
        Which take part.
    """
    e = values.residuals(problem.rays)
    size = np.array([max(c.width, c.height) for c in problem.block.cameras], dtype=np.float64)
    good = problem.rays.active & np.isfinite(e).all(axis=1)
    good &= np.abs(e).max(axis=1) < size[problem.rays.camera[problem.rays.image]]
    rays = np.bincount(problem.point[good], minlength=len(problem.block.points))
    return np.asarray(good & ((rays >= 2) | problem.observed)[problem.point])


def redundancy_of(problem: Problem) -> int:
    """Return the number of observations less that of unknowns.

    Coordinates of points that are not known are no observations.

    Parameters
    ----------
    problem : Problem
        The observations; active ones count.

    Returns
    -------
    int
        The redundancy.
    """
    weights = [group.weight for group in problem.groups]
    n = 2 * int(problem.rays.active.sum()) + sum(len(weight) for weight in weights)
    points = np.array([weight for weight in weights if len(weight) == 3]).reshape(-1, 3, 3)
    n -= int((np.linalg.eigvalsh(points) < (2.0 / UNKNOWN_M) ** 2).sum())
    eliminated = problem.determined & (problem.layout.kept < 0)
    return n - int((~problem.layout.held).sum()) - 3 * int(eliminated.sum())


def residuals_px(result: Adjusted) -> Array:
    """Return the residuals of the image observations.

    Parameters
    ----------
    result : Adjusted
        The adjustment.

    Returns
    -------
    ndarray, (n, 2)
        Observed - computed, pixels, in the order of the block's observations; NaN where a point
        does not take part or cannot be seen.
    """
    problem = result.problem
    out = np.empty_like(problem.rays.uv)
    out[problem.order] = result.values.residuals(problem.rays)
    return out
