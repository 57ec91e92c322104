"""The smoothed covariance within an outage (B.6, B.7), where (B.1) loses its digits."""

import numpy as np

from ....base.compilation import njit
from ..codes import IMU0
from .copies import copy_matrix
from .update import cholesky


@njit(cache=True, allocates=False)
def scaled_cholesky(P, scale, L):
    """Compute the lower Cholesky factor of a covariance scaled to a unit diagonal.

    Parameters
    ----------
    P : ndarray
        (n, n) covariance.
    scale : ndarray
        (n,) roots of its diagonal, filled in place.
    L : ndarray
        (n, n) the factor, filled in place; above its diagonal nothing is written.

    Returns
    -------
    bool
        Whether it is positive definite.
    """
    n = P.shape[0]
    for r in range(n):
        if not P[r, r] > 0.0:
            return False
        scale[r] = np.sqrt(P[r, r])
    for r in range(n):
        for c in range(r + 1):
            L[r, c] = P[r, c] / (scale[r] * scale[c])
    return cholesky(L, L)


@njit(cache=True, allocates=False)
def scaled_solve(scale, L, B):
    """Solve with a covariance that was factored by `scaled_cholesky`, in place: B <- P^-1 B.

    Parameters
    ----------
    scale : ndarray
        (n,) of `scaled_cholesky`.
    L : ndarray
        (n, n) of `scaled_cholesky`.
    B : ndarray
        (n, m) right-hand sides, changed in place.
    """
    n, m = B.shape
    for r in range(n):
        for j in range(m):
            B[r, j] /= scale[r]
        for k in range(r):
            for j in range(m):
                B[r, j] -= L[r, k] * B[k, j]
        for j in range(m):
            B[r, j] /= L[r, r]
    for r in range(n - 1, -1, -1):
        for k in range(r + 1, n):
            for j in range(m):
                B[r, j] -= L[k, r] * B[k, j]
        for j in range(m):
            B[r, j] /= L[r, r]
    for r in range(n):
        for j in range(m):
            B[r, j] /= scale[r]


@njit(cache=True)
def smooth_across(P, F, D, W, Qbb, later, smoothed):
    """Smooth the covariance of an epoch by that of the next one (B.6).

    Parameters
    ----------
    P : ndarray
        (n, n) of the filter at the epoch, post.
    F : ndarray
        (9, n) navigation rows of the transition to the next epoch.
    D : ndarray
        (ns,) diagonal of the transition behind them.
    W : ndarray
        (9, n) process noise [Q_nn Q_nb].
    Qbb : ndarray
        (ns,) diagonal of the process noise behind.
    later : ndarray
        (n, n) smoothed covariance at the next epoch.
    smoothed : ndarray
        (n, n) smoothed covariance, filled in place.

    Returns
    -------
    bool
        Whether the predicted covariance is positive definite; else nothing is filled.
    """
    n = P.shape[0]
    Phi, Q, L = np.zeros((n, n)), np.zeros((n, n)), np.zeros((n, n))
    copy_matrix(F, Phi)
    copy_matrix(W, Q)
    copy_matrix(W[:, IMU0:].T, Q[IMU0:])
    for s in range(IMU0, n):
        Phi[s, s] = D[s - IMU0]
        Q[s, s] = Qbb[s - IMU0]
    gain = np.dot(Phi, P)  # its transpose, until it is solved
    predicted = np.dot(gain, Phi.T) + Q
    scale = np.zeros(n)
    if not scaled_cholesky(predicted, scale, L):
        return False
    scaled_solve(scale, L, gain)
    C = np.ascontiguousarray(gain.T)
    J = -np.dot(C, Phi)
    for r in range(n):
        J[r, r] += 1.0
    total = np.dot(np.dot(J, P), J.T) + np.dot(np.dot(C, Q + later), gain)
    copy_matrix(0.5 * (total + total.T), smoothed)
    return True


@njit(cache=True)
def gain_within(P, smoothed, out):
    """Solve for what takes covariances with the state at an epoch to the smoothed ones (B.7).

    Parameters
    ----------
    P, smoothed : ndarray
        (n, n) of the filter, post, and smoothed.
    out : ndarray
        (n, n) P^-1 P_s, filled in place.

    Returns
    -------
    bool
        Whether P is positive definite; else nothing is filled.
    """
    n = P.shape[0]
    scale, L = np.zeros(n), np.zeros((n, n))
    if not scaled_cholesky(P, scale, L):
        return False
    copy_matrix(smoothed, out)
    scaled_solve(scale, L, out)
    return True
