"""The pictures of a run, each with the sentence that says how to read it.

Time runs in minutes since the first epoch. Long lines are thinned to their extremes (`_style.thin`), points of fixes are all drawn.
"""

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..records import Diagnostics, ExteriorOrientation
from ._style import ACCENT, AXIS_COLOURS, FAINT, LINE, MOST_POINTS, WARN, bounds, legend, length_unit, line, logarithmic, png, sheet
from .statistics import NIS_95
from .summary import DEG_H_PER_RAD_S, MG_PER_M_S2, image_sigmas

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Picture:
    """A drawn figure: PNG bytes, title, and how to read it."""

    name: str
    title: str
    reading: str
    png: bytes


def pictures(diagnostics: Diagnostics, eo: ExteriorOrientation | None) -> tuple[Picture, ...]:
    """All pictures for which there is something to show."""
    d = diagnostics
    has_images = eo is not None and len(eo.images) > 0
    drawn: list[tuple[str, str, str, Callable[[], Any]]] = [
        ("map", "Where the flight went", _MAP_IMAGES if has_images else _MAP, lambda: _map(d, eo if has_images else None)),
        (
            "motion",
            "How it flew",
            "Height, horizontal speed and attitude; dots are exposures. " + _MOTION,
            lambda: _motion(d, eo if has_images else None),
        ),
        ("sigmas", "How well it is known", _SIGMAS, lambda: _sigmas(d, eo if has_images else None)),
    ]
    if np.isfinite(d.innovation).all(axis=1).any():
        drawn.append(("innovations", "Whether the fixes agree with the prediction", _INNOVATIONS, lambda: _innovations(d)))
    drawn.append(("biases", "Errors of the IMU", _BIASES, lambda: _biases(d)))
    if np.isfinite(d.separation).any():
        drawn.append(("separation", "Forward against backward", _SEPARATION, lambda: _separation(d)))
    return tuple(Picture(name, title, reading, png(draw())) for name, title, reading, draw in drawn)


_MAP = "The line is the flight seen from above; a cross marks where a fix was rejected."
_MAP_IMAGES = (
    "Dots are images, coloured by their horizontal standard deviation; a cross marks where a fix was rejected. Images that stand out in "
    "colour are those to weigh down, or to look at, in the adjustment."
)
_MOTION = "Heading that changes is what makes heading and biases observable; straight flight does not."
_SIGMAS = (
    "Standard deviations on a logarithmic scale: pale, the forward filter; full, after smoothing, which must lie below; right, the images "
    "in their order. A rise at either end or in the middle tells of missing fixes or missing turns."
)
_INNOVATIONS = (
    "Each fix minus what was predicted for it; nearly all must lie within the shaded three standard deviations, without drift. Below, the "
    "same in one number (NIS): one in twenty may exceed the dashed line, those above the full line were rejected, and its distribution "
    "(right) should follow the curve."
)
_BIASES = "Estimated biases within three standard deviations, after smoothing; a wide band says that the flight did not determine the bias."
_SEPARATION = (
    "The flight filtered backward minus the same forward: where both are honest it stays within the shaded three standard deviations. The "
    "backward run knows the errors of the IMU from the later fixes alone, hence the width of its bands, which says nothing of the smoothed "
    "result. The scale is that of the middle of the flight."
)


def _clock(d: Diagnostics) -> tuple[Callable[[Array], Array], str]:
    """Minutes since the first epoch, and the label of that axis."""
    start = float(d.time[0])
    return (lambda t: (t - start) / 60.0), f"minutes since TOW {start:.1f} s"


def _rejected_times(d: Diagnostics) -> Array:
    return d.fix_time[~d.used]


def _map(d: Diagnostics, eo: ExteriorOrientation | None) -> Any:
    figure, axes = sheet(1, 1, 6.2)
    figure.subplots_adjust(right=0.93)
    ax = axes[0, 0]
    north, east = d.position[:, 0], d.position[:, 1]
    some = slice(None, None, -(-north.size // MOST_POINTS))
    ax.plot(east[some], north[some], color=FAINT, lw=0.8, zorder=1)
    if eo is not None:
        position, _ = image_sigmas(eo)
        horizontal = np.hypot(position[:, 0], position[:, 1])
        factor, unit = length_unit(float(np.median(horizontal)))
        low, high = factor * horizontal.min(), factor * horizontal.max()
        dots = ax.scatter(*_at(d, eo.time), c=factor * horizontal, s=14, cmap="viridis", vmin=low, vmax=max(high, 1.2 * low), zorder=2)
        bar = figure.colorbar(dots, ax=ax, fraction=0.025, pad=0.015)
        bar.set_label(f"horizontal sigma of the image, {unit}", size=9)
        bar.ax.tick_params(labelsize=8)
        bar.outline.set_visible(False)
    if (~d.used).any():
        ax.plot(*_at(d, _rejected_times(d)), "x", color=WARN, ms=5, mew=1.0, zorder=1.5, label="rejected fix")
    ax.plot(east[0], north[0], "^", color="black", ms=8, zorder=4, label="start")
    ax.plot(east[-1], north[-1], "s", color="black", ms=7, mfc="white", zorder=4, label="end")
    ax.set_aspect("equal", adjustable="datalim")
    ax.set_xlabel("east of the local frame's origin, m")
    ax.set_ylabel("north, m")
    legend(ax)
    return figure


def _at(d: Diagnostics, time: Array) -> tuple[Array, Array]:
    """East and north at `time`, m."""
    return np.interp(time, d.time, d.position[:, 1]), np.interp(time, d.time, d.position[:, 0])


def _motion(d: Diagnostics, eo: ExteriorOrientation | None) -> Any:
    figure, axes = sheet(4, 1, 7.0, sharex=True)
    figure.subplots_adjust(hspace=0.24)
    minutes, label = _clock(d)
    t, up = minutes(d.time), -d.position[:, 2]
    height, speed, level, heading = axes[:, 0]
    line(height, t, up, color=FAINT)
    if eo is not None:
        height.plot(minutes(eo.time), np.interp(eo.time, d.time, up), ".", color=LINE, ms=3, label="exposure")
        legend(height)
    line(speed, t, np.hypot(d.velocity[:, 0], d.velocity[:, 1]), color=LINE)
    for column, name in enumerate(("roll", "pitch")):
        line(level, t, np.degrees(d.rpy[:, column]), color=AXIS_COLOURS[column], label=name, lw=0.8)
    legend(level)
    some = slice(None, None, -(-d.time.size // MOST_POINTS))
    heading.plot(t[some], np.degrees(d.rpy[some, 2]) % 360.0, ".", color=LINE, ms=1.5)
    heading.set_yticks([0, 90, 180, 270, 360])
    for ax, name in zip(axes[:, 0], ("up, m", "speed, m/s", "roll, pitch, deg", "heading, deg"), strict=True):
        ax.set_ylabel(name)
    heading.set_xlabel(label)
    return figure


def _sigmas(d: Diagnostics, eo: ExteriorOrientation | None) -> Any:
    """Rows position and attitude; left over time, right by image."""
    ratio = {"gridspec_kw": {"width_ratios": [3, 2]}} if eo is not None else {}
    figure, axes = sheet(2, 1 if eo is None else 2, 6.0, sharex="col", sharey="row", **ratio)
    figure.subplots_adjust(wspace=0.05)
    minutes, label = _clock(d)
    t = minutes(d.time)
    factor, unit = length_unit(float(np.median(d.smoothed_sigma[:, :3])))
    for row, (first, scale) in enumerate(((0, factor), (6, math.degrees(1.0)))):
        ax = axes[row, 0]
        for k, name in enumerate("NED"):
            line(ax, t, scale * d.filter_sigma[:, first + k], color=AXIS_COLOURS[k], alpha=0.35, lw=0.7)
            line(ax, t, scale * d.smoothed_sigma[:, first + k], color=AXIS_COLOURS[k], lw=1.4, label=name)
        logarithmic(ax)
    legend(axes[0, 0])
    axes[0, 0].set_ylabel(f"sigma of position, {unit}")
    axes[1, 0].set_ylabel("sigma of attitude about N, E, D, deg")
    axes[1, 0].set_xlabel(label)
    if eo is not None:
        _image_sigmas(axes[:, 1], eo, factor)
    return figure


def _image_sigmas(axes: NDArray[Any], eo: ExteriorOrientation, factor: float) -> None:
    """Sigmas of the images by their number; north keeps its colour, so east and up follow as 1, 2."""
    number = np.arange(1, len(eo.images) + 1)
    for ax, sigma, scale in zip(axes, image_sigmas(eo), (factor, math.degrees(1.0)), strict=True):
        for column, colour, name in ((1, 0, "N"), (0, 1, "E"), (2, 2, "U")):
            ax.plot(number, scale * sigma[:, column], ".", ms=2.5, color=AXIS_COLOURS[colour], label=name)
        ax.tick_params(labelleft=False)
    legend(axes[0], markerscale=3)
    axes[1].set_xlabel(f"image, by number (1 is {_short(eo.images[0])})")


def _short(name: str) -> str:
    """Name as it fits a label, without meaning to the text layout."""
    return (name if len(name) <= 30 else name[:27] + "...").replace("$", r"\$")


def _innovations(d: Diagnostics) -> Any:
    """Rows north, east, down, NIS; over time at the left, distribution at the right."""
    figure, axes = sheet(4, 2, 8.0, sharey="row", gridspec_kw={"width_ratios": [6, 1]})
    figure.subplots_adjust(wspace=0.03)
    minutes, label = _clock(d)
    t = minutes(d.fix_time)
    known = np.isfinite(d.innovation.sum(axis=1))
    kept = known & d.used if (known & d.used).any() else known
    reach = 1.15 * max(float(np.abs(d.innovation[kept]).max()), float(np.quantile(3 * d.innovation_sigma[kept], 0.95)))
    factor, unit = length_unit(reach / 4)
    for k, name in enumerate(("north", "east", "down")):
        ax, beside = axes[k]
        ax.sharex(axes[3, 0])
        ax.tick_params(labelbottom=False)
        bounds(ax, t, np.zeros_like(t), 3 * factor * d.innovation_sigma[:, k], color=FAINT)
        _points(ax, t, np.clip(factor * d.innovation[:, k], -factor * reach, factor * reach), d.used)
        ax.set_ylim(-1.03 * factor * reach, 1.03 * factor * reach)
        ax.set_ylabel(f"{name}, {unit}")
        edges = np.linspace(-reach, reach, 61)
        _distribution(beside, factor * edges, d.innovation[kept, k] * factor, _normal_mixture(edges, d.innovation_sigma[kept, k]) / factor)
    legend(axes[0, 0])
    _nis(axes[3, 0], axes[3, 1], t, d, kept)
    axes[3, 0].set_xlabel(label)
    return figure


def _points(ax: Any, t: Array, y: Array, used: NDArray[np.bool_]) -> None:
    ax.plot(t[used], y[used], ".", color=LINE, ms=2 if t.size < 10000 else 1, label="fix")
    if not used.all():
        ax.plot(t[~used], y[~used], "x", color=WARN, ms=5, mew=1.0, label="rejected (beyond the axis: at its edge)")


def _nis(ax: Any, beside: Any, t: Array, d: Diagnostics, kept: NDArray[np.bool_]) -> None:
    """NIS over time on a logarithmic scale, and its distribution by ln NIS, where chi-square with 3 degrees of freedom has
    the density x^(3/2) exp(-x/2) / sqrt(2 pi)."""
    low, high = 1e-2, 4.0 * max(d.nis_limit, NIS_95)
    shown = np.clip(d.nis, low, high)
    ax.axhline(d.nis_limit, color="black", lw=1.0)
    ax.axhline(NIS_95, color="black", lw=1.0, ls="--")
    _points(ax, t, shown, d.used)
    ax.set_ylim(low, 1.2 * high)
    logarithmic(ax)
    ax.set_ylabel("NIS")
    edges = np.geomspace(low, high, 41)
    density = np.histogram(np.log(shown[kept]), bins=np.log(edges), density=True)[0]
    beside.fill_betweenx(np.repeat(edges, 2)[1:-1], np.repeat(density, 2), color=LINE, alpha=0.35, lw=0)
    beside.plot(edges**1.5 * np.exp(-edges / 2.0) / math.sqrt(2.0 * math.pi), edges, color=ACCENT, lw=1.2)
    _bare(beside)


def _distribution(ax: Any, edges: Array, x: Array, expected: Array) -> None:
    """Histogram of `x` lying on its side, with the density that the sigmas promise."""
    density = np.histogram(np.clip(x, edges[0], edges[-1]), bins=edges, density=True)[0]
    ax.fill_betweenx(np.repeat(edges, 2)[1:-1], np.repeat(density, 2), color=LINE, alpha=0.35, lw=0)
    ax.plot(expected, edges, color=ACCENT, lw=1.2)
    _bare(ax)


def _bare(ax: Any) -> None:
    ax.tick_params(labelleft=False, labelbottom=False, bottom=False)
    ax.grid(False)
    ax.set_xlim(left=0.0)


def _normal_mixture(x: Array, sigma: Array) -> Array:
    """Mean density at `x` of zero-mean normal variables of the standard deviations `sigma`, of at most 200 of them."""
    s = sigma[:: -(-sigma.size // 200)]
    return np.mean(np.exp(-0.5 * (x[:, None] / s) ** 2) / (math.sqrt(2.0 * math.pi) * s), axis=1)


def _biases(d: Diagnostics) -> Any:
    """Gyro above accelerometer, the body's three axes in each."""
    figure, axes = sheet(2, 1, 5.6, sharex=True)
    minutes, label = _clock(d)
    t = minutes(d.time)
    sensors = ((DEG_H_PER_RAD_S, "gyro, deg/h"), (MG_PER_M_S2, "accelerometer, mg"))
    for ax, first, (scale, name) in zip(axes[:, 0], (0, 3), sensors, strict=True):
        for row, axis in enumerate(("forward", "right", "down")):
            bias, sigma = scale * d.bias[:, first + row], scale * d.bias_sigma[:, first + row]
            bounds(ax, t, bias, 3 * sigma, color=AXIS_COLOURS[row])
            line(ax, t, bias, color=AXIS_COLOURS[row], label=axis)
        ax.set_ylabel(name)
    legend(axes[0, 0])
    axes[1, 0].set_xlabel(label)
    return figure


def _separation(d: Diagnostics) -> Any:
    """Position, tilt and heading, one above the other."""
    figure, axes = sheet(3, 1, 6.0, sharex=True)
    minutes, label = _clock(d)
    t = minutes(d.separation_time)
    factor, unit = length_unit(_typical(d.separation_sigma[:, :3]))
    rows = (((0, 1, 2), factor, f"position, {unit}"), ((6, 7), math.degrees(1.0), "tilt, deg"), ((8,), math.degrees(1.0), "heading, deg"))
    for ax, (columns, scale, name) in zip(axes[:, 0], rows, strict=True):
        for k in columns:
            colour, axis = AXIS_COLOURS[k % 3], ("north", "east", "down")[k % 3]
            bounds(ax, t, np.zeros_like(t), 3 * scale * d.separation_sigma[:, k], color=colour, alpha=0.13)
            line(ax, t, scale * d.separation[:, k], color=colour, lw=0.9, label=axis)
        _look_at_the_middle(ax, scale * d.separation[:, columns], 3 * scale * d.separation_sigma[:, columns])
        ax.set_ylabel(name)
    legend(axes[0, 0])
    axes[2, 0].set_xlabel(label)
    return figure


def _typical(sigma: Array) -> float:
    known = sigma[np.isfinite(sigma)]
    return float(np.median(known)) if known.size else 0.0


def _look_at_the_middle(ax: Any, x: Array, bound: Array) -> None:
    """Scale to three times the median: where one of the two filters knows little, as at the ends, the line may leave the axes."""
    size = np.maximum(np.abs(x), bound)
    size = size[np.isfinite(size)]
    if size.size and (reach := 3.0 * float(np.median(size))) > 0.0:
        ax.set_ylim(-reach, reach)
