"""How far a step has come: long loops say it here, and who shows a run listens.

A loop of any room runs `through` what it has to do; nothing is computed and nothing kept where
nobody listens. Steps themselves are announced by the callable `progress` that a run is given; the
share belongs to the step that was announced last. `insgnss.base.compilation` says
what a first run compiles.
"""

import threading
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from typing import TypeVar

Item = TypeVar("Item")
Listener = Callable[[float], None]
_listeners: list[Listener] = []


@contextmanager
def listening(listener: Listener) -> Iterator[None]:
    """Tell `listener` of the process how far steps have come, until the context ends.

    Parameters
    ----------
    listener : callable
        Called with the share of the step that is done, 0 to 1; NaN where something is compiled,
        whose length nobody knows.
    """
    _listeners.append(listener)
    try:
        yield
    finally:
        _listeners.remove(listener)


def share(done: float) -> None:
    """Say that the share `done` of the step that runs is done, 0 to 1; NaN: compiling.

    What runs beside it, in another thread, says nothing.
    """
    if threading.current_thread() is not threading.main_thread():
        return
    for listener in _listeners:
        listener(done)


def through(items: Sequence[Item]) -> Iterator[Item]:
    """Yield the items of a step that cost about the same, and say how far it has come.

    Parameters
    ----------
    items : sequence
        What the step goes through.

    Yields
    ------
    Item
        Each item in its turn; the share before it is said first.
    """
    for count, item in enumerate(items):
        share(count / len(items))
        yield item
