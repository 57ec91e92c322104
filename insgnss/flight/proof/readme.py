"""The README of a proof: its files, what to do, what to see, and what each mistake looks like."""

import re
import textwrap

import numpy as np

from ...geodesy.projection import MapProjection
from ...io.formats.exports import Export
from ..exporting.export import Exported
from .costs import mistakes, of_the_grid
from .scene import Scene

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
        _expected(scene, projection, ground_m),
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
    return "\n\n".join(_wrapped(paragraph) for paragraph in parts if paragraph) + "\n"


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


def _expected(scene: Scene, projection: MapProjection | None, ground_m: float | None) -> str:
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


def _wrapped(text: str) -> str:
    """Lines of `README_WIDTH`; what follows a number or a length stays behind it."""
    lines = []
    for line in text.splitlines():
        bullet = re.match(r"\d+\. | *\S+ px  ", line)
        indent = " " * len(bullet[0]) if bullet else ""
        lines.append(
            textwrap.fill(line, README_WIDTH, break_on_hyphens=False, subsequent_indent=indent)
        )
    return "\n".join(lines)
