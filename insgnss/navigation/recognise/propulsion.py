"""How a vehicle changes its speed: by a push along its axis of motion, or by leaning.

Wheels, a propeller and legs push along the axis e along which the vehicle moves: its accelerometers
feel there what it gains over ground. The rotors of a multirotor push along -z alone: it leans to
gain speed, and feels nothing along e but its drag. With h the horizontal direction of e and f_n the
specific force turned to north, east, down, whose horizontal part is the acceleration,

    f_b . e = slope (f_n . h) + constant,  slope 1: pushed, slope 0: it leans                 (R.11)

Both sides are the IMU's, so that errors of the fixes do not draw the slope to zero. Who leans is as
free to fly sideways or backwards as nose first: which axis is forward is then for its owner to say.
"""

from dataclasses import dataclass

import numpy as np

from ...records import Array

SEEN_MS2 = 0.1  # standard deviation of accelerations along the axis that show the slope
INDEPENDENT_ACCELERATION_S = 2.0  # a change of speed takes that long
# of the slope (R.11) by which it has to be on one side of `HALF`: 95 % (chosen)
SLOPE_CONFIDENCE_SIGMAS = 2.0
HALF = 0.5  # slope midway between that of leaning, 0, and that of being pushed, 1
# m/s: who is faster all the time, and shows no slope, is taken for an aircraft
FASTER_MS = 10.0


@dataclass(frozen=True)
class Propulsion:
    """The regression (R.11): slope, its sigma, and standard deviation of the accelerations, m/s^2.

    Parameters
    ----------
    slope, sigma : float
    seen : float, m/s^2
    """

    slope: float
    sigma: float
    seen: float

    @property
    def leans(self) -> bool:
        """Whether it leans to change its speed."""
        return self.seen > SEEN_MS2 and self.slope + SLOPE_CONFIDENCE_SIGMAS * self.sigma < HALF

    @property
    def pushed(self) -> bool:
        """Whether it is pushed along the axis."""
        return self.seen > SEEN_MS2 and self.slope - SLOPE_CONFIDENCE_SIGMAS * self.sigma > HALF

    def nose_is_free(self, speed: float) -> bool:
        """Whether the axis of motion may be another one than forward, at a usual speed in m/s."""
        return self.leans or not (self.pushed or speed > FASTER_MS)


def propulsion(time: Array, C_nb: Array, force_n: Array, axis: Array) -> Propulsion:
    """Regress the force felt along an axis on the acceleration along it (R.11).

    Parameters
    ----------
    time : ndarray, shape (n,), s
    C_nb : ndarray, shape (n, 3, 3)
        Axes of the IMU (or the body) into north, east, down.
    force_n : ndarray, shape (n, 3), m/s^2
        Specific force, north, east, down.
    axis : ndarray, shape (3,)
        The axis of motion, in the axes of the IMU (or the body).

    Returns
    -------
    Propulsion
    """
    ahead = C_nb @ axis
    level = np.maximum(np.hypot(ahead[:, 0], ahead[:, 1]), 1e-3)
    gained = (ahead[:, 0] * force_n[:, 0] + ahead[:, 1] * force_n[:, 1]) / level
    felt = np.sum(ahead * force_n, axis=1)
    gained, felt = gained - gained.mean(), felt - felt.mean()
    seen = float(np.sqrt(np.mean(gained**2)))
    if seen == 0.0:
        return Propulsion(0.0, np.inf, 0.0)
    slope = float(np.mean(gained * felt)) / seen**2
    spacing = float(np.median(np.diff(time))) if time.size > 1 else INDEPENDENT_ACCELERATION_S
    independent = max(1.0, time.size * min(1.0, abs(spacing) / INDEPENDENT_ACCELERATION_S))
    residual = float(np.sqrt(np.mean((felt - slope * gained) ** 2)))
    return Propulsion(slope, residual / (seen * np.sqrt(independent)), seen)
