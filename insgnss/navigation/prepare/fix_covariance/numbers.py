"""The numbers of the rules: classes of an engine's positions, floors of qualities, their scale."""

import math
from collections.abc import Mapping
from dataclasses import dataclass, field

Triple = tuple[float, float, float]

GATE_3_SIGMA = 14.16
"""Chi-square of 3 degrees of freedom at 0.9973."""

# scale factors and floors, m, of each class
_OF_CLASS: dict[str, tuple[Triple, Triple]] = {
    "fixed": ((0.75, 0.75, 0.75), (0.001, 0.001, 0.001)),
    "degraded": ((4.0, 4.0, 4.0), (0.025, 0.025, 0.04)),
    "float": ((3.0, 3.0, 3.0), (0.3, 0.3, 0.6)),
    "isolated": ((30.0, 30.0, 30.0), (0.3, 0.3, 0.6)),
    "unsupported": ((30.0, 30.0, 30.0), (15.0, 15.0, 15.0)),
    "sbas": ((5.0, 5.0, 5.0), (1.0, 1.0, 2.0)),
    "dgps": ((5.0, 5.0, 5.0), (1.0, 1.0, 2.0)),
    "single": ((5.0, 5.0, 5.0), (2.0, 2.0, 4.0)),
    "ppp": ((3.0, 3.0, 3.0), (0.05, 0.05, 0.1)),
}
FIX_CLASSES = tuple(_OF_CLASS)
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

CALIBRATED_ORIGIN = "calibrated"
"""`GnssFixes.source_format` of fixes whose covariances are calibrated by class."""
CLAIMED_SCALE: Mapping[str, tuple[float, float]] = {
    # squares of 0.17 to 1.5 in the table of `classes`; right sigmas times 0.75 have 1.33
    CALIBRATED_ORIGIN: (-0.15, 0.35),
    # squares of 0.36 to 0.53 with the engine's own sigmas there; also of Emlid, whose engine it is
    "rtklib_pos": (-0.4, 0.35),
    # of a u-blox as a rule, which claims too much under multipath (PX4-Autopilot issue 9549,
    # ArduPilot pull request 15109, both without a number): one number for open sky and town; chosen
    "ardupilot": (0.0, 0.5),
    "ulog": (0.0, 0.5),
    # of an inertial solution (Trimble's POSPac, NovAtel's Inertial Explorer); chosen
    "sbet": (0.0, 0.35),
    # who states sigmas in a table (NovAtel, DJI) and does not say how: as they are; chosen
    "": (0.0, 0.2),
}
"""Prior of log k, k the factor that makes claimed sigmas right: mean and width by format."""
WIDE_FACTOR = 2.0  # of the prior, within which 95 % of flights are: nothing to say


def largest_usual_scale(source_format: str) -> float:
    """Return the factor of claimed sigmas up to which they are as usual of such a source.

    Thousands of innovations tell a flight's own factor to a per cent, which no prior of this width
    changes: it is used as it is, and the prior decides whether it is worth a word.

    Parameters
    ----------
    source_format : str
        As `GnssFixes.source_format` has it.

    Returns
    -------
    float
        The factor that lies `WIDE_FACTOR` widths above the mean of the prior of its logarithm, at
        least 1: sigmas that are right are nothing to say.
    """
    mean, width = CLAIMED_SCALE.get(source_format, CLAIMED_SCALE[""])
    return max(1.0, math.exp(mean + WIDE_FACTOR * width))


def _by_class(column: int) -> dict[str, Triple]:
    return {name: numbers[column] for name, numbers in _OF_CLASS.items()}


@dataclass(frozen=True)
class CalibrationNumbers:
    """Numbers of (V.1) to (V.6) of `classes`, measured as said there.

    What each one means is stated with the options of the table gnss.covariance of the flight file
    (`gnss.covariance_model`), which have these values by default. Triples are north, east, down.
    """

    scale: Mapping[str, Triple] = field(default_factory=lambda: _by_class(0))
    floor_m: Mapping[str, Triple] = field(default_factory=lambda: _by_class(1))
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
