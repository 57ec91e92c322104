"""Charts of a PPK solution: every row drawn where there is something, none where there is not."""

import dataclasses
import io

import numpy as np
import pytest
from matplotlib.image import imread

from insgnss.navigation.prepare.fix_covariance.classes import VALIDATED
from insgnss.navigation.prepare.fix_covariance.numbers import FIX_CLASSES
from insgnss.records import GnssFixes
from insgnss.report.charts import gnss
from insgnss.report.charts.drawn import draw_sheet
from insgnss.report.charts.gnss import charts, fix_series


@pytest.fixture
def series():
    """Two minutes at 5 Hz: fixed, then float, a contradiction of 0.2 m, a gap, slips."""
    n = 600
    time = 1000.0 + 0.2 * np.arange(n)
    kind = np.where(np.arange(n) < 500, 0, 1)
    apart = np.zeros((n, 3))
    apart[300:320, 0] = 0.2
    return {
        "time": time,
        "kind": kind,
        "satellites": np.where(kind == 0, 15, 8),
        "ratio": np.where(kind == 0, 40.0, 1.1),
        "distance_m": np.linspace(1000.0, 2500.0, n),
        "height_difference_m": np.linspace(0.0, 100.0, n),
        "separation_m": apart,
        "separation_sigma_m": np.full((n, 3), 0.01),
        "cn0_time": np.arange(1000.0, 1120.0),
        "cn0": {"band 1": np.full(120, 45.0), "band 2": np.full(120, 39.0)},
        "slip_time": np.array([1010.0, 1010.0, 1090.0]),
        "slip_satellite": ["G05", "R11", "G05"],
        "gaps": np.array([[1060.0, 1063.0]]),
    }


def test_all_rows_are_there(series):
    """Oracle: labels of the panels, and a PNG that an image reader takes."""
    labels = [panel.label for chart in charts(series) for panel in chart.panels]
    for word in ("satellites", "fixed", "ratio", "backward", "km", "above", "dB-Hz", "satellite"):
        assert any(word in label for label in labels), word
    image = imread(io.BytesIO(draw_sheet([list(charts(series))])))
    assert image.shape[1] == 1000
    assert image[..., :3].std() > 0.05


def _panel(series, word):
    return next(p for chart in charts(series) for p in chart.panels if word in p.label)


def test_the_separation_is_drawn_where_it_is(series):
    """Oracle: the planted 0.2 m on the north line, in mm."""
    north = next(layer for layer in _panel(series, "backward").layers if layer.name == "north")
    assert north.y.max() == pytest.approx(200.0, rel=1e-6)
    assert 1.0 <= north.x[np.argmax(north.y)] <= 1.07


def test_unknown_things_have_no_row(series):
    """Oracle: a ready solution without observations and without a second run."""
    for name in (
        "separation_m",
        "separation_sigma_m",
        "cn0",
        "cn0_time",
        "slip_time",
        "slip_satellite",
        "gaps",
    ):
        series.pop(name)
    drawn = list(charts(series))
    assert [chart.name for chart in drawn] == ["gnss-solution"]
    assert "run backward" not in drawn[0].reading


def test_a_file_of_fixes_says_what_its_columns_hold():
    """Oracle: RTKLIB's codes; 1 fixed, 2 float, 5 single, 9 unknown to us counts as single. What
    the file does not hold has no panel, what one epoch does not know is left open.
    """
    fixes = GnssFixes.from_degrees(
        np.arange(10.0, 14.0),
        np.full(4, 46.0),
        np.full(4, 7.0),
        np.full(4, 500.0),
        sigma_m=(0.02, 0.02, 0.03),
        quality=[1, 2, 5, 0],
    )
    fixes = dataclasses.replace(
        fixes, satellites=np.array([12.0, 9.0, 5.0, np.nan]), pdop=np.array([1.5, 2.0, 4.0, 9.0])
    )
    series = fix_series(fixes)
    assert [gnss.CLASS_NAMES[k] for k in series["kind"]] == ["fixed", "float", "single", "single"]
    assert [panel.label for panel in next(charts(series)).panels] == [
        *("satellites", "fixed, %", "PDOP")
    ]
    assert fix_series(dataclasses.replace(fixes, quality=None, satellites=None, pdop=None)) == {}
    assert list(charts({})) == []
    assert fixes[1:3].satellites.tolist() == [9.0, 5.0]


def test_every_class_has_a_name_and_a_colour():
    """Oracle: the classes of the covariance."""
    assert len(gnss.CLASS_NAMES) == len(gnss.CLASS_INKS) == len(FIX_CLASSES)
    assert gnss.VALIDATED_CODES == VALIDATED


def test_degraded_fixes_are_drawn_apart_and_count_as_fixed(series):
    """Oracle: the first 200 epochs named so; the share of confirmed fixes stays at 100 %."""
    series["kind"] = np.where(
        np.arange(600) < 200, FIX_CLASSES.index("degraded"), FIX_CLASSES.index("fixed")
    )
    named = {layer.name for layer in _panel(series, "satellites").layers}
    assert {"fixed", "fixed, degraded"} <= named
    assert _panel(series, "fixed, %").layers[0].y.min() == 100.0


def test_times_without_epochs_break_nothing(series):
    """Oracle: no warning, where all separations are unknown and no slip was found."""
    series |= {
        "separation_m": np.full((600, 3), np.nan),
        "separation_sigma_m": np.full((600, 3), np.nan),
        "slip_time": np.zeros(0),
    }
    series |= {"slip_satellite": []}
    assert [chart.name for chart in charts(series)] == ["gnss-solution", "gnss-signals"]
