"""Datums of positions: names, other kinds of CRS of one datum, transformations between two.

It also finds which CRS of the registry numbers may be of.

A wrong zone, or metres declared as feet, puts points hundreds of kilometres away, while the numbers
are those of another CRS at the place where they are known to be.
"""

import warnings
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..base.errors import InputError, UsageError
from .crs import (
    GIVE_CRS,
    GNSS_YEARS,
    crs_of,
    moves,
    source_crs,
    transform_points,
    transformer_between,
    undulation,
)
from .grids import lacking_grids

Array = NDArray[np.float64]

FITTING = 20.0  # distance (units of a CRS) up to which coordinates fit it: an adjustment moves less
# how far beyond the area of a CRS (deg of longitude) it may be used: countries keep one UTM zone
BEYOND_DEG = 6.0
OF_DATUM = 2000.0  # largest shift of a datum (ft), up to which a CRS is looked at with it
# distance by which another CRS may fit worse and is named as well: WGS 84 and ETRS89
AGREEING_M = 1.0
# degrees up to which numbers are longitude and latitude of a place: as metres they are next to none
SAME_PLACE_DEG = 0.1
# datums fixed to Eurasia, North America, Australia
PLATES = ("EPSG:4937", "EPSG:6319", "EPSG:7843")
MOST_CRS = 2  # that are named: more do not fit into a line


def datum_words(crs: Any, epoch: float | None) -> str:
    """Return what people call the datum of positions.

    Parameters
    ----------
    crs : pyproj.CRS
        As of `source_crs`.
    epoch : float, optional
        Decimal year of the positions.

    Returns
    -------
    str
        Such as "ITRF2014, epoch 2023.5".
    """
    return crs.name if epoch is None else f"{crs.name}, epoch {epoch:.10g}"


def code_of(crs: Any) -> str:
    """Return the authority code of a CRS.

    Parameters
    ----------
    crs : pyproj.CRS
        The CRS.

    Returns
    -------
    str
        Such as EPSG:6319; empty where it has none.
    """
    return ":".join(crs.to_authority() or ())


def sibling_code(crs: Any, kind: str) -> str:
    """Return the code of the CRS of the same datum and another kind.

    Parameters
    ----------
    crs : pyproj.CRS
        A geographic or geocentric CRS.
    kind : str
        Name of a `pyproj.enums.PJType`: GEOCENTRIC_CRS or GEOGRAPHIC_3D_CRS.

    Returns
    -------
    str
        Its EPSG code, whose name is the same there; empty where there is none.
    """
    from pyproj.database import query_crs_info
    from pyproj.enums import PJType

    siblings = query_crs_info("EPSG", [PJType[kind]])
    return next((f"EPSG:{info.code}" for info in siblings if info.name == crs.name), "")


def geodetic_from_geographic(
    definition: str,
    coordinates: Array,
    geoid: Path | None = None,
    datum: str | None = None,
    epoch: float | None = None,
) -> tuple[Array, Array, Array]:
    """Return the geodetic position of points of a geographic CRS.

    Parameters
    ----------
    definition : str
        The CRS, as of `MapProjection`; heights are ellipsoidal unless it has heights of its own or
        a geoid is named.
    coordinates : ndarray, (n, 3)
        Longitude and latitude, deg, height, m.
    geoid : Path, optional
        Grid of geoid heights.
    datum, epoch : optional
        Of the result, as of `source_crs`.

    Returns
    -------
    tuple of ndarray
        Latitude and longitude, rad, and height above the ellipsoid, m, each (n,).

    Raises
    ------
    UsageError
        A CRS that is unknown or not geographic, or a geoid beside heights of its own.
    InputError
        Where the CRS or its grids do not reach the points.
    """
    crs = crs_of(definition)
    horizontal = crs.sub_crs_list[0] if crs.is_compound else crs
    if not horizontal.is_geographic:
        raise UsageError(f"CRS {definition!r} is {crs.name}, which is not geographic; {GIVE_CRS}")
    if geoid is not None and crs.is_compound:
        raise UsageError(f"CRS {definition!r} has heights of its own; leave the geoid out")
    transformer = transformer_between(
        source_crs(datum, epoch), crs if crs.is_compound else crs.to_3d()
    )
    x, y, z = coordinates.T
    lon, lat, h = transform_points(transformer, crs.name, x, y, z, inverse=True, epoch=epoch)
    lat, lon = np.radians(lat), np.radians(lon)
    return lat, lon, h if geoid is None else h + undulation(geoid, lat, lon)


def between_datums(
    lat: Array,
    lon: Array,
    h: Array,
    source: tuple[str | None, float | None],
    target: tuple[str | None, float | None],
) -> tuple[Array, Array, Array]:
    """Return geodetic positions in another datum.

    Parameters
    ----------
    lat, lon : ndarray, (n,)
        Latitude and longitude, rad.
    h : ndarray, (n,)
        Height above the ellipsoid, m.
    source, target : tuple
        Datum and epoch as of `source_crs`, of these positions and of the result.

    Returns
    -------
    tuple of ndarray
        Latitude, longitude and height, each (n,).

    Raises
    ------
    UsageError
        As `source_crs`.
    InputError
        PROJ knows no transformation, its grid is not installed, or both datums move, the epochs
        differ, and the positions are on none of `PLATES`: no motion of the ground is known there.
    """
    crs_from, crs_to = source_crs(*source), source_crs(*target)
    epochs = {epoch for crs, (_, epoch) in ((crs_from, source), (crs_to, target)) if moves(crs)}
    if len(epochs) > 1 and (plate := _plate_of(lat, lon)):
        fixed = between_datums(lat, lon, h, source, (plate, None))
        return between_datums(*fixed, (plate, None), target)
    if len(epochs) > 1:
        raise InputError(
            f"{datum_words(crs_from, source[1])} and {datum_words(crs_to, target[1])}: plates move"
            " by centimetres a year, and the motion at this place is not known; process both data"
            " sets at one epoch"
        )
    if crs_from == crs_to:
        return lat, lon, h
    transformer = transformer_between(crs_from, crs_to)
    degrees = np.degrees(lon), np.degrees(lat)
    epoch = next(iter(epochs), None)
    try:
        x, y, h = transform_points(transformer, crs_to.name, *degrees, h, epoch=epoch)
    except InputError:
        if grids := lacking_grids(crs_to.name, crs_from, crs_to, lat, lon, "its datum"):
            raise InputError(grids) from None
        raise
    return np.radians(y), np.radians(x), h


def at_epoch(datum: str, epoch: float | None) -> tuple[str, float | None]:
    """Return a datum that positions are brought into, with their epoch where it moves.

    Parameters
    ----------
    datum : str
        As of `source_crs`.
    epoch : float, optional
        Decimal year of the positions.

    Returns
    -------
    tuple
        The datum, and the epoch or None.

    Raises
    ------
    UsageError
        As `source_crs`.
    """
    return datum, epoch if moves(source_crs(datum, epoch or GNSS_YEARS[0])) else None


def _plate_of(lat: Array, lon: Array) -> str:
    """Return the one of `PLATES` in whose area all positions lie, empty where there is none."""
    lat, lon = np.degrees(lat), np.degrees(lon)
    for code in PLATES:
        area = crs_of(code).area_of_use
        west, east = area.west, area.east + 360.0 * (area.east < area.west)
        within = (lat >= area.south) & (lat <= area.north) & ((lon - west) % 360.0 <= east - west)
        if within.all():
            return code
    return ""


def fitting_crs(
    numbers: Array,
    lat: float,
    lon: float,
    extent: float,
    datum: str | None = None,
    epoch: float | None = None,
) -> str:
    """Return the CRSs of the registry in which numbers are coordinates of a place.

    Parameters
    ----------
    numbers : ndarray, (n, 2) or (n, 3)
        Coordinates as a file has them, easting before northing.
    lat, lon : float
        Where they are known to be, rad.
    extent : float
        By how much the middle of both may differ, m.
    datum, epoch : optional
        Of the place, as of `source_crs`.

    Returns
    -------
    str
        At most two codes with "or" between them, those of the same datum first; empty where none
        fits.
    """
    from pyproj import CRS, Proj, Transformer
    from pyproj.aoi import AreaOfInterest
    from pyproj.database import query_crs_info
    from pyproj.enums import PJType
    from pyproj.exceptions import CRSError, ProjError

    globe, middle = source_crs(datum, epoch), np.median(numbers[:, :2], axis=0)
    lat_deg, lon_deg = np.degrees([lat, lon]).tolist()
    if np.abs(middle - (lon_deg, lat_deg)).max() < SAME_PLACE_DEG:
        return f"{datum or 'EPSG:4326'} {globe.name} (longitude and latitude, deg)"
    fits: list[tuple[bool, float, str]] = []
    for beyond in (0.0, BEYOND_DEG):
        west, east = ((lon_deg + margin + 180.0) % 360.0 - 180.0 for margin in (-beyond, beyond))
        area = AreaOfInterest(west, lat_deg, east, lat_deg)
        for info in () if fits else query_crs_info("EPSG", PJType.PROJECTED_CRS, area):
            try:
                crs = CRS.from_epsg(int(info.code))
                with warnings.catch_warnings(action="ignore"):  # that a PROJ text has no datum
                    distance = np.linalg.norm(Proj(crs)(lon_deg, lat_deg) - middle)
                if not distance <= FITTING + extent + OF_DATUM:
                    continue
                to_crs = Transformer.from_crs(globe, crs, always_xy=True)
                x = to_crs.transform(lon_deg, lat_deg)
            except (CRSError, ProjError):
                continue
            if (distance := np.linalg.norm(x[:2] - middle)) < FITTING + extent:
                geodetic = crs.geodetic_crs
                other_datum = geodetic is None or geodetic.name != globe.name
                fits.append((other_datum, float(distance), f"EPSG:{info.code} {info.name}"))
    nearest = min((distance for _, distance, _ in fits), default=0.0)
    names = [name for _, distance, name in sorted(fits) if distance <= nearest + AGREEING_M]
    return " or ".join(names[:MOST_CRS])
