"""The error states behind those of navigation over one block: decay, mean, weight and biases."""

import numpy as np

from ....base.compilation import njit
from ..codes import ACCEL0, AIDING_ERROR, BIAS, DRIFT_CODE, TEMPERATURE_CODE
from .records import BiasCourse

SAME_BLOCK_S = 1e-8  # what differs by less has the same decay: stamps of a week resolve 1e-10 s


@njit(cache=True, allocates=False)
def set_decay(model, B, work):
    """Work out decay and mean of each state over a block.

    Parameters
    ----------
    model : StateModel
        The error states behind those of navigation.
    B : float
        Length of the block, s.
    work : IntervalWork
        Takes decay, mean and the length that they hold for.
    """
    for s in range(model.channel.size):
        b = model.beta[s] * B
        work.decay[s] = np.exp(-b)
        work.mean[s] = -np.expm1(-b) / b if b > 1e-6 else 1.0 - 0.5 * b
    work.last_block[0] = B


@njit(cache=True, allocates=False)
def course_from(epochs, e):
    """Return the course of biases from an epoch to the next.

    Parameters
    ----------
    epochs : Epochs
        The m epochs of the filter.
    e : int
        The earlier one.

    Returns
    -------
    BiasCourse
        At the earlier one.
    """
    T, begin = epochs.temperature[e], epochs.time[e]
    return BiasCourse(begin, T, (epochs.temperature[e + 1] - T) / (epochs.time[e + 1] - begin))


@njit(cache=True, allocates=False)
def later(course, seconds):
    """Return a course of biases some seconds later.

    Parameters
    ----------
    course : BiasCourse
        The course.
    seconds : float
        How much later, s.

    Returns
    -------
    BiasCourse
        The same course then.
    """
    T = course.temperature + seconds * course.warming
    return BiasCourse(course.elapsed + seconds, T, course.warming)


@njit(cache=True, allocates=False)
def block_states(intervals, i0, i1, B, course, x, model, work):
    """Compute decay, mean and weight of each state over the block, and the biases at its ends.

    Parameters
    ----------
    intervals : IntegrationIntervals
        The body increments.
    i0, i1 : int
        The integration intervals i0..i1 - 1 are passed.
    B : float
        Length of the block, s.
    course : BiasCourse
        At the start of the block.
    x : ndarray
        (ns,) nominal values of the other states.
    model : StateModel
        The error states behind those of navigation.
    work : IntervalWork
        Takes decay, mean, weight, bias (2, 6) and scale (6, 6).

    Returns
    -------
    bool
        Whether scale factors or misalignments are among the states.
    """
    ns = model.channel.size
    if abs(B - work.last_block[0]) > SAME_BLOCK_S:
        set_decay(model, B, work)
    work.bias[:] = 0.0
    has_scale = False
    for s in range(ns):
        f = model.factor[s]
        c = model.channel[s]
        if f == BIAS:
            work.weight[s] = 1.0
            work.bias[0, c] += x[s]
            work.bias[1, c] += x[s] * work.decay[s]
        elif f == DRIFT_CODE:
            work.weight[s] = course.elapsed + 0.5 * B
            work.bias[0, c] += x[s] * course.elapsed
            work.bias[1, c] += x[s] * (course.elapsed + B)
        elif f == TEMPERATURE_CODE:
            work.weight[s] = course.temperature + 0.5 * B * course.warming
            work.bias[0, c] += x[s] * course.temperature
            work.bias[1, c] += x[s] * (course.temperature + B * course.warming)
        elif f == AIDING_ERROR:
            work.weight[s] = 0.0
        else:
            if not has_scale:
                work.scale[:] = 0.0
                has_scale = True
            t = 0.0
            for i in range(i0, i1):
                t += intervals.dtheta[i, f] if f < ACCEL0 else intervals.dvel[i, f - ACCEL0]
            work.weight[s] = t / B
            work.scale[c, f] += x[s]
    return has_scale
