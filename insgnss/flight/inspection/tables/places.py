"""Where an unknown table without names has its positions, and what a receiver gives beside them.

By values

    a position   is a latitude and a longitude beside each other that move no faster than an
                 aircraft, the height behind them; one row in seven may be a wrong fix
    a velocity   is the triad whose values are the differences of the positions (correlation and
                 slope near one), which also tells its order: north east down, north east up or east
                 north up; or a speed with a course behind it, and the vertical behind these
    sigmas       are triads of small positive numbers behind position and velocity, in the order of
                 that velocity

Which of the two angles is the latitude is shown by the velocity alone: it must be the difference of
the positions in both, and a metre east is more longitude than a metre north is latitude. Without a
velocity the first is taken for the latitude, unless it can be none.
"""

from collections.abc import Iterator, Sequence

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view

from ....geodesy.earth import curvature_radii
from ....io.formats import unit_factor
from ....io.formats.gnss.rounding import floor_of_zeros
from ....records import Array
from .clocks import clocks, clocks_by_values, is_clock_of, tick, week_column, weeks
from .names import Roles, UnknownTable

TENTH_MICRODEGREES, LARGEST_DEGREES = "1e-7 deg", 1e4
# velocity (m/s) of a vehicle, and sigma (m) of its fixes: larger ones are other columns
FASTEST_MS, LARGEST_SIGMA = 150.0, 100.0
BAD_SHARE = 0.15  # of the rows: wrong fixes among those of a position
MEDIAN_OF = 5  # rows, among which up to two wrong fixes do not show
# rows; the way in them over that of one, which noise does not make; and what may be noise
LAG, TRAVELLED, SMALL_M = 20, 4.0, 100.0
# correlation and slope of a velocity against the differences of the positions, without the worst
FOLLOWS, SLOPE, KEPT_VELOCITIES = 0.8, (0.75, 1.3), 0.75
RISES = 0.3  # correlation that tells a vertical velocity beside a speed and a course
MOST_ROWS_LOOKED_AT = 20000  # looked at
PLACES_BY_VALUES = "by their values, a position on Earth that moves as its velocity"
ORDER_ASSUMED = (
    "recognised by their values, a position on Earth; no velocity shows which angle is the "
    "latitude, so the first possible one is taken: check the order"
)
_ORDERS = {
    ("vn", "ve", "vd"): (0, 1, 2, 1.0),
    ("vn", "ve", "vu"): (0, 1, 2, -1.0),
    ("ve", "vn", "vu"): (1, 0, 2, -1.0),
}


def angle_unit(grid: UnknownTable, lat: int, lon: int) -> str:
    """Return the unit of latitude and longitude.

    It is found by values that could be neither degrees nor radians, else by the header, else it is
    radians where all values could be such.
    """
    largest = (np.abs(grid.values[:, lat]).max(), np.abs(grid.values[:, lon]).max())
    if max(largest) > LARGEST_DEGREES and largest[0] <= 90e7 and largest[1] <= 360e7:
        return TENTH_MICRODEGREES
    if header_unit := grid.unit_of(lat, "angle"):
        return header_unit
    return "rad" if largest[0] <= 0.5 * np.pi and largest[1] <= np.pi else "deg"


def gnss_by_values(grid: UnknownTable) -> Roles | None:
    """Find positions and what else a receiver gives by the values alone; None without any."""
    ticks = clocks(grid, 30.0) or clocks_by_values(grid, 30.0, set())
    for clock, unit in ticks.items():  # a latitude along which one flies evenly runs like a clock
        position = _position(grid, clock, tick(unit))
        if position is not None:
            columns, units = position
            further = {
                k: unit for k, unit in ticks.items() if k != clock and k not in columns.values()
            }
            moving = {"vn", "speed"} & columns.keys()
            return Roles(
                columns,
                {clock: unit} | further,
                week_column(grid),
                units,
                how=PLACES_BY_VALUES if moving else ORDER_ASSUMED,
            )
    return None


def _position(
    grid: UnknownTable, clock: int, factor: float
) -> tuple[dict[str, int], dict[str, str]] | None:
    """Columns of a position that moves, its velocity and sigmas, and their units.

    `clock` is the column of time, `factor` its factor to seconds. Of several positions that is
    taken whose velocity beside it agrees best, else the first.
    """
    step = max(1, -(-len(grid.values) // MOST_ROWS_LOOKED_AT))
    grid = UnknownTable(grid.values[::step], grid.names)
    time = grid.values[:, clock] * factor
    columns = range(grid.values.shape[1])
    used_columns = {
        clock,
        *weeks(grid),
        *(column for column in columns if is_clock_of(grid, column, clock)),
    }
    best_position: tuple[float, dict[str, int], dict[str, str]] | None = None
    for lat, lon, height in _triples(grid.values.shape[1]):
        if used_columns & {lat, lon, height} or is_clock_of(grid, lat, lon):
            continue
        position = {"lat": lat, "lon": lon, "h": height}
        units = {"angle": angle_unit(grid, lat, lon)}
        metres = _metres(grid, position, units["angle"])
        if metres is None or not _draws_path(time, metres, any(grid.names)):
            continue
        velocity_and_sigmas, course_units, misfit = _velocity_and_sigmas(
            grid.values, time, metres, height + 1
        )
        if best_position is None or misfit < best_position[0]:
            best_position = misfit, position | velocity_and_sigmas, units | course_units
    return None if best_position is None else best_position[1:]


def _triples(columns: int) -> Iterator[tuple[int, int, int]]:
    """Yield the places of latitude, longitude and height: latitude first, then longitude first."""
    firsts = range(columns - 2)
    yield from ((k, k + 1, k + 2) for k in firsts)
    yield from ((k + 1, k, k + 2) for k in firsts)


def _metres(grid: UnknownTable, position: dict[str, int], unit: str) -> Array | None:
    """North, east, down (n, 3), m, of the first row; None where the columns are no position.

    Whole numbers are a position in `TENTH_MICRODEGREES` only, and nothing else is.
    """
    raw = grid.values[:, [position["lat"], position["lon"]]]
    integral = (raw == np.round(raw)).all(axis=0)
    if not integral.all() if unit == TENTH_MICRODEGREES else integral.any():
        return None
    lat, lon = raw.T * unit_factor(unit, "angle")
    height = grid.values[:, position["h"]]
    if (
        np.abs(lat).max() > 0.5 * np.pi
        or np.abs(lon).max() > 2.0 * np.pi
        or height.min() < -1000.0
        or height.max() > 10000.0
    ):
        return None
    meridian_m, prime_vertical_m = curvature_radii(lat[0])
    return np.column_stack(
        [
            (lat - lat[0]) * meridian_m,
            (lon - lon[0]) * prime_vertical_m * np.cos(lat[0]),
            height[0] - height,
        ]
    )


def _draws_path(time: Array, metres: Array, named: bool) -> bool:
    """Whether the positions draw a path, never faster than an aircraft, but for wrong fixes.

    Those of one place do as well where no names of columns say that they are something else.
    """
    if len(metres) <= 2 * LAG or not (np.ptp(metres[:, :2], axis=0) > 0.0).all():
        return False
    step = np.maximum(np.diff(time), 1e-3)
    count = len(metres) - MEDIAN_OF + 1
    path = np.median(sliding_window_view(metres[:, :2], MEDIAN_OF, axis=0), axis=2)
    half = MEDIAN_OF // 2
    deviation = np.linalg.norm(metres[half : half + count, :2] - path, axis=1)
    step_length = np.linalg.norm(np.diff(path, axis=0), axis=1)
    longest_step = 2.0 * FASTEST_MS * float(np.median(step))
    distance = np.linalg.norm(path[LAG:] - path[:-LAG], axis=1)
    spread = np.quantile(path, 0.95, axis=0) - np.quantile(path, 0.05, axis=0)
    drawn = np.quantile(distance, 0.9) > TRAVELLED * np.quantile(step_length, 0.9) or (
        not named and spread.max() < SMALL_M
    )
    return bool(
        np.mean(step_length < FASTEST_MS * step[half : half + count - 1]) > 0.98
        and np.mean(deviation > longest_step) < BAD_SHARE
        and drawn
    )


def _velocity_and_sigmas(
    values: Array, time: Array, metres: Array, first_column: int
) -> tuple[dict[str, int], dict[str, str], float]:
    """Return columns of velocity and sigmas from `first_column` on, their units, the misfit.

    The misfit of the stated velocity to the slopes of the positions (-); infinite without one.
    """
    step = np.maximum(np.diff(time), 1e-3)
    track = np.diff(metres, axis=0) / step[:, None]
    usable = (np.linalg.norm(track, axis=1) < FASTEST_MS) & (step < 5.0 * np.median(step))
    mean = 0.5 * (values[1:] + values[:-1])
    for k in range(first_column, values.shape[1] - 2):
        for names, (north, east, vertical_axis, vertical_sign) in _ORDERS.items():
            stated_velocity = mean[usable, k : k + 3]
            misfit = _misfit(stated_velocity[:, 0], track[usable, north]) + _misfit(
                stated_velocity[:, 1], track[usable, east]
            )
            vertical = track[usable, vertical_axis] * vertical_sign
            if not np.isfinite(misfit) or (
                np.ptp(stated_velocity[:, 2]) > 0.0
                and np.dot(stated_velocity[:, 2], vertical) < 0.0
            ):
                continue
            velocity = dict(zip(names, range(k, k + 3), strict=True))
            axes = [name[1:] if name != "vd" else "u" for name in names]
            of_place, of_speed = (k + 3, k + 6) if k < first_column + 3 else (first_column, k + 3)
            speeds = [f"v{axis if axis != 'u' else 'd'}" for axis in axes]
            sigmas = _sigmas(values, axes, of_place) | _sigmas(values, speeds, of_speed)
            return velocity | sigmas, {}, misfit
    for k in range(first_column, values.shape[1] - 1):
        for unit, factor in (("deg", np.pi / 180.0), ("rad", 1.0)):
            polar = values[:, k] * np.exp(1j * factor * values[:, k + 1])
            along = (0.5 * (polar[1:] + polar[:-1]))[usable]
            misfit = _misfit(along.real, track[usable, 0]) + _misfit(along.imag, track[usable, 1])
            if values[:, k].min() < 0.0 or not np.isfinite(misfit):
                continue
            columns = {"speed": k, "course": k + 1}
            if k + 2 < values.shape[1] and (up := _vertical(mean[usable, k + 2], track[usable, 2])):
                columns[up] = k + 2
            return (
                columns | _sigmas(values, ("n", "e", "u"), first_column),
                {"course": unit},
                misfit,
            )
    return _sigmas(values, ("n", "e", "u"), first_column), {}, np.inf


def _vertical(stated: Array, down: Array) -> str:
    """Name of a vertical velocity, by its sense; empty where it is none."""
    if np.std(stated) == 0.0 or np.std(down) == 0.0:
        return ""
    likeness = float(np.corrcoef(stated, down)[0, 1])
    return "" if abs(likeness) < RISES else "vd" if likeness > 0.0 else "vu"


def _sigmas(values: Array, axes: Sequence[str], first: int) -> dict[str, int]:
    """Three columns of standard deviations from `first` on, where they can be such."""
    columns = values[:, first : first + 3]
    if columns.shape[1] < 3 or columns.min() < 0.0 or columns.max() > LARGEST_SIGMA:
        return {}
    if not all(c.min() > 0.0 or floor_of_zeros(c) is not None for c in columns.T):
        return {}
    return {f"sd_{axis}": first + i for i, axis in enumerate(axes)}


def _misfit(stated: Array, track: Array) -> float:
    """How far the slope of two series is from one, as a logarithm; infinite for unlike ones.

    The worst of the rows are left out: differences across a wrong fix.
    """
    if stated.size < 20 or np.std(stated) == 0.0 or np.std(track) == 0.0:
        return np.inf
    deviation = np.abs(stated - track)
    kept = deviation <= np.quantile(deviation, KEPT_VELOCITIES)
    x, y = stated[kept], track[kept]
    if np.std(x) == 0.0 or np.std(y) == 0.0:
        return np.inf
    slope = float(np.dot(x, y) / np.dot(x, x))
    like = np.corrcoef(x, y)[0, 1] > FOLLOWS and SLOPE[0] < slope < SLOPE[1]
    return abs(np.log(slope)) if like else np.inf
