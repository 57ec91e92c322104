"""The verb `compare`: its options and what it does with them."""

import argparse
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING

from ..base.errors import UsageError
from ..base.inputs import sha256
from ..io.options.kinds import Checked
from ..io.options.schema import argument
from .console import Progress
from .verb import Verb, show_result

if TYPE_CHECKING:
    from ..base.files import Content
    from ..photogrammetry.comparison.result import Comparison

FORMS = (
    *("eo_json", "eo_local_plane", "metashape", "metashape_opk", "pix4d_matic", "pix4d_mapper"),
    *("realitycapture", "micmac", "inpho_ascii", "tum", "odm"),
    *("generic_ascii", "trajectory_csv", "sbet", "gnss", "mrk", "camera_positions", "odyn"),
    *("metashape_xml", "metashape_opk_text", "metashape_reference", "pix4d_external"),
    *("pix4d_camera", "colmap", "opensfm", "micmac_xml", "bentley"),
    *("inpho_prj", "ign_opk", "odm_shots", "opf"),
)  # those of `photogrammetry.comparison.reading.FORMS`, named here so that help needs no numpy
EXAMPLE = """  insgnss compare eo.json truth/EO_local-plane.txt --page differences.html
  insgnss compare trajectory.sbet reference.pos --week 2008"""


GEOID = "geoid above the ellipsoid, to be added to heights of"
GNSS = ", positions of GNSS that are above the geoid"
_form = partial(argument, metavar="FORMAT")


@dataclass(frozen=True)
class Request(Checked):
    """Options of the verb."""

    a: Path = argument(..., f"exterior orientation or trajectory: {', '.join(FORMS)}", cli="A")
    b: Path = argument(..., "the one to compare with it; differences are B minus A", cli="B")
    format_a: str | None = _form(None, "of A, where it does not show it; one of the formats above")
    format_b: str | None = _form(None, "of B, where it does not show it; one of the formats above")
    undulation_a: float | None = argument(None, f"{GEOID} A{GNSS}", metavar="M")
    undulation_b: float | None = argument(None, f"{GEOID} B{GNSS}", metavar="M")
    origin: tuple[float, float, float] | None = argument(
        None,
        "deg, deg, m: of a tangent plane whose file does not say it",
        kind="place",
        metavar="LAT,LON,H",
    )
    crs: str | None = argument(
        None, "of coordinates whose file does not name it, such as EPSG:2056", metavar="CRS"
    )
    coordinate_shift: tuple[float, float, float] | None = argument(
        None,
        "what was subtracted from projected coordinates, in their unit",
        kind="pair",
        metavar="E,N,H",
    )
    geoid: Path | None = argument(
        None, "grid of geoid heights, for projected heights above sea level", metavar="GRID"
    )
    week: int | None = argument(None, "GPS week, of files with the time of week only")
    shift: float = argument(0.0, "seconds to be added to the times of B", metavar="S")
    figure: Path | None = argument(
        None, "write the differences as a picture: PNG, or by its ending .pdf or .svg"
    )
    force: bool = argument(False, "overwrite a page or figure of other inputs")
    page: Path | None = argument(
        None, "write statistics and differences as a page, HTML, whose charts one can zoom"
    )


def compare(given: argparse.Namespace, progress: Callable[[str], None]) -> "Comparison":
    """Do what the parsed command line asks for."""
    from ..base.files import atomic_writes
    from ..base.output.staging import together
    from ..photogrammetry.comparison.compare import compare_files

    progress("reading and matching")
    result = compare_files(
        given.a,
        given.b,
        form_a=given.format_a,
        form_b=given.format_b,
        undulation_m=(given.undulation_a, given.undulation_b),
        origin=given.origin,
        crs=given.crs,
        gps_week=given.week,
        geoid=given.geoid,
        time_shift_s=given.shift,
        coordinate_shift=given.coordinate_shift,
    )
    files: dict[Path, Content] = {}
    if given.figure is not None:
        form = given.figure.suffix.lower().removeprefix(".")
        files[given.figure] = result.figure(form if form in ("pdf", "svg") else "png")
    if given.page is not None:
        files[given.page] = result.document(result.charts()).html()
    with together() as staging:
        atomic_writes(files)
        for _, goal in () if given.force else staging.changed():
            if goal != given.page or not _of_same(goal, [given.a, given.b]):
                raise UsageError(
                    f"compare: {goal} is there and of other inputs, or of others; give another"
                    " file, or --force"
                )
    return result


def _of_same(page: Path, inputs: Sequence[Path]) -> bool:
    """Tell whether a page is of a comparison of these files, by their hashes."""
    text = page.read_text(encoding="utf-8", errors="replace")
    return all(path.is_file() and sha256(path) in text for path in inputs)


def run(options: argparse.Namespace, progress: Progress) -> int:
    """Do what the parsed command line asks for; return the exit code."""
    return show_result(options, progress, compare(options, progress))


VERB = Verb(
    "compare",
    "differences of two exterior orientations or trajectories, and which mistaken convention"
    " explains them",
    EXAMPLE,
    (Request,),
    run,
)
