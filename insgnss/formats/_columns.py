"""From the columns of a text table to named quantities: header aliases, column maps, units, clocks.

A column gets its name from the caller's `columns`, else from the header, else from the documented default of the format.
A header that does not name what is needed is an error that prints it; names are never guessed from values.
"""

import re
from collections.abc import Mapping, Sequence
from itertools import product
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from ..errors import InputError, UsageError
from ..geodesy.gpstime import WEEK_S, unwrap_week
from ._layout import Layout
from ._text import Table, TextTable

Array = NDArray[np.float64]
Aliases = Mapping[str, tuple[str, ...]]
Columns = Sequence[str] | Mapping[str, str] | None

STANDARD_GRAVITY = 9.80665

TIME: Aliases = {
    "tow": ("tow", "gpstow", "gps_tow", "time", "gpstime", "gps_time", "gpst", "sow", "gps_sow", "seconds", "time_of_week", "t"),
    "week": ("week", "gpsweek", "gps_week", "wn"),
}

GYRO_UNITS = {"rad/s": 1.0, "deg/s": np.pi / 180.0, "deg/h": np.pi / 180.0 / 3600.0}
ACCEL_UNITS = {"m/s2": 1.0, "g": STANDARD_GRAVITY, "mg": 1e-3 * STANDARD_GRAVITY}
ANGLE_INCREMENT_UNITS = {"rad": 1.0, "deg": np.pi / 180.0}
VELOCITY_UNITS = {"m/s": 1.0}
ANGLE_UNITS = {"deg": np.pi / 180.0, "rad": 1.0}
LENGTH_UNITS = {"m": 1.0}
TIME_UNITS = {"s": 1.0}

_UNIT_SPELLINGS = {
    **{"m/s/s": "m/s2", "mps2": "m/s2", "m/sec2": "m/s2", "dps": "deg/s", "°/s": "deg/s", "deg/sec": "deg/s", "rad/sec": "rad/s"},
    **{"deg/hr": "deg/h", "°/h": "deg/h", "°": "deg", "degree": "deg", "degrees": "deg", "radian": "rad", "radians": "rad"},
    **{"sec": "s", "second": "s", "seconds": "s", "meter": "m", "metre": "m", "meters": "m", "metres": "m", "mps": "m/s"},
}


def sigma_aliases(*axes: str) -> tuple[str, ...]:
    """Header names of a standard deviation along an axis of these names."""
    heads = ("sd", "std", "sigma", "rms", "acc", "stdev")
    return tuple(f"{head}{glue}{axis}" for head, glue, axis in product(heads, ("_", ""), axes))


def axis_aliases(letter: str, *stems: str) -> tuple[str, ...]:
    """Header names of the component x, y or z of a triad with these stems."""
    return tuple(f"{stem}{glue}{letter}" for stem, glue in product(stems, ("_", "")))


def normalised(name: str) -> tuple[str, str | None]:
    """Header name in lower case with underscores, and the unit in its brackets."""
    match = re.fullmatch(r"\s*[\"']?\s*([^(\[]*?)\s*(?:[(\[]([^)\]]*)[)\]])?\s*[\"']?\s*", name)
    head, unit = match.groups() if match else (name, None)
    return re.sub(r"[\s\-./]+", "_", head.lower()).strip("_"), unit.strip() if unit else None


def unit_name(unit: str) -> str:
    """One spelling for each unit: m/s^2, m/s**2 and m/s² are m/s2."""
    plain = re.sub(r"[\s*^]", "", unit.lower()).replace("²", "2")
    return _UNIT_SPELLINGS.get(plain, plain)


def columns_of(
    table: Table | TextTable,
    aliases: Aliases,
    required: Sequence[str],
    defaults: Sequence[Sequence[str]],
    columns: Columns = None,
) -> dict[str, int]:
    """Index of every known column by its canonical name, the keys of `aliases`.

    columns : canonical name of each column, "-" or any other name leaving one out; or canonical name to name in the header.
    defaults : the documented layouts of a file without header, told apart by their number of columns.
    Raises InputError where a required name is missing, ambiguous, or the number of fields does not fit.
    """
    layout, known = table.layout, ", ".join(aliases)
    if isinstance(columns, Mapping):
        found, what = _from_mapping(table.path, layout, aliases, columns), f"columns = {dict(columns)}"
    elif columns is not None:
        if len(columns) != layout.n_fields:
            raise InputError.at(
                table.path, layout.first_line, f"{layout.n_fields} fields, but columns names {len(columns)}: {list(columns)}"
            )
        found = [name if name in aliases else None for name in columns]
        what = f"columns = {list(columns)}"
    elif layout.header is not None:
        found = _from_header(table.path, layout, aliases)
        what = f"the header {layout.header!r}"
    else:
        default = next((names for names in defaults if len(names) == layout.n_fields), None)
        if default is None:
            sizes = "; ".join(" ".join(names) for names in defaults)
            what = f"{layout.n_fields} fields and no header; without one the columns are {sizes}; name them by columns = [...] of {known}"
            raise InputError.at(table.path, layout.first_line, what)
        found, what = list(default), "the default"
    index = {name: i for i, name in enumerate(found) if name is not None}
    twice = next((name for name in index if found.count(name) > 1), None)
    missing = [name for name in required if name not in index]
    if twice or missing:
        why = f"names {twice} twice" if twice else f"does not name {', '.join(missing)}"
        line = None if columns is not None else layout.header_line
        how = f"set columns = [...] of {known}, with '-' for what is to be left out, or columns = {{ tow = \"its name in the file\", ... }}"
        raise InputError.at(table.path, line, f"{what} {why}; {how}")
    return index


def _from_header(path: str, layout: Layout, aliases: Aliases) -> list[str | None]:
    if layout.header_fields is None:
        what = f"the header {layout.header!r} does not have the {layout.n_fields} fields of the data; set columns = [...]"
        if layout.delimiter == "," and layout.n_fields == 2 * len(str(layout.header).split(",")):
            what += ", or, where these are decimal commas between commas, write the numbers with points"
        raise InputError.at(path, layout.header_line, what)
    canonical = {alias: name for name, names in aliases.items() for alias in names}
    return [canonical.get(normalised(field)[0]) for field in layout.header_fields]


def _from_mapping(path: str, layout: Layout, aliases: Aliases, columns: Mapping[str, str]) -> list[str | None]:
    if layout.header_fields is None:
        what = f"columns names fields of the header, but there is none of {layout.n_fields} fields; give columns as a list instead"
        raise InputError.at(path, layout.first_line, what)
    found: list[str | None] = [None] * layout.n_fields
    names = [normalised(field)[0] for field in layout.header_fields]
    for canonical, field in columns.items():
        if canonical not in aliases:
            raise UsageError(f"{path}: columns: {canonical!r} is none of {', '.join(aliases)}")
        if names.count(normalised(field)[0]) != 1:
            what = f"columns: {field!r} does not stand once in the header {layout.header!r}"
            raise InputError.at(path, layout.header_line, what)
        found[names.index(normalised(field)[0])] = canonical
    return found


def header_unit(layout: Layout, column: int) -> str | None:
    """Unit that the header gives for a column."""
    return normalised(layout.header_fields[column])[1] if layout.header_fields else None


def scale_of(
    table: Table | TextTable, index: Mapping[str, int], names: Sequence[str], units: Mapping[str, float], given: str | None
) -> float:
    """Factor that takes the columns `names` to SI or rad: by the unit `given`, else by the header's, else by the first of `units`."""
    if given is not None:
        if unit_name(given) not in units:
            raise UsageError(f"{table.path}: unit {given!r} for {' '.join(names)} is none of {', '.join(units)}")
        return units[unit_name(given)]
    said = {unit for name in names if name in index and (unit := header_unit(table.layout, index[name]))}
    if not said:
        return next(iter(units.values()))
    unit = said.pop()
    if said or unit_name(unit) not in units:
        what = f"the header gives the unit {unit!r} for {' '.join(names)}, which is none of {', '.join(units)} for them all"
        raise InputError.at(table.path, table.layout.header_line, what)
    return units[unit_name(unit)]


class Lines(Protocol):
    """What can say where a row stands."""

    def at(self, row: int, what: str) -> InputError:
        """The error `what` at the line of `row`."""
        ...


def check_increasing(lines: Lines, time: Array) -> None:
    """Refuse time (n,), s, that does not increase, with the line and both times."""
    step = np.diff(time)
    if (step <= 0.0).any():
        row = int(np.argmax(step <= 0.0)) + 1
        what = f"time {time[row]:.6f} s follows {time[row - 1]:.6f} s; time must increase; sort the file or take out the double line"
        raise lines.at(row, what)


def check_units(units: Mapping[str, str] | None, keys: tuple[str, ...]) -> Mapping[str, str]:
    """The caller's units, after a look at their keys."""
    unknown = next((key for key in units or {} if key not in keys), None)
    if unknown is not None:
        raise UsageError(f"units: {unknown!r} is none of {', '.join(keys)}")
    return units or {}


def gps_time(table: Lines, tow: Array, week: Array | None, gps_week: int | None) -> tuple[Array, int | None]:
    """Seconds of the first week, increasing, and that week; from times of week and either a column of weeks or the caller's week.

    Raises InputError with line and both times where time does not increase, and where a week contradicts the caller's.
    """
    if week is not None:
        first = int(week[0])
        if gps_week is not None and first != gps_week:
            raise table.at(0, f"GPS week {first}, but the flight is said to be of week {gps_week}; check gps_week or the file")
        time, gps_week = tow + WEEK_S * (week - first), first
    else:
        time = unwrap_week(tow)
    check_increasing(table, time)
    if tow.size and (tow.min() < 0.0 or tow.max() > 2.0 * WEEK_S):
        row = int(np.argmax((tow < 0.0) | (tow > 2.0 * WEEK_S)))
        raise table.at(row, f"time {tow[row]:.3f} s is no GPS time of week (0 to {WEEK_S:.0f} s); check the column or convert the clock")
    return time, gps_week
