"""The smoothed trajectory between the epochs, at every IMU sample.

From each smoothed epoch the strapdown runs to the next with the smoothed bias of its channels. What
it misses there, d, is the effect of the noise that the smoother placed into the interval. It is
given back in the course of the interval: of psi and velocity the share s = elapsed / length (a
random walk between two known ends), of position the cubic that meets d_p with the slope d_v at its
end. Epochs lie at most a fix interval apart, over which d is a fraction of a millimetre; the shares
are the conditional mean of white noise, the time-correlated part of which is already in the bias.
"""

import numpy as np

from ..geodesy.rotation import (
    quaternion_from_rotation,
    rotation_from_quaternion,
    rotation_from_vector,
    vector_from_rotation,
)
from ..records import Array, Trajectory
from .codes import N_NAV, N_NOMINAL, POS, PSI, PSI0, QUAT, VEL
from .kernels.strapdown import run_between
from .solution import Solution, rotate_blocks
from .strapdown import kernel_earth, kernel_intervals


def dense_trajectory(solution: Solution, gps_week: int) -> Trajectory:
    """Return the trajectory at every IMU sample and epoch, from the first epoch to the last.

    Parameters
    ----------
    solution : Solution
        The smoothed flight.
    gps_week : int
        The week that its times belong to.

    Returns
    -------
    Trajectory
        Latitude, longitude, height, velocity and attitude in axes north, east, down at the point;
        the covariances are interpolated between epochs.
    """
    inc, frame = solution.problem.inc, solution.problem.frame
    epochs = np.arange(solution.time.size)
    bias = np.ascontiguousarray(solution.x @ solution.problem.layout.channel_sum().T)
    nav = np.empty((int(inc.stop[-1] - inc.stop[0]), N_NOMINAL))
    run_between(kernel_intervals(inc), inc.stop, solution.nav, bias, kernel_earth(frame), nav)
    interval = np.repeat(epochs[:-1], np.diff(inc.stop))
    elapsed = (
        np.cumsum(inc.dt) - np.concatenate([[0.0], np.cumsum(inc.dt)])[inc.stop[:-1]][interval]
    )
    length = np.diff(inc.marks)[interval]
    share = np.clip(elapsed / length, 0.0, 1.0)
    missed = _missed(solution.nav[1:], nav[inc.stop[1:] - 1])
    _give_back(nav, missed[interval], share, length)
    time = inc.marks[interval] + elapsed
    time[inc.stop[1:] - 1] = inc.marks[1:]
    lat, lon, height = frame.geodetic_from_position(nav[:, POS])
    C_nl = np.swapaxes(frame.C_ln(lat, lon), -1, -2)
    P = solution.nav_covariance()
    cov = P[interval] + share[:, None, None] * (P[interval + 1] - P[interval])
    C_lb = rotation_from_quaternion(nav[:, QUAT])
    velocity = np.einsum("nij,nj->ni", C_nl, nav[:, VEL])
    return Trajectory(
        time, lat, lon, height, velocity, C_nl @ C_lb, rotate_blocks(C_nl, cov, C_nl), gps_week
    )


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
