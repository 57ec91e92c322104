"""IMU samples as a text table: `tow gx gy gz ax ay az`, data_specs/imu_csv.md.

The unit of a triad is the caller's, else the one that the header gives, in brackets or behind the
name (`headers`), else SI; where both give one and they differ, a note says so. A file without a
column of time has the caller's rate, and its time starts at zero.
"""

from collections.abc import Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from ....base.errors import InputError, UsageError
from ....records import Finding, ImuSamples, Quantity
from ..text.columns import (
    FINE,
    TIME,
    Aliases,
    Columns,
    axis_aliases,
    clock_of,
    clock_of_dates,
    columns_of,
    fields_of,
    gps_time,
    reversed_names,
)
from ..text.direct import Bytes, Rows, Target, read_columns
from ..text.headers import Kinds, kinds_like, settled_units
from ..text.layout import Layout, sniff
from ..text.order import Lines, note, open_end, put_in_order
from ..text.stamps import spread_evenly, unrepeated
from ..text.text import Source, Table, load, loaded, parse
from ..text.units import check_units, imu_kinds, usual_unit
from .apart import joined

Array = NDArray[np.float64]
Notes = tuple[Finding, ...]

GYRO, ACCEL = ("gx", "gy", "gz"), ("ax", "ay", "az")
COLUMNS = ("tow", *GYRO, *ACCEL)
GYRO_STEMS = (
    "g",
    "gyro",
    "gyr",
    "gyroscope",
    "w",
    "omega",
    "rate",
    "angular_rate",
    "angular_velocity",
    "dtheta",
)
ACCEL_STEMS = (
    "a",
    "acc",
    "accel",
    "accelerometer",
    "f",
    "acceleration",
    "linear_acceleration",
    "dv",
    "dvel",
)
ALIASES: Aliases = {
    **TIME,
    **{f"g{c}": axis_aliases(c, *GYRO_STEMS) for c in "xyz"},
    **{f"a{c}": axis_aliases(c, *ACCEL_STEMS) for c in "xyz"},
    **FINE,
}
TRIADS = {"gyro": GYRO, "accel": ACCEL, "time": ("tow",)}
UNIT_KEYS = tuple(TRIADS)
CLOCK = (*TIME, *FINE)
KINDS: Kinds = {name: kinds_like(key) for key, names in TRIADS.items() for name in names}
MAX_RATE_HZ = 1e5


@dataclass(frozen=True)
class Scales:
    """Factors of the gyro and the accelerometer columns to SI, and the clock.

    Attributes
    ----------
    gyro, accel : float
        Factors to rad/s and m/s^2, of increments to rad and m/s.
    time : str
        Unit of time.
    rate_hz : float, optional
        The rate where there is no column of time.
    units : mapping
        Units of gyro and accel, by name; empty where the format fixes them.
    """

    gyro: float
    accel: float
    time: str = "s"
    rate_hz: float | None = None
    units: Mapping[str, str] = field(default_factory=dict)


def read_imu_csv(
    path: Source,
    columns: Columns = None,
    units: Mapping[str, str] | None = None,
    quantity: Quantity = "mean_rate",
    gps_week: int | None = None,
    rate_hz: float | None = None,
    accel_file: Source | None = None,
) -> ImuSamples:
    """Read IMU samples into SI.

    A column whose name begins with a minus (-YAccel) holds the reverse of its axis: its sign is
    reversed, and a note says so.

    Parameters
    ----------
    path : path
        The file.
    columns : sequence or mapping, optional
        Name of each column out of tow week gx gy gz ax ay az; any other name leaves a column out;
        or a table of them to the header's names or to indices, "[1]" for the first.
    units : mapping, optional
        Units of "gyro" (rad/s, deg/s, deg/h; rad, deg, arcsec for increments), "accel" (m/s^2, g,
        mg, ug; m/s, g*s for increments), each with the value of one count before it where need be,
        and "time".
    quantity : {"mean_rate", "increments", "instant_rate"}
        What a sample is.
    gps_week : int, optional
        The week, where no column holds it.
    rate_hz : float, optional
        Samples a second, where the file has no column of time; time then starts at zero.
    accel_file : path, optional
        The file of the accelerometers, where `path` has the gyros alone (`apart`); a mapping
        `columns` names those of both, a sequence those of the gyros, and gx gy gz of it are ax ay
        az of the other file.

    Returns
    -------
    ImuSamples
        The samples.

    Raises
    ------
    InputError
        What cannot be read, with file and line.
    UsageError
        A unit that does not exist, or a rate beside `accel_file`.
    """
    units = check_units(units, UNIT_KEYS)
    if accel_file is None:
        required = required_columns(rate_hz)
        return _read(path, columns, units, quantity, gps_week, rate_hz, required)
    if rate_hz is not None:
        raise UsageError(
            f"{path}: rate_hz: gyros and accelerometers in two files need stamps;"
            " leave it out, and name the column of time tow in both"
        )
    gyro, accel = (
        _read(file, _of_one(columns, triad), units, quantity, gps_week, None, ("tow", *triad))
        for file, triad in ((path, GYRO), (accel_file, ACCEL))
    )
    return joined(gyro, accel)


def _of_one(columns: Columns, triad: tuple[str, ...]) -> Columns:
    """Return the columns of the file that has one triad alone."""
    other = ACCEL if triad == GYRO else GYRO
    if isinstance(columns, Mapping):
        return {name: field for name, field in columns.items() if name not in other}
    own = dict(zip(other, triad, strict=True))
    return None if columns is None else [own.get(name, name) for name in columns]


def _read(
    path: Source,
    columns: Columns,
    units: Mapping[str, str],
    quantity: Quantity,
    gps_week: int | None,
    rate_hz: float | None,
    required: tuple[str, ...],
) -> ImuSamples:
    """Read the samples of a file that must hold some columns; zeros for a triad it does not."""

    def named(table: Table) -> dict[str, int]:
        index = columns_of(table, ALIASES, required, (required,), columns, KINDS)
        return {name: i for name, i in index.items() if name in (*required, *CLOCK)}

    def settled(index: Mapping[str, int], units: Mapping[str, str]) -> tuple[Scales, Notes]:
        fields = {key: fields_of(layout, index, names) for key, names in TRIADS.items()}
        return scales_of(str(path), layout.header_line, fields, units, quantity, rate_hz)

    direct, usual = None, False
    with loaded(path) as (buf, complete):
        layout = sniff(path, buf)
        # what is wrong in a line is said before what is wrong with the columns: `parse` does
        with suppress(InputError, UsageError):
            index = named(Table(str(path), layout, np.empty((0, 0)), np.empty(0, dtype=np.int64)))
            scales, unit_notes = settled(index, units)
            usual = complete
        if usual:
            direct = _direct(buf, layout, index, scales)
    del buf
    lines: Lines = Rows(str(path), layout)
    date_notes: Notes = ()
    if direct is None:
        table = parse(path, *load(path), layout, whole=False)
        index, lines = named(table), table
        units, date_notes = clock_of_dates(table, index, units, "IMU rows")
        scales, unit_notes = settled(index, units)
        direct = _of_table(table, index, scales)
    clock, gyro, accel = direct
    del direct
    notes = (*open_end("IMU rows", complete), *unit_notes, *date_notes)
    if backward := _backward(layout, index):
        fields = ", ".join(str((layout.header_fields or ())[index[name]]) for name in backward)
        advice = (
            f"rename {'it' if len(backward) == 1 else 'them'} in the header if the values are not"
            " reversed"
        )
        notes = (
            *notes,
            note(
                "IMU columns",
                f"{fields} taken with the sign reversed",
                "names without a sign",
                advice,
            ),
        )
    return _samples(clock, gyro, accel, lines, str(path), scales, quantity, gps_week, notes)


def _backward(layout: Layout, index: Mapping[str, int]) -> list[str]:
    """Return the columns of the sensors that hold the reverse of their axis."""
    return [name for name in reversed_names(layout, index) if name in (*GYRO, *ACCEL)]


def _factors(layout: Layout, index: Mapping[str, int], scales: Scales) -> dict[str, float]:
    """Return the factor of each column of the sensors, negative for one that is reversed."""
    backward = _backward(layout, index)
    return {
        name: -factor if name in backward else factor
        for names, factor in ((GYRO, scales.gyro), (ACCEL, scales.accel))
        for name in names
    }


def _direct(
    buf: Bytes, layout: Layout, index: Mapping[str, int], scales: Scales
) -> tuple[dict[str, Array], Array, Array] | None:
    """Return columns of the clock, and both triads, as `direct` reads them."""
    factors = _factors(layout, index, scales)
    targets, widths = {}, {"gyro": 3, "accel": 3}
    for name, i in index.items():
        if name in factors:
            sensor, names = ("gyro", GYRO) if name in GYRO else ("accel", ACCEL)
            targets[i] = Target(sensor, names.index(name), factors[name])
        else:
            targets[i], widths[name] = Target(name, 0), 1
    arrays = read_columns(buf, layout, targets, widths)
    if arrays is None:
        return None
    gyro, accel = arrays.pop("gyro"), arrays.pop("accel")
    for triad, names in ((gyro, GYRO), (accel, ACCEL)):
        triad[:, [k for k, name in enumerate(names) if name not in index]] = 0.0
    return {name: array[:, 0] for name, array in arrays.items()}, gyro, accel


def _of_table(
    table: Table, index: Mapping[str, int], scales: Scales
) -> tuple[dict[str, Array], Array, Array]:
    """Return columns of the clock, and both triads, of a table as it was parsed."""
    factors = _factors(table.layout, index, scales)
    gyro, accel = np.zeros((2, len(table.values), 3))
    for triad, names in ((gyro, GYRO), (accel, ACCEL)):
        for k, name in enumerate(names):
            if name in index:
                np.multiply(table.values[:, index[name]], factors[name], out=triad[:, k])
    clock = {name: table.values[:, i] for name, i in index.items() if name not in factors}
    return clock, gyro, accel


def scales_of(
    path: str,
    line: int | None,
    fields: Mapping[str, Sequence[str]],
    units: Mapping[str, str],
    quantity: Quantity,
    rate_hz: float | None,
) -> tuple[Scales, tuple[Finding, ...]]:
    """Settle the units of gyro, accel and time: the caller's, else those of the header, else SI.

    Parameters
    ----------
    path : str
        The file, for messages.
    line : int, optional
        The header's line.
    fields : mapping
        What the file calls the columns of each of `TRIADS`.
    units : mapping
        The caller's units.
    quantity : str
        What a sample is.
    rate_hz : float, optional
        The rate where there is no column of time.

    Returns
    -------
    Scales
        The factors.
    tuple of Finding
        A note for each of the caller's units where the fields give another one.

    Raises
    ------
    InputError, UsageError
        A unit that is none, with `path` and `line`.
    """
    kinds = dict(zip(UNIT_KEYS, (*imu_kinds(quantity), "time"), strict=True))
    taken, factors, notes = settled_units(path, line, TRIADS, kinds, fields, units, "IMU")
    names = {key: usual_unit(taken[key], kinds[key]) for key in ("gyro", "accel")}
    return Scales(factors["gyro"], factors["accel"], taken["time"], rate_hz, names), notes


def required_columns(rate_hz: float | None) -> tuple[str, ...]:
    """Return what a table of samples must hold, with or without a column of time."""
    if rate_hz is not None and not 0.0 < rate_hz <= MAX_RATE_HZ:
        raise UsageError(
            f"rate_hz = {rate_hz:g} is not between 0 and {MAX_RATE_HZ:g}; give samples a second"
        )
    return COLUMNS if rate_hz is None else (*GYRO, *ACCEL)


def imu_from_columns(
    cols: Mapping[str, Array],
    lines: Lines,
    source: str,
    scales: Scales,
    quantity: Quantity,
    gps_week: int | None,
    notes: tuple[Finding, ...] = (),
) -> ImuSamples:
    """Make samples of columns (n,) by canonical name, each stamp once, in order.

    Stamps with too few digits are spread evenly (`text.stamps`).

    `notes` come before those of the order.
    """
    gyro, accel = _triad(cols, GYRO, scales.gyro), _triad(cols, ACCEL, scales.accel)
    clock = {name: column for name, column in cols.items() if name not in (*GYRO, *ACCEL)}
    return _samples(clock, gyro, accel, lines, source, scales, quantity, gps_week, notes)


def _samples(
    clock: dict[str, Array],
    gyro: Array,
    accel: Array,
    lines: Lines,
    source: str,
    scales: Scales,
    quantity: Quantity,
    gps_week: int | None,
    notes: Notes,
) -> ImuSamples:
    """Make samples of the columns of a clock, which is emptied, and of triads (n, 3) in SI."""
    if scales.rate_hz is not None:
        if "tow" in clock:
            raise InputError(
                f"{source}: rate_hz is given, but there is a column of time; leave rate_hz out, or"
                " leave the column out of columns"
            )
        time = np.arange(len(gyro)) / scales.rate_hz
    else:
        time, gps_week = gps_time(lines, clock_of(clock), clock.get("week"), gps_week, scales.time)
    clock.clear()  # so that one copy of the stamps lives
    time, repeat_notes = unrepeated(time)
    rows, order_notes = put_in_order(
        lines,
        time,
        lambda i, k: bool((gyro[i] == gyro[k]).all() and (accel[i] == accel[k]).all()),
        "IMU rows",
    )
    if rows is not None:
        time, gyro, accel = time[rows], gyro[rows], accel[rows]
    time, stamp_notes = spread_evenly(time)
    notes = (*notes, *repeat_notes, *order_notes, *stamp_notes)
    return ImuSamples(time, gyro, accel, quantity, gps_week, source, notes, scales.units)


def _triad(cols: Mapping[str, Array], names: tuple[str, ...], factor: float) -> Array:
    out = np.empty((cols[names[0]].size, 3))
    for k, name in enumerate(names):
        np.multiply(cols[name], factor, out=out[:, k])
    return out
