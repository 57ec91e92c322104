"""Dense least squares: observations in groups with a covariance, Gauss-Newton, variance factors.

A group has k vectors of d observations, uncorrelated with each other: the misclosures e (observed -
computed), their derivatives A by the u unknowns, and a covariance of named shares, each with a
variance factor f (1 where none is given):

    V = sum_i f_i V_i,   W = V^-1,   N = sum A' W A,   b = sum A' W e,   dx = N^-1 b        (LS.1)

What is known a priori is one more group, of the share `PRIOR`. The caller linearises at its values
and moves them by dx, until dx' N dx, the squared step over its variance, is below a limit. Factors
follow from the residuals: those of (LS.1) per share and its redundancy, which add up to the number
of observations less that of the unknowns (restricted maximum likelihood, Koch 1999, 3.6),

    f_i <- f_i e' W V_i W e / tr(P_r V_i),   P_r = W - W A N^-1 A' W                        (LS.2)
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property

import numpy as np

from .rotation import Array

PRIOR = "a priori"


@dataclass(frozen=True, eq=False)
class Equations:
    """One group of linearised observations.

    Parameters
    ----------
    e : ndarray, (k, d)
        Observed - computed.
    A : ndarray, (k, d, u)
        Derivatives by the unknowns.
    shares : mapping of str to ndarray, (k, d, d)
        Shares of the covariance, by name.
    """

    e: Array
    A: Array
    shares: Mapping[str, Array]

    @classmethod
    def prior(cls, e: Array, covariance: Array, A: Array | None = None) -> "Equations":
        """Return what is known a priori of d functions of the unknowns.

        Parameters
        ----------
        e : ndarray, (d,)
            Known value - present value.
        covariance : ndarray, (d, d)
            Of the known value.
        A : ndarray, (d, u), optional
            Derivatives by the unknowns; without it the functions are the unknowns themselves.

        Returns
        -------
        Equations
            One vector, of the share `PRIOR`.
        """
        A = np.eye(e.size) if A is None else A
        return cls(e[None], A[None], {PRIOR: covariance[None]})

    def covariance(self, factors: Mapping[str, float] | None = None) -> Array:
        """Return V of (LS.1).

        Parameters
        ----------
        factors : mapping of str to float, optional
            Variance factors of the shares.

        Returns
        -------
        ndarray, (k, d, d)
            The covariance.
        """
        by = factors or {}
        return np.asarray(sum(by.get(name, 1.0) * share for name, share in self.shares.items()))

    def whitened(self, factors: Mapping[str, float] | None = None) -> tuple[Array, Array]:
        """Return e and A made white of unit variance, for another solver.

        Parameters
        ----------
        factors : mapping of str to float, optional
            Variance factors of the shares.

        Returns
        -------
        e : ndarray, (k d,)
        A : ndarray, (k d, u)
        """
        white = np.linalg.inv(np.linalg.cholesky(self.covariance(factors)))
        return (white @ self.e[:, :, None]).ravel(), (white @ self.A).reshape(-1, self.A.shape[2])

    def residual(self, dx: Array) -> Array:
        """Return what a step leaves.

        Parameters
        ----------
        dx : ndarray, (u,)
            The step.

        Returns
        -------
        ndarray, (k, d)
            e - A dx.
        """
        return np.asarray(self.e - self.A @ dx)


@dataclass(frozen=True, eq=False)
class NormalEquations:
    """Normal equations of groups of observations.

    Parameters
    ----------
    groups : sequence of Equations
        The observations.
    factors : mapping of str to float
        Variance factors of shares of their covariances.
    """

    groups: Sequence[Equations]
    factors: Mapping[str, float] = field(default_factory=dict)

    @cached_property
    def weights(self) -> tuple[Array, ...]:
        """W of each group, (k, d, d)."""
        return tuple(inverse(group.covariance(self.factors)) for group in self.groups)

    @cached_property
    def N(self) -> Array:
        """The normal matrix (u, u)."""
        by_group = zip(self.groups, self.weights, strict=True)
        return sum((g.A.swapaxes(1, 2) @ W @ g.A).sum(axis=0) for g, W in by_group)

    @cached_property
    def b(self) -> Array:
        """The right side (u,)."""
        by_group = zip(self.groups, self.weights, strict=True)
        return sum(np.einsum("kiu,ki->u", g.A, (W @ g.e[:, :, None])[:, :, 0]) for g, W in by_group)

    @property
    def dx(self) -> Array:
        """The step (u,) of (LS.1)."""
        return np.asarray(np.linalg.solve(self.N, self.b))

    @cached_property
    def cov(self) -> Array:
        """The covariance (u, u) of the unknowns."""
        return inverse(self.N)

    def square(self, dx: Array | float = 0.0) -> float:
        """Return the weighted square sum of the residuals, without those of a-priori groups.

        Parameters
        ----------
        dx : ndarray, (u,), optional
            A step that is taken.

        Returns
        -------
        float
            v' W v, v = e - A dx.
        """
        square = 0.0
        for group, W in zip(self.groups, self.weights, strict=True):
            if PRIOR not in group.shares:
                residual = group.e if isinstance(dx, float) else group.residual(dx)
                square += float(np.einsum("ki,kij,kj->", residual, W, residual))
        return square

    def components(self) -> dict[str, tuple[float, float]]:
        """Return what each share of the covariances has of the residuals (LS.2).

        Returns
        -------
        dict of str to tuple of float
            Weighted square sum and redundancy by name.
        """
        sums = dict[str, tuple[float, float]]()
        for group, W in zip(self.groups, self.weights, strict=True):
            We = (W @ group.e[:, :, None])[:, :, 0]
            WA = W @ group.A
            P_r = W - WA @ self.cov @ WA.swapaxes(1, 2)
            for name, share in group.shares.items():
                V_i = self.factors.get(name, 1.0) * share
                square, redundancy = sums.get(name, (0.0, 0.0))
                square += float(np.einsum("ki,kij,kj->", We, V_i, We))
                sums[name] = square, redundancy + float(np.sum(P_r * V_i))
        return sums


def gauss_newton(
    linearised: Callable[[], Sequence[Equations]],
    move: Callable[[Array], None],
    limit: float,
    steps: int,
    factors: Mapping[str, float] | None = None,
    redundancy: int = 0,
) -> tuple[NormalEquations, bool]:
    """Move values by Gauss-Newton steps until they stay.

    Parameters
    ----------
    linearised : callable
        Returns the groups of observations at the present values.
    move : callable
        Moves the values by a step (u,).
    limit : float
        Of the squared step over its variance, for the values to stay.
    steps : int
        Most steps.
    factors : mapping of str to float, optional
        Variance factors of shares of the covariances.
    redundancy : int
        Where given, variances grow by the variance factor if it is above one.

    Returns
    -------
    normals : NormalEquations
        Before the last step.
    converged : bool
        Whether the values stay.
    """
    for _ in range(steps):
        normals = NormalEquations(linearised(), factors or {})
        dx = normals.dx
        move(dx)
        variance = max(normals.square() / redundancy, 1.0) if redundancy else 1.0
        if float(dx @ normals.N @ dx) < limit * variance:
            return normals, True
    return normals, False


def condition_on(cov: Array, A: Array, e: Array, V: Array) -> tuple[Array, Array]:
    """Return what further observations would change.

    Parameters
    ----------
    cov : ndarray, (u, u)
        Covariance of the unknowns without them.
    A : ndarray, (d, u)
        Derivatives by the unknowns.
    e : ndarray, (d,)
        Observed - computed.
    V : ndarray, (d, d)
        Covariance of the observations.

    Returns
    -------
    dx : ndarray, (u,)
        Corrections of the unknowns.
    cov : ndarray, (u, u)
        Covariance of the unknowns.
    """
    CA = cov @ A.T
    gain = CA @ inverse(A @ CA + V)
    return gain @ e, cov - gain @ CA.T


def inverse(matrix: Array) -> Array:
    """Return the symmetric inverses of positive definite matrices.

    Parameters
    ----------
    matrix : ndarray, (..., u, u)
        Positive definite.

    Returns
    -------
    ndarray, (..., u, u)
        Symmetric.
    """
    unsymmetric = np.asarray(np.linalg.inv(matrix), dtype=np.float64)
    return np.asarray(0.5 * (unsymmetric + unsymmetric.swapaxes(-1, -2)))
