"""The satellites of each epoch as records: where they stand, and what weight their phases have."""

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Sky:
    """Satellites of each of n epochs, m rows.

    Parameters
    ----------
    epoch : ndarray of int, shape (m,)
        Index of the epoch.
    azimuth, elevation : ndarray, shape (m,)
        rad.
    system : ndarray of int, shape (m,)
        Number from 0.
    weight : ndarray, shape (m,)
        Relative: the number of the satellite's bands, of GLONASS less.
    row : ndarray of int, shape (m,)
        Row of the rover's observations, empty where there are none.
    """

    epoch: NDArray[np.int64]
    azimuth: Array
    elevation: Array
    system: NDArray[np.int64]
    weight: Array
    row: NDArray[np.int64] = field(default_factory=lambda: np.empty(0, dtype=np.int64))
