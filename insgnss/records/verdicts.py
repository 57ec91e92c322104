"""What is found of a recording or a run besides its numbers: checks, states, residuals and errors
with a verdict.

A check that a flight file may accept has its line in `CHECKS`, and nowhere else.
"""

import math
from collections.abc import Mapping
from dataclasses import dataclass

from ..base.findings import Finding
from .states import State

# of the a-priori sigma: what is known better afterwards was observed, what is known worse was not
OBSERVED, UNOBSERVED = 1.0 / 3.0, 0.9

REMARK = 0.5
"""Rank of a note that does not change the result; from one on a finding stands out."""
NOTED_FACTOR, ADOPTED = 1.5, 2.0
"""Ranks of notes that stand out: of what enlarges sigmas without need or may be of another camera,
time or clock, and of what the solution has otherwise than the flight file asks for.
"""

CHECKS: Mapping[str, float] = {
    "IMU rate": REMARK,
    "silent sensor": REMARK,
    "specific force": REMARK,
    "axes, vertical": REMARK,
    "IMU readings": REMARK,
    "GNSS rate": REMARK,
    "GNSS speed": REMARK,
    "GNSS position": REMARK,
    "GNSS velocity": REMARK,
    "GNSS kinds": REMARK,
    "tangent plane origin": REMARK,
    "turn rate, gyro against GNSS course": REMARK,
    "camera events": REMARK,
    "heading against course": REMARK,
    "recognised units": REMARK,
    "recognised axes": REMARK,
    "recognised sign": REMARK,
    "recognised clock": REMARK,
    "IMU rows": REMARK,
    "GNSS rows": REMARK,
    "event rows": REMARK,
    "barometer rows": REMARK,
    "standing": REMARK,
    "IMU parity": REMARK,
    "IMU clocks": REMARK,
    "IMU overlap": REMARK,
    "IMU calibration": REMARK,
    "IMU gaps": REMARK,
    "images": REMARK,
    "motion": REMARK,
    "mounting": REMARK,
    "mounting file": NOTED_FACTOR,
    "bore-sight": REMARK,
    "barometer": REMARK,
    "measurements": REMARK,
    "GNSS quality": REMARK,
    "antenna lever arm": ADOPTED,
    "GNSS time offset": ADOPTED,
    "clock rate": ADOPTED,
    "clock step": REMARK,
    "exposure clock": NOTED_FACTOR,
    "IMU scale factors": REMARK,
    "IMU misalignments": REMARK,
    "IMU warm-up": ADOPTED,
    "IMU bias step": ADOPTED,
    "gyro delay": ADOPTED,
    "receiver dynamics": ADOPTED,
    "load-dependent bias": ADOPTED,
    "IMU noise": ADOPTED,
    "drift": ADOPTED,
    "GNSS sigmas": ADOPTED,
    "sigmas of the fixes": NOTED_FACTOR,
    "unseen constants": REMARK,
    "incorrect fixes": ADOPTED,
    "turn-on bias": REMARK,
}
"""Every check that `accept` of a flight file takes, in the order in which to act on them, with the
rank of its note in the report.
"""

Check = Finding
"""The public name of a finding of a recording or a run."""


@dataclass(frozen=True)
class Estimate:
    """A constant that was estimated; numbers are in SI units.

    Parameters
    ----------
    state : State
        What it is.
    value, sigma : float
        Its estimate and standard deviation; of a correction of `stated`, that of a segment as of a
        flight of several segments, which have one `stated`: stamps that were moved before a segment
        was solved again are part of it. A time offset that changes is that of the middle of the
        segment.
    prior : float
        Its a-priori standard deviation, or how well such constants are known otherwise.
    moves_m : float or None
        How far its sigma moves the fixes, m, of a clock rate the last against the first; None for
        an error of the IMU.
    requested : bool
        Whether the flight file asks for it; what the innovations led to is weighed by the check
        that says so.
    stated : float
        The flight file's value and nothing else; 0 of a clock rate.
    """

    state: State
    value: float
    sigma: float
    prior: float = math.inf
    moves_m: float | None = None
    requested: bool = True
    stated: float = 0.0

    @property
    def observed(self) -> bool:
        """Whether the data determine it."""
        return self.sigma < OBSERVED * self.prior

    def degree(self, determined: str, improved: str, undetermined: str) -> str:
        """How far the data determine it, in the words of those who read it.

        Parameters
        ----------
        determined, improved, undetermined : str
            Below `OBSERVED` of the a-priori sigma, below `UNOBSERVED`, and above.

        Returns
        -------
        str
            One of the three.
        """
        if self.observed:
            return determined
        return improved if self.sigma < UNOBSERVED * self.prior else undetermined

    @property
    def name(self) -> str:
        """Its name."""
        return str(self.state)


@dataclass(frozen=True)
class TimeCorrelatedError:
    """A time-correlated (Gauss-Markov) GNSS error that was estimated, in north, east and down.

    Parameters
    ----------
    time_s : float
        Its correlation time, s.
    fixes : int
        How many fixes have it.
    sigma_m : tuple of float
        (3,) its standard deviation at the median fix, m.
    share : tuple of float
        (3,) its standard deviation in standard deviations of the file.
    white : tuple of float
        (3,) standard deviation of the white error of these fixes in the same unit.
    """

    time_s: float
    fixes: int
    sigma_m: tuple[float, ...]
    share: tuple[float, ...]
    white: tuple[float, ...]


@dataclass(frozen=True)
class MeanResidual:
    """The mean of fixes minus smoothed solution over a piece of time, in north, east and down.

    Parameters
    ----------
    begin_s, end_s : float
        Times of its first and of its last fix, s, GPST.
    fixes : int
        How many fixes the mean is of.
    mean_m : tuple of float
        (3,) the mean, m, weighted with what the fixes claim.
    sigma_m : tuple of float
        (3,) what the claims of solution and fixes allow it, a standard deviation, m.
    """

    begin_s: float
    end_s: float
    fixes: int
    mean_m: tuple[float, ...]
    sigma_m: tuple[float, ...]
