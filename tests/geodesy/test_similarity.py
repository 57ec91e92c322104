"""Similarity of two frames in closed form."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from insgnss.geodesy.similarity import similarity


@pytest.mark.parametrize("seed", range(5))
@pytest.mark.parametrize("flat", [False, True])
@pytest.mark.parametrize("rigid", [False, True])
def test_a_similarity_is_recovered(seed, flat, rigid):
    """Oracle: the similarity that made the points, turned by scipy's rotations; points of a plane
    as well.
    """
    rng = np.random.default_rng(seed)
    X = rng.normal(size=(6, 3)) * [10.0, 7.0, 0.0 if flat else 3.0]
    R, T = Rotation.from_rotvec(rng.normal(size=3)), rng.normal(size=3) * 100.0
    scale = 1.0 if rigid else float(rng.uniform(0.2, 5.0))
    got = similarity(X, T + scale * R.apply(X), rigid=rigid)
    assert np.abs(got.rotation - R.as_matrix()).max() < 1e-12
    assert abs(got.scale - scale) < 1e-12 * 5.0
    assert np.abs(got.points(X) - T - scale * R.apply(X)).max() < 1e-11
    assert abs(np.linalg.det(got.rotation) - 1.0) < 1e-12


def test_rotation_of_least_squares_is_that_of_scipy():
    """Oracle: Rotation.align_vectors of centred points with noise."""
    rng = np.random.default_rng(2)
    X = rng.normal(size=(8, 3))
    Y = Rotation.from_rotvec([0.3, -1.0, 2.0]).apply(X) + rng.normal(0.0, 0.1, (8, 3))
    best, _ = Rotation.align_vectors(Y - Y.mean(axis=0), X - X.mean(axis=0))
    assert np.abs(similarity(X, Y).rotation - best.as_matrix()).max() < 1e-9


def test_mirrored_points_do_not_get_a_reflection():
    """Oracle: determinants; a reflection would fit exactly."""
    X = np.random.default_rng(3).normal(size=(8, 3)) * [3.0, 2.0, 1.0]
    got = similarity(X, X * [1.0, 1.0, -1.0])
    assert abs(np.linalg.det(got.rotation) - 1.0) < 1e-12


def test_points_on_a_line_give_none():
    """Oracle: a turn about the line leaves the points where they are."""
    X = np.outer(np.arange(5.0), [1.0, 2.0, 3.0])
    assert similarity(X, X) is None
    assert similarity(np.ones((4, 3)), np.ones((4, 3))) is None
