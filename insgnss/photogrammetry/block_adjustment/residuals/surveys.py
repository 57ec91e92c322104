"""Ground and check points of two surveys: some of them lie shifted against the others.

Half of the points have heights above sea level, or come from another base. Each subset bends the
block towards itself, so that neither the residuals nor a shift of all points show it. So the block
is adjusted without ground control, and all ground points are check points: with d = surveyed -
adjusted of n points and their joint covariance C (C.1 of `check_points`), a shift s of all of them,
of which aerial control may be the cause, and a further one t of a subset A,

    d_i = s + [i in A] t,    q = (d - s - t)' C^-1 (d - s - t),    gain = q(t = 0) - min q    (S.1)

Subsets are those that lie above a gap in one of the coordinates of d. A subset explains d where the
rest of it then is chance, which a camera, a lever arm or a clock leaves in no subset.
"""

from dataclasses import replace

import numpy as np

from ....base.errors import DataError
from ....base.quantiles import chi_square_quantile
from ....base.wording import some
from ....records.block import Array, GroundPoints
from ..solve import AdjustedBlock, solve_block
from ..trials import OTHER_DATUM, Trial, explains, moved_sigmas
from .check_points import check_points

FEWEST_POINTS, FEWEST_OF_SURVEY = 5, 2  # in all, and of each survey; one alone is a gross error
FITS_CHANCE = 1e-4  # of what a subset leaves, as right points leave it
CHECK_SHIFT = "shift of check points"
ALMOST_ALL = 0.8  # of what is too much in check points, which a shift of all of them takes away
HEIGHTS_BESIDE = (
    "heights above sea level (geoid) stand beside heights above the ellipsoid, or two bases were"
    " used; bring all points to one of them"
)
SPLIT_CHANCE = 1e-6  # of the gain of the best of all subsets where there is one survey


def two_surveys(whole: AdjustedBlock) -> Trial | None:
    """Find a subset of ground and check points that lies shifted against the others.

    Parameters
    ----------
    whole : AdjustedBlock
        The block, with ground control.

    Returns
    -------
    Trial or None
        The shift of the smaller subset, m; None where one survey explains them, where no subset
        does, or where nothing but the points says where the block lies.
    """
    inputs, block = whole.inputs, whole.inputs.block
    control = block.control.complete
    if inputs.eo is None or whole.direct or not len(control):
        return None
    every = GroundPoints(
        *(
            np.concatenate([getattr(points, name) for points in (control, block.check)])
            for name in ("point", "position_m", "cov")
        )
    )
    if len(every) < FEWEST_POINTS:
        return None
    free = replace(block, control=GroundPoints(every.point[:0], *_none()), check=every)
    try:
        alone = solve_block(replace(inputs, block=free), lambda _: None)
        checks = check_points(alone)
        split = best_split(checks.difference_m, checks.cov_of_differences)
    except (DataError, np.linalg.LinAlgError):
        return None  # aerial control alone does not determine the block
    if split is None:
        return None
    subset, shift, sigma, gain = split
    names = [block.points[p] for p in every.point[checks.rows]]
    shifted = [name for name, inside in zip(names, subset, strict=True) if inside]
    vertical = abs(shift[2]) > 3.0 * np.linalg.norm(shift[:2])
    return Trial(
        f"shift of {len(shifted)} of {len(names)} ground points ({some(shifted)}) against the"
        " others",
        gain,
        shift,
        sigma,
        "m",
        True,
        HEIGHTS_BESIDE if vertical else OTHER_DATUM,
        moved_sigmas(whole, alone.result.values.position - whole.result.values.position),
    )


def shift_of_check_points(solved: AdjustedBlock) -> Trial | None:
    """Try whether check points all stand in axes shifted against those of the block.

    Parameters
    ----------
    solved : AdjustedBlock
        The adjusted block.

    Returns
    -------
    Trial or None
        The shift; None of fewer than three check points.
    """
    checks = check_points(solved)
    if len(checks.rows) < 3:
        return None
    value, cov = checks.shift()
    gain = float(value @ np.linalg.solve(cov, value))
    excess = checks.normalised_square - checks.difference_m.size
    enough = explains(gain, 3, excess, ALMOST_ALL)
    return Trial(CHECK_SHIFT, gain, value, np.sqrt(np.diagonal(cov)), "m", enough, OTHER_DATUM)


def _none() -> tuple[Array, Array]:
    """Coordinates and covariances of no points."""
    return np.zeros((0, 3)), np.zeros((0, 3, 3))


def best_split(d: Array, C: Array) -> tuple[Array, Array, Array, float] | None:
    """Return the subset of points whose shift against the others explains all differences (S.1).

    Parameters
    ----------
    d : ndarray, (n, 3)
        Surveyed - adjusted, m.
    C : ndarray, (3 n, 3 n)
        Their covariance, m^2.

    Returns
    -------
    subset : ndarray of bool, (n,)
        The smaller of both.
    shift, sigma : ndarray, (3,)
        Of the subset against the others, m.
    gain : float
        By how much the weighted squares fall.
    """
    n = len(d)
    if n < FEWEST_POINTS:
        return None
    W = np.linalg.inv(C)
    every, e = np.tile(np.eye(3), (n, 1)), d.ravel()

    def fitted(H: Array) -> tuple[Array, Array, float]:
        """Return shifts, their cofactors, and the weighted squares that they leave."""
        cofactors = np.asarray(np.linalg.inv(H.T @ W @ H), dtype=np.float64)
        shifts = cofactors @ (H.T @ W @ e)
        residual = e - H @ shifts
        return shifts, cofactors, float(residual @ W @ residual)

    q = fitted(every)[2]
    if q <= chi_square_quantile(3 * n - 3, FITS_CHANCE):
        return None
    best: tuple[float, Array, Array, Array] | None = None
    for axis in range(3):
        order = np.argsort(d[:, axis])
        for k in range(FEWEST_OF_SURVEY, n - FEWEST_OF_SURVEY + 1):
            subset = np.zeros(n, dtype=bool)
            subset[order[:k] if 2 * k <= n else order[k:]] = True
            H = np.hstack([every, every * np.repeat(subset, 3)[:, None]])
            shifts, cofactors, remaining = fitted(H)
            if best is None or remaining < best[0]:
                best = remaining, subset, shifts[3:], np.sqrt(np.diagonal(cofactors))[3:]
    assert best is not None
    remaining, subset, shift, sigma = best
    splits = 3 * (n - 2 * FEWEST_OF_SURVEY + 1)
    least_gain = chi_square_quantile(3, SPLIT_CHANCE / splits)
    if q - remaining <= least_gain or remaining > chi_square_quantile(3 * n - 6, FITS_CHANCE):
        return None
    return subset, shift, sigma, q - remaining
