"""The verb `process`: raw data in, products out."""

import argparse
from pathlib import Path

from .console import Progress
from .verb import Verb, show


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the options of the verb."""
    parser.add_argument(
        "flight",
        type=Path,
        metavar="FLIGHT",
        help="the flight file, or the directory that holds flight.toml",
    )
    parser.add_argument(
        "--out",
        type=Path,
        metavar="DIR",
        help="where the products go (default: output.directory of the flight file)",
    )
    parser.add_argument(
        "--mounting",
        type=Path,
        metavar="FILE",
        help=(
            "tables [mounting] and [camera] time_offset_s, such as mounting.toml of insgnss adjust,"
            " in the place of those of the flight file"
        ),
    )
    parser.add_argument(
        "--force",
        action="store_true",
        help="overwrite results of other measurements (those of the same are overwritten anyway)",
    )
    parser.add_argument(
        "--engine",
        metavar="NAME",
        help=(
            "engine that solves gnss.rover, in the place of gnss.engine: pyrtklib5, or an rnx2rtkp"
            " by its path or its name on PATH"
        ),
    )


def run(options: argparse.Namespace, progress: Progress) -> int:
    """Do what the parsed command line asks for; return the exit code."""
    from ..flight.config.load import load_flight, remounted, with_engine

    flight = load_flight(options.flight)
    if options.mounting is not None:
        flight = remounted(flight, options.mounting)
    if options.engine is not None:
        flight = with_engine(flight, options.engine)
    from ..flight.processing import pipeline

    result = pipeline.process(flight, options.out, progress, force=options.force)
    return show(options, progress, result.summary, lambda: result.report)


VERB = Verb(
    "process",
    "raw data in, exterior orientation, trajectory and report out",
    "  insgnss process ign8/flight.toml --out results\n"
    "  insgnss process ign8/flight.toml --mounting adjusted/mounting.toml --out remounted",
    add_arguments,
    run,
)
