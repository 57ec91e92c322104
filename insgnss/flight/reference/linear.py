"""A linear estimation problem and its textbook solutions.

    error_0 ~ (mean, P),   error_k = Phi_k error_(k-1) + gap_k + noise Q_k          (T.20)
    z = H error_k + noise R   at each epoch k, any number of times                  (T.21)

The gap is known: the nominal of the epoch before, propagated, less the nominal at this epoch.

filter   the Kalman filter, by filterpy
smoother Rauch-Tung-Striebel, x_s = x + K (x_s' - Phi' x - gap'), by filterpy's method
         `KalmanFilter.rts_smoother`, whose Fs[k + 1] leads from epoch k to k + 1 (filterpy's
         *function* of that name takes Fs[k] and is wrong where Phi changes with time). It knows no
         gaps; with c_k = Phi_k c_(k-1) + gap_k taken off, the errors obey (T.20) without them

graph    GTSAM's elimination of the factor graph of the same problem, which knows neither of them

All give the same mean, filter and smoother at the last epoch alone.
"""

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from ...records import Array

if TYPE_CHECKING:
    from filterpy.kalman import KalmanFilter

Measurement = tuple[Array, Array, Array]
KNOWN_SHARE = 1e-14  # of the largest variance: smaller ones are rounding, the state is known


@dataclass(frozen=True, eq=False)
class LinearProblem:
    """The problem (T.20, T.21) of m epochs and n states.

    Parameters
    ----------
    mean, P : (n,) and (n, n), a-priori mean and covariance at the first epoch.
    Phi, Q : (m, n, n) transition and noise from the epoch before; the first ones are not used.
    gap : (m, n) known part of the step from the epoch before; the first one is not used.
    measured : of each epoch a list of H (k, n), z (k,), R (k, k).
    """

    mean: Array
    P: Array
    Phi: Array
    Q: Array
    gap: Array
    measured: list[list[Measurement]]

    def gap_response(self) -> Array:
        """Return c (m, n), what the gaps alone make of an error that starts at zero."""
        c = np.zeros_like(self.gap)
        for k in range(1, len(c)):
            c[k] = self.Phi[k] @ c[k - 1] + self.gap[k]
        return c


@dataclass(frozen=True, eq=False)
class GaussianStates:
    """Means (m, n) and covariances (m, n, n) at every epoch.

    Parameters
    ----------
    gain : (m, n, n) of the smoother, from the epoch after; None of a filter.
    """

    mean: Array
    P: Array
    gain: Array | None = None


def new_filter(mean: Array, P: Array) -> "KalmanFilter":
    """Return filterpy's Kalman filter with mean (n,) and covariance P (n, n)."""
    from filterpy.kalman import KalmanFilter

    kf = KalmanFilter(dim_x=mean.size, dim_z=3)
    kf.x, kf.P = mean[:, None].copy(), P.copy()
    return kf


def kalman_filter(problem: LinearProblem) -> GaussianStates:
    """Return the Kalman filter's estimate after the update at each epoch."""
    kf, identity = new_filter(problem.mean, problem.P), np.eye(problem.mean.size)
    means, covariances = [], []
    for k, measured in enumerate(problem.measured):
        if k:
            kf.predict(u=problem.gap[k][:, None], B=identity, F=problem.Phi[k], Q=problem.Q[k])
        for H, z, R in measured:
            kf.update(z[:, None], R=R, H=H)
        means.append(kf.x[:, 0])
        covariances.append(kf.P)
    return GaussianStates(np.array(means), np.array(covariances))


def rts_smoother(problem: LinearProblem, filtered: GaussianStates) -> GaussianStates:
    """Return the Rauch-Tung-Striebel smoother's estimate of a filter's.

    Parameters
    ----------
    problem : whose transitions, noise and gaps are used; the measurements are in the filter's.
    filtered : the filter's estimate of it.
    """
    kf, c = new_filter(problem.mean, problem.P), problem.gap_response()
    x, P, gain, _ = kf.rts_smoother(
        (filtered.mean - c)[..., None], filtered.P, problem.Phi, problem.Q, inv=_inverse
    )
    return GaussianStates(x[..., 0] + c, P, gain)


def factor_graph(problem: LinearProblem) -> Array:
    """Return the solution of GTSAM's factor graph of the problem: no filter, no smoother.

    Parameters
    ----------
    problem : LinearProblem
        Its start, steps and measurements become the factors.

    Returns
    -------
    Array
        (m, n) means at the epochs.

    Raises
    ------
    ImportError
        Where gtsam is not installed (the extra `oracles`).
    """
    import gtsam

    scale = np.sqrt(np.diag(problem.P))  # so that metres and radians a second are of one size

    def noise(cov: Array) -> tuple[Array, Any]:
        each = np.sqrt(np.diag(cov))
        each[each == 0.0] = 1.0  # without noise: a constraint
        values, axes = np.linalg.eigh(cov / np.outer(each, each))
        sigmas = np.sqrt(np.where(values > KNOWN_SHARE * values.max(), values, 0.0))
        return axes.T / each, gtsam.noiseModel.Constrained.MixedSigmas(1.0, sigmas)

    graph = gtsam.GaussianFactorGraph()
    axes, model = noise(problem.P / np.outer(scale, scale))
    graph.add(0, axes, axes @ (problem.mean / scale), model)
    for k, measured in enumerate(problem.measured):
        if k:
            axes, model = noise(problem.Q[k] / np.outer(scale, scale))
            step = problem.Phi[k] * scale / scale[:, None]
            graph.add(k - 1, -axes @ step, k, axes, axes @ (problem.gap[k] / scale), model)
        for H, z, R in measured:
            axes, model = noise(R)
            graph.add(k, axes @ (H * scale), axes @ z, model)
    best = graph.optimize()
    return np.array([scale * best.at(k) for k in range(len(problem.measured))])


def _inverse(P: Array) -> Array:
    """Inverse by way of the correlation matrix, zero for states that are known without error.

    Metres beside radians a second would cost a plain inversion four digits.
    """
    sigma = np.sqrt(np.diag(P))
    free = np.flatnonzero(sigma > 0.0)
    scale = np.outer(sigma[free], sigma[free])
    out = np.zeros_like(P)
    out[np.ix_(free, free)] = np.linalg.inv(P[np.ix_(free, free)] / scale) / scale
    return out
