"""`insgnss figures`: the charts of a page as files for papers, one a chart.

A page carries its charts as data, and the SHA-256 of the JSON document that was written with it. A
JSON document is opened by the page beside it, and refused where that is of another run.
"""

import re
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, get_args

import numpy as np

from ...base.errors import InputError, UsageError, near
from ...base.files import atomic_write
from ...base.inputs import is_file, read_text, sha256
from ...base.output.staging import together
from .chart import Chart, Ink, Kind, Layer, Link, Mark, Panel, Scale
from .drawn import CHART_FILES, PRINTED_PAGE, Form, Paper, draw
from .encoded import in_page, is_jpeg

FOLDER = "figures"
NARROWEST_MM, WIDEST_MM = 40.0, 500.0  # letters fill a narrower picture; no page is wider
DPI = 300  # as journals ask for


@dataclass(frozen=True)
class Figures:
    """The files that were written, and of which page."""

    page: Path
    files: tuple[Path, ...]

    def summary(self) -> str:
        """Return the text for the terminal."""
        return "\n".join([f"{len(self.files)} figures of {self.page}", *map(str, self.files)])

    def as_dict(self) -> dict[str, Any]:
        """Return the document for machines."""
        return {"page": str(self.page), "files": [str(file) for file in self.files]}


def figure_files(
    source: Path,
    form: Form = "pdf",
    out: Path | None = None,
    only: Sequence[str] = (),
    width_mm: float = PRINTED_PAGE.width_mm,
    force: bool = False,
) -> Figures:
    """Draw the charts of a page into files named by them.

    Parameters
    ----------
    source : Path
        A page of insgnss, or the JSON document beside it.
    form : str
        "pdf", "svg" or "png".
    out : Path, optional
        Directory of the files, made where it is missing; by default `figures` beside the page.
    only : sequence of str
        Names of charts; all of them where empty.
    width_mm : float
        Of each figure.
    force : bool
        Overwrite files.

    Returns
    -------
    Figures
        The files.

    Raises
    ------
    InputError
        The page is not there, of another run or damaged.
    UsageError
        A chart, form or width is unknown, or a file exists already.
    """
    if form not in CHART_FILES:
        raise UsageError(
            f"figures: format {form!r} is unknown; it is one of {', '.join(CHART_FILES)}"
        )
    if not NARROWEST_MM <= width_mm <= WIDEST_MM:
        raise UsageError(
            f"figures: a width of {width_mm:g} mm; give {NARROWEST_MM:g} to {WIDEST_MM:g}"
        )
    page, charts = charts_of(source)
    names = [chart.name for chart in charts]
    for name in only:
        if name not in names:
            raise UsageError(f"figures: {page} has no chart {name!r}; {near(name, names)}")
    folder = page.parent / FOLDER if out is None else out
    chosen = [chart for chart in charts if not only or chart.name in only]
    files = tuple(folder / f"{chart.name}.{form}" for chart in chosen)
    _refuse_present(folder, files, force)
    paper = Paper(width_mm, DPI)
    with together() as staging:
        into = staging.tree(folder)
        for chart, file in zip(chosen, files, strict=True):
            atomic_write(into / file.name, draw(chart, form, paper))
    return Figures(page, files)


def _refuse_present(folder: Path, files: Sequence[Path], force: bool) -> None:
    if folder.exists() and not folder.is_dir():
        raise UsageError(f"figures: --out {folder} is a file, a directory is expected")
    present = [file.name for file in files if file.exists()]
    if present and not force:
        raise UsageError(
            f"figures: {folder} already holds {', '.join(present)}; nothing written; give another"
            " directory with --out, or overwrite with --force"
        )


def charts_of(source: Path) -> tuple[Path, tuple[Chart, ...]]:
    """Return a page and its charts.

    Parameters
    ----------
    source : Path
        The page, or the JSON document beside it.

    Returns
    -------
    page : Path
        The page.
    charts : tuple of Chart
        Sound ones.

    Raises
    ------
    InputError
        The page is not there, of another run or damaged.
    """
    if not is_file(source):
        kind = "is a directory; give a page" if source.is_dir() else "does not exist; give a page"
        raise InputError.in_file(source, f"{kind}, such as report.html")
    is_json = source.suffix.lower() == ".json"
    page = source.with_suffix(".html") if is_json else source
    if not page.is_file():
        raise InputError.in_file(
            source,
            f"{page.name} with its charts does not exist beside it; give report.json or a page",
        )
    try:
        charts, digest = in_page(read_text(page))
    except UnicodeDecodeError:
        raise InputError.in_file(page, "is no page of insgnss: it is not text") from None
    except InputError as error:
        raise InputError.in_file(page, str(error)) from None
    if is_json and digest != sha256(source):
        raise InputError.in_file(
            page,
            f"was not written with {source.name}: one file is of another run or was changed; run "
            "the verb again, or give the page itself",
        )
    for chart in charts:
        if problem := _problem(chart):
            raise InputError.in_file(page, f"chart {chart.name!r}: {problem}")
    return page, charts


def _problem(chart: Chart) -> str:
    """Return what is wrong with a chart that somebody may have changed; empty where it is sound."""
    if not re.fullmatch(r"[A-Za-z0-9_-]+", str(chart.name)):
        return "its name has other characters than letters, digits and hyphens"
    if not chart.panels or chart.columns < 1 or chart.scale not in get_args(Scale):
        return "no panels, or a scale or number of columns that is unknown"
    if chart.link not in get_args(Link):
        return f"the link {chart.link!r} is unknown"
    if chart.background is not None and not is_jpeg(chart.background.jpeg):
        return "its background is no picture"
    return next((problem for panel in chart.panels if (problem := _of_panel(panel))), "")


def _of_panel(panel: Panel) -> str:
    if panel.scale not in get_args(Scale):
        return f"the scale {panel.scale!r} is unknown"
    return next((problem for layer in panel.layers if (problem := _of_layer(layer))), "")


def _of_layer(layer: Layer) -> str:
    """Return what is wrong with a layer."""
    for word, allowed in ((layer.kind, Kind), (layer.ink, Ink), (layer.mark, Mark)):
        if word not in get_args(allowed):
            return f"{word!r} is unknown"
    if layer.kind == "rules":
        return ""
    needed = {"band": ("y2",), "arrows": ("x2", "y2")}.get(layer.kind, ())
    if any(getattr(layer, name) is None for name in needed):
        return f"a layer of {layer.kind} lacks {' or '.join(needed)}"
    n = layer.x.size - (layer.kind == "steps")
    arrays = [layer.y, layer.y2, layer.x2, layer.value]
    sizes = {np.size(values) for values in arrays if values is not None}
    if layer.texts or layer.kind == "labels":
        sizes.add(len(layer.texts))
    return "" if sizes == {n} else f"arrays of a layer of {layer.kind} have different lengths"
