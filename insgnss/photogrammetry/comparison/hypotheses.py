"""How a hypothesis is judged.

It is taken off b, and what remains of the differences says how much of them it explains.

Hypotheses are tried on at most `MOST` poses spread over all of them, and the one that is chosen is
taken off all. Of those that explain `ENOUGH` of the squares the one that leaves least is stated,
where each parameter that was fitted must pay for itself by a quarter of what is left and of what
the digits of files leave; others that leave hardly more with no more parameters are stated too.
"""

from collections.abc import Callable, Iterable
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from .poses import Poses
from .result import Aspect, Finding

Array = NDArray[np.float64]
Measure = Callable[[Poses, Poses], Array]

ENOUGH = 0.9  # share of the sum of squares
AS_GOOD = 1.3  # ratio of what two hypotheses leave, below which both are stated
SIMPLER = 1.25  # by which a hypothesis must leave less for each parameter more
MOST = 2000
LEAST_POSES = 5
NOTHING = 1e-9  # m or rad; below it all is left alike
DIGITS = {
    "m": 1e-4,
    "rad": 2e-8,
}  # rms that the printed digits of two files leave; less of it is no reason for another parameter


@dataclass(frozen=True)
class Trial:
    """A hypothesis: b with it taken off, as a function of (a, b).

    How many parameters were fitted to these poses, and their values.
    """

    name: str
    statement: str
    taken_off: Callable[[Poses, Poses], Poses]
    parameters: int = 0
    values: dict[str, float] = field(default_factory=dict)


def rms(d: Array) -> float:
    """Root mean square length of vectors (n, k)."""
    return float(np.sqrt(np.mean(np.sum(d**2, axis=1)))) if len(d) else 0.0


def explain(
    aspect: Aspect,
    a: Poses,
    b: Poses,
    measure: Measure,
    trials: Callable[[Poses, Poses], Iterable[Trial]],
    least: float,
) -> tuple[Finding, Poses] | None:
    """The hypothesis that explains the differences, and b with it taken off; None where none does.

    Parameters
    ----------
    measure : differences (n, k) of a part.
    trials : hypotheses for some poses.
    least : rms below which nobody asks why.
    """
    if a.n < LEAST_POSES or rms(measure(a, b)) <= least:
        return None
    rows = np.unique(np.linspace(0, a.n - 1, min(a.n, MOST)).astype(np.int64))
    some_a, some_b = a.taken(rows), b.taken(rows)
    before = rms(measure(some_a, some_b))
    judged = [
        (rms(measure(some_a, trial.taken_off(some_a, some_b))), trial)
        for trial in trials(some_a, some_b)
    ]
    good = [(left, trial) for left, trial in judged if left**2 <= (1.0 - ENOUGH) * before**2]
    if not good:
        return None
    unit = "rad" if aspect == "attitude" else "m"
    left, best = min(
        good, key=lambda pair: ((pair[0] + DIGITS[unit]) * SIMPLER ** pair[1].parameters, pair[0])
    )
    rivals = [
        t
        for other, t in good
        if t is not best and other <= AS_GOOD * left + NOTHING and t.parameters <= best.parameters
    ]
    moved = best.taken_off(a, b)
    before, left = rms(measure(a, b)), rms(measure(a, moved))
    beside = tuple(dict.fromkeys(t.statement for t in rivals if t.statement != best.statement))
    return (
        Finding(
            best.name,
            best.statement,
            aspect,
            before,
            left,
            1.0 - (left / before) ** 2,
            best.values,
            beside,
            unit,
        ),
        moved,
    )
