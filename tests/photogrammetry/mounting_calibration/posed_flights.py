"""Poses of a made-up flight and of its block, whose errors have exactly the covariance they state.

Errors of the flight are A c + white noise with A of tilts, heading, a level of the positions and
the antenna's lever arm; draws go through no factorisation.
"""

from dataclasses import dataclass, replace

import numpy as np

from insgnss.geodesy.rotation import rotation_from_vector, skew
from insgnss.photogrammetry.mounting_calibration.records import CameraPoses, CovariantPoses, Stated
from insgnss.records import ExteriorOrientation
from insgnss.records.cameras.mounting import Mounting
from insgnss.records.strips import CommonErrors, StripCovariance

ANTENNA, IMU = np.array([0.462, -0.001, -0.065]), np.array([0.113, 0.02, 0.0])
BORESIGHT = rotation_from_vector(np.radians([-0.657, 0.574, -0.513]))
DELAY_S = 0.017
WHITE_M, WHITE_RAD = 0.01, np.radians(0.01)
POSE_M, POSE_RAD = 0.01, np.radians(0.003)
LEVER_SIGMA_M = 0.3


@dataclass(frozen=True)
class Plan:
    """How a flight is flown.

    Parameters
    ----------
    headings_deg : of the lines, one each.
    speeds : m/s, one each.
    images : of a line.
    tilt_deg : rms of the tilts.
    rate_dps : rms of the angular rates.
    gust_mps : rms of what the velocity is off its line's.
    """

    headings_deg: tuple[float, ...] = (10.0, 190.0, 10.0, 190.0, 100.0)
    speeds: tuple[float, ...] = (17.0, 12.0, 17.0, 12.0, 15.0)
    images: int = 12
    tilt_deg: float = 3.0
    rate_dps: float = 4.0
    gust_mps: float = 0.3


PLAIN = Plan()
ONE_HEADING = Plan((10.0,) * 4, (15.0,) * 4, 12, 0.5, 0.0, 0.05)


@dataclass(frozen=True, eq=False)
class Posed:
    """A flight, the poses of its block, and the truth."""

    flight: CovariantPoses
    block: CameraPoses
    rows: np.ndarray
    stated: Stated
    mounting: Mounting


def posed(
    plan: Plan = PLAIN, seed: int = 0, noise: float = 1.0, georeferenced: bool = True
) -> Posed:
    """Fly and adjust; the flight knows nothing of bore-sight and delay, and 5 cm of the antenna.

    Parameters
    ----------
    plan : how it is flown.
    seed : of tilts, rates and errors.
    noise : factor of all errors; 0: exact.
    georeferenced : whether the block stands in the tangent plane, else in a frame of its own.
    """
    rng = np.random.default_rng(seed)
    true = Mounting(ANTENNA, IMU, boresight=BORESIGHT)
    believed = Mounting(ANTENNA + [0.05, -0.04, 0.03], IMU)
    lines, m = len(plan.headings_deg), plan.images
    n = lines * m
    heading = np.radians(np.repeat(plan.headings_deg, m))
    along = np.stack([np.sin(heading), np.cos(heading), np.zeros(n)], axis=1)
    across = np.stack([np.cos(heading), -np.sin(heading), np.zeros(n)], axis=1)
    number = np.repeat(np.arange(lines), m)
    place = np.tile(np.linspace(-150.0, 150.0, m), lines)
    X = place[:, None] * along + (60.0 * (number - lines / 2))[:, None] * across
    X[:, 2] = 120.0 + 8.0 * rng.standard_normal(n)
    tilt = np.radians(plan.tilt_deg) * rng.standard_normal((n, 3))
    down = np.stack([along, across, np.tile([0.0, 0.0, -1.0], (n, 1))], axis=2)
    C_mb = down @ rotation_from_vector(tilt)
    speed = np.repeat(plan.speeds, m)
    rate = np.radians(plan.rate_dps) * rng.standard_normal((n, 3))
    velocity = speed[:, None] * along + plan.gust_mps * rng.standard_normal((n, 3))
    # truth at mid-exposure, DELAY_S behind the stamps at which the flight says its poses
    C_mc = C_mb @ true.C_cb.T
    at_stamp = rotation_from_vector(-DELAY_S * rate) @ C_mb
    X_imu = X + np.einsum("nij,j->ni", C_mc, IMU) - velocity * DELAY_S
    # errors of the flight: tilt and heading of the body, a level, the lever arm of the antenna
    A = np.zeros((n, 6, 9))
    A[:, 3:, :3] = at_stamp * np.radians([0.01, 0.01, 0.03])
    A[:, :3, 3:6] = 0.01 * np.eye(3)
    A[:, :3, 6:] = -LEVER_SIGMA_M * at_stamp
    lever_error = true.antenna_lever_b - believed.antenna_lever_b
    c = rng.standard_normal(9)
    c[:6] *= noise
    c[6:] = lever_error / LEVER_SIGMA_M
    white = noise * rng.standard_normal((n, 6)) * np.repeat([WHITE_M, WHITE_RAD], 3)
    error = A @ c + white
    X_said = X_imu - error[:, :3] + at_stamp @ believed.camera_lever_b
    # a turn of the body turns the lever arm to the camera as well
    A[:, :3] += (-skew(at_stamp @ believed.camera_lever_b)) @ A[:, 3:]
    X_said += np.cross(at_stamp @ believed.camera_lever_b, -(error[:, 3:]))
    C_said = rotation_from_vector(-error[:, 3:]) @ at_stamp @ believed.C_cb.T
    J = np.tile(np.eye(6), (n, 1, 1))
    J[:, :3, 3:] = -skew(at_stamp @ believed.camera_lever_b)
    own = J @ np.diag(np.repeat([WHITE_M**2, WHITE_RAD**2], 3)) @ J.swapaxes(1, 2)
    cov = own + A @ A.swapaxes(1, 2)
    strips = []
    for k in range(lines):
        rows = np.arange(k * m, (k + 1) * m)
        F = A[rows].reshape(6 * m, 9)
        whole = F @ F.T
        for i in range(m):
            whole[6 * i : 6 * i + 6, 6 * i : 6 * i + 6] += own[rows[i]]
        strips.append(StripCovariance(rows, whole))
    lever = np.zeros((1, 3, 9))
    lever[0, :, 6:] = LEVER_SIGMA_M * np.eye(3)
    common = CommonErrors(np.zeros(n, dtype=np.int64), A, lever, np.zeros((1, 3)))
    names = tuple(f"{k:04d}.tif" for k in range(n))
    eo = ExteriorOrientation(
        names,
        100.0 + np.arange(n) * 2.0,
        2008,
        np.array([0.8, 0.1, 0.0]),
        X_said,
        C_said,
        cov,
        None,
        believed.boresight,
        believed.camera_from_body,
        (),
        velocity_mps=velocity,
        rate_radps=rate,
    )
    X_b = X + noise * POSE_M * rng.standard_normal((n, 3))
    C_b = rotation_from_vector(noise * POSE_RAD * rng.standard_normal((n, 3))) @ C_mc
    P = np.tile(np.diag(np.repeat([POSE_M**2, POSE_RAD**2], 3)), (n, 1, 1))
    if not georeferenced:
        R, s = rotation_from_vector(np.array([0.4, -1.1, 2.0])), 0.03
        X_b, C_b = s * (X_b - [3.0, 4.0, 5.0]) @ R.T, R @ C_b
        G = np.kron(np.diag([s, 1.0]), R)
        P = G @ P @ G.T
    independent = np.zeros((6, 6))  # no image shares its error with another
    frame = "plane" if georeferenced else "own"
    block = CameraPoses(names, X_b, C_b, P, frame, "block.xml", shared=independent)
    flight = CovariantPoses(eo, tuple(strips), common, believed)
    stated = Stated(believed, 0.0, frozenset({"antenna_m", "imu_m"}))
    return Posed(flight, block, np.arange(n), stated, true)


def only(of: Posed, rows: np.ndarray) -> Posed:
    """The same of some images of the block."""
    return replace(of, block=of.block.taken(rows), rows=rows)
