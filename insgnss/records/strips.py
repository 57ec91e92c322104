"""The covariance of all poses of a strip at once."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ..base.errors import InputError
from ._checked import Array, frozen


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
        rows = np.array(self.rows, dtype=np.int64)
        if rows.ndim != 1 or (np.diff(rows) <= 0).any():
            raise InputError("StripCovariance.rows: they must be one-dimensional and increase")
        rows.setflags(write=False)
        object.__setattr__(self, "rows", rows)
        frozen(self, "cov", (6 * rows.size, 6 * rows.size))

    @property
    def blocks(self) -> Array:
        """(m, m, 6, 6) covariance of image a with image b."""
        m = self.rows.size
        return np.asarray(self.cov.reshape(m, 6, m, 6).transpose(0, 2, 1, 3))
