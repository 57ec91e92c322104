"""What a kernel's compiled code depends on: its source file and all that this file imports."""

import hashlib
import re
from functools import cache
from pathlib import Path

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
