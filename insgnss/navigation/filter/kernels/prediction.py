"""Prediction over an interval between epochs: covariance, mean, columns of errors."""

import numpy as np

from ....base.compilation import njit
from ..codes import IMU0, N_NAV
from .copies import copy_matrix


@njit(cache=True)
def predict_covariance(P, F, D, W, Qbb, X, nine):
    """Predict the covariance in place: P <- Phi P Phi' + Q, Phi = [F; 0 D] and Q = [W; Q_bb].

    Parameters
    ----------
    P : ndarray
        (n, n) covariance of the errors, changed in place.
    F : ndarray
        (9, n) navigation rows of the transition matrix.
    D : ndarray
        (ns,) diagonal of the transition matrix behind them.
    W : ndarray
        (9, n) process noise [Q_nn Q_nb].
    Qbb : ndarray
        (ns,) diagonal of the process noise of the states behind those of navigation.
    X : ndarray
        (9, n) scratch.
    nine : ndarray
        (9, 9) scratch.
    """
    n = P.shape[0]
    np.dot(F, P, X)
    np.dot(X, F.T, nine)
    for r in range(N_NAV):
        for c in range(r, N_NAV):
            t = nine[r, c] + W[r, c]
            P[r, c] = t
            P[c, r] = t
    for r in range(N_NAV):
        for c in range(N_NAV, n):
            t = X[r, c] * D[c - IMU0] + W[r, c]
            P[r, c] = t
            P[c, r] = t
    for s in range(D.size):
        d, row = D[s], P[IMU0 + s, IMU0:]
        for k in range(D.size):
            row[k] *= d * D[k]
        row[s] += Qbb[s]


@njit(cache=True, allocates=False)
def propagate_mean(F, D, m, gap, scratch):
    """Predict the error estimate in place: m <- Phi m + gap, Phi = [F; 0 D].

    Parameters
    ----------
    F : ndarray
        (9, n) navigation rows of the transition matrix.
    D : ndarray
        (ns,) diagonal of the transition matrix behind them.
    m : ndarray
        (n,) estimate of the errors about the nominal, changed in place.
    gap : ndarray
        (n,) propagated nominal minus the nominal at the next epoch, about which m then counts.
    scratch : ndarray
        (n,) scratch.
    """
    for r in range(N_NAV):
        t = gap[r]
        for c in range(m.size):
            t += F[r, c] * m[c]
        scratch[r] = t
    for s in range(D.size):
        scratch[IMU0 + s] = gap[IMU0 + s] + D[s] * m[IMU0 + s]
    for c in range(m.size):
        m[c] = scratch[c]


@njit(cache=True)
def predict_errors(F, D, M, top):
    """Multiply errors by the transition in place: M <- Phi M, Phi = [F; 0 D].

    Parameters
    ----------
    F : ndarray
        (9, n) navigation rows of the transition matrix.
    D : ndarray
        (ns,) diagonal of the transition matrix behind them.
    M : ndarray
        (n, c) columns of errors, changed in place.
    top : ndarray
        (9, c) scratch.
    """
    np.dot(F, M, top)
    copy_matrix(top, M)
    for s in range(D.size):
        if D[s] != 1.0:
            for c in range(M.shape[1]):
                M[IMU0 + s, c] *= D[s]
