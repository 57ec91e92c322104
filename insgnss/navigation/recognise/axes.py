"""From the attitude in every window to the axes: which way is down, and which way is forward.

Mathematics: the package's docstring, (R.8) and (R.9).
"""

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ...geodesy.rotation import right_angle_rotations, rotation_from_vector
from ...records import Array, GnssFixes
from ..prepare.fix_path import north_east
from .relation import Relation

# prior standard deviations of wind and airspeed, and least scatter of a speed
WIND_MS, SPEED_MS, GUST_MS = 5.0, 30.0, 1.0
SLOWEST_COURSE_MS = 2.0  # from here up GNSS has a course
# over which a velocity is taken (s): the noise of fixes hides it over a shorter time (chosen)
LEAST_WIDTH_S = 2.0
INDEPENDENT_CRAB_S = 10.0  # crab and speed change so slowly
# standard deviation of what tilts the mean of a flight against the axis meant
MOUNT_RAD = np.radians(8.0)
# sigma of the forward axis by the mean crab that the fitted wind does not explain (chosen)
CRAB_RAD = np.radians(5.0)
MOVING_SPEED_SHARE = 0.3  # of the speed that is exceeded a tenth of the time
WIND_ITERATIONS = 5  # of the weighted fit of wind and axis (chosen)


def imu_word(direction: Array) -> str:
    """Signed letter of the IMU's axis along a direction (3,) in its axes, "-z" for one."""
    k = int(np.argmax(np.abs(direction)))
    return ("+" if direction[k] > 0 else "-") + "xyz"[k]


def scores(towards: Array, ahead: Array) -> Array:
    """Score the 24 orientations, -1 to 1.

    Parameters
    ----------
    towards, ahead : ndarray, shape (3,)
        Down and forward as found in the IMU's axes, of length 1 at most.

    Returns
    -------
    ndarray, shape (24,)
        Mean cosine of the orientation's down and forward against those found.
    """
    C = right_angle_rotations()
    return 0.5 * (C[:, 2] @ towards + C[:, 0] @ ahead)


@dataclass(frozen=True, eq=False)
class Pose:
    """Attitude of the IMU's axes and velocity of GNSS at m instants.

    Parameters
    ----------
    time : ndarray, shape (m,), s
        On the IMU's clock.
    C_ns : ndarray, shape (m, 3, 3)
        IMU axes into north, east, down.
    yaw_sigma : ndarray, shape (m,), rad
    velocity : ndarray, shape (m, 2), m/s
        North and east.
    course_rate : ndarray, shape (m,), rad/s
        NaN below `SLOWEST_COURSE_MS`.
    width : float, s
        Length over which the velocity is averaged.
    """

    time: Array
    C_ns: Array
    yaw_sigma: Array
    velocity: Array
    course_rate: Array
    width: float


def poses(relation: Relation, gnss: GnssFixes, sound: NDArray[np.bool_]) -> Pose:
    """Return the attitude (R.8) and the velocity at the rows of the relation's fit.

    The velocity is that between the `sound` fixes (n,) around each row.
    """
    propagated, fit, acc = relation.propagated, relation.fit, relation.acc
    assert fit is not None
    window = acc.window[fit.used]
    C_ns = fit.C[window] @ rotation_from_vector(fit.turned) @ propagated.C[fit.middle]
    instants, width = acc.time[fit.used], max(LEAST_WIDTH_S, acc.span_s)
    v1, v2 = (
        _velocity(gnss, sound, instants + shift, 0.5 * width)
        for shift in (-0.25 * width, 0.25 * width)
    )
    fast = np.minimum(np.abs(v1), np.abs(v2)) > SLOWEST_COURSE_MS
    course_rate = np.where(fast, np.angle(v2 * np.conj(v1)) / (0.5 * width), np.nan)
    v = 0.5 * (v1 + v2)
    time, velocity = instants + fit.theta[0], np.column_stack([v.real, v.imag])
    return Pose(time, C_ns, fit.yaw_sigma[window], velocity, course_rate, width)


def _velocity(
    gnss: GnssFixes, sound: NDArray[np.bool_], instants: Array, width: float
) -> NDArray[np.complex128]:
    """North + i east velocity, m/s, at `instants` (m,) s, of the receiver or over `width` s."""
    t = gnss.time[sound]
    if gnss.velocity_ned is not None:
        v = gnss.velocity_ned[sound, :2] @ np.array([1.0, 1j])
        return np.asarray(np.interp(instants, t, v), dtype=np.complex128)
    p = north_east(gnss)[sound] @ np.array([1.0, 1j])
    before = np.clip(instants - 0.5 * width, t[0], t[-1])
    after = np.clip(instants + 0.5 * width, t[0], t[-1])
    moved = np.interp(after, t, p) - np.interp(before, t, p)
    return np.asarray(moved / np.maximum(after - before, 1e-3), dtype=np.complex128)


@dataclass(frozen=True, eq=False)
class Direction:
    """A direction in the IMU's axes.

    Parameters
    ----------
    vector : ndarray, shape (3,)
        Of length 1.
    axis : ndarray, shape (3,)
        The nearest signed axis.
    off : float, rad
        The angle between both.
    confidence : float
        Of the axis.
    """

    vector: Array
    axis: Array
    off: float
    confidence: float

    @property
    def word(self) -> str:
        """The axis in words, such as "-y"."""
        return imu_word(self.axis)


def _direction(vector: Array, sigma: float) -> Direction:
    """The direction with its confidence.

    That is the probability that an angle of standard deviation `sigma`, rad, does not reach the
    border to the next axis, 45 deg away.
    """
    axis = np.zeros(3)
    k = int(np.argmax(np.abs(vector)))
    axis[k] = np.sign(vector[k])
    off = math.acos(min(1.0, abs(float(vector[k])) / float(np.linalg.norm(vector))))
    sure = 0.5 * (1.0 + math.erf((np.pi / 4.0 - off) / (max(sigma, 1e-6) * math.sqrt(2.0))))
    return Direction(vector / np.linalg.norm(vector), axis, off, max(2.0 * sure - 1.0, 0.0))


def down_direction(pose: Pose) -> Direction:
    """Return the mean direction of down in the IMU's axes."""
    mean = pose.C_ns[:, 2, :].mean(axis=0)
    return _direction(mean, MOUNT_RAD / max(float(np.linalg.norm(mean)), 0.1))


@dataclass(frozen=True, eq=False)
class ForwardAxis:
    """Forward in the IMU's axes, with airspeed and wind (R.9).

    Parameters
    ----------
    direction : Direction
    speed : float, m/s
        Through the air, along the direction.
    speed_sigma : float, m/s
    wind : ndarray, shape (2,), m/s
        North and east.
    """

    direction: Direction
    speed: float
    speed_sigma: float
    wind: Array


def forward(pose: Pose, vertical: Direction) -> ForwardAxis:
    """Find forward by regression (R.9) of the velocity on the heading of a level axis."""
    d = vertical.axis
    e = np.roll(np.abs(d), 1)
    ahead = pose.C_ns @ e
    h = ahead[:, 0] + 1j * ahead[:, 1]
    level = np.abs(h)
    v = pose.velocity[:, 0] + 1j * pose.velocity[:, 1]
    h = h / np.maximum(level, 1e-3)
    A = np.column_stack([h, np.ones_like(h)])
    prior = np.diag([1.0 / SPEED_MS**2, 1.0 / WIND_MS**2])
    spacing = float(np.median(np.diff(pose.time))) if pose.time.size > 1 else INDEPENDENT_CRAB_S
    share = min(1.0, spacing / INDEPENDENT_CRAB_S)
    moving = np.abs(v) > MOVING_SPEED_SHARE * np.quantile(np.abs(v), 0.9)
    heading_known = moving & (pose.yaw_sigma < 0.5)
    residual = np.zeros(v.size)
    scale = max(float(np.median(np.abs(v[moving]))) if moving.any() else 0.0, GUST_MS)
    for _ in range(WIND_ITERATIONS):
        variance = scale**2 + (np.abs(v) * pose.yaw_sigma) ** 2
        weight = share * moving * level / variance / (1.0 + residual**2 / variance)
        N = (A.conj().T * weight) @ A + prior
        c, wind = np.linalg.solve(N, (A.conj().T * weight) @ v)
        residual = np.abs(v - c * h - wind)
        if heading_known.any():
            scale = max(1.2 * float(np.median(residual[heading_known])), GUST_MS)
    sigma = float(np.sqrt(np.linalg.inv(N)[0, 0].real))
    along = (c.real * e + c.imag * np.cross(d, e)) / abs(c) if abs(c) > 1e-9 else e
    angle = math.hypot(sigma / max(abs(c), 1e-9), CRAB_RAD)
    return ForwardAxis(
        _direction(along, angle), float(abs(c)), sigma, np.array([wind.real, wind.imag])
    )
