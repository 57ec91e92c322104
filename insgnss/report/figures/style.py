"""Ink and paper of the figures: colours, axes, thinning of long lines, and the way to PNG bytes.

Colours are those of Okabe and Ito (2008), which the colour-blind tell apart.
"""

import io
import math
from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

AXIS_COLOURS = ("#0072B2", "#D55E00", "#009E73")  # north or east, ..., down or up
LINE, ACCENT, FAINT, WARN = "#0072B2", "#D55E00", "#8A8F98", "#CC3311"
DPI = 100
MOST_POINTS = 1000
WHOLE = (slice(None),)


def thin(y: Array, limit: int = MOST_POINTS) -> NDArray[np.int64]:
    """Return the rows of `y` (n,) that a line needs to look as all of it.

    They are the smallest and largest of each of limit / 2 intervals, and the first and last. An
    interval without finite value keeps one, so that the line stays broken there.
    """
    if y.size <= limit:
        return np.arange(y.size)
    width = -(-y.size // (limit // 2))
    padded = np.pad(y, (0, -y.size % width), mode="edge").reshape(-1, width)
    finite = np.isfinite(padded)
    first = np.arange(len(padded)) * width
    low = first + np.argmin(np.where(finite, padded, np.inf), axis=1)
    high = first + np.argmax(np.where(finite, padded, -np.inf), axis=1)
    return np.unique(np.clip(np.concatenate([[0, y.size - 1], low, high]), 0, y.size - 1))


def line(
    ax: Any,
    t: Array,
    y: Array,
    parts: Sequence[slice] = WHOLE,
    label: str | None = None,
    **style: Any,
) -> None:
    """Draw y over t, thinned, each of the `parts` by itself."""
    for number, piece in enumerate(parts):
        keep = thin(y[piece])
        ax.plot(
            t[piece][keep],
            y[piece][keep],
            **({"lw": 1.0, "label": None if number else label} | style),
        )


def bounds(
    ax: Any,
    t: Array,
    centre: Array,
    half_width: Array,
    parts: Sequence[slice] = WHOLE,
    **style: Any,
) -> None:
    """Shade centre +- half_width over t, thinned, each of the `parts` by itself."""
    for piece in parts:
        c, w = centre[piece], half_width[piece]
        keep = np.union1d(thin(c), thin(w))
        ax.fill_between(
            t[piece][keep], (c - w)[keep], (c + w)[keep], **({"alpha": 0.22, "lw": 0} | style)
        )


def length_unit(typical: float) -> tuple[float, str]:
    """Factor and unit in which lengths of about `typical` m are read."""
    return (1e3, "mm") if typical < 0.5 else (1.0, "m")


def sheet(rows: int, columns: int, height: float, **options: Any) -> tuple[Any, NDArray[Any]]:
    """Figure 10 inches wide with axes (rows, columns), a restrained grid in each.

    Options go to `Figure.subplots`.
    """
    from matplotlib.figure import Figure

    figure = Figure(figsize=(10.0, height), dpi=DPI, facecolor="white")
    axes = figure.subplots(rows, columns, squeeze=False, **options)
    margin, top = 0.55 / height, 1 - 0.3 / height
    figure.subplots_adjust(
        left=0.085, right=0.985, bottom=margin, top=top, wspace=0.18, hspace=0.12
    )
    for ax in axes.ravel():
        dress(ax)
    return figure, axes


def dress(ax: Any) -> None:
    """Give axes thin spines, a pale grid, small labels and few ticks (ticks are slow to draw)."""
    from matplotlib.ticker import MaxNLocator

    ax.xaxis.set_major_locator(MaxNLocator(6, steps=[1, 2, 5, 10]))
    ax.yaxis.set_major_locator(MaxNLocator(4, steps=[1, 2, 5, 10]))
    ax.grid(True, color="#E3E6EA", lw=0.6)
    ax.set_axisbelow(True)
    ax.margins(x=0.01)
    ax.tick_params(labelsize=8, length=3, color=FAINT)
    for side in ("top", "right"):
        ax.spines[side].set_visible(False)
    for side in ("left", "bottom"):
        ax.spines[side].set_color(FAINT)
    ax.yaxis.label.set_size(9)
    ax.xaxis.label.set_size(9)


def legend(ax: Any, **options: Any) -> None:
    """Small legend in one row above the axes."""
    style = {
        "loc": "lower right",
        "bbox_to_anchor": (1.0, 0.98),
        "ncols": 8,
        "frameon": False,
        "fontsize": 8,
        "borderaxespad": 0.1,
        "handlelength": 1.2,
    }
    ax.legend(**(style | options))


def logarithmic(ax: Any) -> None:
    """Logarithmic scale with few, plain labels."""
    from matplotlib.ticker import FuncFormatter, LogLocator, NullLocator

    ax.set_yscale("log")
    low, high = ax.get_ylim()
    decades = math.log10(high / low)
    ax.yaxis.set_major_locator(LogLocator(subs=(1.0, 2.0, 5.0) if decades < 2.5 else (1.0,)))
    ax.yaxis.set_major_formatter(FuncFormatter(lambda x, _: f"{x:g}"))
    ax.yaxis.set_minor_locator(NullLocator())


def png(figure: Any) -> bytes:
    """The figure as PNG."""
    from matplotlib.backends.backend_agg import FigureCanvasAgg

    stream = io.BytesIO()
    _place_labels(figure)
    FigureCanvasAgg(figure).print_png(
        stream, metadata={"Software": None}, pil_kwargs={"compress_level": 3}
    )
    return stream.getvalue()


def _place_labels(figure: Any) -> None:
    """Put axis labels at one distance (inches) from their axes, without measuring tick labels."""
    width, height = figure.get_size_inches()
    for ax in figure.axes:
        box = ax.get_position()
        ax.xaxis.set_label_coords(0.5, -0.32 / (box.height * height))
        if ax.yaxis.get_label_position() == "left":
            ax.yaxis.set_label_coords(-0.52 / (box.width * width), 0.5)
