"""What the calibrations of a lever arm have in common: observations, result and limits."""

from dataclasses import dataclass, replace

import numpy as np

from ...base.errors import DataError
from ...base.quantiles import chi_square_quantile
from ...geodesy.conventions import Change
from ...geodesy.rotation import is_rotation
from ...records import Array
from ...report.notebook import Shown

RULER_M = 0.05  # standard error of a lever arm measured on the aircraft by hand
# of a lever arm on an aircraft that maps: more are positions of other images or setups
LONGEST_LEVER_ARM_M = 5.0
SIGNIFICANCE = 0.01  # of global tests, and of an outlier test over all setups
MOST_ITERATIONS = 30  # of Gauss and Newton (chosen): from first values in closed form a few do


def refuse_other_shapes(record: object, **shapes: tuple[int, ...]) -> None:
    """Refuse fields of a record that are of other shapes, or not finite.

    Parameters
    ----------
    record : object
        The record.
    **shapes : tuple of int
        Shape of each field.

    Raises
    ------
    DataError
        With the field and its shape.
    """
    for name, shape in shapes.items():
        value = np.asarray(getattr(record, name))
        if value.shape != shape or not np.isfinite(value).all():
            raise DataError(f"{name}: finite values of shape {shape} are needed")


@dataclass(frozen=True, eq=False)
class PosedAntennas:
    """Camera poses and antenna positions at the same instants, one row an image or setup.

    Parameters
    ----------
    position : ndarray, (n, 3)
        Projection centres in the frame r of the poses, in its unit.
    C_rc : ndarray, (n, 3, 3)
        Rotations of camera axes into r.
    pose_cov : ndarray, (n, 6, 6)
        Covariance of position (unit of r) and attitude error psi (rad, axes of r).
    antenna_m : ndarray, (n, 3)
        Antenna positions, or tips of the pin in the antenna's place, in the mapping frame.
    antenna_cov : ndarray, (n, 3, 3)
        Their covariance, m^2.

    Raises
    ------
    DataError
        Shapes that differ, values that are not finite, or matrices that are no rotations.
    """

    position: Array
    C_rc: Array
    pose_cov: Array
    antenna_m: Array
    antenna_cov: Array

    def __post_init__(self) -> None:
        n = len(self.position)
        poses = {"position": (n, 3), "C_rc": (n, 3, 3), "pose_cov": (n, 6, 6)}
        refuse_other_shapes(self, **poses, antenna_m=(n, 3), antenna_cov=(n, 3, 3))
        for k, matrix in enumerate(self.C_rc, 1):
            if not is_rotation(matrix, 1e-4):
                raise DataError(
                    f"pose {k}: C_rc is no rotation (mirrored axes, or rounded to fewer than five"
                    " digits)"
                )

    def changed(self, change: Change, *names: str) -> "PosedAntennas":
        """Return them with a change of some fields, as a file that is read in another way."""
        return replace(self, **{name: change(getattr(self, name)) for name in names})


@dataclass(frozen=True, eq=False)
class LeverArm(Shown):
    """Lever arm from the projection centre to the antenna, in camera axes.

    Parameters
    ----------
    lever_arm_m : ndarray, (3,)
        The lever arm.
    cov : ndarray, (k, k)
        Covariance of the unknowns, the lever arm the last three of them, m^2; by the variance
        factor where residuals are above chance.
    variance_factor, factor_limit : float
        Of the residuals, NaN without redundancy, and what chance allows of it.
    """

    lever_arm_m: Array
    cov: Array
    variance_factor: float
    factor_limit: float

    @property
    def sigma_m(self) -> Array:
        """The standard errors (3,) of the lever arm, m."""
        return np.sqrt(np.diag(self.cov)[-3:])


def millimetres(values: Array, sign: str = "") -> str:
    """Return three lengths, m, in millimetres: "[+462.0, -1.0, -65.0]" with the sign "+"."""
    return "[" + ", ".join(f"{1e3 * v:{sign}.1f}" for v in values) + "]"


def factor_limit(redundancy: int) -> float:
    """Return what chance allows of a variance factor; NaN without redundancy."""
    if not redundancy:
        return float("nan")
    return chi_square_quantile(redundancy, SIGNIFICANCE) / redundancy
