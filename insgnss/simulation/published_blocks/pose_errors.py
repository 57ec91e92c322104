"""Errors of poses that are drawn, and their covariance as a processed flight has it.

Each of the six components (position, psi; tangent-plane axes) has at the exposures t_k

    e_k = sigma (sqrt(s) g_k + sqrt(1 - s) w_k),   cov(g_j, g_k) = exp(-|t_j - t_k| / tau)    (B.2)

with w white, s the share of the variance that lasts and tau its correlation time; components are
independent of each other. g is drawn by its recursion from exposure to exposure, so that a draw is
the same on every machine.

As files the covariance is that of each flight line at once and what the lines share
(`records.CommonErrors`). g is a Markov process: given its values at nodes of which one lies between
any two lines that follow each other, its values in different lines are independent. With the nodes'
correlations L L' the shared errors are c = L^-1 g(nodes), of unit covariance, and

    A_k = sigma sqrt(s) cov(g_k, g(nodes)) L^-T                                               (B.3)

leaves no covariance between lines: nothing is lost, where a Karhunen-Loeve expansion of as many
terms leaves neighbouring lines part of it. It takes six unknowns for each node.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ...base.errors import UsageError
from ...records.strips import CommonErrors, StripCovariance

Array = NDArray[np.float64]


@dataclass(frozen=True)
class PoseErrors:
    """Statistics of the errors of poses (B.2).

    Parameters
    ----------
    position_m, attitude_deg : tuple of float
        (3) standard deviations of position, m, and psi, deg, along east, north, up.
    share : float
        Share of the variances that lasts, 0 to 1.
    correlation_s : float
        Its correlation time, s.

    Raises
    ------
    UsageError
        A value that cannot be.
    """

    position_m: tuple[float, ...] = (0.035, 0.035, 0.030)
    attitude_deg: tuple[float, ...] = (0.045, 0.045, 0.125)
    share: float = 0.75
    correlation_s: float = 300.0

    def __post_init__(self) -> None:
        sigma = (*self.position_m, *self.attitude_deg)
        if len(sigma) != 6 or not all(0.0 < value < np.inf for value in sigma):
            raise UsageError(
                f"pose errors: standard deviations {sigma}; three of position and three of"
                " attitude, each greater than zero"
            )
        if not 0.0 <= self.share <= 1.0 or not 0.0 < self.correlation_s < np.inf:
            raise UsageError(
                f"pose errors: share {self.share:g} over {self.correlation_s:g} s; the share lies"
                " within 0 to 1, the correlation time is greater than zero"
            )

    @property
    def sigma(self) -> Array:
        """(6,) standard deviations, m and rad."""
        return np.array([*self.position_m, *np.radians(self.attitude_deg)])

    def draw(self, time: Array, rng: np.random.Generator) -> Array:
        """Return errors, truth minus estimate.

        Parameters
        ----------
        time : ndarray, (n,)
            Exposures, not decreasing, s.
        rng : numpy.random.Generator
            Where they are drawn.

        Returns
        -------
        ndarray, (n, 6)
            Position, m, and psi, rad.
        """
        lasting = gauss_markov(time, self.correlation_s, 6, rng)
        white = rng.standard_normal(lasting.shape)
        errors = np.sqrt(self.share) * lasting + np.sqrt(1.0 - self.share) * white
        return np.asarray(self.sigma * errors)

    def correlation(self, time: Array) -> Array:
        """Return the correlations (n, n) of any component of exposures at `time` (n,)."""
        apart = np.abs(time[:, None] - time)
        rho = self.share * np.exp(-apart / self.correlation_s)
        return np.asarray(rho + (1.0 - self.share) * np.eye(time.size))

    def covariance(self, time: Array) -> Array:
        """Return the covariance (6 n, 6 n) of all poses, image after image."""
        return np.asarray(np.kron(self.correlation(time), np.diag(self.sigma**2)), dtype=np.float64)

    def strips(self, time: Array, rows: Sequence[NDArray[np.int64]]) -> list[StripCovariance]:
        """Return the covariance of each strip of which the rows are given."""
        return [StripCovariance(k, self.covariance(time[k])) for k in rows]

    def common(self, time: Array, rows: Sequence[NDArray[np.int64]]) -> CommonErrors | None:
        """Return what strips share (B.3).

        Parameters
        ----------
        time : ndarray, (n,)
            Exposures, s.
        rows : sequence of ndarray
            Rows of the images of each strip; an image in none is one by itself.

        Returns
        -------
        CommonErrors or None
            The shared errors; None of a single strip.
        """
        n = time.size
        number = -1 - np.arange(n)
        for k, strip in enumerate(rows):
            number[strip] = k
        last = np.flatnonzero(np.diff(number))
        if not last.size or self.share == 0.0:
            return None
        nodes = 0.5 * (time[last] + time[last + 1])
        between = np.exp(-np.abs(nodes[:, None] - nodes) / self.correlation_s)
        cross = np.exp(-np.abs(time[:, None] - nodes) / self.correlation_s)
        root = np.linalg.solve(np.linalg.cholesky(between), cross.T).T
        factor = np.einsum("kq,ij->kiqj", np.sqrt(self.share) * root, np.diag(self.sigma))
        return CommonErrors(np.zeros(n, dtype=np.int64), factor.reshape(n, 6, -1))


def gauss_markov(
    time: Array, correlation_s: float, columns: int, rng: np.random.Generator
) -> Array:
    """Return stationary Gauss-Markov processes of unit variance, by their recursion.

    Parameters
    ----------
    time : ndarray, (n,)
        Not decreasing, s.
    correlation_s : float
        Correlation time, s.
    columns : int
        How many, independent of each other.
    rng : numpy.random.Generator
        Where they are drawn.

    Returns
    -------
    ndarray, (n, columns)
        The processes.
    """
    out = rng.standard_normal((time.size, columns))
    rho = np.exp(-np.diff(time) / correlation_s)
    for k, r in enumerate(rho, start=1):
        out[k] = r * out[k - 1] + np.sqrt(1.0 - r * r) * out[k]
    return out
