"""Sensors that show the motion late, or worse in turns: one table of them, and how they are tried.

Such a sensor looks like a wrong lever arm or clock. That is no state: what it measured is corrected
(`SensorDynamics`) and the flight solved again.

    gyros later than accelerometers by d    the rotation is taken d later
    a receiver's tracking loop of natural   fixes lag by a / w^2, a the antenna's acceleration: in
    frequency w                             a coordinated turn a lever arm g / w^2 too low
    a receiver that predicts by T           they lag by a T^2 / 2
    a receiver that averages over T         they lead by a T^2 / 24
    a bias b of the accelerometers at a     vibration rectification: b (|f| / g - 1), which acts in
    g of load more                          turns alone, as a lever arm does

In a coordinated turn the antenna's acceleration is a = g + C_lb (0, 0, -|f|). Fixes that lag by c a
are then those of an antenna c |f| lower, less c g: a lever-arm state takes the first with its
a-priori sigma alone as resistance, and all heights are c g off, in silence. So where that state has
left zero, a lag is tried, too. With q the probability of what is not adopted, d the shift between
both solutions and r = sigma / c of the lag, the positions share besides

    (q + p r^2) d d'  with the lag adopted, p = 1 - q,      q (1 + r^2) d d'  without      (R.1)
"""

from collections.abc import Callable, Collection, Sequence
from dataclasses import dataclass, replace
from itertools import combinations

import numpy as np

from ...base.errors import DataError
from ...base.units import MILLI_G, STANDARD_GRAVITY
from ...geodesy.rotation import rotation_from_quaternion
from ...records import Array, Finding, Question
from ...records.cameras.mounting import UNSTATED_PHASE_CENTRE_SIGMA_M
from ...records.interpolation import columns_at
from ...records.states import State
from ..filter.codes import POS, QUAT, VEL
from ..filter.problem import EstimationProblem
from ..filter.smoother import SharedError
from ..filter.solution import Solution, solve
from .advice import millimetres
from .candidates import ErrorModel, with_every_constant
from .constants import OTHERS
from .estimated import MOVED_M, has_moved
from .evidence import ErrorModelSearch, Posed, misfit

LOAD_S = 0.25  # s on either side, over which the load factor is a mean: longer than vibration lasts
# share of the evidence to be exceeded that the parabola of a delay promises where the flight is
# solved with it: of promises beyond 30, 0.9 to 1.3 came true, and 2.6 with fixes lost before
LEAST_PROMISED = 0.3


Corrected = Callable[[Array], EstimationProblem]
"""Returns the problem without an error of a sensor, of the parameters of that error."""


def with_earlier_gyros(problem: EstimationProblem, solution: Solution) -> Corrected:
    """Return what takes gyros that are late to the stamps of the accelerometers.

    Parameters
    ----------
    problem : EstimationProblem
        The problem.
    solution : Solution
        Its solution, of which nothing is needed.

    Returns
    -------
    callable
        Returns the problem with other angle increments and rates, of their delay (1,), s.
    """
    inc, time = problem.inc, problem.epochs.time
    nodes = np.concatenate([[0.0], np.cumsum(inc.dt)])
    ends = 1.0 / inc.dt[[0, -1], None] * inc.dtheta[[0, -1]]  # held for a second beyond
    steps = np.concatenate([ends[:1], inc.dtheta, ends[1:]])
    extended = np.concatenate([[-1.0], nodes, [nodes[-1] + 1.0]])
    angle = np.concatenate([np.zeros((1, 3)), np.cumsum(steps, axis=0)])

    def corrected(late_s: Array) -> EstimationProblem:
        shifted = columns_at(nodes + late_s, extended, angle)
        rate = columns_at(time + late_s, time, inc.rate)
        earlier = replace(inc, dtheta=np.diff(shifted, axis=0), rate=rate)
        return replace(problem, inc=earlier, epochs=problem.epochs._replace(rate=rate))

    return corrected


def with_followed_fixes(problem: EstimationProblem, solution: Solution) -> Corrected:
    """Return what takes their lag behind the antenna off the fixes.

    Parameters
    ----------
    problem : EstimationProblem
        The problem.
    solution : Solution
        Its solution, which gives the acceleration of the antenna.

    Returns
    -------
    callable
        Returns the problem with other positions, of what they lag by at 1 m/s^2, m: (1,), 1 / w^2
        of the receiver's tracking loop, s^2.
    """
    epochs, fixes = problem.epochs, np.flatnonzero(problem.epochs.has_position)
    nav, time = solution.nav[fixes], problem.epochs.time[fixes]
    arm = rotation_from_quaternion(nav[:, QUAT]) @ problem.antenna_lever_b
    velocity = nav[:, VEL] + np.gradient(arm, time, axis=0)
    acceleration = np.gradient(velocity, time, axis=0)

    def corrected(lag_s2: Array) -> EstimationProblem:
        position = epochs.position.copy()
        position[fixes] += lag_s2 * acceleration
        return replace(problem, epochs=epochs._replace(position=position))

    return corrected


def without_load_bias(problem: EstimationProblem, solution: Solution) -> Corrected:
    """Return what takes a bias that grows with the load factor off the accelerometers.

    Parameters
    ----------
    problem : EstimationProblem
        The problem.
    solution : Solution
        Its solution, of which nothing is needed.

    Returns
    -------
    callable
        Returns the problem with other velocity increments, of the bias (3,) at 2 g less that at
        1 g, m/s^2.
    """
    inc = problem.inc
    nodes = np.concatenate([[0.0], np.cumsum(inc.dt)])
    sums = np.concatenate([np.zeros((1, 3)), np.cumsum(inc.dvel, axis=0)])
    ends = np.clip([nodes[:-1] - LOAD_S, nodes[1:] + LOAD_S], 0.0, nodes[-1])
    before, after = (columns_at(end, nodes, sums) for end in ends)
    load = np.linalg.norm(after - before, axis=1) / (ends[1] - ends[0]) / STANDARD_GRAVITY - 1.0
    gained_s = load * inc.dt

    def corrected(bias: Array) -> EstimationProblem:
        return replace(problem, inc=replace(inc, dvel=inc.dvel - np.outer(gained_s, bias)))

    return corrected


def delay_in_words(value: Array, sigma: Array) -> str:
    """Describe gyros that are late."""
    side = "later" if value[0] > 0.0 else "earlier"
    delay = f"{1e3 * abs(value[0]):.1f} +- {1e3 * sigma[0]:.1f}"
    return f"gyros {delay} ms {side} than accelerometers"


def loop_in_words(value: Array, sigma: Array) -> str:
    """Describe a receiver that lags, or whose fixes are means."""
    size = f"by {millimetres(abs(value[0]))} +- {millimetres(sigma[0])} mm at 1 m/s^2"
    if value[0] < 0.0:
        return f"fixes smoothed over some {(-24.0 * value[0]) ** 0.5:.1f} s, which cut turns {size}"
    hertz = 0.5 / np.pi / max(value[0], 1e-6) ** 0.5
    return f"a tracking loop of the receiver of {hertz:.1f} Hz, which lags {size}"


def load_bias_in_words(value: Array, sigma: Array) -> str:
    """Describe accelerometers whose biases grow with the load factor."""
    biases = ", ".join(
        f"{axis} {one / MILLI_G:+.1f} +- {its_sigma / MILLI_G:.1f}"
        for axis, one, its_sigma in zip("xyz", value, sigma, strict=True)
    )
    return f"accelerometer biases that grow with the load factor, by {biases} mg per g"


@dataclass(frozen=True)
class SensorDynamics:
    """Errors of a sensor that follow the motion, by a few parameters.

    Parameters
    ----------
    name, expected : str
        Those of its check.
    trial : tuple of float
        Of each parameter the size by which it is tried.
    prior, least : float
        The a-priori sigma of each, and the smallest that exists.
    corrected : callable
        Returns what makes the problem without it of its parameters.
    in_words : callable
        Describes the parameters and their sigmas.
    remedy : str
        What to do about it.
    of_motion : bool
        Whether the correction depends on the solution.
    """

    name: str
    expected: str
    trial: tuple[float, ...]
    prior: float
    least: float
    corrected: Callable[[EstimationProblem, Solution], Corrected]
    in_words: Callable[[Array, Array], str]
    remedy: str
    of_motion: bool = False


DYNAMICS = (
    SensorDynamics(
        "gyro delay",
        "gyros and accelerometers of one instant",
        (2e-3,),
        5e-3,  # s: filters of MEMS gyros delay by 1 to 10 ms
        -np.inf,
        with_earlier_gyros,
        delay_in_words,
        "set the same filter for gyros and accelerometers in the IMU, or shift the gyro columns",
    ),
    SensorDynamics(
        "receiver dynamics",
        "fixes that do not lag",
        (3e-3,),
        0.025,  # s^2: receivers that smooth have loops of 1 Hz and more
        -np.inf,
        with_followed_fixes,
        loop_in_words,
        "set the receiver to high dynamics, without smoothing of carrier or positions",
        of_motion=True,
    ),
    SensorDynamics(
        "load-dependent bias",
        "biases that do not depend on the load factor",
        (5.0 * MILLI_G,) * 3,
        20.0 * MILLI_G,  # m/s^2 a g: rectification makes some milli-g in a turn of 1.2 g
        -np.inf,
        without_load_bias,
        load_bias_in_words,
        "mount the IMU softer, as vibration that grows in turns biases the accelerometers",
    ),
)


@dataclass(frozen=True)
class DynamicsTrial:
    """A flight that was solved again without the delay of a sensor.

    Parameters
    ----------
    dynamics : SensorDynamics
        Which delay.
    value, sigma : ndarray
        Its parameters, and how well the flight tells them.
    evidence : float
        Logarithm, against none.
    posed : tuple of EstimationProblem and InitialState
        The problem without it.
    solution : Solution
        The solution of it.
    """

    dynamics: SensorDynamics
    value: Array
    sigma: Array
    evidence: float
    posed: Posed
    solution: Solution

    @property
    def probability(self) -> float:
        """That of the delay, against none."""
        return float(1.0 / (1.0 + np.exp(-self.evidence)))

    def shared_error(self, before: Solution, adopted: bool = True) -> SharedError:
        """Return what the positions share besides, of this solution or of the one before (R.1).

        Parameters
        ----------
        before : Solution
            The solution without the delay.
        adopted : bool
            Whether the result is that with the delay.
        """
        shift = np.mean(self.solution.nav[:, POS] - before.nav[:, POS], axis=0)
        spread = self.sigma @ self.sigma / (self.value @ self.value)
        p = self.probability
        share = 1.0 - p + p * spread if adopted else p * (1.0 + spread)
        return SharedError(0, before.time.size - 1, share * np.outer(shift, shift))

    @property
    def sentence(self) -> str:
        """What delays, and by how much."""
        return self.dynamics.in_words(self.value, self.sigma)

    def check(self) -> Finding:
        """Return a note that a sensor has such errors, which have been corrected in the result."""
        undecided = self.dynamics.of_motion and self.evidence < OTHERS
        either = "; or the antenna is off, up or down: the sigmas allow for both" * undecided
        return Question(self.dynamics.name, self.dynamics.expected).note(
            f"{self.sentence}, log evidence {self.evidence:.0f}; corrected in the result{either}",
            self.dynamics.remedy,
        )


def without_gate(problem: EstimationProblem) -> EstimationProblem:
    """Return a problem that uses every fix, each with its own weight."""
    return replace(problem, gate=np.inf, huber_threshold=np.inf)


def arm_has_moved(solution: Solution) -> bool:
    """Tell whether the state of the lever arm has left zero, downwards or upwards.

    Not one that the flight is to find, whose a-priori sigma is wide: there a lag is not tried.
    """
    layout, down = solution.problem.layout, solution.problem.layout.lever + 2
    if layout.lever < 0 or layout.sigma0[down] > UNSTATED_PHASE_CENTRE_SIGMA_M:
        return False
    return has_moved(solution, down, MOVED_M)


def lag_beside_arm(
    search: ErrorModelSearch, posed: Posed, model: ErrorModel, solution: Solution
) -> DynamicsTrial | None:
    """Look for a lag of the fixes in what the state of the lever arm has taken (R.1)."""
    lags = [one for one in DYNAMICS if one.of_motion]
    return next(iter(dynamics_trials(search, posed, model, solution, lags)), None)


def late_sensors(
    search: ErrorModelSearch,
    posed: Posed,
    model: ErrorModel,
    solution: Solution,
    attempted: Collection[State | str] = (),
    least: float = -np.inf,
) -> list[DynamicsTrial]:
    """Look for errors of sensors that follow the motion.

    Parameters
    ----------
    search, posed, model, solution : ErrorModelSearch, Posed, ErrorModel, Solution
        As in `dynamics_trial`.
    attempted : collection of str
        Names of those that are not tried again.
    least : float
        The log evidence that they must exceed.

    Returns
    -------
    list of DynamicsTrial
        The best first.
    """
    untried = [dynamics for dynamics in DYNAMICS if dynamics.name not in attempted]
    trials = dynamics_trials(search, posed, model, solution, untried, least)
    return [one for one in trials if one.evidence > least]


def dynamics_trials(
    search: ErrorModelSearch,
    posed: Posed,
    model: ErrorModel,
    solution: Solution,
    every: Sequence[SensorDynamics],
    least: float = -np.inf,
) -> list[DynamicsTrial]:
    """Look for the delays of sensors that explain the innovations; those that have one, best first.

    The parameters are those of `dynamics_trial`. Without some that stay below the evidence `least`.
    """
    opened = without_gate(posed[0])
    same = search.misfit_of((opened, posed[1]), model) if every else np.nan
    trials = (
        dynamics_trial(search, posed, model, solution, one, same, least=least) for one in every
    )
    return sorted((one for one in trials if one is not None), key=lambda one: -one.evidence)


def dynamics_trial(
    search: ErrorModelSearch,
    posed: Posed,
    model: ErrorModel,
    solution: Solution,
    dynamics: SensorDynamics,
    same: float,
    about: Solution | None = None,
    least: float = -np.inf,
) -> DynamicsTrial | None:
    """Look for the delay of a sensor that explains the innovations best.

    `misfit` is quadratic in it: solutions on either side give its minimum, with an open gate.

    Parameters
    ----------
    search : ErrorModelSearch
        How candidates are solved.
    posed : tuple of EstimationProblem and InitialState
        The problem and its initial state.
    model : ErrorModel
        What is estimated already.
    solution : Solution
        The solution with this model.
    dynamics : SensorDynamics
        The delay.
    same : float
        The misfit without it, with an open gate.
    about : Solution, optional
        The solution that gives the motion; by default the one with the delay. Where that is larger
        than usual, the motion is taken from the corrected one in a second trial.
    least : float
        The log evidence that it must exceed: what promises less than `LEAST_PROMISED` of it is not
        solved.

    Returns
    -------
    DynamicsTrial or None
        None where there is none of its sign, or no solution, or where it promises too little.
    """
    search.progress(f"{dynamics.name}, as a rival of what is suspected")
    (problem, start), motion = posed, about or solution
    without = dynamics.corrected(without_gate(problem), motion)

    def cost(value: Array) -> float:
        size = search.misfit_of((without(value), start), model)
        return size if np.isfinite(size) else np.nan

    steps = np.diag(dynamics.trial)
    more, less = (np.array([cost(sign * step) for step in steps]) for sign in (1.0, -1.0))
    hessian = np.diag(more + less - 2.0 * same)
    for i, j in combinations(range(len(steps)), 2):
        hessian[i, j] = hessian[j, i] = cost(steps[i] + steps[j]) - more[i] - more[j] + same
    if not np.isfinite(hessian).all() or np.linalg.eigvalsh(hessian)[0] <= 0.0:
        return None
    cov = 2.0 * steps @ np.linalg.inv(hessian) @ steps
    value = -0.25 * cov @ ((more - less) / dynamics.trial)
    if (value < dynamics.least).any():
        return None
    another = about is None and dynamics.of_motion and bool((np.abs(value) > dynamics.prior).any())
    promised = 0.125 * float((value / dynamics.trial) @ (less - more))
    if not another and promised < LEAST_PROMISED * least:
        return None
    corrected = dynamics.corrected(problem, motion)(value), start
    again = search.solved(corrected, model)
    if again is None:
        return None
    if another:
        return dynamics_trial(search, posed, model, solution, dynamics, same, again, least)
    gain = 0.5 * (misfit(solution) - misfit(again))
    charge = np.linalg.slogdet(np.eye(value.size) + dynamics.prior**2 * np.linalg.inv(cov))[1]
    sigma, evidence = np.sqrt(np.diag(cov)), gain - 0.5 * float(charge)
    return DynamicsTrial(dynamics, value, sigma, evidence, corrected, again)


@dataclass(frozen=True)
class OpenedFlight:
    """What a flight that loses its fixes says where every one of them is used.

    Parameters
    ----------
    misfit, of_constants : float
        `misfit` as requested, and with every constant that may be wrong.
    trials : tuple of DynamicsTrial
        Sensors that follow the motion late and explain more than these constants, the best first.
    """

    misfit: float
    of_constants: float
    trials: tuple[DynamicsTrial, ...]

    def beyond(self, evidence: float) -> list[DynamicsTrial]:
        """Return the late sensors of more than an evidence."""
        return [one for one in self.trials if one.evidence > evidence]


def opened_flight(search: ErrorModelSearch, posed: Posed) -> OpenedFlight | None:
    """Solve a flight with every fix; None without a solution."""
    opened, model = (without_gate(posed[0]), posed[1]), search.requested_model
    try:
        shown = solve(*opened, "off", search.progress)
    except DataError:
        return None
    of_constants = search.misfit_of(opened, with_every_constant(model))
    size = misfit(shown)
    trials = late_sensors(search, opened, model, shown, least=0.5 * (size - of_constants))
    return OpenedFlight(size, of_constants, tuple(trials))
