"""Ground points as a plain table, data_specs/ground_points.md."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from ....base.errors import UsageError, near
from ....base.units import METRE
from ....geodesy.crs import is_geographic
from ....geodesy.datums import geodetic_from_geographic
from ....geodesy.frames import TangentPlane
from ....geodesy.projection import MapProjection
from ....records.block import UNKNOWN_M
from ..names import OF_A_REFERENCE, PLACES, ROLE
from ..orientation.exported import quoted_names
from ..origins import stated_plane
from ..text.columns import METRES, Columns, NamedTable, TableOut, TableSpec
from ..text.layout import quote
from ..text.order import refuse_rows
from ..text.text import Source, TextTable

Array = NDArray[np.float64]

SIGMAS = "sigma_x sigma_y sigma_z"
POINT_COLUMNS = f"point x y z {SIGMAS}"
SPEC = TableSpec(
    {"point": "point point_id point_name id name label marker", **PLACES, **ROLE},
    required=POINT_COLUMNS,
    layouts=(f"{POINT_COLUMNS} role", POINT_COLUMNS),
    text=True,
    strict=METRES,
    ignored=OF_A_REFERENCE,
)
OUT = TableOut("point x=%.4f y=%.4f z=%.4f sigma_x=%.5f sigma_y=%.5f sigma_z=%.5f role")
ROLES = ("control", "check")
NOT_KNOWN = ("", "-")  # in the place of a coordinate


@dataclass(frozen=True, eq=False)
class GroundTable:
    """Points on the ground, by names.

    Parameters
    ----------
    points : tuple of str
        Names, each once.
    position_m : ndarray
        (n, 3) coordinates, m; of points in a projected CRS in its unit.
    cov : ndarray
        (n, 3, 3) covariance, m^2.
    check : ndarray of bool
        (n,) which are check points; the others are control points.
    sigma_in_units : bool
        Whether `cov` stands in the unit of the coordinates, as in tables, where that is feet.
    """

    points: tuple[str, ...]
    position_m: Array
    cov: Array
    check: NDArray[np.bool_]
    sigma_in_units: bool = False

    def metric(self, axes: "GroundAxes") -> "GroundTable":
        """Return the points with their covariance in m^2, their coordinates as they are.

        Parameters
        ----------
        axes : GroundAxes
            The CRS of `position_m`.

        Returns
        -------
        GroundTable
            The same points.
        """
        if not self.sigma_in_units:
            return self
        cov = self.cov * axes.unit_m[:, None] * axes.unit_m
        return replace(self, cov=cov, sigma_in_units=False)

    def in_plane(self, axes: "GroundAxes", plane: TangentPlane) -> "GroundTable":
        """Return points of a CRS in a tangent plane.

        Parameters
        ----------
        axes : GroundAxes
            The CRS of `position_m`.
        plane : TangentPlane
            The axes of the block.

        Returns
        -------
        GroundTable
            The same points; covariances are turned from the axes of the grid, or from east, north,
            up at each point of a geographic CRS.

        Raises
        ------
        InputError
            Where the CRS or its grids do not reach the points, or a grid is not installed.
        UsageError
            A CRS that is not conformal or counts in left-handed axes.
        """
        lat, lon, h = axes.geodetic(self.position_m)
        enu_from_ned = np.array([[0.0, 1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, -1.0]])
        C = plane.C_mn(lat, lon) @ enu_from_ned.T
        if axes.plane is not None:
            C = (plane.C_em.T @ axes.plane.C_em)[None]
        if axes.projection is not None:
            C = C @ axes.projection.axes(lat, lon, h).transpose(0, 2, 1)
        table = self.metric(axes)
        return replace(
            table,
            position_m=plane.position_from_geodetic(lat, lon, h),
            cov=C @ table.cov @ C.transpose(0, 2, 1),
        )


@dataclass(frozen=True)
class GroundAxes:
    """The CRS in which ground points stand.

    Parameters
    ----------
    crs : str
        Projected or geographic, as `MapProjection` takes its definition, or the origin of a tangent
        plane as of `stated_plane`.
    geoid : Path, optional
        Grid of geoid heights, for heights above sea level.
    datum, epoch : optional
        Of the tangent plane's positions; None: WGS 84.

    Raises
    ------
    UsageError
        A CRS that is unknown, or a geoid beside heights of its own or of a tangent plane.
    """

    crs: str
    geoid: Path | None = None
    datum: str | None = None
    epoch: float | None = None

    @cached_property
    def plane(self) -> TangentPlane | None:
        """The tangent plane; None of a CRS."""
        plane = stated_plane(self.crs)
        if plane is not None and self.geoid is not None:
            raise UsageError("heights of a tangent plane need no geoid; leave it out")
        return plane

    @cached_property
    def projection(self) -> MapProjection | None:
        """The projected CRS; None of a geographic one, or a tangent plane."""
        if self.plane is not None or is_geographic(self.crs):
            return None
        return MapProjection(self.crs, self.geoid, self.datum, self.epoch, any_unit=True)

    @property
    def unit_m(self) -> Array:
        """(3,) metres of one unit of easting, northing and height; 1 of a geographic CRS."""
        return np.ones(3) if self.projection is None else self.projection.unit_m

    @property
    def unit_note(self) -> str:
        """What to know of a CRS that counts in feet; empty of one in metres."""
        if self.projection is None or self.projection.units == (METRE, METRE):
            return ""
        plan, height = (unit.plural for unit in self.projection.units)
        units = plan if plan == height else f"{plan}, heights in {height}"
        return f"{self.projection.name} counts in {units}: ground points are read so"

    def geodetic(self, position: Array) -> tuple[Array, Array, Array]:
        """Return the geodetic position of points.

        Parameters
        ----------
        position : ndarray, (n, 3)
            Easting, northing and height in the unit of the CRS; of a geographic CRS longitude,
            latitude, deg, height; of a tangent plane east, north, up.

        Returns
        -------
        tuple of ndarray
            Latitude and longitude, rad, height above the ellipsoid, m, each (n,).

        Raises
        ------
        InputError
            Where the CRS or its grids do not reach the points.
        """
        if self.plane is not None:
            return self.plane.geodetic_from_position(position)
        if self.projection is not None:
            return self.projection.inverse(position * self.unit_m)
        return geodetic_from_geographic(self.crs, position, self.geoid, self.datum, self.epoch)


def read_ground_points(path: Source, columns: Columns = None) -> GroundTable:
    """Read a table of ground points.

    Parameters
    ----------
    path : path
        The file.
    columns : sequence or mapping, optional
        As of `text.columns.TableSpec.index`; columns that it leaves out are not read.

    Returns
    -------
    GroundTable
        The points; without a column of roles all are control points.

    Raises
    ------
    InputError
        A column that is unknown, a field that is no number, a standard deviation that is not
        positive, a role that is none, or a point that is there twice, with file and line.
    """
    table, unknown = _fill_unknown(SPEC.read(path, columns))
    points, rows = table.rows_of("point", "point")
    table.refuse_repeats(lambda row: f"point {quote(points[rows[row]])} is there twice", rows)
    position, sigma = table.block("x y z"), table.positive(SIGMAS, "m")
    roles = [role.lower() for role in table.strings("role")] if "role" in table else []
    for row, role in enumerate(roles):
        if role not in ROLES:
            raise table.error_at(row, f"role {quote(role)}; {near(role, ROLES)}")
    check = np.array([role == "check" for role in roles] or [False] * len(rows), dtype=bool)
    refuse_rows(
        table,
        check & unknown.any(axis=1),
        "a check point needs all its coordinates; make it control, or leave it out",
    )
    for axes, name in ((slice(0, 2), "plan"), (slice(2, 3), "height")):
        if unknown[:, axes].all() and len(points):
            raise table.error_at(0, f"no point has a {name}; give that of one, at least roughly")
        somewhere = np.median(position[~unknown[:, axes.start]][:, axes], axis=0)
        position[unknown[:, axes.start], axes] = somewhere
    return GroundTable(points, position, sigma[:, :, None] ** 2 * np.eye(3), check, True)


def _fill_unknown(table: NamedTable) -> tuple[NamedTable, NDArray[np.bool_]]:
    """Return a table with numbers in the place of coordinates that are not known, and which (n, 3).

    Raises
    ------
    InputError
        Easting without northing, or no coordinate at all, with file and line.
    """
    assert isinstance(table.table, TextTable)
    rows, unknown = [list(row) for row in table.table.rows], np.zeros((len(table), 3), dtype=bool)
    for k, row in enumerate(rows):
        for column, name in enumerate("xyz"):
            if row[table.index[name]].strip(" \"'") in NOT_KNOWN:
                unknown[k, column] = True
                row[table.index[name]], row[table.index[f"sigma_{name}"]] = "0", f"{UNKNOWN_M:g}"
    none = np.asarray(unknown.all(axis=1))
    refuse_rows(table, none, "no coordinate; give plan or height, or leave it out")
    one = np.asarray(unknown[:, 0] != unknown[:, 1])
    refuse_rows(table, one, "one of x and y alone; leave both empty where the plan is not known")
    return replace(table, table=replace(table.table, rows=rows)), unknown


def write_ground_points(ground: GroundTable, path: Source, comments: Sequence[str] = ()) -> None:
    """Write a table of ground points: coordinates with 4 decimals, standard deviations with 5.

    Correlations of coordinates are not written.

    Parameters
    ----------
    ground : GroundTable
        The points.
    path : path
        The file, written whole or not at all.
    comments : sequence of str
        Lines before the header, such as what the axes are.

    Raises
    ------
    InputError
        A name that the table cannot hold.
    UsageError
        The file cannot be written.
    """
    points = quoted_names(ground.points, ",", "point")
    sigma = np.sqrt(np.diagonal(ground.cov, axis1=1, axis2=2))
    roles = [ROLES[int(check)] for check in ground.check]
    OUT.write(path, np.hstack([ground.position_m, sigma]), points, roles, comments=comments)
