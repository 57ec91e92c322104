"""Files of compiled code, verified before they are used; a wheel may ship some.

A kernel's compiled code depends on its source file and all that this file imports.
"""

import hashlib
import os
import pickle
import re
import stat
import warnings
from functools import cache
from pathlib import Path
from typing import Any

import llvmlite
import numpy as np

from ..shipped import PROCESSOR

_PYTHON_COMMENT = re.compile(r"#[^\n]*")
_IMPORT = re.compile(r"^from (\.+)([\w.]*) import (\([^)]*\)|[^\n]*)", re.MULTILINE)


@cache
def digest(source: Path) -> str:
    """Return one digest of the contents of a source file and of all that it imports (`closure`)."""
    state = hashlib.sha256()
    for path in sorted(closure(source)):
        state.update(f"{path.name} {len(_text(path))}\n".encode())
        state.update(_text(path).encode())
    return state.hexdigest()


def closure(source: Path) -> set[Path]:
    """Return a source file and those of the package that it imports, directly or through others."""
    visited: set[Path] = set()
    todo = [source]
    while todo:
        path = todo.pop()
        if path not in visited:
            visited.add(path)
            todo += imported(path)
    return visited


@cache
def imported(source: Path) -> tuple[Path, ...]:
    """Return the files of the package that one source file imports at its top.

    The package imports its own modules by relative names only, one statement from the first column
    on; what is imported within functions or for type checkers alone does not reach a kernel.
    """
    files: list[Path] = []
    for dots, module, names in _IMPORT.findall(_PYTHON_COMMENT.sub("", _text(source))):
        stem = source.parents[len(dots) - 1].joinpath(*filter(None, module.split(".")))
        inner = (stem / name.split()[0] for name in names.strip("() \n").split(",") if name.strip())
        for path in (stem, *inner):
            files += (
                file for file in (path.with_suffix(".py"), path / "__init__.py") if file.is_file()
            )
    return tuple(files)


@cache
def _text(path: Path) -> str:
    """Return a source file's content, "" where it lies in an archive or cannot be read."""
    try:
        return path.read_text(encoding="utf-8")
    except OSError:
        return ""


DIGEST_BYTES = 16  # of a kept file: no damage passes, and 1 MB takes 0.8 ms
_warned: list[str] = []


def keep_soundly(kept: Any, source: Path) -> bool:
    """Have a function's cache verify what it takes from the disk, and go on where it cannot save.

    Parameters
    ----------
    kept : numba.core.caching.Cache
        The cache of one function.
    source : Path
        The file that defines the function.

    Returns
    -------
    bool
        False with a numba of other inner names.
    """
    entry: Any = getattr(kept, "_cache_file", None)
    names = "_source_stamp", "_index_path", "_data_path", "_dump", "_open_for_write"
    if not all(hasattr(entry, name) for name in names):
        return False
    entry.__class__ = kept_class()
    numpy_api = ".".join(np.__version__.split(".")[:2])  # what numba tells apart
    stamp = None if source.is_file() else entry._source_stamp  # an old numba's is the time
    entry._source_stamp = (stamp, numpy_api, llvmlite.__version__, digest(source))
    entry.source = source.stat() if source.is_file() else None
    cached = source.parent / "__pycache__" / os.path.basename(entry._index_path)
    entry.places = (entry._index_path, *([str(cached)] if PROCESSOR.is_file() else []))
    save = kept.save_overload

    def save_overload(signature: Any, code: Any) -> None:
        try:
            save(signature, code)
        except OSError as error:
            warn_unkept(f"{kept.cache_path}: {error.strerror or error}")

    kept.save_overload = save_overload
    return True


@cache
def kept_class() -> Any:
    """Return numba's class of a function's files on disk, with files that are verified.

    A file is a pickle and its digest, which is keyed with the sources and with the versions of
    numba, llvmlite and numpy. Nothing is unpickled, and no machine code run, before the digest is
    right. Within its file the code stands beside what it was compiled for (types, processor):
    processes that compile at the same time may give one name to two entries.
    """
    from numba.core.caching import IndexDataCacheFile

    class Kept(IndexDataCacheFile):
        source: os.stat_result | None
        places: tuple[str, ...]  # of the index: numba's, and the one that a wheel ships

        def load(self, key: Any) -> Any:
            for index in self.places:
                name = (self._content(index) or {}).get(key)
                path = os.path.join(os.path.dirname(index), name or "")
                compiled_for, code = (name and self._content(path)) or (None, None)
                if compiled_for == key:
                    return code
            return None

        def save(self, key: Any, data: Any) -> None:
            super().save(key, (key, data))

        def _load_index(self) -> Any:
            return self._content(self._index_path) or {}

        def _save_index(self, overloads: Any) -> None:
            self._write(self._index_path, overloads)

        def _save_data(self, name: str, data: Any) -> None:
            self._write(self._data_path(name), data)

        def _write(self, path: str, content: Any) -> None:
            data = self._dump(content)
            with self._open_for_write(path) as file:
                file.write(data)
                file.write(self._digest(data))

        def _content(self, path: str) -> Any:
            """Return what a file holds, None where it is not to be used, whatever the reason."""
            try:
                with open(path, "rb") as file:
                    data = memoryview(file.read())
                    trusted = _is_trusted_owner(os.fstat(file.fileno()), self.source)
                content = data[:-DIGEST_BYTES]
                if trusted and data[-DIGEST_BYTES:] == self._digest(content):
                    return pickle.loads(content)
            except Exception:  # compiling always helps, and says what else is wrong
                return None
            return None

        def _digest(self, data: Any) -> bytes:
            made_by = hashlib.sha256(repr((self._version, self._source_stamp)).encode()).digest()
            return hashlib.blake2b(data, digest_size=DIGEST_BYTES, key=made_by).digest()

    return Kept


def _is_trusted_owner(file: os.stat_result, source: os.stat_result | None) -> bool:
    """Whether a file is of somebody whose code runs here anyway: this user, root, the source's.

    Nor may others write it, unless they may write the source as well.
    """
    if not hasattr(os, "getuid"):  # Windows
        return True
    owner, mode = (source.st_uid, source.st_mode) if source else (0, 0)
    open_to_all = file.st_mode & ~mode & stat.S_IWOTH
    return file.st_uid in (os.getuid(), 0, owner) and not open_to_all


def warn_unkept(reason: str) -> None:
    """Warn, once in a process, that compiled functions are not kept."""
    if not _warned:
        _warned.append(reason)
        warnings.warn(
            f"compiled functions cannot be kept ({reason}), so every command compiles them again,"
            " up to a minute: free space there, or set NUMBA_CACHE_DIR to a directory that you can"
            " write",
            stacklevel=2,
        )


def unkept(kernel: Any) -> bool:
    """Tell whether a kernel is kept on disk once it is compiled, and is not there yet."""
    entry: Any = getattr(getattr(kernel, "_cache", None), "_cache_file", None)
    return type(entry) is kept_class() and not any(map(entry._content, entry.places))
