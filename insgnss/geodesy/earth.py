"""The WGS84 ellipsoid and its normal gravity.

Normal gravity on the ellipsoid (Somigliana) and at height h, with the centrifugal part:

    gamma_0 = gamma_e (1 + k sin^2 lat) / sqrt(1 - e^2 sin^2 lat)                              (E.1)
    k       = b gamma_p / (a gamma_e) - 1
    gamma   = gamma_0 [1 - 2/a (1 + f + m - 2 f sin^2 lat) h + 3 h^2 / a^2]                    (E.2)
    m       = omega^2 a^2 b / GM

It acts along the ellipsoidal normal, downwards. Its true direction at height leans north by 8.08e-9
h sin(2 lat) m/s^2 (Groves 2.140), 0.1 micro-g at 120 m, which is left out. The series (E.2) is good
to 1.5e-6 m/s^2 up to 20 km.

NIMA TR8350.2, 3rd edition, 2000, tables 3.1 to 3.4 and equations 4-1 to 4-3; Groves (2013) 2.134,
2.139.
"""

import numpy as np
from numpy.typing import ArrayLike, NDArray

Array = NDArray[np.float64]

A = 6378137.0  # semi-major axis, m
F = 1.0 / 298.257223563  # flattening
B = A * (1.0 - F)  # semi-minor axis, m
E2 = F * (2.0 - F)  # first eccentricity squared
EP2 = E2 / (1.0 - E2)  # second eccentricity squared
GM = 3.986004418e14  # m^3/s^2, with the atmosphere
EARTH_RATE = 7.292115e-5  # rad/s
GRAVITY_EQUATOR = 9.7803253359  # m/s^2
GRAVITY_POLE = 9.8321849378  # m/s^2
SOMIGLIANA_K = B * GRAVITY_POLE / (A * GRAVITY_EQUATOR) - 1.0  # k of (E.1)
CENTRIFUGAL_M = EARTH_RATE**2 * A**2 * B / GM  # m of (E.2)


def curvature_radii(lat: ArrayLike) -> tuple[Array, Array]:
    """Return the radii of curvature of the WGS84 ellipsoid.

    Parameters
    ----------
    lat : array_like, (...)
        Geodetic latitude, rad.

    Returns
    -------
    M, N : ndarray, (...)
        Radii of the meridian and of the prime vertical, m.
    """
    w2 = 1.0 - E2 * np.sin(lat) ** 2
    N = A / np.sqrt(w2)
    return N * (1.0 - E2) / w2, N


def normal_gravity(lat: ArrayLike, h: ArrayLike) -> Array:
    """Return the magnitude of normal gravity at a height (E.1, E.2).

    Parameters
    ----------
    lat : array_like, (...)
        Geodetic latitude, rad.
    h : array_like, (...)
        Height above the WGS84 ellipsoid, m.

    Returns
    -------
    ndarray, (...)
        Normal gravity with its centrifugal part, m/s^2. It acts down the ellipsoidal normal.
    """
    h = np.asarray(h, dtype=np.float64)
    s2 = np.sin(lat) ** 2
    gamma_0 = GRAVITY_EQUATOR * (1.0 + SOMIGLIANA_K * s2) / np.sqrt(1.0 - E2 * s2)
    return gamma_0 * (
        1.0 - 2.0 / A * (1.0 + F + CENTRIFUGAL_M - 2.0 * F * s2) * h + 3.0 * h**2 / A**2
    )
