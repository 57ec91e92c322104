"""Paths of lines and arcs."""

import numpy as np
import pytest
from numpy.testing import assert_allclose

from insgnss.simulation.path import Route, _dubins_words, advance, shortest_way

PI = np.pi


def test_a_segment_is_the_integral_of_its_course():
    """Oracle: trapezoidal integration of cosine and sine of the course."""
    s = np.linspace(0.0, 90.0, 200001)
    course = 0.7 - s / 40.0
    x, y = (np.trapezoid(f(course), s) for f in (np.cos, np.sin))
    assert_allclose(
        advance((5.0, -3.0, 0.7), -1 / 40.0, 90.0),
        (5.0 + x, -3.0 + y, 0.7 - 90.0 / 40.0),
        atol=1e-7,
    )


def test_every_word_ends_at_its_goal():
    """Oracle: walking along it; 300 random goals, all six words must occur."""
    rng = np.random.default_rng(2)
    seen = set()
    for d, a, b in zip(
        rng.uniform(0.0, 6.0, 300), rng.uniform(-4, 4, 300), rng.uniform(-4, 4, 300), strict=True
    ):
        for turns, lengths in _dubins_words(d, a, b):
            pose = (0.0, 0.0, a)
            for turn, length in zip(turns, lengths, strict=True):
                assert length >= 0.0
                pose = advance(pose, turn, length)
            assert_allclose(
                [pose[0], pose[1], np.sin(0.5 * (pose[2] - b))], [d, 0.0, 0.0], atol=1e-9
            )
            seen.add(turns)
    assert len(seen) == 6


@pytest.mark.parametrize(
    ("goal", "length"),
    [
        ((300.0, 0.0, 0.0), 300.0),
        ((0.0, 100.0, PI), 50.0 * PI),  # the next line, one diameter to the right: half a circle
        ((0.0, -100.0, PI), 50.0 * PI),
        ((0.0, 160.0, PI), 50.0 * PI + 60.0),
        ((50.0, 50.0, PI / 2), 25.0 * PI),
        ((0.0, 0.0, PI), 50.0 * 7.0 * PI / 3.0),  # turn on the spot: arcs of 60, 300 and 60 degrees
        ((0.0, 0.0, 0.0), 0.0),
    ],
)
def test_shortest_way_has_the_length_that_geometry_gives(goal, length):
    """Oracle: elementary geometry, turns of 50 m."""
    assert sum(part for _, part in shortest_way((0.0, 0.0, 0.0), goal, 50.0)) == pytest.approx(
        length, abs=1e-9
    )


def test_climb_takes_as_many_circles_as_the_gradient_needs():
    """Oracle: arithmetic; 100 m of height at 0.2 take 500 m of way, 300 m are there, one circle of
    314 m is added.
    """
    route = Route((0.0, 0.0, 0.0), 10.0)
    route.connect((300.0, 0.0, 0.0), 110.0, 50.0, 0.2)
    path = route.path()
    assert path.total == pytest.approx(300.0 + 100.0 * PI)
    position, course = path.pose_at(np.array([0.0, 100.0 * PI, path.total]))
    assert_allclose(
        position,
        [[0, 0, -10], [0, 0, -10 - 100 * 100 * PI / path.total], [300, 0, -110]],
        atol=1e-9,
    )
    assert_allclose(course, [0.0, 2.0 * PI, 2.0 * PI], atol=1e-12)


def test_a_path_is_continuous():
    """Oracle: no step is longer than the path walked, and none shorter than its chord on the
    tightest turn.
    """
    route = Route((0.0, 0.0, 1.0), 0.0)
    for goal in ((200.0, 50.0, 2.0), (0.0, 0.0, -1.0), (30.0, 0.0, 3.0)):
        route.connect(goal, route.height + 5.0, 40.0, 0.2)
    path = route.path()
    s = np.linspace(0.0, path.total, 5000)
    position, _ = path.pose_at(s)
    step = np.linalg.norm(np.diff(position[:, :2], axis=0), axis=1)
    ds = s[1]
    assert step.max() <= ds * (1 + 1e-9)
    assert step.min() >= 80.0 * np.sin(ds / 80.0) - 1e-9
