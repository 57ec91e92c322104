"""Vehicles on the ground.

A car that drives and stops without side slip, and a person who carries the rig.

The car's body point is the middle of its rear axle, which moves where the car points: yaw and pitch
are those of the velocity,

    yaw = atan2(v_east, v_north),   pitch = atan2(-v_down, |v_horizontal|)                     (G.1)

and of the road where it stands. The speed obeys v^2(s) <= v^2(s') + 2 a |s - s'| between stops and
v^2 <= a_side / |curvature|, the path is smoothed over 0.4 s, which rounds the onset of bends. Side
slip that remains is that between a spline of (G.1) and (G.1) of the spline, below 1 cm/s. The road
shakes the car in roll and, by millimetres, up and down (some cm/s), as long as it drives.
"""

from dataclasses import dataclass

import numpy as np

from ..base.errors import UsageError
from ..records import Array
from .flights import MOTION_KNOT_S, SITE, START_TOW, FlightMotion, flight_along, gusts
from .motion import ExactMotion
from .path import Route, SegmentPath, times_along

_TIMETABLE_STEP_M = 0.1  # of the timetable
_BEND_SMOOTH_S = 0.4  # of smoothing
_KNOTS_BEYOND = round(3.0 / MOTION_KNOT_S)  # knots past the end, farther than the smoothing reaches
_REST_MS = 0.3  # below this the road gives the heading
# of the road: time scale, standard deviations of roll and height
_SHAKE_S, _SHAKE_ROLL, _SHAKE_M = 0.12, 0.004, 0.0012


@dataclass(frozen=True)
class Gait:
    """How a vehicle goes.

    Its speed is in m/s, accelerations along and across in m/s^2, straights and radius of bends in m
    (shortest, longest).

    Parameters
    ----------
    stop_share : of the bends with a halt before them, of stop_s (shortest, longest) s.
    """

    speed_ms: float
    along_ms2: float
    across_ms2: float
    straight_m: tuple[float, float]
    radius_m: tuple[float, float]
    stop_share: float = 0.5
    stop_s: tuple[float, float] = (8.0, 20.0)


CAR = Gait(12.0, 1.5, 2.5, (60.0, 250.0), (8.0, 20.0))  # in a town (chosen)
WALKER = Gait(1.35, 0.8, 1.0, (10.0, 40.0), (0.8, 3.0))  # a person who carries the rig (chosen)


_RIG_HEIGHT_M = 1.5  # of the rig above the ground: a car's roof, a person's hand
_SLOPE = 0.02  # largest of a road, m/m (chosen)
_HALT_SHARE = 0.8  # of a straight that is travelled before a halt: at its end, before the bend
_MOVING_MS = 0.2  # speed above which the rig moves: below any gait, above the rounding of knots
_BODY_ROLL, _BODY_ROLL_S = 0.01, 2.0  # rad, and s: how a car's body rolls on its springs (chosen)
_STEP_PAIRS_HZ = 0.9  # pairs of steps a second: a pair lasts 1.1 s
_SWAY_M, _BOB_M = (
    0.03,
    0.025,
)  # of a walker's hand, sideways and up and down with each step (chosen)
_STEP_ANGLES = (0.06, 0.05, 0.04)  # rad of roll, pitch, yaw with each step (chosen)
_HAND_SWING, _HAND_SWING_S = 0.05, 1.5  # rad, and s: how a hand wanders besides (chosen)


def drive(
    minutes: float,
    *,
    seed: int = 0,
    stand_s: float = 15.0,
    rough: float = 1.0,
    gait: Gait = CAR,
    start_tow: float = START_TOW,
) -> FlightMotion:
    """Return the motion of a car in a town, without side slip, with stops, after a stand.

    It stands for `stand_s` first.

    Parameters
    ----------
    rough : factor on how the road shakes it.
    """
    rng = np.random.default_rng(seed)
    path, s = _draw_journey(gait, minutes, stand_s, rng)
    position, course, moving = _smoothed_motion(path, s)
    velocity = np.gradient(position, MOTION_KNOT_S, axis=0)
    level = np.hypot(velocity[:, 0], velocity[:, 1])
    yaw = np.where(level > _REST_MS, np.unwrap(np.arctan2(velocity[:, 1], velocity[:, 0])), course)
    yaw += 2.0 * np.pi * np.round((course - yaw) / (2.0 * np.pi))
    pitch = np.where(level > _REST_MS, np.arctan2(-velocity[:, 2], level), 0.0)
    roll = (
        _BODY_ROLL * _unit_swing(s.size, _BODY_ROLL_S, rng)
        + rough * _SHAKE_ROLL * _unit_swing(s.size, _SHAKE_S, rng)
    ) * moving
    position[:, 2] += rough * _SHAKE_M * _unit_swing(s.size, _SHAKE_S, rng) * moving
    return _flight("drive", position, np.column_stack([roll, pitch, yaw]), start_tow)


def walk(
    minutes: float,
    *,
    seed: int = 0,
    stand_s: float = 15.0,
    gait: Gait = WALKER,
    start_tow: float = START_TOW,
) -> FlightMotion:
    """Return the motion of a person who carries the rig in the hand.

    The person takes steps, sways, wanders in heading about the way, and stands for `stand_s` first.
    """
    rng = np.random.default_rng(seed)
    path, s = _draw_journey(gait, minutes, stand_s, rng)
    position, course, moving = _smoothed_motion(path, s)
    step = 2.0 * np.pi * np.cumsum(moving) * MOTION_KNOT_S * _STEP_PAIRS_HZ
    position[:, 0] += -np.sin(course) * _SWAY_M * moving * np.sin(step)
    position[:, 1] += np.cos(course) * _SWAY_M * moving * np.sin(step)
    position[:, 2] += _BOB_M * moving * np.sin(2.0 * step)
    roll, pitch, yaw = _STEP_ANGLES
    swing = [roll * np.sin(step), pitch * np.sin(2.0 * step + 1.0), yaw * np.sin(step + 2.0)]
    angles = [
        moving * (angle + _HAND_SWING * _unit_swing(s.size, _HAND_SWING_S, rng)) for angle in swing
    ]
    return _flight("walk", position, np.column_stack([*angles[:2], course + angles[2]]), start_tow)


def _flight(name: str, position: Array, angles: Array, start_tow: float) -> FlightMotion:
    control = np.hstack([position, angles])[:-_KNOTS_BEYOND]
    return flight_along(ExactMotion(SITE, start_tow, MOTION_KNOT_S, control), name, 5.0)


def _draw_journey(
    gait: Gait, minutes: float, stand_s: float, rng: np.random.Generator
) -> tuple[SegmentPath, Array]:
    """Return a path with bends of a quarter turn, and the length (n,), m, travelled at each knot.

    About as many bends go to the right as to the left.
    """
    if not minutes > 0.5 or stand_s < 0.0:
        raise UsageError(
            f"{minutes} minutes with {stand_s} s of standing; give more than half a minute and no"
            " negative time"
        )
    route = Route((0.0, 0.0, float(rng.uniform(0.0, 2.0 * np.pi))), _RIG_HEIGHT_M)
    halts = []
    travelled = 0.0
    while travelled < 60.0 * minutes * gait.speed_ms:
        straight = rng.uniform(*gait.straight_m)
        route.add(0.0, straight, _RIG_HEIGHT_M + rng.uniform(-_SLOPE, _SLOPE) * straight)
        if rng.random() < gait.stop_share:
            halts.append((travelled + _HALT_SHARE * straight, rng.uniform(*gait.stop_s)))
        radius = rng.uniform(*gait.radius_m)
        route.add(rng.choice([-1.0, 1.0]) / radius, 0.5 * np.pi * radius)
        travelled += straight + 0.5 * np.pi * radius
    path = route.path()
    time, s = _timetable(path, gait, halts)
    knots = int(np.ceil(60.0 * minutes / MOTION_KNOT_S)) + 5 + _KNOTS_BEYOND
    return path, np.interp((np.arange(knots) - 2.0) * MOTION_KNOT_S - stand_s, time, s)


def _timetable(
    path: SegmentPath, gait: Gait, halts: list[tuple[float, float]]
) -> tuple[Array, Array]:
    """Return times (n,), s, with the halts as pauses, and path lengths (n,), m, from a stand."""
    s = np.arange(0.0, path.total, _TIMETABLE_STEP_M)
    k = np.abs(path.curvature[path.segment_at(s)])
    square = np.minimum(gait.speed_ms**2, gait.across_ms2 / np.maximum(k, 1e-9))
    stops = np.array([round(distance / _TIMETABLE_STEP_M) for distance, _ in halts], dtype=np.int64)
    square[[0, *stops]] = 0.0
    time = times_along(s, square, gait.along_ms2)
    # a halt is reached and left at the same place
    node = np.insert(np.arange(s.size), stops + 1, stops)
    wait = np.zeros(node.size)
    wait[stops + 1 + np.arange(stops.size)] = [length for _, length in halts]
    return time[node] + np.cumsum(wait), s[node]


def _smoothed_motion(path: SegmentPath, s: Array) -> tuple[Array, Array, Array]:
    """Return position (n, 3), m, unwrapped course (n,), rad, and motion (n,), 0 at rest to 1."""
    from scipy.ndimage import gaussian_filter1d

    position, course = path.pose_at(s)
    base = position[0].copy()
    width = _BEND_SMOOTH_S / MOTION_KNOT_S
    position = base + gaussian_filter1d(position - base, width, axis=0, mode="nearest")
    course = course[0] + gaussian_filter1d(np.unwrap(course) - course[0], width, mode="nearest")
    moving = gaussian_filter1d(
        (np.gradient(s, MOTION_KNOT_S) > _MOVING_MS).astype(float), width, mode="nearest"
    )
    return position, course, moving


def _unit_swing(n: int, width_s: float, rng: np.random.Generator) -> Array:
    """Return smooth noise (n,) of unit standard deviation, `width_s` wide."""
    return gusts(((1.0, width_s),), n, rng)
