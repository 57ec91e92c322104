"""Motions in the air that are no survey lines: circles, and a multirotor with its nose anywhere.

The circles are flown through the air as one bank and one speed make them,

    R = V^2 / (g tan(bank)),   f = g / cos(bank)                                               (V.1)

and the wind carries them away; attitude follows as in coordinated flight (F.1, F.2 of `flights`).

A multirotor leans its thrust. Of its velocity v, acceleration a and the wind w, with drag of
`_DRAG` a second, the thrust a rotor disc gives for each kilogram is

    T = a - g + drag (v - w)                                                                   (V.2)

along its body's -z, about which its heading is free: the nose has nothing to do with the course.
"""

import numpy as np
from numpy.typing import NDArray

from insgnss.base.errors import UsageError
from insgnss.simulation.flights import (
    MOTION_KNOT_S,
    SETTLE_S,
    SITE,
    START_TOW,
    TURN_GRAVITY,
    FlightMotion,
    coordinated_attitude,
    flight_along,
    gusts,
)
from insgnss.simulation.motion import ExactMotion

Array = NDArray[np.float64]

STYLES = ("sideways", "backward", "hover")
_NOSE = {"sideways": 0.5 * np.pi, "backward": np.pi}  # against the course
_DRAG = 0.3  # 1/s
_FLYING_HEIGHT_M = 60.0  # above the site (chosen)
_LEG_SMOOTH_S = 0.8  # of smoothing
_LEG_S, _PAUSE_S = (8.0, 16.0), (2.0, 5.0)  # shortest, longest, of a leg and of what lies between
_HOVER_S = (50.0, 70.0)  # between two legs of the one that hovers
_HOVER_WANDER = ((0.15, 2.5),)  # m, s: how it holds its place


def circles(
    minutes: float,
    *,
    seed: int = 0,
    bank_deg: float = 30.0,
    speed_ms: float = 16.0,
    wind_ms: float = 2.0,
    start_tow: float = START_TOW,
) -> FlightMotion:
    """Circle in the air all the time, with gusts (V.1).

    Parameters
    ----------
    minutes : of the record, which begins in the air.
    seed : of wind direction, sense of turn and gusts.
    bank_deg, speed_ms : of the aircraft, through the air.
    wind_ms : m/s, of the wind.
    start_tow : s, of the first instant.
    """
    rng = np.random.default_rng(seed)
    time = _clock(minutes)
    radius = speed_ms**2 / (TURN_GRAVITY * np.tan(np.radians(bank_deg)))
    sense, begin, towards = rng.choice([-1.0, 1.0]), *rng.uniform(0.0, 2.0 * np.pi, 2)
    phase = begin + sense * speed_ms / radius * time
    wind = wind_ms * np.array([np.cos(towards), np.sin(towards), 0.0])
    ring = radius * np.stack([np.cos(phase), np.sin(phase)], axis=-1)
    gust = [gusts(bands, time.size, rng) for bands in (((0.4, 3.0),),) * 2 + (((0.3, 3.0),),)]
    position = np.column_stack([ring, np.full(time.size, -_FLYING_HEIGHT_M)]) + time[:, None] * wind
    position += np.stack(gust, axis=-1)
    ahead = np.stack([-np.sin(phase), np.cos(phase), np.zeros(time.size)], axis=-1) * sense
    angles = coordinated_attitude(position, ahead, wind) + np.stack(
        _shaking(time.size, rng), axis=-1
    )
    return _flight("circles", position, angles, start_tow)


def multirotor(
    minutes: float,
    style: str = "sideways",
    *,
    seed: int = 0,
    speed_ms: float = 6.0,
    wind_ms: float = 3.0,
    start_tow: float = START_TOW,
) -> FlightMotion:
    """Fly legs of a multirotor whose nose does not follow its course (V.2).

    Parameters
    ----------
    minutes : of the record, which begins in the air.
    style : "sideways" keeps its nose across the course, "backward" against it, with another
        heading for every leg; "hover" stands for a minute between two legs, its nose anywhere.
    seed : of everything random.
    speed_ms, wind_ms : m/s, on the legs and of the wind.
    start_tow : s, of the first instant.

    Raises
    ------
    UsageError : a style that does not exist.
    """
    if style not in STYLES:
        raise UsageError(f"style {style!r} is none of {', '.join(STYLES)}")
    from scipy.ndimage import gaussian_filter1d

    rng = np.random.default_rng(seed)
    time = _clock(minutes)
    velocity, nose = np.zeros((time.size, 3)), np.empty(time.size)
    course, heading = rng.uniform(0.0, 2.0 * np.pi, 2)
    heading = course + _NOSE.get(style, heading)
    k, leg = 0, style != "hover"
    while k < time.size:
        pause = _HOVER_S if style == "hover" else _PAUSE_S
        last = k + round(rng.uniform(*(_LEG_S if leg else pause)) / MOTION_KNOT_S)
        if leg:
            velocity[k:last] = speed_ms * np.array([np.cos(course), np.sin(course), 0.0])
            velocity[k:last, 2] = rng.uniform(-0.5, 0.5)
        else:
            course += rng.choice([-1.0, 1.0]) * rng.uniform(0.35, 0.65) * np.pi
            target = course + _NOSE.get(style, rng.uniform(0.0, 2.0 * np.pi))
            nose[k : (k + last) // 2] = heading
            heading += (target - heading + np.pi) % (2.0 * np.pi) - np.pi
        nose[k if leg else (k + last) // 2 : last] = heading
        k, leg = last, not leg
    rounded = _LEG_SMOOTH_S / MOTION_KNOT_S
    velocity = gaussian_filter1d(velocity, rounded, axis=0, mode="nearest")
    position = np.cumsum(velocity, axis=0) * MOTION_KNOT_S
    position += np.stack([gusts(_HOVER_WANDER, time.size, rng) for _ in range(3)], axis=-1)
    position[:, 2] -= _FLYING_HEIGHT_M
    towards = rng.uniform(0.0, 2.0 * np.pi)
    wind = wind_ms * np.array([np.cos(towards), np.sin(towards), 0.0])
    yaw = nose[0] + gaussian_filter1d(nose - nose[0], 1.5 * rounded, mode="nearest")
    angles = _leaning(position, yaw, wind) + np.stack(_shaking(time.size, rng), axis=-1)
    return _flight(style, position, angles, start_tow)


def _leaning(position: Array, yaw: Array, wind: Array) -> Array:
    """(n, 3) roll, pitch, yaw whose body axis -z is the thrust (V.2)."""
    velocity = np.gradient(position, MOTION_KNOT_S, axis=0)
    thrust = np.gradient(velocity, MOTION_KNOT_S, axis=0) + _DRAG * (velocity - wind)
    thrust[:, 2] -= TURN_GRAVITY
    c, s = np.cos(yaw), np.sin(yaw)
    along, across = c * thrust[:, 0] + s * thrust[:, 1], c * thrust[:, 1] - s * thrust[:, 0]
    size = np.linalg.norm(thrust, axis=1)
    roll, pitch = np.arcsin(across / size), np.arctan2(-along, -thrust[:, 2])
    return np.column_stack([roll, pitch, yaw])


def _shaking(n: int, rng: np.random.Generator) -> list[Array]:
    """What turbulence adds to roll, pitch and yaw, rad."""
    bands = ((1.0, 0.8), (0.3, 0.15))
    return [np.radians(gusts(bands, n, rng)) for _ in range(3)]


def _clock(minutes: float) -> Array:
    """Seconds of the control points, of which some lie beyond the record's ends."""
    if not minutes > 0.5:
        raise UsageError(f"{minutes} minutes; give more than half a minute")
    reach = round(SETTLE_S / MOTION_KNOT_S)
    n = int(np.ceil(60.0 * minutes / MOTION_KNOT_S)) + 5 + 2 * reach
    return np.asarray((np.arange(n) - 2.0 - reach) * MOTION_KNOT_S, dtype=np.float64)


def _flight(name: str, position: Array, angles: Array, start_tow: float) -> FlightMotion:
    reach = round(SETTLE_S / MOTION_KNOT_S)
    control = np.hstack([position, angles])[reach:-reach]
    return flight_along(ExactMotion(SITE, start_tow, MOTION_KNOT_S, control), name, 5.0)
