"""A season in its order: gather, forecast, process on workers, judge trends, write the files.

The memory that a flight will need is forecast from the sizes of its files before any is read:
`navigation.filter.forecast` knows what filter, smoother and trajectory need of samples,
epochs and rows; these are counted here by the size of a file over the mean length of its first
lines. It serves to decide how many flights run side by side; `process` forecasts again from what it
has read.
"""

import os
import time
import warnings
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from ...base.ahead import compile_ahead
from ...base.beside import processors
from ...base.errors import InsgnssError, UsageError
from ...base.files import atomic_write, pick_attributes
from ...base.inputs import open_bytes
from ...base.output.staging import together
from ...base.wording import duration, relative
from ...flight.config.flight_file import Flight
from ...navigation.filter.forecast import forecast
from .gathering import SeasonFlight, gather, refuse_shared_outputs
from .page import PAGE_MARK, is_ours, page_html, season_document
from .pool import run_alone, run_side_by_side
from .request import SeasonRequest
from .row import ROW_COLUMNS, Row, with_own_names
from .tables import SEASON_HEAD, csv_text, parquet_bytes, refuse_without_parquet
from .trends import SeasonTrend, trends
from .work import FAILED, JOB_DONE, JOB_KEPT, WAITING, Outcome, Task, Tell, not_reached

PROGRAM_BYTES = 400e6  # interpreter, libraries, kernels: a run of eight minutes takes 315 MB in all
READ_BYTES = 150.0  # of a sample while its text is read and its increments are formed
PAGE_BYTES = 0.15e9  # diagnostics and charts of a page
USUAL_STATES, TRIPLES = 34, 1  # of a NavChip with the constants of its fixes
PROBE = 65_536  # bytes that the length of a line is measured by
BINARY_ROW = 56  # bytes of a row of seven doubles
USUAL_IMU_HZ = 200.0  # rate of an IMU, where it has to be guessed for a forecast (chosen)
USUAL_EVENTS = 2_000  # exposures of a flight, where the file does not show them (chosen)


def rows_of(file: object) -> int:
    """Return about how many rows a file has; 0 for what is no file.

    Parameters
    ----------
    file : object
        A path, or what a flight has in its place.
    """
    if not isinstance(file, Path) or not file.is_file():
        return 0
    size_bytes = file.stat().st_size
    with open_bytes(file) as stream:
        beginning = stream.read(PROBE)
    if b"\0" in beginning:
        return size_bytes // BINARY_ROW
    lines = beginning.count(b"\n")
    return int(size_bytes * lines / len(beginning)) if lines else 0


def forecast_bytes(flight: Flight) -> float:
    """Return the bytes that a flight will need at most, program and libraries among them.

    Parameters
    ----------
    flight : Flight
        The flight file.
    """
    samples = sum(rows_of(imu.file) for imu in (flight.imu, *flight.imu.further))
    fixes = rows_of(flight.gnss.file)
    if not fixes and samples:  # raw observations, a stationary sensor
        fixes = int(samples / USUAL_IMU_HZ * 10.0)
    events = rows_of(flight.camera.events) if flight.camera is not None else 0
    events = min(events or USUAL_EVENTS, fixes or USUAL_EVENTS)
    hz = flight.output.trajectory_hz
    rows = samples if hz is None else min(samples, int(samples / USUAL_IMU_HZ * hz) or samples)
    needed = forecast(samples, fixes + events, USUAL_STATES, TRIPLES, events, rows)
    return PROGRAM_BYTES + PAGE_BYTES + needed.total + READ_BYTES * samples


SEASON_TABLE, SEASON_PAGE, PARQUET = "season.csv", "index.html", "season.parquet"
MIXED_CODE = 4  # exit code where flights failed of different kinds


@dataclass(frozen=True)
class SeasonResult:
    """What became of a season.

    Parameters
    ----------
    rows : tuple of dict
        Rows of the table, paths relative to it.
    outcomes : tuple of Outcome
        Of the flights.
    trends : tuple of SeasonTrend
        Of the equipments.
    files : tuple of Path
        Table and page.
    seconds : float
        What it took.
    """

    rows: tuple[Row, ...]
    outcomes: tuple[Outcome, ...]
    trends: tuple[SeasonTrend, ...]
    files: tuple[Path, ...]
    seconds: float

    @property
    def headline(self) -> str:
        """The result in one sentence, without full stop."""
        return headline(self.outcomes)

    @property
    def exit_code(self) -> int:
        """Zero where every flight has a result; else the code of the failures, 4 of several."""
        codes = {outcome.exit_code for outcome in self.outcomes if outcome.status == FAILED}
        return 0 if not codes else codes.pop() if len(codes) == 1 else MIXED_CODE

    def summary(self) -> str:
        """Return the text for the terminal."""
        headline_text = f"{self.headline}, in {duration(self.seconds)}"
        return season_document(self.rows, self.trends, headline_text, files=self.files).text()

    def as_dict(self) -> dict[str, Any]:
        """Return the document for machines."""
        return {
            **pick_attributes(self, "headline", "exit_code", "seconds"),
            "flights": list(self.rows),
            "trends": [
                {
                    **pick_attributes(t, "equipment", "finding"),
                    "constant": str(t.quantity.state),
                    "unit": t.quantity.unit,
                    "flights": int(t.days.size),
                    "per_day": t.slope,
                    "per_day_sigma": t.slope_sigma,
                    "chi_square_per_dof": t.chi_square,
                    "text": t.sentence(),
                }
                for t in self.trends
            ],
            "files": [str(file) for file in self.files],
        }


def headline(outcomes: Sequence[Outcome]) -> str:
    """Return how many flights have results, without full stop.

    Parameters
    ----------
    outcomes : sequence of Outcome
        Of all flights.
    """
    count = {
        s: sum(one.status == s for one in outcomes) for s in (JOB_DONE, JOB_KEPT, FAILED, WAITING)
    }
    images = sum(int(one.row.get("images") or 0) for one in outcomes)
    parts = [f"{count[JOB_DONE]} processed"]
    if count[JOB_KEPT]:
        parts.append(f"{count[JOB_KEPT]} kept, with unchanged inputs, options and version")
    if count[FAILED]:
        parts.append(f"{count[FAILED]} failed")
    if count[WAITING]:
        parts.append(f"{count[WAITING]} not reached")
    return f"{len(outcomes)} flights: {', '.join(parts)}; {images} images"


def line_of(outcome: Outcome) -> str:
    """Return the line of a flight: name, status, images, median sigmas, what limits, seconds.

    Parameters
    ----------
    outcome : Outcome
        What became of it.
    """
    row = outcome.row
    seconds = f"{row.get('seconds') or 0.0:.1f} s"
    if outcome.status == FAILED:
        return f"{outcome.name}: failed: {outcome.reason} ({seconds})"
    sigmas = [row.get(f"sigma_{axis}_mm") for axis in "enu"]
    parts = [f"{row['images']} images"]
    if None not in sigmas:
        parts.append(f"{' / '.join(f'{s:.1f}' for s in sigmas)} mm (E, N, U)")
    if row.get("sigma_att_u_deg") is not None:
        parts.append(f"heading {row['sigma_att_u_deg']:.3f} deg")
    why = row.get("reason") or row.get("limits")
    parts.append(str(row["judgement"]) + (f": {why}" if why else ""))
    return f"{outcome.name}: {outcome.status}, {', '.join(parts)} ({seconds})"


def run_season(
    request: SeasonRequest, tell: Tell, progress: Callable[[int, int, int, float], None]
) -> SeasonResult:
    """Process the flights of a season, and write its table and its page.

    A run that is interrupted leaves both as well, of what is done by then.

    Parameters
    ----------
    request : SeasonRequest
        What is asked for.
    tell : callable
        Is given the outcome of each flight as it ends.
    progress : callable
        Is given the numbers of flights that are processed, that are done or kept or failed, and of
        all, and the seconds so far.

    Returns
    -------
    SeasonResult
        What became of the flights.

    Raises
    ------
    UsageError
        No flight, two with one output directory, a page of others is in the way, Dask is missing or
        a scheduler cannot be reached.
    InputError
        A table of flights is wrong.
    DataError
        The scheduler ended, or had no worker for minutes.
    """
    start = time.monotonic()
    if request.parquet:
        refuse_without_parquet()
    flights = gather(request.sources, request.out)
    _refuse_files_of_others(request)
    tasks = tasks_of(flights, request)
    ended: dict[str, Outcome] = {}

    def report(outcome: Outcome) -> None:
        ended[outcome.name] = outcome
        tell(outcome)

    def tick() -> None:
        worked = sum(outcome.status != JOB_KEPT for outcome in ended.values())
        progress(worked, len(ended), len(tasks), time.monotonic() - start)

    def so_far() -> SeasonResult:
        outcomes = [ended.get(task.name) or not_reached(task) for task in tasks]
        return _write_season(request, outcomes, time.monotonic() - start)

    tick()
    try:
        killed = _run(tasks, request, report, tick)
        run_alone(killed, report, tick)
    except (KeyboardInterrupt, InsgnssError):
        if ended:
            so_far()
        raise
    return so_far()


def _run(
    tasks: Sequence[Task], request: SeasonRequest, tell: Tell, tick: Callable[[], None]
) -> list[Task]:
    """Run flights side by side; return those whose workers died."""
    if request.scheduler is not None:
        from .scheduler import run_on_scheduler

        return run_on_scheduler(tasks, request.scheduler, tell, tick)
    compile_ahead()  # for all workers
    return run_side_by_side(tasks, request.workers or processors(), tell, tick)


def tasks_of(flights: Sequence[SeasonFlight], request: SeasonRequest) -> list[Task]:
    """Return a task for each flight, with the forecast of its memory.

    Parameters
    ----------
    flights : sequence of SeasonFlight
        The flights.
    request : SeasonRequest
        What is asked for.

    Raises
    ------
    UsageError
        Two flights have the same output directory.
    """
    from ...flight.config.load import load_flight

    tasks, outputs = [], []
    for flight in flights:
        needed = PROGRAM_BYTES
        out = "" if flight.out is None else str(flight.out)
        try:
            with warnings.catch_warnings(action="ignore"):  # its worker says them
                loaded = load_flight(flight.file)
            needed = forecast_bytes(loaded)
            outputs.append((flight.name, flight.out or loaded.output.directory))
        except (InsgnssError, OSError):  # its worker says why
            pass
        tasks.append(Task(flight.name, str(flight.file), out, request.again, request.force, needed))
    refuse_shared_outputs(outputs)
    return tasks


def _refuse_files_of_others(request: SeasonRequest) -> None:
    """Raise UsageError where index.html or season.csv are there and no season's."""
    for name, mark in {SEASON_PAGE: PAGE_MARK, SEASON_TABLE: SEASON_HEAD[:16]}.items():
        path = request.directory / name
        if not request.force and path.exists() and not is_ours(path, mark):
            raise UsageError(
                f"batch: {path} exists and was not written by insgnss batch; give another"
                " directory with --out, or --force to overwrite it"
            )


def _write_season(
    request: SeasonRequest, outcomes: Sequence[Outcome], seconds: float
) -> SeasonResult:
    """Write table and page; return the result."""
    directory = request.directory
    rows = tuple(_relative(row, directory) for row in with_own_names([o.row for o in outcomes]))
    found_trends = tuple(trends(rows))
    settings = {"flights": " ".join(request.sources)}
    settings |= {"scheduler": request.scheduler} if request.scheduler else {}
    document = season_document(rows, found_trends, headline(outcomes), settings)
    files = [directory / SEASON_TABLE, directory / SEASON_PAGE]
    with together() as staging:
        into = staging.tree(directory)
        atomic_write(into / SEASON_TABLE, csv_text(rows))
        atomic_write(into / SEASON_PAGE, page_html(document))
        if request.parquet:
            atomic_write(into / PARQUET, parquet_bytes(rows))
            files.append(directory / PARQUET)
    return SeasonResult(rows, tuple(outcomes), found_trends, tuple(files), seconds)


def _relative(row: Row, directory: Path) -> Row:
    """Return a row whose paths are relative to the table, as far as they are on its drive."""
    out: Row = {column: row.get(column) for column in ROW_COLUMNS}
    if out["reason"]:
        out["reason"] = str(out["reason"]).replace(f"{directory.resolve()}{os.sep}", "")
    for column in ("flight", "report"):
        if out[column]:
            out[column] = Path(relative(str(out[column]), directory)).as_posix()
    return out
