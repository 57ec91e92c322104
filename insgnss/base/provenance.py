"""What results in a directory were made from, before others take their place, and by which run."""

import json
import os
import platform
import sys
from collections.abc import Iterable
from datetime import UTC, datetime
from pathlib import Path

from .errors import UsageError
from .files import sha256
from .wording import command_line, relative

KEY = "inputs_sha256"
"""In the JSON documents of results: the SHA-256 of each input by its path."""


def circumstances() -> dict[str, str]:
    """Return date, operating system, machine and command of this run, as text by name."""
    name = Path(sys.argv[0]).name
    command = ["insgnss" if name == "__main__.py" else name or "python", *sys.argv[1:]]
    return {
        "date (UTC)": datetime.now(UTC).strftime("%Y-%m-%d %H:%M:%S"),
        "operating system": platform.platform(),
        "machine": f"{platform.machine()}, {os.cpu_count() or 1} processors",
        "command": command_line(command),
    }


def hashes_of(files: Iterable[Path], start: Path) -> dict[str, str]:
    """Return the hash of each file by its path relative to the directory `start`."""
    return {relative(file, start): sha256(file) for file in files if file.is_file()}


def other_results(
    document: Path, measured: Iterable[Path], one_is_enough: bool = False
) -> str | None:
    """Tell whether results are of other measurements than those that a run is going to take.

    Settings do not matter, such as the flight file or a noise model: the same measurements may be
    processed again in another way.

    Parameters
    ----------
    document : Path
        The JSON document of results that may be there, with `KEY`.
    measured : iterable of Path
        Files of measurements; others than files are left out.
    one_is_enough : bool
        Whether results that know one of the files are of these.

    Returns
    -------
    str or None
        What is wrong; None without results, and where they know each of the files by its hash.
    """
    if not document.is_file():
        return None
    try:
        hashes = set(dict(json.loads(document.read_text(encoding="utf-8"))[KEY]).values())
    except (OSError, ValueError, KeyError, TypeError):
        return f"{document} is there and does not say what it was made from"
    files = [file for file in measured if file.is_file()]
    others = [file for file in files if sha256(file) not in hashes]
    if not others or (one_is_enough and len(others) < len(files)):
        return None
    return (
        f"{document.parent} holds results of other measurements: {others[0].name} is not what"
        f" {document.name} was made from"
    )


def refuse_other_results(
    verb: str,
    document: Path,
    measured: Iterable[Path],
    force: bool = False,
    one_is_enough: bool = False,
) -> None:
    """Raise UsageError where `other_results` are in the way and `force` is not given."""
    if not force and (reason := other_results(document, measured, one_is_enough)):
        raise UsageError(f"{verb}: {reason}; give another directory with --out, or --force")
