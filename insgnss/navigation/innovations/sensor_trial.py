"""What a second antenna would have brought to a flight that was recorded without one.

The flight is filtered and smoothed once more about its solution, with headings that agree with it:
nothing moves, and the covariance is that of the flight with them.
"""

from dataclasses import replace

import numpy as np

from ...base.units import DEG
from ...records import Array
from ...records.measurements import Measurement, Motion
from ..filter.codes import AZ
from ..filter.linearised import about_solution, prediction, with_measurements
from ..filter.problem import InitialState
from ..filter.solution import Solution, solve

ANTENNAS_SIGMA = 0.2 * DEG  # of a heading by antennas 1 m apart, as makers of receivers state it


def heading_with_antennas(solution: Solution) -> Array:
    """Return the standard deviations of the heading with two antennas whose mounting is known.

    Parameters
    ----------
    solution : Solution
        The smoothed flight, without measurements given by their prediction.

    Returns
    -------
    Array
        (m,) rad, at the epochs of the solution, with a heading at each fix.
    """
    problem = replace(solution.problem.without_measurements, event_chain=False)
    rows = np.flatnonzero(problem.epochs.has_position)
    time, every = solution.time[rows], [np.arange(rows.size)]

    def predict(motion: Motion, states: Array) -> Array:
        return motion.roll_pitch_heading[:, 2]

    def posed(values: Array) -> Measurement:
        return Measurement(
            "heading", time, values, ANTENNAS_SIGMA, predict, (), np.inf, 2.0 * np.pi
        )

    empty = with_measurements(problem, [posed(np.zeros(rows.size))], every, [rows])
    about = about_solution(problem, solution.nav, solution.x)
    values = prediction(empty, empty.measurements[0], about[rows])
    sigma = np.concatenate([solution.filter_sigma[0], problem.layout.sigma0])
    start = InitialState(solution.nav[0], solution.x[0], np.zeros(sigma.size), np.diag(sigma**2))
    equipped = solve(
        with_measurements(problem, [posed(values)], every, [rows]),
        start,
        "off",
        separations=0,
        about=solution,
        rows=0,
    )
    return np.sqrt(equipped.nav_covariance()[:, AZ, AZ])
