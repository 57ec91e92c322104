"""Numba kernels that eliminate object points from the normal equations (J.6)."""

from typing import NamedTuple

import numpy as np

from ....base.compilation import njit
from .collinearity import Rows
from .points import invert3, linearise_point, take_own, times_inverse


class EntryPlaces(NamedTuple):
    """Where the entries of a symmetric matrix stand that is stored by columns (`envelope`).

    Entry (r, c), r >= c, stands at inner[c] + r where r < window, else at outer[c] + r.

    Parameters
    ----------
    window : number of columns before the border.
    inner, outer : (u,) of each column.
    """

    window: int
    inner: Rows
    outer: Rows


@njit(cache=True)
def address(places, r, c):
    """Return where an entry of a symmetric matrix stands.

    Parameters
    ----------
    places : EntryPlaces
        Where entries stand.
    r, c : int
        Row and column, in any order.

    Returns
    -------
    int
        Its place among the numbers that are stored.
    """
    if r < c:
        r, c = c, r
    return r + (places.inner[c] if r < places.window else places.outer[c])


@njit(cache=True)
def add_between(places, columns, N, stored):
    """Add a symmetric matrix between some columns.

    Parameters
    ----------
    places : EntryPlaces
        Where entries stand.
    columns : ndarray of int, (n,)
        The columns, each once.
    N : ndarray, (n, n)
        What is added, of which the lower triangle is read.
    stored : ndarray
        The matrix that is added to.
    """
    for a in range(columns.size):
        for b in range(a + 1):
            stored[address(places, columns[a], columns[b])] += N[a, b]


@njit(cache=True)
def take_between(places, columns, stored, out):
    """Read the entries between some columns.

    Parameters
    ----------
    places : EntryPlaces
        Where entries stand.
    columns : ndarray of int, (n,)
        The columns.
    stored : ndarray
        The matrix.
    out : ndarray, (n, n)
        The entries, written here.
    """
    for a in range(columns.size):
        for b in range(a + 1):
            out[a, b] = out[b, a] = stored[address(places, columns[a], columns[b])]


@njit(cache=True)
def add_product(start, column, value, P, out):
    """Add J^T P J of a sparse matrix J, one row of P after the other.

    Parameters
    ----------
    start, column, value : ndarray
        (m + 1,), (k,), (k,) J by rows: where each begins, columns, and what stands there.
    P : ndarray, (m, m)
        The matrix between.
    out : ndarray, (d, d)
        The product, added to.
    """
    weighted = np.empty(len(out))
    for r in range(len(P)):
        weighted[:] = 0.0
        for q in range(len(P)):
            p = P[r, q]
            for k in range(start[q], start[q + 1]):
                weighted[column[k]] += p * value[k]
        for k in range(start[r], start[r + 1]):
            v, row = value[k], out[column[k]]
            for a in range(weighted.size):
                row[a] += v * weighted[a]


@njit(cache=True)
def normal_equations(rays, values, damping, own_V, own_g, s, places, S, g, g_reduced, diagonal, gp):
    """Add the image observations to the normal equations, points eliminated (J.6).

    Parameters
    ----------
    rays, values : Rays, Values
        The observations, and where they are linearised.
    damping : float
        lambda: the diagonal of each point's matrix is enlarged by 1 + lambda.
    own_V, own_g : ndarray
        (np, 3, 3) and (np, 3) what groups say of each point alone.
    s : PointArrays
        Working arrays.
    places : EntryPlaces
        Where the entries of the normal matrix stand.
    S : ndarray
        Normal matrix, added to.
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
    w0, w1, w2 = np.empty(len(s.W)), np.empty(len(s.W)), np.empty(len(s.W))
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
                inner, outer = places.inner[row], places.outer[row]
                if a < 6:
                    k = row - a + (inner if places.window > 0 else outer)
                    for b in range(a, 6):
                        S[k + b] += l0 * s.L[t, 0, b] + l1 * s.L[t, 1, b]
                for b in range(max(a, 6), width):
                    S[s.column[t, b] + outer] += l0 * s.L[t, 0, b] + l1 * s.L[t, 1, b]
        if n == 0:
            continue
        for a in range(3):
            s.V[a, a] *= 1.0 + damping
        if not invert3(s.V, s.Vi):
            return p
        times_inverse(s, n)
        poses = 6 * m
        for a in range(n):
            w0[a], w1[a], w2[a] = s.W[a, 0], s.W[a, 1], s.W[a, 2]
        begin = 0
        for a in range(n):
            row = s.row[a]
            # rays stand in the order of their images' columns; rows before have been met
            if a == poses or (a % 6 == 0 and a < poses and s.row[begin] != row):
                begin = a
            t0, t1, t2 = s.T[a, 0], s.T[a, 1], s.T[a, 2]
            g_reduced[row] -= t0 * s.g[0] + t1 * s.g[1] + t2 * s.g[2]
            inner, outer = places.inner[row], places.outer[row]
            of_pose = inner if places.window > 0 else outer
            for b in range(begin, poses, 6):
                r = s.row[b]
                k = r + of_pose
                if r >= row:
                    for c in range(6):
                        S[k + c] -= t0 * w0[b + c] + t1 * w1[b + c] + t2 * w2[b + c]
                else:
                    for c in range(row - r, 6):
                        S[k + c] -= t0 * w0[b + c] + t1 * w1[b + c] + t2 * w2[b + c]
            for b in range(max(begin, poses), n):
                r = s.row[b]
                if r >= row:
                    S[r + outer] -= t0 * w0[b] + t1 * w1[b] + t2 * w2[b]
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
    wide = 6 + rays.columns.size
    for p in range(rays.start.size - 1):
        for a in range(3):
            dp[p, a] = dx[rays.kept[p] + a] if rays.kept[p] >= 0 else 0.0
        if rays.kept[p] >= 0:
            continue
        take_own(own_V, own_g, p, s)
        m, _ = linearise_point(rays, values, p, s, False)
        for t in range(m):
            for r in range(2):
                moved = 0.0
                for a in range(wide):
                    moved += s.L[t, r, a] * dx[s.column[t, a]]
                for b in range(3):
                    s.g[b] -= s.L[t, r, wide + b] * moved
        for a in range(3):
            s.V[a, a] *= 1.0 + damping
        if invert3(s.V, s.Vi):
            for a in range(3):
                dp[p, a] = s.Vi[a, 0] * s.g[0] + s.Vi[a, 1] * s.g[1] + s.Vi[a, 2] * s.g[2]
