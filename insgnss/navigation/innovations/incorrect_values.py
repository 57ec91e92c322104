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
        The solution without these values and the note; None where none stand apart, or too many.
    """
    spells: list[ValueSpell] = []
    offered = sum(measured.rows.size for measured in solution.problem.measurements)
    for _ in range(ROUNDS):
        kept, incorrect = _without_spells(solution, alone)
        if not incorrect:
            break
        if sum(m.rows.size for m in kept) < (1.0 - MOST_WITHHELD) * offered:
            return None
        spells += incorrect
        every = zip(*((m.measurement, m.rows, m.at_epoch) for m in kept), strict=True)
        solution = solve_again(with_measurements(solution.problem, *every))
        if not suspicious(solution):
            break
    return (solution, _check(spells)) if spells else None


def _without_spells(
    solution: Solution, alone: Solution
) -> tuple[tuple[MeasuredRows, ...], list[ValueSpell]]:
    """Return the rows of all measurements without their spells, and the spells."""
    about = about_solution(alone.problem, alone.nav, alone.x)
    of_sensors = about_solution(solution.problem, solution.nav, solution.x)[:, ABOUT_STATES:]
    about[:, ABOUT_STATES:] = of_sensors
    pieces, means, ratios = [], [], []
    for number in range(len(solution.problem.measurements)):
        of_it, mean, white, of_solution = _means(solution, alone, number, about)
        sigma = np.sqrt(white + of_solution + _of_own_states(solution, number, of_it))
        pieces.append(of_it)
        means.append((mean, sigma))
        ratios.append(np.abs(mean) / sigma)
    largest = max(float(ratio.max(initial=0.0)) for ratio in ratios)
    if largest < APART_SIGMAS:
        return solution.problem.measurements, []
    kept, spells = [], []
    for number, measured in enumerate(solution.problem.measurements):
        of_it, ratio = pieces[number], ratios[number]
        time = measured.measurement.time[measured.rows]
        keep = np.ones(time.size, dtype=np.bool_)
        flagged = ratio.max(axis=1, initial=0.0) > OF_LARGEST * largest
        for first, stop in _runs(flagged):
            # it begins and ends somewhere in the pieces beside
            low, high = of_it[max(first - 1, 0)][0], of_it[min(stop, len(of_it) - 1)][-1]
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
) -> tuple[list[np.ndarray], Array, Array, Array]:
    """Return the pieces of a measurement, and of each the mean residual, its variance from white
    errors R / n, and that from the motion H P H' of the solution that it is taken against.
    """
    measured = solution.problem.measurements[number]
    measurement, pieces = measured.measurement, _pieces(solution, measured)
    predicted = prediction(solution.problem, measured, about[measured.at_epoch])
    residual = measurement.minus(measured.rows, predicted)
    variance = np.diagonal(measurement.cov[measured.rows], axis1=1, axis2=2)
    limit = measurement.gate_sigma * np.sqrt(variance)
    if against is solution:  # a single gross value is the gate's
        residual = np.clip(residual, -limit, limit)
    mean = np.array([residual[piece].mean(axis=0) for piece in pieces])
    white = np.array([variance[piece].mean(axis=0) / len(piece) for piece in pieces])
    middle = _middle(measured, pieces)
    H = solution.problem.epochs.linear_H[middle, number, : residual.shape[1]]
    P = against.nav_covariance(middle)
    of_solution = np.einsum("kci,kij,kcj->kc", H[:, :, NAV], P, H[:, :, NAV])
    if (of_bias := H[:, :, OF_BIAS:OF_STATES] ** 2).any():
        bias = against.channel_bias(_kept(against, middle))[1][:, :3]
        of_solution += np.einsum("kci,ki->kc", of_bias, bias**2)
    return pieces, mean.reshape(of_solution.shape), white.reshape(of_solution.shape), of_solution


def _of_own_states(solution: Solution, number: int, pieces: list[np.ndarray]) -> Array:
    """Return the variance (k, c) of the prediction in each piece from states of measurements."""
    measured = solution.problem.measurements[number]
    middle = _middle(measured, pieces)
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


def _middle(measured: MeasuredRows, pieces: list[np.ndarray]) -> np.ndarray:
    """Return the epoch in the middle of each piece."""
    return measured.at_epoch[np.array([piece[len(piece) // 2] for piece in pieces], dtype=np.int64)]


def _pieces(solution: Solution, measured: MeasuredRows) -> list[np.ndarray]:
    """Return the rows of each piece of time that holds any."""
    time = solution.problem.epochs.time[measured.at_epoch]
    cuts = np.flatnonzero(np.diff(time // SPELL_PIECE_S)) + 1
    return [piece for piece in np.split(np.arange(time.size), cuts) if piece.size]


def _runs(flagged: np.ndarray) -> list[tuple[int, int]]:
    """Return first and end of each run of true values."""
    edges = np.flatnonzero(np.diff(np.concatenate([[0], flagged, [0]])))
    return list(pairwise(edges.tolist()))[::2]


def _check(spells: list[ValueSpell]) -> Finding:
    """Say which values stand apart."""
    texts = []
    for spell in spells[:MOST_SPELLS_NAMED]:
        unit, factor = (" deg", 1.0 / DEG) if spell.angle else ("", 1.0)
        texts.append(
            f"{spell.measurement}, {spell.first_s:.1f} to {spell.last_s:.1f} s, by"
            f" {factor * spell.mean:.3g} +- {factor * spell.sigma:.2g}{unit}"
        )
    more = f" and {len(spells) - MOST_SPELLS_NAMED} more" if len(spells) > MOST_SPELLS_NAMED else ""
    return Question("measurements", "one level throughout").note(
        "for seconds, values differ from the flight solved without these sensors:"
        f" {'; '.join(texts)}{more}; they are left out",
        "look for what disturbed the sensor there: iron or currents, reflections, slip",
    )
