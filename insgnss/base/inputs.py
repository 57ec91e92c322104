"""The one door through which files are read.

Whoever reads a file opens it here. A pipe or a device is refused, which could wait or go on for
ever, and so is a file that a killed run left among those of another (`base.output.unfinished`).
Within `reading` every file is remembered as it was when it was first opened: its size, the time of
its last change, and its number on the file system, which another file in its place does not share.
Whenever it is opened again, by another reader or for its hash, it has to be the same. So what a run
was made from and the hash that it states are of the same bytes.
"""

import errno
import hashlib
import io
import os
import stat
import time
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from contextvars import ContextVar
from io import BufferedReader
from pathlib import Path
from typing import TextIO

from .errors import InputError
from .output.unfinished import refuse_unfinished

Source = str | os.PathLike[str]
Identity = tuple[int, int, int, int]
"""Device, number on it, size in bytes and time of the last change in ns."""
BOM = b"\xef\xbb\xbf"  # byte order mark of UTF-8
SETTLED_NS = 2_000_000_000  # age of a change (ns): within it a stamp may hide another one
KEPT_HASHES = 64  # hashes of files kept: those of a run's inputs, asked for before and after it

NOT_REGULAR = "is not a regular file but a pipe or a device; save its content to a file"

_READ: ContextVar[dict[str, Identity] | None] = ContextVar("files read", default=None)
_HASHES: dict[tuple[str, Identity], str] = {}


@contextmanager
def reading(before: Mapping[str, Identity] | None = None) -> Iterator[dict[str, Identity]]:
    """Hold every file that is read in the block to what it was when it was first opened.

    A block within another one remembers together with that.

    Parameters
    ----------
    before : mapping, optional
        Files that were read before, such as those that a flight file was loaded from.

    Yields
    ------
    dict
        What is remembered: identities of files by their absolute paths.

    Raises
    ------
    InputError
        When a file is opened that changed since.
    """
    files = _READ.get()
    token = None
    if files is None:
        files = {}
        token = _READ.set(files)
    try:
        for name, identity in (before or {}).items():
            _remember(files, name, identity)
        yield files
    finally:
        if token is not None:
            _READ.reset(token)


def forget_content(path: Path) -> None:
    """Forget a file, or the files of a directory, that the run itself has replaced."""
    if files := _READ.get():
        name = os.path.realpath(path)
        for key in [key for key in files if f"{key}{os.sep}".startswith(f"{name}{os.sep}")]:
            del files[key]


def _remember(files: dict[str, Identity], name: str, identity: Identity) -> None:
    if files.setdefault(name, identity) != identity:
        raise InputError.in_file(
            name,
            "the file changed after it was read; wait until the program that writes it has ended, "
            "then run the command again (in Python, load the flight file again)",
        )


def identity_of(state: os.stat_result) -> Identity:
    """Return what tells a file from another one, and from itself after a change."""
    return state.st_dev, state.st_ino, state.st_size, state.st_mtime_ns


def open_bytes(path: Source) -> BufferedReader:
    """Open a file to read its bytes.

    Parameters
    ----------
    path : path
        The file.

    Returns
    -------
    BufferedReader
        The stream, to be closed by the caller.

    Raises
    ------
    OSError
        It is missing or must not be read.
    InputError
        It is no regular file, may not belong to those beside it, or changed since it was read.
    """
    check_input(path)
    stream = open(path, "rb")  # noqa: SIM115
    try:
        _check(path, os.fstat(stream.fileno()))
    except BaseException:
        stream.close()
        raise
    return stream


def check_input(path: Source) -> None:
    """Raise what `open_bytes` raises, before a library opens the file by its own means."""
    _check(path, os.stat(path))
    refuse_unfinished(Path(path))


def is_file(path: Path) -> bool:
    """Tell whether a path is a regular file; pipes and devices raise InputError, links count."""
    if path.is_file() or path.is_dir() or not path.exists():
        return path.is_file()
    raise InputError.in_file(path, NOT_REGULAR)


def _check(path: Source, state: os.stat_result) -> None:
    if stat.S_ISDIR(state.st_mode):
        raise IsADirectoryError(errno.EISDIR, "is a directory, a file is expected", os.fspath(path))
    if not stat.S_ISREG(state.st_mode):
        raise InputError.in_file(path, NOT_REGULAR)
    if (files := _READ.get()) is not None:
        _remember(files, os.path.realpath(path), identity_of(state))


def read_bytes(path: Source) -> bytes:
    """Return the bytes of a file. Raises what `open_bytes` raises."""
    with open_bytes(path) as stream:
        return stream.read()


def opened_text(
    path: Source, encoding: str = "utf-8", errors: str = "strict", newline: str | None = None
) -> TextIO:
    """Open a file to read its text, as `open` does. Raises what `open_bytes` raises."""
    return io.TextIOWrapper(open_bytes(path), encoding, errors, newline)


def read_text(path: Source, encoding: str = "utf-8", errors: str = "strict") -> str:
    """Return a file's text, its ends of lines as line feeds.

    Raises
    ------
    UnicodeDecodeError
        With `errors` "strict"; and what `open_bytes` raises.
    """
    return read_bytes(path).decode(encoding, errors).replace("\r\n", "\n").replace("\r", "\n")


@contextmanager
def readable(path: Source, advice: str = "check path and permission") -> Iterator[None]:
    """Refuse a file that the system does not let read; InputError says why."""
    try:
        yield
    except OSError as error:
        raise InputError.unread(path, error, advice) from None


def first_bytes(path: Source, count: int, advice: str = "check the path") -> bytes:
    """Return a file's first bytes behind a byte order mark. Raises InputError for no such file."""
    with readable(path, advice), open_bytes(path) as stream:
        return stream.read(count).removeprefix(BOM)


def sha256(path: Source) -> str:
    """Return the SHA-256 hash of a file's bytes, hexadecimal. Raises what `open_bytes` raises."""
    with open_bytes(path) as stream:
        key = os.path.realpath(path), identity_of(os.fstat(stream.fileno()))
        if key not in _HASHES or time.time_ns() - key[1][-1] <= SETTLED_NS:
            digest = hashlib.file_digest(stream, "sha256").hexdigest()
            _check(path, os.fstat(stream.fileno()))
            if len(_HASHES) >= KEPT_HASHES:
                _HASHES.clear()
            _HASHES[key] = digest
    return _HASHES[key]
