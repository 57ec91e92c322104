"""The kinds of options: for each the form of its values, and what is wrong with one that cannot be.

The reader of flight files, the constructors of records and the command line all judge a value by
`accept_value`; the first adds file and line to the refusal. A wing above adds its kinds by
`register`.
"""

import argparse
import math
import os
from collections.abc import Callable, Mapping
from dataclasses import dataclass, fields
from datetime import date
from numbers import Real
from pathlib import Path
from typing import Any, ClassVar, get_args

from ...base.errors import OptionError, UsageError, near, nearest
from ...base.units import LARGEST_UNIT, is_number, time_zone
from ...base.wording import phrase, spell
from .schema import Declared, class_names, declared_options, plain

Problem = Callable[[Declared, Any], str]
# m: a base that averaged its own position is off by metres, one of another datum by hundreds
MOST_MOVED_M = 1000.0
EARTH_RADIUS_M = 6.37e6  # Earth's radius (m): good enough for a distance held against MOST_MOVED_M
HOW_MANY = ("", "a number", "two numbers", "three numbers")


@dataclass(frozen=True)
class OptionKind:
    """What the values of a kind of option are.

    Parameters
    ----------
    problem : function
        Of the option and a value: what is wrong with the value, empty where nothing is.
    form : function, optional
        Of the option and a value: the form in which a record keeps it.
    member : function, optional
        Of a kind whose value is a mapping: of the option, a name and the value beside it, what is
        wrong with that.
    word : function
        How a word of the command line is read.
    several : bool
        Whether the command line takes several words.
    """

    problem: Problem
    form: Callable[[Declared, Any], Any] = lambda item, value: value
    member: Callable[[Declared, str, Any], str] | None = None
    word: Callable[[str], Any] = str
    several: bool = False


def accept_value(item: Declared, value: Any, key: str) -> Any:
    """The value of an option in the form in which a record keeps it.

    Parameters
    ----------
    item : Declared
        The option.
    value : Any
        What a caller, a file or a command line gives.
    key : str
        How a refusal names the option.

    Raises
    ------
    OptionError
        For a value that the option cannot have.
    """
    if value is None:
        if not item.optional:
            raise OptionError(key, "is None; give a value, or leave it out for the default")
        return None
    kind, original = OPTION_KINDS[item.kind], value
    value = kind.form(item, value)
    if problem := kind.problem(item, value):
        raise OptionError(key, problem, *(() if isinstance(original, Mapping) else (original,)))
    names = item.option.members() if item.option.members and isinstance(value, Mapping) else ()
    for name in value if kind.member else ():
        if names and name not in names:
            raise OptionError(key, f"{name!r} is unknown; {near(str(name), names)}")
        if problem := kind.member(item, name, value[name]) if kind.member else "":
            raise OptionError(f"{key}.{name}", problem, original[name])
    return value


def check(instance: Any, table: str) -> None:
    """Hold the values of a dataclass against what its options declare and its fields annotate.

    Each is kept in the form of its kind: a text where a path is expected as a path, a list as a
    tuple.

    Parameters
    ----------
    instance : dataclass
        Whose fields are looked at.
    table : str
        The table of the flight file that the fields are keys of.

    Raises
    ------
    OptionError
        Naming the first value that cannot be.
    """
    options, start = declared_options(instance.__class__), f"{table}." if table else ""
    for field in fields(instance):
        value, key = getattr(instance, field.name), start + field.name
        if field.name in options:
            object.__setattr__(instance, field.name, accept_value(options[field.name], value, key))
        elif problem := other_class(field.type, value):
            raise OptionError(key, problem)
    for name, item in options.items():
        missing = [needed for needed in item.option.needs if getattr(instance, needed) is None]
        if missing and getattr(instance, name) != item.default:
            problem = f"has no meaning without {spell(start + missing[0])}; give both"
            raise OptionError(start + name, problem)


@dataclass(frozen=True)
class Checked:
    """A record of options, whose values `check` holds against what they declare.

    `class Plan(Checked, table="plan")` names the table of a file that they are keys of; options of
    a verb are keys of none.
    """

    _table: ClassVar[str] = ""

    def __init_subclass__(cls, table: str = "") -> None:
        if table:
            cls._table = table

    def __post_init__(self) -> None:
        check(self, self._table)


def register(name: str, kind: OptionKind) -> None:
    """Add a kind of option whose values only a wing above this module can judge."""
    OPTION_KINDS[name] = kind


def other_class(annotation: Any, value: Any) -> str:
    """What is wrong with the class of a value, empty where it is one of the annotation."""
    expected, classes = class_names(annotation), {base.__name__ for base in type(value).__mro__}
    if (value is None and "None" in expected) or classes & set(expected):
        return ""
    return f"is of type {type(value).__name__}; it must be {phrase(expected)}"


def are_numbers(value: Any, count: int) -> bool:
    """Whether a value is so many finite numbers."""
    try:
        parts = tuple(value)
    except TypeError:
        return False
    return len(parts) == count and all(map(is_number, parts))


def is_place(lat_deg: float, lon_deg: float, height_m: float) -> bool:
    """Whether there can be such a latitude, longitude and ellipsoidal height."""
    return abs(lat_deg) <= 90.0 and abs(lon_deg) <= 180.0 and -1000.0 <= height_m <= 10000.0


def swapped_advice(lat_deg: float, lon_deg: float) -> str:
    """Advice for a latitude, longitude and height that cannot be a place."""
    if abs(lat_deg) > 90.0 >= abs(lon_deg):
        return "are latitude and longitude swapped?"
    return "order and units are deg, deg, m"


def range_words(item: Declared) -> str:
    """The range of an option's numbers, empty where any number will do."""
    low, high = item.option.low, item.option.high
    if item.option.positive or item.kind == "sigmas":
        return "greater than zero"
    if abs(low) == math.inf:
        return ""
    return f"{low:g} to {high:g}" if high < math.inf else f"{low:g} or more"


def _limits(item: Declared) -> str:
    """The range of an option's numbers with its unit."""
    limits = range_words(item)
    return f"{limits} {item.option.unit}".rstrip() if " to " in limits else limits


def in_range(item: Declared, value: Any) -> bool:
    """Whether a value is a number within the option's range."""
    positive = item.option.positive or item.kind == "sigmas"
    low, high = item.option.low, item.option.high
    return (
        is_number(value) and (not positive or 0.0 < value < LARGEST_UNIT) and low <= value <= high
    )


def as_number(item: Declared, value: Any) -> Any:
    """A number as the option's type has it, all else as it is."""
    whole = item.kind == "whole" and is_number(value) and value % 1 == 0
    return int(value) if whole else float(value) if is_number(value) else value


def as_tuple(item: Declared, value: Any) -> Any:
    """A list or an array as a tuple, all else as it is."""
    value = value.tolist() if hasattr(value, "tolist") else value
    return tuple(value) if isinstance(value, list | tuple) else value


def _as_numbers(item: Declared, value: Any) -> Any:
    value = as_tuple(item, value)
    return tuple(map(float, value)) if are_numbers(value, 3) or are_numbers(value, 2) else value


def _as_rows(item: Declared, value: Any) -> Any:
    """Three rows; a `Rotation` of scipy is its matrix."""
    value = value.as_matrix() if hasattr(value, "as_matrix") else value
    rows = as_tuple(item, value)
    return tuple(_as_numbers(item, row) for row in rows) if isinstance(rows, tuple) else rows


def _as_angles(item: Declared, value: Any) -> Any:
    pair = isinstance(value, tuple) and len(value) == 2
    return (value[0], _as_numbers(item, value[1])) if pair else value


def _as_triple(item: Declared, value: Any) -> Any:
    """North, east, down; one number stands for all of them."""
    value = as_tuple(item, value)
    return _as_numbers(item, (value,) * 3 if is_number(value) else value)


def _as_path(item: Declared, value: Any) -> Any:
    text = isinstance(value, str | os.PathLike)
    return Path(value) if text and Path in (plain(item.type), *get_args(item.type)) else value


def _as_paths(item: Declared, value: Any) -> Any:
    return tuple(map(Path, value)) if isinstance(value, list | tuple) else _as_path(item, value)


def by_name(form: Callable[[Declared, Any], Any]) -> Callable[[Declared, Any], Any]:
    """A form for each value of a mapping."""

    def of_mapping(item: Declared, value: Any) -> Any:
        if not isinstance(value, Mapping):
            return value
        return {name: form(item, inner) for name, inner in value.items()}

    return of_mapping


def comma_numbers(text: str) -> Any:
    """Numbers of a word such as 46.57,6.54,512.3; the word itself where it is none."""
    try:
        return tuple(map(float, text.split(",")))
    except ValueError:
        return text


def comma_columns(text: str) -> Any:
    """Names in the order of the columns, or a mapping where each is given as name=column."""
    parts = [word.strip() for word in text.split(",")]
    if "=" not in text and text.strip():
        return tuple(parts)
    pairs = [(name.strip(), field.strip()) for name, _, field in (w.partition("=") for w in parts)]
    if not all(name and field for name, field in pairs):
        advice = "names in the order of the columns, or every one as in tow=Time,gx=GyrX"
        raise argparse.ArgumentTypeError(f"{text!r}: give {advice}")
    return dict(pairs)


def _no_number(item: Declared, value: Any) -> str:
    if item.choices and item.kind == "whole":
        return _no_choice(item, value)
    if value == item.default or (
        in_range(item, value) and (item.kind != "whole" or isinstance(value, int))
    ):
        return ""
    if is_number(value) and (item.kind != "whole" or isinstance(value, int)):
        return f"must be {_limits(item)}"
    noun = "a whole number" if item.kind == "whole" else "a number"
    return f"must be {noun} {_limits(item)}".rstrip()


def _no_numbers(item: Declared, value: Any) -> str:
    if are_numbers(value, item.count) and all(in_range(item, number) for number in value):
        return ""
    return f"must be {HOW_MANY[item.count]} {_limits(item)}".rstrip()


def _no_sigmas(item: Declared, name: str, value: Any) -> str:
    right = are_numbers(value, 3) and 0.0 < min(value) <= max(value) < LARGEST_UNIT
    return "" if right else "must be three numbers greater than zero"


def _no_triple(item: Declared, value: Any) -> str:
    if are_numbers(value, 3) and all(in_range(item, number) for number in value):
        return ""
    return f"must be three numbers (north, east, down) from {range_words(item)}"


def _no_matrix(item: Declared, value: Any) -> str:
    right = isinstance(value, tuple) and [are_numbers(row, 3) for row in value] == [True] * 3
    return "" if right else "must be 3 rows of 3 finite numbers"


def _no_place(item: Declared, value: Any) -> str:
    if are_numbers(value, 3) and is_place(*value):
        return ""
    example = "; such as 46.5712345,6.5412345,512.345" if isinstance(value, str) else ""
    advice = f"; {swapped_advice(*value[:2])}" if are_numbers(value, 3) else example
    return f"must be latitude, longitude (deg), ellipsoidal height (m){advice}"


def _no_moved(item: Declared, value: Any) -> str:
    places: tuple[Any, ...] = value if isinstance(value, tuple) and len(value) == 2 else ("", "")
    if problem := next(filter(None, (_no_place(item, position) for position in places)), ""):
        return f"must be the old and the new position of the base; each {problem}"
    (lat, lon, height), (new_lat, new_lon, new_height) = places
    north = EARTH_RADIUS_M * math.radians(new_lat - lat)
    east = EARTH_RADIUS_M * math.radians(new_lon - lon) * math.cos(math.radians(lat))
    moved = math.hypot(north, east, new_height - height)
    far = f"are {moved:.0f} m apart (limit {MOST_MOVED_M:g} m); {swapped_advice(new_lat, new_lon)}"
    return far if moved > MOST_MOVED_M else ""


def _no_lever(item: Declared, value: Any) -> str:
    from ...records.cameras.mounting import MAX_LEVER_M

    if problem := _no_numbers(item, value):
        return problem
    length = math.hypot(*value)
    long = f"is {length:.0f} m long (limit {MAX_LEVER_M:.0f} m); the unit is m"
    return "" if length < MAX_LEVER_M else long


def _no_angles(item: Declared, value: Any) -> str:
    names = item.option.members() if item.option.members else ()
    named = isinstance(value, tuple) and len(value) == 2 and value[0] in names
    if not named:
        return f"must name one angle set, such as {{ opk = [..] }}; known are {', '.join(names)}"
    return "" if are_numbers(value[1], 3) else "must be three numbers"


def _no_choice(item: Declared, value: Any) -> str:
    comparable = isinstance(value, str | Real)  # an array is not
    if comparable and value in item.choices:
        return ""
    close = nearest(value, map(str, item.choices)) if isinstance(value, str) else ""
    return f"must be {phrase(item.choices)}" + (f"; did you mean {close!r}?" if close else "")


def _no_gm_sigma(item: Declared, value: Any) -> str:
    return _no_choice(item, value) if isinstance(value, str) else _no_number(item, value)


def _no_date(item: Declared, value: Any) -> str:
    try:
        date.fromisoformat(value or "2000-01-01")
    except (TypeError, ValueError):
        return "must be a date such as 2018-07-06"
    return ""


def _no_zone(item: Declared, value: Any) -> str:
    try:
        time_zone(value)
    except (TypeError, UsageError):
        return 'must be a time zone such as "Europe/Zurich" or "+02:00"'
    return ""


def _no_sign(item: Declared, value: Any) -> str:
    return "" if is_number(value) and abs(value) == 1.0 else "must be 1 or -1"


def _no_letters(item: Declared, value: Any) -> str:
    allowed = "".join(map(str, item.choices))
    right = isinstance(value, str) and value and set(value) <= set(allowed)
    return "" if right else f"must be letters of {allowed}"


def no_text(item: Declared, value: Any) -> str:
    """What is wrong with a value that should be a text."""
    return "" if isinstance(value, str) else "must be a text"


def no_texts(item: Declared, value: Any) -> str:
    """What is wrong with a value that should be a list of texts, of the choices if there are."""
    if isinstance(value, str):
        return f"must be a list; give [{value!r}]"
    if not (isinstance(value, tuple) and all(isinstance(word, str) for word in value)):
        return "must be a list of texts"
    choices = tuple(map(str, item.choices))
    unknown = next((word for word in value if choices and word not in choices), None)
    return "" if unknown is None else f"{unknown!r} is unknown; {near(unknown, choices)}"


def _no_path(item: Declared, value: Any) -> str:
    return other_class(Path, value) if plain(item.type) is Path else ""  # or it is a record


def _no_paths(item: Declared, value: Any) -> str:
    several = isinstance(value, tuple) and value and all(isinstance(one, Path) for one in value)
    single = other_class(Path, value) if item.kind == "observations" else "must be a list of files"
    return "" if several else single


def _no_event_numbers(item: Declared, value: Any) -> str:
    right = isinstance(value, tuple) and all(is_number(k) and k >= 1 and k % 1 == 0 for k in value)
    return "" if right else "must be a list of whole numbers from 1, as the events are counted"


def no_mapping(item: Declared, value: Any) -> str:
    """What is wrong with a value that should be a mapping."""
    return "" if isinstance(value, Mapping) else "must be a mapping by name"


def _no_columns(item: Declared, value: Any) -> str:
    right = isinstance(value, list | tuple | Mapping) and len(value) > 0
    names = value.values() if isinstance(value, Mapping) else value if right else ()
    if right and all(isinstance(name, str) and name for name in names):
        return ""
    return "must be a list of names, or a mapping of the names in the file"


def _no_tables(item: Declared, value: Any) -> str:
    right = isinstance(value, tuple) and not any(other_class(item.type, one) for one in value)
    return "" if right else f"must be a list of {class_names(item.type)[-1]}"


def no_record(item: Declared, value: Any) -> str:
    """What is wrong with a value that should be of the option's class."""
    return other_class(item.type, value)


_FILE = OptionKind(_no_path, _as_path, word=Path)
_FILES = OptionKind(_no_paths, _as_paths, word=Path, several=True)
_NUMBER_KIND = OptionKind(_no_number, as_number, word=float)
_NUMBERS = OptionKind(_no_numbers, _as_numbers, word=float)
_POSITION = OptionKind(_no_place, _as_numbers, word=comma_numbers)
_TEXT = OptionKind(no_text)
_TEXTS = OptionKind(no_texts, as_tuple, several=True)
OPTION_KINDS: dict[str, OptionKind] = {
    "angles": OptionKind(_no_angles, _as_angles),
    "camera_mounting": OptionKind(no_record),
    "choice": OptionKind(_no_choice),
    "columns": OptionKind(_no_columns, as_tuple, word=comma_columns),
    "covariance": OptionKind(no_record, word=Path),
    "date": OptionKind(_no_date),
    "directory": _FILE,
    "engine": _TEXT,
    "event_numbers": OptionKind(_no_event_numbers, as_tuple, word=int, several=True),
    "existing": _FILE,
    "file": _FILE,
    "file_or_directory": _FILE,
    "files": _FILES,
    "flag": OptionKind(
        lambda item, value: "" if isinstance(value, bool) else "must be true or false",
        word=lambda text: {"true": True, "false": False}.get(text.lower(), text),
    ),
    "gm_sigma": OptionKind(_no_gm_sigma, as_number),
    "images": _FILE,
    "letters": OptionKind(_no_letters),
    "lever": OptionKind(_no_lever, _as_numbers, word=float),
    "matrix": OptionKind(_no_matrix, _as_rows),
    "name": _TEXT,
    "number": _NUMBER_KIND,
    "numbers": _NUMBERS,
    "observations": _FILES,
    "origin": _POSITION,
    "moved": OptionKind(_no_moved, _as_rows, word=comma_numbers),
    "pair": OptionKind(_no_numbers, _as_numbers, word=comma_numbers),
    "place": _POSITION,
    "quality_sigmas": OptionKind(no_mapping, by_name(_as_numbers), _no_sigmas),
    "rate": OptionKind(_no_number, as_number),
    "sigmas": _NUMBERS,
    "sign": OptionKind(_no_sign, as_number),
    "tables": OptionKind(_no_tables, as_tuple),
    "text": _TEXT,
    "texts": _TEXTS,
    "triple": OptionKind(_no_triple, _as_triple),
    "triples": OptionKind(no_mapping, by_name(_as_triple), lambda item, _, v: _no_triple(item, v)),
    "units": OptionKind(no_mapping, member=lambda item, _, unit: no_text(item, unit)),
    "whole": OptionKind(_no_number, as_number, word=int),
    "zone": OptionKind(_no_zone),
}
