"""Kinematic ground control: a target on a vehicle that each image sees where it is just then.

The target has moved from image to image, so that it is an object point of its own in each, K. Its
places follow from the trajectory of the vehicle, and one group has all of them with one covariance,
as errors of a trajectory last for minutes. With the attitude C of the vehicle (forward, right, down
to the axes of the block) and the velocity v of the target in the axes of the block, the trajectory
gives at the stamp of the exposure

    X_o = K - C a - v (d - b) + s                                                            (J.21)

    X_o  place of the target by trajectory and lever arm as they are stated
    a    "lever arm of the target": what is left of it, in the axes of the vehicle
    d    "time offset" of (J.8): the image was exposed at its stamp + d
    b    "delay of the vehicle's clock": where the trajectory puts the vehicle at t, it was at t + b
    s    "shift of the vehicle": by how much its positions lie off, as by those of another base

Delays move the target along v: of b, and of what a vehicle turns within b, the second order is
neglected, 0.1 mm for 10 ms at 2 m/s^2; a clock that is off by a second is found and not used.

The diameter of a level disc that is parallel to the image has all of its points at the same depth
q_3 of (J.1). Collinearity takes it to a length that no tilt of the camera shortens, wherever the
disc lies on the format,

    s = f (L + dL) / q_3,    q_3 = c_3 . (K - X_0)                                           (J.22)
    ds = s (df / f + dL / (L + dL) - (c_3 . (dK - dX_0) + psi . (c_3 x (K - X_0))) / q_3)    (J.23)

with c_3 the third column of C_mc and dL, "size of the target", what is left of L. In an image that
is tilted by tau it is the larger axis of the disc's ellipse where the target is nearer to the
middle than f tan(tau) / 2; farther out the other one may be longer, by 2 % at 10 deg and f / 5.
Who measures it takes the distortion out, with the slope of (J.4) there; affinity b_1, b_2 (1e-4) is
neglected.
"""

from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from ...base.errors import InputError
from ...records.block import INTERIOR, Array
from .aerial import EXPOSURE_DELAY
from .groups import refuse_other_parameters, refuse_other_shapes
from .unknowns import CAMERA, POINT, POSE, Key, Unknowns, keys_of_parameters

TARGET_ARM, VEHICLE_CLOCK = "lever arm of the target", "delay of the vehicle's clock"
VEHICLE_SHIFT, SIZE = "shift of the vehicle", "size of the target"
OF_VEHICLE = (TARGET_ARM, VEHICLE_CLOCK, VEHICLE_SHIFT, EXPOSURE_DELAY)
KINEMATIC_CONTROL, TARGET_SIZES = "kinematic ground control", "target sizes"


@dataclass(frozen=True, eq=False)
class KinematicControl:
    """Places of a moving target at n exposures (J.21).

    Parameters
    ----------
    points : tuple of int
        (n,) rows of the object points, one an exposure.
    position_m : ndarray, (n, 3)
        X_o in the axes of the block, m.
    weight : ndarray, (3 n, 3 n)
        Inverse of the covariance of all positions, exposure after exposure, 1/m^2.
    velocity : ndarray, (n, 3)
        Velocity of the target in the axes of the block, m/s.
    C_mv : ndarray, (n, 3, 3)
        Attitude of the vehicle, forward right down to the axes of the block.
    parameters : mapping
        Row of the block that stands for each of `OF_VEHICLE`; those that are missing are zero.
    name : str
        Name of the variance component.

    Raises
    ------
    InputError
        Shapes that differ, or a parameter that is none.
    """

    points: tuple[int, ...]
    position_m: Array
    weight: Array
    velocity: Array
    C_mv: Array
    parameters: Mapping[str, int] = field(default_factory=dict)
    name: str = KINEMATIC_CONTROL

    def __post_init__(self) -> None:
        n = len(self.points)
        shapes: dict[str, tuple[int, ...]] = {"position_m": (n, 3), "weight": (3 * n, 3 * n)}
        refuse_other_shapes(self, shapes | {"velocity": (n, 3), "C_mv": (n, 3, 3)})
        refuse_other_parameters(self, self.parameters, OF_VEHICLE)

    @property
    def keys(self) -> tuple[Key, ...]:
        """The object points, then parameters that are unknowns, in the order of `OF_VEHICLE`."""
        points = tuple((POINT, p) for p in self.points)
        return points + keys_of_parameters(self.parameters, OF_VEHICLE)

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
        n = len(self.points)
        computed = values.point[list(self.points)].copy()
        of: list[Array] = []
        for key in keys_of_parameters(self.parameters, OF_VEHICLE):
            derivative = self._by(key[0])
            computed += derivative @ values.blocks[key]
            of.append(derivative.reshape(3 * n, -1))
        e = self.position_m - computed
        return e.ravel(), np.hstack([np.eye(3 * n), *of])

    def _by(self, name: str) -> Array:
        """Return the derivative of (J.21) by a parameter, (n, 3, d); it is linear in all."""
        if name == TARGET_ARM:
            return -self.C_mv
        if name == VEHICLE_SHIFT:
            return np.tile(np.eye(3), (len(self.points), 1, 1))
        return self.velocity[:, :, None] * (1.0 if name == VEHICLE_CLOCK else -1.0)


@dataclass(frozen=True, eq=False)
class TargetSize:
    """Apparent size of a target of known size in an image (J.22).

    Parameters
    ----------
    image, camera, point : int
        Rows of the image, of its camera and of the object point.
    size_px : float
        Length of the diameter that is parallel to the image, without distortion, pixels.
    sigma_px : float
        Its standard deviation, pixels.
    size_m : float
        L, m.
    scaled : bool
        Whether what is left of L is an unknown, ("size of the target", 0).
    name : str
        Name of the variance component.

    Raises
    ------
    InputError
        A length that is not positive.
    """

    image: int
    camera: int
    point: int
    size_px: float
    sigma_px: float
    size_m: float
    scaled: bool = False
    name: str = TARGET_SIZES

    def __post_init__(self) -> None:
        for name in ("size_px", "sigma_px", "size_m"):
            if not getattr(self, name) > 0.0:
                raise InputError(f"TargetSize.{name} {getattr(self, name):g}; it must be positive")

    @property
    def keys(self) -> tuple[Key, ...]:
        """The pose, the camera, the object point, and the size where it is an unknown."""
        keys: tuple[Key, ...] = ((POSE, self.image), (CAMERA, self.camera), (POINT, self.point))
        return (*keys, (SIZE, 0)) if self.scaled else keys

    @property
    def weight(self) -> Array:
        """Inverse of the variance, (1, 1)."""
        return np.array([[1.0 / self.sigma_px**2]])

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
        axis = values.C_mc[self.image][:, 2]
        from_camera = values.point[self.point] - values.position[self.image]
        f = float(values.interior[self.camera, INTERIOR.index("f")])
        size = self.size_m + (float(values.blocks[(SIZE, 0)][0]) if self.scaled else 0.0)
        depth = float(axis @ from_camera)
        s = f * size / depth
        J = np.zeros((1, 6 + len(INTERIOR) + 3 + int(self.scaled)))
        J[0, :3] = s / depth * axis
        J[0, 3:6] = -s / depth * np.cross(axis, from_camera)
        J[0, 6 + INTERIOR.index("f")] = s / f
        J[0, 6 + len(INTERIOR) : 9 + len(INTERIOR)] = -s / depth * axis
        if self.scaled:
            J[0, -1] = s / size
        return np.array([self.size_px - s]), J


def gauss_markov(time: Array, share: float, duration_s: float) -> NDArray[np.float64]:
    """Return the correlations of errors of which a share lasts and the rest is white.

    Parameters
    ----------
    time : ndarray, (n,)
        Instants, s.
    share : float
        Of the variance, that of a first-order Gauss-Markov process.
    duration_s : float
        Its correlation time, s.

    Returns
    -------
    ndarray, (n, n)
        share exp(-|t_i - t_j| / duration) + (1 - share) of i = j.
    """
    gap = np.abs(np.subtract.outer(time, time))
    return np.asarray(share * np.exp(-gap / duration_s) + (1.0 - share) * np.eye(time.size))
