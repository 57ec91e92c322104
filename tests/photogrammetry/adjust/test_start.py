"""First values, against the poses from which points are seen."""

import numpy as np
import pytest

from insgnss.geodesy.rotation import rotation_from_vector
from insgnss.photogrammetry.adjust.start import three_point_poses

NADIR = np.diag([1.0, -1.0, -1.0])  # camera to axes east, north, up
ANGLES = np.radians([90.0, 210.0, 330.0])
EQUILATERAL = np.column_stack([40.0 * np.cos(ANGLES), 40.0 * np.sin(ANGLES), np.zeros(3)])
ISOSCELES = np.array([[0.0, 60.0, 0.0], [-30.0, -20.0, 0.0], [30.0, -20.0, 0.0]])


def nearest_m(X, X0, C):
    """Distance of the nearest pose's projection centre from the one that saw the points, m."""
    seen = (X - X0) @ C
    poses = three_point_poses(seen[:, :2] / seen[:, 2:], X)
    return min((np.linalg.norm(centre - X0) for centre, _ in poses), default=np.inf)


@pytest.mark.parametrize("X", [EQUILATERAL, *(np.roll(ISOSCELES, k, axis=0) for k in range(3))])
def test_a_symmetric_triangle_is_resected(X):
    """Oracle: the pose above its centre, where ratios of distances are double roots."""
    assert nearest_m(X, X.mean(axis=0) + [0.0, 0.0, 100.0], NADIR) < 1e-3  # first values


def test_any_triangle_is_resected():
    """Oracle: the pose. The danger cylinder is near for some: half of the digits are left."""
    rng = np.random.default_rng(1)
    for _ in range(300):
        X = rng.uniform(-50.0, 50.0, (3, 3)) * [1.0, 1.0, 0.2]
        X0 = rng.uniform(-40.0, 40.0, 3) + [0.0, 0.0, 100.0]
        C = NADIR @ rotation_from_vector(rng.uniform(-0.3, 0.3, 3))
        assert nearest_m(X, X0, C) < 0.05
