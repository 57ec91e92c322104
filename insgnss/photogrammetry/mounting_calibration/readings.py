"""In which other way a file would fit: axes exchanged, millimetres, rows shifted by one.

Only what does not fit as it stands is tried, and a way is named only where it fits five times
better and as well as data of that kind do. It is named, never taken.
"""

from collections.abc import Callable, Mapping, Sequence

import numpy as np

from ...base.errors import InsgnssError
from ...geodesy.rotation import CV_RUB, opk_from_rotation, rotation_from_opk
from ...records import Array

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


def attitude_readings(C: Array, opk: Array | None) -> Mapping[str, Array]:
    """Return attitudes as other files would have them.

    Parameters
    ----------
    C : ndarray, (n, 3, 3)
        Attitudes as they stand: camera (x right, y down) to the axes.
    opk : ndarray, (n, 3), or None
        Angles of a table as they stand there, taken for degrees, rad.

    Returns
    -------
    mapping of str to ndarray
        By what was done to the file, as a clause about it.
    """
    if opk is None:
        opk = opk_from_rotation(C @ CV_RUB)
    return {
        "its angles are radians": rotation_from_opk(np.degrees(opk)) @ CV_RUB,
        "its angles are gon": rotation_from_opk(0.9 * opk) @ CV_RUB,
        "its omega and kappa are exchanged": rotation_from_opk(opk[:, ::-1]) @ CV_RUB,
        "its omega and phi are exchanged": rotation_from_opk(opk[:, [1, 0, 2]]) @ CV_RUB,
        "its rotations take the axes into the camera": C.transpose(0, 2, 1),
        "its angles have the opposite signs": rotation_from_opk(-opk) @ CV_RUB,
        "its angles are those of the camera x right, y down": C @ CV_RUB,
    }


def named_reading(
    as_it_is: float,
    readings: Mapping[str, Array],
    misfit: Misfit,
    good: float,
    better: float = BETTER,
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
    better : float
        How many times better it must fit.

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
    if best * better >= as_it_is or best > good:
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
