"""Exposures in a table of text: one column of images and one of times, in any words.

The values decide what a column can be: file names of images or a count of them; dates with a time
of day, a date beside a time of day, or seconds that increase. Where several can be the same, the
words of the header decide; where they do not, the file is left out with the columns named.
"""

import re
from collections.abc import Sequence
from contextlib import suppress
from pathlib import Path
from typing import Any

import numpy as np

from ....base.errors import InsgnssError
from ....geodesy.gpstime import WEEK_S
from ....io.formats import read_events, sniff_events
from ....io.formats.events.dated import DATED_QUOTES, DATED_STAMP, DAY_ALONE, table_of_dates
from ....io.formats.events.events import SPEC, UNNAMED
from ....io.formats.names import IMAGE_ENDINGS
from ....io.formats.text.text import TextTable, read_text_table
from ....records import Array
from ..event_clock import SCALE_OPEN
from ..sources import InputSource
from .clocks import UNIX_FROM

IMAGE_WORDS = "image img photo foto picture pic bild file name frame shot event seq number id"
TIME_WORDS = "time zeit date datum stamp clock tow sec sek utc gps"
# of the instant of exposure, which no other time of a file is
EXPOSURE_WORDS = "exposure shutter shot taken trigger capture event mid aufnahme"
OTHER_TIMES = "created modified upload download duration length"
CLOCK_TEXT = re.compile(r"\d{1,2}:\d{2}:\d{2}([.,]\d+)?", re.ASCII)
IN_MS = re.compile(r"[\[(]ms[\])]")
LAST_TOW_S = 2.0 * WEEK_S  # largest time of week (s): flights run past the week's end by hours
LAST_WEEK = 4000  # GPS week, of 2056: later ones are of ticks taken for seconds
EXPOSURE_EPOCH_UNITS = ("unix", "unix_ms", "unix_us", "unix_ns")
LARGEST_LIST_BYTES = 20_000_000  # of a list of exposures: 100 000 of 200 characters each
NAMES_BY_VALUES = "columns recognised by their values, and by their names where several values fit"


def exposures_of(path: Path) -> tuple[list[InputSource], str]:
    """Return the exposures that a text table lists, and else what it lacks for that.

    Parameters
    ----------
    path : Path

    Returns
    -------
    tuple of list of InputSource, str
        One source or none; without one, what is missing where the table names images.
    """
    if path.stat().st_size > LARGEST_LIST_BYTES:
        return [], ""
    dated = sniff_events(path) == "event_dates"
    if dated and (source := _source(path, None)):
        return [source], ""
    try:
        table = table_of_dates(path) if dated else read_text_table(path)
    except InsgnssError:  # no table of text
        return [], ""
    columns, missing = _columns(table)
    source = _source(path, columns) if columns else None
    return ([], missing) if source is None else ([source], "")


def _source(path: Path, columns: dict[str, str] | None) -> InputSource | None:
    """The file as a source, read by its header or by `columns`; None where that gives no names."""
    dated = columns is None or "time" in columns
    events, units = None, None
    for unit in ("", *(() if dated else EXPOSURE_EPOCH_UNITS)):
        units = {"time": unit} if unit else None
        with suppress(InsgnssError):  # dates or numbers of something else
            scale = "utc" if dated else None
            read = read_events(path, columns=columns, units=units, time_scale=scale)
            if (read.gps_week or 0) < LAST_WEEK:
                events = read
                break
    if events is None or any(check.name == UNNAMED for check in events.notes):
        return None
    keys: dict[str, Any] = {} if columns is None else {"columns": columns}
    why = dict.fromkeys(keys, NAMES_BY_VALUES)
    if units is not None:
        keys["units"], why["units"] = units, "times count seconds from 1970, not of a GPS week"
    if events.time_scale:
        keys["time_scale"], why["time_scale"] = events.time_scale, SCALE_OPEN
    count = f"exposures{' with their dates' if dated else ''}, {len(events.images)} of them"
    return InputSource("events", path, count, keys, why)


def _columns(table: TextTable) -> tuple[dict[str, str], str]:
    """Image and time in the keys of `camera.columns`, or what is missing."""
    fields = table.layout.header_fields or ("",) * table.layout.n_fields
    texts = [
        [cell.strip(DATED_QUOTES) for cell in column] for column in zip(*table.rows, strict=True)
    ]
    if len(table.rows) < 2:
        return {}, ""
    scores: dict[str, list[int]] = {}
    for role, score_of in (("image", _image), ("time", _date), ("tow", _seconds)):
        scores[role] = [score_of(*pair) for pair in zip(fields, texts, strict=True)]
    image = _best_column(scores["image"])
    if image is None:
        return {}, ""
    week = SPEC.named(fields).index("week") if "week" in SPEC.named(fields) else None
    titles = [
        f"[{k + 1}]" if not name or fields.count(name) > 1 else name
        for k, name in enumerate(fields)
    ]
    days, clocks = (
        [k for k, column in enumerate(texts) if all(map(form.fullmatch, column))]
        for form in (DAY_ALONE, CLOCK_TEXT)
    )
    if len(days) == len(clocks) == 1:
        return {"image": titles[image], "date": titles[days[0]], "time": titles[clocks[0]]}, ""
    for role in ("time", "tow"):
        scores[role][image] = 0
        if (column_index := _best_column(scores[role])) is not None:
            of_week = {"week": titles[week]} if role == "tow" and week is not None else {}
            return {"image": titles[image], role: titles[column_index]} | of_week, ""
    names = ", ".join(repr(name) for name in titles)
    return {}, (
        f"the table lists images ({titles[image]}), but none of {names} is surely the time of "
        'exposure; name both in camera.columns = { image = "...", tow = "..." } or { image, time '
        "} names them"
    )


def _best_column(scores: Sequence[int]) -> int | None:
    """Index of the one highest score; None where there is none or several are equal."""
    highest = max(scores)
    return scores.index(highest) if highest > 0 and scores.count(highest) == 1 else None


def _count(name: str, terms: str) -> int:
    return sum(word in name.lower() for word in terms.split())


def _image(name: str, texts: Sequence[str]) -> int:
    """Score of a column as names of images; 0 for one that cannot hold them."""
    if len(set(texts)) < len(texts) or any(map(DATED_STAMP.fullmatch, texts)):
        return 0
    score = _count(name, IMAGE_WORDS)
    if all(text.lower().endswith(tuple(IMAGE_ENDINGS.split())) for text in texts):
        return 10 + score
    numbers = _numbers(texts)
    return score if numbers is None or set(np.diff(numbers)) == {1.0} else 0


def _date(name: str, texts: Sequence[str]) -> int:
    """Score of a column as dates with a time of day; 0 for one that cannot hold them."""
    return _time_words(name) if all(map(DATED_STAMP.fullmatch, texts)) else 0


def _seconds(name: str, texts: Sequence[str]) -> int:
    """Score of a column as seconds of week; 0 for one that cannot hold them."""
    values, score = _numbers(texts), _time_words(name)
    if values is None:
        return 0
    factor = 1e-3 if IN_MS.search(name) else 1.0  # the reader takes the unit of a header
    in_range = (factor * values[-1] < LAST_TOW_S) | (values[0] > UNIX_FROM)
    fits = (np.diff(values) > 0.0).all() and values[0] >= 0.0 and in_range
    are_integers = (
        values == np.round(values)
    ).all()  # a count of images is no time but by its name
    return score if fits and not (are_integers and score < 2) else 0


def _numbers(texts: Sequence[str]) -> Array | None:
    """Return the column as numbers; None where a field is none."""
    try:
        return np.array(texts, dtype=np.float64)
    except ValueError:
        return None


def _time_words(name: str) -> int:
    """Return 1, more for each word of a time and most for one of the exposure; 1 at the least."""
    score = _count(name, TIME_WORDS) + 3 * _count(name, EXPOSURE_WORDS)
    return max(1, 1 + score - 4 * _count(name, OTHER_TIMES))
