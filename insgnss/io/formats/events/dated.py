"""Exposures by dates: tables `file name, date and time` of geotagging tools and of exiftool, and
the Exif of the images themselves; data_specs/event_dates.md.

A date is not a time of the Global Positioning System until somebody says of which scale it is: UTC
is 18 s behind GPST since 2017, and a camera's clock is of some time zone. The scale is taken from
the file where it says (a Z or an offset behind the time, UTC or GPST in the name of the column) and
from `time_scale` ("utc", "gpst", "utc+02:00") where it does not; with neither the file is refused.

A stamp of few digits is one of many instants. Whole seconds, which cameras cut off, are taken in
the middle, and every stamp has the standard deviation of its last digit d,

    sigma = d / sqrt(12)                                                                       (T.1)

0.29 s of whole seconds. Digits that all stamps have as zeros are none. What a camera's clock lacks
besides is not in it: `camera.time_offset_s` takes off a constant.
"""

import csv
import re
from collections.abc import Sequence
from dataclasses import replace
from datetime import datetime, timedelta
from pathlib import Path

import numpy as np

from ....base.errors import InputError, UsageError
from ....base.wording import spell
from ....geodesy.gpstime import WEEK_S, gps_from_calendar
from ....records import Array, CameraEvents, Finding
from ..names import DATED, IMAGE_ENDINGS
from ..read_options import STATED_NOTHING, ReadOptions
from ..text.columns import Columns, TableSpec
from ..text.layout import TextLayout, decode, quote
from ..text.order import Lines, note
from ..text.text import FileLine, Source, TextTable, data_lines, load
from .events import events_in_order

_DAY = r"(?:(\d{4})[-/.:](\d{1,2})[-/.:](\d{1,2})|(\d{1,2})\.(\d{1,2})\.(\d{4}))"  # or day first
DATED_STAMP = re.compile(
    _DAY + r"[ T_]+(\d{1,2}):(\d{1,2}):(\d{1,2})(?:[.,](\d{1,9}))?"
    r"\s*(Z|UTC|GPST|[+-]\d{2}:?\d{2})?",
    re.ASCII,
)
DAY_ALONE = re.compile(_DAY, re.ASCII)
SPEC = TableSpec(DATED, "time", ("time", "image time", "image date time"), text=True)
DATED_QUOTES = " \"'"
SUBSECONDS = ("subsectimeoriginal", "subsectime")  # of exiftool, beside times without them
FINEST = ("subsecdatetimeoriginal", "gpsdatetime", "datetimeoriginal", "createdate")
TIME_OF_WEEK = r"\b(tow|sow|gps_tow|time of week|gps_sow|timeofweek|gpstow|gpssow)\b"
UTC_OFFSET = re.compile(r"utc(?:([+-])(0?\d|1[0-4])(?::?([0-5]\d))?)?$", re.ASCII)
MATTERS_S = 5e-3  # last digit of a stamp (s): a coarser one adds 15 mm and more at 10 m/s
GIVE_SCALE = 'time_scale "utc", "gpst", or of a camera in local time "utc+02:00"'


def is_dated(beginning: bytes) -> bool:
    """Tell whether the first lines of a table hold dates with a time of day and no time of week."""
    lines = [
        line
        for line in decode(beginning).splitlines()[:6]
        if line.strip() and not line.lstrip().startswith("%")
    ]
    if any(re.search(TIME_OF_WEEK, line.lower()) for line in lines[:1]):
        return False
    return any(DATED_STAMP.search(line) or _date_and_time(line) for line in lines)


def _date_and_time(line: str) -> bool:
    """Tell whether one field of a line is a date and another a time of day."""
    fields = [field.strip(" \"'") for field in re.split(r"[,;\t]", line)]
    dates = [field for field in fields if DAY_ALONE.fullmatch(field)]
    return bool(dates) and any(re.fullmatch(r"\d{1,2}:\d{2}:\d{2}([.,]\d+)?", f) for f in fields)


def offset_of(time_scale: str) -> float | None:
    """Return how far a scale is ahead of UTC, s; None for GPST.

    Raises
    ------
    UsageError
        For a text that names no scale.
    """
    text = time_scale.strip().lower()
    if text in ("gpst", "gps"):
        return None
    match = UTC_OFFSET.fullmatch(text)
    if match is None:
        raise UsageError(f"time_scale {time_scale!r} is unknown; give {GIVE_SCALE}")
    sign, hours, minutes = match.groups()
    seconds = 3600.0 * int(hours or 0) + 60.0 * int(minutes or 0)
    return -seconds if sign == "-" else seconds


def read_dated_events(path: Source, options: ReadOptions = STATED_NOTHING) -> CameraEvents:
    """Read exposures of a table of image names and dates.

    Parameters
    ----------
    path : path
        The table, with a header, or `image, date and time` without.
    options : ReadOptions
        `columns` of image, date and time; `gps_week`, from whose beginning times count;
        `time_scale`.

    Returns
    -------
    CameraEvents
        GPST, with standard deviations where stamps have few digits.

    Raises
    ------
    InputError
        A date that is none, with file and line, or dates of which nothing says the scale.
    UsageError
        A `time_scale` that is none.
    """
    table = table_of_dates(path)
    named_table = SPEC.of(table, _evident(table) if options.columns is None else options.columns)
    index, texts = named_table.index, named_table.strings("time")
    if "date" in index and not DATED_STAMP.search(texts[0]):
        days = named_table.strings("date")
        texts = tuple(f"{day} {clock}" for day, clock in zip(days, texts, strict=True))
    header = table.layout.header_fields or ()
    texts = _with_subseconds(table, texts)
    named_columns = [index[key] for key in ("time", "date") if key in index]
    title = " ".join(header[k] for k in named_columns if k < len(header))
    images = named_table.strings("image") if "image" in index else None
    if images is not None:
        images = tuple(Path(name.replace("\\", "/")).name for name in images)
    return dated_events(images, texts, table, title, options)


def _with_subseconds(table: TextTable, texts: Sequence[str]) -> tuple[str, ...]:
    """Return times with the decimals that exiftool has in a column of their own."""
    header = [name.strip().lower() for name in table.layout.header_fields or ()]
    column = next((header.index(name) for name in SUBSECONDS if name in header), None)
    if column is None or any("." in text for text in texts):
        return tuple(texts)
    decimals = (row[column].strip(DATED_QUOTES) for row in table.rows)
    return tuple(
        f"{text.strip(DATED_QUOTES)}.{digits}" if digits.isdecimal() else text
        for text, digits in zip(texts, decimals, strict=True)
    )


def table_of_dates(path: Source) -> TextTable:
    """Return the fields of a table; its header is a first line without a date."""
    buf, complete = load(path)
    text = decode(bytes(buf[:-1]))
    lines = [(line, row.rstrip("\r")) for line, row in data_lines(path, text)]
    if not lines:
        raise InputError.in_file(path, "holds no line; check that the file was copied whole")
    delimiter = max(",;\t", key=lines[-1][1].count)
    rows = [(line, _fields(line, text, delimiter)) for line, text in lines]
    header = None if DATED_STAMP.search(lines[0][1]) or _date_and_time(lines[0][1]) else rows.pop(0)
    if not rows:
        raise InputError.in_file(path, "holds a header and no exposure; copy it again")
    count = len(rows[0][1])
    for line, fields in rows:
        if len(fields) != count:
            problem = f"{len(fields)} fields, expected {count}"
            raise line.error(f"{problem}; correct or delete the line")
    layout = TextLayout(delimiter, ".", count, first_line=rows[0][0].number)
    if header is not None:
        names = tuple(name.strip() for name in header[1])
        layout = replace(
            layout,
            header=lines[0][1],
            header_fields=names if len(names) == count else None,
            header_line=header[0].number,
        )
    cells = [[cell.strip() for cell in row] for _, row in rows]
    return TextTable(str(path), layout, cells, [line.number for line, _ in rows], complete)


def _fields(line: FileLine, text: str, delimiter: str) -> list[str]:
    try:
        return next(csv.reader([text], delimiter=delimiter))
    except csv.Error:
        default_limit = csv.field_size_limit()
        problem = (
            f"{quote(text)} has a carriage return or a field of more than {default_limit}"
            " characters"
        )
        raise line.error(f"{problem}; save it with line ends LF") from None


def dated_events(
    images: tuple[str, ...] | None,
    texts: Sequence[str],
    lines: Lines,
    title: str,
    options: ReadOptions,
) -> CameraEvents:
    """Make events of names, or numbers from 1, and dates.

    Parameters
    ----------
    images : tuple of str, optional
        Names.
    texts : sequence of str
        Date and time of each, with Z or an offset, or without.
    lines : Lines
        Where they stand, for refusals.
    title : str
        Name of the column, which may state the scale.
    options : ReadOptions
        The caller's week and time scale.

    Returns
    -------
    CameraEvents
        GPST, with standard deviations where stamps have few digits.
    """
    stamps = [_stamp(text, lines, row) for row, text in enumerate(texts)]
    stated = stated_scale(title, {stamp[11] for stamp in stamps if stamp[11]})
    scale = stated or options.time_scale
    if scale is None:
        raise lines.error_at(
            0,
            "dates do not say whether they are UTC or GPS time, which are 18 s apart; give"
            f" {spell('camera.time_scale')}: {GIVE_SCALE}",
        )
    times = [_gpst(stamp, scale, lines, row) for row, stamp in enumerate(stamps)]
    week = times[0][0] if options.gps_week is None else options.gps_week
    time = np.array([tow + (own_week - week) * WEEK_S for own_week, tow in times])
    time, sigma, notes = centre_of_digits(time, max(len((s[10] or "").rstrip("0")) for s in stamps))
    events = events_in_order(images, time, lines, week, notes)
    matters = sigma * 12.0**0.5 >= MATTERS_S
    return replace(
        events,
        time_scale="" if stated else scale.strip().lower(),
        sigma_s=np.full(events.time.size, sigma) if matters else None,
    )


def _evident(table: TextTable) -> Columns:
    """The columns of a table whose header does not tell them, or tells several: by the values.

    Of exiftool's times of an image that of most digits, or of the receiver, is taken; without a
    name of a time the only column of dates with a time of day, and beside it the only column of
    image files.
    """
    header = [name.strip().lower() for name in table.layout.header_fields or ()]
    names = SPEC.named(table.layout.header_fields or ())
    times = [header.index(name) for name in FINEST if name in header]
    images = [k for k, name in enumerate(names) if name == "image"]
    if header and not times and "time" not in names:
        times = [
            k
            for k, text in enumerate(table.rows[0])
            if DATED_STAMP.fullmatch(text.strip(DATED_QUOTES))
        ]
        endings = tuple(IMAGE_ENDINGS.split())
        files = [k for k, text in enumerate(table.rows[0]) if text.lower().endswith(endings)]
        images = images or files
        if len(times) != 1 or len(images) != 1:
            return None
    elif len(times) < 2:
        return None
    chosen = {"time": f"[{times[0] + 1}]"}
    return chosen | {"image": f"[{images[0] + 1}]"} if images else chosen


def _stamp(text: str, lines: Lines, row: int) -> re.Match[str]:
    """Return the parts of a stamp; InputError for a text that is none."""
    if match := DATED_STAMP.fullmatch(text.strip(DATED_QUOTES)):
        return match
    problem = f"{quote(text)} where date and time must stand, such as 2021-03-18 12:19:04.623"
    raise lines.error_at(row, f"{problem}; correct the line or name the columns")


def centre_of_digits(time: Array, digits: int) -> tuple[Array, float, tuple[Finding, ...]]:
    """Return times in the middle of what their digits leave open, their sigma (T.1), and a note.

    Parameters
    ----------
    time : ndarray, shape (n,)
        s, as stamped.
    digits : int
        Decimals of a second that the stamps have.
    """
    digit = 10.0**-digits
    sigma = digit / 12.0**0.5
    if digit < MATTERS_S:
        return time, sigma, ()
    finding = f"stamps with a resolution of {digit:g} s: standard deviation {sigma:.2g} s"
    if digits == 0:
        time = time + 0.5
        finding += ", half a second added, since cameras cut the decimals off"
    advice = (
        f"at 10 m/s these are {10.0 * sigma:.2g} m along the path; use the camera's event marks at"
        " the receiver (hot-shoe), or stamps of more digits"
    )
    check = note("exposure times", finding, f"stamps finer than {MATTERS_S:g} s", advice)
    return time, sigma, (check,)


def stated_scale(title: str, signs: set[str]) -> str | None:
    """Return the scale that a column's name or the signs behind its times state; None for none."""
    if signs:
        return "gpst" if signs == {"GPST"} else "utc"
    parts = re.split(r"[^a-z]+", title.lower())
    if any(word in ("utc", "gmt") for word in parts):
        return "utc"
    return "gpst" if any(word in ("gpst", "gpstime") for word in parts) else None


def _gpst(match: re.Match[str], scale: str, lines: Lines, row: int) -> tuple[int, float]:
    """GPS week and seconds of a stamp with an offset of its own, or of a scale."""
    stated_offset = match[11] if match[11] and match[11][0] in "+-" else ""
    offset = offset_of(scale)
    year, month, day = (
        int(x) for x in (match.group(1, 2, 3) if match[1] else match.group(6, 5, 4))
    )
    hour, minute, second = (int(match[k]) for k in range(7, 10))
    try:
        if second > 60:  # which a leap second is called
            raise ValueError(second)
        when = datetime(year, month, day, hour, minute) + timedelta(seconds=second)
        if stated_offset:
            offset = offset_of(f"utc{stated_offset}")
        if offset is None:
            week, tow = gps_from_calendar(when, "gpst")
        else:
            week, tow = gps_from_calendar(when - timedelta(seconds=offset), "utc")
    except (ValueError, OverflowError, UsageError):
        raise lines.error_at(row, f"{quote(match[0])} is no date; correct the line") from None
    except InputError as error:
        raise lines.error_at(row, str(error)) from None
    return week, tow + (float(f"0.{match[10]}") if match[10] else 0.0)
