"""Sensors that show the motion late, or worse in turns: one table of them, and how they are tried.

Such a sensor looks like a wrong lever arm or clock. That is no state: what it measured is corrected
(`SensorDynamics`) and the flight solved again.

    gyros later than accelerometers by d    the rotation is taken d later
    a receiver's tracking loop of natural   fixes lag by a / w^2, a the antenna's acceleration: in
    frequency w                             a coordinated turn a lever arm g / w^2 too low
    a bias b of the accelerometers at a     vibration rectification: b (|f| / g - 1), which acts in
    g of load more                          turns alone, as a lever arm does
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from itertools import combinations

import numpy as np

from ...base.units import MILLI_G, STANDARD_GRAVITY
from ...geodesy.rotation import rotation_from_quaternion
from ...records import Array, Finding, Question
from ...records.interpolation import columns_at
from ..filter.codes import QUAT, VEL
from ..filter.problem import EstimationProblem
from ..filter.solution import Solution
from .advice import millimetres
from .candidates import ErrorModel
from .evidence import ErrorModelSearch, Posed, misfit

LOAD_S = 0.25  # s on either side, over which the load factor is a mean: longer than vibration lasts


def with_earlier_gyros(
    problem: EstimationProblem, solution: Solution, late_s: Array
) -> EstimationProblem:
    """Return the problem whose gyros, which are late, are at the stamps of the accelerometers.

    Parameters
    ----------
    problem : EstimationProblem
        The problem.
    solution : Solution
        Its solution, of which nothing is needed.
    late_s : ndarray
        (1,) their delay, s.

    Returns
    -------
    EstimationProblem
        The problem with other angle increments and rates.
    """
    inc, time = problem.inc, problem.epochs.time
    nodes = np.concatenate([[0.0], np.cumsum(inc.dt)])
    ends = 1.0 / inc.dt[[0, -1], None] * inc.dtheta[[0, -1]]  # held for a second beyond
    steps = np.concatenate([ends[:1], inc.dtheta, ends[1:]])
    extended = np.concatenate([[-1.0], nodes, [nodes[-1] + 1.0]])
    angle = np.concatenate([np.zeros((1, 3)), np.cumsum(steps, axis=0)])
    shifted = columns_at(nodes + late_s, extended, angle)
    rate = columns_at(time + late_s, time, inc.rate)
    inc = replace(inc, dtheta=np.diff(shifted, axis=0), rate=rate)
    return replace(problem, inc=inc, epochs=problem.epochs._replace(rate=rate))


def with_followed_fixes(
    problem: EstimationProblem, solution: Solution, lag_s2: Array
) -> EstimationProblem:
    """Return the problem whose fixes do not lag behind the antenna.

    Parameters
    ----------
    problem : EstimationProblem
        The problem.
    solution : Solution
        Its solution, which gives the acceleration of the antenna.
    lag_s2 : ndarray
        (1,) what they lag by at 1 m/s^2, m: 1 / w^2 of the receiver's tracking loop, s^2.

    Returns
    -------
    EstimationProblem
        The problem with other positions.
    """
    epochs, fixes = problem.epochs, np.flatnonzero(problem.epochs.has_position)
    nav, time = solution.nav[fixes], problem.epochs.time[fixes]
    arm = rotation_from_quaternion(nav[:, QUAT]) @ problem.antenna_lever_b
    velocity = nav[:, VEL] + np.gradient(arm, time, axis=0)
    position = epochs.position.copy()
    position[fixes] += lag_s2 * np.gradient(velocity, time, axis=0)
    return replace(problem, epochs=epochs._replace(position=position))


def without_load_bias(
    problem: EstimationProblem, solution: Solution, bias: Array
) -> EstimationProblem:
    """Return the problem whose accelerometers have no bias that grows with the load factor.

    Parameters
    ----------
    problem : EstimationProblem
        The problem.
    solution : Solution
        Its solution, of which nothing is needed.
    bias : ndarray
        (3,) the bias at 2 g less that at 1 g, m/s^2.

    Returns
    -------
    EstimationProblem
        The problem with other velocity increments.
    """
    inc = problem.inc
    nodes = np.concatenate([[0.0], np.cumsum(inc.dt)])
    sums = np.concatenate([np.zeros((1, 3)), np.cumsum(inc.dvel, axis=0)])
    ends = np.clip([nodes[:-1] - LOAD_S, nodes[1:] + LOAD_S], 0.0, nodes[-1])
    before, after = (columns_at(end, nodes, sums) for end in ends)
    load = np.linalg.norm(after - before, axis=1) / (ends[1] - ends[0]) / STANDARD_GRAVITY - 1.0
    dvel = inc.dvel - np.outer(load * inc.dt, bias)
    return replace(problem, inc=replace(inc, dvel=dvel))


def delay_in_words(value: Array, sigma: Array) -> str:
    """Describe gyros that are late."""
    side = "later" if value[0] > 0.0 else "earlier"
    delay = f"{1e3 * abs(value[0]):.1f} +- {1e3 * sigma[0]:.1f}"
    return f"gyros {delay} ms {side} than accelerometers"


def loop_in_words(value: Array, sigma: Array) -> str:
    """Describe a receiver that lags."""
    hertz = 0.5 / np.pi / max(value[0], 1e-6) ** 0.5
    return (
        f"a tracking loop of the receiver of {hertz:.1f} Hz, which lags by {millimetres(value[0])}"
        f" +- {millimetres(sigma[0])} mm at 1 m/s^2"
    )


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
        Returns the problem without it.
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
    corrected: Callable[[EstimationProblem, Solution, Array], EstimationProblem]
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
        "give both the same filter in the IMU's settings, or move the gyro columns of the file",
    ),
    SensorDynamics(
        "receiver dynamics",
        "fixes that do not lag",
        (3e-3,),
        0.025,  # s^2: receivers that smooth have loops of 1 Hz and more
        0.0,
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
        "mount the IMU softer: vibration that grows in turns shifts the accelerometers",
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
    def sentence(self) -> str:
        """What delays, and by how much."""
        return self.dynamics.in_words(self.value, self.sigma)

    def check(self) -> Finding:
        """Return a note that a sensor has such errors, which have been corrected in the result."""
        return Question(self.dynamics.name, self.dynamics.expected).note(
            f"{self.sentence}, log evidence {self.evidence:.0f}; corrected in the result",
            self.dynamics.remedy,
        )


def dynamics_trials(
    search: ErrorModelSearch,
    posed: Posed,
    model: ErrorModel,
    solution: Solution,
    every: Sequence[SensorDynamics],
) -> list[DynamicsTrial]:
    """Look for the delays of sensors that explain the innovations best; none without any.

    The parameters are those of `dynamics_trial`.
    """
    opened = replace(posed[0], gate=np.inf, huber_threshold=np.inf)
    same = search.misfit_of((opened, posed[1]), model) if every else np.nan
    trials = (dynamics_trial(search, posed, model, solution, one, same) for one in every)
    return [trial for trial in trials if trial is not None]


def dynamics_trial(
    search: ErrorModelSearch,
    posed: Posed,
    model: ErrorModel,
    solution: Solution,
    dynamics: SensorDynamics,
    same: float,
    about: Solution | None = None,
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

    Returns
    -------
    DynamicsTrial or None
        None where there is none of its sign, or no solution.
    """
    search.progress(f"{dynamics.name}, as a rival of what is suspected")
    (problem, start), motion = posed, about or solution
    opened = replace(problem, gate=np.inf, huber_threshold=np.inf)

    def cost(value: Array) -> float:
        size = search.misfit_of((dynamics.corrected(opened, motion, value), start), model)
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
    corrected = dynamics.corrected(problem, motion, value), start
    again = search.solved(corrected, model)
    if again is None:
        return None
    if about is None and dynamics.of_motion and (value > dynamics.prior).any():
        return dynamics_trial(search, posed, model, solution, dynamics, same, again)
    gain = 0.5 * (misfit(solution) - misfit(again))
    charge = np.linalg.slogdet(np.eye(value.size) + dynamics.prior**2 * np.linalg.inv(cov))[1]
    sigma, evidence = np.sqrt(np.diag(cov)), gain - 0.5 * float(charge)
    return DynamicsTrial(dynamics, value, sigma, evidence, corrected, again)
