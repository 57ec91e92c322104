"""Heights of a barometer: `tow h` or `tow pressure`, data_specs/barometer.md.

A pressure becomes the height that belongs to it in the standard atmosphere
(`geodesy.atmosphere`); where both are there the pressure is taken, which no autopilot has set to
zero in between.
"""

from collections.abc import Mapping

import numpy as np

from ...base.errors import InputError
from ...geodesy.atmosphere import LOWEST_PA, standard_height
from ...records import Array, BarometerHeights, Finding
from .text.columns import TIME, Aliases, Columns, columns_of, fields_of, gps_time
from .text.headers import Kinds, settled_units
from .text.order import Lines, open_end, put_in_order
from .text.text import Source, read_table
from .text.units import check_units

ROWS = "barometer rows"  # name of the notes on rows left out or put in order
HIGHEST_PA = 120e3  # far below sea level
HEIGHTS_M = (-2000.0, 11000.0)  # above whatever level it counts from
DEFAULTS = (("tow", "h"),)
UNIT_COLUMNS = {"length": ("h",), "pressure": ("pressure",), "time": ("tow",)}
KINDS: Kinds = {name: (kind,) for kind, names in UNIT_COLUMNS.items() for name in names}
ALIASES: Aliases = {
    **TIME,
    "h": ("h", "height", "hgt", "alt", "altitude", "baro", "baro_alt", "baro_height"),
    "pressure": ("p", "press", "pressure", "baro_pressure", "static_pressure"),
}


def read_barometer_text(
    path: Source,
    columns: Columns = None,
    gps_week: int | None = None,
    units: Mapping[str, str] | None = None,
) -> BarometerHeights:
    """Read the heights of a barometer.

    Parameters
    ----------
    path : path
        The file.
    columns : sequence or mapping, optional
        Name of each column out of tow, week, h, pressure; any other name leaves a column out; or a
        table of them to the header's.
    gps_week : int, optional
        The week, where no column holds it.
    units : mapping, optional
        Units of "time", "length" and "pressure", else those that the header gives, else s, m, Pa.

    Returns
    -------
    BarometerHeights
        The heights.

    Raises
    ------
    InputError
        Neither height nor pressure, a bad value, or time that does not increase, with file and
        line.
    """
    units = check_units(units, tuple(UNIT_COLUMNS))
    table = read_table(path)
    index = columns_of(table, ALIASES, ("tow",), DEFAULTS, columns, KINDS)
    fields = {key: fields_of(table.layout, index, names) for key, names in UNIT_COLUMNS.items()}
    kinds = {key: key for key in UNIT_COLUMNS}
    taken, factors, notes = settled_units(
        str(path), table.layout.header_line, UNIT_COLUMNS, kinds, fields, units, "barometer"
    )
    cols = {name: np.ascontiguousarray(table.values[:, i]) for name, i in index.items()}
    tow, week = cols.pop("tow"), cols.pop("week", None)
    time, gps_week = gps_time(table, tow, week, gps_week, taken["time"])
    for name, factor in (("h", factors["length"]), ("pressure", factors["pressure"])):
        if name in cols:
            cols[name] = cols[name] * factor
    notes = (*open_end(ROWS, table.complete), *notes)
    return heights_from_columns(cols, time, table, str(path), gps_week, notes)


def heights_from_columns(
    cols: Mapping[str, Array],
    time: Array,
    lines: Lines,
    source: str,
    gps_week: int | None,
    notes: tuple[Finding, ...] = (),
) -> BarometerHeights:
    """Make heights of columns: each stamp once, in order.

    Parameters
    ----------
    cols : mapping
        Columns (n,) of "pressure", Pa, or of "h", m, which is taken where there is no pressure.
    time : ndarray
        (n,) s, GPST.
    lines : Lines
        Where the rows stand, for refusals.
    source : str
        Name of the file.
    gps_week : int, optional
        The week of `time`.
    notes : tuple of Finding
        What the reader found odd.

    Returns
    -------
    BarometerHeights
        The heights.

    Raises
    ------
    InputError
        Neither column, a value that cannot be, or times out of order beyond the limits.
    """
    name = "pressure" if "pressure" in cols else "h"
    if name not in cols:
        raise InputError.at_line(
            source, None, "no column h or pressure; set columns = [...] of tow, h, pressure"
        )
    values = cols[name]
    low, high, unit = (LOWEST_PA, HIGHEST_PA, "Pa") if name == "pressure" else (*HEIGHTS_M, "m")
    if (odd := ~((values > low) & (values < high))).any():
        row = int(np.argmax(odd))
        advice = (
            "set units = { pressure = ... }" if unit == "Pa" else "set units = { length = ... }"
        )
        raise lines.error_at(
            row,
            f"{name} {values[row]:g} {unit} of a barometer; it must be between {low:g} and"
            f" {high:g} {unit}; {advice} or the columns",
        )
    rows, odd_rows = put_in_order(lines, time, lambda i, k: values[i] == values[k], ROWS)
    if rows is not None:
        time, values = time[rows], values[rows]
    height = standard_height(values) if name == "pressure" else values
    return BarometerHeights(time, height, gps_week, source, (*notes, *odd_rows))
