"""The verb `process`: raw data in, products out."""

import argparse
from dataclasses import dataclass
from pathlib import Path

from ..io.options.schema import argument
from .console import Progress
from .verb import Result, Verb


@dataclass(frozen=True)
class ProcessRequest:
    """Options of the verb."""

    flight: Path = argument(
        ..., "the flight file, or the directory that holds flight.toml", cli="FLIGHT"
    )
    out: Path | None = argument(
        None, "where the products go", usual="output.directory of the flight file", metavar="DIR"
    )
    mounting: Path | None = argument(
        None,
        "file whose tables [mounting] and [camera] time_offset_s replace those of the flight"
        " file, such as mounting.toml of insgnss adjust",
    )
    force: bool = argument(False, "overwrite results even if they came from other measurements")
    engine: str | None = argument(
        None,
        "GNSS engine for gnss.rover, instead of gnss.engine: pyrtklib5, or the path or name of an"
        " rnx2rtkp",
    )


def run(options: argparse.Namespace, progress: Progress) -> Result:
    """Do what the parsed command line asks for."""
    from ..flight.config.load import load_flight, with_engine, with_mounting_file

    flight = load_flight(options.flight)
    if options.mounting is not None:
        flight = with_mounting_file(flight, options.mounting)
    if options.engine is not None:
        flight = with_engine(flight, options.engine)
    from ..batch.season.earlier import earlier_flights
    from ..flight.processing import pipeline

    force, compare = options.force, earlier_flights
    return pipeline.process(flight, options.out, progress, force=force, compare=compare)


VERB = Verb(
    "process",
    "  insgnss process ign8/flight.toml --out results\n"
    "  insgnss process ign8/flight.toml --mounting adjusted/mounting.toml --out remounted",
    (ProcessRequest,),
    run,
)
