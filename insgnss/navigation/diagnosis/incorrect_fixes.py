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

A float solution that claims to be fixed steps away and converges: no step takes that back. Its
fixes are off, from the onset t_0 on, by

    a exp(-(t - t_0) / T)                                                                      (S.2)

with a of the size of the step, a state. The IMU hardly tells T, nor a level that lasts (T infinite,
`PERMANENT` a priori): fixes are corrected by the mean of (S.2) over `CONVERGING_S`, weighted by the
likelihood of the flight up to the next step. What that leaves, the variance about the mean,
`UNLIKE` of it, `BETWEEN` of T and `SAFE` sigmas of a, is a Gauss-Markov error of these fixes. Where
the level after a single step, or up to one that takes it back, lasts more probably, it is undecided
as any other. A lever arm, a clock or a late sensor that is wrong makes steps as well: whoever
adopts (S.2) has let them lose before (`remedies`).
"""

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from ...base.errors import DataError
from ...base.wording import some
from ...records import Array, Finding, Question
from ..filter.codes import (
    COVARIANCE_RESET,
    N_NAV,
    NOT_MEASURED,
    POSITION_ROW,
    REJECTED,
    UNFIXED_GROUP,
    USED,
)
from ..filter.filter import make_history, run_filter
from ..filter.kernels.records import Epochs, FilterHistory
from ..filter.layout import FixErrors, StateLayout
from ..filter.problem import EstimationProblem, InitialState
from ..filter.smoother import SharedError
from ..filter.solution import Solution
from .candidates import with_layout
from .estimated import fix_counts
from .evidence import misfit_of_pass

LONGEST_SPELL_S = 60.0  # of a spell whose fixes are withheld: a MEMS IMU alone is then a metre off
MOST_WITHHELD = 0.3  # share of the fixes
LEAST_SIDE = 0.45  # of a flight: of one step with shorter sides the longer is believed (chosen)
TAKEN_BACK = 0.5  # of the larger step, by which a spell's two steps may differ
APART_S = 5.0  # between rejected fixes: from there on they make two spells
REJECTED_BESIDE_SPELLS = 0.01  # share of the other fixes that may be rejected
STEP_SIGMAS = 3.0  # of what the fixes claim, below which a step is none: code solutions wander so
# what is done with spells
LEFT_OUT = "these fixes are left out"
AS_FLOAT = "they are taken as float solutions, whose sigmas include a decaying error of this size"
ENLARGED = "no data show which level is right, so the covariance includes the step"
PASSES = 4  # of the filter, each of which may show further steps
# of float solutions that claim to be fixed
CONVERGING_S = (5.0, 7.0, 10.0, 14.0, 20.0, 28.0, 40.0, 56.0, 80.0)  # s, T of (S.2)
ENDLESS_S = 1e6  # s, T of a level that lasts, and of a state that is constant over a flight
SHAPE_S = 60.0  # s, over which the error departs from an exponential: satellites come and go
UNLIKE = 0.1  # of (S.2), by which it does
BETWEEN = 0.15  # of T, by which it may differ from the nearest one above
SAFE = 3.0  # standard deviations of a: the fixes that gave them are used once more
ENDS_AT = 0.2  # of a fix's claimed sigma, below which its float error no longer matters
LARGEST_FLOAT_M = 2.0  # m, of a step: float solutions are decimetres off, larger ones are glitches
SUDDEN = 3.0  # times the innovation before: a wrong IMU leaves its fixes by and by
PERMANENT = 0.2  # a-priori probability that a step lasts: of float solutions few do (chosen)
MOST_FLOAT_SPELLS = 8  # of a flight


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
    problem: EstimationProblem, start: InitialState, closing: bool = True
) -> tuple[EstimationProblem, tuple[FixSpell, ...]]:
    """Withhold the fixes of spells that stand apart from the rest of a flight.

    Parameters
    ----------
    problem, start : EstimationProblem, InitialState
        The problem and its initial state.
    closing : bool
        Whether spells are those whose steps take each other back, or whatever is rejected.

    Returns
    -------
    tuple of EstimationProblem and tuple of FixSpell
        The problem with these fixes withheld, and the spells; the problem itself and none where
        that is no remedy.
    """
    longest_s = LONGEST_SPELL_S if closing else np.inf
    candidate, spells = problem, tuple[FixSpell, ...]()
    for _ in range(PASSES):
        history = _filter_or_none(candidate, start)
        if history is None:
            break
        if _follows(candidate, history):
            return candidate, spells
        apart = (_closing_spells if closing else rejected_spells)(candidate, history)
        with_apart = _withheld(candidate, apart, longest_s)
        if not apart or with_apart is None:
            break
        spells = tuple(sorted((*spells, *apart), key=lambda spell: spell.first))
        candidate = with_apart
    return problem, ()


FloatSpells = tuple[EstimationProblem, InitialState, FixErrors, tuple[FixSpell, ...]]
"""A problem whose fixes have the error (S.2), its start, the errors of the fixes, the spells."""


def float_spells(
    problem: EstimationProblem,
    start: InitialState,
    layout_factory: Callable[[FixErrors], StateLayout],
    errors: FixErrors,
) -> FloatSpells | None:
    """Give the fixes after steps that nothing takes back the error of a float solution (S.2).

    Parameters
    ----------
    problem, start : EstimationProblem, InitialState
        The problem and its initial state.
    layout_factory : callable
        The error states of the flight as a function of those of its fixes.
    errors : FixErrors
        Those that are estimated.

    Returns
    -------
    FloatSpells or None
        None where that is no remedy, or where the fixes say themselves which of them are float.
    """
    if errors.unfixed_gm_sigma is not None:
        return None
    errors = replace(
        errors,
        unfixed_gm_sigma=1.0,
        unfixed_correlation_time_s=ENDLESS_S,
        unfixed_white_scale=errors.white_scale[0],
    )
    wide = layout_factory(errors)
    spells = tuple[FixSpell, ...]()
    sizes = np.zeros_like(problem.epochs.sigma)
    corrected = problem
    while (history := _filter_or_none(corrected, start)) is not None:
        if _follows(corrected, history):
            break
        steps = _sudden_steps(corrected, history)
        if not steps or len(spells) == MOST_FLOAT_SPELLS:
            return None
        until = steps[1].first if len(steps) > 1 else sizes.shape[0]
        alone = len(steps) == 1 and not spells
        if len(steps) > 1:
            alone = _misclosure(steps[0].step, steps[1].step) < TAKEN_BACK
        one = _correct_after_step(corrected, start, wide, steps[0], until, alone)
        if one is None:
            return None
        corrected, spells, sizes = one[0], (*spells, one[1]), np.hypot(sizes, one[2])
    largest = max((float(np.linalg.norm(one.step)) for one in spells), default=np.inf)
    if history is None or largest > LARGEST_FLOAT_M:
        return None
    errors = replace(errors, unfixed_correlation_time_s=SHAPE_S)
    group = np.where(sizes[:, 0] > 0.0, UNFIXED_GROUP, corrected.epochs.group)
    sigma = np.where(sizes > 0.0, sizes, corrected.epochs.sigma)
    epochs = corrected.epochs._replace(sigma=sigma, group=group)
    corrected, start = with_layout(corrected, start, layout_factory(errors))
    return replace(corrected, epochs=epochs), start, errors, spells


def _correct_after_step(
    problem: EstimationProblem,
    start: InitialState,
    layout: StateLayout,
    step: FixSpell,
    until: int,
    alone: bool,
) -> tuple[EstimationProblem, FixSpell, Array] | None:
    """Correct the fixes after a step by the mean of (S.2), by what those before `until` say of it.

    The third is the standard deviation, (m, 3) m, of what is left. None where the filter diverges,
    or where the level after a step that is `alone`, or taken back, lasts more probably.
    """
    ep = problem.epochs
    largest = float(np.linalg.norm(step.step))
    since = ep.time - ep.time[step.first]
    withheld = ep.withheld.copy()
    withheld[until:] = True
    wide, begin = with_layout(problem, start, layout)
    of_a = slice(layout.unfixed_gm, layout.unfixed_gm + 3)
    of_m = slice(N_NAV + of_a.start, N_NAV + of_a.stop)
    times = (*CONVERGING_S, ENDLESS_S)
    courses = np.exp(-np.maximum(since, 0.0) / np.array(times)[:, None]) * (since > -1e-9)
    cost, a, variance = np.empty(len(times)), np.empty((len(times), 3)), np.empty((len(times), 3))
    for k, course in enumerate(courses):
        rows = ep.has_position & (course > 0.0)
        sigma, group = ep.sigma.copy(), ep.group.copy()
        sigma[rows], group[rows] = largest * course[rows, None], UNFIXED_GROUP
        epochs = ep._replace(sigma=sigma, group=group, withheld=withheld)
        history = _filter_or_none(replace(wide, epochs=epochs), begin)
        if history is None:
            return None
        cost[k] = misfit_of_pass(history, problem.gate)
        a[k] = largest * (history.x[-1, of_a] + history.m[-1, of_m])
        variance[k] = largest**2 * np.diag(history.P[-1])[of_m]
    prior = np.full(len(times), (1.0 - PERMANENT) / len(CONVERGING_S))
    prior[-1] = PERMANENT
    weight = prior * np.exp(-0.5 * (cost - cost.min()))
    weight /= weight.sum()
    if weight[-1] > 0.5 and alone:
        return None
    error = courses[:, :, None] * a[:, None]
    mean = np.tensordot(weight, error, 1)
    unlike = UNLIKE**2 + np.square(BETWEEN * np.maximum(since, 0.0) / np.array(times)[:, None])
    about = np.square(error - mean) + unlike[:, :, None] * np.square(error)
    about += SAFE**2 * np.square(courses)[:, :, None] * variance[:, None]
    remaining = np.sqrt(np.tensordot(weight, about, 1))
    claimed = np.sqrt(np.diagonal(ep.position_cov, axis1=1, axis2=2))
    remaining[~ep.has_position | (remaining < ENDS_AT * claimed).all(axis=1)] = 0.0
    rows = np.flatnonzero((remaining > claimed).any(axis=1) & ep.has_position)
    last = int(rows.max(initial=step.last))
    position = ep.position - np.where(ep.has_position[:, None], mean, 0.0)
    corrected = replace(problem, epochs=ep._replace(position=position))
    return corrected, replace(step, last=last, step=mean[step.first]), remaining


def _sudden_steps(problem: EstimationProblem, history: FilterHistory) -> list[FixSpell]:
    """Return the spells of rejected fixes in which the covariance was reset, if all are sudden."""
    verdict = history.verdict[:, POSITION_ROW]
    resets = np.flatnonzero(verdict == COVARIANCE_RESET)
    spells = rejected_spells(problem, history)
    spells = [s for s in spells if ((resets >= s.first) & (resets <= s.last)).any()]
    size = np.linalg.norm(history.innovation[:, :3], axis=1)
    used = np.flatnonzero(verdict == USED)
    before = [used[max(int(np.searchsorted(used, one.first)) - 1, 0)] for one in spells]
    sudden = [size[one.first] > SUDDEN * size[k] for one, k in zip(spells, before, strict=True)]
    return spells if all(sudden) else []


def _misclosure(into: Array, out: Array) -> float:
    """Return by what share of the larger one two steps, (3,) m, do not take each other back."""
    largest = max(float(np.linalg.norm(step)) for step in (into, out))
    return float(np.linalg.norm(into + out)) / largest


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
            of_spell = int(fixes[first]), int(fixes[last - 1]), into, sigmas[max(k - 1, 0)]
            spells.append(FixSpell(*of_spell, _misclosure(into, out)))
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
    spells = [spell for spell in spells if spell.misclosure < TAKEN_BACK]
    if len(spells) != 1:
        return spells
    # of one step either side may be the wrong one, unless it lasts much longer
    ep, (one,) = solution.problem.epochs, spells
    fixes = np.flatnonzero(ep.has_position & ~ep.withheld)
    before, after = fixes[fixes < one.first], fixes[fixes > one.last]
    length_s = float(ep.time[one.last] - ep.time[one.first])
    if (before.size == 0) == (after.size == 0) or length_s < LEAST_SIDE * float(ep.time[-1]):
        return spells
    longer = before if before.size else after
    return [one, replace(one, first=int(longer[0]), last=int(longer[-1]))]


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


def incorrect_check(problem: EstimationProblem, spells: tuple[FixSpell, ...], done: str) -> Finding:
    """Say which fixes stand apart, and what was done.

    Parameters
    ----------
    problem : EstimationProblem
        The problem.
    spells : tuple of FixSpell
        The spells.
    done : str
        One of `LEFT_OUT`, `AS_FLOAT` and `ENLARGED`.

    Returns
    -------
    Finding
        A note.
    """
    time = problem.inc.marks
    end = int(np.flatnonzero(problem.epochs.has_position)[-1])
    each = (
        f"{time[s.first]:.1f} to {f'{time[s.last]:.1f} s' if s.last < end else 'the end'} by"
        f" {1e3 * float(np.linalg.norm(s.step)):.0f} mm"
        for s in spells
    )
    check = Question("incorrect fixes", "one level throughout").note(
        "some fixes jump against the others, as with an incorrect ambiguity fix: "
        f"{some(each, 5, '; ')}; {done}",
        "see the quality of the PPK solution there",
    )
    return replace(
        check, spans_s=tuple((float(time[s.first]), float(time[s.last])) for s in spells)
    )


def _filter_or_none(problem: EstimationProblem, start: InitialState) -> FilterHistory | None:
    """Filter a flight, however often its covariance is reset; None where the filter diverges."""
    history = make_history(problem.epochs, problem.layout, smoothed=False)
    try:
        run_filter(problem, start, history)
    except DataError:
        if not np.isfinite(history.nav[-1]).all():
            return None
    return history
