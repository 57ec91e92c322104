"""IMU samples as a text table: `tow gx gy gz ax ay az`, data_specs/imu_csv.md.

The unit of a triad is the caller's, else the one that the header gives, in brackets or behind the
name (`headers`), else SI; where both give one and they differ, a note says so. A file without a
column of time has the caller's rate, and its time starts at zero; a packet counter beside it shows
where samples are lost. A column of temperatures that cannot be read is left out with a note: the
samples are whole without it.
"""

from collections.abc import Callable, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, field, replace

import numpy as np

from ....base.errors import InputError, UsageError
from ....base.wording import spell
from ....records import Array, Finding, ImuSamples, Quantity
from ..names import FINE, IMU, TIME
from ..read_options import STATED_NOTHING, ReadOptions
from ..text.clock import clock_of, examined_time, line_of, on_one_clock
from ..text.columns import Columns, NamedTable, TableSpec
from ..text.dates import calendar_columns
from ..text.direct import Bytes, DirectRows, read_columns
from ..text.headers import Settled
from ..text.layout import sniff
from ..text.order import Lines, note, put_in_order
from ..text.stamps import spread_evenly, without_jitter
from ..text.text import NumberTable, Source, load, loaded, parse
from ..text.units import imu_kinds, usual_unit
from .apart import join_sensors

Notes = tuple[Finding, ...]

GYRO, ACCEL = ("gx", "gy", "gz"), ("ax", "ay", "az")
IMU_COLUMNS = ("tow", *GYRO, *ACCEL)
UNITS_OF_COLUMNS = {"gyro": " ".join(GYRO), "accel": " ".join(ACCEL), "time": "tow"}
SPEC = TableSpec(IMU, units=UNITS_OF_COLUMNS, record="IMU")
CLOCK_COLUMNS = (*TIME, *FINE)
TEMPERATURE = "temperature"  # the column, of the sensor
USUAL_QUANTITY: Quantity = "mean_rate"
MAX_RATE_HZ = 1e5  # samples a second: above every IMU's rate, below a rate in other units (chosen)


@dataclass(frozen=True)
class Scales:
    """Factors of the gyro and the accelerometer columns to SI, and the clock.

    Attributes
    ----------
    gyro, accel : float
        Factors to rad/s and m/s^2, of increments to rad and m/s.
    time : str
        Unit of time.
    units : mapping
        Units of gyro and accel, by name; empty where the format fixes them.
    """

    gyro: float
    accel: float
    time: str = "s"
    units: Mapping[str, str] = field(default_factory=dict)


def read_imu_csv(path: Source, options: ReadOptions = STATED_NOTHING) -> ImuSamples:
    """Read IMU samples into SI.

    A column whose name begins with a minus (-YAccel) holds the reverse of its axis: its sign is
    reversed, and a note says so.

    Parameters
    ----------
    path : path
        The file.
    options : ReadOptions
        `columns` of tow week gx gy gz ax ay az; `units` of "gyro" (rad/s, deg/s, mdeg/s, deg/h;
        rad, deg, arcsec for increments), "accel" (m/s^2, g, mg, ug; m/s, g*s for increments) and
        "time".

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
    SPEC.checked_units(options.units)
    if options.accel_file is None:
        return _read(path, options, required_columns(options.rate_hz))
    if options.rate_hz is not None:
        raise UsageError(
            f"{path}: {spell('rate_hz')}: gyros and accelerometers in two files need time"
            f" stamps; leave {spell('rate_hz')} out, and name the time column of both files tow"
        )
    gyro, accel = (
        _read(
            file,
            replace(options, columns=_columns_of_one_triad(options.columns, triad)),
            ("tow", *triad),
        )
        for file, triad in ((path, GYRO), (options.accel_file, ACCEL))
    )
    return join_sensors(gyro, accel)


def _columns_of_one_triad(columns: Columns, triad: tuple[str, ...]) -> Columns:
    """Return the columns of the file that has one triad alone."""
    second_triad = ACCEL if triad == GYRO else GYRO
    if isinstance(columns, Mapping):
        return {name: field for name, field in columns.items() if name not in second_triad}
    role = dict(zip(second_triad, triad, strict=True))
    return None if columns is None else [role.get(name, name) for name in columns]


def _read(path: Source, options: ReadOptions, required: tuple[str, ...]) -> ImuSamples:
    """Read the samples of a file that must hold some columns; zeros for a triad it does not."""
    spec, units, rate_hz = with_required(required), options.units or {}, options.rate_hz
    kinds = kinds_of(options.quantity)

    def with_names(table: NumberTable | DirectRows) -> NamedTable:
        index = spec.index(table.path, table.layout, options.columns)
        clock = CLOCK_COLUMNS if rate_hz is None else (*CLOCK_COLUMNS, "counter")
        names = (*required, *clock, TEMPERATURE)
        return NamedTable(spec, table, {name: i for name, i in index.items() if name in names})

    direct, usual = None, False
    with loaded(path) as (buf, complete):
        layout = sniff(path, buf)
        # what is wrong in a line is said before what is wrong with the columns: `parse` does
        with suppress(InputError, UsageError):
            table = with_names(DirectRows(str(path), layout, complete))
            settled = table.settled(units, kinds)
            usual = (
                complete
                and table.index.get("tow") not in calendar_columns(layout.header_fields).values()
            )
        if usual:
            direct = _direct(buf, table, scales_of(settled, kinds))
    del buf
    left_out: Notes = ()
    if direct is None:
        table = with_names(parse(path, *load(path), layout, whole=False))
        table, left_out = _without_bad_temperature(table)
        table = table.checked()
        settled = table.settled(units, kinds)
        factors = _factors(scales_of(settled, kinds), _backward(table))
        direct = _triads(table.numbers(), factors)
    scales = scales_of(settled, kinds)
    clock, gyro, accel = direct
    del direct
    notes = (*settled.notes, *left_out)
    if backward := _backward(table):
        them = "it" if len(backward) == 1 else "them"
        advice = f"rename {them} in the header if the values are not reversed"
        finding = f"{', '.join(table.fields(' '.join(backward)))} taken with the sign reversed"
        notes = (*notes, note("IMU columns", finding, "names without a sign", advice))
    return _samples(clock, gyro, accel, table, scales, options, notes)


def _without_bad_temperature(table: NamedTable) -> tuple[NamedTable, Notes]:
    """Return a table without a column of temperatures that holds text, and the note on it."""
    assert isinstance(table.table, NumberTable)
    problem = table.table.bad.get(table.index.get(TEMPERATURE, -1))
    if problem is None:
        return table, ()
    index = {name: k for name, k in table.index.items() if name != TEMPERATURE}
    advice = "fill the gaps, if its biases are to be tried against the temperature"
    left_out = note("IMU temperature", f"left out: {problem}", "a number in every row", advice)
    return replace(table, index=index), (left_out,)


def with_required(required: Sequence[str]) -> TableSpec:
    """Return the specification of a table that must hold these columns, and may hold them alone."""
    return replace(SPEC, required=" ".join(required), layouts=(" ".join(required),))


def _backward(table: NamedTable) -> list[str]:
    """Return the columns of the sensors that hold the reverse of their axis."""
    return [name for name in table.reversed_names() if name in (*GYRO, *ACCEL)]


def _factors(scales: Scales, backward: Sequence[str] = ()) -> dict[str, float]:
    """Return the factor of each column of the sensors, negative for one that is reversed."""
    factors = dict.fromkeys(GYRO, scales.gyro) | dict.fromkeys(ACCEL, scales.accel)
    return factors | {name: -factors[name] for name in backward}


def _direct(
    buf: Bytes, table: NamedTable, scales: Scales
) -> tuple[dict[str, Array], Array, Array] | None:
    """Return columns of the clock, and both triads, as `direct` reads them."""
    factors = _factors(scales, _backward(table))
    requested_columns = {
        sensor: [(table.index.get(name), factors[name]) for name in names]
        for sensor, names in (("gyro", GYRO), ("accel", ACCEL))
    }
    requested_columns |= {
        name: [(k, 1.0)] for name, k in table.index.items() if name not in factors
    }
    arrays = read_columns(buf, table.table.layout, requested_columns)
    if arrays is None:
        return None
    gyro, accel = arrays.pop("gyro"), arrays.pop("accel")
    return {name: array[:, 0] for name, array in arrays.items()}, gyro, accel


def _triads(
    cols: Mapping[str, Array], factors: Mapping[str, float]
) -> tuple[dict[str, Array], Array, Array]:
    """Return columns of the clock, and both triads in SI; zeros for a column that is not there."""
    gyro, accel = np.zeros((2, next(iter(cols.values())).size, 3))
    for triad, names in ((gyro, GYRO), (accel, ACCEL)):
        for k, name in enumerate(names):
            if name in cols:
                np.multiply(cols[name], factors[name], out=triad[:, k])
    return {name: column for name, column in cols.items() if name not in factors}, gyro, accel


def kinds_of(quantity: Quantity | None) -> dict[str, str]:
    """Return the kinds of the units of gyro and accel, of samples that are such a quantity."""
    return dict(zip(("gyro", "accel"), imu_kinds(quantity or USUAL_QUANTITY), strict=True))


def scales_of(settled: Settled, kinds: Mapping[str, str]) -> Scales:
    """Return the scales of settled units.

    Parameters
    ----------
    settled : Settled
        Units of gyro, accel and time: the caller's, else those of the header, else SI.
    kinds : mapping
        Kinds of the units of gyro and accel.
    """
    units, factors, _ = settled
    names = {key: usual_unit(units[key], kind) for key, kind in kinds.items()}
    return Scales(factors["gyro"], factors["accel"], units["time"], names)


def required_columns(rate_hz: float | None) -> tuple[str, ...]:
    """Return what a table of samples must hold, with or without a column of time."""
    if rate_hz is not None and not 0.0 < rate_hz <= MAX_RATE_HZ:
        raise UsageError(
            f"{spell('rate_hz')} = {rate_hz:g} is not between 0 and {MAX_RATE_HZ:g}; give"
            " samples a second"
        )
    return IMU_COLUMNS if rate_hz is None else (*GYRO, *ACCEL)


def imu_from_columns(
    cols: Mapping[str, Array],
    lines: Lines,
    scales: Scales,
    options: ReadOptions,
    notes: tuple[Finding, ...] = (),
) -> ImuSamples:
    """Make samples of columns (n,) by canonical name, each stamp once, in order.

    Stamps with too few digits are spread evenly (`text.stamps`).

    `notes` come before those of the order.
    """
    return _samples(*_triads(cols, _factors(scales)), lines, scales, options, notes)


def _samples(
    clock: dict[str, Array],
    gyro: Array,
    accel: Array,
    lines: Lines,
    scales: Scales,
    options: ReadOptions,
    notes: Notes,
) -> ImuSamples:
    """Make samples of the columns of a clock, which is emptied, and of triads (n, 3) in SI."""

    def same(i: int, k: int) -> bool:
        return bool((gyro[i] == gyro[k]).all() and (accel[i] == accel[k]).all())

    gps_week, quantity = options.gps_week, options.quantity or USUAL_QUANTITY
    temperature = clock.pop(TEMPERATURE, None)
    if options.rate_hz is not None:
        if "tow" in clock:
            raise InputError(
                f"{lines.path}: {spell('rate_hz')} is given, but the file has a time column; leave"
                f" it out, or leave the time column out of {spell('columns')}"
            )
        time, counter_notes = _by_rate(clock, lines, len(gyro), options.rate_hz, same)
        notes = (*notes, *counter_notes)
    else:
        week = clock.get("week")
        time, gps_week, clock_notes = examined_time(
            lines, clock_of(clock), week, "IMU rows", gps_week, scales.time, same
        )
        notes = (*notes, *clock_notes)
    clock.clear()  # so that one copy of the stamps lives
    time, jitter_notes = without_jitter(time)
    rows, order_notes = put_in_order(lines, time, same, "IMU rows")
    if rows is not None:
        time, gyro, accel = time[rows], gyro[rows], accel[rows]
        temperature = None if temperature is None else temperature[rows]
    time, stamp_notes = spread_evenly(time)
    notes = (*notes, *jitter_notes, *order_notes, *stamp_notes)
    of_file = quantity, gps_week, lines.path, notes, scales.units
    return ImuSamples(time, gyro, accel, *of_file, temperature)


def _by_rate(
    clock: Mapping[str, Array],
    lines: Lines,
    rows: int,
    rate_hz: float,
    same: Callable[[int, int], bool],
) -> tuple[Array, Notes]:
    """Return stamps (n,) from zero, s, of samples at a rate, by their packet counter if there is.

    The counter shows samples that are lost, and begins anew after 2^16 or 2^32 of them.
    """
    if "counter" not in clock or rows < 2:
        return np.arange(rows) / rate_hz, ()
    sample_unit = f"{1.0 / rate_hz!r} s"
    packets, _, _, notes = on_one_clock(
        lines, clock["counter"], None, sample_unit, "IMU rows", same
    )
    packets = packets - packets[0]
    count = packets / max(float(np.median(np.diff(packets))), 1.0)
    if missing := round(float(count.max())) + 1 - rows:
        row = int(np.argmax(np.diff(count) > 1.5)) + 1
        first_gap = line_of(lines, row)
        finding = (
            f"{missing} samples are lost by the count of packets, the first before {first_gap}"
        )
        notes = (*notes, note("IMU rows", finding, "every packet", "check the logger's buffer"))
    return count / rate_hz, notes
