"""The charts of an image block: what lies where, and residuals enlarged alike."""

import numpy as np
import pytest

from insgnss.report.figures.block import SHARE, Field, Ground, charts, precision_map

RNG = np.random.default_rng(5)
PLACE = np.column_stack(
    [np.repeat([0.0, 100.0], 5), np.tile(np.arange(5) * 50.0, 2), np.full(10, 80)]
)
POINTS = np.column_stack([RNG.uniform(-20, 120, 400), RNG.uniform(-20, 220, 400), np.zeros(400)])
GROUND = Ground(
    PLACE,
    np.vstack([POINTS, [9e5, 9e5, 0.0]]),
    np.vstack([np.full((400, 3), 0.03), [9.0, 9.0, 9.0]]),
    (np.arange(5), np.arange(5, 10)),
)


def point(name, x, y, off, key):
    return {"point": name, "position_m": [x, y, 0.0], key: off}


FIGURES = {
    "images": [
        {
            "image": f"{k}.tif",
            "rms_px": None if k == 3 else 0.3 + 0.01 * k,
            "sigma_m": [0.001, 0.002, 0.003],
            "sigma_rad": [1e-5, 2e-5, 3e-5],
        }
        for k in range(10)
    ],
    "ground_control": [
        point("G1", 0.0, 0.0, [0.01, 0.0, -0.02], "residual_m"),
        point("G2", 100.0, 200.0, [0.0, 0.01, 0.0], "residual_m"),
    ],
    "check_points": [
        point("C1", 50.0, 100.0, [0.01, 0.01, 0.01], "difference_m"),
        {"point": "C2", "position_m": [0.0, 0.0, 0.0]},
    ],
    "cameras": [],
}


def named(chart, panel=0):
    return {layer.name: layer for layer in chart.panels[panel].layers if layer.name}


def test_the_map_shows_images_lines_and_surveyed_points():
    """Oracle: by hand; places and names, flight lines with numbers, no point on the horizon."""
    chart = charts(FIGURES, [], GROUND)[0]
    assert chart.map
    shown = named(chart)
    assert np.column_stack([shown["image"].x, shown["image"].y]) == pytest.approx(PLACE[:, :2])
    assert shown["image"].texts[4] == "4.tif"
    assert shown["ground control"].x.tolist() == [0.0, 100.0]
    assert shown["check point"].x.tolist() == [50.0]
    assert "-20.0 mm" in shown["ground control"].texts[0]
    layers = chart.panels[0].layers
    numbers = next(layer for layer in layers if layer.kind == "labels" and layer.texts[0] == "1")
    assert list(numbers.texts) == ["1", "2"]
    assert max(layer.x.max() for layer in layers) < 1e3


def test_residuals_are_enlarged_alike():
    """Oracle: arrows over residuals are one factor, which makes the usual arrow a share of the map;
    the height's runs upwards.
    """
    arrows = [
        layer for layer in charts(FIGURES, [], GROUND)[0].panels[0].layers if layer.kind == "arrows"
    ]
    control, height, check, _ = arrows
    east, north = control.x2 - control.x, control.y2 - control.y
    factor = east[0] / 0.01
    assert [east[1], north[0], north[1]] == pytest.approx([0.0, 0.0, 0.01 * factor])
    assert (height.y2 - height.y)[0] == pytest.approx(-0.02 * factor)
    assert (height.x2 == height.x).all()
    assert (check.x2 - check.x)[0] == pytest.approx(0.01 * factor)
    usual = np.quantile([np.sqrt(5e-4), 0.01, np.sqrt(3e-4)], 0.9)
    assert factor * usual == pytest.approx(SHARE * (1.5 * 200.0 + 40.0), rel=1e-6)


def test_images_one_by_one():
    """Oracle: the figures of the document, in px, mm and mdeg; an image without observations is
    not known.
    """
    chart = charts(FIGURES, [], GROUND)[-1]
    assert chart.link == "image"
    rms, sigma, angle = (panel.layers for panel in chart.panels)
    assert np.isnan(rms[0].y[3])
    assert rms[0].y[9] == pytest.approx(0.39)
    assert [layer.y[0] for layer in sigma] == pytest.approx([1.0, 2.0, 3.0])
    assert [layer.y[0] for layer in angle] == pytest.approx(np.degrees([0.01, 0.02, 0.03]))
    assert [layer.texts[2] for layer in sigma] == ["2.tif"] * 3


def test_residuals_on_the_format_stand_as_the_image_does():
    """Oracle: by hand; a residual to the right and down in the image goes right and down here, from
    a cell at its upper left.
    """
    centre, mean = np.array([[100.0, 50.0]]), np.array([[0.2, 0.1]])
    field = Field("cam $1$", (4000, 3000), centre, mean, np.full((1, 2), 0.05))
    chart = charts(FIGURES, [field], GROUND)[2]
    assert chart.name == "format-cam--1-"
    arrow = named(chart)["mean residual"]
    assert (arrow.x[0], arrow.y[0]) == (100.0, 2950.0)
    right, up = arrow.x2[0] - 100.0, arrow.y2[0] - 2950.0
    assert right > 0.0 > up
    assert right == pytest.approx(-2.0 * up)
    circle = named(chart)["by chance"]
    radius = 0.5 * np.ptp(circle.x)
    assert radius / right == pytest.approx(np.hypot(0.05, 0.05) / 0.2, rel=1e-3)


def test_precision_is_coloured_and_a_proposal_marked():
    """Oracle: sigmas in mm; the place that was proposed."""
    chart = precision_map(FIGURES, GROUND, np.array([10.0, 20.0]))
    dots = chart.panels[0].layers[0]
    assert dots.value == pytest.approx(30.0)
    assert dots.x.size == 400
    where = named(chart)["one more would help here"]
    assert (where.x.tolist(), where.y.tolist()) == ([10.0], [20.0])
    assert "one more would help here" not in named(precision_map(FIGURES, GROUND))
