"""Pictures of a PPK solution: every row drawn where there is something, none where there is not."""

import io

import numpy as np
import pytest
from matplotlib.image import imread

from insgnss.gnss.quality.covariance import CLASSES, VALIDATED
from insgnss.report.figures import gnss
from insgnss.report.figures.gnss import draw_quality, pictures


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


def test_all_rows_are_drawn(series):
    """Oracle: number of axes, and a PNG that an image reader takes."""
    figure = gnss._draw(series, [*gnss._solution_panels(series), *gnss._signal_panels(series)])
    labels = [ax.get_ylabel() for ax in figure.axes]
    for word in ("satellites", "fixed", "ratio", "backward", "km", "above base", "dB-Hz", "slips"):
        assert any(word in label for label in labels), word
    image = imread(io.BytesIO(draw_quality(series)))
    assert image.shape[1] == 1000
    assert image[..., :3].std() > 0.05


def test_the_separation_is_drawn_where_it_is(series):
    """Oracle: the planted 0.2 m on the north line, in mm."""
    figure = gnss._draw(series, gnss._solution_panels(series))
    ax = next(ax for ax in figure.axes if "backward" in ax.get_ylabel())
    north = next(line for line in ax.lines if line.get_label() == "north")
    x, y = north.get_data()
    assert y.max() == pytest.approx(200.0, rel=1e-6)
    assert 1.0 <= x[np.argmax(y)] <= 1.07


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
    drawn = pictures(series)
    assert [picture.name for picture in drawn] == ["gnss_solution"]
    assert "run backward" not in drawn[0].reading


def test_every_class_has_a_name_and_a_colour():
    """Oracle: the classes of the covariance."""
    assert len(gnss.NAMES) == len(gnss.COLOURS) == len(CLASSES)
    assert gnss.VALIDATED == VALIDATED


def test_degraded_fixes_are_drawn_apart_and_count_as_fixed(series):
    """Oracle: the first 200 epochs named so; the share of confirmed fixes stays at 100 %."""
    series["kind"] = np.where(
        np.arange(600) < 200, CLASSES.index("degraded"), CLASSES.index("fixed")
    )
    figure = gnss._draw(series, gnss._solution_panels(series))
    axes = {ax.get_ylabel(): ax for ax in figure.axes}
    assert {"fixed", "fixed, degraded"} <= {drawn.get_label() for drawn in axes["satellites"].lines}
    assert axes["fixed, %"].lines[0].get_ydata().min() == 100.0


@pytest.mark.slow
def test_times_without_epochs_break_nothing(series):
    """Oracle: no warning, where all separations are unknown and no slip was found."""
    series |= {
        "separation_m": np.full((600, 3), np.nan),
        "separation_sigma_m": np.full((600, 3), np.nan),
        "slip_time": np.zeros(0),
    }
    series |= {"slip_satellite": []}
    assert [picture.name for picture in pictures(series)] == ["gnss_solution", "gnss_signals"]
