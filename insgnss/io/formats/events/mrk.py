"""Camera events of DJI and Autel drones (Timestamp.MRK), data_specs/mrk.md.

One line an exposure: number, time of week, [week], offsets of the camera from the antenna north,
east, down (mm), latitude, longitude, height of the camera, standard deviations north, east, up and
the quality of the fix, each value with or without its name:

    1  275295.301059  [2024]  -26,N  19,E  191,V  -36.41144502,Lat  174.63075195,Lon
        170.415,Ellh  1.492559, 1.368525, 3.180128  16,Q

The line is read as its numbers and names, whatever separates them. A flight's positions come from
`gnss.file`; what the drone itself computed of the camera at the exposure is for blocks without one.
"""

import re
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from ....base.errors import InputError
from ....records import Array, CameraEvents
from ..gnss.fixes import FIX_SIGMAS
from ..read_options import STATED_NOTHING, ReadOptions
from ..text.clock import examined_time
from ..text.layout import BINARY, decode, is_binary, quote
from ..text.order import AtLines
from ..text.text import TRUNCATED, FileLine, Source, data_lines, load
from .events import events_in_order

_WEEK = re.compile(r"\[\s*([0-9]+)\s*\]")
_MRK_TOKEN = re.compile(r"[^\s,;]+")
MRK_NAMES = ("n", "e", "v", "lat", "lon", "ellh", "q")
MRK_OFFSET = ("n", "e", "v")
# antenna to camera (m): drones are smaller, a longer one is not in millimetres
LONGEST_OFFSET_M = 5.0
MRK_PLACE = ("lat", "lon", "ellh")
# largest number, week or quality: six digits, more than any drone counts (chosen)
LARGEST_NUMBER = 999999
LEAST_MRK_VALUES = 2  # values of a line without names: number and time of week (format)


@dataclass(frozen=True, eq=False)
class MrkFile(AtLines):
    """What the lines hold of the exposures' times.

    Attributes
    ----------
    path : str
        The file.
    lines : tuple of int
        The line of each row.
    number, week : ndarray
        (n,) number and GPS week (-1 without a week).
    tow : ndarray
        (n,) time of week, s.
    offset_ned : ndarray, optional
        (n, 3) m, camera minus antenna, north, east, down; None where the lines do not state it.
    camera : ndarray, optional
        (n, 3) latitude, longitude, deg, height above the ellipsoid, m; None likewise.
    sigma_neu : ndarray, optional
        (n, 3) m, standard deviations north, east, up; None likewise.
    """

    path: str
    lines: tuple[int, ...]
    number: NDArray[np.int64]
    tow: Array
    week: NDArray[np.int64]
    offset_ned: Array | None = None
    camera: Array | None = None
    sigma_neu: Array | None = None


def is_mrk(beginning: bytes) -> bool:
    """Tell whether the first bytes of a file are those of an .MRK.

    Its numbers have names behind commas, such as `-26,N`.
    """
    return (
        re.search(
            rb"^[ \t]*\d+[ \t,;]+\d+\.\d*[^\n]*[\d.][ \t]*,[ \t]*(?:Lat|Ellh|[NEVQ])\b",
            beginning,
            re.MULTILINE,
        )
        is not None
    )


def read_mrk(path: Source) -> MrkFile:
    """Read every line.

    Raises
    ------
    InputError
        The first line that is no event, or of another kind than the first, with file and line.
    """
    buf, complete = load(path)
    rows, lines = [], []
    content = decode(bytes(buf[:-1]))
    for line, text in data_lines(path, content):
        rows.append(_values(line, text))
        lines.append(line)
    if not rows:
        raise InputError.in_file(path, "holds no event; check that the file was copied whole")
    for row, line in zip(rows, lines, strict=True):
        if row.keys() != rows[0].keys():
            differ = " ".join(sorted(row.keys() ^ rows[0].keys()))
            cut = "truncated: the file ends within this line; " if line == lines[-1] else ""
            as_first = f"expected {len(rows[0])} as in line {lines[0].number}"
            problem = f"{cut}{len(row)} values, {as_first} (differing: {differ})"
            raise line.error(f"{problem}; copy the file again")
    if not complete and content.rpartition("\n")[2].strip() and "q" not in rows[-1]:
        raise lines[-1].error(TRUNCATED)
    number, tow, week = (
        np.array([row.get(name, -1.0) for row in rows]) for name in ("number", "tow", "week")
    )
    offset, camera, sigma = (
        np.array([[row[name] for name in names] for row in rows])
        if all(name in rows[0] for name in names)
        else None
        for names in (MRK_OFFSET, MRK_PLACE, FIX_SIGMAS)
    )
    numbers = tuple(line.number for line in lines)
    return MrkFile(
        *(str(path), numbers, number.astype(np.int64), tow, week.astype(np.int64)),
        *(None if offset is None else 1e-3 * offset, camera, sigma),
    )


def _values(line: FileLine, text: str) -> dict[str, float]:
    """Return the values of a line by name.

    Those without a name are number, time of week, and then three standard deviations.
    """
    if is_binary(text):
        raise line.error(f"is no text; {BINARY}")
    row: dict[str, float] = {}
    if week := _WEEK.search(text):
        row["week"] = line.value(week[1])
        text = text[: week.start()] + " " + text[week.end() :]
    tokens, unnamed, i = _MRK_TOKEN.findall(text), [], 0
    while i < len(tokens):
        value = line.value(tokens[i])
        name = tokens[i + 1].lower() if i + 1 < len(tokens) else ""
        if name in MRK_NAMES:
            if name in row:
                raise line.error(f"{tokens[i + 1]} stands twice; correct or delete the line")
            row[name] = value
        else:
            unnamed.append(value)
        i += 2 if name in MRK_NAMES else 1
    if len(unnamed) not in (LEAST_MRK_VALUES, LEAST_MRK_VALUES + 3):
        message = (
            f"{len(unnamed)} values without a name; five are expected (number, time of week, three"
            " standard deviations) or two (number, time of week)"
        )
        raise line.error(f"{message}: {quote(text.strip())}; copy the file again")
    row |= dict(zip(("number", "tow", *FIX_SIGMAS), unnamed, strict=False))
    for name in ("number", "week", "q"):
        value = row.get(name, 0.0)
        if not (value.is_integer() and 0.0 <= value <= LARGEST_NUMBER):
            problem = f"{name} {value:g} is no whole number from 0 to {LARGEST_NUMBER}"
            raise line.error(f"{problem}; correct or delete the line")
    return row


def read_events_mrk(path: Source, options: ReadOptions = STATED_NOTHING) -> CameraEvents:
    """Read the exposures; images are named by their number in the file.

    Where the lines state the offset from antenna to camera, the events have it.
    """
    mrk = read_mrk(path)
    week = mrk.week.astype(np.float64) if (mrk.week >= 0).all() else None
    time, gps_week, notes = examined_time(mrk, mrk.tow, week, "event rows", options.gps_week, "s")
    names = tuple(str(k) for k in mrk.number.tolist())
    events = events_in_order(names, time, mrk, gps_week, notes)
    if mrk.offset_ned is None:
        return events
    if (too_long := np.linalg.norm(mrk.offset_ned, axis=1) > LONGEST_OFFSET_M).any():
        row = int(np.argmax(too_long))
        raise mrk.error_at(
            row,
            f"the camera is {np.linalg.norm(mrk.offset_ned[row]):.1f} m from the antenna (limit"
            f" {LONGEST_OFFSET_M:g} m); N, E, V are millimetres: correct or delete the line",
        )
    row_of = {name: row for row, name in enumerate(names)}
    return replace(events, offset_ned=mrk.offset_ned[[row_of[name] for name in events.images]])
