"""The verb `verify`: its options and what it does with them."""

import argparse
import math
from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from .verify import Verification

EXAMPLE = """  insgnss verify ign8/flight.toml
  insgnss verify ign8 --minutes 1 --start 381600"""


def add_arguments(parser: argparse.ArgumentParser, positive: Callable[[str], float]) -> None:
    """Add the options of the verb.

    Parameters
    ----------
    parser : of the verb.
    positive : reads a number greater than zero.
    """
    what = "the flight file, or the directory that holds flight.toml"
    parser.add_argument("flight", type=Path, metavar="FLIGHT", help=what)
    length = "length of the part (default: 2); the twin takes some ten seconds a minute"
    parser.add_argument("--minutes", type=positive, default=2.0, metavar="M", help=length)
    start = "time of week, s, at which it begins (default: where the path is longest)"
    parser.add_argument("--start", type=float, metavar="TOW", help=start)


def verify_verb(given: argparse.Namespace, progress: Callable[[str], None]) -> "Verification":
    """Do what the parsed command line asks for.

    Raises
    ------
    UsageError
        Where `--start` is no number of seconds.
    """
    from ..errors import UsageError
    from ..flight import load_flight
    from .verify import verify

    if given.start is not None and not math.isfinite(given.start):
        raise UsageError(f"verify: --start {given.start} is no time of week in seconds")
    return verify(load_flight(given.flight), given.minutes, given.start, progress)
