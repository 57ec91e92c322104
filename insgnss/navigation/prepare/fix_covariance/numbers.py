"""The numbers of the rules: classes of an engine's positions, floors of qualities, their scale."""

from collections.abc import Mapping
from dataclasses import dataclass, field

from ....base.findings.scale_prior import ScalePrior

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
_RECEIVER = ScalePrior(0.0, 0.6)  # of one in an autopilot; sources below
CLAIMED_SCALE: Mapping[str, ScalePrior] = {
    # squares of 0.17 to 1.5 in the table of `classes`; right sigmas times 0.75 have 1.33
    CALIBRATED_ORIGIN: ScalePrior(-0.15, 0.35),
    # squares of 0.36 to 0.53 with the engine's own sigmas there; also of Emlid, whose engine it is
    "rtklib_pos": ScalePrior(-0.4, 0.35),
    # of a u-blox as a rule: 0.6 m claimed for 2 m in flight (PX4-Autopilot pull request 4915), a
    # factor of 3.3 or two widths; 4.8 m claimed for fixes that scatter by 0.1 m about a slow error
    # (fusioncore issue 87)
    "ardupilot": _RECEIVER,
    "ulog": _RECEIVER,
    # "usually slightly pessimistic" (NovAtel's known solution on BESTPOS, no number): a fifth
    "novatel": ScalePrior(-0.2, 0.3),
    # of an inertial solution (Trimble's POSPac, NovAtel's Inertial Explorer): no source that
    # compares its sigmas with the truth was found, so it may be a factor of 2.7 at two widths
    "sbet": ScalePrior(0.0, 0.5),
    # who states sigmas in a table (NovAtel, DJI, Emlid) and does not say how: no source, 1.8
    "": ScalePrior(0.0, 0.3),
}
"""Prior of the factor that makes claimed sigmas right, by format of the source."""


def claimed_scale(source_format: str) -> ScalePrior:
    """Return the prior of the factor of a source's sigmas, by `GnssFixes.source_format`."""
    return CLAIMED_SCALE.get(source_format, CLAIMED_SCALE[""])


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
