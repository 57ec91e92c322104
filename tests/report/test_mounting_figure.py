"""The charts of a calibrated mounting: setups about their mean, residuals of a flight."""

from dataclasses import replace

import numpy as np
import pytest

from insgnss.report.figures.mounting import (
    Residuals,
    Scatter,
    over_motion,
    residuals,
    scatter_panel,
)

RNG = np.random.default_rng(8)


def scatter(n=5, sigma=0.002):
    each = np.array([0.46, -0.01, -0.06]) + RNG.normal(0.0, 0.002, (n, 3))
    left_out = np.arange(n) == 2
    mean = each[~left_out].mean(axis=0)
    sigmas = np.full((n, 3), sigma)
    names = tuple(f"p{k}" for k in range(n))
    return Scatter(names, each, sigmas, left_out, mean, np.full(3, sigma / 2.0))


def test_setups_stand_about_their_mean_with_their_sigma():
    """Oracle: each estimate minus the mean, mm, and bars of one sigma both ways; the one that was
    left out is red.
    """
    data = scatter()
    chart = scatter_panel(data, "setup", "Lever arm of each setup")
    assert "left out" in chart.reading
    for k, panel in enumerate(chart.panels):
        kept, out = (layer for layer in panel.layers if layer.kind == "points")
        off = 1e3 * (data.each[:, k] - data.mean[k])
        assert kept.y == pytest.approx(off[[0, 1, 3, 4]])
        assert (out.y == pytest.approx(off[2]), out.ink, list(out.texts)) == (True, "warn", ["p2"])
        bars = next(layer for layer in panel.layers if layer.kind == "line")
        assert (np.diff(bars.x) > 0).all()
        ends = bars.y.reshape(-1, 3)
        assert ends[:, 1] - ends[:, 0] == pytest.approx(4.0)
        assert np.isnan(ends[:, 2]).all()
        band = next(layer for layer in panel.layers if layer.kind == "band")
        assert (band.y[0], band.y2[0]) == pytest.approx((-1.0, 1.0))
    names = chart.panels[-1].layers[-1]
    assert list(names.texts) == list(data.names)


def test_misclosures_without_sigma_have_no_bars():
    """Oracle: by hand."""
    data = replace(scatter(sigma=0.0), names=tuple("12345"))
    kinds = {
        layer.kind for panel in scatter_panel(data, "target", "T").panels for layer in panel.layers
    }
    assert kinds == {"rules", "points"}


def test_residuals_over_images_course_and_map():
    """Oracle: the residuals that were put in; arrows are one factor of them, east and north."""
    residual = RNG.normal(0.0, 0.01, (40, 3))
    course = np.where(np.arange(40) < 30, np.arange(40.0), np.nan)
    place = RNG.uniform(0.0, 300.0, (40, 3))
    over, by_course, where = residuals(Residuals(residual, course, place))
    for k in range(3):
        assert over.panels[k].layers[-1].y == pytest.approx(1e3 * residual[:, k])
        dots = by_course.panels[k].layers[-1]
        assert dots.x == pytest.approx(np.arange(30.0))
        assert dots.y == pytest.approx(1e3 * residual[:30, k])
    arrows = where.panels[0].layers[-1]
    factor = (arrows.x2 - arrows.x) / residual[:, 0]
    assert factor == pytest.approx(factor[0])
    assert (arrows.y2 - arrows.y) / residual[:, 1] == pytest.approx(factor)
    unknown = Residuals(residual, np.full(40, np.nan), place)
    assert [chart.name for chart in residuals(unknown)] == ["residuals", "map"]


def test_means_follow_what_moves_the_residuals():
    """Oracle: a delay of 2 ms planted on the forward axis: 2 mm for each m/s, about the mean."""
    speed = np.linspace(2.0, 12.0, 120)
    residual = np.zeros((120, 6))
    residual[:, 0] = 0.002 * (speed - 7.0)
    (chart,) = over_motion(residual, {"speed, m/s": speed})
    assert (chart.name, chart.label) == ("over-speed", "speed, m/s")
    line = next(layer for layer in chart.panels[0].layers if layer.name == "forward")
    slope = np.polyfit(line.x, line.y, 1)[0]
    assert slope == pytest.approx(2.0, rel=1e-6)
    assert all((layer.y == 0.0).all() for layer in chart.panels[1].layers)
