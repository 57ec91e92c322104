"""Survey flights in the shape of ign8 and ign6x1; `changes` are fields of `FlightPlan`."""

from typing import Any

from insgnss.simulation.flights import FlightMotion, fly
from insgnss.simulation.layout import BLOCK, CORRIDOR


def block_flight(minutes: float | None = None, *, seed: int = 0, **changes: Any) -> FlightMotion:
    """Two levels of perpendicular lines over a block."""
    return fly(BLOCK.changed(minutes=minutes, **changes), seed)


def corridor_flight(minutes: float | None = None, *, seed: int = 0, **changes: Any) -> FlightMotion:
    """Two levels of two lines along a corridor."""
    return fly(CORRIDOR.changed(minutes=minutes, **changes), seed)
