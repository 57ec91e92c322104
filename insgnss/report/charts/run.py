"""The charts of a run, each with the sentence that says how to read it.

Time runs in minutes since the first epoch. Long lines are thinned to their extremes (`thin_layer`);
fixes that were rejected, and the images of the map, are all there.
"""

import math
from collections.abc import Iterator, Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ...records import Diagnostics, ExteriorOrientation
from ..coverage import outages, stationary_periods
from ..flightlines import flight_lines, image_sigmas
from ..marks import Marks, marks_of
from ..rules.wording import NED_NAMES
from . import gnss, support
from .chart import AXES_INKS, Array, Background, Chart, Ink, Layer, Panel
from .pieces import dots, length_unit, line, over_time
from .thinned import MOST_DOTS, MOST_POINTS, thin_layer

LONGEST_LABEL = 30  # characters of a label (-): more than this overlaps its neighbours
_MAP = (
    "The flight seen from above, straight lines with their numbers; a cross marks a rejected fix, "
    "red where no fix was used for a while, a ring a stationary period. Zoom with two fingers or "
    "Ctrl and wheel, move by dragging, show all by double-click."
)
_MAP_IMAGES = (
    " Dots are images, coloured by their horizontal standard deviation: those that stand out"
    " deserve less weight in the adjustment. Point at an image to see its time in all charts; click"
    " it to mark it in the table, whose coordinates count from the origin of the tangent plane."
)
_MOTION = (
    "Height, horizontal speed and attitude. Changes of heading make heading and biases "
    "observable; straight flight does not. Shaded in all charts over time: numbered lines, "
    "stationary periods, times without a used fix. Drag across a chart to zoom, double-click to "
    "return; all charts over time follow."
)
_SIGMAS = (
    "Standard deviations on a logarithmic scale: the forward filter pale, the smoothed solution, "
    "which must lie below, dark. A rise shows missing fixes or missing turns; numbers are those "
    "of the table of lines."
)
_BY_IMAGE = "Standard deviations of each image, in order; check images where the values step."


def charts(
    diagnostics: Diagnostics,
    eo: ExteriorOrientation | None,
    standing: bool = False,
    series: Mapping[str, Any] | None = None,
    background: Background | None = None,
) -> tuple[Chart, ...]:
    """All charts for which there is something to show.

    Parameters
    ----------
    standing : the sensor stood at a given place, and there are no fixes.
    series : what the source of the fixes says of each epoch, as `gnss.charts` takes it.
    background : what the map shows below the flight.
    """
    d = diagnostics
    images = eo if eo is not None and len(eo.images) > 0 else None
    marks = marks_of(d, images)
    shown = [] if standing else [_map(d, images, series, background)]
    shown += [_motion(d, images, marks), _sigmas(d, marks)]
    if images is not None:
        shown.append(_sigmas_by_image(images))
    if not standing and np.isfinite(d.innovation).all(axis=1).any():
        shown += [support.innovations(d, marks), *support.distributions(d)]
    if not standing and d.residuals:
        shown.append(support.residuals(d, marks))
    shown.append(support.biases(d, marks))
    constants = support.constants(d, marks)
    if constants is not None:
        shown.append(constants)
    if np.isfinite(d.separation).any():
        shown.append(support.separation(d, marks))
    if not standing and series is not None:
        shown += gnss.charts(series, marks)
    return tuple(shown)


def _map(
    run: Diagnostics,
    eo: ExteriorOrientation | None,
    series: Mapping[str, Any] | None,
    background: Background | None,
) -> Chart:
    north, east = run.position[:, 0], run.position[:, 1]
    rows = track_rows(run)
    ink: Ink = "ink" if background else "faint"
    layers = [Layer("line", east[rows], north[rows], "", ink, width=1.2)]
    layers += _fixes(run, series)
    layers += _map_marks(run)
    if eo is not None:
        layers.append(_images(run, eo))
    layers += [
        Layer("points", east[:1], north[:1], "start", "ink", mark="triangle", width=9.0),
        Layer("points", east[-1:], north[-1:], "end", "ink", mark="square", width=8.0),
        _numbers(run, eo),
    ]
    return Chart(
        "map",
        "Where the flight went",
        _MAP
        + (_MAP_IMAGES if eo is not None else "")
        + (f" The ground below is {background.name}." if background else ""),
        (Panel("north of the local frame's origin, m", layers),),
        "east of the local frame's origin, m",
        map=True,
        link="image" if eo is not None else "time",
        background=background,
    )


def track_rows(run: Diagnostics) -> NDArray[np.int64]:
    """Return the rows of the diagnostics by which the map draws the flight."""
    return np.arange(0, run.time.size, -(-run.time.size // (2 * MOST_POINTS)))


def _fixes(run: Diagnostics, series: Mapping[str, Any] | None) -> Iterator[Layer]:
    """Places of the fixes by class, fixed below all others; classes unknown, none."""
    if series is None or "kind" not in series:
        return
    kind, time = np.asarray(series["kind"]), np.asarray(series["time"])
    inside = (time >= run.time[0]) & (time <= run.time[-1])
    for k in sorted(np.unique(kind[inside])):
        rows = np.flatnonzero(inside & (kind == k))
        rows = rows[:: -(-rows.size // MOST_DOTS)]
        yield Layer(
            "points",
            *_east_north(run, time[rows]),
            gnss.CLASS_NAMES[k],
            gnss.CLASS_INKS[k],
            width=4.0,
            faint=True,
        )


def _images(run: Diagnostics, eo: ExteriorOrientation) -> Layer:
    """The images, coloured by their horizontal sigma; none is left out."""
    position, _ = image_sigmas(eo)
    horizontal = np.hypot(position[:, 0], position[:, 1])
    factor, unit = length_unit(float(np.median(horizontal)))
    return Layer(
        "points",
        *_east_north(run, eo.time),
        "image",
        value=factor * horizontal,
        value_name=f"horizontal sigma of the image, {unit}:",
        width=6.0,
    )


def _map_marks(run: Diagnostics) -> Iterator[Layer]:
    """Yield the map's layers of times without used fixes, stationary periods and rejected fixes."""
    east, north = [np.zeros(0)], [np.zeros(0)]
    for begin, length in outages(run):
        first_row, last_row = np.searchsorted(run.time, (begin, begin + length))
        rows = slice(max(first_row - 1, 0), last_row + 1)
        east += [run.position[rows, 1], np.array([np.nan])]
        north += [run.position[rows, 0], np.array([np.nan])]
    if len(east) > 1:
        yield Layer(
            "line", np.concatenate(east), np.concatenate(north), "no used fix", "warn", width=3.0
        )
    stood = stationary_periods(run)
    if stood.size:
        yield Layer(
            "points",
            *_east_north(run, stood.mean(axis=1)),
            "stationary",
            "ok",
            mark="ring",
            width=8,
        )
    if (~run.used).any():
        texts = [
            f"rejected fix, TOW {t:.2f} s" + (f", NIS {nis:.1f}" if math.isfinite(nis) else "")
            for t, nis in zip(run.fix_time[~run.used], run.nis[~run.used], strict=True)
        ]
        positions = _east_north(run, run.fix_time[~run.used])
        yield Layer(
            "points", *positions, "rejected fix", "warn", mark="cross", width=6, texts=texts
        )


def _numbers(run: Diagnostics, eo: ExteriorOrientation | None) -> Layer:
    """Numbers of the lines, a tenth of the way in."""
    lines = flight_lines(run, eo)
    rows = np.array([x.first + (x.last - x.first) // 10 for x in lines], dtype=np.int64)
    texts = [str(k) for k in range(1, len(lines) + 1)]
    return Layer("labels", run.position[rows, 1], run.position[rows, 0], texts=texts)


def _east_north(run: Diagnostics, time: Array) -> tuple[Array, Array]:
    """East and north at `time`, m."""
    return np.interp(time, run.time, run.position[:, 1]), np.interp(
        time, run.time, run.position[:, 0]
    )


def _motion(run: Diagnostics, eo: ExteriorOrientation | None, marks: Marks) -> Chart:
    """Return the chart of height, speed, attitude and heading over time."""
    t, up = marks.minutes(run.time), marks.broken(marks.minutes(run.time), -run.position[:, 2])
    height = [line(t, up, "trajectory", "faint")]
    if eo is not None:
        exposed = np.interp(eo.time, run.time, -run.position[:, 2])
        height.append(dots(marks.exposures, exposed, "exposures"))
    speed = marks.broken(t, np.hypot(run.velocity[:, 0], run.velocity[:, 1]))
    level = [
        line(t, marks.broken(t, np.degrees(run.rpy[:, k])), name, AXES_INKS[k], width=1.0)
        for k, name in enumerate(("roll", "pitch"))
    ]
    heading = np.degrees(run.rpy[:, 2]) % 360.0
    thinned = slice(None, None, -(-run.time.size // (2 * MOST_POINTS)))
    panels = [
        Panel("up, m", height),
        Panel("speed, m/s", (line(t, speed, "horizontal"),)),
        Panel("roll, pitch, deg", level),
        Panel(
            "heading, deg", (Layer("points", t[thinned], heading[thinned], "heading", width=2.2),)
        ),
    ]
    reading = ("Dots are exposures. " if eo is not None else "") + _MOTION
    return over_time("motion", "How it moved", reading, panels, marks)


def _sigmas(run: Diagnostics, marks: Marks) -> Chart:
    """Return sigmas of position and attitude over time, of the filter and after smoothing."""
    t = marks.minutes(run.time)
    factor, unit = length_unit(float(np.median(run.smoothed_sigma[:, :3])))
    rows = ((0, factor, f"sigma of position, {unit}"), (6, math.degrees(1.0), _ATTITUDE))
    panels = [
        Panel(
            label,
            [
                line(
                    t,
                    marks.broken(t, scale * sigma[:, first_column + k]),
                    NED_NAMES[k] if smoothed else "forward filter",
                    AXES_INKS[k],
                    faint=not smoothed,
                    width=1.8 if smoothed else 1.0,
                )
                for smoothed, sigma in ((False, run.filter_sigma), (True, run.smoothed_sigma))
                for k in range(3)
            ],
            scale="log",
        )
        for first_column, scale, label in rows
    ]
    return over_time("sigmas", "How well it is known", _SIGMAS, panels, marks)


_ATTITUDE = "sigma of attitude about N, E, D, deg"


def _sigmas_by_image(eo: ExteriorOrientation) -> Chart:
    """The sigmas of the images by number; each axis keeps its colour, so north is column 1."""
    number = np.arange(1.0, len(eo.images) + 1.0)
    position, psi = image_sigmas(eo)
    factor, unit = length_unit(float(np.median(position)))
    rows = (
        (factor * position, f"sigma of position, {unit}"),
        (np.degrees(psi), "sigma of attitude about E, N, U, deg"),
    )
    panels = [
        Panel(
            label,
            [
                thin_layer(
                    Layer("points", number, sigma[:, column], name, AXES_INKS[colour]), MOST_DOTS
                )
                for column, colour, name in ((1, 0, "north"), (0, 1, "east"), (2, 2, "up"))
            ],
            scale="log",
        )
        for sigma, label in rows
    ]
    label = f"image, by number (1 is {_shortened_label(eo.images[0])})"
    title = "How well each image is known"
    return Chart("image-sigmas", title, _BY_IMAGE, panels, label, link="image")


def _shortened_label(name: str) -> str:
    """Name as it fits a label."""
    return name if len(name) <= LONGEST_LABEL else f"{name[: LONGEST_LABEL - 3]}..."
