"""The standard atmosphere: the height that belongs to an air pressure.

In the troposphere of the standard atmosphere temperature falls linearly from T0 at the rate L, and

    h = T0 / L [1 - (p / p0)^(R L / g0)]                                                       (A.1)

with p0 at h = 0 and the gas constant R of dry air. h is geopotential: at 2000 m the geometric
height is 0.6 m greater. The air of a day differs in p0, which shifts all heights, and in T0, which
scales them by the ratio of the temperatures.

ISO 2533:1975, equation 12 and tables 1 and 5.
"""

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ..base.units import STANDARD_GRAVITY

Array = NDArray[np.float64]

T0 = 288.15  # K, at sea level
P0 = 101325.0  # Pa, at sea level
LAPSE = 6.5e-3  # K/m
GAS_CONSTANT = 287.05287  # m^2/(s^2 K), of dry air
LOWEST_PA = 22632.1  # at 11 km, where the troposphere ends


def standard_height(pressure_pa: ArrayLike) -> Array:
    """Return the height of a pressure in the standard atmosphere (A.1).

    Parameters
    ----------
    pressure_pa : array_like, (...)
        Static pressure of the air, Pa, greater than `LOWEST_PA`.

    Returns
    -------
    ndarray, (...)
        Geopotential height above the level of 101325 Pa, m.
    """
    ratio = np.asarray(pressure_pa, dtype=np.float64) / P0
    return np.asarray(T0 / LAPSE * (1.0 - ratio ** (GAS_CONSTANT * LAPSE / STANDARD_GRAVITY)))
