"""Compiled scalar forms for loops over samples: a quaternion's matrix, height, gravity in ECEF.

Each writes into `out` and allocates nothing. Conventions of `rotation` and `earth`.

Geodetic latitude without trigonometric functions (Bowring 1985): with p^2 = x^2 + y^2, r^2 = p^2 +
z^2,

    tan beta = b z (1 + e'^2 b / r) / (a p)                                      (K.1)
    tan lat  = (z + e'^2 b sin^3 beta) / (p - e^2 a cos^3 beta)                  (K.2)
    h        = p cos lat + z sin lat - a sqrt(1 - e^2 sin^2 lat)                 (K.3)

where sine and cosine come from numerator and denominator by normalising. One step leaves 3e-13 rad
of latitude below 20 km, 3e-12 m/s^2 of gravity.
"""

import math

from ..base.compilation import njit
from .earth import CENTRIFUGAL_M, E2, EP2, GRAVITY_EQUATOR, SOMIGLIANA_K, A, B, F


@njit(cache=True, allocates=False)
def quat_to_matrix(q, out):
    """Write the rotation matrix of a unit quaternion.

    Parameters
    ----------
    q : ndarray, (4,)
        Unit quaternion w, x, y, z.
    out : ndarray, (3, 3)
        Rotation matrix, written here.
    """
    w, x, y, z = q[0], q[1], q[2], q[3]
    out[0, 0] = 1.0 - 2.0 * (y * y + z * z)
    out[0, 1] = 2.0 * (x * y - w * z)
    out[0, 2] = 2.0 * (x * z + w * y)
    out[1, 0] = 2.0 * (x * y + w * z)
    out[1, 1] = 1.0 - 2.0 * (x * x + z * z)
    out[1, 2] = 2.0 * (y * z - w * x)
    out[2, 0] = 2.0 * (x * z - w * y)
    out[2, 1] = 2.0 * (y * z + w * x)
    out[2, 2] = 1.0 - 2.0 * (x * x + y * y)


@njit(cache=True, allocates=False)
def latitude_height(x, y, z):
    """Return geodetic latitude and ellipsoidal height of a position (K.1-K.3).

    Parameters
    ----------
    x, y, z : float
        Position in ECEF, m; not the Earth's centre.

    Returns
    -------
    sl, cl : float
        Sine and cosine of the latitude.
    p : float
        Distance from the Earth's axis, m.
    w : float
        sqrt(1 - e^2 sl^2), by which the ellipsoid is scaled there.
    h : float
        Height above the ellipsoid, m.
    """
    p = math.sqrt(x * x + y * y)
    num = B * z * (1.0 + EP2 * B / math.sqrt(p * p + z * z))  # (K.1)
    den = A * p
    scale = 1.0 / math.sqrt(num * num + den * den)
    sb, cb = num * scale, den * scale
    num = z + EP2 * B * sb * sb * sb  # (K.2)
    den = p - E2 * A * cb * cb * cb
    scale = 1.0 / math.sqrt(num * num + den * den)
    sl, cl = num * scale, den * scale
    w = math.sqrt(1.0 - E2 * (sl * sl))
    return sl, cl, p, w, p * cl + z * sl - A * w  # (K.3)


@njit(cache=True, allocates=False)
def height_ecef(x, y, z, out):
    """Return the height above the ellipsoid at a position, and write its gradient.

    Parameters
    ----------
    x, y, z : float
        Position in ECEF, m; not on the Earth's axis.
    out : ndarray, (3,)
        Unit vector upwards along the ellipsoidal normal, in ECEF axes, written here.

    Returns
    -------
    float
        Height above the ellipsoid, m.
    """
    sl, cl, p, _, h = latitude_height(x, y, z)
    out[0], out[1], out[2] = cl * x / p, cl * y / p, sl
    return h


@njit(cache=True, allocates=False)
def gravity_ecef(x, y, z, out):
    """Write normal gravity at a position: `earth` (E.2) down the ellipsoidal normal.

    It holds the centrifugal part; the position must not be the Earth's centre.

    Parameters
    ----------
    x, y, z : float
        Position in ECEF, m.
    out : ndarray, (3,)
        Gravity in ECEF axes, m/s^2, written here.
    """
    sl, cl, p, w, h = latitude_height(x, y, z)
    s2 = sl * sl
    gamma = GRAVITY_EQUATOR * (1.0 + SOMIGLIANA_K * s2) / w
    gamma *= 1.0 - 2.0 / A * (1.0 + F + CENTRIFUGAL_M - 2.0 * F * s2) * h + 3.0 * h * h / (A * A)
    horizontal = -gamma * cl / p if p > 0.0 else 0.0
    out[0], out[1], out[2] = horizontal * x, horizontal * y, -gamma * sl
