"""How limits are stated: one sentence with its rank, and numbers as a surveyor reads them."""

import math
from collections.abc import Mapping, Sequence
from datetime import datetime, tzinfo
from typing import Any

from ...base.units import STANDARD_GRAVITY, time_zone
from ...geodesy.gpstime import calendar_from_gps
from ...records.states import State

Figures = Mapping[str, Any]

NED_NAMES = ("north", "east", "down")

DEG_H_PER_RAD_S = math.degrees(1.0) * 3600.0  # deg/h of one rad/s
MG_PER_M_S2 = 1e3 / STANDARD_GRAVITY  # mg of one m/s^2


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


def span(figures: Figures, start: float, end: float) -> str:
    """Return a piece of the flight as `at_time` has its ends."""
    if figures["span"]["gps_week"] is None:
        return f"TOW {start:.1f} to {end:.1f} s"
    begin, until = clock(figures, start), clock(figures, end)
    return f"{begin:%H:%M:%S} to {until:%H:%M:%S %Z} (TOW {start:.1f} to {end:.1f} s)"


def at_time(figures: Figures, tow: float) -> str:
    """Return an instant as clock time and time of week; without a week as the latter alone."""
    if figures["span"]["gps_week"] is None:
        return f"TOW {tow:.1f} s"
    return f"{clock(figures, tow):%H:%M:%S %Z} (TOW {tow:.1f} s)"


def clock(figures: Figures, tow: float) -> datetime:
    """Return an instant of a flight with a GPS week in the time zone that `output` states."""
    return calendar_from_gps(figures["span"]["gps_week"], tow).astimezone(local_zone(figures))


def local_zone(figures: Figures) -> tzinfo:
    """Return the time zone that `output` states, UTC where it states none."""
    return time_zone((figures["flight"].get("output") or {}).get("time_zone") or "UTC")


def no_fix(figures: Figures, outage: Figures) -> str:
    """Return how long and since when no GNSS position was used, as a clause."""
    since = at_time(figures, outage["time_s"])
    return f"no GNSS position was used for {outage['length_s']:.1f} s from {since} on"


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
    shown = {"": (1e6, "ppm"), "rad": (1e3, "mrad"), "s": (1e3, "ms")}
    return shown.get(state.unit, (1.0, state.unit))
