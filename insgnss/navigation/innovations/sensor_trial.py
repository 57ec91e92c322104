"""What a further sensor would have brought to a flight that was recorded without one.

The flight is filtered and smoothed once more about its solution, with values that agree with it:
nothing moves, and the covariance is that of the flight with them.
"""

from dataclasses import replace

import numpy as np

from ...records import Array
from ...records.measurements import Measurement
from ..filter.codes import AZ
from ..filter.linearised import about_solution, prediction, with_measurements
from ..filter.problem import InitialState
from ..filter.solution import Solution, solve


def heading_with(solution: Solution, sensor: Measurement) -> Array:
    """Return the standard deviations of the heading with a further sensor.

    Parameters
    ----------
    solution : Solution
        The smoothed flight, without measurements given by their prediction.
    sensor : Measurement
        The sensor; of its times and values only how many components these have counts.

    Returns
    -------
    Array
        (m,) rad, at the epochs of the solution, with values at each fix.
    """
    problem = replace(
        solution.problem.without_measurements,
        event_chain=False,
        layout=solution.problem.layout.with_states_of(sensor),
    )
    rows = np.flatnonzero(problem.epochs.has_position)
    time, every = solution.time[rows], [np.arange(rows.size)]
    sigma, components = np.sqrt(sensor.cov[0].diagonal()), sensor.values.shape[1]

    def posed(values: Array) -> Measurement:
        return replace(sensor, time=time, values=values, sigma=sigma, gate_sigma=np.inf)

    empty = with_measurements(problem, [posed(np.zeros((rows.size, components)))], every, [rows])
    solution = replace(solution, x=np.pad(solution.x, ((0, 0), (0, len(sensor.states)))))
    about = about_solution(empty, solution.nav, solution.x)
    values = prediction(empty, empty.measurements[0], about[rows])
    start_sigma = np.concatenate([solution.filter_sigma[0], problem.layout.sigma0])
    start = InitialState(
        *(solution.nav[0], solution.x[0], np.zeros(start_sigma.size), np.diag(start_sigma**2))
    )
    equipped = solve(
        with_measurements(problem, [posed(values)], every, [rows]),
        start,
        "off",
        separations=0,
        about=solution,
        rows=0,
    )
    return np.sqrt(equipped.nav_covariance()[:, AZ, AZ])
