"""Observation groups: what is known besides the image observations.

A group names the blocks of unknowns that it sees (`unknowns.Key`), gives observed - computed and
the derivative d computed / d unknown by all parameters of these blocks, side by side in their
order, and has the inverse of the covariance of its m observations as a dense weight matrix. The
engine asks for nothing else: whole strips of poses with all their covariances, shifts and drifts,
mounting, relative poses and kinematic ground points are groups of this kind. Groups of one name
share a variance component.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Protocol

import numpy as np

from ...base.errors import DataError, InputError
from ...geodesy.rotation import inverse_right_jacobian, vector_from_rotation
from ...records.block import Array, GroundPoints
from .unknowns import CAMERA, POINT, POSE, Key, Unknowns

# sigma of inner constraints, of the network's size: far below what images determine, and no worse
# for the condition of the normal matrix than a good block is
HELD_SHARE = 1e-7
# reciprocal condition from which on a scaled covariance needs no eigenvalues: ten times the least
WELL = 1e-12


class ObservationGroup(Protocol):
    """Observations with one weight matrix; what the engine asks of a group."""

    @property
    def name(self) -> str:
        """Name of the variance component."""

    @property
    def keys(self) -> tuple[Key, ...]:
        """Blocks of unknowns that the group sees."""

    @property
    def weight(self) -> Array:
        """Inverse of the observations' covariance, (m, m)."""

    def linearised(self, values: Unknowns) -> tuple[Array, Array]:
        """Linearise the group.

        Parameters
        ----------
        values : Unknowns
            Where it is linearised.

        Returns
        -------
        e : ndarray, (m,)
            Observed - computed.
        J : ndarray, (m, d)
            d computed / d unknown, for all parameters of the blocks in `keys`, side by side: 6 of a
            pose, 11 of a camera, 3 of a point.
        """


def refuse_other_shapes(group: object, shapes: Mapping[str, tuple[int, ...]]) -> None:
    """Refuse a group one of whose arrays has another shape than expected.

    Parameters
    ----------
    group : ObservationGroup
        The group.
    shapes : mapping
        Expected shape by field.

    Raises
    ------
    InputError
        A shape differs.
    """
    for name, shape in shapes.items():
        if (got := getattr(group, name).shape) != shape:
            raise InputError(f"{type(group).__name__}.{name}: shape {got}, expected {shape}")


def refuse_other_parameters(
    group: object, parameters: Mapping[str, int], order: Sequence[str]
) -> None:
    """Refuse a group with a parameter that its equations do not have.

    Parameters
    ----------
    group : ObservationGroup
        The group.
    parameters : mapping
        Its parameters.
    order : sequence of str
        Those of its equations.

    Raises
    ------
    InputError
        A parameter is none of them.
    """
    if unknown := set(parameters) - set(order):
        raise InputError(
            f"{type(group).__name__}.parameters: {', '.join(sorted(unknown))} is none of"
            f" {', '.join(order)}"
        )


def weight_of(cov: Array, who: str) -> Array:
    """Return the inverse of a covariance.

    Parameters
    ----------
    cov : ndarray, (m, m)
        Covariance.
    who : str
        Whose it is, for the message.

    Returns
    -------
    ndarray, (m, m)
        Its inverse, symmetric.

    Raises
    ------
    DataError
        It is not positive definite, to 13 digits when its diagonal is scaled to one.
    """
    scale = 1.0 / np.sqrt(np.maximum(np.diagonal(cov), np.finfo(float).tiny))
    if (inverse := _by_cholesky(cov, scale)) is not None:
        return inverse
    values, axes = np.linalg.eigh(scale[:, None] * cov * scale)
    if not values[0] > 1e-13 * values[-1]:
        raise DataError(
            f"{who}: covariance is not positive definite (eigenvalues from {values[0]:.1e} to"
            f" {values[-1]:.1e} when scaled); give every observation a variance of its own"
        )
    whitened = axes / np.sqrt(values) * scale[:, None]
    return np.asarray(whitened @ whitened.T)


def _by_cholesky(cov: Array, scale: Array) -> Array | None:
    """Return the inverse of a covariance, by its scaled one; None where that may be singular."""
    from scipy.linalg.lapack import dlange, dpocon, dpotrf, dpotri

    scaled = scale[:, None] * cov
    scaled *= scale
    norm = dlange("1", scaled.T)
    factor, failed = dpotrf(scaled.T, lower=1, overwrite_a=1)
    if failed or not dpocon(factor, norm, uplo="L")[0] > WELL:
        return None
    upper = dpotri(factor, lower=1, overwrite_c=1)[0].T  # rows in a piece; zeros below
    upper *= scale[:, None]
    upper *= scale
    for first in range(0, scale.size, 256):  # in pieces that caches hold
        rows = slice(first, first + 256)
        upper[rows, :first] = upper[:first, rows].T
        square = upper[rows, rows]
        square += np.triu(square, 1).T
    return upper


@dataclass(frozen=True, eq=False)
class PoseObservation:
    """The pose of an image, with the covariance of position and psi.

    Parameters
    ----------
    image : int
        Row of the image.
    position_m : ndarray, (3,)
        Projection centre, m.
    C_mc : ndarray, (3, 3)
        Attitude, camera to the axes of the block.
    weight : ndarray, (6, 6)
        Inverse of the covariance of position (m) and psi (rad).
    name : str
        Name of the variance component.
    """

    image: int
    position_m: Array
    C_mc: Array
    weight: Array
    name: str = "pose"

    @property
    def keys(self) -> tuple[Key, ...]:
        """The pose."""
        return ((POSE, self.image),)

    def linearised(self, values: Unknowns) -> tuple[Array, Array]:
        """Linearise the group; see `ObservationGroup.linearised`.

        Parameters
        ----------
        values : Unknowns
            Where it is linearised.

        Returns
        -------
        e : ndarray, (m,)
            Observed - computed.
        J : ndarray, (m, d)
            d computed / d unknown.
        """
        C = values.C_mc[self.image]
        psi = vector_from_rotation(self.C_mc @ C.T)
        e = np.concatenate([self.position_m - values.position[self.image], psi])
        J = np.eye(6)
        J[3:, 3:] = inverse_right_jacobian(psi)
        return e, J


@dataclass(frozen=True, eq=False)
class PointObservation:
    """Coordinates of an object point, such as of a ground control point.

    Parameters
    ----------
    point : int
        Row of the object point.
    position_m : ndarray, (3,)
        Coordinates, m.
    weight : ndarray, (3, 3)
        Inverse of their covariance.
    name : str
        Name of the variance component.
    """

    point: int
    position_m: Array
    weight: Array
    name: str = "ground control"

    @property
    def keys(self) -> tuple[Key, ...]:
        """The point."""
        return ((POINT, self.point),)

    def linearised(self, values: Unknowns) -> tuple[Array, Array]:
        """Linearise the group; see `ObservationGroup.linearised`.

        Parameters
        ----------
        values : Unknowns
            Where it is linearised.

        Returns
        -------
        e : ndarray, (m,)
            Observed - computed.
        J : ndarray, (m, d)
            d computed / d unknown.
        """
        return self.position_m - values.point[self.point], np.eye(3)


@dataclass(frozen=True, eq=False)
class InteriorObservation:
    """Interior orientation of a camera, of which an earlier calibration gave the covariance.

    Parameters
    ----------
    camera : int
        Row of the camera.
    parameters : ndarray of int
        (m,) rows of the parameters in the interior orientation.
    values : ndarray, (m,)
        Their values.
    weight : ndarray, (m, m)
        Inverse of their covariance.
    name : str
        Name of the variance component.
    """

    camera: int
    parameters: np.ndarray
    values: Array
    weight: Array
    name: str = "interior orientation"

    @property
    def keys(self) -> tuple[Key, ...]:
        """The camera."""
        return ((CAMERA, self.camera),)

    def linearised(self, values: Unknowns) -> tuple[Array, Array]:
        """Linearise the group; see `ObservationGroup.linearised`.

        Parameters
        ----------
        values : Unknowns
            Where it is linearised.

        Returns
        -------
        e : ndarray, (m,)
            Observed - computed.
        J : ndarray, (m, d)
            d computed / d unknown.
        """
        current = values.interior[self.camera]
        J = np.zeros((self.parameters.size, current.size))
        J[np.arange(self.parameters.size), self.parameters] = 1.0
        return self.values - current[self.parameters], J


@dataclass(frozen=True, eq=False)
class DistanceObservation:
    """The distance of two object points, such as of a scale bar.

    Parameters
    ----------
    points : tuple of int
        Rows of both.
    distance_m : float
        Their distance, m.
    weight : ndarray, (1, 1)
        Inverse of its variance.
    name : str
        Name of the variance component.
    """

    points: tuple[int, int]
    distance_m: float
    weight: Array
    name: str = "distances"

    @property
    def keys(self) -> tuple[Key, ...]:
        """Both points."""
        return tuple((POINT, row) for row in self.points)

    def linearised(self, values: Unknowns) -> tuple[Array, Array]:
        """Linearise the group; see `ObservationGroup.linearised`.

        Parameters
        ----------
        values : Unknowns
            Where it is linearised.

        Returns
        -------
        e : ndarray, (m,)
            Observed - computed.
        J : ndarray, (m, d)
            d computed / d unknown.
        """
        a, b = self.points
        d = values.point[b] - values.point[a]
        computed = float(np.linalg.norm(d))
        return np.array([self.distance_m - computed]), np.concatenate([-d, d])[None] / computed


@dataclass(frozen=True, eq=False)
class InnerConstraints:
    """Coordinates whose shift, turn and scale as a whole stay as they are: a free network.

    With the rows of B the motions of all of them that change no observation, each of unit length,
    B (x - x_0) = 0 makes the trace of their covariance least, and residuals are those of any other
    datum.

    Parameters
    ----------
    blocks : tuple
        Keys of the poses, of which the projection centres count, or of object points.
    first_m : ndarray, (n, 3)
        Their first coordinates x_0, m.
    scaled : bool
        Whether the scale is constrained, which distances would determine.
    name : str
        Name of the variance component.
    """

    blocks: tuple[Key, ...]
    first_m: Array
    scaled: bool = True
    name: str = "free network"

    @cached_property
    def motions(self) -> Array:
        """B, (7, 3 n), or (6, 3 n) without scale."""
        n = len(self.first_m)
        x = self.first_m - self.first_m.mean(axis=0)
        rows = [np.tile(axis, n) for axis in np.eye(3)]
        rows += [np.cross(axis, x).ravel() for axis in np.eye(3)]
        rows += [x.ravel()] if self.scaled else []
        return np.stack([row / np.linalg.norm(row) for row in rows])

    @cached_property
    def weight(self) -> Array:
        """Inverse of the covariance, of a millionth of the network's size or less."""
        spread = self.first_m - self.first_m.mean(axis=0)
        sigma = HELD_SHARE * float(np.sqrt(np.mean(np.sum(spread**2, axis=1))))
        return np.asarray(np.eye(len(self.motions)) / sigma**2)

    @property
    def keys(self) -> tuple[Key, ...]:
        """The blocks."""
        return self.blocks

    def linearised(self, values: Unknowns) -> tuple[Array, Array]:
        """Linearise the group; see `ObservationGroup.linearised`.

        Parameters
        ----------
        values : Unknowns
            Where it is linearised.

        Returns
        -------
        e : ndarray, (m,)
            Observed - computed.
        J : ndarray, (m, d)
            d computed / d unknown.
        """
        of = {POSE: values.position, POINT: values.point}
        x = np.stack([of[name][row] for name, row in self.blocks])
        size = [6 if name == POSE else 3 for name, _ in self.blocks]
        columns = np.concatenate(([0], np.cumsum(size)[:-1]))[:, None] + np.arange(3)
        J = np.zeros((len(self.motions), sum(size)))
        J[:, columns.ravel()] = self.motions
        return self.motions @ (self.first_m - x).ravel(), J


@dataclass(frozen=True, eq=False)
class Rescaled:
    """An observation group with other weights.

    Parameters
    ----------
    group : ObservationGroup
        The group.
    factor : float
        Its variances are multiplied by it.
    """

    group: ObservationGroup
    factor: float

    @property
    def name(self) -> str:
        """Name of the variance component."""
        return self.group.name

    @property
    def keys(self) -> tuple[Key, ...]:
        """Blocks of unknowns that the group sees."""
        return self.group.keys

    @cached_property
    def weight(self) -> Array:
        """Inverse of the covariance, (m, m)."""
        return np.asarray(self.group.weight / self.factor)

    def linearised(self, values: Unknowns) -> tuple[Array, Array]:
        """Linearise the group; see `ObservationGroup.linearised`.

        Parameters
        ----------
        values : Unknowns
            Where it is linearised.

        Returns
        -------
        e : ndarray, (m,)
            Observed - computed.
        J : ndarray, (m, d)
            d computed / d unknown.
        """
        return self.group.linearised(values)


def control_points(control: GroundPoints) -> list[PointObservation]:
    """Return ground control as observation groups.

    Parameters
    ----------
    control : GroundPoints
        The points, each with its covariance.

    Returns
    -------
    list of PointObservation
        One group a point.
    """
    return [
        PointObservation(int(point), position, weight_of(cov, f"control point in row {point}"))
        for point, position, cov in zip(control.point, control.position_m, control.cov, strict=True)
    ]
