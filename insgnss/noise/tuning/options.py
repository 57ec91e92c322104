"""What a person may choose when tuning, with the meaning of every option in one place; standard
library only, for the command line.
"""

import re
from collections.abc import Mapping
from dataclasses import dataclass
from functools import partial
from typing import Literal

from ...base.errors import OptionError, UsageError
from ...io.options.kinds import Checked
from ...io.options.schema import argument

Axes = Literal["separate", "joint"]
Weights = Literal["auto", "full", "diagonal"]
Sampling = Literal["point", "mean"]
FAMILY = (
    *("WN", "WN+RW", "WN+GM", "WN+GM+RW", "WN+2GM", "WN+2GM+RW", "WN+3GM", "WN+3GM+RW"),
    *("QN+WN", "QN+WN+RW", "QN+WN+GM", "QN+WN+GM+RW", "QN+WN+2GM", "QN+WN+2GM+RW", "QN+WN+3GM"),
    "QN+WN+3GM+RW",
)
"""The models that compete where none is named."""
_model, _reading = (partial(argument, group=group) for group in ("model", "reading"))
_unit = partial(_reading, usual="by header", metavar="UNIT")
_sum = partial(_model, metavar="SUM")


@dataclass(frozen=True)
class TuneOptions(Checked):
    """How to read static recordings, and how to fit; `insgnss tune` has each as an argument.

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

    Raises
    ------
    OptionError
        For a value that cannot be.
    """

    columns: tuple[str, ...] | Mapping[str, str] | None = _reading(
        None, "tow,gx,gy,gz,ax,ay,az in their order, or tow=Time,gx=...", kind="columns"
    )
    gyro_unit: str | None = _unit(
        None, "rad/s, deg/s, mdeg/s, deg/h or the size of one count, '0.05 deg/s'"
    )
    accel_unit: str | None = _unit(None, "m/s^2, g, mg or the size of one count, '3.33 mg'")
    time_unit: str | None = _unit(
        None, "unit of the time column: s, ms, us, ns; unix, unix_ms, ... count from 1970"
    )
    quantity: Literal["mean_rate", "increments", "instant_rate"] | None = _reading(
        None, "what a sample is", usual="mean_rate"
    )
    rate_hz: float | None = _reading(
        None,
        "samples a second, where there is no column of time",
        positive=True,
        cli="--rate",
        metavar="HZ",
    )
    variable: str | None = _reading(None, "the table inside a file that holds several")
    model: str | None = _sum(
        None,
        "processes QN WN GM RW DR, such as WN+3GM, or several with commas to choose from",
        usual=" ".join(FAMILY),
    )
    gyro_model: str | None = _sum(None, "model of the gyroscopes, where it differs")
    accel_model: str | None = _sum(None, "model of the accelerometers, where it differs")
    axes: Axes = argument("separate", "a model an axis, or one for the three", group="model")
    levels: str | None = _model(
        None, "scales to fit: 3-, 2-14, 1,2,5- (level j: differences of means of 2^(j-1) samples)"
    )
    weights: Weights = argument(
        "auto", "efficient second step", usual="where the model fits", group="model"
    )
    robust: bool | None = _model(
        None,
        "robust wavelet variances, insensitive to disturbances (default: where there are"
        " disturbances)",
    )
    sampling: Sampling = argument("point", "what a sample is of the process", group="model")
    bootstrap: int = _model(0, "replicates for the J test and, from 100, intervals", low=0)
    seed: int = _model(0, "of the random numbers", low=0)
    skip_s: float = _reading(
        0.0,
        "left out at the beginning, where the sensor warms up",
        low=0.0,
        cli="--skip",
        metavar="MINUTES",
        scale=60.0,
    )
    keep_s: float = _reading(
        float("inf"),
        "used from there on",
        positive=True,
        usual="all",
        cli="--keep",
        metavar="MINUTES",
        scale=60.0,
    )
    bridge_s: float = _reading(
        0.0, "fill gaps up to this length by straight lines", unit="s", low=0.0, cli="--bridge"
    )
    accept: tuple[str, ...] = _reading(
        (),
        "name of a check whose failure shall not stop the tuning",
        repeated=True,
        metavar="CHECK",
    )
    only: str | None = _reading(
        None,
        "tune these channels alone: gyro, accel, gyro_z, ... with commas between",
        usual="those that the file has",
    )

    def __post_init__(self) -> None:
        super().__post_init__()
        if self.bootstrap == 1:
            problem = "give 2 replicates at least, some hundreds for intervals, or 0 for none"
            raise OptionError("bootstrap", problem, self.bootstrap)


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
