r"""Wavelet moments as one weighted least squares problem.

With the variances x >= 0 of the processes (square of each root density, sigma^2 of a Gauss-Markov
process) the wavelet variance of curve i is A_i(T) x, linear in x given the correlation times T. The
objective is

    Q(x, T) = sum_i (nu_i - A_i x)' Omega_i (nu_i - A_i x)                                     (M.1)

Curves of the same levels and rate enter through their weighted mean alone, W = sum Omega_i, nu =
W^-1 sum Omega_i nu_i: Q = (nu - A x)' W (nu - A x) + a constant, exactly. With Cholesky factors W =
L L', what remains is |y - D x|^2 with y = L' nu and D = L' A stacked. Lengths of y and of the
columns of D are taken out, so that no unit and no magnitude matters.

The minimum over x for given T has a gradient and a Hessian in t = log T that follow from those of
(M.1), r = y - D x over the columns with x > 0, D = U R (orthogonal, triangular), J the columns x_k
dd_k/dt_k (Golub and Pereyra 1973, variable projection):

    g_k = -2 x_k r'd'_k                                                                        (M.2)
    G = 2 (J'J - diag(x_k r'd''_k) - S'S),    S = U'J - R^-T E,
    E_kk = r'd'_k in the row of column k                                                       (M.3)

d'' is the central difference of the analytic d'; only the number of Newton steps depends on it.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from ...base.errors import UsageError
from ...records import Array, WaveletVariance
from ..moments.theory import Sampling, gauss_markov_haar, haar_variance
from ..processes.composition import Composition
from ._search import nonnegative

SHORTEST_SAMPLES = 0.02  # samples; exp(-50) is left of the correlation from one sample to the next
# lengths of the longest recording; within it the process is a random walk to a part in a hundred
# thousand
LONGEST_LENGTHS = 1e5
# relative distance within which a time is that of a bound: rounding of exp(log T) is 1e-14, no
# curve tells so much
EDGE = 1e-6
_DIFFERENCE = 1e-4  # of log T, for d''


@dataclass(frozen=True, eq=False)
class PooledCurves:
    """Curves of the same levels and rate, pooled.

    level (J,).
    root (J, J) : L'.
    mean (J,) : weighted mean curve, X^2.
    """

    level: np.ndarray
    rate_hz: float
    root: Array
    mean: Array


@dataclass(frozen=True, eq=False)
class MatchingSolution:
    """Times (K,) s, ascending, unit-column variances x (L + K,), and the objective over |y|^2."""

    times: Array
    x: Array
    value: float


def pool_curves(curves: Sequence[WaveletVariance], weights: Sequence[Array]) -> list[PooledCurves]:
    """Curves of the same levels and rate as one, exactly (M.1). Raises UsageError for weights that
    are not positive definite.
    """
    for number, W in enumerate(weights, start=1):
        try:
            _scaled_cholesky(W)
        except np.linalg.LinAlgError:
            raise UsageError(
                f"weights of curve {number}: not positive definite; take the interval weights"
            ) from None
    members_of_kind: dict[tuple[float, tuple[int, ...]], list[int]] = {}
    for i, curve in enumerate(curves):
        members_of_kind.setdefault((curve.rate_hz, tuple(curve.level.tolist())), []).append(i)
    groups = []
    for (rate_hz, _), members in members_of_kind.items():
        W = sum((weights[i] for i in members), np.zeros_like(weights[members[0]]))
        L, root_of_diagonal = _scaled_cholesky(W)
        scaled = (
            sum((weights[i] @ curves[i].variance for i in members), np.zeros(root_of_diagonal.size))
            / root_of_diagonal
        )
        mean = np.linalg.solve(L.T, np.linalg.solve(L, scaled)) / root_of_diagonal
        groups.append(PooledCurves(curves[members[0]].level, rate_hz, L.T * root_of_diagonal, mean))
    return groups


def _scaled_cholesky(W: Array) -> tuple[Array, Array]:
    """Return L (J, J) and d (J,) of W = (d L)(d L)', d the root of W's diagonal. Raises LinAlgError
    for W that is not positive definite.
    """
    diagonal = np.diag(W)
    if diagonal.min() <= 0.0:
        raise np.linalg.LinAlgError
    root = np.sqrt(diagonal)
    return np.linalg.cholesky(W / np.outer(root, root)), root


class Moments:
    """The least squares problem (M.1) of pooled curves and K Gauss-Markov processes beside those
    without a time; M rows.

    y (M,), linear (L, M) : of unit length; norm (L,), length : what was taken out.
    bounds : of the times, s.
    """

    def __init__(
        self,
        groups: Sequence[PooledCurves],
        composition: Composition,
        sampling: Sampling,
        bounds: tuple[float, float],
    ) -> None:
        self.groups, self.sampling = tuple(groups), sampling
        self.K = composition.gauss_markov
        self.bounds = bounds
        y = np.concatenate([g.root @ g.mean for g in groups])
        self.length = float(np.linalg.norm(y))
        self.y = y / self.length
        axes = [Composition(**{name: True}).axis([1.0]) for name in composition.linear]
        raw = [
            np.concatenate(
                [g.root @ haar_variance(axis, g.level, g.rate_hz, sampling) for g in groups]
            )
            for axis in axes
        ]
        self.norm = np.array([float(np.linalg.norm(column)) for column in raw])
        self.linear = np.array([c / n for c, n in zip(raw, self.norm, strict=True)]).reshape(
            len(raw), y.size
        )

    def on_bounds(self, times: Array) -> Array:
        """Return the times (K,), those within `EDGE` of a bound put on it, so that a time is on a
        bound exactly or clearly off it.
        """
        low, high = self.bounds
        return np.where(
            times >= high * (1.0 - EDGE), high, np.where(times <= low * (1.0 + EDGE), low, times)
        )

    def columns(self, times: Array) -> tuple[Array, Array, Array]:
        """Return unit columns (t, M) of Gauss-Markov processes of these times, d column / d log T
        (t, M) at fixed scale, and lengths (t,).
        """
        value, slope = [], []
        for group in self.groups:
            rows = times[:, None] * group.rate_hz
            variance, derivative = gauss_markov_haar(rows, group.level, self.sampling)
            value.append(variance @ group.root.T)
            slope.append(derivative @ group.root.T)
        d, dd = np.concatenate(value, axis=1), np.concatenate(slope, axis=1)
        norm = np.sqrt(np.einsum("tm,tm->t", d, d))
        return d / norm[:, None], dd / norm[:, None], norm

    def variances(self, D: Array) -> tuple[Array, Array]:
        """Return the non-negative x (p,) that minimises |y - D'x|, and the residual (M,), for unit
        columns D (p, M).
        """
        p = len(D)
        x = np.empty(p)
        nonnegative(D @ D.T, D @ self.y, x, np.empty((p + 2, p)))
        positive = x > 0.0
        # the normal equations square the condition of D; two steps on the residual give it back
        for _ in range(2):
            r = self.y - x @ D
            correction = np.linalg.lstsq(D[positive].T, r, rcond=None)[0]
            if np.any(x[positive] + correction <= 0.0):
                break
            x[positive] += correction
        return x, self.y - x @ D

    def solution(self, times: Array) -> MatchingSolution:
        """Return the best variances for these times (K,), s."""
        ascending = np.sort(times)
        x, r = self.variances(np.concatenate([self.linear, self.columns(ascending)[0]]))
        return MatchingSolution(ascending, x, float(r @ r))

    def curvature(self, solution: MatchingSolution) -> tuple[Array, Array]:
        """Return gradient (K,) and Hessian (K, K) of the minimum over the variances with respect to
        log T (M.2, M.3).
        """
        L, K = len(self.linear), self.K
        T = solution.times
        shifted = np.concatenate([T, T * np.exp(_DIFFERENCE), T * np.exp(-_DIFFERENCE)])
        d, dd, norm = self.columns(shifted)
        scale = norm[K:] / np.tile(norm[:K], 2)
        second = (dd[K : 2 * K] * scale[:K, None] - dd[2 * K :] * scale[K:, None]) / (
            2.0 * _DIFFERENCE
        )
        D = np.concatenate([self.linear, d[:K]])
        x = solution.x
        r = self.y - x @ D
        slope = dd[:K] @ r
        J = x[L:, None] * dd[:K]
        positive = x > 0.0
        U, R = np.linalg.qr(D[positive].T)
        E = np.zeros((L + K, K))
        E[L + np.arange(K), np.arange(K)] = slope
        S = (J @ U).T - np.linalg.solve(R.T, E[positive])
        G = 2.0 * (J @ J.T - np.diag(x[L:] * (second @ r)) - S.T @ S)
        return -2.0 * x[L:] * slope, G
