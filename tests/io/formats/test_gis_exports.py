"""GeoJSON, KML, GeoPackage and RTKLIB's .pos: read by minimal readers of their specifications; the
traps of heights and of time.
"""

import json
import sqlite3
import struct
import xml.etree.ElementTree as ET
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from ba_scene import (
    Array,
    D,
    Place,
    assert_reprojects,
    block,
    boresight,
    enu_axes,
    exterior,
    framed,
    to_ecef,
    worked,
)
from draws import normal_draws
from format_pages import on_page
from numpy.testing import assert_allclose
from pyproj import CRS
from scipy.spatial.transform import Rotation

from insgnss.base.errors import InputError, UsageError
from insgnss.io.formats.exports import EXPORTS
from insgnss.io.formats.gis.geojson import cut_at_antimeridian, write_geojson
from insgnss.io.formats.gis.geopackage import write_geopackage
from insgnss.io.formats.gis.kml import camera_angles, write_kml
from insgnss.io.formats.gnss.rtklib_pos import read_rtklib_pos
from insgnss.io.formats.gnss.rtklib_pos_write import antenna_fixes, write_antenna_pos
from insgnss.navigation.orient.frame import in_frame
from insgnss.records import FramedOrientation, Trajectory
from insgnss.records.cameras.mounting import Mounting

UNDULATION = 49.6  # m, about that of the test field
KML = "{http://www.opengis.net/kml/2.2}"
FRAMES = ["tangent plane", "geocentric", "geographic", "EPSG:2056", "EPSG:32632"]
# 199 800 s of GPS week 2008 are 07:30:00 GPST, of the third day; UTC lags 18 s behind
UTC_0 = "2018-07-03T07:29:42"


def opk(values: list[float]) -> Array:
    """Camera (x right, y down) of omega phi kappa in rad: scipy's intrinsic XYZ, then D."""
    return Rotation.from_euler("XYZ", values).as_matrix() @ D


def true_north(values: list[float]) -> Array:
    """Camera of yaw pitch roll in degrees: Rz(-yaw) Rx(pitch) Ry(roll), then D."""
    return (
        Rotation.from_euler("ZXY", [-values[0], values[1], values[2]], degrees=True).as_matrix() @ D
    )


# --- GeoJSON ---


@pytest.mark.parametrize("where", FRAMES)
def test_geojson_reprojects_from_every_frame(tmp_path: Path, where: str) -> None:
    """Oracle: RFC 7946: longitude, latitude, height above the ellipsoid; yaw, pitch, roll to true
    north.
    """
    eo = block()
    write_geojson(framed(eo, where), tmp_path / "a.geojson")
    *points, line = json.loads((tmp_path / "a.geojson").read_text())["features"]
    read = [
        (
            Place("geographic", np.array(f["geometry"]["coordinates"])),
            true_north(f["properties"]["ypr_deg"]),
            True,
        )
        for f in points
    ]
    assert_reprojects(eo, read)
    assert line["geometry"] == {
        "type": "LineString",
        "coordinates": [f["geometry"]["coordinates"] for f in points],
    }
    assert points[0]["properties"]["time_utc"] == f"{UTC_0}.000000Z"
    assert points[0]["properties"]["image"] == "8001.tif"


@pytest.mark.parametrize("where", ["EPSG:2056", "EPSG:32632"])
def test_geojson_of_orthority_reprojects(tmp_path: Path, where: str) -> None:
    """Oracle: orthority's dialect: xyz in `world_crs`, opk in radians, Rx Ry Rz of right, up, back;
    no feature but points.
    """
    eo = block()
    write_geojson(
        framed(eo, where), tmp_path / "a.geojson", dialect="orthority", camera='my "camera" 50%'
    )
    content = json.loads((tmp_path / "a.geojson").read_text())
    assert CRS(content["world_crs"]).to_authority() == tuple(where.split(":"))
    properties = [f["properties"] for f in content["features"]]
    assert_reprojects(
        eo, [(Place(where, np.array(p["xyz"])), opk(p["opk"]), False) for p in properties]
    )
    assert {p["camera"] for p in properties} == {'my "camera" 50%'}


@pytest.mark.parametrize(
    ("longitudes", "pieces"),
    [
        (
            [179.998, 179.9995, -179.999, -179.998],
            [[179.998, 179.9995, 180], [-180, -179.999, -179.998]],
        ),
        ([-179.999, 179.999, -179.999], [[-179.999, -180], [180, 179.999, 180], [-180, -179.999]]),
        ([179.999, 180.0, -179.999], [[179.999, 180], [-180, -179.999]]),
        ([180.0, -179.999, -179.998], [[-180, -179.999, -179.998]]),
        ([6.5, 6.6], [[6.5, 6.6]]),
        ([-180.0], []),
    ],
)
def test_a_track_is_cut_at_the_antimeridian(
    longitudes: list[float], pieces: list[list[float]]
) -> None:
    """Oracle: RFC 7946 3.1.9, by hand; latitude and height are linear along the way."""
    x = np.array([[lon, -17.0 + 0.1 * k, 100.0 + k] for k, lon in enumerate(longitudes)])
    cut = cut_at_antimeridian(x)
    assert [line[:, 0].tolist() for line in cut] == pieces
    east = np.unwrap(np.array(longitudes), period=360.0)
    for line in cut:
        lon = line[:, 0] + 360.0 * np.round((east.mean() - line[:, 0]) / 360.0)
        if np.all(np.diff(east) > 0.0):
            assert_allclose(line[:, 1], np.interp(lon, east, x[:, 1]), atol=1e-9)
            assert_allclose(line[:, 2], np.interp(lon, east, x[:, 2]), atol=1e-7)


def test_geojson_across_the_antimeridian(tmp_path: Path) -> None:
    """Oracle: json, and RFC 7946: no part of a line is longer than half the Earth."""
    position = np.array([[60.0 * k - 90.0, 5.0 * k, 100.0] for k in range(4)])
    eo = exterior(np.broadcast_to(D, (4, 3, 3)), position)
    eo = replace(eo, origin=np.array([*np.radians([-17.0, 180.0]), 0.0]))
    write_geojson(in_frame(eo, "geographic"), tmp_path / "a.geojson")
    *points, line = json.loads((tmp_path / "a.geojson").read_text())["features"]
    assert len(points) == 4
    assert line["geometry"]["type"] == "MultiLineString"
    first, second = (np.array(piece) for piece in line["geometry"]["coordinates"])
    assert first[-1, 0] == 180.0
    assert second[0, 0] == -180.0
    assert (first[-1, 1:] == second[0, 1:]).all()
    assert max(np.abs(np.diff(piece[:, 0])).max() for piece in (first, second)) < 1e-3


def test_geojson_covariance(tmp_path: Path) -> None:
    """Oracle: the geographic frame's own covariance, written from a projected one; names that JSON
    must quote.
    """
    eo = replace(framed(block(), "EPSG:32632"), images=('a"b.tif', "ü.tif", "c\\.tif"))
    write_geojson(eo, tmp_path / "a.geojson")
    features = json.loads((tmp_path / "a.geojson").read_text())["features"]
    assert tuple(f["properties"].get("image") for f in features[:3]) == eo.images
    full = np.zeros((6, 6))
    full[np.triu_indices(6)] = features[2]["properties"]["cov6_enu"]
    P = framed(block(), "geographic").cov[2]
    assert_allclose(full, np.triu(P), rtol=1e-7, atol=1e-12)
    assert_allclose(features[2]["properties"]["sigma_enu_m"], np.sqrt(np.diag(P))[:3], atol=0.51e-5)


def test_geojson_refusals(tmp_path: Path) -> None:
    """Oracle: orthority's frame and the two dialects."""
    with pytest.raises(UsageError, match="geojson of orthority cannot carry a geographic frame"):
        write_geojson(framed(block(), "geographic"), tmp_path / "x", dialect="orthority")
    eo = framed(block(), "geographic")
    with pytest.raises(UsageError, match="dialect 'geo' is none of"):
        write_geojson(eo, tmp_path / "x", dialect="geo")  # type: ignore[arg-type]
    eo = framed(block(), "EPSG:2056")
    with pytest.raises(UsageError, match="names northing first"):
        write_geojson(
            replace(eo, frame=replace(eo.frame, northing_first=True)),
            tmp_path / "x",
            dialect="orthority",
        )
    assert not list(tmp_path.iterdir())


# --- KML ---


@pytest.mark.parametrize("where", FRAMES)
def test_kml_reprojects_and_stands_above_sea_level(tmp_path: Path, where: str) -> None:
    """Oracle: KML's camera: heading about Z, tilt about X, roll about Z again, axes right, up,
    back; altitude + geoid = ellipsoid.
    """
    eo = block()
    write_kml(framed(eo, where), tmp_path / "a.kml", undulation_m=UNDULATION)
    read = []
    for camera in ET.parse(tmp_path / "a.kml").iter(f"{KML}Camera"):
        lon, lat, alt, heading, tilt, roll = (float(e.text or "") for e in list(camera)[:6])
        assert camera[6].text == "absolute"
        R = Rotation.from_euler("ZXZ", [-heading, tilt, roll], degrees=True).as_matrix()
        read.append((Place("geographic", np.array([lon, lat, alt + UNDULATION])), R @ D, True))
    assert_reprojects(eo, read)


def test_kml_document(tmp_path: Path) -> None:
    """Oracle: the schema's order of elements, UTC, the track at the photos' places, text that XML
    must escape.
    """
    eo = replace(framed(block(), "geographic"), images=("a&b.tif", "c<d>.tif", "e.tif"))
    write_kml(eo, tmp_path / "a.kml", undulation_m=[UNDULATION, UNDULATION + 0.1, UNDULATION + 0.2])
    root = ET.parse(tmp_path / "a.kml").getroot()
    photos = [p for p in root.iter(f"{KML}Placemark") if p.find(f"{KML}Camera") is not None]
    assert tuple(p.findtext(f"{KML}name") for p in photos) == eo.images
    assert [e.tag.removeprefix(KML) for e in photos[0]] == [
        "name",
        "Camera",
        "TimeStamp",
        "styleUrl",
        "ExtendedData",
        "Point",
    ]
    assert photos[0].findtext(f"{KML}TimeStamp/{KML}when") == f"{UTC_0}.000000Z"
    line = next(root.iter(f"{KML}LineString")).findtext(f"{KML}coordinates") or ""
    assert line.split() == [p.findtext(f"{KML}Point/{KML}coordinates") for p in photos]
    heights = [float(x.split(",")[2]) for x in line.split()]
    assert_allclose(heights, eo.geodetic[:, 2] - UNDULATION - [0.0, 0.1, 0.2], atol=0.51e-4)


def test_kml_needs_a_geoid(tmp_path: Path) -> None:
    """Oracle: the 50 m between ellipsoid and sea level; geoid heights on Earth lie within 110 m."""
    eo = framed(block(), "geographic")
    with pytest.raises(
        UsageError, match="kml takes heights above mean sea level; give the geoid's heights"
    ):
        write_kml(eo, tmp_path / "a.kml")
    with pytest.raises(InputError, match="undulation_m: 2 geoid heights for 3 images"):
        write_kml(eo, tmp_path / "a.kml", undulation_m=[49.0, 50.0])
    with pytest.raises(InputError, match="undulation_m: 630 m is no geoid height"):
        write_kml(eo, tmp_path / "a.kml", undulation_m=[49.0, 630.0, 50.0])
    with pytest.raises(InputError, match="undulation_m: nan m is no geoid height"):
        write_kml(eo, tmp_path / "a.kml", undulation_m=float("nan"))
    with pytest.raises(UsageError, match="undulation_m: 'egm96' is no height of a geoid"):
        write_kml(eo, tmp_path / "a.kml", undulation_m="egm96")
    assert not list(tmp_path.iterdir())


def test_kml_without_a_geoid(tmp_path: Path) -> None:
    """Oracle: KML 2.2: altitudes above the ground are those above the ellipsoid less its height; a
    clamped track has none, and no cameras that would lie in the grass.
    """
    eo = framed(block(), "geographic")
    write_kml(eo, tmp_path / "r.kml", altitude="relative", ground_m=500.0)
    root = ET.parse(tmp_path / "r.kml").getroot()
    assert {e.text for e in root.iter(f"{KML}altitudeMode")} == {"relativeToGround"}
    cameras = [float(e.findtext(f"{KML}altitude") or "nan") for e in root.iter(f"{KML}Camera")]
    assert_allclose(cameras, eo.geodetic[:, 2] - 500.0, atol=0.51e-4)
    assert "altitudes: above the ground" in (root.findtext(f".//{KML}description") or "")
    write_kml(eo, tmp_path / "c.kml", altitude="clamped")
    root = ET.parse(tmp_path / "c.kml").getroot()
    assert {e.text for e in root.iter(f"{KML}altitudeMode")} == {"clampToGround"}
    assert root.find(f".//{KML}Camera") is None
    assert len(list(root.iter(f"{KML}Point"))) == len(eo.images)
    height = root.find(f".//{KML}Data[@name='ellipsoidal_height_m']/{KML}value")
    assert height is not None
    assert float(height.text or "") == pytest.approx(eo.geodetic[0, 2], abs=1e-6)
    for options, message in (
        ({"altitude": "relative"}, "ground_m, the height of the ground above the ellipsoid"),
        ({"ground_m": 500.0}, "belongs to relative altitudes"),
        ({"altitude": "clamped", "undulation_m": 49.0}, "clamped altitudes need no geoid"),
        ({"altitude": "flat"}, "altitude 'flat' is none of absolute, relative, clamped"),
    ):
        with pytest.raises(UsageError, match=message):
            write_kml(eo, tmp_path / "x.kml", **options)  # type: ignore[arg-type]
    with pytest.raises(InputError, match="ground_m 5000 m is not below the images"):
        write_kml(eo, tmp_path / "x.kml", altitude="relative", ground_m=5000.0)
    assert not (tmp_path / "x.kml").exists()


def test_kml_angles_of_known_cameras() -> None:
    """Oracle: by hand: nadir with the top to the east; looking north, 30 deg below the horizon,
    level; the same, right side down.
    """
    nadir_east = np.array(
        [[0.0, 1, 0], [-1, 0, 0], [0, 0, 1]]
    )  # right is south, up is east, back is up
    c, s = np.cos(np.radians(30)), np.sin(np.radians(30))
    north = np.column_stack([[1.0, 0, 0], [0, s, c], [0, -c, s]])
    bank = (
        north @ Rotation.from_euler("z", -10, degrees=True).as_matrix()
    )  # clockwise as the camera sees itself
    got = np.degrees(camera_angles(np.stack([nadir_east, north, bank])))
    assert_allclose(got, [[90, 0, 0], [0, 60, 0], [0, 60, -10]], rtol=0, atol=1e-9)


# --- GeoPackage ---


def opened(path: Path) -> sqlite3.Connection:
    db = sqlite3.connect(path)
    db.row_factory = sqlite3.Row
    return db


def geometry(blob: bytes) -> tuple[int, int, Array]:
    """Reference system, type and coordinates of a GeoPackage geometry (12-128r17, 2.1.3; little
    endian).
    """
    assert blob[:3] == b"GP\x00"
    assert blob[3] & 1
    (srs,) = struct.unpack_from("<i", blob, 4)
    at = 8 + {0: 0, 1: 32}[(blob[3] >> 1) & 7]
    order, kind = struct.unpack_from("<BI", blob, at)
    assert order == 1
    start, n = (at + 5, 1) if kind == 1001 else (at + 9, struct.unpack_from("<I", blob, at + 5)[0])
    assert len(blob) == start + 24 * n
    return srs, kind, np.frombuffer(blob, "<f8", 3 * n, start).reshape(n, 3)


@pytest.mark.parametrize("where", ["tangent plane", "geographic", "EPSG:2056", "EPSG:32632"])
def test_geopackage_reprojects(tmp_path: Path, where: str) -> None:
    """Oracle: well-known binary by struct; omega phi kappa in the frame, the quaternion beside it,
    yaw pitch roll to true north.
    """
    eo = block()
    write_geopackage(framed(eo, where), tmp_path / "a.gpkg")
    db = opened(tmp_path / "a.gpkg")
    images = db.execute("SELECT * FROM images ORDER BY fid").fetchall()
    track = geometry(db.execute("SELECT geom FROM track").fetchone()[0])
    db.close()
    points = [geometry(row["geom"]) for row in images]
    assert {kind for _, kind, _ in points} == {1001}
    assert track[1] == 1002
    assert_allclose(track[2], np.vstack([x for _, _, x in points]), rtol=0, atol=0)
    by_opk, by_q, by_ypr = [], [], []
    for (_, _, x), row in zip(points, images, strict=True):
        place = Place(where, x[0])
        by_opk.append(
            (
                place,
                opk(np.radians([row["omega_deg"], row["phi_deg"], row["kappa_deg"]]).tolist()),
                False,
            )
        )
        by_q.append(
            (
                place,
                Rotation.from_quat([row["qx"], row["qy"], row["qz"], row["qw"]]).as_matrix(),
                False,
            )
        )
        own = enu_axes(*geodetic(where, x[0])[:2])  # true north at the image, whatever the frame
        by_ypr.append(
            (
                replaced_north(Place(where, x[0]), own),
                true_north([row["yaw_deg"], row["pitch_deg"], row["roll_deg"]]),
                True,
            )
        )
    for read in (by_opk, by_q, by_ypr):
        assert_reprojects(eo, read)
    assert images[0]["time_utc"] == f"{UTC_0}.000Z"
    assert_allclose(json.loads(images[2]["cov6"]), framed(eo, where).cov[2], rtol=1e-8)


def geodetic(where: str, x: Array) -> tuple[float, float, float]:
    lon, lat, h = Place("geographic", np.array([0.0, 0.0, 0.0]))._geodetic(where, x)
    return lat, lon, h


def replaced_north(place: Place, axes: Array) -> Place:
    place.north_axes = axes
    return place


@pytest.mark.parametrize(
    ("where", "code"), [("tangent plane", -1), ("geographic", 4979), ("EPSG:2056", 2056)]
)
def test_geopackage_is_valid(tmp_path: Path, where: str, code: int) -> None:
    """Oracle: requirements 1, 2, 5 to 7, 10 to 14, 21 to 31 and 115 of OGC 12-128, as far as a
    feature table has them.
    """
    write_geopackage(framed(block(), where), tmp_path / "a.gpkg")
    head = (tmp_path / "a.gpkg").read_bytes()[:100]
    assert head[:16] == b"SQLite format 3\x00"
    assert head[68:72] == b"GPKG"
    assert struct.unpack(">I", head[60:64]) == (10300,)
    db = opened(tmp_path / "a.gpkg")
    assert db.execute("PRAGMA integrity_check").fetchone()[0] == "ok"
    assert db.execute("PRAGMA foreign_key_check").fetchall() == []
    srs = {row["srs_id"]: row for row in db.execute("SELECT * FROM gpkg_spatial_ref_sys")}
    assert (
        srs[-1]["organization"],
        srs[-1]["organization_coordsys_id"],
        srs[-1]["definition"],
    ) == ("NONE", -1, "undefined")
    assert (srs[0]["organization"], srs[0]["definition"]) == ("NONE", "undefined")
    assert (srs[4326]["organization"], srs[4326]["organization_coordsys_id"]) == ("EPSG", 4326)
    if code > 0:
        assert CRS(srs[code]["definition_12_063"]).to_epsg() == code
    contents = db.execute("SELECT * FROM gpkg_contents").fetchall()
    columns = {row["table_name"]: row for row in db.execute("SELECT * FROM gpkg_geometry_columns")}
    assert {row["table_name"] for row in contents} == set(columns) == {"images", "track"}
    assert {(row["data_type"], row["srs_id"]) for row in contents} == {("features", code)}
    assert {
        (name, row["geometry_type_name"], row["z"], row["m"]) for name, row in columns.items()
    } == {
        ("images", "POINT", 1, 0),
        ("track", "LINESTRING", 1, 0),
    }
    types = {row["type"] for table in columns for row in db.execute(f"PRAGMA table_info({table})")}
    assert types <= {"INTEGER", "POINT", "LINESTRING", "TEXT", "DATETIME", "DOUBLE"}
    keys = [row["name"] for row in db.execute("PRAGMA table_info(images)") if row["pk"]]
    assert keys == ["fid"]
    assert db.execute("SELECT extension_name, scope FROM gpkg_extensions").fetchone()[:] == (
        "gpkg_crs_wkt",
        "read-write",
    )
    x = np.vstack([geometry(row["geom"])[2] for row in db.execute("SELECT geom FROM images")])
    assert_allclose(
        [contents[0][name] for name in ("min_x", "min_y", "max_x", "max_y")],
        [*x.min(0)[:2], *x.max(0)[:2]],
        rtol=0,
        atol=0,
    )
    db.close()


def test_geopackage_of_a_compound_crs(tmp_path: Path) -> None:
    """Oracle: a CRS with heights has no single code, so it stands under a number of its own with
    its whole WKT.
    """
    eo = framed(block(), "EPSG:2056")
    eo = replace(
        eo, frame=replace(eo.frame, wkt=CRS("EPSG:2056+5728").to_wkt(), heights="LN02 height")
    )
    write_geopackage(eo, tmp_path / "a.gpkg")
    db = opened(tmp_path / "a.gpkg")
    row = db.execute(
        "SELECT * FROM gpkg_spatial_ref_sys WHERE srs_id NOT IN (-1, 0, 4326)"
    ).fetchone()
    db.close()
    assert row["organization"] == "insgnss"
    assert CRS(row["definition_12_063"]).sub_crs_list[1].to_epsg() == 5728
    assert "LN02 height" in row["description"]


def test_geopackage_refusals(tmp_path: Path) -> None:
    """Oracle: requirement 3 (.gpkg), and a frame that no map has."""
    with pytest.raises(UsageError, match=r"must be named \.gpkg"):
        write_geopackage(framed(block(), "EPSG:2056"), tmp_path / "a.db")
    with pytest.raises(UsageError, match="geopackage cannot carry a geocentric frame"):
        EXPORTS["geopackage"].write(framed(block(), "geocentric"), tmp_path / "a.gpkg")
    with pytest.raises(UsageError, match="does the directory exist"):
        write_geopackage(framed(block(), "EPSG:2056"), tmp_path / "no" / "a.gpkg")
    assert not list(tmp_path.iterdir())


def test_no_image_at_all(tmp_path: Path) -> None:
    """Oracle: an empty flight is a file without features, in every format."""
    eo = framed(exterior(np.zeros((0, 3, 3)), np.zeros((0, 3))), "geographic")
    write_geojson(eo, tmp_path / "a.geojson")
    assert json.loads((tmp_path / "a.geojson").read_text())["features"] == []
    write_kml(eo, tmp_path / "a.kml", undulation_m=UNDULATION)
    assert ET.parse(tmp_path / "a.kml").find(f".//{KML}Placemark") is None
    write_geopackage(eo, tmp_path / "a.gpkg")
    db = opened(tmp_path / "a.gpkg")
    assert (
        db.execute(
            "SELECT (SELECT count(*) FROM images) + (SELECT count(*) FROM track)"
        ).fetchone()[0]
        == 0
    )
    db.close()


# --- antenna positions ---

ANTENNA = np.array([0.462, -0.001, -0.065])  # Table 1 of paper 000, from the camera, in its axes


def enu_of(eo: FramedOrientation, k: int) -> tuple[Array, Array]:
    """ECEF of the projection centre and east, north, up there, from pyproj."""
    lat, lon = np.degrees(eo.geodetic[k, :2])
    return to_ecef(lon, lat, eo.geodetic[k, 2]), enu_axes(lat, lon)


@pytest.mark.parametrize("where", FRAMES)
def test_antenna_of_images(where: str) -> None:
    """Oracle: X_ant = X_cam + R_c a (formats.md 0) in ECEF by pyproj; Monte Carlo of its covariance
    (4000 draws).
    """
    eo = framed(block(), where)
    got = antenna_fixes(eo, ANTENNA)
    x, A = enu_of(eo, 1)
    C = eo.C_fE[1].T @ eo.C_fc[1]
    antenna = to_ecef(np.degrees(got.lon[1]), np.degrees(got.lat[1]), got.height[1])
    assert_allclose(antenna, x + A @ C @ ANTENNA, rtol=0, atol=1e-6)
    turn = np.kron(np.eye(2), eo.C_fE[1].T)
    e = normal_draws(turn @ eo.cov[1] @ turn.T, 4000, seed=4)
    moved = e[:, :3] + Rotation.from_rotvec(e[:, 3:]).apply(C @ ANTENNA)
    P = np.cov(moved[:, [1, 0, 2]].T) * np.outer([1, 1, -1], [1, 1, -1])
    scale = np.sqrt(np.diag(P))
    assert_allclose(got.cov_ned[1] / np.outer(scale, scale), P / np.outer(scale, scale), atol=0.003)


def test_antenna_of_a_trajectory_is_that_of_its_images() -> None:
    """Oracle: two ways through the mounting of paper 000: from the IMU in body axes, from the
    camera in its own.
    """
    mounting = Mounting(ANTENNA, np.array([0.113, 0.020, 0.0]), np.diag([-1.0, -1, 1]), boresight())
    C_nb = Rotation.from_euler("ZYX", [[40.0, -3, 5]], degrees=True).as_matrix()
    place = (np.radians([46.57]), np.radians([6.54]), np.array([630.0]))
    imu = Trajectory(np.array([2e5]), *place, np.zeros((1, 3)), C_nb, np.eye(9)[None] * 1e-4, 2008)
    got = antenna_fixes(imu, mounting.antenna_lever_b)
    S = np.array([[0.0, 1, 0], [1, 0, 0], [0, 0, -1]])
    A, x = enu_axes(46.57, 6.54), to_ecef(6.54, 46.57, 630.0)
    C = S @ C_nb[0] @ mounting.C_cb.T
    antenna = x + A @ S @ C_nb[0] @ mounting.camera_lever_b + A @ C @ ANTENNA
    assert_allclose(
        to_ecef(np.degrees(got.lon[0]), np.degrees(got.lat[0]), got.height[0]),
        antenna,
        rtol=0,
        atol=1e-6,
    )


def test_antenna_file_as_rtklib_reads_it(tmp_path: Path) -> None:
    """Oracle: RTKLIB's solution.c, which takes fields by their place: lat lon h Q ns, six roots,
    age, ratio; our reader of .pos.
    """
    eo = framed(block(), "EPSG:32632")
    object.__setattr__(eo, "time", np.array([604799.0, 604800.3, 604801.6]))
    write_antenna_pos(eo, tmp_path / "a.pos", lever_m=ANTENNA, quality=2)
    fixes = antenna_fixes(eo, ANTENNA)
    lines = [
        line.split()
        for line in (tmp_path / "a.pos").read_text().splitlines()
        if not line.startswith("%")
    ]
    for k, fields in enumerate(lines):
        assert len(fields) == 15
        lat, lon, h, Q, ns, sdn, sde, sdu, sdne, sdeu, sdun, age, ratio = (
            float(v) for v in fields[2:]
        )
        assert_allclose([lat, lon], np.degrees([fixes.lat[k], fixes.lon[k]]), rtol=0, atol=0.51e-10)
        assert (h, Q, ns, age, ratio) == (pytest.approx(fixes.height[k], abs=0.51e-4), 2, 0, 0, 0)
        c = fixes.cov_ned[k] * np.outer([1, 1, -1], [1, 1, -1])
        want = np.array([c[0, 0], c[1, 1], c[2, 2], c[0, 1], c[1, 2], c[0, 2]])
        roots = np.array([sdn, sde, sdu, sdne, sdeu, sdun])
        assert_allclose(np.sign(roots) * roots**2, want, atol=2e-7)
    assert [line[:2] for line in lines] == [
        ["2008", "604799.000000"],
        ["2009", "0.300000"],
        ["2009", "1.600000"],
    ]
    write_antenna_pos(eo, tmp_path / "b.pos", lever_m="0.462,-0.001,-0.065", quality=2)
    assert (tmp_path / "b.pos").read_text() == (tmp_path / "a.pos").read_text()
    back = read_rtklib_pos(tmp_path / "a.pos")
    assert_allclose(back.time, eo.time, rtol=0, atol=1e-6)
    assert_allclose(back.cov_ned, fixes.cov_ned, atol=2e-7)
    assert set((back.quality if back.quality is not None else np.zeros(0)).tolist()) == {2}


def test_antenna_refusals(tmp_path: Path) -> None:
    """Oracle: RTKLIB's codes; three numbers of a vector."""
    eo = framed(block(), "geographic")
    with pytest.raises(UsageError, match="rtklib_pos holds antenna positions; give the lever arm"):
        write_antenna_pos(eo, tmp_path / "a.pos")
    with pytest.raises(UsageError, match=r"lever_m: '0\.4,0\.1' is not three numbers in m"):
        write_antenna_pos(eo, tmp_path / "a.pos", lever_m="0.4,0.1")
    with pytest.raises(UsageError, match="quality 0 is none of RTKLIB's"):
        write_antenna_pos(eo, tmp_path / "a.pos", lever_m=ANTENNA, quality=0)
    assert not list(tmp_path.iterdir())


# --- the pages ---


def test_the_page_lists_the_columns_that_are_written(tmp_path: Path) -> None:
    """Oracle: data_specs/geopackage.md."""
    write_geopackage(worked("EPSG:2056"), tmp_path / "x.gpkg")
    db = opened(tmp_path / "x.gpkg")
    columns = [f"{row['name']} {row['type']}" for row in db.execute("PRAGMA table_info(images)")]
    db.close()
    assert columns == on_page("geopackage", "columns").strip().split("\n")
