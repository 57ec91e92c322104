"""Flights side by side on this machine: worker processes of the standard library.

A worker is a process that is given one flight at a time through a pipe; no port is opened. A flight
starts where a processor is free and the memory holds its forecast beside those that run; larger
ones follow. A worker that dies costs its own flight alone, which runs once more by itself when the
others are done, with all the memory, and only then counts as failed.
"""

import multiprocessing
import os
import signal
import time
from collections.abc import Callable, Sequence
from contextlib import suppress
from multiprocessing.connection import Connection, wait

from ...base.errors import DataError
from ...base.interrupts import defer_signals, ignore_endings, raise_on_termination
from ...base.memory import GB, available, kills, resident
from .work import Outcome, Task, Tell, failed_outcome, process_task

USABLE = 0.9  # of the available memory, for forecasts: they are some tenths above what is taken
# of it, for all workers; beyond, the kernel would soon end any process of the machine
MOST_MEMORY = 0.95
WORKER_POLL_S = 0.1  # between looks at the workers: one that reads fills some 0.1 GB meanwhile
END_S = 5.0  # for a worker to remove what is half written, before it is killed
ONE_THREAD = dict.fromkeys(("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"), "1")
TRY = (
    "process the flight in parts (start_tow, end_tow), lower the trajectory rate "
    "output.trajectory_hz, or take a machine with more memory"
)


def run_side_by_side(
    tasks: Sequence[Task], count: int, tell: Tell, tick: Callable[[], None]
) -> list[Task]:
    """Run flights in worker processes, and tell what became of each.

    Parameters
    ----------
    tasks : sequence of Task
        The flights, with their forecasts.
    count : int
        Most workers.
    tell : callable
        Is given each outcome as it comes.
    tick : callable
        Is called several times a second.

    Returns
    -------
    list of Task
        Flights whose workers died, of which nothing was told.
    """
    died: list[Task] = []
    _run(tasks, count, available(), tell, tick, lambda worker: died.append(worker.task))
    return died


def run_alone(tasks: Sequence[Task], tell: Tell, tick: Callable[[], None]) -> None:
    """Run flights whose workers died once more, one at a time, and tell what became of each.

    Parameters
    ----------
    tasks : sequence of Task
        The flights.
    tell, tick : callable
        As of `run_side_by_side`.
    """
    room = available()
    for task in tasks:
        _run([task], 1, room, tell, tick, lambda worker: tell(worker.verdict(room)))


def next_flight(
    waiting: Sequence[Task], running: Sequence[Task], room: float | None
) -> Task | None:
    """Return the first flight whose forecast the memory holds beside those that run.

    Parameters
    ----------
    waiting, running : sequence of Task
        The flights.
    room : float or None
        Memory for all of them, bytes; None where it is not known.

    Returns
    -------
    Task or None
        Any where none runs: one that is larger than the memory has to be tried.
    """
    if not running or room is None:
        return next(iter(waiting), None)
    free = USABLE * room - sum(task.forecast_bytes for task in running)
    return next((task for task in waiting if task.forecast_bytes <= free), None)


class _Worker:
    """A process for one flight at a time, and what is seen of it."""

    task: Task

    def __init__(self) -> None:
        context = multiprocessing.get_context("spawn")  # threads of this process are not copied
        self.pipe, end = context.Pipe()
        self.process = context.Process(target=_work, args=(end,), daemon=True)
        # Ctrl-C reaches all processes of a terminal: workers inherit that they ignore it, and are
        # ended by this one
        handler = signal.signal(signal.SIGINT, signal.SIG_IGN)
        try:
            self.process.start()
        finally:
            signal.signal(signal.SIGINT, handler)
            end.close()

    def give(self, task: Task) -> None:
        """Have it process a flight."""
        self.task, self._since, self._kills = task, time.monotonic(), kills()
        self.resident = self._most = self._ended = 0
        with suppress(OSError):  # it is dead, which reading from it shows
            self.pipe.send(task)

    def look(self) -> int:
        """Return the memory that it takes now, bytes."""
        self.resident = resident(self.process.pid or 0)
        self._most = max(self._most, self.resident)
        return self.resident

    def end_for_memory(self) -> None:
        """Kill it because of what it takes."""
        self._ended = self.resident
        self.process.kill()

    def verdict(self, room: float | None) -> Outcome:
        """Return the outcome of the flight that it died of while it ran alone."""
        self.process.join()
        forecast = f"memory forecast {self.task.forecast_bytes / GB:.1f} GB"
        if self._ended and room:
            reason = (
                f"memory: the process of this flight was stopped at {self._ended / GB:.2f} GB; it "
                f"ran alone with a limit of {room / GB:.2f} GB ({forecast}); {TRY}"
            )
        elif kills() > self._kills:
            had = f" (it had {self._most / GB:.2f} GB when last seen)" if self._most else ""
            limit = f", {room / GB:.2f} GB being allowed" if room else ""
            reason = (
                "memory: the system ended the process of this flight for lack of "
                f"memory{had}{limit}; it ran alone ({forecast}); {TRY}"
            )
        else:
            reason = (
                "the process of this flight died again when it ran alone, "
                f"{_exit_reason(self.process)}, and the system reports no lack of memory "
                f"({forecast}, {self._most / GB:.1f} GB when last seen). It was ended from "
                f"outside, or compiled code crashed; insgnss process {self.task.file} shows which"
            )
        return failed_outcome(
            self.task, reason, DataError.exit_code, time.monotonic() - self._since
        )


def _run(
    tasks: Sequence[Task],
    count: int,
    room: float | None,
    tell: Tell,
    tick: Callable[[], None],
    died: Callable[[_Worker], None],
) -> None:
    """Run flights; give their outcomes to `tell`, workers that died of one to `died`."""
    for name, value in ONE_THREAD.items():  # flights side by side need no threads of BLAS
        os.environ.setdefault(name, value)
    waiting = list(tasks)
    busy: list[_Worker] = []
    idle: list[_Worker] = []
    try:
        while waiting or busy:
            while len(busy) < count and (
                task := next_flight(waiting, [worker.task for worker in busy], room)
            ):
                waiting.remove(task)
                busy.append(idle.pop() if idle else _Worker())
                busy[-1].give(task)
            tick()
            wait([worker.pipe for worker in busy], WORKER_POLL_S)
            total = sum([worker.look() for worker in busy + idle])
            if room is not None and total > MOST_MEMORY * room:
                beyond = [worker.resident - worker.task.forecast_bytes for worker in busy]
                busy[beyond.index(max(beyond))].end_for_memory()
            for worker in [worker_ready for worker_ready in busy if worker_ready.pipe.poll()]:
                busy.remove(worker)
                try:
                    outcome: Outcome = worker.pipe.recv()
                except (EOFError, OSError):
                    died(worker)
                else:
                    idle.append(worker)
                    tell(outcome)
    finally:
        _end(busy + idle)


def _end(workers: Sequence[_Worker]) -> None:
    """End workers; they remove what they have half written."""
    with defer_signals():
        for worker in workers:
            worker.process.terminate()
        end = time.monotonic() + END_S
        for worker in workers:
            worker.process.join(max(end - time.monotonic(), 0.0))
            worker.process.kill()
            worker.process.join()


def _work(pipe: Connection) -> None:
    """Process the flights that come through a pipe until its other end is closed."""
    try:
        raise_on_termination()
        while True:
            pipe.send(process_task(pipe.recv()))
    except (KeyboardInterrupt, EOFError, OSError):  # the run has ended
        ignore_endings()


def _exit_reason(process: multiprocessing.process.BaseProcess) -> str:
    """Return by what a process has ended."""
    code = process.exitcode or 0
    with suppress(ValueError):
        return f"by {signal.Signals(-code).name}"
    return f"with exit code {code}"
