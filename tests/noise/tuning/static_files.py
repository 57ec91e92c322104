"""Static recordings for the tests of tuning, simulated with known noise."""

from pathlib import Path

import numpy as np

from insgnss.navigation.noise_model.model import AxisNoise, GaussMarkov
from insgnss.noise.processes.realisation import simulate_noise

RATE, MINUTES = 50.0, 12
DEG_H, UG = np.pi / 180.0 / 3600.0, 9.80665e-6
GYRO = AxisNoise(
    white_noise=10.0 * DEG_H, gauss_markov=(GaussMarkov.from_sigma(4.0, 25.0 * DEG_H),)
)
ACCEL = AxisNoise(white_noise=50.0 * UG, gauss_markov=(GaussMarkov.from_sigma(6.0, 120.0 * UG),))
BIAS = np.array([0.01, -0.02, 0.005])
GRAVITY = np.array([0.1, -0.2, -9.8])


def samples(seed: int, minutes: float = MINUTES) -> np.ndarray:
    """(n, 6) rad/s and m/s^2 of a sensor at rest."""
    rng = np.random.default_rng(seed)
    n = int(minutes * 60 * RATE)
    noise = [simulate_noise(axis, n, 1.0 / RATE, rng) for axis in (GYRO,) * 3 + (ACCEL,) * 3]
    return np.column_stack(noise) + np.concatenate([BIAS, GRAVITY])


def save(path: Path, values: np.ndarray) -> Path:
    """A .npy of the samples."""
    np.save(path, values)
    return path
