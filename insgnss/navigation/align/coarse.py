"""Coarse attitude from GNSS motion against integrated inertial motion over one window.

A drone crabs in wind, so its course is not its heading. But the specific force integrated in the
axes b0 of the body at the window's start, where the gyros alone say how the body turned since, and
the accelerations seen by GNSS are the same vectors in two frames. With s(t) the double integral of
the specific force in b0, tau the time since the window's start, l_b the lever arm and g gravity:

    p_a(t) - g tau^2 / 2 = p_0 + v_0 tau + C [ s(t) + C_b0b(t) l_b ]                           (A.1)

and, where the receiver gives velocities, the derivative of it. p_0 and v_0 enter linearly:
projecting both sides on the complement of what they can explain leaves pairs (z_i, a_i) with z_i =
C a_i, Wahba's problem, solved by one singular value decomposition with no first guess. Its
information matrix, with the residuals' own size, is the attitude's

    I = sum w (|C a|^2 - C a a' C')                                                            (A.2)

to which the unknown gyro bias over the window and the accelerometer bias against the manoeuvre's
acceleration are added.

The gyro bias turns b0 away from what the gyros say: the window must be short enough for it. What is
left is an attitude good to some degrees, from which `initial` estimates the window properly, biases
and all.

Wahba (1965); Markley (1988) for the solution; Wu and Pan (2013) "Velocity/position integration
formula" for the idea.
"""

from dataclasses import dataclass

import numpy as np

from ...geodesy.earth import normal_gravity
from ...records import Array
from ..filter.problem import EstimationProblem
from ._kernels import relative_motion

# lengths (s): short ones have little gyro drift, long ones more motion (chosen)
WINDOWS_S = (10.0, 20.0, 60.0)
CANDIDATES = 4  # windows of a length that are solved, those of most motion (chosen)
REWEIGHTINGS = 6  # of solving with weights: gross fixes have lost theirs by then (chosen)
OUTLYING_MEDIANS = 3.0  # times the median residual, beyond which a row is weighed down (chosen)
MEDIAN_OF_CHI_3 = 1.538  # of the length of three normal variables


@dataclass(frozen=True)
class CoarseAttitude:
    """Attitude at the start of one window.

    Parameters
    ----------
    first, last : int
        First and last epoch of the window.
    C_lb : ndarray, (3, 3)
        Attitude, body into the local frame l, at the first epoch.
    velocity : ndarray, (3,)
        Velocity in l at the first epoch, m/s.
    cov : ndarray, (3, 3)
        Covariance of the attitude error psi, rad^2.
    """

    first: int
    last: int
    C_lb: Array
    velocity: Array
    cov: Array

    @property
    def heading_sigma(self) -> float:
        """The standard deviation of the rotation about the vertical, rad."""
        return float(np.sqrt(self.cov[2, 2]))


def coarse_attitudes(problem: EstimationProblem) -> list[CoarseAttitude]:
    """Solve the most unsteady windows of each length.

    Parameters
    ----------
    problem : EstimationProblem
        The flight's measurements, increments and layout of states.

    Returns
    -------
    list of CoarseAttitude
        Solutions, the most certain heading first; empty without windows.
    """
    solutions = [solve_window(problem, window) for window in _candidates(problem)]
    return sorted(solutions, key=lambda c: c.heading_sigma)


def _candidates(problem: EstimationProblem) -> list[np.ndarray]:
    """Return the windows in which GNSS alone shows the largest changes of velocity.

    A window holds the indices of its epochs with a position.
    """
    ep = problem.epochs
    with_position = np.flatnonzero(ep.has_position)
    time = ep.time[with_position]
    windows: list[np.ndarray] = []
    for length in WINDOWS_S:
        begin = time[0] if time.size else 0.0
        scored = []
        while time.size and begin < time[-1]:
            lo, hi = np.searchsorted(time, [begin, begin + length + 1e-6])
            if hi - lo >= 5:
                window = with_position[lo:hi]
                scored.append((_unsteadiness(time[lo:hi], ep.position[window]), window))
            begin += 0.5 * length
        median = np.median([score for score, _ in scored]) if scored else 0.0
        early = [window for score, window in scored if score > median][:1]
        liveliest = sorted(scored, key=lambda one: -one[0])[:CANDIDATES]
        windows += [window for _, window in liveliest] + early
    return windows


def _unsteadiness(time: Array, position: Array) -> float:
    """Return the median distance, m, of the horizontal position from uniform motion.

    The median keeps a few gross fixes out.
    """
    t, horizontal = time - time.mean(), position[:, :2]  # a line fitted in closed form
    residual = horizontal - horizontal.mean(axis=0)
    residual -= t[:, None] * ((t @ residual) / (t @ t))
    size = np.sort(np.abs(residual), axis=None)
    return float(0.5 * (size[(size.size - 1) // 2] + size[size.size // 2]))


def solve_window(problem: EstimationProblem, epochs: np.ndarray) -> CoarseAttitude:
    """Solve Wahba's problem of one window (A.1, A.2).

    Parameters
    ----------
    problem : EstimationProblem
        The flight's measurements, increments and layout of states.
    epochs : ndarray of int, (k,)
        Indices of the window's epochs, each with a position.

    Returns
    -------
    CoarseAttitude
        Attitude and velocity at the first of the epochs.
    """
    ep, inc = problem.epochs, problem.inc
    thin = epochs[:: max(1, epochs.size // 200)]
    moved = np.empty((thin.size, 15))
    relative_motion(inc.dt, inc.dtheta, inc.dvel, ep.stop[thin], moved)
    tau = ep.time[thin] - ep.time[thin[0]]
    C_b0b = moved[:, 6:].reshape(-1, 3, 3)
    g = _gravity(problem, ep.position[thin[thin.size // 2]])
    weight = 1.0 / np.sqrt(np.trace(ep.position_cov[thin], axis1=1, axis2=2) / 3.0)
    rows = [np.column_stack([np.ones(tau.size), tau]) * weight[:, None]]
    columns = [(ep.position[thin] - 0.5 * tau[:, None] ** 2 * g) * weight[:, None]]
    right = [(moved[:, 3:6] + C_b0b @ problem.antenna_lever_b) * weight[:, None]]
    if ep.has_velocity[thin].all():
        weight = 1.0 / np.sqrt(np.trace(ep.velocity_cov[thin], axis1=1, axis2=2) / 3.0)
        rows.append(np.column_stack([np.zeros(tau.size), np.ones(tau.size)]) * weight[:, None])
        columns.append((ep.velocity[thin] - tau[:, None] * g) * weight[:, None])
        turn = np.cross(ep.rate[thin], problem.antenna_lever_b)
        right.append((moved[:, :3] + np.einsum("nij,nj->ni", C_b0b, turn)) * weight[:, None])
    design, z, a = np.vstack(rows), np.vstack(columns), np.vstack(right)
    C, v0, directions, misfit = _robust_wahba(design, z, a)
    cov = _attitude_cov(problem, directions, misfit, tau[-1], weight)
    return CoarseAttitude(int(epochs[0]), int(epochs[-1]), C, v0, cov)


def _robust_wahba(design: Array, z: Array, a: Array) -> tuple[Array, Array, Array, float]:
    """Solve Wahba's problem with outliers weighed down.

    Rows whose residual exceeds `OUTLYING_MEDIANS` times the median are weighed down and the problem
    is solved again: a few gross fixes must not turn the attitude.

    Returns the attitude C (3, 3), v_0 (3,), the rows C a without what p_0 and v_0 explain, and the
    typical residual in sigmas.
    """
    trust = np.ones((z.shape[0], 1))
    for _ in range(REWEIGHTINGS):
        basis = np.linalg.qr(trust * design)[0]
        z_rest, a_rest = (x - basis @ (basis.T @ x) for x in (trust * z, trust * a))
        U, _, Vt = np.linalg.svd(z_rest.T @ a_rest)
        C = U @ np.diag([1.0, 1.0, np.linalg.det(U @ Vt)]) @ Vt
        p0_v0 = np.linalg.lstsq(trust * design, trust * (z - a @ C.T), rcond=None)[0]
        residual = np.linalg.norm(z - a @ C.T - design @ p0_v0, axis=1, keepdims=True)
        typical = float(np.median(residual))
        trust = np.minimum(1.0, OUTLYING_MEDIANS * typical / np.maximum(residual, 1e-12))
    return C, p0_v0[1], a_rest @ C.T, typical / MEDIAN_OF_CHI_3


def _attitude_cov(
    problem: EstimationProblem, directions: Array, misfit: float, length: float, weight: Array
) -> Array:
    """Return the covariance (3, 3) of psi, rad^2.

    It sums noise (A.2), gyro bias over the window and accelerometer bias against the manoeuvre.
    """
    information = np.sum(directions**2) * np.eye(3) - directions.T @ directions
    noise = np.linalg.pinv(information, rcond=1e-12) * max(misfit, 1.0) ** 2
    M = np.abs(problem.layout.channel_sum())
    bias = np.sqrt(M @ problem.layout.sigma0**2)
    gyro, accel = bias[:3].max(), bias[3:].max()
    tilt = (accel / 9.8) ** 2 + (gyro * length / 2.0) ** 2
    horizontal = np.sqrt(np.mean(directions[:, :2] ** 2)) / np.median(weight)
    acceleration = horizontal * 12.0 / length**2
    heading = (accel / max(acceleration, 1e-9)) ** 2 + (gyro * length / 2.0) ** 2
    return np.asarray(noise + np.diag([tilt, tilt, heading]), dtype=np.float64)


def _gravity(problem: EstimationProblem, position: Array) -> Array:
    """Return gravity (3,) in l at a point, m/s^2."""
    lat, _, height = problem.frame.geodetic_from_position(position)
    down = np.array([0.0, 0.0, float(normal_gravity(lat, height))])
    return problem.frame.C_ln_at(position) @ down
