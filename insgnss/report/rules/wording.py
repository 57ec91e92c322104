"""How limits are stated: one sentence with its rank, and numbers as a surveyor reads them."""

import math
from collections.abc import Mapping, Sequence
from typing import Any

from ...base.units import STANDARD_GRAVITY
from ...geodesy.gpstime import calendar_from_gps
from ...records.states import State

Figures = Mapping[str, Any]

AXES = ("north", "east", "down")

DEG_H_PER_RAD_S = math.degrees(1.0) * 3600.0
MG_PER_M_S2 = 1e3 / STANDARD_GRAVITY


def millimetres(x: float, unit: bool = True) -> str:
    """Return a length in mm with two significant digits or more; with `unit` in m from 1 m on."""
    if unit and abs(x) >= 1e3:
        return f"{x / 1e3:.2f} m" if abs(x) < 1e4 else f"{x / 1e3:.1f} m"
    return f"{x:z.1f}{' mm' if unit else ''}" if abs(x) < 100 else f"{x:.0f}{' mm' if unit else ''}"


def lengths(x: Sequence[float]) -> str:
    """Lengths given in mm side by side, with their common unit."""
    if max(abs(value) for value in x) >= 1e3:
        return " / ".join(f"{value / 1e3:.2f}" for value in x) + " m"
    return " / ".join(millimetres(value, unit=False) for value in x) + " mm"


def degrees(x: float) -> str:
    """Angle in deg with two significant digits."""
    return f"{x:.2g} deg" if abs(x) < 10 else f"{x:.0f} deg"


def span(start: float, end: float) -> str:
    """A piece of the flight by its time of week."""
    return f"TOW {start:.1f} to {end:.1f} s"


def at_time(f: Figures, tow: float) -> str:
    """Return an instant as clock time and time of week; without a week as the latter alone."""
    week = f["span"]["gps_week"]
    if week is None:
        return f"TOW {tow:.1f} s"
    return f"{calendar_from_gps(week, tow):%H:%M:%S} UTC (TOW {tow:.1f} s)"


def tilt(attitude: Sequence[float]) -> float:
    """The larger of the two level angles of an attitude's sigmas."""
    return max(attitude[:2])


def image_range(piece: Figures) -> str:
    """The images of a piece of the flight: their names and number."""
    if piece["images"] == 1:
        return f"image {piece['first_image']}"
    return f"images {piece['first_image']} to {piece['last_image']} ({piece['images']})"


def screen_unit(unit: str) -> tuple[float, str]:
    """Factor and unit in which small lengths (m), angles (rad) and times (s) are read."""
    return {"m": (1e3, "mm"), "rad": (math.degrees(1.0), "deg"), "s": (1e3, "ms")}[unit]


def state_unit(state: State) -> tuple[float, str]:
    """Factor and unit in which a constant is read."""
    return {"": (1e6, "ppm"), "rad": (1e3, "mrad"), "s": (1e3, "ms"), "m": (1.0, "m")}[state.unit]
