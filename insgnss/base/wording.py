"""How a message names an option: as a key of the flight file, or as an option of the command line.

A message deep inside a room says which option the user is to change, and only the border knows how
this user writes it. `named` and `setting` write it as the flight file does, unless a verb of the
command line has said otherwise:

    named("gnss.antex")                        gnss.antex
    setting("camera.skip_events", [3, 5])      camera.skip_events = [3, 5]

    with spoken_as({"gnss.antex": "--antex", "camera.skip_events": "--skip-events"}):
        named("gnss.antex")                    --antex
        setting("camera.skip_events", [3, 5])  --skip-events 3 5

An argument of a Python function, such as `imu_axes`, is written as a key is.

The words belong to the current context (`contextvars`); a thread takes them over where it is
started through `contextvars.copy_context`. Which key is which option stands in the schema
(`flight.config.command_line`).

Paths and commands are written as the system's shell takes them (`relative`, `command_line`).
"""

import os
from collections.abc import Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from contextvars import ContextVar
from types import MappingProxyType
from typing import Any

DOCTOR = "`insgnss doctor` shows what is installed"
"""The end of a message that only an installation can mend."""
_OPTIONS: ContextVar[Mapping[str, str]] = ContextVar("options", default=MappingProxyType({}))


@contextmanager
def spoken_as(options: Mapping[str, str]) -> Iterator[None]:
    """Name the keys of `options` by its values as long as the context lasts.

    Parameters
    ----------
    options : Mapping[str, str]
        The option of the command line ("--antex") for the key of the flight file ("gnss.antex").
    """
    token = _OPTIONS.set(options)
    try:
        yield
    finally:
        _OPTIONS.reset(token)


def named(key: str) -> str:
    """Name of the option that the flight file calls `key`, as the present caller writes it."""
    return _OPTIONS.get().get(key, key)


def setting(key: str, value: Any) -> str:
    """The option `key` with a value, as the present caller writes it."""
    option = named(key)
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


def command_line(words: Sequence[str]) -> str:
    """Return words as one types them: in the quotation marks of this system's shell."""
    if os.name == "nt":
        import subprocess

        return subprocess.list2cmdline(words)
    import shlex

    return shlex.join(words)


def some(items: Iterable[object], most: int = 3, mark: str = ", ") -> str:
    """The first of many in one phrase, "a, b, c and 4 more"; all where they are not many."""
    words = [*map(str, items)]
    more = f" and {len(words) - most} more" if len(words) > most else ""
    return f"{mark.join(words[:most])}{more}"


def listed(words: Sequence[object]) -> str:
    """The words in one phrase, "a, b or c"."""
    *first, last = map(str, words)
    return f"{', '.join(first)} or {last}" if first else last
