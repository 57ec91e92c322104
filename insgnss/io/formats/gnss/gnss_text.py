"""Antenna positions as a text table: `tow lat lon h [sd_n sd_e sd_u [Q]]`, data_specs/gnss_text.md.

Latitude and longitude in degrees, heights above the ellipsoid and standard deviations along north,
east and up in m, unless the caller or the header says another unit, in brackets or behind the name
(`headers`); where both give one and they differ, a note says so. Correlations have no place in this
format; RTKLIB's .pos has one for them.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ....base.files import atomic_write
from ....records import Finding, GnssFixes
from ....records.observations import OF_THE_SOLUTION
from ..orientation.exported import quoted_names
from ..text.columns import (
    FINE,
    TIME,
    Aliases,
    Columns,
    clock_of_dates,
    columns_of,
    fields_of,
    sigma_aliases,
)
from ..text.headers import Kinds, normalised, settled_units
from ..text.order import open_end
from ..text.text import Source, Table, format_rows, read_table
from ..text.units import check_units
from .fixes import SIGMA, VELOCITY, VELOCITY_SIGMA, FixScales, fixes_from_columns
from .heights import settled_undulation

Array = NDArray[np.float64]

REQUIRED = ("tow", "lat", "lon", "h")
UNIT_COLUMNS = {
    "angle": ("lat", "lon"),
    "time": ("tow",),
    "length": ("h", *SIGMA, "sd_ne"),
    "velocity": (*VELOCITY, *VELOCITY_SIGMA, "speed"),
    "course": ("course",),
}
UNIT_KINDS = {key: "angle" if key == "course" else key for key in UNIT_COLUMNS}
UNIT_KEYS = (*UNIT_COLUMNS, "quality")
KINDS: Kinds = {name: (UNIT_KINDS[key],) for key, names in UNIT_COLUMNS.items() for name in names}
DEFAULTS = (
    REQUIRED,
    (*REQUIRED, *SIGMA),
    (*REQUIRED, *SIGMA, "q"),
    (*REQUIRED, *SIGMA, "vn", "ve", "vd", *VELOCITY_SIGMA),  # KF-GINS, positions and velocities
    # KF-GINS, navigation result (.nav)
    ("week", *REQUIRED, "vn", "ve", "vd", "roll", "pitch", "yaw"),
)
ALIASES: Aliases = {
    **TIME,
    "lat": ("lat", "latitude", "lat_deg", "phi_deg", "b"),
    "lon": ("lon", "long", "lng", "longitude", "lon_deg", "lambda", "l"),
    "h": (
        "h",
        "height",
        "ellheight",
        "ell_height",
        "ellipsoid_height",
        "ellipsoidal_height",
        "alt",
        "altitude",
        "hgt",
        "h_ell",
        "h_m",
        "up_ell",
    ),
    "sd_n": sigma_aliases("n", "north", "lat", "latitude", "n_m"),
    "sd_e": sigma_aliases("e", "east", "lon", "longitude", "e_m"),
    "sd_u": sigma_aliases("u", "up", "d", "down", "h", "height", "alt", "u_m"),
    **dict.fromkeys(("sd_ne", "var_n", "var_e", "var_u"), ()),  # only `columns` can name these
    **FINE,
    **dict.fromkeys(OF_THE_SOLUTION, ()),  # of a header: `_described`
    "q": ("q", "quality", "fix_quality"),
    "vn": ("vn", "v_n", "vel_n", "v_north", "north_velocity", "velocity_north", "vnorth"),
    "ve": ("ve", "v_e", "vel_e", "v_east", "east_velocity", "velocity_east", "veast"),
    "vd": ("vd", "v_d", "vel_d", "v_down", "down_velocity", "velocity_down", "vdown"),
    "vu": ("vu", "v_u", "vel_u", "v_up", "up_velocity", "velocity_up", "vup"),
    "sd_vn": sigma_aliases("vn", "v_n", "vel_n"),
    "sd_ve": sigma_aliases("ve", "v_e", "vel_e"),
    "sd_vd": sigma_aliases("vd", "v_d", "vel_d", "vu", "v_u", "vel_u"),
    "speed": ("speed", "spd", "ground_speed", "gndspd", "gnd_speed", "sog", "hspeed"),
    "course": ("course", "cog", "gcrs", "track", "course_over_ground", "ground_course"),
}
DESCRIBED = {
    **dict.fromkeys(("ns", "nsat", "nsats", "n_sat", "num_sat", "num_sats", "nsv"), "satellites"),
    **dict.fromkeys(("numsv", "num_sv", "satellites", "sats", "n_satellites"), "satellites"),
    **dict.fromkeys(("ratio", "ar_ratio"), "ratio"),
    **dict.fromkeys(("age", "age_s", "diff_age"), "age_s"),
    **{"pdop": "pdop", "hdop": "hdop"},
}


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


def read_gnss_text(
    path: Source,
    columns: Columns = None,
    sigma_m: ArrayLike | None = None,
    gps_week: int | None = None,
    sigma_velocity: ArrayLike | None = None,
    units: Mapping[str, str] | None = None,
    undulation_m: float | None = None,
) -> GnssFixes:
    """Read antenna positions, and velocities where the file has them.

    In `columns`, sd_ne with sd_u stands for sd_n and sd_e alike, and var_n var_e var_u for the
    squares of sd_n sd_e sd_u.

    Parameters
    ----------
    path : path
        The file.
    columns : sequence or mapping, optional
        Name of each column out of the keys of `ALIASES`; any other name leaves a column out; or a
        table of them to the header's.
    sigma_m, sigma_velocity : array_like, optional
        Standard deviations north, east, down where the file has none, m and m/s.
    gps_week : int, optional
        The week, where no column holds it.
    units : mapping, optional
        Units of "angle" (latitude and longitude: deg, rad), "time", "length", "velocity", "course"
        (deg, rad) and "quality" (rtklib, nmea). A note reports a header's own unit that is another.
    undulation_m : float, optional
        Geoid above the ellipsoid, m, added to heights that are above the geoid (`heights`).

    Returns
    -------
    GnssFixes
        The fixes.

    Raises
    ------
    InputError
        A bad value, with file and line, or no standard deviation at all.
    """
    units = check_units(units, UNIT_KEYS)
    table = read_table(path, whole=False)
    index = columns_of(table, ALIASES, REQUIRED, DEFAULTS, columns, KINDS)
    units, date_notes = clock_of_dates(table, index, units, "GNSS rows")
    fields = {key: fields_of(table.layout, index, names) for key, names in UNIT_COLUMNS.items()}
    scales, unit_notes = fix_scales(str(path), table.layout.header_line, fields, units)
    header_line, of_height = table.layout.header_line, fields_of(table.layout, index, ("h",))
    geoid_m, height_notes = settled_undulation(
        path, header_line, of_height, undulation_m, commented=True
    )
    index = {**_described(table, index), **index}
    cols = {name: np.ascontiguousarray(table.values[:, i]) for name, i in index.items()}
    notes = (*open_end("GNSS rows", table.complete), *unit_notes, *date_notes, *height_notes)
    return fixes_from_columns(
        cols, table, str(path), scales, gps_week, sigma_m, sigma_velocity, geoid_m, notes
    )


def _described(table: Table, index: Mapping[str, int]) -> dict[str, int]:
    """Return the first column of each of `OF_THE_SOLUTION` that the header names.

    They weigh nothing, so that one of text alone is passed over; text among numbers is refused.
    """
    index_of: dict[str, int] = {}
    for k, field in enumerate(table.layout.header_fields or ()):
        name = DESCRIBED.get(normalised(field)[0])
        if name is None or k in index.values() or k in table.dates:
            continue
        if k not in table.bad:
            index_of.setdefault(name, k)
        elif np.isfinite(table.values[:, k]).any():
            table.refuse_text([k])
    return index_of


def fix_scales(
    path: str, line: int | None, fields: Mapping[str, Sequence[str]], units: Mapping[str, str]
) -> tuple[FixScales, tuple[Finding, ...]]:
    """Settle the units of fixes: the caller's, else those that the header gives, else the defaults.

    Parameters
    ----------
    path : str
        The file, for messages.
    line : int, optional
        The header's line.
    fields : mapping
        What the file calls the columns of each of `UNIT_COLUMNS`.
    units : mapping
        The caller's units; deg, m, m/s and s where neither says.

    Returns
    -------
    FixScales
        The factors.
    tuple of Finding
        A note for each of the caller's units where the fields give another one.

    Raises
    ------
    InputError, UsageError
        A unit that is none, with `path` and `line`.
    """
    taken, factors, notes = settled_units(
        path, line, UNIT_COLUMNS, UNIT_KINDS, fields, units, "GNSS"
    )
    scales = FixScales(
        angle=factors["angle"],
        length=factors["length"],
        velocity=factors["velocity"],
        course=factors["course"],
        time=taken["time"],
        quality=units.get("quality", "rtklib"),
    )
    return scales, notes


def write_gnss_text(fixes: GnssFixes, path: Source) -> None:
    """Write antenna positions (AntennaPos_WGS84.txt): degrees with 10 decimals, m with 4.

    Correlations are left out.
    """
    sigma = np.sqrt(np.diagonal(fixes.cov_ned, axis1=1, axis2=2))
    head = ["tow[s]", "lat[deg]", "lon[deg]", "h[m]", *(f"{name}[m]" for name in SIGMA)]
    form = "%.6f %.10f %.10f %.4f" + " %.5f" * 3
    parts = [fixes.time, np.degrees(fixes.lat), np.degrees(fixes.lon), fixes.height, sigma]
    if fixes.quality is not None:
        head, form = [*head, "Q"], form + " %d"
        parts.append(fixes.quality)
    if fixes.velocity_ned is not None and fixes.velocity_cov_ned is not None:
        head += [f"{name}[m/s]" for name in ("vn", "ve", "vd", *VELOCITY_SIGMA)]
        form += " %.5f" * 6
        parts += [
            fixes.velocity_ned,
            np.sqrt(np.diagonal(fixes.velocity_cov_ned, axis1=1, axis2=2)),
        ]
    atomic_write(
        path, ["# " + " ".join(head) + "\n", *format_rows(form + "\n", np.column_stack(parts))]
    )


def write_image_positions(positions: ImagePositions, path: Source) -> None:
    """Write antenna positions at exposures.

    By their frame this is AntennaPos_Img_WGS84.txt or AntennaPos_Img_WGS84_tangentplane.txt.
    """
    images = quoted_names(positions.images, None)
    geodetic = positions.frame == "geodetic"
    head = "# image lat[deg] lon[deg] h[m]\n" if geodetic else "# image e[m] n[m] u[m]\n"
    form = "%s %.10f %.10f %.4f\n" if geodetic else "%s %.4f %.4f %.4f\n"
    values = positions.position * (
        [180.0 / np.pi, 180.0 / np.pi, 1.0] if geodetic else [1.0, 1.0, 1.0]
    )
    atomic_write(
        path,
        [
            head,
            *(form % (name, *row) for name, row in zip(images, values.tolist(), strict=True)),
        ],
    )
