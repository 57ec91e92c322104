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
import re
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import MISSING, dataclass, field, fields
from functools import cache
from pathlib import Path
from types import NoneType, UnionType
from typing import Any, Literal, Union, get_args, get_origin

from ...base.errors import OptionError

Words = tuple[str, ...] | tuple[int, ...]
Triple = tuple[float, float, float]

BY_HEADER = "by header or order"
"""How page and help describe the default of `columns`."""

_KIND_OF_TYPE: dict[type, str] = {
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
        What its values are (`kinds.KINDS`); empty: by the type of the field.
    form : str
        How the page describes its value, where kind and type do not say enough.
    usual : str
        How page and help describe a default that is no literal value.
    only : str
        The one table that has the option, where several share its dataclass.
    of_file : bool
        Whether it says how the file of its table is read, and nothing of a record in its place.
    needs : tuple of str
        Options of the same dataclass without which it has no meaning.
    cli : str
        Its option of the command line, "--mask" ("--": by its name), or its positional argument,
        "ROVER"; empty: none.
    metavar, cli_meaning, cli_default : str
        Name of the value in the help; meaning and default where those of the page do not fit.
    group : str
        Heading of the help under which its argument stands; empty: none.
    alone : Any
        Its value where its argument stands without one; None: it must have one.
    repeated : bool
        Whether its argument takes one word and is repeated, for more.
    scale : float
        What a number of the command line, of another unit, is multiplied by.
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
    needs: tuple[str, ...] = ()
    cli: str = ""
    metavar: str = ""
    cli_meaning: str = ""
    cli_default: str = ""
    group: str = ""
    alone: Any = None
    repeated: bool = False
    scale: float = 1.0


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


def sigmas(meaning: str, unit: str = "m", **more: Any) -> Any:
    """Field of a dataclass that is an option of three standard deviations, None by default."""
    return option(None, meaning, kind="sigmas", unit=unit, **more)


def columns_of_file(meaning: str, **more: Any) -> Any:
    """Field of a dataclass that is an option naming the columns of a file, by default its own."""
    return option(None, meaning, kind="columns", usual=BY_HEADER, **more)


def argument(default: Any, meaning: str, **more: Any) -> Any:
    """Field of a dataclass that is an option of a verb, by its own name where no other is given."""
    if default is ... and not more.get("cli", "-").startswith("-"):
        return field(metadata={"option": Option(meaning=meaning, **more)})
    return option(default, meaning, **({"cli": "--"} | more))


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
        return self.default is None or "None" in class_names(self.type)

    @property
    def kind(self) -> str:
        """Name of its kind (`kinds.KINDS`)."""
        return self.option.kind or _kind(self.type)

    @property
    def choices(self) -> Words:
        """Values that it may have, empty where others may."""
        declared_choices = self.option.choices
        if callable(declared_choices):
            return declared_choices()
        return declared_choices or (get_args(plain(self.type)) if self.kind == "choice" else ())

    @property
    def flag(self) -> str:
        """Its option of the command line, or its positional argument; empty: none."""
        named = f"--{self.name.replace('_', '-')}"
        return named if self.option.cli == "--" else self.option.cli

    @property
    def count(self) -> int:
        """How many numbers it has."""
        return len(get_args(plain(self.type)))


def plain(annotation: Any) -> Any:
    """The type without `| None`."""
    if get_origin(annotation) in (Union, UnionType):
        members = [member for member in get_args(annotation) if member is not NoneType]
        return members[0] if len(members) == 1 else annotation
    return annotation


def class_names(annotation: Any) -> tuple[str, ...]:
    """Names of the classes of an annotation, which may be a text; "None" for that of None."""
    if isinstance(annotation, str):
        return tuple(re.findall(r"\w+", annotation))
    if get_origin(annotation) in (Union, UnionType):
        return tuple(name for member in get_args(annotation) for name in class_names(member))
    return ("None" if annotation is NoneType else getattr(annotation, "__name__", ""),)


def _kind(annotation: Any) -> str:
    kind = plain(annotation)
    if kind in _KIND_OF_TYPE:
        return _KIND_OF_TYPE[kind]
    if get_origin(kind) is Literal:
        return "choice"
    if get_origin(kind) is tuple:
        parts = get_args(kind)
        if set(parts) == {float}:
            return "numbers"
        if parts == (str, ...):
            return "texts"
        if parts == (Path, ...):
            return "files"
    raise TypeError(f"{annotation}: say by kind=... which of options.kinds it is")


@cache
def declared_options(table: type) -> Mapping[str, Declared]:
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


def options_of(table: str, classes: Sequence[type]) -> Iterator[Declared]:
    """The options of a table of the flight file whose keys several dataclasses share."""
    for kind in classes:
        for item in declared_options(kind).values():
            if item.option.only in ("", table):
                yield item


def reading_of(table: Any) -> dict[str, Any]:
    """The options of a table that say how its file is read, as keywords of the reader."""
    options = declared_options(table.__class__).values()
    return {item.name: getattr(table, item.name) for item in options if item.option.of_file}


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
    options = declared_options(table.__class__)
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
