"""Sets of files that a killed run left half moved: marked before the moves, refused by readers.

Before a run moves its files it leaves a mark in each directory that gets some: a file with their
names. The mark goes when all have been moved, or when all are as they were. Where the run is killed
in between the mark stays, and whoever reads a file that it names is told that this file may be of
another run than those beside it. A later run that writes a file anew takes its name from the mark.

Nothing is done because of a mark but to refuse what it names: one that others planted harms nobody.
"""

import json
import os
import stat
from collections.abc import Iterable
from pathlib import Path

from ..errors import InputError
from .scratch import alone

UNFINISHED_MARK = ".insgnss-unfinished"
MOST_BYTES = 1 << 24  # of a mark that is read: names of 100 000 files


def marked_names(directory: Path) -> set[str] | None:
    """Return the names that a directory's mark holds, none without one.

    None where the mark cannot be read: it is not one of ours, and says nothing about any file.
    """
    try:
        descriptor = os.open(
            directory / UNFINISHED_MARK, os.O_RDONLY | getattr(os, "O_NONBLOCK", 0)
        )
    except FileNotFoundError:
        return set()
    except OSError:
        return None
    state = os.fstat(descriptor)
    if not stat.S_ISREG(state.st_mode) or state.st_size > MOST_BYTES:
        os.close(descriptor)
        return None
    with os.fdopen(descriptor, "rb") as stream:
        try:
            return {str(name) for name in json.loads(stream.read(MOST_BYTES))}
        except (OSError, ValueError, TypeError, RecursionError):
            return None


def mark(directory: Path, names: Iterable[str], scratch: Path) -> None:
    """Have a directory's mark hold these names; without any there is no mark.

    Parameters
    ----------
    directory : Path
        The directory that gets the files.
    names : iterable of str
        Of files in it that may not be those of one run.
    scratch : Path
        A directory on the same file system, in which the mark is written first.
    """
    goal = directory / UNFINISHED_MARK
    if not (remaining := sorted(names)):
        goal.unlink(missing_ok=True)
        return
    draft = scratch / UNFINISHED_MARK
    with draft.open("w", encoding="ascii") as stream:
        json.dump(remaining, stream)
        stream.flush()
        os.fsync(stream.fileno())
    os.replace(draft, goal)
    flush_directory(directory)


def flush_directory(directory: Path) -> None:
    """Have the names in a directory on the disk, where the system can do that."""
    if os.name == "posix":
        descriptor = os.open(directory, os.O_RDONLY)
        try:
            os.fsync(descriptor)
        except OSError:  # a file system that cannot
            pass
        finally:
            os.close(descriptor)


def is_unfinished(path: Path) -> bool:
    """Tell whether a file is one of those that a killed run was moving.

    A run that is moving them now is waited for.
    """
    directory = path.parent
    if not os.path.lexists(directory / UNFINISHED_MARK):
        return False
    with alone([directory]):
        names = marked_names(directory)
    return names is None or path.name in names


def refuse_unfinished(path: Path) -> None:
    """Refuse a file that may belong to another run than the files beside it.

    Raises
    ------
    InputError
        A run was killed while it moved this file and others.
    """
    if is_unfinished(path):
        raise InputError.in_file(
            path,
            f"a run was killed while it moved its files into {path.absolute().parent}, so this "
            "file may be older than those beside it; run that command again, or, if the files are "
            f"of one run, delete {UNFINISHED_MARK} there",
        )
