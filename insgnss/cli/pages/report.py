"""The verb `report`: a page as a PDF to hand over."""

import argparse
from dataclasses import dataclass
from pathlib import Path

from ...io.options.kinds import Checked
from ...io.options.schema import argument
from ..console import Progress
from ..verb import Result, Verb

EXAMPLE = """  insgnss report results/02_Processed/GPS-INS/report.json
  insgnss report report.html --pdf ign8.pdf --appendix"""


@dataclass(frozen=True)
class ReportRequest(Checked):
    """Options of the verb."""

    source: Path = argument(
        ...,
        "a page that insgnss wrote (report.html, adjust.html, ...), or the JSON beside it",
        cli="PAGE",
    )
    pdf: Path | None = argument(
        None, "where the PDF goes", usual="PAGE with the ending .pdf", metavar="FILE"
    )
    appendix: bool = argument(False, "print also the details that are not in the summary")
    force: bool = argument(False, "overwrite an existing file")


def run(options: argparse.Namespace, progress: Progress) -> Result:
    """Do what the parsed command line asks for."""
    from ...report.printed import print_page

    progress("printing")
    return print_page(options.source, options.pdf, options.appendix, options.force)


VERB = Verb("report", EXAMPLE, (ReportRequest,), run)
