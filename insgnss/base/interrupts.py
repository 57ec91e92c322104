"""Signals that end a run: SIGTERM and SIGHUP end it like SIGINT, and none within final moves."""

import signal
import threading
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from types import FrameType
from typing import Any

ENDING = tuple(
    getattr(signal, name) for name in ("SIGINT", "SIGTERM", "SIGHUP") if hasattr(signal, name)
)
"""Those of this system; SIGKILL cannot be caught."""
BY_SIGNAL = 128  # added to a signal's number: the exit code that shells give it


class Terminated(KeyboardInterrupt):
    """A signal that asks the process to end, raised where SIGINT would raise KeyboardInterrupt.

    Parameters
    ----------
    number : int
        The signal.
    """

    def __init__(self, number: int) -> None:
        super().__init__(number)
        self.exit_code = BY_SIGNAL + number


def raise_on_termination() -> None:
    """Let SIGTERM and SIGHUP raise `Terminated`, so that a run cleans up; ignored ones stay so."""
    for number in ENDING:
        if number != signal.SIGINT and signal.getsignal(number) == signal.SIG_DFL:
            signal.signal(number, _terminate)


def ignore_endings() -> None:
    """Let signals pass without effect once everything is done and the interpreter ends."""
    for number in ENDING:
        signal.signal(number, signal.SIG_IGN)


def _terminate(number: int, frame: FrameType | None) -> None:
    raise Terminated(number)


@contextmanager
def defer_signals() -> Iterator[None]:
    """Hold signals that end a run back until the block is over; their own handlers run then.

    In another thread than the main one nothing is held back: Python runs no handler there.
    """
    if threading.current_thread() is not threading.main_thread():
        yield
        return
    received: list[int] = []
    handlers: dict[int, Any] = {}
    try:
        for number in ENDING:
            handler = signal.getsignal(number)
            if handler not in (None, signal.SIG_IGN):  # None: not of Python
                handlers[number] = handler
                signal.signal(number, lambda number, frame: received.append(number))
        yield
    finally:
        for number, handler in handlers.items():
            with suppress(ValueError):  # the interpreter ends
                signal.signal(number, handler)
        for number in dict.fromkeys(received):
            signal.raise_signal(number)
