"""Why the worker of a flight died: the memory that it may have, the system's memory, or unknown.

Dask's nanny ends a worker that goes beyond its memory and logs it with the scheduler; the kernel
counts the processes that it ends for want of memory. Both are looked at while a flight runs alone.
"""

from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

from ..base.errors import DataError
from ..base.memory import kills
from .work import Outcome, Task, failed

if TYPE_CHECKING:
    from distributed import Client

BEYOND_MEMORY = "worker-restart-memory"  # topic of Dask's nannies
HERE = ""  # of the machine of this process
GB = 1e9
TRY = (
    "process parts of the flight with start_tow and end_tow, lower output.trajectory_hz, or take a"
    " machine with more memory"
)


class Watch:
    """What is seen of the workers of a flight while it runs alone.

    Parameters
    ----------
    client : Client
        Of the cluster.
    here : bool
        Whether the workers are processes of this machine.
    """

    def __init__(self, client: "Client", here: bool) -> None:
        self._client, self._here = client, here
        self._ended = len(client.get_events(BEYOND_MEMORY))
        self._kills = self._kernel_kills()
        self._workers: set[str] = set()
        self._most = self._limit = 0.0

    def look(self) -> None:
        """See which worker has the flight, and what it takes."""
        infos = self._client.scheduler_info(n_workers=-1)["workers"]
        for address, keys in self._client.processing().items():
            if keys:
                self._workers.add(address)
                info = infos.get(address, {})
                self._limit = float(info.get("memory_limit") or self._limit)
                self._most = max(self._most, float(info.get("metrics", {}).get("memory", 0.0)))

    def _kernel_kills(self) -> Mapping[str, int]:
        """Return the kernel's count of each machine."""
        if self._here:
            return {HERE: kills()}
        counts: dict[str, int] = {}
        for address, count in self._client.run(kills, on_error="ignore").items():
            machine = str(address).rpartition(":")[0]
            counts[machine] = max(counts.get(machine, 0), count)
        return counts

    def outcome(self, task: Task, deaths: str, seconds: float) -> Outcome:
        """Return the outcome of a flight that its workers died of.

        Parameters
        ----------
        task : Task
            The flight.
        deaths : str
            How often they died.
        seconds : float
            What it took.
        """
        events: list[Mapping[str, Any]] = [
            message for _, message in self._client.get_events(BEYOND_MEMORY)[self._ended :]
        ]
        own = [float(one["rss"]) for one in events if one["worker"] in self._workers]
        killed = any(n > self._kills.get(machine, n) for machine, n in self._kernel_kills().items())
        forecast = f"memory forecast {task.forecast_bytes / GB:.1f} GB"
        if own:
            limit = f" of the {self._limit / GB:.2f} GB that it may have" if self._limit else ""
            reason = (
                f"memory: its worker was ended at {max(own) / GB:.2f} GB{limit} when it runs alone"
                f" ({forecast}); {TRY}"
            )
        elif killed:
            had = f", which had {self._most / GB:.2f} GB when last seen" if self._most else ""
            limit = f", of {self._limit / GB:.2f} GB that it might have" if self._limit else ""
            reason = (
                f"memory: the system ended its worker for want of it{had}{limit}, when it ran alone"
                f" ({forecast}); {TRY}"
            )
        else:
            reason = (
                f"its worker died {deaths}, and neither Dask nor the system says that it was for"
                f" memory ({forecast}, {self._most / GB:.1f} GB when last seen): ended from"
                f" outside, or compiled code that crashed; insgnss process {task.file} shows it"
            )
        return failed(task, reason, DataError.exit_code, seconds)
