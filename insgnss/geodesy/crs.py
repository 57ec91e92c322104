"""Coordinate reference systems by their codes, the transformations between them by PROJ, and the
height of a geoid.

What PROJ refuses becomes one line that says what to give instead: a CRS that is unknown, a datum
that moves without an epoch, a grid that is not installed, points that a grid does not reach.
"""

import re
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..base.errors import InputError, UsageError
from ..base.inputs import read_text
from ..base.units import METRE, LengthUnit
from ..base.wording import DOCTOR
from .grids import geoid_file

Array = NDArray[np.float64]

GIVE_CRS = (
    "give an EPSG code such as EPSG:2056, one with heights such as EPSG:25832+7837, or the path of"
    " a WKT file"
)
DATUMS = (
    "give the geographic CRS of the base's coordinates, such as EPSG:4937 (ETRS89), EPSG:9989"
    " (ITRF2020), EPSG:6319 (NAD83(2011)), EPSG:7843 (GDA2020)"
)
# decimal years of positions: before GPS there were none, and plates are not extrapolated farther
GNSS_YEARS = 1980.0, 2100.0
# code at the end of well-known text, and the values of its projection's parameters
ROOT_CODE = re.compile(r'AUTHORITY\[\s*"EPSG"[\s,]+"?(\d+)"?\s*\]\s*\]\s*$')
PARAMETER = re.compile(r'PARAMETER\[\s*"[^"]*"[\s,]+([-+]?[\d.]+(?:[eE][-+]?\d+)?)')


def source_crs(datum: str | None, epoch: float | None) -> Any:
    """Return the geographic CRS of GNSS positions, in three dimensions.

    Parameters
    ----------
    datum : str, optional
        Its EPSG code or name; None: WGS 84.
    epoch : float, optional
        Decimal year of the positions.

    Returns
    -------
    pyproj.CRS
        The CRS.

    Raises
    ------
    UsageError
        For one that is unknown or not geographic, one that moves without an epoch, an epoch
        without a datum, and one that is no year of `GNSS_YEARS`.
    """
    if datum is None:
        if epoch is not None:
            raise UsageError(f"epoch {epoch:g} belongs to a datum; {DATUMS}")
        return crs_of("EPSG:4979")
    try:
        crs = crs_of(datum)
    except UsageError:
        raise UsageError(f"datum {datum[:60]!r} is unknown; {DATUMS}") from None
    if not crs.is_geographic:
        raise UsageError(f"datum {datum!r} is {crs.name}, which is not geographic; {DATUMS}")
    if moves(crs) and epoch is None:
        raise UsageError(
            f"datum {datum!r} is {crs.name}, which moves by centimetres a year against the ground;"
            " give the epoch of the positions too, such as 2024.5"
        )
    if moves(crs) and epoch is not None and not GNSS_YEARS[0] <= epoch <= GNSS_YEARS[1]:
        raise UsageError(
            f"epoch {epoch:g} is no decimal year of GNSS positions, {GNSS_YEARS[0]:g} to"
            f" {GNSS_YEARS[1]:g}; give it such as 2024.5, no day, week or seconds"
        )
    return crs.to_3d()


def moves(crs: Any) -> bool:
    """Whether the datum of a CRS moves by centimetres a year against the ground.

    Parameters
    ----------
    crs : pyproj.CRS
        The CRS.

    Returns
    -------
    bool
        Whether its coordinates need an epoch.
    """
    return crs.datum is not None and str(crs.datum.type_name).startswith("Dynamic")


def is_projected(crs: Any) -> bool:
    """Whether a CRS is a projected one, or derived from one by a site's own shift and turn.

    Parameters
    ----------
    crs : pyproj.CRS
        Without vertical part.

    Returns
    -------
    bool
        Whether it counts in the plane of a map.
    """
    return bool(crs.is_projected) or crs.type_name == "Derived Projected CRS"


def is_geographic(definition: str) -> bool:
    """Whether a CRS counts longitude and latitude.

    Parameters
    ----------
    definition : str
        As of `MapProjection`.

    Returns
    -------
    bool
        Whether it does, with heights or without.

    Raises
    ------
    UsageError
        A CRS that is unknown.
    """
    return bool(crs_of(definition).is_geographic)


def is_globe(definition: str) -> bool:
    """Whether a CRS counts longitude and latitude, and heights from its ellipsoid.

    Parameters
    ----------
    definition : str
        As of `MapProjection`.

    Returns
    -------
    bool
        Whether it does.

    Raises
    ------
    UsageError
        A CRS that is unknown.
    """
    return is_geographic(definition) and not crs_of(definition).is_compound


def not_metric(definition: str, crs: Any, units: tuple[LengthUnit, LengthUnit]) -> str:
    """Return why a CRS is refused that counts in feet, and which one counts in metres.

    Parameters
    ----------
    definition : str
        The CRS as the user gave it.
    crs : pyproj.CRS
        Its horizontal part.
    units : tuple of LengthUnit
        In which it counts in plan and in height.

    Returns
    -------
    str
        The message.
    """
    from pyproj import CRS
    from pyproj.exceptions import CRSError

    plan, height = units
    if plan == METRE:
        return (
            f"CRS {definition!r} has heights in {height.plural}, metres are needed here; give"
            " heights in metres, such as +5703 (NAVD88)"
        )
    try:
        code = CRS.from_user_input(crs.name.partition(" (ft")[0]).to_authority()
    except CRSError:
        code = None
    sibling = f", {':'.join(code)}" if code and crs.name.endswith(")") else ""
    return (
        f"CRS {definition!r} counts in {plan.plural}, metres are needed here; give its metric"
        f" sibling{sibling}"
    )


def crs_of(definition: str) -> Any:
    """Return the CRS of a definition.

    Parameters
    ----------
    definition : str
        EPSG code, WKT or PROJ text, or the path of a file that holds one.

    Returns
    -------
    pyproj.CRS
        The CRS.

    Raises
    ------
    UsageError
        For one that PROJ does not know.
    """
    from pyproj import CRS
    from pyproj.exceptions import CRSError

    text = str(definition).strip()
    path = Path(text)
    try:
        if len(text) < 1000 and path.suffix.lower() in (".wkt", ".prj", ".txt") and path.is_file():
            text = read_text(path)
        text = _code_at_end(text) or text
        return CRS.from_user_input(int(text) if text.isdecimal() else text)
    except (CRSError, UnicodeDecodeError, OSError):
        raise UsageError(f"CRS {str(definition)[:60]!r} is unknown; {GIVE_CRS}") from None


def _code_at_end(text: str) -> str:
    """Return the code that well-known text ends with, where its parameters are those of the code.

    Metashape's text of LV95 has a parameter "recitified_grid_angle", with which PROJ computes
    nothing; what a site changed of a CRS may still bear its code.
    """
    from pyproj import CRS
    from pyproj.exceptions import CRSError

    code = ROOT_CODE.search(text)
    try:
        crs = None if code is None else CRS.from_epsg(int(code[1]))
    except CRSError:
        return ""
    if code is None or crs is None:
        return ""
    operation = (crs.sub_crs_list or [crs])[0].coordinate_operation
    registered = [] if operation is None else [parameter.value for parameter in operation.params]
    values = [float(number) for number in PARAMETER.findall(text)]
    same_parameters = all(
        np.isclose(value, registered, rtol=1e-7, atol=1e-9).any() for value in values
    )
    return code[1] if same_parameters else ""


def first_wkt(crs: Any, who: str) -> str:
    """Return the well-known text of the first kind, which older programs read.

    Parameters
    ----------
    crs : pyproj.CRS
        The CRS.
    who : str
        What needs the text, for the message.

    Returns
    -------
    str
        The text.

    Raises
    ------
    UsageError
        It has none: a site calibration, or one of three geographic axes.
    """
    from pyproj.exceptions import CRSError

    try:
        return str(crs.to_wkt("WKT1_GDAL"))
    except CRSError:
        base = crs.source_crs.name if crs.is_derived and crs.source_crs else "a CRS with a code"
        raise UsageError(
            f"{who}: {crs.name} cannot be written as well-known text of the first kind, the only"
            f" one that the program reads; export {base}, or the tangent plane"
        ) from None


def undulation(geoid: Path, lat: Array, lon: Array) -> Array:
    """Return the height of a geoid above the WGS84 ellipsoid.

    Parameters
    ----------
    geoid : Path
        Grid of geoid heights (GeoTIFF, .gtx, ...).
    lat, lon : ndarray, (n,)
        Geodetic latitude and longitude, rad.

    Returns
    -------
    ndarray, (n,)
        Geoid undulation, m.

    Raises
    ------
    UsageError
        Where the file does not exist.
    InputError
        For a grid that PROJ does not read or that does not reach the points.
    """
    grid = geoid_file(geoid)
    return -transform_points(
        geoid_transformer(grid), above(grid), np.degrees(lon), np.degrees(lat), np.zeros(lat.size)
    )[2]


def above(geoid: Path) -> str:
    """Return what heights above a geoid are called.

    Parameters
    ----------
    geoid : Path
        Its grid.

    Returns
    -------
    str
        Such as "above the geoid us_noaa_g2018u0.tif".
    """
    return f"above the geoid {geoid.name}"


def above_ellipsoid(crs: Any) -> str:
    """Return what heights above the ellipsoid of a datum are called.

    Parameters
    ----------
    crs : pyproj.CRS
        Geographic CRS of the datum.

    Returns
    -------
    str
        Such as "above the ellipsoid of WGS84".
    """
    return f"above the ellipsoid of {'WGS84' if crs.name == 'WGS 84' else crs.name}"


def geoid_transformer(geoid: Path) -> Any:
    """Return PROJ's step from ellipsoidal heights to those above the geoid.

    Parameters
    ----------
    geoid : Path
        Grid of geoid heights.

    Returns
    -------
    pyproj.Transformer
        It takes longitude and latitude, deg, and height, m.

    Raises
    ------
    InputError
        For a file that PROJ does not read.
    """
    from pyproj import Transformer
    from pyproj.exceptions import ProjError

    shift = f'+step +inv +proj=vgridshift +grids="{geoid}" +multiplier=1'
    try:
        return Transformer.from_pipeline(
            f"+proj=pipeline +step +proj=unitconvert +xy_in=deg +xy_out=rad {shift}"
        )
    except ProjError:
        raise InputError(
            f"{geoid}: is no grid of geoid heights that PROJ reads; give a GeoTIFF or .gtx"
        ) from None


def transformer_between(source: Any, target: Any) -> Any:
    """Return PROJ's best transformation between two CRS, never one that leaves the datum out.

    Parameters
    ----------
    source, target : pyproj.CRS
        The two CRS.

    Returns
    -------
    pyproj.Transformer
        It takes and gives longitude before latitude, easting before northing.

    Raises
    ------
    InputError
        Where there is none, or its grid is not installed.
    """
    from pyproj import Transformer
    from pyproj.exceptions import ProjError

    try:
        return Transformer.from_crs(
            source, target, always_xy=True, allow_ballpark=False, only_best=True
        )
    except ProjError as error:
        why = " ".join(str(error).split())
        if "not available" not in why:
            of_use = "" if target.area_of_use is None else f", made for {target.area_of_use.name}"
            why = why[:200].removeprefix("Error creating Transformer from CRS.")
            why = why or f"PROJ knows no transformation from {source.name} to this CRS{of_use}"
            raise InputError(f"CRS {target.name}: {why.rstrip('.')}; give another CRS") from None
        grid = why.rpartition("Grid ")[2].partition(" is not")[0]
        advice = (
            "name a geoid file and a horizontal CRS instead, or get the grid by"
            f" `pyproj sync --file {grid}`; {DOCTOR}"
        )
        raise InputError(f"CRS {target.name}: its grid {grid} is not installed; {advice}") from None


def transform_points(
    transformer: Any,
    name: str,
    x: Array,
    y: Array,
    z: Array,
    inverse: bool = False,
    epoch: float | None = None,
) -> tuple[Array, Array, Array]:
    """Return points transformed by PROJ.

    Parameters
    ----------
    transformer : pyproj.Transformer
        The transformation.
    name : str
        What does not reach the points where it fails: a CRS or a grid.
    x, y, z : ndarray, (n,)
        Coordinates: longitude and latitude in degrees.
    inverse : bool
        Whether from target to source.
    epoch : float, optional
        Decimal year of the points.

    Returns
    -------
    tuple of ndarray
        The three coordinates, each (n,).

    Raises
    ------
    InputError
        Where the transformation does not reach a point.
    """
    from pyproj.exceptions import ProjError

    epochs = () if epoch is None else (np.full(np.shape(x), epoch),)
    try:
        out = transformer.transform(
            x, y, z, *epochs, errcheck=True, direction="INVERSE" if inverse else "FORWARD"
        )[:3]
    except ProjError as error:
        raise InputError(
            f"{name} does not reach the flight: {' '.join(str(error).split())[:160]}; give another"
            " CRS or grid"
        ) from None
    out = tuple(np.asarray(v, dtype=np.float64) for v in out)
    if not all(np.isfinite(v).all() for v in out):
        raise InputError(f"{name} does not reach the flight; give another CRS or grid")
    return out
