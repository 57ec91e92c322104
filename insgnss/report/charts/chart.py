"""A chart as data: layers in axes, before anything draws them.

Whoever has figures to show says here what lies where and what it means; nothing in this module
knows a browser or matplotlib. `encoded` puts charts into a page, whose script draws them so that
one can zoom and hover; `drawn` draws the same charts with matplotlib for papers.

Colours are roles, so that light and dark pages, print and papers each have their own ink.
"""

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Literal

from ...records import Array

Ink = Literal["first", "second", "third", "fourth", "fifth", "ink", "faint", "warn", "ok"]
Kind = Literal["line", "points", "band", "steps", "arrows", "rules", "labels"]
Mark = Literal["dot", "cross", "ring", "square", "triangle"]
Scale = Literal["linear", "log"]
Link = Literal["", "time", "image"]

AXES_INKS: tuple[Ink, Ink, Ink] = ("first", "second", "third")  # north or east, ..., down or up


@dataclass(frozen=True, eq=False)
class Layer:
    """One thing drawn in axes.

    Parameters
    ----------
    kind : str
        "line" (broken at NaN), "points", "band" between y and y2, "steps" (a histogram: n values of
        y over n + 1 edges x), "arrows" from (x, y) to (x2, y2), "rules" (lines across the axes: at
        the values of y, or of x where y is empty), "labels" (texts at x, y).
    x, y : ndarray, shape (n,)
        In the units that the axes name. x of a line or band ascends where the chart is no map.
    name : str
        In the legend; empty leaves it out.
    ink : str
        The role of its colour.
    y2, x2 : ndarray, shape (n,), or None
        The other edge of a band, the other end of arrows.
    mark : str
        The shape of points.
    value, value_name : ndarray, shape (n,), or None, and str
        Colours points on a scale with a bar beside the axes, that the name stands at.
    texts : sequence of str
        What hovering says of each point, or the labels themselves; empty or n of them.
    width : float
        Of a line or the size of a mark, in pixels; 0 for the usual one.
    faint, dashed : bool
        Drawn pale; drawn in dashes.
    """

    kind: Kind
    x: Array
    y: Array
    name: str = ""
    ink: Ink = "first"
    y2: Array | None = None
    x2: Array | None = None
    mark: Mark = "dot"
    value: Array | None = None
    value_name: str = ""
    texts: Sequence[str] = ()
    width: float = 0.0
    faint: bool = False
    dashed: bool = False


@dataclass(frozen=True, eq=False)
class Panel:
    """A panel: a vertical axis with its layers; the horizontal one is the chart's.

    Parameters
    ----------
    label : str
        Quantity and unit, such as "north, mm".
    layers : sequence of Layer
        From the back to the front.
    scale : str
        "linear" or "log".
    limits : tuple of float, or None
        What is shown at first; all of it where None. Zooming out shows the rest.
    """

    label: str
    layers: Sequence[Layer]
    scale: Scale = "linear"
    limits: tuple[float, float] | None = None


@dataclass(frozen=True)
class Shade:
    """A span of the horizontal axis that is shaded in all panels.

    Parameters
    ----------
    begin, end : float
        In the unit of the horizontal axis.
    kind : str
        "line" (a flight line), "rest" (a stationary period), "outage" (no used fix), "other".
    text : str
        What stands at its top: the number of a line; may be empty.
    """

    begin: float
    end: float
    kind: Literal["line", "rest", "outage", "other"]
    text: str = ""


@dataclass(frozen=True)
class Background:
    """A picture below a map.

    Parameters
    ----------
    jpeg : str
        The file in base64.
    west, south, east, north : float
        Its edges in the map's axes.
    name : str
        What it shows, or its file.
    """

    jpeg: str
    west: float
    south: float
    east: float
    north: float
    name: str


@dataclass(frozen=True, eq=False)
class Chart:
    """A figure: panels one above the other over one horizontal axis, or a map.

    Parameters
    ----------
    name : str
        Its id in the page and of its file; letters, digits, hyphens.
    title : str
        A heading.
    reading : str
        How to read it, in whole sentences.
    panels : sequence of Panel
        From the top.
    label : str
        Quantity and unit of the horizontal axis.
    scale : str
        Of the horizontal axis: "linear" or "log".
    map : bool
        One unit is as long upwards as to the right; such a chart has one panel.
    link : str
        Charts with the same link share zoom and cursor: "time" (minutes since the first epoch),
        "image" (number of an image, 1 the first).
    shades : sequence of Shade
        Spans that are shaded in every panel.
    limits : tuple of float, or None
        What of the horizontal axis is shown at first.
    columns : int
        Panels stand in that many columns, row by row; of more than one, each panel has a horizontal
        axis of its own.
    """

    name: str
    title: str
    reading: str
    panels: Sequence[Panel]
    label: str
    scale: Scale = "linear"
    map: bool = False
    link: Link = ""
    shades: Sequence[Shade] = field(default=())
    limits: tuple[float, float] | None = None
    columns: int = 1
    background: Background | None = None
