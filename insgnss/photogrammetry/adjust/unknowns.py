"""Values of the unknowns, and where each stands in the normal matrix.

A block of unknowns has a key, a name and a row: ("pose", i), ("camera", c), ("point", p), and any
other name that a group brings, such as ("boresight", 0). Corrections of a pose are those of the
position (m) and psi (rad) in the axes of the block; those of any other block whose value is a
matrix (3, 3) are a rotation vector on its left, exp([psi x]) C, and those of a vector are added.

The columns of the normal matrix are poses (in an order of their own where the matrix is not dense,
`ordering`), cameras (parameters that are unknowns of some camera), other blocks, points that are
not eliminated. Columns that are held (values that do not change) are
left out when it is solved.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray

from ...base.errors import UsageError
from ...geodesy.rotation import rotation_from_vector
from ...records.block import INTERIOR, Array, BrownCamera, ImageBlock
from ...records.cameras.camera import fold_radius
from .envelope import Envelope
from .kernels import collinearity
from .ordering import arrange_poses

Key = tuple[str, int]
POSE, CAMERA, POINT = "pose", "camera", "point"


@dataclass(frozen=True, eq=False)
class Unknowns:
    """Values of all unknowns, and of what is held.

    Parameters
    ----------
    position : (n, 3) projection centres, m.
    C_mc : (n, 3, 3) attitudes, camera to the axes of the block.
    interior : (c, 11) interior orientations.
    point : (m, 3) object points, m; NaN of a point that does not take part.
    blocks : the other blocks by key, each (d,) or (3, 3).
    """

    position: Array
    C_mc: Array
    interior: Array
    point: Array
    blocks: Mapping[Key, Array] = field(default_factory=dict)

    def moved(self, layout: "UnknownLayout", dx: Array, dp: Array) -> "Unknowns":
        """Return the values after a correction.

        Parameters
        ----------
        layout : UnknownLayout
            Where the unknowns stand.
        dx : ndarray, (u,)
            Corrections of all columns of the layout.
        dp : ndarray, (m, 3)
            Corrections of all points, m.

        Returns
        -------
        Unknowns
            The new values.
        """
        n, k = len(self.position), layout.columns.size
        pose = dx[: 6 * n].reshape(n, 6)[layout.place]
        interior = self.interior.copy()
        c = len(interior)
        interior[:, layout.columns] += dx[6 * n : 6 * n + k * c].reshape(c, k)
        blocks = {}
        for key, value in self.blocks.items():
            step = dx[layout.of(key)[0]]
            blocks[key] = rotation_from_vector(step) @ value if value.ndim == 2 else value + step
        return Unknowns(
            self.position + pose[:, :3],
            rotation_from_vector(pose[:, 3:]) @ self.C_mc,
            interior,
            self.point + dp,
            blocks,
        )

    def kernel_values(self) -> collinearity.Values:
        """Return what the kernels take of the values."""
        fold2 = np.array([fold_radius(c) ** 2 for c in self.interior])
        return collinearity.Values(self.position, self.C_mc, self.interior, fold2, self.point)

    def cameras(self, cameras: Sequence[BrownCamera]) -> tuple[BrownCamera, ...]:
        """Return cameras with these values of their interior orientations.

        Parameters
        ----------
        cameras : sequence of BrownCamera
            The cameras of the block.

        Returns
        -------
        tuple of BrownCamera
            The same with other values.
        """
        return tuple(c.with_(v) for c, v in zip(cameras, self.interior, strict=True))

    def residuals(self, rays: collinearity.Rays) -> Array:
        """Return the residuals of image observations.

        Parameters
        ----------
        rays : Rays
            The observations.

        Returns
        -------
        ndarray, (n, 2)
            Observed - computed, pixels; NaN of points that cannot be seen.
        """
        e = np.empty_like(rays.uv)
        collinearity.residuals(rays, self.kernel_values(), e)
        return e

    def completed(self, first: "Unknowns") -> "Unknowns":
        """Return the values with first ones of points that did not take part.

        Parameters
        ----------
        first : Unknowns
            Has them.

        Returns
        -------
        Unknowns
            The same otherwise.
        """
        return self.with_points(np.where(np.isnan(self.point), first.point, self.point))

    def with_points(self, point: Array) -> "Unknowns":
        """Return the values with other object points.

        Parameters
        ----------
        point : ndarray, (m, 3)
            The points, m.

        Returns
        -------
        Unknowns
            The same otherwise.
        """
        return replace(self, point=point)


@dataclass(frozen=True, eq=False)
class UnknownLayout:
    """Columns of the normal matrix.

    Parameters
    ----------
    n_images, n_cameras : int
        Numbers of poses and cameras.
    columns : ndarray of int
        (k,) parameters of interior orientation that are unknowns of some camera.
    first : mapping
        First column and number of columns of each other block, by key.
    kept : ndarray of int
        (m,) first column of each point that is not eliminated, -1 of the others.
    held : ndarray of bool
        (u,) columns whose values are held.
    place : ndarray of int
        (n,) place of each image among the poses.
    envelope : Envelope
        What is stored of the normal matrix.
    """

    n_images: int
    n_cameras: int
    columns: NDArray[np.int64]
    first: Mapping[Key, tuple[int, int]]
    kept: NDArray[np.int64]
    held: NDArray[np.bool_]
    place: NDArray[np.int64]
    envelope: Envelope

    @property
    def size(self) -> int:
        """Number of columns, held ones included."""
        return int(self.held.size)

    def of(self, key: Key) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
        """Return where a block stands.

        Parameters
        ----------
        key : tuple
            The block.

        Returns
        -------
        columns : ndarray of int
            Its columns of the normal matrix.
        parameters : ndarray of int
            Which of its parameters these are.

        Raises
        ------
        UsageError
            There is no such block, or it is a point that is eliminated.
        """
        name, row = key
        if name == POSE and 0 <= row < self.n_images:
            start = 6 * int(self.place[row])
            return np.arange(start, start + 6), np.arange(6)
        if name == CAMERA and 0 <= row < self.n_cameras:
            k = self.columns.size
            start = 6 * self.n_images + k * row
            return np.arange(start, start + k), self.columns
        if name == POINT and 0 <= row < self.kept.size and self.kept[row] >= 0:
            return np.arange(self.kept[row], self.kept[row] + 3), np.arange(3)
        if key in self.first:
            start, length = self.first[key]
            return np.arange(start, start + length), np.arange(length)
        raise UsageError(f"observation group: no block {name} {row} among the unknowns")

    def names(self) -> list[Key]:
        """Return the key of each column's block."""
        k = self.columns.size
        keys = [(POSE, int(i)) for i in np.argsort(self.place) for _ in range(6)]
        keys += [(CAMERA, c) for c in range(self.n_cameras) for _ in range(k)]
        for key, (_, length) in self.first.items():
            keys += [key] * length
        kept = np.flatnonzero(self.kept >= 0)
        keys += [(POINT, int(p)) for p in kept[np.argsort(self.kept[kept])] for _ in range(3)]
        return keys


def size_of(value: Array) -> int:
    """Return how many parameters the value of a block has.

    Parameters
    ----------
    value : ndarray
        A vector, or a rotation matrix.

    Returns
    -------
    int
        Three of a rotation.
    """
    return 3 if value.ndim == 2 else value.size


def layout_of(
    block: ImageBlock, blocks: Mapping[Key, Array], keys: Sequence[tuple[Key, ...]]
) -> UnknownLayout:
    """Decide where the unknowns of a block stand.

    Parameters
    ----------
    block : ImageBlock
        The block: what of its poses is held, which parameters of its cameras are free.
    blocks : mapping
        Values of the blocks that groups bring.
    keys : sequence of tuple
        The blocks that each group refers to.

    Returns
    -------
    UnknownLayout
        The columns. A point is kept where a group ties it to another block.
    """
    n, c = len(block.images), len(block.cameras)
    free = np.array([[name in camera.free for name in INTERIOR] for camera in block.cameras])
    columns = np.flatnonzero(free.any(axis=0)).astype(np.int64)
    held = [~free[:, columns].ravel()]
    position = 6 * n + columns.size * c
    first = {}
    for key, value in blocks.items():
        length = size_of(value)
        first[key] = (position, length)
        position += length
        held.append(np.zeros(length, dtype=bool))
    kept = np.full(len(block.points), -1, dtype=np.int64)
    for tied in keys:
        for name, row in tied:
            if name == POINT and len(tied) > 1 and kept[row] < 0:
                kept[row] = position
                position += 3
                held.append(np.zeros(3, dtype=bool))
    together = [[row for name, row in tied if name == POSE] for tied in keys]
    pose_order, envelope = arrange_poses(block, together, position)
    held = [np.asarray(block.held)[np.argsort(pose_order)].ravel(), *held]
    return UnknownLayout(n, c, columns, first, kept, np.concatenate(held), pose_order, envelope)


def columns_of(
    layout: UnknownLayout, keys: tuple[Key, ...]
) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """Return where the blocks of a group stand.

    Parameters
    ----------
    layout : UnknownLayout
        Where the unknowns stand.
    keys : tuple
        Blocks of the group.

    Returns
    -------
    columns : ndarray of int
        Columns of the normal matrix.
    taken : ndarray of int
        Columns of the group's Jacobian that belong to them; parameters of a camera that are no
        unknowns have none.
    """
    columns, taken, offset = [], [], 0
    for key in keys:
        mine, parameters = layout.of(key)
        columns.append(mine)
        taken.append(offset + parameters)
        offset += len(INTERIOR) if key[0] == CAMERA else mine.size
    return np.concatenate(columns), np.concatenate(taken)


def keys_of_parameters(parameters: Mapping[str, int], order: Sequence[str]) -> tuple[Key, ...]:
    """Return the blocks of the parameters that are unknowns.

    Parameters
    ----------
    parameters : mapping
        Row of the block of each.
    order : sequence of str
        All parameters in the order of a group's columns.

    Returns
    -------
    tuple of tuple
        Their keys in this order.
    """
    return tuple((name, parameters[name]) for name in order if name in parameters)
