"""IMU samples and fixes from content by a column map: what MATLAB and numpy files have in common.

A file that holds the last fix until the next comes is read by `repeat_column`, the quantity that
changes with each new fix: a fix is taken at the row where it changes to something that is neither
zero nor not-a-number, and it is stamped with that row's time.
"""

from collections.abc import Collection, Mapping, Sequence

import numpy as np
from numpy.typing import ArrayLike

from ....base.errors import InputError, UsageError
from ....records import Array, GnssFixes, ImuSamples, Quantity
from ....records.observations import OF_THE_SOLUTION
from ..gnss import gnss_text
from ..gnss.cartesian import Position, geodetic_columns, position_columns
from ..gnss.fixes import OF_POSITION, SIGMA, VELOCITY_SIGMA, fixes_from_columns
from ..gnss.heights import settled_undulation
from ..gnss.rounding import is_held
from ..imu import imu_csv
from ..text.columns import TableSpec
from ..text.headers import Settled
from ..text.order import Lines, NumberedRows, Picked, refuse_rows
from ..text.units import imu_kinds
from .content import Content, take_columns

Columns = Mapping[str, str] | Sequence[str]

OF_A_FIX = ("h", "vn", "ve", "vd", "vu", "speed", "course", *SIGMA, *VELOCITY_SIGMA, "sd_ne")


def _taken(
    spec: TableSpec, path: object, content: Content, columns: Columns, variable: str | None
) -> dict[str, Array]:
    names = list(columns)
    if isinstance(columns, Mapping) and (odd := [n for n in names if n not in spec.names]):
        raise UsageError(f"{path}: columns: {odd[0]!r} is none of {', '.join(spec.names)}")
    taken = take_columns(path, content, columns, variable)
    cols = {name: column for name, column in taken.items() if name in spec.names}
    if missing := [name for name in spec.required.split() if name not in cols]:
        raise InputError(
            f"{path}: columns does not name {', '.join(missing)}; give it a name or a place in the"
            " file"
        )
    return cols


def _finite(table: Mapping[str, Array], lines: Lines, incomplete: Collection[str] = ()) -> None:
    for name, column in table.items():
        if name not in (*OF_THE_SOLUTION, *incomplete):
            message = f"{name} is {{}}; it must be finite; leave the row out"
            refuse_rows(lines, ~np.isfinite(column), message, column)


def imu_of_content(
    path: object,
    content: Content,
    columns: Columns,
    variable: str | None = None,
    units: Mapping[str, str] | None = None,
    quantity: Quantity = "mean_rate",
    gps_week: int | None = None,
    rate_hz: float | None = None,
) -> ImuSamples:
    """Read IMU samples in SI units from content by a column map.

    Parameters
    ----------
    path, content, columns, variable
        As in `content.take_columns`.
    units : mapping, optional
        Units of gyro, accel and time, which fields' names may end in as well.
    quantity, rate_hz
        As in `imu_csv`.
    gps_week : int, optional
        The week, where no column holds it.

    Returns
    -------
    ImuSamples
        The samples.
    """
    units = imu_csv.SPEC.checked_units(units)
    spec = imu_csv.with_required(imu_csv.required_columns(rate_hz))
    cols = _taken(spec, path, content, columns, variable)
    lines = NumberedRows(str(path))
    _finite(cols, lines)
    kinds = dict(zip(("gyro", "accel"), imu_kinds(quantity), strict=True))
    settled = _settled(spec, path, columns, units, kinds)
    scales = imu_csv.scales_of(settled, kinds, rate_hz)
    return imu_csv.imu_from_columns(
        cols, lines, str(path), scales, quantity, gps_week, settled.notes
    )


def _settled(
    spec: TableSpec,
    path: object,
    columns: Columns,
    units: Mapping[str, str],
    kinds: Mapping[str, str] | None = None,
) -> Settled:
    """Return the units by the caller and by what the file calls the columns."""
    fields = {key: _fields(columns, names.split()) for key, names in spec.units.items()}
    return spec.settled(str(path), None, fields, units, kinds)


def _fields(columns: Columns, names: Sequence[str]) -> list[str]:
    """Return what the file calls the columns `names`; a list of columns gives no names."""
    return (
        [columns[name] for name in names if name in columns] if isinstance(columns, Mapping) else []
    )


def gnss_of_content(
    path: object,
    content: Content,
    columns: Columns,
    variable: str | None = None,
    repeat_column: str | None = None,
    sigma_m: ArrayLike | None = None,
    sigma_velocity: ArrayLike | None = None,
    units: Mapping[str, str] | None = None,
    gps_week: int | None = None,
    undulation_m: float | None = None,
    reference: Position | None = None,
) -> GnssFixes:
    """Read fixes from content by a column map.

    Parameters
    ----------
    path, content, columns, variable
        As in `content.take_columns`.
    repeat_column : str, optional
        Path (or canonical name) of the quantity that changes with each new fix; without it every
        row is a fix, which is refused where the rows repeat each fix until the next (`rounding`).
    sigma_m, sigma_velocity : array_like, optional
        Standard deviations north, east, down, m and m/s, where no columns hold them.
    units : mapping, optional
        As in `gnss_text`; fields' names may end in a unit as well.
    gps_week : int, optional
        The week, where no column holds it.
    undulation_m : float, optional
        Geoid above the ellipsoid, m, added to heights that are above the geoid (`heights`).
    reference : tuple of float, optional
        As in `gnss_text`.

    Returns
    -------
    GnssFixes
        The fixes.

    Raises
    ------
    InputError
        A value that is not finite, repeated positions, or a `repeat_column` that never changes.
    """
    spec = gnss_text.spec_of(columns)
    units = spec.checked_units(units, "quality")
    settled = _settled(spec, path, columns, units)
    scales = gnss_text.fix_scales(settled, units)
    geoid_m, more = settled_undulation(path, None, _fields(columns, ("h",)), undulation_m)
    table = _taken(spec, path, content, columns, variable)
    lines: Lines = NumberedRows(str(path))
    if repeat_column is not None:
        mark = (
            table[repeat_column]
            if repeat_column in table
            else take_columns(path, content, {"mark": repeat_column}, variable)["mark"]
        )
        if mark.size != table["tow"].size:
            raise InputError(
                f"{path}: {repeat_column} has {mark.size} rows, the columns have"
                f" {table['tow'].size}; name a field of the same recording"
            )
        rows = (
            np.flatnonzero(np.isfinite(mark[1:]) & (mark[1:] != 0.0) & (mark[1:] != mark[:-1])) + 1
        )
        if rows.size == 0:
            raise InputError(
                f"{path}: {repeat_column} never changes to a new value; no fix; set repeat_column"
                " to what changes with each fix, or None"
            )
        table, lines = {name: column[rows] for name, column in table.items()}, Picked(lines, rows)
    elif is_held(
        [table[name] for name in position_columns(table)[:2]],
        [column for name, column in table.items() if name in OF_A_FIX],
    ):
        finding = "more than half of the rows repeat the fix before"
        raise InputError(f"{path}: {finding}; set repeat_column to what changes with each new fix")
    _finite(table, lines, () if sigma_m is None else OF_POSITION)
    return fixes_from_columns(
        geodetic_columns(table, lines, reference, scales.angle, scales.length),
        lines,
        str(path),
        scales,
        gps_week,
        sigma_m,
        sigma_velocity,
        geoid_m,
        (*settled.notes, *more),
    )
