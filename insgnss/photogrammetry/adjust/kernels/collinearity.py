"""Numba kernels of single image observations: collinearity and distortion, (J.1) to (J.5)."""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ....base.compilation import njit
from ....records import Array
from ....records.cameras.camera import AXIS_R2

Rows = NDArray[np.int64]
Flags = NDArray[np.bool_]

N_INTERIOR = 11
"""Parameters of interior orientation: f cx cy b1 b2 k1 k2 k3 k4 p1 p2."""
FORWARD, BACKWARD, FISHEYE = range(3)
"""Rows of `records.block.MODELS`."""


class Rays(NamedTuple):
    """Image observations, point by point; those of a point in the order of their poses' columns.

    Parameters
    ----------
    start : (np + 1,) first observation of each point.
    image : (n,) row of the image.
    uv : (n, 2) pixels.
    weight : (n, 3) `records.block.ImageObservations.whitening` of each, 1 / px.
    active : (n,) whether the observation takes part.
    camera : (ni,) row of each image's camera.
    pose : (ni,) first column of each image's pose.
    model : (nc,) which model the camera has: FORWARD, BACKWARD or FISHEYE.
    unit : (nc,) pixels in the unit of a backward polynomial.
    columns : (k,) parameters of interior orientation that are unknowns of some camera.
    kept : (np,) first column of each point that is not eliminated, else -1.
    """

    start: Rows
    image: Rows
    uv: Array
    weight: Array
    active: Flags
    camera: Rows
    pose: Rows
    model: Rows
    unit: Array
    columns: Rows
    kept: Rows


class Values(NamedTuple):
    """Values of the unknowns.

    Parameters
    ----------
    position : (ni, 3) projection centres, m.
    C_mc : (ni, 3, 3) attitude, camera to the axes of the block.
    interior : (nc, 11) interior orientation.
    fold2 : (nc,) squares of the radii at which the radial polynomials fold back, in their unit.
    point : (np, 3) object points, m.
    """

    position: Array
    C_mc: Array
    interior: Array
    fold2: Array
    point: Array


@njit(cache=True)
def distort_brown(x, y, c, out):
    """Distort a point by (J.3).

    Parameters
    ----------
    x, y : float
        The point, in the polynomial's unit.
    c : ndarray, (11,)
        Interior orientation.
    out : ndarray, (5,)
        D(x, y) and its derivatives dD_1/dx, dD_1/dy = dD_2/dx, dD_2/dy, written here.
    """
    r2 = x * x + y * y
    k1, k2, k3, k4, p1, p2 = c[5], c[6], c[7], c[8], c[9], c[10]
    radial = 1.0 + r2 * (k1 + r2 * (k2 + r2 * (k3 + r2 * k4)))
    slope = 2.0 * (k1 + r2 * (2.0 * k2 + r2 * (3.0 * k3 + r2 * 4.0 * k4)))
    out[0] = radial * x + p1 * (r2 + 2.0 * x * x) + 2.0 * p2 * x * y
    out[1] = radial * y + p2 * (r2 + 2.0 * y * y) + 2.0 * p1 * x * y
    out[2] = radial + slope * x * x + 6.0 * p1 * x + 2.0 * p2 * y
    out[3] = slope * x * y + 2.0 * p1 * y + 2.0 * p2 * x
    out[4] = radial + slope * y * y + 6.0 * p2 * y + 2.0 * p1 * x


@njit(cache=True)
def _equidistant(x, y):
    """Compute arctan(r) / r of (J.4a), and its derivative by r over r."""
    r2 = max(x * x + y * y, AXIS_R2)
    r = np.sqrt(r2)
    scale = np.arctan(r) / r
    return scale, (1.0 / (1.0 + r2) - scale) / r2


@njit(cache=True)
def image_residual(X0, C, X, c, model, unit, fold2, uv, work, e):
    """Compute observed - computed of one image observation, pixels.

    Parameters
    ----------
    X0, C, X, c : ndarray
        (3,) projection centre, (3, 3) C_mc, (3,) object point, (11,) interior orientation.
    model, unit, fold2 : int, float, float
        The camera's model, and its polynomial's unit and fold.
    uv : ndarray, (2,)
        Measured pixel.
    work : ndarray, (10,)
        x, y, 1 / q_3, the point that is distorted (2) and what `distort_brown` gives for it (5),
        written here.
    e : ndarray, (2,)
        The residual, written here.

    Returns
    -------
    bool
        Whether the point lies before the camera and within the fold of its polynomial.
    """
    d0, d1, d2 = X[0] - X0[0], X[1] - X0[1], X[2] - X0[2]
    q2 = C[0, 2] * d0 + C[1, 2] * d1 + C[2, 2] * d2
    if not q2 > 0.0:
        return False
    z = 1.0 / q2
    x = z * (C[0, 0] * d0 + C[1, 0] * d1 + C[2, 0] * d2)
    y = z * (C[0, 1] * d0 + C[1, 1] * d1 + C[2, 1] * d2)
    work[0], work[1], work[2] = x, y, z
    if model == BACKWARD:
        a = ((1.0 + c[3]) * (uv[0] - c[1]) + c[4] * (uv[1] - c[2])) / unit
        b = (uv[1] - c[2]) / unit
    else:
        a, b = x, y
        if model == FISHEYE:
            scale, _ = _equidistant(x, y)
            a, b = scale * x, scale * y
    if not a * a + b * b < fold2:
        return False
    work[3], work[4] = a, b
    distort_brown(a, b, c, work[5:])
    if model == BACKWARD:
        e[0] = unit * work[5] - c[0] * x
        e[1] = unit * work[6] - c[0] * y
    else:
        e[0] = uv[0] - (c[1] + (c[0] + c[3]) * work[5] + c[4] * work[6])
        e[1] = uv[1] - (c[2] + c[0] * work[6])
    return True


@njit(cache=True)
def image_jacobian(X0, C, X, c, model, unit, uv, work, A, K, B):
    """Compute the derivative of one image observation, d computed / d unknown.

    Parameters
    ----------
    X0, C, X, c, model, unit, uv, work
        As `image_residual` takes them and leaves them.
    A, K, B : ndarray
        (2, 6) by position and psi, (2, 11) by interior orientation, (2, 3) by the object point,
        written here.
    """
    x, y, z, a, b = work[0], work[1], work[2], work[3], work[4]
    Da, Db, Daa, Dab, Dbb = work[5], work[6], work[7], work[8], work[9]
    f, b1, b2 = c[0], c[3], c[4]
    if model == BACKWARD:
        m00, m01, m10, m11 = f, 0.0, 0.0, f
        s = -unit
        t00, t01, t11 = s, 0.0, s  # what a distortion does to the computed value
        xm, ym = uv[0] - c[1], uv[1] - c[2]
        K[0, 0], K[1, 0] = x, y
        K[0, 1], K[1, 1] = (1.0 + b1) * Daa, (1.0 + b1) * Dab
        K[0, 2], K[1, 2] = b2 * Daa + Dab, b2 * Dab + Dbb
        K[0, 3], K[1, 3] = -Daa * xm, -Dab * xm
        K[0, 4], K[1, 4] = -Daa * ym, -Dab * ym
    else:
        t00, t01, t11 = f + b1, b2, f
        m00, m01 = t00 * Daa + t01 * Dab, t00 * Dab + t01 * Dbb
        m10, m11 = t11 * Dab, t11 * Dbb
        if model == FISHEYE:
            scale, slope = _equidistant(x, y)
            s0, s1 = slope * (m00 * x + m01 * y), slope * (m10 * x + m11 * y)
            m00, m01 = scale * m00 + s0 * x, scale * m01 + s0 * y
            m10, m11 = scale * m10 + s1 * x, scale * m11 + s1 * y
        K[0, 0], K[1, 0] = Da, Db
        K[0, 1], K[1, 1] = 1.0, 0.0
        K[0, 2], K[1, 2] = 0.0, 1.0
        K[0, 3], K[1, 3] = Da, 0.0
        K[0, 4], K[1, 4] = Db, 0.0
    r2 = a * a + b * b
    power = r2
    for k in range(5, 9):
        K[0, k] = (t00 * a + t01 * b) * power
        K[1, k] = t11 * b * power
        power *= r2
    ab, aa, bb = 2.0 * a * b, r2 + 2.0 * a * a, r2 + 2.0 * b * b
    K[0, 9], K[1, 9] = t00 * aa + t01 * ab, t11 * ab
    K[0, 10], K[1, 10] = t00 * ab + t01 * bb, t11 * bb
    d0, d1, d2 = X[0] - X0[0], X[1] - X0[1], X[2] - X0[2]
    for i in range(2):
        m0, m1 = (m00, m01) if i == 0 else (m10, m11)
        g0, g1 = z * m0, z * m1
        g2 = -(g0 * x + g1 * y)
        for j in range(3):
            B[i, j] = g0 * C[j, 0] + g1 * C[j, 1] + g2 * C[j, 2]
            A[i, j] = -B[i, j]
        A[i, 3] = B[i, 1] * d2 - B[i, 2] * d1
        A[i, 4] = B[i, 2] * d0 - B[i, 0] * d2
        A[i, 5] = B[i, 0] * d1 - B[i, 1] * d0


@njit(cache=True)
def residuals(rays, values, e):
    """Compute all residuals observed - computed, pixels.

    Parameters
    ----------
    rays, values : Rays, Values
        The observations, and the values of the unknowns.
    e : ndarray, (n, 2)
        Residuals, written here; NaN of points behind the camera or beyond the fold.

    Returns
    -------
    cost : float
        e^T P e of the active observations.
    invalid : int
        Number of active observations without residual.
    """
    work = np.empty(10)
    cost, invalid = 0.0, 0
    for p in range(rays.start.size - 1):
        for j in range(rays.start[p], rays.start[p + 1]):
            i = rays.image[j]
            cam = rays.camera[i]
            seen = image_residual(
                values.position[i],
                values.C_mc[i],
                values.point[p],
                values.interior[cam],
                rays.model[cam],
                rays.unit[cam],
                values.fold2[cam],
                rays.uv[j],
                work,
                e[j],
            )
            if not seen:
                e[j, 0] = e[j, 1] = np.nan
            if rays.active[j]:
                if seen:
                    w = rays.weight[j]
                    cost += (w[0] * e[j, 0]) ** 2 + (w[1] * e[j, 0] + w[2] * e[j, 1]) ** 2
                else:
                    invalid += 1
    return cost, invalid
