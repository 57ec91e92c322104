"""The verb `demo`: simulate a short flight, process it, compare with the truth."""

import argparse
from pathlib import Path

from .console import Progress
from .verb import Verb, positive, show_result


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the options of the verb."""
    parser.add_argument(
        "directory",
        nargs="?",
        type=Path,
        metavar="DIR",
        help="where the data set goes (default: insgnss_demo)",
    )
    parser.add_argument(
        "--minutes",
        type=positive,
        default=8.0,
        metavar="M",
        help="length of the flight (default: 8)",
    )
    parser.add_argument(
        "--seed", type=int, default=0, metavar="N", help="of the random numbers (default: 0)"
    )


def run(options: argparse.Namespace, progress: Progress) -> int:
    """Do what the parsed command line asks for; return the exit code."""
    from ..api.demo import demo

    result = demo(options.directory, options.minutes, options.seed, progress)
    return show_result(options, progress, result)


VERB = Verb(
    "demo",
    "simulate a short flight, process it, print the errors against truth, leave the report",
    "  insgnss demo\n  insgnss demo my_demo --minutes 10 --seed 7",
    add_arguments,
    run,
)
