"""The scene of the proofs: four images of one site, points in space, and the pixels where they must
be. Elementary matrices only.

The camera stands in space by formats.md section 0, R_enu^c = T B R_ned^b S at its own place, which
pyproj takes to ECEF; a point at X in ECEF is seen at f (x/z, y/z) + principal point of R^T (X -
X0). The record that the exports start from is made of these.

The site lies 3 km from the origin of its tangent plane, so that the axes there differ from the
local ones by 1.5 minutes of arc (2.6 px), 140 m above ground; the convergence of the meridian is
-0.63 deg in LV95 and -1.76 deg in UTM 32N.
"""

import numpy as np
from readers.geometry import (
    TO_ECEF,
    Array,
    Frame,
    Geocentric,
    Poses,
    Projected,
    Rx,
    Ry,
    Rz,
    S,
    Tangent,
    ned,
    turn,
    up_axes,
)

from insgnss.geodesy.projection import MapProjection
from insgnss.navigation.orient.frame import in_frame
from insgnss.records import ExteriorOrientation, FramedOrientation

FOCAL_PX, SIZE_PX, CENTRE_PX = 5607.0, np.array([5120.0, 3840.0]), np.array([2590.4, 1971.9])
ORIGIN = (6.54, 46.57, 412.5)  # longitude, latitude, ellipsoidal height
T = np.diag([-1.0, -1.0, 1.0])
B = Rx(-0.657) @ Ry(0.574) @ Rz(-0.513)
LEVER_C = np.array([0.462, -0.001, -0.065])  # camera to antenna, in the camera's axes
UNDULATION_M = 49.63
NAMES = ["8001.tif", "8002.tif", "8003.tif", "8004.tif"]
ROLL, PITCH, YAW = (
    np.array([3.0, -4.1, 1.2, -2.2]),
    np.array([-2.0, 3.3, -5.0, 4.4]),
    np.array([47.0, 227.6, 136.2, -38.7]),
)
CAMERAS = np.array(
    [
        [2391.0, 1806.0, 252.0],
        [2412.0, 1793.0, 249.5],
        [2406.0, 1811.0, 246.0],
        [2395.0, 1790.0, 254.3],
    ]
)
POINTS = np.array(
    [
        [2385.0, 1785.0, 112.3],
        [2400.0, 1782.5, 104.0],
        [2418.0, 1788.0, 109.1],
        [2380.0, 1801.0, 99.2],
        [2402.0, 1799.0, 117.8],
        [2421.0, 1803.5, 101.5],
        [2388.0, 1816.0, 106.6],
        [2404.5, 1819.0, 110.2],
        [2414.0, 1814.0, 97.4],
    ]
)
PLANE = Tangent(*ORIGIN)
FRAMES: dict[str, Frame] = {
    "tangent plane": PLANE,
    "geographic": Frame(),
    "geocentric": Geocentric(),
    **{code: Projected(code) for code in ("EPSG:2056", "EPSG:32632", "EPSG:3044")},
}


def true_poses() -> Poses:
    """The cameras in ECEF."""
    place = PLANE.geographic(CAMERAS)
    R_enu_c = T @ B @ turn(ned(ROLL, PITCH, YAW)) @ S
    return Poses(
        NAMES,
        np.column_stack(TO_ECEF.transform(*place.T)),
        up_axes(place[:, 0], place[:, 1]) @ turn(R_enu_c),
    )


def project(poses: Poses, points: Array) -> tuple[Array, Array]:
    """Pixels (n, m, 2) and depths (n, m), m, of points (m, 3) in ECEF."""
    assert poses.axes is not None
    x = (points[None] - poses.centre[:, None]) @ poses.axes
    return FOCAL_PX * x[..., :2] / x[..., 2:] + CENTRE_PX, x[..., 2]


TRUTH = true_poses()
GROUND = PLANE.ecef(POINTS)
PIXELS, _ = project(TRUTH, GROUND)
SEEN = ((PIXELS > 0.0) & (PIXELS < SIZE_PX)).all(axis=2)
ANTENNA = TRUTH.centre + TRUTH.axes @ LEVER_C


def residuals(poses: Poses) -> Array:
    """Pixels (k,) by which the visible points miss their places; infinite behind the camera.
    Attitude and images not told are the true.
    """
    row = [NAMES.index(name) for name in poses.names]
    axes = TRUTH.axes[row] if poses.axes is None else poses.axes
    pixels, depth = project(Poses(poses.names, poses.centre, axes), GROUND)
    off = np.where(depth > 0.0, np.linalg.norm(pixels - PIXELS[row], axis=2), np.inf)
    return off[SEEN[row]]


def master() -> ExteriorOrientation:
    """The record of the scene, with full covariances of centimetres and hundredths of a degree."""
    C_m = Frame().local(PLANE.origin)[0]
    A = np.random.default_rng(5).normal(size=(6, 6)) * np.array([0.02] * 3 + [5e-4] * 3)[:, None]
    n = len(NAMES)
    cov = np.broadcast_to(A @ A.T, (n, 6, 6))
    return ExteriorOrientation(
        images=tuple(NAMES),
        time=199_800.0 + 1.3 * np.arange(n),
        gps_week=2008,
        origin=np.array([*np.radians([ORIGIN[1], ORIGIN[0]]), ORIGIN[2]]),
        position_m=CAMERAS,
        C_mc=C_m.T @ TRUTH.axes,
        cov=cov,
        cross=0.7 * cov[1:],
        boresight=B,
        camera_from_body=T,
        history=("smoothed",),
    )


def framed(where: str) -> FramedOrientation:
    """The scene in a kind of frame, or in a projected CRS by its code."""
    if where.startswith("EPSG:"):
        return in_frame(master(), "projected", MapProjection(where))
    return in_frame(master(), where)
