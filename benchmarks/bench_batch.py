"""`insgnss batch` against a shell loop of `insgnss process`, and how it grows to 10 000 flights.

    python benchmarks/bench_batch.py [--flights 24] [--repeats 3] [--minutes 1.2] [--tasks 10000]

The same flights are processed by a loop of commands, one after the other, and by `insgnss batch` on
two workers, in turn; wall time of both, start of the workers included, and the median of the
ratios of the pairs (bar: 1.8 on two processors). Then a large season is run of
tasks that do nothing but return a flight's row, on as many workers: microseconds that a task costs
beside its flight, and the memory of the run with all rows; trends, table and page of as many rows
follow.
"""

import argparse
import resource
import shutil
import statistics
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable
from pathlib import Path

from insgnss.batch.season import pool
from insgnss.batch.season.page import page_html, season_document
from insgnss.batch.season.row import ROW_COLUMNS, Row
from insgnss.batch.season.tables import csv_text
from insgnss.batch.season.trends import trends
from insgnss.batch.season.work import Outcome, Task
from insgnss.simulation.dataset import write_dataset

COMMAND = [sys.executable, "-m", "insgnss"]
BAR = 1.8
PROCESSORS = 2
OUT = Path("02_Processed") / "GPS-INS"


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--flights", type=int, default=24)
    parser.add_argument("--repeats", type=int, default=3)
    parser.add_argument("--minutes", type=float, default=1.2)
    parser.add_argument("--tasks", type=int, default=10_000)
    options = parser.parse_args()
    with tempfile.TemporaryDirectory() as scratch:
        against_a_loop(Path(scratch), options.flights, options.minutes, options.repeats)
    growth(options.tasks)


def against_a_loop(root: Path, count: int, minutes: float, repeats: int) -> None:
    """Print wall times of both and the median of their ratios."""
    write_dataset(
        root / "f0", minutes=minutes, imu_rate=50.0, start_in_air=True, line_length_m=120.0
    )
    flights = [root / f"f{k}" for k in range(count)]
    for flight in flights[1:]:
        shutil.copytree(flights[0], flight)
    subprocess.run([*COMMAND, "process", "-q", str(flights[0])], check=True, capture_output=True)
    ratios, loops, batches = [], [], []
    for _ in range(repeats):
        loops.append(seconds(lambda: loop(flights)))
        batches.append(seconds(lambda: batch(root, flights)))
        ratios.append(loops[-1] / batches[-1])
        print(f"loop {loops[-1]:.1f} s, batch {batches[-1]:.1f} s, ratio {ratios[-1]:.2f}")
    print(
        f"{count} flights of {minutes} min, {PROCESSORS} workers: loop"
        f" {statistics.median(loops):.1f} s, batch {statistics.median(batches):.1f} s, median"
        f" ratio {statistics.median(ratios):.2f} (bar {BAR})"
    )


def seconds(action: Callable[[], None]) -> float:
    """Wall time of an action."""
    start = time.perf_counter()
    action()
    return time.perf_counter() - start


def loop(flights: list[Path]) -> None:
    """What one would write in a shell: for f in */; do insgnss process $f; done."""
    for flight in flights:
        shutil.rmtree(flight / OUT, ignore_errors=True)
        subprocess.run([*COMMAND, "process", "-q", str(flight)], check=True, capture_output=True)


def batch(root: Path, flights: list[Path]) -> None:
    """The same by `insgnss batch`."""
    for flight in flights:
        shutil.rmtree(flight / OUT, ignore_errors=True)
    words = ["batch", str(root), "--workers", str(PROCESSORS), "-q"]
    subprocess.run([*COMMAND, *words], check=True, capture_output=True)


def idle(task: Task) -> Outcome:
    """A flight of no time, with a row as a flight has one."""
    number = int(task.name)
    row: Row = dict.fromkeys(ROW_COLUMNS, 0.125)
    row |= {"name": task.name, "flight": task.file, "status": "done", "judgement": "good"}
    row |= {"equipment": f"wing{number % 5}", "report": "r.html", "limits": "", "reason": ""}
    row |= {"date_utc": f"2026-{1 + number % 12:02d}-{1 + number % 28:02d}T08:00:00Z"}
    return Outcome(task.name, "done", row)


pool.process_task = idle  # in workers, which import this file, as well


def growth(most: int) -> None:
    """Print what a task of a season costs beside its flight."""
    for count in (most // 100, most // 10, most):
        tasks = [Task(str(k), f"f{k}/flight.toml") for k in range(count)]
        start = time.perf_counter()
        outcomes: list[Outcome] = []
        pool.run_side_by_side(tasks, PROCESSORS, outcomes.append, lambda: None)
        taken = time.perf_counter() - start
        rows = [outcome.row for outcome in outcomes]
        start = time.perf_counter()
        table = sum(len(text) for text in csv_text(rows))
        page = sum(len(text) for text in page_html(season_document(rows, trends(rows), "h")))
        written = time.perf_counter() - start
        memory = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024
        print(
            f"{count} tasks: {taken:.1f} s, {1e6 * taken / count:.0f} us each; table"
            f" {table / 1e6:.1f} MB and page {page / 1e6:.1f} MB in {written:.1f} s; at most"
            f" {memory:.0f} MB"
        )


if __name__ == "__main__":
    main()
