"""In which other way a file would fit: axes exchanged, millimetres, rows shifted by one.

Only what does not fit as it stands is tried, and a way is named only where it fits five times
better and as well as data of that kind do. It is named, never taken.
"""

from collections.abc import Callable, Mapping, Sequence

import numpy as np

from ..base.errors import InsgnssError
from ..records import Array

BETTER = 5.0  # times, of a misfit
ALIKE = 1.2  # times the best: of a level flight, two axes exchanged are one mirrored and turned
Misfit = Callable[[Array], float]


def position_readings(position: Array) -> Mapping[str, Array]:
    """Return positions as other files would have them.

    Parameters
    ----------
    position : ndarray, (n, 3)
        Positions as they stand.

    Returns
    -------
    mapping of str to ndarray
        By what was done to the file, as a clause about it.
    """
    x, y, z = np.eye(3)
    flips = {
        "its x and y are exchanged": np.array([y, x, z]),
        "its y and z are exchanged": np.array([x, z, y]),
        "its x and z are exchanged": np.array([z, y, x]),
        "its x has the opposite sign": np.array([-x, y, z]),
        "its y has the opposite sign": np.array([x, -y, z]),
        "its z has the opposite sign": np.array([x, y, -z]),
    }
    out = {words: position @ turn.T for words, turn in flips.items()}
    out["it is in millimetres"] = 1e-3 * position
    out["it is in centimetres"] = 1e-2 * position
    out["it is in feet"] = 0.3048 * position
    if len(position) > 2:
        out["its rows stand one too late"] = np.roll(position, -1, axis=0)
        out["its rows stand one too early"] = np.roll(position, 1, axis=0)
    return out


def named_reading(
    as_it_is: float, readings: Mapping[str, Array], misfit: Misfit, good: float
) -> str:
    """Return the reading that fits best, in words.

    Parameters
    ----------
    as_it_is : float
        The misfit of the file as it stands.
    readings : mapping of str to ndarray
        Of `position_readings`, or of another kind.
    misfit : callable
        Misfit of one; errors of the package count as none.
    good : float
        Misfit above which nothing is named.

    Returns
    -------
    str
        Clauses that fit alike; empty where none fits.
    """
    sizes: dict[str, float] = {}
    for words, value in readings.items():
        try:
            sizes[words] = misfit(value)
        except (InsgnssError, np.linalg.LinAlgError):
            continue
    if not sizes:
        return ""
    best = min(sizes.values())
    if best * BETTER >= as_it_is or best > good:
        return ""
    return ", or ".join(words for words, size in sizes.items() if size <= ALIKE * best)


def advice(words: Sequence[str]) -> str:
    """Return clauses as an explanation, empty without one.

    Parameters
    ----------
    words : sequence of str
        Clauses.

    Returns
    -------
    str
        Begins with a semicolon.
    """
    given = [clause for clause in words if clause]
    return f"; it fits where {' and '.join(given)}: correct that" if given else ""
