"""The satellites of each epoch as records: where they stand, and what weight their phases have."""

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Sky:
    """Satellites of each of n epochs: rows (m,) with epoch, azimuth and elevation, rad, system, a
    number from 0, and relative weight (the number of its bands, of GLONASS less); row (m,) of the
    rover's observations, empty where there are none."""

    epoch: NDArray[np.int64]
    azimuth: Array
    elevation: Array
    system: NDArray[np.int64]
    weight: Array
    row: NDArray[np.int64] = field(default_factory=lambda: np.empty(0, dtype=np.int64))
