"""The tables inside a file as grids of numbers, named as the file names them.

Files are text, MATLAB and numpy.
"""

import re
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from datetime import datetime
from pathlib import Path
from typing import Any

import numpy as np

from ....io.formats import load_content
from ....io.formats.arrays.content import Matrix, tables_of, take_columns
from ....io.formats.arrays.matlab import load_matlab
from ....io.formats.names import FRACTIONS_S
from ....io.formats.text.order import SHARE_LIMIT
from ....io.formats.text.text import read_table
from ....records import Array
from .clocks import seconds_and_fractions
from .names import UnknownTable, squash_name

FEWEST_ROWS = 20  # of a table that is a recording (chosen)
SENSOR_STEMS = {
    "gyro": {"gyro", "gyr", "gyros", "gyroscope", "w", "omega", "angrate", "angularrate", "wb"}
    | {"angularvelocity", "gyrodata", "imugyro", "gyrorad"},
    "accel": {"accel", "acc", "accelerometer", "acceleration", "f", "fb", "specificforce"}
    | {"linearacceleration", "accdata", "acceldata", "imuaccel", "imuacc"},
}  # squashed names of matrices
DAY_FIRST, YEAR_FIRST = (
    re.compile(r"\b\d{1,2}-[A-Z][a-z]{2}-\d{4}\b"),
    re.compile(r"\b\d{4}-\d{2}-\d{2}\b"),
)


@dataclass(frozen=True, eq=False)
class GridTable:
    """A grid inside a file, with the file's names of its columns.

    `variable` is the variable that holds them, where the file has variables.
    """

    grid: UnknownTable
    fields: tuple[str, ...]
    variable: str | None = None


def tables_of_file(path: Path) -> Iterator[GridTable]:
    """Yield the tables of numbers that a file holds.

    Raises
    ------
    InputError
        Where the file cannot be read.
    """
    suffix = path.suffix.lower()
    form = {".mat": "matlab", ".npy": "npy", ".npz": "npy"}.get(suffix)
    if form is not None:
        yield from _content_tables(path, load_content(form, path))
    else:
        yield from _text_tables(path)


def _content_tables(path: Path, content: Any) -> Iterator[GridTable]:
    """Matrices, structs of columns, and variables of one length."""
    for info in tables_of(content):
        if info.rows < FEWEST_ROWS or not info.columns:
            continue
        columns = take_columns(
            path, content, {name: name for name in info.columns}, info.name or None
        )
        names = tuple(None if name.startswith("[") else name for name in info.columns)
        yield GridTable(
            UnknownTable(np.column_stack(list(columns.values())), names),
            info.columns,
            info.name or None,
        )
    yield from _sensors_apart(content)


def _sensors_apart(content: Any) -> Iterator[GridTable]:
    """Gyros and accelerometers in a matrix each, of x y z or with a clock before them.

    They are one table where they have as many rows and, if they have clocks, the same stamps.
    """
    triads: dict[str, tuple[str, Array]] = {}
    for name, node in content.items():
        sensor = next(
            (key for key, stems in SENSOR_STEMS.items() if squash_name(name) in stems), None
        )
        if sensor is not None and isinstance(node, Matrix) and node.values.shape[1] in (3, 4):
            triads.setdefault(sensor, (name, node.values.astype(np.float64)))
    if len(triads) != len(SENSOR_STEMS):
        return
    (gyro, rates), (accel, forces) = triads["gyro"], triads["accel"]
    if rates.shape != forces.shape or len(rates) < FEWEST_ROWS:
        return
    clock = rates.shape[1] == 4
    if clock and not (
        np.array_equal(rates[:, 0], forces[:, 0]) and (np.diff(rates[:, 0]) > 0).all()
    ):
        return
    if not clock and any(np.size(v) == len(rates) for v in content.values() if np.ndim(v) == 1):
        return  # a vector of stamps makes them a table already
    first = 1 if clock else 0
    values = np.column_stack([rates[:, :first], rates[:, first:], forces[:, first:]])
    names = (
        *(["time"] if clock else []),
        *(f"{stem}{c}" for stem in ("gyro", "accel") for c in "xyz"),
    )
    fields = tuple(
        f"{name}[{k + 1}]"
        for name, from_column in ((gyro, 0), (accel, first))
        for k in range(from_column, first + 3)
    )
    yield GridTable(UnknownTable(values, names), fields)


def _text_tables(path: Path) -> Iterator[GridTable]:

    table = read_table(path, whole=False)
    blank_limit = SHARE_LIMIT * len(table)
    table = table.with_values(
        index for index, blanks in table.blank.items() if blanks < blank_limit
    )
    layout, values = table.layout, table.values
    names = layout.header_fields or (None,) * layout.n_fields
    fractions = {}
    for whole, (fine, key) in seconds_and_fractions(names).items():
        column = FRACTIONS_S[key] * values[:, fine]
        if column.min() >= 0.0 and column.max() < 1.0 and np.ptp(column) > 0.0:
            fractions[whole] = fine, key
    if fractions:
        values = values.copy()
        for whole, (fine, key) in fractions.items():
            values[:, whole] += FRACTIONS_S[key] * values[:, fine]
    grid = UnknownTable(values, tuple(names), fractions)
    yield GridTable(grid, tuple(name or "" for name in names))


def date_in(path: Path) -> np.datetime64 | None:
    """Find a date among the texts of a MATLAB file, such as 10-Oct-2012 or 2012-10-10.

    It is None without exactly one.
    """
    if path.suffix.lower() != ".mat":
        return None

    dates: set[np.datetime64] = set()

    def visit(node: Any) -> None:
        if isinstance(node, Mapping):
            for value in node.values():
                visit(value)
        elif isinstance(node, str):
            for pattern, form in (DAY_FIRST, "%d-%b-%Y"), (YEAR_FIRST, "%Y-%m-%d"):
                for text in pattern.findall(node):
                    try:
                        dates.add(np.datetime64(datetime.strptime(text, form).date()))
                    except ValueError:
                        continue

    visit(load_matlab(path))
    return dates.pop() if len(dates) == 1 else None
