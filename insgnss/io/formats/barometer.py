"""Heights of a barometer: `tow h` or `tow pressure`, data_specs/barometer.md.

A pressure becomes the height that belongs to it in the standard atmosphere
(`geodesy.atmosphere`); where both are there the pressure is taken, which no autopilot has set to
zero in between.
"""

from collections.abc import Mapping

from ...base.errors import InputError
from ...geodesy.atmosphere import LOWEST_PA, standard_height
from ...records import Array, BarometerHeights, Finding
from .names import BAROMETER
from .read_options import STATED_NOTHING, ReadOptions
from .text.columns import TableSpec
from .text.order import Lines, put_in_order, refuse_rows
from .text.text import Source

BAROMETER_ROWS = "barometer rows"  # name of the notes on rows left out or put in order
HIGHEST_PA = 120e3  # pressure (Pa): 1400 m below sea level, where nobody flies
BAROMETER_LIMITS = {  # of each column: lowest, highest, their unit and its key
    "pressure": (LOWEST_PA, HIGHEST_PA, "Pa", "pressure"),
    "h": (-2000.0, 11000.0, "m", "length"),  # above whatever level it counts from
}
SPEC = TableSpec(
    BAROMETER,
    required="tow",
    layouts=("tow h",),
    units={"length": "h", "pressure": "pressure", "time": "tow"},
    record="barometer",
)


def read_barometer_text(path: Source, options: ReadOptions = STATED_NOTHING) -> BarometerHeights:
    """Read the heights of a barometer.

    Parameters
    ----------
    path : path
        The file.
    options : ReadOptions
        `columns` of tow, week, h, pressure; `units` of "time", "length" and "pressure", else those
        that the header gives, else s, m, Pa.

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
    units = SPEC.checked_units(options.units)
    table = SPEC.read(path, options.columns)
    settled = table.settled(units)
    factors = {"h": settled.factors["length"], "pressure": settled.factors["pressure"]}
    cols = {name: table.floats(name) * factors[name] for name in factors if name in table}
    time, gps_week, notes = table.examined_time(
        BAROMETER_ROWS,
        options.gps_week,
        settled.units["time"],
        lambda i, k: all(column[i] == column[k] for column in cols.values()),
    )
    return heights_from_columns(cols, time, table, gps_week, (*settled.notes, *notes))


def heights_from_columns(
    cols: Mapping[str, Array],
    time: Array,
    lines: Lines,
    gps_week: int | None,
    notes: tuple[Finding, ...],
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
        problem = "no column h or pressure; set columns = [...] of tow, h, pressure"
        raise InputError.in_file(lines.path, problem)
    values = cols[name]
    low, high, unit, key = BAROMETER_LIMITS[name]
    message = (
        f"{name} {{:g}} {unit} of a barometer; it must be between {low:g} and {high:g} {unit}; set"
        f" units = {{{{ {key} = ... }}}} or the columns"
    )
    refuse_rows(lines, ~((values > low) & (values < high)), message, values)
    rows, odd_rows = put_in_order(lines, time, lambda i, k: values[i] == values[k], BAROMETER_ROWS)
    if rows is not None:
        time, values = time[rows], values[rows]
    height = standard_height(values) if name == "pressure" else values
    return BarometerHeights(time, height, gps_week, lines.path, (*notes, *odd_rows))
