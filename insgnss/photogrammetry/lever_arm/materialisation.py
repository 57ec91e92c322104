"""Lever arm on the ground: targets on camera and receiver stand for the centres that nobody can
touch (paper 002, equations 3 to 9).

*Targets.* A target seen by images k of known pose is the point whose image coordinates fit best
(equation 3); with normalised ones, freed of distortion, and u = C_k^T (P - C_k)

    (x, y)_k = (u_1, u_2) / u_3                                                                (H.1)

*Camera* (equation 4). Its targets and the pose of one image s of its own, in one scaled frame:

    P_cam = C_s^T (P - c_s)                                                                    (H.2)

The error of that pose moves all targets together: no residual shows it, and the lever arm O takes
J F J^T, J = [-I | [O x]], F the covariance of the pose in camera axes.

*Receiver* (equation 5). In each session, the receiver turned by some 90 deg, targets are
intersected in the frame of the survey and GNSS gives the antenna's phase centre. A rigid
transformation, from the targets, takes each session to the first; the antenna is the mean, the
spread what the receiver's attitude does to it. What turns with the receiver stays in the mean.

*Mounted* (equations 6 to 9). Both sets in one free block r of the aircraft:

    P_cam = T1 + s R1 P_r                                                                      (H.3)
    T1 + s R1 G_r = O + R2 (G_l - A_l)                                                         (H.4)

G are the receiver's targets, in r and in its own frame l, A_l the antenna in l, and O is the lever
arm from projection centre to antenna in camera axes. The paper prints (6) and (8) with source and
target exchanged; written as here, O = R2 A_l + T2 (9) closes. Two closed fits, (6) then (8), are
the first values; the estimate is the joint adjustment of (H.3) and (H.4), 13 unknowns, weighted by
the covariances of the targets in both frames: the receiver's known size helps the block's scale.

Its variance factor is the check, with the differences of lever arms before and after a flight and
to the one estimated in flight (Table 1 of the paper, `difference.lever_arm_difference`).
"""

from dataclasses import dataclass

import numpy as np

from ...base.errors import DataError
from ...geodesy.explain import Candidate, explain
from ...geodesy.least_squares import Equations, gauss_newton
from ...geodesy.rotation import rotation_from_vector, skew
from ...geodesy.similarity import Similarity, similarity
from ...records import Array
from .records import MOST_ITERATIONS, LeverArm, factor_limit, millimetres, refuse_other_shapes
from .tripod import weighted_mean

# residuals of both: other targets, not small covariances
MISFIT_TARGETS_M, MISFIT_SIGMA = 0.005, 10.0
CONVERGED_TARGETS = 1e-10  # squared step over its variance
FEWEST_TARGETS = 3  # of a frame: two leave the rotation about their line


@dataclass(frozen=True, eq=False)
class Targets:
    """Targets on a sensor, one row a target.

    Parameters
    ----------
    position : ndarray, (n, 3)
        Positions.
    cov : ndarray, (n, 3, 3)
        Their covariances.
    """

    position: Array
    cov: Array

    def __post_init__(self) -> None:
        n = len(self.position)
        refuse_other_shapes(self, position=(n, 3), cov=(n, 3, 3))
        if n < FEWEST_TARGETS:
            raise DataError(f"{n} targets; a frame needs {FEWEST_TARGETS} that stand on no line")
        if not (np.linalg.eigvalsh(self.cov)[:, 0] > 0.0).all():
            raise DataError("a target's covariance is not positive definite")


@dataclass(frozen=True, eq=False)
class CameraTargets:
    """Targets on the camera in its own axes (H.2).

    Parameters
    ----------
    targets : Targets
        In camera axes from the projection centre, m.
    frame_cov : ndarray, (6, 6)
        Covariance of the projection centre (m) and attitude (rad), camera axes.
    """

    targets: Targets
    frame_cov: Array


@dataclass(frozen=True, eq=False)
class ReceiverSession:
    """One session of the receiver, in the frame of the survey.

    Parameters
    ----------
    targets : Targets
        Targets on the receiver, m.
    antenna_m : ndarray, (3,)
        Phase centre by GNSS, m.
    antenna_cov : ndarray, (3, 3)
        Its covariance, m^2.
    """

    targets: Targets
    antenna_m: Array
    antenna_cov: Array


@dataclass(frozen=True, eq=False)
class ReceiverTargets:
    """Targets and phase centre of a receiver in the frame of its first session.

    Parameters
    ----------
    targets : Targets
        Means over the sessions, m.
    antenna_m : ndarray, (3,)
        Mean of the phase centres, m.
    antenna_cov : ndarray, (3, 3)
        Its covariance; by the variance factor where sessions scatter above chance.
    each_m : ndarray, (n, 3)
        Phase centre of each session, m.
    variance_factor, factor_limit : float
        Of the phase centres, and what chance allows of it; NaN with one session.
    """

    targets: Targets
    antenna_m: Array
    antenna_cov: Array
    each_m: Array
    variance_factor: float
    factor_limit: float

    @property
    def apart_m(self) -> Array:
        """Distances between the phase centres of any two sessions, m."""
        first, second = np.triu_indices(len(self.each_m), 1)
        return np.linalg.norm(self.each_m[first] - self.each_m[second], axis=1)

    def summary(self) -> str:
        """Return how far the phase centres of the sessions are apart."""
        if len(self.each_m) < 2:
            return "phase centre from one session: nothing checks it; turn the receiver by 90 deg"
        sigma = np.sqrt(np.diag(self.antenna_cov))
        text = (
            f"phase centres of {len(self.each_m)} sessions {1e3 * self.apart_m.mean():.1f} mm apart"
            f" in the mean, {1e3 * self.apart_m.max():.1f} mm at most; standard errors of their"
            f" mean {millimetres(sigma)} mm"
        )
        if self.variance_factor > self.factor_limit:
            text += (
                f" (variance factor {self.variance_factor:.1f}, limit {self.factor_limit:.2f}:"
                " multipath or a phase centre that moves with the attitude)"
            )
        return text


@dataclass(frozen=True, eq=False)
class MaterialisedLeverArm(LeverArm):
    """Lever arm from the projection centre to the phase centre, in camera axes.

    Parameters
    ----------
    lever_arm_m, cov, variance_factor, factor_limit
        As `LeverArm` has them: O of (H.4); the variance factor is that of the misclosures, and
        grows the share of the targets in the covariance.
    block_cov : ndarray, (3, 3)
        The share of the block of the mounted sensors and of the targets in it, m^2: without that of
        the phase centre and of the camera's own pose, which other blocks of the same sensors share.
    two_step_m : ndarray, (3,)
        O by the two unweighted fits of the paper, one after the other.
    scale : float
        Metres for each unit of the block.
    residual_m : ndarray, (n, 3)
        Misclosures of camera targets (H.3), then of receiver targets (H.4), camera axes.
    """

    block_cov: Array
    two_step_m: Array
    scale: float
    residual_m: Array

    def summary(self) -> str:
        """Return the lever arm and how well the targets fit."""
        values = ", ".join(
            f"{'xyz'[j]} {1e3 * self.lever_arm_m[j]:+.1f} +- {1e3 * self.sigma_m[j]:.1f}"
            for j in range(3)
        )
        rms = 1e3 * float(np.sqrt((self.residual_m**2).mean()))
        text = (
            f"lever arm camera to antenna {values} mm in camera axes; {len(self.residual_m)}"
            f" targets close to {rms:.2f} mm rms (variance factor {self.variance_factor:.2f}, limit"
            f" {self.factor_limit:.2f})"
        )
        if self.variance_factor > self.factor_limit:
            text += ": more than covariances say, standard errors grown accordingly"
        return text


def intersected_target(
    position: Array, C_rc: Array, image: Array, sigma: float
) -> tuple[Array, Array, float]:
    """Intersect a target from its images (H.1).

    Parameters
    ----------
    position, C_rc : ndarray
        (n, 3) and (n, 3, 3) poses of the images, taken as exact.
    image : ndarray, (n, 2)
        Normalised image coordinates, x right and y down, without distortion.
    sigma : float
        Their standard deviation, that of a pixel over the focal length in pixels.

    Returns
    -------
    target : ndarray, (3,)
    cov : ndarray, (3, 3)
    variance_factor : float
        Of the image coordinates.

    Raises
    ------
    DataError
        Where images are fewer than two, their rays are parallel or meet behind a camera.
    """
    n = len(position)
    if n < 2:
        raise DataError(f"{n} image shows the target; an intersection needs two")
    ray = np.einsum("nij,nj->ni", C_rc, np.column_stack([image, np.ones(n)]))
    ray /= np.linalg.norm(ray, axis=1)[:, None]
    across = np.eye(3) - ray[:, :, None] * ray[:, None, :]
    normal = across.sum(axis=0)
    if np.linalg.eigvalsh(normal)[0] < 1e-6 * n:
        raise DataError("rays to the target are parallel; take images from more directions")
    P = np.linalg.solve(normal, np.einsum("nij,nj->i", across, position))
    cov = np.tile(sigma**2 * np.eye(2), (n, 1, 1))

    def linearised() -> list[Equations]:
        u = np.einsum("nji,nj->ni", C_rc, P - position)
        if not (u[:, 2] > 0.0).all():
            raise DataError(
                "rays to the target meet behind a camera: wrong poses or another target"
            )
        projected = u[:, :2] / u[:, 2:]
        J = np.zeros((n, 2, 3))
        J[:, 0, 0] = J[:, 1, 1] = 1.0 / u[:, 2]
        J[:, :, 2] = -projected / u[:, 2:]
        return [Equations(image - projected, J @ C_rc.transpose(0, 2, 1), {"": cov})]

    def move(dx: Array) -> None:
        P[:] += dx

    normals, _ = gauss_newton(linearised, move, CONVERGED_TARGETS, MOST_ITERATIONS)
    return P, normals.cov, normals.square() / (2 * n - 3)


def camera_targets(
    targets: Targets, position: Array, C_rc: Array, pose_cov: Array
) -> CameraTargets:
    """Take targets to the axes of the camera that they stand on (H.2).

    Parameters
    ----------
    targets : Targets
        In the scaled frame of the block, m.
    position, C_rc : ndarray
        (3,) and (3, 3): pose of the image that the camera itself took.
    pose_cov : ndarray, (6, 6)
        Covariance of position (m) and attitude error psi (rad), axes of the block.

    Returns
    -------
    CameraTargets
        The targets, and apart from them the error that they have in common.
    """
    turn = np.kron(np.eye(2), C_rc.T)
    in_camera = Targets((targets.position - position) @ C_rc, C_rc.T @ targets.cov @ C_rc)
    return CameraTargets(in_camera, turn @ pose_cov @ turn.T)


def receiver_targets(*sessions: ReceiverSession) -> ReceiverTargets:
    """Unite the sessions of a receiver in the frame of the first.

    Parameters
    ----------
    *sessions : ReceiverSession
        Of the same targets in the same order.

    Returns
    -------
    ReceiverTargets
        Means of targets and phase centre, with the spread of the latter.

    Raises
    ------
    DataError
        Without a session, and where targets of two sessions do not fit.
    """
    if not sessions:
        raise DataError("no session of the receiver; give one file for each session (--receiver)")
    first = sessions[0]
    n = len(first.targets.position)
    points, covs = [first.targets.position], [first.targets.cov]
    antenna, antenna_cov = [first.antenna_m], [first.antenna_cov]
    for k, session in enumerate(sessions[1:], 2):
        if len(session.targets.position) != n:
            raise DataError(f"session {k} has {len(session.targets.position)} targets, not {n}")
        R, position, cov, residual = _rigid(session, first.targets)
        if (rms := float(np.sqrt((residual**2).mean()))) > MISFIT_TARGETS_M:
            raise DataError(
                f"targets of session {k} miss those of the first by {1e3 * rms:.1f} mm rms (limit"
                f" {1e3 * MISFIT_TARGETS_M:g} mm): another order, a target that moved or a mirrored"
                " frame"
            )
        points.append(first.targets.position + residual)
        covs.append(R @ session.targets.cov @ R.T)
        antenna.append(position)
        antenna_cov.append(R @ session.antenna_cov @ R.T + cov)
    mean, mean_cov, factor = weighted_mean(np.array(antenna), np.array(antenna_cov))
    limit = factor_limit(3 * (len(sessions) - 1))
    means = [
        weighted_mean(np.array([p[i] for p in points]), np.array([c[i] for c in covs]))
        for i in range(n)
    ]
    return ReceiverTargets(
        Targets(np.array([m[0] for m in means]), np.array([m[1] for m in means])),
        mean,
        mean_cov * (factor if factor > limit else 1.0),
        np.array(antenna),
        factor,
        limit,
    )


def _rigid(session: ReceiverSession, target: Targets) -> tuple[Array, Array, Array, Array]:
    """Return rotation into the target frame, the phase centre there with the covariance of the
    transformation, and the residuals of the session's targets.
    """
    X = session.targets
    start = similarity(X.position, target.position, rigid=True)
    if start is None:
        raise DataError("targets on the receiver stand on a line; add one beside it")
    R, A = start.rotation, start.points(session.antenna_m)

    def linearised() -> list[Equations]:
        d = (X.position - session.antenna_m) @ R.T
        rows = np.concatenate([np.broadcast_to(np.eye(3), (len(d), 3, 3)), -skew(d)], axis=2)
        return [Equations(target.position - A - d, rows, {"": target.cov + R @ X.cov @ R.T})]

    def move(dx: Array) -> None:
        nonlocal A, R
        A, R = A + dx[:3], rotation_from_vector(dx[3:]) @ R

    normals, _ = gauss_newton(linearised, move, CONVERGED_TARGETS, MOST_ITERATIONS)
    d = (X.position - session.antenna_m) @ R.T
    return R, A, normals.cov[:3, :3], A + d - target.position


def materialised_lever_arm(
    camera: CameraTargets,
    receiver: ReceiverTargets,
    camera_in_block: Targets,
    receiver_in_block: Targets,
) -> MaterialisedLeverArm:
    """Adjust the lever arm of mounted sensors (H.3, H.4).

    Parameters
    ----------
    camera : CameraTargets
        Targets on the camera in its axes.
    receiver : ReceiverTargets
        Targets and phase centre of the receiver in its frame.
    camera_in_block, receiver_in_block : Targets
        The same targets, in the same order, in one block of the aircraft, of any frame and unit.

    Returns
    -------
    MaterialisedLeverArm
        Lever arm with covariance and check.

    Raises
    ------
    DataError
        Where targets differ in number, stand on a line or do not fit.
    """
    P, G = camera_in_block, receiver_in_block
    first, R2, two_step = _two_steps(camera.targets, receiver, P, G)
    n, N = len(P.position), len(P.position) + len(G.position)
    source = np.concatenate([P.position, G.position])
    source_cov = np.concatenate([P.cov, G.cov])
    own_cov = np.concatenate([camera.targets.cov, receiver.targets.cov])
    origin = P.position.mean(axis=0)
    # unknowns: T1 at the origin, turn of R1, log of s, O, turn of R2
    T1, R1, s, arm = first.points(origin), first.rotation, first.scale, two_step
    local = receiver.targets.position - receiver.antenna_m

    def linearised() -> list[Equations]:
        d = s * (source - origin) @ R1.T
        target = np.concatenate([camera.targets.position, arm + local @ R2.T])
        rows = np.zeros((N, 3, 13))
        rows[:, :, :3], rows[:, :, 3:6], rows[:, :, 6] = np.eye(3), -skew(d), d
        rows[n:, :, 7:10], rows[n:, :, 10:] = -np.eye(3), skew(local @ R2.T)
        cov = s**2 * R1 @ source_cov @ R1.T
        cov[:n] += own_cov[:n]
        cov[n:] += R2 @ own_cov[n:] @ R2.T
        return [Equations(target - T1 - d, rows, {"": cov})]

    def move(dx: Array) -> None:
        nonlocal T1, R1, s, arm, R2
        T1, R1, s = T1 + dx[:3], rotation_from_vector(dx[3:6]) @ R1, s * float(np.exp(dx[6]))
        arm, R2 = arm + dx[7:10], rotation_from_vector(dx[10:]) @ R2

    normals, _ = gauss_newton(linearised, move, CONVERGED_TARGETS, MOST_ITERATIONS)
    residual, dof = normals.groups[0].e, 3 * N - 13
    factor = normals.square() / dof
    limit = factor_limit(dof)
    if factor > limit and _mirrored(P, camera.targets) and _mirrored(G, receiver.targets):
        raise DataError(
            "the targets in the block's coordinates fit those measured from the camera and the"
            " antenna only as in a mirror: correct an axis of the block that has the wrong sign, or"
            " two that are exchanged"
        )
    rms = float(np.sqrt((residual**2).mean()))
    if rms > MISFIT_TARGETS_M and factor > MISFIT_SIGMA**2:
        raise DataError(
            f"targets miss each other by {1e3 * rms:.1f} mm rms (limit {1e3 * MISFIT_TARGETS_M:g} "
            f" mm), {np.sqrt(factor):.0f} times their covariances: another order, a sensor that was"
            " taken apart or a mirrored frame"
        )
    J = np.concatenate([-np.eye(3), skew(arm)], axis=1)
    block_cov = normals.cov[7:10, 7:10] * (factor if factor > limit else 1.0)
    arm_cov = block_cov + R2 @ receiver.antenna_cov @ R2.T + J @ camera.frame_cov @ J.T
    return MaterialisedLeverArm(arm, arm_cov, factor, limit, block_cov, two_step, s, residual)


def _two_steps(
    camera: Targets, receiver: ReceiverTargets, P: Targets, G: Targets
) -> tuple[Similarity, Array, Array]:
    """Return the similarity (6), the rotation of (8) and the lever arm (9), unweighted."""
    for sensor, of_sensor, block in (("camera", camera, P), ("receiver", receiver.targets, G)):
        if len(of_sensor.position) != len(block.position):
            raise DataError(
                f"{len(of_sensor.position)} targets on the {sensor}, {len(block.position)} in the"
                " block"
            )
    first = similarity(P.position, camera.position)
    second = None
    if first is not None:
        in_block = first.points(G.position)
        second = similarity(receiver.targets.position, in_block, rigid=True)
    if first is None or second is None:
        raise DataError("targets on a sensor stand on a line; add one beside it")
    return first, second.rotation, second.points(receiver.antenna_m)


def _mirrored(block: Targets, body: Targets) -> bool:
    """Tell whether targets fit much better where one axis of the block changes its sign."""

    def misfit(X: Array) -> float:
        fitted = similarity(X, body.position)
        return np.inf if fitted is None else float(np.linalg.norm(fitted.points(X) - body.position))

    mirror = Candidate[Array]("mirrored", lambda X: X * [1.0, 1.0, -1.0])
    return explain(block.position, [mirror], misfit) is not None
