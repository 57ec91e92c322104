"""Where lines of a copter in wind begin and end: at corners of its course, not where it yaws.

Oracle: the flight plan. Gusts move the copter aside (sigma grows with the wind, correlated from
image to image), it crabs into the wind, and its yaw scatters.
"""

import numpy as np
import pytest

from insgnss.navigation.orient.relative import line_numbers
from insgnss.photogrammetry.block_adjustment.aerial.relative import flight_lines
from insgnss.records import ExteriorOrientation

BASE_M, IMAGES = 12.0, 14
GUSTS = {5.0: (0.3, 5.0), 8.0: (0.8, 10.0), 12.0: (1.5, 18.0)}  # wind, m/s: aside, m; yaw, deg
SEEDS = range(8)


def line(start, course_deg, images: int = IMAGES) -> np.ndarray:
    """Images along a straight line."""
    course = np.radians(course_deg)
    along = BASE_M * np.arange(images)[:, None]
    return np.array(start) + along * [np.sin(course), np.cos(course)]


def serpentine(course_deg: float = 20.0, lines: int = 4) -> list[np.ndarray]:
    """Lines to and fro, 30 m apart, with an image at both ends of the way across."""
    whole, out = np.zeros(2), []
    across = 30.0 * np.array([np.cos(np.radians(course_deg)), -np.sin(np.radians(course_deg))])
    for k in range(lines):
        out.append(line(whole, course_deg + 180.0 * (k % 2)))
        whole = out[-1][-1] + across
    return out


def saw() -> list[np.ndarray]:
    """Lines with corners of 60 deg, 12 m from the end of one to the next."""
    out, start = [], np.zeros(2)
    for k in range(4):
        out.append(line(start, 30.0 * (-1.0) ** k))
        start = line(out[-1][-1], 30.0 * (-1.0) ** (k + 1), 2)[1]
    return out


def bent_road() -> list[np.ndarray]:
    """A corridor along a road with bends of 200 m radius, in one line."""
    course = np.cumsum(BASE_M / 200.0 * np.sign(np.sin(np.arange(50) / 8.0)))
    return [np.cumsum(BASE_M * np.column_stack([np.sin(course), np.cos(course)]), axis=0)]


def orbit() -> list[np.ndarray]:
    """A circle of 12 deg from image to image."""
    angle = np.radians(12.0 * np.arange(30))
    return [BASE_M / np.radians(12.0) * np.column_stack([np.cos(angle), np.sin(angle)])]


PLANS = {
    "to and fro": serpentine(),
    "cross grid": [*serpentine(), *(x + [0.0, 150.0] for x in serpentine(110.0))],
    "corners of 60 deg": saw(),
    "bent road": bent_road(),
    "orbit": orbit(),
}


def flown(plan, wind: float, seed: int, hover_s: float = 0.0, turned_deg: float = 0.0):
    """Times, positions and attitudes of images; amidst each line it hovers and turns its nose."""
    draw = np.random.default_rng(seed)
    aside_m, yaw_deg = GUSTS[wind]
    clock, times, places, yaws = 0.0, [], [], []
    for XY in plan:
        way = np.gradient(XY, axis=0)
        course = np.unwrap(np.arctan2(way[:, 0], way[:, 1]))
        gust = draw.standard_normal(len(XY))
        for k in range(1, len(XY)):
            gust[k] = 0.8 * gust[k - 1] + 0.6 * gust[k]
        right = np.column_stack([np.cos(course), -np.sin(course)])
        up = 80.0 + 6.0 * np.sin(0.7 * np.arange(len(XY)))  # follows the terrain
        places.append(np.column_stack([XY + aside_m * gust[:, None] * right, up]))
        second_half = np.arange(len(XY)) >= len(XY) // 2
        times.append(clock + BASE_M / 6.0 * np.arange(len(XY)) + hover_s * second_half)
        clock = times[-1][-1] + 5.0
        crab = np.arcsin(wind / 16.0) * np.sin(course - 1.0)
        scatter = np.radians(yaw_deg) * draw.uniform(-1.0, 1.0, len(XY))
        yaws.append(course + crab + scatter + np.radians(turned_deg) * second_half)
    yaw = np.concatenate(yaws)
    C = np.zeros((yaw.size, 3, 3))  # image x to the right of the nose, z down
    C[:, 0, 0], C[:, 1, 0] = np.cos(yaw), -np.sin(yaw)
    C[:, 0, 1], C[:, 1, 1] = -np.sin(yaw), -np.cos(yaw)
    C[:, 2, 2] = -1.0
    return np.concatenate(times), np.vstack(places), C


def pieces(number: np.ndarray, plan) -> list[int]:
    """Return the sizes of the pieces of each planned line, the largest first."""
    ends = np.cumsum([len(XY) for XY in plan])[:-1]
    return [
        sorted(np.bincount(of_line)[np.unique(of_line)].tolist(), reverse=True)
        for of_line in np.split(number, ends)
    ]


@pytest.mark.parametrize(
    ("kind", "wind"),
    [(kind, wind) for kind in PLANS for wind in GUSTS if kind != "orbit" or wind < 8.0],
)
def test_a_line_in_wind_is_one(kind, wind) -> None:
    """At most its first and last image, where it turns, are left out of a line; an orbit turns by
    12 deg an image, so that stronger gusts end its lines.
    """
    plan = PLANS[kind]
    for seed in SEEDS:
        time, place, C = flown(plan, wind, seed)
        number = line_numbers(time, place, np.tile([0.0, 0.0, 1.0], (time.size, 1)), C)
        for XY, parts in zip(plan, pieces(number, plan), strict=True):
            assert parts[0] >= len(XY) - 2, (seed, parts)
            assert sum(part >= 3 for part in parts) == 1
        long = np.flatnonzero(np.bincount(number)[1:] >= 3) + 1
        assert long.size == len(plan)


@pytest.mark.parametrize("wind", GUSTS)
@pytest.mark.parametrize(("hover_s", "parts"), [(0.0, 1), (15.0, 2)])
def test_a_turn_of_the_nose_ends_no_line_and_a_pause_does(wind, hover_s, parts) -> None:
    """Amidst each line the copter turns by 180 deg, and hovers for no or for 15 s."""
    plan = PLANS["to and fro"]
    for seed in SEEDS:
        time, place, C = flown(plan, wind, seed, hover_s, 180.0)
        number = line_numbers(time, place, np.tile([0.0, 0.0, 1.0], (time.size, 1)), C)
        for found in pieces(number, plan):
            assert sum(part >= 3 for part in found) == parts, (seed, found)


def test_lines_of_a_block_part_at_a_corner_with_an_image() -> None:
    """Oracle: the plan: a corner image ends its line, so that no two lines share a shift."""
    plan = PLANS["corners of 60 deg"]
    time, place, C = flown(plan, 5.0, 1)
    n = time.size
    eo = ExteriorOrientation(
        tuple(map(str, range(n))), time, 2300, np.array([0.8, 0.1, 0.0]), place, C,
        np.tile(np.eye(6), (n, 1, 1)), None, np.eye(3), np.eye(3),
    )  # fmt: skip
    lines = [rows for rows in flight_lines(eo) if rows.size >= 3]
    assert len(lines) == len(plan)
    assert all(abs(rows.size - IMAGES) <= 2 for rows in lines)
