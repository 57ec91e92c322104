"""Orientations at places on the Earth, for exports and their ways back."""

import numpy as np

from insgnss.geodesy.rotation import rotation_from_vector
from insgnss.records import ExteriorOrientation

SIGMA = np.array([0.01, 0.01, 0.02, 5e-5, 5e-5, 2e-4])  # m and rad


def orientation_at(
    lat_deg: float,
    lon_deg: float,
    ground_m: float = 400.0,
    datum: str | None = None,
    epoch: float | None = None,
) -> ExteriorOrientation:
    """Two strips of six images, 80 m above the ground, tilted by some degrees."""
    rng = np.random.default_rng(8)
    along, across = np.tile(np.arange(6) * 40.0, 2), np.repeat([0.0, 70.0], 6)
    n = along.size
    east, north = 0.8 * along - 0.6 * across, 0.6 * along + 0.8 * across
    heading = np.repeat([0.9, 0.9 + np.pi], 6)[:, None] * [0.0, 0.0, -1.0]
    tilt = rng.normal(scale=[0.05, 0.05, 0.02], size=(n, 3))
    C = rotation_from_vector(tilt) @ rotation_from_vector(heading) @ np.diag([1.0, -1.0, -1.0])
    return ExteriorOrientation(
        tuple(f"IMG_{k:04d}.jpg" for k in range(n)),
        1000.0 + 2.0 * np.arange(n),
        2290,
        np.array([np.radians(lat_deg), np.radians(lon_deg), ground_m]),
        np.column_stack([east, north, 80.0 + rng.normal(scale=2.0, size=n)]),
        C,
        np.broadcast_to(np.diag(SIGMA**2), (n, 6, 6)),
        np.zeros((n - 1, 6, 6)),
        np.eye(3),
        np.array([[0.0, 1.0, 0.0], [-1.0, 0.0, 0.0], [0.0, 0.0, 1.0]]),
        datum=datum,
        epoch=epoch,
    )
