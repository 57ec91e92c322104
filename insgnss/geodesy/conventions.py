"""Conventions in which files of the same data differ: axes, angles, units, rows, time scales.

Each is a clause that follows "has", and the change that makes right values of the file's. Who
suspects a file tries them by `insgnss/geodesy/explain.py`.
"""

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from itertools import permutations, product

import numpy as np
from numpy.typing import NDArray

from ..base.units import FOOT_M
from .gpstime import LEAP_DAYS, WEEK_S
from .rotation import (
    opk_from_rotation,
    pok_from_rotation,
    rotation_from_opk,
    rotation_from_pok,
    rotation_from_rpy,
    rotation_from_ypr,
    rpy_from_rotation,
    vector_from_rotation,
    ypr_from_rotation,
)

Array = NDArray[np.float64]
Rows = NDArray[np.int64]
Change = Callable[[Array], Array]

XYZ = ("x", "y", "z")
METRES_OF = {"millimetres": 1e-3, "centimetres": 1e-2, "feet": FOOT_M}  # m
ANGLES = {  # unit of the file, unit as which it was read: factor
    ("radians", "degrees"): 180.0 / np.pi,
    ("degrees", "radians"): np.pi / 180.0,
    ("gon", "degrees"): 0.9,
    ("degrees", "gon"): 1.0 / 0.9,
}
FARTHEST_ROWS = 5  # rows that tables are looked for to be off: more were never seen
JUDGED_ROWS = 0.5  # least share of the rows that is judged: few fit in some order by chance
LEAP_WITHIN_S = 0.3  # what an offset of two clocks may be off whole leap seconds
OLDEST_LEAP_S = 13  # leap seconds of 1999, when flights of today's kind began


@dataclass(frozen=True)
class Convention:
    """A convention of a file.

    Parameters
    ----------
    words : str
        A clause that follows "has".
    change : callable
        Makes right values of the file's, (n, 3).
    name : str
        Short name, for documents.
    """

    words: str
    change: Change
    name: str = ""


@dataclass(frozen=True)
class AngleSet:
    """A set of angles.

    Parameters
    ----------
    names : tuple of str
        Of the angles.
    take, rotation : callable
        Angles (n, 3), rad, of rotations (n, 3, 3), and rotations of angles; of a camera right,
        up, back into its frame, of a body into north, east, down.
    """

    names: tuple[str, str, str]
    take: Change
    rotation: Change


CAMERA_SETS = {
    "opk": AngleSet(("omega", "phi", "kappa"), opk_from_rotation, rotation_from_opk),
    "pok": AngleSet(("phi", "omega", "kappa"), pok_from_rotation, rotation_from_pok),
    "ypr": AngleSet(("yaw", "pitch", "roll"), ypr_from_rotation, rotation_from_ypr),
}
CAMERA_SETS["kpo"] = AngleSet(  # omega, phi, kappa composed in the reverse order
    ("kappa", "phi", "omega"),
    lambda R: rpy_from_rotation(R)[:, ::-1],
    lambda x: rotation_from_rpy(x[:, ::-1]),
)
BODY_SETS = {"rpy": AngleSet(("roll", "pitch", "heading"), rpy_from_rotation, rotation_from_rpy)}


def exchanged_orders(names: Sequence[str]) -> Iterator[Convention]:
    """Return the other orders of columns, two exchanged or all.

    Parameters
    ----------
    names : sequence of str
        Of the first columns of three; those behind them stay.

    Returns
    -------
    iterator of Convention
        Each with the change that undoes it.
    """
    for order in list(permutations(range(len(names))))[1:]:
        moved = [name for k, name in enumerate(names) if order[k] != k]
        description = f"{' '.join(names[k] for k in order)} for {' '.join(names)}"
        if len(moved) == 2:
            description = f"{moved[0]} and {moved[1]} exchanged"
        columns = [*order, *range(len(names), 3)]
        yield Convention(description, _columns(columns), " for ".join(moved))


def reversed_signs(names: Sequence[str], most: int = 3) -> Iterator[Convention]:
    """Return columns with other signs.

    Parameters
    ----------
    names : sequence of str
        Of three columns; those without a name keep their signs.
    most : int
        How many have the other sign at most.

    Returns
    -------
    iterator of Convention
        Each with the change that undoes it.
    """
    for signs in list(product(*((1.0, -1.0) if name else (1.0,) for name in names)))[1:]:
        which = " and ".join(name for name, sign in zip(names, signs, strict=True) if sign < 0.0)
        if signs.count(-1.0) <= most:
            description = f"{which} with the other sign"
            yield Convention(description, _times(signs), f"{which} reversed")


def lengths(quantity: str, units: Sequence[str] = tuple(METRES_OF)) -> Iterator[Convention]:
    """Return coordinates in other units than metres.

    Parameters
    ----------
    quantity : str
        Its name.
    units : sequence of str
        Those of `METRES_OF` that are looked for.

    Returns
    -------
    iterator of Convention
        Each with the change that undoes it.
    """
    for unit in units:
        yield Convention(f"{quantity} in {unit}", _times(METRES_OF[unit]), unit)


def angles(
    read_as: AngleSet,
    sets: Mapping[str, AngleSet],
    units: Sequence[str] = ("degrees", "radians", "gon"),
) -> Iterator[Convention]:
    """Return angles of another order, sign, unit or set; the changes make rotations of angles.

    Parameters
    ----------
    read_as : AngleSet
        As which they were read.
    sets : mapping of AngleSet
        That they may be of.
    units : sequence of str
        As which they may have been read; none where no other unit is looked for.

    Returns
    -------
    iterator of Convention
        Each with the change that undoes it.
    """
    changes = {"angles exchanged": exchanged_orders, "sign of angles": reversed_signs}
    for name, conventions in changes.items():
        for convention in conventions(read_as.names):
            change = _after(convention.change, read_as.rotation)
            yield Convention(convention.words, change, name)
    for (unit, read_unit), factor in ANGLES.items():
        if read_unit in units:
            description = f"angles in {unit} that were read as {read_unit}"
            change = _after(_times(factor), read_as.rotation)
            yield Convention(description, change, f"{unit} for {read_unit}")
    for other_set in sets.values():
        if other_set is read_as:
            continue
        for order in permutations(range(3)):
            names = tuple(other_set.names[order.index(k)] for k in range(3))
            description = f"{' '.join(names)} that were read as {' '.join(read_as.names)}"
            if names == read_as.names:
                description = (
                    f"angles of rotations in the order {' '.join(other_set.names)}"
                    f" ({other_set.names[0]} primary), read as {' '.join(read_as.names)}"
                )
            yield Convention(description, _after(_columns(order), other_set.rotation), "angle set")


def _columns(order: Sequence[int]) -> Change:
    """Return the change that puts columns of (n, 3) in an order."""
    return lambda x: x[:, list(order)]


def _times(factors: float | Sequence[float]) -> Change:
    """Return the change that multiplies columns of (n, 3) by factors."""
    return lambda x: x * np.asarray(factors)


def _after(first: Change, second: Change) -> Change:
    """Return the change that does one and then the other."""
    return lambda x: second(first(x))


def turned_by(Q: Array, names: Sequence[str]) -> str:
    """Say by which right angles axes are turned.

    Parameters
    ----------
    Q : ndarray, (3, 3)
        The rotation.
    names : sequence of str
        Of the axes.

    Returns
    -------
    str
        Such as "+90 deg about up".
    """
    rotation_vector = vector_from_rotation(Q)
    angle = float(np.degrees(np.linalg.norm(rotation_vector)))
    axis = np.round(rotation_vector / np.abs(rotation_vector).max(), 6)
    axis_names = [
        f"{'minus ' if x < 0.0 else ''}{name}" for name, x in zip(names, axis, strict=True) if x
    ]
    if len(axis_names) > 1:
        return f"{angle:.0f} deg about the bisector of {' and '.join(axis_names)}"
    return f"{angle * axis.sum():+.0f} deg about {names[int(np.abs(axis).argmax())]}"


def orders(n: int) -> Iterator[tuple[int | None, Rows, Rows]]:
    """Return how two tables of the same n rows may have been joined: some rows off, or reversed.

    Parameters
    ----------
    n : int
        Rows of either.

    Returns
    -------
    iterator of tuple
        k, where row i of the one belongs to row i + k of the other (None: the order is reversed),
        and the rows of either that belong together, `JUDGED_ROWS` of all at least.
    """
    rows = np.arange(n)
    for k in range(-FARTHEST_ROWS, FARTHEST_ROWS + 1):
        if k and n - abs(k) >= JUDGED_ROWS * n:
            yield k, rows[max(0, -k) : n - max(0, k)], rows[max(0, k) : n + min(0, k)]
    yield None, rows, rows[::-1]


def time_scale(seconds: float, within_s: float = LEAP_WITHIN_S) -> str:
    """Say of which time scale stamps are that lie so many seconds off.

    Parameters
    ----------
    seconds : float
        Stamps less those of GPS time.
    within_s : float
        What they may be off whole leap seconds.

    Returns
    -------
    str
        Such as "the 18 leap seconds between GPS time and UTC"; empty of two clocks that disagree.
    """
    weeks = round(seconds / WEEK_S)
    if weeks and abs(seconds - weeks * WEEK_S) < 0.5 * WEEK_S / 7.0:
        return (
            f"{abs(weeks)} GPS week{'s' if abs(weeks) > 1 else ''}: the GPS week of one file is"
            " wrong"
        )
    size = abs(seconds)
    hours = round(size / 3600.0)
    remainder = abs(size - 3600.0 * hours)
    if hours and (remainder < 1.0 or OLDEST_LEAP_S <= round(remainder) <= len(LEAP_DAYS)):
        return f"a time zone of {hours} h" + (" and leap seconds" if remainder > 1.0 else "")
    if OLDEST_LEAP_S <= round(size) <= len(LEAP_DAYS) and abs(size - round(size)) < within_s:
        return f"the {round(size)} leap seconds between GPS time and UTC"
    return ""
