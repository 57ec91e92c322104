"""An exact recording of an IMU that is turned by hand from one position at rest to the next."""

from itertools import pairwise

import numpy as np

from insgnss.geodesy.earth import normal_gravity
from insgnss.geodesy.frames import LocalFrame
from insgnss.navigation.prepare.calibration import TriadCalibration
from insgnss.records import ImuSamples
from insgnss.simulation.motion import ExactMotion

LATITUDE, HEIGHT = np.radians(46.5), 400.0
GRAVITY = float(normal_gravity(LATITUDE, HEIGHT))
FACES = np.radians([[0, 0, 0], [90, 0, 0], [180, 0, 0], [270, 0, 0], [270, 89, 0], [270, -89, 0]])
GYRO = TriadCalibration(
    np.array([0.011, -0.007, 0.004]),
    np.eye(3) + 1e-3 * np.array([[4.0, -2.0, 1.0], [3.0, -6.0, 0.5], [-1.5, 2.5, 2.0]]),
)
ACCEL = TriadCalibration(
    np.array([0.12, -0.2, 0.05]),
    np.eye(3) + 1e-3 * np.array([[3.0, 0, 0], [-2.0, -5.0, 0], [1.0, 4.0, 7.0]]),
)


def positions(n=24, seed=3):
    """(n, 3) roll, pitch, yaw: faces and edges, turned about all axes."""
    rng = np.random.default_rng(seed)
    return np.concatenate(
        [FACES, rng.uniform([-3.0, -1.4, -3.0], [3.0, 1.4, 3.0], (n - len(FACES), 3))]
    )


def turned_by_hand(angles, hold_s=5.0, turn_s=2.0, rate=100.0):
    """Exact recording of a body that rests in each position and turns to the next."""
    knot = 0.1
    hold, turn = round(hold_s / knot), round(turn_s / knot)
    ramp = 0.5 - 0.5 * np.cos(np.pi * np.arange(1, turn) / turn)
    rows = [np.repeat(angles[:1], hold, axis=0)]
    for a, b in pairwise(angles):
        rows += [a + ramp[:, None] * (b - a), np.repeat(b[None], hold, axis=0)]
    control = np.concatenate(rows)
    frame = LocalFrame(float(LATITUDE), 0.1, HEIGHT)
    return ExactMotion(frame, 1000.0, knot, np.hstack([np.zeros_like(control), control])).imu(rate)


def recorded(ideal, seed, gyro=1e-3, accel=5e-3, wander=0.0):
    """What a sensor of the error model (C.1) would record, with white noise."""
    rng = np.random.default_rng(seed)
    n = ideal.gyro.shape
    noise = [rng.normal(0.0, s, n) for s in (gyro, accel)]
    return ImuSamples(
        ideal.time,
        ideal.gyro @ GYRO.response.T + GYRO.bias + noise[0],
        ideal.accel @ ACCEL.response.T
        + ACCEL.bias
        + noise[1]
        + wander * np.round(ideal.accel, 1) ** 2 / 96.0 * [1, -1, 1],
        source="hand",
    )
