"""The header of an RTKLIB .pos, and the layouts of files without one.

RTKLIB writes legend lines (`% (lat/lon/height=WGS84/ellipsoidal,...)`), options, and the line that
names the columns, whose first name is the time scale. Separators stand between all values, angles
of degrees, minutes and seconds being three, but not between date and time of day. Without header
(out-outhead = off) its layouts are known by the number of fields: 15, or 24 with velocities.
"""

import re
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ....base.errors import InputError
from ....base.files import lines_of
from ....records import Array
from ..text.layout import NUMBER, decode, float_of, is_comment, quote
from ..text.text import Source

POS_DATE = re.compile(rb"^([ \t]*\d{4})/(\d\d?)/(\d\d?)[ \t]+(\d\d?):(\d\d?):", re.MULTILINE)
POSITION_COLUMNS = {
    "latitude": ("latitude", "longitude", "height"),
    "x-ecef": ("x-ecef", "y-ecef", "z-ecef"),
    "e-baseline": ("e-baseline", "n-baseline", "u-baseline"),
}
ROOTS = {
    "latitude": ("sdn", "sde", "sdu", "sdne", "sdeu", "sdun"),
    "x-ecef": ("sdx", "sdy", "sdz", "sdxy", "sdyz", "sdzx"),
    "e-baseline": ("sde", "sdn", "sdu", "sden", "sdnu", "sdue"),
}
# RTKLIB's columns that describe a solution, and those of other programs in its layout
SOLUTION_COLUMNS = {
    "ns": "satellites",
    "ratio": "ratio",
    "age": "age_s",
    "pdop": "pdop",
    "hdop": "hdop",
}
VELOCITY_COLUMNS = {
    "latitude": ("vn", "ve", "vu"),
    "x-ecef": ("vx", "vy", "vz"),
    "e-baseline": ("ve", "vn", "vu"),
}
VELOCITY_ROOTS = {kind: tuple(f"sdv{name[2:]}" for name in names) for kind, names in ROOTS.items()}
_OTHER_NAMES = {"latitude": {"sdue": "sdun", "sdvue": "sdvun"}}  # RTKLIB's own older spelling
_WEEK_TOW = re.compile(r"\s*\d{1,4}[\s,;]+\d{1,6}\.\d*[\s,;]", re.ASCII)
POS_SCALES = ("GPST", "UTC", "JST")
PLAIN_FIELDS = (15, 24)  # fields of RTKLIB's lines without header: of positions; with velocities


@dataclass(frozen=True)
class Header:
    """The header of a file.

    Attributes
    ----------
    kind : str
        Kind of coordinates, a key of `POSITION_COLUMNS`.
    names : tuple of str
        Column names.
    scale : str
        Time scale.
    ellipsoidal : bool
        Whether heights are above the ellipsoid.
    sexagesimal : bool
        Whether angles are in degrees, minutes and seconds.
    dated : bool
        Whether time is a date.
    base : tuple of float, optional
        The base's position (3,): latitude, longitude, deg, height, m, or geocentric, m.
    stated : bool
        Whether there is a header.
    """

    kind: str
    names: tuple[str, ...]
    scale: str
    ellipsoidal: bool
    sexagesimal: bool
    dated: bool
    base: tuple[float, ...] | None
    stated: bool = True

    @property
    def columns(self) -> list[str]:
        """Names of the fields: year ... second or week, tow; parts of sexagesimal angles apart."""
        names = ["week", "tow"]
        if self.dated:
            names = ["year", "month", "day", "hour", "minute", "second"]
        for name in self.names:
            if self.sexagesimal and name in ("latitude", "longitude"):
                names += [f"{name}:{component}" for component in "dms"]
            else:
                names.append(_OTHER_NAMES.get(self.kind, {}).get(name, name))
        return names


def is_rtklib_pos(head: bytes) -> bool:
    """Tell whether the first bytes of a file are RTKLIB's.

    They hold a header that names its columns, or lines laid out as RTKLIB does without one.
    """
    text = decode(head)
    lines = [line for line in lines_of(text) if line.strip()]
    if any(line.startswith("%") and _names_position(line) for line in lines):
        return True
    data = [line for line in lines if not is_comment(line)]
    return bool(data) and _plain_layout(data[0]) is not None


def _names_position(line: str) -> bool:
    return any(f"{name}(" in line for name in POSITION_COLUMNS)


def _plain_layout(line: str) -> bool | None:
    """Tell whether a line of RTKLIB without header begins with a date; None for any other line."""
    dated = POS_DATE.match(line.encode("utf-8", "replace")) is not None
    if not dated and not _WEEK_TOW.match(line):
        return None
    fields = re.split(r"[\s,;]+", line.strip())
    if (
        len(fields) not in PLAIN_FIELDS
        or not all(NUMBER.fullmatch(field) for field in fields[2:])
        or not re.fullmatch(r"[0-7]", fields[5])
        or not re.fullmatch(r"[0-9]{1,3}", fields[6])
    ):
        return None
    return dated


def read_header(path: Source, buf: NDArray[np.uint8]) -> Header:
    """Read the header of the file in `buf`.

    Raises
    ------
    InputError
        No header and lines that are not RTKLIB's, or two headers that differ.
    """
    data = buf.tobytes()
    comments = [decode(line) for line in re.findall(rb"^[ \t]*%[^\r\n]*", data, re.MULTILINE)]
    column_lines = [line for line in comments if _names_position(line)]
    data_line = next((m for m in re.finditer(rb"^[ \t]*[^\s%][^\r\n]*", data, re.MULTILINE)), None)
    first = decode(data_line[0]) if data_line else ""
    if not column_lines:
        return _without_header(path, first)
    if len({" ".join(line.split()) for line in column_lines}) > 1:
        problem = (
            f"holds {len(column_lines)} headers that differ; was it put together from two files"
        )
        raise InputError.in_file(path, f"{problem}? split it")
    kind = next(name for name in POSITION_COLUMNS if f"{name}(" in column_lines[0])
    tokens = re.findall(r"[^\s,;]+", re.sub(r"\([^)]*\)", "", column_lines[0].strip().lstrip("% ")))
    geodetic = any("WGS84/geodetic" in line for line in comments)
    dated = POS_DATE.match(first.encode("utf-8", "replace")) is not None
    if tokens[0] not in POS_SCALES:
        problem = f"time scale {quote(tokens[0])} is none of {', '.join(POS_SCALES)}"
        raise InputError.in_file(path, f"{problem}; let RTKLIB write GPST")
    sexagesimal = "(d'\")" in column_lines[0]
    names, base = tuple(tokens[1:]), _base(path, comments)
    return Header(kind, names, tokens[0], not geodetic, sexagesimal, dated, base)


def _without_header(path: Source, first: str) -> Header:
    dated = _plain_layout(first)
    if dated is None:
        message = (
            "no RTKLIB header (% GPST latitude(deg) ...); write it (out-outhead = on), or rename"
            " the file to .txt"
        )
        raise InputError.in_file(path, message)
    fields = re.split(r"[\s,;]+", first.strip())
    kind = "x-ecef" if max(abs(float(v)) for v in fields[2:5]) > 1e5 else "latitude"
    names = [*POSITION_COLUMNS[kind], "Q", "ns", *ROOTS[kind], "age", "ratio"]
    if len(fields) == PLAIN_FIELDS[1]:
        names += [*VELOCITY_COLUMNS[kind], *VELOCITY_ROOTS[kind]]
    return Header(kind, tuple(names), "GPST", True, False, dated, None, stated=False)


def _base(path: Source, comments: list[str]) -> tuple[float, ...] | None:
    """The three numbers of `% ref pos :`, degrees and metres; None without such a line."""
    line = next((line for line in comments if re.match(r"\s*%\s*ref pos\s*:", line)), None)
    if line is None:
        return None
    numbers = [float_of(text) for text in re.split(r"[\s,;]+", line.partition(":")[2].strip())]
    if None in numbers or len(numbers) not in (3, 7):
        message = f"{quote(line.strip())} is no position of the base; correct or delete the line"
        raise InputError.in_file(path, message)
    values = [x for x in numbers if x is not None]
    if len(values) == 3:
        return tuple(values)
    lat, lon = (float(degrees_of(*np.array(values[k : k + 3]))) for k in (0, 3))
    return (lat, lon, values[6])


def degrees_of(d: Array, m: Array, s: Array) -> Array:
    """Return degrees of degrees, minutes and seconds, whose sign stands before the degrees."""
    return np.copysign(np.abs(d) + m / 60.0 + s / 3600.0, d)
