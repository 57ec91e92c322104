"""Plans of survey flights, and their path over ground with the times at which it is flown.

Spacing of exposures and lines follows from the camera's footprint at height H above ground:

    base = (1 - forward overlap) H n_x d / f,   line spacing = (1 - side overlap) H n_y d / f  (L.1)

with n_x pixels along and n_y across the flight, pixel d and focal length f. Lines are flown every
other one first, so that most turns are half circles; the way between lines is the shortest of
bounded curvature. On course c in a wind of components w_a along and w_c across c, an aircraft of
airspeed V makes over ground

    v = w_a + sqrt(V^2 - w_c^2)                                                                (L.2)

limited by its acceleration: v^2(s) <= v^2(s') + 2 a |s - s'|, from a stand and to a stand.
"""

from dataclasses import dataclass, fields, replace
from typing import Any

import numpy as np

from ..base.advance import share as share_done
from ..base.advance import through, within
from ..base.errors import UsageError
from ..records import Array
from .path import Pose, Route, SegmentPath, advance, times_along

Line = tuple[Pose, float, float]  # start, height above ground m, length m

_PROFILE_STEP_M = 0.5  # of the speed profile
_ACCELERATION = 5.0  # m/s^2 along the path
# take-off and landing on the ground, the approach, and the way before and after lines (chosen)
_GROUND_RUN_M, _APPROACH_M, _LEAD_IN_M = 12.0, 220.0, 120.0
_COUNTED = 0.6  # of the time of a layout: by then the number of lines is found
# of the path beyond both ends of an airborne record; longer than the motion's smoothing reaches
_MARGIN_S = 5.0
# a trimmed flight: lines that stay, and the least part of their length
_FEWEST_LINES, _SHORTEST = 4, 0.25


@dataclass(frozen=True)
class SimulatedCamera:
    """Frame camera with its long side along the flight; the digiCAM of paper 000 by default."""

    along_px: int = 5120
    across_px: int = 3840
    pixel_m: float = 6.4e-6
    focal_m: float = 0.035
    min_interval_s: float = 1.3

    def base(self, height_m: float, overlap: float) -> float:
        """Distance between exposures, m (L.1)."""
        return (1.0 - overlap) * height_m * self.along_px * self.pixel_m / self.focal_m

    def line_spacing(self, height_m: float, overlap: float) -> float:
        """Distance between lines, m (L.1)."""
        return (1.0 - overlap) * height_m * self.across_px * self.pixel_m / self.focal_m


@dataclass(frozen=True)
class Level:
    """Parallel lines at one height above ground."""

    height_m: float
    course_deg: float
    lines: int
    length_m: float


@dataclass(frozen=True)
class FlightPlan:
    """What is to be flown.

    Parameters
    ----------
    minutes : duration of the record, or None for the plan as it is. A longer record flies lines
        again; a shorter one flies fewer lines (never under four), then shorter ones; if even that
        does not fit, the record ends in the air. `start_in_air` : it begins shortly before the
        first line, has no landing, and is cut at `minutes`.
    ground_s, ground_after_s : standing before take-off and after landing.
    max_bank_deg : in a steady turn downwind.
    lead_m : part of a line, at both ends, without exposures.
    turbulence : factor on all gusts.
    """

    name: str
    first_image: int
    levels: tuple[Level, ...]
    forward_overlap: float
    side_overlap: float
    launch: tuple[float, float]
    camera: SimulatedCamera = SimulatedCamera()
    minutes: float | None = None
    start_in_air: bool = False
    airspeed_ms: float = 14.0
    wind_ms: float = 4.0
    wind_from_deg: float = 240.0
    max_bank_deg: float = 32.0
    climb_gradient: float = 0.18
    lead_m: float = 40.0
    ground_s: float = 60.0
    ground_after_s: float = 20.0
    turbulence: float = 1.0
    trigger_delay_s: float = 0.02

    def __post_init__(self) -> None:
        if not 0.0 <= self.wind_ms < 0.7 * self.airspeed_ms:
            raise UsageError(
                f"wind {self.wind_ms} m/s at airspeed {self.airspeed_ms} m/s; it must stay under 70"
                " % of the airspeed"
            )
        for name in ("forward_overlap", "side_overlap"):
            if not 0.0 <= getattr(self, name) < 1.0:
                raise UsageError(
                    f"{name} {getattr(self, name)}; it lies between 0 and 1 (0.65 is 65 %)"
                )
        if self.minutes is not None and not self.minutes > 0.0:
            raise UsageError(f"a flight of {self.minutes} minutes; give a positive duration")
        if self.ground_s < 0.0 or self.ground_after_s < 0.0:
            raise UsageError(
                f"standing {self.ground_s} s before and {self.ground_after_s} s after the flight;"
                " neither can be negative"
            )

    def changed(self, **changes: Any) -> "FlightPlan":
        """The plan with other values of some fields; `line_length_m` sets that of all lines.

        UsageError for an unknown field.
        """
        length = changes.pop("line_length_m", None)
        names = {f.name for f in fields(self)}
        for name in changes:
            if name not in names:
                raise UsageError(
                    f"flight plan: {name!r} is unknown; use one of"
                    f" {', '.join(sorted(names | {'line_length_m'}))}"
                )
        levels = changes.get("levels", self.levels)
        if length is not None:
            changes["levels"] = tuple(replace(level, length_m=float(length)) for level in levels)
        return replace(self, **changes)

    @property
    def wind_l(self) -> Array:
        """(3,) m/s, velocity of the air in north, east, down."""
        towards = np.radians(self.wind_from_deg + 180.0)
        return self.wind_ms * np.array([np.cos(towards), np.sin(towards), 0.0])

    @property
    def turn_radius_m(self) -> float:
        """Radius at which the bank reaches its maximum downwind."""
        return float(
            (self.airspeed_ms + self.wind_ms) ** 2 / (9.81 * np.tan(np.radians(self.max_bank_deg)))
        )

    def ground_speed(self, course: Array) -> Array:
        """Speed over ground, m/s, on `course`, rad (L.2)."""
        north, east, _ = self.wind_l
        along = north * np.cos(course) + east * np.sin(course)
        across = east * np.cos(course) - north * np.sin(course)
        return along + np.sqrt(self.airspeed_ms**2 - across**2)


BLOCK = FlightPlan(
    name="ign8",
    first_image=8001,
    levels=(Level(140.0, 35.0, 14, 906.5), Level(180.0, 125.0, 12, 848.0)),
    forward_overlap=0.65,
    side_overlap=0.45,
    launch=(-560.0, -120.0),
)
CORRIDOR = FlightPlan(
    name="ign6x1",
    first_image=6001,
    levels=(Level(100.0, 60.0, 2, 2280.0), Level(140.0, 60.0, 2, 2280.0)),
    forward_overlap=0.70,
    side_overlap=0.70,
    launch=(-480.0, -960.0),
    wind_from_deg=290.0,
)

PLANS = {plan.name: plan for plan in (BLOCK, CORRIDOR)}
"""Plans by the names of the open data set."""


@dataclass(frozen=True, eq=False)
class Timetable:
    """A path with its timetable: path length s (n,), m, at `time` (n,), s.

    The record begins at `clock_offset_s` of that clock.
    """

    path: SegmentPath
    s: Array
    time: Array
    duration_s: float
    clock_offset_s: float


_HALVINGS = 12  # of the scale of lines: to 1/4096 of its range, seconds of a flight
_CLIMB_RUNS = 5.0  # ground runs over which a flight climbs straight ahead after take-off (chosen)
_APPROACH_SLOPE = 0.6  # of the approach, over the climb gradient (chosen)


def lay_out(plan: FlightPlan) -> Timetable:
    """Return path and timetable of a plan, as long as it asks for."""
    line_count = sum(level.lines for level in plan.levels)
    if plan.minutes is None:
        return (
            _lay_out_in_air(plan, line_count)
            if plan.start_in_air
            else _lay_out_from_ground(plan, line_count, 1.0)
        )
    duration_s = 60.0 * plan.minutes
    if plan.start_in_air:
        count = 1
        while (timetable := _lay_out_in_air(plan, count)).duration_s < duration_s:
            count += 1
        return replace(timetable, duration_s=duration_s)
    return _fit_duration(plan, line_count, duration_s)


def _fit_duration(plan: FlightPlan, line_count: int, duration_s: float) -> Timetable:
    """Return the timetable from take-off to landing in `duration_s`.

    It has as many lines as it takes, a little shortened.
    Cut in the air where nothing fits.
    """
    count = min(_FEWEST_LINES, line_count)
    while (unshortened := _lay_out_from_ground(plan, count, 1.0)).duration_s < duration_s:
        share_done(
            _COUNTED * (unshortened.duration_s / duration_s) ** 2
        )  # each takes as long as it is
        count += 1
    low = _SHORTEST
    high = 1.0
    fitting = _lay_out_from_ground(plan, count, low)
    if fitting.duration_s > duration_s:
        return replace(unshortened, duration_s=duration_s)
    with within(_COUNTED, 1.0):
        for _ in through(range(_HALVINGS)):
            middle = 0.5 * (low + high)
            trial = _lay_out_from_ground(plan, count, middle)
            if trial.duration_s > duration_s:
                high = middle
            else:
                low = middle
                fitting = trial
    return replace(fitting, duration_s=duration_s)


def _lay_out_from_ground(plan: FlightPlan, count: int, scale: float) -> Timetable:
    """Return the timetable of take-off, `count` lines of `scale` times their length, landing."""
    into_wind = np.radians(plan.wind_from_deg)
    launch: Pose = (*plan.launch, float(into_wind))
    route = Route(launch, 0.0)
    route.add(0.0, _GROUND_RUN_M)
    climb_m = _CLIMB_RUNS * _GROUND_RUN_M
    route.add(0.0, climb_m, climb_m * plan.climb_gradient)
    _fly_lines(route, plan, _lines_of_plan(plan, count, scale))
    gate = advance(launch, 0.0, -_APPROACH_M)
    route.connect(
        gate,
        _APPROACH_SLOPE * plan.climb_gradient * (_APPROACH_M - _GROUND_RUN_M),
        plan.turn_radius_m,
        plan.climb_gradient,
    )
    route.add(0.0, _APPROACH_M - _GROUND_RUN_M, 0.0)
    route.add(0.0, _GROUND_RUN_M)
    path = route.path()
    s, time = _timetable(path, plan, at_rest=True)
    return Timetable(
        path, s, time, float(time[-1]) + plan.ground_s + plan.ground_after_s, -plan.ground_s
    )


def _lay_out_in_air(plan: FlightPlan, count: int) -> Timetable:
    """Return the timetable of `count` lines and no more, from shortly before the first."""
    lines = _lines_of_plan(plan, count, 1.0)
    first_pose, height, _ = lines[0]
    route = Route(advance(first_pose, 0.0, -_LEAD_IN_M), height)
    route.add(0.0, _LEAD_IN_M)
    _fly_lines(route, plan, lines)
    route.add(0.0, _LEAD_IN_M)
    path = route.path()
    s, time = _timetable(path, plan, at_rest=False)
    return Timetable(path, s, time, float(time[-1]) - 2.0 * _MARGIN_S, _MARGIN_S)


def _fly_lines(route: Route, plan: FlightPlan, lines: list[Line]) -> None:
    for number, (start, height, length) in enumerate(lines, start=1):
        route.connect(start, height, plan.turn_radius_m, plan.climb_gradient)
        route.add(0.0, length, height, number)


def _lines_of_plan(plan: FlightPlan, count: int, scale: float) -> list[Line]:
    """Return `count` lines in the order flown; past the plan's last line its first follows."""
    line_count = sum(level.lines for level in plan.levels)
    position = plan.launch
    lines: list[Line] = []
    while len(lines) < count:
        missing = min(count - len(lines), line_count)
        for level, share in zip(plan.levels, _lines_of_levels(plan, missing), strict=True):
            if share:
                lines += _level_lines(plan, level, share, scale, position)
                start, _, length = lines[-1]
                position = advance(start, 0.0, length)[:2]
    return lines


def _lines_of_levels(plan: FlightPlan, count: int) -> list[int]:
    """Return how many of `count` lines each level gets, in proportion to its lines."""
    line_count = sum(level.lines for level in plan.levels)
    edges = np.round(
        np.cumsum([0, *(level.lines for level in plan.levels)]) * count / line_count
    ).astype(int)
    return [int(n) for n in np.diff(edges)]


def _level_lines(
    plan: FlightPlan, level: Level, count: int, scale: float, position: tuple[float, float]
) -> list[Line]:
    """Return `count` lines about the block's centre: every other one first, then back.

    From the corner nearest to `position`.
    """
    course = float(np.radians(level.course_deg))
    length = level.length_m * scale
    spacing = plan.camera.line_spacing(level.height_m, plan.side_overlap)
    order = list(range(0, count, 2)) + list(range(1, count, 2))[::-1]
    choices = []
    for side in (1.0, -1.0):
        for sense in (1.0, -1.0):
            starts: list[Pose] = []
            for k, j in enumerate(order):
                line_course = course if (sense > 0.0) == (k % 2 == 0) else course + np.pi
                offset = side * (j - 0.5 * (count - 1)) * spacing
                middle = (-offset * np.sin(course), offset * np.cos(course), float(line_course))
                starts.append(advance(middle, 0.0, -0.5 * length))
            choices.append(starts)
    nearest = min(
        choices, key=lambda poses: np.hypot(poses[0][0] - position[0], poses[0][1] - position[1])
    )
    return [(start, level.height_m, length) for start in nearest]


def _timetable(path: SegmentPath, plan: FlightPlan, at_rest: bool) -> tuple[Array, Array]:
    """Return path lengths (n,), m, and times (n,), s, `at_rest` or at full speed at both ends."""
    s = np.linspace(0.0, path.total, int(np.ceil(path.total / _PROFILE_STEP_M)) + 1)
    square = plan.ground_speed(path.pose_at(s)[1]) ** 2
    if at_rest:
        square[0] = square[-1] = 0.0
    return s, times_along(s, square, _ACCELERATION)
