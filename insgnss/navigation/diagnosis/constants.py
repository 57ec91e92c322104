"""The evidence that a constant of the flight file is wrong: which one, by how much, or none.

One pass of the filter over the whole flight carries every candidate as a state with a wide a-priori
sigma D (`candidates.with_every_constant`): the antenna's lever arm, the time offset of the fixes
and its rate, scale factors and misalignments of the IMU. At the last epoch filter and smoother
agree; in units of D, let x and P be the candidates' estimate and covariance there, all other states
marginalised. The data alone know of them

    I = P^-1 - 1,     b = P^-1 x                                                               (D.1)

A hypothesis gives them a priori the variances diag(V): a suspected one that of the `WIDE` sigmas of
`candidates` or, where that explains more, of `PRIOR_FACTORS` times them; one that the flight file
states with a sigma s the variance (s / D)^2, one that it takes as known 0. With W = sqrt(V),

    A = 1 + W I W,    e = W A^-1 W b,    cov e = W A^-1 W,
    F(V) = b' e / 2 - log det A / 2                                                            (D.2)

e is what the hypothesis estimates, and F(V) - F(V of the flight file) the logarithm of its evidence
against the flight file's (the ratio of the likelihoods of all innovations, candidates
marginalised). The determinant charges a hypothesis for what it leaves open, so the file wins where
nothing is wrong: by some 3 over any single constant. All subsets of a few groups cost small
matrices only.

A flight in which nothing is wrong, as most are, needs no pass of its own for it: the filter of the
flight file follows the constants beside (`navigation.diagnosis.sensitivity`), which gives I and b
where the innovations depend on them linearly, as they do near the flight file's numbers. Where that
evidence comes within `UNSETTLED_EVIDENCE` of `TAKEN_EVIDENCE`, or fixes were rejected, the pass is
run, and it alone counts.

A constant that the flight file states as exact (a sigma of 0) is no state: where another hypothesis
explains as much, that is taken; where none does, the contradiction is shown, nothing estimated.

Errors that are no constants (a variance that is too small, a bias that drifts) show up as constants
beyond what any sensor has; an estimate of the IMU beyond `PLAUSIBLE` of its D is therefore no
hypothesis. They compete as variances (`navigation.diagnosis.variances`), and constants are judged
again under the winner.

Jaynes (2003), ch. 20; MacKay (2003), ch. 28.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from itertools import combinations

import numpy as np

from ...base.errors import DataError
from ...records import Array
from ...records.states import (
    CLOCK_RATE,
    MISALIGNMENT,
    OF_FIXES,
    OF_LEVER_ARM,
    SCALE_FACTOR,
    TIME_OFFSET,
    State,
)
from ...records.verdicts import Estimate
from ..filter.codes import NAV, NHC, POSITION_ROW
from ..filter.filter import make_history, run_filter
from ..filter.layout import StateLayout
from ..filter.problem import EstimationProblem, InitialState
from ..filter.solution import Solution
from .candidates import FAR_FACTOR, with_a_priori, with_layout, without_other_aiding
from .estimated import fix_counts
from .sensitivity import LONGEST_INTERVAL_S, Constants, Sensitivity

MOST_TOGETHER = 3  # groups of constants that are suspected at once
PLAUSIBLE = 4.0  # a-priori sigmas of scale factors and misalignments
# log evidence from which a hypothesis becomes states. From 1.5 on 4 of 90 right flights of three
# minutes had one, by chance among nine groups; from 4 on none, and no wrong constant is lost by it
TAKEN_EVIDENCE = 4.0
PRIOR_FACTORS = (0.1, 1.0, FAR_FACTOR)  # of the a-priori sigmas of the fixes' constants
# of the wide a-priori sigma: a flight that reaches it says something of a constant
TELLING_SHARE = 0.5
STRONG = 5.0  # log evidence from which a hypothesis is taken as shown
# log evidence by which what the filter follows beside may be off: 0.02 to 0.6 on flights near
# the decision, 1.1 at most far below it
UNSETTLED_EVIDENCE = 1.5
REJECTED_WITH_CONSTANTS = 1e-3  # share of the fixes, up to which it is taken at all
OTHERS = 3.0  # log evidence below the winner's: within it two hypotheses are not told apart


@dataclass(frozen=True)
class Hypothesis:
    """Constants that are suspected together.

    Parameters
    ----------
    groups : tuple of State
        The groups (`group_of`), or single axes of the IMU.
    evidence : float
        Logarithm of its evidence against the flight file's.
    states : tuple of State
        (k,) the error states.
    value, sigma : Array
        (k,) what it estimates of them, and the standard deviations.
    factor : float
        Of the a-priori sigmas of the fixes' constants, one of `PRIOR_FACTORS`.
    wide_evidence : float
        Its evidence with a factor of at least one, which chance alone reaches more rarely.
    """

    groups: tuple[State, ...]
    evidence: float
    states: tuple[State, ...]
    value: Array
    sigma: Array
    factor: float
    wide_evidence: float


@dataclass(frozen=True)
class ConstantsEvidence:
    """What a flight says of its constants.

    Parameters
    ----------
    states : tuple of State
        (c,) the candidates.
    wide : Array
        (c,) the wide a-priori sigma of each.
    stated : Array
        (c,) the sigma that the flight file states, 0 where it takes it as known.
    information : Array
        (c, c) of the data alone (D.1), in units of `wide`.
    vector : Array
        (c,) b of (D.1).
    requested : tuple of str
        Groups of states that are estimated in any case and not suspected.
    exact : tuple of str
        Groups of states that the flight file states as exact.
    """

    states: tuple[State, ...]
    wide: Array
    stated: Array
    information: Array
    vector: Array
    requested: tuple[str, ...] = ()
    exact: tuple[str, ...] = ()

    @cached_property
    def group(self) -> tuple[State, ...]:
        """(c,) what each candidate is suspected with."""
        return tuple(group for state in self.states if (group := group_of(state)))

    def denied(self, hypothesis: Hypothesis) -> bool:
        """Tell whether a hypothesis suspects what the flight file states as exact."""
        return any(suspected.group in self.exact for suspected in hypothesis.groups)

    @cached_property
    def hypotheses(self) -> tuple[Hypothesis, ...]:
        """All hypotheses of at most `MOST_TOGETHER` groups, the strongest first.

        Those whose estimates a sensor or a mounting may have; a constant that is requested, or has
        been given its wide sigma already, is not suspected.
        """
        groups = tuple(dict.fromkeys(self._may_be_suspected))
        sizes = range(1, MOST_TOGETHER + 1)
        return self._judged([one for size in sizes for one in combinations(groups, size)])

    @cached_property
    def _may_be_suspected(self) -> dict[State, list[State]]:
        """The candidates of each group that have no wide sigma yet."""
        narrow = self.stated < np.where(self.of_fixes, self.wide / FAR_FACTOR, self.wide)
        of_group: dict[State, list[State]] = {}
        for group, state, is_narrow in zip(self.group, self.states, narrow, strict=True):
            if is_narrow and group.group not in self.requested:
                of_group.setdefault(group, []).append(state)
        return of_group

    def _judged(self, every: Sequence[tuple[State, ...]]) -> tuple[Hypothesis, ...]:
        """Return the hypotheses that suspect these groups or single states, strongest first."""
        cases = [(suspected, factor) for suspected in every for factor in PRIOR_FACTORS]
        cost, estimate, cov = self._evaluate([((), 1.0), *cases])
        evidence = (cost[1:] - cost[0]).reshape(-1, len(PRIOR_FACTORS))
        wide_evidence = evidence[:, [factor >= 1.0 for factor in PRIOR_FACTORS]].max(axis=1)
        hypotheses = []
        for k, (suspected, factor) in enumerate(zip(every, evidence.argmax(axis=1), strict=True)):
            case = 1 + k * len(PRIOR_FACTORS) + int(factor)
            chosen = np.flatnonzero(self._is_suspected(suspected))
            of_imu = chosen[~self.of_fixes[chosen]]
            if np.abs(estimate[case, of_imu]).max(initial=0.0) > PLAUSIBLE:
                continue
            states, wide = tuple(self.states[state] for state in chosen), self.wide[chosen]
            estimates = estimate[case, chosen] * wide, np.sqrt(cov[case, chosen, chosen]) * wide
            strength = PRIOR_FACTORS[factor], float(wide_evidence[k])
            one = Hypothesis(suspected, float(evidence[k, factor]), states, *estimates, *strength)
            hypotheses.append(one)
        return tuple(sorted(hypotheses, key=lambda one: -one.evidence))

    def strongest(self) -> Hypothesis | None:
        """Return the strongest hypothesis, without groups that add little.

        Returns
        -------
        Hypothesis or None
            The one of fewest groups within `OTHERS` of the strongest, of those that leave alone
            what is stated as exact where there are any, and single axes of the IMU where they
            explain as much as all; None where that is not beyond `TAKEN_EVIDENCE`: nothing is
            suspected.
        """
        every = self.hypotheses
        if not every:
            return None
        close = [one for one in every if one.evidence > every[0].evidence - OTHERS]
        close = [one for one in close if not self.denied(one)] or close
        simplest = min(close, key=lambda one: (len(one.groups), -one.evidence))
        if simplest.evidence < TAKEN_EVIDENCE:
            return None
        as_simple = [one for one in close if len(one.groups) == len(simplest.groups)]
        return max(map(self._of_single_axes, as_simple), key=lambda one: one.evidence)

    def _of_single_axes(self, one: Hypothesis) -> Hypothesis:
        """Return the hypothesis with axes of the IMU in place of all of a sensor, if they do."""
        chosen = tuple(group for group in one.groups if group in OF_FIXES or group.axis)
        axes = [s for g in one.groups if g not in chosen for s in self._may_be_suspected[g]]
        best = replace(one, evidence=-np.inf)
        while axes and len(chosen) < MOST_TOGETHER:
            every = self._judged([(*chosen, axis) for axis in axes if axis not in chosen])
            if not every or every[0].evidence < best.evidence + OTHERS:
                break
            best, chosen = every[0], every[0].groups
        return best if best.evidence > one.evidence - OTHERS else one

    def rivals(self, of: Hypothesis) -> list[Hypothesis]:
        """Return other hypotheses that the flight does not tell apart from one.

        Parameters
        ----------
        of : Hypothesis
            The one that is compared with.

        Returns
        -------
        list of Hypothesis
            Those of as few groups whose evidence is within `OTHERS` of it; beside one that leaves
            alone what is stated as exact, none that suspects it; beside one of single axes those of
            others, but none of all axes with them.
        """
        axes = [axis for axes in self._may_be_suspected.values() for axis in axes]
        single = [group for group in of.groups if group.sensor and group.axis]
        of_others = self._judged(
            [
                (*(group for group in of.groups if group != one), axis)
                for one in single
                for axis in axes
                if axis.sensor and axis not in of.groups
            ]
        )
        with_them = {one.of_all_axes for one in single}
        rivals = [
            one
            for one in (*self.hypotheses, *of_others)
            if one.groups != of.groups
            and with_them.isdisjoint(one.groups)
            and (self.denied(of) or not self.denied(one))
            and len(one.groups) <= len(of.groups)
            and one.evidence > of.evidence - OTHERS
        ]
        by_axes = [self._of_single_axes(one) for one in rivals]
        return list({frozenset(one.groups): one for one in by_axes}.values())

    def known_to(self) -> dict[State, float]:
        """Return to what sigma this flight alone knows each candidate, were it the only one.

        Returns
        -------
        dict of State to float
            Standard deviation of each, infinite where the flight does not tell.
        """
        root = np.sqrt(np.maximum(np.diag(self.information), 0.0))
        with np.errstate(divide="ignore"):
            return dict(zip(self.states, (self.wide / root).tolist(), strict=True))

    def estimates(self, middle_s: float = 0.0) -> tuple[Estimate, ...]:
        """Return what this flight alone says of the constants of its fixes.

        The components of a lever arm are estimated together, another constant alone; what is not
        estimated has the sigma that the flight file states. A time offset that changes, as where a
        clock rate is estimated as well, is that of the middle, where the flight knows it best.

        Parameters
        ----------
        middle_s : float
            The middle of the flight, s after its first epoch.

        Returns
        -------
        tuple of Estimate
            Those of which the flight says anything: whose sigma is below half of the wide one.
        """
        estimates = []
        for together in (OF_LEVER_ARM, (TIME_OFFSET,), (CLOCK_RATE,)):
            groups = tuple(state for state in together if state in self.states)
            if not groups:
                continue
            evidence = self._offset_at(middle_s) if TIME_OFFSET in groups else self
            _, (estimate,), (cov,) = evidence._evaluate([(groups, FAR_FACTOR)])
            for k in np.flatnonzero([group in groups for group in self.group]):
                sigma = float(np.sqrt(max(cov[k, k], 0.0)))
                if sigma < TELLING_SHARE:
                    value, in_si = float(estimate[k] * self.wide[k]), sigma * float(self.wide[k])
                    estimates.append(Estimate(self.states[k], value, in_si))
        return tuple(estimates)

    def _offset_at(self, instant_s: float) -> "ConstantsEvidence":
        """Return the evidence with the time offset at an instant in place of the first epoch's."""
        if not {TIME_OFFSET, CLOCK_RATE} <= set(self.states):
            return self
        offset, rate = self.states.index(TIME_OFFSET), self.states.index(CLOCK_RATE)
        back = np.eye(self.wide.size)
        back[offset, rate] = -instant_s * self.wide[rate] / self.wide[offset]
        return replace(
            self, information=back.T @ self.information @ back, vector=back.T @ self.vector
        )

    @property
    def of_fixes(self) -> np.ndarray:
        """(c,) bool, whether a candidate is of the fixes rather than of the IMU."""
        return np.array([state in OF_FIXES for state in self.states])

    @cached_property
    def _candidates_of(self) -> dict[State, set[int]]:
        """The numbers of the candidates that a group or a single state has."""
        numbers: dict[State, set[int]] = {}
        for k, names in enumerate(zip(self.states, self.group, strict=True)):
            for name in names:
                numbers.setdefault(name, set()).add(k)
        return numbers

    def _is_suspected(self, groups: tuple[State, ...]) -> np.ndarray:
        """Tell which candidates these groups or single states are."""
        out = np.zeros(len(self.states), dtype=np.bool_)
        for name in groups:
            out[list(self._candidates_of.get(name, ()))] = True
        return out

    def _evaluate(
        self, cases: Sequence[tuple[tuple[State, ...], float]]
    ) -> tuple[Array, Array, Array]:
        """Return F, e and cov e of (D.2) of groups and factors, in units of `wide`."""
        stated = self.stated / self.wide
        is_suspected = np.array([self._is_suspected(suspected) for suspected, _ in cases])
        factors = np.array([factor for _, factor in cases])
        suspected_sigma = np.where(self.of_fixes, factors[:, None] / FAR_FACTOR, 1.0)
        W = np.where(is_suspected, np.maximum(suspected_sigma, stated), stated)
        A = np.eye(stated.size) + W[:, :, None] * self.information * W[:, None, :]
        cov = W[:, :, None] * np.linalg.inv(A) * W[:, None, :]
        estimate = cov @ self.vector
        cost = 0.5 * estimate @ self.vector - 0.5 * np.linalg.slogdet(A)[1]
        return cost, estimate, cov


def constants_evidence(
    problem: EstimationProblem,
    start: InitialState,
    own: StateLayout,
    layout: StateLayout,
    requested: tuple[str, ...] = (),
    exact: tuple[str, ...] = (),
) -> ConstantsEvidence | None:
    """Run the filter once with every candidate constant as a state.

    Parameters
    ----------
    problem, start : EstimationProblem, InitialState
        The problem and its initial state.
    own : StateLayout
        The states of the flight as it is taken to be.
    layout : StateLayout
        Its states and the candidates besides, with their wide a-priori sigmas.
    requested : tuple of str
        Groups of states that are estimated in any case and not suspected.
    exact : tuple of str
        Groups of states that the flight file states as exact.

    Returns
    -------
    ConstantsEvidence or None
        The evidence; None where the filter does not follow the fixes.
    """
    states = [s for s, state in enumerate(layout.states) if group_of(state)]
    wide, wide_start = with_layout(_open_gate(problem), start, layout)
    rows, sigma = NAV.stop + np.array(states), layout.sigma0[states]
    # what the flight file says of them, which is not zero of stamps that were moved since
    stated_value = (wide_start.x[states] + wide_start.mean[rows]) / sigma
    # a state that the flight file has with a sigma of its own is a candidate with a wide one
    wide_start = with_a_priori(wide_start, layout, states)
    history = make_history(wide.epochs, layout, smoothed=False)
    try:
        run_filter(wide, wide_start, history)
    except DataError:
        return None
    P = history.P[-1][np.ix_(rows, rows)] / np.outer(sigma, sigma)
    x = (history.x[-1][states] + history.m[-1][rows]) / sigma
    L = np.linalg.inv(P)
    information = L - np.eye(sigma.size)
    vector = L @ x - information @ stated_value
    candidates = tuple(layout.states[s] for s in states)
    own_sigma = dict(zip(own.states, own.sigma0.tolist(), strict=True))
    stated = np.array([own_sigma.get(state, 0.0) for state in candidates])
    return ConstantsEvidence(candidates, sigma, stated, information, vector, requested, exact)


def followed_constants(problem: EstimationProblem, wide: StateLayout) -> Sensitivity | None:
    """Return what follows the candidates beside the filter of a problem.

    Parameters
    ----------
    problem : EstimationProblem
        The flight as it is taken to be.
    wide : StateLayout
        Its states and the candidates besides, with their wide a-priori sigmas.

    Returns
    -------
    Sensitivity or None
        None where they cannot be followed: a candidate acts like no state of the problem, epochs
        are far apart, or the pass sees a barometer, non-holonomic constraints or measurements given
        by their prediction, which have no say in the evidence.
    """
    epochs = problem.epochs
    with_rows = problem.gates_of_measurements and problem.linearised
    if with_rows or np.diff(epochs.time).max(initial=0.0) > LONGEST_INTERVAL_S:
        return None
    if (epochs.barometer_variance > 0.0).any() or (epochs.constraint == NHC).any():
        return None
    states = [s for s, state in enumerate(wide.states) if group_of(state)]
    constants = Constants.of(problem.layout, wide, states)
    return None if constants is None else Sensitivity.before(problem, constants)


def settled_evidence(
    solution: Solution,
    followed: Sensitivity | None,
    requested: tuple[str, ...] = (),
    exact: tuple[str, ...] = (),
) -> ConstantsEvidence | None:
    """Return the evidence that was followed beside the filter of a solution, where it settles it.

    Parameters
    ----------
    solution : Solution
        The solution of the flight as it is taken to be.
    followed : Sensitivity or None
        What went along with its first pass; that of another problem is not taken.
    requested : tuple of str
        Groups of states that are estimated in any case and not suspected.
    exact : tuple of str
        Groups of states that the flight file states as exact.

    Returns
    -------
    ConstantsEvidence or None
        The evidence, which suspects nothing; None where the pass of `constants_evidence` is needed.
    """
    problem = solution.problem
    if followed is None or not followed.problem.same_otherwise(problem):
        return None
    limit = min(problem.gate, problem.huber_threshold)
    beyond = np.count_nonzero(solution.nis[:, POSITION_ROW] > limit)
    offered, _, resets = fix_counts(solution.verdict)
    if beyond > REJECTED_WITH_CONSTANTS * offered or resets:
        return None
    constants, data = followed.constants, followed.of_the_data()
    sigmas = constants.wide, constants.stated
    evidence = ConstantsEvidence(constants.states, *sigmas, *data, requested, exact)
    every = evidence.hypotheses
    return None if every and every[0].evidence > TAKEN_EVIDENCE - UNSETTLED_EVIDENCE else evidence


def group_of(state: State) -> State | None:
    """Return what a candidate is suspected with, None of a state that is no candidate.

    An error of the fixes is suspected by itself, one of the IMU with those of the other axes.
    """
    if state in OF_FIXES:
        return state
    return state.of_all_axes if state.group in (SCALE_FACTOR, MISALIGNMENT) else None


def _open_gate(problem: EstimationProblem) -> EstimationProblem:
    """Return the problem with its gate open; what lies beyond it is weighed down (K.11).

    A barometer and other sensors, whose own errors may be large, and constraints of the motion,
    which may not hold, have no say.
    """
    problem = without_other_aiding(problem.without_measurements)
    return replace(problem, gate=np.inf, huber_threshold=problem.gate)
