"""A scene for the exports to bundle adjustments, and what an independent reader needs to re-project
its points.

Nothing here shares code with the writers: frames by pyproj and cross products, rotations by scipy.
An attitude read from a file comes as the matrix of the camera (x right, y down, z viewing
direction) to axes, and the axes as a matrix to ECEF.
"""

import numpy as np
from pyproj import CRS, Transformer
from scipy.spatial.transform import Rotation

from insgnss.geodesy.projection import MapProjection
from insgnss.navigation.orient.frame import in_frame
from insgnss.records import ExteriorOrientation, FramedOrientation

Array = np.ndarray

LAT0, LON0, H0 = 46.57, 6.54, 412.5
ORIGIN = np.array([np.radians(LAT0), np.radians(LON0), H0])
S = np.array([[0.0, 1, 0], [1, 0, 0], [0, 0, -1]])
D, T = np.diag([1.0, -1, -1]), np.diag([-1.0, -1, 1])
FOCAL_PX, HALF_PX = 5607.0, np.array([2560.0, 1920.0])
PLANES = dict.fromkeys(("tangent plane", "geographic", "geocentric")) | {
    code: code for code in ("EPSG:2056", "EPSG:32632", "EPSG:3413")
}


def boresight() -> Array:
    """Table 2 of paper 000, made orthonormal by SVD (formats.md 0.2)."""
    U, _, Vt = np.linalg.svd(
        [
            [0.999909, 0.008952, 0.010018],
            [-0.009067, 0.999893, 0.011465],
            [-0.009914, -0.011555, 0.999884],
        ]
    )
    return U @ Vt


def camera_of(roll: Array, pitch: Array, yaw: Array) -> Array:
    """formats.md 0: R_c^enu of attitudes in degrees and the mounting of paper 000."""
    R_nb = Rotation.from_euler("ZYX", np.column_stack([yaw, pitch, roll]), degrees=True).as_matrix()
    return S @ R_nb @ boresight().T @ T


def exterior(C_mc: Array, position: Array, seed: int = 1) -> ExteriorOrientation:
    """Images 8001.tif, ... with random full covariances of centimetres and tenths of a degree."""
    n = len(C_mc)
    A = (
        np.random.default_rng(seed).normal(size=(n, 6, 6))
        * np.array([0.02] * 3 + [1e-3] * 3)[:, None]
    )
    cov = A @ np.swapaxes(A, 1, 2)
    names = tuple(f"{8001 + k}.tif" for k in range(n))
    time = 199_800.0 + 1.3 * np.arange(n)
    return ExteriorOrientation(
        names,
        time,
        2008,
        ORIGIN,
        position,
        C_mc,
        cov,
        0.7 * cov[1:],
        boresight(),
        T,
        ("smoothed, 30 states",),
    )


def worked(kind: str = "geographic") -> FramedOrientation:
    """formats.md 0.2 on the vertical of the origin, where tangent plane and geographic frame have
    the same axes.
    """
    return framed(
        exterior(
            camera_of(np.array([3.0]), np.array([-2.0]), np.array([47.0])),
            np.array([[0.0, 0.0, 217.5]]),
        ),
        kind,
    )


def block(n: int = 3, seed: int = 3) -> ExteriorOrientation:
    """Exposures of a flight 2 to 3 km from the origin."""
    rng = np.random.default_rng(seed)
    attitude = (rng.uniform(-8, 8, n), rng.uniform(-6, 6, n), rng.uniform(-180, 180, n))
    position = np.column_stack(
        [
            2400 + rng.uniform(-60, 60, n),
            1800 + rng.uniform(-60, 60, n),
            220 + rng.uniform(-5, 5, n),
        ]
    )
    return exterior(camera_of(*attitude), position)


def framed(eo: ExteriorOrientation, where: str) -> FramedOrientation:
    """`eo` in a frame of PLANES."""
    code = PLANES[where]
    return in_frame(eo, where) if code is None else in_frame(eo, "projected", MapProjection(code))


def enu_axes(lat_deg: float, lon_deg: float) -> Array:
    """Columns east, north, up in ECEF by cross products."""
    lat, lon = np.radians([lat_deg, lon_deg])
    up = np.array([np.cos(lat) * np.cos(lon), np.cos(lat) * np.sin(lon), np.sin(lat)])
    east = np.cross([0.0, 0, 1], up) / np.hypot(up[0], up[1])
    return np.column_stack([east, np.cross(up, east), up])


def to_ecef(lon: float, lat: float, h: float) -> Array:
    return np.array(
        Transformer.from_crs("EPSG:4979", "EPSG:4978", always_xy=True).transform(lon, lat, h)
    )


class Place:
    """Where coordinates of a frame are, by pyproj: `ecef` (3,), `axes` of the frame and
    `north_axes` east, north, up, columns in ECEF.
    """

    def __init__(self, where: str, x: Array) -> None:
        lon, lat, h = self._geodetic(where, x)
        self.ecef, self.north_axes = to_ecef(lon, lat, h), enu_axes(lat, lon)
        if where == "tangent plane":
            self.axes = self.north_axes = enu_axes(LAT0, LON0)
        elif where == "geocentric":
            self.axes = np.eye(3)
        elif where == "geographic":
            self.axes = self.north_axes
        else:
            _, horizontal = self._crs(where)
            (E1, N1, _), (E0, N0, _) = (
                horizontal.transform(lon, lat + 1e-5, h),
                horizontal.transform(lon, lat - 1e-5, h),
            )
            azimuth = np.arctan2(
                E1 - E0, N1 - N0
            )  # of true north in the grid: minus the convergence
            self.axes = self.north_axes @ Rotation.from_euler("z", -azimuth).as_matrix().T

    @staticmethod
    def _crs(where: str) -> tuple[Transformer, Transformer]:
        crs = CRS(where).to_3d()
        return (
            Transformer.from_crs(crs, "EPSG:4979", always_xy=True),
            Transformer.from_crs("EPSG:4979", crs, always_xy=True),
        )

    def _geodetic(self, where: str, x: Array) -> tuple[float, float, float]:
        if where == "geographic":
            return float(x[0]), float(x[1]), float(x[2])
        if where == "geocentric":
            to_geodetic = Transformer.from_crs("EPSG:4978", "EPSG:4979", always_xy=True)
            return to_geodetic.transform(*x)  # type: ignore[no-any-return]
        if where == "tangent plane":
            return self._geodetic("geocentric", to_ecef(LON0, LAT0, H0) + enu_axes(LAT0, LON0) @ x)
        inverse, _ = self._crs(where)
        z = x[2]
        for _ in range(3):  # heights stay those above the ellipsoid of WGS84
            lon, lat, h = inverse.transform(x[0], x[1], z)
            z += x[2] - h
        return lon, lat, h


def pixels(ecef: Array, C_ec: Array, points: Array) -> Array:
    """Image coordinates (k, 2), px, of points (k, 3) in ECEF."""
    v = (points - ecef) @ C_ec
    assert (v[:, 2] > 0).all()
    return FOCAL_PX * v[:, :2] / v[:, 2:]


def assert_reprojects(
    eo: ExteriorOrientation, read: list[tuple[Place, Array, bool]], limit_px: float = 0.02
) -> None:
    """Points at the corners and the middle of every image, 120 m below, project as in the master.

    read : of every image its place, its attitude as a matrix to axes, and whether these are east,
        north, up.
    """
    assert len(read) == len(eo.images)
    A = enu_axes(LAT0, LON0)
    corner = np.array([[0, 0], [1, 1], [1, -1], [-1, 1], [-1, -1]]) * HALF_PX
    for k, (place, C, north) in enumerate(read):
        centre, C_ec = to_ecef(LON0, LAT0, H0) + A @ eo.position_m[k], A @ eo.C_mc[k]
        points = centre + 120.0 * np.column_stack([corner / FOCAL_PX, np.ones(5)]) @ C_ec.T
        got = pixels(place.ecef, (place.north_axes if north else place.axes) @ C, points)
        assert np.abs(got - corner).max() < limit_px
