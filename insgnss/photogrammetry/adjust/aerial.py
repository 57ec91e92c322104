"""Aerial control: poses that a trajectory gives, with the covariance of all of them at once.

The poses of n images, such as a strip, are one group with one weight matrix. What stands between
the trajectory and the camera are blocks of unknowns that any number of groups may share; each may
be left out. An image is exposed at its stamp + d; velocity v and rate omega are those of the camera
in the axes of the block:

    X_o = X + C l - v d + s + (t - t_m) r - A_X c                                             (J.8)
    C_o = exp([-A_psi c x]) exp([-omega d x]) C E^T                                           (J.9)

    X_o, C_o   observed position and attitude, that of a camera of nominal bore-sight
    l          "lever arm": from the projection centre to the point that is observed, in the axes of
               the camera; zero where the observed point is the projection centre, as in eo.json,
               and then what is left of an incorrect lever arm
    E          "bore-sight": camera to nominal camera, near the unit matrix where the bore-sight was
               applied, as in eo.json
    d          "time offset", s
    s, r       "shift" (m) and "drift" (m/s) of the strip; t_m is the mean of its stamps
    c          "common errors of the trajectory", of unit covariance, which groups share; A of each
               image makes position and psi of them. The weight is that of the rest

Errors of the trajectory are the usual ones, X_o(true) = X_o + A_X c + rest and C_o(true) =
exp([psi x]) C_o with psi = A_psi c + rest. With R = C_o E C^T exp([omega d x]), r = log R and J_r
the right Jacobian of the rotation group, the rest (its sign changed) is

    e(psi, beta, d, c) = r + A_psi c - J_r^-1(r) exp([-omega d x]) psi + J_r^-1(-r) C_o beta
                           + J_r^-1(r) omega dd + A_psi dc                                   (J.10)

where the corrections are those of C (psi on its left), E (beta on its left), d and c.
"""

from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from ...base.errors import InputError
from ...geodesy.rotation import (
    inverse_right_jacobian,
    rotation_from_vector,
    skew,
    vector_from_rotation,
)
from ...records import ExteriorOrientation
from ...records.block import Array
from .groups import (
    refuse_other_parameters,
    refuse_other_shapes,
)
from .unknowns import POSE, Key, Unknowns, keys_of_parameters, size_of

CAMERA_LEVER_ARM, BORESIGHT, EXPOSURE_DELAY = "lever arm", "bore-sight", "time offset"
SHIFT, LINE_DRIFT, COMMON_OF_TRAJECTORY = "shift", "drift", "common errors of the trajectory"
AERIAL_PARAMETERS = (
    CAMERA_LEVER_ARM,
    BORESIGHT,
    EXPOSURE_DELAY,
    SHIFT,
    LINE_DRIFT,
    COMMON_OF_TRAJECTORY,
)


@dataclass(frozen=True, eq=False)
class StripControl:
    """Poses of n images that a trajectory gives, of which a group observes some.

    Parameters
    ----------
    images : tuple of int
        (n,) rows of the images.
    position_m : ndarray, (n, 3)
        Observed positions X_o in the axes of the block, m.
    C_mc : ndarray, (n, 3, 3)
        Observed attitudes C_o.
    weight : ndarray, (m, m)
        Inverse of the covariance of positions (m) and rotations (rad) that are observed.
    time : ndarray, (n,)
        Stamps, s; only their differences count, for the drift.
    velocity, rate : ndarray, (n, 3)
        Velocity, m/s, and angular rate, rad/s, in the axes of the block, for the time offset.
    parameters : mapping
        Row of the block that stands for each of `AERIAL_PARAMETERS`; those that are missing are
        zero.
    name : str
        Name of the variance component.
    common : ndarray, optional
        A: what is observed by each of the common errors, where they are a parameter.

    Raises
    ------
    InputError
        Shapes that differ, or a parameter that is none.
    """

    images: tuple[int, ...]
    position_m: Array
    C_mc: Array
    weight: Array
    time: Array
    velocity: Array
    rate: Array
    parameters: Mapping[str, int] = field(default_factory=dict)
    name: str = "aerial control"
    common: Array | None = None

    def __post_init__(self) -> None:
        n = len(self.images)
        shapes = {"position_m": (n, 3), "C_mc": (n, 3, 3), "time": (n,)}
        refuse_other_shapes(self, shapes | {"velocity": (n, 3), "rate": (n, 3)})
        refuse_other_parameters(self, self.parameters, AERIAL_PARAMETERS)

    @property
    def keys(self) -> tuple[Key, ...]:
        """The poses, then the parameters that are unknowns, in the order of `AERIAL_PARAMETERS`."""
        poses = tuple((POSE, i) for i in self.images)
        return poses + keys_of_parameters(self.parameters, AERIAL_PARAMETERS)

    def columns(self, values: Unknowns) -> tuple[dict[str, slice], int]:
        """Return where the parameters stand in the Jacobian, and how wide it is.

        Parameters
        ----------
        values : Unknowns
            Has their values.

        Returns
        -------
        columns : dict of slice
            By parameter.
        width : int
            Number of columns.
        """
        columns, width = {}, 6 * len(self.images)
        for name, row in keys_of_parameters(self.parameters, AERIAL_PARAMETERS):
            columns[name] = slice(width, width + size_of(values.blocks[(name, row)]))
            width = columns[name].stop
        return columns, width

    def positions(self, values: Unknowns) -> tuple[Array, Array]:
        """Linearise the positions of the strip (J.8), without its common errors.

        Parameters
        ----------
        values : Unknowns
            Where they are linearised.

        Returns
        -------
        e : ndarray, (n, 3)
            Observed - computed, m.
        J : ndarray, (n, 3, d)
            d computed / d unknown.
        """
        n, images = len(self.images), list(self.images)
        since = (self.time - self.time.mean() if n else self.time)[:, None]
        C, v = values.C_mc[images], self.velocity
        value = {p: values.blocks[(p, row)] for p, row in self.parameters.items()}
        columns, width = self.columns(values)
        J = np.zeros((n, 3, width))
        computed = values.position[images]
        put(J, 6 * np.arange(n), np.broadcast_to(np.eye(3), (n, 3, 3)))
        if CAMERA_LEVER_ARM in value:
            arm = C @ value[CAMERA_LEVER_ARM]
            computed = computed + arm
            put(J, 6 * np.arange(n) + 3, -skew(arm))
            J[:, :, columns[CAMERA_LEVER_ARM]] = C
        if EXPOSURE_DELAY in value:
            computed = computed - v * value[EXPOSURE_DELAY][0]
            J[:, :, columns[EXPOSURE_DELAY]] = -v[:, :, None]
        if SHIFT in value:
            computed = computed + value[SHIFT]
            J[:, :, columns[SHIFT]] = np.eye(3)
        if LINE_DRIFT in value:
            computed = computed + since * value[LINE_DRIFT]
            J[:, :, columns[LINE_DRIFT]] = since[:, :, None] * np.eye(3)
        return self.position_m - computed, J


def put(J: Array, columns: NDArray[np.int64], blocks: Array) -> None:
    """Write a block into each row of (k, 3, u), from a column of its own on.

    Parameters
    ----------
    J : ndarray, (k, 3, u)
        Is written.
    columns : ndarray of int, (k,)
        First columns.
    blocks : ndarray, (k, 3, d)
        The blocks.
    """
    wide = columns[:, None] + np.arange(blocks.shape[2])
    J[np.arange(len(J))[:, None, None], np.arange(3)[:, None], wide[:, None]] = blocks


@dataclass(frozen=True, eq=False)
class AerialControl(StripControl):
    """Observed poses of n images (J.8, J.9), or positions alone.

    Parameters
    ----------
    images : tuple of int
        (n,) rows of the images.
    position_m, C_mc : ndarray
        (n, 3) and (n, 3, 3) observed positions X_o, m, and attitudes C_o.
    weight : ndarray
        (6 n, 6 n) inverse of the covariance of position (m) and psi (rad), image after image; of
        (3 n, 3 n) positions alone are observed.
    time, velocity, rate : ndarray
        (n,) stamps, s, (n, 3) velocities, m/s, and (n, 3) rates, rad/s.
    parameters : mapping
        Row of the block that stands for each of `AERIAL_PARAMETERS`.
    name : str
        Name of the variance component.
    common : ndarray, optional
        (n, 6, q) A: position (m) and psi (rad) by each of the common errors, where they are a
        parameter.
    """

    def __post_init__(self) -> None:
        super().__post_init__()
        n = len(self.images)
        if self.weight.shape not in ((3 * n, 3 * n), (6 * n, 6 * n)):
            raise InputError(
                f"AerialControl.weight: shape {self.weight.shape}, expected"
                f" {(6 * n, 6 * n)}, or {(3 * n, 3 * n)} of positions alone"
            )
        got = None if self.common is None else self.common.shape[:-1]
        if (COMMON_OF_TRAJECTORY in self.parameters) != (got is not None) or got not in (
            None,
            (n, 6),
        ):
            raise InputError(
                f"AerialControl.common: shape {got} + (q,), expected {(n, 6)} + (q,) where"
                f" {COMMON_OF_TRAJECTORY} are a parameter, else none"
            )

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
        columns, width = self.columns(values)
        e, J = self.positions(values)
        if self.weight.shape[0] > 3 * len(self.images):
            psi, of_attitudes = self._attitudes(values, columns, width)
            e, J = np.hstack([e, psi]), np.concatenate([J, of_attitudes], axis=1)
        if self.common is not None:
            A = self.common[:, : e.shape[1]]
            e += A @ values.blocks[(COMMON_OF_TRAJECTORY, self.parameters[COMMON_OF_TRAJECTORY])]
            J[:, :, columns[COMMON_OF_TRAJECTORY]] = -A
        return e.ravel(), J.reshape(e.size, width)

    def _attitudes(
        self, values: Unknowns, columns: Mapping[str, slice], width: int
    ) -> tuple[Array, Array]:
        """Return observed - computed of the attitudes (J.9), and its Jacobian (J.10)."""
        value = {p: values.blocks[(p, row)] for p, row in self.parameters.items()}
        C_o, turned = self.C_mc, values.C_mc[list(self.images)].swapaxes(1, 2)
        if EXPOSURE_DELAY in value:
            turn = rotation_from_vector(self.rate * value[EXPOSURE_DELAY][0])
            turned = turned @ turn
        E = value.get(BORESIGHT, np.eye(3))
        psi = vector_from_rotation(C_o @ E @ turned)
        right = inverse_right_jacobian(psi)
        J = np.zeros((len(psi), 3, width))
        if EXPOSURE_DELAY in value:
            put(J, 6 * np.arange(len(psi)) + 3, right @ turn.swapaxes(1, 2))
            J[:, :, columns[EXPOSURE_DELAY]] = -right @ self.rate[:, :, None]
        else:
            put(J, 6 * np.arange(len(psi)) + 3, right)
        if BORESIGHT in value:
            J[:, :, columns[BORESIGHT]] = -inverse_right_jacobian(-psi) @ C_o
        return psi, J


@dataclass(frozen=True, eq=False)
class ParameterObservation:
    """A value of a block that groups bring, such as of a measured lever arm.

    Parameters
    ----------
    key : tuple
        The block: a vector, or a rotation matrix.
    value : ndarray, (d,) or (3, 3)
        Its observed value.
    weight : ndarray, (d, d)
        Inverse of the covariance; of a rotation of psi (rad) on its left.
    name : str
        Name of the variance component.
    """

    key: Key
    value: Array
    weight: Array
    name: str = "mounting"

    @property
    def keys(self) -> tuple[Key, ...]:
        """The block."""
        return (self.key,)

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
        current = values.blocks[self.key]
        if self.value.ndim == 1:
            return self.value - current, np.eye(self.value.size)
        psi = vector_from_rotation(self.value @ current.T)
        return psi, inverse_right_jacobian(psi)


def chained_covariance(eo: ExteriorOrientation) -> Array:
    """Return the covariance of all poses of a strip, as far as neighbours tell it.

    eo.json has the covariance of each image and that with the next, P_i,i+1. Those of images
    farther apart follow where each image's error depends on earlier ones through that of the image
    before alone (a Markov chain): P_ik = P_ij P_jj^-1 P_jk. Six components of an error that biases
    and errors of the fixes move are none. Of a processed corridor (`ign6x1`, 15 min, lines of 49
    and 68 images) the sigma of the mean of a line comes out 0.32 to 0.38 times as large as it is
    for tilts, 0.73 to 1.38 for positions, 1.12 to 1.14 for heading (independent images: 0.15 to
    0.36). Take `eo_covariance.npz` where there is one
    (`insgnss.io.formats.orientation.eo_covariance`), this where there is none.

    Parameters
    ----------
    eo : ExteriorOrientation
        The images of the strip, neighbours in order.

    Returns
    -------
    ndarray, (6 n, 6 n)
        Covariance of position (m) and psi (rad), image after image.

    Raises
    ------
    InputError
        The covariance between neighbours is not known.
    """
    if eo.cross is None:
        raise InputError(
            "chained_covariance: the covariance between neighbours is not known (images were left"
            " out); take the whole strip of eo.json"
        )
    n = len(eo.images)
    P = np.zeros((n, n, 6, 6))
    for i in range(n):
        P[i, i] = eo.cov[i]
        for k in range(i + 1, n):
            P[i, k] = P[i, k - 1] @ np.linalg.solve(eo.cov[k - 1], eo.cross[k - 1])
            P[k, i] = P[i, k].T
    return P.transpose(0, 2, 1, 3).reshape(6 * n, 6 * n)
