"""Charts drawn with matplotlib: for papers, and for the pictures that verbs write as files.

A page draws its charts itself; this module is loaded where somebody asked for a picture. No window,
no pyplot, nothing that a session's settings of matplotlib would change; the bytes of two drawings
of one chart are the same.
"""

import io
import math
import textwrap
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Literal

import numpy as np

from .artists import (
    CHART_INKS,
    SHADE_NAMES,
    SHADES,
    draw_background,
    draw_layer,
    draw_shades,
    legend_entries,
    number_shades,
)
from .chart import Array, Chart, Layer, Panel

Form = Literal["png", "pdf", "svg"]
CHART_FILES: tuple[Form, ...] = ("png", "pdf", "svg")

INCH_MM = 25.4  # mm of an inch
GRID_INK, MINOR, FRAME = "#E3E6EA", "#F1F3F5", "#8A8F98"
LETTER = 0.56  # width of a letter, of its height
FLATTEST, TALLEST = 0.35, 1.0  # height of a map by its width
LEAST_IN = 1.5  # inches of a panel beside another
SETTINGS: Any = {
    "pdf.fonttype": 42,  # TrueType: letters stay letters, as journals ask for
    "svg.fonttype": "none",
    "svg.hashsalt": "insgnss",
    "font.family": ["DejaVu Sans"],
    "axes.formatter.useoffset": False,
}


@dataclass(frozen=True)
class Paper:
    """Size of a picture.

    Parameters
    ----------
    width_mm : float
        Its width; the height follows from what it shows.
    dpi : int
        Pixels to the inch, of PNG and of what a PDF has as an image.
    """

    width_mm: float = 254.0
    dpi: int = 100

    @property
    def letters(self) -> float:
        """Height of letters in points: a narrow picture is one of a journal."""
        return 9.0 if self.width_mm > 200.0 else 8.0 if self.width_mm > 120.0 else 7.0


SCREEN = Paper()
COLUMN = Paper(84.0, 300)  # of a journal with two of them
PRINTED_PAGE = Paper(174.0, 300)  # of a journal, both columns


def draw(chart: Chart, form: Form = "png", paper: Paper = SCREEN) -> bytes:
    """Draw one chart.

    Parameters
    ----------
    chart : Chart
        What to draw; title and reading are left to the text around the picture.
    form : str
        "png", "pdf" or "svg".
    paper : Paper
        Its width.

    Returns
    -------
    bytes
        The file.
    """
    return draw_sheet([[chart]], form=form, paper=paper)


def draw_sheet(
    columns: Sequence[Sequence[Chart]],
    title: str = "",
    subtitle: str = "",
    form: Form = "png",
    paper: Paper = SCREEN,
) -> bytes:
    """Draw charts on one sheet, each column from its top.

    Parameters
    ----------
    columns : sequence of sequence of Chart
        Of several charts each has its title above it.
    title, subtitle : str
        Above all of them; empty for none.
    form : str
        "png", "pdf" or "svg".
    paper : Paper
        Its width.

    Returns
    -------
    bytes
        The file.
    """
    import matplotlib

    with matplotlib.rc_context(SETTINGS):
        return _bytes(figure_of(columns, title, subtitle, paper), form, paper)


def _bytes(figure: Any, form: Form, paper: Paper) -> bytes:
    stream = io.BytesIO()
    if form == "png":
        from matplotlib.backends.backend_agg import FigureCanvasAgg

        canvas = FigureCanvasAgg(figure)
        canvas.print_png(stream, metadata={"Software": None}, pil_kwargs={"compress_level": 3})
    else:
        undated = {"CreationDate": None} if form == "pdf" else {"Date": None}
        figure.savefig(stream, format=form, dpi=paper.dpi, metadata=undated)
    return stream.getvalue()


def figure_of(
    columns: Sequence[Sequence[Chart]], title: str = "", subtitle: str = "", paper: Paper = SCREEN
) -> Any:
    """Return the figure of matplotlib that `draw_sheet` writes.

    Parameters
    ----------
    columns, title, subtitle, paper
        As of `draw_sheet`.

    Returns
    -------
    matplotlib.figure.Figure
        With all artists.
    """
    from matplotlib.figure import Figure

    width = paper.width_mm / INCH_MM
    heading = _wrapped(title, subtitle, width, paper.letters)
    titled = sum(map(len, columns)) > 1
    blocks = [
        [_SheetBlock(chart, width / len(columns), paper, titled) for chart in charts]
        for charts in columns
    ]
    height = heading.height + max(
        (sum(block.height for block in column) for column in blocks), default=0.1
    )
    figure = Figure(figsize=(width, height), dpi=paper.dpi, facecolor="white")
    heading.write(figure, height)
    for k, column in enumerate(blocks):
        top = height - heading.height
        for block in column:
            block.draw(figure, k * width / len(columns), top)
            top -= block.height
    return figure


@dataclass(frozen=True)
class _Head:
    """Title and subtitle in lines that fit, and the inches that they take."""

    title: list[str]
    subtitle: list[str]
    letters: float

    @property
    def height(self) -> float:
        rows = 1.45 * len(self.title) + 1.25 * len(self.subtitle)
        return self.letters * rows / 72.0 + (0.12 if self.title or self.subtitle else 0.0)

    def write(self, figure: Any, height: float) -> None:
        """Write both at the top left of a figure that is so many inches high."""
        top = height - 0.08
        for rows, size, weight, ink in (
            (self.title, 1.25 * self.letters, "bold", "#000000"),
            (self.subtitle, self.letters, "normal", "#333333"),
        ):
            for row in rows:
                text = figure.text(0.01, top / height, row, size=size, weight=weight, va="top")
                text.set_color(ink)
                text.set_parse_math(False)
                top -= 1.3 * size / 72.0


def _wrapped(title: str, subtitle: str, width: float, letters: float) -> _Head:
    fits = width * 0.98 * 72.0 / (LETTER * letters)
    return _Head(textwrap.wrap(title, int(fits / 1.4)), textwrap.wrap(subtitle, int(fits)), letters)


class _SheetBlock:
    """Where on the sheet a chart and its panels stand, in inches.

    Parameters
    ----------
    chart : Chart
        What to draw.
    width : float
        All that it has.
    paper : Paper
        Of the sheet.
    titled : bool
        Whether its title stands above it.
    """

    def __init__(self, chart: Chart, width: float, paper: Paper, titled: bool) -> None:
        self.chart, self.width, self.letters = chart, width, paper.letters
        row = 1.35 * self.letters / 72.0
        self.title = textwrap.wrap(
            chart.title, max(10, int(width * 72.0 / (LETTER * self.letters)) - 4)
        )
        self.head = (row * len(self.title) + 0.05) if titled else 0.0
        self.title = self.title if titled else []
        self.foot, self.left, self.right = 3.6 * self.letters / 72.0, 5.6 * self.letters / 72.0, 0.1
        has_values = (layer.value is not None for panel in chart.panels for layer in panel.layers)
        if any(has_values):
            self.right += 6.5 * self.letters / 72.0
        self.columns = max(1, min(chart.columns, int(width / LEAST_IN)))
        separate_axes = chart.columns > 1  # each panel has an axis of its own
        self.panel_width = width / self.columns - self.left - self.right
        self.panel_height = self._panel_height()
        self.keys = _legends(chart)
        self.above = [self._above(k) for k in range(len(chart.panels))]
        self.below = 2.0 * self.letters / 72.0 if separate_axes else 0.06
        self.rows = [
            max(self.above[k : k + self.columns]) + self.panel_height + self.below
            for k in range(0, len(chart.panels), self.columns)
        ]
        fits = int((width - self.left) * 72.0 / (LETTER * self.letters))
        self.label = textwrap.wrap(chart.label, max(fits, 10))
        label_height = row * max(len(self.label) - 1, 0) - (self.below if separate_axes else 0.0)
        self.height = self.head + sum(self.rows) + self.foot + label_height

    def _panel_height(self) -> float:
        """Return the height of each panel, inches: of a map by its extent, else by their number."""
        scale = self.width / 10.0
        if self.chart.map:
            width, height_shown = _extent(self.chart)
            return self.panel_width * float(np.clip(height_shown / width, FLATTEST, TALLEST))
        if self.chart.columns > 1:
            return float(np.clip(0.7 * self.panel_width, 0.9, 2.6))
        rows = len(self.chart.panels)
        height = {1: 4.0, 2: 2.6, 3: 2.0, 4: 1.6}.get(rows, 1.3) * scale
        return max(height, 0.95 if rows > 2 else 1.2 if rows == 2 else 1.9)

    def _above(self, k: int) -> float:
        """Inches above panel `k`: its legend."""
        _, rows = _legend_size(self.keys[k], self._room(k), self.letters)
        label = self.chart.panels[k].label
        wide = LETTER * len(label) * self.letters / 72.0 > 0.6 * self.panel_width
        rows += 0 if self._along(label) else 1 if wide or not rows else 0
        return 0.08 + rows * 1.3 * self.letters / 72.0

    def draw(self, figure: Any, left_px: float, top: float) -> None:
        """Draw the chart with its upper left corner there."""
        width, height = figure.get_size_inches()
        if self.title:
            corner = (left_px + 0.15) / width, (top - 0.06) / height
            text = figure.text(*corner, "\n".join(self.title), size=self.letters, weight="bold")
            text.set_va("top")
            text.set_parse_math(False)
        bottom = top - self.head
        first_axes: Any = None
        drawn: list[Any] = []
        for k, panel in enumerate(self.chart.panels):
            row, column = divmod(k, self.columns)
            if column == 0:
                base = bottom - self.rows[row] + self.below
                bottom -= self.rows[row]
            x = left_px + column * self.width / self.columns + self.left
            box = (x / width, base / height, self.panel_width / width, self.panel_height / height)
            shared: Any = first_axes if self.chart.columns == 1 else None
            ax = figure.add_axes(box, sharex=shared)
            first_axes = first_axes or ax
            drawn.append(ax)
            self._panel(figure, ax, panel, k)
        labelled = drawn if self.chart.columns > 1 else drawn[-1:]
        for ax in drawn:
            ax.tick_params(labelbottom=ax in labelled)
        centre = left_px + 0.5 * (self.left + self.width - self.right)
        foot = bottom + self.below - 1.9 * self.letters / 72.0  # below the numbers of the last row
        text = figure.text(centre / width, foot / height, "\n".join(self.label), ha="center")
        text.set(size=self.letters, va="top", parse_math=False)
        self._finish(drawn)

    def _panel(self, figure: Any, ax: Any, panel: Panel, k: int) -> None:
        """Draw one panel with its layers, scale, limits and legend."""
        _style_axes(ax, self.letters, int(np.clip(2.0 * self.panel_width, 3, 6)))
        if self.chart.scale == "log":
            ax.set_xscale("log")
        if panel.scale == "log":
            ax.set_yscale("log")
        bars = [(layer, draw_layer(ax, layer, self.letters / 9.0)) for layer in panel.layers]
        for layer, artist in bars:
            if artist is not None:
                self._colour_bar(figure, ax, artist, layer)
        if panel.limits is not None:
            ax.set_ylim(*panel.limits)
        if self.chart.limits is not None:
            ax.set_xlim(*self.chart.limits)
        if self.chart.map:
            if self.chart.background is not None:
                draw_background(ax, self.chart.background)
            ax.set_aspect("equal", adjustable="datalim")
        self._label(ax, panel.label)
        if panel.scale == "log":
            _label_log_axis(ax.yaxis, ax.get_ylim(), self.panel_height)
        if self.keys[k]:
            _legend(ax, self.keys[k], self._room(k), self.letters)

    def _label(self, ax: Any, label: str) -> None:
        """Write the quantity along the vertical axis, or above it where it is longer than that."""
        if self._along(label):
            ax.set_ylabel(label, size=self.letters, parse_math=False)
            ax.yaxis.set_label_coords(-3.9 * self.letters / 72.0 / self.panel_width, 0.5)
            return
        corner = (0.0, 1.0 + 0.3 * self.letters / 72.0 / self.panel_height)
        text = ax.text(*corner, label, transform=ax.transAxes, size=self.letters, va="bottom")
        text.set_parse_math(False)

    def _along(self, label: str) -> bool:
        return LETTER * len(label) * self.letters / 72.0 <= self.panel_height

    def _room(self, k: int) -> float:
        """Inches that the legend of panel `k` has: beside a label that stands above the axes."""
        label = self.chart.panels[k].label
        label_width = 0.0 if self._along(label) else LETTER * len(label) * self.letters / 72.0
        return max(self.panel_width - label_width, 0.4 * self.panel_width)

    def _colour_bar(self, figure: Any, ax: Any, artist: Any, layer: Layer) -> None:
        """Put the bar of colours beside the axes."""
        box, width = ax.get_position(), figure.get_size_inches()[0]
        position = (box.x1 + 0.08 / width, box.y0 + 0.1 * box.height, 0.1 / width, 0.8 * box.height)
        beyond = _finite([layer.value if layer.value is not None else np.zeros(0)])
        extend = "max" if (beyond > artist.norm.vmax).any() else "neither"
        bar = figure.colorbar(artist, cax=figure.add_axes(position), extend=extend)
        bar.set_label(layer.value_name.rstrip(": "), size=self.letters)
        bar.ax.tick_params(labelsize=0.9 * self.letters, length=2, color=FRAME)
        bar.outline.set_visible(False)

    def _finish(self, drawn: list[Any]) -> None:
        """Shade, when the limits of the horizontal axis are known."""
        if self.chart.shades:
            span = drawn[0].get_xlim()
            for ax in drawn:
                draw_shades(ax, self.chart.shades, span)
            drawn[0].set_xlim(span)
            number_shades(drawn[0], self.chart.shades, 0.85 * self.letters)
        if self.chart.scale == "log":
            for ax in drawn:
                _label_log_axis(ax.xaxis, ax.get_xlim(), self.panel_width)


def _extent(chart: Chart) -> tuple[float, float]:
    """Return how much a map shows from left to right and upwards."""
    x: list[Array] = []
    y: list[Array] = []
    for layer in chart.panels[0].layers:
        if layer.kind == "rules":
            continue
        x += [layer.x, *([] if layer.x2 is None else [layer.x2])]
        y += [layer.y, *([] if layer.y2 is None else [layer.y2])]
    limits = (chart.limits, chart.panels[0].limits)
    spans = [
        float(np.ptp(pieces))
        if (pieces := _finite(values)).size
        else 1.0
        if limit is None
        else abs(limit[1] - limit[0])
        for values, limit in zip((x, y), limits, strict=True)
    ]
    return max(spans[0], 1e-9), max(spans[1], 1e-9)


def _finite(pieces: Sequence[Array]) -> Array:
    joined = np.concatenate([np.zeros(0), *pieces])
    return joined[np.isfinite(joined)]


def _style_axes(ax: Any, letters: float, ticks: int) -> None:
    """Give axes thin spines, a pale grid, small labels and few ticks."""
    from matplotlib.ticker import MaxNLocator

    ax.xaxis.set_major_locator(MaxNLocator(ticks, steps=[1, 2, 5, 10]))
    ax.yaxis.set_major_locator(MaxNLocator(4, steps=[1, 2, 5, 10]))
    ax.grid(True, color=GRID_INK, lw=0.6)
    ax.set_axisbelow(True)
    ax.margins(x=0.01)
    ax.tick_params(labelsize=0.9 * letters, length=3, color=FRAME)
    for side in ("top", "right"):
        ax.spines[side].set_visible(False)
    for side in ("left", "bottom"):
        ax.spines[side].set_color(FRAME)


def _label_log_axis(axis: Any, limits: tuple[float, float], inches: float) -> None:
    """Give a logarithmic axis few, plain numbers, at least two of them."""
    from matplotlib.ticker import FuncFormatter, LogLocator, NullFormatter

    low, high = sorted(limits)
    decades = math.log10(high / low)
    subs = (1.0,) if decades > 2.2 else (1.0, 2.0, 5.0) if decades > 0.6 else tuple(range(1, 10))
    tick_count = max(3, int(3.0 * inches))
    axis.set_major_locator(LogLocator(subs=subs, numticks=tick_count))
    axis.set_minor_locator(LogLocator(subs=tuple(range(2, 10)), numticks=30))
    axis.set_minor_formatter(NullFormatter())
    axis.set_major_formatter(FuncFormatter(lambda value, _: f"{value:g}"))
    axis.grid(True, which="minor", color=MINOR, lw=0.5)
    axis.set_tick_params(which="minor", length=2, color="#C8CCD2")


Keys = list[tuple[str, Any, str]]


def _legends(chart: Chart) -> list[Keys]:
    """Return what stands in the legend of each panel: not again what stood in the one before."""
    kinds = [k for k in SHADE_NAMES if any(s.kind == k for s in chart.shades)]
    shades: Keys = [(SHADE_NAMES[k], SHADES[k], "shade") for k in kinds]
    keys: list[Keys] = []
    last_keys: Keys = []
    for k, panel in enumerate(chart.panels):
        shown: Keys = list({key[0]: key for key in reversed(legend_entries(panel))}.values())[::-1]
        keys.append([*(shades if k == 0 else []), *(shown if shown != last_keys else [])])
        last_keys = shown
    return keys


def _legend_size(keys: Keys, width: float, letters: float) -> tuple[int, int]:
    """Return columns and rows of a legend in `width` inches."""
    if not keys:
        return 1, 0
    widest = max(len(name) for name, _, _ in keys)
    entry = (0.94 * LETTER * widest + 3.4) * letters * 0.9 / 72.0
    columns = max(1, min(len(keys), int(width / entry)))
    return columns, math.ceil(len(keys) / columns)


def _legend(ax: Any, keys: Keys, width: float, letters: float) -> None:
    """Write the legend in rows above the axes."""
    from matplotlib.patches import Patch

    columns, _ = _legend_size(keys, width, letters)
    labelled: Mapping[str, Any] = dict(zip(*reversed(ax.get_legend_handles_labels()), strict=True))
    handles = [
        Patch(facecolor=ink, lw=0)
        if kind == "shade"
        else labelled.get(name, Patch(color=CHART_INKS["faint"]))
        for name, ink, kind in keys
    ]
    legend = ax.legend(
        handles,
        [name for name, _, _ in keys],
        loc="lower right",
        bbox_to_anchor=(1.0, 1.0),
        ncols=columns,
        frameon=False,
        fontsize=0.9 * letters,
        borderaxespad=0.1,
        borderpad=0.1,
        handlelength=1.4,
        labelspacing=0.25,
        columnspacing=1.4,
    )
    for text in legend.get_texts():
        text.set_parse_math(False)
