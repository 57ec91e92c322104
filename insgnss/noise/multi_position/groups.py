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
from ...records import Array

CONFIDENCE = 0.99
ROUNDS = 6


@dataclass(frozen=True, eq=False)
class Group:
    """One group of residuals.

    Parameters
    ----------
    model : callable
        Maps parameters (p,) to residuals (m,) and their Jacobian (m, p).
    covariance : ndarray, (m, m) or (m,)
        Covariance or variances of the residuals.
    determined : int
        Number of parameters that the group mainly determines.
    """

    model: Callable[[Array], tuple[Array, Array]]
    covariance: Array
    determined: int

    def whitening(self) -> Array:
        """Return the matrix (m, m) that makes the residuals white of unit variance."""
        if self.covariance.ndim == 1:
            return np.diag(1.0 / np.sqrt(self.covariance))
        return np.asarray(np.linalg.inv(np.linalg.cholesky(self.covariance)), dtype=np.float64)


@dataclass(frozen=True, eq=False)
class Fit:
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


def solve_groups(groups: Mapping[str, Group], prior: Array, prior_sigma: Array) -> Fit:
    """Fit parameters to all groups.

    Parameters
    ----------
    groups : mapping of str to Group
        Groups of residuals by name.
    prior, prior_sigma : ndarray, (p,)
        Where the parameters start and how far they may go.

    Returns
    -------
    Fit
        The solution.

    Raises
    ------
    DataError
        Where the solution does not converge.
    """
    from scipy.optimize import least_squares
    from scipy.stats import chi2

    white = {name: group.whitening() for name, group in groups.items()}
    inflate = dict.fromkeys(groups, 1.0)
    values, factor = prior, dict.fromkeys(groups, 1.0)
    for _ in range(ROUNDS):
        weights = {name: white[name] / inflate[name] for name in groups}

        def residual(q: Array, weights: dict[str, Array] = weights) -> Array:
            p = prior + prior_sigma * q
            return np.concatenate(
                [*(weights[name] @ group.model(p)[0] for name, group in groups.items()), q]
            )

        def jacobian(q: Array, weights: dict[str, Array] = weights) -> Array:
            p = prior + prior_sigma * q
            rows = [
                weights[name] @ group.model(p)[1] * prior_sigma for name, group in groups.items()
            ]
            return np.concatenate([*rows, np.eye(q.size)])

        start = (values - prior) / prior_sigma
        solution = least_squares(
            residual, start, jac=jacobian, method="trf", xtol=1e-14, ftol=1e-14, gtol=1e-10
        )
        if not solution.success:
            raise DataError(
                "calibration does not converge; the stationary periods contradict each other, look"
                " at units and at the recording"
            )
        values = prior + prior_sigma * solution.x
        wanted = {}
        for name, group in groups.items():
            free = len(group.covariance) - group.determined
            square = float(np.sum((white[name] @ group.model(values)[0]) ** 2))
            factor[name] = square / free if free > 0 else 1.0
            wanted[name] = (
                np.sqrt(factor[name]) if free > 0 and square > chi2.ppf(CONFIDENCE, free) else 1.0
            )
        settled = all(abs(wanted[name] / inflate[name] - 1.0) < 0.01 for name in groups)
        if settled:
            break
        inflate = wanted
    covariance = np.linalg.inv(solution.jac.T @ solution.jac) * np.outer(prior_sigma, prior_sigma)
    return Fit(values, covariance, solution.fun[: -prior.size], factor)
