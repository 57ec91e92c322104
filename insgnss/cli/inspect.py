"""The verb `inspect`: what a recording is, and a draft of its flight file."""

import argparse
from dataclasses import dataclass
from pathlib import Path

from ..io.options.kinds import Checked
from ..io.options.schema import argument
from .console import Progress
from .verb import Judged, Verb


@dataclass(frozen=True)
class InspectRequest(Checked):
    """Options of the verb."""

    source: tuple[Path, ...] = argument(
        ..., "a flight file, a directory, or the files of a recording", cli="SOURCE"
    )
    write: Path | None = argument(
        None,
        "write a flight file from what was found, with the noise model and a picture beside it",
        usual="flight.toml",
        alone=Path("flight.toml"),
        metavar="FLIGHT",
    )
    force: bool = argument(False, "let --write overwrite existing files", needs=("write",))


def run(options: argparse.Namespace, progress: Progress) -> Judged:
    """Do what the parsed command line asks for."""
    from ..flight.inspection.described import flight_file, inspect_flight
    from ..flight.inspection.run import inspect_files

    described = flight_file(options.source, options.write is not None)
    if described is not None:
        checked = inspect_flight(described, progress)
        return Judged(checked, checked.refusal, options.source)
    result = inspect_files(options.source, progress)
    if options.write is not None and not result.missing:
        progress("writing")
        result = result.write(options.write, options.force)
    return Judged(result, result.refusal, options.source)


VERB = Verb(
    "inspect",
    "  insgnss inspect ign8/flight.toml\n  insgnss inspect my_recording --write\n  insgnss inspect"
    " imu.csv gps.pos --write a.toml",
    (InspectRequest,),
    run,
)
