"""report.html, one page that needs nothing else: data and what draws them are in it.

It is for the person who has to trust the images.

The order is that of the questions: what accuracy, what limits it, where, image by image, line by
line, how it looks, what was checked and thrown away, from what it was made. Every text is escaped;
charts and the table of images are drawn by the page's own script.
"""

from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from types import MappingProxyType
from typing import Any

from ..base.files import atomic_write, json_ready, text_sha256
from ..records import Diagnostics, ExteriorOrientation
from . import sections
from .charts.chart import Background, Chart
from .charts.run import charts
from .document import Document, Section
from .image_table import image_table, track
from .rules.wording import local_zone
from .sections import made_from
from .verdict import run_verdict


def write_report(
    path: str | Path,
    summary: Mapping[str, Any],
    diagnostics: Diagnostics,
    eo: ExteriorOrientation | None,
    series: Mapping[str, Any] | None = None,
    report_sha256: str = "",
    background: Background | None = None,
) -> Path:
    """Write the page, whole or not at all; returns where it is.

    Parameters
    ----------
    path : the file, or a directory that gets report.html.
    summary : of `summary.run_summary`.
    eo : None without a camera.
    series : what the source of the fixes says of each epoch, as `charts.gnss` takes it.
    report_sha256 : SHA-256 of the text of report.json of the same run, as `write_report_json`
        returns it.
    background : what the map shows below the flight.
    """
    path = Path(path)
    if path.is_dir():
        path = path / "report.html"
    shown = charts(diagnostics, eo, summary["standing"], series or None, background)
    data: dict[str, Any] = {"track": track(diagnostics)}
    if eo is not None and eo.images:
        data["images"] = image_table(diagnostics, eo, local_zone(summary))
    atomic_write(path, page(summary, shown, data, report_sha256))
    return path


def write_report_json(summary: Mapping[str, Any], path: str | Path) -> str:
    """Write `summary` to `path`, whole or not at all; returns the SHA-256 of the text."""
    import orjson

    form = orjson.OPT_INDENT_2 | orjson.OPT_APPEND_NEWLINE
    form |= orjson.OPT_SERIALIZE_NUMPY | orjson.OPT_NON_STR_KEYS
    text = orjson.dumps(summary, default=json_ready, option=form).decode()
    atomic_write(path, text)
    return text_sha256(text)


def page(
    summary: Mapping[str, Any],
    shown: Sequence[Chart],
    data: Mapping[str, Any] = MappingProxyType({}),
    report_sha256: str = "",
) -> Iterator[str]:
    """The HTML of the page, piece by piece.

    Parameters
    ----------
    shown : the charts.
    data : what the script needs besides by name: "images" and "track" of `image_table`.
    report_sha256 : SHA-256 of the text of report.json.
    """
    document = run_document(summary, shown, with_images="images" in data)
    yield from document.html(tuple(made_from(summary)), data, report_sha256)


def run_document(
    summary: Mapping[str, Any],
    shown: Sequence[Chart] = (),
    with_images: bool = False,
    files: Sequence[Path] = (),
) -> Document:
    """Return the document of a run: what accuracy, what limits it, where, how it looks.

    Parameters
    ----------
    summary : of `summary.run_summary`, with its exports where there are any.
    shown : the charts.
    with_images : whether the page has data of the table of images.
    files : what was written.
    """
    name = summary["name"] or "flight"
    return Document(
        f"{name}: insgnss report",
        summary["headline"],
        run_verdict(summary)._replace(phrase="Why"),  # the headline begins with the phrase
        tuple(_sections(summary, shown, with_images)),
        files=files,
        heading=name,
        about=sections.about(summary),
    )


def _sections(
    s: Mapping[str, Any], shown: Sequence[Chart], with_images: bool
) -> Iterator[Section | Chart]:
    pending, moving = {chart.name: chart for chart in shown}, not s["standing"]

    def of(*names: str) -> Iterator[Chart]:
        return (pending.pop(name) for name in names if name in pending)

    yield sections.limits(s)
    notes = (note for export in s.get("exports", ()) for note in export["notes"])
    yield Section("Notes on the exports", tuple(dict.fromkeys(notes)))
    yield from of("map")
    if with_images:
        yield sections.images(s)
    yield sections.flight_lines(s)
    yield sections.earlier(s)
    yield sections.hidden(s)
    yield sections.settings(s)
    if moving:
        yield sections.fixes_by_line(s)
    yield sections.key_numbers(s)
    yield from of("motion", "sigmas", "image-sigmas")
    yield from of("innovations", "innovation-distribution", "nis-distribution")
    if moving:
        yield sections.innovations(s)
        yield from of("residuals")
        yield sections.residuals(s)
    yield from of("biases")
    yield sections.constants(s)
    yield from of("constants", "separation", "gnss-solution", "gnss-signals", *pending)
    if moving:
        yield from (sections.rejected(s), sections.gaps(s))
    yield from (sections.segments_and_stationary_periods(s), sections.checks(s))
