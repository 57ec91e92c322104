"""The smoothed trajectory at epochs, and between them at every IMU sample.

From each smoothed epoch the strapdown runs to the next with the smoothed bias of its channels. What
it misses there, d, is the effect of the noise that the smoother placed into the interval. It is
given back in the course of the interval: of psi and velocity the share s = elapsed / length (a
random walk between two known ends), of position the cubic that meets d_p with the slope d_v at its
end. Epochs lie at most a fix interval apart, over which d is a fraction of a millimetre; the shares
are the conditional mean of white noise, the time-correlated part of which is already in the bias.
"""

from dataclasses import replace

import numpy as np

from ...geodesy.frames import LocalFrame
from ...geodesy.rotation import rotation_from_quaternion
from ...records import Array, Trajectory
from .codes import N_NOMINAL, POS, QUAT, VEL
from .covariances import COVARIANCES_AT_A_TIME
from .epochs import EPOCH_ROUNDING_S
from .kernels.strapdown import run_between
from .problem import channel_biases
from .solution import Solution, inject_errors
from .strapdown import kernel_earth, kernel_intervals, nav_difference

EPOCHS_AT_A_TIME = 1024  # epochs that are worked on at a time: a pose takes four kB on the way


def trajectory(
    solution: Solution, index: np.ndarray, gps_week: int, events: bool = False
) -> Trajectory:
    """Return the smoothed trajectory at some epochs.

    Accelerations are differences of the velocities at these epochs, rates those of the gyros at the
    instant.

    Parameters
    ----------
    solution : Solution
        The smoothed flight.
    index : ndarray
        (k,) the epochs.
    gps_week : int
        The week that its times belong to.
    events : bool
        Whether these are the epochs of all camera events: then the cross-covariances of neighbours
        come along.

    Returns
    -------
    Trajectory
        Latitude, longitude, height, velocity and attitude in axes north, east, down at the point,
        with covariances of the errors in the same axes.
    """
    nav, cov = solution.nav[index], solution.nav_covariance(index)
    cross = solution.event_cross[1:] if events else None
    return local_trajectory(solution, index, solution.time[index], nav, cov, cross, gps_week)


def local_trajectory(
    solution: Solution,
    index: np.ndarray,
    time: Array,
    nav: Array,
    cov: Array,
    cross: Array | None,
    gps_week: int,
) -> Trajectory:
    """Return states and covariances of the local frame as a trajectory in axes at the point.

    Parameters
    ----------
    solution : Solution
        The smoothed flight that they are of.
    index : ndarray
        (k,) the epochs of which the body rates are taken.
    time : Array
        (k,) s, GPST.
    nav : Array
        (k, 10) position (m), velocity (m/s) in l, quaternion q_lb (w, x, y, z).
    cov : Array
        (k, 9, 9) covariances of their errors in l, which are turned in place.
    cross : Array or None
        (k - 1, 9, 9) covariances of the errors of neighbours in l.
    gps_week : int
        The week that the times belong to.

    Returns
    -------
    Trajectory
        As `trajectory` does.
    """
    exact = _in_level_axes(solution.problem.frame, time, nav, cov, cross, gps_week)
    acceleration = None
    if index.size > 1:
        change = np.gradient(exact.velocity_ned, time, axis=0)
        acceleration = np.einsum("nji,nj->ni", exact.C_nb, change)
    rate = _body_rate(solution, index, rotation_from_quaternion(nav[:, QUAT]))
    return replace(exact, acceleration_b=acceleration, rate_b=rate)


def _in_level_axes(
    frame: LocalFrame, time: Array, nav: Array, cov: Array, cross: Array | None, gps_week: int
) -> Trajectory:
    """Return states and covariances of the local frame in axes at the point, without rates."""
    lat, lon, height = frame.geodetic_from_position(nav[:, POS])
    C_nl = np.swapaxes(frame.C_ln(lat, lon), -1, -2)
    turn_own(C_nl, cov)
    if cross is not None:
        cross = rotate_blocks(C_nl[:-1], cross, C_nl[1:])
    velocity = np.einsum("nij,nj->ni", C_nl, nav[:, VEL])
    C_nb = C_nl @ rotation_from_quaternion(nav[:, QUAT])
    return Trajectory(time, lat, lon, height, velocity, C_nb, cov, gps_week, cross=cross)


def _body_rate(solution: Solution, index: np.ndarray, C_lb: Array) -> Array:
    """Return the rate of the body against the Earth, (k, 3) rad/s in body axes, without bias."""
    bias = channel_biases(solution.problem, solution.x[index], index)[:, :3]
    earth = np.einsum("nij,i->nj", C_lb, solution.problem.frame.earth_rate_l)
    return solution.problem.inc.rate[index] - bias - earth


def rotate_blocks(C_left: Array, cov: Array, C_right: Array) -> Array:
    """Return covariances between errors in other axes.

    Parameters
    ----------
    C_left : Array
        (n, 3, 3) rotations from the axes of the errors of the rows into the wanted ones.
    cov : Array
        (n, 3k, 3k) covariances in blocks of three.
    C_right : Array
        (n, 3, 3) rotations from the axes of the errors of the columns into the wanted ones.

    Returns
    -------
    Array
        (n, 3k, 3k) with every block B replaced by C_left B C_right'.
    """
    n, size = cov.shape[:2]
    k = size // 3
    blocks = cov.reshape(n, k, 3, k, 3)
    turned = np.einsum("nij,najbk,nlk->naibl", C_left, blocks, C_right, optimize=True)
    return turned.reshape(n, size, size)


def turn_own(C: Array, cov: Array) -> None:
    """Take covariances to other axes in place, piece by piece, exactly symmetric.

    Parameters
    ----------
    C : Array
        (n, 3, 3) rotations into the wanted axes.
    cov : Array
        (n, 3k, 3k) covariances in blocks of three.
    """
    for begin in range(0, len(cov), COVARIANCES_AT_A_TIME):
        rows = slice(begin, begin + COVARIANCES_AT_A_TIME)
        turned = rotate_blocks(C[rows], cov[rows], C[rows])
        cov[rows] = 0.5 * (turned + np.swapaxes(turned, -1, -2))


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
        parts.append(_trajectory_between(solution, begin, end, wanted, gps_week))
    return Trajectory.joined(parts)


def _trajectory_between(
    solution: Solution, begin: int, end: int, wanted: Array | None, gps_week: int
) -> Trajectory:
    """Return the trajectory after one epoch up to another, at what is wanted of it."""
    inc, frame = solution.problem.inc, solution.problem.frame
    epochs, marks = slice(begin, end + 1), inc.marks[begin : end + 1]
    stop, states = inc.stop[epochs], solution.nav[epochs]
    bias = channel_biases(solution.problem, solution.x[epochs], epochs)
    nav = np.empty((int(stop[-1] - stop[0]), N_NOMINAL))
    run_between(kernel_intervals(inc), stop, states, bias, kernel_earth(frame), nav)
    stop = stop - stop[0]
    interval = np.repeat(np.arange(end - begin), np.diff(stop))
    sums = np.concatenate([[0.0], np.cumsum(inc.dt[inc.stop[begin] : inc.stop[end]])])
    elapsed = sums[1:] - sums[stop[:-1]][interval]
    length = np.diff(marks)[interval]
    share = np.clip(elapsed / length, 0.0, 1.0)
    missed = nav_difference(states[1:], nav[stop[1:] - 1])
    _give_back(nav, missed[interval], share, length)
    time = marks[interval] + elapsed
    time[stop[1:] - 1] = marks[1:]
    rows: np.ndarray | slice = slice(None)
    if wanted is not None:
        inside = wanted[(wanted > marks[0]) & (wanted <= marks[-1])]
        rows = np.unique(np.searchsorted(time, inside))
    nav, interval, share = nav[rows], interval[rows], share[rows]
    P = solution.nav_covariance(epochs)
    cov = P[interval] + share[:, None, None] * (P[interval + 1] - P[interval])
    return _in_level_axes(frame, time[rows], nav, cov, None, gps_week)


def _give_back(nav: Array, missed: Array, share: Array, length: Array) -> None:
    """Distribute the misses (k, 9) over the interval of length (k,) s, in place."""
    s = share[:, None]
    d_p, d_v = missed[:, POS], missed[:, VEL] * length[:, None]
    delta = s * missed
    delta[:, POS] = s**2 * (3.0 - 2.0 * s) * d_p + s**2 * (s - 1.0) * d_v
    inject_errors(nav, np.zeros((len(nav), 0)), delta)
