"""What explains the differences of a part: candidates are taken off b, and judged by what remains.

They are judged on at most `MOST_JUDGED` poses spread over all (`insgnss/geodesy/explain.py`), and
the one that is chosen is taken off all.
"""

from collections.abc import Callable, Iterable, Mapping
from dataclasses import replace

import numpy as np

from ...geodesy.explain import Candidate, Explanation, explain
from ...records import Array
from .matching import Matched
from .poses import Poses
from .result import Aspect, Mismatch

Measure = Callable[[Poses, Poses], Array]

# poses, spread over all, by which readings are judged: more tell no more (chosen)
MOST_JUDGED = 2000
LEAST_POSES = 5  # matched ones: fewer fit many readings
WRITTEN_DIGITS = {"m": 1e-4, "rad": 2e-8}  # rms that the printed digits of two files leave


def rms(d: Array) -> float:
    """Root mean square length of vectors (n, k)."""
    return float(np.sqrt(np.mean(np.sum(d**2, axis=1)))) if len(d) else 0.0


def taken_off(
    name: str,
    statement: str,
    change: Callable[[Poses, Poses], Poses],
    parameters: int = 0,
    values: Mapping[str, float] | None = None,
    size: float = 0.0,
) -> Candidate[Matched]:
    """Return a candidate that replaces b by a function of (a, b); see `Candidate`."""

    def read(m: Matched) -> Matched:
        return replace(m, b=change(m.a, m.b))

    return Candidate(statement, read, name, parameters=parameters, values=values or {}, size=size)


def finding(
    explanation: Explanation[Matched], aspect: Aspect, before: float, after: float, unit: str = "m"
) -> Mismatch:
    """Return what is said of an explanation that leaves `after` of `before`."""
    alike = tuple(c.statement for c in explanation.alike)
    best, values = explanation.best, dict(explanation.best.values)
    return Mismatch(best.name, best.statement, aspect, before, after, values, alike, unit)


def recognise_difference(
    aspect: Aspect,
    matched: Matched,
    measure: Measure,
    candidates: Callable[[Poses, Poses], Iterable[Candidate[Matched]]],
    least: float,
) -> tuple[Mismatch, Matched] | None:
    """What explains the differences, and the match with it taken off b; None where nothing does.

    Parameters
    ----------
    measure : differences (n, k) of a part.
    candidates : for some poses.
    least : rms below which nobody asks why.
    """
    n, unit = matched.a.n, "rad" if aspect == "attitude" else "m"

    def misfit(m: Matched) -> float:
        return rms(measure(m.a, m.b))

    if n < LEAST_POSES or (before := misfit(matched)) <= least:
        return None
    some = matched.taken(np.unique(np.linspace(0, n - 1, min(n, MOST_JUDGED)).astype(np.int64)))
    explanation = explain(some, candidates(some.a, some.b), misfit, floor=WRITTEN_DIGITS[unit])
    if explanation is None:
        return None
    again = explanation.best.read(matched)
    return finding(explanation, aspect, before, misfit(again), unit), again
