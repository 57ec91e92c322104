"""Where numba keeps compiled kernels and matplotlib its fonts for a user without a home directory.

numba looks for a place when a kernel is defined: NUMBA_CACHE_DIR, `__pycache__` beside the source,
the user's cache directory. On an installation that is not to be written such a user has none of
them, and a kernel could not even be defined; matplotlib complains of the same in lines of its own.
Both then get a directory of that user within the temporary one. What lies there is code: it has to
be the user's own, closed to others.
"""

import os
import stat
import sys
from functools import cache

KERNELS_AT, FONTS_AT = "NUMBA_CACHE_DIR", "MPLCONFIGDIR"


@cache
def settle() -> str:
    """Set the variables of numba and matplotlib where these would find no directory.

    The result is a line that says so, "" where there is nothing to say. It has to run before a
    kernel is defined. Where not even a temporary directory can be written, the variables stay
    unset.
    """
    if os.name == "nt" or _writable(_cache_home()):
        return ""
    kept = bool(os.environ.get(KERNELS_AT)) or _writable_installation()
    try:
        directory = _own_directory()
    except OSError:  # `njit` says that it keeps nothing
        return ""
    os.environ.setdefault(FONTS_AT, os.path.join(directory, "matplotlib"))
    if kept:
        return ""
    os.environ[KERNELS_AT] = directory
    if "numba" in sys.modules:
        sys.modules["numba"].config.reload_config()
    return (
        "neither the home directory nor the installation is writable, so compiled functions are "
        f"kept in {directory}; set {KERNELS_AT} to a permanent directory that you can write"
    )


def _cache_home() -> str:
    """The user's cache directory as numba finds it."""
    if sys.platform == "darwin":
        return os.path.expanduser("~/Library/Caches")
    return os.environ.get("XDG_CACHE_HOME") or os.path.expanduser("~/.cache")


def _writable_installation() -> bool:
    """Whether numba could keep code beside every source of the package."""
    for folder, below, files in os.walk(os.path.dirname(os.path.dirname(__file__))):
        below[:] = [name for name in below if name != "__pycache__"]
        sources = any(name.endswith(".py") for name in files)
        if sources and not _writable(os.path.join(folder, "__pycache__")):
            return False
    return True


def _writable(directory: str) -> bool:
    """Whether files can be made in a directory, which itself may have to be made."""
    if not os.path.isabs(directory):
        return False
    existing = directory
    while not os.path.exists(existing):
        existing = os.path.dirname(existing)
    return os.path.isdir(existing) and os.access(existing, os.W_OK | os.X_OK)


def _own_directory() -> str:
    """A directory that stays, or where others took its name, one for this process.

    Raises
    ------
    OSError
        Where none can be made.
    """
    import atexit
    import contextlib
    import shutil
    import tempfile

    directory = os.path.join(tempfile.gettempdir(), f"insgnss-{os.getuid()}")
    with contextlib.suppress(FileExistsError):
        os.mkdir(directory, 0o700)
    status = os.lstat(directory)
    if stat.S_ISDIR(status.st_mode) and status.st_uid == os.getuid() and not status.st_mode & 0o077:
        return directory
    directory = tempfile.mkdtemp(prefix="insgnss-")
    atexit.register(shutil.rmtree, directory, ignore_errors=True)
    return directory
