"""The verb `compare`: its options and what it does with them."""

import argparse
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from ..base.errors import UsageError
from ..base.inputs import sha256
from .console import Progress
from .verb import Verb, show_result

if TYPE_CHECKING:
    from ..base.files import Content
    from ..photogrammetry.comparison.result import Comparison

FORMS = (
    "eo_json",
    "eo_local_plane",
    "metashape",
    "metashape_opk",
    "pix4d_matic",
    "pix4d_mapper",
    "realitycapture",
    "inpho_ascii",
    "tum",
    "generic_ascii",
    "trajectory_csv",
    "sbet",
    "gnss",
    "odyn",
    "metashape_xml",
    "metashape_opk_text",
    "metashape_reference",
    "pix4d_external",
    "pix4d_camera",
    "colmap",
    "opensfm",
    "micmac_xml",
    "bentley",
    "inpho_prj",
)  # those of `photogrammetry.comparison.reading.FORMS`, named here so that help needs no numpy
EXAMPLE = """  insgnss compare eo.json truth/EO_local-plane.txt --page differences.html
  insgnss compare trajectory.sbet reference.pos --week 2008"""


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """The options of the verb."""
    parser.add_argument(
        "a", type=Path, metavar="A", help=f"exterior orientation or trajectory: {', '.join(FORMS)}"
    )
    parser.add_argument(
        "b", type=Path, metavar="B", help="the one to compare with it; differences are B minus A"
    )
    for side in "ab":
        parser.add_argument(
            f"--format-{side}",
            metavar="FORMAT",
            help=f"of {side.upper()}, where it does not show it; one of the formats above",
        )
    for side in "ab":
        undulation = (
            f"geoid above the ellipsoid, to be added to heights of {side.upper()}, positions of"
            " GNSS that are above the geoid"
        )
        parser.add_argument(f"--undulation-{side}", type=float, metavar="M", help=undulation)
    parser.add_argument(
        "--origin",
        metavar="LAT,LON,H",
        help="deg, deg, m: of a tangent plane whose file does not say it",
    )
    parser.add_argument("--crs", metavar="CRS", help="of projected coordinates, such as EPSG:2056")
    parser.add_argument(
        "--geoid",
        type=Path,
        metavar="GRID",
        help="grid of geoid heights, for projected heights above sea level",
    )
    parser.add_argument(
        "--week", type=int, metavar="N", help="GPS week, of files with the time of week only"
    )
    parser.add_argument(
        "--shift",
        type=float,
        default=0.0,
        metavar="S",
        help="seconds to be added to the times of B (default: 0)",
    )
    parser.add_argument(
        "--figure",
        type=Path,
        metavar="FILE",
        help="write the differences as a picture: PNG, or by its ending .pdf or .svg",
    )
    parser.add_argument(
        "--force", action="store_true", help="overwrite a page or figure of other inputs"
    )
    parser.add_argument(
        "--page",
        type=Path,
        metavar="FILE",
        help="write statistics and differences as a page, HTML, whose charts one can zoom",
    )


def compare(given: argparse.Namespace, progress: Callable[[str], None]) -> "Comparison":
    """Do what the parsed command line asks for. Raises UsageError for an origin that is none."""
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
        origin=_origin(given.origin),
        crs=given.crs,
        gps_week=given.week,
        geoid=given.geoid,
        time_shift_s=given.shift,
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


def _origin(text: str | None) -> tuple[float, float, float] | None:

    if text is None:
        return None
    try:
        lat, lon, height = (float(word) for word in text.split(","))
    except ValueError:
        raise UsageError(
            f"compare: --origin {text!r} is not latitude, longitude, height with commas, such as"
            " 46.57,6.54,0"
        ) from None
    return lat, lon, height


def run(options: argparse.Namespace, progress: Progress) -> int:
    """Do what the parsed command line asks for; return the exit code."""
    return show_result(options, progress, compare(options, progress))


VERB = Verb(
    "compare",
    "differences of two exterior orientations or trajectories, and which mistaken convention"
    " explains them",
    EXAMPLE,
    add_arguments,
    run,
)
