"""Which other reading of data explains a misfit: all candidates are judged on the same data.

A candidate reads the data otherwise: axes exchanged, another unit, rows in another order, or with
something fitted and taken off. With q the misfit as given and q_c that of a candidate, on the same
rows and by the same function, the candidate explains the misfit where

    q_c <= EXPLAINS q   and   q_c <= good                                                   (X.1)

with the misfit `good` that data of the kind may have, and never where it leaves more than all data
do as given. Of those that do, the one with the least

    (q_c + floor) LEAST_MISFIT_RATIO^p                                                     (X.2)

is best, of p fitted parameters, where right data leave `floor`; those with no more parameters and
within LEAST_MISFIT_RATIO of it cannot be told from it and are named beside it. A candidate whose
fitted value is larger than anything of its kind on Earth is none.
"""

from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, field
from typing import Generic, TypeVar

import numpy as np

from ..base.errors import InsgnssError

EXPLAINS = 0.3  # largest share of the misfit as given: it takes off nine tenths of the squares
# smallest ratio of two misfits that tells candidates apart; noise changes an rms less
LEAST_MISFIT_RATIO = 1.3
Data = TypeVar("Data")


@dataclass(frozen=True)
class Candidate(Generic[Data]):
    """Another reading of the data.

    Parameters
    ----------
    statement : str
        What is the case if it is right.
    read : callable
        The data read so.
    name : str
        Short name, for documents.
    remedy : str
        What to do if it is right.
    same : callable, optional
        The data as given on the rows that `read` keeps; without it those are all rows.
    parameters : int
        How many were fitted to the data.
    values : mapping
        Fitted values by name, SI.
    size : float
        Fitted value over the largest that occurs; beyond 1 the candidate is absurd.
    """

    statement: str
    read: Callable[[Data], Data]
    name: str = ""
    remedy: str = ""
    same: Callable[[Data], Data] | None = None
    parameters: int = 0
    values: Mapping[str, float] = field(default_factory=dict)
    size: float = 0.0


@dataclass(frozen=True)
class Explanation(Generic[Data]):
    """The candidate that explains a misfit, and those that cannot be told from it.

    Parameters
    ----------
    best : Candidate
    data : object
        The data as it reads them.
    before, left : float
        Misfit as given and as it leaves it, on the same rows.
    alike : tuple of Candidate
        Others, with other statements.
    """

    best: Candidate[Data]
    data: Data
    before: float
    left: float
    alike: tuple[Candidate[Data], ...] = ()

    def clauses(self, words: Callable[[Candidate[Data]], str] = lambda c: c.statement) -> str:
        """Return the statements of all that cannot be told apart, joined by "or".

        Parameters
        ----------
        words : callable
            The words of one.

        Returns
        -------
        str
            Such as "a, or b".
        """
        return ", or ".join(dict.fromkeys(words(c) for c in (self.best, *self.alike)))


def readings_of(data: Mapping[str, Data]) -> list[Candidate[Data]]:
    """Return candidates of data that were read otherwise already.

    Parameters
    ----------
    data : mapping
        By what is the case if it is right.

    Returns
    -------
    list of Candidate
        One of each.
    """

    def constant(value: Data) -> Callable[[Data], Data]:
        return lambda _: value

    return [Candidate(statement, constant(value)) for statement, value in data.items()]


def explain(
    given: Data,
    candidates: Iterable[Candidate[Data]],
    misfit: Callable[[Data], float],
    good: float = np.inf,
    floor: float = 0.0,
) -> Explanation[Data] | None:
    """Find the candidate that explains a misfit, by (X.1) and (X.2).

    Parameters
    ----------
    given : object
        The data as given.
    candidates : iterable of Candidate
        Other readings.
    misfit : callable
        Of data, in any unit; an error of the package, or of linear algebra, is infinite.
    good : float
        Largest misfit of what is named.
    floor : float
        What right data leave: less of it tells no candidates apart.

    Returns
    -------
    Explanation or None
        None where no candidate explains it.
    """

    def misfit_of(read: Callable[[Data], Data] | None) -> float:
        try:
            return misfit(given if read is None else read(given))
        except (InsgnssError, np.linalg.LinAlgError):
            return np.inf

    unchanged_misfit = misfit_of(None)
    judged = []
    for candidate in candidates:
        if not abs(candidate.size) <= 1.0:
            continue
        reference_misfit = unchanged_misfit if candidate.same is None else misfit_of(candidate.same)
        remaining = misfit_of(candidate.read)
        if remaining <= min(EXPLAINS * reference_misfit, good, unchanged_misfit) and np.isfinite(
            remaining
        ):
            cost = (remaining + floor) * LEAST_MISFIT_RATIO**candidate.parameters
            judged.append((cost, remaining, reference_misfit, candidate))
    if not judged:
        return None
    _, remaining, reference_misfit, best = min(judged, key=lambda entry: entry[:2])
    alike = {
        candidate.statement: candidate
        for _, candidate_misfit, _, candidate in judged
        if candidate.statement != best.statement
        and candidate.parameters <= best.parameters
        and candidate_misfit + floor <= LEAST_MISFIT_RATIO * (remaining + floor)
    }
    return Explanation(best, best.read(given), reference_misfit, remaining, tuple(alike.values()))


FINER_STEPS = 5  # of a finer scan, on either side of the best shift of the coarser one (chosen)


def best_shift(
    misfit: Callable[[float], float], reach: float, *steps: float
) -> tuple[float, float] | None:
    """Return the shift with the least misfit, such as of two clocks, and that misfit.

    Parameters
    ----------
    misfit : callable
        Of a shift; infinite where it cannot be judged.
    reach : float
        Longest shift that is looked for.
    *steps : float
        Of the shifts up to `reach`, and of finer ones, five on either side of the best so far.

    Returns
    -------
    tuple of float, or None
        None where no shift can be judged.
    """
    best = 0.0
    least_misfit = np.inf
    for number, step in enumerate(steps):
        count = round(reach / step) if number == 0 else FINER_STEPS
        shifts = best + step * np.arange(-count, count + 1)
        misfits = [misfit(float(shift)) for shift in shifts]
        best = float(shifts[np.argmin(misfits)])
        least_misfit = min(misfits)
    return (best, least_misfit) if np.isfinite(least_misfit) else None
