"""Tables of targets, and the files of other programs.

predictions.csv     every ground point in every image, with its ellipse
image_points.csv    what was measured, as `insgnss adjust` takes it
ground_points.csv   the ground points in the axes of the orientation
target_positions.csv, target_sizes.csv    of a vehicle, in the place of ground_points.csv
rejected.csv        what was not measured, each with its reason
markers.xml         Metashape
pix4d_marks.csv     PIX4Dmatic
gcp_list.txt        OpenDroneMap
targets.json        everything that was found
targets.html        the contact sheet

Apparent sizes of a vehicle's target of known diameter follow from its matched deformation. The
matching takes metres along the axes of the signal to pixels by T. The diameter of a disc that
is parallel to the image lies along G e in it, with e level and across the viewing axis and G the
predicted derivative of pixels by east and north; the disc's ellipse is L / |T^-1 t| long in the
direction t of G e. Without distortion it would be longer by (f / q_3) / |G e|, q_3 the depth:

    size = L (f / q_3) / (|G e| |T^-1 t|)                                                    (GT.7)

Its standard deviation is that of the deformation (T = M^-1 T_0) and that of both ends by (GT.4).
"""

import re
from collections.abc import Iterator, Sequence
from pathlib import Path

import numpy as np

from ...base.errors import InputError
from ...geodesy.frames import TangentPlane
from ...io.formats.blocks.gcp_list import write_gcp_list
from ...io.formats.blocks.ground_points import GroundAxes, GroundTable, write_ground_points
from ...io.formats.blocks.image_points import PIXEL_ORIGIN, ImagePoints, write_image_points
from ...io.formats.markers.metashape_markers import write_metashape_markers
from ...io.formats.markers.pix4d_marks import write_pix4d_marks
from ...io.formats.orientation.exported import quoted_names
from ...io.formats.text.columns import write_table
from ...io.formats.vehicle.target_positions import TargetPositions, write_target_positions
from ...io.formats.vehicle.target_sizes import TargetSizes, write_target_sizes
from ...records.block import Array, ImageObservations
from ..targets.prediction import VISIBILITY
from .inputs import TargetInputs
from .windows import Window, accepted_windows

LEVEL_SINE = 1e-6
"""Of the sine of the tilt below which every diameter is parallel to the image."""


def target_sizes(inputs: TargetInputs, windows: Sequence[Window]) -> TargetSizes:
    """Return the apparent sizes of a target in the photographs in which it was measured.

    Parameters
    ----------
    inputs : TargetInputs
        The flight and the vehicle.
    windows : sequence of Window
        All windows.

    Returns
    -------
    TargetSizes
        One an accepted window (GT.7).
    """
    predictions, length = inputs.predictions, inputs.request.target.size_m
    images, points, size, sigma = [], [], [], []
    for window, match in accepted_windows(windows):
        if match.M_cov is None:
            continue
        i, p = int(predictions.image[window.row]), int(predictions.point[window.row])
        axis = inputs.eo.C_mc[i][:, 2]
        depth = float(axis @ (inputs.ground.position_m[p] - inputs.eo.position_m[i]))
        along = predictions.by_point[window.row] @ _across(axis)
        slope = float(np.linalg.norm(along))
        t = along / slope
        inverse = np.linalg.inv(match.to_pixel)
        w = inverse @ t
        ratio = inputs.camera.of("f") / depth / slope
        diameter_px = length * ratio / float(np.linalg.norm(w))
        # T^-1 = T_0^-1 M: d(T^-1 t) = T_0^-1 dM t = T^-1 M^-1 dM t
        by_M = np.kron(w @ inverse @ np.linalg.inv(match.M), t) / float(w @ w)
        variance = diameter_px**2 * float(by_M @ match.M_cov @ by_M) + 2.0 * match.edge_px**2
        images.append(inputs.eo.images[i])
        points.append(inputs.ground.points[p])
        size.append(diameter_px)
        sigma.append(float(np.sqrt(variance)))
    return TargetSizes(tuple(images), tuple(points), np.array(size), np.array(sigma))


def _across(axis: Array) -> Array:
    """Return the level direction that is parallel to the image; east of an image that is level."""
    e = np.array([-axis[1], axis[0], 0.0])
    sine = float(np.linalg.norm(e))
    return e / sine if sine > LEVEL_SINE else np.array([1.0, 0.0, 0.0])


PREDICTIONS = "predictions.csv"
IMAGE_POINTS_FILE, GROUND_POINTS, REJECTED_FILE = (
    "image_points.csv",
    "ground_points.csv",
    "rejected.csv",
)
POSITIONS, SIZES_FILE = "target_positions.csv", "target_sizes.csv"
MEASUREMENT_COLUMNS = (
    *("image", "point", "x", "y", "sigma_x", "sigma_y", "correlation"),
    *("semi_major", "semi_minor", "direction", "visibility"),
)
GEOGRAPHIC_CRS = "EPSG:4979"


def write_predictions(inputs: TargetInputs, path: Path) -> None:
    """Write where ground points are expected, data_specs/target_predictions.md.

    Parameters
    ----------
    inputs : TargetInputs
        The flight and its ground points.
    path : Path
        The file, written whole or not at all.

    Raises
    ------
    InputError
        A name that the table cannot hold.
    UsageError
        The file cannot be written.
    """
    images = quoted_names(inputs.eo.images, ",")
    points = quoted_names(inputs.ground.points, ",", "point")
    pred = inputs.predictions
    ellipse = pred.ellipse
    rows = np.arange(len(pred)) if inputs.request.whole else np.flatnonzero(pred.visible)

    def lines() -> Iterator[str]:
        for row in rows.tolist():
            names = f"{images[pred.image[row]]},{points[pred.point[row]]}"
            u, v = pred.uv[row]
            pixel = f"{u:.3f},{v:.3f}" if np.isfinite(u) else ","
            word = VISIBILITY[pred.visibility[row]]
            if not pred.visible[row]:
                yield f"{names},{pixel},,,,,,,{word}\n"
                continue
            C, (a, b, along) = pred.cov[row], ellipse[row]
            su, sv = np.sqrt(np.diagonal(C))
            shape = f"{su:.4g},{sv:.4g},{C[0, 1] / (su * sv):.4f},{a:.4g},{b:.4g}"
            yield f"{names},{pixel},{shape},{np.degrees(along):.2f},{word}\n"

    comments = (
        f"ground points in images: {PIXEL_ORIGIN}",
        "of one standard deviation: sigma_x sigma_y, semi-axes of the ellipse, px; direction of the"
        " larger one, deg from x to y",
    )
    write_table(path, comments, MEASUREMENT_COLUMNS, lines())


def measured_points(inputs: TargetInputs, windows: Sequence[Window]) -> ImagePoints:
    """Return what stands of the measurements, as image observations.

    Parameters
    ----------
    inputs : TargetInputs
        The flight and its ground points.
    windows : sequence of Window
        All windows.

    Returns
    -------
    ImagePoints
        One observation an accepted window.
    """
    predictions, good = inputs.predictions, accepted_windows(windows)
    rows = np.array([window.row for window, _ in good], dtype=np.int64)
    uv = np.array([match.uv for _, match in good]).reshape(-1, 2)
    cov = np.array([match.cov for _, match in good]).reshape(-1, 2, 2)
    sigma = np.sqrt(np.diagonal(cov, axis1=1, axis2=2))
    images, image = np.unique(predictions.image[rows], return_inverse=True)
    points, point = np.unique(predictions.point[rows], return_inverse=True)
    return ImagePoints(
        tuple(inputs.eo.images[k] for k in images),
        tuple(inputs.ground.points[k] for k in points),
        ImageObservations(
            image.astype(np.int64),
            point.astype(np.int64),
            uv,
            sigma,
            cov[:, 0, 1] / sigma.prod(axis=1),
        ),
    )


def write_rejected(inputs: TargetInputs, windows: Sequence[Window], path: Path) -> None:
    """Write what was rejected, data_specs/target_rejections.md.

    Parameters
    ----------
    inputs : TargetInputs
        The flight and its ground points.
    windows : sequence of Window
        All windows.
    path : Path
        The file.
    """
    predictions = inputs.predictions
    images = quoted_names(inputs.eo.images, ",")
    points = quoted_names(inputs.ground.points, ",", "point")

    def lines() -> Iterator[str]:
        for w in windows:
            if w.measurement.accepted:
                continue
            image, point = images[predictions.image[w.row]], points[predictions.point[w.row]]
            u, v = predictions.uv[w.row]
            match = w.measurement.match
            pixel = "," if match is None else f"{match.uv[0]:.3f},{match.uv[1]:.3f}"
            yield f'{image},{point},{u:.3f},{v:.3f},{pixel},"{w.measurement.rejected}"\n'

    head = ("image", "point", "predicted_x", "predicted_y", "matched_x", "matched_y", "reason")
    write_table(path, (f"targets that were not measured: {PIXEL_ORIGIN}",), head, lines())


def write_measured(inputs: TargetInputs, windows: Sequence[Window], into: Path) -> list[str]:
    """Write the tables and the files of other programs.

    Parameters
    ----------
    inputs : TargetInputs
        The flight and its ground points.
    windows : sequence of Window
        All windows; at least one is accepted.
    into : Path
        Directory of the files.

    Returns
    -------
    list of str
        What could not be written, sentence by sentence.
    """
    image_points = measured_points(inputs, windows)
    write_image_points(image_points, into / IMAGE_POINTS_FILE)
    plane = TangentPlane(*inputs.eo.origin)
    axes = (f"tangent plane of {inputs.request.eo.name}, m",)
    if inputs.vehicle is None:
        write_ground_points(inputs.ground, into / GROUND_POINTS, axes)
    else:
        vehicle = inputs.vehicle
        time = vehicle.time if np.isfinite(vehicle.time).all() else None
        places = TargetPositions(
            vehicle.images, time, inputs.eo.gps_week, inputs.ground.position_m, inputs.ground.cov
        )
        write_target_positions(places, into / POSITIONS, axes)
        write_target_sizes(target_sizes(inputs, windows), into / SIZES_FILE)
    notes: list[str] = []
    ground, crs = _in_crs(inputs, plane)
    camera = inputs.camera
    for name, write in (
        (
            "markers.xml",
            lambda path: write_metashape_markers(image_points, ground, crs, camera, path),
        ),
        ("pix4d_marks.csv", lambda path: write_pix4d_marks(image_points, path)),
        ("gcp_list.txt", lambda path: write_gcp_list(image_points, ground, crs, path)),
    ):
        try:
            write(into / name)
        except InputError as refusal:
            notes.append(f"no {name}: {refusal}")
    return notes


def _in_crs(inputs: TargetInputs, plane: TangentPlane) -> tuple[GroundTable, str]:
    """Ground points in a CRS that every program knows: their own where it is one code, else
    longitude, latitude and height above the ellipsoid.
    """
    crs = inputs.crs
    if crs is not None and re.fullmatch(r"EPSG:\d+", crs) and inputs.request.geoid is None:
        return inputs.surveyed.metric(GroundAxes(crs)), crs
    datum = inputs.eo.datum or GEOGRAPHIC_CRS
    lat, lon, h = plane.geodetic_from_position(inputs.ground.position_m)
    position = np.column_stack([np.degrees(lon), np.degrees(lat), h])
    axes = plane.C_mn(lat, lon) @ np.array([[0.0, 1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, -1.0]])
    cov = axes.transpose(0, 2, 1) @ inputs.ground.cov @ axes
    return GroundTable(inputs.ground.points, position, cov, inputs.ground.check), datum
