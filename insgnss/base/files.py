"""Files that appear whole or not at all, paths of files, and what JSON takes."""

import hashlib
import json
import math
import os
from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Any

from .errors import InputError, UsageError, unwritten_error
from .output.staging import FREE, Staging, together

CONTEXT = 40  # characters shown beside an undecodable one (-): the name around it fits in a line

Content = str | bytes | Iterable[str | bytes]


def refuse_other_than_utf8(paths: Iterable[str | os.PathLike[str]]) -> None:
    """Raise InputError at the first path that is not UTF-8, which no report could name."""
    for path in paths:
        try:
            str(path).encode("utf-8")
        except UnicodeEncodeError:
            raise InputError(
                f"{str(path)!r}: the file name is not UTF-8, so reports and tables cannot hold "
                "it; rename the file, such as by convmv -f latin1 -t utf8"
            ) from None


def text_sha256(text: str) -> str:
    """Return the SHA-256 of a text as a file in UTF-8 has it, hexadecimal."""
    return hashlib.sha256(text.encode()).hexdigest()


def lines_of(text: str) -> list[str]:
    """Split a text at line feeds, carriage returns and pairs of both, and nowhere else.

    `str.splitlines` splits at ten characters more, among them NEL (the byte 0x85 of a Latin-1
    text): lines would be counted in another way than by editors and by the readers of numbers.
    """
    lines = text.replace("\r\n", "\n").replace("\r", "\n").split("\n")
    return lines if lines[-1] else lines[:-1]


def atomic_write(
    path: str | os.PathLike[str], content: str | bytes | Iterable[str | bytes]
) -> None:
    """Write a file whole or not at all: into a temporary one beside it, which then replaces it."""
    atomic_writes({Path(path): content})


def atomic_writes(contents: Mapping[Path, Content]) -> None:
    """Write files whole or none of them; within `staging.together` they move with those of it.

    What may go wrong while writing, such as a full disk, leaves all of them as they were.
    """
    with together() as staging:
        try:
            _write_all(staging, contents)
        except BaseException:  # a block around may go on without these files
            for goal in contents:
                staging.forget(goal)
            raise


def _write_all(staging: Staging, contents: Mapping[Path, Content]) -> None:
    """Write each content into the staging file of its path."""
    for path, content in contents.items():
        goal = staging.destination(path)
        try:
            _write(staging.file(path), content)
        except FileNotFoundError:
            raise UsageError(f"{goal}: the directory does not exist; create it first") from None
        except OSError as error:
            raise unwritten_error(goal, error, FREE) from None
        except UnicodeEncodeError as error:  # a name of the file system that is in the text
            context = error.object[max(error.start - CONTEXT, 0) : error.end + CONTEXT].split("\n")
            word = next(
                text
                for text in context
                if any("\ud800" <= character <= "\udfff" for character in text)
            )
            raise InputError(
                f"{goal}: cannot hold the file name {word!r}, which is not UTF-8; rename that file"
            ) from None


def _write(path: Path, content: str | bytes | Iterable[str | bytes]) -> None:
    with path.open("wb") as stream:
        for chunk in [content] if isinstance(content, str | bytes) else content:
            stream.write(chunk.encode("utf-8") if isinstance(chunk, str) else chunk)


def json_ready(value: Any) -> Any:
    """Return `value` with arrays as lists, paths as text and not finite numbers as null."""
    if isinstance(value, Mapping):
        return {str(key): json_ready(item) for key, item in value.items()}
    if isinstance(value, list | tuple):
        return [json_ready(item) for item in value]
    if isinstance(value, float):
        return value if math.isfinite(value) else None
    if isinstance(value, str | int | None):
        return value
    return json_ready(value.tolist()) if hasattr(value, "tolist") else str(value)


def json_text(document: Mapping[str, Any]) -> str:
    """Return a document as the text of its file."""
    return json.dumps(json_ready(document), indent=1, allow_nan=False, ensure_ascii=False) + "\n"


def pick_attributes(of: object, *names: str) -> dict[str, Any]:
    """Return attributes of a record by name, as its JSON has them."""
    return {name: getattr(of, name) for name in names}


def is_pattern(name: str | Path) -> bool:
    """Return whether a path is one of several files: it has * or ? and is no file itself."""
    return any(sign in str(name) for sign in "*?") and not Path(name).is_file()


def expand_patterns(paths: Iterable[Path]) -> tuple[Path, ...]:
    """Return paths with the files of each pattern in its place, by name; one without files stays.

    Parameters
    ----------
    paths : iterable of Path
        Files, and patterns with * or ? in their last part.
    """
    out: list[Path] = []
    for path in paths:
        matches = sorted(path.parent.glob(path.name)) if is_pattern(path) else []
        out += [file for file in matches if file.is_file()] or [path]
    return tuple(out)
