r"""Four images of a hilly field, and marked points on it, all of it exact in a tangent plane m.

A camera of focal length f and principal point c sees the point X at

    u = f (x / z, y / z) + c,    (x, y, z) = C_mc^T (X - X_0)                                  (P.1)

in pixels from the outer corner of the first one. Its attitude is C_mc = S C_nb B^T T^T of an
aircraft with roll and pitch of a few degrees and a bore-sight B of some tenths of a degree, so that
every rotation of the chain is needed to get the points right. The ground is

    U = 9 sin(E / 31 m) + 6 cos(N / 23 m)                                                      (P.2)

The field lies 6.5 km from the origin of the tangent plane, so that its axes are turned by 4 minutes
of arc against those in the field.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ...base.errors import UsageError
from ...geodesy.frames import TangentPlane
from ...geodesy.projection import MapProjection
from ...geodesy.rotation import NED_ENU, rotation_from_opk, rotation_from_rpy
from ...records import Array, ExteriorOrientation

FOCAL_PX, WIDTH_PX, HEIGHT_PX = 1400.0, 1280, 960  # of a usual lens, and small images (chosen)
# principal point, the middle of the image
SCENE_CENTRE_PX = np.array([0.5 * WIDTH_PX, 0.5 * HEIGHT_PX])
PIXEL_UM = 5.5  # size of a pixel (um) for formats in mm (chosen)
SITE_DEG = (46.57, 6.54)  # latitude and longitude (deg), in Switzerland (chosen)
GROUND_M = 518.0  # of the origin, above the ellipsoid
# east and north of the origin: 6.5 km away, so that axes differ
FIELD_M = np.array([5200.0, 3900.0])
# of the exposures: any week and time of it
GPS_WEEK, FIRST_S, EXPOSURE_INTERVAL_S = 2008, 199_800.0, 1.9
SIGMA_M, SIGMA_RAD = (0.02, 0.02, 0.04), (8e-4, 8e-4, 2e-3)  # of the poses, as of an RTK drone
CORRELATION = 0.6  # of neighbours

# T of paper 000, and a bore-sight of half a degree about each axis: left out, it moves every point
# by tens of pixels
CAMERA_FROM_BODY: Array = np.diag([-1.0, -1.0, 1.0])
SCENE_BORESIGHT: Array = rotation_from_opk(np.radians([-0.657, 0.574, -0.513]))
# roll, pitch, yaw
ATTITUDES_DEG = (5.9, -6.2, 71.0), (-6.8, 4.6, 69.9), (4.7, 5.9, 71.8), (-5.4, -4.3, -14.5)
# from the field's middle: three images of a line and one that crosses it, 120 m above
CENTRES_M = ((-18.0, -5.5, 121.0), (1.5, 0.5, 119.0), (20.0, 7.5, 122.5), (3.0, -2.0, 126.0))
# east and north of the field's middle: within what several images see
POINTS_M = (
    (-28.0, -3.0),
    (-29.0, 14.0),
    (-20.0, -27.0),
    (-6.0, 3.0),
    (2.0, 24.0),
    (8.0, -24.0),
    (19.0, 4.0),
    (30.0, 29.0),
    (37.0, -8.0),
)


@dataclass(frozen=True, eq=False)
class Scene:
    """eo : the images.

    Parameters
    ----------
    points : (m, 3) m, in the tangent plane.
    pixels : (n, m, 2).
    visible : (n, m), whether they lie in the image.
    """

    eo: ExteriorOrientation
    names: tuple[str, ...]
    points: Array
    pixels: Array
    visible: NDArray[np.bool_]

    @property
    def plane(self) -> TangentPlane:
        """The tangent plane."""
        return TangentPlane(*self.eo.origin)

    @property
    def geodetic(self) -> Array:
        """(m, 3) latitude, longitude rad, height m above the ellipsoid, of the points."""
        return np.column_stack(self.plane.geodetic_from_position(self.points))


def terrain(east: Array, north: Array) -> Array:
    """Height of the ground (P.2), m, in the tangent plane, from coordinates in the field."""
    return np.asarray(9.0 * np.sin(east / 31.0) + 6.0 * np.cos(north / 23.0))


def project(C_mc: Array, centre: Array, points: Array) -> Array:
    """Pixels (n, m, 2) of points (m, 3) (P.1), NaN behind the camera."""
    x = (points[None] - centre[:, None]) @ C_mc
    with np.errstate(divide="ignore", invalid="ignore"):
        pixels = FOCAL_PX * x[..., :2] / x[..., 2:] + SCENE_CENTRE_PX
    return np.asarray(np.where(x[..., 2:] > 0.0, pixels, np.nan))


def make_scene(projection: MapProjection | None = None) -> Scene:
    """Return the scene at its usual site, or within a CRS's area of use that ends before it."""
    lat, lon = (np.radians(SITE_DEG) if projection is None else _site(projection)).tolist()
    field = np.array([*FIELD_M, 0.0])
    C_nb = rotation_from_rpy(np.radians(ATTITUDES_DEG))
    plane = TangentPlane(lat, lon, GROUND_M)
    centres = field + CENTRES_M
    C_mn = plane.C_mn(*plane.geodetic_from_position(centres)[:2])
    n = len(centres)
    cov = np.broadcast_to(np.diag(np.square([*SIGMA_M, *SIGMA_RAD])), (n, 6, 6))
    eo = ExteriorOrientation(
        images=tuple(f"{8001 + k}.tif" for k in range(n)),
        time=FIRST_S + EXPOSURE_INTERVAL_S * np.arange(float(n)),
        gps_week=GPS_WEEK,
        origin=np.array([lat, lon, GROUND_M]),
        position_m=centres,
        C_mc=C_mn @ C_nb @ SCENE_BORESIGHT.T @ CAMERA_FROM_BODY.T,
        cov=cov,
        cross=CORRELATION * cov[1:],
        boresight=SCENE_BORESIGHT,
        camera_from_body=CAMERA_FROM_BODY,
        history=("a synthetic scene that proves a format",),
    )
    plan = np.array(POINTS_M)
    points = np.column_stack([plan + FIELD_M, terrain(*plan.T)])
    pixels = project(eo.C_mc, eo.position_m, points)
    visible = np.all((pixels > 0.0) & (pixels < (WIDTH_PX, HEIGHT_PX)), axis=2)
    return Scene(eo, tuple(f"P{k + 1}" for k in range(len(points))), points, pixels, visible)


def _site(projection: MapProjection) -> Array:
    """Latitude and longitude, rad, of the scene.

    It is the usual site where the CRS reaches it, else one off the middle of the area of use.
    """
    area = projection.horizontal.area_of_use
    lat, lon = SITE_DEG
    if area is None or (area.west <= lon <= area.east and area.south <= lat <= area.north):
        return np.radians([lat, lon])
    if area.east < area.west:
        raise UsageError(
            f"proof: the area of {projection.name} crosses the date line; name another CRS"
        )
    return np.radians(
        [area.south + 0.4 * (area.north - area.south), area.west + 0.6 * (area.east - area.west)]
    )


def tangent_axes(scene: Scene) -> Array:
    """(n, 3, 3), east, north, up at the images into the tangent plane."""
    lat, lon, _ = scene.plane.geodetic_from_position(scene.eo.position_m)
    return np.asarray(scene.plane.C_mn(lat, lon) @ NED_ENU)
