"""Beginning and hash of a file, files that appear whole or not at all, and what JSON takes."""

import hashlib
import math
import os
from collections.abc import Iterable, Mapping
from contextlib import suppress
from pathlib import Path
from typing import Any

from .errors import InputError, UsageError


def first_bytes(path: str | os.PathLike[str], count: int, advice: str = "check the path") -> bytes:
    """Return the first bytes of a file. Raises InputError where it cannot be read."""
    try:
        with Path(path).open("rb") as stream:
            return stream.read(count)
    except OSError as error:
        message = f"cannot be read: {error.strerror or error}; {advice}"
        raise InputError.at_line(path, None, message) from None


def sha256(file: str | os.PathLike[str]) -> str:
    """Return the SHA-256 hash of a file's bytes, hexadecimal."""
    with Path(file).open("rb") as stream:
        return hashlib.file_digest(stream, "sha256").hexdigest()


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


def atomic_writes(contents: Mapping[Path, str | bytes | Iterable[str | bytes]]) -> None:
    """Write files whole or none of them: all into temporary ones, which then replace them in order.

    What may go wrong while writing, such as a full disk, leaves all of them as they were.
    """
    temporary = {path: path.with_name(f".{path.name}.{os.getpid()}.tmp") for path in contents}
    path = next(iter(contents))
    try:
        for path, content in contents.items():
            with temporary[path].open("wb") as stream:
                for chunk in [content] if isinstance(content, str | bytes) else content:
                    stream.write(chunk.encode("utf-8") if isinstance(chunk, str) else chunk)
        for path in contents:
            os.replace(temporary[path], path)
    except FileNotFoundError:
        raise UsageError(f"{path}: the directory does not exist; create it first") from None
    except OSError as error:
        raise UsageError(f"{path}: cannot be written: {error.strerror or error}") from None
    except UnicodeEncodeError as error:  # half a character, out of a file's name that is no UTF-8
        odd = ascii(error.object[max(error.start - 20, 0) : error.end + 20])
        raise InputError.at_line(path, None, f"{odd} is no Unicode; rename the file") from None
    finally:
        for left in temporary.values():
            with suppress(OSError):  # a path below a file has no temporary one, nor a directory
                left.unlink()


def json_ready(value: Any) -> Any:
    """Return `value` with arrays as lists, paths as text and not finite numbers as null."""
    if isinstance(value, dict):
        return {str(key): json_ready(item) for key, item in value.items()}
    if isinstance(value, list | tuple):
        return [json_ready(item) for item in value]
    if isinstance(value, float):
        return value if math.isfinite(value) else None
    if isinstance(value, str | int | None):
        return value
    return json_ready(value.tolist()) if hasattr(value, "tolist") else str(value)
