"""GeoJSON (RFC 7946 and orthority's dialect), KML, GeoPackage, formats.md B12.

GeoJSON     longitude, latitude, height above the ellipsoid; ypr_deg from true north, opk_deg in the
            axes of the frame; orthority: xyz and opk in radians in the CRS of the member world_crs
KML         longitude, latitude, height above sea level; heading, tilt (0 the nadir), roll: turns
            about z, x, z of a camera that looks along -z with y up
GeoPackage  geometry blob "GP", version, flags, SRS, WKB PointZ in the CRS of gpkg_spatial_ref_sys;
            qw.. camera (right, down, view) to it
"""

import json
import sqlite3
import struct
from pathlib import Path
from xml.etree import ElementTree

import numpy as np
import scene

from .case import EVERY, GLOBE, GRIDS, LOCAL, LV95, NORTH_FIRST, Case, at_sea
from .geometry import Array, D, Frame, Poses, Projected, Table, kml, opk, quaternion, ypr

KML = {"k": "http://www.opengis.net/kml/2.2"}


def _columns(features: list[dict], keys: dict[str, str]) -> dict[str, Array]:
    columns = dict(
        zip("xyz", np.array([f["geometry"]["coordinates"] for f in features]).T, strict=True)
    )
    for key, names in keys.items():
        columns |= dict(
            zip(names.split(), np.array([f["properties"][key] for f in features]).T, strict=True)
        )
    return columns


def read_geojson(path: Path) -> Table:
    features = [
        f
        for f in json.loads(path.read_text(encoding="utf-8"))["features"]
        if f["geometry"]["type"] == "Point"
    ]
    columns = _columns(features, {"ypr_deg": "yaw pitch roll", "opk_deg": "omega phi kappa"})
    return Table([f["properties"]["image"] for f in features], columns)


def poses_geojson(table: Table, frame: Frame) -> Poses:
    x = table.place()
    return Poses(
        table.names,
        Frame().ecef(x),
        Frame().axes(x) @ ypr(table["yaw"], table["pitch"], table["roll"]) @ D,
    )


def poses_geojson_opk(table: Table, frame: Frame) -> Poses:
    """The angles that count from the axes of the export's frame."""
    centre = Frame().ecef(table.place())
    axes = frame.axes(frame.coordinates(centre))
    return Poses(table.names, centre, axes @ opk(table["omega"], table["phi"], table["kappa"]) @ D)


def read_orthority(path: Path) -> Table:
    content = json.loads(path.read_text(encoding="utf-8"))
    columns = _columns(content["features"], {"xyz": "X Y Z", "opk": "omega phi kappa"})
    columns |= {name: np.degrees(columns[name]) for name in ("omega", "phi", "kappa")}
    return Table(
        [f["properties"]["filename"] for f in content["features"]],
        columns,
        {"crs": content["world_crs"]},
    )


def poses_orthority(table: Table, frame: Frame) -> Poses:
    grid, x = Projected(table.said["crs"]), table.place("X", "Y", "Z")
    return Poses(
        table.names,
        grid.ecef(x),
        grid.axes(x) @ opk(table["omega"], table["phi"], table["kappa"]) @ D,
    )


def read_kml(path: Path) -> Table:
    marks = ElementTree.parse(path).getroot().findall(".//k:Folder/k:Placemark", KML)
    keys = {
        "x": "longitude",
        "y": "latitude",
        "z": "altitude",
        "heading": "heading",
        "tilt": "tilt",
        "roll": "roll",
    }
    columns = {
        c: np.array([float(m.findtext(f"k:Camera/k:{key}", "", KML)) for m in marks])
        for c, key in keys.items()
    }
    assert {m.findtext("k:Camera/k:altitudeMode", "", KML) for m in marks} == {"absolute"}
    return Table([m.findtext("k:name", "", KML) for m in marks], columns)


def poses_kml(table: Table, frame: Frame, undulation_m: float) -> Poses:
    x = table.place() + [0.0, 0.0, undulation_m]
    return Poses(
        table.names,
        Frame().ecef(x),
        Frame().axes(x) @ kml(table["heading"], table["tilt"], table["roll"]) @ D,
    )


def read_geopackage(path: Path) -> Table:
    database = sqlite3.connect(path)
    try:
        (srs,) = database.execute(
            "SELECT srs_id FROM gpkg_geometry_columns WHERE table_name = 'images'"
        ).fetchone()
        query = "SELECT definition, definition_12_063 FROM gpkg_spatial_ref_sys WHERE srs_id = ?"
        wkt1, wkt2 = database.execute(query, (srs,)).fetchone()
        names = [
            "yaw_deg",
            "pitch_deg",
            "roll_deg",
            "omega_deg",
            "phi_deg",
            "kappa_deg",
            "qw",
            "qx",
            "qy",
            "qz",
        ]
        rows = database.execute(
            f"SELECT image, geom, {', '.join(names)} FROM images ORDER BY fid"
        ).fetchall()
    finally:
        database.close()
    x = []
    for row in rows:
        magic, _, flags, number = struct.unpack_from("<2sBBi", row[1])
        assert (magic, number, flags & 0b1111) == (b"GP", srs, 1)
        order, kind, *xyz = struct.unpack_from("<BI3d", row[1], 8)
        assert (order, kind) == (1, 1001)
        x.append(xyz)
    values = dict(
        zip(
            (name.removesuffix("_deg") for name in names),
            np.array([row[2:] for row in rows]).T,
            strict=True,
        )
    )
    values |= dict(zip("xyz", np.array(x).T, strict=True)) | {
        "q": np.column_stack([values[f"q{c}"] for c in "wxyz"])
    }
    return Table([row[0] for row in rows], values, {"crs": wkt2 if wkt1 == "undefined" else wkt1})


def _own(table: Table, frame: Frame) -> Frame:
    """The frame that the file names, or the user's where it is undefined."""
    crs = table.said["crs"]
    return frame if crs == "undefined" else Projected(crs) if crs.startswith("PROJ") else Frame()


def poses_geopackage(table: Table, frame: Frame) -> Poses:
    x, own = table.place(), _own(table, frame)
    return Poses(table.names, own.ecef(x), own.axes(x) @ quaternion(table["q"]))


def poses_geopackage_opk(table: Table, frame: Frame) -> Poses:
    x, own = table.place(), _own(table, frame)
    return Poses(
        table.names,
        own.ecef(x),
        own.axes(x) @ opk(table["omega"], table["phi"], table["kappa"]) @ D,
    )


def poses_geopackage_ypr(table: Table, frame: Frame) -> Poses:
    x, own = table.place(), _own(table, frame)
    return Poses(
        table.names,
        own.ecef(x),
        own.local(x) @ ypr(table["yaw"], table["pitch"], table["roll"]) @ D,
    )


CASES = {
    "geojson": Case(read_geojson, poses_geojson, EVERY, "ypr"),
    "geojson opk": Case(read_geojson, poses_geojson_opk, EVERY, "opk"),
    "geojson orthority": Case(
        read_orthority, poses_orthority, GRIDS, "opk", ("X", "Y", "Z"), {"dialect": "orthority"}
    ),
    "kml": Case(
        read_kml,
        at_sea(poses_kml),
        (GLOBE, LV95),
        "kml",
        options={"undulation_m": scene.UNDULATION_M},
    ),
    "geopackage": Case(
        read_geopackage, poses_geopackage, (LOCAL, GLOBE, *GRIDS, NORTH_FIRST), "quaternion"
    ),
    "geopackage opk": Case(read_geopackage, poses_geopackage_opk, (LOCAL, GLOBE, *GRIDS), "opk"),
    "geopackage ypr": Case(read_geopackage, poses_geopackage_ypr, (LOCAL, GLOBE, *GRIDS), "ypr"),
}
