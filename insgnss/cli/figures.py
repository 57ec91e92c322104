"""The verb `figures`: the charts of a page as files for papers."""

import argparse
from pathlib import Path

from .console import Progress
from .verb import Verb, positive, show_result

EXAMPLE = """  insgnss figures results/02_Processed/GPS-INS/report.json --format pdf --out paper
  insgnss figures adjust.html --only map by-image --format svg
  insgnss figures report.html --width 84"""


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the options of the verb."""
    parser.add_argument(
        "source",
        type=Path,
        metavar="PAGE",
        help="a page that insgnss wrote (report.html, adjust.html, ...), or the JSON beside it",
    )
    parser.add_argument(
        "--format",
        choices=("pdf", "svg", "png"),
        default="pdf",
        help="of the files (default: pdf; PNG has 300 pixels to the inch)",
    )
    parser.add_argument(
        "--out",
        type=Path,
        metavar="DIR",
        help="where the files go (default: figures beside PAGE)",
    )
    parser.add_argument(
        "--only", nargs="+", default=[], metavar="NAME", help="names of charts (default: all)"
    )
    parser.add_argument(
        "--width",
        type=positive,
        default=174.0,
        metavar="MM",
        help="of each figure: 84 fills one column of a journal, 174 two of them (default: 174)",
    )
    parser.add_argument("--force", action="store_true", help="overwrite existing files")


def run(options: argparse.Namespace, progress: Progress) -> int:
    """Do what the parsed command line asks for; return the exit code."""
    from ..report.charts.files import figure_files

    progress("drawing")
    result = figure_files(
        options.source, options.format, options.out, options.only, options.width, options.force
    )
    return show_result(options, progress, result)


VERB = Verb(
    "figures",
    "the charts of a page of insgnss as PDF, SVG or PNG, one file a chart",
    EXAMPLE,
    add_arguments,
    run,
)
