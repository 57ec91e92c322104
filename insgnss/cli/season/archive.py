"""The verb `archive`: whether products can be made again from their inputs."""

import argparse
from dataclasses import dataclass
from pathlib import Path

from ...io.options.schema import argument
from ..console import Progress
from ..verb import Judged, Verb

EXAMPLE = """  insgnss archive season
  insgnss archive season --remake"""


@dataclass(frozen=True)
class ArchiveRequest:
    """Options of the verb."""

    directory: Path = argument(..., "the directory of flights and their results", cli="DIR")
    remake: bool = argument(
        False, "process every flight again in a temporary directory and compare byte for byte"
    )


def run(options: argparse.Namespace, progress: Progress) -> Judged:
    """Do what the parsed command line asks for."""
    from ...batch.season.archive import examine_archive

    result = examine_archive(options.directory, options.remake, progress)
    return Judged(result, result.refusal)


VERB = Verb("archive", EXAMPLE, (ArchiveRequest,), run)
