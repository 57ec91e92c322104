"""The smoother (B) over all epochs."""

import numpy as np

from ....base.compilation import njit
from ..codes import ABSENT, IMU0, N_KINDS, N_NAV
from .copies import copy_matrix, copy_vector
from .outage import gain_within, smooth_across
from .update import is_scalar, take_off, weigh

CANCELLED = 1e-2  # share of the filter's variance, below which (B.1) loses digits within an outage


@njit(cache=True, nogil=True, error_model="numpy", fastmath={"contract"})
def run_backward(event, history, full, state, begin, out):
    """Run the modified Bryson-Frazier smoother (B.1-B.8) from the last epoch to the first.

    Of most epochs the navigation block of the covariance is all that anybody asks for, a quarter of
    the work; the whole of it where `slot` says so, and within outages.

    Parameters
    ----------
    event : ndarray
        (m,) number of the camera event of each epoch, or ABSENT.
    history : FilterHistory
        What the forward pass left.
    full : bool
        Whether covariances and cross-covariances of events are smoothed as well.
    state : SmootherState
        The smoother before the last epoch, zero at the end of the flight; taken on in place to the
        epoch before `begin`.
    begin : int
        The epoch to end with, as of `run_forward`.
    out : Smoothed
        What it gives (`navigation.filter.smoother`), filled in place; covariances, and what is made
        of them, with `full`.
    """
    nz, n = history.H.shape[1], history.m.shape[1]
    ns = n - N_NAV
    lam, Lam, smoothed_later = state.adjoint, state.information, state.later
    chained = out.read.state.size > 0
    new = np.zeros(n)
    A, B = np.zeros((n, n)), np.zeros((n, n))
    smoothed, gain = np.zeros((n, n)), np.zeros((n, n))
    M, G, AN = np.zeros((N_NAV, n)), np.zeros((N_NAV, n)), np.zeros((N_NAV, n))
    BN, nav = np.zeros((N_NAV, N_NAV)), np.zeros((N_NAV, N_NAV))
    g = np.zeros((3, n))
    linear = history.slot[N_KINDS] if history.slot.size > N_KINDS else nz  # first row of (K.13)
    for e in range(event.size - 1, begin - 1, -1):
        P = history.P[e]
        if out.keep[e] != ABSENT:
            copy_matrix(Lam, out.information[out.keep[e]])
            copy_vector(lam, out.adjoint[out.keep[e]])
        estimate = out.delta[e]
        copy_vector(history.m[e], estimate)
        for c in range(n):  # P is symmetric
            t, row = lam[c], P[c]
            for r in range(n):
                estimate[r] += t * row[r]
        if full:
            within, outage, j = state.within[0] != 0, history.outage[e], event[e]
            np.dot(P[:N_NAV], Lam, AN)
            np.dot(AN, P[:N_NAV].T, BN)
            cancelled = False
            for r in range(N_NAV):
                for c in range(N_NAV):
                    nav[r, c] = P[r, c] - 0.5 * (BN[r, c] + BN[c, r])
                cancelled = cancelled or (within and not nav[r, r] > CANCELLED * P[r, r])
            whole = out.slot[e] != ABSENT or outage != ABSENT or cancelled
            if whole or (chained and j != ABSENT):
                np.dot(Lam, P, A)
            if whole:
                np.dot(P, A, B)
                for r in range(n):
                    for c in range(n):
                        smoothed[r, c] = P[r, c] - 0.5 * (B[r, c] + B[c, r])
                copy_matrix(nav, smoothed)
            if j != ABSENT:
                cross = history.cross[j]
                np.dot(AN, cross.T, BN)
                for r in range(N_NAV):
                    for c in range(N_NAV):
                        out.event_cross[j, r, c] = cross[r, c] - BN[c, r]
                if chained:
                    for t in range(out.read.begin[j], out.read.begin[j + 1]):
                        s = out.read.state[t]
                        copy_vector(P[s], out.event_filter[t])
                        for r in range(n):
                            out.event_gain[t, r] = -A[r, s]
                        out.event_gain[t, s] += 1.0
            if cancelled:
                F, D, W, Qbb = state.F, state.D, state.W, state.Qbb
                if smooth_across(P, F, D, W, Qbb, smoothed_later, smoothed):
                    copy_matrix(smoothed[:N_NAV, :N_NAV], nav)
                    if j != ABSENT and gain_within(P, smoothed, gain):
                        np.dot(history.cross[j], gain, M)
                        copy_matrix(M[:, :N_NAV], out.event_cross[j])
                        if chained:
                            for t in range(out.read.begin[j], out.read.begin[j + 1]):
                                copy_vector(gain[:, out.read.state[t]], out.event_gain[t])
            t = 0
            for r in range(N_NAV):
                for c in range(r + 1):
                    out.nav_cov[e, t] = nav[r, c]
                    t += 1
            if out.slot[e] != ABSENT:
                t = 0
                for r in range(n):
                    for c in range(r + 1):
                        out.kept[out.slot[e], t] = smoothed[r, c]
                        t += 1
            state.within[0] = outage != ABSENT
            if outage != ABSENT:
                copy_matrix(smoothed, smoothed_later)
                copy_matrix(history.F[e], state.F)
                copy_vector(history.D[e], state.D)
                copy_matrix(history.W[outage], state.W)
                copy_vector(history.Qbb[outage], state.Qbb)
        for i in range(nz - 3, -1, -3):
            if history.S[e, i] <= 0.0:
                continue
            h, k, used = history.H[e, i : i + 3], history.K[e, i : i + 3], history.used[i]
            scalar = i >= linear and is_scalar(h, used)
            if full and scalar:
                remove_scalar(Lam, h[0], k[0], history.S[e, i], used, g[0])
            elif full:
                weigh(Lam, k, n, g)
                remove_triple(Lam, h, k, history.S[e, i : i + 3], used, g)
            for j in range(0 if scalar else 2, -1, -1):
                t, row, of = history.y[e, i + j] / history.S[e, i + j], h[j], k[j]
                for r in range(n):
                    t -= of[r] * lam[r]
                for r in range(used):
                    lam[r] += t * row[r]
        if e == 0:
            break
        F = history.F[e]
        D = history.D[e]
        new[:] = 0.0
        for r in range(N_NAV):
            t, row = lam[r], F[r]
            for c in range(n):
                new[c] += t * row[c]
        for s in range(ns):
            new[IMU0 + s] += D[s] * lam[IMU0 + s]
        copy_vector(new, lam)
        if full:
            # Phi' Lambda Phi, Phi = [F; 0 D]: F' (Lambda_nn F / 2 + Lambda_nb D) and its transpose
            for r in range(N_NAV):
                for c in range(N_NAV):
                    nav[r, c] = 0.5 * Lam[r, c]
            np.dot(nav, F, G)
            for r in range(N_NAV):
                to, row = G[r, IMU0:], Lam[r, IMU0:]
                for s in range(ns):
                    to[s] += row[s] * D[s]
            np.dot(F.T, G, A)
            for r in range(ns):
                t, to, row = 0.5 * D[r], A[IMU0 + r, IMU0:], Lam[IMU0 + r, IMU0:]
                for c in range(ns):
                    to[c] += t * D[c] * row[c]
            for r in range(n):
                for c in range(n):
                    Lam[r, c] = A[r, c] + A[c, r]


@njit(cache=True, allocates=False)
def remove_scalar(Lam, h, k, s, used, g):
    """Take Lambda of the smoother back across one update (B.3), in place.

    Parameters
    ----------
    Lam : ndarray
        (n, n) Lambda, changed in place.
    h, k : ndarray
        (j,) whitened derivative and (n,) gain.
    s : float
        Innovation variance.
    used : int
        Number of leading columns of h that may differ from zero.
    g : ndarray
        (n,) scratch.
    """
    n = Lam.shape[0]
    g[:] = 0.0
    for r in range(n):
        t, row = k[r], Lam[r]
        for c in range(n):
            g[c] += t * row[c]
    t = 1.0 / s
    for r in range(n):
        t += k[r] * g[r]
    t *= 0.5
    for r in range(used):
        g[r] -= t * h[r]
    for r in range(used):
        t, row = h[r], Lam[r]
        if t != 0.0:
            for c in range(n):
                row[c] -= t * g[c]
    for c in range(used):
        t = h[c]
        if t != 0.0:
            for r in range(n):
                Lam[r, c] -= t * g[r]


@njit(cache=True, allocates=False)
def remove_triple(Lam, H, K, S, used, G):
    """Take Lambda of the smoother back across three updates (B.3), in place, the last first.

    Lambda - h g' - g h' + (1 / s + k' Lambda k) h h' with g = Lambda k, as a sum of two products of
    h and g - t h; what the later ones do to the g of those before is as in `triple_update`.

    Parameters
    ----------
    Lam : ndarray
        (n, n) Lambda, changed in place.
    H, K : ndarray
        (3, k) whitened derivatives and (3, n) gains.
    S : ndarray
        (3,) innovation variances.
    used : int
        Number of leading columns of H that may differ from zero.
    G : ndarray
        (3, n) K Lambda; scratch afterwards.
    """
    n = Lam.shape[0]
    for i in range(2, -1, -1):
        h, k, g = H[i], K[i], G[i]
        t = 1.0 / S[i]
        for r in range(n):
            t += g[r] * k[r]
        t *= 0.5
        for r in range(used):
            g[r] -= t * h[r]
        for j in range(i):
            own, other = K[j], G[j]
            a = b = 0.0
            for r in range(n):
                a += g[r] * own[r]
            for r in range(used):
                b += h[r] * own[r]
            for r in range(n):
                other[r] -= b * g[r]
            for r in range(used):
                other[r] -= a * h[r]
    take_off(H, G, n, Lam)
    take_off(G, H, used, Lam)
