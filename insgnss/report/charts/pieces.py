"""Pieces that charts of a run are made of: units, lines, bands, charts over time."""

from collections.abc import Sequence
from typing import Any

import numpy as np

from ..marks import Marks
from .chart import Array, Chart, Ink, Layer, Panel
from .thinned import MOST_DOTS, thin_layer


def length_unit(typical: float) -> tuple[float, str]:
    """Factor and unit in which lengths of about `typical` m are read."""
    return (1e3, "mm") if typical < 0.5 else (1.0, "m")


def line(x: Array, y: Array, name: str = "", ink: Ink = "first", **look: Any) -> Layer:
    """A line, thinned to its extremes."""
    return thin_layer(Layer("line", x, y, name, ink, **look))


def band(x: Array, centre: Array, half_width: Array, name: str = "", ink: Ink = "first") -> Layer:
    """The area centre +- half_width, thinned to the extremes of its edges."""
    return thin_layer(Layer("band", x, centre - half_width, name, ink, y2=centre + half_width))


def dots(x: Array, y: Array, name: str = "", ink: Ink = "first", **look: Any) -> Layer:
    """Points of which those that lie farthest out are kept where there are too many."""
    return thin_layer(Layer("points", x, y, name, ink, **look), MOST_DOTS)


def rules(*y: float, ink: Ink = "ink", dashed: bool = False) -> Layer:
    """Lines across the axes at values of y."""
    return Layer("rules", np.zeros(0), np.array(y, dtype=np.float64), ink=ink, dashed=dashed)


def over_time(name: str, title: str, reading: str, panels: Sequence[Panel], marks: Marks) -> Chart:
    """A chart over minutes since the first epoch, with the shades of the flight."""
    return Chart(name, title, reading, tuple(panels), marks.label, link="time", shades=marks.shades)


def median_limits(x: Array, bound: Array) -> tuple[float, float] | None:
    """Return limits of three times the median of what is drawn.

    Where one of two filters knows little, as at the ends, the line may leave the axes.
    """
    magnitude = np.maximum(np.abs(x), bound)
    magnitude = magnitude[np.isfinite(magnitude)]
    half_height = 3.0 * float(np.median(magnitude)) if magnitude.size else 0.0
    return (-half_height, half_height) if half_height > 0.0 else None
