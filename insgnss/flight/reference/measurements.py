"""What each sensor would measure, written once as a residual; the derivative comes from that alone.

A measurement is given by its residual r(state) = measured - predicted, which is zero at the truth
but for noise of covariance R. About the nominal it reads

    z = H error + noise,   z = r(nominal),   H = -dr/d(error)                      (T.14)

H comes from central differences of r, one state after the other: slow, and nothing to get wrong.
With the lever arm l_b from the IMU to the antenna, the body's rate against the Earth omega
(measured rate less its errors U x less C_bl Omega), a the acceleration of the IMU in l over the
last interval, d the time by which a fix was taken later than its stamp (an offset, and its rate
times the time since the start), e the time-correlated errors of a fix counted in its standard
deviations sigma:

    antenna position    p + C_lb l_b + (v + C_lb (omega x l_b)) d + a d^2 / 2 + sigma e      (T.15)
    antenna velocity    v + C_lb (omega x l_b) + a d + e_v                                 (T.16)
    zero velocity update (ZUPT)        0 = v                                               (T.17)
    non-holonomic constraint (NHC)     0 = right and down of C_bl v                        (T.18)
    zero angular rate update (ZARU)    0 = omega, of the mean gyro rate at rest            (T.19)
    height of a barometer              b + (1 + s) h                                       (T.26)
    a measurement of one's own         its `predict` at the state, no derivative of the core (T.27)

The errors of a fix's own group come in: those of group 1 (float, code) have both correlated errors.
e_v is that of the velocities. h is the height of the IMU above the origin of l, b and s bias and
scale factor of the barometer.

Groves (2013) 14.3 (lever arm), 15.3 (zero updates, non-holonomic constraint).
"""

from collections.abc import Callable

import numpy as np

from ...navigation.filter.codes import (
    BAROMETER_ROW,
    N_KINDS,
    NOT_MEASURED,
    POSITION_ROW,
    VELOCITY_CONSTRAINT,
    VELOCITY_ROW,
    ZARU,
    ZUPT,
)
from ...navigation.filter.problem import EstimationProblem, MeasuredRows
from ...records import Array
from ...records.measurements import Motion
from .error_model import GYRO_CHANNELS, earth_rate, influence
from .strapdown import NominalState, cross

Residual = Callable[[NominalState], Array]
# of the a-priori sigma of an error state: step of the central differences
DIFFERENCE_STEP_SIGMAS = 0.01
STEP_NAV = np.repeat([1e-2, 1e-2, 1e-4], 3)  # m, m/s, rad


def measurement(
    problem: EstimationProblem, epoch: int, kind: int, state: NominalState, acceleration: Array
) -> tuple[Array, Array, Array] | None:
    """Return H (k, n), z (k,) and R (k, k) of one kind of measurement, None where there is none.

    Parameters
    ----------
    problem : the estimation problem.
    epoch : index of the epoch.
    kind : POSITION_ROW, VELOCITY_ROW, VELOCITY_CONSTRAINT, ZARU, BAROMETER_ROW of
    `navigation.filter.codes`,
        or N_KINDS and more of the problem's `measurements`.
    state : the nominal at the epoch.
    acceleration : (3,) of the IMU in l over the last interval, m/s^2.
    """
    if kind >= N_KINDS:
        model = _predict_at_epoch(problem, epoch, problem.measurements[kind - N_KINDS])
    else:
        model = {
            POSITION_ROW: _position,
            VELOCITY_ROW: _velocity,
            VELOCITY_CONSTRAINT: _motion,
            ZARU: _angular_rate,
            BAROMETER_ROW: _height,
        }[kind](problem, epoch, acceleration)
    if model is None:
        return None
    residual, R = model
    return -derivative(residual, state, problem.layout.sigma0), residual(state), R


def derivative(residual: Residual, state: NominalState, sigma0: Array) -> Array:
    """Return the derivative (k, n) of a residual with respect to the error, by central differences.

    Parameters
    ----------
    residual : function of a state, (k,).
    state : where the derivative is taken.
    sigma0 : (ns,) a-priori standard deviations of the error states, which set their steps.
    """
    steps = np.concatenate(
        [STEP_NAV, np.where(sigma0 > 0.0, DIFFERENCE_STEP_SIGMAS * sigma0, 1e-6)]
    )
    columns = [
        (residual(state.plus(step)) - residual(state.plus(-step))) / (2.0 * size)
        for size, step in zip(steps, np.diag(steps), strict=True)
    ]
    return np.column_stack(columns)


ResidualModel = tuple[Residual, Array] | None


def _position(problem: EstimationProblem, epoch: int, acceleration: Array) -> ResidualModel:
    """(T.15)."""
    ep, layout, group = problem.epochs, problem.layout, problem.epochs.group[epoch]
    if not ep.has_position[epoch]:
        return None
    firsts = [layout.gm, layout.unfixed_gm][: group + 1]
    correlated = [slice(first, first + 3) for first in firsts if first >= 0]
    body_rate = _body_rate(problem, epoch, ep.rate[epoch])

    def residual(state: NominalState) -> Array:
        lever, delay, moved = _lever_arm(problem, state), _delay(problem, epoch, state), np.zeros(3)
        if layout.offset >= 0:
            velocity = state.v + state.C_lb @ cross(body_rate(state), lever)
            moved = velocity * delay + 0.5 * acceleration * delay**2
        e = sum((state.x[rows] for rows in correlated), np.zeros(3))
        return ep.position[epoch] - state.p - state.C_lb @ lever - moved - ep.sigma[epoch] * e

    scale = np.array([layout.white_scale, (layout.unfixed_white_scale,) * 3])[group]
    return residual, ep.position_cov[epoch] * np.outer(scale, scale)


def _velocity(problem: EstimationProblem, epoch: int, acceleration: Array) -> ResidualModel:
    """(T.16)."""
    ep, first = problem.epochs, problem.layout.velocity_gm
    if not ep.has_velocity[epoch]:
        return None
    body_rate = _body_rate(problem, epoch, ep.rate[epoch])

    def residual(state: NominalState) -> Array:
        swing = state.C_lb @ cross(body_rate(state), _lever_arm(problem, state))
        delay = _delay(problem, epoch, state)
        e = state.x[first : first + 3] if first >= 0 else np.zeros(3)
        return ep.velocity[epoch] - state.v - swing - acceleration * delay - e

    return residual, ep.velocity_cov[epoch] * problem.layout.velocity_white_scale**2


def _motion(problem: EstimationProblem, epoch: int, _: Array) -> ResidualModel:
    """(T.17) ZUPT of a vehicle at rest, (T.18) NHC of one that moves along its axis."""
    motion, cov = problem.epochs.constraint[epoch], problem.epochs.constraint_cov[epoch]
    if motion == NOT_MEASURED:
        return None
    if motion == ZUPT:
        return lambda state: -state.v, cov
    return lambda state: -(state.C_lb.T @ state.v)[1:], cov[1:, 1:]


def _angular_rate(problem: EstimationProblem, epoch: int, _: Array) -> ResidualModel:
    """(T.19)."""
    rate, variance = problem.epochs.zaru_rate[epoch], problem.epochs.zaru_variance[epoch]
    if variance == 0.0:
        return None
    return _body_rate(problem, epoch, rate), variance * np.eye(3)


def _height(problem: EstimationProblem, epoch: int, _: Array) -> ResidualModel:
    """(T.26)."""
    ep, first, frame = problem.epochs, problem.layout.barometer, problem.frame
    if ep.barometer_variance[epoch] == 0.0:
        return None
    origin = frame.geodetic_from_position(np.zeros(3))[2]

    def residual(state: NominalState) -> Array:
        bias, scale = state.x[first : first + 2]
        above = frame.geodetic_from_position(state.p)[2] - origin
        return np.array([ep.barometer_height[epoch] - bias - (1.0 + scale) * above])

    return residual, np.array([[ep.barometer_variance[epoch]]])


def _predict_at_epoch(
    problem: EstimationProblem, epoch: int, measured: MeasuredRows
) -> ResidualModel:
    """(T.27)."""
    rows = measured.rows[measured.at_epoch == epoch]
    if not rows.size:
        return None
    measurement, rate = measured.measurement, problem.epochs.rate[epoch]
    body_rate = _body_rate(problem, epoch, rate)
    first = len(problem.layout.states) - problem.measurements[-1].states.stop

    def residual(state: NominalState) -> Array:
        omega = body_rate(state)
        motion = Motion(
            problem.inc.marks[[epoch]],
            state.p[None],
            state.v[None],
            state.C_lb[None],
            omega[None],
            (rate - state.C_lb.T @ earth_rate(problem) - omega)[None],
            problem.frame,
        )
        predicted = measurement.predicted(motion, state.x[None, first:][:, measured.states])
        return measurement.minus(rows, predicted)[0]

    return residual, measurement.cov[rows[0]]


def _body_rate(problem: EstimationProblem, epoch: int, measured: Array) -> Residual:
    """Rate of the body against the Earth, (3,) rad/s in body axes, as a function of the state.

    Parameters
    ----------
    measured : (3,) rad/s, of the gyros.
    """
    rates = np.concatenate([measured, np.zeros(3)])
    epochs = problem.epochs
    elapsed, temperature = float(epochs.time[epoch]), float(epochs.temperature[epoch])
    U = influence(problem.layout, elapsed, temperature, rates)[GYRO_CHANNELS]
    Omega = earth_rate(problem)
    return lambda state: measured - U @ state.x - state.C_lb.T @ Omega


def _lever_arm(problem: EstimationProblem, state: NominalState) -> Array:
    """Lever arm from the IMU to the antenna with the states of its error, (3,) m in body axes."""
    first = problem.layout.lever
    lever = problem.antenna_lever_b
    return lever + state.x[first : first + 3] if first >= 0 else lever


def _delay(problem: EstimationProblem, epoch: int, state: NominalState) -> float:
    """By how many seconds the fix was taken later than its stamp says."""
    offset, rate = problem.layout.offset, problem.layout.rate
    delay = state.x[offset] if offset >= 0 else 0.0
    return float(delay + (problem.epochs.time[epoch] * state.x[rate] if rate >= 0 else 0.0))
