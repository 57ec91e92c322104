"""Biases that drift or step, as states, and drifts that larger noise has smoothed over.

Slow biases: an IMU warms up after it was switched on, or its temperature drifts.

Every channel has a bias a exp(-t/T), one that grows linearly, or one that follows the temperature
which the IMU logs, with `SLOW_BIAS` as a-priori sigma of a: states without driving noise
(`navigation.filter.layout`). T is looked for on the grid `TIMES_S` by the likelihood of the
innovations, and competes with larger noise by its evidence (V.2). A random walk that is as large
all the flight long cannot hold an error that is large in the first minute alone.

The alignment is part of the hypothesis: that of the other model has levelled by biases which this
one denies. Whoever adopts it aligns anew.

The second is a drift of some seconds that larger noise of a whole flight has smoothed over.

Fixes that drift by centimetres a second for half a minute (an ambiguity that converges), or an IMU
that is warmed, put a step into the separation of backward and forward velocities at either end:
many sigmas there, none elsewhere. Larger noise explains such innovations by the likelihood as well,
of the whole flight, and hides the step; a noise that is larger would separate them everywhere.

Steps: of biases at one instant, as motors that start after the rest, a gap of the IMU, a shock.

With lambda and Lambda of the smoother behind an epoch (`navigation.filter.smoother`), a step of the
constant biases b there with the a-priori covariance V has the log evidence

    lambda_b' (V^-1 + Lambda_bb)^-1 lambda_b / 2 - log det(1 + V Lambda_bb) / 2 - log m        (J.1)

(De Jong and Penzer 1998 on shocks of a state), m epochs being as probable a priori. The smoother
has worked out both at a hundred epochs already; where one of them shows a step, a second pass looks
at all epochs around it. The filter is then given V as process noise of the biases (E.9), shared by
the epochs that are about as probable, and the flight is aligned anew.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import ClassVar

import numpy as np

from ...base.errors import DataError
from ...base.units import DEG_PER_H, MILLI_G
from ...records import Array, Finding, Question
from ...records.states import CHANNELS
from ..filter.codes import BIAS, IMU0, VEL
from ..filter.layout import SLOW_BIAS, SLOW_STATE, SlowBias, StateLayout
from ..filter.problem import EstimationProblem, InitialState
from ..filter.solution import Solution, solve
from .candidates import ErrorModel, widen_layout
from .constants import TAKEN_EVIDENCE
from .evidence import ErrorModelSearch, Posed, misfit
from .variances import VarianceSearch

TIMES_S = (30.0, 90.0, 300.0)  # T of a decay
FINER = (3.0**0.5, 3.0**0.25)  # of T about the best, which leaves it 14 % off at most
SLOW_PARAMETERS = 1  # T, which the evidence is charged for
SETTLED_TIMES = 3.0  # times T, after which 5 % of a warm-up are left
# sigmas: of a thousand normal variables the largest is beyond once in a million
PARTED_SIGMAS = 6.0
# sigmas that noise leaves behind now and then; share of the epochs beyond
USUAL_SIGMAS, SHARE_BEYOND_USUAL = 3.0, 0.2
LARGER_NOISE = ("IMU noise", "GNSS sigmas")  # names of checks
NED_LETTERS = ("N", "E", "D")
STATES = ("position", "velocity", "attitude")
# sigma of a step, by channel
SLOW_BIAS_PRIOR = np.array([SLOW_BIAS[sensor] for sensor, _ in CHANNELS])
# log evidence from which a step is suspected: a recorded walk without one shows 9
LEAST_STEP_EVIDENCE = 20.0
AS_MODELLED = "biases that change no more than the noise model says"
BIAS_STEP = "bias step"  # of what is attempted, beside `SLOW_STATE`
AS_PROBABLE = 5.0  # log evidence below the best instant, down to which an epoch shares the step
AT_REST_MPS = 0.5  # smoothed speed, below which a vehicle has not taken off (chosen)
# from a take-off or a gap, within which a step is said to be due to it (chosen)
CAUSED_WITHIN_S = 2.0


def hidden_drift(
    before: Solution, adopted: Solution, adopted_checks: Sequence[Finding]
) -> Finding | None:
    """Say where forward and backward disagreed before another error model was adopted.

    Parameters
    ----------
    before : Solution
        The solution with the errors of the flight file.
    adopted : Solution
        The solution that is gone on with.
    adopted_checks : sequence of Finding
        What its error model says of the flight file.

    Returns
    -------
    Finding or None
        A note; None where they disagree nowhere, still do, or do so throughout, and where no larger
        noise was adopted: a constant, a time offset say, explains such instants.
    """
    if not {check.name for check in adopted_checks} & set(LARGER_NOISE):
        return None
    ratio = _ratios(before)
    if adopted is before or not ratio.size or ratio.max() <= PARTED_SIGMAS:
        return None
    if _ratios(adopted).max(initial=0.0) > PARTED_SIGMAS:
        return None  # which the report says
    if np.mean(ratio.max(axis=1) > USUAL_SIGMAS) > SHARE_BEYOND_USUAL:
        return None
    k, column = np.unravel_index(int(np.argmax(ratio)), ratio.shape)
    time = float(np.abs(before.problem.inc.marks[before.separation_epoch[k]]))
    return Question("drift", f"below {PARTED_SIGMAS:g} sigmas").note(
        "before larger errors were adopted forward and backward disagreed by "
        f"{ratio[k, column]:.1f} sigmas in {STATES[int(column) // 3]} "
        f"{NED_LETTERS[int(column) % 3]} at TOW {time:.1f} s, and agreed elsewhere. The fixes or "
        "the IMU drifted at this time for seconds or minutes, which the adopted noise covers only "
        "on average",
        "look at the quality of the fixes there; do not rely on the sigmas of images near it",
    )


def _ratios(solution: Solution) -> np.ndarray:
    """Separations in their sigmas, (epochs, 9), 0 where they are not known."""
    separation, sigma = solution.separation, solution.separation_sigma
    determined = np.isfinite(separation) & np.isfinite(sigma) & (sigma > 0.0)
    return np.abs(np.divide(separation, sigma, out=np.zeros_like(separation), where=determined))


@dataclass(frozen=True)
class SlowBiasCandidate:
    """A slow bias of the IMU that is suspected.

    Parameters
    ----------
    evidence : float
        Logarithm of its evidence (V.2).
    model : ErrorModel
        The error model with it.
    problem : EstimationProblem
        The flight with its states.
    """

    evidence: float
    model: ErrorModel
    problem: EstimationProblem
    kind: ClassVar[str] = SLOW_STATE

    def solved(self, search: ErrorModelSearch) -> tuple[Solution, InitialState] | None:
        """Align and solve the flight with it; None where there is no solution."""
        search.progress("align and filter, with slow biases of the IMU")
        try:
            start, _ = search.align(self.problem)
            return solve(self.problem, start, search.second_pass, search.progress), start
        except DataError:
            return None

    def check(self, solution: Solution) -> Finding:
        """Say that the IMU warms up, or that its biases drift.

        Parameters
        ----------
        solution : Solution
            The flight solved with the slow bias.

        Returns
        -------
        Finding
            A note: the slow bias is estimated, and the sigmas of the images allow for it.
        """
        states = [
            s for s, one in enumerate(solution.problem.layout.states) if one.group == SLOW_STATE
        ]
        slow = self.model.imu.slow
        assert slow is not None
        factor = slow.time_s if slow.course == "drift" else 1.0
        value = factor * solution.x[0, states]
        sigma = factor * np.sqrt(solution.variance(np.array([0]))[0, IMU0 + np.array(states)])
        gyro, accel = (
            f"{abs(value[c]) / unit:.{digits}f} +- {sigma[c] / unit:.{digits}f} {name}"
            for c, unit, digits, name in (
                (int(np.argmax(np.abs(value[:3]))), DEG_PER_H, 0, "deg/h"),
                (3 + int(np.argmax(np.abs(value[3:]))), MILLI_G, 1, "mg"),
            )
        )
        remedy = "let the IMU warm up before take-off, and keep sun and wind off it"
        if slow.course == "decay":
            course = f"warms up over about {slow.time_s:.0f} s, and the biases change"
            minutes = SETTLED_TIMES * slow.time_s / 60.0
            remedy = f"switch the IMU on {minutes:.1f} minutes or more before take-off"
        elif slow.course == "drift":
            course = "changes its temperature, and the biases drift linearly"
        else:
            course = "is not compensated for temperature, and the biases follow it"
        return Question("IMU warm-up", AS_MODELLED).note(
            f"the IMU {course} by up to {gyro} and {accel} in the flight, log evidence"
            f" {self.evidence:.0f}; estimated, and the sigmas of the images allow for it",
            remedy,
        )


def slow_bias_candidate(
    search: ErrorModelSearch,
    model: ErrorModel,
    problem: EstimationProblem,
    variances: VarianceSearch,
) -> SlowBiasCandidate | None:
    """Look for the slow bias that explains the innovations of a solution best.

    Parameters
    ----------
    search : ErrorModelSearch
        What the search may vary.
    model : ErrorModel
        What is estimated already.
    problem : EstimationProblem
        The problem of the whole flight.
    variances : VarianceSearch
        The search for variances that explain the innovations.

    Returns
    -------
    SlowBiasCandidate or None
        None where the flight shows no slow bias.
    """
    if model.imu.slow is not None:
        return None
    search.progress("biases that warm up or drift")
    evidence: dict[SlowBias, float] = {}

    def best_of(biases: Sequence[SlowBias]) -> SlowBias:
        for slow in biases:
            layout = search.layout(_with_slow_bias(model, slow))
            evidence[slow] = variances.evidence_of(layout, SLOW_PARAMETERS)
        return max(evidence, key=lambda slow: evidence[slow])

    slow = best_of(_courses(problem))
    for factor in FINER if slow.course == "decay" else ():
        slow = best_of([replace(slow, time_s=slow.time_s * f) for f in (1.0 / factor, factor)])
    if evidence[slow] < TAKEN_EVIDENCE:
        return None
    best = _with_slow_bias(model, slow)
    posed = replace(problem, layout=search.layout(best))
    return SlowBiasCandidate(evidence[slow], best, posed)


def _courses(problem: EstimationProblem) -> list[SlowBias]:
    """Return the slow biases to try: decays, a drift, and one by the temperature if it is known."""
    length_s = float(problem.epochs.time[-1] - problem.epochs.time[0])
    biases = [*(SlowBias("decay", time_s) for time_s in TIMES_S), SlowBias("drift", length_s)]
    return [*biases, SlowBias("temperature")] if problem.epochs.temperature.any() else biases


def _with_slow_bias(model: ErrorModel, slow: SlowBias) -> ErrorModel:
    """Return an error model with a slow bias."""
    return replace(model, imu=replace(model.imu, slow=slow))


@dataclass(frozen=True)
class BiasStepCandidate(SlowBiasCandidate):
    """A step of the biases of the IMU that is suspected; its problem has it as process noise."""

    kind: ClassVar[str] = BIAS_STEP

    def check(self, solution: Solution) -> Finding:
        """Say when the biases step, and by how much.

        Parameters
        ----------
        solution : Solution
            The flight solved with the step.

        Returns
        -------
        Finding
            A note: the step is estimated, and the sigmas of the images allow for it.
        """
        epochs = np.flatnonzero(self.problem.epochs.bias_step[:, 0] > 0.0)
        first, last = int(epochs[0]), int(epochs[-1])
        bias = solution.x @ solution.problem.layout.channel_sum().T
        step = np.abs(bias[last] - bias[first - 1])
        gyro, accel = step[:3].max() / DEG_PER_H, step[3:].max() / MILLI_G
        time = float(np.abs(solution.time[last]))
        near = np.abs(solution.time - solution.time[last]) <= CAUSED_WITHIN_S
        moves = np.hypot.reduce(solution.nav[:, VEL], axis=1) > AT_REST_MPS
        when, remedy = "", "mount the IMU so that shocks and heat do not reach it"
        if (self.problem.epochs.gap[near] > 0.0).any():
            when, remedy = " (at a gap of the IMU)", "look for what interrupted the IMU"
        elif not moves[:first].any() or (moves[near].any() and not moves[: np.argmax(near)].any()):
            when = " (when the motors start)"
            remedy = (
                "mount the IMU softer, or let the motors run before the stationary period at the"
                " start"
            )
        return Question("IMU bias step", AS_MODELLED).note(
            f"the biases step by about {gyro:.0f} deg/h and {accel:.1f} mg at TOW {time:.1f} s"
            f"{when}, log evidence {self.evidence:.0f}; estimated, and the sigmas of the images"
            " allow for it",
            remedy,
        )


def courses_beside(
    search: ErrorModelSearch, model: ErrorModel, problem: EstimationProblem, step: SlowBiasCandidate
) -> list[SlowBiasCandidate]:
    """Return slow biases that the whole flight tells from a step.

    The liveliest part, by which slow biases are looked for, may hold no more of a warm-up than a
    step at its beginning: of flights longer than that part nothing but the misfit tells.

    Parameters
    ----------
    search : ErrorModelSearch
        What the search may vary.
    model : ErrorModel
        What is estimated already.
    problem : EstimationProblem
        The problem of the whole flight.
    step : SlowBiasCandidate
        The step that is suspected, whose evidence stands for theirs.

    Returns
    -------
    list of SlowBiasCandidate
        One a course; none where a slow bias is among the states already.
    """
    if model.imu.slow is not None:
        return []
    models = [_with_slow_bias(model, slow) for slow in _courses(problem)]
    return [
        SlowBiasCandidate(step.evidence, one, replace(problem, layout=search.layout(one)))
        for one in models
    ]


def least_misfit(
    search: ErrorModelSearch, candidates: Sequence[SlowBiasCandidate]
) -> tuple[SlowBiasCandidate, Posed, Solution] | None:
    """Align and solve a flight with each of some candidates; return the one that explains most.

    Their evidence is of different parts of the flight, the misfit of the whole.

    Parameters
    ----------
    search : ErrorModelSearch
        What the search may vary.
    candidates : sequence of SlowBiasCandidate
        The candidates.

    Returns
    -------
    tuple of SlowBiasCandidate, Posed and Solution, or None
        The candidate, problem with its start, and solution; None where there is none.
    """
    solved = []
    for one in candidates:
        outcome = one.solved(search)
        if outcome is not None:
            solution, start = outcome
            solved.append((one, (solution.problem, start), solution))
    return min(solved, key=lambda one: misfit(one[2]), default=None)


def bias_step_candidate(
    search: ErrorModelSearch, model: ErrorModel, posed: Posed, solution: Solution
) -> BiasStepCandidate | None:
    """Look for the instant at which a step of the biases explains the innovations best.

    Parameters
    ----------
    search : ErrorModelSearch
        What the search may vary.
    model : ErrorModel
        What is estimated already.
    posed : tuple of EstimationProblem and InitialState
        The problem of the whole flight and its initial state.
    solution : Solution
        The solution with this model, which has separations.

    Returns
    -------
    BiasStepCandidate or None
        None where no instant shows a step, or further sensors take part, of which a wrong constant
        is a rival that no trial here has.
    """
    if solution.adjoint.shape[0] == 0 or solution.problem.measurements:
        return None
    evidence = step_evidence(solution)
    k = int(np.argmax(evidence))
    if evidence[k] < LEAST_STEP_EVIDENCE:
        return None
    search.progress("when the biases of the IMU step")
    chosen = solution.separation_epoch
    around = np.arange(chosen[max(k - 1, 0)], chosen[min(k + 1, chosen.size - 1)] + 1)
    layout = solution.problem.layout
    _, start = widen_layout(*posed, layout)
    try:
        closer = solve(solution.problem, start, "off", separations=around, about=solution)
    except DataError:
        return None
    evidence = step_evidence(closer)
    best = float(evidence.max())
    if best < LEAST_STEP_EVIDENCE:
        return None
    shared = around[evidence > best - AS_PROBABLE]
    # within an interval a step has its mean over it, for which the epochs at its ends are opened
    epochs = np.arange(max(shared[0] - 1, 1), min(shared[-1] + 2, solution.time.size))
    problem = replace(posed[0], layout=search.layout(model))
    return BiasStepCandidate(best, model, with_bias_step(problem, epochs))


def step_evidence(solution: Solution) -> Array:
    """Return the log evidence (J.1) of a step at each epoch of the separations, (s,)."""
    states = constant_biases(solution.problem.layout)
    if states.size == 0:
        return np.full(solution.separation_epoch.size, -np.inf)
    sigma, index = SLOW_BIAS_PRIOR[solution.problem.layout.channel[states]], IMU0 + states
    score = solution.adjoint[:, index] * sigma
    A = solution.information[:, index[:, None], index] * np.outer(sigma, sigma) + np.eye(sigma.size)
    gain = np.einsum("si,si->s", score, np.linalg.solve(A, score[:, :, None])[:, :, 0])
    return 0.5 * (gain - np.linalg.slogdet(A)[1]) - np.log(solution.time.size)


def constant_biases(layout: StateLayout) -> np.ndarray:
    """Return the states that are constant biases or random walks of a channel."""
    return np.flatnonzero((layout.factor == BIAS) & (layout.beta == 0.0))


def with_bias_step(problem: EstimationProblem, epochs: np.ndarray) -> EstimationProblem:
    """Return the problem whose biases may step by `SLOW_BIAS_PRIOR` in all, at some epochs.

    Parameters
    ----------
    problem : EstimationProblem
        The problem.
    epochs : ndarray
        (k,) the epochs, which share the variance.

    Returns
    -------
    EstimationProblem
        The same with process noise there.
    """
    variance = problem.epochs.bias_step.copy()
    variance[epochs] += SLOW_BIAS_PRIOR**2 / epochs.size
    return replace(problem, epochs=problem.epochs._replace(bias_step=variance))
