"""How far a step has come: long loops say it here, and who shows a run listens.

A loop of any room runs `through` what it has to do; nothing is computed and nothing kept where
nobody listens. Steps themselves are announced by the callable `progress` that a run is given; the
share belongs to the step that was announced last. `insgnss.base.compilation` says
what a first run compiles.
"""

import logging
import math
import threading
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from functools import wraps
from typing import ParamSpec, TypeVar

Item = TypeVar("Item")
P = ParamSpec("P")
T = TypeVar("T")
Listener = Callable[[float], None]
MOST_SHARES = 1000  # reports of progress in a loop: quick items stay quick
LOGGER = logging.getLogger("insgnss")
"""Hears what a terminal would show, at level INFO; silent until a program sets it up."""
LOGGER.addHandler(logging.NullHandler())
_listeners: list[Listener] = []
_range = [(0.0, 1.0)]
"""What of the step the shares that are said are of: the last is that of the innermost part."""


def logged(step: str) -> None:
    """Log the name of a step: the progress of a run that is given no other."""
    LOGGER.info(step)


def heard(function: Callable[P, T]) -> Callable[P, T]:
    """Return the function, which logs the text of its result as a terminal would show it."""

    @wraps(function)
    def with_log(*args: P.args, **kwargs: P.kwargs) -> T:
        result = function(*args, **kwargs)
        if LOGGER.isEnabledFor(logging.INFO):
            for line in getattr(result, "summary", str)().splitlines():
                LOGGER.info(line)
        return result

    return with_log


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

    What runs beside it, in another thread, says nothing but that it compiles, which the main line
    may be waiting for.
    """
    if not _listeners or not (math.isnan(done) or _in_main_thread()):
        return
    begin, end = _range[-1]
    for listener in _listeners:
        listener(begin + (end - begin) * done)


def _in_main_thread() -> bool:
    return threading.current_thread() is threading.main_thread()


@contextmanager
def within(begin_share: float, end_share: float) -> Iterator[None]:
    """Have the shares that are said within mean a part of the step, or of the part around it.

    Parameters
    ----------
    begin_share, end_share : float
        What of it is done before and after, 0 to 1.
    """
    if not _in_main_thread():
        yield
        return
    outer_begin, outer_end = _range[-1]
    _range.append(
        (
            outer_begin + (outer_end - outer_begin) * begin_share,
            outer_begin + (outer_end - outer_begin) * end_share,
        )
    )
    try:
        share(0.0)
        yield
    finally:
        _range.pop()


def converged_share(step: float, longest: float, last: float) -> float:
    """Return the share of an iteration that is done, by the orders of magnitude of its steps.

    Parameters
    ----------
    step, longest, last : float
        Size of the latest step, of the longest so far, and of the one that ends it.

    Returns
    -------
    float
        0 to 1.
    """
    if not longest > last:
        return 1.0
    return min(max(math.log(longest / max(step, last)) / math.log(longest / last), 0.0), 1.0)


def through(items: Sequence[Item]) -> Iterator[Item]:
    """Yield the items of a step that cost about the same, and say how far it has come.

    Parameters
    ----------
    items : sequence
        What the step goes through.

    Yields
    ------
    Item
        Each item in its turn; the share before it is said first, of many items now and then.
    """
    every = len(items) // MOST_SHARES + 1
    for count, item in enumerate(items):
        if count % every == 0:
            share(count / len(items))
        yield item
