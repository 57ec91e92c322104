"""The pictures of a run, each with the sentence that says how to read it.

Time runs in minutes since the first epoch. Long lines are thinned to their extremes
(`_style.thin`), points of fixes are all drawn.
"""

import math
from collections.abc import Callable
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ...records import Diagnostics, ExteriorOrientation
from ..coverage import outages, stationary_periods
from ..flightlines import FlightLine, flight_lines
from ..marks import LINE_SHADE, MOST_NUMBERS, Marks, mark, marks_of
from ..markup import Picture
from ..summary import image_sigmas
from . import support
from .style import (
    AXIS_COLOURS,
    FAINT,
    LINE,
    MOST_POINTS,
    WARN,
    legend,
    length_unit,
    line,
    logarithmic,
    png,
    sheet,
)

Array = NDArray[np.float64]


def pictures(
    diagnostics: Diagnostics, eo: ExteriorOrientation | None, standing: bool = False
) -> tuple[Picture, ...]:
    """All pictures for which there is something to show.

    Parameters
    ----------
    standing : the sensor stood at a given place, and there are no fixes.
    """
    d = diagnostics
    images = eo if eo is not None and len(eo.images) > 0 else None
    marks = marks_of(d, images)
    motion, sigmas = (
        ("Dots are exposures. " if images else "") + _MOTION,
        _SIGMAS + (_BY_IMAGE if images else ""),
    )
    drawn: list[tuple[str, str, str, Callable[[], Any]]] = [
        ("motion", "How it moved", motion, lambda: _motion(d, images, marks)),
        ("sigmas", "How well it is known", sigmas, lambda: _sigmas(d, images, marks)),
    ]
    if not standing:
        drawn.insert(
            0,
            (
                "map",
                "Where the flight went",
                _MAP + (_MAP_IMAGES if images else ""),
                lambda: _map(d, images),
            ),
        )
        if np.isfinite(d.innovation).all(axis=1).any():
            drawn.append(
                (
                    "innovations",
                    "Whether the fixes agree with the prediction",
                    _INNOVATIONS,
                    lambda: support.innovations(d, marks),
                )
            )
    drawn.append(("biases", "Errors of the IMU", _BIASES, lambda: support.biases(d, marks)))
    if np.isfinite(d.separation).any():
        drawn.append(
            (
                "separation",
                "Forward against backward",
                _SEPARATION,
                lambda: support.separation(d, marks),
            )
        )
    return tuple(Picture(name, title, reading, png(draw())) for name, title, reading, draw in drawn)


_MAP = (
    "The line is the flight seen from above, straight lines with their numbers; a cross marks where"
    " a fix was rejected, red where no fix was used for a while, a green ring a stationary period."
)
_MAP_IMAGES = (
    " Dots are images, coloured by their horizontal standard deviation. Images that stand out in"
    " colour are those to weigh down, or to look at, in the adjustment."
)
_MOTION = (
    "Height, horizontal speed and attitude. Heading that changes is what makes heading and biases"
    " observable; straight flight does not. Shades, in all figures over time: numbered lines,"
    " stationary periods, times without a used fix."
)
_SIGMAS = (
    "Standard deviations on a logarithmic scale: pale, the forward filter; full, after smoothing,"
    " which must lie below. A rise at either end or in the middle tells of missing fixes or missing"
    " turns; the numbers are those of the table of lines."
)
_BY_IMAGE = " Right, the images in their order."
_INNOVATIONS = (
    "Each fix minus what was predicted for it; nearly all must lie within the shaded three standard"
    " deviations, without drift (what lies beyond the axis is drawn at its edge). Below, the same"
    " in one number (NIS): one in twenty may exceed the dashed line, those above the full line were"
    " rejected, and its distribution (right) should follow the curve."
)
_BIASES = (
    "Estimated biases within three standard deviations, after smoothing; a wide band says that the"
    " flight did not determine the bias."
)
_SEPARATION = (
    "The flight filtered backward minus the same forward: where both are honest it stays within the"
    " shaded three standard deviations. The backward run knows the errors of the IMU from the later"
    " fixes alone, hence the width of its bands, which says nothing of the smoothed result. The"
    " scale is that of the middle of the flight."
)


def _map(d: Diagnostics, eo: ExteriorOrientation | None) -> Any:
    figure, axes = sheet(1, 1, 6.2)
    figure.subplots_adjust(right=0.93)
    ax = axes[0, 0]
    north, east = d.position[:, 0], d.position[:, 1]
    some = slice(None, None, -(-north.size // MOST_POINTS))
    ax.plot(east[some], north[some], color=FAINT, lw=0.8, zorder=1)
    _map_marks(ax, d, flight_lines(d, eo))
    if eo is not None:
        position, _ = image_sigmas(eo)
        horizontal = np.hypot(position[:, 0], position[:, 1])
        factor, unit = length_unit(float(np.median(horizontal)))
        low, high = factor * horizontal.min(), factor * horizontal.max()
        dots = ax.scatter(
            *_east_north(d, eo.time),
            c=factor * horizontal,
            s=14,
            cmap="viridis",
            vmin=low,
            vmax=max(high, 1.2 * low),
            zorder=2,
        )
        bar = figure.colorbar(dots, ax=ax, fraction=0.025, pad=0.015)
        bar.set_label(f"horizontal sigma of the image, {unit}", size=9)
        bar.ax.tick_params(labelsize=8)
        bar.outline.set_visible(False)
    ax.plot(east[0], north[0], "^", color="black", ms=8, zorder=4, label="start")
    ax.plot(east[-1], north[-1], "s", color="black", ms=7, mfc="white", zorder=4, label="end")
    _look_at_all(ax, np.stack([east, north]))
    ax.set_xlabel("east of the local frame's origin, m")
    ax.set_ylabel("north, m")
    legend(ax)
    return figure


def _map_marks(ax: Any, d: Diagnostics, lines: tuple[FlightLine, ...]) -> None:
    """Draw numbered lines, times without fixes, stationary periods and rejected fixes."""
    north, east = d.position[:, 0], d.position[:, 1]
    step = max(1, -(-len(lines) // MOST_NUMBERS))
    for number, x in list(enumerate(lines, 1))[::step]:
        row = x.first + (x.last - x.first) // 10
        box = {"boxstyle": "round,pad=0.15", "fc": LINE_SHADE, "ec": "none"}
        ax.text(
            east[row],
            north[row],
            str(number),
            fontsize=8,
            ha="center",
            va="center",
            zorder=3,
            bbox=box,
        )
    for number, (begin, length) in enumerate(outages(d)):
        first, last = np.searchsorted(d.time, (begin, begin + length))
        piece = slice(max(first - 1, 0), last + 1)
        ax.plot(
            east[piece],
            north[piece],
            color=WARN,
            lw=2.2,
            zorder=1.2,
            label=None if number else "no used fix",
        )
    stood = stationary_periods(d)
    if stood.size:
        ax.plot(
            *_east_north(d, stood.mean(axis=1)),
            "o",
            color="#009E73",
            mfc="none",
            ms=8,
            zorder=3,
            label="stationary",
        )
    if (~d.used).any():
        ax.plot(
            *_east_north(d, d.fix_time[~d.used]),
            "x",
            color=WARN,
            ms=5,
            mew=1.0,
            zorder=1.5,
            label="rejected fix",
        )


def _look_at_all(ax: Any, positions: Array) -> None:
    """Limits of equal scale that hold all of `positions` (2, n)."""
    box, (width, height) = ax.get_position(), ax.figure.get_size_inches()
    size = np.array([box.width * width, box.height * height])
    middle, reach = 0.5 * (positions.max(axis=1) + positions.min(axis=1)), np.ptp(positions, axis=1)
    half = 0.54 * size * max(float((reach / size).max()), 1e-3)
    ax.set_xlim(middle[0] - half[0], middle[0] + half[0])
    ax.set_ylim(middle[1] - half[1], middle[1] + half[1])


def _east_north(d: Diagnostics, time: Array) -> tuple[Array, Array]:
    """East and north at `time`, m."""
    return np.interp(time, d.time, d.position[:, 1]), np.interp(time, d.time, d.position[:, 0])


def _motion(d: Diagnostics, eo: ExteriorOrientation | None, marks: Marks) -> Any:
    figure, axes = sheet(4, 1, 7.0, sharex=True)
    figure.subplots_adjust(hspace=0.24)
    t, up = marks.minutes(d.time), -d.position[:, 2]
    height, speed, level, heading = axes[:, 0]
    line(height, t, up, marks.parts, color=FAINT)
    if eo is not None:
        height.plot(marks.exposures, np.interp(eo.time, d.time, up), ".", color=LINE, ms=3)
    line(speed, t, np.hypot(d.velocity[:, 0], d.velocity[:, 1]), marks.parts, color=LINE)
    for column, name in enumerate(("roll", "pitch")):
        line(
            level,
            t,
            np.degrees(d.rpy[:, column]),
            marks.parts,
            name,
            color=AXIS_COLOURS[column],
            lw=0.8,
        )
    legend(level)
    some = slice(None, None, -(-d.time.size // MOST_POINTS))
    heading.plot(t[some], np.degrees(d.rpy[some, 2]) % 360.0, ".", color=LINE, ms=1.5)
    if np.ptp(np.degrees(d.rpy[:, 2]) % 360.0) > 90.0:
        heading.set_yticks([0, 90, 180, 270, 360])
    for ax, name in zip(
        axes[:, 0], ("up, m", "speed, m/s", "roll, pitch, deg", "heading, deg"), strict=True
    ):
        ax.set_ylabel(name)
    heading.set_xlabel(marks.label)
    mark(figure, axes[:, 0], marks, lines=True)
    return figure


def _sigmas(d: Diagnostics, eo: ExteriorOrientation | None, marks: Marks) -> Any:
    """Rows position and attitude; left over time, right by image."""
    ratio = {"gridspec_kw": {"width_ratios": [3, 2]}} if eo is not None else {}
    figure, axes = sheet(2, 1 if eo is None else 2, 6.0, sharex="col", sharey="row", **ratio)
    figure.subplots_adjust(wspace=0.05)
    t = marks.minutes(d.time)
    factor, unit = length_unit(float(np.median(d.smoothed_sigma[:, :3])))
    for row, (first, scale) in enumerate(((0, factor), (6, math.degrees(1.0)))):
        ax = axes[row, 0]
        for k, name in enumerate("NED"):
            line(
                ax,
                t,
                scale * d.filter_sigma[:, first + k],
                marks.parts,
                color=AXIS_COLOURS[k],
                alpha=0.35,
                lw=0.7,
            )
            line(
                ax,
                t,
                scale * d.smoothed_sigma[:, first + k],
                marks.parts,
                name,
                color=AXIS_COLOURS[k],
                lw=1.4,
            )
        logarithmic(ax)
    legend(axes[0, 0])
    axes[0, 0].set_ylabel(f"sigma of position, {unit}")
    axes[1, 0].set_ylabel("sigma of attitude about N, E, D, deg")
    axes[1, 0].set_xlabel(marks.label)
    mark(figure, axes[:, 0], marks, lines=True)
    if eo is not None:
        _image_sigmas(axes[:, 1], eo, factor)
    return figure


def _image_sigmas(axes: NDArray[Any], eo: ExteriorOrientation, factor: float) -> None:
    """Draw the sigmas of the images by number; each axis keeps its colour, so north is column 1."""
    number = np.arange(1, len(eo.images) + 1)
    for ax, sigma, scale in zip(axes, image_sigmas(eo), (factor, math.degrees(1.0)), strict=True):
        for column, colour, name in ((1, 0, "N"), (0, 1, "E"), (2, 2, "U")):
            ax.plot(
                number,
                scale * sigma[:, column],
                ".",
                ms=2.5,
                color=AXIS_COLOURS[colour],
                label=name,
            )
        ax.tick_params(labelleft=False)
    legend(axes[0], markerscale=3)
    axes[1].set_xlabel(f"image, by number (1 is {_short(eo.images[0])})")


def _short(name: str) -> str:
    """Name as it fits a label, without meaning to the text layout."""
    return (name if len(name) <= 30 else name[:27] + "...").replace("$", r"\$")
