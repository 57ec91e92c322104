"""Where the files of a tuning go: refused before any work where they cannot be written."""

import tempfile
from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from ...base.errors import UsageError, writing
from ...base.inputs import is_file
from ...base.output.staging import together
from ...base.provenance import made_from, other_results
from ...navigation.noise_model.model import NoiseModel, write_noise_model

if TYPE_CHECKING:
    from ...report.document import Document

ELSEWHERE = "give another --out FILE"


def planned(
    target: Path, force: bool, measured: Iterable[Path], inputs: Iterable[Path] = ()
) -> Path:
    """Return the path of a noise model that is going to be written, with table and page beside it.

    Parameters
    ----------
    target : Path
        The noise model; a directory that is not there yet is made when the files are written.
    force : bool
        Whether files of other recordings are replaced.
    measured, inputs : iterable of Path
        The recordings, and files that are never replaced.

    Raises
    ------
    UsageError
        Where the path names no TOML file in a directory that takes files, an input would be
        replaced, or files are there that are not of a tuning of the same recordings.
    """
    if target.suffix != ".toml":
        raise UsageError(f"{target}: a noise model is a TOML file; end its name with .toml")
    present = next(path for path in target.absolute().parents if path.exists())
    with writing(target, ELSEWHERE), tempfile.TemporaryFile(dir=present):
        files, never = (target, *beside(target)), {file.resolve() for file in inputs}
    if taken := [file for file in files if file.resolve() in never]:
        raise UsageError(
            f"{taken[0]}: is an input of this flight and is never overwritten; {ELSEWHERE}"
        )
    existing = [str(path) for path in files if path.exists()]
    if force or not existing:
        return target
    if not is_file(files[1]):
        verb = "is" if len(existing) == 1 else "are"
        reason = f"{', '.join(existing)} {verb} there already, and not of a tuning"
    elif (reason := other_results(files[1], measured) or "") == "":
        return target
    raise UsageError(f"{reason}; nothing done; {ELSEWHERE}, or --force")


def beside(target: Path) -> tuple[Path, Path]:
    """Return the paths of the table and the page beside a noise model."""
    return target.with_suffix(".json"), target.with_suffix(".html")


def write_tuning(
    target: Path,
    model: NoiseModel | None,
    remarks: Sequence[str],
    measured: Iterable[Path],
    document: "Document",
    numbers: dict[str, Any],
) -> None:
    """Write the noise model, where there is one, the table and the page: all or none.

    Parameters
    ----------
    target : Path
        The noise model.
    model : NoiseModel, optional
        What it holds.
    remarks : sequence of str
        Comments of its file.
    measured : iterable of Path
        The files that the result was made from.
    document, numbers : Document, dict
        What stands on the page, and what in the table.
    """
    from ...report.document import write_with_page

    table, page = beside(target)
    with writing(target.parent, ELSEWHERE, "made"):
        target.parent.mkdir(parents=True, exist_ok=True)
    with together():
        if model is not None:
            write_noise_model(model, target, remarks)
        numbers |= made_from(measured, table, (target,) if model else ())
        write_with_page(document, numbers, table, page)
