"""The straight lines of a flight, numbered, with what is known on each.

A surveyor plans, and repeats, by the line.

A row belongs to a line where the chords over the `HALF_S` before and after it differ by less than
`STRAIGHT_DEG` at more than a part `SLOWEST` of the flight's speed. Rows on end make a line if they
last, and if the course at their ends does not differ by more than `BEND_DEG`, which leaves wide
circles out. Where there are images, the lines are those with images on them.
"""

import math
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..records import Array, Diagnostics, ExteriorOrientation
from ..records.interpolation import columns_at

# the course changes by less than the first angle from so long before to so long after, and by less
# than the second from the line's first third to its last: gusts stay within (chosen)
HALF_S, STRAIGHT_DEG, BEND_DEG = 2.0, 12.0, 30.0
SLOWEST, SLOWEST_MS = 0.3, 0.5  # of the 90 % quantile of the speed; m/s
SHORTEST_LINE_S = 8.0  # of a line: a few exposures; shorter ones are parts of turns (chosen)
BROKEN_S = 2.0  # a step of time beyond it ends a line


@dataclass(frozen=True)
class FlightLine:
    """Rows `first` to `last` of the diagnostics.

    Images `image` to `next_image` - 1 of the exterior orientation.
    """

    first: int
    last: int
    image: int = 0
    next_image: int = 0


def flight_lines(run: Diagnostics, eo: ExteriorOrientation | None) -> tuple[FlightLine, ...]:
    """Return the straight lines of the flight in the order of time."""
    if run.time.size < 3 or run.time[-1] - run.time[0] < SHORTEST_LINE_S:
        return ()
    course, straight = _course(run)
    starts = np.concatenate(
        [[True], (~straight[1:]) | (~straight[:-1]) | (np.diff(run.time) > BROKEN_S)]
    )
    edges = np.append(np.flatnonzero(starts), run.time.size)
    lines = []
    for first_row, last_row in zip(edges[:-1], edges[1:] - 1, strict=True):
        if run.time[last_row] - run.time[first_row] < SHORTEST_LINE_S:
            continue
        third = (last_row - first_row) // 3
        ends = (slice(first_row, first_row + third), slice(last_row - third, last_row))
        begin, end = (_mean_course(course[rows]) for rows in ends)
        if abs(math.remainder(end - begin, 2.0 * math.pi)) > math.radians(BEND_DEG):
            continue
        image, next_image = 0, 0
        if eo is not None:
            ends_s = (run.time[first_row] - HALF_S, run.time[last_row] + HALF_S)
            image, next_image = map(int, np.searchsorted(eo.time, ends_s))
        lines.append(FlightLine(int(first_row), int(last_row), image, next_image))
    with_images = [line for line in lines if line.next_image > line.image]
    return tuple(with_images or lines)


def _course(run: Diagnostics) -> tuple[Array, NDArray[np.bool_]]:
    """Return the course over each row's neighbourhood (n,), rad, and whether it is straight."""
    position = run.position[:, :2]
    shifted = [np.clip(run.time + shift, run.time[0], run.time[-1]) for shift in (-HALF_S, HALF_S)]
    position_before, position_after = (columns_at(time, run.time, position) for time in shifted)
    incoming, outgoing = position - position_before, position_after - position
    speed = np.hypot(run.velocity[:, 0], run.velocity[:, 1])
    slowest = max(SLOWEST_MS, SLOWEST * float(np.quantile(speed, 0.9)))
    turn_rad = np.arctan2(
        incoming[:, 0] * outgoing[:, 1] - incoming[:, 1] * outgoing[:, 0],
        np.sum(incoming * outgoing, axis=1),
    )
    turn_rad[(run.time - run.time[0] < HALF_S) | (run.time[-1] - run.time < HALF_S)] = 0.0
    chord = position_after - position_before
    straight = (np.abs(turn_rad) < math.radians(STRAIGHT_DEG)) & (speed > slowest)
    return np.arctan2(chord[:, 1], chord[:, 0]), straight


def _mean_course(course: Array) -> float:
    return math.atan2(float(np.sin(course).sum()), float(np.cos(course).sum()))


def image_sigmas(eo: ExteriorOrientation) -> tuple[Array, Array]:
    """Return the standard deviations of the images: position (n, 3) m and psi (n, 3) rad.

    The axes are those of the tangent plane, east, north, up.
    """
    sigma = np.sqrt(np.maximum(np.diagonal(eo.cov, axis1=1, axis2=2), 0.0))
    return sigma[:, :3], sigma[:, 3:]


def line_figures(run: Diagnostics, eo: ExteriorOrientation | None) -> list[dict[str, Any]]:
    """Return one row a line: time, course, length, images, and median sigmas.

    The median is over the images, without images over the line.
    """
    turned = np.unwrap(run.rpy[:, 2])
    of_images = np.zeros((0, 6)) if eo is None else np.hstack(image_sigmas(eo))
    rows = []
    for number, line in enumerate(flight_lines(run, eo), 1):
        sigma = of_images[line.image : line.next_image]
        if not len(sigma):
            sigma = np.delete(run.smoothed_sigma[line.first : line.last + 1], [3, 4, 5], axis=1)
        tilt = np.max(sigma[:, 3:5], axis=1)
        step = run.position[line.last] - run.position[line.first]
        count = line.next_image - line.image
        rows.append(
            {
                "line": number,
                "start_s": run.time[line.first],
                "end_s": run.time[line.last],
                "course_deg": math.degrees(math.atan2(step[1], step[0])) % 360.0,
                "length_m": math.hypot(step[0], step[1]),
                "images": count,
                "first_image": eo.images[line.image] if eo is not None and count else None,
                "last_image": eo.images[line.next_image - 1] if eo is not None and count else None,
                "horizontal_mm": 1e3 * float(np.median(np.hypot(sigma[:, 0], sigma[:, 1]))),
                "down_mm": 1e3 * float(np.median(sigma[:, 2])),
                "tilt_deg": math.degrees(float(np.median(tilt))),
                "heading_deg": math.degrees(float(np.median(sigma[:, 5]))),
                "turned_before_deg": math.degrees(float(np.ptp(turned[: line.first + 1]))),
                "turned_after_deg": math.degrees(float(np.ptp(turned[line.last :]))),
            }
        )
    return rows
