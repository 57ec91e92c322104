"""Normal equations of a block: assembled from image observations and groups, and solved (J.6)."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from ...base.errors import DataError
from ...records.block import INTERIOR, RADIAL_MODELS, Array, ImageBlock
from .envelope import Factor
from .envelope import factorise_envelope as envelope_factorised
from .groups import ObservationGroup, Rescaled
from .kernels import collinearity, elimination, points
from .unknowns import CAMERA, POINT, POSE, Key, UnknownLayout, Unknowns, columns_of, layout_of

SMALLEST_EIGENVALUE = 1e-14
"""Of the normal matrix with unit diagonal. Without datum, or without scale, rounding leaves some
1e-16; a strip of 60 images that hangs on three control points in a line has 1e-13, a good block
1e-5."""
SPARSE_UNKNOWNS = 100  # unknowns of a group from which on its Jacobian is taken for sparse (chosen)
POSE_NAMES = ("X", "Y", "Z", "rotation about X", "rotation about Y", "rotation about Z")


@dataclass(frozen=True, eq=False)
class Problem:
    """What an adjustment minimises.

    Parameters
    ----------
    block : ImageBlock
        Cameras, images and image observations.
    groups : tuple of ObservationGroup
        All other observations.
    layout : UnknownLayout
        Where the unknowns stand.
    rays : Rays
        Image observations in the order of their points, as the kernels take them.
    order : ndarray of int
        Row of the block's image observations of each of `rays`.
    """

    block: ImageBlock
    groups: tuple[ObservationGroup, ...]
    layout: UnknownLayout
    rays: collinearity.Rays
    order: NDArray[np.int64]

    def with_active(self, active: NDArray[np.bool_]) -> "Problem":
        """Return the problem with other image observations taking part.

        Parameters
        ----------
        active : ndarray of bool, (n,)
            Which take part, in the order of `rays`.

        Returns
        -------
        Problem
            The same otherwise.
        """
        return replace(self, rays=self.rays._replace(active=active))

    def with_active_of(self, source: "Problem") -> "Problem":
        """Return the problem with the image observations active that are so in another.

        Parameters
        ----------
        source : Problem
            One of the same image observations, whose rays may stand in another order.

        Returns
        -------
        Problem
            The same otherwise.
        """
        return self.with_active(source.active[self.order])

    @property
    def stated_groups(self) -> tuple[ObservationGroup, ...]:
        """The groups with the variances that were stated."""
        return tuple(g.group if isinstance(g, Rescaled) else g for g in self.groups)

    @property
    def active(self) -> NDArray[np.bool_]:
        """(n,) which of the block's image observations take part."""
        active = np.empty(self.order.size, dtype=bool)
        active[self.order] = self.rays.active
        return active

    @property
    def point(self) -> NDArray[np.int64]:
        """(n,) object point of each of `rays`."""
        return np.repeat(np.arange(self.rays.start.size - 1), np.diff(self.rays.start))

    @property
    def ray_count(self) -> NDArray[np.int64]:
        """(m,) number of rays of each object point that take part."""
        return np.bincount(self.point[self.rays.active], minlength=self.rays.start.size - 1)

    @property
    def observed(self) -> NDArray[np.bool_]:
        """(m,) which object points a group observes."""
        rows = [row for group in self.groups for name, row in group.keys if name == POINT]
        return np.isin(np.arange(self.rays.start.size - 1), rows)

    @property
    def determined(self) -> NDArray[np.bool_]:
        """(m,) which object points take part: seen, or observed by a group."""
        return np.asarray((self.ray_count > 0) | self.observed)

    def filled(self, values: Unknowns) -> Unknowns:
        """Return values with zeros for points that take no part, as kernels take them.

        Parameters
        ----------
        values : Unknowns
            Values; of points that take no part any.

        Returns
        -------
        Unknowns
            The same otherwise.
        """
        return values.with_points(np.where(self.determined[:, None], values.point, 0.0))


def problem_of(
    block: ImageBlock,
    groups: Sequence[ObservationGroup] = (),
    blocks: Mapping[Key, Array] | None = None,
    keep: Sequence[int] = (),
) -> Problem:
    """Return the problem of a block and its groups.

    Parameters
    ----------
    block : ImageBlock
        Cameras, images and image observations.
    groups : sequence of ObservationGroup
        All other observations, ground control among them.
    blocks : mapping, optional
        Values of the unknowns that groups bring.
    keep : sequence of int
        Object points that are not eliminated, so that their covariances with others can be had.

    Returns
    -------
    Problem
        With all image observations active.
    """
    tied = [group.keys for group in groups] + [((POINT, p), (POINT, p)) for p in keep]
    layout = layout_of(block, blocks or {}, tied)
    obs = block.observations
    order = np.lexsort((layout.place[obs.image], obs.point))
    rays = collinearity.Rays(
        np.searchsorted(obs.point[order], np.arange(len(block.points) + 1)).astype(np.int64),
        obs.image[order],
        np.ascontiguousarray(obs.uv[order]),
        obs.whitening[order],
        np.ones(len(obs), dtype=bool),
        np.ascontiguousarray(block.camera, dtype=np.int64),
        6 * layout.place,
        np.array([RADIAL_MODELS.index(camera.model) for camera in block.cameras], dtype=np.int64),
        np.array([camera.unit_px for camera in block.cameras], dtype=np.float64),
        layout.columns,
        layout.kept,
    )
    return Problem(block, tuple(groups), layout, rays, order)


@dataclass(frozen=True, eq=False)
class Normals:
    """Normal equations at one place, points eliminated with one damping.

    Parameters
    ----------
    S : normal matrix, as its envelope is stored, not damped on its diagonal.
    g : (u,) J^T P e of its columns.
    g_reduced : (u,) the same with the points eliminated.
    diagonal : (u,) diagonal of U.
    own_V, own_g : (m, 3, 3), (m, 3) what groups say of each point alone.
    gp : (m, 3) right-hand sides of the points.
    damping : lambda.
    """

    S: Array
    g: Array
    g_reduced: Array
    diagonal: Array
    own_V: Array
    own_g: Array
    gp: Array
    damping: float


Linearised = list[tuple[Array, Array]]
"""Residual and Jacobian of each group."""


def linearise_groups(problem: Problem, values: Unknowns) -> Linearised:
    """Linearise all groups.

    Parameters
    ----------
    problem : Problem
        The observations.
    values : Unknowns
        Where they are linearised.

    Returns
    -------
    list of tuple
        Residual (m,) and Jacobian (m, d) of each group.
    """
    return [group.linearised(values) for group in problem.groups]


def assemble_normals(
    problem: Problem,
    values: Unknowns,
    damping: float = 0.0,
    groups: Linearised | None = None,
) -> Normals:
    """Assemble the normal equations.

    Parameters
    ----------
    problem : Problem
        The observations.
    values : Unknowns
        Where they are linearised.
    damping : float
        lambda; the diagonals of the points are enlarged by it before they are eliminated.
    groups : list of tuple, optional
        What `linearise_groups` gives there.

    Returns
    -------
    Normals
        The normal equations.

    Raises
    ------
    DataError
        An object point is not determined by its rays.
    """
    u, m, envelope = problem.layout.size, len(problem.block.points), problem.layout.envelope
    S, g, reduced, diagonal = np.zeros(envelope.starts[-1]), np.zeros(u), np.zeros(u), np.zeros(u)
    V_own, g_own = np.zeros((m, 3, 3)), np.zeros((m, 3))
    groups = linearise_groups(problem, values) if groups is None else groups
    for group, (e, J) in zip(problem.groups, groups, strict=True):
        N, right = _normal(group.weight, J, e)
        (name, row), *further = group.keys
        if name == POINT and not further and problem.layout.kept[row] < 0:
            V_own[row] += N
            g_own[row] += right
            continue
        columns, taken = columns_of(problem.layout, group.keys)
        envelope.add(S, columns, N[np.ix_(taken, taken)])
        g[columns] += right[taken]
        diagonal[columns] += np.diagonal(N)[taken]
    gp = np.empty((m, 3))
    singular = elimination.normal_equations(
        problem.rays,
        values.kernel_values(),
        damping,
        V_own,
        g_own,
        points.scratch_for(problem.rays, len(values.interior)),
        envelope.places,
        S,
        g,
        reduced,
        diagonal,
        gp,
    )
    if singular >= 0:
        raise DataError(
            f"object point {problem.block.points[singular]}: its rays are parallel; leave it out"
        )
    return Normals(S, g, g + reduced, diagonal, V_own, g_own, gp, damping)


def _normal(P: Array, J: Array, e: Array) -> tuple[Array, Array]:
    """Return J^T P J and J^T P e of a group."""
    return weighted_product(J, P), J.T @ (P @ e)


def weighted_product(J: Array, P: Array) -> Array:
    """Compute J^T P J, of many unknowns by what is not zero in J.

    Of whole strips an observed pose depends on its own image, and on few other unknowns.

    Parameters
    ----------
    J : ndarray, (m, d)
        Derivatives.
    P : ndarray, (m, m)
        A symmetric matrix.

    Returns
    -------
    ndarray, (d, d)
        The product.
    """
    if max(J.shape) < SPARSE_UNKNOWNS:
        return np.asarray(J.T @ P @ J)
    row, column = np.nonzero(J)
    start = np.searchsorted(row, np.arange(len(J) + 1))
    out = np.zeros((J.shape[1], J.shape[1]))
    elimination.add_product(start, column, J[row, column], np.ascontiguousarray(P), out)
    return out


def factorise_normals(problem: Problem, normals: Normals) -> Factor:
    """Factorise the damped normal matrix of what is free, in the place of S.

    Parameters
    ----------
    problem : Problem
        The observations.
    normals : Normals
        What was assembled of them; its S is used up.

    Returns
    -------
    Factor
        Of the matrix that is scaled by the inverse roots of the diagonal of U.

    Raises
    ------
    DataError
        A column is not determined, with its name.
    """
    free = ~problem.layout.held
    if not (normals.diagonal[free] > 0.0).all():
        worst = np.flatnonzero(free)[np.argmin(normals.diagonal[free])]
        raise DataError(_undetermined_sentence(problem, int(worst)))
    scale = np.zeros(free.size)
    scale[free] = 1.0 / np.sqrt(normals.diagonal[free])
    factor, column = envelope_factorised(problem.layout.envelope, normals.S, scale, normals.damping)
    if column >= 0:
        raise DataError(_undetermined_sentence(problem, column))
    if free.any() and normals.damping == 0.0:
        eigenvalue, vector = _smallest(factor)
        if eigenvalue < SMALLEST_EIGENVALUE:
            raise DataError(_undetermined_sentence(problem, int(np.argmax(np.abs(vector)))))
    return factor


def _smallest(factor: Factor) -> tuple[float, Array]:
    """Return the smallest eigenvalue of L L^T, and its vector, by inverse iteration.

    It is no smaller than the true one, and near it where that is far from the next: as it is where
    something is not determined.
    """
    vector = np.cos(np.arange(factor.scale.size) * 2.399963)  # in no direction of its own
    size = 1.0
    for _ in range(4):
        vector = factor.solved(vector / np.linalg.norm(vector), scaled=True)
        size = float(np.linalg.norm(vector))
    return 1.0 / size, vector


def unknown_name(problem: Problem, column: int) -> str:
    """Return the name of a column's unknown for people.

    Parameters
    ----------
    problem : Problem
        The observations.
    column : int
        Column of the normal matrix.

    Returns
    -------
    str
        Such as "k1 of camera P1", "Z of image 8001.tif" or "lever arm z".
    """
    name, row = problem.layout.names()[column]
    position = column - int(problem.layout.of((name, row))[0][0])
    if name == POSE:
        return f"{POSE_NAMES[position]} of image {problem.block.images[row]}"
    if name == CAMERA:
        parameter = INTERIOR[problem.layout.columns[position]]
        return f"{parameter} of camera {problem.block.cameras[row].name}"
    if name == POINT:
        return f"{'XYZ'[position]} of point {problem.block.points[row]}"
    length = problem.layout.first[(name, row)][1]
    axis = f" {'xyz'[position]}" if length == 3 else f" {position}" if length > 1 else ""
    several = sum(first_name == name for first_name, _ in problem.layout.first) > 1
    return f"{name}{axis}{f' {row}' if several else ''}"


def _undetermined_sentence(problem: Problem, column: int) -> str:
    """Say which unknown the observations do not determine."""
    return (
        f"{unknown_name(problem, column)} is not determined by the observations: the block"
        " lacks control, too few tie points connect its images, or more camera parameters are"
        " estimated than the images determine; give ground control or aerial control, hold a"
        " pose, or estimate less (camera.free)"
    )


def corrections(problem: Problem, values: Unknowns, normals: Normals) -> tuple[Array, Array]:
    """Solve the normal equations.

    Parameters
    ----------
    problem, values, normals
        The observations, where they were linearised, and what was assembled there; its S is used
        up.

    Returns
    -------
    dx : ndarray, (u,)
        Corrections of all columns; zero where they are held.
    dp : ndarray, (m, 3)
        Corrections of all points, m.
    """
    dx = factorise_normals(problem, normals).solved(normals.g_reduced)
    dp = np.zeros((len(problem.block.points), 3))
    elimination.back_substitute(
        problem.rays,
        values.kernel_values(),
        normals.damping,
        normals.own_V,
        normals.own_g,
        points.scratch_for(problem.rays, len(values.interior)),
        dx,
        dp,
    )
    return dx, dp


def cost(problem: Problem, values: Unknowns, groups: Linearised | None = None) -> tuple[float, int]:
    """Compute e^T P e of all observations.

    Parameters
    ----------
    problem : Problem
        The observations.
    values : Unknowns
        The values of the unknowns.
    groups : list of tuple, optional
        What `linearise_groups` gives there.

    Returns
    -------
    cost : float
        e^T P e.
    invalid : int
        Number of active image observations without residual: behind the camera, or beyond the fold.
    """
    e = np.empty_like(problem.rays.uv)
    total, invalid = collinearity.residuals(problem.rays, values.kernel_values(), e)
    groups = linearise_groups(problem, values) if groups is None else groups
    for group, (r, _) in zip(problem.groups, groups, strict=True):
        total += float(r @ group.weight @ r)
    return float(total), int(invalid)


def cofactors_of(problem: Problem, values: Unknowns, columns: NDArray[np.int64]) -> Array:
    """Compute the cofactors of some columns alone, for the price of an iteration.

    Parameters
    ----------
    problem : Problem
        The observations.
    values : Unknowns
        The adjusted values.
    columns : ndarray of int, (d,)
        The columns.

    Returns
    -------
    ndarray, (d, d)
        Their cofactors, symmetric.

    Raises
    ------
    DataError
        The observations do not determine an unknown.
    """
    values = problem.filled(values)
    factor, envelope = (
        factorise_normals(problem, assemble_normals(problem, values)),
        problem.layout.envelope,
    )
    if 3 * columns.size > envelope.size and envelope.holds(columns):  # the inverse costs less
        return envelope.entries(factor.inverted(), columns)
    unit = np.zeros((envelope.size, columns.size))
    unit[columns, np.arange(columns.size)] = 1.0
    Q = factor.solved(unit)[columns]
    return np.asarray(0.5 * (Q + Q.T))
