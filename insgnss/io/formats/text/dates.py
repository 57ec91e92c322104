"""Stamps that are dates: 2015_11_26_15_00_02_617, 2015-11-26T15:00:02.617Z, 2015/11/26-15:00:02.

Year, month, day, hour, minute and second stand between signs that are no digits; what follows a
point or comma is a fraction of a second, what follows another sign counts milliseconds (three
digits or fewer), microseconds or nanoseconds. Such a column becomes a clock in seconds since 1970;
dates are taken for UTC, since they rarely say.
"""

import re
from collections.abc import Sequence

import numpy as np

from ....records import Array

_DATE = re.compile(
    r"\"?(\d{4})[-_/.:](\d{1,2})[-_/.:](\d{1,2})[-_/.:T ](\d{1,2})[-_/.:](\d{1,2})[-_/.:](\d{1,2})"
    r"(?:([-_/.:,])(\d{1,9}))?Z?\"?",
    re.ASCII,
)
UNIX = "unix"  # of the clock that dates become
PARTS_S = {3: 1e-3, 6: 1e-6, 9: 1e-9}  # by the number of digits, at most


def is_date(text: str) -> bool:
    """Tell whether a field is a date with a time of day."""
    return _DATE.fullmatch(text.strip()) is not None


def seconds_of_dates(texts: Sequence[str]) -> Array | None:
    """Return seconds since 1970 (n,) of fields; None where one of them is no date."""
    whole: list[str] = []
    parts = np.zeros(len(texts))
    for i, text in enumerate(texts):
        match = _DATE.fullmatch(text.strip())
        if match is None:
            return None
        year, month, day, hour, minute, second, sign, digits = match.groups()
        whole.append(f"{year}-{month:0>2}-{day:0>2}T{hour:0>2}:{minute:0>2}:{second:0>2}")
        if digits is not None:
            unit = next(factor for size, factor in PARTS_S.items() if len(digits) <= size)
            parts[i] = float(f"0.{digits}") if sign in ".," else int(digits) * unit
    try:
        stamps = np.array(whole, dtype="datetime64[s]")
    except ValueError:  # a thirteenth month
        return None
    return np.asarray(stamps.astype(np.int64) + parts)
