"""What the usual mistakes would look like in this scene.

The figure is the median of the residuals, in pixels, of the points in the images.

A mistake puts a camera elsewhere or turns it, C_mc to W C_mc or C_mc W, and the points are
projected again. They are no more than signs to go by: a tool that adjusts the cameras distributes
residuals among orientations, points and focal length.
"""

from collections.abc import Iterator

import numpy as np

from ...geodesy.projection import MapProjection
from ...geodesy.rotation import (
    CV_RUB,
    opk_from_rotation,
    rotation_from_opk,
    rotation_from_pok,
    rotation_from_ypr,
    ypr_from_rotation,
)
from ...navigation.orient.frame import in_frame
from ...records import Array
from .scene import CAMERA_FROM_BODY, Scene, project, tangent_axes

TYPICAL_GEOID_M = 50.0  # height of the geoid (m) in central Europe
# from the camera to the antenna (m): that of `write`, rounded to 1 cm
LEVER_CM_C = np.array([0.46, 0.0, -0.07])
QUARTER_TURN = np.array([[0.0, -1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 1.0]])


def mistakes(scene: Scene, projection: MapProjection | None) -> Iterator[tuple[str, float]]:
    """Mistakes in words, and the residual that each makes, px.

    Infinite where most points would lie behind the camera.
    """
    C, centre = scene.eo.C_mc, scene.eo.position_m
    C_mE = tangent_axes(scene)
    R = C_mE.swapaxes(1, 2) @ C @ CV_RUB
    opk, ypr = opk_from_rotation(R), ypr_from_rotation(R)
    B = CAMERA_FROM_BODY @ scene.eo.boresight @ CAMERA_FROM_BODY.T

    def of(R_wrong: Array) -> Array:
        return np.asarray(C_mE @ R_wrong @ CV_RUB)

    turned = {
        (
            "the heading of the aircraft is used as yaw of the image (90 deg off), or the image "
            "is shown rotated"
        ): C @ QUARTER_TURN,
        "omega and phi (pitch and roll) are exchanged": of(rotation_from_opk(opk[:, [1, 0, 2]])),
        "phi is turned before omega": of(rotation_from_pok(opk[:, [1, 0, 2]])),
        "yaw is counted the other way round": of(rotation_from_ypr(ypr * [-1.0, 1.0, 1.0])),
        "pitch has the other sign": of(rotation_from_ypr(ypr * [1.0, -1.0, 1.0])),
        "the matrix is transposed": of(R.swapaxes(1, 2)),
        "the bore-sight is left out": C @ B,
        "the bore-sight is applied twice": C @ B.T,
        "axes of the tangent plane and those at the image are exchanged": C_mE.swapaxes(1, 2) @ C,
    }
    if projection is not None:
        lat, lon, h = scene.plane.geodetic_from_position(centre)
        turned["grid north and true north are exchanged"] = (
            C_mE @ projection.axes(lat, lon, h) @ C_mE.swapaxes(1, 2) @ C
        )
    yield from ((mistake, residual(scene, W, centre)) for mistake, W in turned.items())
    yield "the lever arm is applied twice", residual(scene, C, centre - C @ LEVER_CM_C)
    yield (
        f"heights above the geoid are taken as ellipsoidal heights ({TYPICAL_GEOID_M:.0f} m)",
        residual(scene, C, centre - [0.0, 0.0, TYPICAL_GEOID_M]),
    )
    middle = centre.mean(axis=0)
    yield (
        "easting and northing of the cameras are exchanged (about their middle)",
        residual(scene, C, middle + (centre - middle)[:, [1, 0, 2]]),
    )
    yield (
        "pixel coordinates count from the centre of the first pixel, not from its corner",
        float(np.hypot(0.5, 0.5)),
    )


def residual(scene: Scene, C_mc: Array, centre: Array) -> float:
    """Median residual, px, of the points in the images, of cameras that stand otherwise."""
    distance = np.linalg.norm(project(C_mc, centre, scene.points) - scene.pixels, axis=2)[
        scene.visible
    ]
    return float(np.median(np.where(np.isnan(distance), np.inf, distance)))


def of_the_grid(scene: Scene, projection: MapProjection, ground_m: float | None) -> float:
    """Return the greatest residual, px, that a tool finds in the right file.

    It arises because the tool takes the coordinates of the grid for Cartesian ones.
    """
    eo = in_frame(scene.eo, "projected", projection, ground_m)
    residual = (
        project(eo.C_fc, eo.coordinates, projection.forward(*scene.geodetic.T)) - scene.pixels
    )
    return float(np.linalg.norm(residual, axis=2)[scene.visible].max())
