"""The picture of a comparison.

Differences of every component over time or images, with their standard deviations, and their
distribution.

Where a mismatch was recognised, the left column has the differences as they are and the right one
what remains after it is taken off.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import Any

import numpy as np
from numpy.typing import NDArray

from .style import ACCENT, DPI, FAINT, LINE, bounds, dress, line, png

Array = NDArray[np.float64]

BREAK_STEPS = 10.0  # a step of time so many times the usual one breaks the line
MOST_DOTS = 400
LEAST = {
    "mm": 0.1,
    "m": 1e-4,
    "deg": 1e-4,
    "mm/s": 0.1,
    "m/s": 1e-4,
}  # half height of a picture in which nothing is to be seen
_ROW, _HEAD, _FOOT = 1.15, 0.95, 0.6  # inches


@dataclass(frozen=True, eq=False)
class Curve:
    """Differences (n,) in the unit of the screen, and their standard deviations or None."""

    values: Array
    sigma: Array | None
    unit: str


@dataclass(frozen=True, eq=False)
class ComparisonPanel:
    """One component: its differences, and what remains of them or None."""

    name: str
    difference: Curve
    remaining: Curve | None = None


def draw_comparison(
    panels: Sequence[ComparisonPanel],
    times: tuple[Array | None, Array | None],
    title: str,
    files: tuple[str, str],
) -> bytes:
    """PNG, a row a component.

    Parameters
    ----------
    times : (n,) s of the differences and of what remains, or None for their order.
    title : what was compared and recognised.
    files : names of a and b.
    """
    from matplotlib.figure import Figure

    height = _HEAD + _FOOT + _ROW * len(panels)
    figure = Figure(figsize=(11.0, height), dpi=DPI, facecolor="white")
    figure.text(0.075, 1.0 - 0.3 / height, _cut(title, 110), size=12, weight="bold")
    figure.text(
        0.075,
        1.0 - 0.52 / height,
        _cut(f"a: {files[0]}    b: {files[1]}", 150),
        size=8.5,
        color="#333333",
    )
    axes = figure.subplots(
        len(panels), 2, squeeze=False, sharex="col", gridspec_kw={"width_ratios": _widths(panels)}
    )
    figure.subplots_adjust(
        left=0.075,
        right=0.985,
        top=1.0 - _HEAD / height,
        bottom=_FOOT / height,
        hspace=0.22,
        wspace=0.14,
    )
    for row, panel in zip(axes, panels, strict=True):
        for ax in row:
            dress(ax)
        _over_time(row[0], times[0], panel.difference, LINE)
        row[0].set_ylabel(f"{panel.name}, {panel.difference.unit}", size=8)
        if panel.remaining is not None:
            _over_time(row[1], times[1], panel.remaining, ACCENT)
            row[1].set_ylabel(panel.remaining.unit, size=8)
        else:
            _distribution(row[1], panel.difference)
    _words(axes, panels, times[0] is None)
    return png(figure)


def _widths(panels: Sequence[ComparisonPanel]) -> list[float]:
    return [1.0, 1.0] if any(panel.remaining is not None for panel in panels) else [2.6, 1.0]


def _words(axes: Any, panels: Sequence[ComparisonPanel], ordered: bool) -> None:
    """Titles of the columns and labels of the bottom."""
    along = "image, in the order of file a" if ordered else "minutes since the first common pose"
    remains = any(panel.remaining is not None for panel in panels)
    axes[0, 0].set_title(
        "b minus a"
        + (", shaded: three standard deviations" if panels[0].difference.sigma is not None else ""),
        size=9,
        loc="left",
    )
    normalised = any(panel.difference.sigma is not None for panel in panels)
    beside = "over sigma, and the normal density" if normalised else "distribution"
    axes[0, 1].set_title(
        "what remains after the recognised is taken off" if remains else beside, size=9, loc="left"
    )
    axes[-1, 0].set_xlabel(along, size=9)
    axes[-1, 1].set_xlabel(
        along if remains else "standard deviations" if normalised else "", size=9
    )


def _over_time(ax: Any, time: Array | None, curve: Curve, colour: str) -> None:
    y, sigma = curve.values, curve.sigma
    x = np.arange(y.size, dtype=np.float64) if time is None else (time - time[0]) / 60.0
    parts = _parts(x)
    if sigma is not None:
        bounds(ax, x, np.zeros_like(x), 3.0 * sigma, parts, color=FAINT)
    ax.axhline(0.0, color=FAINT, lw=0.7)
    if x.size <= MOST_DOTS:
        ax.plot(x, y, ".", color=colour, ms=3.5)
    else:
        line(ax, x, y, parts, color=colour)
    reach = 1.1 * max(float(np.abs(y).max()), LEAST[curve.unit])
    low, high = min(float(y.min()), 0.0), max(float(y.max()), 0.0)
    ax.set_ylim(low - 0.1 * reach, high + 0.1 * reach)
    if sigma is not None and 3.0 * float(np.median(sigma)) < 4.0 * reach:
        widest = max(reach, 3.3 * float(np.median(sigma)))
        ax.set_ylim(
            min(low, -widest) if low < 0 else -0.3 * widest,
            max(high, widest) if high > 0 else 0.3 * widest,
        )
    ax.ticklabel_format(axis="y", useOffset=False)


def _distribution(ax: Any, curve: Curve) -> None:
    """Histogram.

    Of differences over their standard deviations where there are some, with the density that they
    should follow.
    """
    if curve.sigma is None:
        ax.hist(curve.values, bins=40, color=LINE, alpha=0.75)
        return
    z = curve.values / curve.sigma
    edges = np.linspace(-5.0, 5.0, 26)
    ax.hist(np.clip(z, -5.0, 5.0), bins=edges, density=True, color=LINE, alpha=0.75)
    x = np.linspace(-5.0, 5.0, 101)
    ax.plot(x, np.exp(-0.5 * x**2) / np.sqrt(2.0 * np.pi), color="black", lw=1.0)


def _parts(x: Array) -> list[slice]:
    """Segments without a gap."""
    step = np.diff(x)
    if step.size == 0:
        return [slice(0, x.size)]
    edges = np.concatenate(
        [[0], np.flatnonzero(step > BREAK_STEPS * np.median(step)) + 1, [x.size]]
    )
    return [slice(int(p), int(q)) for p, q in pairwise(edges)]


def _cut(text: str, longest: int) -> str:
    return text if len(text) <= longest else text[: longest - 3] + "..."
