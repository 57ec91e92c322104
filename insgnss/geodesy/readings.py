"""In which other way a file would fit: axes exchanged, millimetres, rows shifted by one.

Only what does not fit as it stands is tried (`explain.py`). It is named, never
taken.
"""

from collections.abc import Callable, Iterable, Iterator, Sequence

import numpy as np
from numpy.typing import NDArray

from .conventions import (
    CAMERA_SETS,
    XYZ,
    Change,
    Convention,
    angles,
    exchanged_orders,
    lengths,
    reversed_signs,
)
from .explain import Candidate, Data, Explanation
from .rotation import CV_RUB

Array = NDArray[np.float64]

OPK = CAMERA_SETS["opk"]


def of_positions(units: bool = True, rows: bool = True) -> Iterator[Convention]:
    """Return how positions may have been written.

    Parameters
    ----------
    units, rows : bool
        Whether in other units than metres, and in rows of their neighbours.

    Returns
    -------
    iterator of Convention
        For positions (n, 3).
    """
    yield from (
        convention for convention in exchanged_orders(XYZ) if "exchanged" in convention.words
    )
    yield from reversed_signs(XYZ, most=1)
    if units:
        yield from lengths("coordinates")
    if rows:
        yield Convention("its rows one too late", lambda X: np.roll(X, -1, axis=0))
        yield Convention("its rows one too early", lambda X: np.roll(X, 1, axis=0))


def of_attitudes(
    opk: Array | None = None, units: Sequence[str] = ("degrees",)
) -> Iterator[Convention]:
    """Return how attitudes may have been written.

    Parameters
    ----------
    opk : ndarray, (n, 3), optional
        Angles of a table as they stand there, taken for degrees, rad.
    units : sequence of str
        As which they were read, where another unit is looked for.

    Returns
    -------
    iterator of Convention
        For attitudes (n, 3, 3): camera (x right, y down) to the axes.
    """

    def of_angles(change: Change) -> Change:
        return lambda C: change(OPK.take(C @ CV_RUB) if opk is None else opk) @ CV_RUB

    for convention in angles(OPK, CAMERA_SETS, units=units):
        yield Convention(convention.words, of_angles(convention.change))
    yield Convention("rotations that take the axes into the camera", lambda C: C.transpose(0, 2, 1))
    yield Convention("angles of the camera x right, y down", lambda C: C @ CV_RUB)


def suspected_readings(
    source: str, conventions: Iterable[Convention], read: Callable[[Data, Change], Data]
) -> Iterator[Candidate[Data]]:
    """Return candidates for a file.

    Parameters
    ----------
    source : str
        Its name.
    conventions : iterable of Convention
        That it may have.
    read : callable
        The data with a change of what is from the file.

    Returns
    -------
    iterator of Candidate
        With a clause as its statement.
    """

    def reading(change: Change) -> Callable[[Data], Data]:
        return lambda data: read(data, change)

    for convention in conventions:
        yield Candidate(f"{source} has {convention.words}", reading(convention.change))


def advice(explanation: Explanation[Data] | None) -> str:
    """Return an explanation as the end of a sentence, empty without one.

    Parameters
    ----------
    explanation : Explanation, optional
        Of candidates whose statements are clauses.

    Returns
    -------
    str
        Begins with a semicolon.
    """
    return "" if explanation is None else f"; the data fit if {explanation.clauses()}: correct this"
