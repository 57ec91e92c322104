"""Relative aerial control: offsets and turns between images of a strip, in place of their poses.

With the observed poses of (J.8) and (J.9), indices o, a pair of images i, j of a strip observes

    X_o,j - X_o,i = X_j - X_i + (C_j - C_i) l - (v_j - v_i) d + (t_j - t_i) r                (J.12)
    D_o = C_o,j C_o,i^T,    D = C'_j C'_i^T,    C' = exp([-omega d x]) C                     (J.13)

Shift and bore-sight are not in them: C_o = C' E^T gives C'_j E^T E C'_i^T, whatever E is. That is
so of the turn in the axes of the block; C_o,i^T C_o,j = E C_i^T C_j E^T, the turn in the axes of
the camera, keeps E. As errors of the poses, X_o(true) = X_o + dx and C_o(true) = exp([psi x]) C_o,

    D_o^T D = exp([rho x]),    rho = D_o^T psi_j - psi_i                                     (J.14)

at the truth. With exp([psi_j x]) and exp([psi_i x]) on the left of C'_j and C'_i it is
exp([rho x]) exp([D^T psi_j x]) exp([-psi_i x]), so that with the right Jacobian J_r of the rotation
group

    d rho = J_r^-1(rho) (D^T (psi'_j - omega_j dd) - psi'_i + omega_i dd),
    psi' = exp([-omega d x]) psi                                                             (J.15)

Written with corrections on the right of C, delta = C^T psi, these are the derivatives C_i and -C_i.

Pairs follow each other, and each of their images stands in two of them: errors that are independent
from image to image are correlated by -1/2 from pair to pair. Weights are

    smoothed      inverse of L P L^T, P the covariance of all poses of the strip, L (J.14)   (J.16)
    independent   P_ii + P_jj of each pair alone: paper 003, equation 5                      (J.17)
    gyro          position as (J.17), attitude q^2 dt + (b dt)^2, about the vertical
                  q^2 dt + (k b dt)^2: paper 003, equation 6                                 (J.18)

(J.16) of all pairs of a strip says the same as all of its poses with a shift and a bore-sight of
which nothing is known: the tests hold one against the other.
Where nothing else tells where a strip lies, a weak observation of one of its poses does (`Datum`).
"""

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Literal, NamedTuple

import numpy as np
from numpy.typing import NDArray

from ...base.errors import InputError
from ...geodesy.rotation import (
    inverse_right_jacobian,
    rotation_from_vector,
    vector_from_rotation,
)
from ...records.block import Array
from .aerial import COMMON_OF_TRAJECTORY, EXPOSURE_DELAY, StripControl, put
from .groups import PoseObservation, refuse_other_shapes
from .unknowns import POSE, Key, Unknowns

if TYPE_CHECKING:
    from scipy.sparse import csr_array

Rows = NDArray[np.int64]


class GyroNoise(NamedTuple):
    """Figures of equation 6 of paper 003.

    Parameters
    ----------
    noise : q, rad/sqrt(s).
    drift : b, rad/s.
    vertical : k, by which the drift about the vertical is larger.
    """

    noise: float
    drift: float
    vertical: float


class ObservedStrip(NamedTuple):
    """What is observed of a strip.

    Parameters
    ----------
    positions : "absolute" of each image, or "relative" of each pair.
    turns : whether those of the pairs are observed.
    pairs : (k, 2) images of each pair, rows of the strip.
    """

    positions: Literal["absolute", "relative"]
    turns: bool
    pairs: Rows

    def sizes(self, images: int) -> tuple[int, int]:
        """Return the numbers of observations of positions and of turns.

        Parameters
        ----------
        images : int
            Number of images of the strip.

        Returns
        -------
        tuple of int
            Both numbers.
        """
        count = 3 * len(self.pairs)
        return 3 * images if self.positions == "absolute" else count, count * self.turns


@dataclass(frozen=True, eq=False)
class RelativeAerialControl(StripControl):
    """Positions of a strip of n images, or offsets between them, and turns between them.

    Parameters
    ----------
    images : tuple of int
        (n,) rows of the images.
    position_m, C_mc : ndarray
        (n, 3) and (n, 3, 3) observed positions X_o, m, and attitudes C_o.
    weight : ndarray
        (m, m) inverse of the covariance of positions or offsets (m), then of turns (rad).
    time, velocity, rate : ndarray
        (n,) stamps, s, (n, 3) velocities, m/s, and (n, 3) rates, rad/s.
    parameters : mapping
        Row of the block that stands for each of `PARAMETERS`.
    name : str
        Name of the variance component.
    common : ndarray, optional
        (m, q) the observations by each of the common errors, where they are a parameter.
    observed : ObservedStrip
        What of the poses is observed, and the pairs.
    """

    observed: ObservedStrip = field(kw_only=True)

    def __post_init__(self) -> None:
        super().__post_init__()
        m = sum(self.observed.sizes(len(self.images)))
        refuse_other_shapes(self, {"weight": (m, m)})
        if (COMMON_OF_TRAJECTORY in self.parameters) != (self.common is not None):
            raise InputError(
                "RelativeAerialControl.common: given where it is a parameter, else not"
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
        first, second = self.observed.pairs.T
        columns, width = self.columns(values)
        e, J = self.positions(values)
        if self.observed.positions == "relative":
            e, J = e[second] - e[first], J[second] - J[first]
        if self.observed.turns:
            turn_residual, of_turns = self._turns(values, columns, width)
            e, J = np.vstack([e, turn_residual]), np.concatenate([J, of_turns])
        residual, jacobian = e.ravel(), J.reshape(-1, width)
        if self.common is not None:
            value = values.blocks[(COMMON_OF_TRAJECTORY, self.parameters[COMMON_OF_TRAJECTORY])]
            residual = residual + self.common @ value
            jacobian[:, columns[COMMON_OF_TRAJECTORY]] = -self.common
        return residual, jacobian

    def _turns(
        self, values: Unknowns, columns: Mapping[str, slice], width: int
    ) -> tuple[Array, Array]:
        """Return observed - computed of the turns of all pairs, and its Jacobian (J.15)."""
        i, j = self.observed.pairs.T
        C = values.C_mc[list(self.images)]
        turn = np.broadcast_to(np.eye(3), C.shape)
        if EXPOSURE_DELAY in self.parameters:
            delay = values.blocks[(EXPOSURE_DELAY, self.parameters[EXPOSURE_DELAY])][0]
            turn = rotation_from_vector(-self.rate * delay)
        moved = turn @ C
        D_t = moved[i] @ moved[j].swapaxes(1, 2)
        rho = vector_from_rotation(self.C_mc[i] @ self.C_mc[j].swapaxes(1, 2) @ D_t.swapaxes(1, 2))
        right = inverse_right_jacobian(rho)
        J = np.zeros((len(i), 3, width))
        put(J, 6 * i + 3, -right @ turn[i])
        put(J, 6 * j + 3, right @ D_t @ turn[j])
        if EXPOSURE_DELAY in self.parameters:
            by_d = self.rate[i] - np.einsum("kij,kj->ki", D_t, self.rate[j])
            J[:, :, columns[EXPOSURE_DELAY]] = right @ by_d[:, :, None]
        return -rho, J


def operator(C_mc: Array, observed: ObservedStrip) -> "csr_array":
    """Return L of (J.14): from the errors of the poses to those of what is observed.

    Parameters
    ----------
    C_mc : ndarray, (n, 3, 3)
        Observed attitudes of the strip.
    observed : ObservedStrip
        What is observed.

    Returns
    -------
    csr_array, (m, 6 n)
        Of positions (m) and psi (rad), image after image.
    """
    from scipy.sparse import csr_array

    n, (i, j) = len(C_mc), observed.pairs.T
    of_position = np.zeros((n, 3, 6 * n))
    put(of_position, 6 * np.arange(n), np.broadcast_to(np.eye(3), (n, 3, 3)))
    L = of_position if observed.positions == "absolute" else of_position[j] - of_position[i]
    if observed.turns:
        of_turn = np.zeros((i.size, 3, 6 * n))
        put(of_turn, 6 * j + 3, C_mc[i] @ C_mc[j].swapaxes(1, 2))
        put(of_turn, 6 * i + 3, np.broadcast_to(-np.eye(3), (i.size, 3, 3)))
        L = np.concatenate([L, of_turn])
    return csr_array(L.reshape(-1, 6 * n))


def relative_covariance(L: "csr_array", P: Array) -> Array:
    """Return the covariance of what is observed (J.16).

    Parameters
    ----------
    L : csr_array, (m, 6 n)
        Of `operator`.
    P : ndarray, (6 n, 6 n)
        Covariance of the poses of the strip.

    Returns
    -------
    ndarray, (m, m)
        Its covariance.
    """
    half = np.asarray(L @ P)
    return np.asarray(L @ half.T)


def as_printed(
    P: Array, C_mc: Array, observed: ObservedStrip, time: Array, gyro: GyroNoise | None
) -> Array:
    """Return the covariance of what is observed with pairs that are independent (J.17, J.18).

    Parameters
    ----------
    P : ndarray, (6 n, 6 n)
        Covariance of the poses of the strip; what is absolute keeps all of its part.
    C_mc : ndarray, (n, 3, 3)
        Observed attitudes of the strip.
    observed : ObservedStrip
        What is observed.
    time : ndarray, (n,)
        Stamps, s.
    gyro : GyroNoise, optional
        For (J.18); None: (J.17).

    Returns
    -------
    ndarray, (m, m)
        The covariance.
    """
    from scipy.linalg import block_diag

    n = len(C_mc)
    m, _ = observed.sizes(n)
    diag = block_diag(*P.reshape(n, 6, n, 6)[np.arange(n), :, np.arange(n)])
    L = operator(C_mc, observed)
    out, alone = relative_covariance(L, P), relative_covariance(L, diag)
    out[:m, m:] = out[m:, :m] = 0.0
    relative = [slice(m, None)] + [slice(0, m)] * (observed.positions == "relative")
    for rows in relative:
        pair = np.arange(len(alone[rows, rows])) // 3
        out[rows, rows] = alone[rows, rows] * (pair[:, None] == pair)
    if gyro is not None and observed.turns:
        i, j = observed.pairs.T
        dt = (time[j] - time[i])[:, None]
        drift = gyro.drift * np.array([1.0, 1.0, gyro.vertical])
        out[m:, m:] = np.diag((gyro.noise**2 * dt + (drift * dt) ** 2).ravel())
    return out


@dataclass(frozen=True, eq=False)
class Datum:
    """A weak observation of the pose of an image, or of its position or attitude alone.

    It keeps a strip determined of which relative control says nothing of where it lies, or how it
    is turned; it says next to nothing where anything else does.

    Parameters
    ----------
    image : int
        Row of the image.
    position_m : ndarray, (3,)
        Position, m.
    C_mc : ndarray, (3, 3)
        Attitude.
    sigma : tuple of float
        Standard deviations of position, m, and of attitude, rad; infinite of what is not observed.
    held : int
        How many images relative control ties to this one, itself among them.
    name : str
        Name of the variance component.
    """

    image: int
    position_m: Array
    C_mc: Array
    sigma: tuple[float, float]
    held: int = 1
    name: str = "weak datum"

    @property
    def keys(self) -> tuple[Key, ...]:
        """The pose."""
        return ((POSE, self.image),)

    @property
    def _rows(self) -> Rows:
        return np.flatnonzero(np.isfinite(np.repeat(self.sigma, 3)))

    @property
    def weight(self) -> Array:
        """Inverse of the covariance, (6, 6), or (3, 3) of one of both."""
        return np.diag(np.repeat(self.sigma, 3)[self._rows] ** -2.0)

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
        J : ndarray, (m, 6)
            d computed / d unknown.
        """
        pose = PoseObservation(self.image, self.position_m, self.C_mc, np.eye(6))
        e, J = pose.linearised(values)
        return e[self._rows], J[self._rows]
