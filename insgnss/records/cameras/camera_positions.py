"""Positions of the camera at the exposures, without attitude: what PPK gives without an IMU."""

from dataclasses import dataclass
from typing import ClassVar

from .._checked import Array
from ..rows import Rows, RowShapes


@dataclass(frozen=True, eq=False, repr=False)
class CameraPositions(Rows):
    """Positions at exposures, WGS84 or the datum of the base's coordinates.

    Parameters
    ----------
    images : n names.
    time : (n,) s, GPST of `gps_week`, increasing.
    lat, lon : (n,) rad.
    height : (n,) m above the ellipsoid.
    cov_ned : (n, 3, 3) m^2, north, east, down.
    quality : (n,) of `records.qualities.Quality`, the worse of the fixes on both sides.
    of_camera : (n,) 1 where the position is the camera's, 0 where it is the antenna's.
    gps_week : GPS week of `time`, None where it is not known.
    source : where they come from, for messages.

    Raises
    ------
    InputError : a shape is wrong, a value is not finite, or time does not increase.
    """

    _ROWS: ClassVar[RowShapes] = {
        **{"images": None, "time": (), "lat": (), "lon": (), "height": (), "cov_ned": (3, 3)},
        **{"quality": (), "of_camera": ()},
    }
    _NOUN: ClassVar[str] = "images"
    _NAMES: ClassVar[str | None] = "images"

    images: tuple[str, ...]
    time: Array
    lat: Array
    lon: Array
    height: Array
    cov_ned: Array
    quality: Array
    of_camera: Array
    gps_week: int | None = None
    source: str = ""
