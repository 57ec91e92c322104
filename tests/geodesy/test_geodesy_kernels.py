"""Compiled scalar forms against scipy and numpy, with the output on its own and on top of an input."""

import numpy as np
import pytest
from numpy.testing import assert_allclose
from scipy.spatial.transform import Rotation

from insgnss.geodesy import _kernels as kernels

ROUNDING = 1e-15


@pytest.mark.parametrize("length", [0.0, 1e-9, 2e-3, 0.04999, 0.05001, 1.0, 3.0, 7.0])
def test_quaternion_of_a_rotation_vector(length):
    """Oracle: scipy Rotation.from_rotvec; 0.05 rad is where the series ends."""
    v = length * np.array([2.0, -3.0, 6.0]) / 7.0
    out = np.empty(4)
    kernels.quat_from_rotvec(*v, out)
    expected = Rotation.from_rotvec(v).as_quat()[[3, 0, 1, 2]]
    assert_allclose(out, expected * np.sign(expected @ out), atol=ROUNDING)
    assert_allclose(out[1:], 0.5 * v * np.sinc(0.5 * length / np.pi), rtol=1e-14, atol=1e-18)


def test_product_and_matrix_of_quaternions():
    """Oracle: scipy's product of rotations and its matrix."""
    a, b = Rotation.random(2, random_state=3)
    qa, qb, C = a.as_quat()[[3, 0, 1, 2]], b.as_quat()[[3, 0, 1, 2]], np.empty((3, 3))
    out = np.empty(4)
    kernels.quat_multiply(qa, qb, out)
    kernels.quat_to_matrix(out, C)
    assert_allclose(C, (a * b).as_matrix(), atol=ROUNDING)
    kernels.quat_multiply(qa, qb, qa)
    assert_allclose(qa, out, atol=0)
    kernels.quat_multiply(b.as_quat()[[3, 0, 1, 2]], qb, qb)
    kernels.quat_to_matrix(qb, C)
    assert_allclose(C, (b * b).as_matrix(), atol=ROUNDING)


def test_cross_product_onto_its_own_input():
    """Oracle: numpy.cross."""
    a, b = np.random.default_rng(2).standard_normal((2, 3))
    expected, out = np.cross(a, b), np.empty(3)
    kernels.cross(a, b, out)
    assert_allclose(out, expected, atol=ROUNDING)
    kernels.cross(a, b, b)
    assert_allclose(b, expected, atol=ROUNDING)
