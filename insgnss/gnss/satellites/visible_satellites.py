"""The satellites of each epoch as records: where they stand, and what weight their phases have."""

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

SMALLEST_DETERMINANT = 1e-6  # of the normal equations: below it PDOP is beyond some hundreds


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


def directions(azimuth: Array, elevation: Array) -> Array:
    """Return unit vectors (n, 3) north, east, down towards azimuths and elevations (n,) rad."""
    across = np.cos(elevation)
    ned = [across * np.cos(azimuth), across * np.sin(azimuth), -np.sin(elevation)]
    return np.stack(ned, axis=1)


def position_dilution(sky: Sky, epochs: int) -> Array:
    """Return the position dilution of precision (PDOP) of each epoch, of one receiver clock.

    It is the root of the trace of the position's cofactors of ranges of unit weight.

    Parameters
    ----------
    sky : Sky
        The satellites.
    epochs : int
        Number of epochs, n.

    Returns
    -------
    ndarray, shape (n,)
        PDOP, NaN where fewer than four satellites, or such in one plane, do not determine it.
    """
    sight = directions(sky.azimuth, sky.elevation)
    rows = np.column_stack([sight, np.ones(sky.elevation.size)])
    normal = np.zeros((epochs, 4, 4))
    np.add.at(normal, sky.epoch, rows[:, :, None] * rows[:, None, :])
    regular = np.linalg.det(normal) > SMALLEST_DETERMINANT
    dilution = np.full(epochs, np.nan)
    cofactors = np.linalg.inv(normal[regular])
    dilution[regular] = np.sqrt(np.trace(cofactors[:, :3, :3], axis1=1, axis2=2))
    return dilution
