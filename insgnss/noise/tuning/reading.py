"""From a file of samples and the verb's options to samples in SI.

It settles columns, units and rate, with messages in the verb's own words. Where nothing in a file
says its units, they must be given: noise numbers are worth nothing without. Columns go by the names
that the readers know; a clock that is called otherwise (timestamp_us, GPS time of week) is found
here. A rate that no IMU has means that time is in another unit: milliseconds taken for seconds make
0.2 Hz of 200 Hz.
"""

from collections.abc import Mapping, Sequence
from contextlib import suppress
from dataclasses import replace
from pathlib import Path
from typing import Any

from ...base.errors import InputError, UsageError
from ...base.wording import spoken_as
from ...flight.inspection.discovery import sources_of
from ...flight.inspection.sources import InputSource
from ...io.formats import TableInfo, describe, read_imu, sniff_imu
from ...io.formats.detect import LOADERS
from ...io.formats.imu.imu_csv import ACCEL, GYRO
from ...io.formats.read_options import ON_COMMAND_LINE
from ...io.formats.text.headers import TIME_FACTORS, factor_of, kinds_like, unit_in
from ...navigation.prepare.gaps import nominal_interval
from ...records import ImuSamples, Question
from .options import TuneOptions
from .some_channels import columns_by_names, fields_of_some, no_unit, read_some

OPTION_NAMES = ON_COMMAND_LINE | {
    "units time": "--time-unit",
    "rate_hz": "--rate",
    "variable": "--variable",
    "member": "--variable",
}
"""How the verb calls the options of readers."""
PLAIN_COLUMNS = ("tow", *GYRO, *ACCEL)
FILE_HEAD_BYTES = 1 << 13  # of a file, which hold its header and its first rows (chosen)
SAY_THEIR_UNITS = ("aimu", "psins", "ardupilot", "ulog", "rosbag")
LEAST_HZ, MOST_HZ = 5.0, 50e3  # IMUs give 20 to 20000 samples a second
USUAL_RANGE_HZ = (20.0, 20e3)  # of an IMU: a time unit that leads into it is proposed


def read_samples(path: Path, options: TuneOptions) -> tuple[ImuSamples, tuple[bool, ...]]:
    """Read the samples of a file in SI, and which of the six channels are there.

    Parameters
    ----------
    path : Path
        The file.
    options : TuneOptions
        Columns, units and rate where the file does not say them.

    Returns
    -------
    imu : ImuSamples
        The samples.
    channels : tuple of bool
        Gyroscopes x, y, z, accelerometers x, y, z; of one that is not there the samples are
        constants.

    Raises
    ------
    InputError
        For a wrong file and a rate that no IMU has.
    UsageError
        Where units or columns are missing.
    """
    channels: tuple[bool, ...] = (True,) * 6
    with spoken_as(OPTION_NAMES):
        file_format = sniff_imu(path)
        fields = fields_of_some(path, file_format, options)
        if fields is None:
            imu = _read_with_units(path, options)
        else:
            imu, channels = read_some(path, file_format, fields, options)
    _refuse_rate(path, imu, options)
    return imu, channels


def _read_with_units(path: Path, options: TuneOptions) -> ImuSamples:
    """Read the samples; where the header gives no time that an IMU has, `inspect` finds it.

    Column and unit of time are then those that `insgnss inspect` proposes.
    """
    arguments = _read_arguments(path, options)
    sources: list[InputSource] = []
    try:
        imu = read_imu(path, **arguments)
        is_given = options.time_unit or "sampling" in options.accept
        if is_given or _is_rate(1.0 / nominal_interval(imu.time)):
            return imu
    except InputError:
        if arguments["columns"] is not None or options.time_unit or options.rate_hz is not None:
            raise
    with suppress(InputError):  # of the reader, below
        sources = [source for source in sources_of(path) if source.role == "imu"]
    keys = sources[0].keys if sources else {}
    if (
        arguments["columns"] is not None
        or "rate_hz" in keys
        or not keys.keys() & {"columns", "units"}
    ):
        return read_imu(path, **arguments)
    unit = keys.get("units", {}).get("time", "s")
    units = (arguments["units"] or {}) | {"time": unit}
    imu = read_imu(path, **arguments | {"columns": keys.get("columns"), "units": units})
    reason = sources[0].why.get("units") or sources[0].why["columns"]
    if unit == "s" or "the header gives" in reason:
        return imu
    unit_note = Question("IMU time", "a column of seconds").note(
        f"{unit}: {reason}", "--time-unit and --columns state another unit or column"
    )
    return replace(imu, notes=(*imu.notes, unit_note))


def _read_arguments(path: Path, options: TuneOptions) -> dict[str, Any]:
    """Return the arguments of `read_imu`."""
    file_format = sniff_imu(path)
    columns: Any = options.columns
    nameless = columns is None and file_format in LOADERS
    if nameless or (
        file_format not in SAY_THEIR_UNITS and not (options.gyro_unit and options.accel_unit)
    ):
        tables = describe(path)
        if nameless:
            columns = _plain_columns(tables, options) or _named_columns(tables, options)
        _require_units(path, tables, options)
    units = {"gyro": options.gyro_unit, "accel": options.accel_unit, "time": options.time_unit}
    return {
        "columns": columns,
        "units": {key: unit for key, unit in units.items() if unit} or None,
        "quantity": options.quantity,
        "rate_hz": options.rate_hz,
        "variable": options.variable,
    }


def _plain_columns(tables: list[TableInfo], options: TuneOptions) -> tuple[str, ...] | None:
    """Return the columns of a matrix of samples, with or without time; None for anything else."""
    tables = [table for table in tables if options.variable in (None, table.name)]
    simple = (
        len(tables) == 1
        and (tables[0].name == "" or options.variable is not None)
        and all(name.startswith("[") for name in tables[0].columns)
    )
    width = len(tables[0].columns) if simple else 0
    if width == 6 and options.rate_hz is None:
        raise UsageError(
            "six columns and no time: give the sensor's rate in samples a second, --rate HZ"
        )
    return {6: PLAIN_COLUMNS[1:], 7: PLAIN_COLUMNS}.get(width)


def _named_columns(tables: Sequence[TableInfo], options: TuneOptions) -> Mapping[str, str] | None:
    """Return the field of each column by its canonical name; None where they are not all named."""
    tables = [table for table in tables if options.variable in (None, table.name)]
    if len(tables) != 1:
        return None
    columns = columns_by_names(tables[0])
    if options.rate_hz is not None:
        columns.pop("tow", None)
    needed = PLAIN_COLUMNS if options.rate_hz is None else PLAIN_COLUMNS[1:]
    return columns if all(name in columns for name in needed) else None


def _require_units(path: Path, tables: list[TableInfo], options: TuneOptions) -> None:
    """Raise UsageError where neither the file nor an option says a unit."""
    fields = [field for table in tables for field in table.columns]
    increments = " increment" if options.quantity == "increments" else ""
    for sensor, unit, example in (
        ("gyro", options.gyro_unit, "deg/s"),
        ("accel", options.accel_unit, "m/s^2"),
    ):
        units = filter(None, (unit_in(field, kinds_like(sensor)) for field in fields))
        if unit is None and not any(factor_of(text, (f"{sensor}{increments}",)) for text in units):
            raise no_unit(
                path, sensor, f"of the {sensor} columns", f"{example} or the size of one count"
            )


def _is_rate(hz: float) -> bool:
    return LEAST_HZ <= hz <= MOST_HZ


def _refuse_rate(path: Path, imu: ImuSamples, options: TuneOptions) -> None:
    """Raise InputError for a rate that no IMU has, with the unit of time that would explain it."""
    rate = 1.0 / nominal_interval(imu.time)
    if _is_rate(rate) or "sampling" in options.accept:
        return
    hours = float(imu.time[-1] - imu.time[0]) / 3600.0
    message = (
        f"{path}: {rate:.3g} Hz, {imu.time.size} samples in {hours:.3g} h; an IMU has"
        f" {USUAL_RANGE_HZ[0]:g} to {USUAL_RANGE_HZ[1]:g} Hz"
    )
    if options.rate_hz is not None:
        raise InputError(f"{message}; give --rate in samples a second")
    likely = [
        unit
        for unit, factor in TIME_FACTORS.items()
        if unit != "s" and USUAL_RANGE_HZ[0] <= rate / factor <= USUAL_RANGE_HZ[1]
    ]
    if likely and options.time_unit is None:
        advice = (
            f"if time is in {likely[0]}, give --time-unit {likely[0]}"
            f" ({rate / TIME_FACTORS[likely[0]]:g} Hz)"
        )
    else:
        advice = "check the column of time and its unit, --time-unit"
    raise InputError(f"{message}; {advice}; --accept sampling takes it all the same")
