"""Biases that drift: slow ones as states, and some seconds that larger noise has smoothed over.

Slow biases: an IMU warms up after it was switched on, or its temperature drifts.

Every channel has a bias a exp(-t/T), or one that grows linearly, with `SLOW_BIAS` as a-priori sigma
of a: states without driving noise (`navigation.filter.layout`). T is looked for on the grid
`TIMES_S` by the likelihood of the innovations, and competes with larger noise by its evidence
(V.2). A random walk that is as large all the flight long cannot hold an error that is large in the
first minute alone.

The alignment is part of the hypothesis: that of the other model has levelled by biases which this
one denies. Whoever adopts it aligns anew.

The second is a drift of some seconds that larger noise of a whole flight has smoothed over.

Fixes that drift by centimetres a second for half a minute (an ambiguity that converges), or an IMU
that is warmed, put a step into the separation of backward and forward velocities at either end:
many sigmas there, none elsewhere. Larger noise explains such innovations by the likelihood as well,
of the whole flight, and hides the step; a noise that is larger would separate them everywhere.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from ...base.errors import DataError
from ...base.units import DEG_PER_H, MILLI_G
from ...records import Finding, Question
from ..filter.codes import IMU0
from ..filter.layout import SLOW, SlowBias
from ..filter.problem import EstimationProblem, InitialState
from ..filter.solution import Solution, solve
from .candidates import ErrorModel
from .constants import TAKEN
from .evidence import ErrorModelSearch
from .variances import VarianceSearch

TIMES_S = (30.0, 90.0, 300.0, np.inf)  # T of the course
FINER = (3.0**0.5, 3.0**0.25)  # of T about the best, which leaves it 14 % off at most
PARAMETERS = 1  # T, which the evidence is charged for
SETTLED = 3.0  # times T, after which 5 % of a warm-up are left
APART = 6.0  # sigmas: of a thousand normal variables the largest is beyond once in a million
USUAL, FEW = 3.0, 0.2  # sigmas that noise leaves behind now and then; share of the epochs beyond
LARGER_NOISE = ("IMU noise", "GNSS sigmas")  # names of checks
AXES = ("N", "E", "D")
STATES = ("position", "velocity", "attitude")


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
    if adopted is before or not ratio.size or ratio.max() <= APART:
        return None
    if _ratios(adopted).max(initial=0.0) > APART:
        return None  # which the report says
    if np.mean(ratio.max(axis=1) > USUAL) > FEW:
        return None
    k, column = np.unravel_index(int(np.argmax(ratio)), ratio.shape)
    time = float(np.abs(before.problem.inc.marks[before.separation_epoch[k]]))
    return Question("drift", f"below {APART:g} sigmas").note(
        f"before larger errors were adopted forward and backward disagreed by"
        f" {ratio[k, column]:.1f} sigmas in {STATES[int(column) // 3]} {AXES[int(column) % 3]} at"
        f" TOW {time:.1f} s, and agreed elsewhere: about then the fixes or the IMU drifted for"
        " seconds or minutes, which the adopted noise holds in the mean only",
        "look at the quality of the fixes there; do not rely on the sigmas of images near it",
    )


def _ratios(solution: Solution) -> np.ndarray:
    """Separations in their sigmas, (epochs, 9), 0 where they are not known."""
    apart, sigma = solution.separation, solution.separation_sigma
    determined = np.isfinite(apart) & np.isfinite(sigma) & (sigma > 0.0)
    return np.abs(np.divide(apart, sigma, out=np.zeros_like(apart), where=determined))


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

    def solved(self, search: ErrorModelSearch) -> tuple[Solution, InitialState] | None:
        """Align and solve the flight with it; None where there is no solution."""
        assert search.align is not None
        search.progress("align and filter, with slow biases of the IMU")
        try:
            start = search.align(self.problem)
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
        states = [s for s, one in enumerate(solution.problem.layout.states) if one.group == SLOW]
        slow = self.model.imu.slow
        assert slow is not None
        warms_up = np.isfinite(slow.time_s)
        factor = 1.0 if warms_up else slow.duration_s
        value = factor * solution.x[0, states]
        sigma = factor * np.sqrt(solution.variance(np.array([0]))[0, IMU0 + np.array(states)])
        gyro, accel = (
            f"{abs(value[c]) / unit:.{digits}f} +- {sigma[c] / unit:.{digits}f} {name}"
            for c, unit, digits, name in (
                (int(np.argmax(np.abs(value[:3]))), DEG_PER_H, 0, "deg/h"),
                (3 + int(np.argmax(np.abs(value[3:]))), MILLI_G, 1, "mg"),
            )
        )
        course = f"warms up over about {slow.time_s:.0f} s: its biases change"
        remedy = (
            f"switch the IMU on {SETTLED * slow.time_s / 60.0:.1f} minutes or more before take-off"
        )
        if not warms_up:
            course = "changes its temperature: its biases drift linearly"
            remedy = "let the IMU warm up before take-off, and keep sun and wind off it"
        return Question("IMU warm-up", "biases that change no more than the noise model says").note(
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
        None where the flight shows no slow bias, or cannot be aligned anew.
    """
    if search.align is None or model.imu.slow is not None:
        return None
    search.progress("biases that warm up or drift")
    duration_s = float(problem.epochs.time[-1] - problem.epochs.time[0])
    evidence: dict[float, float] = {}

    def with_slow(time_s: float) -> ErrorModel:
        return replace(model, imu=replace(model.imu, slow=SlowBias(time_s, duration_s)))

    def best_of(times_s: Sequence[float]) -> float:
        for time_s in times_s:
            evidence[time_s] = variances.evidence_of(search.layout(with_slow(time_s)), PARAMETERS)
        return max(evidence, key=lambda time_s: evidence[time_s])

    time_s = best_of(TIMES_S)
    for factor in FINER if np.isfinite(time_s) else ():
        time_s = best_of((time_s / factor, time_s * factor))
    if evidence[time_s] < TAKEN:
        return None
    best = with_slow(time_s)
    posed = replace(problem, layout=search.layout(best))
    return SlowBiasCandidate(evidence[time_s], best, posed)
