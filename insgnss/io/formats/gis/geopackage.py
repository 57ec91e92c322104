"""OGC GeoPackage: images as points and the track in the frame's CRS, data_specs/geopackage.md.

A GeoPackage is an SQLite database with three tables of its own, written here with the standard
library alone. Geometries are well-known binary with a header (OGC 12-128r17, 2.1.3): x is easting
or longitude, y northing or latitude, whatever order the CRS names, z the height that the
description of the CRS tells. The CRS stands as WKT 1, where that can say it, and as WKT 2
(extension gpkg_crs_wkt).

A tangent plane has no CRS that the format knows: it is written as undefined Cartesian, its origin
in the description.
"""

import json
import sqlite3
from collections.abc import Iterator
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from ....base.errors import UsageError
from ....base.output.staging import destination, staged_path
from ....geodesy.rotation import quaternion_from_rotation
from ....records import Array, FramedOrientation
from ....records.framed import TANGENT
from ..orientation.exported import places, position_sigma
from ..orientation.poses import all_angles, sentences, utc
from ..text.text import Source

# "GPKG" and 1.3.0: the standard's marks in the file's head
APPLICATION_ID, USER_VERSION = 0x47504B47, 10300
UNDEFINED_CARTESIAN_ID = -1  # srs_id of undefined Cartesian coordinates: the standard's number
FIRST_OWN_ID = 100000  # srs_id of a CRS without EPSG code: above the numbers of EPSG (chosen)
REALS = (
    *("yaw_deg", "pitch_deg", "roll_deg", "sigma_yaw_deg", "sigma_pitch_deg", "sigma_roll_deg"),
    *("omega_deg", "phi_deg", "kappa_deg", "sigma_omega_deg", "sigma_phi_deg", "sigma_kappa_deg"),
    *("sigma_x_m", "sigma_y_m", "sigma_z_m", "qw", "qx", "qy", "qz", "ellipsoidal_height_m"),
)
GEOPACKAGE_TABLES = f"""
CREATE TABLE gpkg_spatial_ref_sys (
  srs_name TEXT NOT NULL, srs_id INTEGER NOT NULL PRIMARY KEY, organization TEXT NOT NULL, \
organization_coordsys_id INTEGER NOT NULL,
  definition TEXT NOT NULL, description TEXT, definition_12_063 TEXT NOT NULL);
CREATE TABLE gpkg_contents (
  table_name TEXT NOT NULL PRIMARY KEY, data_type TEXT NOT NULL, identifier TEXT UNIQUE, \
description TEXT DEFAULT '',
  last_change DATETIME NOT NULL DEFAULT (strftime('%Y-%m-%dT%H:%M:%fZ','now')),
  min_x DOUBLE, min_y DOUBLE, max_x DOUBLE, max_y DOUBLE, srs_id INTEGER,
  CONSTRAINT fk_gc_r_srs_id FOREIGN KEY (srs_id) REFERENCES gpkg_spatial_ref_sys(srs_id));
CREATE TABLE gpkg_geometry_columns (
  table_name TEXT NOT NULL, column_name TEXT NOT NULL, geometry_type_name TEXT NOT NULL, \
srs_id INTEGER NOT NULL,
  z TINYINT NOT NULL, m TINYINT NOT NULL,
  CONSTRAINT pk_geom_cols PRIMARY KEY (table_name, column_name), \
CONSTRAINT uk_gc_table_name UNIQUE (table_name),
  CONSTRAINT fk_gc_tn FOREIGN KEY (table_name) REFERENCES gpkg_contents(table_name),
  CONSTRAINT fk_gc_srs FOREIGN KEY (srs_id) REFERENCES gpkg_spatial_ref_sys (srs_id));
CREATE TABLE gpkg_extensions (
  table_name TEXT, column_name TEXT, extension_name TEXT NOT NULL, \
definition TEXT NOT NULL, scope TEXT NOT NULL,
  CONSTRAINT ge_tce UNIQUE (table_name, column_name, extension_name));
INSERT INTO gpkg_extensions VALUES ('gpkg_spatial_ref_sys', 'definition_12_063', 'gpkg_crs_wkt',
  'http://www.geopackage.org/spec130/#extension_crs_wkt', 'read-write');
CREATE TABLE images (
  fid INTEGER PRIMARY KEY AUTOINCREMENT NOT NULL, geom POINT, image TEXT, time_utc DATETIME, \
gps_week INTEGER, tow_s DOUBLE,
  {", ".join(f"{name} DOUBLE" for name in REALS)}, cov6 TEXT);
CREATE TABLE track (fid INTEGER PRIMARY KEY AUTOINCREMENT NOT NULL, geom LINESTRING, name TEXT);
"""


@dataclass(frozen=True)
class _Srs:
    name: str
    number: int
    organization: str
    description: str
    wkt1: str = "undefined"
    wkt2: str = "undefined"


UNDEFINED_CARTESIAN = _Srs(
    "Undefined Cartesian", UNDEFINED_CARTESIAN_ID, "NONE", "undefined Cartesian"
)
GPS_EPOCH_ISO = "1980-01-06T00:00:00.000Z"  # of a file without images


def write_geopackage(eo: FramedOrientation, path: Source) -> None:
    """Write the tables `images` and `track`.

    `cov6` is JSON, 6 x 6, of position (m) and psi (rad) in the frame's axes.

    Raises
    ------
    UsageError
        A geocentric frame, or a path that does not end in .gpkg.
    """
    if not str(path).lower().endswith(".gpkg"):
        raise UsageError(f"{path}: a GeoPackage must be named .gpkg, such as --out eo.gpkg")
    coordinates = places(eo)
    srs = _srs(eo)
    with staged_path(path) as work:
        db = sqlite3.connect(work, isolation_level=None)
        try:
            db.execute(f"PRAGMA application_id = {APPLICATION_ID}")
            db.execute(f"PRAGMA user_version = {USER_VERSION}")
            db.execute("PRAGMA foreign_keys = ON")
            db.execute("BEGIN")
            for statement in GEOPACKAGE_TABLES.split(";\n"):
                db.execute(statement)
            _describe(db, eo, coordinates, srs)
            marks = ", ".join("?" * (6 + len(REALS)))
            names = ", ".join(["geom", "image", "time_utc", "gps_week", "tow_s", *REALS, "cov6"])
            db.executemany(
                f"INSERT INTO images ({names}) VALUES ({marks})", _rows(eo, coordinates, srs.number)
            )
            if len(coordinates) > 1:
                db.execute(
                    "INSERT INTO track (geom, name) VALUES (?, 'track')",
                    (_line(coordinates, srs.number),),
                )
            db.execute("COMMIT")
        except sqlite3.OperationalError as error:  # a full disk is not an error of the system there
            problem = f"cannot be written: {error}; check space and permission"
            raise UsageError(f"{destination(Path(path))}: {problem}") from None
        finally:
            db.close()


def _describe(db: sqlite3.Connection, eo: FramedOrientation, coordinates: Array, srs: _Srs) -> None:
    """Write the reference systems and the contents of both tables, images and track."""
    from pyproj import CRS

    wgs84 = CRS.from_epsg(4326)
    degrees = _Srs("Undefined geographic", 0, "NONE", "undefined geographic")
    wkt1, wkt2 = wgs84.to_wkt("WKT1_GDAL"), wgs84.to_wkt()
    globe = _Srs("WGS 84", 4326, "EPSG", "longitude, latitude", wkt1, wkt2)
    required = (UNDEFINED_CARTESIAN, degrees, globe)
    rows = {row.number: row for row in (*required, srs)}.values()
    fields = [
        (row.name, row.number, row.organization, row.number, row.wkt1, row.description, row.wkt2)
        for row in rows
    ]
    db.executemany("INSERT INTO gpkg_spatial_ref_sys VALUES (?, ?, ?, ?, ?, ?, ?)", fields)
    box = [None] * 4
    if len(coordinates):
        plane = coordinates[:, :2]
        box = [*plane.min(axis=0).tolist(), *plane.max(axis=0).tolist()]
    description = "; ".join(sentences(eo))
    contents = (
        "INSERT INTO gpkg_contents (table_name, data_type, identifier, description, min_x, min_y,"
        " max_x, max_y, srs_id, last_change)"
    )
    last_change = (utc(eo, "ms") or [GPS_EPOCH_ISO])[-1]  # not now: the same content, the same file
    for table, kind in (("images", "POINT"), ("track", "LINESTRING")):
        db.execute(
            f"{contents} VALUES (?, 'features', ?, ?, ?, ?, ?, ?, ?, ?)",
            (table, table, description, *box, srs.number, last_change),
        )
        db.execute(
            "INSERT INTO gpkg_geometry_columns VALUES (?, 'geom', ?, ?, 1, 0)",
            (table, kind, srs.number),
        )


def _srs(eo: FramedOrientation) -> _Srs:
    """Return the row of the frame's CRS: its EPSG code where one code states it, else our own."""
    from pyproj import CRS
    from pyproj.exceptions import CRSError

    frame = eo.frame
    if frame.kind == TANGENT:
        return replace(UNDEFINED_CARTESIAN, description=frame.name)
    crs = CRS.from_user_input(frame.wkt or frame.crs)
    try:
        wkt1 = crs.to_wkt("WKT1_GDAL") or "undefined"
    except CRSError:  # WKT 1 has no CRS of three geographic axes
        wkt1 = "undefined"
    authority, _, code = frame.crs.partition(":")
    single = authority == "EPSG" and code.isdigit() and not crs.is_compound
    number, organization = (int(code), "EPSG") if single else (FIRST_OWN_ID, "insgnss")
    heights = f"heights {frame.heights}" if frame.scaled_from_m is None else "scaled heights"
    description = f"{frame.name}; {heights}"
    return _Srs(crs.name, number, organization, description, wkt1, crs.to_wkt())


def _header(srs: int, flags: int) -> np.ndarray:
    return np.frombuffer(
        b"GP\x00" + bytes([flags]) + np.array(srs, dtype="<i4").tobytes(), dtype=np.uint8
    )


def _points(coordinates: Array, srs: int) -> Iterator[bytes]:
    """Geometries of points with z, little endian, without envelope."""
    kind = np.dtype([("head", "u1", 8), ("order", "u1"), ("type", "<u4"), ("xyz", "<f8", 3)])
    out = np.zeros(len(coordinates), dtype=kind)
    out["head"], out["order"], out["type"], out["xyz"] = _header(srs, 1), 1, 1001, coordinates
    data, size = out.tobytes(), kind.itemsize
    return (data[k : k + size] for k in range(0, len(data), size))


def _line(coordinates: Array, srs: int) -> bytes:
    """Geometry of a line with z, little endian, with its envelope in x and y."""
    box = np.stack([coordinates[:, :2].min(axis=0), coordinates[:, :2].max(axis=0)], axis=1).astype(
        "<f8"
    )
    wkb = (
        b"\x01"
        + np.array([1002, len(coordinates)], dtype="<u4").tobytes()
        + coordinates.astype("<f8").tobytes()
    )
    return _header(srs, 3).tobytes() + box.tobytes() + wkb


def _rows(eo: FramedOrientation, coordinates: Array, srs: int) -> Iterator[tuple[object, ...]]:
    """Yield the row of each image: geometry, name, time, angles, sigmas, rotation, covariance."""
    reals = np.hstack(
        [all_angles(eo), position_sigma(eo), quaternion_from_rotation(eo.C_fc), eo.geodetic[:, 2:]]
    )
    covariance_form = json.dumps([["%.9g"] * 6] * 6).replace('"', "")
    for geometry, name, when, tow, row, covariance in zip(
        _points(coordinates, srs),
        eo.images,
        utc(eo, "ms"),
        eo.time.tolist(),
        reals.tolist(),
        eo.cov.reshape(-1, 36),
        strict=True,
    ):
        yield (
            geometry,
            name,
            when,
            eo.gps_week,
            tow,
            *row,
            covariance_form % tuple(covariance.tolist()),
        )
