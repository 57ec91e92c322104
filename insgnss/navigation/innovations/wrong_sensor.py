"""What is wrong with a sensor whose values contradict the flight as a whole.

With z the values and h their prediction by the flight solved without the sensor, its own constants
s with their prior, and p one more unknown,

    z - h = H_s s + c p + v                                                              (V.3)

holds c = dh/dt for stamps that are p too early, c = h for values that are 1 + p times as large. A
course given as heading leaves z less the course instead. The one that leaves least is named, where
it leaves much less than nothing at all does.
"""

from collections.abc import Collection
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from ...base.units import DEG
from ...records import Array
from ...records.measurements import Motion, OwnState
from ..filter.codes import OF_STATES, VEL
from ..filter.linearised import (
    about_solution,
    linearised_about,
    prediction,
    with_measurements,
)
from ..filter.problem import EstimationProblem, MeasuredRows
from ..filter.solution import Solution

# share of the sum of squares that the right explanation leaves at most; the heading of the flight
# without the sensor wanders by some tenths of a degree, which no explanation takes away
LEFT_AT_MOST = 0.5
LONGEST_STEP_S = 1.0  # between values, over which their change is a rate still
LEAST_SPEED_MPS = 2.0  # over ground: below it a course is noise (chosen)
WIDER = 100.0  # times its sigma: a constant is then what the values alone make of it
FAR_SIGMAS = 3.0  # a-priori sigmas of a constant: further off it is stated wrong, not uncertain


class WrongSensor(NamedTuple):
    """What would make the values of a sensor agree with the flight.

    Parameters
    ----------
    sensor : str
        Its name.
    text : str
        In words; empty where nothing does.
    before, after : float
        Times their sigmas that the values scatter without and with it.
    """

    sensor: str
    text: str
    before: float
    after: float

    def sentence(self) -> str:
        """Return it with its figures, to follow another sentence; empty where nothing explains."""
        if not self.text:
            return ""
        return f"; {self.text} they scatter {self.after:.2g} times as much"


def explain_sensors(
    problem: EstimationProblem, alone: Solution, names: Collection[str] | None = None
) -> list[WrongSensor]:
    """Return what explains best why the values of sensors are not those that a flight predicts.

    Parameters
    ----------
    problem : EstimationProblem
        The problem with the sensors.
    alone : Solution
        The solution of the same epochs without them; it may have states that the problem lacks.
    names : collection of str, optional
        Those that are asked for; all by default.

    Returns
    -------
    list of WrongSensor
        Without text where none leaves less than `LEFT_AT_MOST` of the squares.
    """
    every = zip(*((m.measurement, m.rows, m.at_epoch) for m in problem.measurements), strict=True)
    posed = with_measurements(alone.problem, *every)  # with the states that its diagnosis added
    posed, _ = linearised_about(posed, alone.nav, alone.x)
    about = about_solution(posed, alone.nav, alone.x)
    return [
        _explain_sensor(posed, about, number)
        for number, measured in enumerate(posed.measurements)
        if names is None or measured.measurement.name in names
    ]


def _explain_sensor(posed: EstimationProblem, about: Array, number: int) -> WrongSensor:
    """Explain one sensor of a problem that is linearised about the flight without them."""
    measured = posed.measurements[number]
    measurement, index = measured.measurement, measured.at_epoch
    c = measurement.values.shape[1]
    residual = posed.epochs.linear_residual[index, number, :c]
    H_states = posed.epochs.linear_H[index, number, :c, OF_STATES:][:, :, measured.states]
    sigma = np.sqrt(np.diagonal(measurement.cov[measured.rows], axis1=1, axis2=2))
    prior = np.array([state.sigma for state in measurement.states])
    base, _ = _fit_unknowns(residual, H_states, sigma, prior)
    freed, constants = _fit_unknowns(residual, H_states, sigma, WIDER * prior)
    before, candidates = base, []
    if (beyond := np.abs(constants) / prior).max(initial=0.0) > FAR_SIGMAS:
        before = float(np.sum((residual / sigma) ** 2))
        state, value = measurement.states[beyond.argmax()], float(constants[beyond.argmax()])
        candidates.append((freed, f"with its {_stated_text(state, value)}"))

    def with_one_more(column: Array, text: str, begin: float) -> None:
        columns, sigmas = np.dstack([H_states, column]), np.append(prior, np.inf)
        squares, x = _fit_unknowns(residual, columns, sigma, sigmas)
        candidates.append((squares, text.format(begin + float(x[-1]))))

    predicted = measurement.values[measured.rows] - residual
    if (rate := _rate(measured, predicted)) is not None:
        with_one_more(rate, "with {:+.3f} s added to its stamps", 0.0)
    about = about[index]
    if measurement.period is None:
        with_one_more(predicted, "divided by {:.3g} (unit, sign or length)", 1.0)
    elif c == 1 and (moving := np.linalg.norm(about[:, VEL], axis=1) > LEAST_SPEED_MPS).any():
        as_course = replace(measured, measurement=replace(measurement, predict=_course))
        of_course = measurement.minus(measured.rows, prediction(posed, as_course, about))
        heading, course = (
            _fit_unknowns(of[moving], H_states[moving], sigma[moving], prior)[0]
            for of in (residual, of_course)
        )
        candidates.append((base * course / heading, "taken for the course over ground"))
    # a further unknown always leaves less; it is believed where it leaves much less
    squares, text = before, ""
    for candidate in candidates:
        if candidate[0] < LEFT_AT_MOST * squares:
            squares, text = candidate
    scatter = np.sqrt(np.array([before, squares]) / max(residual.size, 1)).tolist()
    return WrongSensor(measurement.name, text, *scatter)


def _stated_text(state: OwnState, value: float) -> str:
    """Say of a constant what would be and what is stated."""
    unit, factor = ("deg", 1.0 / DEG) if state.unit == "rad" else (state.unit, 1.0)
    text = f"{state.name} at {factor * value:.3g} {unit}".rstrip()
    return f"{text} (stated 0 +- {factor * state.sigma:.2g})"


def _course(motion: Motion, states: Array) -> Array:
    """Return the direction of the velocity, rad from north."""
    north, east, _ = motion.velocity_ned.T
    return np.arctan2(east, north)


def _rate(measured: MeasuredRows, predicted: Array) -> Array | None:
    """Return the change of predictions (k, c) per second; None of too few, or sparse ones."""
    time = measured.measurement.time[measured.rows]
    steps = np.diff(time)
    if time.size < 3 or np.median(steps) > LONGEST_STEP_S:
        return None
    change = measured.measurement.wrapped(np.diff(predicted, axis=0)) / steps[:, None]
    change[steps > LONGEST_STEP_S] = 0.0
    return 0.5 * (np.vstack([change[:1], change]) + np.vstack([change, change[-1:]]))


def _fit_unknowns(
    residual: Array, columns: Array, sigma: Array, prior: Array
) -> tuple[float, Array]:
    """Return the weighted sum of squares that (V.3) leaves, and its unknowns."""
    A = (columns / sigma[:, :, None]).reshape(residual.size, -1)
    z = (residual / sigma).ravel()
    x = np.linalg.lstsq(A.T @ A + np.diag(prior**-2.0), A.T @ z, rcond=None)[0]
    return float(np.sum((z - A @ x) ** 2)), x.astype(np.float64)
