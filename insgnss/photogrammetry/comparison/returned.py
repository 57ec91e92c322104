"""Poses that a bundle adjustment gave back, in the frame that its file, or the caller, names.

The frame is, in this order, that which the file names (a caller's CRS stands in for a projected
one, such as with heights), that of the caller, and what the values themselves can only be:

    geocentric     heights above the ellipsoid are those of aircraft, points off the equator
    geographic     plan coordinates fit into 0.1 unit and are angles, heights are far larger
    one's own      small coordinates: a tangent plane, or axes of no place

Large coordinates without a CRS are refused, and coordinates in a CRS that lie far from its area.
"""

from pathlib import Path
from typing import NamedTuple

import numpy as np

from ...base.errors import InputError
from ...geodesy.crs import crs_of, geodetic_from_geographic
from ...geodesy.frames import TangentPlane, ecef_to_geodetic
from ...io.formats.returned.crs import kind_of_crs
from ...io.formats.returned.poses import ReturnedPoses
from ...io.formats.returned.reading import read_returned_poses
from ...records import Array
from ...records.framed import GEOCENTRIC, GEOGRAPHIC, PROJECTED, TANGENT
from .hints import Hints
from .poses import PLANE_M, CoordinateFrame, Poses, tangent_frame

# heights above the ellipsoid of a camera (m): Dead Sea to a jet's ceiling
CAMERA_HEIGHTS_M = -500.0, 15e3
# least |z| of a geocentric point (m): nearer to the equator, z is as small as a height in a map's
# coordinates, and 6.4e6 m may be a northing
OFF_EQUATOR_M = 2e4
LARGEST_EXTENT_DEG = 0.1  # largest extent of a flight's longitudes and latitudes (deg): 11 km
STEEP = 100.0  # height over plan extent beyond which the plan is no metres: no flight is 1 m wide


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
    given = read_returned_poses(path, form)
    framed = framed_coordinates(given, hints, path)
    frame = framed.frame or tangent_frame(path, framed.x, None)
    return placed_poses(given, framed._replace(frame=frame), path, form)


def placed_poses(given: ReturnedPoses, framed: Framed, path: Path, form: str) -> Poses:
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
        given.C,
        given.true_north and framed.frame.kind in (PROJECTED, GEOGRAPHIC),
        given.cov_position,
        given.cov_attitude,
        images=given.images,
        angle_set=given.angle_set,
        angles=given.angles,
        notes=(*given.notes, framed.note) if framed.note else given.notes,
    )


def framed_coordinates(given: ReturnedPoses, hints: Hints, path: Path) -> Framed:
    """Return the coordinates of a file in the frame that it or the caller names, or that they tell.

    Parameters
    ----------
    given : ReturnedPoses
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
    kind, crs, x = given.kind, given.crs, given.position
    if kind in ("", PROJECTED):
        x = x if hints.shift is None else x + hints.shift
        if hints.crs is not None:
            named, words = kind_of_crs(crs_of(hints.crs))
            kind, crs = named, hints.crs if named == PROJECTED else words
    if kind == TANGENT and given.origin:
        return Framed(CoordinateFrame(TANGENT, TangentPlane(*given.origin)), x)
    if kind == PROJECTED:
        projection = hints.projected(crs)
        return Framed(CoordinateFrame(PROJECTED, projection=projection), x * projection.unit_m)
    if kind == GEOGRAPHIC:
        degrees = (
            x if given.kind != GEOGRAPHIC else np.column_stack([np.degrees(x[:, :2]), x[:, 2]])
        )
        return Framed(CoordinateFrame(GEOGRAPHIC), _geographic(degrees, crs, hints, path))
    if kind:
        return Framed(CoordinateFrame(kind), x)
    if hints.plane is not None:
        return Framed(tangent_frame(path, x, hints.plane), x)
    return _recognised(x, path)


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


def _recognised(x: Array, path: Path) -> Framed:
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
        x = np.column_stack([np.radians(x[:, :2]), x[:, 2]])
        return Framed(CoordinateFrame(GEOGRAPHIC), x, note)
    return Framed(None, x)


def degrees_for_metres(x: Array) -> bool:
    """Whether coordinates (n, 3) can only be longitude and latitude, deg, and height."""
    extent = float(np.ptp(x[:, :2], axis=0).max(initial=0.0))
    angles = bool((np.abs(x[:, :2]) <= (180.0, 90.0)).all())
    steep = float(np.median(np.abs(x[:, 2]))) > STEEP * extent
    return angles and 0.0 < extent < LARGEST_EXTENT_DEG and steep
