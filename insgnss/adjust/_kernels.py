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
def linearise(rays, values, j, X, work, e, A, K, full, B):
    """Compute the whitened residual and derivative of observation j of a point X.

    Parameters
    ----------
    rays, values : Rays, Values
        The observations, and where they are linearised.
    j : int
        Row of the observation.
    X : ndarray, (3,)
        The object point.
    work, full : ndarray
        (10,) and (2, 11) scratch.
    e, A, K, B : ndarray
        (2,) residual, (2, 6), (2, k) and (2, 3) derivatives by pose, unknown parameters of the
        camera and point, written here.

    Returns
    -------
    bool
        As `image_residual`.
    """
    i = rays.image[j]
    cam = rays.camera[i]
    c = values.interior[cam]
    X0, C, uv = values.position[i], values.C_mc[i], rays.uv[j]
    backward, unit = rays.backward[cam], rays.unit[cam]
    if not image_residual(X0, C, X, c, backward, unit, values.fold2[cam], uv, work, e):
        return False
    image_jacobian(X0, C, X, c, backward, unit, uv, work, A, full, B)
    for row in range(2):
        w = rays.weight[j, row]
        e[row] *= w
        for col in range(6):
            A[row, col] *= w
        for col in range(rays.columns.size):
            K[row, col] = w * full[row, rays.columns[col]]
        for col in range(3):
            B[row, col] *= w
    return True


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


@njit(cache=True)
def add_product(S, row, col, L, R, sign):
    """Add sign L^T R to the block of S at row, col; L is (2, a), R (2, b)."""
    for i in range(L.shape[1]):
        l0, l1 = sign * L[0, i], sign * L[1, i]
        for j in range(R.shape[1]):
            S[row + i, col + j] += l0 * R[0, j] + l1 * R[1, j]


@njit(cache=True)
def subtract_outer(S, row, col, T, W):
    """Subtract T W^T from the block of S at row, col; T is (a, 3), W (b, 3)."""
    for i in range(T.shape[0]):
        t0, t1, t2 = T[i, 0], T[i, 1], T[i, 2]
        for j in range(W.shape[0]):
            S[row + i, col + j] -= t0 * W[j, 0] + t1 * W[j, 1] + t2 * W[j, 2]


@njit(cache=True)
def times_inverse(W, Vi, T):
    """Compute T = W V^-1; W and T are (a, 3)."""
    for i in range(W.shape[0]):
        for j in range(3):
            T[i, j] = W[i, 0] * Vi[0, j] + W[i, 1] * Vi[1, j] + W[i, 2] * Vi[2, j]


@njit(cache=True)
def normal_equations(rays, values, damping, V_prior, g_prior, S, g, g_reduced, diagonal, V, gp):
    """Add the image observations to the normal equations, points eliminated (J.6).

    Parameters
    ----------
    rays, values : Rays, Values
        The observations, and where they are linearised.
    damping : float
        lambda: the diagonal of each point's matrix is enlarged by 1 + lambda.
    V_prior, g_prior : ndarray
        (np, 3, 3) and (np, 3) what groups say of each point alone.
    S : ndarray, (u, u)
        Normal matrix; its lower triangle is added to.
    g, g_reduced : ndarray, (u,)
        J^T P e, and what is left of it when the points are eliminated, added to.
    diagonal : ndarray, (u,)
        Diagonal of U, added to.
    V, gp : ndarray
        (np, 3, 3) matrices, not enlarged, and (np, 3) right-hand sides of the points, written here.

    Returns
    -------
    int
        First point whose matrix is singular, -1 if there is none.
    """
    k = rays.columns.size
    n_images, n_cameras = values.position.shape[0], values.interior.shape[0]
    first_camera = 6 * n_images
    longest = 1
    for p in range(rays.start.size - 1):
        longest = max(longest, rays.start[p + 1] - rays.start[p])
    work, e, A, K = np.empty(10), np.empty(2), np.empty((2, 6)), np.empty((2, k))
    full, B = np.empty((2, INTERIOR)), np.empty((2, 3))
    W, T = np.empty((longest, 6, 3)), np.empty((longest, 6, 3))
    Wc, Tc = np.empty((n_cameras, k, 3)), np.empty((n_cameras, k, 3))
    cameras, seen_by = np.empty(n_cameras, dtype=np.int64), np.empty(longest, dtype=np.int64)
    enlarged, Vi = np.empty((3, 3)), np.empty((3, 3))
    for p in range(rays.start.size - 1):
        kept = rays.kept[p]
        m, n_seen = 0, 0
        Vp, gpp = V[p], gp[p]
        Vp[:] = V_prior[p]
        gpp[:] = g_prior[p]
        for j in range(rays.start[p], rays.start[p + 1]):
            if not rays.active[j]:
                continue
            linearise(rays, values, j, values.point[p], work, e, A, K, full, B)
            i = rays.image[j]
            cam = rays.camera[i]
            row, crow = 6 * i, first_camera + k * cam
            add_product(S, row, row, A, A, 1.0)
            add_product(S, crow, row, K, A, 1.0)
            add_product(S, crow, crow, K, K, 1.0)
            for a in range(6):
                diagonal[row + a] += A[0, a] ** 2 + A[1, a] ** 2
                g[row + a] += A[0, a] * e[0] + A[1, a] * e[1]
            for a in range(k):
                diagonal[crow + a] += K[0, a] ** 2 + K[1, a] ** 2
                g[crow + a] += K[0, a] * e[0] + K[1, a] * e[1]
            if kept >= 0:
                add_product(S, kept, row, B, A, 1.0)
                add_product(S, kept, crow, B, K, 1.0)
                add_product(S, kept, kept, B, B, 1.0)
                for a in range(3):
                    diagonal[kept + a] += B[0, a] ** 2 + B[1, a] ** 2
                    g[kept + a] += B[0, a] * e[0] + B[1, a] * e[1]
                continue
            add_product(Vp, 0, 0, B, B, 1.0)
            for a in range(3):
                gpp[a] += B[0, a] * e[0] + B[1, a] * e[1]
            W[m] = 0.0
            add_product(W[m], 0, 0, A, B, 1.0)
            slot = -1
            for t in range(n_seen):
                if cameras[t] == cam:
                    slot = t
            if slot < 0:
                slot, cameras[n_seen] = n_seen, cam
                Wc[slot] = 0.0
                n_seen += 1
            add_product(Wc[slot], 0, 0, K, B, 1.0)
            seen_by[m] = i
            m += 1
        if kept >= 0 or m == 0:
            continue
        enlarged[:] = Vp
        for a in range(3):
            enlarged[a, a] *= 1.0 + damping
        if not invert3(enlarged, Vi):
            return p
        for a in range(m):
            times_inverse(W[a], Vi, T[a])
        for a in range(n_seen):
            times_inverse(Wc[a], Vi, Tc[a])
        for a in range(m):
            row = 6 * seen_by[a]
            for b in range(m):
                if seen_by[a] >= seen_by[b]:
                    subtract_outer(S, row, 6 * seen_by[b], T[a], W[b])
            for b in range(6):
                g_reduced[row + b] -= (
                    T[a, b, 0] * gpp[0] + T[a, b, 1] * gpp[1] + T[a, b, 2] * gpp[2]
                )
        for a in range(n_seen):
            crow = first_camera + k * cameras[a]
            for b in range(m):
                subtract_outer(S, crow, 6 * seen_by[b], Tc[a], W[b])
            for b in range(n_seen):
                if cameras[a] >= cameras[b]:
                    subtract_outer(S, crow, first_camera + k * cameras[b], Tc[a], Wc[b])
            for b in range(k):
                g_reduced[crow + b] -= (
                    Tc[a, b, 0] * gpp[0] + Tc[a, b, 1] * gpp[1] + Tc[a, b, 2] * gpp[2]
                )
    return -1


@njit(cache=True)
def back_substitute(rays, values, damping, V, gp, dx, dp):
    """Compute the corrections of the eliminated points (J.6).

    Parameters
    ----------
    rays, values, damping
        As in `normal_equations`.
    V, gp : ndarray
        As `normal_equations` leaves them.
    dx : ndarray, (u,)
        Corrections of all other unknowns.
    dp : ndarray, (np, 3)
        Corrections of the points, m, written here.
    """
    k = rays.columns.size
    first_camera = 6 * values.position.shape[0]
    work, e, A, K = np.empty(10), np.empty(2), np.empty((2, 6)), np.empty((2, k))
    full, B = np.empty((2, INTERIOR)), np.empty((2, 3))
    enlarged, Vi, g = np.empty((3, 3)), np.empty((3, 3)), np.empty(3)
    for p in range(rays.start.size - 1):
        dp[p] = 0.0
        if rays.kept[p] >= 0:
            for a in range(3):
                dp[p, a] = dx[rays.kept[p] + a]
            continue
        g[:] = gp[p]
        for j in range(rays.start[p], rays.start[p + 1]):
            if not rays.active[j]:
                continue
            linearise(rays, values, j, values.point[p], work, e, A, K, full, B)
            row = 6 * rays.image[j]
            crow = first_camera + k * rays.camera[rays.image[j]]
            for r in range(2):
                moved = 0.0
                for a in range(6):
                    moved += A[r, a] * dx[row + a]
                for a in range(k):
                    moved += K[r, a] * dx[crow + a]
                for a in range(3):
                    g[a] -= B[r, a] * moved
        enlarged[:] = V[p]
        for a in range(3):
            enlarged[a, a] *= 1.0 + damping
        if invert3(enlarged, Vi):
            for a in range(3):
                dp[p, a] = Vi[a, 0] * g[0] + Vi[a, 1] * g[1] + Vi[a, 2] * g[2]


@njit(cache=True)
def quadratic(L, Q, R):
    """Return L Q R^T of two rows L (a,) and R (b,)."""
    total = 0.0
    for i in range(L.size):
        if L[i] != 0.0:
            inner = 0.0
            for j in range(R.size):
                inner += Q[i, j] * R[j]
            total += L[i] * inner
    return total


@njit(cache=True)
def posterior(rays, values, V, Q, Q_point, redundancy):
    """Compute cofactors of the points and redundancy numbers of the image observations (J.7).

    Parameters
    ----------
    rays, values : Rays, Values
        The observations, and the adjusted values.
    V : ndarray, (np, 3, 3)
        Normal matrices of the points.
    Q : ndarray, (u, u)
        Cofactors of all unknowns but eliminated points; zero in rows and columns of what is held.
    Q_point : ndarray, (np, 3, 3)
        Cofactors of the points, m^2, written here; NaN of points without an active observation.
    redundancy : ndarray, (n, 2)
        Redundancy numbers, written here; NaN of observations that are not active.
    """
    k = rays.columns.size
    first_camera = 6 * values.position.shape[0]
    longest = 1
    for p in range(rays.start.size - 1):
        longest = max(longest, rays.start[p + 1] - rays.start[p])
    work, e, full = np.empty(10), np.empty(2), np.empty((2, INTERIOR))
    A, K, B = np.empty((longest, 2, 6)), np.empty((longest, 2, k)), np.empty((longest, 2, 3))
    wide = 6 + k
    # one slot a ray: its pose and its camera, whose share in W is that of this ray
    W, QT = np.zeros((longest * wide, 3)), np.zeros((longest * wide, 3))
    index, own = np.empty(longest * wide, dtype=np.int64), np.empty(wide)
    rows = np.empty(longest, dtype=np.int64)
    Vi, Qp, local = np.empty((3, 3)), np.empty((3, 3)), np.empty((wide, wide))
    for p in range(rays.start.size - 1):
        m = 0
        for j in range(rays.start[p], rays.start[p + 1]):
            redundancy[j] = np.nan
            if not rays.active[j]:
                continue
            linearise(rays, values, j, values.point[p], work, e, A[m], K[m], full, B[m])
            row = 6 * rays.image[j]
            crow = first_camera + k * rays.camera[rays.image[j]]
            for a in range(wide):
                index[wide * m + a] = row + a if a < 6 else crow + a - 6
            rows[m] = j
            m += 1
        kept = rays.kept[p]
        Q_point[p] = np.nan
        if m == 0:
            if kept < 0 and invert3(V[p], Vi):
                Q_point[p] = Vi
            continue
        n = m * wide
        if kept >= 0:
            for a in range(3):
                for b in range(3):
                    Qp[a, b] = Q[kept + a, kept + b]
            for a in range(n):
                for b in range(3):
                    QT[a, b] = -Q[index[a], kept + b]
        else:
            if not invert3(V[p], Vi):
                continue
            for t in range(m):
                for a in range(wide):
                    for b in range(3):
                        W[wide * t + a, b] = 0.0
                        for r in range(2):
                            l = A[t, r, a] if a < 6 else K[t, r, a - 6]
                            W[wide * t + a, b] += l * B[t, r, b]
            times_inverse(W[:n], Vi, QT[:n])
            W[:n] = QT[:n]  # T of (J.7)
            for a in range(n):
                s0, s1, s2 = 0.0, 0.0, 0.0
                Qa = Q[index[a]]
                for b in range(n):
                    q = Qa[index[b]]
                    s0 += q * W[b, 0]
                    s1 += q * W[b, 1]
                    s2 += q * W[b, 2]
                QT[a, 0], QT[a, 1], QT[a, 2] = s0, s1, s2
            Qp[:] = Vi
            for a in range(n):
                for b in range(3):
                    for c in range(3):
                        Qp[b, c] += W[a, b] * QT[a, c]
        Q_point[p] = Qp
        for t in range(m):
            for a in range(wide):
                for b in range(wide):
                    local[a, b] = Q[index[wide * t + a], index[wide * t + b]]
            for r in range(2):
                own[:6] = A[t, r]
                own[6:] = K[t, r]
                variance = quadratic(own, local, own) + quadratic(B[t, r], Qp, B[t, r])
                variance -= 2.0 * quadratic(own, QT[wide * t : wide * (t + 1)], B[t, r])
                redundancy[rows[t], r] = 1.0 - variance
