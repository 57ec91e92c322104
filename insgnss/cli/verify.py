"""The verb `verify`: a part of a flight by the core and by its reference twin; a file of raw
observations by the reader and by georinex.
"""

import argparse
from dataclasses import dataclass
from pathlib import Path

from ..io.options.kinds import Checked
from ..io.options.schema import argument
from .console import Progress
from .verb import Judged, Verb

EXAMPLE = """  insgnss verify ign8/flight.toml
  insgnss verify ign8 --minutes 1 --start 381600
  insgnss verify rover.obs"""


@dataclass(frozen=True)
class VerifyRequest(Checked):
    """Options of the verb."""

    flight: Path = argument(
        ...,
        "the flight file, or the directory that holds flight.toml; or RINEX observations, which are"
        " compared with georinex value by value",
        cli="FLIGHT",
    )
    minutes: float = argument(
        2.0,
        "length of the part; the textbook implementation needs about ten seconds per minute of"
        " flight",
        positive=True,
        metavar="M",
    )
    start: float | None = argument(
        None,
        "time of week, s, at which it begins",
        usual="where the path is longest",
        metavar="TOW",
    )


def run(options: argparse.Namespace, progress: Progress) -> Judged:
    """Do what the parsed command line asks for."""
    if options.flight.is_file() and options.flight.suffix.lower() != ".toml":
        from ..gnss.rinex.against_georinex import compare_with_georinex

        compared = compare_with_georinex(options.flight, progress)
        return Judged(compared, compared.refusal, (options.flight,))
    from ..flight.config.load import load_flight
    from ..flight.reference.verify import verify

    result = verify(load_flight(options.flight), options.minutes, options.start, progress)
    return Judged(result, result.refusal, (options.flight,))


VERB = Verb("verify", EXAMPLE, (VerifyRequest,), run)
