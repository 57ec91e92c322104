"""Poses that a bundle adjustment gave back, in the frame that its file, or the caller, names.

The frame is, in this order, that which the file names (a caller's CRS stands in for a projected
one, such as with heights), that of the caller, and what the values themselves can only be:

    geocentric     heights above the ellipsoid are those of aircraft, points off the equator
    geographic     plan coordinates fit into 0.1 unit and are angles, heights are far larger
    one's own      small coordinates: a tangent plane, or axes of no place

Large coordinates without a CRS are refused, and coordinates in a CRS that lie far from its area.

Of two adjustments of `insgnss adjust` points and cameras are compared as well: `points.csv` and
`adjust.json` have their standard deviations.
"""

from collections.abc import Iterator
from pathlib import Path
from typing import NamedTuple

import numpy as np

from ...base.errors import InputError
from ...base.received.nesting import read_object
from ...geodesy.crs import crs_of
from ...geodesy.datums import geodetic_from_geographic
from ...geodesy.frames import TangentPlane, ecef_to_geodetic
from ...io.formats.returned.crs import kind_of_crs
from ...io.formats.returned.poses import ReturnedPoses
from ...io.formats.returned.reading import read_returned_poses
from ...io.formats.text.columns import TableSpec
from ...records import Array
from ...records.framed import GEOCENTRIC, GEOGRAPHIC, PROJECTED, TANGENT
from .hints import Hints
from .poses import PLANE_M, CoordinateFrame, Poses, degrees_for_metres, tangent_frame
from .result import AdjustedDifferences, ComponentDifferences, ParameterDifference

# heights above the ellipsoid of a camera (m): Dead Sea to a jet's ceiling
CAMERA_HEIGHTS_M = -500.0, 15e3
# least |z| of a geocentric point (m): nearer to the equator, z is as small as a height in a map's
# coordinates, and 6.4e6 m may be a northing
OFF_EQUATOR_M = 2e4


ADJUST_DOCUMENT, ORIENTATION, POINTS = "adjust.json", "eo.json", "points.csv"
COMPARED_POINT_COLUMNS = TableSpec.exactly(
    "point x y z sd_x sd_y sd_z cov_xy cov_xz cov_yz rays role", text=True
)


class Framed(NamedTuple):
    """Coordinates, and the frame that they stand in.

    Parameters
    ----------
    frame : CoordinateFrame or None
        None: of axes of their own, for all that anybody knows.
    x : ndarray, (n, 3)
        m, or longitude, latitude, rad, height, m.
    note : str
        How the frame was recognised, empty where it is named.
    """

    frame: CoordinateFrame | None
    x: Array
    note: str = ""


def read_adjusted_poses(form: str, path: Path, hints: Hints) -> Poses:
    """Poses of a file of one of `io.formats.returned.reading.RETURNED`.

    Raises
    ------
    InputError
        With file and line; where nothing tells the frame of large coordinates.
    """
    returned = read_returned_poses(path, form)
    framed = framed_coordinates(returned, hints, path)
    frame = framed.frame or tangent_frame(path, framed.x, None)
    return placed_poses(returned, framed._replace(frame=frame), path, form)


def placed_poses(returned: ReturnedPoses, framed: Framed, path: Path, form: str) -> Poses:
    """Poses of a frame on the Earth.

    Raises
    ------
    FarError
        They lie far from the area of their CRS.
    InputError
        The CRS does not reach them.
    """
    assert framed.frame is not None
    return framed.frame.poses(
        path,
        form,
        framed.x,
        returned.C,
        returned.true_north and framed.frame.kind in (PROJECTED, GEOGRAPHIC),
        returned.cov_position,
        returned.cov_attitude,
        images=returned.images,
        angle_set=returned.angle_set,
        angles=returned.angles,
        notes=(*returned.notes, framed.note) if framed.note else returned.notes,
    )


def framed_coordinates(returned: ReturnedPoses, hints: Hints, path: Path) -> Framed:
    """Return the coordinates of a file in the frame that it or the caller names, or that they tell.

    Parameters
    ----------
    returned : ReturnedPoses
        The file.
    hints : Hints
        What the caller names.
    path : Path
        The file, for the message.

    Raises
    ------
    InputError
        Large coordinates whose frame nobody names, or no longitude and latitude.
    """
    kind, crs, x = returned.kind, returned.crs, returned.position
    if kind in ("", PROJECTED):
        x = x if hints.shift is None else x + hints.shift
        if hints.crs is not None:
            named, frame_name = kind_of_crs(crs_of(hints.crs))
            kind, crs = named, hints.crs if named == PROJECTED else frame_name
    if kind == TANGENT and returned.origin:
        return Framed(CoordinateFrame(TANGENT, TangentPlane(*returned.origin)), x)
    if kind == PROJECTED:
        projection = hints.projected(crs)
        return Framed(CoordinateFrame(PROJECTED, projection=projection), x * projection.unit_m)
    if kind == GEOGRAPHIC:
        degrees = (
            x if returned.kind != GEOGRAPHIC else np.column_stack([np.degrees(x[:, :2]), x[:, 2]])
        )
        return Framed(CoordinateFrame(GEOGRAPHIC), _geographic(degrees, crs, hints, path))
    if kind:
        return Framed(CoordinateFrame(kind), x)
    if hints.plane is not None:
        return Framed(tangent_frame(path, x, hints.plane), x)
    return _recognised(x, path, hints)


def _geographic(degrees: Array, crs: str, hints: Hints, path: Path) -> Array:
    """Return longitude, latitude, rad, height, m, of WGS 84 or the datum that is hinted at."""
    lon, lat = np.abs(degrees[:, :2]).max(axis=0)
    if lon > 360.0 or lat > 90.0:
        problem = f"{degrees[0, 0]:.3f} {degrees[0, 1]:.3f} are no longitude and latitude, deg"
        how = "give the CRS of these coordinates"
        if lon <= 90.0 and lat <= 360.0:
            how = "latitude stands before longitude: exchange the columns"
        raise InputError.in_file(path, f"{problem}; {how}")
    if not crs and hints.geoid is None:
        return np.column_stack([np.radians(degrees[:, :2]), degrees[:, 2]])
    lat, lon, h = geodetic_from_geographic(
        crs or "EPSG:4979", degrees, hints.geoid, hints.datum, hints.epoch
    )
    return np.column_stack([lon, lat, h])


def _recognised(x: Array, path: Path, hints: Hints) -> Framed:
    """Return the frame that coordinates can only be of; none of small ones."""
    if float(np.linalg.norm(x, axis=1).max()) > PLANE_M:
        _, _, h = ecef_to_geodetic(x)
        low, high = CAMERA_HEIGHTS_M
        if low < h.min() and h.max() < high and float(np.abs(x[:, 2]).min()) > OFF_EQUATOR_M:
            note = f"{path.name} names no CRS; its coordinates are geocentric by their size"
            return Framed(CoordinateFrame(GEOCENTRIC), x, note)
        tangent_frame(path, x, None)
    if degrees_for_metres(x):
        extent, height = float(np.ptp(x[:, :2], axis=0).max()), float(np.median(np.abs(x[:, 2])))
        note = f"{path.name} names no CRS; X and Y are taken as longitude and latitude, degrees: as"
        note += f" metres the flight would be {extent:.4f} m long at a height of {height:.0f} m"
        return Framed(CoordinateFrame(GEOGRAPHIC), _geographic(x, "", hints, path), note)
    return Framed(None, x)


def adjustment_in(file: object) -> Path | None:
    """Directory of an adjustment that its adjust.json or the directory names; None otherwise."""
    if not isinstance(file, str | Path):
        return None
    path = Path(file)
    document = path / ADJUST_DOCUMENT if path.is_dir() else path
    return document.parent if document.name == ADJUST_DOCUMENT and document.is_file() else None


def orientation_in(directory: Path) -> Path:
    """The eo.json of an adjustment.

    Raises
    ------
    InputError
        It has none.
    """
    if not (path := directory / ORIENTATION).is_file():
        raise InputError.in_file(
            directory / ADJUST_DOCUMENT,
            f"no {ORIENTATION} beside it: an adjustment without aerial control, or one that was"
            " refused, writes none; give the poses themselves",
        )
    return path


def differences_of_adjustments(a: Path, b: Path, one_frame: bool) -> AdjustedDifferences:
    """Points and cameras of two adjustments, b minus a.

    Parameters
    ----------
    a, b : their directories.
    one_frame : whether both have the same axes.
    """
    without = [str(d / POINTS) for d in (a, b) if not (d / POINTS).is_file()]
    notes: list[str] = []
    points: tuple[ComponentDifferences, ...] = ()
    if without:
        notes.append(f"no object points compared: no {without[0]} (adjust with output.tables)")
    elif not one_frame:
        notes.append("no object points compared: the axes of both blocks differ")
    else:
        points = _point_differences(a / POINTS, b / POINTS)
    parameters = tuple(_parameter_differences(a, b))
    if not parameters:
        notes.append("no camera compared: none has the same name in both")
    return AdjustedDifferences(points, parameters, tuple(notes))


def _point_differences(a: Path, b: Path) -> tuple[ComponentDifferences, ...]:
    tables = [COMPARED_POINT_COLUMNS.read(path) for path in (a, b)]
    names = [table.strings("point") for table in tables]
    rows = [{name: k for k, name in enumerate(each)} for each in names]
    common = [name for name in names[0] if name in rows[1]]
    taken = [[row[name] for name in common] for row in rows]
    x, sigma = (
        [table.block(columns)[k] for table, k in zip(tables, taken, strict=True)]
        for columns in ("x y z", "sd_x sd_y sd_z")
    )
    if not common:
        return ()
    d, s = x[1] - x[0], np.hypot(*sigma)
    return tuple(ComponentDifferences(n, "m", d[:, k], s[:, k]) for k, n in enumerate("xyz"))


def _parameter_differences(a: Path, b: Path) -> Iterator[ParameterDifference]:
    cameras = [read_object(d / ADJUST_DOCUMENT).get("cameras", []) for d in (a, b)]
    of_b = {camera["name"]: camera["parameters"] for camera in cameras[1]}
    for camera in cameras[0]:
        for name, first in camera["parameters"].items():
            second = of_b.get(camera["name"], {}).get(name)
            if second is not None and (first["estimated"] or second["estimated"]):
                sigma = float(np.hypot(first["sigma"] or 0.0, second["sigma"] or 0.0))
                difference = second["value"] - first["value"]
                yield ParameterDifference(camera["name"], name, difference, sigma)
