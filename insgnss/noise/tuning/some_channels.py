"""Recordings that hold some of the six channels: only gyroscopes, one axis, a column a file.

Channels that are not there become constants, the vertical at rest: they keep the shape of the
record, and nothing is checked of them or fitted to them.
"""

from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path

import numpy as np

from ...base.errors import UsageError
from ...base.units import STANDARD_GRAVITY
from ...io.formats import TableInfo, describe
from ...io.formats.arrays.content import take_columns
from ...io.formats.arrays.mapped import imu_of_content
from ...io.formats.detect import LOADERS, load_content
from ...io.formats.imu.imu_csv import ACCEL, GYRO, SPEC, with_required
from ...io.formats.names import TIME
from ...io.formats.read_options import ReadOptions
from ...io.formats.text.headers import kinds_like, names_of, unit_in
from ...records import ImuSamples
from .options import TuneOptions

CHANNEL_COLUMNS = (*GYRO, *ACCEL)
PER_AXIS = tuple(f"{sensor}_{axis}" for sensor in ("gyro", "accel") for axis in "xyz")
# rad/s and m/s^2 of channels that a file has not: at rest with z down
STAND_IN = (0.0, 0.0, 0.0, 0.0, 0.0, -STANDARD_GRAVITY)
TABLE_LOADERS = (*LOADERS, "imu_csv")


def chosen_channels(text: str | None) -> tuple[bool, ...]:
    """Return which of the six channels a list such as "gyro" or "gyro_z,accel" names.

    Raises
    ------
    UsageError
        For a name that is none.
    """
    if text is None:
        return (True,) * 6
    channel_names = [word.strip().lower().replace(".", "_") for word in text.split(",")]
    for word in channel_names:
        if word not in ("gyro", "accel", *PER_AXIS):
            choices = f"gyro, accel, {', '.join(PER_AXIS)}"
            raise UsageError(f"--only {text!r}: {word!r} is none of {choices}")
    return tuple(
        name in channel_names or name.partition("_")[0] in channel_names for name in PER_AXIS
    )


def fields_of_some(path: Path, form: str, options: TuneOptions) -> dict[str, str] | None:
    """Return the field of each quantity by its canonical name where a file lacks channels.

    Parameters
    ----------
    path : Path
        The file.
    form : str
        Its format.
    options : TuneOptions
        Columns, variable and rate.

    Returns
    -------
    dict or None
        None where all six are there, none is, or the time is not known.
    """
    if form not in TABLE_LOADERS:
        return None
    if isinstance(options.columns, Mapping):
        named = dict(options.columns)
    else:
        tables = [table for table in describe(path) if options.variable in (None, table.name)]
        if len(tables) != 1:
            return None
        named = _names_of_columns(tables[0], options.columns)
    if options.rate_hz is not None:
        named.pop("tow", None)
    named_channels = [name for name in CHANNEL_COLUMNS if name in named]
    timed = "tow" in named or options.rate_hz is not None
    return named if timed and 0 < len(named_channels) < 6 else None


def _names_of_columns(table: TableInfo, columns: tuple[str, ...] | None) -> dict[str, str]:
    """Return the field of each quantity, by the columns that an option names or by their names."""
    if columns is not None:
        pairs = zip(columns, table.columns, strict=False)
        unique = all(columns.count(name) == 1 for name in columns if name != "-")
        if not unique or len(columns) != len(table.columns):
            return {}
        return {name: field for name, field in pairs if name != "-"}
    return columns_by_names(table)


def columns_by_names(table: TableInfo) -> dict[str, str]:
    """Return the field of the time and of each channel by its canonical name, as far as named."""
    clocks = {name.strip("~"): "tow" for name in TIME["tow"].split()}
    out: dict[str, str] = {}
    names = names_of(table.columns, SPEC.aliases | clocks, SPEC.kinds)
    for column, name in zip(table.columns, names, strict=True):
        if name in ("tow", *CHANNEL_COLUMNS):
            out.setdefault(name, column)
    return out


def read_some(
    path: Path, form: str, fields: Mapping[str, str], options: TuneOptions
) -> tuple[ImuSamples, tuple[bool, ...]]:
    """Read a recording of some channels.

    Parameters
    ----------
    path : Path
        The file.
    form : str
        Its format.
    fields : mapping
        The field of each quantity, of `fields_of_some`.
    options : TuneOptions
        Units, where the fields do not say them.

    Returns
    -------
    imu : ImuSamples
        The samples, SI, with constants where a channel is not there.
    channels : tuple of bool
        Which of the six are there.

    Raises
    ------
    UsageError
        Nothing says a unit.
    InputError
        A column is not there, or is no column of numbers.
    """
    is_present = tuple(name in fields for name in CHANNEL_COLUMNS)
    if form in LOADERS:
        columns = take_columns(path, load_content(form, path), dict(fields), options.variable)
    else:
        columns = with_required(tuple(fields)).read(path, fields).numbers()
    n = next(iter(columns.values())).size
    content = {name: columns.get(name, np.ones(n)) for name in CHANNEL_COLUMNS}
    content |= {name: columns[name] for name in ("tow",) if name in columns}
    read_options = ReadOptions(
        columns={name: name for name in content},
        units=_units(path, fields, options),
        quantity=options.quantity,
        rate_hz=options.rate_hz,
    )
    imu = imu_of_content(path, content, read_options)
    triads = np.hstack([imu.gyro, imu.accel])
    for k, present in enumerate(is_present):
        if not present:
            triads[:, k] = STAND_IN[k]
    return replace(imu, gyro=triads[:, :3], accel=triads[:, 3:]), is_present


def no_unit(path: Path, sensor: str, of: str, example: str) -> UsageError:
    """Return the refusal of a file that does not say the unit of its numbers."""
    advice = f"give --{sensor}-unit, such as {example}"
    return UsageError(f"{path}: neither the file nor an option states the unit {of}; {advice}")


def _units(path: Path, fields: Mapping[str, str], options: TuneOptions) -> dict[str, str]:
    """Return the units by sensor; of one that is not there any, since its values are not taken."""
    units = {}
    for sensor, names, unit_option, example in (
        ("gyro", GYRO, options.gyro_unit, "rad/s"),
        ("accel", ACCEL, options.accel_unit, "m/s^2"),
    ):
        cols = [fields[name] for name in names if name in fields]
        header = next(filter(None, (unit_in(field, kinds_like(sensor)) for field in cols)), None)
        if cols and not (unit_option or header):
            raise no_unit(path, sensor, f"of the {sensor} columns", example)
        units[sensor] = str(unit_option or header or example)
    time = options.time_unit or (unit_in(fields["tow"], ("time",)) if "tow" in fields else None)
    return units | ({"time": time} if time else {})
