"""What a file of fixes says of its heights: above the ellipsoid, above the geoid, or nothing.

Above the geoid taken for above the ellipsoid is an error of the geoid's height of every image, 50 m
in the Alps, which no other sensor sees. The name of the column and the comments before the table
are believed; names that stand for both (altitude, elevation) make a note.
"""

import re
from collections.abc import Sequence

from ....base.errors import InputError
from ....base.files import lines_of
from ....base.inputs import first_bytes
from ....records import Finding
from ..text.headers import normalise_header
from ..text.layout import decode, is_comment, quote
from ..text.order import note

COMMENT_BYTES = 1 << 12  # bytes from the file's start in which comments are looked for (chosen)
_GEOID = re.compile(
    r"(?<![a-z])a?msl(?![a-z])|(alt|height|hgt|h)_?msl|orthom|h_?orth|geoid|sea_?level"
    r"|egm_?(84|96|08|2008)|navd_?88|dhhn"
)
_ELLIPSOID = re.compile(r"ell(ips|_|h|$)|_ell|hae")
_EITHER = re.compile(r"(gps_?|gnss_?)?(alt|altitude|elev|elevation|ele)(_?m)?")
_STATED = re.compile(
    r"(above|over)\s+(the\s+)?(geoid|(mean\s+)?sea[\s-]+level|msl)|orthometric|\ba?msl\b|\begm\d+",
    re.IGNORECASE,
)
GIVE = (
    "give heights above the ellipsoid, or the geoid's height above the ellipsoid, gnss.undulation_m"
    " (compare: --undulation-a, --undulation-b)"
)


def settled_undulation(
    path: object,
    line: int | None,
    fields: Sequence[str],
    undulation_m: float | None,
    commented: bool = False,
) -> tuple[float, tuple[Finding, ...]]:
    """Return what is to be added to the heights of a table, and what is to be said of them.

    Parameters
    ----------
    path : path
        The file.
    line : int, optional
        The header's line.
    fields : sequence of str
        What the file calls the column of heights; empty where it gives no names.
    undulation_m : float, optional
        Geoid above the ellipsoid, m, as the caller states it; 0 for heights above the ellipsoid
        whatever the file calls them.
    commented : bool
        Whether the file is text, whose comments are read.

    Returns
    -------
    float
        The geoid's height to add, m.
    tuple of Finding
        A note where the name stands for heights of both kinds.

    Raises
    ------
    InputError
        Heights above the geoid without `undulation_m`, and heights above the ellipsoid with one
        that is not zero.
    """
    names = [normalise_header(field)[0] for field in fields]
    above_geoid = next((f for f, n in zip(fields, names, strict=True) if _GEOID.search(n)), None)
    above_ellipsoid = above_geoid is None and any(map(_ELLIPSOID.search, names))
    if undulation_m is not None:
        if above_ellipsoid and undulation_m != 0.0:
            raise InputError.at_line(
                path, line, above_already(f"heights {quote(fields[0])}", undulation_m)
            )
        return undulation_m, ()
    if above_geoid is not None:
        problem = f"heights {quote(above_geoid)} are above the geoid, not the ellipsoid"
        raise InputError.at_line(path, line, f"{problem}; {GIVE}")
    if commented and not above_ellipsoid and (statement := _stated_geoid(path)):
        row, text = statement
        problem = f"heights are above the geoid, not the ellipsoid, according to {quote(text)}"
        raise InputError.at_line(path, row, f"{problem}; {GIVE} (0 where the comment is wrong)")
    if names and _EITHER.fullmatch(names[0]):
        finding = f"the heights {quote(fields[0])} were taken as above the ellipsoid"
        advice = "set gnss.undulation_m: 0 if they are ellipsoidal, else the height of the geoid"
        return 0.0, (note("GNSS position", finding, "a name that states the surface", advice),)
    return 0.0, ()


def refused_heights(path: object, fields: Sequence[str], commented: bool = False) -> str:
    """Return the reason for which the heights of a table are refused without a geoid's height.

    Parameters
    ----------
    path, fields, commented
        As in `settled_undulation`.

    Returns
    -------
    str
        Why they are above the geoid; empty where nothing says so.
    """
    try:
        settled_undulation("", None, fields, None)
    except InputError:
        return f"heights {quote(fields[0])} are above the geoid"
    statement = _stated_geoid(path) if commented else None
    return f"heights are above the geoid according to {quote(statement[1])}" if statement else ""


def above_already(heights: str, undulation_m: float) -> str:
    """Return the refusal of a geoid's height for `heights` that are above the ellipsoid."""
    return f"{heights} are above the ellipsoid already; remove gnss.undulation_m = {undulation_m:g}"


def comments_in(path: object) -> list[tuple[int, str]]:
    """Return the comments at the begin of a file, with their lines."""
    head = lines_of(decode(first_bytes(str(path), COMMENT_BYTES)))
    return [(line, text.strip()) for line, text in enumerate(head, 1) if is_comment(text)]


def _stated_geoid(path: object) -> tuple[int, str] | None:
    """Return the comment before the table that puts heights above the geoid, with its line.

    None where a comment speaks of an ellipsoid, too.
    """
    comments = comments_in(path)
    if any("ellips" in text.lower() for _, text in comments):
        return None
    return next(((k, text) for k, text in comments if _STATED.search(text)), None)
