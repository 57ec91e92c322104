r"""Estimates of a fit: values with standard errors and 95 % intervals, by the sandwich, by the
profile, or by re-fits.

With D = d nu/d x of all curves below each other, Omega their weights and V the covariance of
nu_hat, both block diagonal over the recordings, which are independent (Guerrier et al. 2013,
theorem 2):

    x_hat - x = B (nu_hat - nu),   B = (D' Omega D)^-1 D' Omega,      cov x_hat = B V B'       (E.1)

x are the coordinates of `_profile`: logarithms where a parameter is determined. All parameters are
positive, so standard errors are those of logarithms and the intervals of the sandwich are exp(log
value -+ 1.96 error). Where a parameter is at its edge the interval starts there and has the length
1.96 errors of its coordinate, of a density 1.96 errors of its square. For Omega = V^-1 the
covariance is (D' V^-1 D)^-1, the least that these moments allow, and Q behaves as minus twice a
log-likelihood: then its profile gives intervals that are right where (E.1) is not, for the long
correlation times of which a recording shows few.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ...records import Array
from ..processes.composition import NoiseTerm
from ._profile import Local
from .bootstrap import Bootstrap
from .gmwm import NoiseFit

_Z_95, _Z_99 = 1.959964, 2.575829  # 97.5 and 99.5 % of the normal distribution
_UNBOUNDED = 1e3  # times the value: an interval that reaches so far has no end


@dataclass(frozen=True)
class NoiseEstimate:
    """One parameter: value in SI, standard error of its logarithm, 95 % interval, and upper limit
    of the 99 % interval.

    log_error : NaN where the value is zero or at the edge of what is admissible (`at_bound`).
    low, high : low may be 0, high infinite.
    """

    term: NoiseTerm
    value: float
    log_error: float
    low: float
    high: float
    high_99: float
    at_bound: bool

    @property
    def name(self) -> str:
        """Name of the parameter."""
        return str(self.term)

    @property
    def standard_error(self) -> float:
        """Of the value itself, SI: value times `log_error`."""
        return self.value * self.log_error


_RANK_TOLERANCE = 1e-12  # of singular values over the largest: smaller ones are rounding
_LEAST_VARIANCE = 1e-12  # of a residual, over that of its moment: a fit through a point leaves none
_FARTHER_LEVEL = 0.99  # of the interval whose upper limit tells that a time has no end
_LARGEST_EXPONENT = 700.0  # of exp: doubles end at 709


class Linearised:
    """The fit linearised (E.1), stacked over the curves, in the coordinates of `Local`."""

    def __init__(self, fitted: NoiseFit, V: Sequence[Array]) -> None:
        self.local = Local(fitted)
        self.x = self.local.coordinates(fitted.parameters)
        idle = fitted.composition.is_time
        idle[idle] = fitted.parameters[1:][idle[:-1]] == 0.0  # a time stands before its density
        self.free = np.flatnonzero(~idle)
        self.D = self.local.derivative(self.x)[:, self.free]
        self.V, self.Omega = _block_diagonal(V), _block_diagonal(fitted.weights)
        A = self.D.T @ self.Omega @ self.D
        root = np.sqrt(np.diag(A))
        scale = np.outer(root, root)
        inverse = np.linalg.pinv(A / scale, rcond=_RANK_TOLERANCE) / scale
        self.B = inverse @ self.D.T @ self.Omega

    def covariance(self) -> Array:
        """Return the covariance (p, p) of x, NaN for times of processes without driving noise."""
        out = np.full((self.x.size, self.x.size), np.nan)
        out[np.ix_(self.free, self.free)] = self.B @ self.V @ self.B.T
        return out

    def parameter(self, i: int, step: float) -> float:
        """Parameter i, SI, at `step` of its coordinate from the fit, and not beyond its edges."""
        x = self.x.copy()
        x[i] = np.clip(x[i] + step, self.local.low[i], self.local.high[i])
        return float(self.local.parameters(x)[i])

    def scatter(self, inside: NDArray[np.bool_]) -> tuple[Array, Array]:
        """Return sigmas (M,) of nu_hat from the fit, and eigenvalues lambda (M,) of P' Omega P V.

        inside : which of the free parameters take part in the fit, those that are not at an edge.
        """
        A = np.linalg.cholesky(self.Omega).T
        U = np.linalg.qr(A @ self.D[:, inside])[0]
        residual = A - U @ (U.T @ A)  # of A P, with P = 1 - D B
        weight = np.linalg.eigvalsh(residual @ self.V @ residual.T)
        P = np.linalg.solve(A, residual)
        variance = np.einsum("ij,jk,ik->i", P, self.V, P)
        return np.sqrt(np.maximum(variance, _LEAST_VARIANCE * np.diag(self.V))), np.maximum(
            weight, 0.0
        )


def estimates(
    fitted: NoiseFit, linear: Linearised, kind: str, resampled: Bootstrap | None = None
) -> tuple[tuple[NoiseEstimate, ...], Array]:
    """Return all parameters with intervals of a kind, and the covariance (p, p) of their
    logarithms.

    kind : "sandwich", "profile", for efficient weights, or "bootstrap", for which the re-fits
        `resampled` are needed.
    """
    C = linear.covariance()
    factor = np.where(
        np.isin(fitted.composition.parameters, fitted.at_bound),
        np.nan,
        linear.local.logarithmic(linear.x),
    )
    log_covariance = C * np.outer(factor, factor)
    log_error = np.sqrt(np.diag(log_covariance))
    if kind == "bootstrap" and resampled is not None:
        ends = np.array([*resampled.interval(), resampled.interval(_FARTHER_LEVEL)[1]]).T
    elif kind == "profile":
        ends = np.array([linear.local.profile(fitted.parameters, i) for i in range(len(C))])
    else:
        ends = np.array([_sandwich_interval(linear, C, log_error, i) for i in range(len(C))])
    columns = (fitted.composition.terms, fitted.parameters.tolist(), log_error.tolist())
    results = []
    for i, (row, term, value, error) in enumerate(zip(ends.tolist(), *columns, strict=True)):
        limits = _bounded_interval(linear, i, row, kind == "sandwich")
        results.append(NoiseEstimate(term, value, error, *limits, str(term) in fitted.at_bound))
    return tuple(results), log_covariance


def _sandwich_interval(
    linear: Linearised, C: Array, log_error: Array, i: int
) -> tuple[float, float, float]:
    """Return the 95 % interval of parameter i and upper limit of the 99 % one, from its standard
    error.
    """
    value = float(linear.local.parameters(linear.x)[i])
    if np.isfinite(log_error[i]):
        factor, farther = (
            math.exp(min(z * log_error[i], _LARGEST_EXPONENT)) for z in (_Z_95, _Z_99)
        )
        return value / factor, value * factor, value * farther
    if not np.isfinite(C[i, i]):
        return 0.0, math.inf, math.inf
    sigma = math.sqrt(C[i, i])
    if linear.local.time[i] and linear.x[i] >= linear.local.high[i]:
        return linear.parameter(i, -_Z_95 * sigma), math.inf, math.inf
    if linear.local.time[i]:
        return 0.0, linear.parameter(i, _Z_95 * sigma), linear.parameter(i, _Z_99 * sigma)
    # of v in (L.1), which is linear at zero
    variance_error = 2.0 * linear.local.s[i] * sigma
    return 0.0, math.sqrt(_Z_95 * variance_error), math.sqrt(_Z_99 * variance_error)


def _bounded_interval(
    linear: Linearised, i: int, ends: Sequence[float], by_error: bool
) -> tuple[float, float, float]:
    """Return an interval and the limit beyond, uninformative ends put at zero and infinity.

    A limit `_UNBOUNDED` times the value and more is none, nor is that of a density whose part alone
    would be so much of the variance at every scale. by_error : the interval is symmetric in the
        logarithm, so that its low end means as little then.
    """
    low, high, far = ends
    value = float(linear.local.parameters(linear.x)[i])
    largest = _UNBOUNDED * value if value > 0.0 else math.inf
    if i in linear.local.linear:
        rows = zip(linear.local.groups, linear.local.linear[i], strict=True)
        squared_density = max(float(np.abs(g.mean / variance).max()) for g, variance in rows)
        largest = min(largest, _UNBOUNDED * math.sqrt(squared_density))
    if not high > largest:
        return low, high, far if far <= largest else math.inf
    return (0.0 if by_error else low), math.inf, math.inf


def _block_diagonal(blocks: Sequence[Array]) -> Array:
    """Return the block diagonal matrix of square blocks."""
    ends = np.cumsum([len(block) for block in blocks])
    out = np.zeros((ends[-1], ends[-1]))
    for block, end in zip(blocks, ends, strict=True):
        rows = slice(end - len(block), end)
        out[rows, rows] = block
    return out
