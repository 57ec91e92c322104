"""Paths over ground of straight lines and circular arcs, and the shortest way (Dubins).

Horizontal coordinates are north x and east y, the course counts from north through east, and a
positive curvature turns right. From (x0, y0, c0) with curvature k, after the length s,

    c = c0 + k s,   (x, y) = (x0, y0) + s sinc(k s / 2) (cos(c0 + k s / 2), sin(c0 + k s / 2)) (P.1)

with sinc x = sin x / x. Height changes linearly along a segment.

The shortest path of bounded curvature between two directed points is one of six words of three
segments: RSR, LSL, RSL, LSR, LRL, RLR, with S straight (Dubins 1957; formulas of Shkel and Lumelsky
2001, with their left being our right).
"""

from collections.abc import Sequence
from dataclasses import dataclass, field
from math import acos, atan2, ceil, cos, hypot, pi, sin, sqrt

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
Pose = tuple[float, float, float]  # north m, east m, course rad


def advance(pose: Pose, curvature: float, length: float) -> Pose:
    """The pose after `length` m along a segment of `curvature` 1/m (P.1)."""
    x, y, course = pose
    half = 0.5 * curvature * length
    chord = length * (sin(half) / half if half else 1.0)
    return x + chord * cos(course + half), y + chord * sin(course + half), course + 2.0 * half


def _angle(x: float) -> float:
    """x within one turn; a hair below a full turn is none, so that rounding adds no circle."""
    x %= 2.0 * pi
    return 0.0 if x > 2.0 * pi - 1e-9 else x


SAME_PLACE_M, SAME_COURSE_COSINE = 1e-6, 1.0 - 1e-12  # of two poses: less apart is rounding


def _dubins_words(
    d: float, a: float, b: float
) -> list[tuple[tuple[int, int, int], tuple[float, float, float]]]:
    """Return turn signs and lengths of Dubins' words from (0, 0, a) to (d, 0, b), radius 1.

    a and b are courses, rad; a word is three segments: turn or straight, in units of the radius.
    """
    sa, sb, ca, cb, cab = sin(a), sin(b), cos(a), cos(b), cos(a - b)
    candidates: list[tuple[tuple[int, int, int], tuple[float, float, float]]] = []
    for s in (1, -1):  # RSR and LSL, one the mirror image of the other
        p2 = 2.0 + d * d - 2.0 * cab + 2.0 * d * s * (sa - sb)
        if p2 >= 0.0:
            way = s * atan2(s * (cb - ca), d + s * (sa - sb))
            candidates.append(
                ((s, 0, s), (_angle(s * (way * s - a)), sqrt(p2), _angle(s * (b - way * s))))
            )
    for s in (1, -1):  # RSL and LSR
        p2 = -2.0 + d * d + 2.0 * cab + 2.0 * d * s * (sa + sb)
        if p2 >= 0.0:
            p = sqrt(p2)
            way = atan2(-s * (ca + cb), d + s * (sa + sb)) - atan2(-2.0 * s, p)
            candidates.append(((s, 0, -s), (_angle(s * (way - a)), p, _angle(s * (way - b)))))
    for s in (1, -1):  # RLR and LRL
        cosine = (6.0 - d * d + 2.0 * cab + 2.0 * d * s * (sb - sa)) / 8.0
        if abs(cosine) <= 1.0:
            p = 2.0 * pi - acos(cosine)
            t = _angle(s * (atan2(s * (cb - ca), d + s * (sa - sb)) - a) + 0.5 * p)
            candidates.append(((s, -s, s), (t, p, _angle(s * (b - a) - t + p))))
    return candidates


def shortest_way(start: Pose, goal: Pose, radius: float) -> list[tuple[float, float]]:
    """Return curvature (1/m) and length (m) of the segments of the shortest path.

    It has three segments from `start` to `goal`, with turns of `radius` m.

    No segment where start and goal are the same but for rounding, to which a word could answer with
    a full circle.
    """
    dx, dy = goal[0] - start[0], goal[1] - start[1]
    if hypot(dx, dy) < SAME_PLACE_M and cos(goal[2] - start[2]) > SAME_COURSE_COSINE:
        return []
    bearing = atan2(dy, dx)
    candidates = _dubins_words(hypot(dx, dy) / radius, start[2] - bearing, goal[2] - bearing)
    turns, lengths = min(candidates, key=lambda word: sum(word[1]))
    return [(turn / radius, length * radius) for turn, length in zip(turns, lengths, strict=True)]


@dataclass
class Route:
    """A path being laid, segment after segment, from `pose` at `height` m.

    `line` is the number of a flight line, 0 elsewhere.
    """

    pose: Pose
    height: float
    segments: list[tuple[float, float, float, float, float, float, float, int]] = field(
        default_factory=list
    )

    def add(
        self, curvature: float, length: float, height: float | None = None, line: int = 0
    ) -> None:
        """Go on for `length` m to `height`."""
        if length > 0.0:
            height = self.height if height is None else height
            self.segments.append((*self.pose, curvature, length, self.height, height, line))
            self.pose = advance(self.pose, curvature, length)
            self.height = height

    def connect(self, goal: Pose, height: float, radius: float, gradient: float) -> None:
        """Go the shortest way to `goal`, changing height evenly.

        Circles come first where the way is too short for `gradient`.
        """
        segments_to_goal = shortest_way(self.pose, goal, radius)
        length = sum(piece_m for _, piece_m in segments_to_goal)
        if not segments_to_goal and height == self.height:
            return
        circle = 2.0 * pi * radius
        missing = abs(height - self.height) / gradient - length
        if missing > 0.0:
            circles = ceil(missing / circle)
            segments_to_goal.insert(
                0,
                (
                    (segments_to_goal[0][0] if segments_to_goal else 0.0) or 1.0 / radius,
                    circles * circle,
                ),
            )
            length += circles * circle
        height_0 = self.height
        rise = (height - height_0) / length
        travelled = 0.0
        for curvature, piece_m in segments_to_goal:
            travelled += piece_m
            self.add(curvature, piece_m, height_0 + rise * travelled)

    def path(self) -> "SegmentPath":
        """Return the finished path."""
        return SegmentPath.of(self.segments)


@dataclass(frozen=True, eq=False)
class SegmentPath:
    """Segments in order, every field (n,).

    Parameters
    ----------
    x, y, course : where a segment starts, m and rad.
    curvature : 1/m.
    length : m.
    height0, height1 : of its ends, m.
    line : number of the flight line, 0 elsewhere.
    s0 : length of the path before it, m.
    """

    x: Array
    y: Array
    course: Array
    curvature: Array
    length: Array
    height0: Array
    height1: Array
    line: NDArray[np.int64]
    s0: Array

    @classmethod
    def of(
        cls, segments: Sequence[tuple[float, float, float, float, float, float, float, int]]
    ) -> "SegmentPath":
        """Return the path of segments as `Route` keeps them."""
        x, y, course, curvature, length, height0, height1, line = np.array(
            segments, dtype=np.float64
        ).T
        s0 = np.concatenate([[0.0], np.cumsum(length)[:-1]])
        return cls(x, y, course, curvature, length, height0, height1, line.astype(np.int64), s0)

    @property
    def total(self) -> float:
        """Length of the whole path, m."""
        return float(self.s0[-1] + self.length[-1])

    def segment_at(self, s: Array) -> NDArray[np.int64]:
        """Return the segment at each path length s."""
        return np.clip(np.searchsorted(self.s0, s, side="right") - 1, 0, self.s0.size - 1)

    def pose_at(self, s: Array) -> tuple[Array, Array]:
        """Return north, east, down (n, 3), m, and course (n,), rad, after the lengths s (n,), m.

        Beyond the path's ends the pose is that of the end (P.1).
        """
        s = np.clip(s, 0.0, self.total)
        i = self.segment_at(s)
        along = s - self.s0[i]
        half = 0.5 * self.curvature[i] * along
        chord = along * np.sinc(half / np.pi)
        middle = self.course[i] + half
        height = self.height0[i] + (self.height1[i] - self.height0[i]) * along / self.length[i]
        position = np.stack(
            [self.x[i] + chord * np.cos(middle), self.y[i] + chord * np.sin(middle), -height],
            axis=-1,
        )
        return position, self.course[i] + 2.0 * half


def times_along(s: Array, square: Array, acceleration: float) -> Array:
    """Return the times (n,) s at path lengths s (n,) m, from zero on.

    The speed is as high as its limits, whose squares are `square` (n,) m^2/s^2, and the
    acceleration, m/s^2, allow.
    """
    slope = 2.0 * acceleration * s
    square = np.minimum.accumulate(square - slope) + slope
    square = np.minimum.accumulate((square + slope)[::-1])[::-1] - slope
    speed = np.sqrt(np.maximum(square, 0.0))
    return np.concatenate([[0.0], np.cumsum(2.0 * np.diff(s) / (speed[1:] + speed[:-1]))])
