"""A file's format by its first bytes and ending, and the loaders of files of named arrays."""

import re
from importlib import import_module
from pathlib import Path
from typing import Any

from ...base.inputs import first_bytes

LOADERS = {"matlab": "load_matlab", "npy": "load_numpy"}  # of named arrays, read by a column map
BY_BYTES = {
    b"ULog\x01\x12\x35": "ulog",
    b"\xa3\x95\x80": "ardupilot",
    b"FMT,": "ardupilot",
    b"#ROSBAG V2.0": "rosbag",
    b"\x89MCAP0\r\n": "rosbag",
    b"\x93NUMPY": "npy",
    b"MATLAB 5.0 MAT-file": "matlab",
}
_BY_ENDING = {
    ".mat": "matlab",
    ".npy": "npy",
    ".npz": "npy",
    ".ulg": "ulog",
    ".bin": "ardupilot",
    ".sbet": "sbet",
}


def by_bytes(path: str | Path, head: bytes) -> str:
    """Return the format by the first bytes, or by the ending; an empty text for all others.

    The ending decides for binary formats that have no such bytes.
    """
    file = Path(path)
    for begin, form in BY_BYTES.items():
        if head.startswith(begin):
            return form
    if head.startswith(b"SQLite format 3\0") and file.suffix.lower() == ".db3":
        return "rosbag"
    name = file.name.lower()
    if name.startswith("sbet") and name.endswith(".out"):
        return "sbet"
    return _BY_ENDING.get(file.suffix.lower(), "")


def head_of(path: str | Path) -> bytes:
    """Return the first bytes of a file. Raises InputError where it cannot be read."""
    return first_bytes(path, 1 << 14, "check the path")


def load_content(form: str, path: str | Path) -> Any:
    """Load the named arrays of a file of the formats that are read by a column map."""
    return getattr(import_module(f".arrays.{form}", __package__), LOADERS[form])(path)


def is_nmea(head: bytes) -> bool:
    """Tell whether the first bytes of a file are sentences of NMEA or its kin.

    They may stand within the lines of another program, such as behind its stamps.
    """
    lines = head.splitlines()
    within = sum(bool(re.search(rb"\$G[A-Z](?:GGA|RMC|GST|GSA|GSV|VTG),", line)) for line in lines)
    return head.lstrip().startswith(b"$") or b"\n$G" in head or 2 * within > len(lines)


def is_aimu(head: bytes) -> bool:
    """Tell whether the first bytes of a file are those of a log of $AIMU sentences."""
    return head.lstrip().startswith((b"$AIMU", b"$APPS"))


def is_psins(head: bytes) -> bool:
    """Tell whether the first bytes of a file are a header of PSINS."""
    return b"PSINS" in head[:200] and head.startswith(b"%")
