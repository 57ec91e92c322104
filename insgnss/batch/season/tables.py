"""season.csv and season.parquet: one row a flight (data_specs/season.md)."""

import csv
import io
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any

from ...base.errors import InputError, UsageError
from ...base.inputs import read_text
from ...base.units import exact_float
from ...base.wording import DOCTOR
from .row import ROW_COLUMNS, TEXT_COLUMNS, Row, is_number

SEASON_HEAD = "# insgnss season 1: one row a flight, columns and units in data_specs/season.md"


def csv_text(rows: Sequence[Row]) -> Iterator[str]:
    """Yield the text of season.csv.

    Parameters
    ----------
    rows : sequence of dict
        By the names of `ROW_COLUMNS`.
    """
    stream = io.StringIO(newline="")
    writer = csv.writer(stream, lineterminator="\n")
    stream.write(f"{SEASON_HEAD}\n")
    writer.writerow(ROW_COLUMNS)
    for row in rows:
        writer.writerow([_cell(row.get(column)) for column in ROW_COLUMNS])
        yield stream.getvalue()
        stream.seek(0)
        stream.truncate()
    yield stream.getvalue()


def _cell(value: Any) -> str:
    if value is None:
        return ""
    if isinstance(value, float):
        return f"{value:.9g}" if is_number(value) else ""
    return " ".join(str(value).split())


def read_season(path: Path) -> list[Row]:
    """Return the rows of a season.csv.

    Parameters
    ----------
    path : Path
        The file.

    Raises
    ------
    InputError
        It is no table of a season, or a value is no number where one belongs.
    """
    try:
        lines = read_text(path, "utf-8-sig").splitlines()
    except (OSError, UnicodeDecodeError) as error:
        raise InputError.in_file(path, f"cannot be read: {error}") from None
    if not lines or not lines[0].startswith("# insgnss season"):
        raise InputError.at_line(
            path, 1, f"is not a season.csv: its first line must be {SEASON_HEAD!r}"
        )
    try:
        head, *body = csv.reader(lines[1:])
    except (csv.Error, ValueError):
        problem = (
            f"has no line of column names, or a field of more than {csv.field_size_limit()} bytes"
        )
        raise InputError.at_line(path, 2, f"{problem}; copy it again") from None
    rows = []
    for number, cells in enumerate(body, 3):
        if len(cells) != len(head):
            problem = f"{len(cells)} values under {len(head)} columns"
            raise InputError.at_line(path, number, problem)
        row: Row = {}
        for name, cell in zip(head, cells, strict=True):
            try:
                row[name] = cell if name in TEXT_COLUMNS else _number(cell) if cell else None
            except ValueError:
                problem = f"{name}: {cell!r} is no number"
                raise InputError.at_line(path, number, problem) from None
        rows.append(row)
    return rows


def _number(cell: str) -> float:
    """Return a finite number of ASCII digits; ValueError for what else Python takes for one."""
    value = exact_float(cell)
    if not (cell.isascii() and "_" not in cell and is_number(value)):
        raise ValueError(cell)
    return value


def refuse_without_parquet() -> None:
    """Raise UsageError where no library writes Parquet files."""
    from importlib.util import find_spec

    if find_spec("pyarrow") is None:
        raise UsageError(f"--parquet needs pyarrow: pip install 'insgnss[parquet]'; {DOCTOR}")


def parquet_bytes(rows: Sequence[Row]) -> bytes:
    """Return season.parquet: the columns of season.csv, texts and doubles.

    Parameters
    ----------
    rows : sequence of dict
        By the names of `ROW_COLUMNS`.
    """
    import pyarrow as pa
    import pyarrow.parquet as pq

    columns = {}
    for name in ROW_COLUMNS:
        values = [row.get(name) for row in rows]
        if name in TEXT_COLUMNS:
            columns[name] = pa.array([None if v is None else str(v) for v in values], pa.string())
        else:
            numbers = [float(v) if v is not None and is_number(v) else None for v in values]
            columns[name] = pa.array(numbers, pa.float64())
    buffer = io.BytesIO()
    pq.write_table(pa.table(columns), buffer)
    return buffer.getvalue()
