"""What a person may choose when tuning, with the meaning of every option in one place; standard
library only, for the command line.
"""

import re
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Literal

from ...base.errors import UsageError

Axes = Literal["separate", "joint"]
Weights = Literal["auto", "full", "diagonal"]
Sampling = Literal["point", "mean"]
FAMILY = (
    *("WN", "WN+RW", "WN+GM", "WN+GM+RW", "WN+2GM", "WN+2GM+RW", "WN+3GM", "WN+3GM+RW"),
    *("QN+WN", "QN+WN+RW", "QN+WN+GM", "QN+WN+GM+RW", "QN+WN+2GM", "QN+WN+2GM+RW", "QN+WN+3GM"),
    "QN+WN+3GM+RW",
)
"""The models that compete where none is named."""


@dataclass(frozen=True)
class TuneOptions:
    """How to read static recordings, and how to fit.

    Parameters
    ----------
    columns : names of the columns in their order, or a mapping; None: what the file says.
    gyro_unit, accel_unit, time_unit : units of the columns, such as "rad/s"; None: what the file
        says, and a file whose columns nothing names is refused.
    quantity : what a sample is; None: "mean_rate".
    rate_hz : samples a second, where there is no column of time.
    variable : the table inside a file that holds several.
    model : sum of processes such as "WN+2GM", several with commas to choose from; None: `FAMILY`.
    gyro_model, accel_model : the same of one sensor, in the place of `model`.
    axes : "separate" (a model an axis) or "joint" (one for the three axes of a sensor).
    levels : scales to fit, such as "3-" or "1,2,5-9"; None: all.
    weights : the efficient second step always ("full"), never ("diagonal"), or where the model
        fits.
    robust : whether wavelet variances are taken that a few disturbances do not move; None: of the
        recordings that hold some.
    sampling : what a sample is of the continuous process, "point" or "mean".
    bootstrap : replicates for the J test and, from 100, intervals; 0: none.
    seed : of the random numbers.
    skip_s : left out at the beginning, where the sensor warms up, s.
    keep_s : used from there on, s.
    bridge_s : gaps up to this length are filled by straight lines, s.
    accept : names of checks that shall not stop.
    only : channels to tune, such as "gyro" or "gyro_z,accel"; None: those that the recordings have.
    """

    columns: tuple[str, ...] | Mapping[str, str] | None = None
    gyro_unit: str | None = None
    accel_unit: str | None = None
    time_unit: str | None = None
    quantity: str | None = None
    rate_hz: float | None = None
    variable: str | None = None
    model: str | None = None
    gyro_model: str | None = None
    accel_model: str | None = None
    axes: Axes = "separate"
    levels: str | None = None
    weights: Weights = "auto"
    robust: bool | None = None
    sampling: Sampling = "point"
    bootstrap: int = 0
    seed: int = 0
    skip_s: float = 0.0
    keep_s: float = float("inf")
    bridge_s: float = 0.0
    accept: tuple[str, ...] = ()
    only: str | None = None


def chosen_levels(text: str | None, highest: int) -> tuple[int, ...] | None:
    """Parse levels such as "3-", "2-14" or "1,2,5-9".

    Parameters
    ----------
    text : str or None
        The levels; None stands for all.
    highest : int
        Highest level there is.

    Returns
    -------
    tuple of int or None
        Levels in ascending order, None for all.

    Raises
    ------
    UsageError
        For any other text, and where no level remains.
    """
    if text is None:
        return None
    levels: set[int] = set()
    for piece in text.split(","):
        match = re.fullmatch(r"\s*(\d+)?\s*(-)?\s*(\d+)?\s*", piece)
        if match is None or not (match[1] or match[3]) or (match[1] and match[3] and not match[2]):
            raise UsageError(
                f"--levels {text!r}: {piece!r} is no level; write as in 3-, 2-14 or 1,2,5-9 (level"
                " j has 2^j samples)"
            )
        low = int(match[1]) if match[1] else 1
        high = int(match[3]) if match[3] else (highest if match[2] else low)
        levels.update(range(max(low, 1), min(high, highest) + 1))
    if not levels:
        raise UsageError(f"--levels {text!r}: no such level; there are 1 to {highest}")
    return tuple(sorted(levels))
