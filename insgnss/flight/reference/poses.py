"""The poses of a flight's images once more, by another way: from the samples to the orientation.

`twin` solves the estimation problem that the core solves, and shares with it how that problem was
posed: the rotation of the Earth, increments, alignment, states, and all from an epoch to an image.
Here nothing of `navigation` is used. The equations are those of a textbook in ECEF axes e (Groves
2013, chapters 2, 5 and 14), on numpy and pyproj; the records of samples, fixes, exposures, mounting
and noise are what goes in.

    dr/dt = v,   dv/dt = C f + g(r) - 2 w x v,   dC/dt = C [omega x] - [w x] C                (P.1)

with r, v the IMU's position and velocity in e, C body into e, f and omega the samples without their
biases, w the Earth's rotation and g gravity with the centrifugal part. Errors are truth minus
nominal, C(true) = exp([psi x]) C, b a sensor's biases:

    dpsi/dt = -w x psi - C b_gyro,   ddv/dt = -[C f x] psi - C b_accel - 2 w x dv + G dr      (P.2)

A fix sees r + C l - o v, l the lever arm and o by how much its stamp is late, states under their
priors. The first attitude is the rotation that takes the forces that the samples sum up to those
that second differences of the fixes show (Wahba 1965). Each pass begins at the smoothed first state
of the one before, under a prior so wide that it says nothing and so narrow that the equations stay
linear.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ...records import Array, ExteriorOrientation, GnssFixes, ImuSamples

EARTH_SPIN = np.array([0.0, 0.0, 7.292115e-5])  # rad/s, WGS 84
EARTH_GM, EQUATOR_M = 3.986004418e14, 6378137.0  # m^3/s^2, m, WGS 84
EARTH_J2, EARTH_J4 = 1.0826298e-3, -2.37091e-6  # of the normal field; J6 makes 4e-7 m/s^2
FIRST_SIGMA = np.repeat([3.0, 3.0, 0.2], 3)  # m, m/s, rad of the first state in the first pass
LATER_SIGMAS = 20.0  # smoothed ones, of the first state in further passes: 1/400 of information
DIFFERENCE_S = 2.0  # of second differences of the fixes: 2 cm of noise leave 0.012 m/s^2
ALIGN_S = 60.0  # of the fixes that show the first attitude: the Earth turns by 0.25 deg meanwhile
MOST_PASSES = 3  # the first begins some degrees off, the second at the smoothed state of the first
GATE_NIS = 75.0  # 5 sigma on each of three axes: the fixes of a part that verifies are right ones


@dataclass(frozen=True)
class Bias:
    """One part of a channel's bias: dx/dt = -x / time_s + white noise of PSD drive.

    Parameters
    ----------
    channel : 0 to 5, gyro x y z, accelerometer x y z.
    sigma : a-priori standard deviation, X.
    time_s : correlation time, s; infinite for a constant or a random walk.
    drive : PSD of what drives it, X^2/s.
    """

    channel: int
    sigma: float
    time_s: float = np.inf
    drive: float = 0.0


@dataclass(frozen=True, eq=False)
class Setup:
    """What the flight file and its noise model say, in numbers.

    Parameters
    ----------
    C_b_imu : (3, 3) axes of the samples into forward, right, down.
    biases : the parts of the biases of the body's axes.
    white : (6,) PSD of the channels, X^2/Hz.
    antenna_b, camera_b : (3,) from the IMU, body axes, m.
    antenna_sigma_m : (3,) of the lever arm.
    offset_sigma_s : of the stamps of the fixes.
    C_cb : (3, 3) body to camera.
    origin : (3,) of the tangent plane: latitude, longitude, rad, height, m.
    """

    C_b_imu: Array
    biases: Sequence[Bias]
    white: Array
    antenna_b: Array
    antenna_sigma_m: Array
    offset_sigma_s: float
    camera_b: Array
    C_cb: Array
    origin: Array


@dataclass(frozen=True, eq=False)
class PosedImages:
    """Projection centres (k, 3) and C_mc (k, 3, 3) in the tangent plane, sigmas (k, 6) m, rad."""

    position_m: Array
    C_mc: Array
    sigma: Array


def cross_matrix(v: Array) -> Array:
    """Return [v x] of vectors (..., 3)."""
    zero = np.zeros_like(v[..., 0])
    x, y, z = np.moveaxis(v, -1, 0)
    rows = [[zero, -z, y], [z, zero, -x], [-y, x, zero]]
    return np.stack([np.stack(row, axis=-1) for row in rows], axis=-2)


def turn(v: Array) -> Array:
    """Return exp([v x]) (Rodrigues) of one rotation vector (3,)."""
    angle = float(np.linalg.norm(v))
    K = cross_matrix(v)
    if angle < 1e-8:
        return np.eye(3) + K
    return np.eye(3) + np.sin(angle) / angle * K + (1.0 - np.cos(angle)) / angle**2 * K @ K


def rotation_vector(C: Array) -> Array:
    """Return v of exp([v x]) = C for rotations (..., 3, 3) below half a turn."""
    axis = np.stack(
        [C[..., 2, 1] - C[..., 1, 2], C[..., 0, 2] - C[..., 2, 0], C[..., 1, 0] - C[..., 0, 1]], -1
    )
    sine = 0.5 * np.linalg.norm(axis, axis=-1)
    angle = np.arctan2(sine, 0.5 * (np.trace(C, axis1=-2, axis2=-1) - 1.0))
    scale = np.where(sine > 1e-12, angle / np.where(sine > 1e-12, 2.0 * sine, 1.0), 0.5)
    return axis * scale[..., None]


def gravity(position_e: Array) -> Array:
    """Return gravitation with J2 and J4 and the centrifugal acceleration at r (3,) in e, m/s^2."""
    distance = float(np.linalg.norm(position_e))
    s2, flat = (position_e[2] / distance) ** 2, (EQUATOR_M / distance) ** 2
    level, polar = 1.0 - 5.0 * s2, 3.0 - 5.0 * s2
    second = 1.5 * EARTH_J2 * flat * np.array([level, level, polar])
    level, polar = 1.0 - 14.0 * s2 + 21.0 * s2**2, 5.0 - 70.0 / 3.0 * s2 + 21.0 * s2**2
    fourth = -1.875 * EARTH_J4 * flat**2 * np.array([level, level, polar])
    attraction = -EARTH_GM / distance**3 * position_e * (1.0 + second + fourth)
    return attraction - np.cross(EARTH_SPIN, np.cross(EARTH_SPIN, position_e))


def ned_axes(lat: float, lon: float) -> Array:
    """Return the rows north, east, down of a place in e."""
    s, c, sl, cl = np.sin(lat), np.cos(lat), np.sin(lon), np.cos(lon)
    return np.array([[-s * cl, -s * sl, c], [-sl, cl, 0.0], [-c * cl, -c * sl, -s]])


def ecef(lat: Array, lon: Array, height: Array) -> Array:
    """Return ECEF coordinates (n, 3), m, by pyproj."""
    from pyproj import Transformer

    to_ecef = Transformer.from_crs(4979, 4978)
    return np.stack(to_ecef.transform(np.degrees(lat), np.degrees(lon), height), axis=-1)


def increments_at(imu: ImuSamples, C_b_imu: Array, times: Array) -> tuple[Array, Array]:
    """Return the instants of samples and of `times` in order, and increments (n - 1, 6) between.

    The sums of all samples are continued between them by a cubic spline.
    """
    from scipy.interpolate import CubicSpline

    t, values = imu.time, np.hstack([imu.gyro @ C_b_imu.T, imu.accel @ C_b_imu.T])
    dt = np.diff(t)[:, None]
    if imu.quantity == "instant_rate":
        steps = 0.5 * (values[1:] + values[:-1]) * dt
    else:
        steps = values[1:] * (1.0 if imu.quantity == "increments" else dt)
    sums = CubicSpline(t, np.vstack([np.zeros(6), np.cumsum(steps, axis=0)]))
    grid = np.union1d(t[(t > times[0]) & (t < times[-1])], times)
    return grid, np.diff(sums(grid), axis=0)


def first_attitude(grid: Array, steps: Array, time: Array, r: Array) -> Array:
    """Return C of the first instant by Wahba's problem, from fixes at `time` and positions r."""
    rotations = np.empty((grid.size, 3, 3))
    rotations[0] = np.eye(3)
    for index, step in enumerate(steps):
        rotations[index + 1] = rotations[index] @ turn(step[:3])
    rotated_force = np.einsum("kij,kj->ki", rotations[:-1], steps[:, 3:])
    middle = 0.5 * (grid[1:] + grid[:-1])
    B = np.zeros((3, 3))
    for start in np.arange(time[0] + DIFFERENCE_S, time[-1] - DIFFERENCE_S, DIFFERENCE_S):
        weight = np.clip(1.0 - np.abs(middle - start) / DIFFERENCE_S, 0.0, None) / DIFFERENCE_S
        position_before, middle_r, position_after = (
            np.array([np.interp(start + shift, time, column) for column in r.T])
            for shift in (-DIFFERENCE_S, 0.0, DIFFERENCE_S)
        )
        acceleration = (position_after - 2.0 * middle_r + position_before) / DIFFERENCE_S**2
        velocity = (position_after - position_before) / (2.0 * DIFFERENCE_S)
        force = acceleration - gravity(middle_r) + 2.0 * np.cross(EARTH_SPIN, velocity)
        B += np.outer(force, weight @ rotated_force)
    U, _, Vt = np.linalg.svd(B)
    return np.asarray(U @ np.diag([1.0, 1.0, np.linalg.det(U @ Vt)]) @ Vt)


@dataclass
class _State:
    """Nominal r, v, C of the IMU in e, and x: biases, errors of lever arm and stamps."""

    r: Array
    v: Array
    C: Array
    x: Array

    def plus(self, error: Array) -> "_State":
        C = turn(error[6:9]) @ self.C
        return _State(self.r + error[:3], self.v + error[3:6], C, self.x + error[9:])

    def minus(self, from_: "_State") -> Array:
        psi = rotation_vector(self.C @ from_.C.T)
        return np.concatenate([self.r - from_.r, self.v - from_.v, psi, self.x - from_.x])


class _TransitionModel:
    """Equations (P.1) and (P.2) with the biases of a setup."""

    def __init__(self, setup: Setup) -> None:
        self.setup, self.count = setup, len(setup.biases)
        self.size = 9 + self.count + 4
        self.sums = np.zeros((6, self.count + 4))  # what every channel has of the states
        for k, bias in enumerate(setup.biases):
            self.sums[bias.channel, k] = 1.0
        times = np.array([bias.time_s for bias in setup.biases] + [np.inf] * 4)
        self.decay = 1.0 / times
        self.drive = np.array([bias.drive for bias in setup.biases] + [0.0] * 4)
        sigmas = [bias.sigma for bias in setup.biases]
        of_fixes = [*setup.antenna_sigma_m, setup.offset_sigma_s]
        self.sigma = np.concatenate([FIRST_SIGMA, sigmas, of_fixes])

    def step(self, s: _State, dt: float, raw: Array, P: Array) -> tuple[_State, Array, Array]:
        """Carry state and covariance P over one increment; the transition is the third."""
        n, sums = self.size, self.sums
        step = raw - sums @ s.x * dt
        a, u = step[:3], step[3:]
        K = cross_matrix(a)
        force = s.C @ (u + 0.5 * K @ u + K @ K @ u / 6.0) / dt
        v = s.v + (force + gravity(s.r) - 2.0 * np.cross(EARTH_SPIN, s.v)) * dt
        r = s.r + 0.5 * (s.v + v) * dt
        advanced = _State(
            r, v, turn(-EARTH_SPIN * dt) @ s.C @ turn(a), s.x * np.exp(-self.decay * dt)
        )
        W, C, F = cross_matrix(EARTH_SPIN), 0.5 * (s.C + advanced.C), np.zeros((n, n))
        up = s.r / np.linalg.norm(s.r)
        F[:3, 3:6] = np.eye(3)
        gradient = EARTH_GM / np.linalg.norm(s.r) ** 3
        F[3:6, :3] = gradient * (3.0 * np.outer(up, up) - np.eye(3))
        F[3:6, 3:6], F[6:9, 6:9] = -2.0 * W, -W
        F[3:6, 6:9] = -cross_matrix(force)
        F[6:9, 9:], F[3:6, 9:] = -C @ sums[:3], -C @ sums[3:]
        F[range(9, n), range(9, n)] = -self.decay
        Phi = np.eye(n) + F * dt + 0.5 * F @ F * dt**2
        q = np.zeros(n)
        q[3:6], q[6:9], q[9:] = self.setup.white[3:], self.setup.white[:3], self.drive
        return advanced, Phi @ P @ Phi.T + np.diag(q * dt), Phi


@dataclass(frozen=True, eq=False)
class _FixInEcef:
    """A fix in e: position (3,), covariance (3, 3)."""

    r: Array
    R: Array


def _update(model: _TransitionModel, s: _State, P: Array, fix: _FixInEcef) -> tuple[_State, Array]:
    """Use a fix; one beyond the gate is left out."""
    n = model.size
    arm, late_s = model.setup.antenna_b + s.x[-4:-1], s.x[-1]
    H = np.zeros((3, n))
    H[:, :3], H[:, 3:6], H[:, 6:9] = np.eye(3), -late_s * np.eye(3), -cross_matrix(s.C @ arm)
    H[:, n - 4 : n - 1], H[:, n - 1] = s.C, -s.v
    y = fix.r - (s.r + s.C @ arm - late_s * s.v)
    S = H @ P @ H.T + fix.R
    if float(y @ np.linalg.solve(S, y)) > GATE_NIS:
        return s, P
    K = np.linalg.solve(S, H @ P).T
    I_KH = np.eye(n) - K @ H
    return s.plus(K @ y), I_KH @ P @ I_KH.T + K @ fix.R @ K.T


def _smooth(
    model: _TransitionModel,
    initial: _State,
    sigma: Array,
    instants: Array,
    grid: Array,
    steps: Array,
    fixes: dict[float, _FixInEcef],
) -> tuple[list[_State], list[Array]]:
    """Filter forward and smooth backward over the marks (Rauch, Tung and Striebel 1965)."""
    s, P, sample = initial, np.diag(sigma**2), 0
    filtered: list[tuple[_State, Array]] = []
    predictions: list[tuple[_State, Array, Array]] = []
    for instant in instants:
        Phi = np.eye(model.size)
        while grid[sample] < instant:
            s, P, increment_Phi = model.step(
                s, float(grid[sample + 1] - grid[sample]), steps[sample], P
            )
            Phi, sample = increment_Phi @ Phi, sample + 1
        predictions.append((s, P, Phi))
        if (fix := fixes.get(float(instant))) is not None:
            s, P = _update(model, s, P, fix)
        filtered.append((s, P))
    states, covariances = [filtered[-1][0]], [filtered[-1][1]]
    for (s, P), (predicted, P_ahead, Phi) in zip(filtered[-2::-1], predictions[:0:-1], strict=True):
        scale = np.sqrt(np.diag(P_ahead))  # states of metres and of microradians
        scale[scale == 0.0] = 1.0
        whitened = P_ahead / np.outer(scale, scale)
        G = (np.linalg.pinv(whitened, hermitian=True, rcond=1e-14) @ ((Phi @ P) / scale[:, None])).T
        G = G / scale
        states.append(s.plus(G @ states[-1].minus(predicted)))
        covariances.append(P + G @ (covariances[-1] - P_ahead) @ G.T)
    return states[::-1], covariances[::-1]


def image_poses(
    setup: Setup,
    imu: ImuSamples,
    fixes: GnssFixes,
    exposures: Array,
    span: tuple[float, float],
    progress: Callable[[str], None] = lambda _: None,
) -> PosedImages:
    """Return the poses of exposures inside a span, from samples and fixes.

    Parameters
    ----------
    setup : what the flight file says.
    imu, fixes : as they were recorded, on one clock.
    exposures : (k,) mid-exposures, s, inside the span.
    span : first and last instant, s; a fix stands at the first.
    progress : gets which pass runs.
    """
    keep = (fixes.time >= span[0]) & (fixes.time <= span[1])
    time, position_e = fixes.time[keep], ecef(fixes.lat[keep], fixes.lon[keep], fixes.height[keep])
    axes = [ned_axes(*of_fix) for of_fix in zip(fixes.lat[keep], fixes.lon[keep], strict=True)]
    measured = {
        float(fix_time): _FixInEcef(fix_r, A.T @ cov @ A)
        for fix_time, fix_r, A, cov in zip(time, position_e, axes, fixes.cov_ned[keep], strict=True)
    }
    marks = np.union1d(time, exposures)
    grid, steps = increments_at(imu, setup.C_b_imu, marks)
    count = int((grid <= marks[0] + ALIGN_S).sum())
    aligning = time <= marks[0] + ALIGN_S
    C = first_attitude(grid[:count], steps[: count - 1], time[aligning], position_e[aligning])
    model = _TransitionModel(setup)
    later = int(np.searchsorted(time, time[0] + 1.0))
    velocity = (position_e[later] - position_e[0]) / (time[later] - time[0])
    zero, sigma = np.zeros(model.size - 9), model.sigma
    initial = _State(position_e[0] - C @ setup.antenna_b, velocity, C, zero)
    for number in range(1, MOST_PASSES + 1):
        progress(f"independent poses, pass {number} of {MOST_PASSES}")
        states, covariances = _smooth(model, initial, sigma, marks, grid, steps, measured)
        initial = _State(states[0].r, states[0].v, states[0].C, zero)
        sigma = model.sigma.copy()
        sigma[:9] = LATER_SIGMAS * np.sqrt(np.diag(covariances[0])[:9])
    chosen = np.searchsorted(marks, exposures)
    return _camera_poses(
        setup, [states[row] for row in chosen], [covariances[row] for row in chosen]
    )


def _camera_poses(
    setup: Setup, states: Sequence[_State], covariances: Sequence[Array]
) -> PosedImages:
    """Take states of the IMU to the camera and the tangent plane."""
    north, east, down = ned_axes(setup.origin[0], setup.origin[1])
    M = np.stack([east, north, -down])
    origin_r = ecef(*(np.array([x]) for x in setup.origin))[0]
    centres, rotations, sigmas = [], [], []
    for s, P in zip(states, covariances, strict=True):
        J = np.zeros((6, P.shape[0]))
        J[:3, :3], J[:3, 6:9], J[3:, 6:9] = M, -M @ cross_matrix(s.C @ setup.camera_b), M
        centres.append(M @ (s.r + s.C @ setup.camera_b - origin_r))
        rotations.append(M @ s.C @ setup.C_cb.T)
        sigmas.append(np.sqrt(np.diag(J @ P @ J.T)))
    return PosedImages(np.array(centres), np.array(rotations), np.array(sigmas))


def pose_differences(
    eo: ExteriorOrientation, poses: PosedImages
) -> tuple[Array, NDArray[np.float64]]:
    """Return independent minus given poses (k, 6), m and rad, and the given sigmas (k, 6)."""
    turned = rotation_vector(poses.C_mc @ np.swapaxes(eo.C_mc, -1, -2))
    error = np.hstack([poses.position_m - eo.position_m, turned])
    return error, np.sqrt(np.diagonal(eo.cov, axis1=1, axis2=2))
