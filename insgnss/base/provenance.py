"""What results in a directory were made from, and by which run: said in their JSON document, and
held against what is there before others take their place.

Every verb that leaves products leaves a document with `made_from` beside them; `insgnss archive`
knows results by it, whichever verb they are of.
"""

import os
import platform
import sys
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import fields, is_dataclass
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

from . import __version__
from .errors import UsageError
from .inputs import sha256
from .output.scratch import SCRATCH_NAME
from .output.staging import destination, written_path
from .received.nesting import read_object
from .wording import command_line, relative

INPUTS_KEY = "inputs_sha256"
"""In the JSON documents of results: the SHA-256 of each input by its path."""
DIGESTS_KEY = "products_sha256"
"""The same of each product by its path from the document; pages that hold the document are none."""
DIRECTORY_KEY = "inputs_directory"
"""From the document to the directory that paths of inputs are relative to; without it its own."""


def made_from(
    inputs: Iterable[Path], document: Path, products: Iterable[Path], start: Path | None = None
) -> dict[str, Any]:
    """Return what a document of results says of their making.

    Parameters
    ----------
    inputs : iterable of Path
        Everything that the results depend on; what is no file is left out.
    document : Path
        The JSON document, where it is written or where it goes to (`base.output.staging`).
    products : iterable of Path
        Files that have been written by now, likewise.
    start : Path, optional
        Directory that paths of inputs are relative to, such as that of a flight file; by default
        that of the document.

    Returns
    -------
    dict
        Versions, the command, hashes of inputs and products.
    """
    folder = destination(document).absolute().parent
    record: dict[str, Any] = {
        "versions": versions(),
        "run": {"command": circumstances()["command"]},
        INPUTS_KEY: hashes_of(inputs, start or folder),
        DIGESTS_KEY: hashes_of_products(products, folder),
    }
    return record if start is None else record | {DIRECTORY_KEY: relative(start, folder)}


def versions() -> dict[str, str]:
    """Return the versions that results hang on."""
    return {
        "insgnss": __version__,
        "python": platform.python_version(),
        "numpy": str(installed_version("numpy")),
    }


def installed_version(distribution: str) -> str | None:
    """Return the version of an installed distribution, None where it is not installed."""
    from importlib.metadata import PackageNotFoundError, version  # costs `insgnss --help` 15 ms

    try:
        return version(distribution)
    except PackageNotFoundError:
        return None


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


def hashes_of_products(files: Iterable[Path], folder: Path) -> dict[str, str]:
    """Return the hash of each product by its path from a directory.

    Parameters
    ----------
    files : iterable of Path
        Where they are written, or where they go to (`base.output.staging`).
    folder : Path
        The directory of their document.
    """
    named = {Path(relative(destination(path), folder)): path for path in sorted(files)}
    return {
        name.as_posix(): sha256(written_path(path))
        for name, path in named.items()
        if not any(map(SCRATCH_NAME.fullmatch, name.parts))  # of a scratch directory that stayed
    }


def changed_products(content: Mapping[str, Any], folder: Path) -> Iterator[tuple[str, str]]:
    """Yield the products that are not what a run wrote.

    Parameters
    ----------
    content : mapping
        The JSON document of the results; without `DIGESTS_KEY` nothing is known of them.
    folder : Path
        The directory of the document.

    Yields
    ------
    tuple of str
        The name of the product, and "missing" or "changed".
    """
    for name, value in (content.get(DIGESTS_KEY) or {}).items():
        path = folder / name
        if not path.is_file():
            yield name, "missing"
        elif sha256(path) != value:
            yield name, "changed"


def paths_named_by(options: Any) -> Iterator[Path]:
    """Yield every path that options hold, at any depth: an option that is new is not forgotten.

    Parameters
    ----------
    options : Any
        Dataclasses, mappings and sequences; what is none of these and no path is passed over.
    """
    if isinstance(options, Path):
        yield options
    elif is_dataclass(options):
        for option in fields(options):
            yield from paths_named_by(getattr(options, option.name))
    elif isinstance(options, Mapping):
        for value in options.values():
            yield from paths_named_by(value)
    elif isinstance(options, list | tuple):
        for value in options:
            yield from paths_named_by(value)


def other_results(
    document: Path, measured: Iterable[Path], one_is_enough: bool = False
) -> str | None:
    """Tell whether results are of other measurements than those that a run is going to take.

    Settings do not matter, such as the flight file or a noise model: the same measurements may be
    processed again in another way.

    Parameters
    ----------
    document : Path
        The JSON document of results that may be there, with `INPUTS_KEY`.
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
        hashes = set(dict(read_object(document, is_replaced=True)[INPUTS_KEY]).values())
    except (ValueError, KeyError, TypeError):
        return f"{document} exists and does not state from which measurements it was made"
    files = [file for file in measured if file.is_file()]
    foreign = [file for file in files if sha256(file) not in hashes]
    if not foreign or (one_is_enough and len(foreign) < len(files)):
        return None
    return (
        f"{document.parent} holds results of other measurements: {document.name} was not"
        f" made from {foreign[0].name}"
    )


def refuse_overwriting(
    goals: Iterable[Path], inputs: Iterable[Path | None], advice: str = "another directory by --out"
) -> None:
    """Raise UsageError where a product would take the place of an input."""
    input_paths = {path.resolve() for path in inputs if path is not None}
    for goal in goals:
        if goal.resolve() in input_paths:
            raise UsageError(f"the product {goal} would overwrite an input; give {advice}")


def refuse_other_results(
    verb: str,
    document: Path,
    measured: Iterable[Path],
    force: bool = False,
    one_is_enough: bool = False,
) -> None:
    """Raise UsageError where `other_results` are in the way and `force` is not given."""
    if not force and (reason := other_results(document, measured, one_is_enough)):
        raise UsageError(
            f"{verb}: {reason}; give another directory with --out, or overwrite it with --force"
        )
