"""Lever arm from a tripod: camera poses by photogrammetry, a pin in the antenna's place by
tachymetry (paper 000, 3.1).

The aircraft stands on a tripod in J setups; in each, images of near targets give the camera's pose
in the mapping frame and a theodolite the tip p of a pin that stands for the antenna's phase centre:

    a_j = C_mc^T (p_j - c_j)                                                                   (Q.1)

in camera axes, from the projection centre to the pin. With C(true) = exp([psi x]) C the error of
(Q.1) is C^T (dp - dc + [d x] psi), d = p - c, and so with the covariance P of (c, psi)

    S_j = C^T (S_p + J P J^T) C,    J = [-I | [d x]]                                           (Q.2)
    a = (sum S_j^-1)^-1 sum S_j^-1 a_j                                                         (Q.3)

The spread is the check: v^T S^-1 v over 3 (J - 1) degrees of freedom, v = a_j - a, is the variance
factor. Where it is above what chance allows, covariances were too small and standard errors grow by
its root. A setup is an outlier where it stands off the mean of the *others* both by the given
covariances (chi-square) and by the spread of the others (F), at 1 % over all setups: covariances
that are too small reject nothing.

What no spread shows: an offset of the two frames that is the same in all setups of one attitude.
Setups turned against each other show it as spread.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ...base.errors import DataError
from ...geodesy.least_squares import Equations, NormalEquations
from ...geodesy.rotation import skew, vector_from_rotation
from ...records import Array
from .records import SIGNIFICANCE, LeverArm, PosedAntennas, factor_limit, millimetres

TURNED_DEG = 20.0  # between setups: below, a common offset of the frames hides in the lever arm


@dataclass(frozen=True, eq=False)
class TripodLeverArm(LeverArm):
    """Lever arm from the camera's projection centre to the antenna, in camera axes.

    Parameters
    ----------
    lever_arm_m, cov, variance_factor, factor_limit
        As `LeverArm` has them: the weighted mean (Q.3) of the setups used.
    each_m : ndarray, (n, 3)
        Lever arm of each setup (Q.1).
    outlier : ndarray, (n,)
        Whether a setup was left out.
    attitude_span_deg : float
        Greatest turn between two setups.
    """

    each_m: Array
    outlier: NDArray[np.bool_]
    attitude_span_deg: float

    @property
    def spread_m(self) -> Array:
        """Standard deviation (3,) of one setup, from the scatter; NaN with one."""
        used = self.each_m[~self.outlier]
        return used.std(axis=0, ddof=1) if len(used) > 1 else np.full(3, np.nan)

    @property
    def consistent(self) -> bool:
        """Whether the spread is what the covariances promise; False where nothing checks it."""
        return bool(self.variance_factor <= self.factor_limit)

    def summary(self) -> str:
        """Return the lever arm, its check and what nothing checked."""
        n, out = len(self.each_m), np.flatnonzero(self.outlier) + 1
        text = [
            f"lever arm camera to antenna {millimetres(self.lever_arm_m)} +-"
            f" {millimetres(self.sigma_m)} mm in camera axes, from {n - len(out)} of {n} setups"
        ]
        if len(out):
            away = 1e3 * np.linalg.norm(self.each_m[out - 1] - self.lever_arm_m, axis=1)
            text.append(
                "left out: "
                + ", ".join(f"setup {j} ({d:.1f} mm off)" for j, d in zip(out, away, strict=True))
            )
        if n - len(out) < 2:
            text.append("one setup, nothing checks it: add two more, turned against it")
        elif self.consistent:
            text.append(
                f"one setup scatters by {millimetres(self.spread_m)} mm, as its covariance says"
                f" (variance factor {self.variance_factor:.2f}, limit {self.factor_limit:.2f})"
            )
        else:
            text.append(
                f"setups scatter by {millimetres(self.spread_m)} mm, more than their covariances"
                f" say (variance factor {self.variance_factor:.1f}, limit {self.factor_limit:.2f});"
                " standard errors grown accordingly: are poses and pins in one frame and scale?"
            )
        if n > 1 and self.attitude_span_deg < TURNED_DEG:
            text.append(
                f"setups turned by {self.attitude_span_deg:.0f} deg at most (limit"
                f" {TURNED_DEG:g}): an offset between photogrammetry and tachymetry would not show"
            )
        return "; ".join(text)


def tripod_lever_arm(setups: PosedAntennas) -> TripodLeverArm:
    """Estimate the lever arm from setups on a tripod.

    Parameters
    ----------
    setups : PosedAntennas
        Poses and pins with their covariances.

    Returns
    -------
    TripodLeverArm
        Weighted mean of the setups without outliers, of which there is at most one in three.

    Raises
    ------
    DataError
        Where a covariance is not positive definite.
    """
    if not len(setups.position):
        raise DataError("no setup; the lever arm needs one, and three to check it")
    each, cov = setup_lever_arms(setups)
    used = np.ones(len(each), dtype=np.bool_)
    for _ in range(len(each) // 3):
        worst = _outlier(each, cov, used)
        if worst is None:
            break
        used[worst] = False
    mean, mean_cov, factor = weighted_mean(each[used], cov[used])
    limit = factor_limit(3 * (int(used.sum()) - 1))
    grown = factor if factor > limit else 1.0
    C = setups.C_rc[used]
    turns = vector_from_rotation(np.einsum("iba,jbc->ijac", C, C))
    return TripodLeverArm(
        mean,
        mean_cov * grown,
        factor,
        limit,
        each,
        ~used,
        float(np.degrees(np.linalg.norm(turns, axis=-1).max())),
    )


def setup_lever_arms(setups: PosedAntennas) -> tuple[Array, Array]:
    """Return the lever arm of each setup.

    Parameters
    ----------
    setups : PosedAntennas
        Poses and pins with their covariances.

    Returns
    -------
    each : ndarray, (n, 3)
        Lever arms (Q.1), m.
    cov : ndarray, (n, 3, 3)
        Their covariances (Q.2), m^2.

    Raises
    ------
    DataError
        Where a covariance is not positive definite.
    """
    d = setups.antenna_m - setups.position
    C = setups.C_rc
    J = np.concatenate([np.broadcast_to(-np.eye(3), C.shape), skew(d)], axis=2)
    cov = setups.antenna_cov + J @ setups.pose_cov @ J.transpose(0, 2, 1)
    cov = C.transpose(0, 2, 1) @ cov @ C
    for j, one in enumerate(cov):
        if not np.linalg.eigvalsh(one)[0] > 0.0:
            raise DataError(
                f"setup {j + 1}: the covariance of the pin (ground mark) and the pose of the"
                " camera is not positive definite; give both standard deviations above zero"
            )
    return np.einsum("nji,nj->ni", C, d), cov


def weighted_mean(each: Array, cov: Array) -> tuple[Array, Array, float]:
    """Return the weighted mean (Q.3), its covariance and the variance factor.

    Parameters
    ----------
    each : ndarray, (n, 3)
        Vectors.
    cov : ndarray, (n, 3, 3)
        Their covariances.

    Returns
    -------
    mean : ndarray, (3,)
    mean_cov : ndarray, (3, 3)
        As the covariances have it, not by the scatter.
    variance_factor : float
        NaN of one vector.
    """
    normals = NormalEquations([Equations(each, np.tile(np.eye(3), (len(each), 1, 1)), {"": cov})])
    mean, dof = normals.dx, 3 * (len(each) - 1)
    return mean, normals.cov, normals.square(mean) / dof if dof else float("nan")


def _outlier(each: Array, cov: Array, used: NDArray[np.bool_]) -> int | None:
    """Return the setup that stands off the mean of the others most, None where none does."""
    from scipy.stats import chi2, f

    if used.sum() < 3:
        return None
    rows = np.flatnonzero(used)
    level = 1.0 - SIGNIFICANCE / len(rows)
    size, limit = np.empty(len(rows)), np.empty(len(rows))
    for i, j in enumerate(rows):
        remaining = rows[rows != j]
        mean, mean_cov, factor = weighted_mean(each[remaining], cov[remaining])
        v = each[j] - mean
        size[i] = v @ np.linalg.solve(cov[j] + mean_cov, v) / 3.0
        by_spread = factor * float(f.ppf(level, 3, 3 * (len(remaining) - 1)))
        limit[i] = max(float(chi2.ppf(level, 3)) / 3.0, by_spread)
    worst = int(np.argmax(size / limit))
    return int(rows[worst]) if size[worst] > limit[worst] else None
