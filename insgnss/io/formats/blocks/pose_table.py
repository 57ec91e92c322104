"""Positions and poses by names as plain tables, data_specs/pose_table.md: pins and targets of a
tachymeter, antenna positions at exposures, poses of an adjustment (`poses.csv` of insgnss adjust).
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ....base.errors import InputError
from ....geodesy.rotation import CV_RUB, opk_jacobian, rotation_from_opk
from ..names import OF_A_REFERENCE, PLACES, ROLE, Names, sigma_names
from ..text.columns import METRES, NamedTable, TableSpec
from ..text.headers import normalise_header
from ..text.layout import quote
from ..text.order import refuse_rows
from ..text.text import Source, TextTable, read_text_table

Array = NDArray[np.float64]

OPK_NAMES, SIGMAS = "omega phi kappa", "sigma_x sigma_y sigma_z"
TURNED = "sigma_omega sigma_phi sigma_kappa"
POSE_TABLE_UNITS = f"{METRES} deg degree degrees s"
POSE_TABLE_NAMES: Names = {
    "name": "name image setup point label id target photo image_name point_id point_name marker"
    " station",
    **PLACES,
    "z": f"{PLACES['z']} alt altitude",
    "tow": "tow gpstow gps_tow time gps_time sow",
    "role": f"{ROLE['role']} aerial_control",
}


def _spec(names: Names, required: str, sigmas: str, ignored: Names | None = None) -> TableSpec:
    layouts, ignored = (required, f"{required} {sigmas}"), ignored or {}
    return TableSpec(names, required, layouts, text=True, strict=POSE_TABLE_UNITS, ignored=ignored)


GEODETIC_COLUMNS: Names = {
    "lat": "lat latitude lat_deg latitude_deg",
    "lon": "lon longitude lon_deg longitude_deg",
}
CARTESIAN_POSITIONS = _spec(
    POSE_TABLE_NAMES | GEODETIC_COLUMNS, "name x y z", SIGMAS, OF_A_REFERENCE
)
GEODETIC_POSITIONS = _spec(POSE_TABLE_NAMES | GEODETIC_COLUMNS, "name lat lon z", SIGMAS)
POSE_SPEC = _spec(
    POSE_TABLE_NAMES
    | {angle: angle for angle in OPK_NAMES.split()}
    | {f"sigma_{angle}": sigma_names(angle) for angle in OPK_NAMES.split()},
    f"name x y z {OPK_NAMES}",
    f"{SIGMAS} {TURNED}",
)
FULL_TURN_DEG = 360.0  # of an angle: a larger one is in gon, or no angle


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
    whole = read_text_table(path)
    geodetic = "lat" in _columns_of(whole, GEODETIC_POSITIONS)
    table = (GEODETIC_POSITIONS if geodetic else CARTESIAN_POSITIONS).of(whole)
    names = _names(table)
    position = table.block("lat lon z" if geodetic else "x y z")
    if geodetic:
        for key, limit, values in (("lat", 90.0, position[:, 0]), ("lon", 180.0, position[:, 1])):
            problem = f"{key} {{:g}} deg (limit {limit:g}); are latitude and longitude exchanged?"
            refuse_rows(table, np.abs(values) > limit, problem, values)
        position[:, :2] = np.radians(position[:, :2])
    cov = _sigmas(table, SIGMAS, "m")
    time = table.floats("tow") if "tow" in table else None
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
    table = POSE_SPEC.read(path)
    names, position, degrees = _names(table), table.block("x y z"), table.block(OPK_NAMES)
    for angle, values in zip(OPK_NAMES.split(), degrees.T, strict=True):
        problem = (
            f"{angle} {{:g}} deg (limit {FULL_TURN_DEG:g}); are columns exchanged, or is it in"
        )
        refuse_rows(table, np.abs(values) > FULL_TURN_DEG, f"{problem} gon?", values)
    opk = np.radians(degrees)
    P, A = _sigmas(table, SIGMAS, "m"), _sigmas(table, TURNED, "deg")
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
        table = read_text_table(path)
    except InputError:
        return False
    fields = _header(table)
    is_pose = {"x", *OPK_NAMES.split()} <= _columns_of(table, POSE_SPEC)
    named = any(name in fields for name in ("image", "setup", "name"))
    return is_pose and named and "somega" not in fields


def is_position_table(path: Source) -> bool:
    """Whether the header of a text table is that of positions by names, without times.

    Parameters
    ----------
    path : path
        The file.

    Returns
    -------
    bool
        False of what is no text table, and where a column is none that `read_position_table` takes.
    """
    try:
        columns = _columns_of(read_text_table(path), GEODETIC_POSITIONS)
    except InputError:
        return False
    whole = {"name", "x", "y", "z"} <= columns or {"name", "lat", "lon", "z"} <= columns
    return whole and not columns & {None, "tow"}


def _columns_of(table: TextTable, spec: TableSpec) -> set[str | None]:
    """Return the columns that a header names; None for a name that is none of them."""
    return {spec.aliases.get(field) for field in _header(table)}


def _header(table: TextTable) -> set[str]:
    return {normalise_header(field)[0] for field in table.layout.header_fields or ()}


def _names(table: NamedTable) -> tuple[str, ...]:
    names, rows = table.rows_of("name", "row")
    table.refuse_repeats(lambda row: f"{quote(names[rows[row]])} is there twice", rows)
    return names


def _sigmas(table: NamedTable, names: str, unit: str) -> Array | None:
    """Return diagonal covariances, None without any of the columns."""
    lacking = [name for name in names.split() if name not in table]
    if len(lacking) == len(names.split()):
        return None
    if lacking:
        message = f"{lacking[0]} is missing among the standard deviations; give all six or none"
        raise table.error_at(0, message)
    return table.positive(names, unit)[:, :, None] ** 2 * np.eye(3)
