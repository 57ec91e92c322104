"""The readers' own geometry against numbers of others, and what a tool makes of a projected
frame.
"""

import numpy as np
import pytest
import scene
from numpy.testing import assert_allclose
from readers.geometry import (
    GIMBAL,
    SETS,
    TO_ECEF,
    Array,
    D,
    Frame,
    Geocentric,
    Projected,
    Rx,
    Rz,
    S,
    Tangent,
    ned,
    ned_of,
    opk_of,
    turn,
    ypr,
    ypr_of,
)
from readers.graphs import quaternion_of

from insgnss.geodesy.projection import MapProjection
from insgnss.navigation.orient.frame import in_frame

PLACE = np.array([[6.54, 46.57, 0.0]])
SEED_B = [
    [0.999909, 0.008952, 0.010018],
    [-0.009067, 0.999893, 0.011465],
    [-0.009914, -0.011555, 0.999884],
]


def worked() -> Array:
    """formats.md 0.2: R_enu^c of roll 3, pitch -2, yaw 47 and the published bore-sight, made
    orthonormal.
    """
    U, _, Vt = np.linalg.svd(SEED_B)
    return scene.T @ (U @ Vt) @ ned(3.0, -2.0, 47.0).T @ S


def test_worked_example() -> None:
    """Oracle: the printed numbers of formats.md 0.2."""
    R = turn(worked()[None])
    assert_allclose(np.concatenate(opk_of(R @ D)), [0.931051, 4.374505, -137.600874], atol=1e-4)
    assert_allclose(np.concatenate(ypr_of(R @ D)), [137.648029, -3.636396, -2.605228], atol=1e-4)
    assert_allclose(np.concatenate(opk_of(R)), [-179.068949, -4.374505, 137.600874], atol=1e-4)
    q = quaternion_of(worked())
    assert_allclose(q * np.sign(q[0]), [0.032646, -0.361631, 0.931504, 0.021370], atol=2e-6)


def test_metashape_prints_this_matrix() -> None:
    """Oracle: ypr2mat of (30, 91, 0) and (210, 89, 180) as the program prints it (formats.md
    B1.1).
    """
    printed = [[0.866, -0.0087, -0.4999], [-0.5, -0.0151, -0.8659], [0.0, 0.99985, -0.01745]]
    assert_allclose(ypr(30.0, 91.0, 0.0), printed, atol=1e-4)
    assert_allclose(ypr(210.0, 89.0, 180.0), printed, atol=1e-4)


def test_boresight_as_an_offset() -> None:
    """Oracle: formats.md B1.4, yaw -0.5130, pitch 0.6621, roll 0.5681 of the published bore-
    sight.
    """
    G = D @ scene.T
    assert_allclose(
        np.concatenate(ypr_of((G @ scene.B @ G.T)[None])), [-0.5130, 0.6621, 0.5681], atol=1e-4
    )


def test_gimbal() -> None:
    """Oracle: formats.md B10, Metashape (47, 1, 2) is gimbal yaw -16.4, pitch -87.8, roll 63.4."""
    roll, pitch, yaw = ned_of((S @ ypr(47.0, 1.0, 2.0) @ D @ GIMBAL)[None])
    assert_allclose([yaw[0], pitch[0], roll[0]], [-16.4, -87.8, 63.4], atol=0.06)


@pytest.mark.parametrize("name", SETS)
def test_angles_and_their_rotation(name: str) -> None:
    """Oracle: round trip."""
    _, compose, decompose = SETS[name]
    R = turn(worked()[None]) @ D @ Rx(np.array([1.0, -2.0])) @ Rz(np.array([20.0, 200.0]))
    assert_allclose(compose(*decompose(R)), R, rtol=0, atol=1e-12)


@pytest.mark.parametrize(
    ("code", "degrees"), [("EPSG:2056", -0.6574), ("EPSG:32632", -1.7870), ("EPSG:32631", 2.5724)]
)
def test_convergence(code: str, degrees: float) -> None:
    """Oracle: formats.md C3.1; LV95 within what its datum turns (2 seconds of arc)."""
    grid = Projected(code)
    x = grid.coordinates(Frame().ecef(PLACE))
    assert_allclose(grid.convergence(x), degrees, atol=7e-4)


@pytest.mark.parametrize(
    "frame",
    [
        Frame(),
        Geocentric(),
        Tangent(6.5, 46.5, 400.0),
        Projected("EPSG:2056"),
        Projected("EPSG:32632"),
    ],
)
def test_frames_and_back(frame: Frame) -> None:
    """Oracle: round trip through ECEF, 1e-8 m; axes are rotations."""
    ecef = np.column_stack(TO_ECEF.transform(*(PLACE + [[0.01, 0.02, 600.0]]).T))
    x = frame.coordinates(ecef)
    assert_allclose(frame.ecef(x), ecef, rtol=0, atol=1e-8)
    for C in (frame.axes(x), frame.north(x), frame.local(x)):
        assert_allclose(C @ turn(C), np.eye(3)[None], rtol=0, atol=1e-12)
        assert_allclose(np.linalg.det(C), 1.0)


def test_every_point_is_seen_by_three_images_at_least() -> None:
    """Oracle: the size of the image; the points lie all over it."""
    assert (scene.SEEN.sum(axis=0) >= 3).all()
    spread = scene.PIXELS.reshape(-1, 2)
    assert (np.ptp(spread, axis=0) > 0.5 * scene.SIZE_PX).all()


def as_cartesian(code: str, ground_m: float | None) -> Array:
    """Residuals, px, of a tool that takes coordinates of a projected CRS for Cartesian ones, camera
    and points alike.
    """
    eo = in_frame(scene.master(), "projected", MapProjection(code), ground_m)
    points = Projected(code).coordinates(scene.GROUND)
    x = (points[None] - eo.coordinates[:, None]) @ eo.C_fc
    pixels = scene.FOCAL_PX * x[..., :2] / x[..., 2:] + scene.CENTRE_PX
    return np.linalg.norm(pixels - scene.PIXELS, axis=2)[scene.SEEN]


@pytest.mark.parametrize(
    ("code", "plain_px", "scaled_px"),
    [("EPSG:2056", 0.25, 0.15), ("EPSG:32632", 0.1, 0.01), ("EPSG:32631", 0.7, 0.05)],
)
def test_a_grid_taken_for_cartesian(code: str, plain_px: float, scaled_px: float) -> None:
    """Oracle: formats.md C3: what is left is the scale, which scaled heights take away.

    In LV95 0.14 px stay, the same in all the image: 5 seconds of arc between the normals of
    Bessel's ellipsoid, on which its plan stands, and of that of WGS84, above which the heights are.
    """
    ground = float(scene.PLANE.geographic(scene.POINTS)[:, 2].mean())
    plain, scaled = as_cartesian(code, None), as_cartesian(code, ground)
    assert plain.max() < plain_px
    assert scaled.max() < scaled_px
    assert scaled.max() < plain.max()
