"""Numbers that were written with few digits: the decimal step of which all are multiples."""

import numpy as np
from numpy.typing import NDArray


def decimal_step(
    values: NDArray[np.float64], largest: float, smallest: float, exact: float
) -> float:
    """Return the largest power of ten of which all values are multiples; 0 where there is none.

    Parameters
    ----------
    values : ndarray, shape (n,)
        One number alone shows no step.
    largest, smallest : float
        Between which it is looked for.
    exact : float
        How far off its multiples values may be.
    """
    values = np.unique(values)
    if values.size < 2:
        return 0.0
    first, last = (int(np.floor(np.log10(limit))) for limit in (largest, smallest))
    for power in range(first, last - 1, -1):
        step = 10.0**power
        if np.abs(values - step * np.rint(values / step)).max() < exact:
            return step
    return 0.0
