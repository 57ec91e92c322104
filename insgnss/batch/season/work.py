"""One flight in a worker: processed, or kept where its products are those of its inputs.

What has been done is known from the products alone: report.json appears with all files of a run or
not at all, and has the hashes of the inputs, the resolved flight file and the version. So a season
that was killed anywhere goes on where it was, and nothing of its own has to be kept.
"""

import contextlib
import threading
import time
import traceback
import warnings
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from ...base import __version__
from ...base.errors import DataError, InputError, InsgnssError
from ...base.files import json_ready
from ...base.inputs import sha256
from ...base.provenance import DIGESTS_KEY, changed_products
from ...base.received.trusted import trusting
from ...base.wording import relative, some
from ...flight.config.flight_file import Flight
from .earlier import earlier_flights
from .row import (
    ROW_COLUMNS,
    Row,
    boresight_of,
    equipment_of,
    known_from_refusal,
    read_report,
    row_of,
)

JOB_DONE, JOB_KEPT, FAILED, WAITING = "done", "kept", "failed", "not reached"
REPORT, FLIGHT_PAGE = "report.json", "report.html"
CHANGED = "changed_products"  # of a row, not of the table: those of a kept flight
MOST_NAMED_PRODUCTS = 3  # of its products
INTERNAL = InsgnssError.exit_code
_ONE_AT_A_TIME = threading.Lock()  # warnings are caught for a whole process


@dataclass(frozen=True)
class Task:
    """A flight for a worker, in plain values that any process understands.

    Parameters
    ----------
    name : str
        Of the flight.
    file : str
        Its flight file.
    out : str
        Directory of its products; empty for the flight file's.
    again : bool
        Whether it is processed although its products are there.
    force : bool
        Whether results of other measurements are overwritten.
    forecast_bytes : float
        Memory that it will need, as forecast.
    """

    name: str
    file: str
    out: str = ""
    again: bool = False
    force: bool = False
    forecast_bytes: float = 0.0


@dataclass(frozen=True)
class Outcome:
    """What became of a flight.

    Parameters
    ----------
    name : str
        Of the flight.
    status : str
        "done", "kept", "failed" or, where the run ended before it, "not reached".
    row : dict
        Its row of the table.
    exit_code : int
        That of `insgnss process` for its failure, else 0.
    notes : tuple of str
        Warnings of the run.
    """

    name: str
    status: str
    row: Row = field(default_factory=dict)
    exit_code: int = 0
    notes: tuple[str, ...] = ()

    @property
    def reason(self) -> str:
        """Why it failed, or what limits it; empty of a good flight."""
        return str(self.row.get("reason") or "")


def is_changed(row: Row) -> bool:
    """Whether a flight was kept although somebody changed its products."""
    return CHANGED in row


Tell = Callable[[Outcome], None]


def process_task(task: Task) -> Outcome:
    """Process a flight; whatever is wrong with it is its outcome and no exception.

    Parameters
    ----------
    task : Task
        The flight.

    Returns
    -------
    Outcome
        With the row of the season's table.
    """
    with _ONE_AT_A_TIME, trusting([task.file]):
        return _outcome(task)


def _outcome(task: Task) -> Outcome:
    start = time.monotonic()
    try:
        with warnings.catch_warnings(record=True) as caught:
            warnings.simplefilter("always")
            status, row = _process_flight(task)
    except Exception as error:
        code, reason = _verdict(error)
        constants = known_from_refusal(error.findings) if isinstance(error, InputError) else {}
        return failed_outcome(task, reason, code, time.monotonic() - start, constants)
    row["seconds"] = round(time.monotonic() - start, 3)
    notes = tuple(dict.fromkeys(" ".join(str(warning.message).split()) for warning in caught))
    return Outcome(task.name, status, row, 0, notes)


def failed_outcome(
    task: Task, reason: str, code: int, seconds: float, constants: Mapping[str, Any] | None = None
) -> Outcome:
    """Return the outcome of a flight without products.

    Parameters
    ----------
    task : Task
        The flight.
    reason : str
        One line.
    code : int
        The exit code that `insgnss process` has for it.
    seconds : float
        What it took.
    constants : mapping, optional
        What it tells all the same, by column.
    """
    row = _row_without_products(task, FAILED, " ".join(reason.split())) | dict(constants or {})
    row |= {"judgement": "bad", "seconds": round(seconds, 3)}
    with contextlib.suppress(Exception):
        from ...flight.config.load import load_flight

        row |= equipment_of(load_flight(task.file))
    return Outcome(task.name, FAILED, row, code)


def not_reached(task: Task) -> Outcome:
    """Return the outcome of a flight that was not done when the run ended.

    Parameters
    ----------
    task : Task
        The flight.
    """
    reason = "the run ended before this flight was processed; give the same command again"
    return Outcome(task.name, WAITING, _row_without_products(task, WAITING, reason))


def _row_without_products(task: Task, status: str, reason: str) -> Row:
    row: Row = dict.fromkeys(ROW_COLUMNS) | {
        "name": task.name,
        "flight": task.file,
        "status": status,
    }
    return row | {"reason": reason, "version": __version__}


def _process_flight(task: Task) -> tuple[str, Row]:
    from ...flight.config.load import load_flight
    from ...flight.processing.pipeline import process

    flight = load_flight(task.file)
    out = Path(task.out) if task.out else None
    directory = out or flight.output.directory
    report = None if task.again else report_in_force(flight, directory)
    status = JOB_KEPT
    if report is None:
        result = process(flight, out, force=task.force, compare=earlier_flights)
        status, report = JOB_DONE, result.report
    row = row_of(report)
    row |= {"name": task.name, "flight": task.file, "status": status}
    if status == JOB_KEPT and (changed := names_of_changed(report, directory)):
        row[CHANGED] = changed
        row["reason"] = "; ".join(filter(None, (changed_since(changed), row["reason"])))
    row |= {"report": str(directory / FLIGHT_PAGE)} | equipment_of(flight)
    row |= boresight_of(flight)
    return status, row


def report_in_force(flight: Flight, directory: Path) -> dict[str, Any] | None:
    """Return the report of a flight's products where these are what would be made now.

    Parameters
    ----------
    flight : Flight
        The flight file.
    directory : Path
        Of the products.

    Returns
    -------
    dict or None
        None where there is none, or where version, an option or an input is another one.
    """
    from ...flight.processing.input_files import input_files

    report = read_report(directory / REPORT)
    if report is None or not (directory / FLIGHT_PAGE).is_file() or "constants" not in report:
        return None
    if report["versions"].get("insgnss") != __version__:
        return None
    if report.get("flight") != json_ready(flight.resolved()):
        return None
    start = flight.path.parent
    hashes = report["inputs_sha256"]
    files = {relative(file, start): file for file in input_files(flight)}
    if set(files) != set(hashes):
        return None
    changed = any(sha256(file) != hashes[name] for name, file in files.items())
    names = [export["file"] for export in report.get("exports", ())]
    # the PPK solution beside them is missing where they alone were published
    names += [name for name in report.get(DIGESTS_KEY, ()) if not name.startswith("..")]
    products = [directory / name for name in names]
    missing = any(not product.exists() for product in products)
    return None if changed or missing else report


def names_of_changed(report: Mapping[str, Any], directory: Path) -> tuple[str, ...]:
    """Return which products of a flight are not what its run wrote, as `insgnss archive` does.

    Parameters
    ----------
    report : mapping
        What report.json holds.
    directory : Path
        Of the products.
    """
    different = changed_products(report, directory)
    return tuple(name for name, how in different if how == "changed")


def changed_since(names: Sequence[str]) -> str:
    """Say that products were changed after the run, and what makes them again.

    Parameters
    ----------
    names : sequence of str
        Of the products.
    """
    return (
        "products changed after the run wrote them, and kept: "
        f"{some(names, MOST_NAMED_PRODUCTS)}; `insgnss process` of this flight, or `batch "
        "--again`, writes them anew"
    )


def _verdict(error: Exception) -> tuple[int, str]:
    """Return exit code and reason of a failure, as the command line has them."""
    if isinstance(error, InsgnssError):
        return error.exit_code, str(error)
    if isinstance(error, MemoryError):
        from ...base.memory import out_of_memory

        return DataError.exit_code, out_of_memory(error)
    if isinstance(error, OSError):
        return 3, f"{error.filename or ''}: {error.strerror or error}".lstrip(": ")
    last = traceback.extract_tb(error.__traceback__)[-1]
    text = f"internal error: {type(error).__name__}: {error} (at {last.filename}:{last.lineno})"
    return INTERNAL, text
