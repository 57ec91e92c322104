"""Work beside the main line: in a thread of its own where there is a second processor.

Compiled functions that release Python's lock (`nogil`), hashes and files run at the same time as
what the main line does meanwhile. What a job returns depends on nothing but its arguments, so that
results are the same whichever ends first. The thread is waited for when the result is asked for,
and by the interpreter before it ends: a signal that ends a run waits for the kernel that runs, as
it does for those of the main line.
"""

import os
import threading
from collections.abc import Callable
from contextvars import copy_context
from typing import Generic, TypeVar

T = TypeVar("T")


def processors() -> int:
    """Return the number of processors that this process may use."""
    if hasattr(os, "sched_getaffinity"):
        return len(os.sched_getaffinity(0))
    return os.cpu_count() or 1


class Beside(Generic[T]):
    """A job that is done while its caller goes on, or on demand where there is one processor.

    Parameters
    ----------
    job : callable
        Called once, without arguments. What it changes nobody else reads or changes before
        `result`.
    """

    def __init__(self, job: Callable[[], T]) -> None:
        self._job = job
        self._outcome: list[T] = []
        self._failed: list[BaseException] = []
        self._thread: threading.Thread | None = None
        if processors() > 1:
            run = copy_context().run  # what the caller set holds there, too
            self._thread = threading.Thread(target=run, args=(self._run,))
            self._thread.start()

    def _run(self) -> None:
        try:
            self._outcome.append(self._job())
        except BaseException as error:
            self._failed.append(error)

    def result(self) -> T:
        """Return what the job returned, or raise what it raised, once it is done."""
        if self._thread is not None:
            self._thread.join()
        elif not (self._outcome or self._failed):
            self._run()
        if self._failed:
            raise self._failed[0]
        return self._outcome[0]
