"""The layers of a chart as artists of matplotlib, in the inks that pages have in a light room.

Colours are those of Okabe and Ito (2008), which the colour-blind tell apart. Sizes are pixels of a
sheet of 1000 pixels, a point is `POINTS_OF_PIXEL` of them.
"""

import base64
import io
from collections.abc import Callable, Mapping, Sequence
from typing import Any

import numpy as np

from .chart import Array, Background, Ink, Layer, Mark, Panel, Shade

CHART_INKS: Mapping[Ink, str] = {
    "first": "#0072B2",
    "second": "#D55E00",
    "third": "#009E73",
    "fourth": "#A0478A",
    "fifth": "#7F6A00",
    "ink": "#000000",
    "faint": "#8A8F98",
    "warn": "#CC3311",
    "ok": "#009E73",
}
SHADES = {"line": "#E4ECF5", "rest": "#F7F0CC", "outage": "#F9CFC8", "other": "#C9CDD3"}
SHADE_NAMES = {
    "line": "flight line",
    "rest": "stationary",
    "outage": "no used fix",
    "other": "no solution",
}
CHART_MARKS: Mapping[Mark, str] = {
    "dot": "o",
    "cross": "x",
    "ring": "o",
    "square": "s",
    "triangle": "^",
}
MARK_PX = 4.4  # pixels that a mark has where its layer says nothing
ARROW_PX = 2.2  # width of an arrow (px): as thick as a line of two pixels looks
LABEL_PX = 11.5  # height of a label's letters (px), readable beside marks of 4.4 px
MARK_WIDTHS: Mapping[Mark, float] = {"ring": 1.6, "triangle": 1.3}  # than a dot of the same size
POINTS_OF_PIXEL = 0.72  # of a pixel: a sheet of 1000 pixels is 10 inches of 72 points
PALE = 0.4  # opacity of what is faint
NARROWEST = 0.002  # of the axis: a shade that is narrower is drawn so wide, to be seen
RASTERISED_FROM = 5000  # points from which on a PDF has them as an image
GROUND_ALPHA = 0.6  # opacity of the ground below a map, so that lines and dots stand out
IN_FRONT = 2.0  # of grid and shades; of what is alike in this, the later is drawn over the earlier
MOST_TEXTS = 80  # of a layer of labels; of more only every so many
# colours end at so many times what that share of the values reach
COLOUR_QUANTILE, COLOURS_END = 0.95, 2.0


def draw_layer(ax: Any, layer: Layer, scale: float = 1.0) -> Any:
    """Draw one layer; return the artist whose colours a bar explains, or None.

    Parameters
    ----------
    ax : matplotlib.axes.Axes
        Where.
    layer : Layer
        What.
    scale : float
        Of marks and labels, which are smaller in a narrow picture.

    Returns
    -------
    matplotlib.cm.ScalarMappable or None
        Of points with values.
    """
    style: dict[str, Any] = {
        "color": CHART_INKS[layer.ink],
        "alpha": PALE if layer.faint else 1.0,
        "label": layer.name or None,
    }
    artists_before = set(ax.get_children())
    explained = _KINDS[layer.kind](ax, layer, style, POINTS_OF_PIXEL * scale)
    for artist in (
        set(ax.get_children()) - artists_before
    ):  # matplotlib would draw lines over points
        artist.set_zorder(IN_FRONT)
    return explained


def draw_background(ax: Any, background: Background) -> None:
    """Draw what a map shows below its layers; the limits of the axes stay."""
    from matplotlib.image import AxesImage
    from PIL import Image

    extent = (background.west, background.east, background.south, background.north)
    below = AxesImage(ax, extent=extent, origin="upper", alpha=GROUND_ALPHA, zorder=0.0)
    with Image.open(io.BytesIO(base64.b64decode(background.jpeg))) as image:
        below.set_data(np.asarray(image))
    ax.add_artist(below)


def _line(ax: Any, layer: Layer, style: dict[str, Any], px: float) -> None:
    ax.plot(layer.x, layer.y, lw=_width(layer, px), ls=_dashes(layer), **style)


def _points(ax: Any, layer: Layer, style: dict[str, Any], px: float) -> Any:
    """Draw the points of a layer; return the artist if its values are colours, else None."""
    diameter = px * (layer.width or MARK_PX) * MARK_WIDTHS.get(layer.mark, 1.0)
    shape = CHART_MARKS[layer.mark]
    rasterised = layer.x.size > RASTERISED_FROM
    if layer.value is not None:
        low, high = value_range(layer.value)
        return ax.scatter(
            layer.x,
            layer.y,
            c=layer.value,
            s=diameter**2,
            marker=shape,
            cmap="viridis",
            vmin=low,
            vmax=high,
            lw=0,
            label=style["label"],
            rasterized=rasterised,
        )
    hollow = layer.mark in ("ring", "square", "triangle")
    ax.plot(
        layer.x,
        layer.y,
        shape,
        ms=diameter,
        mew=1.0 if hollow or layer.mark == "cross" else 0.0,
        mfc="none" if hollow else style["color"],
        rasterized=rasterised,
        **style,
    )
    return None


def _band(ax: Any, layer: Layer, style: dict[str, Any], _: float) -> None:
    assert layer.y2 is not None
    opacity = 0.10 if layer.faint else 0.22
    ax.fill_between(layer.x, layer.y, layer.y2, lw=0, **(style | {"alpha": opacity}))


def _steps(ax: Any, layer: Layer, style: dict[str, Any], px: float) -> None:
    filled = {**style, "alpha": 0.35 * style["alpha"], "label": None}
    ax.stairs(layer.y, layer.x, fill=True, lw=0, **filled)
    ax.stairs(layer.y, layer.x, lw=_width(layer, px), ls=_dashes(layer), **style)


def _arrows(ax: Any, layer: Layer, style: dict[str, Any], px: float) -> None:
    """Draw a layer's arrows from (x, y) to (x2, y2), in the units of the axes."""
    assert layer.x2 is not None
    assert layer.y2 is not None
    ax.quiver(
        layer.x,
        layer.y,
        layer.x2 - layer.x,
        layer.y2 - layer.y,
        angles="xy",
        scale_units="xy",
        scale=1.0,
        units="dots",
        width=px * (layer.width or ARROW_PX) * ax.figure.dpi / 72.0,
        **style,
    )
    # a quiver widens axes by its tails only
    for x, y in ((layer.x, layer.y), (layer.x2, layer.y2)):
        ax.update_datalim(np.column_stack([x, y]))


def _rules(ax: Any, layer: Layer, style: dict[str, Any], px: float) -> None:
    options = style | {"lw": _width(layer, px, 1.2), "ls": _dashes(layer)}
    values, across = (layer.y, ax.axhline) if layer.y.size else (layer.x, ax.axvline)
    for k, value in enumerate(values):
        across(value, **(options if k == 0 else options | {"label": None}))


def _labels(ax: Any, layer: Layer, style: dict[str, Any], px: float) -> None:
    """Write the texts of a layer at its positions, at most `MOST_TEXTS` of them."""
    ax.update_datalim(np.column_stack([layer.x, layer.y]))  # no text does so by itself
    ax.autoscale_view()
    step = -(-layer.x.size // MOST_TEXTS) or 1
    for x, y, text in list(zip(layer.x, layer.y, layer.texts, strict=True))[::step]:
        ax.annotate(
            text,
            (x, y),
            size=px * (layer.width or LABEL_PX),
            color=style["color"],
            alpha=style["alpha"],
            ha="center",
            va="center",
            annotation_clip=True,
            bbox={"boxstyle": "square,pad=0.12", "fc": "white", "ec": "none", "alpha": 0.7},
            parse_math=False,
        )


_KINDS: Mapping[str, Callable[[Any, Layer, dict[str, Any], float], Any]] = {
    "line": _line,
    "points": _points,
    "band": _band,
    "steps": _steps,
    "arrows": _arrows,
    "rules": _rules,
    "labels": _labels,
}


def _width(layer: Layer, px: float, usual: float = 1.5) -> float:
    return px * (layer.width or usual)


def _dashes(layer: Layer) -> Any:
    return (0, (5, 2)) if layer.dashed else "-"


def value_range(value: Array) -> tuple[float, float]:
    """Return where the colours of values begin and end: some outliers do not make the rest alike.

    Parameters
    ----------
    value : ndarray, (n,)
        NaN where there is none.

    Returns
    -------
    low, high : float
        High above low.
    """
    finite = value[np.isfinite(value)]
    if not finite.size:
        return 0.0, 1.0
    low, high = float(finite.min()), float(finite.max())
    high = min(high, COLOURS_END * float(np.quantile(finite, COLOUR_QUANTILE)))
    return low, high if high > low else low + max(0.2 * abs(low), 1e-9)


def draw_shades(ax: Any, shades: Sequence[Shade], span: tuple[float, float]) -> None:
    """Shade spans behind the layers.

    Parameters
    ----------
    ax : matplotlib.axes.Axes
        Where.
    shades : sequence of Shade
        What.
    span : tuple of float
        Ends of the horizontal axis.
    """
    narrowest = NARROWEST * (span[1] - span[0])
    for shade in shades:
        colour = SHADES[shade.kind]
        missing = max(0.0, 0.5 * (narrowest - (shade.end - shade.begin)))
        ax.axvspan(shade.begin - missing, shade.end + missing, color=colour, lw=0, zorder=0.4)


def number_shades(ax: Any, shades: Sequence[Shade], size: float) -> None:
    """Write the texts of shades along the top, as many as have room.

    Parameters
    ----------
    ax : matplotlib.axes.Axes
        Where; its limits are set.
    shades : sequence of Shade
        What.
    size : float
        Of the letters, points.
    """
    written = -np.inf
    axis_transform = ax.get_xaxis_transform()
    for shade in sorted(shades, key=lambda shade: shade.begin):
        middle = 0.5 * (shade.begin + shade.end)
        low, high = ax.get_xlim()
        if not shade.text or not min(low, high) <= middle <= max(low, high):
            continue
        position = float(ax.transData.transform((middle, 1.0))[0])
        room = 0.5 * (len(shade.text) + 1.0) * 0.62 * size * ax.figure.dpi / 72.0
        if position - room < written:
            continue
        written = position + room
        ax.text(
            middle,
            0.985,
            shade.text,
            transform=axis_transform,
            ha="center",
            va="top",
            size=size,
            color="#40506A",
            parse_math=False,
        )


def legend_entries(panel: Panel) -> list[tuple[str, Ink, str]]:
    """Return what the legend of a panel has: name, ink and kind of each layer with a name.

    Parameters
    ----------
    panel : Panel
        The panel.

    Returns
    -------
    list of tuple
        In the order of the layers.
    """
    return [(layer.name, layer.ink, layer.kind) for layer in panel.layers if layer.name]
