"""The verb `doctor`: what an installation is and lacks, and whether its core counts right."""

import argparse
from dataclasses import dataclass

from ..base.errors import UsageError
from ..io.options.schema import argument
from .console import Progress
from .verb import Judged, Result, Verb

EXAMPLE = """  insgnss doctor
  insgnss doctor --compile
  insgnss doctor --json > doctor.json
  insgnss doctor --limits"""


@dataclass(frozen=True)
class DoctorRequest:
    """Options of the verb."""

    compile: bool = argument(
        False,
        "compile the kernels of process and demo now, on all processors, so that the first run"
        " is not slow",
    )
    limits: bool = argument(
        False,
        "instead of all checks, list the numeric constants of insgnss, each with its"
        " value and reason",
    )


def run(options: argparse.Namespace, progress: Progress) -> Result | Judged:
    """Do what the parsed command line asks for."""
    if options.limits:
        if options.compile:
            raise UsageError(
                "--limits and --compile: --limits only lists constants; leave one of the two out"
            )
        from ..batch.installation.limits import read_limits

        return read_limits()
    from ..batch.installation.examination import examine

    result = examine(progress, options.compile)
    return Judged(result, result.refusal)


VERB = Verb("doctor", EXAMPLE, (DoctorRequest,), run)
