"""The verb `compare`: its options and what it does with them."""

import argparse
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

from ..base.errors import UsageError
from ..base.inputs import sha256
from ..io.options.comparison_options import ComparisonOptions
from ..io.options.kinds import Checked
from ..io.options.schema import argument
from .verb import Verb

if TYPE_CHECKING:
    from ..base.files import Content
    from ..photogrammetry.comparison.result import Comparison

FORMS = (
    *("eo_json", "eo_local_plane", "metashape", "metashape_opk", "pix4d_matic", "pix4d_mapper"),
    *("realitycapture", "micmac", "inpho_ascii", "tum"),
    *("generic_ascii", "trajectory_csv", "sbet", "gnss", "mrk", "camera_positions", "odyn"),
    *("metashape_xml", "metashape_opk_text", "metashape_reference", "pix4d_external"),
    *("pix4d_camera", "colmap", "opensfm", "micmac_xml", "bentley"),
    *("inpho_prj", "ign_opk", "odm", "odm_shots", "geojson", "positions", "opf"),
)  # those of `photogrammetry.comparison.reading.FORMS`, named here so that help needs no numpy
EXAMPLE = """  insgnss compare eo.json truth/EO_local-plane.txt --page differences.html
  insgnss compare trajectory.sbet reference.pos --week 2008
  insgnss compare Adjustment Adjustment_without_gcp"""


@dataclass(frozen=True)
class Inputs(Checked):
    """What is compared."""

    a: Path = argument(
        ...,
        f"exterior orientation or trajectory: {', '.join(FORMS)}; or a directory or adjust.json of"
        " insgnss adjust; two of these are also compared in points and cameras",
        cli="A",
    )
    b: Path = argument(
        ..., "the second orientation or trajectory; differences are B minus A", cli="B"
    )


@dataclass(frozen=True)
class Products(Checked):
    """What is written."""

    figure: Path | None = argument(
        None, "write the differences as a picture: PNG, PDF or SVG according to the file's ending"
    )
    force: bool = argument(False, "overwrite a page or figure of other inputs")
    page: Path | None = argument(
        None, "write statistics and differences as an HTML page with charts that can be zoomed"
    )


def compare(arguments: argparse.Namespace, progress: Callable[[str], None]) -> "Comparison":
    """Do what the parsed command line asks for."""
    from ..base.files import atomic_writes
    from ..base.output.staging import together
    from ..photogrammetry.comparison.compare import compare_files

    progress("reading and matching")
    result = compare_files(arguments.a, arguments.b, **vars(arguments.records[ComparisonOptions]))
    files: dict[Path, Content] = {}
    if arguments.figure is not None:
        form = arguments.figure.suffix.lower().removeprefix(".")
        files[arguments.figure] = result.figure(form if form in ("pdf", "svg") else "png")
    if arguments.page is not None:
        files[arguments.page] = result.document(result.charts()).html()
    with together() as staging:
        atomic_writes(files)
        for _, goal in () if arguments.force else staging.changed():
            if goal != arguments.page or not _is_of_same_files(goal, [arguments.a, arguments.b]):
                raise UsageError(
                    f"compare: {goal} exists and was made from other inputs, or not by"
                    " compare; give another file, or --force"
                )
    return result


def _is_of_same_files(page: Path, inputs: Sequence[Path]) -> bool:
    """Tell whether a page is of a comparison of these files, by their hashes."""
    text = page.read_text(encoding="utf-8", errors="replace")
    return all(path.is_file() and sha256(path) in text for path in inputs)


VERB = Verb("compare", EXAMPLE, (Inputs, ComparisonOptions, Products), compare)
