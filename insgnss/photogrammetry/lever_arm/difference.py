"""Two lever arms against each other, such as before take-off and after landing."""

from dataclasses import dataclass

import numpy as np

from ...records import Array
from .records import factor_limit


@dataclass(frozen=True, eq=False)
class LeverArmDifference:
    """Difference of two lever arms.

    Parameters
    ----------
    difference_m : ndarray, (3,)
        Second minus first.
    sigma_m : ndarray, (3,)
        Its standard errors.
    chi_square, limit : float
        Of the difference over its covariance, and what chance allows of it.
    """

    difference_m: Array
    sigma_m: Array
    chi_square: float
    limit: float

    @property
    def length_m(self) -> float:
        """Length of the difference, m."""
        return float(np.linalg.norm(self.difference_m))

    @property
    def agrees(self) -> bool:
        """Whether chance explains the difference."""
        return self.chi_square <= self.limit

    def summary(self) -> str:
        """Return the difference with its verdict."""
        values = ", ".join(
            f"{1e3 * d:+.1f} +- {1e3 * s:.1f}"
            for d, s in zip(self.difference_m, self.sigma_m, strict=True)
        )
        verdict = "agree" if self.agrees else "contradict each other"
        return (
            f"lever arms {1e3 * self.length_m:.1f} mm apart ({values} mm) {verdict} (chi-square"
            f" {self.chi_square:.1f}, limit {self.limit:.1f})"
        )


def lever_arm_difference(
    first: Array, first_cov: Array, second: Array, second_cov: Array
) -> LeverArmDifference:
    """Compare two lever arms, such as before take-off and after landing.

    Parameters
    ----------
    first, second : ndarray, (3,)
        Lever arms in the same axes, m.
    first_cov, second_cov : ndarray, (3, 3)
        Their covariances, m^2; of independent errors.

    Returns
    -------
    LeverArmDifference
        Second minus first.
    """
    difference, cov = np.asarray(second) - first, np.asarray(first_cov) + second_cov
    size = float(difference @ np.linalg.solve(cov, difference))
    return LeverArmDifference(difference, np.sqrt(np.diag(cov)), size, 3.0 * factor_limit(3))
