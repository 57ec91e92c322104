"""The verb `tune`: static recordings or a flight."""

import argparse
import re
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

from ..base.errors import UsageError
from ..flight.config.command_line import add_options, made_of
from ..io.options.schema import option
from ..noise.tuning.options import TuneOptions
from .verb import Verb

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


@dataclass(frozen=True)
class TuneRequest:
    """What is tuned, and where the files go."""

    static: tuple[Path, ...] = option(
        (), "static recordings of one IMU, or a file of published variances", cli="STATIC"
    )
    flight: Path | None = option(
        None,
        "estimate noise from the innovations of this flight instead; several IMUs are estimated"
        " one by one, the second is written to FILE_2",
        cli="--",
        metavar="FLIGHT",
    )
    parameters: str | None = option(
        None, "with --flight: what to estimate, with commas between", cli="--", metavar="NAMES"
    )
    out: Path | None = option(
        None,
        "the noise model to write; its page (.html) and table (.json) are written beside it",
        usual="imu_noise.toml, of a flight in_flight_noise.toml",
        cli="--",
    )
    force: bool = option(False, "overwrite files of other recordings", cli="--")


def tune(
    arguments: argparse.Namespace, progress: Callable[[str], None]
) -> "TuneResult | FlightTuning | SeveralTuned":
    """Do what the parsed command line asks for. Raises UsageError for what does not go together."""
    if arguments.flight is not None and arguments.static:
        raise UsageError(
            f"tune: both static recordings ({arguments.static[0]}) and --flight are given; choose"
            " one of them"
        )
    if arguments.flight is None and not arguments.static:
        raise UsageError(
            "tune: give static recordings, or --flight FLIGHT; see insgnss tune --help"
        )
    options = made_of(TuneOptions, arguments)
    if arguments.only is not None:
        from ..noise.tuning.some_channels import chosen_channels

        chosen_channels(arguments.only)
    if arguments.flight is None:
        if arguments.parameters:
            raise UsageError(
                "tune: --parameters belongs to --flight; --model names the processes of static"
                " recordings"
            )
        from ..noise.tuning.static import tune_static

        return tune_static(arguments.static, options, arguments.out, arguments.force, progress)
    if options != TuneOptions():
        raise UsageError(
            "tune: with --flight only --parameters, --out and --force have an effect; leave the"
            " other options out, the flight file states them"
        )
    from ..flight.config.load import load_flight
    from ..noise.tuning.several import tune_each

    names = (
        [name.strip() for name in arguments.parameters.split(",")] if arguments.parameters else None
    )
    return tune_each(load_flight(arguments.flight), arguments.out, names, progress, arguments.force)


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the options of the verb."""
    _files_anywhere(parser)
    add_options(parser, (TuneRequest, TuneOptions))


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
        parsed, positional = plain(joined, namespace)
        if positional and not any(text.startswith("-") for text in positional):
            parsed.static, positional = [*parsed.static, *map(Path, positional)], []
        return parsed, positional

    setattr(parser, "rearranged", parse)  # noqa: B010


VERB = Verb("tune", EXAMPLE, add_arguments, tune)
