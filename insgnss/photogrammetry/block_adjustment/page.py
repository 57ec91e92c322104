"""What an adjusted block says: the document of adjust.html and of the terminal."""

from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from ...base.provenance import paths_named_by
from ...io.formats.blocks.reading import parts_of_block
from ...io.formats.orientation.eo_covariance import FILE as STRIPS
from ...report.charts.chart import Chart
from ...report.document import Document, Drawing, Marked, Section, Table, limit_sentences, strong
from ...report.figures.block import Field, Ground, charts
from ...report.rules.wording import lengths
from ...report.verdict import Verdict, worst_of
from ..adjust.aerial import SHIFT
from .judgement import Judgement
from .solve import AdjustedBlock

MARKED_CORRELATION = 0.9  # a correlation that stands out
CONTROL_MODES = {
    "iso": "integrated sensor orientation",
    "indirect": "indirect: without aerial control",
    "fast_at": "Fast AT: ground points alone, camera held",
    "direct": "direct: poses and camera held",
}


def document_of(
    solved: AdjustedBlock,
    figures: Mapping[str, Any],
    judgement: Judgement,
    charts: Sequence[Chart] = (),
    files: Sequence[Path] = (),
) -> Document:
    """Return what an adjusted block says.

    Parameters
    ----------
    solved : AdjustedBlock
        The block.
    figures : mapping
        Its figures.
    judgement : Judgement
        What is said of it.
    charts : sequence of Chart
        Its charts, for the page.
    files : sequence of Path
        What was written.
    """
    stands_out = limit_sentences(judgement.findings, "contradiction") or [Marked("nothing", "text")]
    head = ("unknown", "verdict", "value")
    return Document(
        f"{figures['name']}: adjustment",
        judgement.headline,
        _verdict(judgement),
        (
            Section("What stands out", stands_out),
            *charts,
            _of_page("In numbers", Table(list(_numbers(figures)))),
            _of_page("What was determined", Table(judgement.determined, head)),
            *_tables(figures),
            Section("Notes", figures["notes"]),
        ),
        input_files(solved),
        settings={
            "mode": CONTROL_MODES[figures["mode"]],
            "block file": solved.inputs.file.path.name,
        },
        files=files,
    )


def charts_of(
    solved: AdjustedBlock, figures: Mapping[str, Any], judgement: Judgement
) -> tuple[Chart, ...]:
    """Return the charts of an adjusted block: residuals on the format, and maps."""
    fields = [
        Field(camera.name, (camera.width, camera.height), p.centre, p.mean, p.sigma)
        for camera, p in zip(solved.result.problem.block.cameras, judgement.patterns, strict=True)
    ]
    return tuple(charts(figures, fields, ground_of(solved)))


def input_files(solved: AdjustedBlock) -> list[Path]:
    """List every file that the adjustment depends on, none twice.

    Of the report beside an orientation only the mounting is taken, which the orientation has been
    made with: it is none of them, as it says the date of its run.

    Parameters
    ----------
    solved : AdjustedBlock
        The block.

    Returns
    -------
    list of Path
        The files.
    """
    file = solved.inputs.file
    named_files = [path for path in paths_named_by(file) if path != file.output.directory]
    poses = (file.aerial_control.file, file.vehicle.file)
    beside = [path.parent / STRIPS for path in poses if path and path.suffix.lower() == ".json"]
    parts = [] if file.images.file is None else parts_of_block(file.images.file)
    return [path for path in dict.fromkeys([*named_files, *beside, *parts]) if path.is_file()]


def ground_of(solved: AdjustedBlock) -> Ground:
    """Return where images and points lie.

    Parameters
    ----------
    solved : AdjustedBlock
        The block.

    Returns
    -------
    Ground
        What the maps show.
    """
    values = solved.result.values
    sigma = solved.precision.point_sigma
    good = np.isfinite(values.point[:, 0]) & np.isfinite(sigma).all(axis=1)
    return Ground(values.position, values.point[good], sigma[good], solved.control.lines)


def _verdict(judgement: Judgement) -> Verdict:
    """Return the verdict: that observations contradict each other, or what they leave open."""
    worst = [f.found for f in judgement.findings if f.rank >= 1.0][:1]
    undetermined = [name for name, word, _ in judgement.determined if word == "not determined"]
    good = "no observation group contradicts another"
    if undetermined:
        good += f"; not determined by this block, and held: {', '.join(undetermined)}"
    doubtful = [f.found for f in judgement.findings if f.verdict == "unknown"]
    return worst_of(good, doubtful, worst if judgement.contradicted else [])


def _of_page(title: str, table: Table, caption: str = "") -> Section:
    """Return a section of a table that only the page shows; empty without rows."""
    parts: list[str | Table | Drawing] = [table]
    if caption:
        parts.insert(0, Marked(caption, "soft"))
    return Section(title, parts if table.rows else [], "page")


def _numbers(figures: Mapping[str, Any]) -> Iterator[tuple[str, str]]:
    c, vehicle, points = figures["counts"], figures["vehicle"], figures["points"]
    yield "mode", CONTROL_MODES[figures["mode"]]
    yield "images", f"{c['images']}, {c['with_aerial_control']} with aerial control"
    yield "object points", f"{c['points']}"
    yield "image observations", f"{c['image_observations']}, {c['rejected']} rejected"
    yield "ground control, check points", f"{c['ground_control']}, {c['check_points']}"
    if vehicle is not None:
        text = f"{vehicle['exposures']}, {vehicle['left_out']} left out"
        yield "kinematic ground control", text
    yield "flight lines", _lines(figures)
    yield "redundancy", f"{figures['redundancy']}"
    yield "steps of the iteration", f"{figures['iterations']}"
    yield "covariance of aerial control", figures["covariance_of_aerial_control"]
    if (sigma := points["median_sigma_m"]) is not None:
        yield "median sigma of object points", lengths([1e3 * x for x in sigma])
    if (px := points["median_detectable_px"]) is not None:
        yield "gross error of an image observation that would show", f"{px:.1f} px"


def _lines(figures: Mapping[str, Any]) -> str:
    """Return the number of flight lines, and what is observed of them."""
    controls = Counter(line["control"] for line in figures["flight_lines"])
    of_controls = ", ".join(f"{control} of {count}" for control, count in controls.items())
    return f"{figures['counts']['flight_lines']}" + (f" ({of_controls})" if of_controls else "")


def _millimetres(values: Sequence[float | None], form: str = "+.1f") -> Iterator[str]:
    """Yield lengths, m, in millimetres; a dash for what is not known."""
    return ("–" if x is None else format(1e3 * x, form) for x in values)


def _pixels(values: Sequence[float | None], form: str) -> Iterator[str]:
    return ("–" if x is None else format(x, form) for x in values)


def _tables(figures: Mapping[str, Any]) -> Iterator[Section]:
    """Yield what the page has below the charts."""
    enu = ("E, mm", "N, mm", "U, mm")
    components = [
        (
            c["name"],
            str(c["observations"]),
            f"{c['redundancy']:.1f}",
            "–" if c["variance"] is None else f"{c['variance']:.3f}",
            "–" if c["factor"] == 1.0 else f"{c['factor'] ** 0.5:.3f}",
        )
        for c in figures["components"]
    ]
    head: tuple[str, ...] = ("observations", "number", "redundancy", "variance component")
    head += ("their sigmas were multiplied by",)
    yield _of_page("Variance components", Table(components, head, True))
    yield _flight_lines(figures)
    control = [
        (
            p["point"],
            str(p["images"]),
            *_millimetres(p["residual_m"]),
            f"{max(p['w'], key=abs):+.1f}",
            *_millimetres(p["detectable_m"], ".0f"),
        )
        for p in figures["ground_control"]
    ]
    head = ("point", "images", *enu, "largest w", "error that would show: E, mm", *enu[1:])
    title = "Ground control: surveyed minus adjusted"
    yield _of_page(title, Table(control, head, True, "points"))
    vehicle = [
        (
            p["image"],
            *_millimetres(p["residual_m"]),
            f"{max(p['w'], key=abs):+.1f}",
            *_pixels(p["residual_px"], "+.2f"),
            f"{p['size_px']:.2f} {p['size_residual_px']:+.2f}" if "size_px" in p else "–",
            "left out" if p["left_out"] else "",
        )
        for p in (figures["vehicle"] or {"points": ()})["points"]
    ]
    head = ("image", *enu, "largest w", "x, px", "y, px", "size and its residual, px", "")
    title = "Kinematic ground control: trajectory of the vehicle minus adjusted"
    yield _of_page(title, Table(vehicle, head, True, "exposures"))
    yield _check_points(figures, enu)
    yield from (_correlations(c) for c in figures["cameras"] if len(c["correlated"]) > 1)
    images = [
        (
            i["image"],
            str(i["observations"]),
            str(i["rejected"]),
            *_pixels([i["rms_px"]], ".2f"),
            lengths([1e3 * x for x in i["sigma_m"]]),
            " / ".join(f"{np.degrees(x):.4f}" for x in i["sigma_rad"]),
            lengths([1e3 * x for x in i["moved_m"]]) if "moved_m" in i else "no aerial control",
        )
        for i in figures["images"]
    ]
    head = ("image", "points", "rejected", "rms, px", "sigma E N U")
    head += ("sigma of attitude E N U, deg", "moved by")
    yield _of_page("Image by image", Table(images, head, True, "images"))
    rejected = [
        (r["image"], r["point"], *_pixels(r["residual_px"], "+.1f")) for r in figures["rejected"]
    ]
    name = "image observations that do not fit"
    yield _of_page("Rejected", Table(rejected, ("image", "point", "x, px", "y, px"), True, name))


def _flight_lines(figures: Mapping[str, Any]) -> Section:
    """Where flight lines were cut; images in none have none."""
    rows = [
        (
            str(number),
            line["first_image"],
            line["last_image"],
            str(line["images"]),
            line["control"],
            lengths([1e3 * x for x in line[SHIFT]]) if SHIFT in line else "–",
        )
        for number, line in enumerate(figures["flight_lines"], 1)
        if line["images"] > 1
    ]
    head = ("line", "first image", "last image", "images", "observed", "shift E N U")
    return _of_page("Flight lines as they were cut", Table(rows, head, True, "lines"))


def _check_points(figures: Mapping[str, Any], enu: tuple[str, ...]) -> Section:
    rows = [
        (
            p["point"],
            str(p["images"]),
            *(
                f"{1e3 * x:+.1f} ± {1e3 * s:.1f}"
                for x, s in zip(p["difference_m"], p["sigma_m"], strict=True)
            ),
            f"{p['normalised_square'] / 3.0:.2f}",
        )
        for p in figures["check_points"]
        if "difference_m" in p
    ]
    together = figures["check_points_together"]
    if rows:
        mean = together["normalised_square"] / together["degrees_of_freedom"]
        rows += [
            ("mean", "", *_millimetres(together["mean_m"]), ""),
            ("root mean square", "", *_millimetres(together["rms_m"], ".1f"), ""),
            ("largest", "", *_millimetres(together["largest_m"]), f"{mean:.2f} together"),
        ]
    square = (
        "difference squared over its variance: 1 is expected, over 3.8 stands once in 20 by chance"
    )
    table = Table(rows, ("point", "images", *enu, square), True, "points")
    return _of_page("Check points: surveyed minus adjusted", table)


def _correlations(camera: Mapping[str, Any]) -> Section:
    """Correlations of the interior orientation; strong ones stand out."""
    names, rho = camera["correlated"], camera["correlation"]
    rows = [
        (
            name,
            *(strong(f"{x:+.2f}", abs(x) > MARKED_CORRELATION) for x in rho[i][:i]),
            *[""] * (len(names) - i),
        )
        for i, name in enumerate(names)
    ]
    caption = (
        "coefficients of one polynomial are always strongly correlated; only their joint"
        " effect on an image ray matters"
    )
    title = f"Interior orientation: correlations of {camera['name']}"
    return _of_page(title, Table(rows, ("", *names), True), caption)
