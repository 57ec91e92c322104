"""The verb `verify`: a part of a flight by the core and by its reference twin; a file of raw
observations by the reader and by georinex.
"""

import argparse
import math
from pathlib import Path

from ..base.errors import UsageError
from .console import Progress
from .verb import Verb, positive, show_judged

EXAMPLE = """  insgnss verify ign8/flight.toml
  insgnss verify ign8 --minutes 1 --start 381600
  insgnss verify rover.obs"""


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the options of the verb."""
    flight = (
        "the flight file, or the directory that holds flight.toml; or RINEX observations, which are"
        " compared with georinex value by value"
    )
    parser.add_argument("flight", type=Path, metavar="FLIGHT", help=flight)
    length = "length of the part (default: 2); the twin takes some ten seconds a minute"
    parser.add_argument("--minutes", type=positive, default=2.0, metavar="M", help=length)
    start = "time of week, s, at which it begins (default: where the path is longest)"
    parser.add_argument("--start", type=float, metavar="TOW", help=start)


def run(options: argparse.Namespace, progress: Progress) -> int:
    """Do what the parsed command line asks for; return the exit code.

    Raises
    ------
    UsageError
        Where `--start` is no number of seconds.
    """
    if options.flight.is_file() and options.flight.suffix.lower() != ".toml":
        from ..gnss.rinex.against_georinex import compare_with_georinex

        compared = compare_with_georinex(options.flight, progress)
        return show_judged(options, progress, compared, options.flight)
    from ..flight.config.load import load_flight
    from ..flight.reference.verify import verify

    if options.start is not None and not math.isfinite(options.start):
        raise UsageError(
            f"verify: --start {options.start} is no time of week in seconds; give one of"
            " the flight's"
        )
    result = verify(load_flight(options.flight), options.minutes, options.start, progress)
    return show_judged(options, progress, result, options.flight)


VERB = Verb(
    "verify",
    "a part of a flight by the core and by a textbook implementation, and their largest difference"
    " in sigmas; raw observations by two readers",
    EXAMPLE,
    add_arguments,
    run,
)
