"""Pieces of fixes that a solved segment is not given, against what it predicts of them.

The fixes of some pieces of a few seconds, and the velocities in them, are withheld
(`Epochs.withheld`), the segment is aligned, filtered and smoothed again with the error model that
was found for it, and each withheld fix z is compared with its prediction,

    r' (C_pred + C_fix)^-1 r / 3,    r = z - h(x),    C_pred = H P H'

P the smoothed covariance, H the derivative of the fix by all states (of the time-correlated errors
of the fixes too, which a fix shares with those outside the piece) and C_fix its white error, as the
filter has them (K.1). The mean over the fixes is 1 where the sigmas are honest; fixes of one piece
err together, so that a handful of pieces makes it to a factor of two or three.
"""

from dataclasses import dataclass, replace

import numpy as np

from insgnss.flight.processing.segment import Segment
from insgnss.navigation.align.initial import initial_state
from insgnss.navigation.filter.codes import COVARIANCE_RESET, NAV, POSITION_ROW, USED, VEL
from insgnss.navigation.filter.filter import INCREMENT_BLOCK_S
from insgnss.navigation.filter.kernels.measurements import measured_triple
from insgnss.navigation.filter.kernels.records import make_triple
from insgnss.navigation.filter.solution import Solution, solve
from insgnss.navigation.filter.strapdown import kernel_earth

MOST_PIECES = 6
SHARE = 0.25  # of the time, at most, that is withheld at once


@dataclass(frozen=True)
class Withheld:
    """What the predictions of withheld fixes are off.

    Parameters
    ----------
    of_pieces : ndarray, shape (k,)
        Mean of the normalised squares of each piece.
    squares : ndarray, shape (3,)
        Mean of the normalised squares of all three axes together, of the horizontal ones and of
        down alone, each by its degrees of freedom.
    rms_m : ndarray, shape (2,)
        Root mean square of the difference, horizontal and down, m.
    """

    of_pieces: np.ndarray
    squares: np.ndarray
    rms_m: np.ndarray


def withheld_pieces(segments: list[Segment], length_s: float) -> Withheld | None:
    """Predict the fixes of pieces spread evenly over each segment without them.

    Fixes that the gate rejects even where all are given do not count.

    Parameters
    ----------
    segments : list of Segment
        The solved segments.
    length_s : float
        The length of a piece.

    Returns
    -------
    Withheld or None
        None where no segment is long enough to miss a piece.
    """
    squares: list[list[float]] = []
    residuals: list[list[float]] = []
    of_pieces: list[float] = []
    for segment in segments:
        number = _pieces(segment.solution, length_s)
        if not number.any():
            continue
        solution = _without(segment, number > 0)
        used = np.isin(segment.solution.verdict[:, POSITION_ROW], (USED, COVARIANCE_RESET))
        for piece in range(1, int(number.max()) + 1):
            first = len(squares)
            for e in np.flatnonzero(used & (number == piece)):
                r, S = _difference(solution, int(e))
                total = r @ np.linalg.solve(S, r) / 3.0
                level = r[:2] @ np.linalg.solve(S[:2, :2], r[:2]) / 2.0
                squares.append([total, level, r[2] ** 2 / S[2, 2]])
                residuals.append([float(np.hypot(r[0], r[1])), r[2]])
            if len(squares) > first:
                of_pieces.append(float(np.mean(squares[first:], axis=0)[0]))
    if not squares:
        return None
    rms = np.sqrt(np.mean(np.square(residuals), axis=0))
    return Withheld(np.array(of_pieces), np.mean(squares, axis=0), rms)


def _pieces(solution: Solution, length_s: float) -> np.ndarray:
    """Return for each epoch the number of the piece that its fix belongs to, from 1; else 0."""
    time, there = solution.time, solution.problem.epochs.has_position
    first, last = time[there][[0, -1]]
    count = min(MOST_PIECES, int(SHARE * (last - first) / length_s))
    number = np.zeros(time.size, dtype=np.int64)
    for k in range(count):
        middle = first + (last - first) * (k + 0.5) / count
        number[there & (np.abs(time - middle) <= 0.5 * length_s)] = k + 1
    return number


def _without(segment: Segment, pieces: np.ndarray) -> Solution:
    """Solve a segment again without the fixes of some epochs."""
    problem = segment.solution.problem
    epochs = problem.epochs
    given = epochs._replace(has_velocity=epochs.has_velocity & ~pieces)
    missing = given._replace(has_position=epochs.has_position & ~pieces)
    start = initial_state(replace(problem, epochs=missing)).start
    if problem.layout.offset >= 0:  # the prior belongs to the stamps before they were moved
        mean = start.mean.copy()
        mean[NAV.stop + problem.layout.offset] -= segment.time_offset_s
        start = replace(start, mean=mean)
    withheld = given._replace(withheld=epochs.withheld | pieces)
    return solve(replace(problem, epochs=withheld), start, separations=0, about=segment.solution)


def _difference(solution: Solution, e: int) -> tuple[np.ndarray, np.ndarray]:
    """Return fix minus prediction of an epoch, (3,) m, and the covariance that it should have."""
    problem = solution.problem
    model = problem.layout.kernel_model(INCREMENT_BLOCK_S, problem.aiding_interval_s)
    triple = make_triple(problem.layout.size - NAV.stop)
    before, after = max(e - 1, 0), min(e + 1, solution.time.size - 1)
    acceleration = (solution.nav[after, VEL] - solution.nav[before, VEL]) / (
        solution.time[after] - solution.time[before]
    )
    measured_triple(
        POSITION_ROW,
        e,
        problem.epochs,
        solution.nav[e],
        solution.x[e],
        np.array(problem.antenna_lever_b, dtype=np.float64),
        acceleration,
        model,
        kernel_earth(problem.frame, problem.backward),
        triple,
    )
    return triple.nu[:, 0].copy(), triple.H @ solution.covariance(np.array([e]))[
        0
    ] @ triple.H.T + triple.R
