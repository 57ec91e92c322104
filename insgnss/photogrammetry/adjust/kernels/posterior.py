"""Numba kernels of cofactors of the points and of redundancy numbers (J.7), and of residuals of
points that were intersected from held poses (J.20)."""

import numpy as np

from ....base.compilation import njit
from .elimination import address
from .points import invert3, linearise_point, take_own, times_inverse


@njit(cache=True)
def posterior(rays, values, own_V, own_g, s, places, Q, Q_point, residual):
    """Compute cofactors of the points and redundancy numbers of the image observations (J.7).

    Parameters
    ----------
    rays, values : Rays, Values
        The observations, and the adjusted values.
    own_V, own_g : ndarray
        (np, 3, 3) and (np, 3) what groups say of each point alone.
    s : PointArrays
        Working arrays.
    places : EntryPlaces
        Where the entries of Q stand.
    Q : ndarray
        Cofactors of all unknowns but eliminated points; zero in rows and columns of what is held.
    Q_point : ndarray, (np, 3, 3)
        Cofactors of the points, m^2, written here but for points that nothing observes.
    residual : ndarray, (n, 3)
        Cofactors (0, 0), (1, 0), (1, 1) of both whitened residuals, written here but for
        observations that are not active.
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
                    Qp[a, b] = Q[address(places, kept + a, kept + b)]
        else:
            if not invert3(s.V, s.Vi):
                continue
            for a in range(3):
                for b in range(3):
                    Qp[a, b] = s.Vi[a, b]
            times_inverse(s, n)
            for a in range(n):
                for c in range(3):
                    QT[a, c] = 0.0
                for b in range(a):
                    q = Q[address(places, s.row[a], s.row[b])]
                    for c in range(3):
                        QT[a, c] += q * s.T[b, c]
                        QT[b, c] += q * s.T[a, c]
                q = Q[address(places, s.row[a], s.row[a])]
                for c in range(3):
                    QT[a, c] += q * s.T[a, c]
            for a in range(n):
                for b in range(3):
                    for c in range(3):
                        Qp[b, c] += s.T[a, b] * QT[a, c]
        for a in range(3):
            for b in range(3):
                Q_point[p, a, b] = Qp[a, b]
        for t in range(m):
            for a in range(wide):
                row = s.column[t, a]
                for b in range(a + 1):
                    Qx[a, b] = Qx[b, a] = Q[address(places, row, s.column[t, b])]
                for c in range(3):
                    Qxp[a, c] = Q[address(places, row, kept + c)] if kept >= 0 else 0.0
            for a in range(n):
                for b in range(wide):
                    if s.row[a] == s.column[t, b]:
                        for c in range(3):
                            Qxp[b, c] = -QT[a, c]
            explained0, explained1, explained2 = 0.0, 0.0, 0.0
            for r in range(2):
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
                    if r == 0:
                        explained0 += s.L[t, 0, a] * inner
                        explained1 += s.L[t, 1, a] * inner
                    else:
                        explained2 += s.L[t, 1, a] * inner
            residual[s.ray[t], 0] = 1.0 - explained0
            residual[s.ray[t], 1] = -explained1
            residual[s.ray[t], 2] = 1.0 - explained2


@njit(cache=True)
def expected_squares(rays, values, own_V, own_g, s, places, Q, out):
    """Compute expected squares of whitened residuals where poses are held (J.20).

    Parameters
    ----------
    rays, values : Rays, Values
        The observations, and the values.
    own_V, own_g : ndarray
        (np, 3, 3) and (np, 3) what groups say of each point alone.
    s : PointArrays
        Working arrays.
    places : EntryPlaces
        Where the entries of Q stand.
    Q : ndarray
        Cofactors of poses and cameras.
    out : ndarray, (n, 2)
        Expected squares, written here but for observations that are not active.
    """
    most = 2 * s.L.shape[0]
    C, H, F = np.empty((most, most)), np.empty((most, most)), np.empty((most, most))
    wide = 6 + rays.columns.size
    block, half = np.empty((wide, wide)), np.empty((2, wide))
    for p in range(rays.start.size - 1):
        take_own(own_V, own_g, p, s)
        m, _ = linearise_point(rays, values, p, s, False)
        if m == 0 or not invert3(s.V, s.Vi):
            continue
        for t in range(m):
            for u in range(t + 1):
                for a in range(wide):
                    for b in range(wide):
                        block[a, b] = Q[address(places, s.column[t, a], s.column[u, b])]
                for r in range(2):
                    for b in range(wide):
                        half[r, b] = 0.0
                        for a in range(wide):
                            half[r, b] += s.L[t, r, a] * block[a, b]
                for r in range(2):
                    for q in range(2):
                        c, h = 0.0, 0.0
                        for b in range(wide):
                            c += half[r, b] * s.L[u, q, b]
                        for a in range(3):
                            for b in range(3):
                                h += s.L[t, r, wide + a] * s.Vi[a, b] * s.L[u, q, wide + b]
                        i, j = 2 * t + r, 2 * u + q
                        C[i, j] = C[j, i] = c
                        H[i, j] = H[j, i] = h
        n = 2 * m
        for i in range(n):
            C[i, i] += 1.0
        for i in range(n):  # F = (I - H) C
            for j in range(n):
                f = C[i, j]
                for b in range(n):
                    f -= H[i, b] * C[b, j]
                F[i, j] = f
        for t in range(m):
            for r in range(2):
                i = 2 * t + r
                square = F[i, i]
                for b in range(n):
                    square -= F[i, b] * H[b, i]
                out[s.ray[t], r] = square
