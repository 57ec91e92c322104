"""Nonlinear least squares over groups of residuals, each with a variance factor of its own.

A group's residuals r of covariance S give the factor F = r^T S^-1 r / (rows - parameters that it
mainly determines). Where F passes the 99 % bound of chi-square over the degrees of freedom, S was
too small: it is multiplied by F and the solution is repeated (a variance component per group, Koch
1999, 3.6). A smaller F is chance, and is left alone.
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass

import numpy as np

from ...base.errors import DataError
from ...base.quantiles import chi_square_quantile
from ...geodesy.least_squares import Equations, NormalEquations
from ...records import Array

FACTOR_CONFIDENCE = 0.99  # of chi-square, above which a group's covariance was too small
FACTOR_ROUNDS = 6  # most solutions with new factors (chosen)


@dataclass(frozen=True, eq=False)
class ResidualGroup:
    """One group of residuals.

    Parameters
    ----------
    model : callable
        Maps parameters (p,) to residuals (k, d) and their Jacobian (k, d, p).
    covariance : ndarray, (k, d, d)
        Covariance of the residuals.
    determined : int
        Number of parameters that the group mainly determines.
    """

    model: Callable[[Array], tuple[Array, Array]]
    covariance: Array
    determined: int


@dataclass(frozen=True, eq=False)
class GroupFit:
    """A solution of all groups.

    Parameters
    ----------
    values : ndarray, (p,)
        Parameters.
    covariance : ndarray, (p, p)
        Their covariance.
    residual : ndarray, (r,)
        Residuals of all rows, whitened by the covariance that was used.
    factor : dict of str to float
        Variance factor of each group over the covariance given.
    """

    values: Array
    covariance: Array
    residual: Array
    factor: dict[str, float]


# of steps and sums of squares, and of the gradient, where the solution ends: rounding
STEP_TOLERANCE, GRADIENT_TOLERANCE = 1e-14, 1e-10
FACTOR_TOLERANCE = 0.01  # of a group's sigma, by which a variance factor may still change


def solve_groups(groups: Mapping[str, ResidualGroup], prior: Array, prior_sigma: Array) -> GroupFit:
    """Fit parameters to all groups.

    Parameters
    ----------
    groups : mapping of str to ResidualGroup
        Groups of residuals by name.
    prior, prior_sigma : ndarray, (p,)
        Where the parameters start and how far they may go.

    Returns
    -------
    GroupFit
        The solution.

    Raises
    ------
    DataError
        Where the solution does not converge.
    """
    from scipy.optimize import least_squares

    def linearised(q: Array) -> list[Equations]:
        """Linearise every group, and the prior, by the parameters in units of its sigmas."""
        out = []
        for name, group in groups.items():
            residual, jacobian = group.model(prior + prior_sigma * q)
            out.append(Equations(-residual, jacobian * prior_sigma, {name: group.covariance}))
        return [*out, Equations.prior(-q, np.eye(q.size))]

    def white(q: Array, factors: Mapping[str, float], column: int) -> Array:
        """Return misclosures (0) or derivatives (1) of all groups, whitened."""
        return np.concatenate([group.whitened(factors)[column] for group in linearised(q)])

    q = np.zeros(prior.size)
    factor: dict[str, float] = {}
    next_factors = dict.fromkeys(groups, 1.0)
    for _ in range(FACTOR_ROUNDS):
        inflate = next_factors
        next_factors = dict.fromkeys(groups, 1.0)
        solution = least_squares(
            lambda q, factors: -white(q, factors, 0),
            q,
            lambda q, factors: white(q, factors, 1),
            xtol=STEP_TOLERANCE,
            ftol=STEP_TOLERANCE,
            gtol=GRADIENT_TOLERANCE,
            args=(inflate,),
        )
        if not solution.success:
            raise DataError(
                "calibration does not converge; the stationary periods contradict each other, look"
                " at units and at the recording"
            )
        normals = NormalEquations(linearised(solution.x), inflate)
        q = solution.x + normals.dx  # scipy stops where the gradient is small, not at its zero
        for (name, group), equations in zip(groups.items(), linearised(q), strict=False):
            redundancy = equations.e.size - group.determined
            square = NormalEquations([equations]).square()
            factor[name] = square / redundancy if redundancy > 0 else 1.0
            if redundancy > 0 and square > chi_square_quantile(redundancy, 1.0 - FACTOR_CONFIDENCE):
                next_factors[name] = factor[name]
        ratios = [np.sqrt(next_factors[name] / inflate[name]) for name in groups]
        if all(abs(ratio - 1.0) < FACTOR_TOLERANCE for ratio in ratios):
            break
    covariance = normals.cov * np.outer(prior_sigma, prior_sigma)
    residual = -white(q, inflate, 0)[: -prior.size]
    return GroupFit(prior + prior_sigma * q, covariance, residual, factor)
