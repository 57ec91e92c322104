"""The covariance of all poses of a strip at once, and what strips have in common."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ..base.errors import InputError
from ._checked import Array, freeze, freeze_field, frozen_integers


@dataclass(frozen=True, eq=False)
class StripCovariance:
    """The covariance of the errors of all images of a strip with each other.

    Parameters
    ----------
    rows : (m,) increasing rows of the images in their `ExteriorOrientation`.
    cov : (6 m, 6 m) covariance of position (m) and psi (rad), image after image, in tangent-plane
        axes as `ExteriorOrientation.cov`, whose blocks stand on its diagonal.

    Raises
    ------
    InputError : shapes that differ, or values that are not finite.
    """

    rows: NDArray[np.int64]
    cov: Array

    def __post_init__(self) -> None:
        rows = frozen_integers(self, "rows")
        if rows.ndim != 1 or (np.diff(rows) <= 0).any():
            raise InputError("StripCovariance.rows: they must be one-dimensional and increase")
        freeze_field(self, "cov", (6 * rows.size, 6 * rows.size))

    @property
    def blocks(self) -> Array:
        """(m, m, 6, 6) covariance of image a with image b."""
        m = self.rows.size
        return np.asarray(self.cov.reshape(m, 6, m, 6).transpose(0, 2, 1, 3))


@dataclass(frozen=True, eq=False)
class CommonErrors:
    """Errors of poses that all strips of a segment share.

    The error of image k is factor_k c + rest_k, with c of unit covariance, one of each segment.
    Rests of different strips are independent, or nearly so; of one strip they have the covariance
    of the strip less factor_j factor_k^T.

    Parameters
    ----------
    segment : (n,) number of the segment of each image, from 0.
    factor : (n, 6, q) position (m) and psi (rad) by each of the q errors, in the axes of
        `ExteriorOrientation.cov`; zero beyond the number of a segment's errors.
    lever_arm : (segments, 3, q) error of the antenna's lever arm from the IMU, m, in body axes, by
        each of the errors of a segment, zero where it is no state; None where it is not known.
    lever_arm_m : (segments, 3) what was estimated of it beyond the mounting's, body axes; None as
        before.

    Raises
    ------
    InputError : shapes that differ, or values that are not finite.
    """

    segment: NDArray[np.int64]
    factor: Array
    lever_arm: Array | None = None
    lever_arm_m: Array | None = None

    def __post_init__(self) -> None:
        segment = frozen_integers(self, "segment")
        if segment.ndim != 1 or (segment < 0).any() or np.ndim(self.factor) != 3:
            raise InputError(
                "CommonErrors: give each image a segment number from 0 and a factor of 6 x q values"
            )
        q = self.factor.shape[2]
        count = int(segment.max(initial=-1)) + 1
        freeze(self, {"factor": (segment.size, 6, q), "lever_arm": (count, 3, q)})
        freeze(self, {"lever_arm_m": (count, 3)})

    def rest(self, rows: NDArray[np.int64], cov: Array) -> Array:
        """Return the covariance of the rest of images of one segment.

        Parameters
        ----------
        rows : (m,) rows of the images.
        cov : (6 m, 6 m) covariance of their errors.

        Returns
        -------
        Array
            (6 m, 6 m).
        """
        A = self.factor[rows].reshape(6 * rows.size, -1)
        return np.asarray(cov - A @ A.T)
