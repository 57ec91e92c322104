"""The exterior orientation in the frame in which somebody wants it."""

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from ..base.errors import InputError
from ..base.units import METRE, LengthUnit
from ._checked import Array, freeze, freeze_field
from .cameras.rig import RigImages

FRAME_KINDS = TANGENT, GEOCENTRIC, GEOGRAPHIC, PROJECTED = (
    "tangent plane",
    "geocentric",
    "geographic",
    "projected",
)


_UNKNOWN = (
    "export: covariances between neighbouring images are lost, since some images between were "
    "left out; choose successive images, such as eo[10:30], or all"
)


@dataclass(frozen=True)
class MapFrame:
    """Coordinates and axes in which an exterior orientation stands.

    Parameters
    ----------
    kind : str
        One of `FRAME_KINDS`.
    name : str
        Name of the frame for people, with its code.
    heights : str
        What the third coordinate is; empty where it is no height.
    crs : str
        Authority code, "EPSG:2056"; empty where there is none.
    wkt : str
        WKT2 of a projected CRS, vertical part included.
    origin : tuple of float
        Latitude (rad), longitude (rad) and ellipsoidal height (m) of a tangent plane's origin.
    northing_first : bool
        Whether the CRS itself names latitude or northing first; coordinates here never do.
    scaled_from_m : float, optional
        Height of the ground, m, if heights were scaled from there.
    units : tuple of LengthUnit
        Those of the CRS, of plan and of heights. Coordinates here are metres all the same; a
        file that names the CRS has them in its units.
    datum : str
        Code of the geographic CRS of the positions, in which `geodetic` stands.
    datum_name : str
        Its name, with its epoch.
    """

    kind: str
    name: str
    heights: str
    crs: str = ""
    wkt: str = ""
    origin: tuple[float, ...] = ()
    northing_first: bool = False
    scaled_from_m: float | None = None
    units: tuple[LengthUnit, LengthUnit] = (METRE, METRE)
    datum: str = "EPSG:4979"
    datum_name: str = "WGS84"

    @property
    def unit_m(self) -> Array:
        """(3,) metres of one unit of each coordinate."""
        plan, height = self.units
        return np.array([plan.metres, plan.metres, height.metres])


@dataclass(frozen=True, eq=False)
class FramedOrientation:
    """Projection centre and attitude of n images in a frame: what the writers of formats get.

    Parameters
    ----------
    images : tuple of str
        (n,) names of the images.
    time : ndarray
        (n,) mid-exposure, s, GPST of `gps_week`.
    gps_week : int
        GPS week of `time`.
    frame : MapFrame
        The frame.
    coordinates : ndarray
        (n, 3) E N U m; X Y Z m; longitude rad, latitude rad, height m; or easting, northing,
        height m, whatever the unit of the CRS.
    C_fc : ndarray
        (n, 3, 3) camera (x image right, y image down, z viewing direction) to the frame's axes at
        the image.
    C_fE : ndarray
        (n, 3, 3) east, north, up at the image to the frame's axes at the image.
    cov : ndarray
        (n, 6, 6) covariance of position (m) and psi (rad), both in the frame's axes at the image;
        R(true) = exp([psi x]) R.
    cross : ndarray or None
        (max(n - 1, 0), 6, 6) covariance of the errors of image k with those of image k + 1; None
        where it is not known.
    geodetic : ndarray
        (n, 3) latitude rad, longitude rad, height m above the ellipsoid, of `frame.datum`.
    boresight, camera_from_body : ndarray
        (3, 3) matrices B and T of the mounting that were applied.
    history : tuple of str
        What was done to get it, sentence by sentence.
    rig : RigImages or None
        Cameras of the images where there are several, their `cross` in the frame's axes;
        `boresight` and `camera_from_body` are those of the first then.

    Raises
    ------
    InputError
        Where a shape is wrong or a value is not finite.
    """

    images: tuple[str, ...]
    time: Array
    gps_week: int
    frame: MapFrame
    coordinates: Array
    C_fc: Array
    C_fE: Array
    cov: Array
    cross: Array | None
    geodetic: Array
    boresight: Array
    camera_from_body: Array
    history: tuple[str, ...] = field(default_factory=tuple)
    rig: RigImages | None = None

    def __post_init__(self) -> None:
        object.__setattr__(self, "images", tuple(self.images))
        n = len(self.images)
        freeze(self, {"time": (n,), "coordinates": (n, 3), "geodetic": (n, 3), "cov": (n, 6, 6)})
        freeze(self, {"C_fc": (n, 3, 3), "C_fE": (n, 3, 3)})
        freeze(self, {"boresight": (3, 3), "camera_from_body": (3, 3)})
        if self.cross is not None:
            freeze_field(self, "cross", (max(n - 1, 0), 6, 6))

    @property
    def C_cb(self) -> Array:
        """(3, 3), or (n, 3, 3) of a rig: body to camera, T B."""
        return self.camera_from_body @ self.boresight if self.rig is None else self.rig.C_cb

    @property
    def cameras(self) -> tuple[tuple[str, ...], NDArray[np.int64]]:
        """Names of the cameras, one without a name where there is no rig, and (n,) numbers."""
        if self.rig is None:
            return ("",), np.zeros(len(self.images), dtype=np.int64)
        return self.rig.names, self.rig.number

    @property
    def neighbours(self) -> tuple[tuple[NDArray[np.int64], Array], ...]:
        """Of each camera the rows (m,) of its images, and (m - 1, 6, 6) what neighbours share.

        Raises InputError where that is not known.
        """
        if self.rig is None:
            return ((np.arange(len(self.images)), self.known_cross),)
        if self.rig.cross is None:
            raise InputError(_UNKNOWN)
        shared = self.rig.cross
        return tuple((rows, shared[rows[:-1]]) for rows in self.rig.rows)

    @property
    def known_cross(self) -> Array:
        """`cross`, for formats that need it. Raises InputError where it is not known."""
        if self.cross is None:
            raise InputError(_UNKNOWN)
        return self.cross

    @property
    def C_Ec(self) -> Array:
        """(n, 3, 3), camera to east, north, up at the image: true north, whatever the frame."""
        return self.C_fE.swapaxes(1, 2) @ self.C_fc
