r"""How camera, IMU and antenna are mounted: lever arms, bore-sight B and nominal turn T.

Body axes b are the IMU's, turned to forward-right-down; b' are the same directions as the camera
realises them; c is the camera (x image right, y image down, z viewing direction). With B = B_b^b'
and T = T_b'^c (equation 1 of paper 000)

    C_cb = T B                      body to camera                                             (M.1)

Vectors are measured from the camera's projection centre in its axes (Table 1 of paper 000), antenna
a_c and IMU b_c. From the IMU, in body axes,

    r_ba_b = C_cb^T (a_c - b_c)     to the antenna phase centre                                (M.2)
    r_bc_b = C_cb^T (-b_c)          to the projection centre                                   (M.3)

Bore-sight in three angle sets, degrees, each turned into its matrix at once and never copied angle
by angle:

    opk            omega phi kappa   B = Rx(omega) Ry(phi) Rz(kappa)                           (M.4)
    rpy            roll pitch yaw    B = (Rz(yaw) Ry(pitch) Rx(roll))^T, of b' in b            (M.5)
    metashape_ypr  yaw pitch roll    B = G^T Rz(-yaw) Rx(pitch) Ry(roll) G                     (M.6)

(M.6), with G = diag(1,-1,-1) T, is the GPS/INS offset of Metashape: the attitude of the reference
body in the camera's right-up-back axes, to which G takes the body. The values printed in paper 000,
[-0.513, 0.657, 0.574], are the numbers of (M.4) carried over; the offset that means the same
rotation as its Table 2 is [-0.5130, 0.6621, 0.5681] (data_specs/metashape.md).
"""

from collections.abc import Callable
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import ArrayLike

from ...base.errors import InputError
from ...geodesy.rotation import (
    CV_RUB,
    nearest_rotation,
    rotation_from_opk,
    rotation_from_rpy,
    rotation_from_ypr,
    ypr_from_rotation,
)
from .. import Array
from .._checked import float_array

ROTATION_TOLERANCE = 1e-4
"""Greatest entry by which a printed matrix may differ from a rotation: four decimals, as tables are
printed.
"""

ANTENNA_SIGMA_M = 0.005  # component of a lever arm (m): what a caliper measures
# the same downwards, where nobody states it: a caliper reaches the antenna's reference point, 30 to
# 60 mm above which drones' antennas have their phase centre
UNSTATED_PHASE_CENTRE_SIGMA_M = 0.02
MAX_LEVER_M = 100.0  # lever arm (m): longer ones are in another unit
LONGEST_DELAY_S = 10.0  # of a camera (s): a longer one is in another unit

PAPER_CAMERA_FROM_BODY = ((-1.0, 0.0, 0.0), (0.0, -1.0, 0.0), (0.0, 0.0, 1.0))
"""T of paper 000: half a turn about z; the image's right is backward, its down is left."""


def antenna_sigmas(stated_m: float | None) -> tuple[float, float, float]:
    """Return the standard deviations of a lever arm in body axes, m, stated (None: not) or usual.

    Parameters
    ----------
    stated_m : float or None
        That of each component, m.

    Returns
    -------
    tuple of float
        Forward, right, down, m.
    """
    if stated_m is None:
        return (ANTENNA_SIGMA_M, ANTENNA_SIGMA_M, UNSTATED_PHASE_CENTRE_SIGMA_M)
    return (stated_m,) * 3


def _opk(angles: Array, T: Array) -> Array:
    return rotation_from_opk(angles)  # (M.4)


def _rpy(angles: Array, T: Array) -> Array:
    return rotation_from_rpy(angles).T  # (M.5)


def _metashape_ypr(angles: Array, T: Array) -> Array:
    G = CV_RUB @ T
    return G.T @ rotation_from_ypr(angles) @ G  # (M.6)


_ANGLE_SETS: dict[str, Callable[[Array, Array], Array]] = {
    "opk": _opk,
    "rpy": _rpy,
    "metashape_ypr": _metashape_ypr,
}

ANGLE_SETS = tuple(_ANGLE_SETS)
"""Names that `boresight_from_angles` knows."""


def boresight_from_angles(
    angle_set: str, angles_deg: ArrayLike, camera_from_body: ArrayLike = PAPER_CAMERA_FROM_BODY
) -> Array:
    """Return the bore-sight matrix B_b^b' of three angles.

    Parameters
    ----------
    angle_set : ``"opk"``, ``"rpy"`` or ``"metashape_ypr"``, (M.4) to (M.6).
    angles_deg : (3,) degrees, in the order of the set's letters.
    camera_from_body : (3, 3), T; only ``"metashape_ypr"`` depends on it.

    Returns
    -------
    (3, 3) rotation from the IMU's body axes to those that the camera realises.

    Raises
    ------
    InputError : unknown set, not three finite angles, or `camera_from_body` is no rotation.
    """
    if angle_set not in _ANGLE_SETS:
        raise InputError.of_value(
            "boresight", f"angle set {angle_set!r} is unknown; use one of {', '.join(ANGLE_SETS)}"
        )
    angles = float_array("boresight", angles_deg)
    if angles.shape != (3,) or not np.isfinite(angles).all():
        raise InputError.of_value(
            "boresight", f"{angles_deg!r} are not three finite angles in degrees"
        )
    return _ANGLE_SETS[angle_set](
        np.deg2rad(angles), _as_rotation("camera_from_body", camera_from_body)
    )


def metashape_offset(
    antenna_m: Array | None, boresight: Array | None, camera_from_body: ArrayLike | None = None
) -> tuple[Array | None, Array | None]:
    """Return the GPS/INS offset of Metashape that means the same mounting.

    It belongs to references that are antenna positions and attitudes of the nominal camera (before
    the bore-sight); beside projection centres and attitudes with the bore-sight it is zero.

    Parameters
    ----------
    antenna_m : ndarray, (3,), or None
        Camera to antenna, camera axes, m.
    boresight : ndarray, (3, 3), or None
        B.
    camera_from_body : array-like, (3, 3), optional
        T; by default that of paper 000.

    Returns
    -------
    location : ndarray, (3,), or None
        Camera to antenna, x right, y up, z backward, m.
    angles : ndarray, (3,), or None
        Yaw, pitch, roll, rad, that `boresight_from_angles` turns back by (M.6).
    """
    location = None if antenna_m is None else CV_RUB.T @ np.asarray(antenna_m)
    if boresight is None:
        return location, None
    T = PAPER_CAMERA_FROM_BODY if camera_from_body is None else camera_from_body
    G = CV_RUB @ _as_rotation("camera_from_body", T)
    return location, ypr_from_rotation(G @ np.asarray(boresight) @ G.T)


@dataclass(frozen=True, eq=False)
class Mounting:
    """Lever arms and rotations between camera, IMU and antenna.

    The matrices are re-orthonormalised. `Mounting.from_body` takes lever arms from the IMU in body
    axes instead.

    Parameters
    ----------
    antenna_m : (3,) from the camera's projection centre to the antenna's phase centre, camera axes,
        m.
    imu_m : (3,) from the camera's projection centre to the IMU, camera axes, m.
    camera_from_body : (3, 3) T_b'^c, nominal body axes to camera (x image right, y image down, z
        viewing direction).
    boresight : (3, 3) B_b^b', the IMU's body axes to those that the camera realises.
    antenna_sigma_m : standard deviation of each component of the lever arm from the IMU to the
        antenna, m; zero where it is exact; None as `antenna_sigmas_b` says.

    Raises
    ------
    InputError : a vector is not three finite numbers, a matrix is farther than 1e-4 from a
        rotation, or the standard deviation is not between 0 and 10 m.

    """

    antenna_m: Array = field(default_factory=lambda: np.zeros(3))
    imu_m: Array = field(default_factory=lambda: np.zeros(3))
    camera_from_body: Array = field(default_factory=lambda: np.array(PAPER_CAMERA_FROM_BODY))
    boresight: Array = field(default_factory=lambda: np.eye(3))
    antenna_sigma_m: float | None = None

    def __post_init__(self) -> None:
        if self.antenna_sigma_m is not None and not 0.0 <= self.antenna_sigma_m <= 10.0:
            raise InputError.of_value(
                "antenna_sigma_m", f"{self.antenna_sigma_m!r} m; it must be between 0 and 10 m"
            )
        for name in ("antenna_m", "imu_m"):
            self._freeze(name, _as_vector(name, getattr(self, name)))
        for name in ("camera_from_body", "boresight"):
            self._freeze(name, _as_rotation(name, getattr(self, name)))

    @classmethod
    def from_body(
        cls,
        antenna_lever_b: ArrayLike,
        camera_lever_b: ArrayLike = (0.0, 0.0, 0.0),
        camera_from_body: ArrayLike = PAPER_CAMERA_FROM_BODY,
        boresight: ArrayLike = ((1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0)),
        antenna_sigma_m: float | None = None,
    ) -> "Mounting":
        """Return the mounting of lever arms that start at the IMU and stand in body axes.

        Parameters
        ----------
        antenna_lever_b : (3,) IMU to the antenna's phase centre, forward right down, m.
        camera_lever_b : (3,) IMU to the camera's projection centre, forward right down, m.
        camera_from_body, boresight : (3, 3) as in `Mounting`.
        antenna_sigma_m : as in `Mounting`.

        Returns
        -------
        The mounting.

        Raises
        ------
        InputError : as `Mounting`.

        Examples
        --------
        >>> import insgnss
        >>> mounting = insgnss.Mounting.from_body([0.1, 0.0, -1.2])  # an antenna on the roof
        >>> mounting.antenna_lever_b.tolist()
        [0.1, 0.0, -1.2]
        """
        T = _as_rotation("camera_from_body", camera_from_body)
        B = _as_rotation("boresight", boresight)
        imu_m = T @ B @ -_as_vector("camera_lever_b", camera_lever_b)
        antenna_m = T @ B @ _as_vector("antenna_lever_b", antenna_lever_b) + imu_m
        return cls(antenna_m, imu_m, T, B, antenna_sigma_m)

    def _freeze(self, name: str, value: Array) -> None:
        value.flags.writeable = False
        object.__setattr__(self, name, value)

    @property
    def C_cb(self) -> Array:
        """(3, 3), body to camera (M.1)."""
        return self.camera_from_body @ self.boresight

    @property
    def antenna_lever_b(self) -> Array:
        """(3,) m, from the IMU to the antenna phase centre, in body axes (M.2)."""
        return self.C_cb.T @ (self.antenna_m - self.imu_m)

    @property
    def antenna_sigmas_b(self) -> tuple[float, float, float]:
        """(3,) m, standard deviations of `antenna_lever_b`, stated or usual, in body axes."""
        return antenna_sigmas(self.antenna_sigma_m)

    @property
    def camera_lever_b(self) -> Array:
        """(3,) m, from the IMU to the projection centre, in body axes (M.3)."""
        return self.C_cb.T @ -self.imu_m


def _as_vector(name: str, value: ArrayLike) -> Array:
    """Copy of `value` as (3,) finite numbers, or InputError."""
    v = float_array(name, value).copy()
    if v.shape != (3,) or not np.isfinite(v).all():
        raise InputError.of_value(name, f"{v.tolist()} are not three finite numbers in m")
    return v


def _as_rotation(name: str, value: ArrayLike) -> Array:
    """Return the rotation nearest to `value`; InputError where rounding does not explain it."""
    M = float_array(name, value).copy()
    if M.shape != (3, 3) or not np.isfinite(M).all():
        raise InputError.of_value(name, "not a 3x3 matrix of finite numbers")
    determinant = float(np.linalg.det(M))
    if determinant < 0:
        raise InputError.of_value(
            name,
            f"no rotation, its determinant is {determinant:.3f}; a row or column has the wrong "
            "sign",
        )
    C = nearest_rotation(M)
    deviation = float(np.abs(M - C).max())
    if deviation > ROTATION_TOLERANCE:
        raise InputError.of_value(
            name,
            f"no rotation matrix, an entry differs by {deviation:.2g} from the nearest one (limit"
            f" {ROTATION_TOLERANCE:g}); check the digits",
        )
    return C
