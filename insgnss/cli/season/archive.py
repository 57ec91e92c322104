"""The verb `archive`: whether products can be made again from their inputs."""

import argparse
from pathlib import Path

from ..console import Progress
from ..verb import Verb, report_error, show_result

EXAMPLE = """  insgnss archive season
  insgnss archive season --remake"""


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the options of the verb."""
    parser.add_argument(
        "directory", type=Path, metavar="DIR", help="the directory of flights and their results"
    )
    parser.add_argument(
        "--remake",
        action="store_true",
        help="process every flight again in a temporary directory and compare byte for byte",
    )


def run(options: argparse.Namespace, progress: Progress) -> int:
    """Do what the parsed command line asks for; return the exit code."""
    from ...batch.season.archive import examine_archive

    result = examine_archive(options.directory, options.remake, progress)
    show_result(options, progress, result)
    if (refusal := result.refusal) is None:
        return 0
    report_error(f"error: {refusal}", refusal.exit_code, as_json=False)
    return refusal.exit_code


VERB = Verb(
    "archive",
    "check that every result below a directory can be made again from its inputs, by hashes and"
    " versions",
    EXAMPLE,
    add_arguments,
    run,
)
