"""From the columns of a text table to named quantities: header aliases, column maps, units, clocks.

A column gets its name from the caller's `columns`, else from the header, else from the documented
default of the format. A header that does not name what is needed is an error that prints it; names
are never guessed from values.
"""

import re
from collections.abc import Mapping, Sequence
from itertools import product

import numpy as np
from numpy.typing import NDArray

from ....base.errors import InputError, UsageError
from ....geodesy.gpstime import WEEK_S, gps_from_unix_utc, unwrap_week
from ....records import Finding
from .dates import UNIT as DATES_UNIT
from .headers import Kinds, names_of, normalised
from .layout import Layout, shown
from .order import Lines, note
from .text import Table, TextTable
from .units import UNITS, split_unit, unit_factor

Array = NDArray[np.float64]
Aliases = Mapping[str, tuple[str, ...]]
Columns = Sequence[str] | Mapping[str, str] | None

TIME: Aliases = {
    "tow": (
        "tow",
        "gpstow",
        "gps_tow",
        "time",
        "gpstime",
        "gps_time",
        "gpst",
        "sow",
        "gps_sow",
        "seconds",
        "time_of_week",
        "t",
    ),
    "week": ("week", "gpsweek", "gps_week", "wn"),
}
# nanoseconds beside the seconds of `tow`, where a clock stands in two columns; only `columns` can
# name it
FINE: Aliases = {"nsec": ()}


def sigma_aliases(*axes: str) -> tuple[str, ...]:
    """Return header names of a standard deviation along an axis of these names."""
    heads = ("sd", "std", "sigma", "rms", "acc", "stdev")
    return tuple(f"{head}{glue}{axis}" for head, glue, axis in product(heads, ("_", ""), axes))


def axis_aliases(letter: str, *stems: str) -> tuple[str, ...]:
    """Return header names of the component x, y or z of a triad with these stems."""
    return tuple(f"{stem}{glue}{letter}" for stem, glue in product(stems, ("_", "")))


def columns_of(
    table: Table | TextTable,
    aliases: Aliases,
    required: Sequence[str],
    defaults: Sequence[Sequence[str]],
    columns: Columns = None,
    kinds: Kinds | None = None,
) -> dict[str, int]:
    """Return the index of every known column by its canonical name, the keys of `aliases`.

    Parameters
    ----------
    table : Table or TextTable
        The table.
    aliases : mapping
        Header names by canonical name.
    required : sequence of str
        Canonical names that the table must have.
    defaults : sequence
        The documented layouts of a file without header, distinguished by their number of columns.
    columns : sequence or mapping, optional
        Canonical name of each column, "-" or any other name leaving one out; or canonical name to
        name in the header, or to its index, "[1]" for the first.
    kinds : mapping, optional
        Kinds of the units that may stand behind the names of a header, by canonical name.

    Raises
    ------
    InputError
        A required name that is missing or ambiguous, or a number of fields that does not fit.
    """
    layout, choices = table.layout, ", ".join(aliases)
    if isinstance(columns, Mapping):
        assigned, source = (
            _from_mapping(table.path, layout, aliases, columns),
            f"columns = {dict(columns)}",
        )
    elif columns is not None:
        if len(columns) != layout.n_fields:
            raise InputError.at_line(
                table.path,
                layout.first_line,
                f"{layout.n_fields} fields, but columns names {len(columns)}: {list(columns)}; name"
                " each field, '-' for what is to be left out",
            )
        assigned = [name if name in aliases else None for name in columns]
        source = f"columns = {list(columns)}"
    elif layout.header is not None:
        assigned = _from_header(table.path, layout, aliases, kinds or {})
        source = f"the header {shown(layout.header, 400)}"
    else:
        default = next((names for names in defaults if len(names) == layout.n_fields), None)
        if default is None:
            sizes = "; ".join(" ".join(names) for names in defaults)
            message = (
                f"{layout.n_fields} fields and no header; without one the columns are {sizes}; name"
                f" them by columns = [...] of {choices}"
            )
            most = max(map(len, defaults), default=0)
            if "image" in aliases and not layout.delimiter and layout.n_fields > most:
                message += '; names with blanks stand in quotation marks: "my image 1.jpg"'
            raise InputError.at_line(table.path, layout.first_line, message)
        assigned, source = [name if name in aliases else None for name in default], "the default"
    index = {name: i for i, name in enumerate(assigned) if name is not None}
    twice = next((name for name in index if assigned.count(name) > 1), None)
    missing = [name for name in required if name not in index]
    if twice or missing:
        why = f"names {twice} twice" if twice else f"does not name {', '.join(missing)}"
        line = None if columns is not None else layout.header_line
        how = (
            f"set columns = [...] of {choices}, with '-' for what is to be left out, or columns ="
            ' { tow = "its name in the file", ... }'
        )
        raise InputError.at_line(table.path, line, f"{source} {why}; {how}")
    if isinstance(table, Table):
        table.refuse_text(index.values())
    return index


def _from_header(path: str, layout: Layout, aliases: Aliases, kinds: Kinds) -> list[str | None]:
    if layout.header_fields is None:
        message = (
            f"the header {shown(layout.header, 400)} does not have the {layout.n_fields} fields of"
            " the data; set columns = [...]"
        )
        if layout.delimiter == "," and layout.n_fields == 2 * len(str(layout.header).split(",")):
            message += (
                ", or, where these are decimal commas between commas, write the numbers with points"
            )
        raise InputError.at_line(path, layout.header_line, message)
    canonical = {alias: name for name, names in aliases.items() for alias in names}
    return names_of(layout.header_fields, canonical, kinds)


def _from_mapping(
    path: str, layout: Layout, aliases: Aliases, columns: Mapping[str, str]
) -> list[str | None]:
    assigned: list[str | None] = [None] * layout.n_fields
    names = [normalised(field)[0] for field in layout.header_fields or ()]
    for canonical, field in columns.items():
        if canonical not in aliases:
            raise UsageError(f"{path}: columns: {canonical!r} is none of {', '.join(aliases)}")
        if match := re.fullmatch(r"\[([0-9]+)\]", field):
            index = int(match[1]) - 1
            if not 0 <= index < layout.n_fields:
                raise InputError.at_line(
                    path,
                    layout.first_line,
                    f"columns: there is no field {field}; there are {layout.n_fields}, counted"
                    " from 1",
                )
        elif layout.header_fields is None:
            message = (
                f"columns names fields of the header, but there is none of {layout.n_fields}"
                " fields; give their places, [1] for the first"
            )
            raise InputError.at_line(path, layout.first_line, message)
        elif layout.header_fields.count(field) == 1:
            index = layout.header_fields.index(field)
        elif names.count(normalised(field)[0]) != 1:
            message = (
                f"columns: {field!r} does not stand once in the header {shown(layout.header, 400)}"
            )
            raise InputError.at_line(path, layout.header_line, message)
        else:
            index = names.index(normalised(field)[0])
        if assigned[index] is not None:
            raise UsageError(
                f"{path}: columns: {field!r} is both {assigned[index]} and {canonical};"
                " give each a field of its own"
            )
        assigned[index] = canonical
    return assigned


def reversed_names(layout: Layout, index: Mapping[str, int]) -> list[str]:
    """Return the columns that the header calls by the reverse of their axis, such as -YAccel."""
    fields = layout.header_fields or ()
    return [
        name for name, k in index.items() if fields and re.match(r"[\"'\s]*-\s*[A-Za-z]", fields[k])
    ]


def fields_of(layout: Layout, index: Mapping[str, int], names: Sequence[str]) -> list[str]:
    """Return the fields of the header for the columns `names`, as far as there are any."""
    return (
        [layout.header_fields[index[name]] for name in names if name in index]
        if layout.header_fields
        else []
    )


def check_increasing(lines: Lines, time: Array) -> None:
    """Refuse time (n,), s, that does not increase, with the line and both times."""
    step = np.diff(time)
    if (step <= 0.0).any():
        row = int(np.argmax(step <= 0.0)) + 1
        message = (
            f"time {time[row]:.6f} s follows {time[row - 1]:.6f} s; time must increase; sort the"
            " file or take out the double line"
        )
        raise lines.error_at(row, message)


def clock_of_dates(
    table: Table, index: Mapping[str, int], units: Mapping[str, str], name: str
) -> tuple[Mapping[str, str], tuple[Finding, ...]]:
    """Return the units with that of the clock where the column of time holds dates, and the note.

    Parameters
    ----------
    table : Table
        The table.
    index : mapping
        Columns by canonical name.
    units : mapping
        The caller's units; one of the time stays.
    name : str
        Name of the note.
    """
    if index.get("tow") not in table.dates:
        return units, ()
    advice = "give a clock of its own where they are of another time scale, or time_offset_s"
    date_note = note(
        name, "dates for stamps were taken for UTC", "the time scale of the stamps", advice
    )
    return {"time": DATES_UNIT, **units}, (date_note,)


def clock_of(cols: Mapping[str, Array]) -> Array:
    """Return readings of the column of time, with the nanoseconds of `nsec` where it exists."""
    tow = np.ascontiguousarray(cols["tow"])
    return tow + 1e-9 * cols["nsec"] if "nsec" in cols else tow


def gps_time(
    lines: Lines, tow: Array, week: Array | None, gps_week: int | None, unit: str = "s"
) -> tuple[Array, int | None]:
    """Return seconds of the first week, and that week.

    Parameters
    ----------
    lines : Lines
        Where the rows stand, for refusals.
    tow : ndarray
        (n,) times of week, or of a clock with an epoch.
    week : ndarray, optional
        (n,) a column of weeks; zeros are taken for none.
    gps_week : int, optional
        The caller's week.
    unit : str
        Unit of `tow`, of UNITS["time"]; of a clock with an epoch (unix, gps) the week follows.

    Raises
    ------
    InputError
        A time that is none, or a week that contradicts the caller's, with the line.
    """
    factor, epoch = unit_factor(unit, "time"), split_unit(unit)[1]
    seconds = tow if factor == 1.0 else tow * factor
    if epoch.startswith(("unix", "gps")):
        return _of_epoch(lines, seconds, epoch, gps_week)
    if week is not None and week.any():
        if (
            odd := (week != np.floor(week))
            | (week < 0.0)
            | (week > 9999.0)
            | (np.abs(week - week[0]) > 1.0)
        ).any():
            row = int(np.argmax(odd))
            raise lines.error_at(
                row,
                f"GPS week {week[row]:g} after {week[0]:g}; check the columns, or split the file",
            )
        first = int(week[0])
        _agree(lines, first, gps_week)
        time, gps_week = seconds + WEEK_S * (week - first), first
    else:
        time = unwrap_week(seconds)
    if seconds.size and (seconds.min() < 0.0 or seconds.max() > 2.0 * WEEK_S):
        row = int(np.argmax((seconds < 0.0) | (seconds > 2.0 * WEEK_S)))
        message = (
            f"time {seconds[row]:.3f} s is no GPS time of week (0 to {WEEK_S:.0f} s); check the"
            " column and units = { time = ... } "
        )
        raise lines.error_at(row, f"{message}({', '.join(UNITS['time'])}), or convert the clock")
    return time, gps_week


def _of_epoch(lines: Lines, seconds: Array, epoch: str, gps_week: int | None) -> tuple[Array, int]:
    """Return seconds of the first week, to the microsecond, and that week.

    The clock counts on from its epoch.
    """
    if epoch == "gps":
        if seconds.size == 0 or not seconds.min() >= 0.0:
            raise lines.error_at(
                int(np.argmin(seconds)),
                f"time {seconds.min():.3f} s lies before the start of GPS time; check units = {{"
                " time = ... }",
            )
        first = int(seconds[0] // WEEK_S)
        time = seconds - first * WEEK_S
    else:
        try:
            first, time = gps_from_unix_utc(seconds)
        except InputError as refusal:
            raise lines.error_at(int(np.argmin(seconds)), str(refusal)) from None
    _agree(lines, first, gps_week)
    return np.round(time, 6), first


def _agree(lines: Lines, week: int, gps_week: int | None) -> None:
    if gps_week is not None and week != gps_week:
        raise lines.error_at(
            0,
            f"GPS week {week}, but the flight is said to be of week {gps_week}; check gps_week or"
            " the file",
        )
