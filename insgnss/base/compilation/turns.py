"""Processes that need a kernel at the same time compile it once."""

import math
import os
import zlib
from contextlib import suppress
from functools import cache
from typing import Any

from ..advance import share

try:
    import fcntl
except ImportError:  # Windows
    fcntl = None  # type: ignore[assignment]


def compile_in_turn(kernel: Any) -> None:
    """Have the processes that need a kernel at the same time compile it once.

    The turn is taken where the disk has no code, which is then looked for again, and ends when the
    code is kept. A kernel compiles its callees within its own turn and calls never go round in a
    circle, so that no two processes wait for each other: numba's lock of threads comes first.
    """
    from numba.core.compiler_lock import global_compiler_lock

    kept, compile_alone = kernel._cache, kernel.compile
    load = kept.load_overload

    def load_overload(signature: Any, context: Any) -> Any:
        code = load(signature, context)
        if code is None and take_turn(kernel):
            code = load(signature, context)
        return code

    def compile_kernel(signature: Any) -> Any:
        with global_compiler_lock:
            try:
                return compile_alone(signature)
            finally:
                end_turn(kernel)

    kept.load_overload, kernel.compile = load_overload, compile_kernel


def take_turn(kernel: Any, wait: bool = True) -> bool:
    """Keep other processes from compiling a kernel until this process has compiled it, or ends.

    Parameters
    ----------
    kernel : numba.core.dispatcher.Dispatcher
        A kernel that is kept on disk.
    wait : bool
        Whether to wait while another process compiles it.

    Returns
    -------
    bool
        False where another process compiles it, or where the file system knows no locks.
    """
    with suppress(OSError):
        try:
            _lock(kernel, "LOCK_EX", "LOCK_NB")
        except (BlockingIOError, PermissionError):  # which of them depends on the system
            if not wait:
                return False
            share(math.nan)
            _lock(kernel, "LOCK_EX")
        return fcntl is not None
    return False


def end_turn(kernel: Any) -> None:
    """Let other processes compile a kernel."""
    with suppress(OSError):
        _lock(kernel, "LOCK_UN")


def _lock(kernel: Any, *operation: str) -> None:
    """Lock a kernel's byte in a file of its cache's directory, for the threads of this process."""
    if fcntl is not None:
        entry = kernel._cache._cache_file
        directory, name = os.path.split(entry._index_path)
        flags = sum(getattr(fcntl, each) for each in operation)
        fcntl.lockf(_lock_file(directory), flags, 1, zlib.crc32(name.encode()))


@cache
def _lock_file(directory: str) -> int:
    """Return an open file, which stays open: closing it would end all turns of the process."""
    return os.open(os.path.join(directory, "compiling.lock"), os.O_RDWR | os.O_CREAT, 0o600)
