"""Columns out of files that hold variables (MATLAB, numpy, a log): matrices, vectors, structs.

Content is a mapping of names to arrays and further mappings. A column is named by a path into it:

    time                 a vector, here or in the struct `variable`
    flight.gps.lat       points reach into structs
    IMU.GyrX             a column of the matrix IMU by its label, where IMU_label (or a record's
                         fields) names the columns
    angRate[2]           a column of a matrix by its place, counted from 1; "[2]" is that of the
                         matrix `variable`
"""

import re
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ....base.errors import InputError, UsageError
from ....base.wording import spell
from ....records import Array

Content = Mapping[str, Any]

FEW_ROWS, LONG_ROW_RATIO = 16, 20  # rows, and columns for each: such are no samples, but channels
_INDEXED = re.compile(r"(.*)\[([0-9]+)\]", re.DOTALL)


@dataclass(frozen=True)
class Matrix:
    """A matrix (n, m), and the names of its columns as far as it has any."""

    values: NDArray[Any]
    labels: tuple[str, ...] = ()


def matrix_of(array: NDArray[Any]) -> Matrix | NDArray[Any]:
    """Return a matrix with a row for each sample; one of a single row or column as a vector.

    A few long rows (3 x N) are the columns of a table that was written the other way round.
    """
    if min(array.shape) == 1:
        return array.reshape(-1)
    rows, columns = array.shape
    return Matrix(array.T if rows <= FEW_ROWS and columns >= LONG_ROW_RATIO * rows else array)


@dataclass(frozen=True)
class TableInfo:
    """A table inside a file.

    Attributes
    ----------
    name : str
        What to set `variable` to; empty where nothing is needed.
    columns : tuple of str
        The names that `columns` may use.
    rows : int
        The number of rows.
    units : tuple of str
        The unit of each column where the file gives one, else an empty text.
    """

    name: str
    columns: tuple[str, ...]
    rows: int
    units: tuple[str, ...] = ()


def take_columns(
    path: object, content: Content, columns: Mapping[str, str] | Sequence[str], variable: str | None
) -> dict[str, Array]:
    """Take columns out of content, by canonical name.

    Parameters
    ----------
    path
        The file, for messages.
    content : mapping
        Its variables.
    columns : mapping or sequence
        Canonical name to path; or for a matrix `variable` the canonical name of each of its columns
        in order, "-" leaving one out.
    variable : str, optional
        The struct or matrix that the paths start from.

    Returns
    -------
    dict
        Arrays (n,) by canonical name.

    Raises
    ------
    InputError
        A path that does not exist; the message lists the names that do.
    UsageError
        A list of columns without `variable`, or with a name twice.
    """
    if isinstance(columns, Mapping):
        table = {
            name: _column(path, content, _joined_name(variable, field))
            for name, field in columns.items()
        }
        sizes = {name: column.size for name, column in table.items()}
        if len(set(sizes.values())) > 1:
            raise InputError(
                f"{path}: columns of different length: {sizes}; name fields of one recording"
            )
        return table
    if variable is None and "" not in content:
        raise UsageError(
            f"{path}: a list of columns needs the name of its matrix; set"
            f" {spell('variable')} to one of {', '.join(content)}"
        )
    if twice := [name for name in columns if name != "-" and list(columns).count(name) > 1]:
        raise UsageError(
            f"{path}: {spell('columns')} names {twice[0]} twice: {list(columns)}; name it once"
        )
    matrix = _matrix(path, _reach(path, content, variable or ""), variable or "the array")
    if matrix.shape[1] != len(columns):
        raise InputError(
            f"{path}: {variable or 'the array'} has the shape {matrix.shape}, but"
            f" {spell('columns')} names {len(columns)}: {list(columns)}"
        )
    return {
        name: np.ascontiguousarray(matrix[:, i]) for i, name in enumerate(columns) if name != "-"
    }


def _joined_name(variable: str | None, field: str) -> str:
    if not variable:
        return field
    is_index = field.startswith("[") and _INDEXED.fullmatch(field)
    return variable + field if is_index else f"{variable}.{field}"


def _reach(path: object, content: Content, name: str) -> Any:
    """Return the node of a path; InputError lists the names that exist."""
    node: Any = content
    for step in name.split("."):
        if isinstance(node, Mapping) and step in node:
            node = node[step]
        elif isinstance(node, Matrix) and step in node.labels:
            node = node.values[:, node.labels.index(step)]
        else:
            raise InputError(
                f"{path}: no {name}; there are {', '.join(_names(node)) or 'no fields'}"
            )
    return node


def _names(node: Any) -> list[str]:
    if isinstance(node, Matrix):
        return list(node.labels) or [f"[{k + 1}]" for k in range(node.values.shape[1])]
    return [str(name) for name in node] if isinstance(node, Mapping) else []


def _column(path: object, content: Content, name: str) -> Array:
    if name in content:  # a name that has points or brackets of its own
        return _vector(path, content[name], name)
    if not (match := _INDEXED.fullmatch(name)):
        return _vector(path, _reach(path, content, name), name)
    matrix = _matrix(path, _reach(path, content, match[1]), match[1])
    if not 1 <= int(match[2]) <= matrix.shape[1]:
        raise InputError(f"{path}: no {name}; there are {matrix.shape[1]} columns, counted from 1")
    return np.ascontiguousarray(matrix[:, int(match[2]) - 1])


def _matrix(path: object, node: Any, name: str) -> Array:
    values = node.values if isinstance(node, Matrix) else node
    return np.atleast_2d(_numbers(path, values, name))


def _vector(path: object, node: Any, name: str) -> Array:
    if isinstance(node, Matrix):
        shape = " x ".join(map(str, node.values.shape))
        raise InputError(
            f"{path}: {name} is a matrix of {shape}; name one of its columns, {name}[1] for the"
            " first"
        )
    return _numbers(path, node, name).reshape(-1)


def _numbers(path: object, node: Any, name: str) -> Array:
    values = np.asarray(node) if not isinstance(node, Mapping) else np.empty(0, dtype=object)
    if values.dtype.kind not in "buif" or values.ndim > 2:
        members = f" (a struct of {', '.join(_names(node))})" if isinstance(node, Mapping) else ""
        if values.dtype.kind == "M":
            raise InputError(
                f"{path}: {name} holds dates ({values.dtype}), which do not say their time scale;"
                ' save seconds: insgnss.gps_from_dates(dates, "utc" or "gpst")'
            )
        raise InputError(
            f"{path}: {name} holds no numbers{members}; name a vector, or a column of a matrix"
        )
    with np.errstate(over="ignore"):  # of a longer type, beyond a float; refused as infinite
        return values.astype(np.float64)


def tables_of(content: Content, prefix: str = "") -> Iterator[TableInfo]:
    """Yield the tables of content: matrices, vectors of equal length together, those of structs."""
    vectors: dict[int, list[str]] = {}
    for name, node in content.items():
        where = f"{prefix}{name}"
        if isinstance(node, Mapping):
            yield from tables_of(node, where + ".")
        elif isinstance(node, Matrix) and node.values.dtype.kind in "buif":
            yield TableInfo(where, tuple(_names(node)), len(node.values))
        elif (
            isinstance(node, np.ndarray)
            and node.ndim == 1
            and node.size > 1
            and node.dtype.kind in "buif"
        ):
            vectors.setdefault(node.size, []).append(name)
    for size, names in vectors.items():
        wide = [
            (name, node.values.shape[1])
            for name, node in content.items()
            if isinstance(node, Matrix) and len(node.values) == size
        ]
        names += [f"{name}[{k + 1}]" for name, width in wide for k in range(width)]
        yield TableInfo(prefix.removesuffix("."), tuple(names), size)
