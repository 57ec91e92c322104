"""What the tables of image blocks share: known columns in one unit, names, repeats, writing."""

from collections.abc import Iterable, Sequence

import numpy as np
from numpy.typing import NDArray

from ....base.errors import DataError, InputError, near
from ....base.files import atomic_write
from ..text.columns import Aliases, Columns, columns_of
from ..text.headers import normalised
from ..text.layout import shown
from ..text.text import Source, TextTable


def named_columns(
    table: TextTable,
    aliases: Aliases,
    required: Sequence[str],
    defaults: Sequence[Sequence[str]],
    units: Sequence[str],
    columns: Columns = None,
) -> dict[str, int]:
    """Return the index of every column by its canonical name.

    Unlike `columns_of`, a column of the header that nobody knows is refused: left out, a misspelled
    standard deviation would become the default one.

    Parameters
    ----------
    table : TextTable
        The table.
    aliases, required, defaults, columns
        As of `columns_of`.
    units : sequence of str
        Spellings of the unit that may stand in brackets behind a name.

    Returns
    -------
    dict
        Indices of the columns.

    Raises
    ------
    InputError
        A column that is unknown, missing or named twice, or of another unit.
    """
    index = columns_of(table, aliases, required, defaults, columns)
    layout = table.layout
    fields = layout.header_fields or ()
    for k, field in enumerate(fields):
        name, unit = normalised(field)
        if k in index.values():
            if unit is not None and unit.lower() not in units:
                raise InputError.at_line(
                    table.path,
                    layout.header_line,
                    f"column {shown(field)} is in {unit!r}; {units[0]} is read: convert it",
                )
        elif columns is None:
            raise InputError.at_line(
                table.path,
                layout.header_line,
                f"column {shown(field)} is unknown; {near(name, aliases)}; take it out, or name"
                " the columns by columns = [...] with '-' for it",
            )
    return index


def positive(table: TextTable, column: int, name: str, unit: str) -> NDArray[np.float64]:
    """Return a column of standard deviations.

    Parameters
    ----------
    table : TextTable
        The table.
    column : int
        The column, from 0.
    name, unit : str
        Its name and its unit, for the message.

    Returns
    -------
    ndarray, (n,)
        The values.

    Raises
    ------
    InputError
        One that is not positive, with file and line.
    """
    values = table.floats(column)
    if (values <= 0.0).any():
        row = int(np.argmax(values <= 0.0))
        raise table.error_at(
            row, f"{name} {values[row]:g} {unit}; a standard deviation must be greater than zero"
        )
    return values


def rows_of(table: TextTable, column: int, kind: str) -> tuple[tuple[str, ...], NDArray[np.int64]]:
    """Return the names of a column, each once and in order, and the row of each line among them.

    Parameters
    ----------
    table : TextTable
        The table.
    column : int
        The column, from 0.
    kind : str
        What it names, for the message.

    Returns
    -------
    names : tuple of str
        Different names.
    rows : ndarray of int, (n,)
        Which of them stands in each line.

    Raises
    ------
    InputError
        A name that is empty, with file and line.
    """
    given = table.strings(column)
    if "" in given:
        raise table.error_at(
            given.index(""), f"no name of the {kind}; write it, or delete the line"
        )
    names = tuple(dict.fromkeys(given))
    row_by_name = {name: k for k, name in enumerate(names)}
    return names, np.array([row_by_name[name] for name in given], dtype=np.int64)


def first_repeat(*keys: NDArray[np.int64]) -> tuple[int, int] | None:
    """Return the first row whose keys stood in an earlier one.

    Parameters
    ----------
    *keys : ndarray of int, (n,)
        The keys of each row.

    Returns
    -------
    tuple of int, optional
        The earlier row and the row; None where all rows differ.
    """
    order = np.lexsort(keys)
    twice = np.all([np.diff(key[order]) == 0 for key in keys], axis=0)
    if not twice.any():
        return None
    k = int(np.flatnonzero(twice)[np.argmin(order[1:][twice])])
    return int(order[k]), int(order[k + 1])


def write_table(
    path: Source, comments: Iterable[str], columns: Sequence[str], rows: Iterable[str]
) -> None:
    """Write a table of columns with commas between them.

    Parameters
    ----------
    path : path
        The file, written whole or not at all.
    comments : iterable of str
        Lines before the header.
    columns : sequence of str
        Names of the columns.
    rows : iterable of str
        The lines, each with its end.

    Raises
    ------
    UsageError
        The file cannot be written.
    """
    head = "".join(f"# {line}\n" for line in comments) + ",".join(columns) + "\n"
    atomic_write(path, "".join([head, *rows]))


def positive_sigma(sigma_px: float, who: str) -> None:
    """Refuse a standard deviation of image observations that is not positive.

    Parameters
    ----------
    sigma_px : float
        The standard deviation, pixels.
    who : str
        Who takes it, for the message.

    Raises
    ------
    DataError
        It is not positive.
    """
    if not 0.0 < sigma_px < np.inf:
        raise DataError(f"{who}: sigma_px {sigma_px:g}; it must be positive")
