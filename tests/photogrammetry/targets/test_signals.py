"""Signals and their templates.

Oracles: the patterns drawn by hand, and means over the pixels of a fine drawing.
"""

import numpy as np
import pytest

from insgnss.base.errors import InputError
from insgnss.photogrammetry.targets.measurement import correlation_maps
from insgnss.photogrammetry.targets.signals import Signal, cross, disc, picture, quadrants
from insgnss.photogrammetry.targets.template import Template, rotated_axes


def _at(signal: Signal, *places: tuple[float, float]) -> list[float]:
    e, n = np.array(places, dtype=np.float64).T
    return [float(v) for v in signal.value(e, n)]


def test_patterns_are_what_they_are_called() -> None:
    """Oracle: by hand."""
    assert _at(quadrants(0.3), (0.1, 0.1), (-0.1, 0.1), (-0.1, -0.1), (0.1, -0.1)) == [1, 0, 1, 0]
    assert _at(disc(0.2), (0.09, 0.0), (0.0, 0.11)) == [1, 0]
    assert _at(disc(0.2, bright=False), (0.09, 0.0), (0.0, 0.11)) == [0, 1]
    assert _at(cross(0.5, 0.08), (0.2, 0.0), (0.0, -0.2), (0.1, 0.1)) == [1, 1, 0]
    grey = np.zeros((9, 9))
    grey[0, 4], grey[4, 8] = 50.0, 100.0  # a middle one to the north, a bright one to the east
    shown = _at(picture(grey, 0.9), (0.0, 0.4), (0.4, 0.0), (0.0, 0.0))
    assert shown == pytest.approx([0.5, 1.0, 0.0])


@pytest.mark.parametrize(
    ("make", "words"),
    [
        (lambda: quadrants(0.0), "positive"),
        (lambda: disc(0.2, around=1.0), "more than 1"),
        (lambda: cross(0.5, 0.3), "half as wide"),
        (lambda: picture(np.ones((5, 5)), 0.3), "nothing to find"),
        (lambda: picture(np.ones((5, 4)), 0.3), "square"),
    ],
)
def test_what_is_no_target_is_refused(make: object, words: str) -> None:
    """Oracle: the message."""
    with pytest.raises(InputError, match=words):
        make()  # type: ignore[operator]


def test_azimuth_is_clockwise_from_north() -> None:
    """Oracle: by hand; an image with north up, whose rows run south."""
    G = rotated_axes(np.array([[50.0, 0.0, 0.0], [0.0, -50.0, 0.0]]), np.radians(90.0))
    np.testing.assert_allclose(G @ [0.0, 1.0], [50.0, 0.0], atol=1e-9)  # its north points east
    np.testing.assert_allclose(G @ [1.0, 0.0], [0.0, 50.0], atol=1e-9)  # its east points south


def test_template_is_the_mean_over_pixels() -> None:
    """Oracle: the area of a half plane's pixels by hand, without blur to speak of."""
    half = Signal("half", 0.2, 2 * np.pi, lambda e, n: np.asarray(e > 0.0, dtype=np.float64))
    sampled = Template(half, np.array([[50.0, 0.0], [0.0, -50.0]])).blurred(0.01)
    d = np.array([[-1.0, 0.3], [-0.3, 0.0], [0.0, 0.0], [0.3, 1.0], [1.0, 0.0]])
    value, du, dv = sampled.at(d)
    np.testing.assert_allclose(value, [0.0, 0.2, 0.5, 0.8, 1.0], atol=1e-6)
    np.testing.assert_allclose(du[1:4], 1.0, atol=0.01)
    np.testing.assert_allclose(dv, 0.0, atol=1e-9)


def test_correlation_is_that_of_the_definition() -> None:
    """Oracle: numpy's coefficient over the pixels within the signal, place by place."""
    rng = np.random.default_rng(3)
    window = rng.uniform(0, 255, (40, 44))
    t = Template(quadrants(0.3), rotated_axes(np.array([[50.0, 5.0, 0], [2.0, -45.0, 0]]), 0.4))
    got = correlation_maps(window, [t], 0.7)[0]
    half = int(np.ceil(t.reach_px))
    at = np.arange(-half, half + 1)
    d = np.stack(np.meshgrid(at, at), axis=-1).reshape(-1, 2)
    d = d[t.inside(d.astype(float))]
    T = t.blurred(0.7).at(d)[0]
    for row, column in ((half, half), (20, 21), (40 - half - 1, 44 - half - 1)):
        grey = window[row + d[:, 1], column + d[:, 0]]
        assert got[row, column] == pytest.approx(np.corrcoef(T, grey)[0, 1], abs=1e-9)
    assert np.isnan(got[half - 1, half])
    assert np.isnan(got[40 - half, half])
    assert (
        correlation_maps(np.full((40, 44), 7.0), [t], 0.7)[0, half:-half, half:-half] == 0.0
    ).all()
    assert np.isnan(correlation_maps(np.zeros((5, 5)), [t], 0.7)).all()
