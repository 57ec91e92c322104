"""Numbers of files that are no tables: words, elements and attributes of XML, arrays of JSON.

What stands where a number belongs and is none is refused by whoever reads it; nothing stands in for
it. The rule is that of tables, `layout.float_of`; numpy would take texts and truth values as well.
"""

from collections.abc import Mapping
from itertools import chain
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ....base.errors import InputError
from ....base.units import LARGEST_UNIT
from .layout import float_of, quote
from .order import Lines, refuse_rows
from .text import Array

LARGEST_NUMBER_READ = 1e12  # of a place (m) or a turn (rad): far beyond any that is real
PLAIN = "write a plain decimal number, such as -1.5e-4"
LARGEST_EXACT_INTEGER = 2**53  # whole number: larger ones are not exact as a float


def finite(text: str | None) -> float:
    """Return the number that a text is; not-a-number where it is none, such as an empty one."""
    value = float_of((text or "").strip())
    return np.nan if value is None else value


def whole(text: str | None) -> int:
    """Return the whole number from zero on that a text is; -1 where it is none."""
    value = finite(text)
    return int(value) if value.is_integer() and 0.0 <= value < LARGEST_EXACT_INTEGER else -1


def are_whole(*values: float) -> bool:
    """Whether all numbers are whole, and exact as a float."""
    return all(value.is_integer() and value < LARGEST_EXACT_INTEGER for value in values)


def whole_rows(lines: Lines, values: Array, name: str) -> NDArray[np.int64]:
    """Return a column of whole numbers; InputError with the line for others."""
    wrong = (values != np.round(values)) | (np.abs(values) > LARGEST_EXACT_INTEGER)
    refuse_rows(lines, wrong, f"{name} {{:g}} is no whole number; correct the line", values)
    return values.astype(np.int64)


def array_of(value: Any, shape: tuple[int, ...]) -> Array | None:
    """Return numbers of JSON or TOML as an array of that shape; None where they are none."""
    flat: Any = [value]
    try:
        for _ in shape:
            flat = chain.from_iterable(flat)
        if not set(map(type, flat)) <= {int, float}:
            return None
        array = np.array(value, dtype=np.float64)
    except (TypeError, ValueError, OverflowError):  # no list, rows of unequal length, 10^400
        return None
    return array if array.shape == shape and (np.abs(array) < LARGEST_UNIT).all() else None


def vector_of(path: object, document: Mapping[str, Any], key: str, who: str = "") -> Array:
    """Return the three numbers of a member of JSON; InputError says `who` has others."""
    vector = array_of(document.get(key), (3,))
    if vector is None or not (np.abs(vector) < LARGEST_NUMBER_READ).all():
        problem = f"{who}{key} is not three numbers below {LARGEST_NUMBER_READ:g}"
        text = quote(str(document.get(key)))
        raise InputError.in_file(path, f"{problem}: {text}; export it again")
    return vector
