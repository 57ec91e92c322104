"""The numbers of the rules: classes of an engine's positions, and floors of qualities."""

import math
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
class ClaimPrior:
    """What is known beforehand of the factor k of an engine's sigmas that makes them right.

    Parameters
    ----------
    mean, width : float
        Mean and standard deviation of log k.
    source : str
        Where they come from.
    """

    mean: float
    width: float
    source: str

    @property
    def limits(self) -> tuple[float, float]:
        """Return the factors within `WITHIN` widths of the mean, which are nothing to say."""
        low, high = math.exp(-WITHIN * self.width), math.exp(WITHIN * self.width)
        return low * math.exp(self.mean), high * math.exp(self.mean)


WITHIN = 2.0  # widths of the prior of log k, within which 95 % of flights are
CALIBRATED = "calibrated"
CLAIMS: Mapping[str, ClaimPrior] = {
    CALIBRATED: ClaimPrior(-0.15, 0.35, "mean squares of 0.17 to 1.5 in the table of `classes`"),
    "rtklib": ClaimPrior(-0.4, 0.35, "mean squares of 0.36 to 0.53 in the text of `classes`"),
    "emlid": ClaimPrior(-0.4, 0.35, "assumed: its engine is RTKLIB"),
    "ublox": ClaimPrior(0.0, 0.5, "assumed: one number for open sky and town; of autopilots' logs"),
    "novatel": ClaimPrior(0.0, 0.35, "assumed"),
    "trimble": ClaimPrior(0.0, 0.35, "assumed"),
    "dji": ClaimPrior(0.0, 0.35, "assumed"),
    "": ClaimPrior(0.0, 0.2, "assumed: who states sigmas and does not say how means them"),
}
"""Priors by `GnssFixes.engine`. The flight's own factor is known to per cent by thousands of
innovations, so that a prior does not change it: it decides whether the factor is worth a word.
"""


def claim_prior(engine: str) -> ClaimPrior:
    """Return the prior of an engine, that of an unknown one where the table lacks it.

    Parameters
    ----------
    engine : str
        As `GnssFixes.engine` names it.

    Returns
    -------
    ClaimPrior
        The prior of log k.
    """
    return CLAIMS.get(engine, CLAIMS[""])


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
