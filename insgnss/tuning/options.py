"""What a person may choose when tuning, with the meaning of every option in one place; standard library only, for the command line."""

import argparse
import re
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Literal

from ..errors import UsageError

Axes = Literal["separate", "joint"]
Weights = Literal["auto", "full", "diagonal"]
Sampling = Literal["point", "mean"]
FAMILY = (
    *("WN", "WN+RW", "WN+GM", "WN+GM+RW", "WN+2GM", "WN+2GM+RW", "WN+3GM"),
    *("QN+WN", "QN+WN+RW", "QN+WN+GM", "QN+WN+GM+RW", "QN+WN+2GM", "QN+WN+2GM+RW", "QN+WN+3GM"),
)
"""The models that compete where none is named."""

EXAMPLE = """\
  insgnss tune static1.csv static2.csv --gyro-model WN+3GM --accel-model WN+2GM --axes joint --out navchip.toml
  insgnss tune static.npy --rate 100 --gyro-unit "0.05 deg/s" --accel-unit "3.33 mg"
  insgnss tune variances.json --gyro-unit rad/s --accel-unit m/s^2 --model WN+2GM --levels 6-
  insgnss tune --flight flight.toml"""


@dataclass(frozen=True)
class TuneOptions:
    """How to read static recordings, and how to fit.

    Parameters
    ----------
    columns : names of the columns in their order, or a mapping; None: what the file says.
    gyro_unit, accel_unit, time_unit : units of the columns; None: what the file says, else SI.
    quantity : what a sample is; None: "mean_rate".
    rate_hz : samples a second, where there is no column of time.
    variable : the table inside a file that holds several.
    model : sum of processes such as "WN+2GM", several with commas to choose from; None: `FAMILY`.
    gyro_model, accel_model : the same of one sensor, in the place of `model`.
    axes : "separate" (a model an axis) or "joint" (one for the three axes of a sensor).
    levels : scales to fit, such as "3-" or "1,2,5-9"; None: all.
    weights : the efficient second step always ("full"), never ("diagonal"), or where the model fits.
    robust : whether wavelet variances are taken that a few disturbances do not move.
    sampling : what a sample is of the continuous process, "point" or "mean".
    bootstrap : replicates for the J test and, from 100, intervals; 0: none.
    seed : of the random numbers.
    skip_s : left out at the beginning, where the sensor warms up, s.
    keep_s : used from there on, s.
    bridge_s : gaps up to this length are filled by straight lines, s.
    accept : names of checks that shall not stop.
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
    robust: bool = False
    sampling: Sampling = "point"
    bootstrap: int = 0
    seed: int = 0
    skip_s: float = 0.0
    keep_s: float = float("inf")
    bridge_s: float = 0.0
    accept: tuple[str, ...] = ()


def chosen_levels(text: str | None, highest: int) -> tuple[int, ...] | None:
    """Levels of a text such as "3-", "2-14" or "1,2,5-9", None for all. Raises UsageError for what is none of these."""
    if text is None:
        return None
    found: set[int] = set()
    for part in text.split(","):
        match = re.fullmatch(r"\s*(\d+)?\s*(-)?\s*(\d+)?\s*", part)
        if match is None or not (match[1] or match[3]) or (match[1] and match[3] and not match[2]):
            raise UsageError(f"--levels {text!r}: {part!r} is no level; write as in 3-, 2-14 or 1,2,5-9 (level j has 2^j samples)")
        low = int(match[1]) if match[1] else 1
        high = int(match[3]) if match[3] else (highest if match[2] else low)
        found.update(range(max(low, 1), min(high, highest) + 1))
    if not found:
        raise UsageError(f"--levels {text!r}: no such level; there are 1 to {highest}")
    return tuple(sorted(found))


def add_arguments(parser: argparse.ArgumentParser, positive: Any) -> None:
    """The options of the verb; `positive` turns a text into a number above zero."""
    _files_anywhere(parser)
    parser.add_argument(
        "static", nargs="*", type=Path, metavar="STATIC", help="static recordings of one IMU, or a file of published variances"
    )
    parser.add_argument(
        "--flight",
        type=Path,
        metavar="FLIGHT",
        help="estimate noise from the innovations of this flight instead; each of several IMUs alone, the second into FILE_2",
    )
    parser.add_argument("--parameters", metavar="NAMES", help="with --flight: what to estimate, with commas between")
    where = "the noise model; its figures and table (.json) go beside it (default: imu_noise.toml, of a flight in_flight_noise.toml)"
    parser.add_argument("--out", type=Path, metavar="FILE", help=where)
    parser.add_argument("--force", action="store_true", help="take the place of files that are there")
    fit = parser.add_argument_group("model")
    models = f"such as WN+3GM, or several with commas to choose from (default: {' '.join(FAMILY)})"
    fit.add_argument("--model", metavar="SUM", help=f"processes QN WN GM RW DR, {models}")
    fit.add_argument("--gyro-model", metavar="SUM", help="of the gyroscopes, where it is another")
    fit.add_argument("--accel-model", metavar="SUM", help="of the accelerometers, where it is another")
    fit.add_argument(
        "--axes", choices=("separate", "joint"), default="separate", help="a model an axis, or one for the three (default: separate)"
    )
    fit.add_argument(
        "--levels", metavar="LEVELS", help="scales to fit: 3-, 2-14, 1,2,5- (level j: differences of means of 2^(j-1) samples)"
    )
    fit.add_argument(
        "--weights", choices=("auto", "full", "diagonal"), default="auto", help="efficient second step (default: where the model fits)"
    )
    fit.add_argument("--robust", action="store_true", help="wavelet variances that a few disturbances do not move")
    fit.add_argument("--sampling", choices=("point", "mean"), default="point", help="what a sample is of the process (default: point)")
    fit.add_argument(
        "--bootstrap",
        type=int,
        default=0,
        metavar="N",
        help="replicates for the J test and, from 100, intervals (default: 0)",
    )
    fit.add_argument("--seed", type=int, default=0, metavar="N", help="of the random numbers (default: 0)")
    read = parser.add_argument_group("reading")
    read.add_argument("--columns", metavar="NAMES", help="tow,gx,gy,gz,ax,ay,az in their order, or tow=Time,gx=...")
    read.add_argument("--rate", type=positive, metavar="HZ", help="samples a second, where there is no column of time")
    read.add_argument("--gyro-unit", metavar="UNIT", help="rad/s, deg/s, deg/h or that of one count, '0.05 deg/s' (default: by header)")
    read.add_argument("--accel-unit", metavar="UNIT", help="m/s^2, g, mg or that of one count, '3.33 mg' (default: by header)")
    read.add_argument("--time-unit", metavar="UNIT", help="s, ms, us, ns, unix, unix_ms, ... of the column of time (default: by header)")
    read.add_argument("--quantity", choices=("mean_rate", "increments", "instant_rate"), help="what a sample is (default: mean_rate)")
    read.add_argument("--variable", metavar="NAME", help="the table inside a file that holds several")
    read.add_argument(
        "--skip", type=_from_zero, default=0.0, metavar="MINUTES", help="left out at the beginning, where the sensor warms up"
    )
    read.add_argument("--keep", type=positive, metavar="MINUTES", help="used from there on (default: all)")
    read.add_argument("--bridge", type=_from_zero, default=0.0, metavar="SECONDS", help="fill gaps up to this length by straight lines")
    read.add_argument("--accept", action="append", default=[], metavar="CHECK", help="the name of a check that shall not stop")


def _from_zero(text: str) -> float:
    """A number of zero and more."""
    try:
        value = float(text)
    except ValueError:
        value = -1.0
    if not 0.0 <= value < float("inf"):
        raise argparse.ArgumentTypeError(f"{text!r} is no number from 0")
    return value


def _files_anywhere(parser: argparse.ArgumentParser) -> None:
    """Let recordings stand behind options, too, and a list of columns begin with the "-" that leaves one out."""
    plain = parser.parse_known_args

    def parse(args: Any = None, namespace: Any = None) -> tuple[Any, list[str]]:
        joined: list[str] = []
        for text in args or ():
            if joined and joined[-1] == "--columns" and re.match(r"-,", text):
                joined[-1] = f"--columns={text}"
            else:
                joined.append(text)
        found, left = plain(joined, namespace)
        if left and not any(text.startswith("-") for text in left):
            found.static, left = [*found.static, *map(Path, left)], []
        return found, left

    setattr(parser, "parse_known_args", parse)  # noqa: B010


def _columns(text: str | None) -> tuple[str, ...] | dict[str, str] | None:
    """Names in the order of the columns, or a mapping where each is given as name=column."""
    if text is None:
        return None
    if not text.strip():
        raise UsageError("--columns '': give names in the order of the columns, or leave the option out")
    parts = [part.strip() for part in text.split(",")]
    if not any("=" in part for part in parts):
        return tuple(parts)
    pairs = [(name.strip(), field.strip()) for name, _, field in (part.partition("=") for part in parts)]
    if not all(name and field for name, field in pairs):
        raise UsageError(f"--columns {text!r}: give names in the order of the columns, or every one as in tow=Time,gx=GyrX")
    return dict(pairs)


def options_of(given: argparse.Namespace) -> TuneOptions:
    """Options of the parsed command line."""
    keep = float("inf") if given.keep is None else 60.0 * given.keep
    if given.bootstrap < 0 or given.bootstrap == 1:
        raise UsageError(f"--bootstrap {given.bootstrap}: give 2 replicates at least, some hundreds for intervals, or 0 for none")
    if given.seed < 0:
        raise UsageError(f"--seed {given.seed}: give a whole number from 0")
    same = (
        "gyro_unit",
        "accel_unit",
        "time_unit",
        "quantity",
        "variable",
        "model",
        "gyro_model",
        "accel_model",
        "axes",
        "levels",
        "weights",
        "robust",
        "sampling",
        "bootstrap",
        "seed",
    )
    return TuneOptions(
        columns=_columns(given.columns),
        rate_hz=given.rate,
        skip_s=60.0 * given.skip,
        keep_s=keep,
        bridge_s=given.bridge,
        accept=tuple(given.accept),
        **{name: getattr(given, name) for name in same},
    )
