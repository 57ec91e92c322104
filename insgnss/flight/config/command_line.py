"""Arguments of a verb, made of the options that records and tables declare.

An option that names its argument (`cli="--max-age"`; `cli="--"`: by its name) becomes one, with
meaning, unit, range and default in its help. Only the standard library is needed.
"""

import argparse
from collections.abc import Callable, Iterable, Mapping, Sequence
from pathlib import Path
from typing import Any, TypeVar

from ...base.errors import OptionError, UsageError
from ...base.wording import spoken_as
from ...io.options.kinds import OPTION_KINDS, in_range, range_words
from ...io.options.schema import Declared, options_of
from .flight_file import FLIGHT_TABLES

Request = TypeVar("Request")


def add_options(
    parser: argparse.ArgumentParser,
    classes: Iterable[type],
    required: Sequence[str] | None = None,
    table: str = "",
) -> None:
    """Add the arguments that the options of some dataclasses declare.

    The parsed values have the names of the options; what nobody gives is None.

    Parameters
    ----------
    parser : argparse.ArgumentParser
        Gets the arguments.
    classes : Iterable[type]
        The dataclasses whose options are taken.
    required : Sequence[str], optional
        Options that must be given; None: those without a default.
    table : str
        Whose options they are, where those of several tables share names: the parsed values have
        it before their names, with two underscores between them.
    """
    groups: dict[str, Any] = {"": parser}
    for item in options_of(table, tuple(classes)):
        if item.flag:
            group = item.option.group
            if group not in groups:
                groups[group] = parser.add_argument_group(group)
            needed = item.required if required is None else item.name in required
            _add_argument(groups[group], item, f"{table}__{item.name}".removeprefix("__"), needed)


def given_of(parsed: argparse.Namespace, kind: type, table: str = "") -> dict[str, Any]:
    """The values of a dataclass' options by name, of those that somebody gave."""
    values = {
        item.name: getattr(parsed, f"{table}__{item.name}".removeprefix("__"), None)
        for item in options_of(table, (kind,))
    }
    return {
        name: tuple(value) if isinstance(value, list) else value
        for name, value in values.items()
        if value is not None and value != []
    }


def made_of(kind: Callable[..., Request], parsed: argparse.Namespace, **more: Any) -> Request:
    """The record of a verb's arguments; UsageError in the words of the command line."""
    with spoken_as(names_of({"": (kind,)})):  # type: ignore[dict-item]
        try:
            return kind(**given_of(parsed, kind), **more)  # type: ignore[arg-type]
        except OptionError as error:
            verb = " ".join(filter(None, (parsed.verb, getattr(parsed, "what", ""))))
            raise UsageError(f"{verb}: {error}; see insgnss {verb} --help") from None


def names_of(tables: Mapping[str, Iterable[type]] = FLIGHT_TABLES) -> dict[str, str]:
    """The option of the command line for each key of the flight file that has one."""
    return {
        ".".join(filter(None, (table, item.name))): item.flag
        for table, classes in tables.items()
        for item in options_of(table, tuple(classes))
        if item.flag
    }


def _add_argument(parser: Any, item: Declared, name: str, required: bool) -> None:
    """Add one declared option to the parser, as its kind takes its values."""
    option, kind = item.option, OPTION_KINDS[item.kind]
    settings: dict[str, Any] = {"help": _help(item, required), "type": _word(item)}
    if kind.several:
        settings |= {"nargs": "+", "action": "extend"}
    if option.repeated:
        settings |= {"nargs": None, "action": "append"}
    elif item.kind in ("numbers", "lever", "moved", "sigmas"):
        settings["nargs"] = item.count
    if option.alone is not None:
        settings |= {"nargs": "?", "const": option.alone}
    if item.kind in ("choice", "whole") and item.choices:
        settings["choices"] = item.choices
    if not item.flag.startswith("-"):
        nargs = ("+" if required else "*") if kind.several else None if required else "?"
        settings |= {"nargs": nargs, "action": "store"}
        if item.kind != "choice":
            settings["metavar"] = item.flag
        parser.add_argument(name, **settings)
        return
    if item.kind == "flag":
        flag_action = "store_false" if item.default else "store_true"
        settings["action"] = argparse.BooleanOptionalAction if item.default is None else flag_action
        settings.pop("type")
    elif "choices" not in settings:
        name_of_value = option.metavar or _metavar(item)
        settings["metavar"] = (
            tuple(name_of_value.split()) if " " in name_of_value else name_of_value
        )
    if required:
        settings["required"] = True
    settings["default"] = [] if kind.several and not required else None
    parser.add_argument(item.flag, dest=name, **settings)


def _word(item: Declared) -> Callable[[str], Any]:
    """How a word is read; where the command line has another unit, it is judged in that."""
    scale, word = item.option.scale, OPTION_KINDS[item.kind].word
    if scale == 1.0:
        return word

    def scaled(text: str) -> float:
        if not in_range(item, float(text)):
            raise argparse.ArgumentTypeError(f"{text!r} must be {range_words(item)}")
        return scale * float(text)

    return scaled


def _metavar(item: Declared) -> str:
    """Name of the value in the help: by unit, else by what it is."""
    names: dict[Any, str] = {Path: "FILE", int: "N", float: "X"}
    return item.option.unit.upper() or names.get(OPTION_KINDS[item.kind].word, "NAME")


def _help(item: Declared, required: bool) -> str:
    """Meaning, unit, range and default."""
    option = item.option
    meanings = [option.cli_meaning or option.meaning]
    if option.unit and not option.cli_meaning:
        meanings.append(option.unit)
    if item.kind in ("number", "whole") and not item.choices:
        meanings.append(range_words(item))
    text = ", ".join(filter(None, meanings))
    usual = option.cli_default or option.usual or default_words(item.default)
    if not (required or item.kind in ("flag", "covariance") or not usual):
        text = f"{text} (default: {usual})"
    return text.replace("%", "%%")


def default_words(value: Any) -> str:
    """A default as the command line takes it, empty for none."""
    if value is None or value is ... or value == "" or isinstance(value, Mapping):
        return ""
    if isinstance(value, tuple):
        return " ".join(map(default_words, value))
    return f"{value:g}" if isinstance(value, int | float) else str(value)
