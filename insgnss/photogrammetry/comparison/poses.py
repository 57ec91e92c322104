"""What any of the files holds, brought to one form.

The form is geodetic positions, attitudes against true north, standard deviations where given.
"""

from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ...base.errors import InputError
from ...base.units import METRE, LengthUnit
from ...geodesy.conventions import exchanged_orders, reversed_signs
from ...geodesy.frames import TangentPlane, ecef_to_geodetic, geodetic_to_ecef, rotation_em
from ...geodesy.projection import MapProjection
from ...geodesy.rotation import NED_ENU
from ...records import Array
from ...records.framed import PROJECTED, TANGENT
from ...records.rows import rows_of
from .hints import rotate_covariance


class NoOriginError(InputError):
    """A file of coordinates in a tangent plane does not say where its origin is."""


class FarError(InputError):
    """Coordinates lie far from the area of their CRS, or are too large for none.

    Parameters
    ----------
    message : the problem and what to do.
    x : (n, 3) the coordinates as the file has them.
    """

    def __init__(self, message: str, x: Array) -> None:
        super().__init__(message)
        self.x = x


FAR_DEG = 3.0  # beyond the area of a CRS (deg): a zone is used in half of its neighbour at most
FAR_UP_M = 1e5  # largest height or depth (m): beyond, coordinates are of another unit or shifted
PLANE_M = 1e5  # largest coordinate in a tangent plane (m): beyond, it is of a projected CRS
LARGEST_EXTENT_DEG = 0.1  # largest extent of a flight's longitudes and latitudes (deg): 11 km
STEEP = 100.0  # height over plan extent beyond which the plan is no metres: no flight is 1 m wide
BY_ROW = (
    *("images", "lat", "lon", "height", "time", "C_Ex", "velocity"),
    *("cov_position", "cov_attitude", "angles", "C_fE", "local"),
)
"""Fields of `Poses` that have one row each, where they are given."""


@dataclass(frozen=True, eq=False)
class Poses:
    """n poses of one file.

    Parameters
    ----------
    source : path.
    form : name of the format.
    point : what the positions are of; "" where the file does not say. lat, lon (n,) rad, height
        (n,) m, as the file has them: whether above the ellipsoid, it may not say.
    images : names, or empty.
    time : (n,) s of `gps_week` (None where unknown), or None.
    C_Ex : (n, 3, 3) attitude into east, north, up at the point, of x = "camera" (right, down,
        viewing direction) or "body" (forward, right, down), or None.
    camera_from_body : (3, 3) body to camera with the bore-sight, where the file says it.
    velocity : (n, 3) east, north, up m/s, or None.
    cov_position, cov_attitude : (n, 3, 3) m^2 and rad^2 (psi), east, north, up, or None.
    angle_set, angles : name and (n, 3) rad of the angles as the file has them, or "" and None.
    C_fE : axes that they count in.
    local : (n, 3) coordinates in `plane` or, m, of `projection` as the file has them, or None.
    notes : what a reader should know.
    datum, epoch : of the positions, where the file names them; None: WGS 84.
    """

    source: str
    form: str
    point: str
    lat: Array
    lon: Array
    height: Array
    images: tuple[str, ...] = ()
    time: Array | None = None
    gps_week: int | None = None
    C_Ex: Array | None = None
    x: str = "camera"
    camera_from_body: Array | None = None
    velocity: Array | None = None
    cov_position: Array | None = None
    cov_attitude: Array | None = None
    angle_set: str = ""
    angles: Array | None = None
    C_fE: Array | None = None
    local: Array | None = None
    plane: TangentPlane | None = None
    projection: MapProjection | None = None
    notes: tuple[str, ...] = field(default_factory=tuple)
    datum: str | None = None
    epoch: float | None = None

    @property
    def n(self) -> int:
        """Number of poses."""
        return int(self.lat.size)

    @property
    def ecef(self) -> Array:
        """(n, 3) m."""
        return geodetic_to_ecef(self.lat, self.lon, self.height)

    @property
    def C_eE(self) -> Array:
        """(n, 3, 3), east, north, up at each point into ECEF."""
        return rotation_em(self.lat, self.lon)

    def taken(self, rows: NDArray[np.int64]) -> "Poses":
        """Only these rows."""
        return replace(self, **rows_of(self, rows, BY_ROW))

    def moved(self, lat: Array, lon: Array, height: Array) -> "Poses":
        """The same at other places."""
        return replace(self, lat=lat, lon=lon, height=height)


@dataclass(frozen=True)
class CoordinateFrame:
    """Frame of the coordinates in a file.

    It has a kind as in `MapFrame`, origin (rad, rad, m) of a tangent plane, definition of a
    projected CRS, datum and epoch of a geographic or geocentric one that is not WGS 84.
    """

    kind: str
    plane: TangentPlane | None = None
    projection: MapProjection | None = None
    datum: str | None = None
    epoch: float | None = None

    def _exchanged(self, x: Array) -> str:
        """Words on another order or sign of easting and northing that reaches the CRS' area."""
        assert self.projection is not None
        names = ("easting", "northing")
        for one in (*exchanged_orders(names), *reversed_signs((*names, ""))):
            try:
                lat, lon, _ = self.projection.inverse(one.change(x))
            except InputError:
                continue
            if not self.projection.outside(lat, lon):
                return (
                    f"; with {one.words} they lie at {np.degrees(lat[0]):.4f}"
                    f" {np.degrees(lon[0]):.4f} deg, inside its area: correct the columns"
                )
        return ""

    def _projected(self, x: Array, path: object) -> tuple[Array, Array, Array, Array]:
        """Return what `resolved` does, of projected coordinates."""
        if self.projection is None:
            raise InputError.in_file(
                path, "has coordinates of a projected CRS; name it, such as crs = EPSG:2056"
            )
        numbers = x / self.projection.unit_m
        problem = f"{path}: coordinates such as {numbers[0, 0]:.3f} {numbers[0, 1]:.3f}"
        refuse_heights(numbers, self.projection.units[1], path)
        try:
            lat, lon, h = self.projection.inverse(x)
        except InputError as error:
            if exchanged := self._exchanged(x):
                raise InputError(f"{path}: {error}{exchanged}") from None
            raise FarError(f"{problem}: {error}", numbers) from None
        far = self.projection.degrees_outside(lat, lon)
        local = far > 0.0 and float(np.abs(x[:, :2]).max()) < PLANE_M
        if (far > FAR_DEG or local) and not self._exchanged(x):  # which compare explains
            raise FarError(
                f"{problem} lie outside the area of"
                f" {self.projection.name}; give the CRS that they are in, or what was"
                " subtracted from them (compare: --coordinate-shift; others: --shift)",
                numbers,
            )
        return lat, lon, h, self.projection.axes(lat, lon, h)

    def resolved(self, x: Array, path: object) -> tuple[Array, Array, Array, Array]:
        """Return latitude, longitude, rad, height, m (n,), and C_fE (n, 3, 3) of `x` (n, 3).

        Geographic coordinates are longitude before latitude, rad.
        """
        if self.kind == "geographic":
            refuse_heights(x, METRE, path)
            return x[:, 1], x[:, 0], x[:, 2], np.broadcast_to(np.eye(3), (len(x), 3, 3))
        if self.kind == "geocentric":
            lat, lon, h = ecef_to_geodetic(x)
            if abs(up := float(np.median(h))) > FAR_UP_M:
                raise FarError(
                    f"{path}: geocentric coordinates such as {x[0, 0]:.3f} {x[0, 1]:.3f}"
                    f" {x[0, 2]:.3f} lie {1e-3 * up:.0f} km above the ellipsoid; give what was"
                    " subtracted from them (compare: --coordinate-shift; others: --shift), or the"
                    " CRS that they are in",
                    x,
                )
            return lat, lon, h, rotation_em(lat, lon)
        if self.kind == "projected":
            return self._projected(x, path)
        if self.plane is None:
            problem = (
                "has coordinates of a tangent plane without its origin; give latitude, longitude"
                " (deg), height (m)"
            )
            raise NoOriginError(f"{path}: {problem}")
        lat, lon, h = self.plane.geodetic_from_position(x)
        return lat, lon, h, self.plane.C_mn(lat, lon) @ NED_ENU

    def poses(
        self,
        path: object,
        form: str,
        x: Array,
        C: Array | None,
        true_north: bool = False,
        cov_position: Array | None = None,
        cov_attitude: Array | None = None,
        **further: Any,
    ) -> Poses:
        """Poses of projection centres `x` (n, 3) in this frame.

        Parameters
        ----------
        C : (n, 3, 3) camera into the axes of the frame; with `true_north` into east, north, up;
            None where only positions are known.
        cov_position, cov_attitude : (n, 3, 3) in the axes of the frame, and of C, or None.
        further : other fields of `Poses`.
        """
        lat, lon, h, C_fE = self.resolved(x, path)
        if self.kind == PROJECTED and self.projection is not None:
            far = self.projection.degrees_outside(lat, lon) > FAR_DEG
            if exchange := self._exchanged(x) if far else "":
                note = f"coordinates lie outside the area of {self.projection.name}{exchange}"
                further["notes"] = (*further.get("notes", ()), note)
        C_Ef = np.swapaxes(C_fE, 1, 2)
        return Poses(
            str(path),
            form,
            "projection centre",
            lat,
            lon,
            h,
            C_Ex=C if true_north or C is None else C_Ef @ C,
            cov_position=rotate_covariance(C_Ef, cov_position),
            cov_attitude=cov_attitude if true_north else rotate_covariance(C_Ef, cov_attitude),
            C_fE=None if true_north else C_fE,
            local=x if self.kind in (TANGENT, PROJECTED) else None,
            plane=self.plane,
            projection=self.projection,
            datum=self.datum,
            epoch=self.epoch,
            **further,
        )


def refuse_heights(numbers: Array, unit: LengthUnit, path: object) -> None:
    """Refuse coordinates (n, 3) whose heights no flight reaches, in millimetres or geocentric.

    Raises
    ------
    FarError
        With the size that they have in their unit.
    """
    up = unit.metres * float(np.median(np.abs(numbers[:, 2])))
    if up > FAR_UP_M:
        raise FarError(
            f"{path}: heights such as {numbers[0, 2]:.3f} are {1e-3 * up:.0f} km in"
            f" {unit.plural}; give their own unit or CRS",
            numbers,
        )


def tangent_frame(path: object, x: Array, plane: TangentPlane | None) -> CoordinateFrame:
    """Frame of coordinates (n, 3) without a CRS; FarError where they are too large for it."""
    if float(np.abs(x[:, :2]).max()) > PLANE_M:
        numbers = f"{x[0, 0]:.3f} {x[0, 1]:.3f}"
        problem = f"does not say the CRS of its coordinates, {numbers}"
        if plane is not None:
            problem = f"its coordinates, {numbers}, are of no tangent plane but of a CRS"
        raise FarError(f"{path}: {problem}; give it, such as --crs EPSG:2056", x)
    return CoordinateFrame(TANGENT, plane)


def degrees_for_metres(x: Array) -> bool:
    """Whether coordinates (n, 3) can only be longitude and latitude, deg, and height."""
    extent = float(np.ptp(x[:, :2], axis=0).max(initial=0.0))
    angles = bool((np.abs(x[:, :2]) <= (180.0, 90.0)).all())
    steep = float(np.median(np.abs(x[:, 2]))) > STEEP * extent
    return angles and 0.0 < extent < LARGEST_EXTENT_DEG and steep
