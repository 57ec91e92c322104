"""Arguments of a verb, made of the options that the flight file declares.

An option that names its argument (`cli="--max-age"`) becomes one, with meaning, unit, range and
default in its help. Only the standard library is needed.
"""

import argparse
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

from ...io.options.schema import Declared, options_of
from .flight_file import TABLES

_TYPES: dict[str, Any] = {
    "covariance": Path,
    "event_numbers": int,
    "existing": Path,
    "file_or_directory": Path,
    "file": Path,
    "files": Path,
    "images": Path,
    "observations": Path,
    "number": float,
    "numbers": float,
    "whole": int,
}
_LISTS = ("event_numbers", "files", "observations", "rtklib", "texts")


def add_options(
    parser: argparse.ArgumentParser, tables: Iterable[type], required: Sequence[str] = ()
) -> None:
    """Add the arguments that the options of some tables declare.

    The parsed values have the names of the options; what nobody gives is None, or an empty list.

    Parameters
    ----------
    parser : argparse.ArgumentParser
        Gets the arguments.
    tables : Iterable[type]
        The dataclasses whose options are taken.
    required : Sequence[str]
        Options that must be given.
    """
    for table in tables:
        for item in options_of("", [table]):
            if item.option.cli:
                _add(parser, item, item.name in required)


def add_options_of_tables(
    parser: argparse.ArgumentParser, tables: Mapping[str, Iterable[type]]
) -> None:
    """Add the arguments of tables whose options may share names.

    The parsed values have the names of table and option, with two underscores between them.

    Parameters
    ----------
    parser : argparse.ArgumentParser
        Gets the arguments.
    tables : mapping
        The dataclasses of each table.
    """
    for name, classes in tables.items():
        for item in options_of(name, tuple(classes)):
            if item.option.cli:
                _add(parser, replace(item, name=f"{name}__{item.name}"), False)


def given_of_tables(
    parsed: argparse.Namespace, tables: Mapping[str, Iterable[type]]
) -> dict[str, dict[str, Any]]:
    """The values of the options of each table by name, of those that somebody gave."""
    given: dict[str, dict[str, Any]] = {name: {} for name in tables}
    for name, classes in tables.items():
        for item in options_of(name, tuple(classes)):
            value = getattr(parsed, f"{name}__{item.name}", None)
            if value is not None and value != []:
                given[name][item.name] = tuple(value) if isinstance(value, list) else value
    return given


def names_of(tables: Mapping[str, Iterable[type]] = TABLES) -> dict[str, str]:
    """The option of the command line for each key of the flight file that has one."""
    options = {}
    for table, classes in tables.items():
        for item in options_of(table, tuple(classes)):
            if item.option.cli:
                options[".".join(filter(None, (table, item.name)))] = item.option.cli
    return options


def given_of(parsed: argparse.Namespace, table: type) -> dict[str, Any]:
    """The values of a table's options by name, of those that somebody gave."""
    values = {item.name: getattr(parsed, item.name, None) for item in options_of("", [table])}
    return {
        name: tuple(value) if isinstance(value, list) else value
        for name, value in values.items()
        if value is not None and value != []
    }


def _add(parser: argparse.ArgumentParser, item: Declared, required: bool) -> None:
    stated, kind = item.option, item.kind
    words = stated.cli_meaning or stated.meaning
    if not stated.cli.startswith("-"):
        count = "+" if kind in _LISTS else None
        parser.add_argument(
            item.name, type=Path, metavar=stated.cli, help=_percent(words), nargs=count
        )
        return
    more: dict[str, Any] = {"dest": item.name, "default": None, "help": _help(item, required)}
    if kind == "flag":
        action = "store_false" if item.default else "store_true"
        parser.add_argument(stated.cli, action=action, **more)
        return
    if required:
        more["required"] = True
    if kind in _LISTS:
        more |= {"nargs": "+", "action": "extend", "default": None if required else []}
    elif kind == "numbers":
        more["nargs"] = item.count
    if kind in _TYPES:
        more["type"] = _TYPES[kind]
    if stated.metavar:
        more["metavar"] = stated.metavar
    if kind in ("choice", "whole") and item.choices:
        more["choices"] = item.choices
    parser.add_argument(stated.cli, **more)


def _help(item: Declared, required: bool) -> str:
    """Meaning, unit, range and default."""
    stated = item.option
    words = [stated.cli_meaning or stated.meaning]
    if stated.unit and not stated.cli_meaning:
        words.append(stated.unit)
    if item.kind in ("number", "whole") and not item.choices and abs(stated.low) != float("inf"):
        words.append(f"{stated.low:g} to {stated.high:g}")
    usual = stated.cli_default or stated.usual or default_words(item.default)
    if required or item.kind in ("flag", *_LISTS, "covariance") or not usual:
        return _percent(", ".join(words))
    return _percent(f"{', '.join(words)} (default: {usual})")


def default_words(value: Any) -> str:
    """A default as the command line takes it, empty for none."""
    if value is None or value is ... or value == "":
        return ""
    if isinstance(value, tuple):
        return " ".join(map(default_words, value))
    return f"{value:g}" if isinstance(value, int | float) else str(value)


def _percent(text: str) -> str:
    """Text as argparse prints it whole."""
    return text.replace("%", "%%")
