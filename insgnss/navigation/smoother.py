"""Fixed-interval smoother with full covariance: the modified Bryson-Frazier form of the Rauch-Tung-Striebel smoother.

It gives the same means and covariances as the Rauch-Tung-Striebel recursion, x_s = x + G (x_s' - x'), without its n x n inverse
at every epoch, and it needs no invertible covariance (a constant bias has no process noise). With the adjoint lambda and its
covariance Lambda after epoch k (both zero after the last), x, P the filter's result after the update at k:

    x_s = x + P lambda,      P_s = P - P Lambda P                                                        (B.1)
    through a scalar update: lambda <- lambda + h' (nu / S - k' lambda)                                  (B.2)
                             Lambda <- (1 - k h)' Lambda (1 - k h) + h' h / S                            (B.3)
    to the epoch before:     lambda <- Phi' lambda,   Lambda <- Phi' Lambda Phi                          (B.4)

Lambda is the inverse of the covariance of the difference between what the later data say of the state and what the earlier data
say, and Lambda^-1 lambda is that difference: the forward/backward separation with its covariance comes at no cost.

The covariance between the errors at an event j and at the next event k > j: the filter carries C = cov(x_j, x_k) given the data
up to k (C <- C Phi', C <- C (1 - k h)'); the later data see x_k only, hence

    cov_s(x_j, x_k) = C - C Lambda_k P_k                                                                 (B.5)

Bierman (1973) "Fixed interval smoothing with discrete measurements"; Fraser and Potter (1969) for the two-filter view.
"""

from dataclasses import dataclass

import numpy as np

from ..records import Array
from ._kernels import Epochs, Store, run_backward


@dataclass(frozen=True)
class Smoothed:
    """delta (m, n): smoothed error estimate about the nominal of the store. P (m, n, n), only of a full run.

    event_cross (events, 9, 9): covariance of the navigation errors of the event before with those of this one (first: zero).
    separation_epoch (s,), separation (s, 9), separation_sigma (s, 9): backward minus forward of the navigation states.
    """

    delta: Array
    P: Array | None
    event_cross: Array
    separation_epoch: np.ndarray
    separation: Array
    separation_sigma: Array


def run_smoother(epochs: Epochs, store: Store, full: bool = True, separations: int = 100) -> Smoothed:
    """Backward pass. With `full` the covariances in store.P are replaced by the smoothed ones."""
    m, n = store.m.shape
    delta = np.empty((m, n))
    event_cross = np.zeros((store.cross.shape[0], 9, 9))
    keep = np.full(m, -1, dtype=np.int64)
    at = (
        np.unique(np.linspace(1, max(m - 2, 1), min(separations, m)).astype(np.int64))
        if full and separations
        else np.zeros(0, dtype=np.int64)
    )
    keep[at] = np.arange(at.size)
    information, adjoint = np.zeros((at.size, n, n)), np.zeros((at.size, n))
    run_backward(epochs, store, full, delta, event_cross, keep, information, adjoint)
    separation, sigma = _separation(information, adjoint)
    return Smoothed(delta, store.P if full else None, event_cross, at, separation, sigma)


def _separation(information: Array, adjoint: Array) -> tuple[Array, Array]:
    """Backward minus forward of the nine navigation states (s, 9) with its sigma; NaN where the later data do not determine it."""
    scale = np.sqrt(np.maximum(np.diagonal(information, axis1=1, axis2=2), 1e-300))
    w, V = np.linalg.eigh(information / (scale[:, :, None] * scale[:, None, :]))
    known = w > 1e-10
    inverse_w = np.where(known, 1.0 / np.where(known, w, 1.0), 0.0)
    inverse = (V * inverse_w[:, None, :]) @ np.swapaxes(V, -1, -2)
    value = np.einsum("sij,sj->si", inverse, adjoint / scale) / scale
    sigma = np.sqrt(np.maximum(np.diagonal(inverse, axis1=1, axis2=2), 0.0)) / scale
    determined = np.sum(np.where(known[:, None, :], 0.0, V**2), axis=2) < 1e-6
    return np.where(determined, value, np.nan)[:, :9], np.where(determined, sigma, np.nan)[:, :9]
