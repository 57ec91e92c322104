r"""Fixes minus solution, minute by minute: what no error model can argue away.

The innovations compare a fix with a prediction that follows the fixes before it; time-correlated
errors, an open gate or a reset can make them consistent beside a solution that leaves its own
fixes. The residual of fix i against the smoothed solution cannot,

    r_i = z_i - (p_i + C_i l + d (v_i + C_i (omega_i x l)) + a_i d^2 / 2)

p, v, a, C of the IMU in the local frame, l the lever arm with its estimated error, d the time
offset (`navigation.filter.filter`, K.1). Time-correlated errors of the fixes are not taken off:
they are part of what a fix claims. In a piece of time the mean is weighted with what each fix
claims,

    r = sum w_i r_i,    w_i ~ 1 / (s_i^2 + sum_g c_gi^2),    sum w_i = 1

s_i the white error of the fix and c_gi that of each time-correlated process. With e_i the error of
the antenna in the solution, r = sum w_i (v_i - e_i), and the claims allow it

    sigma^2 = sum w_i^2 s_i^2 + sum_g (sum w_i c_gi)^2 + mean(H_i P_i H_i')                   (Y.1)

White errors average, time-correlated ones count as they stand, and so does the error of the
solution. That is an upper bound: where the solution is optimal, e is that part of v which it
followed, and the variance of a residual is R - H P H', below R. It holds for every piece whatever
the pieces have in common, and so does a bound of the largest of them that adds the probabilities of
all (`report.statistics.residual_limit`).
"""

from collections.abc import Sequence
from itertools import pairwise

import numpy as np

from ...geodesy.rotation import rotation_from_quaternion, skew
from ...records import Array, MeanResidual
from ..filter.codes import COVARIANCE_RESET, NAV, POS, POSITION_ROW, PSI, QUAT, USED, VEL
from ..filter.problem import EstimationProblem
from ..filter.solution import Solution

PIECE_S = 60.0  # of the time in which residuals are averaged
FEWEST_PIECES = 8  # of a segment, however short
MOST_COVARIANCES = 60  # of a piece whose mean stands for all


def mean_residuals(solution: Solution) -> tuple[MeanResidual, ...]:
    """Return the mean residual of the position fixes of each minute, and what the claims allow it.

    Fixes that were rejected or withheld do not count. A segment below eight minutes is divided into
    eighths.

    Parameters
    ----------
    solution : Solution
        The smoothed segment.

    Returns
    -------
    tuple of MeanResidual
        Those of the pieces that hold a fix, in the order of time; axes of the local frame.
    """
    epochs = solution.problem.epochs
    used = np.isin(solution.verdict[:, POSITION_ROW], (USED, COVARIANCE_RESET)) & ~epochs.withheld
    rows = np.flatnonzero(used & epochs.has_position)
    if not rows.size:
        return ()
    time = solution.time[rows]
    white, correlated = claimed_errors(solution.problem, rows)
    residual, C, a = _residuals(solution, rows)
    length = float(time[-1] - time[0])
    edges = time[0] + length * np.linspace(0.0, 1.0, max(FEWEST_PIECES, int(length / PIECE_S)) + 1)
    bounds = np.concatenate([[0], np.searchsorted(time, edges[1:-1]), [time.size]])
    pieces = []
    for first, last in pairwise(bounds.tolist()):
        if first == last:
            continue
        piece = slice(first, last)
        some = first + _some(solution, rows[first:last])
        variance = _antenna_variance(solution, rows[some], C[some], a[some])
        mean, sigma = weighted_mean(
            residual[piece], white[piece], correlated[:, piece], variance.mean(axis=0)
        )
        pieces.append(
            MeanResidual(
                float(time[first]),
                float(time[last - 1]),
                last - first,
                tuple(mean.tolist()),
                tuple(sigma.tolist()),
            )
        )
    return tuple(pieces)


def _some(solution: Solution, rows: np.ndarray) -> np.ndarray:
    """Return which epochs of a piece give its mean covariance, of those where it is kept if any."""
    kept = np.flatnonzero(np.isin(rows, solution.rows))
    if not kept.size:
        kept = np.array([rows.size // 2])
    return kept[:: -(-kept.size // MOST_COVARIANCES)]


def weighted_mean(
    residual: Array, white: Array, correlated: Array, variance: Array
) -> tuple[Array, Array]:
    """Return the weighted mean of residuals and what the claims allow it (Y.1).

    Parameters
    ----------
    residual : ndarray, shape (k, 3), m
        Fixes minus solution.
    white : ndarray, shape (k, 3), m
        Standard deviations of the white errors of the fixes.
    correlated : ndarray, shape (g, k, 3), m
        Those of g time-correlated errors.
    variance : ndarray, shape (3,), m^2
        Of the antenna in the solution.

    Returns
    -------
    mean, sigma : ndarray, shape (3,), m
        The mean and its standard deviation.
    """
    weight = 1.0 / (white**2 + (correlated**2).sum(axis=0))
    weight /= weight.sum(axis=0)
    of_white = (weight**2 * white**2).sum(axis=0)
    of_correlated = ((weight * correlated).sum(axis=1) ** 2).sum(axis=0)
    return (weight * residual).sum(axis=0), np.sqrt(of_white + of_correlated + variance)


def claimed_errors(problem: EstimationProblem, rows: np.ndarray) -> tuple[Array, Array]:
    """Return the standard deviations of the errors that the filter gives some fixes.

    Parameters
    ----------
    problem : EstimationProblem
        The problem.
    rows : ndarray, shape (k,)
        Epochs of fixes.

    Returns
    -------
    white : ndarray, shape (k, 3), m
        Of their white errors, in the local frame.
    correlated : ndarray, shape (2, k, 3), m
        Of the time-correlated error of all fixes, and of that of float and code solutions; zero
        where there is none.
    """
    epochs, layout = problem.epochs, problem.layout
    group = epochs.group[rows]
    white = layout.white_scales[group] * np.sqrt(
        np.diagonal(epochs.position_cov[rows], axis1=1, axis2=2)
    )
    correlated = np.zeros((2, rows.size, 3))
    for least_group, first in enumerate((layout.gm, layout.unfixed_gm)):
        if first >= 0:
            share = np.where(group >= least_group, 1.0, 0.0)[:, None]
            correlated[least_group] = share * epochs.sigma[rows] * layout.sigma0[first : first + 3]
    return white, correlated


def worst_piece(pieces: Sequence[MeanResidual]) -> tuple[MeanResidual, int, float]:
    """Return the piece and the axis whose mean residual is the largest in sigmas, and that ratio.

    Parameters
    ----------
    pieces : sequence of MeanResidual
        One at least.

    Returns
    -------
    tuple of MeanResidual, int, float
        The piece, its axis (0 north, 1 east, 2 down), and the mean over its sigma, not negative.
    """
    ratio = np.array([np.abs(piece.mean_m) / np.array(piece.sigma_m) for piece in pieces])
    k, axis = np.unravel_index(int(np.argmax(ratio)), ratio.shape)
    return pieces[int(k)], int(axis), float(ratio[k, axis])


def _residuals(solution: Solution, rows: np.ndarray) -> tuple[Array, Array, Array]:
    """Return residuals (k, 3), C_lb and, in l, the lever arm at the epochs of fixes."""
    problem, layout = solution.problem, solution.problem.layout
    nav, x = solution.nav[rows], solution.x[rows]
    C = rotation_from_quaternion(nav[:, QUAT])
    lever = np.broadcast_to(problem.antenna_lever_b, (rows.size, 3))
    if layout.lever >= 0:
        lever = lever + x[:, layout.lever : layout.lever + 3]
    a = np.einsum("kij,kj->ki", C, lever)
    antenna = nav[:, POS] + a
    if layout.offset >= 0:
        d = x[:, layout.offset, None]
        if layout.rate >= 0:
            d = d + problem.epochs.time[rows, None] * x[:, layout.rate, None]
        turning = np.einsum("kij,kj->ki", C, np.cross(problem.epochs.rate[rows], lever))
        velocity = solution.nav[:, VEL]
        acceleration = np.gradient(velocity, problem.epochs.time, axis=0)[rows]
        antenna = antenna + d * (velocity[rows] + turning) + 0.5 * d**2 * acceleration
    return problem.epochs.position[rows] - antenna, C, a


def _antenna_variance(solution: Solution, rows: np.ndarray, C: Array, a: Array) -> Array:
    """Return the variance (k, 3), m^2, of the antenna in the solution, at the time of each fix."""
    layout = solution.problem.layout
    columns, blocks = list(range(POS.stop)), [np.broadcast_to(np.eye(3), C.shape)]
    columns += range(PSI.start, PSI.stop)
    blocks.append(-skew(a))
    if layout.lever >= 0:
        columns += range(NAV.stop + layout.lever, NAV.stop + layout.lever + 3)
        blocks.append(C)
    if layout.offset >= 0:
        velocity = solution.nav[rows, VEL][:, :, None]
        columns.append(NAV.stop + layout.offset)
        blocks.append(velocity)
        if layout.rate >= 0:
            columns.append(NAV.stop + layout.rate)
            blocks.append(solution.problem.epochs.time[rows, None, None] * velocity)
    H = np.concatenate(blocks, axis=2)
    of = np.array(columns)
    P = solution.covariance(rows)[:, of[:, None], of]
    return np.maximum(np.einsum("kit,kit->ki", H @ P, H), 0.0)
