"""The numbers of the rules: classes of an engine's positions, and floors of qualities."""

from collections.abc import Mapping
from dataclasses import dataclass, field

Triple = tuple[float, float, float]

CLASSES = ("fixed", "degraded", "float", "isolated", "unsupported", "sbas", "dgps", "single", "ppp")
GATE_3_SIGMA = 14.16
"""Chi-square of 3 degrees of freedom at 0.9973."""

_SCALE: dict[str, Triple] = {
    "fixed": (0.75, 0.75, 0.75),
    "degraded": (4.0, 4.0, 4.0),
    "float": (3.0, 3.0, 3.0),
    "isolated": (30.0, 30.0, 30.0),
    "unsupported": (30.0, 30.0, 30.0),
    "sbas": (5.0, 5.0, 5.0),
    "dgps": (5.0, 5.0, 5.0),
    "single": (5.0, 5.0, 5.0),
    "ppp": (3.0, 3.0, 3.0),
}
_FLOOR_M: dict[str, Triple] = {
    "fixed": (0.001, 0.001, 0.001),
    "degraded": (0.025, 0.025, 0.04),
    "float": (0.3, 0.3, 0.6),
    "isolated": (0.3, 0.3, 0.6),
    "unsupported": (15.0, 15.0, 15.0),
    "sbas": (1.0, 1.0, 2.0),
    "dgps": (1.0, 1.0, 2.0),
    "single": (2.0, 2.0, 4.0),
    "ppp": (0.05, 0.05, 0.1),
}
QUALITY_SIGMA_M: dict[str, Triple] = {
    "float": (0.3, 0.3, 0.6),
    "sbas": (0.3, 0.3, 0.6),
    "dgps": (0.3, 0.3, 0.6),
    "single": (1.0, 1.0, 2.0),
}
"""Floors, m, of fixes by quality: what a receiver's own standard deviations leave out."""
STATIONARY_SIGMA_M: Triple = (0.1, 0.1, 0.1)
"""m, of a sensor that stands at a known place, which is stated to decimetres as a rule."""
UNKNOWN_SIGMA_M: Triple = (10.0, 10.0, 20.0)
"""m, of an epoch of PPK whose covariance the engine did not estimate."""


@dataclass(frozen=True)
class CalibrationNumbers:
    """Numbers of (V.1) to (V.6) of `classes`, measured as said there.

    What each one means is stated with the options of the table gnss.covariance of the flight file
    (`gnss.covariance_model`), which have these values by default. Triples are north, east, down.
    """

    scale: Mapping[str, Triple] = field(default_factory=lambda: dict(_SCALE))
    floor_m: Mapping[str, Triple] = field(default_factory=lambda: dict(_FLOOR_M))
    ppm: Triple = (1.0, 1.0, 1.0)
    acceleration_mps2: Triple = (20.0, 20.0, 10.0)
    least_satellites: int = 6
    unsupported_satellites: int = 8
    support_s: float = 5.0
    support_share: float = 0.5
    island_s: float = 60.0
    island_share: float = 0.5
    degraded_s: float = 180.0
    degraded_share: float = 0.9
    gate: float = GATE_3_SIGMA


MEASURED = CalibrationNumbers()
