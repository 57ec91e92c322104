r"""Map projections: coordinates of a projected CRS, where its grid points, and how long a metre is
on it.

With the coordinates X of the projection and v_en a small way east and north at a point, at its
height,

    dX = m G v_en,        m the scale of grid distances at that height, G a rotation           (G.1)

and what is east, north and up at the point has the axes G of the grid. Where the CRS counts east
and north, G = Rz(gamma), gamma the meridian convergence, positive east of the central meridian;
true north has the grid azimuth -gamma (Legat 2006). m = k R / (R + h), k the
scale on the ellipsoid and R the Gaussian radius of curvature.

G and m are central differences of the projection over `STEP_RAD` (6 m), exact to 1e-9: so they hold
for every projection, for axes that are not east and north, and with what the datum of the CRS turns
(for LV95 the convergence at the Bessel ellipsoid's own longitude is wrong by 2 seconds of arc).

Coordinates here are metres, also those of a CRS that counts in feet: `units` says in which.

Horizontal coordinates go through the datum of the CRS in three dimensions: the normals of two
ellipsoids differ by seconds of arc. Heights go along where the datum of the positions is named and
the CRS has an ellipsoid of their size (ITRF2014 to NAD83(2011): 0.86 m), or three axes. Elsewhere
they stay above the ellipsoid of the positions, as GNSS gives them (LV95: nobody counts heights from
Bessel's ellipsoid), unless the CRS has a vertical part or a geoid is named.

Positions are of WGS 84 unless their datum is named, and an epoch where that datum moves with the
Earth's crust (ITRF). PROJ chooses among the transformations between two datums those whose grids
are there. Where it knows a more accurate one at the flight whose grid is not installed, nothing is
projected: a British grid would be off by 2 m.
"""

from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..base.errors import InputError, UsageError
from ..base.units import METRE, LengthUnit
from .crs import (
    GIVE_CRS,
    above,
    above_ellipsoid,
    crs_of,
    geoid_transformer,
    is_projected,
    not_metric,
    source_crs,
    transform_points,
    transformer_between,
)
from .earth import curvature_radii
from .grids import box_around, geoid_file, lacking_grids, lacking_plan, operations

Array = NDArray[np.float64]

STEP_RAD = 1e-6  # over which G and m are differences (rad): 6 m, by which they are exact to 1e-9
# difference up to which an ellipsoid has the size of that of WGS 84 (m): the nearest other has 2 m
SAME_AXIS_M = 1.0
# rad: by how much the axes of a conformal projection may fail to be perpendicular, or of one scale;
# 0.1 px
CONFORMAL_TOLERANCE = 2e-5


class MapProjection:
    """A projected CRS: its coordinates, the axes of its grid and its scale (G.1).

    Parameters
    ----------
    definition : str
        EPSG code ("EPSG:2056", "2056", "EPSG:25832+7837"), WKT or PROJ text, or the path of a file
        that holds one.
    geoid : Path, optional
        Grid of geoid heights above the WGS84 ellipsoid (GeoTIFF, .gtx, ...), for a CRS without a
        vertical part.
    datum : str, optional
        Geographic CRS of the positions that are projected ("EPSG:4937"); None: WGS 84.
    epoch : float, optional
        Their epoch, decimal year, for a datum that moves.
    any_unit : bool
        Whether the CRS may count in other units than metres, which is for callers that heed
        `units`.

    Raises
    ------
    UsageError
        For a CRS that is unknown, not projected or counts in other units than it may, for a geoid
        beside a CRS with heights of its own, for a geoid file that does not exist, and for what
        `source_crs` refuses.
    """

    def __init__(
        self,
        definition: str,
        geoid: Path | None = None,
        datum: str | None = None,
        epoch: float | None = None,
        any_unit: bool = False,
    ) -> None:
        self._source, self._epoch = source_crs(datum, epoch), epoch
        self._named = datum is not None
        self._looked: set[tuple[float, ...]] = set()
        self.crs = crs_of(definition)
        self.horizontal = self.crs.sub_crs_list[0] if self.crs.is_compound else self.crs
        if not is_projected(self.horizontal):
            raise UsageError(
                f"CRS {definition!r} is {self.crs.name}, which is not projected; {GIVE_CRS}"
            )
        if self.units != (METRE, METRE) and not any_unit:
            raise UsageError(not_metric(definition, self.horizontal, self.units))
        if geoid is not None and self.crs.is_compound:
            raise UsageError(f"CRS {definition!r} has heights of its own; leave the geoid out")
        self.geoid = None if geoid is None else geoid_file(geoid)

    @property
    def name(self) -> str:
        """The code and the name of the CRS, such as EPSG:2056 CH1903+ / LV95."""
        return f"{self.code} {self.crs.name}".strip()

    @property
    def code(self) -> str:
        """The authority code of the horizontal part, empty where it has none."""
        code = self.horizontal.to_authority()
        return ":".join(code) if code else ""

    @property
    def heights(self) -> str:
        """Return the name of what the third coordinate is."""
        if self.crs.is_compound:
            return str(self.crs.sub_crs_list[1].name)
        if self.geoid is not None:
            return above(self.geoid)
        in_datum = self._heights_of_datum
        return above_ellipsoid(self.horizontal.geodetic_crs if in_datum else self._source)

    @cached_property
    def _heights_of_datum(self) -> bool:
        """Return whether heights go along into the datum of the CRS."""
        axes_m = [crs.ellipsoid.semi_major_metre for crs in (self.horizontal, self._source)]
        return len(self.horizontal.axis_info) > 2 or (
            self._named and abs(axes_m[0] - axes_m[1]) < SAME_AXIS_M
        )

    @cached_property
    def units(self) -> tuple[LengthUnit, LengthUnit]:
        """Return the units in which the CRS counts in plan and in height.

        Heights of a CRS without a vertical part are in the unit of the plan.
        """
        plan = self.horizontal.axis_info[0]
        vertical = self.crs.sub_crs_list[1].axis_info[0] if self.crs.is_compound else plan

        def unit(axis: Any) -> LengthUnit:
            factor = axis.unit_conversion_factor
            return METRE if factor == 1.0 else LengthUnit(axis.unit_name, factor)

        return unit(plan), unit(vertical)

    @property
    def unit_m(self) -> Array:
        """Return the metres (3,) of one unit of easting, northing and height of the CRS."""
        plan, height = self.units
        return np.array([plan.metres, plan.metres, height.metres])

    @property
    def northing_first(self) -> bool:
        """Whether the CRS itself names northing before easting.

        Coordinates here are easting, northing all the same.
        """
        return bool(self.horizontal.axis_info[0].direction.lower() in ("north", "south"))

    @cached_property
    def _horizontal(self) -> Any:
        return transformer_between(self._source, self.horizontal.to_3d())

    @cached_property
    def _heights(self) -> Any:
        if self.crs.is_compound:
            return transformer_between(self._source, self.crs)
        assert self.geoid is not None
        return geoid_transformer(self.geoid)

    def forward(self, lat: Array, lon: Array, h: Array) -> Array:
        """Project geodetic coordinates.

        Parameters
        ----------
        lat, lon : ndarray, (n,)
            Geodetic latitude and longitude on WGS84, rad.
        h : ndarray, (n,)
            Height above the WGS84 ellipsoid, m.

        Returns
        -------
        ndarray, (n, 3)
            Easting, northing and height of the CRS, m.

        Raises
        ------
        InputError
            Where the CRS or its grids do not reach the points, or a grid is not installed.
        """
        x = self._coordinates_in_datum(lat, lon, h)
        horizontal, h_crs = x[:, :2], x[:, 2] if self._heights_of_datum else h
        if not self.crs.is_compound and self.geoid is None:
            return np.column_stack([horizontal, h_crs])
        h = h if self.crs.is_compound else h_crs
        epoch = self._epoch if self.crs.is_compound else None
        try:
            _, _, z = transform_points(
                self._heights, self.heights, np.degrees(lon), np.degrees(lat), h, epoch=epoch
            )
        except InputError:
            if self.crs.is_compound and (
                why := lacking_grids(self.name, self._source, self.crs, lat, lon)
            ):
                raise InputError(why) from None
            raise
        return np.column_stack([horizontal, z * self.units[1].metres])

    def forward_horizontal(self, lat: Array, lon: Array, h: Array) -> Array:
        """Project geodetic coordinates to the first two coordinates of `forward`.

        Parameters
        ----------
        lat, lon : ndarray, (n,)
            Geodetic latitude and longitude on WGS84, rad.
        h : ndarray, (n,)
            Height above the WGS84 ellipsoid, m.

        Returns
        -------
        ndarray, (n, 2)
            Easting and northing of the CRS, m.

        Raises
        ------
        InputError
            Where the CRS or its grids do not reach the points, or a grid is not installed.
        """
        return self._coordinates_in_datum(lat, lon, h)[:, :2]

    def _coordinates_in_datum(self, lat: Array, lon: Array, h: Array) -> Array:
        """Return easting, northing, m, and the height above the ellipsoid of the CRS's datum."""
        self._refuse_missing_grid(lat, lon)
        x, y, z = transform_points(
            self._horizontal, self.name, np.degrees(lon), np.degrees(lat), h, epoch=self._epoch
        )
        unit = self.units[0].metres
        return np.column_stack([x * unit, y * unit, z])

    def _refuse_missing_grid(self, lat: Array, lon: Array) -> None:
        """Raise InputError where PROJ knows a better transformation whose grid is not installed."""
        if lat.size == 0 or not (np.isfinite(lat).all() and np.isfinite(lon).all()):
            return
        box = box_around(lat, lon)
        if box in self._looked:
            return
        group = operations(self._source, self.horizontal.to_3d(), lat, lon)
        best = group.unavailable_operations[:1]
        if not group.best_available and best and group.transformers:
            accuracy_m = group.transformers[0].accuracy
            if 0.0 <= best[0].accuracy < accuracy_m or accuracy_m < 0.0:
                grids = [grid.short_name for grid in best[0].grids if not grid.available]
                geodetic = self.horizontal.geodetic_crs
                code = ":".join(geodetic.to_authority() or ())
                datum = f"{geodetic.name} {code}".strip()
                message = lacking_plan(self.name, grids, best[0].accuracy, accuracy_m, datum)
                raise InputError(message)
        self._looked.add(box)

    def inverse(self, coordinates: Array) -> tuple[Array, Array, Array]:
        """Convert coordinates of the CRS to geodetic ones.

        Steps of Newton start from PROJ's own inverse, since that of a datum with rotations is half
        a millimetre off what `forward` gives.

        Parameters
        ----------
        coordinates : ndarray, (n, 3)
            Easting, northing and height of the CRS, m.

        Returns
        -------
        lat, lon : ndarray, (n,)
            Geodetic latitude and longitude on WGS84, rad.
        h : ndarray, (n,)
            Height above the WGS84 ellipsoid, m.

        Raises
        ------
        InputError
            Where the CRS or its grids do not reach the points, or a grid is not installed.
        """
        x = np.asarray(coordinates, dtype=np.float64)
        plan = x[:, :2] / self.units[0].metres
        lon, lat, _ = transform_points(
            self._horizontal, self.name, plan[:, 0], plan[:, 1], x[:, 2], True, self._epoch
        )
        lat, lon, h = np.radians(lat), np.radians(lon), x[:, 2].copy()
        M, N = curvature_radii(lat)
        for _ in range(3):
            misclosure = x - self.forward(lat, lon, h)
            jacobian = self._jacobian(lat, lon, h)
            east, north = np.linalg.solve(jacobian, misclosure[:, :2, None])[:, :, 0].T
            lon = lon + east / ((N + h) * np.cos(lat))
            lat = lat + north / (M + h)
            h = h + misclosure[:, 2]
        return lat, lon, h

    def axes(self, lat: Array, lon: Array, h: Array) -> Array:
        """Return G of (G.1), the rotation of east, north, up into the axes of the grid.

        Parameters
        ----------
        lat, lon : ndarray, (n,)
            Geodetic latitude and longitude on WGS84, rad.
        h : ndarray, (n,)
            Height above the WGS84 ellipsoid, m.

        Returns
        -------
        ndarray, (n, 3, 3)
            Rotation matrices.

        Raises
        ------
        UsageError
            Where the axes are left-handed or the projection is not conformal: no attitude can be
            given in them.
        InputError
            Where the CRS or its grids do not reach the points, or a grid is not installed.
        """
        J = self._jacobian(lat, lon, h)
        scale = np.sqrt(np.abs(np.linalg.det(J)))
        G = np.zeros((len(J), 3, 3))
        G[:, 2, 2] = 1.0
        if (np.linalg.det(J) < 0.0).any():
            raise UsageError(
                f"CRS {self.name} has left-handed axes (northing first), in which attitudes are"
                " undefined; use the same CRS with easting first"
            )
        angle = np.arctan2(J[:, 1, 0] - J[:, 0, 1], J[:, 0, 0] + J[:, 1, 1])
        G[:, 0, 0] = G[:, 1, 1] = np.cos(angle)
        G[:, 1, 0], G[:, 0, 1] = np.sin(angle), -np.sin(angle)
        if np.abs(J - scale[:, None, None] * G[:, :2, :2]).max() > CONFORMAL_TOLERANCE:
            raise UsageError(
                f"CRS {self.name} is not conformal, so attitudes in it are undefined; use a"
                " conformal CRS (UTM, ...)"
            )
        return G

    def ground_scale(self, lat: Array, lon: Array, h: Array) -> Array:
        """Return m of (G.1), the scale of grid distances at the points' height.

        Parameters
        ----------
        lat, lon : ndarray, (n,)
            Geodetic latitude and longitude on WGS84, rad.
        h : ndarray, (n,)
            Height above the WGS84 ellipsoid, m.

        Returns
        -------
        ndarray, (n,)
            Metres of the grid for a metre on the ground.

        Raises
        ------
        InputError
            Where the CRS or its grids do not reach the points, or a grid is not installed.
        """
        return np.asarray(np.sqrt(np.abs(np.linalg.det(self._jacobian(lat, lon, h)))))

    def _jacobian(self, lat: Array, lon: Array, h: Array) -> Array:
        """Return m G (n, 2, 2), its columns east and north."""
        M, N = curvature_radii(lat)
        half = 0.5 * STEP_RAD
        east, west, north, south = (
            self.forward_horizontal(lat + half * to_north, lon + half * to_east / np.cos(lat), h)
            for to_north, to_east in ((0, 1), (0, -1), (1, 0), (-1, 0))
        )
        return np.stack(
            [
                (east - west) / (STEP_RAD * (N + h))[:, None],
                (north - south) / (STEP_RAD * (M + h))[:, None],
            ],
            axis=-1,
        )

    def outside(self, lat: Array, lon: Array) -> int:
        """Count the points outside the area for which the CRS is made.

        Parameters
        ----------
        lat, lon : ndarray, (n,)
            Geodetic latitude and longitude, rad.

        Returns
        -------
        int
            Number of points; 0 where the registry names no area.
        """
        return int(np.count_nonzero(self._degrees_beyond(lat, lon) > 0.0))

    def degrees_outside(self, lat: Array, lon: Array) -> float:
        """Return how far the points lie outside the area for which the CRS is made.

        Parameters
        ----------
        lat, lon : ndarray, (n,)
            Geodetic latitude and longitude, rad.

        Returns
        -------
        float
            Degrees of longitude or latitude, the median of the points; 0 where the registry names
            no area.
        """
        return float(np.median(self._degrees_beyond(lat, lon))) if lat.size else 0.0

    def _degrees_beyond(self, lat: Array, lon: Array) -> Array:
        """Return the degrees (n,) by which points lie beyond the area, 0 inside or without one."""
        area = self.horizontal.area_of_use
        if area is None:
            return np.zeros(lat.shape)
        width = (area.east - area.west) % 360.0 or 360.0
        lat_deg = np.degrees(lat)
        east = (np.degrees(lon) - area.west) % 360.0
        beyond = np.where(east > width, np.minimum(east - width, 360.0 - east), 0.0)
        return np.maximum(beyond, np.maximum(area.south - lat_deg, lat_deg - area.north))

    def operation(self) -> tuple[str, float]:
        """Return the datum transformation that was last used.

        Returns
        -------
        name : str
            Its name, empty before the first use.
        accuracy : float
            Its accuracy, m; negative where unknown.
        """
        try:
            last_operation = self._horizontal.get_last_used_operation()
        except Exception:  # pyproj's own error class, before the first use
            return "", -1.0
        return str(last_operation.description), float(last_operation.accuracy)

    def shift_m(self, lat: Array, lon: Array, h: Array) -> float:
        """Return the most by which the datum transformation moves the points horizontally.

        Parameters
        ----------
        lat, lon : ndarray, (n,)
            Geodetic latitude and longitude, rad.
        h : ndarray, (n,)
            Height above the ellipsoid, m.

        Returns
        -------
        float
            m, against the projection of the same latitudes and longitudes in the CRS's own datum.
        """
        of_datum = transformer_between(
            self.horizontal.geodetic_crs.to_3d(), self.horizontal.to_3d()
        )
        x, y, _ = transform_points(of_datum, self.name, np.degrees(lon), np.degrees(lat), h)
        difference = np.column_stack([x, y]) * self.units[0].metres - self.forward_horizontal(
            lat, lon, h
        )
        return float(np.hypot(*difference.T).max(initial=0.0))
