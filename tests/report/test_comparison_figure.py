"""The charts of a comparison: differences, their distribution, what remains."""

import numpy as np
import pytest

from insgnss.report.figures.comparison import ComparisonPanel, Curve, comparison_charts

N = 300
TIME = 100.0 + np.arange(N, dtype=float)
SIGMA = np.full(N, 2.0)


def panels(seed=3, remaining=False):
    rng = np.random.default_rng(seed)
    east = Curve(rng.normal(0.0, 2.0, N), SIGMA, "mm")
    up = Curve(rng.normal(50.0, 2.0, N), SIGMA, "mm")
    left = Curve(up.values - 50.0, SIGMA, "mm") if remaining else None
    return [ComparisonPanel("east", east), ComparisonPanel("up", up, left)]


def layer(axes, kind):
    return next(one for one in axes.layers if one.kind == kind)


def test_differences_lie_over_minutes_within_three_sigma():
    """Oracle: the differences that were put in, over minutes, and 3 x 2 mm about zero."""
    names = [f"{k}.tif" for k in range(N)]
    chart, distribution = comparison_charts(panels(), (TIME, None), names)
    assert (chart.name, chart.link, distribution.name) == ("differences", "time", "distribution")
    dots, band = (layer(chart.panels[1], kind) for kind in ("points", "band"))
    assert dots.x == pytest.approx((TIME - 100.0) / 60.0)
    assert dots.y == pytest.approx(panels()[1].difference.values)
    assert list(dots.texts) == names
    assert band.y2 == pytest.approx(6.0)
    for axes in chart.panels:
        low, high = axes.limits
        y = layer(axes, "points").y
        assert low < min(y.min(), 0.0) < max(y.max(), 0.0) < high


def test_the_distribution_is_a_density_of_normalised_differences():
    """Oracle: it sums to one; noise as large as its sigma has a deviation of one, and what lies 25
    sigma away stands in the outermost class.
    """
    _, chart = comparison_charts(panels(), (TIME, None))
    found = [layer(axes, "steps") for axes in chart.panels]
    for steps in found:
        assert (steps.y * np.diff(steps.x)).sum() == pytest.approx(1.0)
    middle = 0.5 * (found[0].x[1:] + found[0].x[:-1])
    share = found[0].y * np.diff(found[0].x)
    assert np.sqrt((share * middle**2).sum()) == pytest.approx(1.0, abs=0.15)
    assert found[1].y[-1] * np.diff(found[1].x)[-1] == pytest.approx(1.0)
    normal = layer(chart.panels[0], "line")
    assert np.trapezoid(normal.y, normal.x) == pytest.approx(1.0, abs=1e-5)


def test_what_remains_has_a_chart_of_its_own():
    """Oracle: the differences less the 50 mm that were put in; only components that changed."""
    charts = comparison_charts(panels(remaining=True), (TIME, TIME))
    assert [chart.name for chart in charts] == ["differences", "remaining", "distribution"]
    (axes,) = charts[1].panels
    assert abs(layer(axes, "points").y.mean()) < 1.0


def test_a_long_series_is_a_line_that_no_gap_is_bridged_by():
    """Oracle: by hand; a leap of the time leaves a NaN between its ends, in the band too."""
    time = np.arange(1000.0)
    time[600:] += 500.0
    curve = Curve(np.ones(1000), np.ones(1000), "mm")
    chart, _ = comparison_charts([ComparisonPanel("east", curve)], (time, None))
    for kind in ("line", "band"):
        one = layer(chart.panels[0], kind)
        (at,) = np.flatnonzero(np.isnan(one.y))
        assert 599.0 / 60.0 < one.x[at] < 1100.0 / 60.0


def test_without_times_images_are_counted_and_without_sigmas_differences():
    """Oracle: by hand; numbers from one, histograms of the differences as they are."""
    plain = [ComparisonPanel("east", Curve(np.arange(10.0), None, "mm"))]
    chart, distribution = comparison_charts(plain, (None, None))
    assert chart.link == "image"
    assert layer(chart.panels[0], "points").x.tolist() == list(range(1, 11))
    assert "band" not in [one.kind for one in chart.panels[0].layers]
    assert layer(distribution.panels[0], "steps").y.sum() == 10.0
