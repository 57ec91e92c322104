"""What is found of a recording or a run besides its numbers: checks, states and errors with a
verdict.
"""

from dataclasses import dataclass
from typing import Literal

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
    """

    name: str
    found: str
    expected: str
    verdict: Verdict = "ok"
    advice: str = ""


@dataclass(frozen=True)
class StateVerdict:
    """A constant that the flight estimates besides biases: value, sigma and a-priori sigma in SI.

    moves_m : how far its sigma moves the fixes, None for an error of the IMU.   observed : whether the flight determines it.
    """

    name: str
    value: float
    sigma: float
    prior: float
    moves_m: float | None
    observed: bool


@dataclass(frozen=True)
class TimeCorrelatedError:
    """A time-correlated (Gauss-Markov) GNSS error that was estimated: (3,) are north, east, down.

    time_s : how long it lasts.
    fixes : how many fixes have it.
    sigma_m : its sigma at the median fix.
    share, white : itself and the uncorrelated error of these fixes in standard deviations of the
        file.
    """

    time_s: float
    fixes: int
    sigma_m: tuple[float, ...]
    share: tuple[float, ...]
    white: tuple[float, ...]
