"""Which flights a season has: directories, patterns, flight files and tables of flights."""

import csv
import os
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from pathlib import Path

from ...base.errors import InputError, UsageError
from ...base.inputs import is_file, opened_text
from ...base.received.trusted import inside

FLIGHT_FILE = "flight.toml"
TABLE_COLUMNS = ("flight", "name", "out")
PATTERN_LETTERS = "*?["


@dataclass(frozen=True)
class SeasonFlight:
    """A flight of a season, before its flight file is read.

    Parameters
    ----------
    file : Path
        Its flight file, absolute.
    name : str
        How lines, table and page call it; of no two flights the same; "" until it has one.
    out : Path or None
        Directory of its products in place of the flight file's.
    """

    file: Path
    name: str = ""
    out: Path | None = None


def gather(sources: Sequence[str], overview: Path | None = None) -> list[SeasonFlight]:
    """Return the flights that some words of the command line name.

    Parameters
    ----------
    sources : sequence of str
        Directories, below which every flight.toml counts; patterns such as ``season/*/flight.toml``
        (``**`` for any depth); flight files; and tables of flights, CSV files with a column
        ``flight`` and, if wanted, ``name`` and ``out``, paths relative to the table.
    overview : Path, optional
        Directory of the season's page, below which ``out`` may lie as below that of the table.

    Returns
    -------
    list of SeasonFlight
        In the order of the words, within a directory by path; none twice.

    Raises
    ------
    UsageError
        A word names no flight.
    InputError
        A table lacks a column, or names a flight that is not there or an ``out`` elsewhere.
    """
    flights: dict[str, SeasonFlight] = {}
    for source in sources:
        for flight in _flights_of_argument(source, overview):
            flights.setdefault(os.path.realpath(flight.file), flight)
    return _with_names(list(flights.values()))


def _flights_of_argument(source: str, overview: Path | None) -> list[SeasonFlight]:
    """Return the flights of one word, whose names may still be empty."""
    path = Path(source)
    if path.is_dir():
        files = _flight_files_below(path)
        if not files:
            raise UsageError(
                f"{source}: no {FLIGHT_FILE} in this directory or below it; give the directory"
                " that holds the season's flights"
            )
        return [SeasonFlight(file) for file in files]
    if is_file(path):
        return (
            _table(path, overview)
            if path.suffix.lower() == ".csv"
            else [SeasonFlight(path.absolute())]
        )
    if any(sign in source for sign in PATTERN_LETTERS):
        return _files_matching(source)
    raise UsageError(
        f"{source}: does not exist; give directories, flight files, patterns or a table of flights"
    )


def _flight_files_below(directory: Path) -> list[Path]:
    """Return the flight files in a directory and below, but for those of runs that have died."""
    files = []
    for folder, inner, names in os.walk(directory.absolute()):
        inner[:] = sorted(name for name in inner if not name.startswith("."))
        if FLIGHT_FILE in names:
            files.append(Path(folder) / FLIGHT_FILE)
    return files


def _files_matching(pattern: str) -> list[SeasonFlight]:
    """Return the flights of a pattern: flight files, or directories that hold them."""
    import glob

    matches = sorted(glob.glob(pattern, recursive=True))
    flights = []
    for match in map(Path, matches):
        if match.is_dir() and (match / FLIGHT_FILE).is_file():
            flights.append(SeasonFlight((match / FLIGHT_FILE).absolute()))
        elif match.is_file() and match.suffix.lower() == ".toml":
            flights.append(SeasonFlight(match.absolute()))
    if not flights:
        count = "nothing" if not matches else f"{len(matches)} files, of which none is a flight"
        raise UsageError(
            f"{pattern}: the pattern matches {count}; correct it, and put it into quotation marks"
            " so that the shell does not expand it"
        )
    return flights


def _table(path: Path, overview: Path | None) -> list[SeasonFlight]:
    """Return the flights of a table."""
    with opened_text(path, "utf-8-sig", newline="") as stream:
        rows = csv.reader("\n" if line.lstrip().startswith("#") else line for line in stream)
        try:
            return _flights_of_rows(path, list(rows), overview)
        except (csv.Error, UnicodeDecodeError) as error:
            raise InputError.in_file(
                path, f"is no CSV file in UTF-8: {error}; save the table as CSV in UTF-8"
            ) from None


def _flights_of_rows(
    path: Path, rows: list[list[str]], overview: Path | None
) -> list[SeasonFlight]:
    """Return the flights of a table's rows; refuse unknown columns and missing flights."""
    header_row = next(
        (index for index, row in enumerate(rows) if row), 0
    )  # comments became empty rows
    header = [word.strip() for word in rows[header_row]] if rows else []
    if "flight" not in header:
        columns = ", ".join(header) or "none"
        names = ", ".join(TABLE_COLUMNS)
        problem = f"has no column flight (columns: {columns}); a table of flights has {names}"
        raise InputError.at_line(path, header_row + 1, problem)
    if unknown := [word for word in header if word not in TABLE_COLUMNS]:
        problem = f"column {unknown[0]!r} is unknown; known are {', '.join(TABLE_COLUMNS)}"
        raise InputError.at_line(path, header_row + 1, problem)
    flights = []
    for number, row in enumerate(rows[header_row + 1 :], header_row + 2):
        if not any(word.strip() for word in row):
            continue
        if len(row) != len(header):
            problem = f"{len(row)} values under {len(header)} columns"
            raise InputError.at_line(path, number, problem)
        cells = dict(zip(header, (word.strip() for word in row), strict=True))
        file = path.absolute().parent / cells["flight"]
        file = file / FLIGHT_FILE if file.is_dir() else file
        if not cells["flight"] or not is_file(file):
            problem = (
                f"flight {cells['flight']!r} does not exist; paths are relative to the directory of"
                f" {path.name}"
            )
            raise InputError.at_line(path, number, problem)
        out_directory = path.absolute().parent / cells["out"] if cells.get("out") else None
        allowed = filter(None, (path.absolute().parent, overview))
        if out_directory is not None and not any(inside(out_directory, home) for home in allowed):
            problem = f"out {cells['out']!r} is outside of the directory of {path.name}"
            advice = (
                f"set --out to a directory above {cells['out']!r}, or move {path.name} to such a"
                " directory"
            )
            raise InputError.at_line(path, number, f"{problem}; {advice}")
        flights.append(SeasonFlight(file, cells.get("name", ""), out_directory))
    if not flights:
        raise InputError.in_file(
            path, "names no flight; write one flight file or directory in each line"
        )
    return flights


def _with_names(flights: list[SeasonFlight]) -> list[SeasonFlight]:
    """Give every flight a name: that of the table, else its directory below the common one."""
    folders = [flight.file.parent for flight in flights]
    common_folder = Path(os.path.commonpath(folders)) if len(folders) > 1 else folders[0].parent
    named = []
    file_of_name: dict[str, Path] = {}
    for flight, folder in zip(flights, folders, strict=True):
        label = (
            folder.relative_to(common_folder).as_posix() if folder != common_folder else folder.name
        )
        if flight.file.name != FLIGHT_FILE:
            label = f"{label}/{flight.file.stem}" if label != "." else flight.file.stem
        name = flight.name or label
        if name in file_of_name:
            raise UsageError(
                f"two flights are called {name!r}: {file_of_name[name]} and {flight.file}; give"
                " names in a table of flights"
            )
        file_of_name[name] = flight.file
        named.append(SeasonFlight(flight.file, name, flight.out))
    return named


def refuse_shared_outputs(outputs: Iterable[tuple[str, Path]]) -> None:
    """Refuse flights whose products would overwrite each other.

    Parameters
    ----------
    outputs : iterable of (str, Path)
        Name and directory of the products of each flight.

    Raises
    ------
    UsageError
        Two of them have the same directory.
    """
    flight_of_output: dict[str, str] = {}
    for name, directory in outputs:
        key = os.path.normcase(os.path.realpath(directory))
        if key in flight_of_output:
            raise UsageError(
                f"{flight_of_output[key]} and {name} have the same output directory {directory};"
                " give each its own: output.directory, or a column out in a table of flights"
            )
        flight_of_output[key] = name
