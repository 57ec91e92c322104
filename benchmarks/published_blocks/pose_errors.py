"""Errors of poses that are drawn, and their covariance as a processed flight has it.

Each of the six components (position, tangent-plane axes; psi, see below) has at the exposures t_k

    e_k = sigma (sqrt(s) g_k + sqrt(1 - s) w_k),   cov(g_j, g_k) = exp(-|t_j - t_k| / tau)    (B.2)

with w white, s the share of the variance that lasts and tau its correlation time; components are
independent of each other. g is drawn by its recursion from exposure to exposure, so that a draw is
the same on every machine. The components of psi are along the axes of the camera, as a tilt is by
the bias of an accelerometer or what is left of a bore-sight: on lines to and fro such errors are
opposite, the repeated pattern of paper 003's Figure 3. Or they are along those of the tangent
plane, where lines to and fro share them.

As files the covariance is that of each flight line at once and what the lines share
(`records.CommonErrors`). g is a Markov process: given its values at nodes of which one lies between
any two lines that follow each other, its values in different lines are independent. With the nodes'
correlations L L' the shared errors are c = L^-1 g(nodes), of unit covariance, and

    A_k = T_k sqrt(s) cov(g_k, g(nodes)) L^-T                                                 (B.3)

(T_k takes components to tangent-plane axes, times sigma) leaves no covariance between lines:
nothing is lost, where a Karhunen-Loeve expansion of as many terms leaves some of it. It
takes six unknowns for each node.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from insgnss.base.errors import UsageError
from insgnss.photogrammetry.adjust.kinematic import gauss_markov as correlations
from insgnss.records.strips import CommonErrors, StripCovariance

Array = NDArray[np.float64]


@dataclass(frozen=True)
class PoseErrors:
    """Statistics of the errors of poses (B.2).

    Parameters
    ----------
    position_m, attitude_deg : tuple of float
        (3) standard deviations of position, m, along east, north, up, and of psi, deg, along
        `axes`.
    share : float
        Share of the variances that lasts, 0 to 1.
    correlation_s : float
        Its correlation time, s.
    axes : str
        Of attitude errors: "camera" or "tangent plane".

    Raises
    ------
    UsageError
        A value that cannot be.
    """

    position_m: tuple[float, ...] = (0.035, 0.035, 0.030)
    attitude_deg: tuple[float, ...] = (0.045, 0.045, 0.125)
    share: float = 0.75
    correlation_s: float = 300.0
    axes: Literal["camera", "tangent plane"] = "camera"

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

    def turned(self, C_mc: Array) -> Array:
        """Return the components in tangent-plane axes.

        Parameters
        ----------
        C_mc : ndarray, (n, 3, 3)
            Attitudes.

        Returns
        -------
        ndarray, (n, 6, 6)
            Errors in tangent-plane axes by errors of unit variance.
        """
        out = np.zeros((len(C_mc), 6, 6))
        out[:, :3, :3] = np.eye(3)
        out[:, 3:, 3:] = C_mc if self.axes == "camera" else np.eye(3)
        return np.asarray(out * self.sigma)

    def draw(self, time: Array, C_mc: Array, rng: np.random.Generator) -> Array:
        """Return errors, truth minus estimate.

        Parameters
        ----------
        time : ndarray, (n,)
            Exposures, not decreasing, s.
        C_mc : ndarray, (n, 3, 3)
            Attitudes.
        rng : numpy.random.Generator
            Where they are drawn.

        Returns
        -------
        ndarray, (n, 6)
            Position, m, and psi, rad, tangent-plane axes.
        """
        slow = gauss_markov(time, self.correlation_s, 6, rng)
        white = rng.standard_normal(slow.shape)
        errors = np.sqrt(self.share) * slow + np.sqrt(1.0 - self.share) * white
        return np.einsum("nij,nj->ni", self.turned(C_mc), errors)

    def correlation(self, time: Array) -> Array:
        """Return the correlations (n, n) of any component of exposures at `time` (n,)."""
        return correlations(time, self.share, self.correlation_s)

    def covariance(self, time: Array, C_mc: Array) -> Array:
        """Return the covariance (6 n, 6 n) of all poses, image after image."""
        T = self.turned(C_mc)
        own = np.einsum("jac,kbc,jk->jakb", T, T, self.correlation(time), optimize=True)
        own = own.reshape(6 * time.size, -1)
        return np.asarray(0.5 * (own + own.T))

    def strips(
        self, time: Array, C_mc: Array, rows: Sequence[NDArray[np.int64]]
    ) -> list[StripCovariance]:
        """Return the covariance of each strip of which the rows are given."""
        return [StripCovariance(k, self.covariance(time[k], C_mc[k])) for k in rows]

    def common(
        self, time: Array, C_mc: Array, rows: Sequence[NDArray[np.int64]]
    ) -> CommonErrors | None:
        """Return what strips share (B.3).

        Parameters
        ----------
        time : ndarray, (n,)
            Exposures, s.
        C_mc : ndarray, (n, 3, 3)
            Attitudes.
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
        factor = np.einsum("kq,kij->kiqj", np.sqrt(self.share) * root, self.turned(C_mc))
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
