"""A season on the workers of a Dask scheduler that is there, of this machine or of others.

Each flight is one task. Dask starts a flight whose worker died again on another one, and gives it
up as the scheduler's `allowed-failures` says (3); `pool` then runs it alone on this machine.
"""

import logging
import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import ExitStack, contextmanager
from typing import TYPE_CHECKING

from ...base import __version__
from ...base.errors import DataError, UsageError, required_library
from ...base.wording import DOCTOR
from .pool import WORKER_POLL_S
from .work import INTERNAL, Outcome, Task, Tell, failed_outcome, process_task

if TYPE_CHECKING:
    from distributed import Client, Future

NEEDS_DASK = (
    "batch --scheduler needs Dask, which is not installed: pip install 'insgnss[batch]', or leave "
    f"--scheduler out to use this machine; {DOCTOR}"
)
REACHED_WITHIN_S = 10.0  # until a scheduler that does not answer counts as not there, or as lost
WORKER_WAIT_S = 30.0  # for a first worker
ALONE_S = 300.0  # without any worker until a season is given up
RESOURCE = "MEMORY"  # bytes; of workers that declare it, as `dask worker --resources MEMORY=8e9`
CONFIGURATION = {"distributed.comm.timeouts.connect": f"{REACHED_WITHIN_S:.0f}s"}


@contextmanager
def _client(scheduler: str) -> Iterator["Client"]:
    """Give a client of a scheduler whose workers are fit for flights.

    Raises
    ------
    UsageError
        Dask is not installed; the scheduler does not answer, has no workers, or workers of another
        version of insgnss or of several threads.
    """
    with required_library(NEEDS_DASK):
        import dask
        from distributed import Client
    with ExitStack() as stack:
        stack.enter_context(dask.config.set(CONFIGURATION))
        stack.callback(logging.disable, logging.root.manager.disable)
        logging.disable(logging.CRITICAL)  # what becomes of a flight is said by its line
        try:
            client = stack.enter_context(Client(scheduler, timeout=REACHED_WITHIN_S))
        except (OSError, TimeoutError, ValueError) as error:
            reason = " ".join(str(error).split())[:200] or "no answer"
            raise UsageError(
                f"--scheduler {scheduler}: not reached within {REACHED_WITHIN_S:.0f} s ({reason});"
                " start it with `dask scheduler`, or leave --scheduler out for processes of this"
                " machine"
            ) from None
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
            f"--scheduler {scheduler}: no worker came within {WORKER_WAIT_S:.0f} s; start workers "
            f"with `dask worker {scheduler} --nthreads 1`"
        ) from None
    try:
        versions = client.run(_version)
    except Exception as error:
        raise UsageError(
            f"--scheduler {scheduler}: a worker cannot load insgnss ({error}); install it there"
        ) from None
    differing = {
        address: remote_version
        for address, remote_version in versions.items()
        if remote_version != __version__
    }
    if differing:
        address, version = next(iter(differing.items()))
        raise UsageError(
            f"--scheduler {scheduler}: worker {address} has insgnss {version}, here it is"
            f" {__version__}; install the same version on both"
        )
    infos = client.scheduler_info(n_workers=-1)["workers"]
    threads = {address: int(info["nthreads"]) for address, info in infos.items()}
    if (largest := max(threads.values(), default=1)) > 1:
        address = max(threads, key=lambda worker: threads[worker])
        raise UsageError(
            f"--scheduler {scheduler}: worker {address} has {largest} threads, but must have 1, "
            "because flights in one process mix their warnings and crash together; start `dask "
            f"worker {scheduler} --nthreads 1 --nworkers {largest}`"
        )


def _version() -> str:
    return __version__


def run_on_scheduler(
    tasks: Sequence[Task], scheduler: str, tell: Tell, tick: Callable[[], None]
) -> list[Task]:
    """Run flights on the workers of a scheduler, and tell what became of each.

    Parameters
    ----------
    tasks : sequence of Task
        The flights.
    scheduler : str
        Its address, such as tcp://10.0.0.5:8786.
    tell : callable
        Is given each outcome as it comes.
    tick : callable
        Is called several times a second.

    Returns
    -------
    list of Task
        Flights whose workers died, or whose result they took along, of which nothing was told: what
        waited in the queue of a worker that another flight took down is not to be blamed for it.

    Raises
    ------
    UsageError
        Dask is not installed, or the scheduler and its workers cannot be used.
    DataError
        The scheduler ended, or no worker was there for minutes; flights that are done stay.
    """
    killed: list[Task] = []
    with _client(scheduler) as client:
        for task, outcome in _arriving(client, tasks, scheduler, tick):
            if outcome is None:
                killed.append(task)
            else:
                tell(outcome)
    return killed


def _arriving(
    client: "Client", tasks: Sequence[Task], scheduler: str, tick: Callable[[], None]
) -> Iterator[tuple[Task, Outcome | None]]:
    """Yield flights as they end, with None where their workers died."""
    from distributed import as_completed

    declared = _declared_memory(client)
    start = time.monotonic()
    futures: dict[Future, Task] = {}
    for number, task in enumerate(tasks):
        need = {RESOURCE: min(task.forecast_bytes, declared)} if declared else {}
        future = client.submit(
            process_task, task, key=f"flight-{number}-{start}", pure=False, resources=need or None
        )
        futures[future] = task
    arriving = as_completed(list(futures))
    last_seen = time.monotonic()
    while remaining := arriving.count():
        if not arriving.has_ready():
            tick()
            now = time.monotonic()
            last_seen = now if client.scheduler_info(n_workers=1)["workers"] else last_seen
            if now - last_seen > ALONE_S:
                raise DataError(
                    f"--scheduler {scheduler}: no worker for {ALONE_S:.0f} s, {remaining} flights "
                    "are not done; start workers and give the same command again, which keeps "
                    "finished flights"
                )
            time.sleep(WORKER_POLL_S)
            continue
        for future in arriving.next_batch(block=False):
            try:
                outcome = _outcome(future, futures[future], time.monotonic() - start)
                is_lost = future.status == "cancelled"  # as all are, once the connection is lost
            except OSError:  # lost while the result was fetched
                is_lost = True
            if is_lost:
                raise DataError(
                    f"--scheduler {scheduler}: the scheduler ended or cannot be reached, "
                    f"{remaining} of the flights are not done; start it and its workers and give "
                    "the same command again, which keeps finished flights"
                )
            yield futures[future], outcome
            future.release()


def _declared_memory(client: "Client") -> float:
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
    return failed_outcome(task, f"ended by Dask: {future.status}: {error}", INTERNAL, seconds)
