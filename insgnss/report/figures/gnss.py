"""The picture of a PPK solution: what was solved epoch by epoch, and what the receiver observed.

`series` holds what `gnss.quality` found, arrays by name; those that are not known are absent, and
their rows with them:

    time : (n,) s.
    kind : (n,) index in CLASSES.
    satellites, ratio, distance_m, height_difference_m : (n,).
    believed : (n,) whether the fix is validated.
    separation_m, separation_sigma_m : (n, 3) north, east, down, backward minus forward.
    cn0 : C/N0, {band: (k,) dB-Hz} over cn0_time (k,) s.
    slip_time, slip_satellite : (s,) s and names.
    gaps : (g, 2) s, begin and end.
"""

from collections.abc import Callable, Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

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
    png,
    sheet,
)

Array = NDArray[np.float64]
Series = Mapping[str, Any]
Panel = Callable[[Any, Array, Series], None]

NAMES = (
    "fixed",
    "fixed, degraded",
    "float",
    "isolated float",
    "unsupported float",
    "SBAS",
    "DGPS",
    "single",
    "PPP",
)  # as gnss.covariance.CLASSES
COLOURS = (
    "#009E73",
    "#A6C36F",
    "#E69F00",
    "#CC3311",
    "#000000",
    "#CC79A7",
    "#56B4E9",
    "#7F6A50",
    "#0072B2",
)
VALIDATED = (0, 1)  # of these classes those of a confirmed fix
RATE_WINDOW_S = 30.0
MOST_RATIO, LEAST_RATIO, MOST_SATELLITES_NAMED = 1000.0, 0.9, 30
_ROW = 1.25  # inches


def draw_quality(series: Series) -> bytes:
    """PNG of all rows on one sheet."""
    return png(_draw(series, [*_solution_panels(series), *_signal_panels(series)]))


def _solution_panels(series: Series) -> list[Panel]:
    rows: list[tuple[str, Panel]] = [
        ("satellites", _satellites),
        ("kind", _rate),
        ("ratio", _ratio),
        ("separation_m", _separation),
        ("distance_m", _distance),
    ]
    return [draw for name, draw in rows if name in series]


def _signal_panels(series: Series) -> list[Panel]:
    rows: list[tuple[str, Panel]] = [("cn0", _carrier_to_noise), ("slip_time", _slips)]
    return [draw for name, draw in rows if name in series and len(series[name])]


def _draw(series: Series, panels: list[Panel]) -> Any:
    """One row a panel over minutes since the first epoch; times without observations in red."""
    height = 0.9 + sum(2.0 if panel is _separation else _ROW for panel in panels)
    ratios = [2.0 if panel is _separation else _ROW for panel in panels]
    figure, axes = sheet(len(panels), 1, height, sharex=True, gridspec_kw={"height_ratios": ratios})
    figure.subplots_adjust(hspace=0.3, right=0.93)
    start = float(series["time"][0])
    for ax, draw in zip(axes[:, 0], panels, strict=True):
        draw(ax, _minutes(series["time"], start), series)
        for begin, end in series.get("gaps", ()):
            ax.axvspan((begin - start) / 60.0, (end - start) / 60.0, color=WARN, alpha=0.18, lw=0)
    axes[-1, 0].set_xlabel(f"minutes since {start:.1f} s of the week")
    return figure


def _minutes(time: Array, start: float) -> Array:
    return (np.asarray(time) - start) / 60.0


def _satellites(ax: Any, t: Array, series: Series) -> None:
    """Satellites of each epoch, coloured by class."""
    count = np.asarray(series["satellites"], dtype=np.float64)
    _by_class(ax, t, count, np.asarray(series["kind"]))
    ax.set_ylim(0.0, 1.15 * count.max(initial=1.0))
    ax.set_ylabel("satellites")
    legend(ax, markerscale=4)


def _by_class(ax: Any, t: Array, y: Array, kind: NDArray[np.int64]) -> None:
    for k in np.unique(kind):
        rows = np.flatnonzero(kind == k)
        rows = rows[:: -(-rows.size // 4000)]
        ax.plot(t[rows], y[rows], ".", ms=2, color=COLOURS[k], label=NAMES[k])


def _rate(ax: Any, t: Array, series: Series) -> None:
    """Share of validated fixes within `RATE_WINDOW_S`."""
    fixed = np.isin(series["kind"], VALIDATED)
    count = np.concatenate([[0.0], np.cumsum(fixed)])
    half = RATE_WINDOW_S / 120.0
    first, after = np.searchsorted(t, t - half), np.searchsorted(t, t + half, side="right")
    line(ax, t, 100.0 * (count[after] - count[first]) / (after - first), color=COLOURS[0])
    ax.set_ylim(-3.0, 103.0)
    ax.set_ylabel("fixed, %")


def _ratio(ax: Any, t: Array, series: Series) -> None:
    ratio = np.clip(np.asarray(series["ratio"], dtype=np.float64), LEAST_RATIO, MOST_RATIO)
    _by_class(ax, t, ratio, np.asarray(series["kind"]))
    ax.set_yscale("log")
    ax.set_ylim(LEAST_RATIO, 1.2 * MOST_RATIO)
    ax.set_yticks([1, 3, 10, 100, 1000], ["1", "3", "10", "100", "1000"])
    ax.minorticks_off()
    ax.axhline(3.0, color="black", lw=0.8, ls="--")
    ax.set_ylabel("ratio")


def _separation(ax: Any, t: Array, series: Series) -> None:
    apart, sigma = np.asarray(series["separation_m"]), np.asarray(series["separation_sigma_m"])
    finite = np.isfinite(apart).all(axis=1)
    typical = float(np.median(sigma[finite])) if finite.any() else 1.0
    reach = max(
        4.0 * typical,
        1.2 * float(np.quantile(np.abs(apart[finite]), 0.99)) if finite.any() else 0.0,
    )
    factor, unit = length_unit(reach / 4.0)
    for k, axis in enumerate(("north", "east", "down")):
        bounds(
            ax,
            t[finite],
            np.zeros(int(finite.sum())),
            np.minimum(3.0 * sigma[finite, k], reach) * factor,
            color=AXIS_COLOURS[k],
            alpha=0.1,
        )
        line(
            ax,
            t,
            np.clip(apart[:, k], -reach, reach) * factor,
            label=axis,
            color=AXIS_COLOURS[k],
            lw=0.8,
        )
    ax.set_ylim(-1.05 * reach * factor, 1.05 * reach * factor)
    ax.set_ylabel(f"backward - forward, {unit}")
    legend(ax)


def _distance(ax: Any, t: Array, series: Series) -> None:
    """Distance to the base, and the height above it at the right."""
    line(ax, t, np.asarray(series["distance_m"]) / 1e3, label="distance", color=LINE)
    ax.set_ylabel("from base, km")
    if "height_difference_m" in series:
        beside = ax.twinx()
        line(beside, t, np.asarray(series["height_difference_m"]), color=ACCENT)
        beside.set_ylabel("above base, m", color=ACCENT, size=9)
        beside.tick_params(labelsize=8, length=3, color=FAINT)
        for side in ("top", "left", "right", "bottom"):
            beside.spines[side].set_visible(False)


def _carrier_to_noise(ax: Any, t: Array, series: Series) -> None:
    start = float(series["time"][0])
    for k, (band, level) in enumerate(series["cn0"].items()):
        line(
            ax,
            _minutes(series["cn0_time"], start),
            np.asarray(level),
            label=band,
            color=COLOURS[(8, 2, 0, 5, 7)[k % 5]],
            lw=0.8,
        )
    ax.set_ylabel("C/N0, dB-Hz")
    legend(ax)


def _slips(ax: Any, t: Array, series: Series) -> None:
    """Cycle slips: a dot each, a row a satellite."""
    names = sorted(set(series["slip_satellite"]))
    row = {name: k for k, name in enumerate(names)}
    minutes = _minutes(series["slip_time"], float(series["time"][0]))
    ax.plot(minutes, [row[name] for name in series["slip_satellite"]], ".", color=WARN, ms=3)
    ax.set_ylim(-1.0, len(names))
    step = -(-len(names) // MOST_SATELLITES_NAMED) if len(names) > 8 else 1
    shown = list(range(0, len(names), max(step, -(-len(names) // 8))))
    ax.set_yticks(shown, [names[k] for k in shown])
    ax.set_ylabel("cycle slips")
