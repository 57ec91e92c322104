"""Relative control: how far neighbouring images of a flight line are apart, in position and
attitude, and how well that is known.
"""

from dataclasses import dataclass, field
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from ._checked import Array, freeze

Form = Literal["mapping", "camera"]
RELATIVE_FORMS: tuple[Form, ...] = ("mapping", "camera")
# s, between exposures of one pair at most: paper 003, 2.3, beyond it equation 6 does not hold
GAP_S = 10.0


@dataclass(frozen=True, eq=False)
class RelativeControl:
    """Relative pose of k pairs of neighbouring images i, j of the same flight line.

    Its covariances (k, 6, 6) of (offset, psi), m and rad, stand side by side by three weightings,
    in the axes of the form, with rotation(true) = exp([psi x]) rotation.

    Parameters
    ----------
    form : "mapping": offset X_j - X_i and rotation C_fc(j) C_fc(i)^T, both in the frame's axes,
        free of the bore-sight; "camera": offset C_fc(i)^T (X_j - X_i) and rotation C_fc(i)^T
        C_fc(j), the pose of camera j in that of camera i.
    images : names of all images of the orientation.
    time : (n,) s, of all of them.
    gps_week : of `time`.
    i, j : (k,) rows of the images of each pair.
    line : (k,) number of the flight line, from 1.
    offset : (k, 3) m.
    rotation : (k, 3, 3).
    smoothed : (k, 6, 6) with the cross-covariance of both images.
    independent : (k, 6, 6) as if both were independent (paper 003, equation 5).
    gyro : (k, 6, 6) position as `independent`, attitude by the gyroscopes (paper 003, equation 6).
    gyro_noise : rad/sqrt(s).
    gyro_drift : rad/s.
    frame : for people, of the coordinates.
    boresight : (3, 3) that was applied.
    history : what was done, sentence by sentence.

    Raises
    ------
    InputError : a shape is wrong or a value is not finite.
    """

    form: Form
    images: tuple[str, ...]
    time: Array
    gps_week: int
    i: NDArray[np.int64]
    j: NDArray[np.int64]
    line: NDArray[np.int64]
    offset: Array
    rotation: Array
    smoothed: Array
    independent: Array
    gyro: Array
    gyro_noise: float
    gyro_drift: float
    frame: str
    boresight: Array
    history: tuple[str, ...] = field(default_factory=tuple)

    def __post_init__(self) -> None:
        object.__setattr__(self, "images", tuple(self.images))
        k = self.i.size
        freeze(self, {"time": (len(self.images),), "offset": (k, 3), "rotation": (k, 3, 3)})
        freeze(self, {"boresight": (3, 3)})
        freeze(self, dict.fromkeys(("smoothed", "independent", "gyro"), (k, 6, 6)))

    @property
    def dt(self) -> Array:
        """(k,) s between the exposures of each pair."""
        return self.time[self.j] - self.time[self.i]

    @property
    def names(self) -> list[tuple[str, str]]:
        """Names of the images of each pair."""
        return [(self.images[a], self.images[b]) for a, b in zip(self.i, self.j, strict=True)]
