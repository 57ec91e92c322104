"""Pieces of fixes that a solution is not given, against what it predicts of them.

The fixes of some pieces of a few seconds, and the velocities in them, are withheld
(`Epochs.withheld`), the segment is aligned, filtered and smoothed again with its error model, and
each withheld fix z is compared with its prediction,

    r' (C_pred + C_fix)^-1 r / 3,    r = z - h(x),    C_pred = H P H'

P the smoothed covariance, H the derivative of the fix by all states (of the time-correlated errors
of the fixes too, which a fix shares with those outside the piece) and C_fix its white error, as the
filter has them (K.1). The mean over the fixes is 1 where the sigmas are honest; fixes of one piece
err together, so that a handful of pieces makes it to a factor of two or three.
"""

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from ...base.errors import DataError
from ...records import Array
from ..filter.codes import COVARIANCE_RESET, NAV, POSITION_ROW, USED, VEL
from ..filter.filter import INCREMENT_BLOCK_S
from ..filter.kernels.measurements import measured_triple
from ..filter.kernels.records import make_triple
from ..filter.problem import EstimationProblem, InitialState
from ..filter.solution import Solution, solve
from ..filter.strapdown import kernel_earth

PIECE_S = 10.0  # of a piece by which sigmas are judged: a MEMS IMU holds decimetres so long
# mean normalised square of withheld fixes: chi-square of six pieces of three axes reaches it in one
# flight of a thousand
MOST_SQUARE = 2.0
MOST_PIECES = 6  # that are withheld at once (chosen)
SHARE = 0.25  # of the time, at most, that is withheld at once


@dataclass(frozen=True, eq=False)
class Withheld:
    """What the predictions of withheld fixes are off.

    Parameters
    ----------
    squares : ndarray, shape (n, 3)
        Normalised squares of each fix: of all three axes together, of the horizontal ones and of
        down alone, each by its degrees of freedom.
    difference_m : ndarray, shape (n, 2)
        Fix minus prediction, horizontal distance and down, m.
    piece : ndarray of int, shape (n,)
        Number of the piece of each fix.
    """

    squares: Array
    difference_m: Array
    piece: np.ndarray

    @property
    def of_pieces(self) -> Array:
        """Mean of the normalised squares of each piece, shape (k,)."""
        total = self.squares[:, 0]
        return np.array([total[self.piece == one].mean() for one in np.unique(self.piece)])


def withheld_pieces(
    solution: Solution, align: Callable[[EstimationProblem], InitialState], length_s: float
) -> Withheld | None:
    """Predict the fixes of pieces spread evenly over a segment without them.

    Fixes that the gate rejects even where all are given do not count.

    Parameters
    ----------
    solution : Solution
        The solved segment.
    align : callable
        Gives the initial state of the problem without these fixes.
    length_s : float
        The length of a piece, s.

    Returns
    -------
    Withheld or None
        None where the segment is too short to miss a piece.

    Raises
    ------
    DataError
        The segment has no solution without these fixes.
    """
    number = _pieces(solution, length_s)
    without = _without(solution, align, number > 0) if number.any() else solution
    used = np.isin(solution.verdict[:, POSITION_ROW], (USED, COVARIANCE_RESET))
    rows = np.flatnonzero(used & (number > 0))
    if not number.any() or not rows.size:
        return None
    squares, difference = [], []
    for e in rows.tolist():
        r, S = _difference(without, e)
        total = r @ np.linalg.solve(S, r) / 3.0
        level = r[:2] @ np.linalg.solve(S[:2, :2], r[:2]) / 2.0
        squares.append([total, level, r[2] ** 2 / S[2, 2]])
        difference.append([float(np.hypot(r[0], r[1])), r[2]])
    return Withheld(np.array(squares), np.array(difference), number[rows])


def predicts(
    solution: Solution, align: Callable[[EstimationProblem], tuple[InitialState, str]]
) -> bool:
    """Tell whether a solution predicts fixes that are withheld within its sigmas.

    Parameters
    ----------
    solution : Solution
        The solved segment.
    align : callable
        Gives the initial state of the problem without these fixes, and how it was found.

    Returns
    -------
    bool
        Whether the mean of their normalised squares is below `MOST_SQUARE`; not where a segment is
        too short, or has no solution without them.
    """
    try:
        pieces = withheld_pieces(solution, lambda problem: align(problem)[0], PIECE_S)
    except DataError:
        return False
    return pieces is not None and bool(pieces.of_pieces.mean() < MOST_SQUARE)


def _pieces(solution: Solution, length_s: float) -> np.ndarray:
    """Return for each epoch the number of the piece that its fix belongs to, from 1; else 0."""
    time, measured = solution.time, solution.problem.epochs.has_position
    first, last = time[measured][[0, -1]]
    count = min(MOST_PIECES, int(SHARE * (last - first) / length_s))
    number = np.zeros(time.size, dtype=np.int64)
    for k in range(count):
        middle = first + (last - first) * (k + 0.5) / count
        number[measured & (np.abs(time - middle) <= 0.5 * length_s)] = k + 1
    return number


def _without(
    solution: Solution, align: Callable[[EstimationProblem], InitialState], pieces: np.ndarray
) -> Solution:
    """Solve a segment again without the fixes of some epochs."""
    problem = solution.problem
    epochs = problem.epochs
    kept = epochs._replace(has_velocity=epochs.has_velocity & ~pieces)
    missing = kept._replace(has_position=epochs.has_position & ~pieces)
    start = align(replace(problem, epochs=missing))
    withheld = kept._replace(withheld=epochs.withheld | pieces)
    return solve(replace(problem, epochs=withheld), start, separations=0, about=solution)


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
