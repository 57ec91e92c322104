"""From the table inside a file to the inputs it holds, in the keys of the flight file.

These are its columns, clock and units. A table whose columns the reader knows by itself gets no
`columns`; any other gets them spelled out.
"""

import re
from collections.abc import Collection
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from ....base.errors import InputError
from ....geodesy.gpstime import GPS_EPOCH_UNIX_S, WEEK_S
from ....io.formats import SENSOR_SCALES
from ....io.formats.gnss import gnss_text
from ....io.formats.gnss.cartesian import reference_in
from ....io.formats.gnss.heights import refused_heights
from ....io.formats.gnss.rounding import floor_of_zeros
from ....io.formats.imu import imu_csv
from ....io.formats.text.columns import TableSpec
from ....io.formats.text.dates import calendar_columns
from ....io.formats.text.headers import factor_of, kinds_like, unit_in
from ....io.formats.text.units import usual_unit
from ..sources import NO_SIGMA, SINGLE_POINT, STEP_REASON, InputSource, Keys, Role
from .clocks import UNIX_FROM, clock_names, fraction_of, tick
from .grids import FEWEST_ROWS, GridTable
from .halves import half_of_imu
from .names import ACCEL, GYRO, Roles, UnknownTable
from .roles import SIGMA_ROLES, fixes_by_values, gnss_roles, has_gravity, imu_roles, triads_named

ASSUMED_HZ = 100.0  # of a table without clock: the usual rate of small IMUs
ATTITUDE = re.compile(
    r"(roll|pitch|yaw|heading|phi|theta|psi)(deg|rad)?|(att|attitude|rpy|ypr|euler)[xyz1-3]?"
    r"|theta[0-2]"
)
OF_RECEIVER = {"nsats", "hdop"}  # names beside which a lone yaw is that of two antennas
UNIT_COLUMNS = {"angle": "lat", "course": "course", "length": "h"}
UNIT_REASONS = {
    "1e-7 deg": "values far beyond 360",
    "deg": "values are too large for a course in rad",
    "mm": "heights are whole numbers, and latitudes are in 1e-7 deg",
}
VELOCITY_UNIT_REASON = "velocities are whole numbers, and heights are in mm"
SIGMA_UNIT_REASON = "standard deviations have decimals, unlike the heights in mm"
NMEA_CODES = (
    "the standard deviations show that the quality codes are those of NMEA: 1 single, 4 fixed, 5 "
    "float"
)
NO_CLOCK = (
    f"the file has no time column; {ASSUMED_HZ:g} Hz is ASSUMED, and all rates and noise "
    "densities depend on this value"
)
HELD_FIXES = "the rows between two fixes repeat the last fix; this column changes with each new fix"
NO_VELOCITY_SIGMA = (
    "the file has no standard deviations of the velocity; the values are typical of a receiver"
)
EPOCH_UNITS = {"s": "unix", "ms": "unix_ms", "us": "unix_us", "ns": "unix_ns"}
ARRAY_ENDINGS = {".mat", ".npy", ".npz"}  # files whose columns must be named
CLOCKLESS = {".npy", ".npz", ".imu"}
GPS_EPOCH_UNIX = GPS_EPOCH_UNIX_S - 18.0  # with the leap seconds since 2017


def sources_of_table(path: Path, table: GridTable) -> list[InputSource]:
    """Return IMU, fixes or exposures in one table, each with the columns that nothing took."""
    grid = table.grid
    named = any(name is not None for name in grid.names)
    finite = np.isfinite(grid.values).all(axis=0)
    enough_rows = len(grid.values) >= FEWEST_ROWS
    fixes = gnss_roles(_zero_filled(grid, finite)) if enough_rows else None
    samples = imu_roles(_zero_filled(grid, finite)) if enough_rows else None
    if named and fixes is None and samples is None and enough_rows:
        fixes = fixes_by_values(_zero_filled(grid, finite))
    if not named and fixes is not None and samples is not None:
        moves = {"vn", "speed"} & fixes.columns.keys()
        if has_gravity(grid, samples) and not moves:
            fixes = None
        else:
            samples = None
    attitude = sum(ATTITUDE.fullmatch(name) is not None for name in grid.named)
    solution = samples is None and attitude > (1 if grid.named.keys() >= OF_RECEIVER else 0)
    if samples is not None and fixes is not None:  # one clock has one unit
        shared = {column: unit for column, unit in samples.clocks.items() if column in fixes.clocks}
        fixes = replace(fixes, clocks=fixes.clocks | shared)
    readable: list[tuple[Any, Roles]] = []
    if samples is not None and (
        samples.clocks or path.suffix.lower() in CLOCKLESS or len(grid.names) in (6, 7)
    ):
        readable.append((_imu_source, samples))
    if fixes is not None and fixes.clocks and not solution:
        readable.append((_gnss_source, fixes))
    unread_columns = _unread_columns(table, finite, [roles for _, roles in readable])
    sources = [
        replace(source_of(path, table, roles), columns_left_out=unread_columns)
        for source_of, roles in readable
    ]
    if not sources and enough_rows and fixes is None and not solution:
        sources = half_of_imu(path, table, lambda roles: _imu_source(path, table, roles))
    events = sources or _events(path, table)
    if (
        not events
        and not solution
        and table.variable is None
        and (why := _incomplete(table, fixes, samples))
    ):
        raise InputError.in_file(path, why)
    return events


def _zero_filled(grid: UnknownTable, finite: Any) -> UnknownTable:
    """Return the table with zeros for columns without a name that are no number in some rows.

    A column of zeros is taken for nothing.
    """
    unnamed = [name is None for name in grid.names]
    empty = np.flatnonzero(~finite & unnamed)
    if not empty.size:
        return grid
    values = grid.values.copy()
    values[:, empty] = 0.0
    return replace(grid, values=values)


def _unread_columns(table: GridTable, finite: Any, inputs: list[Roles]) -> tuple[str, ...]:
    """Name the columns that no input takes, with the reason where there is a particular one."""
    grid = table.grid
    used: set[int | None] = {fine for fine, _ in grid.fractions.values()}
    reasons: dict[int, str] = {}
    date = set(calendar_columns(table.fields).values())
    for roles in inputs:
        first, *further = roles.clocks or (None,)
        used |= date if first in date else set()
        used |= {*roles.columns.values(), first, roles.week, roles.repeat_column}
        reasons |= dict.fromkeys(further, "another clock") | roles.unread
    texts = []
    for k in range(len(grid.names)):
        if k in used:
            continue
        name = table.fields[k] or f"[{k + 1}]"
        reason = reasons.get(k) or ("" if finite[k] else "no number in some rows")
        texts.append(f"{name} ({reason})" if reason else name)
    return tuple(texts)


def _incomplete(table: GridTable, fixes: Roles | None, samples: Roles | None) -> str:
    """What a table of a sensor lacks to be of use; empty where it holds none, or lacks nothing."""
    names = " ".join(name or f"[{k + 1}]" for k, name in enumerate(table.grid.names))
    timed = any(roles is not None and roles.clocks for roles in (samples, fixes))
    texts = [
        name
        for name, column in zip(table.grid.names, table.grid.values.T, strict=True)
        if name and clock_names(name) and np.isnan(column).mean() > 0.5
    ]
    if texts and not timed:
        return (
            f"the time column {texts[0]} holds neither numbers nor dates, and times of day lack "
            "the date; write seconds, or dates as 2026-05-01 09:00:00.010"
        )
    if samples is not None and not samples.clocks:
        return (
            f"gyros and accelerometers have no time column among {names}; name one time or tow, "
            "or set imu.columns and imu.rate_hz"
        )
    if fixes is not None and not fixes.clocks:
        return f"positions have no time column among {names}; name one time or tow"
    named = triads_named(table.grid) if len(table.grid.values) >= FEWEST_ROWS else []
    if len(named) == 1 and fixes is None:
        missing = "accelerometers" if named == ["gyros"] else "gyros"
        return (
            f"{named[0]} without {missing} or a time column among {names}; put both sensors into "
            "one table, or name the columns gx gy gz and ax ay az"
        )
    return ""


def _imu_source(path: Path, table: GridTable, roles: Roles) -> InputSource:
    """Samples by their first clock; by the others in `other_clocks`."""
    sources = []
    for clock, unit in roles.clocks.items() or [(None, "s")]:
        entry = _keys_of_variable(table)
        columns, span = dict(roles.columns), None
        if clock is None:
            entry.set("rate_hz", ASSUMED_HZ, NO_CLOCK)
        else:
            columns |= _clock_columns(table.grid, clock, roles.week)
            span = _time_span(table.grid, clock, unit)
            _time_unit(entry, table.grid, clock, unit)
        _spell_out(path, table, columns, "imu", entry, roles.how)
        units = _header_units(table.grid, columns, entry)
        rows = f"samples, {len(table.grid.values)} rows"
        sources.append(
            InputSource("imu", path, rows, entry.keys, entry.why, span, header_units=units)
        )
    return replace(sources[0], other_clocks=tuple(sources[1:]))


def _header_units(grid: UnknownTable, columns: dict[str, int], entry: Keys) -> dict[str, str]:
    """Units of gyro and accel that the names of the columns give, and with them the quantity.

    One that no reader knows is none, nor that of an increment beside that of a rate: the numbers
    are then read as SI, and that is noted.
    """
    header_units: dict[str, str] = {}
    for key, names in (("gyro", GYRO), ("accel", ACCEL)):
        fields = [
            name for c in names if c in columns and (name := grid.names[columns[c]]) is not None
        ]
        if unit := next(filter(None, (unit_in(field, kinds_like(key)) for field in fields)), None):
            header_units[key] = next(
                (usual for kind in kinds_like(key) if (usual := usual_unit(unit, kind)) != unit),
                unit,
            )
    rates, increments = (
        {key for key, unit in header_units.items() if factor_of(unit, (f"{key}{of}",)) is not None}
        for of in ("", " increment")
    )
    if increments == header_units.keys() and header_units:
        reason = f"the header gives {' and '.join(header_units.values())}"
        entry.set("quantity", "increments", reason)
        return header_units
    for key in header_units.keys() - rates:
        problem = "is that of an increment" if key in increments else "is not known"
        reason = f"the header's unit {header_units[key]!r} {problem}"
        entry.set_unit(key, next(iter(SENSOR_SCALES[key])), reason)
    return {key: unit for key, unit in header_units.items() if key in rates}


def _gnss_source(path: Path, table: GridTable, roles: Roles) -> InputSource:
    """Return the fixes timed by their first clock; those by the others in `other_clocks`."""
    sources = []
    for clock, unit in roles.clocks.items():
        entry = _keys_of_variable(table)
        columns = roles.columns | _clock_columns(table.grid, clock, roles.week)
        _time_unit(entry, table.grid, clock, unit)
        _add_units(entry, table.grid, roles)
        if roles.repeat_column is not None:
            entry.set("repeat_column", table.fields[roles.repeat_column], HELD_FIXES)
        _add_sigmas(entry, table.grid, columns)
        _spell_out(path, table, columns, "gnss", entry, roles.how)
        if "north" in columns and _is_text(path) and (reference := reference_in(path)):
            entry.set("reference", list(reference), "a comment of the file names it")
        names = [table.fields[columns["h"]] or ""] if "h" in columns else []
        if above_geoid := refused_heights(path, names, commented=_is_text(path)):
            reason = f"{above_geoid}: write the geoid's height above the ellipsoid here"
            entry.set("undulation_m", 0.0, reason)  # to look at them; the draft leaves it open
        rows: Any = slice(None)
        if roles.repeat_column is not None:
            rows = np.flatnonzero(np.diff(table.grid.values[:, roles.repeat_column]) != 0.0) + 1
        count = f"fixes, {len(table.grid.values[rows])} of them"
        span = _time_span(table.grid, clock, unit, rows)
        free_height = "h" in columns  # a name that may mean above the sea
        sources.append(
            InputSource("gnss", path, count, entry.keys, entry.why, span, free_height=free_height)
        )
    return replace(sources[0], other_clocks=tuple(sources[1:]))


def _add_units(entry: Keys, grid: UnknownTable, roles: Roles) -> None:
    """Add the units that the values show and the header does not state, each with its reason."""
    if "quality" in roles.units:
        entry.set_unit("quality", roles.units["quality"], NMEA_CODES)
    for key, column in UNIT_COLUMNS.items():
        if key not in roles.units:
            continue
        value, kind = roles.units[key], "length" if key == "length" else "angle"
        if value != (grid.unit_of(roles.columns[column], kind) or "deg"):
            quantity = "a course" if key == "course" else "latitude and longitude"
            usual = f"no value is too large for {quantity} in rad"
            entry.set_unit(key, value, UNIT_REASONS.get(value, usual))
    for key, reason in (("sigma", SIGMA_UNIT_REASON), ("velocity", VELOCITY_UNIT_REASON)):
        if key in roles.units:
            entry.set_unit(key, roles.units[key], reason)


def _add_sigmas(entry: Keys, grid: UnknownTable, columns: dict[str, int]) -> None:
    """Add a single-point receiver's standard deviations where fixes have none."""
    if not SIGMA_ROLES & columns.keys():
        entry.set("sigma_m", SINGLE_POINT["sigma_m"], NO_SIGMA)
    elif unstated := _count_unstated_sigmas(grid, columns):
        reason = (
            f"{unstated} of {len(grid.values)} fixes have no standard deviation, or 0; the values "
            "are typical of a single-point receiver"
        )
        entry.set("sigma_m", SINGLE_POINT["sigma_m"], reason)
    if {"vn", "ve", "speed"} & columns.keys() and not {"sd_vn", "sd_v"} & columns.keys():
        entry.set("sigma_velocity_mps", SINGLE_POINT["sigma_velocity_mps"], NO_VELOCITY_SIGMA)


def _count_unstated_sigmas(grid: UnknownTable, columns: dict[str, int]) -> int:
    """Count the fixes without a standard deviation, or with a zero that is no rounded one."""
    sigmas = [np.nan_to_num(grid.values[:, columns[role]]) for role in SIGMA_ROLES & columns.keys()]
    zero = [sigma == 0.0 for sigma in sigmas if floor_of_zeros(sigma) is None]
    return int(np.any(zero, axis=0).sum()) if zero else 0


def _events(path: Path, table: GridTable) -> list[InputSource]:
    """Exposures of a table without names, whose last column is a clock."""
    named = any(name is not None for name in table.grid.names)
    if path.suffix.lower() in ARRAY_ENDINGS or named or not 1 <= len(table.grid.names) <= 2:
        return []
    count = f"exposures, {len(table.grid.values)} of them"
    last = table.grid.values[:, -1]
    increasing = np.isfinite(last).all() and last.size > 1 and bool((np.diff(last) > 0.0).all())
    if not increasing:
        return []
    return [InputSource("events", path, count, span=(float(last[0]), float(last[-1])))]


def _clock_columns(grid: UnknownTable, clock: int, week: int | None) -> dict[str, int]:
    """Columns of the time: seconds, fractions and week, as far as there are any."""
    columns = {"tow": clock, **fraction_of(grid, clock), "week": week}
    return {name: k for name, k in columns.items() if k is not None}


def _keys_of_variable(table: GridTable) -> Keys:
    """The key of the variable that holds the table, where the file has variables."""
    return Keys({} if table.variable is None else {"variable": table.variable})


def _is_text(path: Path) -> bool:
    return path.is_file() and path.suffix.lower() not in ARRAY_ENDINGS


def _time_unit(entry: Keys, grid: UnknownTable, clock: int, unit: str) -> None:
    """Unit of the clock, where it is not the reader's default."""
    steps = np.diff(grid.values[:, clock])
    if unit in EPOCH_UNITS and float(np.median(grid.values[:, clock])) * tick(unit) > UNIX_FROM:
        unit = EPOCH_UNITS[unit]
    header_unit = grid.unit_of(clock, "time")
    if unit == "s" and header_unit in (unit, None):
        return
    by_step = f"{STEP_REASON} {float(np.median(steps[steps > 0.0])):g}"
    entry.set_unit("time", unit, f"the header gives {unit}" if header_unit == unit else by_step)


def _time_span(
    grid: UnknownTable, clock: int, unit: str, rows: Any = slice(None)
) -> tuple[float, float]:
    """First and last stamp, s; of a clock that counts from 1970 about the time of week."""
    column = grid.values[rows, clock] * tick(unit)
    if np.median(column) > UNIX_FROM:  # without rows from before the date was known
        column = column[column > UNIX_FROM]
    first_s, last_s = float(column[0]), float(column[-1])
    offset_s = 0.0 if first_s < UNIX_FROM else first_s - (first_s - GPS_EPOCH_UNIX) % WEEK_S
    return first_s - offset_s, last_s - offset_s


def _spell_out(
    path: Path, table: GridTable, columns: dict[str, int], role: Role, entry: Keys, how: str
) -> None:
    """Set `columns`, unless the reader of text tables finds the same ones itself."""
    names, spec = table.grid.names, _spec(role, columns)
    if all(name is None for name in names):
        name_of = {k: name for name, k in columns.items()}
        listed = [name_of.get(k, "-") for k in range(len(names))]
        if not (_is_text(path) and " ".join(listed) in spec.layouts):
            entry.set("columns", listed, how)
        return
    named_columns = [
        (name, k) for k, name in enumerate(spec.named(table.fields)) if name is not None
    ]
    by_itself = dict(named_columns) == columns and len(named_columns) == len(columns)
    if not (_is_text(path) and by_itself):
        entry.set("columns", {name: table.fields[k] for name, k in columns.items()}, how)


def _spec(role: Role, columns: Collection[str]) -> TableSpec:
    """What the reader of text tables takes."""
    return (
        imu_csv.with_required(imu_csv.IMU_COLUMNS) if role == "imu" else gnss_text.spec_of(columns)
    )
