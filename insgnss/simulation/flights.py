"""Survey flights of a small fixed wing, from a plan to an exact motion and its exposures.

A flight is laid out over ground (`layout`) at a speed that wind and acceleration allow, sampled at
the knots of a `ExactMotion`, moved by gusts, and smoothed over 0.7 s, which gives turns and climbs
their
onset. Attitude follows from the motion as in coordinated flight: the nose points along the velocity
through the air (so the aircraft crabs in wind), and the bank is the one at which no specific force
is felt sideways,

    heading = direction of p' - wind,      roll = atan2(f_right, -f_down),   f = p'' - g       (F.1)
    pitch   = climb angle through the air + angle of attack, which grows with the load factor  (F.2)

plus turbulence in all three angles. On the ground the aircraft is stationary.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ..base.errors import UsageError
from ..geodesy.frames import LocalFrame
from .layout import FlightPlan, lay_out
from .motion import ExactMotion
from .path import SegmentPath

Array = NDArray[np.float64]

GPS_WEEK = 2008  # of 3 July 2018
START_TOW = 205200.0  # Tuesday 3 July 2018, 09:00 GPST
# latitude, longitude, height (m): near Lausanne (chosen)
SITE = LocalFrame(float(np.radians(46.57)), float(np.radians(6.54)), 510.0)

MOTION_KNOT_S = 0.1  # of the spline: motions of up to some 2.5 Hz (chosen)
SETTLE_S = 4.0  # beyond both ends of the record: longer than the smoothing reaches
ONSET_S = 0.7  # smoothing that gives turns and climbs their onset (chosen)
TURN_GRAVITY = 9.81  # m/s^2, for turns and attitudes alone: the sensors have normal gravity
_ATTACK = np.radians(4.0)  # angle of attack at a load factor of one (chosen)
_STANDING = np.radians([1.2, 3.0])  # roll and pitch on the ground
_FLYING_MS = 6.0  # from here up the aircraft is carried by the air
_FREE_M = 15.0  # height above ground of full gusts
# gusts: standard deviation (m, deg) and time scale (s) of smoothed white noise (chosen)
_LATERAL_M, _HEIGHT_M = ((0.8, 4.0), (0.03, 0.25)), ((0.5, 3.0), (0.03, 0.25))
_ROLL, _PITCH, _YAW = (  # deg
    ((1.8, 0.6), (0.3, 0.12)),
    ((1.0, 0.6), (0.2, 0.12)),
    ((0.8, 0.8), (0.2, 0.12)),
)


@dataclass(frozen=True, eq=False)
class FlightMotion:
    """An exact motion (of the IMU's navigation centre) and the exposures along it.

    `plan` is None where it was not a survey.

    Parameters
    ----------
    images : names; time : (n,) s, mid-exposure; line : (n,) number of the flight line, counted from
        1; spacing_m : (n,) m between exposures on that line as planned.
    wind_l : (3,) m/s.
    """

    name: str
    plan: FlightPlan | None
    motion: ExactMotion
    images: tuple[str, ...]
    time: Array
    line: NDArray[np.int64]
    spacing_m: Array
    wind_l: Array
    gps_week: int = GPS_WEEK


DEGREE = 5  # of the spline of a motion, and control points beyond its pieces
ROUNDING = 1e-6  # of a count or a length (m): less is rounding and makes no knot or exposure
OFF_SAMPLES_S = 0.00317  # of exposures: no sensor has a sample at such a stamp
FIRST_IMAGE = 1001  # number of the first image, as the paper's


def fly(
    plan: FlightPlan,
    seed: int | np.random.SeedSequence = 0,
    *,
    frame: LocalFrame = SITE,
    start_tow: float = START_TOW,
) -> FlightMotion:
    """Fly a plan.

    Parameters
    ----------
    plan : see `layout`.
    seed : of gusts and trigger delays.
    frame : local frame whose origin lies on the ground of the site; heights above ground are
        heights in it.
    start_tow : s, time of the first instant.

    Raises
    ------
    UsageError : the exposures of the plan follow each other faster than the camera can.
    """
    source = np.random.SeedSequence(seed) if isinstance(seed, int) else seed
    gusts, trigger = (np.random.default_rng(child) for child in source.spawn(2))
    layout = lay_out(plan)
    knots = int(np.ceil(layout.duration_s / MOTION_KNOT_S - ROUNDING))
    margin = round(SETTLE_S / MOTION_KNOT_S)
    # of the control points and beyond both ends
    clock = (np.arange(-margin, knots + DEGREE + margin) - 2.0) * MOTION_KNOT_S
    control = _control_points(
        layout.path, np.interp(clock + layout.clock_offset_s, layout.time, layout.s), plan, gusts
    )
    motion = ExactMotion(frame, start_tow, MOTION_KNOT_S, control[margin : margin + knots + DEGREE])
    time, line, spacing = _exposure_times(
        layout.path,
        layout.s,
        layout.time - layout.clock_offset_s,
        plan,
        motion.end - motion.start,
        trigger,
    )
    names = tuple(f"{plan.first_image + i}.tif" for i in range(time.size))
    return FlightMotion(
        plan.name, plan, motion, names, start_tow + time, line, spacing, plan.wind_l
    )


def flight_along(motion: ExactMotion, name: str, every_s: float) -> FlightMotion:
    """Return any motion as a flight, exposed every `every_s` s, a second or more from both ends."""
    if not every_s > 0.0:
        raise UsageError(f"an exposure every {every_s} s; the interval must be positive")
    time = np.arange(motion.start + 1.0, motion.end - 1.0, every_s) + OFF_SAMPLES_S
    spacing = every_s * np.linalg.norm(motion.velocity(time), axis=1)
    images = tuple(f"{FIRST_IMAGE + k}.tif" for k in range(time.size))
    return FlightMotion(
        name=name,
        plan=None,
        motion=motion,
        images=images,
        time=time,
        line=np.ones(time.size, dtype=np.int64),
        spacing_m=spacing,
        wind_l=np.zeros(3),
        gps_week=GPS_WEEK,
    )


def _control_points(
    path: SegmentPath, s: Array, plan: FlightPlan, rng: np.random.Generator
) -> Array:
    """Return control points (n, 6) of position, m, and attitude, rad, at lengths `s` (n,), m."""
    from scipy.ndimage import gaussian_filter1d

    position, course = path.pose_at(s)
    forward = np.stack([np.cos(course), np.sin(course), np.zeros_like(course)], axis=-1)
    airborne = _smoothstep(np.gradient(s, MOTION_KNOT_S) / _FLYING_MS) * _smoothstep(
        -position[:, 2] / _FREE_M
    )
    gust = [
        gusts(bands, s.size, rng) * airborne * plan.turbulence
        for bands in (_LATERAL_M, _HEIGHT_M, _ROLL, _PITCH, _YAW)
    ]
    position[:, 0] -= forward[:, 1] * gust[0]
    position[:, 1] += forward[:, 0] * gust[0]
    position[:, 2] -= gust[1]
    base = position[0].copy()
    position = base + gaussian_filter1d(
        position - base, ONSET_S / MOTION_KNOT_S, axis=0, mode="nearest"
    )
    angles = coordinated_attitude(position, forward, plan.wind_l)
    return np.hstack([position, angles + np.radians(np.stack(gust[2:], axis=-1))])


def coordinated_attitude(position: Array, ahead: Array, wind: Array) -> Array:
    """Return roll, pitch, unwrapped yaw (n, 3), rad (F.1, F.2), of positions (n, 3), m, at knots.

    Parameters
    ----------
    ahead : unit vectors along the path, for the stand.
    """
    velocity = np.gradient(position, MOTION_KNOT_S, axis=0)
    force = np.gradient(velocity, MOTION_KNOT_S, axis=0) - [0.0, 0.0, TURN_GRAVITY]
    airborne = _smoothstep(np.hypot(velocity[:, 0], velocity[:, 1]) / _FLYING_MS)[:, None]
    air = velocity + (1.0 - airborne) * ahead - airborne * wind
    level = np.hypot(air[:, 0], air[:, 1])
    side_force = (-air[:, 1] * force[:, 0] + air[:, 0] * force[:, 1]) / level
    roll = np.arctan2(side_force, -force[:, 2])
    pitch = (
        np.arctan2(-air[:, 2], level) + _ATTACK * np.hypot(side_force, force[:, 2]) / TURN_GRAVITY
    )
    tilt = _STANDING + airborne * (np.stack([roll, pitch], axis=-1) - _STANDING)
    return np.column_stack([tilt, np.unwrap(np.arctan2(air[:, 1], air[:, 0]))])


def gusts(bands: tuple[tuple[float, float], ...], n: int, rng: np.random.Generator) -> Array:
    """Return a sum (n,) of white noises smoothed by Gaussians, of (sigma, width in s) each."""
    from scipy.ndimage import gaussian_filter1d

    total = np.zeros(n)
    for sigma, width in bands:
        knots = width / MOTION_KNOT_S
        smooth = gaussian_filter1d(rng.standard_normal(n), knots, mode="wrap")
        total += sigma * np.sqrt(2.0 * np.sqrt(np.pi) * knots) * smooth
    return total


def _smoothstep(x: Array) -> Array:
    x = np.clip(x, 0.0, 1.0)
    return x * x * (3.0 - 2.0 * x)


def _exposure_times(
    path: SegmentPath,
    s: Array,
    clock: Array,
    plan: FlightPlan,
    duration: float,
    rng: np.random.Generator,
) -> tuple[Array, NDArray[np.int64], Array]:
    """Return times (m,), s from the start, line numbers (m,) and planned spacings (m,), m."""
    path_lengths, line, spacing = [], [], []
    for i in np.flatnonzero(path.line > 0):
        base = plan.camera.base(path.height0[i], plan.forward_overlap)
        end = path.s0[i] + path.length[i] - plan.lead_m + ROUNDING
        marks = np.arange(path.s0[i] + plan.lead_m, end, base)
        path_lengths.append(marks)
        line.append(np.full(marks.size, path.line[i]))
        spacing.append(np.full(marks.size, base))
    time = np.interp(np.concatenate(path_lengths), s, clock)
    time += rng.uniform(0.0, plan.trigger_delay_s, time.size)
    keep = (time > 0.0) & (time < duration)
    time = time[keep]
    if time.size > 1 and np.diff(time).min() < plan.camera.min_interval_s:
        k = int(np.argmin(np.diff(time)))
        raise UsageError(
            f"exposures {k + 1} and {k + 2} are {time[k + 1] - time[k]:.2f} s apart, the camera"
            f" needs {plan.camera.min_interval_s} s; lower the overlap or the speed, or fly higher"
        )
    return time, np.concatenate(line)[keep], np.concatenate(spacing)[keep]
