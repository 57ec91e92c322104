"""Charts of a run: thinned series keep what the eye looks for; every run has its charts."""

import itertools

import numpy as np
import pytest

from insgnss.report.charts.chart import Chart, Layer
from insgnss.report.charts.run import charts
from insgnss.report.charts.thinned import MOST_DOTS, MOST_POINTS, scatter, thin, thin_layer
from insgnss.report.marks import marks_of

START = 205200.0
ALL = [
    *("map", "motion", "sigmas", "image-sigmas", "innovations", "innovation-distribution"),
    *("nis-distribution", "biases", "separation"),
]


def test_thinned_line_keeps_its_extremes() -> None:
    """Oracle: definition; single spikes, the ends and the extremes of each stretch survive."""
    y = np.random.default_rng(0).standard_normal(27013)
    y[[5000, 20001]] = 50.0, -50.0
    keep = thin(y)
    assert keep.size <= MOST_POINTS + 2
    assert (np.diff(keep) > 0).all()
    assert {0, 5000, 20001, y.size - 1} <= set(keep.tolist())
    stretch = np.searchsorted(keep, np.arange(0, y.size, 1000))
    assert all(
        y[keep[a:b]].max() > 1.5 for a, b in itertools.pairwise(stretch)
    )  # of 1000 normal numbers, surely


def test_thinned_line_stays_broken_where_it_was() -> None:
    """Oracle: definition; a stretch that is not determined keeps a point that is not."""
    y = np.ones(10000)
    y[4000:6000] = np.nan
    keep = thin(y)
    assert np.isnan(y[keep[(keep >= 4100) & (keep < 5900)]]).all()
    assert ((keep >= 4100) & (keep < 5900)).any()


def test_short_line_is_kept_whole() -> None:
    """Oracle: definition."""
    assert thin(np.arange(5.0)).tolist() == [0, 1, 2, 3, 4]


def test_thinned_points_keep_their_distribution_and_what_lies_far_out() -> None:
    """Oracle: the normal distribution; half of the points lie within 0.6745 sigma, extremes alone
    would leave none there.
    """
    y = np.random.default_rng(1).standard_normal(50000)
    y[12345] = 9.0
    keep = scatter(y)
    assert keep.size <= 1.1 * MOST_DOTS
    assert 12345 in keep
    assert np.mean(np.abs(y[keep]) < 0.6745) == pytest.approx(0.45, abs=0.06)


def test_thinned_band_keeps_both_of_its_edges() -> None:
    """Oracle: definition; a spike of either edge survives, with the texts of its row."""
    x = np.arange(20000.0)
    low, high = np.zeros(20000), np.ones(20000)
    low[7001], high[15002] = -5.0, 5.0
    layer = thin_layer(Layer("band", x, low, y2=high, texts=[str(int(k)) for k in x]))
    assert layer.y.min() == -5.0
    assert layer.y2 is not None
    assert layer.y2.max() == 5.0
    assert [float(text) for text in layer.texts] == layer.x.tolist()


def test_charts_are_there(diagnostics, eo) -> None:
    """Oracle: by hand; each has a reading in whole sentences, and layers with values."""
    shown = charts(diagnostics(), eo())
    assert [chart.name for chart in shown] == ALL
    for chart in shown:
        assert chart.reading.endswith(".")
        assert all(panel.layers for panel in chart.panels)
    assert {chart.link for chart in shown} == {"", "time", "image"}


def test_every_run_has_its_charts(odd_cases) -> None:
    """Oracle: by hand; what there is nothing to draw of is left out, the rest is there."""
    of_innovations = {"innovations", "innovation-distribution", "nis-distribution"}
    missing = {
        "no camera": {"image-sigmas"},
        "no fix": of_innovations,
        "separation undetermined": {"separation"},
    }
    for name in ("everything rejected", *missing):
        d, images = odd_cases[name]
        expected = [p for p in ALL if p not in missing.get(name, set())]
        assert [chart.name for chart in charts(d, images)] == expected, name


def _layer(shown: tuple[Chart, ...], chart: str, name: str) -> Layer:
    named = [
        layer
        for one in shown
        if one.name == chart
        for panel in one.panels
        for layer in panel.layers
        if layer.name == name
    ]
    return named[0]


def test_rejected_fixes_and_images_are_never_thinned_away(diagnostics, eo) -> None:
    """Oracle: counts; of 60 000 fixes all 5 000 rejected ones are drawn, the used ones are not."""
    n = 60000
    used = np.arange(n) % 12 != 0
    rng = np.random.default_rng(3)
    changes = {
        "fix_time": START + np.linspace(0.0, 119.0, n),
        "innovation": 0.02 * rng.standard_normal((n, 3)),
        "innovation_sigma": np.full((n, 3), 0.02),
        "nis": rng.chisquare(3, n),
        "used": used,
    }
    shown = charts(diagnostics(**changes), eo())
    assert _layer(shown, "innovations", "rejected").x.size == 5000
    assert _layer(shown, "innovations", "fix").x.size < 4000
    assert _layer(shown, "map", "rejected fix").x.size == 5000
    assert _layer(shown, "map", "image").x.size == 30


def test_marks_are_where_they_belong(block) -> None:
    """Oracle: by hand; minutes from the start of lines, of a rest that began before, of fixes
    lacking from 30 to 50 s, of two parts.
    """
    d = block()
    used = (d.fix_time <= START + 30) | (d.fix_time >= START + 50)
    parts = ((START, START + 60.0), (START + 90.0, START + 119.9))
    marks = marks_of(
        block(used=used, stationary=np.array([[START - 9, START + 6]]), segments=parts), None
    )
    assert 60 * marks.stationary == pytest.approx(np.array([[0.0, 6.0]]), abs=1e-6)
    assert 60 * marks.outages == pytest.approx(np.array([[30.0, 50.0]]), abs=1e-6)
    assert 60 * marks.nothing == pytest.approx(np.array([[60.0, 90.0]]), abs=1e-6)
    assert len(marks.lines) == 4
    assert [shade.text for shade in marks.shades if shade.kind == "line"] == ["1", "2", "3", "4"]
    broken = marks.broken(np.array([0.1, 0.9, 1.6, 1.7]), np.ones(4))
    assert np.isnan(broken).tolist() == [False, False, True, False]


def test_all_charts_over_time_are_shaded_alike(diagnostics) -> None:
    """Oracle: by hand; a rest and an outage where they were asked for, and only then."""
    d = diagnostics()
    used = (d.fix_time <= START + 60) | (d.fix_time >= START + 110)
    marked = charts(diagnostics(used=used, stationary=np.array([[START, START + 30]])), None)
    for plain, shaded in zip(charts(d, None), marked, strict=True):
        if plain.link != "time" or plain.map:
            continue
        assert {shade.kind for shade in plain.shades} <= {"line"}, plain.name
        assert {"rest", "outage"} <= {shade.kind for shade in shaded.shades}, plain.name
