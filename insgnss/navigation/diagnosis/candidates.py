"""The candidates of the search: errors that are tried as states, and noise that is tried larger.

Those of the fixes are states of `navigation.filter.layout.FixErrors`, those of the IMU scale
factors, misalignments and factors of its noise (`ImuErrors`). Estimated together on one flight they
explain each other's share:

    lever arm dl and time offset d    moving the antenna by C_lb dl and v d: seen in turns and in
                                      changes of speed
    GNSS errors themselves            white, k times the sigma of each fix, and a Gauss-Markov
                                      process, c times it, with correlation time T
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np

from ...records.states import (
    CLOCK_RATE,
    LEVER_ARM,
    MISALIGNMENT,
    OF_FIXES,
    SCALE_FACTOR,
    TIME_OFFSET,
    State,
)
from ..filter.codes import NAV, NO_CONSTRAINT
from ..filter.layout import FixErrors, SlowBias, StateLayout
from ..filter.problem import EstimationProblem, InitialState
from ..noise_model.model import AxisNoise, NoiseModel

CLOCK_RATE_SIGMA = 1e-4  # s/s, a-priori sigma of the rate of a quartz that nothing disciplines
WHITER = 1.6  # factor of the white share, each time that the filter loses fixes with a candidate

# k, c, T (s) from which the search for the time-correlated error starts
GUESSES = ((0.6, 1.0, 20.0), (1.0, 1.0, 20.0), (1.0, 3.0, 20.0), (0.3, 0.7, 20.0), (0.4, 0.8, 3.0))
# the same for code solutions, whose sigmas hold errors of minutes
CODE_GUESSES = ((0.1, 0.2, 10.0),)

# m, s, s/s: wider than errors of a measured arm or of a clock are as a rule (chosen)
WIDE_LEVER_ARM_M, WIDE_TIME_OFFSET_S, WIDE_CLOCK_RATE = 0.2, 0.05, 2e-4
WIDE_SCALE, WIDE_MISALIGNMENT_RAD = 0.01, 0.008
"""A-priori sigmas under which constants are suspected (`navigation.diagnosis.constants`)."""

FAR_FACTOR = 10.0
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
        The model with lever arm, time offset and clock rate, `FAR_FACTOR` times wide, and scale
        factors and misalignments.
    """
    return with_constants(model, (*OF_FIXES, State(SCALE_FACTOR), State(MISALIGNMENT)), FAR_FACTOR)


def with_time_correlated_error(
    errors: FixErrors, k: float, c: float, time_s: float, height_ratio: float = 1.0
) -> FixErrors:
    """Add a time-correlated (Gauss-Markov) GNSS error to the estimated errors.

    Parameters
    ----------
    errors : FixErrors
        The errors of the fixes that are estimated already.
    k, c : float
        The white share, of the white error that is estimated already, and the time-correlated one,
        in standard deviations of each fix.
    time_s : float
        The correlation time, s.
    height_ratio : float
        The factor of both shares in height.

    Returns
    -------
    FixErrors
        The same errors with the time-correlated one among them.
    """
    north, east, down = errors.white_scale
    return replace(
        errors,
        gm_sigma=(c, c, c * height_ratio),
        correlation_time_s=time_s,
        white_scale=(k * north, k * east, k * height_ratio * down),
        unfixed_white_scale=min(k, errors.unfixed_white_scale),
    )


def with_larger_white_share(
    errors: FixErrors, factor: float = WHITER, of_velocities: float = 1.0
) -> FixErrors:
    """Raise the white share of the fixes' errors, by `WHITER` as heavy tails call for.

    Parameters
    ----------
    errors : FixErrors
        The errors of the fixes.
    factor, of_velocities : float
        Of the white shares of positions and of velocities.

    Returns
    -------
    FixErrors
        The same errors with these shares.
    """
    return replace(
        errors,
        white_scale=tuple(factor * k for k in errors.white_scale),
        unfixed_white_scale=factor * errors.unfixed_white_scale,
        velocity_white_scale=of_velocities * errors.velocity_white_scale,
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


def widen_layout(
    problem: EstimationProblem, start: InitialState, layout: StateLayout
) -> tuple[EstimationProblem, InitialState]:
    """Pose the same problem with the states of another layout, some with larger a-priori sigmas.

    Parameters
    ----------
    problem, start : EstimationProblem, InitialState
        The problem and its initial state.
    layout : StateLayout
        The states that it is to have.

    Returns
    -------
    tuple of EstimationProblem and InitialState
        As `with_layout` gives them, with the states whose sigma has grown as they are a priori.
    """
    before = problem.layout
    sigma = dict(zip(before.states, before.sigma0.tolist(), strict=True))
    grown = [
        s
        for s, state in enumerate(layout.states)
        if layout.beta[s] == 0.0 and layout.sigma0[s] > sigma.get(state, np.inf)
    ]
    problem, start = with_layout(problem, start, layout)
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


def without_other_aiding(problem: EstimationProblem) -> EstimationProblem:
    """Return the problem without barometer and constraints of the motion, which may not hold."""
    epochs = problem.epochs._replace(
        barometer_variance=np.zeros_like(problem.epochs.barometer_variance),
        constraint=np.full_like(problem.epochs.constraint, NO_CONSTRAINT),
    )
    return replace(problem, epochs=epochs)
