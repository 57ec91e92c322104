"""Stamps that are dates: 2015_11_26_15_00_02_617, 2015-11-26T15:00:02.617Z, 2015/11/26-15:00:02,
26.11.2015 15:00:02 (the day first only with points, which nobody writes for the month first, and
with the month's name: 26-Nov-2015 15:00:02.617).

Year, month, day, hour, minute and second stand between signs that are no digits; what follows a
point or comma is a fraction of a second, what follows another sign counts milliseconds (three
digits or fewer), microseconds or nanoseconds. Such a column becomes a clock in seconds since 1970;
dates are taken for UTC, since they rarely say; a zone behind one (+02:00) is taken off. A date may
stand in columns of its parts, too: UTC_Year to UTC_Second, UTC_Nano. That of the year then becomes
the clock, and of a day beside a time of day that of the latter.
"""

import re
from collections.abc import Sequence

import numpy as np

from ....records import Array

_DATE = re.compile(
    r"\"?(\d{4})[-_/.:](\d{1,2})[-_/.:](\d{1,2})[-_/.:T ](\d{1,2})[-_/.:](\d{1,2})[-_/.:](\d{1,2})"
    r"(?:([-_/.:,])(\d{1,9}))?(?:Z|([+-]\d\d):?([0-5]\d))?\"?",
    re.ASCII,
)
DAY, CLOCK = re.compile(r"\"?\d{4}[-_/.:]\d{1,2}[-_/.:]\d{1,2}\"?"), re.compile(r"\"?\d{1,2}:.*")
DAY_FIRST = re.compile(r"\"?(\d{1,2})\.(\d{1,2})\.(\d{4})(?!\d)", re.ASCII)  # only with points
MONTHS = ["jan", "feb", "mar", "apr", "may", "jun", "jul", "aug", "sep", "oct", "nov", "dec"]
NAMED_MONTH = re.compile(
    rf"\"?(\d{{1,2}})([- ])({'|'.join(MONTHS)})\2(\d{{4}})(?!\d)", re.IGNORECASE
)
UNIX = "unix"  # of the clock that dates become
# columns of a date, and s of those of a fraction of its second by their names
CALENDAR = ("year", "month", "day", "hour", "minute", "second")
FRACTIONS_S = {"millisecond": 1e-3, "ms": 1e-3, "nano": 1e-9, "nanosecond": 1e-9, "nsec": 1e-9}
# of each column: values of a date, up to the leap second; before 1970 no clock was logged
LOWEST_PARTS, HIGHEST_PARTS = (1970, 1, 1, 0, 0, 0), (2100, 13, 32, 24, 60, 61)
PARTS_S = {3: 1e-3, 6: 1e-6, 9: 1e-9}  # by the number of digits, at most


def joined_dates(days: Sequence[str], clocks: Sequence[str]) -> list[str] | None:
    """Return dates of a column of days and one of times of day; None where one is neither."""
    days = [_year_first(day) for day in days]
    if all(map(DAY.fullmatch, days)) and all(map(CLOCK.fullmatch, clocks)):
        pairs = zip(days, clocks, strict=True)
        return [f"{day} {clock}".replace('"', "") for day, clock in pairs]
    return None


def is_date(text: str) -> bool:
    """Tell whether a field is a date with a time of day."""
    return _DATE.fullmatch(_year_first(text)) is not None


def _year_first(text: str) -> str:
    """Return a date with the day first, as 26.11.2015 or 26-Nov-2015, with the year before."""
    text = text.strip()
    if named := NAMED_MONTH.match(text):
        day, _, month, year = named.groups()
        return f"{year}-{1 + MONTHS.index(month.lower()):02}-{day}{text[named.end() :]}"
    first = DAY_FIRST.match(text)
    return text if first is None else first.expand(r"\3-\2-\1") + text[first.end() :]


def seconds_of_dates(texts: Sequence[str]) -> Array | None:
    """Return seconds since 1970 (n,) of fields; None where one of them is no date."""
    whole: list[str] = []
    parts = np.zeros(len(texts))
    for i, text in enumerate(texts):
        match = _DATE.fullmatch(_year_first(text))
        if match is None:
            return None
        year, month, day, hour, minute, second, sign, digits, zone, more = match.groups()
        whole.append(f"{year}-{month:0>2}-{day:0>2}T{hour:0>2}:{minute:0>2}:{second:0>2}")
        if digits is not None:
            unit = next(factor for size, factor in PARTS_S.items() if len(digits) <= size)
            parts[i] = float(f"0.{digits}") if sign in ".," else int(digits) * unit
        if zone is not None:
            parts[i] -= 3600.0 * int(zone) + float(f"{zone[0]}60.0") * int(more)
    try:
        stamps = np.array(whole, dtype="datetime64[s]")
    except ValueError:  # a thirteenth month
        return None
    return np.asarray(stamps.astype(np.int64) + parts)


def calendar_columns(fields: Sequence[str] | None) -> dict[str, int]:
    """Return the columns of the parts of a date by the names of a header; none where one lacks."""
    names = [re.sub(r"[^a-z]|^(\W*utc)", "", name.lower()) for name in fields or ()]
    columns = {n: names.index(n) for n in (*CALENDAR, *FRACTIONS_S) if n in names}
    return columns if columns.keys() >= set(CALENDAR) else {}


def take_calendar(fields: Sequence[str] | None, values: Array) -> frozenset[int]:
    """Put seconds since 1970 into the column of the years, and return it; none without a date.

    Rows whose parts are no date, as before the date was known, are of 1970.
    """
    columns = calendar_columns(fields)
    parts = values[:, [columns[name] for name in CALENDAR]] if columns else np.empty((0, 6))
    dated = np.all((parts >= LOWEST_PARTS) & (parts < HIGHEST_PARTS), axis=1)
    parts[~dated, :3] = LOWEST_PARTS[:3]
    if not dated.size or np.mean(dated) <= 0.5:
        return frozenset()
    year, month, day, *clock = parts.T
    months = (12.0 * (year - 1970.0) + month - 1.0).astype("datetime64[M]")
    days = months.astype("datetime64[D]").astype(np.int64) + day - 1.0
    seconds = 86400.0 * days + 3600.0 * clock[0] + 60.0 * clock[1] + clock[2]
    for name, factor in FRACTIONS_S.items():
        if name in columns:
            seconds += factor * values[:, columns[name]]
    values[:, columns["year"]] = seconds
    return frozenset({columns["year"]})
