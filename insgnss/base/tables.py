"""Reading a TOML file so that every refusal names its line.

The file is tables whose values are checked as they are taken.
"""

import math
import re
import reprlib
import tomllib
from collections.abc import Mapping, Sequence
from contextlib import nullcontext
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from .errors import UNSET, InputError, OptionError, near, nearest
from .files import lines_of
from .inputs import is_file, read_text
from .received.nesting import DEEPEST_NESTING, too_deep
from .received.trusted import trusting
from .units import LARGEST_UNIT, exact_float, is_number, parse_quantity

Columns = tuple[str, ...] | Mapping[str, str] | None

LONGEST_TOML = 1_000_000  # characters: no file of settings has as many
# characters of a name and of a path: what file systems take at most
LONGEST_FILE_NAME, LONGEST_PATH = 255, 4000
NESTED = f"nested tables or lists (limit {DEEPEST_NESTING}); write them without nesting"
_DOTTED = re.compile(r"[^=#]*")
_TYPE_NAMES = {
    bool: "true/false",
    int: "a number",
    float: "a number",
    str: "a text",
    list: "a list",
    dict: "a table",
}


@dataclass(frozen=True)
class KeySource:
    """The file that a key of a table came from, where that is another one than the table's.

    Parameters
    ----------
    path : Path
        The file.
    lines : mapping of str to int
        Line, counted from 1, of each of its keys by dotted name.
    """

    path: Path
    lines: Mapping[str, int]


@dataclass(frozen=True)
class OptionTable:
    """A table of the file: its checked values by key, and errors that know the line.

    The default ``...`` means required. `sources` has the keys, by dotted name, that came from
    another file, to which their paths are relative.
    """

    path: Path
    lines: Mapping[str, int]
    keys: Mapping[str, tuple[str, ...]]
    name: str
    data: Mapping[str, Any]
    sources: Mapping[str, KeySource] = field(default_factory=dict)

    def error(self, key: str, problem: str, value: Any = UNSET) -> InputError:
        """Return an error at the line of `key`, of its table where the key is absent."""
        full = self.full(key)
        source = self.source(key)
        line, prefix = None, full
        while prefix and line is None:
            line, prefix = source.lines.get(prefix), prefix.rpartition(".")[0]
        ours = nearest(key.partition(".")[0], self.keys.get(self.name, ()))
        # a key of ours, or one that is nearly so, is no text of others, wherever the file lies
        with trusting([source.path]) if ours else nullcontext():
            text = str(value).lower() if isinstance(value, bool) else reprlib.repr(value)
            shown = "" if value is UNSET else f" = {text}"
            return InputError.at_line(source.path, line, f"{full}{shown}: {problem}")

    def refusal(self, error: OptionError) -> InputError:
        """Return the refusal of an option at the line of its key, here or in a table around it."""
        key, table = error.key, self.name
        while table and not key.startswith(f"{table}."):
            table = table.rpartition(".")[0]
        key = key.removeprefix(f"{table}.")
        return self.error(key, error.problem, error.value)

    def source(self, key: str) -> KeySource:
        """Return the file that `key`, or the value around it, came from."""
        prefix = self.full(key)
        while prefix and prefix not in self.sources:
            prefix = prefix.rpartition(".")[0]
        return self.sources[prefix] if prefix else KeySource(self.path, self.lines)

    def full(self, key: str) -> str:
        """Return the dotted name of a key."""
        return ".".join(filter(None, (self.name, key)))

    def check_keys(self) -> None:
        """Refuse a key that this table does not know.

        The error names the nearest key, or the table that it belongs to.
        """
        own_keys = self.keys[self.name]
        for key in self.data:
            if key not in own_keys:
                homes = [
                    table for table, keys in self.keys.items() if key in keys and "." not in table
                ]
                advice = near(key, own_keys)
                if 0 < len(homes) < 3:
                    advice = (
                        f"this key belongs in {' or '.join(f'[{home}]' for home in homes)}"
                        if homes[0]
                        else "this key belongs at the top, before the first [table]"
                    )
                raise self.error(key, f"unknown {'key' if self.name else 'table or key'}; {advice}")

    def table(self, key: str) -> "OptionTable":
        """Return a sub-table, its keys checked; it is empty where it is absent."""
        value = self.value(key, dict, {})
        sub = OptionTable(self.path, self.lines, self.keys, self.full(key), value, self.sources)
        sub.check_keys()
        return sub

    def tables(self, key: str) -> "list[OptionTable]":
        """Return an array of sub-tables ([[name]]), keys checked, empty where it is absent."""
        items = self.data.get(key, [])
        name = self.full(key)
        if not isinstance(items, list) or not all(isinstance(item, dict) for item in items):
            raise self.error(key, f"{reprlib.repr(items)}, expected [[{name}]] tables")
        source = self.source(key)
        subs = [
            OptionTable(source.path, _lines_of_entry(source.lines, name, k), self.keys, name, item)
            for k, item in enumerate(items)
        ]
        for sub in subs:
            sub.check_keys()
        return subs

    def value(self, key: str, kind: type, default: Any) -> Any:
        """Value of `key` if it is of TOML type `kind`; where it is absent, `default`."""
        if key not in self.data:
            if default is ...:
                raise self.error(key, "is missing; it has no default")
            return default
        value = self.data[key]
        if isinstance(value, bool) is not (kind is bool) or not isinstance(
            value, (int, float) if kind is float else kind
        ):
            got = _TYPE_NAMES.get(type(value), "a date or time")
            raise self.error(key, f"{reprlib.repr(value)} is {got}, expected {_TYPE_NAMES[kind]}")
        return value

    def quantity(self, key: str, dimension: str) -> float:
        """Return a number with its unit in SI, of the dimension of a unit such as "deg/s"."""
        try:
            return parse_quantity(self.data.get(key), dimension)
        except InputError as error:
            raise self.error(key, str(error)) from None

    def text(self, key: str, default: Any = ...) -> Any:
        """A text that is not empty."""
        value = self.value(key, str, default)
        if value == "":
            raise self.error(key, "is an empty text")
        return value

    def choice(self, key: str, choices: Sequence[str], default: str) -> Any:
        """One of the `choices` words."""
        value = self.text(key, default)
        if value not in choices:
            raise self.error(key, f"{value!r} is unknown; {near(value, choices)}")
        return value

    def number(
        self, key: str, default: Any = ..., low: float = -math.inf, high: float = math.inf
    ) -> Any:
        """A finite number within [low, high]."""
        value = self.value(key, float, default)
        if value is None:
            return None
        if not (is_number(value) and low <= value <= high):
            raise self.error(key, f"{value} is outside {low:g} to {high:g}")
        return float(value)

    def numbers(self, key: str, count: int, default: Any = ...) -> Any:
        """A tuple of `count` finite numbers."""
        values = self.value(key, list, default)
        if values is default:
            return values
        if len(values) != count or not all(is_number(v) for v in values):
            raise self.error(key, f"{reprlib.repr(values)}, expected {count} finite numbers")
        return tuple(float(v) for v in values)

    def sigmas(self, key: str, default: Any) -> Any:
        """Three standard deviations greater than zero."""
        values = self.numbers(key, 3, default)
        if values is not None and not 0.0 < min(values) <= max(values) < LARGEST_UNIT:
            limits = f"must be greater than zero and below {LARGEST_UNIT:g}"
            raise self.error(key, f"{list(values)}: a standard deviation {limits}")
        return values

    def matrix(self, key: str) -> NDArray[np.float64]:
        """Return (3, 3) finite numbers."""
        rows = self.value(key, list, ...)
        if len(rows) != 3 or not all(
            isinstance(row, list) and len(row) == 3 and all(is_number(v) for v in row)
            for row in rows
        ):
            raise self.error(key, f"{reprlib.repr(rows)}, expected 3 rows of 3 finite numbers")
        return np.array(rows, dtype=np.float64)

    def texts(self, key: str, default: Any) -> Any:
        """Return a tuple of texts, none empty."""
        values = self.value(key, list, list(default))
        if not all(isinstance(v, str) and v for v in values):
            raise self.error(key, f"{reprlib.repr(values)}, expected a list of texts")
        return tuple(values)

    def resolve(self, name: str | Path, key: str = "") -> Path:
        """Return the path of a name given relative to the file, or to that which gave `key`."""
        text = str(name)
        longest = max(len(step) for step in re.split(r"[/\\]", text))
        if longest > LONGEST_FILE_NAME or len(text) > LONGEST_PATH or "\0" in text:
            shown = f"{text[:40]!r}..., {len(text)} characters"
            raise InputError.in_file(self.path, f"{shown}, is not a valid file path; correct it")
        return self.source(key).path.parent / name

    def file(self, key: str) -> Path:
        """Return the path of a file that exists and is not empty."""
        name = self.text(key)
        path = self.resolve(name, key)
        if path.is_dir():
            raise self.error(key, f"{name} is a directory, a file is expected")
        if not is_file(path):
            remedy = f"the path is relative to {self.source(key).path.name}"
            slashed = name.replace("\\", "/")
            if slashed != name and self.resolve(slashed).is_file():
                remedy = f"{slashed} exists: write paths with /, which every system reads"
            raise self.error(key, f"{name} does not exist; {remedy}")
        if path.stat().st_size == 0:
            raise self.error(key, f"{name} is empty; copy the recording again")
        return path


def read_toml(path: Path, keys: Mapping[str, tuple[str, ...]]) -> OptionTable:
    """The whole file as a table, with the lines of its keys.

    `keys` names those that each table may hold.
    """
    if not is_file(path):
        raise InputError.in_file(
            path, "does not exist; give the flight file, or the directory that holds flight.toml"
        )
    try:
        text = read_text(path, "utf-8-sig")
    except UnicodeDecodeError as error:
        raise InputError.in_file(
            path, f"byte {error.start} is not UTF-8; save the file as UTF-8"
        ) from None
    return table_of_text(path, text, keys)


def table_of_text(path: Path, text: str, keys: Mapping[str, tuple[str, ...]]) -> OptionTable:
    """Return the text of a file as `read_toml` returns the file."""
    return OptionTable(path, _key_lines(text), keys, "", parse_toml(path, text))


def parse_toml(path: Path, text: str) -> dict[str, Any]:
    """Return the tables of the TOML text of a file.

    Raises
    ------
    InputError
        With the line, where it is known, for what is no TOML, holds tables or lists within each
        other more than 100 deep, or has more than a million characters: no file that a person
        wrote.
    """
    if len(text) > LONGEST_TOML:
        problem = (
            f"{len(text)} characters are too many for a file of settings (limit {LONGEST_TOML})"
        )
        raise InputError.in_file(path, problem)
    for number, line in enumerate(lines_of(text), 1):
        if (
            line.count(".") > DEEPEST_NESTING
            and (key := _DOTTED.match(line))
            and key[0].count(".") > DEEPEST_NESTING
        ):
            raise InputError.at_line(path, number, f"{key[0].count('.')} {NESTED}")
    try:
        data = tomllib.loads(text, parse_float=exact_float)
    except RecursionError:
        raise InputError.in_file(path, f"more than {DEEPEST_NESTING} {NESTED}") from None
    except ValueError as error:  # TOMLDecodeError, or an integer of thousands of digits
        location = re.search(r"at line (\d+)", str(error))
        line_number = int(location[1]) if location else None
        remedy = ""
        if line_number and "\\" in text.split("\n")[line_number - 1]:
            remedy = "; write paths with /, on Windows too, or in single quotes"
        raise InputError.at_line(path, line_number, f"not TOML: {error}{remedy}") from None
    if too_deep(data):
        raise InputError.in_file(path, f"more than {DEEPEST_NESTING} {NESTED}")
    return data


def line_of_key(path: Path, key: str) -> int | None:
    """Return the line of a key by its dotted name; None where a file does not have it itself."""
    try:
        return _key_lines(read_text(path, "utf-8-sig")).get(key)
    except (OSError, ValueError):
        return None


def _key_lines(text: str) -> dict[str, int]:
    """Line, counted from 1, of every table header and of every key that begins a line.

    The keys are dotted names; entries of an array of tables are numbered from 0.
    """
    lines: dict[str, int] = {}
    entries: dict[str, int] = {}
    table = ""
    for number, line in enumerate(lines_of(text), 1):
        if header := re.match(r"\s*(\[\[?)([\w.\- ]+)\]\]?\s*(#.*)?$", line):
            table = header[2].replace(" ", "")
            lines.setdefault(table, number)
            array = table if header[1] == "[[" else table.rpartition(".")[0]
            if header[1] == "[[":
                entries[array] = entries.get(array, -1) + 1
            if array in entries:
                table = f"{array}.{entries[array]}{table.removeprefix(array)}"
                lines.setdefault(table, number)
        elif key := re.match(r"""\s*["']?([\w.\-]+)["']?\s*=""", line):
            lines.setdefault(".".join(filter(None, (table, key[1]))), number)
    return lines


def _lines_of_entry(lines: Mapping[str, int], name: str, entry: int) -> dict[str, int]:
    """Return the lines of a file with one entry of the array `name` in the place of the array."""
    numbered = f"{name}.{entry}"
    around = {key: line for key, line in lines.items() if not key.startswith(f"{name}.")}
    inside = {
        key.removeprefix(numbered): line for key, line in lines.items() if key.startswith(numbered)
    }
    return around | {name + key: line for key, line in inside.items() if key[:1] in ("", ".")}
