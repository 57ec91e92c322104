"""Directories of one run, beside what it writes: locked while it lives, swept by the next run.

The lock is on the directory itself and ends with the process, however that ends. Where a file
system or an operating system has no such locks, a file says whose directory it is: that of a
process of this machine that is no more is swept, and any that has not changed for `OLD_S`.
"""

import atexit
import json
import os
import shutil
import tempfile
import time
import warnings
from collections.abc import Iterable, Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

from .errors import UsageError
from .interrupts import deferred

try:
    import fcntl
except ImportError:  # Windows
    fcntl = None  # type: ignore[assignment]

PREFIX, ENGINE = ".insgnss-", ".engine-"
PREFIXES = (PREFIX, ENGINE)
JOURNAL, LEAD, OWNER = "journal.json", "lead", "owner"
OLD_S = 7 * 86400.0  # no run lasts as long
MOST_WAIT_S = 10.0
Moves = list[tuple[str, str, str | None]]
"""Source, goal, where the goal's old file goes; all relative to the directory of the journal."""


class Scratch:
    """A directory of this run, gone when it is closed or the process ends.

    Parameters
    ----------
    where : Path
        The existing directory that holds it; what dead runs left there is swept first.
    prefix : str
        Of its name, one of `PREFIXES`.
    """

    def __init__(self, where: Path, prefix: str = PREFIX) -> None:
        sweep(where)
        with deferred():
            self.path, self._lock = _locked(where, prefix)
            self._owner = os.getpid()
            _OPEN.add(self)

    def close(self) -> None:
        """Remove the directory; without effect a second time and in a child of the process."""
        with deferred():
            if self in _OPEN and self._owner == os.getpid():
                _OPEN.discard(self)
                shutil.rmtree(self.path, ignore_errors=True)
                self.leave()

    def leave(self) -> None:
        """Give up the lock and leave the directory, with its journal, to the next run."""
        _OPEN.discard(self)
        if self._lock is not None:
            os.close(self._lock)
            self._lock = None


_OPEN: set[Scratch] = set()


@atexit.register
def _close_all() -> None:
    for own in tuple(_OPEN):
        own.close()


@contextmanager
def scratch_directory(where: Path, prefix: str = PREFIX) -> Iterator[Path]:
    """Give a directory of this run, in the directory `where`, for intermediate files."""
    own = Scratch(where, prefix)
    try:
        yield own.path
    finally:
        own.close()


def _locked(where: Path, prefix: str) -> tuple[Path, int | None]:
    """Make a directory and lock it; again where a sweep was faster than the lock."""
    while True:
        path = Path(tempfile.mkdtemp(prefix=prefix, dir=where))
        if fcntl is None:
            return _signed(path), None
        try:
            descriptor = os.open(path, os.O_RDONLY)
        except FileNotFoundError:
            continue
        try:
            fcntl.flock(descriptor, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError:
            os.close(descriptor)
            continue
        except OSError:  # a file system without locks
            os.close(descriptor)
            return _signed(path), None
        if path.exists():
            return path, descriptor
        os.close(descriptor)


def _machine() -> str:
    return os.uname().nodename if hasattr(os, "uname") else ""


def _signed(path: Path) -> Path:
    """Say whose directory this is, which has no lock."""
    (path / OWNER).write_text(f"{_machine()} {os.getpid()}", encoding="utf-8")
    return path


def _deserted(path: Path) -> bool:
    """Tell whether the process is no more that a directory without lock belongs to.

    On Windows, where asking after a process may end it, only its age tells.
    """
    with suppress(OSError, ValueError):
        newest = max(entry.stat().st_mtime for entry in (path, *path.iterdir()))
        if time.time() - newest > OLD_S:
            return True
        host, _, number = (path / OWNER).read_text(encoding="utf-8").rpartition(" ")
        if os.name == "posix" and host == _machine():
            try:
                os.kill(int(number), 0)
            except ProcessLookupError:
                return True
            except PermissionError:  # of another user
                return False
    return False


@contextmanager
def alone(directories: Iterable[Path]) -> Iterator[None]:
    """Keep other runs from moving files into directories while the block runs.

    Raises
    ------
    UsageError
        Where another run does so for longer than moves take.
    """
    descriptors: list[int] = []
    try:
        own = {os.path.realpath(scratch.path) for scratch in _OPEN}  # locked by this run
        for directory in sorted({os.path.realpath(d) for d in directories} - own) if fcntl else ():
            descriptors.append(os.open(directory, os.O_RDONLY))
            _wait_for(descriptors[-1], directory)
        yield
    finally:
        for descriptor in descriptors:
            os.close(descriptor)


def _wait_for(descriptor: int, directory: str) -> None:
    deadline = time.monotonic() + MOST_WAIT_S
    while True:
        try:
            fcntl.flock(descriptor, fcntl.LOCK_EX | fcntl.LOCK_NB)
            return
        except BlockingIOError:
            if time.monotonic() > deadline:
                raise UsageError(
                    f"{directory}: another run has been moving its files there for"
                    f" {MOST_WAIT_S:.0f} s; wait for it, or give another directory"
                ) from None
            time.sleep(0.01)
        except OSError:  # a file system without locks
            return


def sweep(*directories: Path) -> None:
    """Remove what dead runs left in directories; undo moves within which they were killed.

    The directories need not exist. A warning names files that were put back.
    """
    for directory in directories:
        try:
            with os.scandir(directory) as entries:
                names = [entry.path for entry in entries if entry.name.startswith(PREFIXES)]
        except OSError:
            continue
        for name in names:
            _sweep(Path(name))


def _taken(path: Path) -> tuple[bool, int | None]:
    """Tell whether a directory is of a dead run, with the lock that keeps others off it."""
    if path.is_symlink() or not path.is_dir():
        return False, None
    if fcntl is None:
        return _deserted(path), None
    try:
        descriptor = os.open(path, os.O_RDONLY | os.O_DIRECTORY | os.O_NOFOLLOW)
    except OSError:  # no directory, of another user, or gone
        return False, None
    try:
        fcntl.flock(descriptor, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except OSError as error:
        os.close(descriptor)
        locked = isinstance(error, BlockingIOError)  # its owner lives; else there are no locks
        return not locked and _deserted(path), None
    if (path / OWNER).exists() and not _deserted(path):  # made where it had no lock
        os.close(descriptor)
        return False, None
    return True, descriptor


def _sweep(path: Path) -> None:
    dead, descriptor = _taken(path)
    if not dead:
        return
    with deferred():
        try:
            if (lead := _lead_of(path)) is not None:
                _sweep(lead)  # has the journal of this one
                if (lead / JOURNAL).exists():
                    return
            if (path / JOURNAL).exists() and undo(path):
                warnings.warn(
                    f"{path.parent}: an earlier run was killed while it moved its files there; the"
                    " files from before it were put back",
                    stacklevel=2,
                )
            shutil.rmtree(path, ignore_errors=True)
        except OSError as error:
            warnings.warn(
                f"{path}: holds files from before a run that was killed; they cannot be put back:"
                f" {error.strerror or error}; {path / JOURNAL} says where they belong",
                stacklevel=2,
            )
        finally:
            if descriptor is not None:
                os.close(descriptor)


def _lead_of(path: Path) -> Path | None:
    """Return the directory that has the journal of `path`, where that is another one."""
    with suppress(OSError, ValueError):
        lead = path / str(json.loads((path / LEAD).read_text(encoding="ascii")))
        return lead.resolve() if lead.exists() else None
    return None


def write_journal(lead: Path, made: list[str], moves: Moves) -> None:
    """Write what is going to be moved, whole or not at all.

    Parameters
    ----------
    lead : Path
        The scratch directory that gets it.
    made : list of str
        Directories that are going to be made, in order.
    moves : list
        The moves in order.
    """
    text = json.dumps({"made": made, "moves": moves})
    (lead / f"{JOURNAL}.new").write_text(text, encoding="ascii")
    os.replace(lead / f"{JOURNAL}.new", lead / JOURNAL)


def undo(lead: Path) -> bool:
    """Undo the moves of a journal, however many were done; then remove the journal.

    Parameters
    ----------
    lead : Path
        The scratch directory that holds it.

    Returns
    -------
    bool
        Whether any file had been moved.

    Raises
    ------
    OSError
        A file that cannot be put back; the journal stays, and the next run tries again.
    """
    journal = json.loads((lead / JOURNAL).read_text(encoding="ascii"))
    changed = False
    for source, goal, aside in reversed(journal["moves"]):
        if aside is None:
            if os.path.lexists(lead / goal) and not os.path.lexists(lead / source):
                os.replace(lead / goal, lead / source)
                changed = True
        elif os.path.lexists(lead / aside):
            os.replace(lead / aside, lead / goal)
            changed = True
    for directory in reversed(journal["made"]):
        with suppress(OSError):  # not made, or in use by now
            os.rmdir(lead / directory)
    os.unlink(lead / JOURNAL)
    return changed
