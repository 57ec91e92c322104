"""Geodetic, ECEF and local coordinates against pyproj and displacements of points."""

import numpy as np
import pytest
from numpy.testing import assert_allclose
from pyproj import Transformer

from insgnss.base.errors import InputError
from insgnss.geodesy.frames import (
    LocalFrame,
    TangentPlane,
    ecef_to_geodetic,
    geodetic_to_ecef,
    rotation_em,
    rotation_en,
)

NANOMETRE = 1e-9
ULP = 1.9e-9  # m, two units in the last place of an ECEF coordinate
EARTH_RADIUS = 6.4e6
CART = "+proj=cart +ellps=WGS84"


def points(h_low: float, h_high: float, n: int = 400) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    rng = np.random.default_rng(17)
    lat = np.concatenate(
        [np.arcsin(rng.uniform(-1, 1, n)), np.radians([-90.0, 90.0, 0.0, 89.9999, -1e-7])]
    )
    lon = np.concatenate(
        [rng.uniform(-np.pi, np.pi, n), np.radians([0.0, 0.0, 180.0, -179.0, 5.0])]
    )
    return lat, lon, rng.uniform(h_low, h_high, lat.size)


def pyproj_ecef(lat: np.ndarray, lon: np.ndarray, h: np.ndarray) -> np.ndarray:
    return np.stack(Transformer.from_pipeline(CART).transform(lon, lat, h, radians=True), axis=-1)


def test_ecef_is_pyprojs():
    """Oracle: pyproj +proj=cart."""
    lat, lon, h = points(-1000.0, 20000.0)
    assert_allclose(geodetic_to_ecef(lat, lon, h), pyproj_ecef(lat, lon, h), rtol=0, atol=2 * ULP)


@pytest.mark.parametrize(
    ("h_low", "h_high", "tol"), [(-1000.0, 20000.0, 2 * ULP), (2e5, 3e7, 1e-6)]
)
def test_geodetic_of_pyprojs_ecef(h_low, h_high, tol):
    """Oracle: geodetic coordinates from which pyproj made ECEF; rounding of ECEF at flying heights,
    a micrometre in space.
    """
    lat, lon, h = points(h_low, h_high)
    lat_out, lon_out, h_out = ecef_to_geodetic(pyproj_ecef(lat, lon, h))
    assert_allclose((lat_out - lat) * EARTH_RADIUS, 0.0, atol=tol)
    assert_allclose((lon_out - lon) * np.cos(lat) * EARTH_RADIUS, 0.0, atol=tol)
    assert_allclose(h_out, h, rtol=0, atol=tol)


def test_shapes_follow_the_points():
    """Oracle: by contract, coordinates lie along a last axis that is added or taken away; inputs
    stay as they are.
    """
    lat, lon, h = np.full((2, 3), 0.8), 0.1, np.zeros(3)
    xyz = geodetic_to_ecef(lat, lon, h)
    assert xyz.shape == (2, 3, 3)
    assert geodetic_to_ecef(0.8, 0.1, 0.0).shape == (3,)
    assert ecef_to_geodetic(xyz)[0].shape == (2, 3)
    assert rotation_en(lat, lon).shape == (2, 3, 3, 3)
    assert (lat == 0.8).all()


def test_axes_are_directions_of_moving_points():
    """Oracle: central difference of pyproj's ECEF coordinates northward, eastward and upward; 1e-9
    from steps of 1e-5 rad and 10 m.
    """
    lat, lon, h, d = 0.81, -1.2, 300.0, 1e-5
    north = pyproj_ecef(lat + d, lon, h) - pyproj_ecef(lat - d, lon, h)
    east = pyproj_ecef(lat, lon + d, h) - pyproj_ecef(lat, lon - d, h)
    up = pyproj_ecef(lat, lon, h + 10.0) - pyproj_ecef(lat, lon, h - 10.0)
    north, east, up = (v / np.linalg.norm(v) for v in (north, east, up))
    assert_allclose(rotation_en(lat, lon), np.stack([north, east, -up], axis=1), rtol=0, atol=1e-9)
    assert_allclose(rotation_em(lat, lon), np.stack([east, north, up], axis=1), rtol=0, atol=1e-9)


def test_tangent_plane_is_pyprojs_topocentric():
    """Oracle: pyproj +proj=topocentric within 3 km; a nanometre and the rounding of ECEF."""
    plane = TangentPlane(np.radians(46.57), np.radians(6.54), 0.0)
    rng = np.random.default_rng(23)
    lat = plane.lat + rng.uniform(-5e-4, 5e-4, 50)
    lon, h = plane.lon + rng.uniform(-5e-4, 5e-4, 50), rng.uniform(400.0, 800.0, 50)
    pipeline = (
        f"+proj=pipeline +step {CART} +step +proj=topocentric +ellps=WGS84 +lat_0=46.57 +lon_0=6.54"
        " +h_0=0"
    )
    expected = np.stack(
        Transformer.from_pipeline(pipeline).transform(lon, lat, h, radians=True), axis=-1
    )
    enu = plane.position_from_geodetic(lat, lon, h)
    assert_allclose(enu, expected, rtol=0, atol=NANOMETRE + 2 * ULP)
    local = LocalFrame(plane.lat, plane.lon, plane.height)
    assert_allclose(
        local.position_from_geodetic(lat, lon, h),
        expected[:, [1, 0, 2]] * [1, 1, -1],
        rtol=0,
        atol=NANOMETRE + 2 * ULP,
    )
    for frame, position in ((plane, enu), (local, local.position_from_geodetic(lat, lon, h))):
        lat_out, lon_out, h_out = frame.geodetic_from_position(position)
        assert_allclose((lat_out - lat) * EARTH_RADIUS, 0.0, atol=3 * ULP)
        assert_allclose((lon_out - lon) * EARTH_RADIUS, 0.0, atol=4 * ULP)
        assert_allclose(h_out, h, rtol=0, atol=3 * ULP)


def test_axes_at_a_distant_point_seen_from_the_origin():
    """Oracle: formats.md C2, 1 km east at 46.57 deg: 32 arcsec of tilt and 34 arcsec of azimuth, as
    printed.

    The signs follow from the sphere: meridians converge, so north at the eastern point leans west
    (negative about down), and down leans back towards the origin's side (positive about north in
    the east, negative about east in the north).
    """
    from insgnss.geodesy.rotation import vector_from_rotation

    plane = TangentPlane(np.radians(46.57), np.radians(6.54), 0.0)
    local = LocalFrame(plane.lat, plane.lon, 0.0)
    lat, lon, _ = plane.geodetic_from_position([[1000.0, 0.0, 0.0], [0.0, 1000.0, 0.0]])
    psi = np.degrees(vector_from_rotation(local.C_ln(lat, lon))) * 3600.0
    assert_allclose(psi, [[32.3, 0.0, -34.1], [0.0, -32.4, 0.0]], atol=0.15)
    assert_allclose(
        local.C_ln_at(local.position_from_geodetic(lat, lon, 0.0)),
        local.C_ln(lat, lon),
        rtol=0,
        atol=1e-14,
    )


@pytest.mark.parametrize("frame", [TangentPlane(0.8, 0.1, 300.0), LocalFrame(0.8, 0.1, 300.0)])
def test_axes_from_ned_are_directions_of_moving_points(frame):
    """Oracle: central difference of positions in the frame at a point 10 km away, 1e-7 from 50 m
    steps at nanometre rounding.
    """
    lat, lon, h, d = 0.8012, 0.1017, 900.0, 1e-5
    at = frame.position_from_geodetic
    north, east = (
        at(lat + d, lon, h) - at(lat - d, lon, h),
        at(lat, lon + d, h) - at(lat, lon - d, h),
    )
    down = at(lat, lon, h - 60.0) - at(lat, lon, h + 60.0)
    expected = np.stack([v / np.linalg.norm(v) for v in (north, east, down)], axis=1)
    C = frame.C_mn(lat, lon) if isinstance(frame, TangentPlane) else frame.C_ln(lat, lon)
    assert_allclose(C, expected, rtol=0, atol=1e-9)


def test_earth_rate_points_along_the_polar_axis():
    """Oracle: the Earth's rate is (0, 0, omega) in ECEF."""
    local = LocalFrame(-0.6, 2.4, 100.0)
    assert_allclose(local.C_el @ local.earth_rate_l, [0.0, 0.0, 7.292115e-5], rtol=0, atol=1e-19)
    assert_allclose(local.origin_ecef, pyproj_ecef(-0.6, 2.4, 100.0), rtol=0, atol=2 * ULP)


@pytest.mark.parametrize(
    "origin", [(46.57, 6.54, 0.0), (0.8, 400.0, 0.0), (0.8, 0.1, np.nan), (np.nan, 0.1, 0.0)]
)
def test_degrees_called_radians_are_refused(origin):
    """Oracle: by contract, an impossible origin ends in one line that names the unit."""
    with pytest.raises(InputError, match="in rad"):
        TangentPlane(*origin)
