"""Origins of tangent planes, as headers of files and options state them."""

import re

import numpy as np

from ...base.errors import InputError, UsageError
from ...base.inputs import Source, opened_text
from ...geodesy.frames import TangentPlane
from .text.layout import quote
from .text.numbers import PLAIN, finite

ORIGIN_BYTES = 16384  # characters of a table in which its comments stand (chosen)
ORIGIN_NUMBER = r"(\S*\d\S*?)"
ORIGIN_FORMS = (
    rf"latitude {ORIGIN_NUMBER}(?: deg)?,? longitude {ORIGIN_NUMBER} deg,?(?: [a-z]+ height)? "
    rf"{ORIGIN_NUMBER} m",
    rf"origin {ORIGIN_NUMBER} {ORIGIN_NUMBER} deg {ORIGIN_NUMBER} m",
)


def stated_plane(text: str) -> TangentPlane | None:
    """Return the tangent plane whose origin a text states; None where it states none.

    Parameters
    ----------
    text : str
        With `latitude 46.57 deg, longitude 6.54 deg, ... height 0 m`, or `origin 46.57 6.54 deg 0
        m`.

    Returns
    -------
    TangentPlane or None
        The plane.

    Raises
    ------
    UsageError
        What stands there is no number.
    """
    origin = next((match for form in ORIGIN_FORMS if (match := re.search(form, text))), None)
    if origin is None:
        return None
    lat, lon, height = map(finite, origin.groups())
    if np.isnan([lat, lon, height]).any() or not (abs(lat) <= 90.0 and abs(lon) <= 360.0):
        problem = f"{quote(origin[0])} is no origin of a tangent plane"
        raise UsageError(f"{problem}; {PLAIN}, angles in degrees")
    return TangentPlane(np.radians(lat), np.radians(lon), height)


def statement_of(plane: TangentPlane) -> str:
    """Return the origin of a tangent plane as `stated_plane` reads it, to a tenth of a millimetre.

    Parameters
    ----------
    plane : TangentPlane
        The plane.

    Returns
    -------
    str
        Such as "origin 46.5700000000 6.5400000000 deg 0.0000 m".
    """
    lat, lon = np.degrees([plane.lat, plane.lon])
    return f"origin {lat:.10f} {lon:.10f} deg {plane.height:.4f} m"


def origin_in(path: Source) -> TangentPlane | None:
    """Return the tangent plane whose origin a header states; None where it states none.

    Parameters
    ----------
    path : path
        The file.

    Returns
    -------
    TangentPlane or None
        The plane.

    Raises
    ------
    InputError
        What stands there is no number.
    """
    with opened_text(path, errors="replace") as stream:
        head = "".join(line for line in stream.readlines(ORIGIN_BYTES) if line.startswith("#"))
    try:
        return stated_plane(head)
    except UsageError as error:
        raise InputError.in_file(path, f"the header's {error}") from None
