"""What an export replaces: scripts beside the one before, tables of a run, files of others."""

import re
from pathlib import Path

from ...base.errors import UsageError
from ...base.output.staging import Staging
from ...base.received.nesting import read_object

MARKS_OF_COMPANIONS = {
    "_import.py": b"Written by insgnss",
    "_format.xml": b"insgnss",
    "_SysCoRTL.xml": b"eTC_RTL",
    "_names.csv": b"old,new",
    "_gps_ins_offset.txt": b"insgnss",
}
"""Ends of the names of files beside an export, and what the first lines of ours have."""
OWN_MARK_BYTES = 600  # in which the mark of our own files stands: it is in their first lines
DOCUMENTS = ("report.json", "adjust.json")
"""Documents of runs that list their exports, each with its frame."""


def remove_stale(path: Path, staging: Staging) -> None:
    """Remove what belongs to an earlier export to the same path and not to this one.

    A script that names the CRS of the table before would have degrees read as metres.

    Parameters
    ----------
    path : Path
        The export.
    staging : Staging
        The open one, in which the export and what belongs to it stand; that stays.
    """
    goal = staging.destination(path)
    for end, mark in MARKS_OF_COMPANIONS.items():
        companion = goal.with_name(f"{goal.stem}{end}")
        if companion.is_file():
            with companion.open("rb") as stream:
                ours = mark in stream.read(OWN_MARK_BYTES)
            if ours:
                staging.remove(companion)


def refuse_replacing(staging: Staging, out: Path, named: bool, frame: str) -> None:
    """Refuse to replace a run's own table in another frame, and what `--out` names, by another one.

    Files that would stay as they are are replaced by any export.

    Parameters
    ----------
    staging : Staging
        The open one, with all files of the export.
    out : Path
        The export.
    named : bool
        Whether the user named it.
    frame : str
        The frame of the export.

    Raises
    ------
    UsageError
        What is in the way, with both frames where these differ.
    """
    changed = [goal for _, goal in staging.changed()]
    if not changed:
        return
    frame_before = frame_of_run(out)
    if frame_before is not None and frame_before != frame:
        code = re.sub(r"[^A-Za-z0-9+]+", "", frame.split()[0])
        renamed = out.with_name(f"{out.stem}_{code}{out.suffix}")
        raise UsageError(
            f"export: {out} is a product of the flight in {frame_before}, and this export is in "
            f"{frame}; give --out {renamed}, or --force"
        )
    if named:
        raise UsageError(
            f"export: {changed[0]} exists and differs from this export (other inputs, options or"
            " frame, or not written by insgnss); give another --out, or --force"
        )


def frame_of_run(out: Path) -> str | None:
    """Return the frame in which a run wrote a file of this name beside its documents.

    Parameters
    ----------
    out : Path
        The file, or the directory of a format that has several.

    Returns
    -------
    str or None
        The frame's name; None where no run says that it wrote such a file.
    """
    for name in DOCUMENTS:
        try:
            exports = read_object(out.parent / name, is_replaced=True)["exports"]
            return next(row["frame"] for row in exports if row["file"] == out.name)
        except (KeyError, TypeError, StopIteration):
            continue
    return None
