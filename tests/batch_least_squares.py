"""The linear problem (T.20, T.21) of `insgnss.flight.reference.linear` by all epochs at once.

It needs no recursion, and is the oracle of filters and smoothers.
"""

from dataclasses import dataclass
from typing import Any

import numpy as np

from insgnss.flight.reference.linear import LinearProblem
from insgnss.records import Array

RANK = 1e-13  # eigenvalues of a correlation matrix below this share of the largest are rounding


@dataclass(frozen=True, eq=False)
class Batch:
    """Batch solution: mean (m, n) and factors (m, n, .), P_jk = free_j free_k' + seen_j seen_k'."""

    mean: Array
    free: Array
    seen: Array

    def covariance(self, j: int, k: int) -> Any:
        """Return the covariance (n, n) of the error at epoch j with that at epoch k."""
        return self.free[j] @ self.free[k].T + self.seen[j] @ self.seen[k].T


def batch(problem: LinearProblem) -> Batch:
    """Return the least-squares solution over all epochs at once; memory grows with their square.

    Every error is mean + A w with independent w of unit variance (start and process noise), every
    whitened measurement z = M w + unit noise. With M = U s V', w given z has the mean
    V s / (1 + s^2) U' z and the covariance (1 - V V') + V V' / (1 + s^2), which needs no inverse of
    the singular Q.
    """
    m, n = problem.gap.shape
    roots = [_square_root(problem.P), *map(_square_root, problem.Q[1:])]
    begin = np.concatenate([[0], np.cumsum([root.shape[1] for root in roots])])
    A, mean = np.zeros((m, n, begin[-1])), np.zeros((m, n))
    mean[0] = problem.mean
    for k in range(m):
        if k:
            A[k] = problem.Phi[k] @ A[k - 1]
            mean[k] = problem.Phi[k] @ mean[k - 1] + problem.gap[k]
        A[k][:, begin[k] : begin[k + 1]] += roots[k]
    rows, values = [], []
    for k, measured in enumerate(problem.measured):
        for H, z, R in measured:
            L = np.linalg.cholesky(R)
            rows.append(np.linalg.solve(L, H @ A[k]))
            values.append(np.linalg.solve(L, z - H @ mean[k]))
    U, s, Vt = np.linalg.svd(np.vstack(rows), full_matrices=False)
    w = Vt.T @ (s / (1.0 + s**2) * (U.T @ np.concatenate(values)))
    seen = A @ Vt.T
    return Batch(mean + A @ w, A - seen @ Vt, seen / np.sqrt(1.0 + s**2))


def _square_root(P: Array) -> Array:
    """S with S S' = P for a semidefinite P."""
    sigma = np.sqrt(np.diag(P))
    sigma = np.where(sigma > 0.0, sigma, 1.0)
    w, V = np.linalg.eigh(P / np.outer(sigma, sigma))
    keep = w > RANK * w[-1]
    root: Array = sigma[:, None] * V[:, keep] * np.sqrt(w[keep])
    return root
