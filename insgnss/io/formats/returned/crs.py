"""The CRS that a program's file names by its well-known text or its code."""

import re
from math import isnan
from typing import Any

import numpy as np

from ....base.errors import InputError, UsageError
from ....base.inputs import first_bytes
from ....geodesy.crs import crs_of, is_projected
from ....geodesy.frames import rotation_em
from ....geodesy.rotation import rotation_from_opk
from ....records.framed import GEOCENTRIC, GEOGRAPHIC, PROJECTED, TANGENT
from ..origins import ORIGIN_BYTES, origin_in, statement_of
from ..text.layout import quote
from ..text.numbers import finite
from ..text.text import Source
from .poses import Array

WGS84_A = 6378137.0  # semi-major axis of WGS 84 and GRS 80 (m): their definitions
SAME_AXIS_M = 1.0  # difference up to which an ellipsoid is one of them: the nearest other has 2 m
STEP_DEG = 1e-5  # northward way over which the direction of north in the map is measured: 1 m
WGS84_NAME = "World Geodetic System 1984"  # name of its datum, an ensemble as well
COORDINATE_SYSTEM = re.compile(r"#\s*coordinatesystem:(.*)", re.IGNORECASE)  # of Metashape
LOCAL_CRS = re.compile(r"^(LOCAL_CS|ENGCRS|ENGINEERINGCRS|LOCALCS)\b", re.IGNORECASE)


def kind_of_wkt(text: str, path: Source) -> tuple[str, str]:
    """Return the kind of frame, and the CRS in words that `MapProjection` takes.

    Programs write the datum's shift into the text (TOWGS84), which PROJ would take for a CRS bound
    to it; where the registry has the CRS its code stands for it.

    Parameters
    ----------
    text : str
        Well-known text or code; a local one, or none, is of no kind.
    path : path
        The file, for the message.

    Returns
    -------
    kind : str
        Of `records.framed.KINDS`, empty of a local one.
    crs : str
        Code or well-known text of a projected CRS, and of a geographic one that is not WGS 84;
        else empty.

    Raises
    ------
    InputError
        A text that is no CRS.
    """
    if not text or LOCAL_CRS.match(text):
        return "", ""
    try:
        crs = crs_of(text)
    except UsageError:
        raise InputError.in_file(
            path, f"the CRS {quote(text)} is unknown; name it by --crs EPSG:..."
        ) from None
    return kind_of_crs(crs)


def stated_crs(path: Source) -> str | None:
    """Return the frame that the head of a table states, as `GroundAxes` takes it.

    Parameters
    ----------
    path : path
        The table.

    Returns
    -------
    str or None
        The origin of a tangent plane, as of `stated_plane`, or what Metashape writes behind "#
        CoordinateSystem:"; None of a local one, and without either.

    Raises
    ------
    InputError
        A text that is no CRS, or an origin that is none.
    """
    plane = origin_in(path)
    if plane is not None:
        return statement_of(plane)
    beginning = first_bytes(path, ORIGIN_BYTES).decode("latin-1")
    wkt = COORDINATE_SYSTEM.match(beginning)
    kind, crs = ("", "") if wkt is None else kind_of_wkt(wkt[1].strip(), path)
    return crs or ("EPSG:4979" if kind == GEOGRAPHIC else None)


def kind_of_crs(crs: Any) -> tuple[str, str]:
    """Return the kind of frame of a CRS, and the CRS in words, as `kind_of_wkt` does.

    Parameters
    ----------
    crs : pyproj.CRS
        Perhaps with a vertical part, or bound to another datum by TOWGS84.

    Returns
    -------
    kind, crs : str
        As there.
    """
    parts = [_unbound(piece) for piece in (crs.sub_crs_list or [crs])]
    if parts[0].is_geocentric:
        return GEOCENTRIC, ""
    kind = PROJECTED if is_projected(parts[0]) else GEOGRAPHIC
    if kind == GEOGRAPHIC and len(parts) == 1 and WGS84_NAME in parts[0].datum.name:
        return GEOGRAPHIC, ""
    codes = [piece.to_authority() for piece in parts]
    if all(code is not None and code[0] == "EPSG" for code in codes):
        return kind, "EPSG:" + "+".join(str(code[1]) for code in codes)
    return kind, str(parts[0].to_wkt() if len(parts) == 1 else crs.to_wkt())


def _unbound(crs: Any) -> Any:
    return crs.source_crs if crs.is_bound else crs


def of_other_ellipsoid(text: str, x: Array, path: Source) -> tuple[str, str, Array, Array] | None:
    """Return geocentric points of the datum of a CRS as coordinates of that CRS.

    A program without datum shifts has geocentric axes of the ellipsoid that the CRS is of, such as
    Bessel's: as coordinates of WGS 84 they lie hundreds of metres off.

    Parameters
    ----------
    text : str
        Well-known text of the CRS.
    x : ndarray, (n, 3)
        Points, m.
    path : path
        The file, for the message.

    Returns
    -------
    tuple, or None
        Kind and CRS as `kind_of_wkt` returns them; coordinates (n, 3) in its unit, or longitude,
        latitude, rad, height; and rotations (n, 3, 3) of geocentric axes into its axes there. None
        of the ellipsoids of WGS 84 and GRS 80.

    Raises
    ------
    InputError
        As `kind_of_wkt`.
    """
    kind, definition = kind_of_wkt(text, path)
    if not definition:
        return None
    from pyproj import CRS, Transformer

    crs = CRS.from_user_input(definition)
    ellipsoid: Any = crs.ellipsoid
    if abs(ellipsoid.semi_major_metre - WGS84_A) < SAME_AXIS_M:
        return None
    axes = f"+a={ellipsoid.semi_major_metre!r} +rf={ellipsoid.inverse_flattening!r}"
    degrees = "+step +proj=unitconvert +xy_in=rad +xy_out=deg"
    to_degrees = Transformer.from_pipeline(f"+proj=pipeline +step +inv +proj=cart {axes} {degrees}")
    lon, lat, height = (np.asarray(values) for values in to_degrees.transform(*x.T))
    C_Ee = rotation_em(np.radians(lat), np.radians(lon)).swapaxes(1, 2)
    if kind == GEOGRAPHIC:
        return kind, definition, np.column_stack([np.radians(lon), np.radians(lat), height]), C_Ee
    plan = _unbound((crs.sub_crs_list or [crs])[0])
    to_map = Transformer.from_crs(plan.geodetic_crs, plan, always_xy=True)
    east, north = to_map.transform(lon, lat)
    east_step, north_step = (
        a - b for a, b in zip(to_map.transform(lon, lat + STEP_DEG), (east, north), strict=True)
    )
    angle, zero = np.arctan2(-east_step, north_step), np.zeros((len(x), 2))
    C_fE = rotation_from_opk(np.column_stack([zero, angle]))
    unit_m = plan.axis_info[0].unit_conversion_factor
    return kind, definition, np.column_stack([east, north, height / unit_m]), C_fE @ C_Ee


def kind_of_definition(text: str, path: Source) -> tuple[str, str, tuple[float, ...]]:
    """Return kind, CRS and origin of a reference system of BlocksExchange.

    Parameters
    ----------
    text : str
        `ENU:latitude,longitude[,height]`, deg and m, a code, or well-known text.
    path : path
        The file, for the message.

    Returns
    -------
    kind, crs : str
        As `kind_of_wkt` returns them.
    origin : tuple of float
        Latitude and longitude, deg, and height, m, of a tangent plane.

    Raises
    ------
    InputError
        A text that is none of these.
    """
    if text.upper().startswith("ENU:"):
        origin = tuple(finite(word) for word in text[4:].split(","))
        if len(origin) not in (2, 3) or not abs(origin[0]) <= 90.0 or any(map(isnan, origin)):
            problem = f"{quote(text)} is not ENU:latitude,longitude; give both in degrees"
            raise InputError.in_file(path, problem)
        return TANGENT, "", (*origin, 0.0)[:3]
    return (*kind_of_wkt(text, path), ())
