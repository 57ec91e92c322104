"""The evidence for a candidate: the likelihood of the innovations, and the fixes that it loses.

With the innovations y and their variances S in whitened units (Schweppe 1965), R the covariance of
a fix and k the white share of its error,

    -2 log L = sum over used fixes [ sum (log S_i + y_i^2 / S_i) + log det k^2 R ]
               + (gate + log det k^2 R) for each rejected one                                  (C.1)

The search evaluates it over a window of at most `WINDOW_FIXES` fixes, in which the velocity varies
most; the decision compares `misfit`, the same of the whole flight.

A noise model whose axes have no `turn_on_bias`, as published variances give one, has a variance of
zero: it takes the constant biases of the sensors for zero. Where the innovations show them, the
solution is wrong.
"""

from collections.abc import Callable
from dataclasses import dataclass, field, replace
from typing import Literal

import numpy as np

from ...base.errors import DataError
from ...base.findings.remedies import Remedy, SetKey
from ...base.findings.scale_prior import UNKNOWN_SCALE, ScalePrior
from ...base.units import STANDARD_GRAVITY
from ...records import Finding, Question
from ...records.cameras.mounting import Mounting
from ...records.states import LEVER_ARM
from ..filter.codes import NOT_MEASURED, POSITION_ROW, REJECTED, USED, VEL
from ..filter.filter import make_history, run_filter
from ..filter.kernels.records import FilterHistory
from ..filter.layout import FixErrors, StateLayout
from ..filter.problem import EstimationProblem, InitialState, sub_problem
from ..filter.solution import Solution, solve
from ..innovations.pieces import sub_solution
from ..noise_model.model import NoiseModel
from .candidates import (
    ErrorModel,
    LayoutFactory,
    widen_layout,
    with_every_constant,
)
from .constants import ConstantsEvidence, constants_evidence, followed_constants
from .estimated import fix_counts
from .sensitivity import Sensitivity

WINDOW_FIXES = 900  # of the window over which candidates are compared
GAIN = 20.0  # in -2 log L, from which a candidate is accepted
IMPOSSIBLE = 1e12  # -2 log L of a candidate with which the filter diverges
MOST_LOST, MOST_NIS = 0.05, 2.0  # share of the fixes and NIS that a remedy may leave
MORE_LOST = 0.01  # of the fixes offered: so many more rejected ones count as lost
FEWEST_FIXES = 60  # below which the innovations are not looked at

TURN_ON = {  # a-priori sigma of a calibrated MEMS IMU, rad/s and m/s^2
    "gyro": np.radians(100.0) / 3600.0,
    "accel": 2e-3 * STANDARD_GRAVITY,
}
TURN_ON_ADVICE = (
    "set turn_on_bias in the noise model: 100 deg/h and 2 mg suit a calibrated MEMS IMU, or take"
    " the values measured in its recordings at rest"
)

SecondPass = Literal["auto", "on", "off"]
Posed = tuple[EstimationProblem, InitialState]
Align = Callable[[EstimationProblem], tuple[InitialState, str]]
"""Gives the initial state of a problem and how it was found, or raises DataError."""


@dataclass(frozen=True)
class FixClaims:
    """What is known beforehand of the sigmas that the fixes claim, and which key scales them.

    Parameters
    ----------
    scale : ScalePrior
        Prior of the factor that makes the positions' sigmas of such a source right.
    sigma_m : tuple of float, optional
        (3,) the flight file's, m, north, east, down, where their source states none.
    white_scale : float
        The flight file's factor of the sigmas that a source states.
    """

    scale: ScalePrior = UNKNOWN_SCALE
    sigma_m: tuple[float, ...] | None = None
    white_scale: float = 1.0

    def advised(self, k: float) -> Remedy:
        """Return the key that takes the factor `k` of the positions' sigmas into the flight."""
        if k <= 1.0:
            return "nothing to do: the result allows for it"
        if self.sigma_m is not None:
            return SetKey("gnss.sigma_m", [float(f"{k * sigma:.3g}") for sigma in self.sigma_m])
        return SetKey("gnss.white_scale", float(f"{k * self.white_scale:.3g}"))


NO_CLAIMS = FixClaims()
"""Nothing is known beforehand: every factor is said, and `gnss.white_scale` advised."""


@dataclass(frozen=True)
class ErrorModelSearch:
    """What the search may vary, and how its candidates are solved.

    Parameters
    ----------
    requested_errors : FixErrors
        The errors of the fixes that the flight file asks for.
    layout_factory : LayoutFactory
        The error states of the flight as a function of those of its fixes.
    mounting : Mounting
        The mounting of the flight file, with which estimates are compared.
    time_correlated : bool
        Whether a time-correlated GNSS error may be adopted.
    second_pass : str
        Of the adopted solution, as `navigation.filter.solution.solve` takes it.
    progress : callable
        Receives the name of each step.
    align : callable
        Gives the initial state of a problem and how it was found; it is part of biases that drift
        or step.
    variances : bool
        Whether variances compete; `tune` estimates them by itself.
    requested : tuple of str
        Groups of constants that the flight file has estimated; they are not suspected.
    events_with_fixes : bool
        Whether the clock of the fixes stamps the exposures.
    exposures : bool
        Whether there are any, whose place depends on that of the IMU in the mounting.
    claims : FixClaims
        What is known beforehand of the sigmas of the fixes.
    drafted : bool
        Whether the noise model of the IMU is a draft, which the flight corrects both ways.
    """

    requested_errors: FixErrors
    layout_factory: LayoutFactory
    mounting: Mounting
    time_correlated: bool
    second_pass: SecondPass
    progress: Callable[[str], None]
    align: Align
    requested: tuple[str, ...] = ()
    variances: bool = True
    events_with_fixes: bool = False
    exposures: bool = False
    claims: FixClaims = NO_CLAIMS
    drafted: bool = False
    _latest: list[tuple[tuple[object, ...], Solution | None]] = field(
        default_factory=list, init=False, repr=False, compare=False
    )  # request and outcome of `solved`, one at most

    @property
    def requested_model(self) -> ErrorModel:
        """What is estimated of the errors of fixes and IMU as the flight file has it."""
        return ErrorModel(self.requested_errors)

    @property
    def exact(self) -> tuple[str, ...]:
        """Groups of constants that the flight file states as exact."""
        of_arm = self.mounting.antenna_sigma_m == 0.0 and LEVER_ARM not in self.requested
        return (LEVER_ARM,) if of_arm else ()

    def layout(self, model: ErrorModel) -> StateLayout:
        """Return the error states of an error model."""
        return self.layout_factory(model.fixes, model.imu)

    def constants(
        self, problem: EstimationProblem, start: InitialState, model: ErrorModel
    ) -> ConstantsEvidence | None:
        """Return what a flight says of its constants under an error model."""
        wide = self.layout(with_every_constant(model))
        own = self.layout(model)
        return constants_evidence(problem, start, own, wide, self.requested, self.exact)

    def followed(self, problem: EstimationProblem) -> Sensitivity | None:
        """Return what is to go along with the first pass over a flight.

        What it finds of the constants may spare the pass of `constants`; None where there are too
        few fixes for it, or where they cannot be followed.
        """
        if np.count_nonzero(problem.epochs.has_position) < FEWEST_FIXES:
            return None
        wide = self.layout(with_every_constant(self.requested_model))
        return followed_constants(problem, wide)

    def solved(self, posed: Posed, model: ErrorModel) -> Solution | None:
        """Solve again with another error model; None where there is no solution.

        The evidence of a hypothesis and its adoption may ask for the same one after the other.
        """
        problem, start = posed
        if self._latest:
            (of_problem, of_start, of_model), solution = self._latest[0]
            if of_problem is problem and of_start is start and of_model == model:
                return solution
        again = widen_layout(problem, start, self.layout(model))
        try:
            solution = solve(*again, self.second_pass, self.progress)
        except DataError:
            solution = None
        self._latest[:] = [((problem, start, model), solution)]
        return solution

    def misfit_of(self, posed: Posed, model: ErrorModel) -> float:
        """Return `misfit` of one pass with another error model; infinite without a solution.

        Nothing is smoothed, unless measurements are linearised about what is.
        """
        problem, start = widen_layout(*posed, self.layout(model))
        if problem.measurements:
            quick = replace(self, second_pass="off", progress=lambda _: None)
            solution = quick.solved(posed, model)
            return np.inf if solution is None else misfit(solution)
        history = make_history(problem.epochs, problem.layout, smoothed=False)
        try:
            run_filter(problem, start, history)
        except DataError:
            return np.inf
        return misfit_of_pass(history, problem.gate)

    def of_fixes(self, model: ErrorModel) -> LayoutFactory:
        """Return the error states as a function of those of the fixes, with the model's IMU."""
        return lambda fixes: self.layout_factory(fixes, model.imu)


def liveliest_window(solution: Solution) -> tuple[EstimationProblem, InitialState]:
    """Cut the window in which the velocity varies most out of a solved flight.

    Parameters
    ----------
    solution : Solution
        The solved flight.

    Returns
    -------
    tuple of EstimationProblem and InitialState
        At most `WINDOW_FIXES` fixes as a problem of its own, and an initial state at what the
        solution knows there, with three times its sigma and a metre and a metre a second more.
    """
    first, last = _liveliest(solution, WINDOW_FIXES)
    P = 9.0 * solution.covariance(np.array([first]))[0]
    P[:6, :6] += np.eye(6)
    nav, x = solution.nav[first], solution.x[first].copy()
    layout = solution.problem.layout
    if layout.rate >= 0:  # time begins anew in the window
        x[layout.offset] += x[layout.rate] * solution.problem.epochs.time[first]
    # (C.1) knows no robust weights
    window = replace(sub_problem(solution.problem, first, last), huber_threshold=np.inf)
    return window, InitialState(nav, x, np.zeros(P.shape[0]), P)


def liveliest_part(solution: Solution, fixes: int) -> Solution:
    """Return the part of a solved flight in which the velocity varies most.

    Parameters
    ----------
    solution : Solution
        The solved flight.
    fixes : int
        The greatest number of fixes of the part.

    Returns
    -------
    Solution
        The part; the solution itself where it has no more.
    """
    if np.count_nonzero(solution.problem.epochs.has_position) <= fixes:
        return solution
    return sub_solution(solution, *_liveliest(solution, fixes))


def _liveliest(solution: Solution, fixes: int) -> tuple[int, int]:
    """Return first and last epoch of the window of fixes in which the velocity varies most."""
    epochs = np.flatnonzero(solution.problem.epochs.has_position)
    count = min(fixes, epochs.size - 1)
    v = solution.nav[epochs, VEL]
    sums = np.cumsum(np.concatenate([np.zeros((1, 6)), np.hstack([v, v**2])]), axis=0)
    moments = (sums[count:] - sums[:-count]) / count
    variance = np.sum(moments[:, 3:] - moments[:, :3] ** 2, axis=1)
    k = int(np.argmax(variance[: epochs.size - count]))
    return int(epochs[k]), int(epochs[k + count])


def minus_two_log_likelihood(problem: EstimationProblem, start: InitialState) -> float:
    """Evaluate (C.1) by one run of the filter; `IMPOSSIBLE` where it diverges."""
    history = make_history(problem.epochs, problem.layout, smoothed=False)
    try:
        run_filter(problem, start, history)
    except DataError:
        return IMPOSSIBLE
    measured = np.flatnonzero(history.verdict[:, POSITION_ROW] != NOT_MEASURED)
    rejected = history.verdict[measured, POSITION_ROW] == REJECTED
    log_R = np.linalg.slogdet(problem.epochs.position_cov[measured])[1] + 2.0 * np.sum(
        np.log(problem.layout.white_scales[problem.epochs.group[measured]]), axis=1
    )
    S, y = history.S[measured, :3], history.y[measured, :3]
    S = np.where(rejected[:, None], 1.0, S)
    fix_cost = np.where(rejected, problem.gate, np.sum(np.log(S) + y**2 / S, axis=1))
    return float(np.sum(fix_cost + log_R))


def misfit(solution: Solution) -> float:
    """Evaluate (C.1) of the whole flight from the innovations of its solution.

    The correlations between the components of an innovation are left out.
    """
    return misfit_of_pass(solution, solution.problem.gate)


def misfit_of_pass(passed: Solution | FilterHistory, gate: float) -> float:
    """Evaluate `misfit` of what a forward pass left, under the gate of its problem."""
    measured = np.flatnonzero(passed.verdict[:, POSITION_ROW] != NOT_MEASURED)
    rejected = passed.verdict[measured, POSITION_ROW] == REJECTED
    size = np.where(rejected, gate, np.minimum(passed.nis[measured, 0], gate))
    log_sigma = np.sum(np.log(passed.innovation_sigma[measured, :3]), axis=1)
    return float(np.sum(size + 2.0 * log_sigma))


def loses_fixes(solution: Solution, before: Solution) -> bool:
    """Tell whether a solution makes less use of the fixes than another one did.

    Parameters
    ----------
    solution, before : Solution
        The solution in question, and the one that it is compared with.

    Returns
    -------
    bool
        Whether it rejects a hundredth (`MORE_LOST`) of the fixes more, or has more covariance
        resets after rejected fixes (`navigation.filter.filter`, K.7).
    """
    offered, rejected_before, resets_before = fix_counts(before.verdict)
    _, rejected, resets = fix_counts(solution.verdict)
    return rejected > rejected_before + MORE_LOST * offered or resets > resets_before


def follows(solution: Solution) -> bool:
    """Tell whether a solution follows its fixes: a remedy that leaves the innovations is none.

    Parameters
    ----------
    solution : Solution
        The solved flight.

    Returns
    -------
    bool
        Whether it rejects few (`MOST_LOST`), and the mean NIS of the others is near its expectation
        (`MOST_NIS`).
    """
    offered, rejected, _ = fix_counts(solution.verdict)
    used = solution.nis[solution.verdict[:, POSITION_ROW] == USED, POSITION_ROW]
    return bool(rejected <= MOST_LOST * offered and np.mean(used) / 3.0 < MOST_NIS)


def without_turn_on(noise: NoiseModel) -> tuple[str, ...]:
    """Name the sensors with noise of which an axis has no turn-on bias.

    Parameters
    ----------
    noise : NoiseModel
        The noise model of the IMU.

    Returns
    -------
    tuple of str
        Some of "gyro" and "accel".
    """
    return tuple(
        sensor
        for sensor in TURN_ON
        if any(a.white_noise > 0.0 and a.turn_on_bias == 0.0 for a in getattr(noise, sensor))
    )


def with_turn_on(noise: NoiseModel) -> NoiseModel:
    """Give every axis that has no turn-on bias one of `TURN_ON`.

    Parameters
    ----------
    noise : NoiseModel
        The noise model of the IMU.

    Returns
    -------
    NoiseModel
        The model with turn-on biases; those that it has stay.
    """
    gx, gy, gz = (
        replace(axis, turn_on_bias=axis.turn_on_bias or TURN_ON["gyro"]) for axis in noise.gyro
    )
    ax, ay, az = (
        replace(axis, turn_on_bias=axis.turn_on_bias or TURN_ON["accel"]) for axis in noise.accel
    )
    return replace(noise, gyro=(gx, gy, gz), accel=(ax, ay, az))


def check_turn_on(noise: NoiseModel) -> Finding:
    """Note what a noise model that `without_turn_on` names does.

    Parameters
    ----------
    noise : NoiseModel
        A noise model of which a sensor lacks turn-on biases.

    Returns
    -------
    Finding
        The note "turn-on bias".
    """
    missing = " and ".join(without_turn_on(noise))
    finding = (
        f"noise model {noise.name} has no turn_on_bias of {missing}, so constant biases are taken "
        "as zero"
    )
    return Question("turn-on bias", "turn_on_bias of gyro and accel").note(finding, TURN_ON_ADVICE)


def check_biases_in_innovations(
    noise: NoiseModel, solution: Solution | None, solve_with_biases: Callable[[], Solution]
) -> Finding | None:
    """Check whether the innovations show the turn-on biases that a noise model lacks.

    Parameters
    ----------
    noise : NoiseModel
        A noise model of which a sensor lacks turn-on biases.
    solution : Solution or None
        The solution without these biases; None where there is none.
    solve_with_biases : callable
        Solves the same problem with the biases among its states.

    Returns
    -------
    Finding or None
        The contradiction "turn-on bias" where they gain more than `evidence.GAIN` in (C.1).
    """
    try:
        candidate = solve_with_biases()
    except DataError:
        return None
    gain = np.inf if solution is None else misfit(solution) - misfit(candidate)
    if gain <= GAIN:
        return None
    reason = f"estimating them lowers the misfit -2 log L by {gain:.0f}, limit {GAIN:g}"
    if solution is None:
        reason = "no solution without them"
    check = check_turn_on(noise)
    finding = f"{check.found}, and the innovations show them ({reason})"
    return replace(check, found=finding, verdict="contradiction")
