"""Attitude of a stationary vehicle: levelling and gyrocompassing.

Level comes from the specific force, heading from the Earth's rotation. In a stationary period
f_b = -C_bl g and omega_b = C_bl Omega + b. The two directions down d = -f / |f| and, across it,
north n ~ (1 - d d') omega are the same in both frames (TRIAD, Black 1964), which gives

    sigma(tilt) = sigma_a / g,      sigma(heading) = sigma_g / (Omega cos(latitude))           (A.3)

with sigma_a, sigma_g what is unknown of the accelerometers and gyros over the period: turn-on bias,
slow processes, and white noise over its length. 0.1 deg/h gives the heading to half a degree at 45
deg of latitude, 100 deg/h gives none. From here filter and smoother estimate the period properly
(`initial`).
"""

from dataclasses import dataclass

import numpy as np

from ...geodesy.earth import EARTH_RATE
from ...geodesy.rotation import rpy_from_rotation
from ...records import Array
from ..filter.codes import ZUPT
from ..filter.problem import EstimationProblem

# of the period (s): the bias, not white noise, limits a longer one (chosen)
LONGEST_GYROCOMPASS_S = 600.0
# of the period (s): white noise hides the Earth's rate in a shorter one (chosen)
SHORTEST_GYROCOMPASS_S = 30.0
USEFUL_RAD = np.radians(20.0)  # of heading


@dataclass(frozen=True)
class StandingAttitude:
    """Attitude over one stationary period.

    Parameters
    ----------
    first, last : int
        First and last epoch of the period.
    C_lb : ndarray, (3, 3)
        Attitude, body into the local frame l.
    tilt_sigma, heading_sigma : float
        Standard deviations (A.3), rad.
    """

    first: int
    last: int
    C_lb: Array
    tilt_sigma: float
    heading_sigma: float

    @property
    def knows_heading(self) -> bool:
        """Whether the gyros are good enough for gyrocompassing."""
        return self.heading_sigma < USEFUL_RAD

    def description(self) -> str:
        """Return what the period gives, in words."""
        roll, pitch, _ = np.degrees(rpy_from_rotation(self.C_lb))
        return (
            f"standing: roll {roll:.2f} and pitch {pitch:.2f} deg (sigma "
            f"{np.degrees(self.tilt_sigma):.2g} deg), heading from the Earth's rotation (sigma "
            f"{min(np.degrees(self.heading_sigma), 180.0):.3g} deg)"
        )


def longest_rest(problem: EstimationProblem) -> tuple[int, int] | None:
    """Find the longest stationary period, by the epochs with a ZUPT.

    Parameters
    ----------
    problem : EstimationProblem
        The flight's measurements, increments and layout of states.

    Returns
    -------
    tuple of int or None
        First and last epoch, of at most `LONGEST_GYROCOMPASS_S`; None where no period lasts for
        `SHORTEST_GYROCOMPASS_S`.
    """
    ep = problem.epochs
    stationary = np.flatnonzero(ep.constraint == ZUPT)
    if stationary.size < 2:
        return None
    breaks = np.flatnonzero(np.diff(ep.time[stationary]) > 2.0)
    begin = stationary[np.concatenate([[0], breaks + 1])]
    end = stationary[np.concatenate([breaks, [stationary.size - 1]])]
    with_fix = np.flatnonzero(ep.has_position)
    begin = with_fix[np.minimum(np.searchsorted(with_fix, begin), with_fix.size - 1)]
    k = int(np.argmax(ep.time[end] - ep.time[begin]))
    begin_s = ep.time[begin[k]]
    end_s = min(ep.time[end[k]], begin_s + LONGEST_GYROCOMPASS_S)
    last = int(np.searchsorted(ep.time, end_s, side="right")) - 1
    return (int(begin[k]), last) if ep.time[last] - begin_s >= SHORTEST_GYROCOMPASS_S else None


def standing_attitude(problem: EstimationProblem) -> StandingAttitude | None:
    """Solve TRIAD over the longest stationary period, with the sigmas of (A.3).

    Parameters
    ----------
    problem : EstimationProblem
        The flight's measurements, increments and layout of states.

    Returns
    -------
    StandingAttitude or None
        None without a stationary period.
    """
    period = longest_rest(problem)
    if period is None:
        return None
    first, last = period
    inc, stop = problem.inc, problem.epochs.stop
    samples = slice(stop[first], stop[last])
    length = float(inc.dt[samples].sum())
    rate, force = inc.dtheta[samples].sum(axis=0) / length, inc.dvel[samples].sum(axis=0) / length
    C_ln = problem.frame.C_ln_at(problem.epochs.position[first])
    lat = float(problem.frame.geodetic_from_position(problem.epochs.position[first])[0])
    down = -force / np.linalg.norm(force)
    east = np.cross(down, rate)
    if np.linalg.norm(east) < 1e-12:
        east = np.cross(down, [1.0, 0.0, 0.0])
    east /= np.linalg.norm(east)
    C_nb = np.stack([np.cross(east, down), east, down])
    layout = problem.layout
    unknown = np.sqrt(np.abs(layout.channel_sum()) @ layout.sigma0**2 + layout.white / length)
    g = float(np.linalg.norm(force))
    heading = float(unknown[:3].max() / (EARTH_RATE * np.cos(lat)))
    return StandingAttitude(first, last, C_ln @ C_nb, float(unknown[3:].max() / g), heading)
