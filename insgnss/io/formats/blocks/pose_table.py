"""Positions and poses by names as plain tables, data_specs/pose_table.md: pins and targets of a
tachymeter, antenna positions at exposures, poses of an adjustment (`poses.csv` of insgnss adjust).
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ....base.errors import InputError
from ....geodesy.rotation import CV_RUB, opk_jacobian, rotation_from_opk
from ..text.columns import Aliases, sigma_aliases
from ..text.headers import normalised
from ..text.layout import shown
from ..text.text import Source, TextTable, read_text_table
from .columns import first_repeat, named_columns, positive, rows_of

Array = NDArray[np.float64]

NAMES = (
    *("name", "image", "setup", "point", "label", "id", "target", "photo", "image_name"),
    *("point_id", "point_name", "marker", "station"),
)
POSITIONS: Aliases = {
    "name": NAMES,
    "x": ("x", "e", "east", "easting"),
    "y": ("y", "n", "north", "northing"),
    "z": ("z", "u", "up", "h", "height", "elevation", "alt", "altitude"),
    "lat": ("lat", "latitude"),
    "lon": ("lon", "longitude"),
    "sigma_x": sigma_aliases("x", "e", "east", "easting"),
    "sigma_y": sigma_aliases("y", "n", "north", "northing"),
    "sigma_z": sigma_aliases("z", "u", "up", "h", "height", "elevation"),
    "tow": ("tow", "gpstow", "gps_tow", "time", "gps_time", "sow"),
    "role": ("role", "use", "type", "kind", "aerial_control"),
}
POSES: Aliases = {key: names for key, names in POSITIONS.items() if key not in ("lat", "lon")} | {
    **{angle: (angle,) for angle in ("omega", "phi", "kappa")},
    **{f"sigma_{angle}": sigma_aliases(angle) for angle in ("omega", "phi", "kappa")},
}
ANGLES = ("omega", "phi", "kappa")
UNITS = ("m", "metre", "metres", "meter", "meters", "deg", "degree", "degrees", "s")
SIGMAS = ("sigma_x", "sigma_y", "sigma_z")
FULL_TURN_DEG = 360.0


@dataclass(frozen=True, eq=False)
class NamedPositions:
    """Positions by names.

    Parameters
    ----------
    names : tuple of str
        (n,) names, each once.
    position : ndarray, (n, 3)
        Cartesian coordinates or easting, northing, height, m; of a geodetic table latitude and
        longitude, rad, and height, m.
    geodetic : bool
        Which of both.
    cov : ndarray, (n, 3, 3), or None
        Covariance along the axes, or east, north, up, m^2; None where the table has none.
    time : ndarray, (n,), or None
        Seconds of the GPS week, where the table has them.
    """

    names: tuple[str, ...]
    position: Array
    geodetic: bool = False
    cov: Array | None = None
    time: Array | None = None


@dataclass(frozen=True, eq=False)
class NamedPoses:
    """Poses of cameras by names.

    Parameters
    ----------
    names : tuple of str
        (n,) names, each once.
    position : ndarray, (n, 3)
        Projection centres.
    C_mc : ndarray, (n, 3, 3)
        Camera (x right, y down, z viewing direction) to the table's axes.
    cov : ndarray, (n, 6, 6), or None
        Covariance of position and attitude error psi (rad, table's axes); None where the table has
        none.
    opk : ndarray, (n, 3), or None
        The angles as they stand there, rad.
    """

    names: tuple[str, ...]
    position: Array
    C_mc: Array
    cov: Array | None = None
    opk: Array | None = None


def read_position_table(path: Source) -> NamedPositions:
    """Read a table of positions.

    Parameters
    ----------
    path : path
        The file: a name and x y z, or lat lon h, with standard deviations and `tow` where there
        are.

    Returns
    -------
    NamedPositions
        What it holds.

    Raises
    ------
    InputError
        A column that is unknown, a field that is no number, a standard deviation that is not
        positive, a name that is there twice, or no latitude, with file and line.
    """
    table = read_text_table(path)
    geodetic = "lat" in _header(table)
    required = ("name", "lat", "lon", "z") if geodetic else ("name", "x", "y", "z")
    defaults = (required, (*required, *SIGMAS))
    index = named_columns(table, POSITIONS, required, defaults, UNITS)
    names = _names(table, index["name"])
    position = np.column_stack([table.floats(index[key]) for key in required[1:]])
    if geodetic:
        for key, limit, column in (("lat", 90.0, 0), ("lon", 180.0, 1)):
            values = np.abs(position[:, column])
            if (values > limit).any():
                row = int(np.argmax(values > limit))
                problem = f"{key} {position[row, column]:g} deg (limit {limit:g})"
                raise table.error_at(row, f"{problem}; are latitude and longitude exchanged?")
        position[:, :2] = np.radians(position[:, :2])
    cov = _sigmas(table, index, SIGMAS, "m")
    time = table.floats(index["tow"]) if "tow" in index else None
    return NamedPositions(names, position, geodetic, cov, time)


def read_pose_table(path: Source) -> NamedPoses:
    """Read a table of poses.

    Parameters
    ----------
    path : path
        The file: a name, x y z and omega phi kappa, deg, where Rx(omega) Ry(phi) Rz(kappa) takes
        the right-up-back camera to the axes of x y z; standard deviations where there are.

    Returns
    -------
    NamedPoses
        What it holds.

    Raises
    ------
    InputError
        As `read_position_table`; angles beyond a full turn.
    """
    table = read_text_table(path)
    required = ("name", "x", "y", "z", *ANGLES)
    turned = tuple(f"sigma_{angle}" for angle in ANGLES)
    index = named_columns(table, POSES, required, (required, (*required, *SIGMAS, *turned)), UNITS)
    names = _names(table, index["name"])
    position, degrees = (
        np.column_stack([table.floats(index[key]) for key in keys]) for keys in ("xyz", ANGLES)
    )
    if (np.abs(degrees) > FULL_TURN_DEG).any():
        row, k = np.argwhere(np.abs(degrees) > FULL_TURN_DEG)[0]
        problem = f"{ANGLES[k]} {degrees[row, k]:g} deg (limit {FULL_TURN_DEG:g})"
        raise table.error_at(int(row), f"{problem}; are columns exchanged, or is it in gon?")
    opk = np.radians(degrees)
    P, A = _sigmas(table, index, SIGMAS, "m"), _sigmas(table, index, turned, "deg")
    if (P is None) != (A is None):
        raise table.error_at(
            0, "standard deviations of positions and of angles belong together; give all six"
        )
    cov = None
    if P is not None and A is not None:
        J = opk_jacobian(opk)
        cov = np.zeros((len(names), 6, 6))
        cov[:, :3, :3] = P
        cov[:, 3:, 3:] = J @ (np.radians(1.0) ** 2 * A) @ J.transpose(0, 2, 1)
    return NamedPoses(names, position, rotation_from_opk(opk) @ CV_RUB, cov, opk)


def is_pose_table(path: Source) -> bool:
    """Whether the header of a text table names what `read_pose_table` needs.

    Parameters
    ----------
    path : path
        The file.

    Returns
    -------
    bool
        False of what is no text table, and of EO_local-plane.txt, whose reader is another.
    """
    try:
        fields = _header(read_text_table(path))
    except InputError:
        return False
    own = all(any(name in fields for name in POSES[key]) for key in ("x", *ANGLES))
    named = any(name in fields for name in ("image", "setup", "name"))
    return own and named and "somega" not in fields


def _header(table: TextTable) -> set[str]:
    return {normalised(field)[0] for field in table.layout.header_fields or ()}


def _names(table: TextTable, column: int) -> tuple[str, ...]:
    names, rows = rows_of(table, column, "row")
    if (twice := first_repeat(rows)) is not None:
        first, row = twice
        raise table.error_at(
            row,
            f"{shown(names[rows[row]])} is there twice, before in line {table.lines[first]};"
            " delete one of the lines",
        )
    return names


def _sigmas(
    table: TextTable, index: dict[str, int], keys: Sequence[str], unit: str
) -> Array | None:
    """Return diagonal covariances, None without any of the columns."""
    there = [key in index for key in keys]
    if not any(there):
        return None
    if not all(there):
        lacking = keys[there.index(False)]
        raise table.error_at(0, f"{lacking} is missing beside the other standard deviations")
    sigma = np.column_stack([positive(table, index[key], key, unit) for key in keys])
    return sigma[:, :, None] ** 2 * np.eye(3)
