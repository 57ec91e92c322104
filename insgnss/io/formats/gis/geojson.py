"""GeoJSON: a point for each image and the track as a line, data_specs/geojson.md.

RFC 7946 knows one frame: longitude, latitude, degrees, height above the ellipsoid of WGS84.
Positions are that whatever the frame, of another datum in its own geographic CRS, which the member
`crs` names; the properties hold yaw, pitch, roll to true north, omega, phi, kappa in the frame's
axes, standard deviations and the covariance. A track across longitude 180 deg is cut there into a
MultiLineString (3.1.9).

The dialect of orthority adds the member `world_crs` and gives, in a projected frame, `xyz` in
metres and `opk` in radians, where R = Rx(omega) Ry(phi) Rz(kappa) takes the camera (right, up,
back) into the axes of the CRS; the line is left out.
"""

import json
from collections.abc import Iterator
from typing import Literal

import numpy as np

from ....base.errors import UsageError
from ....base.files import atomic_write
from ....base.units import METRE
from ....records import Array, FramedOrientation
from ....records.framed import PROJECTED
from ..exports import check_frame
from ..orientation.ascii_columns import Conventions, numbers_of
from ..orientation.exported import check_choice, listed_rows
from ..orientation.poses import all_angles, local_covariance, sentences, utc
from ..text.text import Source

DIALECTS = ("rfc7946", "orthority")
# change of longitude (deg): a track with a larger one crosses the antimeridian
HALF_TURN_DEG = 180.0


def write_geojson(
    eo: FramedOrientation,
    path: Source,
    dialect: Literal["rfc7946", "orthority"] = "rfc7946",
    camera: str = "camera",
) -> None:
    """Write degrees with 10 decimals (position) and 6 (angles), metres with 4.

    Parameters
    ----------
    eo : FramedOrientation
        The orientation in its frame.
    path : path
        The file.
    dialect : {"rfc7946", "orthority"}
        "orthority" needs a projected frame.
    camera : str
        The name that orthority's interior has.

    Raises
    ------
    UsageError
        Another dialect, or a frame that it cannot carry.
    """
    check_choice("dialect", dialect, DIALECTS)
    if dialect == "orthority":
        check_frame(eo, "geojson of orthority", (PROJECTED,))
        if eo.frame.units != (METRE, METRE):
            raise UsageError(
                f"geojson of orthority takes metres, {eo.frame.name} counts in"
                f" {eo.frame.units[0].plural}; use its metric sibling"
            )
        if eo.frame.northing_first:
            raise UsageError(
                f"{eo.frame.name} names northing first, orthority takes easting first; use its"
                " east-north sibling"
            )
    collection: dict[str, object] = {"type": "FeatureCollection", "insgnss": sentences(eo)}
    if dialect == "orthority":
        collection["world_crs"] = eo.frame.wkt
    if eo.frame.datum != "EPSG:4979":  # the member of 2008, since RFC 7946 knows WGS 84 alone
        urn = "urn:ogc:def:crs:" + eo.frame.datum.replace(":", "::")
        collection["crs"] = {"type": "name", "properties": {"name": urn}}
    rows = _orthority_features(eo, camera) if dialect == "orthority" else _features(eo)
    start = json.dumps(collection).removesuffix("}") + ', "features": [\n'
    atomic_write(path, listed_rows(start, rows, ",\n", "\n]}\n"))


def _lon_lat_height(eo: FramedOrientation) -> Array:
    """(n, 3) longitude, latitude, deg, height, m."""
    return np.column_stack([np.degrees(eo.geodetic[:, [1, 0]]), eo.geodetic[:, 2]])


AT_POINT = '"geometry": {"type": "Point", "coordinates": [%.10f, %.10f, %.4f]}'


def _features(eo: FramedOrientation) -> Iterator[str]:
    """Yield the GeoJSON feature of each image, then the track."""
    covariance = local_covariance(eo)
    names = [
        f'"{name}": [%.6f, %.6f, %.6f]'
        for name in ("ypr_deg", "ypr_sigma_deg", "opk_deg", "opk_sigma_deg")
    ]
    template = (
        f'{{"type": "Feature", {AT_POINT}, "properties": {{"image": %s, "time_utc": "%s",'
        f' "gps_week": {eo.gps_week}, "tow_s": %.6f, '
    )
    template += (
        ", ".join(names)
        + ', "sigma_enu_m": [%.5f, %.5f, %.5f], "cov6_enu": ['
        + ", ".join(["%.9g"] * 21)
        + "]}}"
    )
    position = _lon_lat_height(eo)
    table = np.column_stack(
        [
            eo.time,
            all_angles(eo),
            np.sqrt(np.diagonal(covariance, axis1=1, axis2=2)[:, :3]),
            covariance[:, *np.triu_indices(6)],
        ]
    )
    for coordinates, name, when, row in zip(
        position.tolist(), eo.images, utc(eo), table.tolist(), strict=True
    ):
        yield template % (*coordinates, json.dumps(name), when, *row)
    lines = [
        "["
        + ", ".join(
            f"[{coordinates:.10f}, {y:.10f}, {z:.4f}]" for coordinates, y, z in line.tolist()
        )
        + "]"
        for line in cut_at_antimeridian(position)
    ]
    if lines:
        kind, inside = (
            ("LineString", lines[0])
            if len(lines) == 1
            else ("MultiLineString", f"[{', '.join(lines)}]")
        )
        yield (
            f'{{"type": "Feature", "geometry": {{"type": "{kind}", "coordinates": {inside}}},'
            ' "properties": {"name": "track"}}'
        )


def cut_at_antimeridian(position: Array) -> list[Array]:
    """Return a track in pieces of which none crosses longitude 180 deg (RFC 7946 3.1.9).

    Between two places the track goes the shorter way round. It is cut where it meets the
    antimeridian, latitude and height linear between the places; both pieces have that point, one
    with longitude 180, the other with -180.

    Parameters
    ----------
    position : ndarray, (n, 3)
        Longitude (-180 to 180) and latitude, deg, height, m.

    Returns
    -------
    list of ndarray, (m, 3)
        Pieces of at least two points; none of a single place.
    """
    pieces, start, first_row = [], position[:0], 0
    for row in np.flatnonzero(np.abs(np.diff(position[:, 0])) > HALF_TURN_DEG).tolist():
        point, next_point = position[row], position[row + 1]
        side = np.copysign(HALF_TURN_DEG, point[0])
        longitude_step = next_point[0] + 2.0 * side - point[0]
        fraction = (side - point[0]) / longitude_step if longitude_step else 0.0
        end, begin = np.tile(point + fraction * (next_point - point), (2, 1))
        end[0], begin[0] = side, -side
        pieces.append([start, position[first_row : row + 1], _point_unless_same(end, point)])
        start, first_row = _point_unless_same(begin, next_point), row + 1
    pieces.append([start, position[first_row:]])
    return [line for piece in pieces if len(line := np.vstack(piece)) > 1]


def _point_unless_same(point: Array, neighbour: Array) -> Array:
    """Return a point as (1, 3), or (0, 3) where it is the same as another."""
    return point[None] if np.any(point != neighbour) else np.empty((0, 3))


def _orthority_features(eo: FramedOrientation, camera: str) -> Iterator[str]:
    """Yield the GeoJSON feature of each image with the keys that Orthority reads."""
    opk = numbers_of(eo, "opk", Conventions(unit="rad"))
    lens = json.dumps(camera).replace("%", "%%")
    form = (
        f'{{"type": "Feature", {AT_POINT}, "properties": {{"filename": %s, "camera": {lens}, "xyz":'
        " [%.4f, %.4f, %.4f], "
    )
    form += '"opk": [%.9f, %.9f, %.9f]}}'
    for x, name, row in zip(
        _lon_lat_height(eo).tolist(),
        eo.images,
        np.hstack([eo.coordinates, opk]).tolist(),
        strict=True,
    ):
        yield form % (*x, json.dumps(name), *row)
