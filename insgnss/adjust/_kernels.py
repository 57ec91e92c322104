"""Numba kernels of the image observations. Mathematics: (J.1) to (J.7) of `insgnss.adjust`."""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ..base.compilation import njit

Array = NDArray[np.float64]
Rows = NDArray[np.int64]
Flags = NDArray[np.bool_]

INTERIOR = 11
"""Parameters of interior orientation: f cx cy b1 b2 k1 k2 k3 k4 p1 p2."""


class Rays(NamedTuple):
    """Image observations in the order of their points.

    Parameters
    ----------
    start : (np + 1,) first observation of each point.
    image : (n,) row of the image.
    uv : (n, 2) pixels.
    weight : (n, 2) square roots of the weights, 1 / px.
    active : (n,) whether the observation takes part.
    camera : (ni,) row of each image's camera.
    backward : (nc,) whether the camera's polynomial takes measured to ideal points.
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
    backward: Flags
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
def brown(x, y, c, out):
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
def image_residual(X0, C, X, c, backward, unit, fold2, uv, work, e):
    """Compute observed - computed of one image observation, pixels.

    Parameters
    ----------
    X0, C, X, c : ndarray
        (3,) projection centre, (3, 3) C_mc, (3,) object point, (11,) interior orientation.
    backward, unit, fold2 : bool, float, float
        The camera's polynomial: its direction, unit and fold.
    uv : ndarray, (2,)
        Measured pixel.
    work : ndarray, (10,)
        x, y, 1 / q_3, the point that is distorted (2) and what `brown` gives for it (5), written
        here.
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
    if backward:
        a = ((1.0 + c[3]) * (uv[0] - c[1]) + c[4] * (uv[1] - c[2])) / unit
        b = (uv[1] - c[2]) / unit
    else:
        a, b = x, y
    if not a * a + b * b < fold2:
        return False
    work[3], work[4] = a, b
    brown(a, b, c, work[5:])
    if backward:
        e[0] = unit * work[5] - c[0] * x
        e[1] = unit * work[6] - c[0] * y
    else:
        e[0] = uv[0] - (c[1] + (c[0] + c[3]) * work[5] + c[4] * work[6])
        e[1] = uv[1] - (c[2] + c[0] * work[6])
    return True


@njit(cache=True)
def image_jacobian(X0, C, X, c, backward, unit, uv, work, A, K, B):
    """Compute the derivative of one image observation, d computed / d unknown.

    Parameters
    ----------
    X0, C, X, c, backward, unit, uv, work
        As `image_residual` takes them and leaves them.
    A, K, B : ndarray
        (2, 6) by position and psi, (2, 11) by interior orientation, (2, 3) by the object point,
        written here.
    """
    x, y, z, a, b = work[0], work[1], work[2], work[3], work[4]
    Da, Db, Daa, Dab, Dbb = work[5], work[6], work[7], work[8], work[9]
    f, b1, b2 = c[0], c[3], c[4]
    if backward:
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
                rays.backward[cam],
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
                    cost += (e[j, 0] * rays.weight[j, 0]) ** 2 + (e[j, 1] * rays.weight[j, 1]) ** 2
                else:
                    invalid += 1
    return cost, invalid


@njit(cache=True)
def invert3(V, out):
    """Invert a symmetric positive definite matrix (3, 3) into `out`; False where it is none."""
    c00 = V[1, 1] * V[2, 2] - V[2, 1] * V[2, 1]
    c10 = V[2, 1] * V[2, 0] - V[1, 0] * V[2, 2]
    c20 = V[1, 0] * V[2, 1] - V[1, 1] * V[2, 0]
    det = V[0, 0] * c00 + V[1, 0] * c10 + V[2, 0] * c20
    if not det > 1e-15 * V[0, 0] * V[1, 1] * V[2, 2]:
        return False
    out[0, 0], out[1, 0], out[2, 0] = c00 / det, c10 / det, c20 / det
    out[1, 1] = (V[0, 0] * V[2, 2] - V[2, 0] * V[2, 0]) / det
    out[2, 1] = (V[1, 0] * V[2, 0] - V[0, 0] * V[2, 1]) / det
    out[2, 2] = (V[0, 0] * V[1, 1] - V[1, 0] * V[1, 0]) / det
    out[0, 1], out[0, 2], out[1, 2] = out[1, 0], out[2, 0], out[2, 1]
    return True


class Scratch(NamedTuple):
    """Working arrays for one point: of r rays at most, k unknown parameters of a camera.

    Parameters
    ----------
    L : (r, 2, 6 + k + 3) whitened derivatives of each ray by pose, camera and point.
    e : (r, 2) whitened residuals of each ray.
    ray : (r,) row of each ray among the observations.
    column : (r, 6 + k + 3) columns of each ray's unknowns in the normal matrix.
    W, T : (6 r + c k, 3) rows of W of the point, and of W V^-1.
    row : (6 r + c k,) column of the normal matrix that each row of W belongs to.
    slot : (c,) place of a camera among the rows of W, -1 where it has none.
    work, full : (10,) and (2, 11) of single observations.
    V, Vi : (3, 3) matrix of the point and its inverse.
    g : (3,) right-hand side of the point.
    """

    L: Array
    e: Array
    ray: Rows
    column: Rows
    W: Array
    T: Array
    row: Rows
    slot: Rows
    work: Array
    full: Array
    V: Array
    Vi: Array
    g: Array


def scratch_for(rays: Rays, n_cameras: int) -> Scratch:
    """Return working arrays for all points of the observations.

    Parameters
    ----------
    rays : Rays
        The observations.
    n_cameras : int
        Number of cameras.

    Returns
    -------
    Scratch
        The arrays.
    """
    r, k = max(int(np.diff(rays.start).max(initial=1)), 1), rays.columns.size
    rows = 6 * r + min(n_cameras, r) * k
    return Scratch(
        np.empty((r, 2, 9 + k)),
        np.empty((r, 2)),
        np.empty(r, dtype=np.int64),
        np.empty((r, 9 + k), dtype=np.int64),
        np.empty((rows, 3)),
        np.empty((rows, 3)),
        np.empty(rows, dtype=np.int64),
        np.full(n_cameras, -1, dtype=np.int64),
        np.empty(10),
        np.empty((2, INTERIOR)),
        np.empty((3, 3)),
        np.empty((3, 3)),
        np.empty(3),
    )


@njit(cache=True)
def linearise_point(rays, values, p, s):
    """Linearise the active observations of one point.

    Parameters
    ----------
    rays, values : Rays, Values
        The observations, and where they are linearised.
    p : int
        Row of the point.
    s : Scratch
        L, e, ray, column, W and row are written; J^T P J and J^T P e of the point are added to V
        and g.

    Returns
    -------
    m : int
        Number of active rays.
    n : int
        Number of rows of W; 0 of a point that is not eliminated.
    """
    k = rays.columns.size
    wide, kept = 6 + k, rays.kept[p]
    first_camera = 6 * values.position.shape[0]
    X = values.point[p]
    A, B = np.empty((2, 6)), np.empty((2, 3))
    m = 0
    for j in range(rays.start[p], rays.start[p + 1]):
        if not rays.active[j]:
            continue
        i = rays.image[j]
        cam = rays.camera[i]
        c, X0, C, uv, e = (
            values.interior[cam],
            values.position[i],
            values.C_mc[i],
            rays.uv[j],
            s.e[m],
        )
        backward, unit = rays.backward[cam], rays.unit[cam]
        image_residual(X0, C, X, c, backward, unit, values.fold2[cam], uv, s.work, e)
        image_jacobian(X0, C, X, c, backward, unit, uv, s.work, A, s.full, B)
        for r in range(2):
            w = rays.weight[j, r]
            e[r] *= w
            for a in range(6):
                s.L[m, r, a] = w * A[r, a]
            for a in range(k):
                s.L[m, r, 6 + a] = w * s.full[r, rays.columns[a]]
            for a in range(3):
                s.L[m, r, wide + a] = w * B[r, a]
        for a in range(6):
            s.column[m, a] = 6 * i + a
        for a in range(k):
            s.column[m, 6 + a] = first_camera + k * cam + a
        for a in range(3):
            s.column[m, wide + a] = kept + a
        s.ray[m] = j
        m += 1
    if kept >= 0:
        return m, 0
    n = 6 * m
    for t in range(m):
        cam = rays.camera[rays.image[s.ray[t]]]
        if s.slot[cam] < 0:
            s.slot[cam] = n
            for a in range(k):
                s.row[n + a] = s.column[t, 6 + a]
                for b in range(3):
                    s.W[n + a, b] = 0.0
            n += k
        for a in range(wide):
            row = 6 * t + a if a < 6 else s.slot[cam] + a - 6
            if a < 6:
                s.row[row] = s.column[t, a]
            for b in range(3):
                if a < 6:
                    s.W[row, b] = 0.0
                for r in range(2):
                    s.W[row, b] += s.L[t, r, a] * s.L[t, r, wide + b]
        for a in range(3):
            for r in range(2):
                s.g[a] += s.L[t, r, wide + a] * s.e[t, r]
                for b in range(3):
                    s.V[a, b] += s.L[t, r, wide + a] * s.L[t, r, wide + b]
    for t in range(m):
        s.slot[rays.camera[rays.image[s.ray[t]]]] = -1
    return m, n


@njit(cache=True)
def take_own(own_V, own_g, p, s):
    """Begin the matrix and right-hand side of point p with what groups say of it alone."""
    for a in range(3):
        s.g[a] = own_g[p, a]
        for b in range(3):
            s.V[a, b] = own_V[p, a, b]


@njit(cache=True)
def times_inverse(s, n):
    """Compute T = W V^-1 of n rows."""
    for a in range(n):
        for b in range(3):
            s.T[a, b] = s.W[a, 0] * s.Vi[0, b] + s.W[a, 1] * s.Vi[1, b] + s.W[a, 2] * s.Vi[2, b]


@njit(cache=True)
def normal_equations(rays, values, damping, own_V, own_g, s, S, g, g_reduced, diagonal, gp):
    """Add the image observations to the normal equations, points eliminated (J.6).

    Parameters
    ----------
    rays, values : Rays, Values
        The observations, and where they are linearised.
    damping : float
        lambda: the diagonal of each point's matrix is enlarged by 1 + lambda.
    own_V, own_g : ndarray
        (np, 3, 3) and (np, 3) what groups say of each point alone.
    s : Scratch
        Working arrays.
    S : ndarray, (u, u)
        Normal matrix; its lower triangle is added to.
    g, g_reduced : ndarray, (u,)
        J^T P e, and what eliminating the points takes from it, added to.
    diagonal : ndarray, (u,)
        Diagonal of U, added to.
    gp : ndarray, (np, 3)
        Right-hand sides of the points, written here.

    Returns
    -------
    int
        First point whose matrix is singular, -1 if there is none.
    """
    wide = 6 + rays.columns.size
    for p in range(rays.start.size - 1):
        take_own(own_V, own_g, p, s)
        m, n = linearise_point(rays, values, p, s)
        for a in range(3):
            gp[p, a] = s.g[a]
        width = wide if rays.kept[p] < 0 else wide + 3
        for t in range(m):
            for a in range(width):
                l0, l1, row = s.L[t, 0, a], s.L[t, 1, a], s.column[t, a]
                g[row] += l0 * s.e[t, 0] + l1 * s.e[t, 1]
                diagonal[row] += l0 * l0 + l1 * l1
                for b in range(a + 1):
                    S[row, s.column[t, b]] += l0 * s.L[t, 0, b] + l1 * s.L[t, 1, b]
        if n == 0:
            continue
        for a in range(3):
            s.V[a, a] *= 1.0 + damping
        if not invert3(s.V, s.Vi):
            return p
        times_inverse(s, n)
        for a in range(n):
            row = s.row[a]
            t0, t1, t2 = s.T[a, 0], s.T[a, 1], s.T[a, 2]
            g_reduced[row] -= t0 * s.g[0] + t1 * s.g[1] + t2 * s.g[2]
            for b in range(n):
                if s.row[b] <= row:
                    S[row, s.row[b]] -= t0 * s.W[b, 0] + t1 * s.W[b, 1] + t2 * s.W[b, 2]
    return -1


@njit(cache=True)
def back_substitute(rays, values, damping, own_V, own_g, s, dx, dp):
    """Compute the corrections of all points (J.6).

    Parameters
    ----------
    rays, values, damping, own_V, own_g, s
        As in `normal_equations`.
    dx : ndarray, (u,)
        Corrections of all other unknowns.
    dp : ndarray, (np, 3)
        Corrections of the points, m, written here.
    """
    for p in range(rays.start.size - 1):
        for a in range(3):
            dp[p, a] = dx[rays.kept[p] + a] if rays.kept[p] >= 0 else 0.0
        if rays.kept[p] >= 0:
            continue
        take_own(own_V, own_g, p, s)
        _, n = linearise_point(rays, values, p, s)
        for a in range(n):
            for b in range(3):
                s.g[b] -= s.W[a, b] * dx[s.row[a]]
        for a in range(3):
            s.V[a, a] *= 1.0 + damping
        if invert3(s.V, s.Vi):
            for a in range(3):
                dp[p, a] = s.Vi[a, 0] * s.g[0] + s.Vi[a, 1] * s.g[1] + s.Vi[a, 2] * s.g[2]


@njit(cache=True)
def posterior(rays, values, own_V, own_g, s, Q, Q_point, redundancy):
    """Compute cofactors of the points and redundancy numbers of the image observations (J.7).

    Parameters
    ----------
    rays, values : Rays, Values
        The observations, and the adjusted values.
    own_V, own_g : ndarray
        (np, 3, 3) and (np, 3) what groups say of each point alone.
    s : Scratch
        Working arrays.
    Q : ndarray, (u, u)
        Cofactors of all unknowns but eliminated points; zero in rows and columns of what is held.
    Q_point : ndarray, (np, 3, 3)
        Cofactors of the points, m^2, written here but for points that nothing observes.
    redundancy : ndarray, (n, 2)
        Redundancy numbers, written here but for observations that are not active.
    """
    wide = 6 + rays.columns.size
    # of a ray: cofactors of its pose and camera, and of these with the point
    Qx, Qxp, Qp = np.empty((wide, wide)), np.empty((wide, 3)), np.empty((3, 3))
    QT = np.empty_like(s.W)
    for p in range(rays.start.size - 1):
        kept = rays.kept[p]
        take_own(own_V, own_g, p, s)
        m, n = linearise_point(rays, values, p, s)
        if kept >= 0:
            for a in range(3):
                for b in range(3):
                    Qp[a, b] = Q[kept + a, kept + b]
        else:
            if not invert3(s.V, s.Vi):
                continue
            for a in range(3):
                for b in range(3):
                    Qp[a, b] = s.Vi[a, b]
            times_inverse(s, n)
            for a in range(n):
                row = s.row[a]
                for c in range(3):
                    QT[a, c] = 0.0
                for b in range(n):
                    q = Q[row, s.row[b]]
                    for c in range(3):
                        QT[a, c] += q * s.T[b, c]
                for b in range(3):
                    for c in range(3):
                        Qp[b, c] += s.T[a, b] * QT[a, c]
        for a in range(3):
            for b in range(3):
                Q_point[p, a, b] = Qp[a, b]
        for t in range(m):
            for a in range(wide):
                row = s.column[t, a]
                for b in range(wide):
                    Qx[a, b] = Q[row, s.column[t, b]]
                for c in range(3):
                    Qxp[a, c] = Q[row, kept + c] if kept >= 0 else 0.0
            for a in range(n):
                for b in range(wide):
                    if s.row[a] == s.column[t, b]:
                        for c in range(3):
                            Qxp[b, c] = -QT[a, c]
            for r in range(2):
                variance = 0.0
                for a in range(wide + 3):
                    inner = 0.0
                    for b in range(wide + 3):
                        if a < wide and b < wide:
                            q = Qx[a, b]
                        elif a < wide:
                            q = Qxp[a, b - wide]
                        elif b < wide:
                            q = Qxp[b, a - wide]
                        else:
                            q = Qp[a - wide, b - wide]
                        inner += q * s.L[t, r, b]
                    variance += s.L[t, r, a] * inner
                redundancy[s.ray[t], r] = 1.0 - variance
