"""The smoothed trajectory between the epochs, at every IMU sample.

From each smoothed epoch the strapdown runs to the next with the smoothed bias of its channels. What
it misses there, d, is the effect of the noise that the smoother placed into the interval. It is
given back in the course of the interval: of psi and velocity the share s = elapsed / length (a
random walk between two known ends), of position the cubic that meets d_p with the slope d_v at its
end. Epochs lie at most a fix interval apart, over which d is a fraction of a millimetre; the shares
are the conditional mean of white noise, the time-correlated part of which is already in the bias.
"""

import numpy as np

from ...geodesy.rotation import (
    quaternion_from_rotation,
    rotation_from_quaternion,
    rotation_from_vector,
    vector_from_rotation,
)
from ...records import Array, Trajectory
from .codes import N_NAV, N_NOMINAL, POS, PSI, PSI0, QUAT, VEL
from .epochs import EPOCH_ROUNDING_S
from .kernels.strapdown import run_between
from .solution import Solution, turn_own
from .strapdown import kernel_earth, kernel_intervals

EPOCHS_AT_A_TIME = 1024  # epochs that are worked on at a time: a pose takes four kB on the way


def dense_trajectory(solution: Solution, gps_week: int, hz: float | None = None) -> Trajectory:
    """Return the trajectory at IMU samples and epochs, from the first epoch to the last.

    Parameters
    ----------
    solution : Solution
        The smoothed flight.
    gps_week : int
        The week that its times belong to.
    hz : float, optional
        The first instant at or after each step of this rate is taken; without it every one.

    Returns
    -------
    Trajectory
        Latitude, longitude, height, velocity and attitude in axes north, east, down at the point;
        the covariances are interpolated between epochs.
    """
    inc, m = solution.problem.inc, solution.time.size
    parts, wanted = [], None
    if hz is not None:
        first, last = inc.marks[0] + inc.dt[inc.stop[0]], inc.marks[-1]
        wanted = first + np.arange(int((last - first) * hz) + 1) / hz - EPOCH_ROUNDING_S
    for begin in range(0, m - 1, EPOCHS_AT_A_TIME):
        end = min(begin + EPOCHS_AT_A_TIME, m - 1)
        parts.append(_between(solution, begin, end, wanted, gps_week))
    return Trajectory.joined(parts)


def _between(
    solution: Solution, begin: int, end: int, wanted: Array | None, gps_week: int
) -> Trajectory:
    """Return the trajectory after one epoch up to another, at what is wanted of it."""
    inc, frame = solution.problem.inc, solution.problem.frame
    own, marks = slice(begin, end + 1), inc.marks[begin : end + 1]
    stop, states = inc.stop[own], solution.nav[own]
    bias = np.ascontiguousarray(solution.x[own] @ solution.problem.layout.channel_sum().T)
    nav = np.empty((int(stop[-1] - stop[0]), N_NOMINAL))
    run_between(kernel_intervals(inc), stop, states, bias, kernel_earth(frame), nav)
    stop = stop - stop[0]
    interval = np.repeat(np.arange(end - begin), np.diff(stop))
    sums = np.concatenate([[0.0], np.cumsum(inc.dt[inc.stop[begin] : inc.stop[end]])])
    elapsed = sums[1:] - sums[stop[:-1]][interval]
    length = np.diff(marks)[interval]
    share = np.clip(elapsed / length, 0.0, 1.0)
    missed = _missed(states[1:], nav[stop[1:] - 1])
    _give_back(nav, missed[interval], share, length)
    time = marks[interval] + elapsed
    time[stop[1:] - 1] = marks[1:]
    rows: np.ndarray | slice = slice(None)
    if wanted is not None:
        here = wanted[(wanted > marks[0]) & (wanted <= marks[-1])]
        rows = np.unique(np.searchsorted(time, here))
    nav, interval, share = nav[rows], interval[rows], share[rows]
    lat, lon, height = frame.geodetic_from_position(nav[:, POS])
    C_nl = np.swapaxes(frame.C_ln(lat, lon), -1, -2)
    P = solution.nav_covariance(own)
    cov = P[interval] + share[:, None, None] * (P[interval + 1] - P[interval])
    C_lb = rotation_from_quaternion(nav[:, QUAT])
    velocity = np.einsum("nij,nj->ni", C_nl, nav[:, VEL])
    turn_own(C_nl, cov)
    return Trajectory(time[rows], lat, lon, height, velocity, C_nl @ C_lb, cov, gps_week)


def _missed(smoothed: Array, propagated: Array) -> Array:
    """Return the error (m, 9) of propagated states (m, 10) against smoothed ones (m, 10)."""
    out = np.empty((smoothed.shape[0], N_NAV))
    out[:, :PSI0] = smoothed[:, :PSI0] - propagated[:, :PSI0]
    C_smoothed, C_propagated = (
        rotation_from_quaternion(smoothed[:, QUAT]),
        rotation_from_quaternion(propagated[:, QUAT]),
    )
    out[:, PSI] = vector_from_rotation(C_smoothed @ np.swapaxes(C_propagated, -1, -2))
    return out


def _give_back(nav: Array, missed: Array, share: Array, length: Array) -> None:
    """Distribute the misses (k, 9) over the interval of length (k,) s, in place."""
    s = share[:, None]
    d_p, d_v = missed[:, POS], missed[:, VEL] * length[:, None]
    nav[:, POS] += s**2 * (3.0 - 2.0 * s) * d_p + s**2 * (s - 1.0) * d_v
    nav[:, VEL] += s * missed[:, VEL]
    turn = rotation_from_vector(s * missed[:, PSI])
    nav[:, QUAT] = quaternion_from_rotation(turn @ rotation_from_quaternion(nav[:, QUAT]))
