"""A first attitude from measurements given by their prediction, where the motion gives none.

Roll and pitch come from the accelerometers, as if the vehicle moved steadily. Of all headings that
one is taken whose predictions, turned along by the gyros, are nearest to what was measured. It is
the start of a first pass without the measurements, about which they are linearised.
"""

from dataclasses import replace

import numpy as np

from ...geodesy.rotation import (
    quaternion_from_rotation,
    rotation_from_rpy,
    rotation_from_vector,
)
from ...records import Array
from ...records.interpolation import columns_at
from ..filter.codes import QUAT, VEL
from ..filter.linearised import prediction
from ..filter.problem import EstimationProblem, InitialState, MeasuredRows
from .initial import given_attitude

LEVEL_S = 2.0  # of specific force that is averaged: shorter than a manoeuvre, longer than vibration
SEARCH_S = 10.0  # of measurements that are compared: gyros of phones turn away by a degree in it
HEADINGS_RAD = np.radians(np.arange(0.0, 360.0, 5.0))  # steps well below the starting sigma
# an acceleration of 0.9 m/s^2 tilts by 5 deg; the filter sees the same measurements again, of whose
# heading, good to 2 deg, then 1 % is used twice
START_SIGMA_RAD = np.radians([5.0, 5.0, 20.0])
APART_RAD = np.radians(30.0)  # headings that are two different answers, not one of another step
LEAST_HEADING_GAIN = 25.0  # of the sum of squares, of the best heading over any apart: five sigmas


def measured_attitude(problem: EstimationProblem) -> tuple[InitialState, str] | None:
    """Return a start whose heading the measurements of the first seconds tell.

    Parameters
    ----------
    problem : EstimationProblem
        The problem with its measurements.

    Returns
    -------
    tuple of InitialState and str, or None
        The start and how it was found; None where no heading fits better than all others.
    """
    epochs, inc = problem.epochs, problem.inc
    last = int(np.searchsorted(epochs.time, SEARCH_S))
    early = [_until(measured, last) for measured in problem.measurements]
    level = inc.dvel[: np.searchsorted(np.cumsum(inc.dt), LEVEL_S) + 1].mean(axis=0)
    roll, pitch = np.arctan2(-level[1], -level[2]), np.arctan2(level[0], np.hypot(*level[1:]))
    nominal = np.zeros((last, epochs.linear_about.shape[1]))
    nominal[:, : VEL.stop] = _motion_of_fixes(problem, last)
    since_start, C_ln = _integrate_gyros(problem, last), problem.frame.C_ln_at(epochs.position[0])
    sums = np.zeros(HEADINGS_RAD.size)
    for k, heading in enumerate(HEADINGS_RAD):
        C_lb = C_ln @ rotation_from_rpy(np.array([roll, pitch, heading])) @ since_start
        nominal[:, QUAT] = quaternion_from_rotation(C_lb)
        sums[k] = sum(_misfit(problem, measured, nominal) for measured in early)
    best = int(np.argmin(sums))
    far_off = np.abs(np.angle(np.exp(1j * (HEADINGS_RAD - HEADINGS_RAD[best])))) > APART_RAD
    if sums[far_off].min() - sums[best] < LEAST_HEADING_GAIN:
        return None
    rpy = np.array([roll, pitch, HEADINGS_RAD[best]])
    names = ", ".join(m.measurement.name for m in early if m.rows.size)
    how = f"initial attitude from the accelerometers, its heading from {names}"
    return given_attitude(problem, rpy, START_SIGMA_RAD), how


def _until(measured: MeasuredRows, last: int) -> MeasuredRows:
    """Return the rows of a measurement before an epoch."""
    early = measured.at_epoch < last
    return replace(measured, rows=measured.rows[early], at_epoch=measured.at_epoch[early])


def _misfit(problem: EstimationProblem, measured: MeasuredRows, nominal: Array) -> float:
    """Return the sum of squares of whitened residuals about a nominal."""
    measurement, rows = measured.measurement, measured.rows
    if not rows.size:
        return 0.0
    predicted = prediction(problem, measured, nominal[measured.at_epoch])
    root = np.linalg.cholesky(measurement.cov[rows])
    residual = measurement.minus(rows, predicted)[:, :, None]
    return float(np.sum(np.linalg.solve(root, residual) ** 2))


def _integrate_gyros(problem: EstimationProblem, last: int) -> Array:
    """Return the rotations (last, 3, 3) of the body since the start by its gyros alone."""
    stop = problem.epochs.stop[:last]
    steps = rotation_from_vector(problem.inc.dtheta[: stop[-1]])
    out = np.tile(np.eye(3), (last, 1, 1))
    for e in range(1, last):
        out[e] = out[e - 1]
        for step in steps[stop[e - 1] : stop[e]]:
            out[e] = out[e] @ step
    return out


def _motion_of_fixes(problem: EstimationProblem, last: int) -> Array:
    """Return position and velocity (last, 6) in l, m and m/s, between the fixes of the antenna."""
    epochs = problem.epochs
    fix = np.flatnonzero(epochs.has_position)
    position = epochs.position[fix]
    velocity = np.gradient(position, epochs.time[fix], axis=0)
    return columns_at(epochs.time[:last], epochs.time[fix], np.hstack([position, velocity]))
