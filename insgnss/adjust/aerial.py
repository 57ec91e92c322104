"""Aerial control: poses that a trajectory gives, with the covariance of all of them at once.

The poses of n images, such as a strip, are one group with one weight matrix. What stands between
the trajectory and the camera are blocks of unknowns that any number of groups may share; each may
be left out. An image is exposed at its stamp + d; velocity v and rate omega are those of the camera
in the axes of the block:

    X_o = X + C l - v d + s + (t - t_m) r                                                     (J.8)
    C_o = exp([-omega d x]) C E^T                                                             (J.9)

    X_o, C_o   observed position and attitude, that of a camera of nominal bore-sight
    l          "lever arm": from the projection centre to the point that is observed, in the axes of
               the camera; zero where the observed point is the projection centre, as in eo.json,
               and then what is left of an incorrect lever arm
    E          "bore-sight": camera to nominal camera, near the unit matrix where the bore-sight was
               applied, as in eo.json
    d          "time offset", s
    s, r       "shift" (m) and "drift" (m/s) of the strip; t_m is the mean of its stamps

Errors of the trajectory are the usual ones, C_o(true) = exp([psi x]) C_o. With R = C_o E C^T
exp([omega d x]), e = log R and J_r the right Jacobian of the rotation group

    e(psi, beta, d) = log R - J_r^-1(e) exp([-omega d x]) psi + J_r^-1(-e) C_o beta
                            + J_r^-1(e) omega dd                                             (J.10)

where the corrections are those of C (psi on its left), E (beta on its left) and d.
"""

from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np

from ..base.errors import InputError
from ..geodesy.rotation import rotation_from_vector, skew, vector_from_rotation
from ..records import ExteriorOrientation
from ..records.block import Array
from .groups import inverse_right_jacobian
from .unknowns import POSE, Key, Unknowns

LEVER_ARM, BORESIGHT, TIME_OFFSET = "lever arm", "bore-sight", "time offset"
SHIFT, DRIFT = "shift", "drift"
PARAMETERS = (LEVER_ARM, BORESIGHT, TIME_OFFSET, SHIFT, DRIFT)


@dataclass(frozen=True, eq=False)
class AerialControl:
    """Observed poses of n images (A.1, A.2).

    Parameters
    ----------
    images : tuple of int
        (n,) rows of the images.
    position_m : ndarray, (n, 3)
        Observed positions X_o in the axes of the block, m.
    C_mc : ndarray, (n, 3, 3)
        Observed attitudes C_o.
    weight : ndarray, (6 n, 6 n) or (3 n, 3 n)
        Inverse of the covariance of position (m) and psi (rad), image after image; of (3 n, 3 n)
        positions alone are observed.
    time : ndarray, (n,)
        Stamps, s; only their differences count, for the drift.
    velocity, rate : ndarray, (n, 3)
        Velocity, m/s, and angular rate, rad/s, in the axes of the block, for the time offset.
    parameters : mapping
        Row of the block that stands for each of `PARAMETERS`; those that are missing are zero.
    name : str
        Name of the variance component.

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

    def __post_init__(self) -> None:
        n = len(self.images)
        shapes = {"position_m": (n, 3), "C_mc": (n, 3, 3), "time": (n,)}
        shapes |= {"velocity": (n, 3), "rate": (n, 3)}
        for name, shape in shapes.items():
            if (got := getattr(self, name).shape) != shape:
                raise InputError(f"AerialControl.{name}: shape {got}, expected {shape}")
        if self.weight.shape not in ((3 * n, 3 * n), (6 * n, 6 * n)):
            raise InputError(
                f"AerialControl.weight: shape {self.weight.shape}, expected"
                f" {(6 * n, 6 * n)}, or {(3 * n, 3 * n)} of positions alone"
            )
        if unknown := set(self.parameters) - set(PARAMETERS):
            raise InputError(
                f"AerialControl.parameters: {', '.join(sorted(unknown))} is none of"
                f" {', '.join(PARAMETERS)}"
            )

    @property
    def keys(self) -> tuple[Key, ...]:
        """The poses, then the parameters that are unknowns, in the order of `PARAMETERS`."""
        poses = tuple((POSE, i) for i in self.images)
        return poses + tuple((p, self.parameters[p]) for p in PARAMETERS if p in self.parameters)

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
        n = len(self.images)
        value = {p: values.blocks[(p, row)] for p, row in self.parameters.items()}
        first = dict.fromkeys(PARAMETERS, 6 * n)
        column = 6 * n
        for p in PARAMETERS:
            if p in value:
                first[p] = column
                column += 1 if p == TIME_OFFSET else 3
        offset = float(value[TIME_OFFSET][0]) if TIME_OFFSET in value else 0.0
        lever, E = value.get(LEVER_ARM, np.zeros(3)), value.get(BORESIGHT, np.eye(3))
        since = self.time - self.time.mean() if n else self.time
        J = np.zeros((n, 6, column))
        e = np.empty((n, 6))
        for k, i in enumerate(self.images):
            C, C_o, v, rate = values.C_mc[i], self.C_mc[k], self.velocity[k], self.rate[k]
            arm = C @ lever
            computed = values.position[i] + arm - v * offset
            computed = computed + value.get(SHIFT, 0.0) + since[k] * value.get(DRIFT, 0.0)
            turn = rotation_from_vector(rate * offset)
            psi = vector_from_rotation(C_o @ E @ C.T @ turn)
            e[k, :3], e[k, 3:] = self.position_m[k] - computed, psi
            right = inverse_right_jacobian(psi)
            pose = slice(6 * k, 6 * k + 6)
            J[k, :, pose] = np.block([[np.eye(3), -skew(arm)], [np.zeros((3, 3)), right @ turn.T]])
            blocks = {
                LEVER_ARM: np.vstack([C, np.zeros((3, 3))]),
                BORESIGHT: np.vstack([np.zeros((3, 3)), -inverse_right_jacobian(-psi) @ C_o]),
                TIME_OFFSET: np.concatenate([-v, -right @ rate])[:, None],
                SHIFT: np.eye(6, 3),
                DRIFT: since[k] * np.eye(6, 3),
            }
            for p in value:
                own = blocks[p]
                J[k, :, first[p] : first[p] + own.shape[1]] = own
        m = self.weight.shape[0] // n if n else 6
        return e[:, :m].ravel(), J[:, :m].reshape(n * m, column)


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
    (`insgnss.formats.orientation.eo_covariance`), this where there is none.

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
