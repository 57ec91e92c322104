"""Which column of an unknown table is what: by its name where it has one, else by what its values
do.

A name decides where there is one that is known (`names`). Values decide only for `insgnss inspect`,
which reports what it found and why; the readers never guess. By values

    a clock      increases from row to row in nearly equal steps
    a GPS week   is a whole number of 500 to 4000, the same in all rows or one more after a while
    a triad      is three neighbouring columns; that of the accelerometer holds gravity, so its mean
                 is large against its scatter, the gyro's is small: the ratio |mean| / scatter tells
                 the two apart at rest and in flight
    a position   is a latitude and a longitude beside each other that move no faster than an
                 aircraft, the height behind them
    a velocity   is the triad whose values are the differences of the positions (correlation and
                 slope near one), which also tells its order: north east down, north east up or east
                 north up
    sigmas       are triads of small positive numbers behind position and velocity, in the order of
                 that velocity
"""

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np

from ...formats import unit_factor
from ...formats.gnss.repeated import holds_fixes
from ...geodesy.earth import curvature_radii
from ...records import Array
from .clocks import clocks, clocks_by_values, tick, week_column, weeks
from .names import ACCEL_NAMES, GNSS_NAMES, GYRO_NAMES, Grid

GYRO, ACCEL = ("gx", "gy", "gz"), ("ax", "ay", "az")
TENTH_MICRODEGREES, LARGEST_DEGREES = "1e-7 deg", 1e4
VELOCITY_SIGMAS = {"sd_vn", "sd_ve", "sd_vd"}
POSITION_SIGMAS = {"sd_n", "sd_e", "sd_u", "sd_ne", "var_n", "var_e", "var_u"}
MOST_QUALITY = 7  # of RTKLIB's codes
STEADY = 0.8  # of a triad's mean to its scatter: gravity keeps an accelerometer's above it
FASTEST_MS, LARGEST_SIGMA = 150.0, 100.0
FOLLOWS, SLOPE = (
    0.8,
    (0.75, 1.3),
)  # correlation and slope of a velocity against the differences of the positions
PLACE_BY_VALUES = "by their values: a position on Earth that moves as its velocity says"
APART = 4.0  # times that the ratio of the accelerometer exceeds that of the gyro


@dataclass(frozen=True)
class Roles:
    """Columns by canonical name, the clocks that may stamp them, units, and the reason.

    A clock is a column and its unit.
    """

    columns: dict[str, int]
    clocks: dict[int, str] = field(default_factory=dict)
    week: int | None = None
    units: dict[str, str] = field(default_factory=dict)
    repeat_column: int | None = None
    how: str = "by the names of its columns"


def imu_roles(grid: Grid) -> Roles | None:
    """Find gyro and accelerometer of a table; None where it has none."""
    names = grid.named
    named_columns: dict[str, int] = {}
    for canonical, spellings in ((GYRO, GYRO_NAMES), (ACCEL, ACCEL_NAMES)):
        triad = next(
            (names_ for names_ in spellings if all(name in names for name in names_)), None
        )
        if triad is not None:
            named_columns |= {c: names[name] for c, name in zip(canonical, triad, strict=True)}
    if len(named_columns) == 6:
        ticks, how = clocks(grid, 0.5), Roles.how
        if not ticks:
            ticks, how = (
                clocks_by_values(grid, 0.5, set(named_columns.values())),
                f"{Roles.how}, the clock by its values",
            )
        return Roles(named_columns, ticks, week_column(grid), how=how if ticks else Roles.how)
    if any(name is not None for name in grid.names):
        return None
    ticks = clocks(grid, 0.5)
    pair = _two_triads(grid.values, {*ticks, *weeks(grid)})
    if pair is None:
        return None
    gyro, accel = pair
    columns = {
        c: first + k for first, triad in ((gyro, GYRO), (accel, ACCEL)) for k, c in enumerate(triad)
    }
    return Roles(
        columns,
        ticks,
        week_column(grid),
        how="by their values: gravity is in one triad, not in the other",
    )


def triads_named(grid: Grid) -> list[str]:
    """Return which of gyros and accelerometers the names of the columns show."""
    names = grid.named
    sensors = (("gyros", GYRO_NAMES), ("accelerometers", ACCEL_NAMES))
    return [
        sensor
        for sensor, triads in sensors
        if any(all(name in names for name in triad) for triad in triads)
    ]


def _two_triads(values: Array, taken: set[int]) -> tuple[int, int] | None:
    """First column of the gyro's and of the accelerometer's triad among the columns that change."""
    rows = values[:: max(1, len(values) // 20000)]
    alive = [k not in taken and float(np.ptp(rows[:, k])) > 0.0 for k in range(values.shape[1])]
    best: tuple[float, int, int] | None = None
    for first in range(values.shape[1] - 5):
        if not all(alive[first : first + 6]):
            continue
        ratio = [_steadiness(rows[:, k : k + 3]) for k in (first, first + 3)]
        gap = max(ratio) / max(min(ratio), 1e-12)
        if (
            gap > APART
            and max(ratio) > STEADY
            and (best is None or first == 0 or not alive[first - 1])
        ):
            order = (first + 3, first) if ratio[0] > ratio[1] else (first, first + 3)
            best = best or (gap, *order)
    return None if best is None else best[1:]


def _steadiness(triad: Array) -> float:
    """|mean| / scatter."""
    return float(
        np.linalg.norm(np.mean(triad, axis=0)) / max(np.sqrt(np.sum(np.var(triad, axis=0))), 1e-30)
    )


def gnss_roles(grid: Grid) -> Roles | None:
    """Find positions and what else a receiver gives; None where the table has no positions."""
    names = grid.named
    columns = {
        role: names[name]
        for role, spellings in GNSS_NAMES.items()
        for name in reversed(spellings)
        if name in names
    }
    if {"lat", "lon", "h"} <= columns.keys():
        return _completed(grid, columns)
    return None if any(name is not None for name in grid.names) else gnss_by_values(grid)


def _completed(grid: Grid, columns: dict[str, int]) -> Roles:
    """Named columns with their units, and what marks a new fix where the last one is held."""
    up = {"vd", "vu"} & columns.keys()
    if {"vn", "ve"} <= columns.keys() and up:
        unused = {"speed", "course"}
    elif {"speed", "course"} <= columns.keys():
        unused = {"vn", "ve", "sd_vn", "sd_ve", "sd_vd"}
    else:
        unused = {"vn", "ve", "vd", "vu", "speed", "course", "sd_vn", "sd_ve", "sd_vd"}
    columns = {
        role: k for role, k in columns.items() if role not in unused | _no_sigmas(grid, columns)
    }
    if "q" in columns and not np.isin(grid.values[:, columns["q"]], range(MOST_QUALITY + 1)).all():
        del columns["q"]
    units = {"angle": _angle_unit(grid, columns["lat"], columns["lon"])}
    height = grid.values[:, columns["h"]]
    if (
        units["angle"] == TENTH_MICRODEGREES
        and grid.unit_of(columns["h"], "length") is None
        and (height == np.round(height)).all()
    ):
        units["length"] = "mm"  # receivers that count so write whole millimetres
    if "course" in columns:
        units["course"] = (
            "rad" if np.abs(grid.values[:, columns["course"]]).max() <= 6.3 else "deg"
        )  # loggers name it wrongly
    lat, lon = grid.values[:, columns["lat"]], grid.values[:, columns["lon"]]
    changes = (np.diff(lat) != 0.0) | (np.diff(lon) != 0.0)
    ticks = clocks(grid, 30.0)
    repeat_column = None
    if changes.size and changes.mean() < 0.5:
        marks = [k for k in ticks if np.mean((np.diff(grid.values[:, k]) != 0.0) == changes) > 0.95]
        if marks:
            repeat_column = marks[0]
        elif holds_fixes(lat, lon):
            repeat_column = columns["lat"]
        ticks = {k: unit for k, unit in ticks.items() if k != repeat_column}
    return Roles(columns, ticks, week_column(grid), units, repeat_column)


def _angle_unit(grid: Grid, lat: int, lon: int) -> str:
    """Unit of latitude and longitude.

    It is found by values that could be neither degrees nor radians, else by the header, else it is
    radians where all values could be such.
    """
    largest = (np.abs(grid.values[:, lat]).max(), np.abs(grid.values[:, lon]).max())
    if max(largest) > LARGEST_DEGREES and largest[0] <= 90e7 and largest[1] <= 360e7:
        return TENTH_MICRODEGREES
    if header_unit := grid.unit_of(lat, "angle"):
        return header_unit
    return "rad" if largest[0] <= 0.5 * np.pi and largest[1] <= np.pi else "deg"


def _no_sigmas(grid: Grid, columns: dict[str, int]) -> set[str]:
    """Roles of standard deviations that are of no use.

    They are not positive, or double where those of north, east and up exist.
    """
    bad = {
        role
        for role, k in columns.items()
        if role.startswith(("sd_", "var_")) and not grid.values[:, k].min() > 0.0
    }
    if not columns.keys() - bad >= VELOCITY_SIGMAS:
        bad |= VELOCITY_SIGMAS
    for complete in ({"sd_n", "sd_e", "sd_u"}, {"sd_ne", "sd_u"}, {"var_n", "var_e", "var_u"}):
        if complete <= columns.keys() - bad:
            return {role for role in columns if role in POSITION_SIGMAS} - complete | bad
    return bad | {role for role in columns if role in POSITION_SIGMAS}


def gnss_by_values(grid: Grid) -> Roles | None:
    """Find positions and what else a receiver gives by the values alone; None without any."""
    ticks = clocks(grid, 30.0) or clocks_by_values(grid, 30.0, set())
    for clock, unit in ticks.items():  # a latitude along which one flies evenly runs like a clock
        columns = _place_by_values(grid, clock, tick(unit))
        if columns is not None:
            others = {
                k: unit for k, unit in ticks.items() if k != clock and k not in columns.values()
            }
            angle = _angle_unit(grid, columns["lat"], columns["lon"])
            return Roles(
                columns,
                {clock: unit} | others,
                week_column(grid),
                {"angle": angle},
                how=PLACE_BY_VALUES,
            )
    return None


def _place_by_values(grid: Grid, clock: int, factor: float) -> dict[str, int] | None:
    """Columns of a position that moves, its velocity and sigmas; None without such.

    `clock` is the column of time, `factor` its factor to seconds.
    """
    taken, time = {clock, *weeks(grid)}, grid.values[:, clock] * factor
    firsts = range(grid.values.shape[1] - 2)
    for lat, lon, height in [
        *((k, k + 1, k + 2) for k in firsts),
        *((k + 1, k, k + 2) for k in firsts),
    ]:
        if taken & {lat, lon, height}:
            continue
        position = {"lat": lat, "lon": lon, "h": height}
        metres = _metres(grid, position, unit_factor(_angle_unit(grid, lat, lon), "angle"))
        if metres is not None and _travels(
            time, metres
        ):  # latitude first, unless that is no latitude
            return position | _velocity_and_sigmas(grid.values, time, metres, height + 1)
    return None


def _metres(grid: Grid, position: dict[str, int], factor: float) -> Array | None:
    """North, east, down (n, 3), m, of the first row; None where the columns are no position."""
    lat, lon, h = (grid.values[:, position[name]] for name in ("lat", "lon", "h"))
    lat, lon = lat * factor, lon * factor
    if (
        np.abs(lat).max() > 0.5 * np.pi
        or np.abs(lon).max() > 2.0 * np.pi
        or h.min() < -1000.0
        or h.max() > 10000.0
    ):
        return None
    M, N = curvature_radii(lat[0])
    return np.column_stack([(lat - lat[0]) * M, (lon - lon[0]) * N * np.cos(lat[0]), h[0] - h])


def _travels(time: Array, metres: Array) -> bool:
    """Whether the position changes, and but for a few rows never faster than an aircraft."""
    step = np.maximum(np.diff(time), 1e-3)
    speed = np.linalg.norm(np.diff(metres[:, :2], axis=0), axis=1) / step
    whole = (metres == np.round(metres)).all()
    return bool(
        np.mean(speed < FASTEST_MS) > 0.98
        and np.ptp(metres[:, 0]) > 0.0
        and np.ptp(metres[:, 1]) > 0.0
        and not whole
    )


_ORDERS = {
    ("vn", "ve", "vd"): (0, 1, 2, 1.0),
    ("vn", "ve", "vu"): (0, 1, 2, -1.0),
    ("ve", "vn", "vu"): (1, 0, 2, -1.0),
}


def _velocity_and_sigmas(values: Array, time: Array, metres: Array, first: int) -> dict[str, int]:
    """Columns of velocity and of standard deviations behind the position, as far as found."""
    step = np.maximum(np.diff(time), 1e-3)
    seen = np.diff(metres, axis=0) / step[:, None]
    usable = (np.linalg.norm(seen, axis=1) < FASTEST_MS) & (step < 5.0 * np.median(step))
    for k in range(first, values.shape[1] - 2):
        for names, (a, b, c, sign) in _ORDERS.items():
            stated = 0.5 * (values[1:, k : k + 3] + values[:-1, k : k + 3])[usable]
            pairs = [(stated[:, 0], seen[usable, a]), (stated[:, 1], seen[usable, b])]
            if not all(_follows(x, y) for x, y in pairs):
                continue
            vertical = seen[usable, c] * sign
            if np.ptp(stated[:, 2]) > 0.0 and np.dot(stated[:, 2], vertical) < 0.0:
                continue
            velocity = dict(zip(names, range(k, k + 3), strict=True))
            axes = [name[1:] if name != "vd" else "u" for name in names]
            of_place, of_speed = (k + 3, k + 6) if k < first + 3 else (first, k + 3)
            speeds = [f"v{axis if axis != 'u' else 'd'}" for axis in axes]
            return (
                velocity
                | _sigmas(values, axes, "sd_", of_place)
                | _sigmas(values, speeds, "sd_", of_speed)
            )
    return _sigmas(values, ("n", "e", "u"), "sd_", first)


def _sigmas(values: Array, axes: Sequence[str], head: str, first: int) -> dict[str, int]:
    """Three columns of standard deviations from `first` on, where they can be such."""
    if (
        first + 3 > values.shape[1]
        or values[:, first : first + 3].min() <= 0.0
        or values[:, first : first + 3].max() > LARGEST_SIGMA
    ):
        return {}
    return {f"{head}{axis}": first + i for i, axis in enumerate(axes)}


def _follows(stated: Array, seen: Array) -> bool:
    """Whether two series are the same but for noise."""
    if stated.size < 20 or np.std(stated) == 0.0 or np.std(seen) == 0.0:
        return False
    slope = float(np.dot(stated, seen) / np.dot(stated, stated))
    return bool(np.corrcoef(stated, seen)[0, 1] > FOLLOWS and SLOPE[0] < slope < SLOPE[1])
