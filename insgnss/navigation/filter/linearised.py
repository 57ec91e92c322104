"""Measurements given by their prediction alone, linearised about a solution (K.13).

Zero velocity updates, non-holonomic constraints and the barometer are none of these: they have
kernels (K.8-K.10, K.12). They are needed before there is a solution to linearise about: at rest
they carry the first pass over minutes without fixes, and the closed loop filter linearises them
about its own nominal, which spares a pass: 45 minutes with a height at each of 10 Hz fixes take
1.28 times the run without as a barometer, 1.47 times by a prediction.
"""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from ...geodesy.rotation import (
    rotation_from_quaternion,
    rotation_from_vector,
)
from ...records import Array
from ...records.measurements import Measurement, Motion
from .codes import (
    ABOUT_BIAS,
    ABOUT_STATES,
    ACCEL0,
    OF_BIAS,
    OF_STATES,
    POS,
    PSI,
    QUAT,
    VEL,
)
from .filter import gate_from_sigma
from .kernels.records import Epochs
from .problem import EstimationProblem, MeasuredRows, channel_biases
from .strapdown import nav_difference

# standard deviations that another linearisation may move a prediction by (chosen)
LINEAR_SIGMAS = 0.01
# m, m/s, rad, rad/s by which a central difference moves the nine errors of navigation and the
# biases of the gyros: rounding and curvature leave some 1e-9 of a derivative
DIFFERENCE_STEPS = np.repeat([1e-2, 1e-2, 1e-5, 1e-6], 3)
# a-priori standard deviations that it moves a state of the measurement by (chosen)
STEP_STATE = 1e-4


def with_measurements(
    problem: EstimationProblem,
    measurements: Sequence[Measurement],
    rows: Sequence[np.ndarray],
    at_epoch: Sequence[np.ndarray],
) -> EstimationProblem:
    """Return the problem with measurements that have not been linearised yet.

    Parameters
    ----------
    problem : EstimationProblem
        The problem, whose last states are those of the measurements, in their order.
    measurements : sequence of Measurement
        The measurements.
    rows, at_epoch : sequence of ndarray
        (k,) the rows of each that lie in the problem, and their epochs.

    Returns
    -------
    EstimationProblem
        The first pass about a solution linearises them (`linearised_about`).
    """
    epochs, first, measured = problem.epochs, 0, []
    for measurement, held, epochs_of_it in zip(measurements, rows, at_epoch, strict=True):
        last = first + len(measurement.states)
        measured.append(MeasuredRows(measurement, held, epochs_of_it, slice(first, last)))
        first = last
    gates = tuple(gate_from_sigma(m.gate_sigma, m.values.shape[1]) for m in measurements)
    m, g = epochs.stop.size, len(measured)
    room = epochs._replace(
        linear_H=np.empty((m, g, 3, OF_STATES + first)),
        linear_residual=np.empty((m, g, 3)),
        linear_cov=np.zeros((m, g, 3, 3)),  # no measurement yet, whatever the others hold
        linear_about=np.empty((m, ABOUT_STATES + first)),
    )
    return replace(problem, epochs=room, measurements=tuple(measured), gates_of_measurements=gates)


def linearised_about(
    problem: EstimationProblem, nav: Array, x: Array
) -> tuple[EstimationProblem, float]:
    """Return the problem with its measurements linearised about a solution.

    Parameters
    ----------
    problem : EstimationProblem
        The problem.
    nav, x : Array
        (m, 10) nominal and (m, ns) other states of the solution.

    Returns
    -------
    problem : EstimationProblem
        With derivatives, residuals and covariances about the solution; as it was where that would
        change less than `LINEAR_SIGMAS`.
    change : float
        What the linearisation so far predicts of the measurements at this solution differs from
        their prediction by so many standard deviations, at most; infinite where there was none.
    """
    before, about = problem.epochs, about_solution(problem, nav, x)
    change, motions, residuals = 0.0, [], []
    for g, measured in enumerate(problem.measurements):
        motions.append(_motion(problem, measured, about[measured.at_epoch]))
        predicted = measured.measurement.predicted(*motions[g])
        residuals.append(measured.measurement.minus(measured.rows, predicted))
        change = max(change, _change(measured, before, about, g, residuals[g]))
    if change <= LINEAR_SIGMAS:
        return problem, change
    epochs = before._replace(
        linear_H=np.zeros(before.linear_H.shape),
        linear_residual=np.zeros(before.linear_residual.shape),
        linear_cov=np.zeros(before.linear_cov.shape),
        linear_about=about,
    )
    for g, measured in enumerate(problem.measurements):
        components = residuals[g].shape[1]
        epochs.linear_residual[measured.at_epoch, g, :components] = residuals[g]
        _linearise(problem, measured, motions[g], epochs, g)
    return replace(problem, epochs=epochs), change


def about_solution(problem: EstimationProblem, nav: Array, x: Array) -> Array:
    """Return what predictions are made of: nominal, biases of the gyros, states of measurements.

    Parameters
    ----------
    problem : EstimationProblem
        The problem.
    nav, x : Array
        (m, 10) nominal and (m, ns) other states.

    Returns
    -------
    Array
        (m, 13 + q).
    """
    q = problem.epochs.linear_about.shape[1] - ABOUT_STATES
    return np.concatenate([nav, _gyro_bias(problem, x), x[:, x.shape[1] - q :]], axis=1)


def _linearise(
    problem: EstimationProblem,
    measured: MeasuredRows,
    about: tuple[Motion, Array],
    epochs: Epochs,
    number: int,
) -> None:
    """Fill in derivative and covariance of one measurement about a motion and own states."""
    measurement, index = measured.measurement, measured.at_epoch
    columns = OF_STATES + np.arange(measured.states.start, measured.states.stop)
    c, columns = measurement.values.shape[1], np.concatenate([np.arange(OF_STATES), columns])
    H = measurement.derived(*about)
    H = _differences(problem, measurement, *about) if H is None else H
    epochs.linear_H[index[:, None, None], number, np.arange(c)[:, None], columns] = H
    cov = np.tile(np.eye(3), (index.size, 1, 1))
    cov[:, :c, :c] = measurement.cov[measured.rows]
    epochs.linear_cov[index, number] = cov


def _differences(
    problem: EstimationProblem, measurement: Measurement, motion: Motion, states: Array
) -> Array:
    """Return the derivatives of a prediction by central differences, (k, c, 12 + q)."""
    state_steps = [STEP_STATE * state.sigma for state in measurement.states]
    steps = np.concatenate([DIFFERENCE_STEPS, state_steps])
    H = np.empty((motion.time.size, measurement.values.shape[1], steps.size))
    for error, step in enumerate(steps):
        forward, backward = (
            measurement.predicted(*_perturb(problem, motion, states, error, s))
            for s in (step, -step)
        )
        H[:, :, error] = measurement.wrapped(forward - backward) / (2.0 * step)
    return H


def prediction(problem: EstimationProblem, measured: MeasuredRows, about: Array) -> Array:
    """Return what a measurement predicts of its values.

    Parameters
    ----------
    problem : EstimationProblem
        The problem.
    measured : MeasuredRows
        The measurement.
    about : Array
        (k, 13 + q) nominal, biases of the gyros and states of all measurements at its epochs.

    Returns
    -------
    Array
        (k, c) values.
    """
    return measured.measurement.predicted(*_motion(problem, measured, about))


def _motion(
    problem: EstimationProblem, measured: MeasuredRows, about: Array
) -> tuple[Motion, Array]:
    """Return the motion at the epochs of a measurement and its own states there."""
    index, bias = measured.at_epoch, about[:, ABOUT_BIAS:ABOUT_STATES]
    C_lb = rotation_from_quaternion(about[:, QUAT])
    motion = Motion(
        problem.inc.marks[index],
        about[:, POS],
        about[:, VEL],
        C_lb,
        problem.inc.rate[index] - bias - _earth_rate(problem, C_lb),
        bias,
        problem.frame,
    )
    return motion, about[:, ABOUT_STATES:][:, measured.states]


def _earth_rate(problem: EstimationProblem, C_lb: Array) -> Array:
    """Return the angular rate of the Earth in body axes, (k, 3) rad/s."""
    return np.einsum("kij,i->kj", C_lb, problem.frame.earth_rate_l)


def _perturb(
    problem: EstimationProblem, motion: Motion, states: Array, error: int, step: float
) -> tuple[Motion, Array]:
    """Return motion and own states with one of their errors larger by a step."""
    if error >= OF_STATES:
        return motion, states + step * (np.arange(states.shape[1]) == error - OF_STATES)
    kind, axis = divmod(error, 3)
    by = step * np.eye(3)[axis]
    if kind == PSI.start // 3:
        C_lb = rotation_from_vector(by) @ motion.C_lb
        turned = _earth_rate(problem, motion.C_lb) - _earth_rate(problem, C_lb)
        return motion.changed(C_lb=C_lb, rate=motion.rate + turned), states
    if kind == OF_BIAS // 3:
        return motion.changed(rate=motion.rate - by, gyro_bias=motion.gyro_bias + by), states
    name = "position" if kind == POS.start // 3 else "velocity"
    return motion.changed(**{name: getattr(motion, name) + by}), states


def _gyro_bias(problem: EstimationProblem, x: Array) -> Array:
    """Return what the states add to the rates of the gyros, (m, 3) rad/s."""
    layout, out = problem.layout, channel_biases(problem, x, slice(None))[:, :3]
    for s, (channel, factor) in enumerate(zip(layout.channel, layout.factor, strict=True)):
        if channel < ACCEL0 and factor >= 0:
            out[:, channel] += x[:, s] * problem.epochs.rate[:, factor]
    return out


def _change(
    measured: MeasuredRows, before: Epochs, about: Array, number: int, residual: Array
) -> float:
    """Return by how many sigmas a prediction differs from that of the linearisation before."""
    index, c = measured.at_epoch, measured.measurement.values.shape[1]
    if not index.size:
        return 0.0
    if not before.linear_cov[index, number, 0, 0].any():
        return np.inf
    old, new = before.linear_about[index], about[index]
    d = np.hstack([nav_difference(new, old), new[:, ABOUT_BIAS:] - old[:, ABOUT_BIAS:]])
    expected = before.linear_residual[index, number, :c] - np.einsum(
        "krc,kc->kr", before.linear_H[index, number, :c], d
    )
    moved = measured.measurement.wrapped(expected - residual)[:, :, None]
    whitened = np.linalg.solve(np.linalg.cholesky(measured.measurement.cov[measured.rows]), moved)
    return float(np.abs(whitened).max())
