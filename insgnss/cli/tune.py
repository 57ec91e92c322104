"""The verb `tune`: static recordings or a flight."""

import argparse
import re
from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING, Any

from ..base.errors import UsageError
from ..noise.tuning.options import FAMILY, TuneOptions
from .console import Progress
from .verb import Verb, positive, show_result

if TYPE_CHECKING:
    from ..noise.tuning.in_flight.estimation import FlightTuning
    from ..noise.tuning.result import TuneResult
    from ..noise.tuning.several import SeveralTuned


EXAMPLE = """\
  insgnss tune static1.csv static2.csv --gyro-model WN+3GM --accel-model WN+2GM \\
      --axes joint --out navchip.toml
  insgnss tune static.npy --rate 100 --gyro-unit "0.05 deg/s" --accel-unit "3.33 mg"
  insgnss tune variances.json --gyro-unit rad/s --accel-unit m/s^2 --model WN+2GM --levels 6-
  insgnss tune --flight flight.toml"""


def tune(
    given: argparse.Namespace, progress: Callable[[str], None]
) -> "TuneResult | FlightTuning | SeveralTuned":
    """Do what the parsed command line asks for. Raises UsageError for what does not go together."""
    if given.flight is not None and given.static:
        raise UsageError(
            f"tune: both static recordings ({given.static[0]}) and --flight are given; choose one"
            " of them"
        )
    if given.flight is None and not given.static:
        raise UsageError(
            "tune: give static recordings, or --flight FLIGHT; see insgnss tune --help"
        )
    options = options_of(given)
    if given.only is not None:
        from ..noise.tuning.some_channels import chosen_channels

        chosen_channels(given.only)
    if given.flight is None:
        if given.parameters:
            raise UsageError(
                "tune: --parameters belongs to --flight; --model names the processes of static"
                " recordings"
            )
        from ..noise.tuning.static import tune_static

        return tune_static(given.static, options, given.out, given.force, progress)
    if options != TuneOptions():
        raise UsageError(
            "tune: with --flight only --parameters, --out and --force have a meaning; the flight"
            " file says the rest"
        )
    from ..flight.config.load import load_flight
    from ..noise.tuning.several import tune_each

    names = [name.strip() for name in given.parameters.split(",")] if given.parameters else None
    return tune_each(load_flight(given.flight), given.out, names, progress, given.force)


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """The options of the verb."""
    _files_anywhere(parser)
    parser.add_argument(
        "static",
        nargs="*",
        type=Path,
        metavar="STATIC",
        help="static recordings of one IMU, or a file of published variances",
    )
    parser.add_argument(
        "--flight",
        type=Path,
        metavar="FLIGHT",
        help=(
            "estimate noise from the innovations of this flight instead; each of several IMUs"
            " alone, the second into FILE_2"
        ),
    )
    parser.add_argument(
        "--parameters", metavar="NAMES", help="with --flight: what to estimate, with commas between"
    )
    where = (
        "the noise model; its figures and table (.json) go beside it (default: imu_noise.toml, of a"
        " flight in_flight_noise.toml)"
    )
    parser.add_argument("--out", type=Path, metavar="FILE", help=where)
    parser.add_argument("--force", action="store_true", help="overwrite files of other recordings")
    _add_model(parser)
    _add_reading(parser)


def _add_model(parser: argparse.ArgumentParser) -> None:
    """Add what chooses and fits the model."""
    fit = parser.add_argument_group("model")
    models = f"such as WN+3GM, or several with commas to choose from (default: {' '.join(FAMILY)})"
    fit.add_argument("--model", metavar="SUM", help=f"processes QN WN GM RW DR, {models}")
    fit.add_argument("--gyro-model", metavar="SUM", help="of the gyroscopes, where it is another")
    fit.add_argument(
        "--accel-model", metavar="SUM", help="of the accelerometers, where it is another"
    )
    fit.add_argument(
        "--axes",
        choices=("separate", "joint"),
        default="separate",
        help="a model an axis, or one for the three (default: separate)",
    )
    fit.add_argument(
        "--levels",
        metavar="LEVELS",
        help="scales to fit: 3-, 2-14, 1,2,5- (level j: differences of means of 2^(j-1) samples)",
    )
    fit.add_argument(
        "--weights",
        choices=("auto", "full", "diagonal"),
        default="auto",
        help="efficient second step (default: where the model fits)",
    )
    fit.add_argument(
        "--robust",
        action=argparse.BooleanOptionalAction,
        help="wavelet variances that disturbances do not move (default: where there are some)",
    )
    fit.add_argument(
        "--sampling",
        choices=("point", "mean"),
        default="point",
        help="what a sample is of the process (default: point)",
    )
    fit.add_argument(
        "--bootstrap",
        type=int,
        default=0,
        metavar="N",
        help="replicates for the J test and, from 100, intervals (default: 0)",
    )
    fit.add_argument(
        "--seed", type=int, default=0, metavar="N", help="of the random numbers (default: 0)"
    )


def _add_reading(parser: argparse.ArgumentParser) -> None:
    """Add how the recordings are read."""
    read = parser.add_argument_group("reading")
    read.add_argument(
        "--columns",
        metavar="NAMES",
        help="tow,gx,gy,gz,ax,ay,az in their order, or tow=Time,gx=...",
    )
    read.add_argument(
        "--rate",
        type=positive,
        metavar="HZ",
        help="samples a second, where there is no column of time",
    )
    read.add_argument(
        "--gyro-unit",
        metavar="UNIT",
        help="rad/s, deg/s, deg/h or that of one count, '0.05 deg/s' (default: by header)",
    )
    read.add_argument(
        "--accel-unit",
        metavar="UNIT",
        help="m/s^2, g, mg or that of one count, '3.33 mg' (default: by header)",
    )
    read.add_argument(
        "--time-unit",
        metavar="UNIT",
        help="s, ms, us, ns, unix, unix_ms, ... of the column of time (default: by header)",
    )
    read.add_argument(
        "--quantity",
        choices=("mean_rate", "increments", "instant_rate"),
        help="what a sample is (default: mean_rate)",
    )
    read.add_argument(
        "--variable", metavar="NAME", help="the table inside a file that holds several"
    )
    read.add_argument(
        "--only",
        metavar="NAMES",
        help=(
            "tune these channels alone: gyro, accel, gyro_z, ... with commas between (default:"
            " those that the file has)"
        ),
    )
    read.add_argument(
        "--skip",
        type=_from_zero,
        default=0.0,
        metavar="MINUTES",
        help="left out at the beginning, where the sensor warms up",
    )
    read.add_argument(
        "--keep", type=positive, metavar="MINUTES", help="used from there on (default: all)"
    )
    read.add_argument(
        "--bridge",
        type=_from_zero,
        default=0.0,
        metavar="SECONDS",
        help="fill gaps up to this length by straight lines",
    )
    read.add_argument(
        "--accept",
        action="append",
        default=[],
        metavar="CHECK",
        help="the name of a check that shall not stop",
    )


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
    """Let recordings stand behind options, too.

    A list of columns may begin with the "-" that leaves one out.
    """

    def parse(plain: Callable[..., Any], args: Any, namespace: Any) -> tuple[Any, list[str]]:
        joined: list[str] = []
        for text in args or ():
            if joined and joined[-1] == "--columns" and re.match(r"-,", text):
                joined[-1] = f"--columns={text}"
            else:
                joined.append(text)
        parsed, left = plain(joined, namespace)
        if left and not any(text.startswith("-") for text in left):
            parsed.static, left = [*parsed.static, *map(Path, left)], []
        return parsed, left

    setattr(parser, "rearranged", parse)  # noqa: B010


def _columns(text: str | None) -> tuple[str, ...] | dict[str, str] | None:
    """Names in the order of the columns, or a mapping where each is given as name=column."""
    if text is None:
        return None
    if not text.strip():
        raise UsageError(
            "--columns '': give names in the order of the columns, or leave the option out"
        )
    parts = [word.strip() for word in text.split(",")]
    if not any("=" in word for word in parts):
        return tuple(parts)
    pairs = [
        (name.strip(), field.strip()) for name, _, field in (word.partition("=") for word in parts)
    ]
    if not all(name and field for name, field in pairs):
        raise UsageError(
            f"--columns {text!r}: give names in the order of the columns, or every one as in"
            " tow=Time,gx=GyrX"
        )
    return dict(pairs)


def options_of(given: argparse.Namespace) -> TuneOptions:
    """Options of the parsed command line."""
    keep = float("inf") if given.keep is None else 60.0 * given.keep
    if given.bootstrap < 0 or given.bootstrap == 1:
        raise UsageError(
            f"--bootstrap {given.bootstrap}: give 2 replicates at least, some hundreds for"
            " intervals, or 0 for none"
        )
    if given.seed < 0:
        raise UsageError(f"--seed {given.seed}: give a whole number from 0")
    same = (
        "gyro_unit",
        "accel_unit",
        "time_unit",
        "quantity",
        "variable",
        "only",
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


def run(options: argparse.Namespace, progress: Progress) -> int:
    """Do what the parsed command line asks for; return the exit code."""
    return show_result(options, progress, tune(options, progress))


VERB = Verb(
    "tune",
    "a noise model, with its uncertainty, from static recordings of an IMU or from the innovations"
    " of a flight",
    EXAMPLE,
    add_arguments,
    run,
)
