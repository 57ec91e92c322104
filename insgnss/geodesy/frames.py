"""Geodetic, ECEF and local Cartesian coordinates on WGS84.

With N the prime vertical radius of curvature, up the ellipsoidal normal:

    x = (N + h) cos lat cos lon,  y = (N + h) cos lat sin lon,  z = (N (1 - e^2) + h) sin lat  (F.1)

and back by Bowring (1985), two steps of it, without a loop to convergence:

    tan beta_0 = b z (1 + e'^2 b / r) / (a p),   tan beta_1 = (b / a) tan lat                  (F.2)
    tan lat    = (z + e'^2 b sin^3 beta) / (p - e^2 a cos^3 beta)                              (F.3)
    h          = p cos lat + z sin lat - a sqrt(1 - e^2 sin^2 lat)                             (F.4)

exact to rounding (1e-9 m) for heights of -1 to 20 km and still below a micrometre at satellite
heights. Angles are rad, lengths m; arrays broadcast, points lie along the leading dimensions.
"""

from abc import ABC, abstractmethod
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ..base.errors import InputError
from .earth import E2, EARTH_RATE, EP2, A, B, curvature_radii
from .rotation import NED_ENU, rotation_from_vector

Array = NDArray[np.float64]


def geodetic_to_ecef(lat: ArrayLike, lon: ArrayLike, h: ArrayLike) -> Array:
    """Convert geodetic to ECEF coordinates (F.1).

    Parameters
    ----------
    lat, lon : array_like, (...)
        Geodetic latitude and longitude, rad.
    h : array_like, (...)
        Height above the WGS84 ellipsoid, m.

    Returns
    -------
    ndarray, (..., 3)
        Coordinates x, y, z in ECEF, m, of the arguments' common shape.
    """
    lat, lon, h = np.broadcast_arrays(*(np.asarray(v, dtype=np.float64) for v in (lat, lon, h)))
    _, N = curvature_radii(lat)
    p = (N + h) * np.cos(lat)
    return np.stack([p * np.cos(lon), p * np.sin(lon), (N * (1.0 - E2) + h) * np.sin(lat)], axis=-1)


def ecef_to_geodetic(xyz: ArrayLike) -> tuple[Array, Array, Array]:
    """Convert ECEF to geodetic coordinates (F.2 to F.4).

    Parameters
    ----------
    xyz : array_like, (..., 3)
        Coordinates in ECEF, m, away from the Earth's centre.

    Returns
    -------
    lat, lon : ndarray, (...)
        Geodetic latitude and longitude, rad.
    h : ndarray, (...)
        Height above the WGS84 ellipsoid, m.
    """
    xyz = np.asarray(xyz, dtype=np.float64)
    x, y, z = xyz[..., 0], xyz[..., 1], xyz[..., 2]
    p = np.hypot(x, y)
    sin, cos = _normalised_sine_cosine(B * z * (1.0 + EP2 * B / np.hypot(p, z)), A * p)
    sin, cos = _normalised_sine_cosine(z + EP2 * B * sin**3, p - E2 * A * cos**3)
    sin, cos = _normalised_sine_cosine(B * sin, A * cos)
    sin, cos = _normalised_sine_cosine(z + EP2 * B * sin**3, p - E2 * A * cos**3)
    h = p * cos + z * sin - A * np.sqrt(1.0 - E2 * sin**2)
    return np.arctan2(sin, cos), np.arctan2(y, x), h


def _normalised_sine_cosine(sin: Array, cos: Array) -> tuple[Array, Array]:
    length = np.hypot(sin, cos)
    return sin / length, cos / length


def rotation_en(lat: ArrayLike, lon: ArrayLike) -> Array:
    """Return C_en, the rotation of north, east, down (NED) at a point into ECEF.

    Parameters
    ----------
    lat, lon : array_like, (...)
        Geodetic latitude and longitude, rad.

    Returns
    -------
    ndarray, (..., 3, 3)
        Rotation matrices; their columns are north, east and down in ECEF.
    """
    lat, lon = np.broadcast_arrays(
        np.asarray(lat, dtype=np.float64), np.asarray(lon, dtype=np.float64)
    )
    sB, cB, sL, cL = np.sin(lat), np.cos(lat), np.sin(lon), np.cos(lon)
    C = np.empty((*lat.shape, 3, 3))
    C[..., 0, 0], C[..., 0, 1], C[..., 0, 2] = -sB * cL, -sL, -cB * cL
    C[..., 1, 0], C[..., 1, 1], C[..., 1, 2] = -sB * sL, cL, -cB * sL
    C[..., 2, 0], C[..., 2, 1], C[..., 2, 2] = cB, 0.0, -sB
    return C


def moved_geodetic(
    lat: Array, lon: Array, h: Array, offset_ned: Array
) -> tuple[Array, Array, Array]:
    """Return places that are moved by offsets north, east, down.

    Parameters
    ----------
    lat, lon : (n,) rad.
    h : (n,) ellipsoidal height, m.
    offset_ned : (n, 3) m.

    Returns
    -------
    Latitude, longitude, ellipsoidal height.
    """
    offset = np.einsum("nij,nj->ni", rotation_en(lat, lon), offset_ned)
    return ecef_to_geodetic(geodetic_to_ecef(lat, lon, h) + offset)


def rotation_em(lat: ArrayLike, lon: ArrayLike) -> Array:
    """Return C_em, the rotation of east, north, up (ENU) at a point into ECEF.

    Parameters
    ----------
    lat, lon : array_like, (...)
        Geodetic latitude and longitude, rad.

    Returns
    -------
    ndarray, (..., 3, 3)
        Rotation matrices; their columns are east, north and up in ECEF.
    """
    return rotation_en(lat, lon) @ NED_ENU


@dataclass(frozen=True)
class _PointFrame(ABC):
    """A Cartesian, Earth-fixed frame with its origin at a geodetic point.

    Parameters
    ----------
    lat, lon : float
        Geodetic latitude and longitude of the origin, rad.
    height : float
        Height of the origin above the WGS84 ellipsoid, m.

    Raises
    ------
    InputError
        Where latitude, longitude or height is not finite or beyond what its unit allows.
    """

    lat: float
    lon: float
    height: float

    def __post_init__(self) -> None:
        for name, limit in (("lat", 0.5 * np.pi), ("lon", 2.0 * np.pi), ("height", 1e6)):
            value = float(getattr(self, name))
            if not abs(value) <= limit:
                raise InputError(
                    f"{type(self).__name__}.{name}: {value:g} exceeds {limit:g}; give latitude and"
                    " longitude in rad, height in m"
                )
            object.__setattr__(self, name, value)

    @property
    def origin_ecef(self) -> Array:
        """The origin in ECEF, ndarray (3,), m."""
        return geodetic_to_ecef(self.lat, self.lon, self.height)

    @abstractmethod
    def _axes(self) -> Array:
        """Return the rotation (3, 3) of this frame's axes into ECEF."""

    def position_from_geodetic(self, lat: ArrayLike, lon: ArrayLike, h: ArrayLike) -> Array:
        """Convert geodetic coordinates to this frame.

        Parameters
        ----------
        lat, lon : array_like, (...)
            Geodetic latitude and longitude, rad.
        h : array_like, (...)
            Height above the WGS84 ellipsoid, m.

        Returns
        -------
        ndarray, (..., 3)
            Coordinates in this frame, m.
        """
        return (geodetic_to_ecef(lat, lon, h) - self.origin_ecef) @ self._axes()

    def geodetic_from_position(self, position: ArrayLike) -> tuple[Array, Array, Array]:
        """Convert coordinates in this frame to geodetic ones.

        Parameters
        ----------
        position : array_like, (..., 3)
            Coordinates in this frame, m.

        Returns
        -------
        lat, lon : ndarray, (...)
            Geodetic latitude and longitude, rad.
        h : ndarray, (...)
            Height above the WGS84 ellipsoid, m.
        """
        return ecef_to_geodetic(
            np.asarray(position, dtype=np.float64) @ self._axes().T + self.origin_ecef
        )

    def _from_ned(self, lat: ArrayLike, lon: ArrayLike) -> Array:
        return self._axes().T @ rotation_en(lat, lon)


@dataclass(frozen=True)
class LocalFrame(_PointFrame):
    """The flight's local frame l: north, east, down (NED) at its origin.

    The axes are parallel to themselves everywhere.

    Parameters
    ----------
    lat, lon : float
        Geodetic latitude and longitude of the origin, rad.
    height : float
        Height of the origin above the WGS84 ellipsoid, m.
    deflection : tuple of float
        Deflection of the vertical, xi and eta in rad: the zenith of the plumb line is north and
        east of the ellipsoidal normal by as much, the same all over the flight.

    Raises
    ------
    InputError
        Where latitude, longitude or height is not finite or beyond what its unit allows.
    """

    deflection: tuple[float, float] = field(default=(0.0, 0.0), kw_only=True)

    def _axes(self) -> Array:
        return rotation_en(self.lat, self.lon)

    @property
    def C_el(self) -> Array:
        """The rotation of l into ECEF, ndarray (3, 3)."""
        return self._axes()

    @property
    def C_el_of_gravity(self) -> Array:
        """The rotation of l into axes in which normal gravity has the plumb line's direction.

        ndarray (3, 3): C_el after the turn that takes gravity from (-xi, -eta, 1) g to (0, 0, 1) g.
        """
        xi, eta = self.deflection
        return self._axes() @ rotation_from_vector(np.array([-eta, xi, 0.0]))

    @property
    def earth_rate_l(self) -> Array:
        """The Earth's rotation against inertial space in l, ndarray (3,), rad/s."""
        return EARTH_RATE * np.array([np.cos(self.lat), 0.0, -np.sin(self.lat)])

    def C_ln(self, lat: ArrayLike, lon: ArrayLike) -> Array:
        """Return C_ln, the rotation of north, east, down (NED) at a point into l.

        Parameters
        ----------
        lat, lon : array_like, (...)
            Geodetic latitude and longitude, rad.

        Returns
        -------
        ndarray, (..., 3, 3)
            Rotation matrices.
        """
        return self._from_ned(lat, lon)

    def C_ln_at(self, p_l: ArrayLike) -> Array:
        """Return C_ln, the rotation of north, east, down (NED) into l, at points given in l.

        Parameters
        ----------
        p_l : array_like, (..., 3)
            Points in l, m.

        Returns
        -------
        ndarray, (..., 3, 3)
            Rotation matrices.
        """
        lat, lon, _ = self.geodetic_from_position(p_l)
        return self._from_ned(lat, lon)


@dataclass(frozen=True)
class TangentPlane(_PointFrame):
    """The mapping frame m: east, north, up (ENU) at its origin.

    The axes are parallel to themselves everywhere.

    Parameters
    ----------
    lat, lon : float
        Geodetic latitude and longitude of the origin, rad.
    height : float
        Height of the origin above the WGS84 ellipsoid, m.

    Raises
    ------
    InputError
        Where latitude, longitude or height is not finite or beyond what its unit allows.
    """

    def _axes(self) -> Array:
        return rotation_em(self.lat, self.lon)

    @property
    def C_em(self) -> Array:
        """The rotation of m into ECEF, ndarray (3, 3)."""
        return self._axes()

    def C_mn(self, lat: ArrayLike, lon: ArrayLike) -> Array:
        """Return C_mn, the rotation of north, east, down (NED) at a point into m.

        Parameters
        ----------
        lat, lon : array_like, (...)
            Geodetic latitude and longitude, rad.

        Returns
        -------
        ndarray, (..., 3, 3)
            Rotation matrices.
        """
        return self._from_ned(lat, lon)
