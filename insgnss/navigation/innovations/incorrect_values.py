"""Spells of incorrect values of further sensors: iron beside a magnetometer, a wheel that slips.

The gate compares single values with a prediction that follows those before; errors of a few sigmas
that last for seconds pull the solution along and then agree with it. The solution of the same
flight without the sensors cannot be pulled. In a piece of time of n values the mean residual
against it,

    r = mean( z_i - h(x_i) ),    sigma^2 = R / n + H P H' + H_s P_s H_s'                       (V.1)

with P of the solution without the sensors, and s the sensor's own states with their covariance P_s,
is an upper bound of what honest values show, however much the errors within a piece have in common.
The error model of the solution without the sensors is looked for without them as well: larger noise
of the IMU that would explain the spell is adopted only where the fixes show it.

That solution is a pass more. It is made where a mean residual r against the solution with the
sensors is larger than honest values leave it. Such a residual has the covariance R - H P H'; of a
mean of errors H e that a piece has in common,

    sigma^2 = R / n - H P H'                                                                   (V.2)

in its variance.
"""

from collections.abc import Callable
from dataclasses import replace
from itertools import pairwise
from typing import NamedTuple

import numpy as np

from ...base.units import DEG
from ...records import Array, Finding, Question
from ..filter.codes import ABOUT_STATES, NAV, OF_BIAS, OF_STATES
from ..filter.linearised import about_solution, prediction, with_measurements
from ..filter.problem import EstimationProblem, MeasuredRows
from ..filter.solution import Solution
from .wrong_sensor import explain_sensors

SPELL_PIECE_S = 5.0  # of the time in which residuals are averaged: a disturbance lasts longer
# (V.2): honest pieces of an hour exceed it once in 200 flights, which costs a pass; errors of four
# sigmas of a value for half a minute reached 6 to 20 on simulated flights
SUSPECT_SIGMAS = 4.5
LEAST_LEFT = 0.4  # of R / n, in (V.2): errors change within a piece, so that less is never left
# (V.1) beside (V.2): honest pieces stay below 2, for the bound adds what they have in common;
# an error of 0.8 deg reached 4.2 to 13 with three kinds of IMU
APART_SIGMAS = 3.5
OF_LARGEST = 0.5  # of the largest ratio: pieces below are off by own states that it has pulled
MOST_WITHHELD = 0.3  # share of the values; where more stand apart none can be called the others
ROUNDS = 3  # after each of which own states no longer follow the spells
MOST_SPELLS_NAMED = 5  # spells that the note names


class ValueSpell(NamedTuple):
    """Values of a sensor that stand apart from the flight without it.

    Parameters
    ----------
    measurement : str
        Name of the sensor.
    first_s, last_s : float
        s, GPST.
    mean, sigma : float
        Of the component that is furthest off (V.1), in the unit of the values.
    angle : bool
        Whether the values are angles, rad.
    """

    measurement: str
    first_s: float
    last_s: float
    mean: float
    sigma: float
    angle: bool

    @property
    def sentence(self) -> str:
        """Which values differ by how much."""
        unit, factor = (" deg", 1.0 / DEG) if self.angle else ("", 1.0)
        return (
            f"{self.measurement}, {self.first_s:.1f} to {self.last_s:.1f} s, by"
            f" {factor * self.mean:.3g} +- {factor * self.sigma:.2g}{unit}"
        )


def suspicious(solution: Solution) -> bool:
    """Return whether a mean residual of a piece is larger than honest values leave it (V.2).

    Parameters
    ----------
    solution : Solution
        The solution with the measurements.

    Returns
    -------
    bool
        False without measurements.
    """
    about = about_solution(solution.problem, solution.nav, solution.x)
    for number in range(len(solution.problem.measurements)):
        _, mean, white, of_solution = _means(solution, solution, number, about)
        remaining = np.maximum(white - of_solution, LEAST_LEFT * white)
        if (mean**2 > SUSPECT_SIGMAS**2 * remaining).any():
            return True
    return False


def withhold_incorrect_values(
    solution: Solution,
    alone: Solution,
    solve_again: Callable[[EstimationProblem], Solution],
) -> tuple[Solution, Finding] | None:
    """Leave out the values of spells that stand apart from the flight without the measurements.

    Where too many stand apart for the others to be believed, the sensor is wrong as a whole.

    Parameters
    ----------
    solution : Solution
        The solution with the measurements.
    alone : Solution
        The solution of the same epochs without them.
    solve_again : callable
        Solves the problem of `solution` with fewer values.

    Returns
    -------
    tuple of Solution and Finding, or None
        The solution without these values and the note, or the one with all and the contradiction;
        None where none stand apart.
    """
    spells: list[ValueSpell] = []
    problem = solution.problem
    offered = sum(measured.rows.size for measured in problem.measurements)
    for _ in range(ROUNDS):
        kept, incorrect = _without_spells(solution, alone)
        if not incorrect:
            break
        if sum(m.rows.size for m in kept) < (1.0 - MOST_WITHHELD) * offered:
            worst = max(incorrect, key=lambda spell: abs(spell.mean) / spell.sigma)
            where = f", most of all {worst.sentence}"
            return solution, contradicting_sensor(problem, alone, where)
        spells += incorrect
        every = zip(*((m.measurement, m.rows, m.at_epoch) for m in kept), strict=True)
        solution = solve_again(with_measurements(solution.problem, *every))
        if not suspicious(solution):
            break
    return (solution, _check(problem, alone, spells)) if spells else None


def _without_spells(
    solution: Solution, alone: Solution
) -> tuple[tuple[MeasuredRows, ...], list[ValueSpell]]:
    """Return the rows of all measurements without their spells, and the spells."""
    about = about_solution(alone.problem, alone.nav, alone.x)
    of_sensors = about_solution(solution.problem, solution.nav, solution.x)[:, ABOUT_STATES:]
    about[:, ABOUT_STATES:] = of_sensors
    edges, means, ratios = [], [], []
    for number in range(len(solution.problem.measurements)):
        of_it, mean, white, of_solution = _means(solution, alone, number, about)
        sigma = np.sqrt(white + of_solution + _of_own_states(solution, number, of_it))
        edges.append(of_it)
        means.append((mean, sigma))
        ratios.append(np.abs(mean) / sigma)
    largest = max(float(ratio.max(initial=0.0)) for ratio in ratios)
    if largest < APART_SIGMAS:
        return solution.problem.measurements, []
    kept, spells = [], []
    for number, measured in enumerate(solution.problem.measurements):
        of_it, ratio = edges[number], ratios[number]
        time = measured.measurement.time[measured.rows]
        keep = np.ones(time.size, dtype=np.bool_)
        flagged = ratio.max(axis=1, initial=0.0) > OF_LARGEST * largest
        for first, stop in _runs(flagged):
            # it begins and ends somewhere in the pieces beside
            low, high = of_it[max(first - 1, 0)], of_it[min(stop + 1, of_it.size - 1)] - 1
            keep[low : high + 1] = False
            worst, axis = divmod(int(ratio[first:stop].argmax()), ratio.shape[1])
            furthest, spread = (float(each[first + worst, axis]) for each in means[number])
            angle = measured.measurement.period is not None
            name = measured.measurement.name
            spells.append(
                ValueSpell(name, float(time[low]), float(time[high]), furthest, spread, angle)
            )
        kept.append(replace(measured, rows=measured.rows[keep], at_epoch=measured.at_epoch[keep]))
    return tuple(kept), spells


def _means(
    solution: Solution, against: Solution, number: int, about: Array
) -> tuple[np.ndarray, Array, Array, Array]:
    """Return the edges of the pieces of a measurement, and of each piece the mean residual, its
    variance from white errors R / n, and that from the motion H P H' of the solution that it is
    taken against.
    """
    measured = solution.problem.measurements[number]
    measurement, edges = measured.measurement, _edges(solution, measured)
    predicted = prediction(solution.problem, measured, about[measured.at_epoch])
    residual = measurement.minus(measured.rows, predicted)
    variance = np.diagonal(measurement.cov[measured.rows], axis1=1, axis2=2)
    limit = measurement.gate_sigma * np.sqrt(variance)
    if against is solution:  # a single gross value is the gate's
        residual = np.clip(residual, -limit, limit)
    values = np.diff(edges)[:, None]
    mean = np.add.reduceat(residual, edges[:-1], axis=0) / values
    white = np.add.reduceat(variance, edges[:-1], axis=0) / values**2
    middle = _middle(measured, edges)
    H = solution.problem.epochs.linear_H[middle, number, : residual.shape[1]]
    P = against.nav_covariance(middle)
    of_solution = np.einsum("kci,kij,kcj->kc", H[:, :, NAV], P, H[:, :, NAV])
    if (of_bias := H[:, :, OF_BIAS:OF_STATES] ** 2).any():
        bias = against.channel_bias(_kept(against, middle))[1][:, :3]
        of_solution += np.einsum("kci,ki->kc", of_bias, bias**2)
    return edges, mean, white, of_solution


def _of_own_states(solution: Solution, number: int, edges: np.ndarray) -> Array:
    """Return the variance (k, c) of the prediction in each piece from states of measurements."""
    measured = solution.problem.measurements[number]
    middle = _middle(measured, edges)
    H = solution.problem.epochs.linear_H[middle, number, :, OF_STATES:]
    H = H[:, : measured.measurement.values.shape[1]]
    q = H.shape[2]
    P = (
        solution.covariance(_kept(solution, middle))[:, -q:, -q:]
        if q
        else np.zeros((middle.size, 0, 0))
    )
    return np.einsum("kci,kij,kcj->kc", H, P, H)


def _kept(solution: Solution, index: np.ndarray) -> np.ndarray:
    """Return the next epochs whose covariance is kept, so that no pass is run again for it."""
    return solution.rows[np.searchsorted(solution.rows[:-1], index)]


def _middle(measured: MeasuredRows, edges: np.ndarray) -> np.ndarray:
    """Return the epoch in the middle of each piece."""
    return measured.at_epoch[(edges[:-1] + edges[1:]) // 2]


def _edges(solution: Solution, measured: MeasuredRows) -> np.ndarray:
    """Return the first row of each piece of time that holds any, and the number of rows."""
    time = solution.problem.epochs.time[measured.at_epoch]
    cuts = np.flatnonzero(np.diff(time // SPELL_PIECE_S)) + 1
    return np.unique(np.concatenate([[0], cuts, [time.size]]))


def _runs(flagged: np.ndarray) -> list[tuple[int, int]]:
    """Return first and end of each run of true values."""
    edges = np.flatnonzero(np.diff(np.concatenate([[0], flagged, [0]])))
    return list(pairwise(edges.tolist()))[::2]


def contradicting_sensor(problem: EstimationProblem, alone: Solution, spell: str = "") -> Finding:
    """Return the contradiction of the sensor whose values are the furthest from a flight.

    Parameters
    ----------
    problem : EstimationProblem
        The problem with the sensors.
    alone : Solution
        The solution of the same epochs without them.
    spell : str
        Where and by how much they differ most, in words.

    Returns
    -------
    Finding
        What would explain it stands in it, where anything does.
    """
    worst = max(explain_sensors(problem, alone), key=lambda one: one.before)
    return Question("measurements", "as the flight without this sensor predicts").contradiction(
        f"{worst.sensor} contradicts the flight solved without this sensor: the values scatter "
        f"{worst.before:.2g} times as much as their sigmas state{spell}{worst.sentence()}",
        "check time stamps, units, signs, lever arm and kind of the sensor, or leave it out",
    )


def _check(problem: EstimationProblem, alone: Solution, spells: list[ValueSpell]) -> Finding:
    """Say which values stand apart."""
    texts = [spell.sentence for spell in spells[:MOST_SPELLS_NAMED]]
    names = {spell.measurement for spell in spells}
    causes = "".join(one.sentence() for one in explain_sensors(problem, alone, names))
    more = f" and {len(spells) - MOST_SPELLS_NAMED} more" if len(spells) > MOST_SPELLS_NAMED else ""
    return Question("measurements", "one level throughout").note(
        "some seconds of values contradict the flight solved without these sensors: "
        f"{'; '.join(texts)}{more}; they are left out{causes}",
        "look for a disturbance of the sensor there, such as iron, currents, reflections, slip",
    )
