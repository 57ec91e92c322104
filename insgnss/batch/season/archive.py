"""Can every product of an archive be made again from its inputs?

Results of insgnss, whichever verb they are of, say in a JSON document beside them which inputs they
were made from, by SHA-256 and path, by which version, and what their products' hashes are
(`base.provenance.made_from`). Each document is held against what is there now; what is missing, has
changed, or is made by another version is named. An archive may have been moved as a whole: inputs
are looked for from the place that the document names, then from the directories above.
"""

import os
import tempfile
import warnings
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

from ...base import __version__
from ...base.errors import DataError, InsgnssError, UsageError
from ...base.files import json_ready
from ...base.inputs import read_bytes, sha256
from ...base.provenance import (
    DIGESTS_KEY,
    DIRECTORY_KEY,
    INPUTS_KEY,
    changed_products,
    installed_version,
)
from ...base.received.nesting import read_object
from ...base.wording import relative
from .gathering import FLIGHT_FILE

REPORT, PUBLISHED = "report.json", "GPS-INS"  # of `process`, beside whose directory its PPK lies
FLIGHT_DIRECTORY = "flight_directory"  # in a report what `DIRECTORY_KEY` is in others
ORPHANS = (
    *("eo.json", "EO_local-plane.txt", "trajectory.sbet", "trajectory.csv", "eo_covariance.npz"),
    *("metashape.csv", "ppk.pos", "poses.csv"),
)
"""Products that no directory should hold without the document of their run."""
Progress = Callable[[str], None]


@dataclass(frozen=True)
class Examined:
    """What an archive says of one run.

    Parameters
    ----------
    document : Path
        The JSON document of its results.
    problems : tuple of str
        Why its products cannot be made again; none where they can.
    notes : tuple of str
        What may move last digits, and what was not made again.
    remade : bool
        Whether they were made again, and came out the same byte for byte.
    """

    document: Path
    problems: tuple[str, ...] = ()
    notes: tuple[str, ...] = ()
    remade: bool = False


@dataclass(frozen=True)
class ArchiveResult:
    """What an archive says of all its runs.

    Parameters
    ----------
    directory : Path
        The archive.
    runs : tuple of Examined
        By path.
    orphans : tuple of Path
        Products beside which no document says what they were made from.
    unprocessed : tuple of Path
        Flight files without results.
    """

    directory: Path
    runs: tuple[Examined, ...]
    orphans: tuple[Path, ...]
    unprocessed: tuple[Path, ...] = ()

    @property
    def refusal(self) -> DataError | None:
        """Why not everything can be made again; None where it can."""
        problem_count = sum(bool(run.problems) for run in self.runs)
        if not problem_count and not self.orphans:
            return None
        also = f", {len(self.orphans)} products of unknown inputs" if self.orphans else ""
        return DataError(
            f"{problem_count} of {len(self.runs)} results cannot be made again from the files"
            f" here{also}"
        )

    def summary(self) -> str:
        """Return a line for each problem, and the count."""
        lines = []
        folders = [run.document.parent for run in self.runs]
        for run, folder in zip(self.runs, folders, strict=True):
            shown_path = folder if folders.count(folder) == 1 else run.document
            where = relative(shown_path, self.directory)
            if run.problems:
                lines += [f"{where}: {problem}" for problem in run.problems]
            elif run.remade:
                lines.append(f"{where}: made again, the same byte for byte")
            lines += [f"{where}: note: {note}" for note in run.notes]
        lines += [
            f"{relative(path, self.directory)}: no JSON document states the inputs of this product"
            for path in self.orphans
        ]
        lines += [
            f"{relative(path, self.directory)}: no results yet; run insgnss process on this flight"
            for path in self.unprocessed
        ]
        reproduced = sum(not run.problems for run in self.runs)
        return "\n".join([*lines, f"{reproduced} of {len(self.runs)} results can be made again"])

    def as_dict(self) -> dict[str, Any]:
        """Return the document for machines."""
        return dict(json_ready(asdict(self)))


def examine_archive(directory: Path, remake: bool, progress: Progress) -> ArchiveResult:
    """Hold every result of a directory against its inputs.

    Parameters
    ----------
    directory : Path
        The archive.
    remake : bool
        Whether what can be made again by `process` is, in a temporary directory, and compared.
    progress : callable
        Is given what is looked at.

    Returns
    -------
    ArchiveResult
        What can be made again, and what not.

    Raises
    ------
    UsageError
        It is no directory, or holds no result of insgnss.
    """
    if not directory.is_dir():
        raise UsageError(f"archive: {directory} is no directory; give one of flights and results")
    documents, orphans = _documents_and_orphans(directory)
    if not documents and not orphans:
        raise UsageError(
            f"archive: {directory} holds no results of insgnss (no JSON document with {INPUTS_KEY})"
        )
    runs = []
    for number, document in enumerate(documents, 1):
        progress(f"{number} of {len(documents)}: {relative(document, directory)}")
        runs.append(_examine_document(document, remake))
    return ArchiveResult(
        directory, tuple(runs), tuple(orphans), _unprocessed_flights(directory, documents)
    )


def _unprocessed_flights(directory: Path, documents: Sequence[Path]) -> tuple[Path, ...]:
    """Return flight files that no results were made from."""
    named: set[Path] = set()
    for document in documents:
        content = read_object(document)
        base = _base_of(document, content)
        named |= {(base / name).resolve() for name in content[INPUTS_KEY]}
    flights = (path for path in sorted(directory.rglob(FLIGHT_FILE)) if path.resolve() not in named)
    return tuple(flights)


def _documents_and_orphans(directory: Path) -> tuple[list[Path], list[Path]]:
    """Return the documents of an archive, and products without one."""
    documents: list[Path] = []
    orphans: list[Path] = []
    above: list[Path] = []  # directories of runs that leave such products
    for folder, inner, names in os.walk(directory):
        inner[:] = sorted(name for name in inner if not name.startswith("."))
        paths = [Path(folder) / name for name in sorted(names) if name.endswith(".json")]
        paths = [path for path in paths if _is_document(path)]
        documents += paths
        above += [path.parent for path in paths if _may_leave_orphans(path)]
        if "mounting.toml" not in names:
            of_run = any(path in (Path(folder), *Path(folder).parents) for path in above)
            has_report = (Path(folder).parent / PUBLISHED / REPORT).is_file()
            if not of_run and not has_report and Path(folder).name != "truth":
                orphans += [Path(folder) / name for name in ORPHANS if name in names]
    return documents, orphans


def _may_leave_orphans(document: Path) -> bool:
    """Tell whether a run leaves what `ORPHANS` names; others, as of `tune`, explain none of it."""
    products = read_object(document).get(DIGESTS_KEY)
    return not products or any(Path(name).name in ORPHANS for name in products)


def _is_document(path: Path) -> bool:
    """Tell whether a file says what results were made from; others are not parsed."""
    try:
        named = INPUTS_KEY.encode() in read_bytes(path)
    except OSError:
        return False
    return named and isinstance(read_object(path).get(INPUTS_KEY), dict)


def _examine_document(document: Path, remake: bool) -> Examined:
    """Hold one document against what is there."""
    content = read_object(document)
    hashes = content[INPUTS_KEY]
    base = _base_of(document, content)
    problems = list(_inputs(hashes, base))
    problems += _products(content, document.parent)
    versions = content.get("versions") or {}
    made_by = versions.get("insgnss")
    if made_by != __version__:
        problems.append(f"made by insgnss {made_by or 'of an unknown version'}, not {__version__}")
    notes = list(_other_versions(versions))
    if any("given as object" in str(value) for value in _leaf_values(content.get("flight"))):
        problems.append(
            "an input was a Python object, not a file, so that the run cannot be repeated"
        )
    if not problems and content.get("flight"):
        problems += _resolved_otherwise(content, base)
        if remake and not problems:
            problems += _remade(content, base)
            return Examined(document, tuple(problems), tuple(notes), not problems)
    elif not problems and remake:
        command = (content.get("run") or {}).get("command", "its verb")
        notes.append(
            f"not made again: --remake repeats flights only, and this result was made by {command}"
        )
    return Examined(document, tuple(problems), tuple(notes))


def changed_since(document: Path) -> tuple[str, ...]:
    """Return which inputs of a result were written after it, and are others now.

    Parameters
    ----------
    document : Path
        The JSON document of the result; without one nothing is said.

    Returns
    -------
    tuple of str
        Names of inputs, as the document has them; files that are older than the document are not
        read.
    """
    content = read_object(document)
    hashes = content.get(INPUTS_KEY)
    if not hashes:
        return ()
    base, written_s = _base_of(document, content), document.stat().st_mtime
    later = [n for n in hashes if (base / n).is_file() and (base / n).stat().st_mtime > written_s]
    return tuple(name for name in later if sha256(base / name) != hashes[name])


def _base_of(document: Path, content: Mapping[str, Any]) -> Path:
    """Return the directory that the paths of inputs are relative to: where most of them are."""
    folder = document.parent.absolute()
    named = content.get(DIRECTORY_KEY, content.get(FLIGHT_DIRECTORY))
    candidates = [folder / named] if isinstance(named, str) else []
    candidates += [folder, *folder.parents]
    names = list(content[INPUTS_KEY])
    counts = [sum((candidate / name).is_file() for name in names) for candidate in candidates]
    best_index = max(range(len(candidates)), key=lambda index: (counts[index], -index))
    return Path(os.path.normpath(candidates[best_index]))


def _inputs(hashes: Mapping[str, str], base: Path) -> Iterator[str]:
    """Yield what is wrong with inputs."""
    for name, value in hashes.items():
        path = base / name
        if not path.is_file():
            yield f"input {name} is missing (looked for in {base})"
        elif (now := sha256(path)) != value:
            yield f"input {name} has changed: SHA-256 {now[:12]}..., was {str(value)[:12]}..."


def _products(content: Mapping[str, Any], folder: Path) -> Iterator[str]:
    """Yield which products are missing or not what the run wrote."""
    for name, how in changed_products(content, folder):
        if how == "missing":
            yield f"product {name} is missing"
        else:
            yield f"product {name} was changed after the run wrote it"


def _other_versions(versions: Mapping[str, str]) -> Iterator[str]:
    """Yield which libraries have another version now."""
    for name, then in versions.items():
        now = None if name in ("insgnss", "python") else installed_version(name)
        if now not in (None, then):
            yield (f"{name} {now} is installed, at the run it was {then}: last digits may differ")


def _resolved_otherwise(content: Mapping[str, Any], base: Path) -> Sequence[str]:
    """Say where the flight file as it is would be processed with other options."""
    from ...flight.config.load import load_flight

    try:
        with warnings.catch_warnings(action="ignore"):
            flight = load_flight(base / str(content["flight"]["path"]))
    except InsgnssError as error:
        return [f"the flight file cannot be read: {error}"]
    now = json_ready(flight.resolved())
    then = content["flight"]
    differing = sorted(key for key in {*now, *then} if now.get(key) != then.get(key))
    if not differing:
        return []
    command = (content.get("run") or {}).get("command", "another command")
    return [
        f"the flight file alone gives other values of {', '.join(differing)}; the result was made "
        f"by {command}, with further options"
    ]


def _remade(content: Mapping[str, Any], base: Path) -> Sequence[str]:
    """Make the products of a flight again, and say which differ."""
    from ...flight.config.load import load_flight
    from ...flight.processing.pipeline import process

    hashes = content.get(DIGESTS_KEY) or {}
    if not hashes:
        return ["made by a version without hashes of products; process the flight again"]
    outside = any(name.startswith("..") for name in hashes)  # the PPK solution, beside `PUBLISHED`
    with tempfile.TemporaryDirectory() as scratch:
        out = Path(scratch) / "made" / (PUBLISHED if outside else "products")
        try:
            with warnings.catch_warnings(action="ignore"):
                process(load_flight(base / str(content["flight"]["path"])), out)
        except InsgnssError as error:
            return [f"cannot be processed again: {error}"]
        return [
            f"product {name} differs when it is made again"
            for name, value in hashes.items()
            if not (out / name).is_file() or sha256(out / name) != value
        ]


def _leaf_values(value: Any) -> Iterator[Any]:
    """Yield the values of nested tables and lists of a JSON document."""
    if isinstance(value, dict | list):
        for item in value.values() if isinstance(value, dict) else value:
            yield from _leaf_values(item)
    else:
        yield value
