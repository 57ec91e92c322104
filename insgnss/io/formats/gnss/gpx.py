"""Tracks of GPX 1.0 and 1.1: the points of all tracks and segments, data_specs/gpx.md.

Times are UTC. Elevations are above the sea, and become heights above the ellipsoid by the point's
geoidheight or the caller's undulation; without both they stay as they are, with a note.
"""

from collections.abc import Sequence
from xml.etree.ElementTree import Element

import numpy as np

from ....base.errors import InputError
from ....records import Array, Finding, GnssFixes
from ..read_options import STATED_NOTHING, ReadOptions
from ..text.dates import UNIX, seconds_of_dates
from ..text.numbers import finite
from ..text.order import NumberedRows, note, refuse_rows
from ..text.text import Source, load_bytes
from ..text.xml import parse_xml
from .fixes import FixScales, fixes_from_columns

GPX_ELEMENTS = {"sat": "satellites", "hdop": "hdop", "pdop": "pdop", "ageofdgpsdata": "age_s"}
TRACK_POINT = "trkpt"


def is_gpx(head: bytes) -> bool:
    """Tell whether the first bytes of a file are those of a GPX document."""
    return b"<gpx" in head and head.lstrip(b"\xef\xbb\xbf \t\r\n").startswith(b"<")


def read_gpx(path: Source, options: ReadOptions = STATED_NOTHING) -> GnssFixes:
    """Read the points of the tracks as fixes in GPST.

    Parameters
    ----------
    path : path
        The document.
    options : ReadOptions
        `sigma_m`, which GPX has none of; `undulation_m` of points without geoidheight.

    Returns
    -------
    GnssFixes
        The fixes.

    Raises
    ------
    InputError
        What cannot be read, with the number of the point.
    """
    root = parse_xml(path, load_bytes(path).tobytes())
    points = [element for element in root.iter() if _name(element.tag) == TRACK_POINT]
    if not points:
        raise InputError.in_file(path, "holds no point of a track (trkpt); export the track")
    lines = NumberedRows(str(path), TRACK_POINT)
    texts = [{_name(child.tag): (child.text or "").strip() for child in p} for p in points]
    stamps = seconds_of_dates([text.get("time", "") for text in texts])
    if stamps is None:
        row = next(k for k, t in enumerate(texts) if seconds_of_dates([t.get("time", "")]) is None)
        problem = f"time {texts[row].get('time', '')!r} is no date in UTC, such as"
        raise lines.error_at(row, f"{problem} 2018-07-03T07:31:10.2Z; export it with times")
    columns = {"lat": _column(points, "lat"), "lon": _column(points, "lon")}
    columns["h"] = _column(texts, "ele")
    for name, column in columns.items():
        message = f"{'ele' if name == 'h' else name} is no number; correct or delete the point"
        refuse_rows(lines, ~np.isfinite(column), message)
    geoid = _column(texts, "geoidheight")
    above = np.where(np.isfinite(geoid), geoid, options.undulation_m or 0.0)
    notes: tuple[Finding, ...] = ()
    if options.undulation_m is None and not np.isfinite(geoid).all():
        finding = "GPX elevations, usually above sea level, were taken as above the ellipsoid"
        advice = "set undulation_m: 0 if they are, else the geoid's height above the ellipsoid"
        notes = (note("GNSS position", finding, "heights above the ellipsoid", advice),)
    described = {role: _column(texts, name) for name, role in GPX_ELEMENTS.items()}
    cols = {"tow": stamps, **columns, "h": columns["h"] + above, **described}
    scales = FixScales(angle=np.pi / 180.0, time=UNIX)
    return fixes_from_columns(cols, lines, scales, options, notes=notes)


def _column(rows: Sequence[Element | dict[str, str]], name: str) -> Array:
    """Return the numbers of a name; not-a-number where a row has none."""
    return np.array([finite(row.get(name)) for row in rows])


def _name(tag: str) -> str:
    """The name of an element without its name space."""
    return tag.rpartition("}")[2]
