"""The smoother (B) over all epochs."""

import numpy as np

from ...base.compilation import njit
from ..codes import ABSENT, IMU0, N_NAV
from .outage import gain_within, smooth_across

CANCELLED = 1e-2  # share of the filter's variance, below which (B.1) loses digits within an outage


@njit(cache=True)
def run_backward(
    epochs,
    history,
    full,
    delta,
    event_cross,
    event_filter,
    event_gain,
    keep,
    keep_information,
    keep_adjoint,
):
    """Run the modified Bryson-Frazier smoother (B.1-B.8) from the last epoch to the first.

    Parameters
    ----------
    epochs : Epochs
        The m epochs of the filter.
    history : FilterHistory
        What the forward pass left; with `full` its P is replaced by the smoothed covariance.
    full : bool
        Whether covariances and cross-covariances of events are smoothed as well.
    delta : ndarray
        (m, n) smoothed errors of the nominal, filled in place.
    event_cross : ndarray
        (events, 9, 9) covariance of the navigation errors of the event before with those of this
        one, filled in place with `full`.
    event_filter, event_gain : ndarray
        (events, n, n) covariance of the filter, post, and what later data make of it on its right,
        1 - Lambda P or P^-1 P_s (B.8), at each event, filled in place with `full`.
    keep : ndarray
        (m,) the slot that takes Lambda and lambda of the epoch, or ABSENT.
    keep_information, keep_adjoint : ndarray
        (slots, n, n) Lambda and (slots, n) lambda, filled in place.
    """
    count = epochs.stop.size
    nz, n = history.H.shape[1], history.m.shape[1]
    ns = n - N_NAV
    lam = np.zeros(n)
    new = np.zeros(n)
    Lam = np.zeros((n, n))
    A = np.zeros((n, n))
    B = np.zeros((n, n))
    M = np.zeros((N_NAV, n))
    G = np.zeros((N_NAV, n))
    g = np.zeros(n)
    forward, smoothed = np.zeros((n, n)), np.zeros((n, n))
    for e in range(count - 1, -1, -1):
        P = history.P[e]
        if keep[e] != ABSENT:
            keep_information[keep[e]] = Lam
            keep_adjoint[keep[e]] = lam
        for r in range(n):
            t = history.m[e, r]
            for c in range(n):
                t += P[r, c] * lam[c]
            delta[e, r] = t
        if full:
            np.dot(Lam, P, A)
            if epochs.event[e] != ABSENT:
                cross = history.cross[epochs.event[e]]
                np.dot(cross, A, M)
                for r in range(N_NAV):
                    for c in range(N_NAV):
                        event_cross[epochs.event[e], r, c] = cross[r, c] - M[r, c]
                event_filter[epochs.event[e]] = P
                gain = event_gain[epochs.event[e]]
                for r in range(n):
                    for c in range(n):
                        gain[r, c] = -A[r, c]
                    gain[r, r] += 1.0
            np.dot(P, A, B)
            within = e + 1 < count and history.outage[e + 1] != ABSENT
            if within:
                forward[:] = P
            for r in range(n):
                for c in range(n):
                    P[r, c] -= 0.5 * (B[r, c] + B[c, r])
            cancelled = False
            if within:
                for r in range(N_NAV):
                    cancelled = cancelled or not P[r, r] > CANCELLED * forward[r, r]
            if cancelled:
                o = history.outage[e + 1]
                F, D = history.F[e + 1], history.D[e + 1]
                W, Qbb = history.W[o], history.Qbb[o]
                if smooth_across(forward, F, D, W, Qbb, history.P[e + 1], smoothed):
                    P[:] = smoothed
                    if epochs.event[e] != ABSENT:
                        j = epochs.event[e]
                        if gain_within(forward, P, event_gain[j]):
                            np.dot(history.cross[j], event_gain[j], M)
                            event_cross[j] = M[:, :N_NAV]
        for i in range(nz - 1, -1, -1):
            S = history.S[e, i]
            if S <= 0.0:
                continue
            h = history.H[e, i]
            k = history.K[e, i]
            used = history.used[i]
            t = history.y[e, i] / S
            for r in range(n):
                t -= k[r] * lam[r]
            for r in range(used):
                lam[r] += h[r] * t
            if full:
                t = 1.0 / S
                for r in range(n):
                    a = 0.0
                    for c in range(n):
                        a += Lam[r, c] * k[c]
                    g[r] = a
                    t += a * k[r]
                for r in range(used):
                    for c in range(n):
                        Lam[r, c] -= h[r] * g[c]
                for r in range(n):
                    for c in range(used):
                        Lam[r, c] -= g[r] * h[c]
                for r in range(used):
                    for c in range(used):
                        Lam[r, c] += t * h[r] * h[c]
        if e == 0:
            break
        F = history.F[e]
        D = history.D[e]
        for c in range(n):
            t = 0.0
            for r in range(N_NAV):
                t += F[r, c] * lam[r]
            if c >= IMU0:
                t += D[c - IMU0] * lam[c]
            new[c] = t
        lam[:] = new
        if full:
            # Phi' Lambda Phi, Phi = [F; 0 D]: F' (Lambda_nn F / 2 + Lambda_nb D) and its transpose
            for r in range(N_NAV):
                row = G[r]
                for c in range(n):
                    row[c] = 0.0
                for k in range(N_NAV):
                    t = 0.5 * Lam[r, k]
                    for c in range(n):
                        row[c] += t * F[k, c]
                for s in range(ns):
                    row[IMU0 + s] += Lam[r, IMU0 + s] * D[s]
            np.dot(F.T, G, A)
            for r in range(n):
                if r >= IMU0:
                    for c in range(IMU0, n):
                        A[r, c] += 0.5 * Lam[r, c] * (D[r - IMU0] * D[c - IMU0])
            for r in range(n):
                for c in range(n):
                    Lam[r, c] = A[r, c] + A[c, r]
