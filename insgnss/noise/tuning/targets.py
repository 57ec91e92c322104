"""Where the files of a tuning go: refused before any work where they cannot be written."""

import tempfile
from collections.abc import Iterable, Sequence
from pathlib import Path

from ...base.errors import UsageError
from ...base.inputs import is_file
from ...base.provenance import other_results


def check_target(target: Path) -> Path:
    """`target`. Raises UsageError unless it names a TOML file in a directory that takes files.

    A directory that is not there yet is made when the files are written.
    """
    if target.suffix != ".toml":
        raise UsageError(f"{target}: a noise model is a TOML file; end its name with .toml")
    present = next(path for path in target.absolute().parents if path.exists())
    try:
        with tempfile.TemporaryFile(dir=present):
            pass
    except OSError as error:
        raise UsageError(
            f"{target}: cannot be written: {error.strerror or error}; give another --out FILE"
        ) from None
    return target


def make_directory(target: Path) -> None:
    """Make the directory of `target` where it is missing. Raises UsageError where it cannot be."""
    try:
        target.parent.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        reason = f"cannot be made: {error.strerror or error}"
        raise UsageError(f"{target.parent}: {reason}; give another --out FILE") from None


def refuse_others(files: Sequence[Path], measured: Iterable[Path]) -> None:
    """Raise UsageError where one of `files` is there and not of a tuning of the same recordings.

    Parameters
    ----------
    files : sequence of Path
        What is going to be written, the JSON document among them.
    measured : iterable of Path
        The recordings.
    """
    existing = [str(path) for path in files if path.exists()]
    if not existing:
        return
    table = next(path for path in files if path.suffix == ".json")
    if not is_file(table):
        verb = "is" if len(existing) == 1 else "are"
        reason = f"{', '.join(existing)} {verb} there already, and not of a tuning"
    elif (reason := other_results(table, measured) or "") == "":
        return
    raise UsageError(f"{reason}; nothing done; give another --out FILE, or --force")
