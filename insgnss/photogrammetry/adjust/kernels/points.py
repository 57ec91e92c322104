"""Numba kernels of one object point: its rays linearised, its matrix inverted (J.6)."""

from typing import NamedTuple

import numpy as np

from ....base.compilation import njit
from .collinearity import N_INTERIOR, Array, Rays, Rows, image_jacobian, image_residual


@njit(cache=True)
def invert3(V, out):
    """Invert a symmetric positive definite matrix.

    Parameters
    ----------
    V : ndarray, (3, 3)
        The matrix.
    out : ndarray, (3, 3)
        Its inverse, written here.

    Returns
    -------
    bool
        Whether it is positive definite.
    """
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


class PointArrays(NamedTuple):
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


def scratch_for(rays: Rays, n_cameras: int) -> PointArrays:
    """Return working arrays for all points of the observations.

    Parameters
    ----------
    rays : Rays
        The observations.
    n_cameras : int
        Number of cameras.

    Returns
    -------
    PointArrays
        The arrays.
    """
    r, k = max(int(np.diff(rays.start).max(initial=1)), 1), rays.columns.size
    rows = 6 * r + min(n_cameras, r) * k
    return PointArrays(
        np.empty((r, 2, 9 + k)),
        np.empty((r, 2)),
        np.empty(r, dtype=np.int64),
        np.empty((r, 9 + k), dtype=np.int64),
        np.empty((rows, 3)),
        np.empty((rows, 3)),
        np.empty(rows, dtype=np.int64),
        np.full(n_cameras, -1, dtype=np.int64),
        np.empty(10),
        np.empty((2, N_INTERIOR)),
        np.empty((3, 3)),
        np.empty((3, 3)),
        np.empty(3),
    )


@njit(cache=True)
def linearise_point(rays, values, p, s, with_W=True):
    """Linearise the active observations of one point.

    Parameters
    ----------
    rays, values : Rays, Values
        The observations, and where they are linearised.
    p : int
        Row of the point.
    s : PointArrays
        L, e, ray, column, W and row are written; J^T P J and J^T P e of the point are added to V
        and g.
    with_W : bool
        Whether W and row are wanted.

    Returns
    -------
    m : int
        Number of active rays.
    n : int
        Number of rows of W; 0 of a point that is not eliminated, and where W is not wanted.
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
        model, unit = rays.model[cam], rays.unit[cam]
        image_residual(X0, C, X, c, model, unit, values.fold2[cam], uv, s.work, e)
        image_jacobian(X0, C, X, c, model, unit, uv, s.work, A, s.full, B)
        w0, w1, w2 = rays.weight[j, 0], rays.weight[j, 1], rays.weight[j, 2]
        e[1] = w1 * e[0] + w2 * e[1]
        e[0] *= w0
        for a in range(6):
            s.L[m, 0, a], s.L[m, 1, a] = w0 * A[0, a], w1 * A[0, a] + w2 * A[1, a]
            s.column[m, a] = rays.pose[i] + a
        for a in range(k):
            c0, c1 = s.full[0, rays.columns[a]], s.full[1, rays.columns[a]]
            s.L[m, 0, 6 + a], s.L[m, 1, 6 + a] = w0 * c0, w1 * c0 + w2 * c1
            s.column[m, 6 + a] = first_camera + k * cam + a
        for a in range(3):
            b = wide + a
            s.L[m, 0, b], s.L[m, 1, b] = w0 * B[0, a], w1 * B[0, a] + w2 * B[1, a]
            s.column[m, b] = kept + a
        s.ray[m] = j
        m += 1
    if kept >= 0:
        return m, 0
    for t in range(m):
        for a in range(3):
            for r in range(2):
                s.g[a] += s.L[t, r, wide + a] * s.e[t, r]
                for b in range(3):
                    s.V[a, b] += s.L[t, r, wide + a] * s.L[t, r, wide + b]
    if not with_W:
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
    for t in range(m):
        s.slot[rays.camera[rays.image[s.ray[t]]]] = -1
    return m, n


@njit(cache=True)
def take_own(own_V, own_g, p, s):
    """Begin the matrix and right-hand side of a point with what groups say of it alone.

    Parameters
    ----------
    own_V, own_g : ndarray
        (np, 3, 3) and (np, 3) what groups say of each point alone.
    p : int
        Row of the point.
    s : PointArrays
        V and g are written.
    """
    for a in range(3):
        s.g[a] = own_g[p, a]
        for b in range(3):
            s.V[a, b] = own_V[p, a, b]


@njit(cache=True)
def times_inverse(s, n):
    """Compute T = W V^-1.

    Parameters
    ----------
    s : PointArrays
        T is written.
    n : int
        Rows of W.
    """
    for a in range(n):
        for b in range(3):
            s.T[a, b] = s.W[a, 0] * s.Vi[0, b] + s.W[a, 1] * s.Vi[1, b] + s.W[a, 2] * s.Vi[2, b]
