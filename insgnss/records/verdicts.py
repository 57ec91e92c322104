"""What is found of a recording or a run besides its numbers: checks, states, residuals and errors
with a verdict.
"""

from dataclasses import dataclass
from typing import Literal

from .states import State

Verdict = Literal["ok", "note", "contradiction"]

# of the a-priori sigma: what is known better after a flight or a recording was observed by it
OBSERVED = 1.0 / 3.0


@dataclass(frozen=True)
class Check:
    """One plausibility check of a recording or a run.

    Parameters
    ----------
    name : what was looked at; `accept` of a flight file takes it.
    found : what was found, with the number and its unit.
    expected : what was expected, with the limit.
    verdict : "ok", "note" or "contradiction"; a contradiction stops `process`.
    advice : what to do about it.
    beyond_chance : False of what a right flight may show as well, by chance.
    """

    name: str
    found: str
    expected: str
    verdict: Verdict = "ok"
    advice: str = ""
    beyond_chance: bool = True


@dataclass(frozen=True)
class StateVerdict:
    """A constant that the flight estimates besides biases; numbers are in SI units.

    Parameters
    ----------
    state : State
        What it is.
    value, sigma : float
        Its estimate and standard deviation.
    prior : float
        Its a-priori standard deviation.
    moves_m : float or None
        How far its sigma moves the fixes, m; None for an error of the IMU.
    observed : bool
        Whether the flight determines it.
    requested : bool
        Whether the flight file asks for it; what the innovations led to is weighed by the check
        that says so.
    """

    state: State
    value: float
    sigma: float
    prior: float
    moves_m: float | None
    observed: bool
    requested: bool = True

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


@dataclass(frozen=True)
class ConstantEstimate:
    """What a flight by itself says of a constant, whatever the flight file states of it.

    Its value is `assumed` + `correction`, of a segment as of a flight of several segments, which
    have one `assumed`: stamps that were moved before a segment was solved again are part of the
    correction. Several segments give the mean of their corrections by weights.

    Parameters
    ----------
    state : State
        Which one.
    correction : float
        What the flight finds beyond `assumed`, m or s; a time offset that changes is that of the
        middle of the segment.
    sigma : float
        Standard deviation, m or s, of the flight alone.
    assumed : float
        The flight file's value and nothing else, m (lever arm IMU to antenna, body axes) or s; 0 of
        a clock rate.
    """

    state: State
    correction: float
    sigma: float
    assumed: float = 0.0
