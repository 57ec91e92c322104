"""How a message names an option: as a key of the flight file, or as an option of the command line.

A message deep inside a room says which option the user is to change, and only the border knows how
this user writes it. `spell` and `setting` write it as the flight file does, unless a verb of the
command line has said otherwise:

    named("gnss.antex")                        gnss.antex
    setting("camera.skip_events", [3, 5])      camera.skip_events = [3, 5]

    with spoken_as({"gnss.antex": "--antex", "camera.skip_events": "--skip-events"}):
        named("gnss.antex")                    --antex
        setting("camera.skip_events", [3, 5])  --skip-events 3 5

An argument of a Python function, such as `imu_axes`, is written as a key is. A caller who has no
such option is told what to do instead: `spoken_as(named, {"imu.units gyro": multiply})` calls
`multiply` with the value that the option should have and the one that it was taken for.

The words belong to the current context (`contextvars`); a thread takes them over where it is
started through `contextvars.copy_context`. Which key is which option stands in the schema
(`flight.config.command_line`).

Paths and commands are written as the system's shell takes them (`relative`, `command_line`).
"""

import json
import os
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from contextvars import ContextVar
from dataclasses import dataclass
from types import MappingProxyType
from typing import Any

DOCTOR = "`insgnss doctor` shows what is installed"
"""The end of a message that only an installation can mend."""
Settings = Mapping[str, Callable[[Any, str], str]]


@dataclass(frozen=True)
class _Door:
    """How a caller writes options: their names, and what stands for one that he has not."""

    name: Callable[[str], str]
    settings: Settings


_FLIGHT_FILE = _Door(str, MappingProxyType({}))
_DOOR: ContextVar[_Door] = ContextVar("door", default=_FLIGHT_FILE)


@contextmanager
def spoken_as(
    options: Mapping[str, str] | Callable[[str, str], str], settings: Settings | None = None
) -> Iterator[None]:
    """Name the keys of `options` by its values as long as the context lasts.

    Parameters
    ----------
    options : Mapping[str, str] or callable
        The option of the command line ("--antex") for the key of the flight file ("gnss.antex"),
        or a function of the key and of how the caller outside writes it.
    settings : Mapping[str, callable], optional
        What a caller does who has no such option, by key: a function of the value and of the one
        that it was taken for, "" where there is none.
    """
    outside = _DOOR.get().name
    name: Callable[[str], str] = (
        (lambda key: options(key, outside(key)))
        if callable(options)
        else (lambda key: options.get(key, key))
    )
    token = _DOOR.set(_Door(name, settings or {}))
    try:
        yield
    finally:
        _DOOR.reset(token)


def spell(key: str) -> str:
    """Name of the option that the flight file calls `key`, as the present caller writes it."""
    return _DOOR.get().name(key)


def fill_in(key: str, example: str) -> str:
    """The option `key` with a value to be filled in: `example` of the flight file, unless the
    caller writes it otherwise, as `written("columns [...]", "columns = [...]")` is --columns NAMES.
    """
    option = spell(key)
    return example if option == key else option


def set_to(key: str, value: Any, instead: str = "") -> str:
    """The option `key` with a value that can be copied, or what the caller does instead of it."""
    door = _DOOR.get()
    if (action := door.settings.get(key)) is not None:
        return action(value, instead)
    option = door.name(key)
    if option.startswith("--"):
        return setting(key, value)
    text = str(value) if option != key and isinstance(value, bool) else toml(value)
    return f"{option} = {text}" + (f" (not in {instead})" if instead else "")


def toml(value: Any, width: float = float("inf")) -> str:
    """A value in TOML; a list that is longer than `width` letters has a line for each element."""
    if isinstance(value, Mapping):
        return "{ " + ", ".join(f"{key} = {toml(item)}" for key, item in value.items()) + " }"
    if isinstance(value, Sequence) and not isinstance(value, str):
        items = [toml(item) for item in value]
        line = f"[{', '.join(items)}]"
        return line if len(line) <= width else "[\n" + "".join(f"  {x},\n" for x in items) + "]"
    return json.dumps(value, ensure_ascii=False).replace("\x7f", "\\u007f")


def setting(key: str, value: Any) -> str:
    """The option `key` with a value, as the present caller writes it."""
    option = spell(key)
    if option == key or (option.islower() and option.isidentifier()):  # of Python
        return f"{option} = {str(value).lower() if isinstance(value, bool) else repr(value)}"
    if isinstance(value, bool):
        return option
    parts = value if isinstance(value, list | tuple) else [value]
    return f"{option} {command_line(list(map(str, parts)))}"


def relative(path: str | os.PathLike[str], start: str | os.PathLike[str]) -> str:
    """Return a path relative to a directory; in full where it is on another drive (Windows)."""
    try:
        return os.path.relpath(path, start)
    except ValueError:
        return os.path.abspath(path)


def command_line(arguments: Sequence[str]) -> str:
    """Return arguments as one types them: in the quotation marks of this system's shell."""
    if os.name == "nt":
        import subprocess

        return subprocess.list2cmdline(arguments)
    import shlex

    return shlex.join(arguments)


def duration(seconds: float) -> str:
    """Return a time as people say it: 45 s, 12 min, 3.5 h."""
    if seconds < 100.0:
        return f"{seconds:.0f} s"
    return f"{seconds / 60.0:.0f} min" if seconds < 6000.0 else f"{seconds / 3600.0:.1f} h"


def some(items: Iterable[object], most: int = 3, mark: str = ", ") -> str:
    """The first of many in one phrase, "a, b, c and 4 more"; all where they are not many."""
    texts = [*map(str, items)]
    more = f" and {len(texts) - most} more" if len(texts) > most else ""
    return f"{mark.join(texts[:most])}{more}"


def phrase(choices: Sequence[object]) -> str:
    """The words in one phrase, "a, b or c"."""
    *first, last = map(str, choices)
    return f"{', '.join(first)} or {last}" if first else last
