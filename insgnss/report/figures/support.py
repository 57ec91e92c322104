"""Pictures of what supports a run: innovations, biases, forward against backward."""

import math
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ...records import Diagnostics
from ..marks import Marks, mark
from ..rules.wording import DEG_H_PER_RAD_S, MG_PER_M_S2
from ..statistics import NIS_95
from .style import (
    ACCENT,
    AXIS_COLOURS,
    FAINT,
    LINE,
    WARN,
    bounds,
    legend,
    length_unit,
    line,
    logarithmic,
    sheet,
)

Array = NDArray[np.float64]


def innovations(d: Diagnostics, marks: Marks) -> Any:
    """Rows north, east, down, NIS; over time at the left, distribution at the right."""
    figure, axes = sheet(4, 2, 8.0, sharey="row", gridspec_kw={"width_ratios": [6, 1]})
    figure.subplots_adjust(wspace=0.03)
    t = marks.minutes(d.fix_time)
    finite = np.isfinite(d.innovation.sum(axis=1))
    kept = finite & d.used if (finite & d.used).any() else finite
    reach = max(
        1.5 * float(np.quantile(np.abs(d.innovation[kept]), 0.98)),
        1.15 * float(np.quantile(3 * d.innovation_sigma[kept], 0.9)),
    )
    factor, unit = length_unit(reach / 4)
    for k, name in enumerate(("north", "east", "down")):
        ax, beside = axes[k]
        ax.sharex(axes[3, 0])
        ax.tick_params(labelbottom=False)
        three_sigma = np.minimum(3 * d.innovation_sigma[:, k], 1.1 * reach)
        bounds(ax, t, np.zeros_like(t), factor * three_sigma, marks.parts_of(t), color=FAINT)
        _points(
            ax, t, np.clip(factor * d.innovation[:, k], -factor * reach, factor * reach), d.used
        )
        ax.set_ylim(-1.03 * factor * reach, 1.03 * factor * reach)
        ax.set_ylabel(f"{name}, {unit}")
        edges = np.linspace(-reach, reach, 61)
        _distribution(
            beside,
            factor * edges,
            d.innovation[kept, k] * factor,
            _normal_mixture(edges, d.innovation_sigma[kept, k]) / factor,
        )
    legend(axes[0, 0])
    _nis(axes[3, 0], axes[3, 1], t, d, kept)
    mark(figure, axes[:, 0], marks)
    axes[3, 0].set_xlabel(marks.label)
    return figure


def _points(ax: Any, t: Array, y: Array, used: NDArray[np.bool_]) -> None:
    ax.plot(t[used], y[used], ".", color=LINE, ms=2 if t.size < 10000 else 1, label="fix")
    if not used.all():
        ax.plot(t[~used], y[~used], "x", color=WARN, ms=5, mew=1.0, label="rejected")


def _nis(ax: Any, beside: Any, t: Array, d: Diagnostics, kept: NDArray[np.bool_]) -> None:
    """Draw NIS over time on a logarithmic scale, and its distribution by ln NIS.

    Chi-square with 3 degrees of freedom has there the density x^(3/2) exp(-x/2) / sqrt(2 pi).
    """
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
    beside.fill_betweenx(
        np.repeat(edges, 2)[1:-1], np.repeat(density, 2), color=LINE, alpha=0.35, lw=0
    )
    beside.plot(
        edges**1.5 * np.exp(-edges / 2.0) / math.sqrt(2.0 * math.pi), edges, color=ACCENT, lw=1.2
    )
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
    """Mean density at `x` of zero-mean normal variables of the standard deviations `sigma`.

    At most 200 of them are taken.
    """
    s = sigma[:: -(-sigma.size // 200)]
    return np.mean(np.exp(-0.5 * (x[:, None] / s) ** 2) / (math.sqrt(2.0 * math.pi) * s), axis=1)


def biases(d: Diagnostics, marks: Marks) -> Any:
    """Gyro above accelerometer, the body's three axes in each."""
    figure, axes = sheet(2, 1, 5.6, sharex=True)
    t = marks.minutes(d.time)
    sensors = ((DEG_H_PER_RAD_S, "gyro, deg/h"), (MG_PER_M_S2, "accelerometer, mg"))
    for ax, first, (scale, name) in zip(axes[:, 0], (0, 3), sensors, strict=True):
        for row, axis in enumerate(("forward", "right", "down")):
            bias, sigma = scale * d.bias[:, first + row], scale * d.bias_sigma[:, first + row]
            bounds(ax, t, bias, 3 * sigma, marks.parts, color=AXIS_COLOURS[row])
            line(ax, t, bias, marks.parts, axis, color=AXIS_COLOURS[row])
        ax.set_ylabel(name)
    legend(axes[0, 0])
    mark(figure, axes[:, 0], marks)
    axes[1, 0].set_xlabel(marks.label)
    return figure


def separation(d: Diagnostics, marks: Marks) -> Any:
    """Position, tilt and heading, one above the other."""
    figure, axes = sheet(3, 1, 6.0, sharex=True)
    t = marks.minutes(d.separation_time)
    parts = marks.parts_of(t)
    factor, unit = length_unit(_typical(d.separation_sigma[:, :3]))
    rows = (
        ((0, 1, 2), factor, f"position, {unit}"),
        ((6, 7), math.degrees(1.0), "tilt, deg"),
        ((8,), math.degrees(1.0), "heading, deg"),
    )
    for ax, (columns, scale, name) in zip(axes[:, 0], rows, strict=True):
        for k in columns:
            colour, axis = AXIS_COLOURS[k % 3], ("north", "east", "down")[k % 3]
            bounds(
                ax,
                t,
                np.zeros_like(t),
                3 * scale * d.separation_sigma[:, k],
                parts,
                color=colour,
                alpha=0.13,
            )
            line(ax, t, scale * d.separation[:, k], parts, axis, color=colour, lw=0.9)
        _look_at_the_middle(
            ax, scale * d.separation[:, columns], 3 * scale * d.separation_sigma[:, columns]
        )
        ax.set_ylabel(name)
    legend(axes[0, 0])
    mark(figure, axes[:, 0], marks)
    axes[2, 0].set_xlabel(marks.label)
    return figure


def _typical(sigma: Array) -> float:
    finite = sigma[np.isfinite(sigma)]
    return float(np.median(finite)) if finite.size else 0.0


def _look_at_the_middle(ax: Any, x: Array, bound: Array) -> None:
    """Scale to three times the median.

    Where one of the two filters knows little, as at the ends, the line may leave the axes.
    """
    size = np.maximum(np.abs(x), bound)
    size = size[np.isfinite(size)]
    if size.size and (reach := 3.0 * float(np.median(size))) > 0.0:
        ax.set_ylim(-reach, reach)
