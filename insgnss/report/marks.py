"""What all figures over time mark in the same way.

Numbered lines, stationary periods, times without fixes, segments, exposures.

Shades run over the whole height of every axis, exposures stand as ticks on the lowest; the key is
at the figure's top.
"""

import itertools
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..records import Diagnostics, ExteriorOrientation
from .coverage import outages, segments, stationary_periods
from .flightlines import flight_lines

Array = NDArray[np.float64]

LINE_SHADE, STATIONARY_SHADE, OUTAGE_SHADE, NOTHING_SHADE = (
    "#E4ECF5",
    "#F7F0CC",
    "#F6C4BC",
    "#C9CDD3",
)
NARROWEST = 0.002  # of the flight: what is shorter is drawn so wide, to be seen
MOST_NUMBERS = 40
KEY_LEFT, KEY_TOP_IN, KEY_LETTER = (
    0.085,
    0.13,
    0.0062,
)  # of the figure's width; inches from its top; width of a letter


@dataclass(frozen=True, eq=False)
class Marks:
    """Pieces (k, 2) of the flight, minutes from its start, and exposures (n,).

    The pieces are lines, stationary periods, times without fixes and without solution.

    Parameters
    ----------
    parts : the rows of the diagnostics of each part that was solved by itself.
    label : of the axis of time.
    """

    minutes: Callable[[Array], Array]
    label: str
    lines: Array
    stationary: Array
    outages: Array
    nothing: Array
    exposures: Array
    parts: tuple[slice, ...]

    def parts_of(self, minutes: Array) -> tuple[slice, ...]:
        """The rows of other `minutes` in each part."""
        edges = (
            np.searchsorted(minutes, self.nothing.mean(axis=1))
            if self.nothing.size
            else np.zeros(0, dtype=np.int64)
        )
        return slices(edges, minutes.size)


def slices(edges: NDArray[np.int64], size: int) -> tuple[slice, ...]:
    """Pieces of `size` rows that begin at zero and at `edges`."""
    return tuple(slice(a, b) for a, b in itertools.pairwise([0, *edges.tolist(), size]) if b > a)


def marks_of(d: Diagnostics, eo: ExteriorOrientation | None) -> Marks:
    """The marks of a run."""
    start = float(d.time[0])

    def minutes(t: Array) -> Array:
        return (t - start) / 60.0

    whole, without = segments(d), outages(d)
    lines = np.array([(d.time[x.first], d.time[x.last]) for x in flight_lines(d, eo)]).reshape(
        -1, 2
    )
    nothing = np.stack([whole[:-1, 1], whole[1:, 0]], axis=1)
    return Marks(
        minutes,
        f"minutes since TOW {start:.1f} s",
        minutes(lines),
        minutes(stationary_periods(d)),
        minutes(np.stack([without[:, 0], without.sum(axis=1)], axis=1)),
        minutes(nothing),
        np.zeros(0) if eo is None else minutes(eo.time),
        slices(np.searchsorted(d.time, nothing.mean(axis=1)), d.time.size),
    )


def mark(figure: Any, axes: NDArray[Any], marks: Marks, lines: bool = False) -> None:
    """Shade `axes` (n,), which share their time, and mark the exposures on the last.

    Where `lines`, the lines are numbered on the first.
    """
    kinds = [(marks.lines, LINE_SHADE, "line")] if lines else []
    kinds += [
        (marks.stationary, STATIONARY_SHADE, "stationary"),
        (marks.outages, OUTAGE_SHADE, "no used fix"),
    ]
    kinds.append((marks.nothing, NOTHING_SHADE, "no solution"))
    keys = []
    for pieces, colour, name in kinds:
        if pieces.size:
            keys.append(("\u25a0", colour, name))
            for ax in axes:
                _shade(ax, pieces, colour)
    if marks.exposures.size:
        ax, height = axes[-1], np.full(marks.exposures.size, 0.012)
        ax.plot(marks.exposures, height, "|k", transform=ax.get_xaxis_transform(), ms=4.0, mew=0.6)
        keys.append(("|", "black", "exposure"))
    if lines:
        _number(axes[0], marks.lines)
    _key(figure, keys)


def _shade(ax: Any, pieces: Array, colour: str) -> None:
    from matplotlib.collections import PolyCollection

    span = ax.dataLim.width or float(pieces.max() - pieces.min())
    half = 0.5 * np.maximum(pieces[:, 1] - pieces[:, 0], NARROWEST * span)
    left, right, zero = (
        pieces.mean(axis=1) - half,
        pieces.mean(axis=1) + half,
        np.zeros(len(pieces)),
    )
    corners = np.stack(
        [left, zero, right, zero, right, zero + 1.0, left, zero + 1.0], axis=1
    ).reshape(-1, 4, 2)
    ax.add_collection(
        PolyCollection(
            list(corners), transform=ax.get_xaxis_transform(), facecolors=colour, lw=0, zorder=0.4
        ),
        autolim=False,
    )


def _key(figure: Any, keys: list[tuple[str, str, str]]) -> None:
    """Sign and name side by side at the figure's top left.

    A legend would measure all of its texts first.
    """
    x, (_, height) = KEY_LEFT, figure.get_size_inches()
    y = 1.0 - KEY_TOP_IN / height
    for sign, colour, name in keys:
        figure.text(x, y, sign, color=colour, fontsize=11 if sign != "|" else 7, va="center")
        figure.text(x + 0.016, y, name, fontsize=8, va="center")
        x += 0.016 + KEY_LETTER * (len(name) + 3)


def _number(ax: Any, lines: Array) -> None:
    step = max(1, -(-len(lines) // MOST_NUMBERS))
    style = {
        "transform": ax.get_xaxis_transform(),
        "ha": "center",
        "va": "top",
        "fontsize": 7.5,
        "color": "#40506A",
    }
    for number, (start, end) in list(enumerate(lines, 1))[::step]:
        ax.text(0.5 * (start + end), 0.985, str(number), **style)
