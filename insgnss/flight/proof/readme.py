"""The README of a proof: its files, what to do, what to see, and what each mistake looks like.

Of each usual mistake it says what it would look like in this scene: the median of the residuals, in
pixels, of the points in the images.

A mistake puts a camera elsewhere or turns it, C_mc to W C_mc or C_mc W, and the points are
projected again. They are no more than signs to go by: a tool that adjusts the cameras distributes
residuals among orientations, points and focal length.
"""

import re
import textwrap
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
from ...io.formats.exports import Export
from ...navigation.orient.frame import in_frame
from ...records import Array
from ..exporting.export import Exported
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


README_WIDTH = 100  # characters of a line
LOOK = {
    "metashape": (
        "Metashape: align the images with the camera fixed; the Reference pane then shows the "
        "errors of cameras (m, deg) and markers (m, px)."
    ),
    "pix4d": (
        "Pix4D: the quality report shows errors of control points and changes of orientations."
    ),
    "opf": "Pix4D: open project.opf; the points of points.csv fall on the pixels of pixels.csv.",
    "odm": (
        "OpenDroneMap: put geo.txt beside the images and the points into gcp_list.txt; it uses "
        "positions, no angles."
    ),
    "opensfm": (
        "OpenSfM: put both json files beside the images; the report shows the errors of "
        "positions, reconstruction.json the rotations."
    ),
    "micmac": (
        "MicMac: mm3d OriConvert OriTxtInFile makes the directory Ori-Nav, GCPConvert the points, "
        "GCPCtrl the residuals."
    ),
    "realitycapture": (
        "RealityCapture, RealityScan: the control point report shows residuals in pixels."
    ),
    "bentley": "ContextCapture, iTwin Capture: the survey report shows residuals in pixels.",
    "inpho": (
        "Inpho: the stereo view of a point, or Match-AT with fixed poses, shows residuals in "
        "pixels."
    ),
    "colmap": (
        "COLMAP: import the model, or triangulate with fixed poses (point_triangulator), subtract "
        "the shift in images.txt from the points, and project them."
    ),
}
SEE = {
    "tum": (
        "evo_traj tum with --plot shows the poses and the camera axes: x image right, y image "
        "down, z viewing direction."
    ),
    "g2o": "In g2o_viewer, or with GTSAM's readG2o, the error of the graph is zero.",
    "relative": (
        "The pose of each second image follows from that of the first one, and the points fall on"
        " their pixels in both."
    ),
    "geojson": "In a GIS the images lie over points_geographic.csv.",
    "kml": "In Google Earth, fly to an image's placemark: the view is that of the image.",
    "geopackage": ("In a GIS the images lie over points.csv, in the CRS of the file."),
    "image_tags": (
        "A program that reads image tags shows position and angles of the tagged copies; load "
        "these copies, not images/, then use points.csv and pixels.csv as with any other "
        "orientation."
    ),
    "rtklib_pos": (
        "RTKPLOT shows the antenna's positions, 0.46 m from the cameras towards the right side of"
        " the images."
    ),
    "eo_json": "This file is the master from which `insgnss export` makes every other format.",
}
TO_DO = """\
1. New project with images/ and the camera of camera.txt, all of it fixed, without distortion.
2. Import {file} as data_specs/{spec}.md says; its frame: {frame}.
3. Import points.csv as ground control in the same frame, pixels.csv as its marks (or set the marks\
 on the crosses).
4. Look at the residuals of the points with the orientations as imported, before anything is\
 adjusted."""
ADJUSTED = (
    "A tool that adjusts orientations hides part of these: then look at the differences between"
    " imported and adjusted angles and positions. Latitude and longitude exchanged put the block on"
    " another continent."
)


def readme(
    scene: Scene,
    name: str,
    export_format: Export,
    exported: Exported,
    frame: str,
    projection: MapProjection | None,
    ground_m: float | None,
) -> str:
    """Text of README.txt; frame in words."""
    file = exported.file.name
    fewest_images = int(scene.visible.sum(axis=0).min())
    parts = [
        f"Proof of the format {name}: {export_format.what}",
        (
            f"{len(scene.eo.images)} images of a synthetic field, {len(scene.names)} marked "
            f"points, each in {fewest_images} images at least. A tool that reads {file} "
            "correctly, with this camera, projects the points onto their crosses."
        ),
        _files(name, file),
        "What to do",
        _text_of_format(SEE, name) or TO_DO.format(file=file, spec=export_format.page, frame=frame),
        _text_of_format(LOOK, name),
        "What to see",
        _expected_pixels(scene, projection, ground_m),
        (
            "What mistakes look like (median residual of the points in this scene, before any"
            " adjustment)"
        ),
        "\n".join(
            _line(mistake, residual_px) for mistake, residual_px in mistakes(scene, projection)
        ),
        ADJUSTED,
        *(f"Note: {note}" for note in exported.notes),
    ]
    return "\n\n".join(_wrap_lines(paragraph) for paragraph in parts if paragraph) + "\n"


def _text_of_format(names: dict[str, str], name: str) -> str:
    """What belongs to the key that the name begins with, or nothing."""
    return next((text for key, text in names.items() if name.startswith(key)), "")


def _files(name: str, file: str) -> str:
    lines = (
        f"{file}: the exterior orientation in the format {name}",
        "images/: synthetic images; the centre of each cross is a point of points.csv",
        (
            "points.csv: the points in the frame of the export; points_geographic.csv: the same in"
            " WGS84"
        ),
        "pixels.csv: where the points are in the images",
        "camera.txt: size, focal length, principal point",
    )
    return "\n".join(lines)


def _expected_pixels(scene: Scene, projection: MapProjection | None, ground_m: float | None) -> str:
    expectation = "Residuals are below 0.01 px, the rounding of the printed digits."
    if projection is None:
        return expectation
    px = of_the_grid(scene, projection, ground_m)
    lat, lon, h = scene.plane.geodetic_from_position(scene.eo.position_m)
    G = projection.axes(lat, lon, h)
    gamma = np.degrees(np.arctan2(G[:, 1, 0], G[:, 0, 0])).mean()
    ground = np.full(lat.shape, scene.geodetic[:, 2].mean())
    scale = float(projection.ground_scale(lat, lon, ground).mean())
    return (
        f"{expectation} A tool that treats the coordinates of {projection.name} as Cartesian "
        f"finds up to {px:.2f} px in the right file, because lengths in the projection are "
        f"{scale:.6f} of those on the ground. The meridian convergence is {gamma:.4f} deg here."
    )


def _line(mistake: str, px: float) -> str:
    return f"{'behind' if np.isinf(px) else f'{px:.1f}':>8} px  {mistake}"


def _wrap_lines(text: str) -> str:
    """Lines of `README_WIDTH`; what follows a number or a length stays behind it."""
    lines = []
    for line in text.splitlines():
        bullet = re.match(r"\d+\. | *\S+ px  ", line)
        indent = " " * len(bullet[0]) if bullet else ""
        lines.append(
            textwrap.fill(line, README_WIDTH, break_on_hyphens=False, subsequent_indent=indent)
        )
    return "\n".join(lines)
