"""Check points: surveyed minus adjusted, with the covariance of all of them together.

Adjusted points of one block share their errors: twenty check points that all lie 3 cm too low say
one thing once. So their differences are judged by their joint covariance,

    q = d^T (P + S)^-1 d,    chi-square with 3 m degrees of freedom                          (C.1)

P that of the adjusted points among each other, S that of their survey. P asks for points that are
not eliminated: the normal equations are assembled once more at the solution with these points kept.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ....base.quantiles import chi_square_quantile
from ....geodesy.least_squares import Equations, NormalEquations
from ....records.block import Array
from ...adjust.direct import joint_covariance
from ...adjust.normals import cofactors_of, problem_of
from ...adjust.unknowns import POINT
from ..solve import AdjustedBlock

FITS = 5e-4  # chance that right check points are judged as contradicting


@dataclass(frozen=True, eq=False)
class CheckPoints:
    """Check points that are seen in two images or more.

    Parameters
    ----------
    rows : ndarray of int
        (m,) their rows among the block's check points.
    difference_m : ndarray
        (m, 3) surveyed - adjusted, m.
    cov : ndarray
        (3 m, 3 m) covariance of the adjusted points, m^2.
    survey : ndarray
        (m, 3, 3) covariance of the survey, m^2.
    """

    rows: NDArray[np.int64]
    difference_m: Array
    cov: Array
    survey: Array

    @property
    def cov_of_differences(self) -> Array:
        """P + S of (C.1), (3 m, 3 m)."""
        total = self.cov.copy()
        for k, S in enumerate(self.survey):
            total[3 * k : 3 * k + 3, 3 * k : 3 * k + 3] += S
        return total

    @property
    def normalised_square(self) -> float:
        """q of (C.1)."""
        d = self.difference_m.ravel()
        return float(d @ np.linalg.solve(self.cov_of_differences, d)) if d.size else 0.0

    @property
    def contradicts_alone(self) -> int | None:
        """Row of the one check point without which the others fit; None where there is none."""
        n, C, d = len(self.rows), self.cov_of_differences, self.difference_m.ravel()
        if n < 2 or self.normalised_square <= chi_square_quantile(d.size, FITS):
            return None
        squares = []
        for k in range(n):
            keep = np.delete(np.arange(d.size), np.s_[3 * k : 3 * k + 3])
            squares.append(float(d[keep] @ np.linalg.solve(C[np.ix_(keep, keep)], d[keep])))
        worst = int(np.argmin(squares))
        return worst if squares[worst] <= chi_square_quantile(d.size - 3, FITS) else None

    def shift(self) -> tuple[Array, Array]:
        """Return the shift of all check points (3,), m, by least squares, and its covariance."""
        H, cov = np.tile(np.eye(3), (1, len(self.rows), 1)), {"": self.cov_of_differences[None]}
        normals = NormalEquations([Equations(self.difference_m.reshape(1, -1), H, cov)])
        return normals.dx, normals.cov


def check_points(solved: AdjustedBlock) -> CheckPoints:
    """Compare check points with the adjustment.

    Parameters
    ----------
    solved : AdjustedBlock
        The adjusted block.

    Returns
    -------
    CheckPoints
        Those that the adjustment determines.
    """
    result = solved.result
    block, point = result.problem.block, result.values.point
    old = result.problem
    rows = np.flatnonzero(np.isfinite(point[block.check.point]).all(axis=1))
    of_block = block.check.point[rows]
    d = block.check.position_m[rows] - point[of_block]
    if not rows.size:
        return CheckPoints(rows, d, np.zeros((0, 0)), block.check.cov[rows])
    keep = [int(p) for p in of_block]
    if solved.direct:
        Q = joint_covariance(old, result.values, keep)
        return CheckPoints(rows, d, Q, block.check.cov[rows])
    problem = problem_of(block, old.groups, result.values.blocks, keep).with_active_of(old)
    columns = np.concatenate([problem.layout.of((POINT, p))[0] for p in keep])
    Q = cofactors_of(problem, result.values, columns)
    return CheckPoints(rows, d, Q, block.check.cov[rows])
