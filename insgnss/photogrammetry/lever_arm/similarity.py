"""Lever arm in flight: adjusted poses in any frame, antenna positions and 0 to n ground points
(paper 002, equations 1 and 2).

A block adjustment without control leaves its poses (C_k, C_rc) in a frame r of its own. Seven
parameters take it to the mapping frame m, and the antenna stands off each camera by one lever arm a
in camera axes:

    G_k = T + s R (C_k - X0) + R C_rc a                                                        (E.1)
    Q_i = T + s R (P_i - X0)                                                                   (E.2)

G are antenna positions, P and Q ground points intersected in r and surveyed in m. The paper writes
(E.1) with its O on the other side, S(C) = G + R O; that O runs from antenna to camera and is -a,
while the O of its equation 9 runs from camera to antenna as a does here. X0 is the mean of the
ground points, where there are any, else that of the cameras: T is then the shift of what control
holds, and its correlations are not those of a far origin.

With R(true) = exp([t x]) R, s(true) = s exp(q) and d = s R (C_k - X0) + R C_rc a, the rows are

    dG = dT - [d x] dt + s R (C_k - X0) dq + R C_rc da                                         (E.3)

and observations of an image weigh by S_G + J P J^T, J = [s R | -R [C_rc a x]], P the covariance of
the pose's position and attitude error in r; (E.2) alike without attitude. Rows are those of the
adjusted attitudes (Gauss-Helmert): with observed ones, whose errors look like tilts of the camera,
the lever arm across the tilts would come out too short. What that does not cure: errors of the
attitudes larger than the tilts themselves (1.1 deg with tilts of 0.1 deg, of no real adjustment)
pass for tilts all the same, and sigmas come out 3 % too small (NEES 3.16 +- 0.05 for 3); at 0.6 deg
and below nothing of it is seen. A lever arm within
+-100 m a priori keeps the normal matrix regular where flight tells nothing, and weighs nothing
elsewhere.

Where all images have one attitude, R C_rc a is one vector and cannot be told from T: in level
flight the vertical lever arm from the vertical shift, with one heading the horizontal ones as well.
The verdict on a component is its multiple correlation with T, 1 - rho^2 = 1 / (V_jj [V^-1]_jj) with
V the covariance of (a_j, T). Above 0.95, or where the standard error is more than a ruler's, the
flight does not determine it.
"""

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from ...base.errors import DataError
from ...geodesy.least_squares import Equations, NormalEquations, gauss_newton, inverse
from ...geodesy.rotation import rotation_from_vector, skew
from ...geodesy.similarity import Similarity, similarity
from ...records import Array
from .records import (
    LONGEST_LEVER_ARM_M,
    MOST_ITERATIONS,
    RULER_M,
    LeverArm,
    PosedAntennas,
    factor_limit,
    refuse_other_shapes,
)

CORRELATED_WITH_SHIFT = 0.95  # with the translation: above, a component is not determined
PRIOR_M = 100.0  # no lever arm is longer
UPWARDS = 0.5  # vertical part of the mean viewing direction: 30 deg above the horizon
# residuals of both: other data, not too small covariances
MISFIT_ANTENNA_M, MISFIT_SIGMA = 0.5, 10.0
CONVERGED_SIMILARITY = 1e-8  # squared step over its variance
ONE_HEADING_LENGTH = 0.97  # length of the mean of unit vectors: spread of some 14 deg
# columns of the ten unknowns: T, rotation, log of the scale, lever arm (E.1)
SHIFT_AT, TURN_AT, SCALE_AT, ARM_AT = slice(0, 3), slice(3, 6), 6, slice(7, 10)


@dataclass(frozen=True, eq=False)
class PairedPoints:
    """Ground points in both frames, one row a point.

    Parameters
    ----------
    model : ndarray, (n, 3)
        Points intersected in the adjustment's frame r.
    model_cov : ndarray, (n, 3, 3)
        Their covariance, unit of r squared.
    surveyed_m : ndarray, (n, 3)
        Points in the mapping frame.
    surveyed_cov : ndarray, (n, 3, 3)
        Their covariance, m^2.
    """

    model: Array = field(default_factory=lambda: np.empty((0, 3)))
    model_cov: Array = field(default_factory=lambda: np.empty((0, 3, 3)))
    surveyed_m: Array = field(default_factory=lambda: np.empty((0, 3)))
    surveyed_cov: Array = field(default_factory=lambda: np.empty((0, 3, 3)))

    def __post_init__(self) -> None:
        n = len(self.model)
        model = {"model": (n, 3), "model_cov": (n, 3, 3)}
        refuse_other_shapes(self, **model, surveyed_m=(n, 3), surveyed_cov=(n, 3, 3))


@dataclass(frozen=True, eq=False)
class SimilarityLeverArm(LeverArm):
    """Lever arm from the projection centre to the antenna, with a verdict for each component.

    Parameters
    ----------
    lever_arm_m, cov, variance_factor, factor_limit
        As `LeverArm` has them; use only the components that are `determined`. The covariance
        (10, 10) is that of T (m), turn (rad, mapping axes), log of the scale and lever arm (m).
    frame : Similarity
        From the frame of the adjustment to the mapping frame.
    vertical_correlation : ndarray, (3,)
        Correlation of each component with the vertical translation.
    translation_correlation : ndarray, (3,)
        Multiple correlation of each component with the whole translation.
    residual_m : ndarray, (n, 3)
        Antenna positions minus (E.1), mapping axes.
    ground_residual_m : ndarray, (k, 3)
        Surveyed ground points minus (E.2), mapping axes.
    heading_length : float
        Length of the mean of the headings' unit vectors: 1 where all have one heading.
    tilt_deg : float
        Root mean square of the camera's tilt about its mean.
    vertical : ndarray, (3,)
        Mean of the vertical in camera axes.
    """

    frame: Similarity
    vertical_correlation: Array
    translation_correlation: Array
    residual_m: Array
    ground_residual_m: Array
    heading_length: float
    tilt_deg: float
    vertical: Array

    @property
    def determined(self) -> NDArray[np.bool_]:
        """Whether the flight determines each component (3,)."""
        return (self.translation_correlation <= CORRELATED_WITH_SHIFT) & (self.sigma_m <= RULER_M)

    def verdict(self, axis: int) -> str:
        """Return one component's value, or why there is none and what would give it.

        Parameters
        ----------
        axis : int
            0 image right, 1 image down, 2 viewing direction.

        Returns
        -------
        str
            One clause.
        """
        name = f"{'xyz'[axis]} (camera)"
        if why := self.why_undetermined(axis):
            return f"{name} not determined {why}"
        return (
            f"{name} {self.lever_arm_m[axis]:+.4f} +- {self.sigma_m[axis]:.4f} m (correlation with"
            f" the vertical translation {self.vertical_correlation[axis]:+.2f})"
        )

    def why_undetermined(self, axis: int) -> str:
        """Return why the flight does not determine a component, and the cure; empty where it does.

        `axis` as in `verdict`.
        """
        if self.determined[axis]:
            return ""
        sigma, rho = self.sigma_m[axis], self.translation_correlation[axis]
        why = (
            f"correlation with the translation {rho:.3f}, limit {CORRELATED_WITH_SHIFT:g}"
            if rho > CORRELATED_WITH_SHIFT
            else f"limit {RULER_M:g} m"
        )
        rms = float(np.sqrt((self.residual_m**2).mean()))
        if rho <= CORRELATED_WITH_SHIFT and rms > RULER_M:
            cure = f"antenna positions scatter by {rms:.2f} m; solve them with carrier phases (PPK)"
        elif abs(self.vertical[axis]) > 0.7:
            cure = f"the camera tilted by {self.tilt_deg:.1f} deg rms; tilt it more"
        elif self.heading_length > ONE_HEADING_LENGTH:
            cure = "all images have one heading; fly opposite or perpendicular strips"
        else:
            cure = "fly more strips of opposite heading"
        ground = "" if len(self.ground_residual_m) else ", or measure a ground point in the images"
        return f"(standard error {sigma:.3f} m; {why}): {cure}{ground}"

    @property
    def basis(self) -> str:
        """What the lever arm is from, as a clause."""
        ground = f", {len(self.ground_residual_m)} ground points"
        return (
            f"lever arm camera to antenna from {len(self.residual_m)} images"
            f"{ground if len(self.ground_residual_m) else ', no ground point'}"
        )

    @property
    def fit(self) -> str:
        """How well everything fits, as a clause."""
        rms = 1e3 * float(np.sqrt((self.residual_m**2).mean()))
        fit = f"variance factor {self.variance_factor:.2f}, limit {self.factor_limit:.2f}"
        if self.variance_factor > self.factor_limit:
            fit += ": more than covariances say; standard errors grown accordingly"
        return f"residuals {rms:.1f} mm rms ({fit})"

    def summary(self) -> str:
        """Return the verdict on each component and how well everything fits."""
        return "; ".join([self.basis, *map(self.verdict, range(3)), self.fit])


def similarity_lever_arm(
    poses: PosedAntennas, ground: PairedPoints | None = None
) -> SimilarityLeverArm:
    """Adjust similarity and lever arm of a flight.

    Parameters
    ----------
    poses : PosedAntennas
        Adjusted poses and antenna positions.
    ground : PairedPoints, optional
        Ground points in both frames.

    Returns
    -------
    SimilarityLeverArm
        Lever arm with the verdict for each component.

    Raises
    ------
    DataError
        Where there are too few images, they stand on a line, cameras look upwards, residuals or the
        lever arm are those of other data, or a covariance is not positive definite.
    """
    ground = ground or PairedPoints()
    n, k = len(poses.position), len(ground.model)
    dof = 3 * (n + k) - 10
    if dof <= 0:
        raise DataError(
            f"{n} images and {k} ground points give {3 * (n + k)} observations; similarity and"
            " lever arm are 10 unknowns and need four images, and many more to be good"
        )
    system = _System(poses, ground)
    normals, converged = gauss_newton(
        system.linearised, system.move, CONVERGED_SIMILARITY, MOST_ITERATIONS, redundancy=dof
    )
    cov, R = normals.cov, system.R
    solution = NormalEquations(system.linearised())
    residual, factor = solution.groups[0].e, solution.square() / dof
    limit = factor_limit(dof)
    C = R @ poses.C_rc
    mean, tilt_deg = tilt_of(C)
    forward = C[:, :2, int(np.argmin(np.abs(mean)))]
    result = SimilarityLeverArm(
        system.arm,
        cov * (factor if factor > limit else 1.0),
        factor,
        limit,
        Similarity(system.T - system.s * R @ system.origin, R, system.s),
        cov[ARM_AT, 2] / np.sqrt(np.diag(cov)[ARM_AT] * cov[2, 2]),
        np.array([_multiple_correlation(cov, 7 + j) for j in range(3)]),
        residual[:n],
        residual[n:],
        float(np.linalg.norm((forward / np.linalg.norm(forward, axis=1)[:, None]).mean(axis=0))),
        tilt_deg,
        mean,
    )
    _plausible(result, C[:, :, 2].mean(axis=0))
    if not converged:
        raise DataError(
            f"similarity and lever arm did not converge in {MOST_ITERATIONS} steps; do poses and"
            " antenna positions belong to the same images?"
        )
    return result


def tilt_of(C: Array) -> tuple[Array, float]:
    """Return the mean vertical in camera axes, and the rms tilt of the cameras about it, deg."""
    up = C[:, 2]
    mean = up.mean(axis=0) / np.linalg.norm(up.mean(axis=0))
    return mean, float(np.degrees(np.sqrt((np.cross(up, mean) ** 2).sum(axis=1).mean())))


class _System:
    """Unknowns and observation equations of images, then of ground points.

    The unknowns are translation at the origin, rotation, scale and lever arm, and the attitude
    errors of images (n, 3) that go with them.
    """

    def __init__(self, poses: PosedAntennas, ground: PairedPoints) -> None:
        self.poses, self.ground = poses, ground
        self.origin = (ground.model if len(ground.model) else poses.position).mean(axis=0)
        self.source = np.concatenate([poses.position, ground.model])
        self.target = np.concatenate([poses.antenna_m, ground.surveyed_m])
        first = similarity(self.source, self.target)
        if first is None:
            raise DataError(
                "cameras and ground points stand on a line, which leaves the rotation about it"
                " open; take images of several strips or a ground point beside the line"
            )
        self.T, self.R, self.s = first.points(self.origin), first.rotation, first.scale
        self.arm, self.psi = np.zeros(3), 0.0 * poses.position

    def linearised(self) -> list[Equations]:
        """Return (E.3) at the values, and that a lever arm has an end."""
        n, k = len(self.poses.position), len(self.source)
        turn = self.s * self.R
        d = (self.source - self.origin) @ turn.T
        rows = np.zeros((k, 3, 10))
        rows[:, :, SHIFT_AT], rows[:, :, SCALE_AT] = np.eye(3), d
        C = rotation_from_vector(self.psi) @ self.poses.C_rc
        rows[:n, :, ARM_AT] = self.R @ C
        d = d + rows[:, :, ARM_AT] @ self.arm
        rows[:, :, TURN_AT] = -skew(d)
        by_attitude = -self.R @ skew(C @ self.arm)
        J = np.concatenate([np.broadcast_to(turn, (n, 3, 3)), by_attitude], axis=2)
        images = self.poses.antenna_cov + J @ self.poses.pose_cov @ J.transpose(0, 2, 1)
        points = self.ground.surveyed_cov + turn @ self.ground.model_cov @ turn.T
        cov = np.concatenate([images, points])
        if not (np.linalg.eigvalsh(cov)[:, 0] > 0.0).all():
            raise DataError(
                "a covariance of antenna positions, poses or ground points is not positive"
                " definite; give standard deviations above zero"
            )
        residual = self.target - self.T - d
        residual[:n] += np.einsum("kij,kj->ki", J[:, :, 3:], self.psi)
        self.gain = (self.poses.pose_cov @ J.transpose(0, 2, 1))[:, 3:] @ inverse(cov[:n])
        self.observed = Equations(residual, rows, {"": cov})
        arm = Equations.prior(-self.arm, PRIOR_M**2 * np.eye(3), np.eye(3, 10, 7))
        return [self.observed, arm]

    def move(self, dx: Array) -> None:
        """Move the values, and the attitudes by what is left (Gauss-Helmert)."""
        self.T, self.R = self.T + dx[SHIFT_AT], rotation_from_vector(dx[TURN_AT]) @ self.R
        self.s *= float(np.exp(np.clip(dx[SCALE_AT], -1.0, 1.0)))
        self.arm = self.arm + dx[ARM_AT]
        residual = self.observed.residual(dx)[: len(self.gain)]
        self.psi = np.einsum("kij,kj->ki", self.gain, residual)


def _multiple_correlation(cov: Array, index: int) -> float:
    """Return the multiple correlation of an unknown with the translation."""
    variance, cross = cov[index, index], cov[index, SHIFT_AT]
    explained = float(cross @ np.linalg.solve(cov[SHIFT_AT, SHIFT_AT], cross)) / variance
    return float(np.sqrt(min(max(explained, 0.0), 1.0)))


def _plausible(result: SimilarityLeverArm, viewing: Array) -> None:
    """Refuse what no flight is."""
    rms = float(np.sqrt((result.residual_m**2).mean()))
    if rms > MISFIT_ANTENNA_M and result.variance_factor > MISFIT_SIGMA**2:
        raise DataError(
            f"antenna positions miss the poses by {rms:.2f} m rms (limit {MISFIT_ANTENNA_M:g} m),"
            f" {np.sqrt(result.variance_factor):.0f} times their covariances: poses of other"
            " images or another flight, event times in UTC, or a frame that is not Cartesian"
        )
    if viewing[2] > UPWARDS and not len(result.ground_residual_m):
        raise DataError(
            f"cameras look {np.degrees(np.arcsin(min(viewing[2], 1.0))):.0f} deg above the horizon:"
            " one frame is mirrored or not east-north-up (a flight that does look up needs a ground"
            " point)"
        )
    beyond = np.abs(result.lever_arm_m) - 3.0 * result.sigma_m > LONGEST_LEVER_ARM_M
    if beyond.any():
        axis = int(np.argmax(beyond))
        raise DataError(
            f"the lever arm comes out as {result.lever_arm_m[axis]:+.1f} m along camera"
            f" {'xyz'[axis]} (limit {LONGEST_LEVER_ARM_M:g} m): images and antenna positions are"
            " shifted by one or more, or their times are off"
        )
