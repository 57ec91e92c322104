"""Gyros and accelerometers in text files of their own: each half found, and both joined.

Loggers of telephones write a file a sensor, with columns x, y, z and one clock or two. What the
columns are the names say, or the unit of the header, or, for x y z without either, the name of the
file. Accelerations from which the device took gravity, and its estimate of gravity alone, are none
of an accelerometer: the one has no steady size, the other has nothing else.
"""

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from ....base.errors import InputError
from ....io.formats.text.headers import factor_of, kinds_like, unit_in
from ..sources import InputSource, Role
from .clocks import clocks, fraction_of, week_column
from .grids import GridTable
from .names import ACCEL, GYRO, Roles, UnknownTable, squash_name

TRIAD_COLUMNS: dict[Role, tuple[str, str, str]] = {"gyro": GYRO, "accel": ACCEL}
IN_NAME: dict[Role, tuple[str, ...]] = {  # of a file
    "gyro": ("gyr", "angularvel", "rotationrate", "turnrate"),
    "accel": ("acc",),
}
TRIAD_NAMES: dict[Role, str] = {"gyro": "gyros", "accel": "accelerometers"}
LACKS: dict[Role, str] = {"gyro": "accelerometers", "accel": "gyros"}
TEXT = {".csv", ".txt", ".dat", ".tsv", ".log", ""}
# scatter of the size of a force, in its median: of gravity, of an estimate
HALF_SCATTER, EXACT_SHARE = 0.5, 1e-5


def half_of_imu(
    path: Path, table: GridTable, source_of: Callable[[Roles], InputSource]
) -> list[InputSource]:
    """Return the gyros or the accelerometers of a table that has one of them and a clock.

    Parameters
    ----------
    path : Path
    table : GridTable
    source_of : function
        Makes samples of columns.

    Raises
    ------
    InputError
        For accelerations without gravity, and for gravity alone.
    """
    if path.suffix.lower() not in TEXT or table.variable is not None:
        return []
    triad = _triad(path, table.grid)
    ticks = clocks(table.grid, 0.5)
    if triad is None or not ticks:
        return []
    role, columns = triad
    values = table.grid.values[:, list(columns.values())]
    if not np.isfinite(values).all():
        return []
    if role == "accel":
        _refuse_without_gravity(path, values)
    description = f"{TRIAD_NAMES[role]} alone, {len(values)} rows"
    sources = []
    for clock, unit in ticks.items():
        source = source_of(Roles(columns, {clock: unit}, week_column(table.grid)))
        indices = {"tow": clock, **fraction_of(table.grid, clock), **columns}
        fields = {name: table.fields[k] for name, k in indices.items() if k is not None}
        sources.append(replace(source, role=role, what=description, fields=fields))
    return [replace(sources[0], other_clocks=tuple(sources[1:]))]


def _triad(path: Path, grid: UnknownTable) -> tuple[Role, dict[str, int]] | None:
    """Role and columns of the one triad of a table; None where there is none, or two."""
    triads = [(role, columns) for role in TRIAD_COLUMNS if (columns := grid.triad(role))]
    if triads:
        return triads[0] if len(triads) == 1 else None
    named = grid.named
    if not all(letter in named for letter in "xyz"):
        return None
    places = [named[letter] for letter in "xyz"]
    for role, canonical in TRIAD_COLUMNS.items():
        units = [unit_in(grid.names[k] or "", kinds_like(role)) for k in places]
        if all(unit and factor_of(unit, (role,)) is not None for unit in units):
            return role, dict(zip(canonical, places, strict=True))
    if any("(" in (grid.names[k] or "") or "[" in (grid.names[k] or "") for k in places):
        return None  # a unit of something else
    stem = squash_name(path.stem)
    by_name = [role for role, stems in IN_NAME.items() if any(one in stem for one in stems)]
    if len(by_name) != 1:
        return None
    return by_name[0], dict(zip(TRIAD_COLUMNS[by_name[0]], places, strict=True))


def _refuse_without_gravity(path: Path, force: Any) -> None:
    """Refuse accelerations from which gravity was taken, and gravity alone."""
    size = np.linalg.norm(force, axis=1)
    spread = float(np.std(size) / max(float(np.median(size)), 1e-12))
    steadiness = float(np.linalg.norm(np.mean(force, axis=0)) / max(float(np.median(size)), 1e-12))
    if spread < EXACT_SHARE:
        raise InputError.in_file(
            path,
            f"{size[0]:g} in every row: gravity computed by the device, not measured",
        )
    if spread > HALF_SCATTER and steadiness < HALF_SCATTER:
        raise InputError.in_file(
            path,
            f"accelerations without gravity (median size {np.median(size):.3g}, relative scatter "
            f"{spread:.2g}), such as a telephone's linear acceleration; take its accelerometer "
            "file with gravity (TotalAcceleration, raw or uncalibrated)",
        )


def of_two_halves(
    gyros: tuple[InputSource, ...], accels: tuple[InputSource, ...]
) -> InputSource | None:
    """Join gyros and accelerometers of two files to one source of samples.

    Parameters
    ----------
    gyros, accels : tuple of InputSource
        The candidates; raw ones ("uncalibrated") count where there are no others.

    Returns
    -------
    InputSource or None
        None without any.

    Raises
    ------
    InputError
        Where one of the two is missing, where there are several, and where no column of time has
        the same name in both.
    """
    if not gyros and not accels:
        return None
    sensors = gyros or accels
    if not gyros or not accels:
        raise InputError.in_file(
            sensors[0].path,
            f"{sensors[0].what}: {LACKS[sensors[0].role]} are missing; give their file as well, "
            "put both sensors into one table, or name the columns gx gy gz and ax ay az",
        )
    gyro, accel = (_calibrated_source(sources) for sources in (gyros, accels))
    pairs = [
        (g, a)
        for g in (gyro, *gyro.other_clocks)
        for a in (accel, *accel.other_clocks)
        if _clock(g) == _clock(a)
    ]
    if not pairs:
        raise InputError.in_file(
            accel.path,
            f"no time column is named as in {gyro.path.name}, in the same unit; name both time",
        )
    first, *further = (_pair(g, a) for g, a in pairs)
    return replace(first, other_clocks=tuple(further))


def _calibrated_source(sources: tuple[InputSource, ...]) -> InputSource:
    """The one source of a sensor; of several the one that is not called raw."""
    usual = [source for source in sources if "uncalibrated" not in source.path.stem.lower()]
    chosen = usual or list(sources)
    if len(chosen) > 1:
        names = ", ".join(source.title for source in chosen)
        triad = TRIAD_NAMES[chosen[0].role]
        raise InputError(f"{len(chosen)} files of {triad}: {names}; name one of them")
    return chosen[0]


def _clock(source: InputSource) -> tuple[str, Any]:
    """Name and unit of the column of time."""
    return source.fields["tow"], source.keys.get("units", {}).get("time")


def _pair(gyro: InputSource, accel: InputSource) -> InputSource:
    """Samples of two files as the flight file names them."""
    keys: dict[str, Any] = {"accel_file": accel.path}
    if "columns" in gyro.keys or "columns" in accel.keys:
        keys["columns"] = gyro.fields | accel.fields
    units = {**accel.keys.get("units", {}), **gyro.keys.get("units", {})}
    if units:
        keys["units"] = units
    header = {**(gyro.header_units or {}), **(accel.header_units or {})}
    description = f"{gyro.what}, with {TRIAD_NAMES[accel.role]} of {accel.path.name}"
    return InputSource(
        "imu",
        gyro.path,
        description,
        keys,
        {**accel.why, **gyro.why},
        gyro.span,
        header_units=header,
        columns_left_out=gyro.columns_left_out,
    )
