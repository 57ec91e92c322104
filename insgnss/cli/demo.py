"""The verb `demo`: simulate a short flight, process it, compare with the truth."""

import argparse
from dataclasses import dataclass
from pathlib import Path

from ..io.options.kinds import Checked
from ..io.options.schema import argument
from .console import Progress
from .verb import Result, Verb


@dataclass(frozen=True)
class DemoRequest(Checked):
    """Options of the verb."""

    directory: Path | None = argument(
        None, "where the data set goes", cli="DIR", usual="insgnss_demo"
    )
    minutes: float = argument(8.0, "length of the flight", positive=True, metavar="M")
    seed: int = argument(0, "of the random numbers")


def run(options: argparse.Namespace, progress: Progress) -> Result:
    """Do what the parsed command line asks for."""
    from ..api.demo import demo

    return demo(options.directory, options.minutes, options.seed, progress)


VERB = Verb(
    "demo", "  insgnss demo\n  insgnss demo my_demo --minutes 10 --seed 7", (DemoRequest,), run
)
