"""Antenna positions as a text table: `tow lat lon h [sd_n sd_e sd_u [Q]]`, data_specs/gnss_text.md.

Latitude and longitude in degrees, heights above the ellipsoid and standard deviations along north,
east and up in m, unless the caller or the header says another unit, in brackets or behind the name
(`headers`); where both give one and they differ, a note says so. Correlations have no place in this
format; RTKLIB's .pos has one for them.
"""

from collections.abc import Collection, Mapping
from dataclasses import dataclass, replace

import numpy as np

from ....records import Array, Finding, GnssFixes
from ....records.observations import OF_THE_SOLUTION
from ..names import GNSS, OF_A_SOLUTION, taken_by_readers
from ..orientation.exported import quoted_names
from ..read_options import STATED_NOTHING, ReadOptions
from ..text.columns import NamedTable, TableOut, TableSpec, place_of
from ..text.headers import Settled, factor_of, normalise_header, unit_in
from ..text.order import Lines, Picked, note
from ..text.text import NumberTable, Source, read_table
from .cartesian import position_columns, reference_in
from .fixes import (
    FIX_SIGMAS,
    FIX_VELOCITIES,
    OF_POSITION,
    VELOCITY_SIGMA,
    FixScales,
    fixes_from_columns,
    new_fixes,
)
from .heights import settled_undulation

SIGMA_NAMES, SPEED_SIGMAS = " ".join(FIX_SIGMAS), " ".join(VELOCITY_SIGMA)
SIGMAS_M = f"{SIGMA_NAMES} sd_ne sd_x sd_y sd_z"
REQUIRED = "tow lat lon h"
SPEC = TableSpec(
    GNSS | dict.fromkeys(OF_THE_SOLUTION, ""),  # the last are of a header: `_solution_columns`
    required=REQUIRED,
    layouts=(
        REQUIRED,
        f"{REQUIRED} {SIGMA_NAMES}",
        f"{REQUIRED} {SIGMA_NAMES} q",
        f"{REQUIRED} {SIGMA_NAMES} vn ve vd {SPEED_SIGMAS}",  # KF-GINS, positions and velocities
        f"week {REQUIRED} vn ve vd roll pitch yaw",  # KF-GINS, navigation result (.nav)
    ),
    units={
        "angle": "lat lon",
        "time": "tow",
        "length": "h x y z north east down up",
        "sigma": SIGMAS_M,
        "velocity": f"{' '.join(FIX_VELOCITIES)} {SPEED_SIGMAS} sd_v speed",
        "course": "course",
    },
    record="GNSS",
)
DESCRIBED = {
    name: canonical for canonical, row in OF_A_SOLUTION.items() for name in taken_by_readers(row)
}
OUT = TableOut(
    "tow[s]=%.6f lat[deg]=%.10f lon[deg]=%.10f h[m]=%.4f sd_n[m]=%.5f sd_e[m]=%.5f sd_u[m]=%.5f",
    " ",
)
OUT_SPEED = "vn[m/s]=%.5f ve[m/s]=%.5f vd[m/s]=%.5f sd_vn[m/s]=%.5f sd_ve[m/s]=%.5f sd_vd[m/s]=%.5f"


@dataclass(frozen=True, eq=False)
class ImagePositions:
    """Antenna positions at exposures.

    Attributes
    ----------
    images : tuple of str
        Image names.
    position : ndarray
        (n, 3) latitude rad, longitude rad, height m; or east, north, up m of a tangent plane.
    frame : {"geodetic", "tangent_plane"}
        Which of both.
    """

    images: tuple[str, ...]
    position: Array
    frame: str  # "geodetic" | "tangent_plane"


def read_gnss_text(path: Source, options: ReadOptions = STATED_NOTHING) -> GnssFixes:
    """Read antenna positions, and velocities where the file has them.

    In `columns`, sd_ne with sd_u stands for sd_n and sd_e alike, sd_v for sd_vn, sd_ve and sd_vd,
    and var_n var_e var_u for the squares of sd_n sd_e sd_u.

    Parameters
    ----------
    path : path
        The file.
    options : ReadOptions
        `columns` of the keys of `GNSS`; `units` of "angle" (latitude and longitude: deg, rad),
        "time", "length", "sigma" (of positions), "velocity", "course" (deg, rad) and "quality"
        (rtklib, nmea);
        `undulation_m`, added to heights that are above the geoid (`heights`); `reference`, else
        that of a comment; `repeat_column`, whose changes are new fixes.

    Returns
    -------
    GnssFixes
        The fixes.

    Raises
    ------
    InputError
        A bad value, with file and line, or no standard deviation at all.
    """
    columns, units = options.columns, SPEC.checked_units(options.units, "quality")
    rows = read_table(path, whole=False)
    fields = SPEC.named(rows.layout.header_fields or ()) if columns is None else columns
    table = spec_of(fields).of(rows, columns, () if options.sigma_m is None else OF_POSITION)
    vertical = _vertical_angle(table)
    settled = table.settled(units, unheeded=["sd_u"] if vertical else [])
    header_line = table.table.layout.header_line
    geoid_m, height_notes = settled_undulation(
        path, header_line, table.fields("h"), options.undulation_m, commented=True
    )
    cols = replace(table, index={**_solution_columns(table), **table.index}).numbers()
    lines: Lines = table
    if (mark := options.repeat_column) is not None:
        assert isinstance(table.table, NumberTable)
        marks = table.table.floats(place_of(str(path), rows.layout, mark))
        taken = new_fixes(path, mark, marks)
        lines, cols = Picked(table, taken), {name: x[taken] for name, x in cols.items()}
    scales = fix_scales(settled, units)
    if options.reference is None and "north" in table:
        options = replace(options, reference=reference_in(path))
    notes = (*settled.notes, *vertical, *height_notes)
    return fixes_from_columns(cols, lines, scales, options, geoid_m, notes)


def spec_of(names: Collection[str | None]) -> TableSpec:
    """Return the specification of a table with these columns, by what its position stands in."""
    return replace(SPEC, required=f"tow {' '.join(position_columns(names))}")


def _vertical_angle(table: NamedTable) -> tuple[Finding, ...]:
    """Return the note on a vertical sigma whose header gives an angle for its unit, as phyphox's.

    It is in the unit of the height then: along the vertical there is no angle.
    """
    fields = table.fields("sd_u")
    unit = unit_in(fields[0], ()) if fields else None
    if unit is None or factor_of(unit, ("angle",)) is None:
        return ()
    finding = f"the header gives {fields[0]} in {unit!r}; it was read in the unit of the height"
    return (note("GNSS units", finding, "a length", "correct the header"),)


def _solution_columns(named: NamedTable) -> dict[str, int]:
    """Return the first column of each of `OF_THE_SOLUTION` that the header names.

    They weigh nothing, so that one of text alone is passed over and an empty field is unknown; text
    among numbers is refused.
    """
    table, index_of = named.table, dict[str, int]()
    assert isinstance(table, NumberTable)
    for k, field in enumerate(table.layout.header_fields or ()):
        name = DESCRIBED.get(normalise_header(field)[0])
        if name is None or k in named.index.values() or k in table.dates:
            continue
        if k not in table.bad or 0 < table.blank.get(k, 0) < len(table):
            index_of.setdefault(name, k)
        elif np.isfinite(table.values[:, k]).any():
            table.refuse_text([k])
    return index_of


def fix_scales(settled: Settled, units: Mapping[str, str]) -> FixScales:
    """Return the scales of settled units, with the caller's codes of quality.

    Parameters
    ----------
    settled : Settled
        The caller's units, else those that the header gives; deg, m, m/s and s where neither says.
        Standard deviations are in the unit of heights where they have none of their own.
    units : mapping
        The caller's units.
    """
    keys = ("angle", "length", "sigma", "velocity", "course")
    factors = {key: settled.factors[key] for key in keys}
    time, quality = settled.units["time"], units.get("quality", "rtklib")
    return FixScales(**factors, time=time, quality=quality)


def write_gnss_text(fixes: GnssFixes, path: Source) -> None:
    """Write antenna positions (AntennaPos_WGS84.txt): degrees with 10 decimals, m with 4.

    Correlations are left out.
    """
    sigma = np.sqrt(np.diagonal(fixes.cov_ned, axis1=1, axis2=2))
    out = OUT
    parts = [fixes.time, np.degrees(fixes.lat), np.degrees(fixes.lon), fixes.height, sigma]
    if fixes.quality is not None:
        out, parts = out.with_columns("Q=%d"), [*parts, fixes.quality]
    if fixes.velocity_ned is not None and fixes.velocity_cov_ned is not None:
        out = out.with_columns(OUT_SPEED)
        speed_sigma = np.sqrt(np.diagonal(fixes.velocity_cov_ned, axis1=1, axis2=2))
        parts += [fixes.velocity_ned, speed_sigma]
    out.write(path, np.column_stack(parts))


def write_image_positions(positions: ImagePositions, path: Source) -> None:
    """Write antenna positions at exposures.

    By their frame this is AntennaPos_Img_WGS84.txt or AntennaPos_Img_WGS84_tangentplane.txt.
    """
    images = quoted_names(positions.images, None)
    columns, factors = "e[m]=%.4f n[m]=%.4f u[m]=%.4f", np.ones(3)
    if positions.frame == "geodetic":
        columns = "lat[deg]=%.10f lon[deg]=%.10f h[m]=%.4f"
        factors = np.array([180.0 / np.pi, 180.0 / np.pi, 1.0])
    TableOut(f"image {columns}", " ").write(path, positions.position * factors, images)
