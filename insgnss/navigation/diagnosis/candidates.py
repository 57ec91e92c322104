"""The candidates of the search: errors that are tried as states, and noise that is tried larger.

Those of the fixes are states of `navigation.filter.layout.FixErrors`, those of the IMU scale
factors, misalignments and factors of its noise (`ImuErrors`). Estimated together on one flight they
explain each other's share:

    lever arm dl and time offset d    moving the antenna by C_lb dl and v d: seen in turns and in
                                      changes of speed
    GNSS errors themselves            white, k times the sigma of each fix, and a Gauss-Markov
                                      process, c times it, with correlation time T

A sensor that shows the motion late, or worse in turns, looks like a wrong lever arm or clock. That
is no state: what it measured is corrected (`SensorDynamics`) and the flight solved again.

    gyros later than accelerometers by d    the rotation is taken d later
    a receiver's tracking loop of natural   fixes lag by a / w^2, a the antenna's acceleration: in
    frequency w                             a coordinated turn a lever arm g / w^2 too low
    a bias b of the accelerometers at a     vibration rectification: b (|f| / g - 1), which acts in
    g of load more                          turns alone, as a lever arm does
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np

from ...base.units import MILLI_G, STANDARD_GRAVITY
from ...geodesy.rotation import rotation_from_quaternion
from ...records import Array
from ...records.interpolation import columns_at
from ...records.states import (
    CLOCK_RATE,
    LEVER_ARM,
    MISALIGNMENT,
    OF_FIXES,
    SCALE_FACTOR,
    TIME_OFFSET,
    State,
)
from ..filter.codes import NAV, QUAT, VEL
from ..filter.layout import FixErrors, SlowBias, StateLayout
from ..filter.problem import EstimationProblem, InitialState
from ..filter.solution import Solution
from ..noise_model.model import AxisNoise, NoiseModel

CLOCK_RATE_SIGMA = 1e-4  # s/s, a-priori sigma of the rate of a quartz that nothing disciplines
LOAD_S = 0.25  # s on either side, over which the load factor is a mean: longer than vibration lasts
WHITER = 1.6  # factor of the white share, each time that the filter loses fixes with a candidate

# k, c, T (s) from which the search for the time-correlated error starts
GUESSES = (
    (0.6, 1.0, 20.0),
    (1.0, 1.0, 20.0),
    (1.0, 3.0, 20.0),
    (0.3, 0.7, 20.0),
    (0.4, 0.8, 3.0),
)
# the same for code solutions, whose sigmas hold errors of minutes
CODE_GUESSES = ((0.1, 0.2, 10.0),)

WIDE_LEVER_ARM_M, WIDE_TIME_OFFSET_S, WIDE_CLOCK_RATE = 0.2, 0.05, 2e-4
WIDE_SCALE, WIDE_MISALIGNMENT_RAD = 0.01, 0.008
"""A-priori sigmas under which constants are suspected (`navigation.diagnosis.constants`)."""

FAR = 10.0
"""Factor of those of the fixes' constants under which a filter looks for any of them: a drawing
that was read in the wrong unit is metres off, a clock half a second.
"""


@dataclass(frozen=True)
class ImuErrors:
    """What a candidate changes in the model of the IMU.

    Parameters
    ----------
    scale_factor, misalignment : float, optional
        A-priori sigma of these states; None: as the flight file has it.
    constants : tuple of State
        Those that are states, all of a sensor where the axis is empty; empty for every channel.
    white_noise, driving_noise : tuple of float
        (2,) factors of the root densities of white noise, and of what drives random walks and
        Gauss-Markov processes, of gyros and of accelerometers.
    slow : SlowBias, optional
        A slow bias of every channel.
    """

    scale_factor: float | None = None
    misalignment: float | None = None
    constants: tuple[State, ...] = ()
    white_noise: tuple[float, float] = (1.0, 1.0)
    driving_noise: tuple[float, float] = (1.0, 1.0)
    slow: SlowBias | None = None

    def of(self, model: NoiseModel) -> NoiseModel:
        """Return the noise model with these errors.

        Parameters
        ----------
        model : NoiseModel
            That of the flight file.

        Returns
        -------
        NoiseModel
            The model with its noise scaled, and with the a-priori sigmas of the states.
        """
        gyro, accel = (
            (self._axis(x, k), self._axis(y, k), self._axis(z, k))
            for k, (x, y, z) in enumerate((model.gyro, model.accel))
        )
        return replace(model, gyro=gyro, accel=accel)

    def _axis(self, axis: AxisNoise, triad: int) -> AxisNoise:
        driven = self.driving_noise[triad]
        return replace(
            axis,
            white_noise=axis.white_noise * self.white_noise[triad],
            random_walk=axis.random_walk * driven,
            gauss_markov=tuple(
                replace(gm, driving_noise=gm.driving_noise * driven) for gm in axis.gauss_markov
            ),
            scale_factor=self.scale_factor or axis.scale_factor,
            misalignment=self.misalignment or axis.misalignment,
        )


AS_STATED = ImuErrors()
LayoutFactory = Callable[..., StateLayout]
"""Gives the error states of a flight for the errors of the fixes, a `FixErrors`, that are to be
among them, and for what is changed in the model of the IMU, an `ImuErrors`; without it nothing.
"""


@dataclass(frozen=True)
class ErrorModel:
    """What is estimated of the errors of fixes and IMU.

    Parameters
    ----------
    fixes : FixErrors
        The errors of the fixes.
    imu : ImuErrors
        What is changed in the model of the IMU.
    """

    fixes: FixErrors
    imu: ImuErrors = AS_STATED


def with_constants(model: ErrorModel, groups: Sequence[State], factor: float = 1.0) -> ErrorModel:
    """Give constants a wide a-priori sigma.

    Parameters
    ----------
    model : ErrorModel
        What is estimated already.
    groups : sequence of State
        Groups of `constants.group_of`, or single states of an IMU; of the clock both are states
        together only.
    factor : float
        Of the a-priori sigmas of the fixes' constants.

    Returns
    -------
    ErrorModel
        The model with these constants among its states.
    """
    fixes, imu = model.fixes, model.imu
    kinds = {one.group for one in groups}
    of_imu = tuple(one for one in groups if one.group in (SCALE_FACTOR, MISALIGNMENT))
    if of_imu:
        of_sensors = all(one.sensor for one in of_imu)
        constants = tuple(dict.fromkeys((*imu.constants, *of_imu))) if of_sensors else ()
        imu = replace(imu, constants=constants)
    if LEVER_ARM in kinds:
        fixes = replace(fixes, lever_arm_m=factor * WIDE_LEVER_ARM_M)
    if kinds & {TIME_OFFSET.group, CLOCK_RATE.group}:
        offset, rate = factor * WIDE_TIME_OFFSET_S, factor * WIDE_CLOCK_RATE
        fixes = replace(fixes, time_offset_s=offset, clock_rate=rate)
    if SCALE_FACTOR in kinds:
        imu = replace(imu, scale_factor=WIDE_SCALE)
    if MISALIGNMENT in kinds:
        imu = replace(imu, misalignment=WIDE_MISALIGNMENT_RAD)
    return ErrorModel(fixes, imu)


def with_every_constant(model: ErrorModel) -> ErrorModel:
    """Give every constant that may be wrong the a-priori sigma under which it is looked for.

    Parameters
    ----------
    model : ErrorModel
        What is estimated already.

    Returns
    -------
    ErrorModel
        The model with lever arm, time offset and clock rate, `FAR` times wide, and scale factors
        and misalignments.
    """
    return with_constants(model, (*OF_FIXES, State(SCALE_FACTOR), State(MISALIGNMENT)), FAR)


def with_time_correlated_error(
    errors: FixErrors, k: float, c: float, time_s: float, height_ratio: float = 1.0
) -> FixErrors:
    """Add a time-correlated (Gauss-Markov) GNSS error to the estimated errors.

    Parameters
    ----------
    errors : FixErrors
        The errors of the fixes that are estimated already.
    k, c : float
        The white and the time-correlated share, in standard deviations of each fix.
    time_s : float
        The correlation time, s.
    height_ratio : float
        The factor of both shares in height.

    Returns
    -------
    FixErrors
        The same errors with the time-correlated one among them.
    """
    return replace(
        errors,
        gm_sigma=(c, c, c * height_ratio),
        correlation_time_s=time_s,
        white_scale=(k, k, k * height_ratio),
        unfixed_white_scale=min(k, errors.unfixed_white_scale),
    )


def with_larger_white_share(errors: FixErrors) -> FixErrors:
    """Raise the white share of the fixes' errors by `WHITER`, which heavy tails call for."""
    return replace(
        errors,
        white_scale=tuple(WHITER * k for k in errors.white_scale),
        unfixed_white_scale=WHITER * errors.unfixed_white_scale,
    )


def guesses(problem: EstimationProblem) -> tuple[tuple[float, float, float], ...]:
    """Return k, c and T (s) of the time-correlated errors from which the search starts."""
    return CODE_GUESSES if only_code_fixes(problem) else GUESSES


def only_code_fixes(problem: EstimationProblem) -> bool:
    """Tell whether the errors of all fixes are of the kind that stays for minutes."""
    return bool((problem.epochs.group[problem.epochs.has_position] == 1).all())


def with_layout(
    problem: EstimationProblem, start: InitialState, layout: StateLayout
) -> tuple[EstimationProblem, InitialState]:
    """Pose the same problem with the states of another layout.

    Parameters
    ----------
    problem, start : EstimationProblem, InitialState
        The problem and its initial state.
    layout : StateLayout
        The states that it is to have.

    Returns
    -------
    tuple of EstimationProblem and InitialState
        The problem with `layout`. States that it had keep their value and their covariance,
        new ones start at zero with their a-priori sigma, uncorrelated with the others.
    """
    old = problem.layout
    index = [old.states.index(one) if one in old.states else -1 for one in layout.states]
    kept = np.array([s for s, k in enumerate(index) if k >= 0], dtype=np.int64)
    source = np.array([k for k in index if k >= 0], dtype=np.int64)
    n = NAV.stop
    x, mean = np.zeros(layout.size - n), np.zeros(layout.size)
    P = np.diag(np.concatenate([np.zeros(n), layout.sigma0**2]))
    x[kept] = start.x[source]
    mean[NAV], mean[n + kept] = start.mean[NAV], start.mean[n + source]
    rows = np.concatenate([np.arange(n), n + kept])
    columns = np.concatenate([np.arange(n), n + source])
    P[np.ix_(rows, rows)] = start.P[np.ix_(columns, columns)]
    return replace(problem, layout=layout), InitialState(start.nav, x, mean, P)


def widened(
    problem: EstimationProblem, start: InitialState, before: StateLayout
) -> tuple[EstimationProblem, InitialState]:
    """Give states whose a-priori sigma has grown since another layout that sigma at the start.

    Parameters
    ----------
    problem, start : EstimationProblem, InitialState
        The problem and its initial state, in which such states still have their earlier sigma.
    before : StateLayout
        The layout in which the start was found.

    Returns
    -------
    tuple of EstimationProblem and InitialState
        The problem, and the start with these states as they are a priori.
    """
    sigma = dict(zip(before.states, before.sigma0.tolist(), strict=True))
    layout = problem.layout
    grown = [
        s
        for s, state in enumerate(layout.states)
        if layout.beta[s] == 0.0 and layout.sigma0[s] > sigma.get(state, np.inf)
    ]
    return problem, with_a_priori(start, layout, grown)


def with_a_priori(start: InitialState, layout: StateLayout, states: Sequence[int]) -> InitialState:
    """Return a start with some of its states at zero with their a-priori sigmas, uncorrelated.

    Parameters
    ----------
    start : InitialState
        The initial state.
    layout : StateLayout
        Its states.
    states : sequence of int
        Those that are set back.

    Returns
    -------
    InitialState
        The start without what was known of these states.
    """
    P, x, mean = start.P.copy(), start.x.copy(), start.mean.copy()
    chosen = np.array(states, dtype=np.int64)
    rows = NAV.stop + chosen
    P[rows, :] = P[:, rows] = 0.0
    P[rows, rows] = layout.sigma0[chosen] ** 2
    x[chosen], mean[rows] = 0.0, 0.0
    return InitialState(start.nav, x, mean, P)


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


@dataclass(frozen=True)
class SensorDynamics:
    """Errors of a sensor that follow the motion, by a few parameters.

    Parameters
    ----------
    name : str
        That of its check.
    trial : tuple of float
        Of each parameter the size by which it is tried.
    prior, least : float
        The a-priori sigma of each, and the smallest that exists.
    corrected : callable
        Returns the problem without it.
    """

    name: str
    trial: tuple[float, ...]
    prior: float
    least: float
    corrected: Callable[[EstimationProblem, Solution, Array], EstimationProblem]


GYRO_DELAY, RECEIVER_DYNAMICS, LOAD_BIAS = "gyro delay", "receiver dynamics", "load-dependent bias"
# a-priori sigmas: filters of MEMS gyros delay by 1 to 10 ms (s); receivers that smooth have loops
# of 1 Hz and more (s^2); rectification makes some milli-g in a turn of 1.2 g (m/s^2 a g)
DYNAMICS = (
    SensorDynamics(GYRO_DELAY, (2e-3,), 5e-3, -np.inf, with_earlier_gyros),
    SensorDynamics(RECEIVER_DYNAMICS, (3e-3,), 0.025, 0.0, with_followed_fixes),
    SensorDynamics(LOAD_BIAS, (5.0 * MILLI_G,) * 3, 20.0 * MILLI_G, -np.inf, without_load_bias),
)
