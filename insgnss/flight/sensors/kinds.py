"""The kinds of tables [[measurement]], and the reading of their files.

A kind is a `SensorKind`. Those that are shipped stand in `shipped.KINDS`; a package installed
beside adds its own by an entry point of the group `insgnss.measurements`, whose name is the kind's.
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import cache
from importlib import import_module
from pathlib import Path

import numpy as np

from ...base.errors import InputError, OptionError
from ...base.received.plugins import installed_plugins, load_installed
from ...base.units import DEG
from ...geodesy.gpstime import WEEK_S
from ...io.formats.gnss.septentrio import DO_NOT_USE
from ...io.formats.names import TIME, Names
from ...io.formats.text.columns import TableSpec
from ...io.formats.text.order import Lines, Picked, note, put_in_order
from ...io.options.schema import declared_options
from ...records import Array, Finding
from ...records.measurements import Measurement, OwnState, Predict
from .options import ENTRY_POINTS, SHIPPED, MeasurementInput

EXACT_DEG = 0.05  # of an angle that is stated as exact, so that the flight can contradict it
EXACT_SCALE = 1e-4  # of such a scale factor
LogRows = tuple[int, Array, Array, Lines, Array | None, tuple[Finding, ...]]
"""GPS week, times, values (k, c) and their lines in a log; sigmas, None without, and notes."""

Modelled = tuple[Predict, tuple[OwnState, ...]] | tuple[Predict, tuple[OwnState, ...], Predict]
"""What a sensor's values follow from: their prediction, the states that it has of its own, and
where it has one the derivative of the prediction.
"""

TURN = 2.0 * np.pi  # rad, by which values of an angle are the same


@dataclass(frozen=True)
class SensorKind:
    """What a kind of [[measurement]] reads, and how its values follow from the motion.

    Parameters
    ----------
    spec : TableSpec
        Columns of its file: its values, and as "sigma_..." their standard deviations.
    values : str
        The columns of the values, blanks between them.
    unit : str
        Key of `units` that they have: "angle", "velocity", "length" or "field".
    model : callable
        Takes the options and which of `values` the file has; returns the prediction of these
        (`records.measurements.Predict`), the own states, and where it has one the derivative.
    other_format : callable, optional
        Takes the file; returns its rows, angles in degrees, all others in SI, where it is no table
        but a log of another format, else None.
    reads, needs : tuple of str
        Which of the options of single kinds it reads, and which of these must be given.
    """

    spec: TableSpec
    values: str
    unit: str
    model: Callable[[MeasurementInput, tuple[str, ...]], Modelled]
    other_format: Callable[[Path], LogRows | None] = lambda path: None
    reads: tuple[str, ...] = ("offset_sigma_deg",)
    needs: tuple[str, ...] = ()


def table_of(names: Names, unit: str, alone: str = "") -> tuple[TableSpec, str, str]:
    """Return the table of values that have each a standard deviation, as `SensorKind` takes it.

    Parameters
    ----------
    names : mapping
        The names that a header may give each value and its "sigma_...", in the order of a file
        without a header.
    unit : str
        Key of `units` that all of them have.
    alone : str
        The value that a file without a header may hold alone; a header may then lack any.

    Returns
    -------
    tuple of TableSpec, str and str
        `spec`, `values` and `unit` of the kind.
    """
    values = " ".join(name for name in names if f"sigma_{name}" in names)
    layouts: list[str] = []
    for columns in filter(None, (alone, values)):
        sigmas = " ".join(f"sigma_{name}" for name in columns.split())
        layouts += [f"tow {columns}", f"tow {columns} {sigmas}"]
    spec = TableSpec(
        {**TIME, **names},
        required="tow" if alone else layouts[0],
        layouts=tuple(layouts),
        units={unit: f"{values} {sigmas}", "time": "tow"},
        record="measurement",
    )
    return spec, values, unit


@cache
def kinds() -> Mapping[str, SensorKind]:
    """Return the kinds by name, the shipped ones first.

    Returns
    -------
    mapping of str to SensorKind
        An installed one cannot replace a shipped one.
    """
    shipped = import_module(".shipped", __package__).KINDS
    return {
        name: load_installed(ENTRY_POINTS, name) for name in installed_plugins(ENTRY_POINTS)
    } | shipped


def turned_angles(options: MeasurementInput, *axes: str) -> tuple[OwnState, ...]:
    """Return the states of a sensor that is turned against the body.

    Parameters
    ----------
    options : MeasurementInput
        The table.
    *axes : str
        What each angle is about.

    Returns
    -------
    tuple of OwnState
        Constants, rad.
    """
    sigma = max(options.offset_sigma_deg, EXACT_DEG) * DEG
    return tuple(OwnState(f"offset {axis}".rstrip(), sigma, "rad") for axis in axes)


def read_measurement(
    options: MeasurementInput, week: int
) -> tuple[Measurement, tuple[Finding, ...]]:
    """Read the file of a table [[measurement]].

    Parameters
    ----------
    options : MeasurementInput
        The table.
    week : int
        The GPS week whose seconds its times are to count.

    Returns
    -------
    tuple of Measurement and tuple of Finding
        The measurement, and notes on its rows.

    Raises
    ------
    OptionError
        An option that its kind does not read, or needs and has not.
    InputError
        A column or a standard deviation that is missing, a bad value, times out of order, with file
        and line.
    """
    kind = kinds()[options.kind]
    _refuse_options(options, kind)
    log = kind.other_format(options.file)
    columns, read = (
        _rows_of_table(options, kind, week) if log is None else _rows_of_log(options, kind, log)
    )
    own_week, time, values, lines, sigma, noted = read
    if sigma is None:
        missing = f"no column {' or '.join(f'sigma_{name}' for name in columns)}"
        reason = missing if log is None else "the format has no standard deviations"
        sigma = _stated_sigma(options, kind, values.shape, reason)
    time = time + options.time_offset_s + WEEK_S * (own_week - week)
    rows, notes = put_in_order(
        lines, time, lambda i, k: bool((values[i] == values[k]).all()), "measurement rows"
    )
    if rows is not None:
        time, values, sigma = time[rows], values[rows], sigma[rows]
    predict, states, *derivative = kind.model(options, columns)
    period = TURN if kind.unit == "angle" else None
    return (
        Measurement(
            *(options.called, time, values, sigma, predict, states),
            gate_sigma=options.gate_sigma,
            period=period,
            derivative=derivative[0] if derivative else None,
        ),
        (*noted, *notes),
    )


def _rows_of_table(
    options: MeasurementInput, kind: SensorKind, week: int
) -> tuple[tuple[str, ...], LogRows]:
    """Return the columns that a table has of the values, and its rows in SI."""
    table = kind.spec.read(options.file, options.columns)
    settled = table.settled(kind.spec.checked_units(options.units))
    columns = tuple(name for name in kind.values.split() if name in table)
    if not columns:
        problem = f"no column out of {kind.values}; set columns = [...] with tow and these names"
        raise InputError.at_line(str(options.file), None, problem)
    factor, values = settled.factors[kind.unit], table.block(" ".join(columns))
    time, own_week, notes = table.examined_time(
        "measurement rows",
        None if "week" in table else week,
        settled.units["time"],
        lambda i, k: bool((values[i] == values[k]).all()),
    )
    names, sigma = [f"sigma_{name}" for name in columns], None
    if all(name in table for name in names):
        unit = {"angle": "deg", "velocity": "m/s", "length": "m", "field": "uT"}[kind.unit]
        sigma = factor * table.positive(" ".join(names), unit)
    lines: Lines = table
    notes = (*settled.notes, *notes)
    if (absent := (values <= DO_NOT_USE).any(axis=1)).any():
        rows = np.flatnonzero(~absent)
        time, values, lines = time[rows], values[rows], Picked(table, rows)
        sigma = None if sigma is None else sigma[rows]
        finding = f"left out {absent.sum()} rows with -2e10, which receivers write for no value"
        notes = (*notes, note("measurement rows", finding, "a value each"))
    return columns, (own_week or week, time, factor * values, lines, sigma, notes)


def _rows_of_log(
    options: MeasurementInput, kind: SensorKind, log: LogRows
) -> tuple[tuple[str, ...], LogRows]:
    """Return the columns of the values, and the rows of a log of another format in SI."""
    if options.columns is not None or options.units is not None:
        key = "units" if options.columns is None else "columns"
        problem = f"belongs to tables, but {options.file.name} is a log; leave this key out"
        raise OptionError(f"measurement.{key}", problem)
    week, time, values, lines, sigma, notes = log
    factor = DEG if kind.unit == "angle" else 1.0
    values = factor * values.reshape(time.size, -1)
    sigma = None if sigma is None else factor * sigma.reshape(values.shape)
    return tuple(kind.values.split()), (week, time, values, lines, sigma, notes)


def _refuse_options(options: MeasurementInput, kind: SensorKind) -> None:
    """Refuse options that the kind does not read, and those that it needs and that are missing."""
    known_options = declared_options(MeasurementInput)
    for name in dict.fromkeys(name for shipped in SHIPPED for name in kinds()[shipped].reads):
        default = getattr(options, name) == known_options[name].default
        if name not in kind.reads and not default:
            problem = f"is not used by kind {options.kind!r}; leave this key out"
            raise OptionError(f"measurement.{name}", problem)
        if name in kind.needs and default:
            meaning = known_options[name].option.meaning
            problem = f"is missing; kind {options.kind!r} needs it: {meaning}"
            raise OptionError(f"measurement.{name}", problem)


def _stated_sigma(
    options: MeasurementInput, kind: SensorKind, shape: tuple[int, ...], reason: str
) -> Array:
    """Return the standard deviation of the table for all values, in SI."""
    if options.sigma is None:
        problem = f"{reason}; give measurement.sigma, the standard deviation of the values"
        raise InputError.at_line(str(options.file), None, problem)
    return np.full(shape, options.sigma * (DEG if kind.unit == "angle" else 1.0))
