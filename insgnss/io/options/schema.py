"""The mechanism of the schema: what an option declares, beside its name, its type and its default.

A table of the flight file is a dataclass. A field of it that is an option is made by `option`:

    max_age_s: float = option(
        30.0, "longest time to the base's epoch", unit="s", low=0.01, high=3600.0, cli="--max-age"
    )

Name, type and default are the field's own; the rest stands in its metadata. The reader of flight
files, the page about them, the arguments of `insgnss ppk` and all checks read them from there.

msgspec and pydantic were weighed. Their errors carry neither the line of a TOML file nor the
nearest known key, and they know no units, so that reader, page and arguments would be ours all the
same; and importing them takes 15 and 33 ms more than `dataclasses`, where `insgnss --help` takes
70.
"""

import math
import os
import re
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import MISSING, dataclass, field, fields
from functools import cache
from numbers import Real
from pathlib import Path
from types import NoneType, UnionType
from typing import Any, Literal, Union, get_args, get_origin

from ...base.errors import OptionError, near
from ...base.wording import listed

Words = tuple[str, ...] | tuple[int, ...]
Triple = tuple[float, float, float]

BY_HEADER = "by header or order"
"""How page and help describe the default of `columns`."""

_KINDS: dict[type, str] = {
    bool: "flag",
    int: "whole",
    float: "number",
    str: "text",
    Path: "file",
}


@dataclass(frozen=True, kw_only=True)
class Option:
    """What an option declares beside name, type and default.

    Parameters
    ----------
    meaning : str
        What the option is for, as the page and the help print it.
    unit : str
        Unit of its numbers, empty for none.
    low, high : float
        Range of its numbers, both ends allowed.
    positive : bool
        Whether each of its numbers must be greater than zero.
    choices : tuple or function
        The values that it may have; a function where only a room above knows them.
    members : function, optional
        The keys of a table that is the option's value.
    kind : str
        The reader of its value (`flight.config.values`); empty: by the type of the field.
    form : str
        How the page describes its value, where kind and type do not say enough.
    usual : str
        How page and help describe a default that is no literal value.
    only : str
        The one table that has the option, where several share its dataclass.
    of_file : bool
        Whether it says how the file of its table is read, and nothing of a record in its place.
    cli : str
        Its option of the command line, "--mask", or its positional argument, "ROVER"; empty: none.
    metavar, cli_meaning, cli_default : str
        Name of the value in the help; meaning and default where those of the page do not fit.
    """

    meaning: str
    unit: str = ""
    low: float = -math.inf
    high: float = math.inf
    positive: bool = False
    choices: Words | Callable[[], Words] = ()
    members: Callable[[], tuple[str, ...]] | None = None
    kind: str = ""
    form: str = ""
    usual: str = ""
    only: str = ""
    of_file: bool = False
    cli: str = ""
    metavar: str = ""
    cli_meaning: str = ""
    cli_default: str = ""


def option(default: Any, meaning: str, **more: Any) -> Any:
    """Field of a dataclass that is an option.

    Parameters
    ----------
    default : Any
        Its default, a function that makes one (of a mapping), or ``...``: it must be given.
    meaning : str
        What it is for.
    more
        Further fields of `Option`.
    """
    metadata = {"option": Option(meaning=meaning, **more)}
    if default is ...:
        return field(metadata=metadata, kw_only=True)
    if callable(default):
        return field(default_factory=default, metadata=metadata)
    return field(default=default, metadata=metadata)


@dataclass(frozen=True)
class Declared:
    """An option as a dataclass declares it: name, type, default and `Option`."""

    name: str
    type: Any
    default: Any
    option: Option

    @property
    def required(self) -> bool:
        """Whether there is no default."""
        return self.default is ...

    @property
    def optional(self) -> bool:
        """Whether None is a value."""
        return self.default is None or "None" in _class_names(self.type)

    @property
    def kind(self) -> str:
        """Name of the reader of its value."""
        return self.option.kind or _kind(self.type)

    @property
    def choices(self) -> Words:
        """Values that it may have, empty where others may."""
        declared_choices = self.option.choices
        if callable(declared_choices):
            return declared_choices()
        return declared_choices or (get_args(_plain(self.type)) if self.kind == "choice" else ())

    @property
    def count(self) -> int:
        """How many numbers it has."""
        return len(get_args(_plain(self.type)))


def _plain(annotation: Any) -> Any:
    """The type without `| None`."""
    if get_origin(annotation) in (Union, UnionType):
        members = [member for member in get_args(annotation) if member is not NoneType]
        return members[0] if len(members) == 1 else annotation
    return annotation


def _kind(annotation: Any) -> str:
    plain = _plain(annotation)
    if plain in _KINDS:
        return _KINDS[plain]
    if get_origin(plain) is Literal:
        return "choice"
    if get_origin(plain) is tuple:
        parts = get_args(plain)
        if set(parts) == {float}:
            return "numbers"
        if parts == (str, ...):
            return "texts"
        if parts == (Path, ...):
            return "files"
    raise TypeError(f"{annotation}: say by kind=... which reader of config.values takes it")


@cache
def declared(table: type) -> Mapping[str, Declared]:
    """The options that a dataclass declares, by name; what must be given comes first."""
    options = []
    for item in fields(table):
        if "option" not in item.metadata:
            continue
        default = item.default
        if item.default_factory is not MISSING:
            default = item.default_factory()
        options.append(
            Declared(
                item.name,
                item.type,
                ... if default is MISSING else default,
                item.metadata["option"],
            )
        )
    return {item.name: item for item in sorted(options, key=lambda item: not item.required)}


def check(instance: Any, table: str) -> None:
    """Hold the values of a dataclass against what its options declare and its fields annotate.

    A text where a path is expected becomes a path, a list of texts or an array a tuple.

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
    options = declared(instance.__class__)
    for name, annotation in ((f.name, f.type) for f in fields(instance)):
        value, key = getattr(instance, name), f"{table}.{name}".removeprefix(".")
        if name not in options:
            if problem := other_class(annotation, value):
                raise OptionError(key, problem)
            continue
        item = options[name]
        if value is None:
            if not item.optional:
                raise OptionError(key, "is None; give a value, or leave it out for the default")
            continue
        value = _usual_form(item, value)
        object.__setattr__(instance, name, value)
        if problem := _problem(item, value):
            raise OptionError(key, problem, value)


def _usual_form(item: Declared, value: Any) -> Any:
    """A text as a path where one is expected, a list as a tuple, all else as it is."""
    if _plain(item.type) is Path and isinstance(value, str | os.PathLike):
        return Path(value)
    if item.kind in _USUAL_FORMS:
        return _USUAL_FORMS[item.kind](value)
    if item.kind == "observations" and isinstance(value, str | os.PathLike):
        return Path(value)
    if item.kind == "observations" and isinstance(value, list | tuple):
        return tuple(map(Path, value))
    if item.kind in ("numbers", "place", "sigmas") and hasattr(value, "tolist"):
        value = value.tolist()
        return tuple(value) if isinstance(value, list) else value
    if item.kind in _LISTS and isinstance(value, list | tuple):
        return tuple(map(Path, value)) if item.kind == "files" else tuple(value)
    return value


def _class_names(annotation: Any) -> tuple[str, ...]:
    """Names of the classes of an annotation, which may be a text; "None" for that of None."""
    if isinstance(annotation, str):
        return tuple(re.findall(r"\w+", annotation))
    if get_origin(annotation) in (Union, UnionType):
        return tuple(name for member in get_args(annotation) for name in _class_names(member))
    return ("None" if annotation is NoneType else getattr(annotation, "__name__", ""),)


def other_class(annotation: Any, value: Any) -> str:
    """What is wrong with the class of a value, empty where it is one of the annotation."""
    expected, own = _class_names(annotation), {base.__name__ for base in type(value).__mro__}
    if (value is None and "None" in expected) or own & set(expected):
        return ""
    return f"is of type {type(value).__name__}; it must be {listed(expected)}"


def _problem(item: Declared, value: Any) -> str:
    """What is wrong with a value, empty where nothing is."""
    if item.kind == "gm_sigma" and not isinstance(value, str):
        return _out_of_range(item, value)
    if item.choices and item.kind in ("choice", "whole", "gm_sigma"):
        comparable = isinstance(value, str | Real)  # an array is not
        if not comparable or value not in item.choices:
            return f"must be {listed(item.choices)}"
    return _CHECKS[item.kind](item, value) if item.kind in _CHECKS else ""


def _out_of_range(item: Declared, value: Any) -> str:
    if not is_number(value):
        return "must be a number"
    if item.kind == "whole" and value % 1 != 0:
        return "must be a whole number"
    low, high = item.option.low, item.option.high
    if in_range(item, value):
        return ""
    return f"must be {low:g} to {high:g}" if high < math.inf else f"must be {low:g} or more"


def _no_flag(item: Declared, value: Any) -> str:
    return "" if isinstance(value, bool) else "must be true or false"


def _no_sign(item: Declared, value: Any) -> str:
    return "" if is_number(value) and abs(value) == 1.0 else "must be 1 or -1"


def _no_letters(item: Declared, value: Any) -> str:
    allowed = "".join(map(str, item.choices))
    right = isinstance(value, str) and value and set(value) <= set(allowed)
    return "" if right else f"must be letters of {allowed}"


def _no_numbers(item: Declared, value: Any) -> str:
    count = ("", "a number", "two numbers", "three numbers")[item.count]
    positive = item.option.positive or item.kind == "sigmas"
    if not are_numbers(value, item.count) or (positive and min(value) <= 0.0):
        return f"must be {count} greater than zero" if positive else f"must be {count}"
    return ""


def _no_place(item: Declared, value: Any) -> str:
    right = are_numbers(value, 3) and is_place(*value)
    return "" if right else "must be latitude, longitude (deg), ellipsoidal height (m)"


def _no_quality_sigmas(item: Declared, value: Any) -> str:
    if problem := _no_mapping(item, value):
        return problem
    qualities = item.option.members() if item.option.members else ()
    if odd := [name for name in value if name not in qualities]:
        return f"{odd[0]!r} is no quality; {near(str(odd[0]), qualities)}"
    wrong = [name for name in value if not are_numbers(value[name], 3) or min(value[name]) <= 0.0]
    return f"{wrong[0]}: must be three numbers greater than zero" if wrong else ""


def no_text(item: Declared, value: Any) -> str:
    """What is wrong with a value that should be a text."""
    return "" if isinstance(value, str) else "must be a text"


def no_texts(item: Declared, value: Any) -> str:
    """What is wrong with a value that should be a list of texts."""
    if isinstance(value, str):
        return f"must be a list; give [{value!r}]"
    right = isinstance(value, tuple) and all(isinstance(word, str) for word in value)
    return "" if right else "must be a list of texts"


def _no_path(item: Declared, value: Any) -> str:
    return other_class(Path, value) if _plain(item.type) is Path else ""  # or it is a record


def _no_paths(item: Declared, value: Any) -> str:
    return "" if isinstance(value, tuple) else "must be a list of files"


def _no_observations(item: Declared, value: Any) -> str:
    several = isinstance(value, tuple) and value and all(isinstance(one, Path) for one in value)
    return "" if several else other_class(Path, value)


def _no_event_numbers(item: Declared, value: Any) -> str:
    right = isinstance(value, tuple) and all(is_number(k) and k >= 1 and k % 1 == 0 for k in value)
    return "" if right else "must be a list of whole numbers from 1, as the events are counted"


def _no_mapping(item: Declared, value: Any) -> str:
    return "" if isinstance(value, Mapping) else "must be a mapping by name"


def _no_columns(item: Declared, value: Any) -> str:
    right = isinstance(value, list | tuple | Mapping)
    return "" if right else "must be a list of names, or a mapping of the names in the file"


def _no_names(item: Declared, value: Any) -> str:
    if problem := no_texts(item, value):
        return problem
    check_names = tuple(map(str, item.choices))
    odd = [name for name in value if name not in check_names]
    return f"{odd[0]!r} is no check; {near(odd[0], check_names)}" if odd else ""


def _no_tables(item: Declared, value: Any) -> str:
    right = isinstance(value, tuple) and not any(other_class(item.type, one) for one in value)
    return "" if right else f"must be a list of {_class_names(item.type)[-1]}"


_LISTS = ("event_numbers", "files", "formats", "names", "tables", "texts")

_CHECKS: dict[str, Callable[[Declared, Any], str]] = {
    "air": _no_mapping,
    "columns": _no_columns,
    "covariance": lambda item, value: other_class(item.type, value),
    "directory": _no_path,
    "engine": no_text,
    "event_numbers": _no_event_numbers,
    "existing": _no_path,
    "file_or_directory": _no_path,
    "file": _no_path,
    "files": _no_paths,
    "flag": _no_flag,
    "gnss_units": _no_mapping,
    "images": _no_path,
    "imu_units": _no_mapping,
    "letters": _no_letters,
    "name": no_text,
    "names": _no_names,
    "number": _out_of_range,
    "observations": _no_observations,
    "numbers": _no_numbers,
    "place": _no_place,
    "quality_sigmas": _no_quality_sigmas,
    "rate": _out_of_range,
    "rtklib": _no_mapping,
    "sigmas": _no_numbers,
    "sign": _no_sign,
    "tables": _no_tables,
    "text": no_text,
    "texts": no_texts,
    "whole": _out_of_range,
}
_USUAL_FORMS: dict[str, Callable[[Any], Any]] = {}


def register(
    kind: str,
    problem: Callable[[Declared, Any], str],
    usual_form: Callable[[Any], Any] | None = None,
) -> None:
    """Add a kind of option whose values only a wing above this module can judge.

    Parameters
    ----------
    kind : str
        Its name, as `Option.kind` has it.
    problem : function
        Of the option and a value: what is wrong with the value, empty where nothing is.
    usual_form : function, optional
        Of a value: the form in which the dataclass keeps it.
    """
    _CHECKS[kind] = problem
    if usual_form is not None:
        _USUAL_FORMS[kind] = usual_form


def is_number(value: Any) -> bool:
    """Whether a value is a real number, true and false not among them."""
    return isinstance(value, Real) and not isinstance(value, bool)


def are_numbers(value: Any, count: int) -> bool:
    """Whether a value is so many finite numbers."""
    try:
        parts = tuple(value)
    except TypeError:
        return False
    return len(parts) == count and all(is_number(x) and math.isfinite(x) for x in parts)


def in_range(item: Declared, value: float) -> bool:
    """Whether a number is finite and lies within the option's range."""
    return (
        is_number(value) and math.isfinite(value) and item.option.low <= value <= item.option.high
    )


def is_place(lat_deg: float, lon_deg: float, height_m: float) -> bool:
    """Whether there can be such a latitude, longitude and ellipsoidal height."""
    return abs(lat_deg) <= 90.0 and abs(lon_deg) <= 180.0 and -1000.0 <= height_m <= 10000.0


def swapped(lat_deg: float, lon_deg: float) -> str:
    """Advice for a latitude, longitude and height that cannot be a place."""
    if abs(lat_deg) > 90.0 >= abs(lon_deg):
        return "are latitude and longitude swapped?"
    return "order and units are deg, deg, m"


def options_of(table: str, classes: Sequence[type]) -> Iterator[Declared]:
    """The options of a table of the flight file whose keys several dataclasses share."""
    for kind in classes:
        for item in declared(kind).values():
            if item.option.only in ("", table):
                yield item


def take_record(table: Any, name: str, maker: str, *more: Any) -> None:
    """Turn what a caller gives where a flight file names a file into a record, a text into a path.

    Parameters
    ----------
    table : dataclass
        The frozen dataclass whose field it is, at its birth.
    name : str
        The field.
    maker : str
        The function of `insgnss.records` that makes the record of an array, a table or a record.
    more
        Further arguments of that function.
    """
    value = getattr(table, name)
    if isinstance(value, str):
        object.__setattr__(table, name, Path(value))
    elif value is not None and not isinstance(value, Path):
        from ... import records

        object.__setattr__(table, name, getattr(records, maker)(value, *more))


def refuse_unread(table: Any, name: str, changes: Mapping[str, Any]) -> None:
    """Refuse changes that say how a file is read where a record stands in its place.

    Parameters
    ----------
    table : dataclass
        The table with the changes; its first option is the file or the record.
    name : str
        Its name.
    changes : mapping
        Value by field of the table.

    Raises
    ------
    OptionError
        Naming the first of them that is not the default.
    """
    options = declared(table.__class__)
    file = next(iter(options))
    record = getattr(table, file)
    if record is None or isinstance(record, Path):
        return
    made_now = file in changes and changes[file] is not record
    for key in changes:
        item = options.get(key)
        if item is None or not item.option.of_file or (made_now and key in OF_ARRAYS):
            continue
        if getattr(table, key) not in (item.default, getattr(record, key, item.default)):
            problem = f"says how a file is read, but {name}.{file} is given as an object"
            raise OptionError(f"{name}.{key}", f"{problem}; leave it out and change the object")


OF_ARRAYS = ("quantity", "sigma_m", "sigma_velocity_mps")
"""Options that an array or a table takes as well, when a record is made of it."""
