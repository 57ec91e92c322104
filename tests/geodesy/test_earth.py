"""WGS84 constants, curvature and normal gravity against published values and the exact normal
potential.
"""

import math

import numpy as np
import pytest
from numpy.testing import assert_allclose

from insgnss.geodesy import earth
from insgnss.geodesy._kernels import gravity_ecef

LINEAR_ECCENTRICITY = math.sqrt(earth.A**2 - earth.B**2)


def q_of(t: float) -> float:
    """((1 + 3/t^2) atan t - 3/t) / 2 as its series, free of cancellation."""
    return 0.5 * sum(
        (-1.0) ** (k + 1) * 4.0 * k * t ** (2 * k + 1) / ((2 * k + 1) * (2 * k + 3))
        for k in range(1, 12)
    )


def normal_potential(x: float, y: float, z: float) -> float:
    """Somigliana-Pizzetti potential of gravity in ellipsoidal coordinates, exact outside (Heiskanen
    and Moritz 1967, 2-62).
    """
    E = LINEAR_ECCENTRICITY
    p2 = x * x + y * y
    d = p2 + z * z - E * E
    u = math.sqrt(0.5 * d * (1.0 + math.sqrt(1.0 + 4.0 * E * E * z * z / d**2)))
    sin2_beta = (z / u) ** 2
    rotation = earth.EARTH_RATE**2
    rest = 0.5 * rotation * earth.A**2 * q_of(E / u) / q_of(E / earth.B) * (sin2_beta - 1.0 / 3.0)
    return earth.GM / E * math.atan(E / u) + rest + 0.5 * rotation * p2


def exact_gravity(xyz: np.ndarray, step: float = 100.0) -> np.ndarray:
    """Gradient of the potential by central difference; 100 m leave 3e-9 m/s^2 of truncation and
    1e-10 of rounding.
    """
    steps = step * np.eye(3)
    return np.array(
        [(normal_potential(*(xyz + d)) - normal_potential(*(xyz - d))) / (2 * step) for d in steps]
    )


def ecef(lat: float, lon: float, h: float) -> np.ndarray:
    N = earth.A / math.sqrt(1.0 - earth.E2 * math.sin(lat) ** 2)
    p = (N + h) * math.cos(lat)
    return np.array(
        [p * math.cos(lon), p * math.sin(lon), (N * (1.0 - earth.E2) + h) * math.sin(lat)]
    )


def left_out(h: float) -> float:
    """What the series of normal gravity in height leaves out, m/s^2: the squares of f and m in its
    slope (Bruns), and the cube.
    """
    g = earth.GRAVITY_EQUATOR
    return (
        3.0 * (earth.F**2 + earth.CENTRIFUGAL_M**2) * g * abs(h) / earth.A
        + 4.0 * g * (abs(h) / earth.A) ** 3
    )


def test_published_constants():
    """Oracle: NIMA TR8350.2 tables 3.3 and 3.4 as printed."""
    assert_allclose(earth.B, 6356752.3142, rtol=0, atol=5e-5)
    assert_allclose(earth.E2, 6.69437999014e-3, rtol=0, atol=5e-14)
    assert_allclose(earth.EP2, 6.73949674228e-3, rtol=0, atol=5e-14)
    assert_allclose(
        earth.SOMIGLIANA_K, 0.00193185265241, rtol=0, atol=2e-11
    )  # from gravities printed to 1e-10
    assert_allclose(earth.CENTRIFUGAL_M, 0.00344978650684, rtol=0, atol=5e-15)


def test_gravity_at_equator_and_pole():
    """Oracle: published theoretical gravity, NIMA TR8350.2 table 3.4."""
    assert_allclose(
        earth.normal_gravity([0.0, np.pi / 2, -np.pi / 2], 0.0),
        [9.7803253359, 9.8321849378, 9.8321849378],
        rtol=0,
        atol=1e-10,
    )


@pytest.mark.parametrize("h", [-500.0, 0.0, 120.0, 3000.0, 20000.0])
def test_gravity_with_height_follows_the_exact_potential(h):
    """Oracle: gradient of the closed-form normal potential, but for what the second-order series
    leaves out (`left_out`).
    """
    for lat in np.radians([-88.0, -46.57, 0.0, 20.0, 45.0, 70.0]):
        exact = np.linalg.norm(exact_gravity(ecef(lat, 0.3, h)))
        assert_allclose(earth.normal_gravity(lat, h), exact, rtol=0, atol=1e-8 + left_out(h))


@pytest.mark.parametrize("lat_deg", [-90.0, -60.0, -10.0, 0.0, 30.0, 46.57, 89.9])
def test_gravity_vector_in_ecef_follows_the_exact_potential(lat_deg):
    """Oracle: gradient of the closed-form normal potential, but for its lean of 8.08e-9 h sin(2
    lat), which is left out.
    """
    lat, lon, h = math.radians(lat_deg), -2.1, 1500.0
    xyz, out = ecef(lat, lon, h), np.empty(3)
    gravity_ecef(*xyz, out)
    north = np.array(
        [-math.sin(lat) * math.cos(lon), -math.sin(lat) * math.sin(lon), math.cos(lat)]
    )
    lean = (
        -8.08e-9 * h * math.sin(2 * lat) * north
    )  # towards the equator with height (Groves 2.140, north component)
    assert_allclose(out + lean, exact_gravity(xyz), rtol=0, atol=1e-8 + left_out(h))


def test_gravity_vector_at_the_pole_itself():
    """Oracle: symmetry; straight down with the published gravity of the pole."""
    out = np.empty(3)
    gravity_ecef(0.0, 0.0, -earth.B, out)
    assert_allclose(out, [0.0, 0.0, 9.8321849378], rtol=0, atol=1e-10)


def test_curvature_radii_are_arc_lengths():
    """Oracle: pyproj geodesic lengths along a meridian, and a parallel's radius N cos lat; 1e-7
    relative over 20 arcsec.
    """
    from pyproj import Geod

    geod, lat, d = Geod(ellps="WGS84"), 46.57, 1e-3
    meridian = geod.inv(6.5, lat - d, 6.5, lat + d)[2]
    M, N = earth.curvature_radii(math.radians(lat))
    assert_allclose(meridian / math.radians(2 * d), M, rtol=1e-7)
    parallel = geod.inv(6.5 - d, lat, 6.5 + d, lat)[2]
    assert_allclose(parallel / math.radians(2 * d), N * math.cos(math.radians(lat)), rtol=1e-7)


def test_constants_cost_no_compiler():
    """Oracle: sys.modules of a fresh interpreter; the kernel is loaded on first use only."""
    import subprocess
    import sys

    code = (
        "import sys, insgnss.geodesy.frames, insgnss.geodesy.gpstime; print('numba' in sys.modules,"
        " 'scipy' in sys.modules)"
    )
    run = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert run.stdout.split() == ["False", "False"]
    with pytest.raises(AttributeError, match="gravity_enu"):
        _ = earth.gravity_enu
