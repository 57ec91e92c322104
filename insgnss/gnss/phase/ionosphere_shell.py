"""Rays that pierce the ionosphere, taken for a shell at 400 km: (I.1) of `ionosphere`."""

import numpy as np

from ...geodesy.frames import ecef_to_geodetic, geodetic_to_ecef, rotation_en
from ...records import Array, GnssFixes
from ..satellites.satellite_geometry import Sky
from ..satellites.visible_satellites import directions

# radius of the Earth and height of the shell above it, m (IS-GPS-200 has 350 km, maps 450)
RADIUS_M, SHELL_M = 6.371e6, 4.0e5

# of a satellite from the Earth's centre; only the parallax of the two receivers depends on it
ORBIT_M = 2.66e7


def shell_design(fixes: GnssFixes, satellites: Sky, base: Array) -> Array:
    """Return D (m, 5) of (I.1) for each of the satellites; base (3,) in m ECEF."""
    ned = directions(satellites.azimuth, satellites.elevation)
    sight = np.einsum("mij,mj->mi", rotation_en(fixes.lat, fixes.lon)[satellites.epoch], ned)
    antenna = geodetic_to_ecef(fixes.lat, fixes.lon, fixes.height)[satellites.epoch]
    lat, lon, _ = ecef_to_geodetic(base)
    axes = rotation_en(lat, lon)
    centre = base + RADIUS_M * axes[:, 2]
    to_satellite = _distance_to_sphere(antenna - centre, sight, ORBIT_M)[:, None] * sight
    base_sight = to_satellite + (antenna - base)
    base_sight /= np.linalg.norm(base_sight, axis=1)[:, None]
    to_base = np.broadcast_to(base - centre, antenna.shape)
    at_rover = _pierce_point_design(antenna - centre, sight, axes, base - centre)
    at_base = _pierce_point_design(to_base, base_sight, axes, base - centre)
    slant = 0.5 * (at_rover[:, :1] + at_base[:, :1])
    offset = at_rover[:, 1:] / at_rover[:, :1] - at_base[:, 1:] / at_base[:, :1]
    return np.column_stack([at_rover - at_base, slant * offset])


def _distance_to_sphere(origin: Array, sight: Array, radius: float) -> Array:
    """Return the distance (m,), m, along rays (m, 3) from (m, 3), m, to a sphere around 0."""
    along = np.einsum("mi,mi->m", origin, sight)
    return np.asarray(np.sqrt(radius**2 - np.einsum("mi,mi->m", origin, origin) + along**2) - along)


def _pierce_point_design(origin: Array, sight: Array, axes: Array, base: Array) -> Array:
    """Return (1, n, e) / cos z' (m, 3) of rays where they pierce the shell.

    Origins (m, 3) and base (3,) are in m from the shell's centre; n and e are metres north and east
    of the base.
    """
    point = origin + _distance_to_sphere(origin, sight, RADIUS_M + SHELL_M)[:, None] * sight
    slant = (RADIUS_M + SHELL_M) / np.einsum("mi,mi->m", point, sight)
    return np.column_stack([slant, slant[:, None] * ((point - base) @ axes[:, :2])])
