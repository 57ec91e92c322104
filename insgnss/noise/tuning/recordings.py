"""Static recordings to wavelet variances.

They are read, identified by their digest, checked, and condensed to what the fit needs. A recording
is let go once its wavelet variances and block means are taken, so that memory holds one at a time.

Reading a file settles columns, units and rate by the verb's options, with messages in the verb's
own words. Where nothing in a file says its units, they must be given: noise numbers are worth
nothing without. Columns go by the names that the readers know; a clock that is called otherwise
(timestamp_us, GPS time of week) is found here. A rate that no IMU has means that time is in another
unit: milliseconds taken for seconds make 0.2 Hz of 200 Hz.
"""

import re
from collections.abc import Callable, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from pathlib import Path
from shlex import quote
from typing import Any

import numpy as np

from ...base.errors import DataError, InputError, UsageError
from ...base.inputs import first_bytes, read_bytes, sha256
from ...base.wording import spoken_as
from ...flight.inspection.discovery import sources_of
from ...flight.inspection.sources import InputSource
from ...io.formats import TableInfo, describe, read_imu, sniff_imu
from ...io.formats.detect import LOADERS
from ...io.formats.imu.imu_csv import ACCEL, GYRO
from ...io.formats.imu.variances import read_variances
from ...io.formats.logs.rosbag import bag_file
from ...io.formats.read_options import ON_COMMAND_LINE
from ...io.formats.text.headers import TIME_FACTORS, factor_of, kinds_like, unit_in
from ...navigation.noise_model.model import RecordingSource
from ...navigation.prepare.gaps import nominal_interval
from ...navigation.prepare.static_recording import Disturbance, StaticSpan, static_span
from ...records import Array, Finding, ImuSamples, Question, WaveletVariance
from ..moments.wavelet import wavelet_variances
from .options import TuneOptions
from .some_channels import chosen_channels, columns_by_names, fields_of_some, no_unit, read_some

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


Progress = Callable[[str], None]

SENSORS, SENSOR_AXES = ("gyro", "accel"), ("x", "y", "z")
TREND_BLOCKS = 128  # equal parts (chosen): the shortest warm-up, 1/100 of a recording, shows
POOLING = "pooling"  # name of the check that recordings are alike


@dataclass(frozen=True, eq=False)
class StaticRecording:
    """What is kept of one recording.

    Parameters
    ----------
    source : RecordingSource
        File, digest, samples and rate.
    curves : mapping of (str, int) to WaveletVariance
        Wavelet variance (X^2) by sensor and axis, 0 to 2.
    blocks : mapping of str to ndarray (TREND_BLOCKS, 3), or None
        Means of equal parts in time by sensor; None where only variances are known.
    begin_s, length_s : float
        Begin and length of the part that was used, s.
    checks : tuple of Finding
        Checks of the recording.
    disturbances : tuple of Disturbance
        Disturbances in it.
    """

    source: RecordingSource
    curves: Mapping[tuple[str, int], WaveletVariance]
    blocks: Mapping[str, Array] | None
    begin_s: float
    length_s: float
    checks: tuple[Finding, ...] = ()
    disturbances: tuple[Disturbance, ...] = ()

    @property
    def name(self) -> str:
        """The name of its file."""
        return self.source.file


def read_static(path: Path, options: TuneOptions, progress: Progress) -> StaticRecording:
    """Read, check and condense one recording.

    Parameters
    ----------
    path : Path
        The file.
    options : TuneOptions
        How to read it; `accept` overrules a check.
    progress : callable
        Takes a line on each step.

    Returns
    -------
    StaticRecording
        What the fit needs of it.

    Raises
    ------
    InputError
        For a wrong file.
    UsageError
        Where units or columns are missing.
    DataError
        For a recording that does not show the noise of a stationary sensor.
    """
    path = bag_file(path)
    progress(f"reading {path.name}")
    with spoken_as(OPTION_NAMES):
        if holds_variances(path):
            return _published_variances(path, options)
    imu, channels = read_samples(path, options)
    progress(f"checking {path.name}")
    span = static_span(imu, options.skip_s, options.keep_s, options.bridge_s, channels)
    _refuse_unfit(path, span, options.accept)
    progress(f"wavelet variances of {path.name}")
    triads = {"gyro": span.gyro, "accel": span.accel}
    requested = chosen_channels(options.only)
    tuned = tuple(has and chosen for has, chosen in zip(channels, requested, strict=True))
    if not any(tuned):
        raise UsageError(
            f"{path}: --only {options.only!r} names none of its channels; name some or leave it out"
        )
    curves, method_notes = _variances(triads, span, options.robust, tuned)
    blocks = {sensor: _block_means(values) for sensor, values in triads.items()}
    source = RecordingSource(path.name, sha256(path), len(span.gyro), round(span.rate_hz, 6))
    return StaticRecording(
        source,
        curves,
        blocks,
        span.begin_s,
        span.length_s,
        (*span.checks, *method_notes),
        span.disturbances,
    )


def _variances(
    triads: Mapping[str, Array], span: StaticSpan, robust: bool | None, tuned: tuple[bool, ...]
) -> tuple[dict[tuple[str, int], WaveletVariance], list[Finding]]:
    """Return the curves of the channels `tuned` (6,), and findings on robust variances.

    robust : None: where the recording holds disturbances, and its rounding allows it.
    """

    def curves_of(robustly: bool) -> dict[tuple[str, int], WaveletVariance]:
        out: dict[tuple[str, int], WaveletVariance] = {}
        for first_channel, (sensor, values) in zip((0, 3), triads.items(), strict=True):
            axes = [k for k in range(3) if tuned[first_channel + k]]
            if axes:
                curves = wavelet_variances(values[:, axes], span.rate_hz, robust=robustly)
                out |= {(sensor, k): curve for k, curve in zip(axes, curves, strict=True)}
        return out

    knocks = len(span.disturbances)
    if robust is not None or not knocks:
        return curves_of(bool(robust)), []
    ask = Question("wavelet variances", "nothing but noise")
    finding = f"{knocks} disturbance{'s' if knocks > 1 else ''}"
    try:
        curves = curves_of(True)
    except DataError as error:
        advice = f"they distort the variances, since robust variances cannot be computed: {error}"
        return curves_of(False), [ask.note(finding, advice)]
    advice = (
        "robust variances are used, which a few disturbances do not distort; --no-robust uses"
        " plain ones"
    )
    return curves, [ask.note(finding, advice)]


def holds_variances(path: Path) -> bool:
    """Tell whether a file holds variances, JSON or a table over scales, instead of samples."""
    content = first_bytes(path, FILE_HEAD_BYTES)
    first_byte = content.lstrip()[:1]
    return first_byte in (b"{", b"[") or (
        first_byte != b"\x93"
        and re.search(rb"(?<![a-z])(scale_s|tau_s|averaging_time)", content) is not None
    )


def _published_variances(path: Path, options: TuneOptions) -> StaticRecording:
    """Return the curves of a file of published variances."""
    content = read_bytes(path)[:FILE_HEAD_BYTES]
    if re.match(rb'\s*\{\s*"recordings":', content):
        raise InputError(
            f"{path}: is the table that insgnss tune wrote beside a noise model; give the"
            " recordings themselves"
        )
    if options.rate_hz is not None and (
        content.lstrip()[:1] in (b"{", b"[") or re.search(rb"(?m)^\W*rate_hz\s*[=:]", content)
    ):
        raise UsageError(f"{path}: the file of variances states its rate; leave --rate out")
    unit_options = {"gyro": options.gyro_unit, "accel": options.accel_unit}
    units = {sensor: unit for sensor, unit in unit_options.items() if unit}
    variances = read_variances(
        path, member=options.variable, units=units or None, rate_hz=options.rate_hz
    )
    unit_line = re.search(rb"(?m)^\W*((gyro|accel)_)?unit\s*[=:]", content)
    curves = {}
    for name, curve in variances.curves.items():
        sensor, _, letter = name.partition("_")
        if sensor not in units and not unit_line:
            example = "rad/s" if sensor == "gyro" else "m/s^2"
            raise no_unit(path, sensor, f"that the {sensor} variances are of", example)
        curves[sensor, SENSOR_AXES.index(letter)] = curve
    longest = max(curves.values(), key=lambda curve: curve.samples / curve.rate_hz)
    source = RecordingSource(path.name, sha256(path), longest.samples, longest.rate_hz)
    description = f"{len(curves)} axes of {variances.sensor or 'a sensor'}"
    checks = (
        Question("variances", "samples").note(
            description, "rest, gaps and disturbances of the recording behind them are not checked"
        ),
    )
    return StaticRecording(source, curves, None, 0.0, longest.samples / longest.rate_hz, checks)


def _refuse_unfit(path: Path, span: StaticSpan, accept: tuple[str, ...]) -> None:
    """Raise DataError with the first check by which the recording is unfit."""
    names = [check.name for check in span.checks]
    for check in span.checks:
        if check.verdict == "contradiction" and check.name not in accept:
            advice = f"{check.advice}; --accept {quote(check.name)} takes it all the same"
            raise DataError(f"{path}: {replace(check, remedy=advice).named_sentence}")
    unknown = [name for name in accept if name not in (*names, "warm-up", POOLING)]
    if unknown:
        raise UsageError(
            f"--accept {unknown[0]!r}: no such check; there are {', '.join((*names, POOLING))}"
        )


def _block_means(values: Array) -> Array:
    """Return the means (TREND_BLOCKS, 3) of equal parts."""
    size = len(values) // TREND_BLOCKS
    return np.asarray(values[: size * TREND_BLOCKS].reshape(TREND_BLOCKS, size, 3).mean(axis=1))
