"""IMU samples and fixes from content by a column map: what MATLAB and numpy files have in common.

A file that holds the last fix until the next comes is read by `repeat_column`, the quantity that
changes with each new fix: a fix is taken at the row where it changes to something that is neither
zero nor not-a-number, and it is stamped with that row's time.
"""

from collections.abc import Collection, Mapping, Sequence

import numpy as np

from ....base.errors import InputError, UsageError
from ....base.wording import spell
from ....records import Array, GnssFixes, ImuSamples
from ....records.observations import OF_THE_SOLUTION
from ..gnss import gnss_text
from ..gnss.cartesian import position_columns
from ..gnss.fixes import FIX_SIGMAS, OF_POSITION, VELOCITY_SIGMA, fixes_from_columns, new_fixes
from ..gnss.heights import settled_undulation
from ..gnss.rounding import is_held
from ..imu import imu_csv
from ..read_options import ReadOptions
from ..text.columns import TableSpec
from ..text.headers import Settled, settled_units
from ..text.order import Lines, NumberedRows, Picked, refuse_rows
from .content import Content, take_columns

OF_A_FIX = ("h", "vn", "ve", "vd", "vu", "speed", "course", *FIX_SIGMAS, *VELOCITY_SIGMA, "sd_ne")


def _take_variables(
    spec: TableSpec, path: object, content: Content, options: ReadOptions
) -> dict[str, Array]:
    columns = options.columns or ()
    names = list(columns)
    if isinstance(columns, Mapping) and (unknown := [n for n in names if n not in spec.names]):
        raise UsageError(
            f"{path}: {spell('columns')}: {unknown[0]!r} is none of {', '.join(spec.names)}"
        )
    taken = take_columns(path, content, columns, options.variable)
    cols = {name: column for name, column in taken.items() if name in spec.names}
    if missing := [name for name in spec.required.split() if name not in cols]:
        raise InputError(
            f"{path}: {spell('columns')} does not name {', '.join(missing)}; give it a name or a"
            " place in the file"
        )
    return cols


def _finite(table: Mapping[str, Array], lines: Lines, incomplete: Collection[str] = ()) -> None:
    for name, column in table.items():
        if name not in (*OF_THE_SOLUTION, *incomplete):
            message = f"{name} is {{}}; it must be finite; leave the row out"
            refuse_rows(lines, ~np.isfinite(column), message, column)


def imu_of_content(path: object, content: Content, options: ReadOptions) -> ImuSamples:
    """Read IMU samples in SI units from content by a column map.

    Parameters
    ----------
    path, content
        The file, for messages, and what it holds by name.
    options : ReadOptions
        `columns`, which it needs; fields' names may end in their units.

    Returns
    -------
    ImuSamples
        The samples.
    """
    spec = imu_csv.with_required(imu_csv.required_columns(options.rate_hz))
    lines = NumberedRows(str(path))
    cols = _take_variables(spec, path, content, options)
    _finite(cols, lines)
    kinds = imu_csv.kinds_of(options.quantity)
    settled = _settle_units(spec, path, options, spec.checked_units(options.units), kinds)
    scales = imu_csv.scales_of(settled, kinds)
    return imu_csv.imu_from_columns(cols, lines, scales, options, settled.notes)


def _settle_units(
    spec: TableSpec,
    path: object,
    options: ReadOptions,
    units: Mapping[str, str],
    kinds: Mapping[str, str] | None = None,
) -> Settled:
    """Return the units by the caller and by what the file calls the columns."""
    fields = {key: _fields(options, names.split()) for key, names in spec.units.items()}
    return settled_units(path, None, spec.units, fields, units, spec.record, kinds)


def _fields(options: ReadOptions, names: Sequence[str]) -> list[str]:
    """Return what the file calls the columns `names`; a list of columns gives no names."""
    columns = options.columns
    return [columns[n] for n in names if n in columns] if isinstance(columns, Mapping) else []


def gnss_of_content(path: object, content: Content, options: ReadOptions) -> GnssFixes:
    """Read fixes from content by a column map.

    Parameters
    ----------
    path, content
        The file, for messages, and what it holds by name.
    options : ReadOptions
        `columns`, which it needs; fields' names may end in their units.

    Returns
    -------
    GnssFixes
        The fixes.

    Raises
    ------
    InputError
        A value that is not finite, repeated positions, or a `repeat_column` that never changes.
    """
    spec, repeat_column = gnss_text.spec_of(options.columns or ()), options.repeat_column
    units = spec.checked_units(options.units, "quality")
    settled = _settle_units(spec, path, options, units)
    scales = gnss_text.fix_scales(settled, units)
    geoid_m, more = settled_undulation(path, None, _fields(options, ("h",)), options.undulation_m)
    table = _take_variables(spec, path, content, options)
    lines: Lines = NumberedRows(str(path))
    if repeat_column is not None:
        mark = table.get(repeat_column)
        if mark is None:
            wanted = {"mark": repeat_column}
            mark = take_columns(path, content, wanted, options.variable)["mark"]
        if mark.size != table["tow"].size:
            raise InputError(
                f"{path}: {repeat_column} has {mark.size} rows, the columns have"
                f" {table['tow'].size}; name a field of the same recording"
            )
        rows = new_fixes(path, repeat_column, mark)
        table, lines = {name: column[rows] for name, column in table.items()}, Picked(lines, rows)
    elif is_held(
        [table[name] for name in position_columns(table)[:2]],
        [column for name, column in table.items() if name in OF_A_FIX],
    ):
        finding = "more than half of the rows repeat the fix before"
        raise InputError(
            f"{path}: {finding}; set repeat_column to a field that changes with each fix"
        )
    _finite(table, lines, () if options.sigma_m is None else OF_POSITION)
    return fixes_from_columns(table, lines, scales, options, geoid_m, (*settled.notes, *more))
