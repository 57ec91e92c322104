"""Memory: how much of it this process may still take, and giving back what it no longer uses."""

import ctypes
import sys
from collections.abc import Iterator
from functools import cache
from pathlib import Path, PurePosixPath
from typing import Any

GB = 1e9  # bytes
CONTROL_GROUPS = Path("/sys/fs/cgroup")
M_TRIM_THRESHOLD, M_MMAP_THRESHOLD = -1, -3  # of mallopt, as malloc.h numbers them
KEPT_ARRAY = 32 << 20  # bytes; the most that glibc takes from its heap (HEAP_MAX_SIZE / 2)
UNLIMITED = 1 << 60  # bytes; what version 1 of control groups writes for no limit is beyond it


def available(proc: Path = Path("/proc"), groups: Path = CONTROL_GROUPS) -> int | None:
    """Return how many bytes this process may still take.

    The least of what the machine has left with its swap, of the limits of the control groups that a
    container or a batch system sets, and of the limits of the process (`ulimit`).

    Parameters
    ----------
    proc, groups : Path
        Where Linux tells of processes and of control groups.

    Returns
    -------
    int or None
        None where the system does not say.
    """
    machine = _machine_memory(proc)
    rooms = [] if machine is None else [machine]
    rooms += [*_left_by_groups(proc, groups), *_left_by_process(proc)]
    return max(min(rooms), 0) if rooms else None


def kills(proc: Path = Path("/proc"), groups: Path = CONTROL_GROUPS) -> int:
    """Return how many processes the system has ended so far for want of memory.

    Those of this process's control group count, where the kernel tells; else those of the machine.

    Parameters
    ----------
    proc, groups : Path
        Where Linux tells of processes and of control groups.

    Returns
    -------
    int
        Only its growth means something; 0 where the system does not say.
    """
    counted = []
    for version, root, group in _own_groups(proc, groups):
        name = "memory.events" if version == 2 else "memory.oom_control"
        count = _kilobyte_table(root / str(group).lstrip("/") / name).get("oom_kill")
        counted += [] if count is None else [count]
    return max(counted, default=_kilobyte_table(proc / "vmstat").get("oom_kill", 0))


def resident(pid: int, proc: Path = Path("/proc")) -> int:
    """Return how many bytes of memory a process takes; 0 where the system does not say.

    Parameters
    ----------
    pid : int
        The process.
    proc : Path
        Where Linux tells of processes.
    """
    return _kilobyte_table(proc / str(pid) / "status").get("VmRSS", 0)


def out_of_memory(error: MemoryError) -> str:
    """Return one line on what memory did not hold: what was needed, what is left, what to try.

    Parameters
    ----------
    error : MemoryError
        What Python or numpy raised; numpy's names the size.
    """
    needed = " ".join(str(error).split())
    free = available()
    remark = "" if free is None else f", {free / 1e9:.3g} GB are left"
    advice = "take a machine with more memory, raise its limit (ulimit, container), or process less"
    return f"memory is exhausted{': ' * bool(needed)}{needed}{remark}; {advice} of the recording"


def give_back() -> None:
    """Return freed memory to the system, where the C library keeps it for itself (glibc)."""
    trim = _glibc_function("malloc_trim")
    if trim is not None:
        trim(0)


def keep_freed() -> None:
    """Let the C library keep freed arrays of up to `KEPT_ARRAY` for the next ones (glibc).

    Else it gives each back to the system, which clears a new one page by page.
    """
    option = _glibc_function("mallopt")
    if option is not None:
        option(M_MMAP_THRESHOLD, KEPT_ARRAY)
        option(M_TRIM_THRESHOLD, 2 * KEPT_ARRAY)


@cache
def _glibc_function(name: str) -> Any:
    """Return a function of glibc, None elsewhere."""
    if not sys.platform.startswith("linux"):
        return None
    try:
        return getattr(ctypes.CDLL(None), name)
    except (OSError, AttributeError):
        return None


def _kilobyte_table(path: Path) -> dict[str, int]:
    """Return the numbers of a file of names and values, those in kB in bytes; empty without it."""
    out = {}
    for line in _text_or_empty(path).splitlines():
        name, *values = line.replace(":", " ").split()
        if values and values[0].isdigit():
            out[name] = int(values[0]) * (1024 if values[1:] == ["kB"] else 1)
    return out


def _text_or_empty(path: Path) -> str:
    """Return the text of a file, nothing where it cannot be read."""
    try:
        return path.read_text(encoding="ascii", errors="replace")
    except OSError:
        return ""


def _machine_memory(proc: Path) -> int | None:
    """Return what the machine has left, with its swap."""
    table = _kilobyte_table(proc / "meminfo")
    if "MemAvailable" not in table:
        return None
    return table["MemAvailable"] + table.get("SwapFree", 0)


def _own_groups(proc: Path, groups: Path) -> Iterator[tuple[int, Path, PurePosixPath]]:
    """Yield version, root and name of the control groups that count this process's memory."""
    for line in _text_or_empty(proc / "self" / "cgroup").splitlines():
        number, controllers, group = (*line.split(":", 2), "", "")[:3]
        if number == "0":
            yield 2, groups, PurePosixPath(group)
        elif "memory" in controllers.split(","):
            yield 1, groups / "memory", PurePosixPath(group)


def _left_by_groups(proc: Path, groups: Path) -> Iterator[int]:
    """Yield what the control groups of this process leave it, of both versions."""
    for version, root, path in _own_groups(proc, groups):
        if version == 2:
            limit, used, cached = "memory.max", "memory.current", "inactive_file"
        else:
            limit, used = "memory.limit_in_bytes", "memory.usage_in_bytes"
            cached = "total_inactive_file"
        for group in (path, *path.parents):
            directory = root / str(group).lstrip("/")
            most, now = (
                _text_or_empty(directory / limit).strip(),
                _text_or_empty(directory / used).strip(),
            )
            if most.isdigit() and now.isdigit() and int(most) < UNLIMITED:
                yield (
                    int(most) - int(now) + _kilobyte_table(directory / "memory.stat").get(cached, 0)
                )


def _left_by_process(proc: Path) -> Iterator[int]:
    """Yield the bytes that the limits of this process leave it."""
    try:
        import resource
    except ImportError:  # no such limits on Windows
        return
    now = _kilobyte_table(proc / "self" / "status")
    for name, size_key in (("RLIMIT_AS", "VmSize"), ("RLIMIT_DATA", "VmData")):
        limit_bytes = resource.getrlimit(getattr(resource, name))[0]
        if limit_bytes != resource.RLIM_INFINITY and size_key in now:
            yield limit_bytes - now[size_key]
