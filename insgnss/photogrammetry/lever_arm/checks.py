"""What the calibrations of a lever arm ask of their observations, and of their residuals."""

import numpy as np

from ...base.errors import DataError
from ...geodesy.rotation import is_rotation
from ...records import Array

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


def refuse_no_rotation(C: Array, name: str, row: str) -> None:
    """Refuse matrices that are no rotations.

    Parameters
    ----------
    C : ndarray, (n, 3, 3)
        The matrices.
    name, row : str
        What the field and each of its rows are called.

    Raises
    ------
    DataError
        With the first of them.
    """
    for k, matrix in enumerate(C, 1):
        if not is_rotation(matrix, 1e-4):
            raise DataError(
                f"{row} {k}: {name} is no rotation (mirrored axes, or rounded to fewer than five"
                " digits)"
            )


def factor_limit(redundancy: int) -> float:
    """Return what chance allows of a variance factor; NaN without redundancy."""
    from scipy.stats import chi2

    if not redundancy:
        return float("nan")
    return float(chi2.ppf(1.0 - SIGNIFICANCE, redundancy) / redundancy)
