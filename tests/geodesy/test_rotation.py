"""Rotations and angle sets against scipy, the formats' matrices and central differences."""

import numpy as np
import pytest
from numpy.testing import assert_allclose
from scipy.spatial.transform import Rotation

from insgnss.geodesy import rotation as rot

ROUNDING = 2e-15  # of entries of size one after a few products
SETS = {
    "rpy": (rot.rotation_from_rpy, rot.rpy_from_rotation, rot.rpy_jacobian),
    "opk": (rot.rotation_from_opk, rot.opk_from_rotation, rot.opk_jacobian),
    "pok": (rot.rotation_from_pok, rot.pok_from_rotation, rot.pok_jacobian),
    "ypr": (rot.rotation_from_ypr, rot.ypr_from_rotation, rot.ypr_jacobian),
}
SCIPY = {
    "rpy": lambda a: Rotation.from_euler("ZYX", a[..., ::-1]),
    "opk": lambda a: Rotation.from_euler("XYZ", a),
    "pok": lambda a: Rotation.from_euler("YXZ", a),
    "ypr": lambda a: Rotation.from_euler("ZXY", a * [-1.0, 1.0, 1.0]),
}
# the second factor's angle of each set is the one confined to +-90 deg
MIDDLE = {"rpy": 1, "opk": 1, "pok": 1, "ypr": 1}


def angles(n: int, middle: int, seed: int = 3) -> np.ndarray:
    a = np.random.default_rng(seed).uniform(-np.pi, np.pi, (n, 3))
    a[:, middle] *= 0.49
    return a


@pytest.mark.parametrize("name", SETS)
def test_angle_set_is_scipys_product_of_elementary_rotations(name):
    """Oracle: scipy Rotation.from_euler with intrinsic axes."""
    a = angles(50, MIDDLE[name]).reshape(5, 10, 3)
    assert_allclose(
        SETS[name][0](a),
        SCIPY[name](a.reshape(-1, 3)).as_matrix().reshape(5, 10, 3, 3),
        rtol=0,
        atol=ROUNDING,
    )


@pytest.mark.parametrize("name", SETS)
def test_angles_come_back_from_the_matrix(name):
    """Oracle: scipy's matrix of known angles; 1e-12 rad allows for pitch up to 88 deg."""
    a = angles(200, MIDDLE[name])
    assert_allclose(SETS[name][1](SCIPY[name](a).as_matrix()), a, rtol=0, atol=1e-12)


@pytest.mark.parametrize("name", SETS)
def test_jacobian_turns_angle_errors_into_psi(name):
    """Oracle: central difference of scipy's rotation vector of R(a + da) R(a)^T; step 1e-5 rad
    leaves 1e-10.
    """
    step = 1e-5
    for a in angles(10, MIDDLE[name]):
        numeric = np.empty((3, 3))
        for k in range(3):
            da = step * np.eye(3)[k]
            plus, minus = SCIPY[name](a + da), SCIPY[name](a - da)
            numeric[:, k] = (plus * minus.inv()).as_rotvec() / (2 * step)
        assert_allclose(SETS[name][2](a), numeric, rtol=0, atol=1e-9)


def test_metashape_printed_matrix():
    """Oracle: the matrix that Metashape prints for (30, 91, 0) and for (210, 89, 180), five digits
    (formats.md B1.1).
    """
    printed = [[0.866, -0.0087, -0.4999], [-0.5, -0.0151, -0.8659], [0.0, 0.99985, -0.01745]]
    for ypr in ([30.0, 91.0, 0.0], [210.0, 89.0, 180.0]):
        assert_allclose(rot.rotation_from_ypr(np.radians(ypr)), printed, atol=6e-5)


def test_worked_example_of_the_formats():
    """Oracle: the printed numbers of formats.md 0.2, six decimals."""
    table_2 = [
        [0.999909, 0.008952, 0.010018],
        [-0.009067, 0.999893, 0.011465],
        [-0.009914, -0.011555, 0.999884],
    ]
    assert not rot.is_rotation(table_2, 1e-6)  # printed to six digits: orthonormal to 1.5e-6 only
    B = rot.nearest_rotation(table_2)
    C_bn = rot.rotation_from_rpy(np.radians([3.0, -2.0, 47.0])).T
    T = np.diag([-1.0, -1.0, 1.0])
    C_cm = T @ B @ C_bn @ rot.NED_ENU
    printed = [
        [-0.736314, -0.675117, 0.045363],
        [-0.672327, 0.737532, 0.063424],
        [-0.076275, 0.016202, -0.996955],
    ]
    assert_allclose(C_cm, printed, atol=6e-7)
    R = C_cm.T @ rot.CV_RUB
    assert_allclose(
        np.degrees(rot.opk_from_rotation(R)), [0.931051, 4.374505, -137.600874], rtol=0, atol=6e-7
    )
    assert_allclose(
        np.degrees(rot.ypr_from_rotation(R)), [137.648029, -3.636396, -2.605228], rtol=0, atol=6e-7
    )
    assert_allclose(
        rot.quaternion_from_rotation(C_cm), [0.032646, -0.361631, 0.931504, 0.021370], atol=6e-7
    )


@pytest.mark.parametrize(
    "length", [0.0, 1e-300, 1e-12, 1e-9, 1e-8, 3e-8, 1e-4, 1.0, 3.0, np.pi - 1e-6, np.pi - 1e-9]
)
def test_rotation_vector_there_and_back(length):
    """Oracle: scipy's matrix of a vector of known length; relative 1e-9 (rounding of the matrix,
    1e-16, over its sine near pi excluded).
    """
    u = np.random.default_rng(5).standard_normal((20, 3))
    v = length * u / np.linalg.norm(u, axis=1, keepdims=True)
    C = Rotation.from_rotvec(v).as_matrix()
    assert_allclose(rot.rotation_from_vector(v), C, rtol=0, atol=ROUNDING)
    assert_allclose(rot.vector_from_rotation(C), v, rtol=1e-9, atol=1e-15)


def test_rotation_vector_of_a_half_turn():
    """Oracle: C = 2 u u^T - I, the closed form of the half turn about u; the sign of u is free."""
    u = np.array([0.6, -0.48, 0.64])
    v = rot.vector_from_rotation(2.0 * np.outer(u, u) - np.eye(3))
    assert_allclose(np.abs(v @ u), np.pi, rtol=1e-14)
    assert_allclose(np.linalg.norm(v), np.pi, rtol=1e-14)


def test_quaternions_are_scipys():
    """Oracle: scipy (quaternion x, y, z, w); half turns about the axes take every branch."""
    q_xyzw = np.vstack([Rotation.random(200, random_state=1).as_quat(canonical=True), np.eye(4)])
    q = q_xyzw[:, [3, 0, 1, 2]]
    C = Rotation.from_quat(q_xyzw).as_matrix()
    assert_allclose(rot.rotation_from_quaternion(q), C, rtol=0, atol=ROUNDING)
    assert_allclose(rot.quaternion_from_rotation(C), q, rtol=0, atol=ROUNDING)
    assert rot.quaternion_from_rotation(np.eye(3)).shape == (4,)


def test_skew_is_the_cross_product():
    """Oracle: numpy.cross."""
    a, b = np.random.default_rng(7).standard_normal((2, 4, 5, 3))
    assert_allclose((rot.skew(a) @ b[..., None])[..., 0], np.cross(a, b), rtol=0, atol=ROUNDING)


def test_nearest_rotation_is_the_polar_factor():
    """Oracle: scipy.linalg.polar, with a determinant kept at +1 for a reflected matrix."""
    from scipy.linalg import polar

    rng = np.random.default_rng(11)
    R = Rotation.random(6, random_state=2).as_matrix()
    M = R + 0.05 * rng.standard_normal((6, 3, 3))
    assert_allclose(rot.nearest_rotation(M), [polar(m)[0] for m in M], rtol=0, atol=1e-14)
    reflected = rot.nearest_rotation(M @ np.diag([1.0, 1.0, -0.1]))
    assert_allclose(np.linalg.det(reflected), 1.0, rtol=1e-14)


def test_is_rotation_tells_rotations_from_the_rest():
    """Oracle: by definition; a reflection, a scaled, a non-finite and a 2 x 2 matrix are no
    rotations.
    """
    R = Rotation.random(3, random_state=4).as_matrix()
    assert rot.is_rotation(R)
    assert rot.is_rotation(R[0])
    for wrong in (
        R * [1.0, 1.0, -1.0],
        1.001 * R,
        np.full((3, 3), np.nan),
        np.eye(2),
        np.vstack([R, [1.01 * R[0]]]),
    ):
        assert not rot.is_rotation(wrong)
    assert rot.is_rotation(1.001 * R, tol=3e-3)


def test_constants_exchange_the_axes_they_name():
    """Oracle: definition of the frames (formats.md 0): north is ENU's second axis; image-down is
    minus image-up.
    """
    assert_allclose(rot.NED_ENU @ [1.0, 2.0, 3.0], [2.0, 1.0, -3.0], atol=0)
    assert_allclose(rot.CV_RUB @ [1.0, 2.0, 3.0], [1.0, -2.0, -3.0], atol=0)
    with pytest.raises(ValueError, match="read-only"):
        rot.NED_ENU[0, 0] = 1.0
