"""The README of a proof: what is there, what to do, what to see, and what each mistake looks like."""

import re
import textwrap

import numpy as np

from ..exporting.export import Exported
from ..formats._exports import Export
from ..geodesy.projection import MapProjection
from .costs import mistakes, of_the_grid
from .scene import Scene

WIDTH = 100
WHERE = {
    "metashape": "Metashape: import images/, the reference csv, the points as markers and their pixels; align with the camera fixed to "
    "camera.txt; the Reference pane shows errors of cameras (m, deg) and of markers (m, px).",
    "pix4d": "Pix4D: the geolocation file in the image properties, points.csv as ground control with the marks of pixels.csv; the quality "
    "report shows the errors of control points and the differences of orientations.",
    "opf": "Pix4D: open project.opf; the cameras must stand over the points of points.csv, as in pixels.csv.",
    "odm": "OpenDroneMap: geo.txt beside images/, points.csv and pixels.csv as gcp_list.txt; only positions are taken from it.",
    "opensfm": "OpenSfM: both json files beside images/; after `opensfm reconstruct` the report shows GPS errors; compare the rotations.",
    "micmac": "MicMac: `mm3d OriConvert OriTxtInFile` (or the directory Ori-Nav as it is), then `mm3d ReprojImg` or `mm3d GCPCtrl` with "
    "points.csv and pixels.csv.",
    "realitycapture": "RealityCapture, RealityScan: import images/ and the flight log, the points as control points with their "
    "marks; the control point report shows pixels.",
    "bentley": "ContextCapture, iTwin Capture: import the block; the 3D view shows cameras over the points, "
    "the survey report their pixels.",
    "inpho": "Inpho: EO import into a project with this camera; Match-AT or the stereo view over the points shows pixels.",
    "colmap": "COLMAP: File, import model, or the database; `colmap point_triangulator` with the known poses, or project points.csv.",
    "tum": "evo: `evo_traj tum --plot`; a pose graph shows the axes of the cameras.",
    "g2o": "g2o_viewer, GTSAM: the chi-square of the graph is zero as it stands.",
    "geojson": "A GIS: the points of the images stand over points_geographic.csv.",
    "kml": "Google Earth: fly to an image's placemark; its view is that of the picture.",
    "geopackage": "A GIS: the points of the images stand over points.csv, in the CRS that the file names.",
    "image_tags": "Load the tagged copies instead of images/; the program shows position and angles of each image.",
    "rtklib_pos": "RTKPLOT: the antenna's positions, 0.46 m in front of the cameras.",
}


def readme(
    scene: Scene, name: str, form: Export, done: Exported, frame: str, projection: MapProjection | None, ground_m: float | None
) -> str:
    """Text of README.txt; frame in words."""
    images, points = len(scene.eo.images), len(scene.names)
    least = int(scene.seen.sum(axis=0).min())
    parts = [
        f"Proof of the format {name}: {form.what}",
        f"{images} images of a synthetic field, {points} marked points, each in {least} images at least; a tool that takes "
        f"{done.file.name} as it is meant, with this camera, finds the points where their crosses are.",
        _files(name, done),
        "What to do",
        "1. New project with images/, camera of camera.txt, all of it fixed, no distortion.\n"
        f"2. Import {done.file.name} as data_specs/{form.writer.partition(':')[0].lstrip('_')}.md says, in the frame: {frame}.\n"
        "3. Import points.csv as ground control in the same frame, pixels.csv as their marks (or set the marks on the crosses).\n"
        "4. Look at the residuals of the points with the orientations as imported, before anything is adjusted.",
        _where(name),
        "What to see",
        _expected(scene, projection, ground_m),
        "What mistakes look like (median residual of the points in this scene before any adjustment)",
        "\n".join(_line(what, px) for what, px in mistakes(scene, projection)),
        "A tool that adjusts orientations hides part of these: then look at the differences between imported and adjusted angles and "
        "positions. Latitude and longitude exchanged put the block on another continent.",
        *(f"Note: {note}" for note in done.notes),
    ]
    return "\n\n".join(_wrapped(part) for part in parts if part) + "\n"


def _files(name: str, done: Exported) -> str:
    lines = [
        f"{done.file.name}: the exterior orientation in the format {name}",
        "images/: the pictures; the middle of a cross is the point",
        "points.csv: the points in the frame of the export; points_geographic.csv: the same in WGS84",
        "pixels.csv: where the points are in the images",
        "camera.txt: size, focal length, principal point",
    ]
    return "\n".join(lines)


def _where(name: str) -> str:
    found = [key for key in WHERE if name.startswith(key)]
    return WHERE[max(found, key=len)] if found else ""


def _expected(scene: Scene, projection: MapProjection | None, ground_m: float | None) -> str:
    near = "Residuals of less than 0.01 px, which is what the printed digits leave."
    if projection is None:
        return near
    px = of_the_grid(scene, projection, ground_m)
    lat, lon, h = scene.plane.geodetic_from_position(scene.eo.position_m)
    G = projection.axes(lat, lon, h)
    gamma = np.degrees(np.arctan2(G[:, 1, 0], G[:, 0, 0])).mean()
    scale = float(projection.ground_scale(lat, lon, scene.geodetic[:, 2].mean() + 0.0 * lat).mean())
    return (
        f"{near} A tool that takes the coordinates of {projection.name} for Cartesian ones finds up to {px:.2f} px in the right file: "
        f"lengths of the plan are {scale:.6f} of those on the ground. The convergence of the meridian is {gamma:.4f} deg here."
    )


def _line(what: str, px: float) -> str:
    return f"{'behind' if np.isinf(px) else f'{px:.1f}':>8} px  {what}"


def _wrapped(text: str) -> str:
    """Lines of `WIDTH`; what follows a number or a length stays behind it."""
    lines = []
    for line in text.splitlines():
        head = re.match(r"\d+\. | *\S+ px  ", line)
        indent = " " * len(head[0]) if head else ""
        lines.append(textwrap.fill(line, WIDTH, break_on_hyphens=False, subsequent_indent=indent))
    return "\n".join(lines)
