"""Dask as the engine of a season: a cluster of this machine, or a scheduler that is there.

Each flight is one task. A worker runs one at a time; what runs side by side is limited by
processors and by memory. Dask starts a flight again whose worker died, on another worker, and
gives it up after `RETRIES` more deaths; it then runs once more alone, on this machine with all the
memory that there is.
"""

import logging
import os
import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

from .. import __version__
from ..base.errors import DataError, UsageError
from ..base.memory import available
from ..base.wording import DOCTOR
from .deaths import Watch
from .work import INTERNAL, Outcome, Task, failed, process_task

if TYPE_CHECKING:
    from distributed import Client, Future

MISSING = f"needs Dask, which is not installed: pip install 'insgnss[batch]'; {DOCTOR}"
RETRIES = 2  # times that a flight is started again because its worker died
REACH_S = 10.0  # until a scheduler that does not answer counts as not there
WORKER_WAIT_S = 30.0  # for a first worker
ALONE_S = 300.0  # without any worker until a season is given up
POLL_S = 0.1
RESOURCE = "MEMORY"  # bytes; of workers that declare it, as `dask worker --resources MEMORY=8e9`
USABLE = 0.9  # of the memory that is available
SCHEDULER = "scheduler"  # limits what runs on workers that are not of this run
CONFIGURATION = {
    "distributed.scheduler.allowed-failures": RETRIES,
    # a flight that waits in a worker's queue would count as one that its worker died of
    "distributed.scheduler.worker-saturation": 1.0,
    "distributed.comm.timeouts.connect": "10s",
    # results are rows; what a flight takes cannot be spilled, and is limited beforehand
    "distributed.worker.memory.target": False,
    "distributed.worker.memory.spill": False,
    "distributed.worker.memory.pause": False,
    "distributed.worker.memory.terminate": 0.95,
    "distributed.diagnostics.nvml": False,
}
QUIET = {"DASK_LOGGING__DISTRIBUTED": "critical"}  # what becomes of a flight is said by its line
Tell = Callable[[Outcome], None]


@dataclass(frozen=True)
class Workers:
    """What the flights of a season run on.

    Parameters
    ----------
    count : int
        Processes, of one thread each.
    memory_bytes : float
        What each may take; 0 where it is not known.
    limited_by : str
        "processors", "flights", "memory" or `SCHEDULER`.
    """

    count: int
    memory_bytes: float
    limited_by: str

    @property
    def alone(self) -> "Workers":
        """One worker with the memory of all of them."""
        return Workers(1, self.count * self.memory_bytes, self.limited_by)


def local_workers(tasks: Sequence[Task], wanted: int | None, room: int | None = None) -> Workers:
    """Return how many workers this machine holds.

    Parameters
    ----------
    tasks : sequence of Task
        The flights, with their forecasts.
    wanted : int or None
        What was asked for; None: one for each processor that this process may use.
    room : int or None
        Memory, bytes; None: what is available.

    Returns
    -------
    Workers
        As many as processors, flights and the largest forecast allow, one at least.
    """
    room = available() if room is None else room
    usable = getattr(os, "sched_getaffinity", None)
    processors = len(usable(0)) if usable else os.cpu_count() or 1
    limits = {"processors": wanted or processors, "flights": len(tasks)}
    largest = max((task.forecast_bytes for task in tasks), default=0.0)
    if room is not None and largest > 0.0:
        limits["memory"] = int(USABLE * room / largest)
    limited_by = min(limits, key=lambda name: limits[name])
    count = max(limits[limited_by], 1)
    return Workers(count, 0.0 if room is None else room / count, limited_by)


def portions(
    tasks: Sequence[Task], wanted: int | None, room: int | None = None
) -> list[tuple[Sequence[Task], Workers]]:
    """Divide flights into those that may run side by side on all processors, and larger ones.

    A single long flight would else have all others wait in one line.

    Parameters
    ----------
    tasks, wanted, room
        As of `local_workers`.

    Returns
    -------
    list of (sequence of Task, Workers)
        What runs one after the other, and on how many workers; none without flights.
    """
    room = available() if room is None else room
    whole = local_workers(tasks, wanted, room)
    if whole.limited_by != "memory" or room is None:
        return [(tasks, whole)]
    most = (
        USABLE * room / local_workers([replace(t, forecast_bytes=0.0) for t in tasks], wanted).count
    )
    small = [task for task in tasks if task.forecast_bytes <= most]
    large = [task for task in tasks if task.forecast_bytes > most]
    return [(some, local_workers(some, wanted, room)) for some in (small, large) if some]


@contextmanager
def cluster(workers: Workers, scheduler: str | None) -> Iterator["Client"]:
    """Give a client of a cluster of this machine, which ends with the block, or of a scheduler.

    Parameters
    ----------
    workers : Workers
        Of the cluster of this machine.
    scheduler : str or None
        Address of one that is there, such as tcp://10.0.0.5:8786.

    Raises
    ------
    UsageError
        Dask is not installed; the scheduler does not answer, has no workers, or workers of another
        version of insgnss or of several threads.
    """
    try:
        import dask
        from distributed import Client, LocalCluster
    except ImportError:
        raise UsageError(f"batch {MISSING}") from None
    with ExitStack() as stack:
        stack.enter_context(dask.config.set(CONFIGURATION))
        environment = "distributed.nanny.pre-spawn-environ"
        spawned = dask.config.get(environment, {}) | QUIET
        stack.enter_context(dask.config.set({environment: spawned}))
        stack.callback(logging.disable, logging.root.manager.disable)
        logging.disable(logging.CRITICAL)
        address: Any = scheduler
        if scheduler is None:
            address = stack.enter_context(
                LocalCluster(
                    n_workers=workers.count,
                    threads_per_worker=1,
                    processes=True,
                    dashboard_address="127.0.0.1:0",  # not 8787, which others may have
                    memory_limit=int(workers.memory_bytes) or None,
                    host="127.0.0.1",
                )
            )
        try:
            client = stack.enter_context(Client(address, timeout=REACH_S))
        except (OSError, TimeoutError, ValueError) as error:
            reason = " ".join(str(error).split())[:200] or "no answer"
            raise UsageError(
                f"--scheduler {scheduler}: not reached within {REACH_S:.0f} s ({reason}); start it"
                " with `dask scheduler`, or leave --scheduler out for a cluster of this machine"
            ) from None
        if scheduler is not None:
            _refuse_workers(client, scheduler)
        yield client


def _refuse_workers(client: "Client", scheduler: str) -> None:
    """Raise UsageError where a scheduler has no workers, or workers that are not fit for flights.

    They need this insgnss, and one thread each.
    """
    try:
        client.wait_for_workers(1, timeout=WORKER_WAIT_S)
    except TimeoutError:
        raise UsageError(
            f"--scheduler {scheduler}: has no worker ({WORKER_WAIT_S:.0f} s waited); start some"
            f" with `dask worker {scheduler} --nthreads 1`"
        ) from None
    try:
        versions = client.run(_version)
    except Exception as error:
        raise UsageError(
            f"--scheduler {scheduler}: a worker cannot load insgnss ({error}); install it there"
        ) from None
    odd = {address: v for address, v in versions.items() if v != __version__}
    if odd:
        address, version = next(iter(odd.items()))
        raise UsageError(
            f"--scheduler {scheduler}: worker {address} has insgnss {version}, here it is"
            f" {__version__}; install the same"
        )
    infos = client.scheduler_info(n_workers=-1)["workers"]
    threads = {address: int(info["nthreads"]) for address, info in infos.items()}
    if (most := max(threads.values(), default=1)) > 1:
        address = max(threads, key=lambda one: threads[one])
        raise UsageError(
            f"--scheduler {scheduler}: worker {address} has {most} threads, 1 is right: flights in"
            f" one process would share its warnings and its death; start `dask worker {scheduler}"
            f" --nthreads 1 --nworkers {most}`"
        )


def _version() -> str:
    return __version__


def run_tasks(
    client: "Client", tasks: Sequence[Task], tell: Tell, tick: Callable[[int], None]
) -> list[Task]:
    """Run flights side by side, and tell what became of each.

    Parameters
    ----------
    client : Client
        Of the cluster.
    tasks : sequence of Task
        The flights.
    tell : callable
        Is given each outcome as it comes.
    tick : callable
        Is given the number of flights that are left, several times a second.

    Returns
    -------
    list of Task
        Flights whose workers died, or whose result they took along, of which nothing was told: what
        waited in the queue of a worker that another flight took down is not to be blamed for it.

    Raises
    ------
    DataError
        No worker was there for minutes; flights that are done stay.
    """
    killed: list[Task] = []
    for task, outcome in _arriving(client, tasks, tick):
        if outcome is None:
            killed.append(task)
        else:
            tell(outcome)
    return killed


def run_alone(
    client: "Client",
    task: Task,
    workers: Workers,
    tell: Tell,
    tick: Callable[[int], None],
) -> None:
    """Run a flight whose workers died once more, alone, and tell what became of it.

    Parameters
    ----------
    client : Client
        Of the cluster.
    task : Task
        The flight.
    workers : Workers
        What it runs on.
    tell, tick : callable
        As of `run_tasks`.

    Raises
    ------
    DataError
        No worker was there for minutes.
    """
    start = time.monotonic()
    watch = Watch(client, here=workers.limited_by != SCHEDULER)

    def look(left: int) -> None:
        watch.look()
        tick(left)

    deaths = f"{RETRIES + 1} times beside other flights and as often alone"
    for _, outcome in _arriving(client, [task], look):
        if outcome is None:
            outcome = watch.outcome(task, deaths, time.monotonic() - start)
        tell(outcome)


def _arriving(
    client: "Client", tasks: Sequence[Task], tick: Callable[[int], None]
) -> Iterator[tuple[Task, Outcome | None]]:
    """Yield flights as they end, with None where their workers died."""
    from distributed import as_completed

    declared = _declared(client)
    start = time.monotonic()
    futures: dict[Future, Task] = {}
    for number, task in enumerate(tasks):
        need = {RESOURCE: min(task.forecast_bytes, declared)} if declared else {}
        future = client.submit(
            process_task, task, key=f"flight-{number}-{start}", pure=False, resources=need or None
        )
        futures[future] = task
    arriving = as_completed(list(futures))
    seen = time.monotonic()
    while arriving.count():
        if not arriving.has_ready():
            tick(arriving.count())
            now = time.monotonic()
            seen = now if client.scheduler_info(n_workers=1)["workers"] else seen
            if now - seen > ALONE_S:
                raise DataError(
                    f"no worker for {ALONE_S:.0f} s, {arriving.count()} flights are left; start"
                    " workers and run the same command again: what is done stays"
                )
            time.sleep(POLL_S)
            continue
        for future in arriving.next_batch(block=False):
            yield futures[future], _outcome(future, futures[future], time.monotonic() - start)
            future.release()


def _declared(client: "Client") -> float:
    """Return the memory that every worker declares at least; 0 where one does not."""
    infos = client.scheduler_info(n_workers=-1)["workers"].values()
    return min((float(info["resources"].get(RESOURCE, 0.0)) for info in infos), default=0.0)


def _outcome(future: "Future", task: Task, seconds: float) -> Outcome | None:
    """Return what became of a flight; None where the workers died that ran it.

    A worker that another flight takes down takes the results along that it has not yet handed
    over; Dask then calls them lost.
    """
    from distributed.scheduler import KilledWorker

    if future.status == "finished":
        outcome: Outcome = future.result()
        return outcome
    error = future.exception() if future.status == "error" else None
    if isinstance(error, KilledWorker) or future.status == "lost":
        return None
    return failed(task, f"ended by Dask: {future.status}: {error}", INTERNAL, seconds)
