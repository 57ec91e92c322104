"""Variables of MATLAB files (up to version 7), data_specs/matlab.md.

There is no default: `columns` says which field or which column of a matrix is what. A file that holds the last fix until
the next comes is read by `new_when`, the quantity that changes with each new fix: a fix is taken at the row where it
changes to something that is neither zero nor not-a-number, and it is stamped with that row's time.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ..errors import InputError, UsageError
from ..records import GnssFixes, ImuSamples, Quantity
from ._columns import ANGLE_UNITS, check_units, gps_time, unit_name
from ._text import Source
from .gnss_text import ALIASES, REQUIRED, fixes_from_columns
from .imu_csv import ACCEL, COLUMNS, GYRO, unit_tables

Array = NDArray[np.float64]
Columns = Mapping[str, str] | Sequence[str]

REPEATED_LIMIT = 0.5


@dataclass(frozen=True)
class _Rows:
    """Rows of a MATLAB variable, counted from 1, in the place of lines."""

    path: str
    rows: NDArray[np.int64]

    def at(self, row: int, what: str) -> InputError:
        """The error `what` at a row."""
        return InputError(f"{self.path}: row {int(self.rows[row]) + 1}: {what}")


def read_matlab_table(path: Source, columns: Columns, variable: str | None = None) -> dict[str, Array]:
    """Arrays (n,) by canonical name.

    columns : canonical name to field (of the struct `variable`, or a variable of the file; points reach into structs), or for
        a matrix `variable` the canonical name of each of its columns in order, "-" leaving one out.
    Raises InputError that lists what is there where something is not.
    """
    content = _load(path)
    if isinstance(columns, Mapping):
        base = _reach(path, content, variable) if variable else content
        table = {name: np.asarray(_reach(path, base, field), dtype=np.float64).reshape(-1) for name, field in columns.items()}
        sizes = {name: column.size for name, column in table.items()}
        if len(set(sizes.values())) > 1:
            raise InputError(f"{path}: columns of different length: {sizes}; name fields of one recording")
        return table
    if variable is None:
        raise UsageError(f"{path}: a list of columns needs the name of its matrix; set variable to one of {', '.join(_names(content))}")
    if twice := [name for name in columns if name != "-" and list(columns).count(name) > 1]:
        raise UsageError(f"{path}: columns names {twice[0]} twice: {list(columns)}")
    matrix = np.atleast_2d(np.asarray(_reach(path, content, variable), dtype=np.float64))
    if matrix.ndim != 2 or matrix.shape[1] != len(columns):
        raise InputError(f"{path}: {variable} has the shape {matrix.shape}, but columns names {len(columns)}: {list(columns)}")
    return {name: np.ascontiguousarray(matrix[:, i]) for i, name in enumerate(columns) if name != "-"}


def _load(path: Source) -> dict[str, Any]:
    from scipy.io import loadmat
    from scipy.io.matlab import MatReadError

    if not Path(path).is_file():
        raise InputError.at(path, None, "no such file; check the path in the flight file")
    try:
        return dict(loadmat(str(path), squeeze_me=True, struct_as_record=False))
    except NotImplementedError:
        raise InputError.at(path, None, "is a MATLAB 7.3 file (HDF5); save it with -v7") from None
    except (MatReadError, ValueError, TypeError, EOFError, OSError) as error:
        raise InputError.at(path, None, f"is no whole MATLAB file ({error}); copy it again from its source") from None


def _names(node: Any) -> list[str]:
    names = node.keys() if isinstance(node, dict) else getattr(node, "_fieldnames", [])
    return [name for name in names if not name.startswith("__")]


def _reach(path: Source, node: Any, name: str) -> Any:
    for part in name.split("."):
        if part not in _names(node):
            raise InputError(f"{path}: no {name}; there are {', '.join(_names(node)) or 'no fields'}")
        node = node[part] if isinstance(node, dict) else getattr(node, part)
    return node


def _finite(table: Mapping[str, Array], lines: _Rows) -> None:
    for name, column in table.items():
        if (bad := ~np.isfinite(column)).any():
            raise lines.at(int(np.argmax(bad)), f"{name} is {column[int(np.argmax(bad))]}; it must be finite")


def _need(path: Source, table: Mapping[str, Array], required: Sequence[str]) -> None:
    if missing := [name for name in required if name not in table]:
        raise InputError(f"{path}: columns does not name {', '.join(missing)}")


def read_imu_mat(
    path: Source,
    columns: Columns,
    variable: str | None = None,
    units: Mapping[str, str] | None = None,
    quantity: Quantity = "mean_rate",
    gps_week: int | None = None,
) -> ImuSamples:
    """Read IMU samples into SI; columns as in `read_matlab_table`, names, units and quantity as in `imu_csv`."""
    units = check_units(units, ("gyro", "accel"))
    table = read_matlab_table(path, columns, variable)
    _need(path, table, COLUMNS)
    lines = _Rows(str(path), np.arange(table["tow"].size))
    _finite(table, lines)
    time, gps_week = gps_time(lines, table["tow"], table.get("week"), gps_week)
    triads = []
    for names, known, key in zip((GYRO, ACCEL), unit_tables(quantity), ("gyro", "accel"), strict=True):
        unit = unit_name(units.get(key, next(iter(known))))
        if unit not in known:
            raise UsageError(f"{path}: unit {units[key]!r} for {key} is none of {', '.join(known)}")
        triads.append(known[unit] * np.column_stack([table[name] for name in names]))
    return ImuSamples(time, triads[0], triads[1], quantity, gps_week, str(path))


def read_gnss_mat(
    path: Source,
    columns: Columns,
    variable: str | None = None,
    new_when: str | None = None,
    sigma_m: ArrayLike | None = None,
    sigma_velocity: ArrayLike | None = None,
    units: Mapping[str, str] | None = None,
    gps_week: int | None = None,
    undulation_m: float = 0.0,
) -> GnssFixes:
    """Read fixes; columns as in `read_matlab_table`, names as in `gnss_text`, latitude and longitude in units["angle"] (deg).

    new_when : field (or, of a matrix, canonical name) that changes with each new fix; None takes every row for a fix, and
        is refused where more than half of them repeat the one before.
    undulation_m : geoid above the ellipsoid, m, added to heights that are above the geoid.
    """
    units = check_units(units, ("angle",))
    unit = unit_name(units.get("angle", "deg"))
    if unit not in ANGLE_UNITS:
        raise UsageError(f"{path}: unit {units['angle']!r} for angle is none of {', '.join(ANGLE_UNITS)}")
    table = read_matlab_table(path, columns, variable)
    _need(path, table, REQUIRED)
    rows = np.arange(table["tow"].size)
    if new_when is not None:
        mark = table[new_when] if new_when in table else read_matlab_table(path, {"mark": new_when}, variable)["mark"]
        changed = np.isfinite(mark[1:]) & (mark[1:] != 0.0) & (mark[1:] != mark[:-1])
        rows = np.flatnonzero(changed) + 1
        if rows.size == 0:
            raise InputError(
                f"{path}: {new_when} never changes to a new value; no fix; set new_when to what changes with each fix, or None"
            )
    elif rows.size > 1 and np.mean((np.diff(table["lat"]) == 0.0) & (np.diff(table["lon"]) == 0.0)) > REPEATED_LIMIT:
        raise InputError(f"{path}: more than half of the positions repeat the one before; set new_when to what changes with each new fix")
    lines = _Rows(str(path), rows)
    cols = {name: column[rows] for name, column in table.items() if name in ALIASES}
    _finite(cols, lines)
    cols["lat"], cols["lon"] = cols["lat"] * ANGLE_UNITS[unit], cols["lon"] * ANGLE_UNITS[unit]
    cols["h"] = cols["h"] + undulation_m
    cols["tow"], gps_week = gps_time(lines, cols["tow"], cols.get("week"), gps_week)
    return fixes_from_columns(cols, lines, str(path), gps_week, sigma_m, sigma_velocity)
