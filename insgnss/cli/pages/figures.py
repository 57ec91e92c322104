"""The verb `figures`: the charts of a page as files for papers."""

import argparse
from dataclasses import dataclass
from pathlib import Path
from typing import Literal

from ...io.options.kinds import Checked
from ...io.options.schema import argument
from ..console import Progress
from ..verb import Result, Verb

EXAMPLE = """  insgnss figures results/02_Processed/GPS-INS/report.json --format pdf --out paper
  insgnss figures adjust.html --only map by-image --format svg
  insgnss figures report.html --width 84"""


@dataclass(frozen=True)
class FiguresRequest(Checked):
    """Options of the verb."""

    source: Path = argument(
        ...,
        "a page that insgnss wrote (report.html, adjust.html, ...), or the JSON beside it",
        cli="PAGE",
    )
    format: Literal["pdf", "svg", "png"] = argument(
        "pdf", "format of the files; PNG has 300 pixels per inch"
    )
    out: Path | None = argument(
        None, "where the files go", usual="figures beside PAGE", metavar="DIR"
    )
    only: tuple[str, ...] = argument((), "names of charts", usual="all")
    width: float = argument(
        174.0,
        "width of each figure: 84 is one column of a journal, 174 two columns",
        unit="mm",
        positive=True,
    )
    force: bool = argument(False, "overwrite existing files")


def run(options: argparse.Namespace, progress: Progress) -> Result:
    """Do what the parsed command line asks for."""
    from ...report.charts.files import figure_files

    progress("drawing")
    return figure_files(
        options.source, options.format, options.out, options.only, options.width, options.force
    )


VERB = Verb("figures", EXAMPLE, (FiguresRequest,), run)
