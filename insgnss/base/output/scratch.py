"""Directories of one run, beside what it writes: locked while it lives, swept by a later run.

A run that is killed leaves its scratch directory behind. A later run removes it, and nothing that
is not certainly such a directory: it has a name as `mkdtemp` makes them, belongs to this user, is
closed to others, is no symbolic link, and no process holds its lock. Nothing that stands in it is
believed or followed. Where a file system or an operating system has no such locks, a directory in
which nothing changed for `ABANDONED_S` is taken for deserted.
"""

import atexit
import os
import re
import shutil
import stat
import tempfile
import time
from collections.abc import Iterable, Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

from ..errors import UsageError
from ..interrupts import defer_signals

try:
    import fcntl
except ImportError:  # Windows
    fcntl = None  # type: ignore[assignment]

PREFIX = ".insgnss-run-"
SCRATCH_NAME = re.compile(re.escape(PREFIX) + "[a-z0-9_]{8}")  # the letters of mkdtemp
ABANDONED_S = 7 * 86400.0  # age (s) of a scratch directory without lock: no run lasts as long
MORE_BYTES = 1 << 17  # bytes written to try a disk: more than the last block of a file leaves
MOST_WAIT_S = 10.0  # wait for another run's moves (s): they take milliseconds


class Scratch:
    """A directory of this run, gone when it is closed or the process ends.

    Parameters
    ----------
    where : Path
        The existing directory that holds it; what dead runs left there is swept first.
    """

    def __init__(self, where: Path) -> None:
        sweep(where)
        with defer_signals():
            self.path, self._lock = _make_locked(where)
            self._owner = os.getpid()
            _OPEN_DIRECTORIES.add(self)

    def close(self) -> None:
        """Remove the directory; without effect a second time and in a child of the process."""
        with defer_signals():
            if self in _OPEN_DIRECTORIES and self._owner == os.getpid():
                _OPEN_DIRECTORIES.discard(self)
                shutil.rmtree(self.path, ignore_errors=True)
                self._unlock()

    def keep(self) -> None:
        """Leave the directory, under a name that no run sweeps: it holds files of the user."""
        with defer_signals():
            _OPEN_DIRECTORIES.discard(self)
            kept = self.path.with_name(self.path.name.replace(PREFIX, "insgnss-kept-"))
            with suppress(OSError):
                os.chmod(self.path, 0o755)  # not swept where renaming fails
                os.rename(self.path, kept)
                self.path = kept
            self._unlock()

    def _unlock(self) -> None:
        if self._lock is not None:
            os.close(self._lock)
            self._lock = None


_OPEN_DIRECTORIES: set[Scratch] = set()


@atexit.register
def _close_all() -> None:
    for scratch in tuple(_OPEN_DIRECTORIES):
        scratch.close()


@contextmanager
def scratch_directory(where: Path) -> Iterator[Path]:
    """Give a directory of this run, in the directory `where`, for intermediate files."""
    scratch = Scratch(where)
    try:
        yield scratch.path
    finally:
        scratch.close()


def _make_locked(where: Path) -> tuple[Path, int | None]:
    """Make a directory and lock it; again where a sweep was faster than the lock."""
    while True:
        path = Path(tempfile.mkdtemp(prefix=PREFIX, dir=where))
        if fcntl is None:
            return path, None
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
            return path, None
        if path.exists():
            return path, descriptor
        os.close(descriptor)


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
        locked = {os.path.realpath(scratch.path) for scratch in _OPEN_DIRECTORIES}  # by this run
        for directory in sorted({os.path.realpath(d) for d in directories} - locked):
            if fcntl is not None:
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
                    f"{directory}: another run has been moving its files there for "
                    f"{MOST_WAIT_S:.0f} s; wait until that run ends, or give another directory"
                ) from None
            time.sleep(0.01)
        except OSError:  # a file system without locks
            return


def refuse_cut_off(path: Path) -> None:
    """Refuse what another program wrote on a disk that is full: it may have lost a part in silence.

    Programs in C often do not look whether the last bytes of a file could be written. Where the
    file cannot grow by `MORE_BYTES`, they could not.

    Raises
    ------
    OSError
        The file cannot grow.
    """
    descriptor = os.open(path, os.O_WRONLY | os.O_APPEND)
    try:
        size_bytes = os.fstat(descriptor).st_size
        padding = bytes(MORE_BYTES)
        try:
            while padding:
                padding = padding[os.write(descriptor, padding) :]
            os.fsync(descriptor)
        finally:
            os.ftruncate(descriptor, size_bytes)
    except OSError as error:
        raise OSError(error.errno, error.strerror, str(path)) from None
    finally:
        os.close(descriptor)


def sweep(directory: Path) -> None:
    """Remove the scratch directories of this user's dead runs in a directory, which may be missing.

    Parameters
    ----------
    directory : Path
        The directory; those below it are not looked at.
    """
    try:
        with os.scandir(directory) as entries:
            paths = [Path(entry.path) for entry in entries if SCRATCH_NAME.fullmatch(entry.name)]
    except OSError:
        return
    for path in paths:
        with defer_signals(), suppress(OSError):
            _remove_dead(path)


def _remove_dead(path: Path) -> None:
    """Remove a scratch directory if it is certain that its run is dead."""
    if fcntl is None:
        if not path.is_symlink() and _is_old(path):
            shutil.rmtree(path, ignore_errors=True)
        return
    descriptor = os.open(path, os.O_RDONLY | os.O_DIRECTORY | os.O_NOFOLLOW)
    try:
        state = os.fstat(descriptor)
        if state.st_uid != os.geteuid() or stat.S_IMODE(state.st_mode) != 0o700:
            return
        try:
            fcntl.flock(descriptor, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError:
            return
        except OSError:  # a file system without locks
            if not _is_old(path):
                return
        # by the descriptor: the directory that was looked at, whatever has its name by now
        shutil.rmtree(".", ignore_errors=True, dir_fd=descriptor)
        os.rmdir(path)
    finally:
        os.close(descriptor)


def _is_old(path: Path) -> bool:
    newest = max(entry.stat().st_mtime for entry in (path, *path.iterdir()))
    return time.time() - newest > ABANDONED_S
