"""Whose text a message may show: that of files which the user named, or which lie beside or below.

A flight file that somebody sent may name any file of the machine as an input. That `/etc/passwd` is
no table of an IMU is then said with the file and the line, but without a word of it. A command
trusts what its own words name; a function of Python trusts the directory of the flight file or
block file that it reads, and outside of such functions every file is shown. The environment
variable INSGNSS_SHOWN names directories that are trusted as well: no file sets it.

The directories belong to the current context (`contextvars`), as the words of `wording` do.
"""

import os
import re
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager
from contextvars import ContextVar
from functools import wraps
from inspect import signature
from pathlib import Path
from typing import Any, ParamSpec, TypeVar

Parameters = ParamSpec("Parameters")
Result = TypeVar("Result")
Named = str | os.PathLike[str]

SHOWN_VARIABLE = "INSGNSS_SHOWN"
PATTERN = re.compile(r"[*?\[]")
_START = re.compile(r"(?::(\d+))?: ")
_HOMES: ContextVar[tuple[Path, ...]] = ContextVar("directories whose files are shown", default=())
_PACKAGE = Path(__file__).resolve().parents[2]  # the package: this file stands two folders deep


def inside(path: Named, directory: Named) -> bool:
    """Tell whether a path lies in or below a directory, symbolic links of both followed."""
    return Path(os.path.realpath(path)).is_relative_to(os.path.realpath(directory))


@contextmanager
def trusting(paths: Iterable[Named]) -> Iterator[None]:
    """Show the text of files in or below these directories alone, as long as the context lasts.

    Parameters
    ----------
    paths : iterable of path
        Directories, files that stand for theirs and for themselves, and patterns of either; what
        does not exist counts for nothing, and without any that exists every file is shown.
    """
    homes: list[Path] = []
    for path in (os.fspath(each) for each in paths):
        if match := PATTERN.search(path):
            path = os.path.dirname(path[: match.start()]) or "."
        if os.path.isdir(path):
            homes.append(Path(os.path.realpath(path)))
        elif os.path.exists(path):
            above = os.path.dirname(os.path.abspath(path))
            homes += [Path(os.path.realpath(home)) for home in (above, path)]
    token = _HOMES.set(tuple(dict.fromkeys(homes)))
    try:
        yield
    finally:
        _HOMES.reset(token)


def words_as_paths(arguments: Iterable[str]) -> list[str]:
    """Return what of the words of a command may be paths, also behind the = of an option."""
    return [path for word in arguments for path in (word, word.partition("=")[2]) if path]


def at_home(function: Callable[Parameters, Result]) -> Callable[Parameters, Result]:
    """Let a function trust the directory of its first argument, where no command trusts others.

    Parameters
    ----------
    function : callable
        Its first argument is a path, or an object with the path of the file that it was read from.
    """

    parameters = signature(function)

    @wraps(function)
    def trusted(*args: Parameters.args, **kwargs: Parameters.kwargs) -> Result:
        if _HOMES.get():
            return function(*args, **kwargs)
        first: Any = next(iter(parameters.bind(*args, **kwargs).arguments.values()))
        with trusting([getattr(first, "path", first)]):
            return function(*args, **kwargs)

    return trusted


def contents_withheld(path: object) -> bool:
    """Tell whether the text of a file stays out of messages."""
    homes: tuple[Named, ...] = _HOMES.get()
    name = str(path)
    if not homes or not os.path.exists(name) or not os.access(name, os.R_OK):
        return False
    if os.path.isfile(name) and os.path.getsize(name) == 0:
        return False
    homes += (_PACKAGE, *filter(None, os.environ.get(SHOWN_VARIABLE, "").split(os.pathsep)))
    return not any(inside(name, home) for home in homes)


def instead(path: object) -> str:
    """Return what a message says of a hidden file."""
    directory = os.path.dirname(os.path.realpath(str(path)))
    return (
        f"has an error, which is not shown because the file is outside of {_HOMES.get()[0]}; if "
        f"you trust the file, set {SHOWN_VARIABLE}={directory} in the environment to see the error"
    )


def without_text(message: str) -> str:
    """Return a message, without what it says of a hidden file that stands at its beginning."""
    if _HOMES.get():
        for match in _START.finditer(message):
            path = message[: match.start()]
            if (os.path.isfile(path) or os.path.basename(path) != path) and contents_withheld(path):
                return f"{message[: match.end()]}{instead(path)}"
    return message
