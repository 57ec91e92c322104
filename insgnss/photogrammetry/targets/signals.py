"""Signals: what targets on the ground look like, as functions of their own plane."""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from ...base.errors import InputError
from ...records import Array


@dataclass(frozen=True)
class Signal:
    """A target in its plane; its centre is the ground point.

    Parameters
    ----------
    name : str
        What messages call it.
    radius_m : float
        Radius about the centre within which the signal is known, m.
    period_rad : float
        Turn after which it looks the same; 0 where any turn leaves it as it is.
    value : callable
        Grey value 0 (dark) to 1 (bright) of arrays of east and north, m.
    outline_m : float
        Radius of the outline that alone tells where its centre is, m; 0 where edges meet in it.
    """

    name: str
    radius_m: float
    period_rad: float
    value: Callable[[Array, Array], Array]
    outline_m: float = 0.0


def quadrants(size_m: float) -> Signal:
    """Return the quadrant pattern: the first and the third quadrant bright, the others dark.

    Parameters
    ----------
    size_m : float
        Side of the board, m.

    Returns
    -------
    Signal
        Known within the circle in the board.
    """
    half = 0.5 * _positive("side of the quadrant pattern", size_m)
    return Signal(
        "quadrants", half, np.pi, lambda e, n: np.asarray((e > 0.0) == (n > 0.0), dtype=np.float64)
    )


def disc(diameter_m: float, around: float = 1.6, bright: bool = True) -> Signal:
    """Return a disc on ground of another, even brightness.

    Parameters
    ----------
    diameter_m : float
        Its diameter, m.
    around : float
        Diameter of what is even about it, in units of its own.
    bright : bool
        Whether it is brighter than what is about it.

    Returns
    -------
    Signal
        The same in all azimuths.
    """
    half = 0.5 * _positive("diameter of the disc", diameter_m)
    if not around > 1.0:
        raise InputError(
            f"disc: uniform background of {around:g} diameters of the disc; it must be more than 1"
        )
    return Signal(
        "disc",
        half * around,
        0.0,
        lambda e, n: np.asarray((np.hypot(e, n) < half) == bright, dtype=np.float64),
        half,
    )


def cross(size_m: float, arm_m: float, bright: bool = True) -> Signal:
    """Return a cross of two bars on ground of another, even brightness.

    Parameters
    ----------
    size_m, arm_m : float
        Length and width of the bars, m.
    bright : bool
        Whether they are brighter than what is about them.

    Returns
    -------
    Signal
        Known within the circle through the ends of the bars.
    """
    half, arm = 0.5 * _positive("length of the bars", size_m), 0.5 * _positive("width", arm_m)
    if not arm < 0.5 * half:
        raise InputError(
            f"cross: bars {arm_m:g} m wide and {size_m:g} m long; at most half as wide"
        )

    def value(e: Array, n: Array) -> Array:
        on = np.minimum(np.abs(e), np.abs(n)) < arm
        return np.asarray(on == bright, dtype=np.float64)

    return Signal("cross", half, 0.5 * np.pi, value)


def picture(grey: ArrayLike, size_m: float) -> Signal:
    """Return a signal that is known by an image of it, north up and east right.

    Parameters
    ----------
    grey : array_like, (k, k)
        Grey values in any unit.
    size_m : float
        Side of what it shows, m.

    Returns
    -------
    Signal
        Known within the circle in the image.

    Raises
    ------
    InputError
        An image that is not square, smaller than 3 pixels, or of one grey value only.
    """
    a = np.asarray(grey, dtype=np.float64)
    half = 0.5 * _positive("side of the picture", size_m)
    if a.ndim != 2 or a.shape[0] != a.shape[1] or a.shape[0] < 3 or not np.isfinite(a).all():
        raise InputError(f"picture of a target: shape {a.shape}; a square of 3 pixels or more")
    if not np.ptp(a) > 0.0:
        raise InputError("picture of a target: all of one grey value; there is nothing to find")
    a = (a - a.min()) / np.ptp(a)
    k = a.shape[0]

    def value(e: Array, n: Array) -> Array:
        from scipy.ndimage import map_coordinates

        cells = np.stack([(half - n) / (2.0 * half), (half + e) / (2.0 * half)]) * k - 0.5
        return np.asarray(map_coordinates(a, cells, order=1, mode="nearest"))

    return Signal("picture", half, 2.0 * np.pi, value)


def _positive(quantity: str, value: float) -> float:
    if not (np.isfinite(value) and value > 0.0):
        raise InputError(f"{quantity}: {value:g} m; it must be positive")
    return float(value)
