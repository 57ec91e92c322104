"""Spells of incorrect fixes: an ambiguity resolved wrongly, which lasts for seconds or a minute.

The IMU carries the position from one fix to the next to a fraction of its sigma, so that a step of
the fixes shows at its onset and, with the opposite sign, at its end: fixes are rejected, and the
covariance is reset (K.7). n steps divide the flight into n + 1 spells that stand alternately on the
one level and on the other,

    s_0 | s_1 | s_2 | ... | s_n

and no fix tells which of the levels is right: the flight file's, by what lasts longer. The even or
the odd ones, whichever are shorter in all, are withheld (looked at, and not used), and the flight
is filtered again; this is a remedy where no reset is left, and where the step out of each spell
takes back the step into it (noise does not). Spells that are too long to be carried by the IMU
alone, `LONGEST_SPELL_S`, are used as they are; in them, and until the filter follows the next
level, the covariance of the position is enlarged by the step d itself, of which one fix tells with
the covariance S of its innovation,

    P + d d' + S                                                                               (S.1)

since the error is one of the step or none. Where the fixes do not step but wander, what is rejected
one after the other makes a spell, on the same terms but however long it lasts: no step is there to
enlarge a covariance by.
"""

from dataclasses import dataclass, replace

import numpy as np

from ...base.errors import DataError
from ...base.wording import some
from ...records import Array, Finding, Question
from ..filter.codes import COVARIANCE_RESET, NOT_MEASURED, POSITION_ROW, REJECTED
from ..filter.filter import make_history, run_filter
from ..filter.kernels.records import Epochs, FilterHistory
from ..filter.problem import EstimationProblem, InitialState
from ..filter.smoother import SharedError
from ..filter.solution import Solution
from .estimated import fix_counts

LONGEST_SPELL_S = 60.0  # of a spell whose fixes are withheld: a MEMS IMU alone is then a metre off
MOST_WITHHELD = 0.3  # share of the fixes
TAKEN_BACK = 0.5  # of the larger step, by which a spell's two steps may differ
APART_S = 5.0  # between rejected fixes: from there on they make two spells
REJECTED_BESIDE_SPELLS = 0.01  # share of the other fixes that may be rejected
STEP_SIGMAS = 3.0  # of what the fixes claim, below which a step is none: code solutions wander so
PASSES = 4  # of the filter, each of which may show further steps


@dataclass(frozen=True)
class FixSpell:
    """Consecutive epochs whose fixes stand apart from the rest.

    Parameters
    ----------
    first, last : int
        Its first and last epoch.
    step : Array
        (3,) m, in l: by how much its fixes are off those before, or after the first of a flight.
    step_sigma : Array
        (3,) m, of the innovation that shows it.
    misclosure : float
        By what share of the larger one the steps into it and out of it differ; 0 at an end.
    """

    first: int
    last: int
    step: Array
    step_sigma: Array
    misclosure: float = 0.0


def withhold_incorrect_fixes(
    problem: EstimationProblem, start: InitialState
) -> tuple[EstimationProblem, tuple[FixSpell, ...]]:
    """Withhold the fixes of spells that stand apart from the rest of a flight.

    Parameters
    ----------
    problem, start : EstimationProblem, InitialState
        The problem and its initial state.

    Returns
    -------
    tuple of EstimationProblem and tuple of FixSpell
        The problem with these fixes withheld, and the spells; the problem itself and none where
        that is no remedy.
    """
    for spells_of, longest_s in ((_closing_spells, LONGEST_SPELL_S), (rejected_spells, np.inf)):
        candidate, spells = problem, tuple[FixSpell, ...]()
        for _ in range(PASSES):
            history = _filtered(candidate, start)
            if history is None:
                break
            if _follows(candidate, history):
                if spells:
                    return candidate, spells
                break
            apart = spells_of(candidate, history)
            with_apart = _withheld(candidate, apart, longest_s)
            if not apart or with_apart is None:
                break
            spells = tuple(sorted((*spells, *apart), key=lambda spell: spell.first))
            candidate = with_apart
    return problem, ()


def _follows(problem: EstimationProblem, history: FilterHistory) -> bool:
    """Tell whether a filter follows the fixes that are not withheld."""
    offered, rejected, resets = fix_counts(history.verdict[~problem.epochs.withheld])
    return rejected <= REJECTED_BESIDE_SPELLS * offered and not resets


def _withheld(
    problem: EstimationProblem, spells: list[FixSpell], longest_s: float
) -> EstimationProblem | None:
    """Withhold the fixes of spells; None where these are too long or too many."""
    ep = problem.epochs
    withheld = ep.withheld.copy()
    for spell in spells:
        if ep.time[spell.last] - ep.time[spell.first] > longest_s:
            return None
        withheld[spell.first : spell.last + 1] = True
    if all(_within_claims(ep, spell) for spell in spells):
        return None
    share = np.count_nonzero(withheld & ep.has_position) / np.count_nonzero(ep.has_position)
    if share > MOST_WITHHELD:
        return None
    return replace(problem, epochs=ep._replace(withheld=withheld))


def _within_claims(epochs: Epochs, spell: FixSpell) -> bool:
    """Tell whether a step is one that fixes with such standard deviations make."""
    sigma = np.sqrt(np.diag(epochs.position_cov[spell.first]))
    return bool((np.abs(spell.step) < STEP_SIGMAS * sigma).all())


def _closing_spells(problem: EstimationProblem, history: FilterHistory) -> list[FixSpell]:
    """Return the spells whose steps take each other back, none where one does not."""
    spells = spells_apart(problem, history)
    closes = all(spell.misclosure < TAKEN_BACK for spell in spells)
    return spells if closes else []


def rejected_spells(
    problem: EstimationProblem, history: FilterHistory | Solution
) -> list[FixSpell]:
    """Return the spells of fixes that are rejected one after the other, wherever they stand.

    Parameters
    ----------
    problem : EstimationProblem
        The problem.
    history : FilterHistory or Solution
        What a filter left of it: verdicts and innovations.

    Returns
    -------
    list of FixSpell
        From the first to the last of the rejected fixes and covariance resets that are less than
        `APART_S` apart, with the largest innovation.
    """
    verdict = history.verdict[:, POSITION_ROW]
    is_rejected = np.isin(verdict, (REJECTED, COVARIANCE_RESET)) & ~problem.epochs.withheld
    rejected = np.flatnonzero(is_rejected)
    if rejected.size == 0:
        return []
    breaks = np.flatnonzero(np.diff(problem.epochs.time[rejected]) > APART_S) + 1
    spells = []
    for rows in np.split(rejected, breaks):
        size = np.linalg.norm(history.innovation[rows, :3], axis=1)
        largest = int(np.argmax(size))
        step, sigma = _step(history, rows[largest : largest + 1])
        spells.append(FixSpell(int(rows[0]), int(rows[-1]), step, sigma))
    return spells


def spells_apart(problem: EstimationProblem, history: FilterHistory | Solution) -> list[FixSpell]:
    """Return the spells that stand apart from the greater part of a flight.

    Parameters
    ----------
    problem : EstimationProblem
        The problem.
    history : FilterHistory or Solution
        What a filter left of it: verdicts and innovations.

    Returns
    -------
    list of FixSpell
        Every other one of those between the steps, those that are shorter in all.
    """
    verdict = history.verdict[:, POSITION_ROW]
    fixes = np.flatnonzero((verdict != NOT_MEASURED) & ~problem.epochs.withheld)
    onsets: list[int] = []  # the first of the rejected fixes before a reset
    steps: list[Array] = []  # the median innovation from there to the reset
    sigmas: list[Array] = []
    for index in np.flatnonzero(verdict[fixes] == COVARIANCE_RESET):
        onset = int(index)
        while onset > 0 and verdict[fixes[onset - 1]] == REJECTED:
            onset -= 1
        onsets.append(onset)
        step, sigma = _step(history, fixes[onset : index + 1])
        steps.append(step)
        sigmas.append(sigma)
    bounds = [0, *onsets, fixes.size]
    parts = [(bounds[k], bounds[k + 1]) for k in range(len(bounds) - 1)]
    shorter = min((0, 1), key=lambda parity: sum(last - first for first, last in parts[parity::2]))
    spells = []
    for k in range(shorter, len(parts), 2):
        first, last = parts[k]
        if last > first:
            into = steps[k - 1] if k > 0 else -steps[0]
            out = steps[k] if k < len(steps) else -into
            largest = max(float(np.linalg.norm(step)) for step in (into, out))
            closure = float(np.linalg.norm(into + out)) / largest
            sigma = sigmas[max(k - 1, 0)]
            spells.append(FixSpell(int(fixes[first]), int(fixes[last - 1]), into, sigma, closure))
    return spells


def _step(history: FilterHistory | Solution, rows: np.ndarray) -> tuple[Array, Array]:
    """Return the median innovation of some fixes, (3,) m, and the standard deviation of the first.

    A single fix that still has the level before, or has none, decides nothing.
    """
    step = np.median(history.innovation[rows, :3], axis=0)
    return step, np.array(history.innovation_sigma[rows[0], :3])


def undecided_spells(solution: Solution) -> list[FixSpell]:
    """Return the spells of a solution that are used, though their steps take each other back.

    Parameters
    ----------
    solution : Solution
        The solved flight.

    Returns
    -------
    list of FixSpell
        None where the steps do not close: noise, or a filter that lost the fixes.
    """
    spells = spells_apart(solution.problem, solution)
    return [spell for spell in spells if spell.misclosure < TAKEN_BACK]


def with_steps(solution: Solution, spells: list[FixSpell]) -> Solution:
    """Enlarge the covariance of the positions of spells by the step itself (S.1).

    Parameters
    ----------
    solution : Solution
        The solved flight, whose covariances of neighbouring events are changed in place.
    spells : list of FixSpell
        The spells.

    Returns
    -------
    Solution
        The same, whose events know what they share.
    """
    resets = np.flatnonzero(solution.verdict[:, POSITION_ROW] == COVARIANCE_RESET)
    shared = []
    for spell in spells:
        added = np.outer(spell.step, spell.step) + np.diag(spell.step_sigma**2)
        # the rejected fixes after its last one do not yet bring the solution to their level
        later = resets[resets > spell.last]
        last = int(later[0]) - 1 if later.size else spell.last
        shared.append(SharedError(spell.first, last, added))
    return solution.enlarged(tuple(shared))


def incorrect_check(
    problem: EstimationProblem, spells: tuple[FixSpell, ...], withheld: bool
) -> Finding:
    """Say which fixes stand apart, and what was done.

    Parameters
    ----------
    problem : EstimationProblem
        The problem.
    spells : tuple of FixSpell
        The spells.
    withheld : bool
        Whether their fixes are withheld; else the covariance is enlarged.

    Returns
    -------
    Finding
        A note.
    """
    time = problem.inc.marks
    each = (
        f"{time[s.first]:.1f} to {time[s.last]:.1f} s by"
        f" {1e3 * float(np.linalg.norm(s.step)):.0f} mm"
        for s in spells
    )
    done = (
        "the data do not show which of the two levels is right: the covariance there is enlarged"
        " by the step"
    )
    if withheld:
        done = "they are left out"
    return Question("incorrect fixes", "one level throughout").note(
        "fixes stand apart from those before and after, as with an incorrect ambiguity or a glitch:"
        f" {some(each, 5, '; ')}; {done}",
        "see the quality of the PPK solution there",
    )


def _filtered(problem: EstimationProblem, start: InitialState) -> FilterHistory | None:
    """Filter a flight, however often its covariance is reset; None where the filter diverges."""
    history = make_history(problem.epochs, problem.layout, smoothed=False)
    try:
        run_filter(problem, start, history)
    except DataError:
        if not np.isfinite(history.nav[-1]).all():
            return None
    return history
