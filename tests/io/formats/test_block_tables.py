"""Plain tables of an image block: there and back, and what is wrong is named."""

import re
from dataclasses import replace

import numpy as np
import pyproj
import pytest
from format_pages import on_page
from numpy.testing import assert_allclose

from insgnss.base.errors import InputError, UsageError
from insgnss.geodesy.frames import TangentPlane
from insgnss.io.formats.blocks.camera_toml import read_camera_toml, write_camera_toml
from insgnss.io.formats.blocks.ground_points import (
    GroundAxes,
    GroundTable,
    read_ground_points,
    write_ground_points,
)
from insgnss.io.formats.blocks.image_points import (
    ImagePoints,
    read_image_points,
    write_image_points,
)
from insgnss.io.formats.blocks.joined import join_block
from insgnss.io.formats.blocks.measured_block import of_table
from insgnss.records.block import INTERIOR, BrownCamera, GroundPoints, ImageObservations

READERS = {
    "image_points": read_image_points,
    "ground_points": read_ground_points,
    "camera_toml": read_camera_toml,
}


def measured(*rows):
    """Observations (image, point, x, y) of 0.5 px."""
    images = tuple(dict.fromkeys(row[0] for row in rows))
    points = tuple(dict.fromkeys(row[1] for row in rows))
    seen = ImageObservations(
        np.array([images.index(row[0]) for row in rows]),
        np.array([points.index(row[1]) for row in rows]),
        np.array([row[2:] for row in rows], dtype=float),
        np.full((len(rows), 2), 0.5),
    )
    return ImagePoints(images, points, seen)


def camera(**values):
    interior = np.array([values.get(name, 0.0) for name in INTERIOR])
    return BrownCamera("c", 5120, 3840, interior, values.get("backward", False), free=("f", "k1"))


def test_image_points_there_and_back(tmp_path) -> None:
    """Oracle: what was written, to half of its last digit; the names as they were."""
    before = measured(
        ("a b.tif", "1", 1.23456, 7.0), ("c.tif", "1", 3.0, 4.0), ("c.tif", "Tö", 5, 6)
    )
    sigma = np.array([[0.5, 0.25], [1.0, 1.0], [2.0, 3.0]])
    none = np.zeros(3)
    for now, rho in (
        (before.observations.sigma_px, none),
        (sigma, none),
        (sigma, np.array([0.5, -0.25, 0.0])),
    ):
        seen = replace(before.observations, sigma_px=now, correlation=rho)
        table = ImagePoints(before.images, before.points, seen)
        write_image_points(table, tmp_path / "points.csv")
        got = read_image_points(tmp_path / "points.csv")
        assert (got.images, got.points) == (table.images, table.points)
        assert got.observations.image.tolist() == [0, 1, 1]
        assert got.observations.point.tolist() == [0, 0, 1]
        assert np.abs(got.observations.uv - seen.uv).max() <= 0.5e-4
        assert got.observations.sigma_px.tolist() == now.tolist()
        assert got.observations.correlation.tolist() == rho.tolist()


def test_a_table_without_header_and_standard_deviations(tmp_path) -> None:
    """Oracle: the page's order of columns, and the caller's standard deviation."""
    (tmp_path / "p.txt").write_text("8001 17 10.5 20.25\n8002 17 30 40\n8002 18 50 60\n")
    got = read_image_points(tmp_path / "p.txt", sigma_px=0.3)
    assert got.images == ("8001", "8002")
    assert got.points == ("17", "18")  # the second is seen once
    assert got.observations.uv.tolist() == [[10.5, 20.25], [30.0, 40.0], [50.0, 60.0]]
    assert got.observations.sigma_px.tolist() == [[0.3, 0.3]] * 3
    assert read_image_points(tmp_path / "p.txt").observations.sigma_px.max() == 1.0


@pytest.mark.parametrize(
    ("page", "old", "new", "message"),
    [
        ("image_points", "y,sigma", "y,sigmapx", ":2: column 'sigmapx' is unknown; did you mean"),
        ("image_points", "x,y,sigma", "x,z,sigma", "does not name y"),
        (
            "image_points",
            "x,y,sigma",
            "x[mm],y[mm],sigma",
            ":2: column 'x[mm]' is in 'mm', but must be in px",
        ),
        ("image_points", "2570.5688", "nan", ":3: 'nan' where a finite number must stand"),
        ("image_points", "2561.0327", "right", ":4: 'right' where a finite number must stand"),
        ("image_points", "412.5000,", "", ":5: 4 fields, expected 5"),
        ("image_points", ",0.2\n", ",-0.2\n", ":5: sigma -0.2 px; a standard deviation must be"),
        ("image_points", "8002.tif,G03", ",G03", ":5: the name of the image is missing"),
        (
            "image_points",
            "8002.tif,G03",
            "8002.tif,T000017",
            ":5: point 'T000017' is measured twice",
        ),
        ("ground_points", ",role", ",roll", ":2: column 'roll' is unknown; did you mean 'role'?"),
        (
            "ground_points",
            "x,y,z,",
            "x[ft],y[ft],z[ft],",
            ":2: column 'x[ft]' is in 'ft', but must be in m",
        ),
        ("ground_points", "sigma_z,", "", "does not have the 8 fields"),
        ("ground_points", ",check", ",checks", ":4: role 'checks'; did you mean 'check'?"),
        ("ground_points", "G04", "G03", ":4: point 'G03' is there twice, before in line 3"),
        ("ground_points", "88.0172", "inf", ":3: 'inf' where a finite number must stand"),
        ("camera_toml", 'model = "forward"\n', "", "model: is missing; it is forward or backward"),
        ("camera_toml", '"forward"', '"brown"', ":2: model: 'brown' is unknown"),
        ("camera_toml", "f = 5606.998", "f = 0", ":5: f: 0 px; it must be greater than zero"),
        ("camera_toml", "f = 5606.998", "f = nan", ":5: f: nan is outside 0 to 1e+06"),
        ("camera_toml", "cx = 2590.441\n", "", "cx: is missing"),
        ("camera_toml", "5120", "5120.5", ":3: width: 5120.5 px; it is a whole number"),
        ("camera_toml", '"forward"', '"backward"', "unit_px: is missing"),
        ("camera_toml", "k1 =", "unit_px = 156\nk1 =", ":8: unit_px: belongs to backward cameras"),
        ("camera_toml", '"f", "cx"', '"f", "c"', ":13: free: 'c' is unknown or given twice"),
        ("camera_toml", "cy = 1971.87", "cy = '1971'", ":7: cy: '1971' is a text"),
    ],
)
def test_what_is_wrong_is_named(page, old, new, message, tmp_path) -> None:
    """Oracle: the fault that was written into the page's example."""
    text = on_page(page)
    assert old in text
    (tmp_path / "x").write_text(text.replace(old, new, 1))
    with pytest.raises(InputError, match=re.escape(message)) as refusal:
        READERS[page](tmp_path / "x")
    assert "\n" not in str(refusal.value)


def test_a_correlation_that_cannot_be_is_named(tmp_path) -> None:
    """Oracle: a correlation of one leaves no redundancy between both coordinates."""
    (tmp_path / "x").write_text("image,point,x,y,sigma,rho\na,1,2,3,1,0.9\na,2,2,3,1,-1\n")
    with pytest.raises(InputError, match=":3: correlation -1; it must be between -1 and 1"):
        read_image_points(tmp_path / "x")


def test_columns_that_nobody_knows_are_left_out_when_told(tmp_path) -> None:
    """Oracle: the page's words on `columns`."""
    (tmp_path / "x").write_text("image,point,x,y,quality\na,1,2,3,0.9\n")
    with pytest.raises(InputError, match="'quality' is unknown"):
        read_image_points(tmp_path / "x")
    got = read_image_points(tmp_path / "x", columns=["image", "point", "x", "y", "-"])
    assert got.observations.uv.tolist() == [[2.0, 3.0]]


def test_ground_points_there_and_back(tmp_path) -> None:
    """Oracle: what was written, to half of its last digit."""
    sigma = np.array([[0.01, 0.02, 0.03], [0.1, 0.1, 0.2]])
    before = GroundTable(
        ("a", "b"),
        np.array([[1.23456, 2.0, 3.0], [-4.0, 5.0, 6.0]]),
        sigma[:, :, None] ** 2 * np.eye(3),
        np.array([False, True]),
    )
    write_ground_points(before, tmp_path / "g.csv", ["tangent plane"])
    got = read_ground_points(tmp_path / "g.csv")
    assert got.points == before.points
    assert got.check.tolist() == [False, True]
    assert np.abs(got.position_m - before.position_m).max() <= 0.5e-4
    assert np.sqrt(np.diagonal(got.cov, axis1=1, axis2=2)) == pytest.approx(sigma, rel=1e-12)


def test_ground_points_of_a_projected_crs(tmp_path) -> None:
    """Oracle: pyproj's transformation to WGS84 and its topocentric pipeline; the sigmas of east and
    north exchange places where the grid is turned by nothing but 1 deg of convergence, and stay
    what they are to (1 deg)^2.
    """
    plane = TangentPlane(np.radians(46.57), np.radians(6.54), 0.0)
    write_ground_points(
        GroundTable(
            ("a", "b"),
            np.array([[311500.0, 5160600.0, 510.0], [312500.0, 5161400.0, 530.0]]),
            np.tile(np.diag([0.01, 0.02, 0.03]) ** 2, (2, 1, 1)),
            np.zeros(2, dtype=bool),
        ),
        tmp_path / "utm.csv",
    )
    got = read_ground_points(tmp_path / "utm.csv").in_plane(GroundAxes("EPSG:32632"), plane)
    back = pyproj.Transformer.from_crs("EPSG:32632", "EPSG:4326", always_xy=True)
    lon, lat = back.transform([311500.0, 312500.0], [5160600.0, 5161400.0])
    topocentric = pyproj.Transformer.from_pipeline(
        "+proj=pipeline +step +proj=cart +ellps=WGS84 +step +proj=topocentric +ellps=WGS84"
        " +lat_0=46.57 +lon_0=6.54 +h_0=0"
    )
    want = np.stack(topocentric.transform(lon, lat, [510.0, 530.0]), axis=-1)
    assert np.abs(got.position_m - want).max() < 1e-5
    gamma = np.radians(6.54 - 9.0) * np.sin(np.radians(46.57))  # of the central meridian 9 deg
    C = np.array([[np.cos(gamma), np.sin(gamma), 0], [-np.sin(gamma), np.cos(gamma), 0], [0, 0, 1]])
    turned = C @ np.diag([0.01, 0.02, 0.03]) ** 2 @ C.T
    assert np.abs(got.cov - turned).max() < 1e-3 * 0.03**2


@pytest.mark.parametrize(
    ("feet", "metric", "foot"),
    [("EPSG:6492", "EPSG:6491", 1200 / 3937), ("EPSG:6557", "EPSG:6556", 0.3048)],
)
def test_ground_points_in_feet(tmp_path, feet, metric, foot) -> None:
    """Oracle: the same place in the sibling of the CRS that counts in metres; sigmas in feet."""
    lon, lat = (-71.06, 42.36) if feet == "EPSG:6492" else (-123.0, 44.5)
    plane = TangentPlane(np.radians(lat), np.radians(lon), 0.0)
    e, n = pyproj.Transformer.from_crs("EPSG:6319", metric, always_xy=True).transform(lon, lat)
    sigma = np.array([0.01, 0.02, 0.03])
    for name, unit in (("feet", foot), ("metric", 1.0)):
        x, P = np.array([[e, n, 50.0]]) / unit, np.diag(sigma / unit)[None] ** 2
        table = GroundTable(("a",), x, P, np.zeros(1, dtype=bool))
        write_ground_points(table, tmp_path / f"{name}.csv")
    got, want = (
        read_ground_points(tmp_path / f"{name}.csv").in_plane(GroundAxes(crs), plane)
        for name, crs in (("feet", feet), ("metric", metric))
    )
    assert np.abs(got.position_m - want.position_m).max() < 1e-4
    assert np.abs(got.cov - want.cov).max() < 1e-3 * 0.03**2
    assert ("feet" in GroundAxes(feet).unit_note, GroundAxes(metric).unit_note) == (True, "")


def test_a_camera_there_and_back_bit_by_bit(tmp_path) -> None:
    """Oracle: the numbers that were written."""
    rng = np.random.default_rng(1)
    interior = np.concatenate([[5607.123456789], rng.normal(size=10)])
    for backward, unit in ((False, 1.0), (True, 156.25)):
        before = BrownCamera('a "b"', 5120, 3840, interior, backward, unit, ("f", "k1"))
        write_camera_toml(before, tmp_path / "c.toml")
        got = read_camera_toml(tmp_path / "c.toml")
        assert got.interior.tolist() == interior.tolist()
        assert (got.name, got.width, got.height) == ('a "b"', 5120, 3840)
        assert (got.backward, got.unit_px, got.free) == (backward, unit, ("f", "k1"))


def test_the_origin_of_pixels(tmp_path) -> None:
    """Oracle: the page: counted from the centre of the first pixel, a coordinate is less by 0.5."""
    (tmp_path / "a.toml").write_text(on_page("camera_toml"))
    (tmp_path / "b.toml").write_text('pixel_origin = "centre"\n' + on_page("camera_toml"))
    a, b = (read_camera_toml(tmp_path / f"{name}.toml").interior for name in "ab")
    assert (b - a).tolist() == [0.0, 0.5, 0.5] + [0.0] * 8


def test_tables_are_joined_by_names() -> None:
    """Oracle: the rows as they were named here; ground points that no image shows are left out."""
    seen = measured(
        ("a", "t", 1.0, 2.0), ("b", "t", 3.0, 4.0), ("b", "g", 5.0, 6.0), ("a", "c", 7, 8)
    )
    ground = GroundTable(
        ("c", "nowhere", "g"),
        np.arange(9.0).reshape(3, 3),
        np.tile(np.eye(3), (3, 1, 1)),
        np.array([True, False, False]),
    )
    block = join_block(of_table(seen, camera(f=5600.0)), ground).block
    assert block.points == ("t", "g", "c")
    assert block.control.point.tolist() == [1]
    assert block.control.position_m.tolist() == [[6.0, 7.0, 8.0]]
    assert block.check.point.tolist() == [2]
    assert not block.oriented.any()
    with pytest.raises(
        InputError, match="no ground point is measured in any image: 'c' is missing"
    ):
        join_block(of_table(measured(("a", "t", 1.0, 2.0)), camera(f=5600.0)), ground)


@pytest.mark.parametrize("pixel", [(-12.0, 5.0), (5121.5, 5.0), (5.0, 3842.0)])
def test_what_lies_beside_the_image_is_refused(pixel) -> None:
    """Oracle: the size of the image; the border itself belongs to it."""
    with pytest.raises(
        InputError, match=re.escape("lies outside the image of 5120 x 3840 pixels (1 of 2")
    ):
        join_block(
            of_table(measured(("a", "t", 0.0, 3840.0), ("b", "t", *pixel)), camera(f=5600.0))
        )


def test_names_that_need_quotation_marks_and_those_that_no_table_holds(tmp_path) -> None:
    """Oracle: the names that were written; the rules of text tables."""
    given = measured(('a "b", c.jpg', "a,b", 1, 2), ("#1", "'p'", 3, 4))
    write_image_points(given, tmp_path / "x")
    back = read_image_points(tmp_path / "x")
    assert (set(back.images), set(back.points)) == (set(given.images), set(given.points))
    with pytest.raises(InputError, match=r"point name 'a\\nb' has a line end"):
        write_image_points(measured(("a", "a\nb", 1, 2)), tmp_path / "x")
    with pytest.raises(UsageError, match="the directory does not exist"):
        write_camera_toml(camera(f=1.0), tmp_path / "no" / "x")


GROUND_HEAD = "point,x,y,z,sigma_x,sigma_y,sigma_z,role\n"


def test_coordinates_that_are_not_known_are_empty(tmp_path):
    """Oracle: by hand: medians of the others and sigmas of 10 km in their place."""
    path = tmp_path / "ground.csv"
    rows = "A,1,2,3,.1,.1,.1,control\nB,,,5,,,.1,control\nC,7,8,-,.2,.2,-,control\n"
    path.write_text(GROUND_HEAD + rows)
    ground = read_ground_points(path)
    assert_allclose(ground.position_m, [[1, 2, 3], [4, 5, 5], [7, 8, 4]])
    sigma = np.sqrt(np.diagonal(ground.cov, axis1=1, axis2=2))
    assert_allclose(sigma, [[0.1, 0.1, 0.1], [1e4, 1e4, 0.1], [0.2, 0.2, 1e4]])
    points = GroundPoints(np.arange(3), ground.position_m, ground.cov)
    assert points.unknown.tolist() == [[False] * 3, [True, True, False], [False, False, True]]
    assert points.complete.point.tolist() == [0]


@pytest.mark.parametrize(
    ("rows", "message"),
    [
        ("B,,7,5,,,.1,control", "one of x and y alone"),
        ("B,,,,,,,control", "no coordinate; give plan or height"),
        ("B,,,5,,,.1,check", "a check point needs all its coordinates"),
        ("B,1,2,3,.1,.1,,control", "'' where a finite number must stand"),
    ],
)
def test_coordinates_that_are_known_in_no_part_are_refused(rows, message, tmp_path):
    """Oracle: the rules by hand, with the line."""
    path = tmp_path / "ground.csv"
    path.write_text(f"{GROUND_HEAD}A,1,2,3,.1,.1,.1,control\n{rows}\n")
    with pytest.raises(InputError, match=f":3: {re.escape(message)}"):
        read_ground_points(path)
