"""Mounting against the printed tables of paper 000, the offsets proven in the format notes, and
scipy.
"""

import numpy as np
import pytest
from numpy.testing import assert_allclose
from scipy.spatial.transform import Rotation

from insgnss.base.errors import InputError
from insgnss.records.cameras.mounting import (
    ANGLE_SETS,
    Mounting,
    boresight_from_angles,
    metashape_offset,
)

TABLE_2 = np.array(
    [
        [+0.999909, +0.008952, +0.010018],
        [-0.009067, +0.999893, +0.011465],
        [-0.009914, -0.011555, +0.999884],
    ]
)
LAST_DIGIT = 1e-6  # of the printed matrix
ANTENNA_C = np.array([0.462, -0.001, -0.065])  # Table 1: camera to antenna, camera axes
IMU_C = np.array([0.113, 0.020, 0.000])  # Table 1: camera to NC1
T = np.diag([-1.0, -1.0, 1.0])


def test_opk_angles_give_the_printed_boresight():
    """Oracle: Table 2 of paper 000."""
    assert_allclose(
        boresight_from_angles("opk", [-0.657, 0.574, -0.513]), TABLE_2, rtol=0, atol=LAST_DIGIT
    )


def test_rpy_angles_give_the_printed_boresight():
    """Oracle: Table 2 of paper 000; its passive aerospace angles are yaw 0.513, pitch -0.574, roll
    0.657.
    """
    assert_allclose(
        boresight_from_angles("rpy", [0.657, -0.574, 0.513]), TABLE_2, rtol=0, atol=LAST_DIGIT
    )


def test_metashape_offset_gives_the_printed_boresight():
    """Oracle: Table 2 of paper 000 and the offset -0.5130, +0.6621, +0.5681 derived from it; 0.5e-4
    deg is 0.9e-6 rad.
    """
    assert_allclose(
        boresight_from_angles("metashape_ypr", [-0.5130, 0.6621, 0.5681]),
        TABLE_2,
        rtol=0,
        atol=2 * LAST_DIGIT,
    )


@pytest.mark.parametrize("off", [0.95e-4, -0.95e-4, 1.05e-4, -1.05e-4])
def test_a_matrix_of_four_decimals_is_a_rotation(off):
    """Oracle: the rotation nearest to 1 + off times one is that one, by off away from it."""
    matrix = (1.0 + off) * np.eye(3)
    if abs(off) < 1e-4:
        assert_allclose(Mounting(boresight=matrix).boresight, np.eye(3), rtol=0, atol=1e-12)
    else:
        with pytest.raises(InputError, match=r"an entry differs by 0\.00011 from the nearest"):
            Mounting(boresight=matrix)


def test_metashape_offset_of_the_paper_is_off_by_28_arcsec():
    """Oracle: the total rotation difference of 0.0078 deg found in the format notes (B1.4)."""
    printed = boresight_from_angles("metashape_ypr", [-0.513, 0.657, 0.574])
    angle = Rotation.from_matrix(printed @ Mounting(boresight=TABLE_2).boresight.T).magnitude()
    assert_allclose(np.rad2deg(angle), 0.0078, atol=0.00005)


def test_metashape_offset_follows_the_mount():
    """Oracle: scipy; with image top to the nose the right-up-back axes are right-forward-up and G
    is that change of axes.
    """
    nose_up = np.array([[0.0, 1.0, 0.0], [-1.0, 0.0, 0.0], [0.0, 0.0, 1.0]])
    right_forward_up = np.array([[0.0, 1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, -1.0]])
    attitude = Rotation.from_euler("ZXY", [-3.0, 2.0, 1.0], degrees=True).as_matrix()
    B = boresight_from_angles("metashape_ypr", [3.0, 2.0, 1.0], nose_up)
    assert_allclose(B, right_forward_up.T @ attitude @ right_forward_up, rtol=0, atol=1e-15)
    assert_allclose(B, boresight_from_angles("rpy", [1.0, 2.0, 3.0], nose_up).T, rtol=0, atol=1e-15)


def test_metashape_offset_of_an_oblique_camera():
    """Oracle: scipy; the same small turn, written in the right-up-back axes of a camera that looks
    30 deg forward.

    A camera that looks down has axes half a turn from the body's, which are their own inverse and
    hide which of the two is which.
    """
    oblique = Rotation.from_euler("ZYX", [90.0, 0.0, 30.0], degrees=True).as_matrix().T
    G = np.diag([1.0, -1.0, -1.0]) @ oblique
    assert np.abs(G - G.T).max() > 0.1
    axis = Rotation.from_euler("ZXY", [-3.0, 2.0, 1.0], degrees=True).as_rotvec()
    expected = Rotation.from_rotvec(G.T @ axis).as_matrix()
    B = boresight_from_angles("metashape_ypr", [3.0, 2.0, 1.0], oblique)
    assert_allclose(B, expected, rtol=0, atol=1e-12)
    _, offset = metashape_offset(None, B, oblique)
    assert_allclose(np.degrees(offset), [3.0, 2.0, 1.0], rtol=0, atol=1e-9)


def test_worked_example_of_the_mounting_chain():
    """Oracle: R_enu^c printed in the format notes (0.2) for roll 3, pitch -2, yaw 47 deg and the
    bore-sight of Table 2.
    """
    C_nb = Rotation.from_euler("ZYX", [47.0, -2.0, 3.0], degrees=True).as_matrix()
    ned_from_enu = np.array([[0.0, 1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, -1.0]])
    expected = [
        [-0.736314, -0.675117, 0.045363],
        [-0.672327, 0.737532, 0.063424],
        [-0.076275, 0.016202, -0.996955],
    ]
    assert_allclose(
        Mounting(boresight=TABLE_2).C_cb @ C_nb.T @ ned_from_enu, expected, atol=LAST_DIGIT
    )


def test_levers_without_boresight_are_table_1_in_body_axes():
    """Oracle: hand calculation, x backward and y left change sign: antenna 0.349 m behind, 0.021 m
    right of, 0.065 m above the IMU.
    """
    mounting = Mounting(ANTENNA_C, IMU_C, T)
    assert_allclose(mounting.antenna_lever_b, [-0.349, 0.021, -0.065], rtol=0, atol=1e-15)
    assert_allclose(mounting.camera_lever_b, [0.113, 0.020, 0.0], rtol=0, atol=1e-15)


def test_levers_with_boresight_close_the_triangle_in_the_camera():
    """Oracle: vector addition, IMU to camera to antenna, the chain T B multiplied out by hand."""
    mounting = Mounting(ANTENNA_C, IMU_C, T, TABLE_2)
    antenna_c = T @ TABLE_2 @ (mounting.antenna_lever_b - mounting.camera_lever_b)
    assert_allclose(antenna_c, ANTENNA_C, atol=0.5 * LAST_DIGIT)
    assert_allclose(T @ TABLE_2 @ mounting.camera_lever_b, -IMU_C, atol=0.5 * LAST_DIGIT)


def test_printed_matrix_is_made_a_rotation():
    """Oracle: orthonormality, and scipy's nearest rotation."""
    B = Mounting(boresight=TABLE_2).boresight
    assert np.abs(TABLE_2 @ TABLE_2.T - np.eye(3)).max() > 1e-7
    assert_allclose(B @ B.T, np.eye(3), rtol=0, atol=1e-15)
    assert_allclose(B, Rotation.from_matrix(TABLE_2).as_matrix(), rtol=0, atol=1e-9)


@pytest.mark.parametrize(
    ("wrong", "says"),
    [
        (
            {"boresight": np.diag([1.0, 1.0, -1.0])},
            r"boresight: no rotation, its determinant is -1\.000",
        ),
        (
            {"boresight": 2 * np.eye(3)},
            r"boresight: no rotation matrix, an entry differs by 1 from",
        ),
        ({"boresight": TABLE_2 + 3e-4 * np.eye(3)}, r"boresight: no rotation.*limit 0\.0001"),
        ({"boresight": np.zeros((3, 3))}, "boresight: no rotation"),
        ({"boresight": np.eye(2)}, "boresight: not a 3x3 matrix"),
        (
            {"camera_from_body": np.full((3, 3), np.nan)},
            "camera_from_body: not a 3x3 matrix of finite",
        ),
        ({"camera_from_body": np.diag([-1.0, 1.0, 1.0])}, "camera_from_body: no rotation"),
        ({"antenna_m": [1.0, 2.0]}, "antenna_m: .* not three finite"),
        ({"imu_m": [1.0, np.inf, 0.0]}, "imu_m: .* not three finite"),
    ],
)
def test_what_is_no_mounting_is_refused(wrong, says):
    """Oracle: the reason written by hand."""
    with pytest.raises(InputError, match=says):
        Mounting(**wrong)


@pytest.mark.parametrize(
    "args",
    [
        ("ypr", [0, 0, 0]),
        ("opk", [0, 0]),
        ("opk", [0, 0, np.nan]),
        ("rpy", [0, 0, 0], np.ones((3, 3))),
    ],
)
def test_wrong_angles_are_refused(args):
    """Oracle: the three sets that exist, three finite angles, T a rotation."""
    assert ANGLE_SETS == ("opk", "rpy", "metashape_ypr")
    with pytest.raises(InputError, match=r"boresight|camera_from_body"):
        boresight_from_angles(*args)


def test_lever_arms_from_the_imu_in_body_axes_come_back():
    """Oracle: the lever arms that were given, through a camera that is turned by a bore-sight of
    some degrees.
    """
    B = boresight_from_angles("opk", [3.0, -4.0, 5.0])
    mounting = Mounting.from_body([0.3, -0.2, -1.1], [0.1, 0.05, 0.2], boresight=B)
    np.testing.assert_allclose(mounting.antenna_lever_b, [0.3, -0.2, -1.1], atol=1e-15)
    np.testing.assert_allclose(mounting.camera_lever_b, [0.1, 0.05, 0.2], atol=1e-15)
    np.testing.assert_allclose(mounting.boresight, B, atol=1e-15)
    with pytest.raises(InputError, match="antenna_lever_b"):
        Mounting.from_body([0.3, -0.2])


@pytest.mark.parametrize(
    ("stated", "of_axes"), [(None, (0.005, 0.005, 0.02)), (0.003, (0.003,) * 3)]
)
def test_heights_of_an_unstated_phase_centre_are_known_less(stated, of_axes):
    """Oracle: a caliper's 5 mm, and 20 mm downwards for phase centres of 30 to 60 mm; as stated."""
    assert Mounting(antenna_sigma_m=stated).antenna_sigmas_b == of_axes
