"""What an adjustment says of itself: covariances, redundancy, tests, variance components (J.7)."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ...records.block import INTERIOR, Array, ImageBlock, whitened
from .adjustment import Adjusted, residuals_px
from .envelope import Factor
from .groups import ObservationGroup
from .kernels import points, posterior
from .normals import Problem, assemble_normals, factorise_normals, weighted_product
from .unknowns import CAMERA, POINT, POSE, Key, Unknowns, columns_of

NONCENTRALITY = 4.13
"""Of Baarda's test with 0.1 % false alarms and 80 % power."""
COMMON_MOTIONS = ("height", "rotation about y", "rotation about x")
"""Motions that all images of a camera may have in common: mean Z of their projection centres (m),
and mean rotation about the axes of the camera (rad): roll and pitch where y looks back or ahead."""
IMAGE = "image observations"


@dataclass(frozen=True, eq=False)
class GroupTest:
    """How the observations of a group fit.

    Parameters
    ----------
    name : str
        Name of the variance component.
    keys : tuple
        Blocks of unknowns that the group sees.
    e : ndarray, (m,)
        Observed - computed.
    redundancy : ndarray, (m,)
        Redundancy numbers; their sum is that of the group.
    w : ndarray, (m,)
        Standardised residuals; standard normal where the observations are as good as stated.
    detectable : ndarray, (m,)
        Minimal detectable biases, in the unit of the observations; infinite where none would show.
    """

    name: str
    keys: tuple[Key, ...]
    e: Array
    redundancy: Array
    w: Array
    detectable: Array


@dataclass(frozen=True)
class VarianceComponent:
    """Variance component of the observations of one name.

    Parameters
    ----------
    name : str
        The name.
    observations : int
        Their number.
    redundancy : float
        Sum of their redundancy numbers.
    variance : float
        e^T P e / redundancy: the factor of their variances that the adjustment finds; NaN where
        the redundancy is below 1e-6.
    """

    name: str
    observations: int
    redundancy: float
    variance: float


@dataclass(frozen=True, eq=False)
class Cofactors:
    """Cofactors of all unknowns but eliminated points.

    Parameters
    ----------
    problem, values
        The observations, and the adjusted values.
    stored : ndarray
        S^-1 within the envelope of the normal matrix; zero in rows and columns of what is held.
    common : ndarray, (u, 3 c)
        Cofactors of all columns with the common motions of each camera's images (`COMMON_MOTIONS`).
    common_motions : ndarray, (3 c, 3 c)
        Cofactors of these motions.
    """

    problem: Problem
    values: Unknowns
    stored: Array
    common: Array
    common_motions: Array

    def of(self, columns: NDArray[np.int64]) -> Array:
        """Return the cofactors of some columns.

        Of images that have nothing in common they are not stored: then the normal equations are
        solved for these columns, for the price of an iteration.

        Parameters
        ----------
        columns : ndarray of int
            (d,) columns.

        Returns
        -------
        ndarray, (d, d)
            Their cofactors.
        """
        envelope = self.problem.layout.envelope
        if envelope.holds(columns):
            return envelope.entries(self.stored, columns)
        unit = np.zeros((envelope.size, len(columns)))
        unit[columns, np.arange(len(columns))] = 1.0
        factor = factorise_normals(self.problem, assemble_normals(self.problem, self.values))
        return np.asarray(factor.solved(unit)[columns])


@dataclass(frozen=True, eq=False)
class Precision:
    """Covariances and tests of an adjustment.

    Parameters
    ----------
    result : Adjusted
        The adjustment.
    scale : float
        Variance of unit weight that is taken: sigma_0^2, or one where variances are known.
    cofactors : Cofactors
        Cofactors of all unknowns but eliminated points.
    point_cov : ndarray, (m, 3, 3)
        Covariance of the object points, m^2; NaN of those that do not take part.
    redundancy, w, detectable_px : ndarray, (n, 2)
        Redundancy numbers, standardised residuals and minimal detectable biases (pixels) of the
        image observations; NaN of those that do not take part.
    groups : tuple of GroupTest
        How the other observations fit.
    """

    result: Adjusted
    scale: float
    cofactors: Cofactors
    point_cov: Array
    redundancy: Array
    w: Array
    detectable_px: Array
    groups: tuple[GroupTest, ...]

    def cov(self, *keys: Key) -> Array:
        """Return the covariance of the unknowns of some blocks.

        Parameters
        ----------
        *keys : tuple
            The blocks. A point alone may be any; one beside others must be one that is not
            eliminated.

        Returns
        -------
        ndarray, (d, d)
            Covariance, in the order of the blocks; of a camera of its unknown parameters only, in
            the order of `INTERIOR`.
        """
        layout = self.result.problem.layout
        (name, row), *further = keys
        if name == POINT and not further and layout.kept[row] < 0:
            return np.array(self.point_cov[row])
        columns = np.concatenate([layout.of(key)[0] for key in keys])
        return self.scale * self.cofactors.of(columns)

    def sigma_interior(self, camera: int) -> Array:
        """Return the standard deviations of a camera's interior orientation.

        Parameters
        ----------
        camera : int
            Row of the camera.

        Returns
        -------
        ndarray, (11,)
            Standard deviations in the order of `INTERIOR`; zero where a parameter is held.
        """
        out = np.zeros(len(INTERIOR))
        layout = self.result.problem.layout
        out[layout.columns] = np.sqrt(np.diagonal(self.cov((CAMERA, camera))))
        return out

    @property
    def point_sigma(self) -> Array:
        """(m, 3) standard deviations of the object points, m."""
        return np.asarray(np.sqrt(np.diagonal(self.point_cov, axis1=1, axis2=2)))

    @property
    def pose_cov(self) -> Array:
        """(n, 6, 6) covariance of each image's position (m) and psi (rad); zero where held."""
        layout = self.result.problem.layout
        blocks = [self.cofactors.of(layout.of((POSE, i))[0]) for i in range(layout.n_images)]
        return self.scale * np.array(blocks).reshape(-1, 6, 6)

    def components(self) -> tuple[VarianceComponent, ...]:
        """Return the variance components: image observations of each camera, then the groups'."""
        problem = self.result.problem
        observations = problem.block.observations
        e = whitened(observations.whitening, residuals_px(self.result))
        of_camera = problem.block.camera[observations.image]
        components = []
        for c, name in enumerate(image_components(problem.block)):
            mine = (of_camera == c) & np.isfinite(self.redundancy[:, 0])
            cost, r = float((e[mine] ** 2).sum()), float(self.redundancy[mine].sum())
            components.append(_component(name, 2 * int(mine.sum()), cost, r))
        for name in dict.fromkeys(test.name for test in self.groups):
            count, cost, r = 0, 0.0, 0.0
            for group, test in zip(problem.groups, self.groups, strict=True):
                if test.name == name:
                    count += test.e.size
                    cost += float(test.e @ group.weight @ test.e)
                    r += float(test.redundancy.sum())
            components.append(_component(name, count, cost, r))
        return tuple(components)


def image_components(block: ImageBlock) -> tuple[str, ...]:
    """Return the name of the variance component of each camera's image observations.

    Parameters
    ----------
    block : ImageBlock
        The block.

    Returns
    -------
    tuple of str
        `IMAGE` of the only camera, with the camera's name of several.
    """
    several = len(block.cameras) > 1
    return tuple(f"{IMAGE} of {c.name}" if several else IMAGE for c in block.cameras)


def _component(name: str, count: int, cost: float, redundancy: float) -> VarianceComponent:
    return VarianceComponent(
        name, count, redundancy, cost / redundancy if redundancy > 1e-6 else np.nan
    )


def precision_of(result: Adjusted, scale: float | None = None) -> Precision:
    """Compute covariances, redundancy numbers and tests of an adjustment.

    Parameters
    ----------
    result : Adjusted
        The adjustment.
    scale : float, optional
        Variance of unit weight, one where the variances of all observations are known; by default
        sigma_0^2 of the adjustment, one where nothing is redundant.

    Returns
    -------
    Precision
        All of it.

    Raises
    ------
    DataError
        The observations do not determine an unknown.
    """
    problem = result.problem
    if scale is None:
        scale = result.sigma0**2 if result.redundancy > 0 else 1.0
    normals = assemble_normals(problem, result.values)
    Q = cofactors_from(problem, result.values, factorise_normals(problem, normals))
    point = np.full((len(problem.block.points), 3, 3), np.nan)
    r = np.full_like(problem.rays.weight, np.nan)
    posterior.posterior(
        problem.rays,
        result.values.kernel_values(),
        normals.own_V,
        normals.own_g,
        points.scratch_for(problem.rays, len(result.values.interior)),
        problem.layout.envelope.places,
        Q.stored,
        point,
        r,
    )
    redundancy, w, detectable = _tested_rays(result, r, scale)
    tests = tuple(test_statistics(result, group, Q, point, scale) for group in problem.groups)
    return Precision(result, scale, Q, scale * point, redundancy, w, detectable, tests)


def _tested_rays(result: Adjusted, r: Array, scale: float) -> tuple[Array, Array, Array]:
    """Return redundancy numbers, w and detectable biases of the image observations, (n, 2) each.

    With the cofactors R of whitened residuals W e, rows `r` in the order of rays, these are those
    of `test_statistics`: P e = W^T W e, P Q_vv P = W^T R W, Q_vv P = W^-1 R W.
    """
    problem = result.problem
    R, W = np.empty_like(r), problem.block.observations.whitening
    R[problem.order] = r
    a, b, c = W.T
    e = whitened(W, residuals_px(result))
    shared = R[:, 1] * b / a
    redundancy = np.column_stack([R[:, 0] + shared, R[:, 2] - shared])
    uncorrelated = b == 0.0  # of others one of both may be negative, as of groups
    redundancy[uncorrelated] = np.maximum(redundancy[uncorrelated], 0.0)
    against = a**2 * R[:, 0] + 2.0 * a * b * R[:, 1] + b**2 * R[:, 2], c**2 * R[:, 2]
    weighted = np.column_stack([a * e[:, 0] + b * e[:, 1], c * e[:, 1]])
    diagonal = np.column_stack([a**2 + b**2, c**2])
    return redundancy, *_standardise(weighted, np.column_stack(against), diagonal, scale)


def _standardise(
    weighted: Array, against: Array, diagonal: Array, scale: float
) -> tuple[Array, Array]:
    """Return w and detectable biases by P e and the diagonals of P Q_vv P and of P."""
    with np.errstate(divide="ignore", invalid="ignore"):
        root = np.where(against <= 1e-9 * diagonal, 0.0, np.sqrt(np.maximum(against, 0.0)))
        w = np.where(root == 0.0, 0.0, weighted / root / np.sqrt(scale))
        return w, NONCENTRALITY * np.sqrt(scale) / root


def cofactors_from(problem: Problem, values: Unknowns, factor: Factor) -> Cofactors:
    """Return all cofactors.

    Parameters
    ----------
    problem, values
        The observations, and the adjusted values.
    factor : Factor
        Of their normal matrix; it is used up.

    Returns
    -------
    Cofactors
        Those that the envelope stores, and those of common motions.
    """
    layout, block = problem.layout, problem.block
    motions = np.zeros((layout.size, len(COMMON_MOTIONS) * len(block.cameras)))
    share = 1.0 / np.maximum(np.bincount(block.camera, minlength=len(block.cameras)), 1)
    for i, c in enumerate(block.camera):
        columns, _ = layout.of((POSE, i))
        first = len(COMMON_MOTIONS) * c
        motions[columns[2], first] = share[c]
        motions[columns[3:], first + 1] = share[c] * values.C_mc[i][:, 1]
        motions[columns[3:], first + 2] = share[c] * values.C_mc[i][:, 0]
    common = factor.solved(motions)
    return Cofactors(problem, values, factor.inverted(), common, motions.T @ common)


def test_statistics(
    result: Adjusted, group: ObservationGroup, Q: Cofactors, point: Array, scale: float
) -> GroupTest:
    """Test a group: w = (P e)_i / sqrt((P Q_vv P)_ii), for correlated observations too.

    Parameters
    ----------
    result : Adjusted
        The adjustment.
    group : ObservationGroup
        The group.
    Q : Cofactors
        Cofactors of all unknowns but eliminated points.
    point : ndarray, (m, 3, 3)
        Cofactors of the points.
    scale : float
        Variance of unit weight.

    Returns
    -------
    GroupTest
        Residuals and their tests.
    """
    layout = result.problem.layout
    e, J = group.linearised(result.values)
    (name, row), *further = group.keys
    if name == POINT and not further and layout.kept[row] < 0:
        mine = point[row]
    else:
        columns, taken = columns_of(layout, group.keys)
        J, mine = J[:, taken], Q.of(columns)
    P = group.weight
    A = explained_cofactors(J, mine)
    redundancy = 1.0 - (A * P).sum(axis=1)  # diagonal of Q_vv P = 1 - A P
    against = np.diagonal(P) - ((P @ A) * P).sum(axis=1)
    w, detectable = _standardise(P @ e, against, np.diagonal(P), scale)
    return GroupTest(group.name, group.keys, e, redundancy, w, detectable)


def explained_cofactors(J: Array, Q: Array) -> Array:
    """Return the cofactors of adjusted observations.

    Parameters
    ----------
    J : ndarray, (m, d)
        Their derivatives by the unknowns.
    Q : ndarray, (d, d)
        Cofactors of these.

    Returns
    -------
    ndarray, (m, m)
        J Q J^T.
    """
    return weighted_product(J.T, Q)


def strongest(precision: Precision, count: int = 10) -> Sequence[tuple[str, str, float]]:
    """Return the image observations with the largest standardised residuals.

    Parameters
    ----------
    precision : Precision
        The tests.
    count : int
        How many.

    Returns
    -------
    sequence of tuple
        Image, object point and w, the largest first.
    """
    block = precision.result.problem.block
    w = np.nan_to_num(np.abs(precision.w)).max(axis=1)
    rows = np.argsort(-w, kind="stable")[:count]
    obs = block.observations
    return [
        (block.images[obs.image[row]], block.points[obs.point[row]], float(w[row])) for row in rows
    ]
