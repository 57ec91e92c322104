"""Charts drawn with matplotlib: each kind of layer leaves its ink where its numbers say, and files
for papers are what journals take.
"""

import io
import re
from xml.etree import ElementTree

import numpy as np
import pytest
from PIL import Image

from insgnss.report.charts.artists import CHART_INKS, SHADES, value_range
from insgnss.report.charts.chart import Chart, Layer, Panel, Shade
from insgnss.report.charts.drawn import COLUMN, SCREEN, draw, draw_sheet, figure_of
from insgnss.report.charts.encoded import background_of

NONE = np.zeros(0)


def array(*values: float) -> np.ndarray:
    return np.array(values, dtype=float)


def chart(*layers: Layer, **options) -> Chart:
    """One panel from 0 to 10 both ways."""
    panel = Panel("height, m", layers, limits=(0.0, 10.0))
    return Chart(*("test", "A title", "How.", (panel,), "time, s"), limits=(0.0, 10.0), **options)


def colour(name: str) -> np.ndarray:
    return np.array([int(name[k : k + 2], 16) for k in (1, 3, 5)])


class Drawn:
    """A chart as pixels."""

    def __init__(self, of: Chart) -> None:
        self.pixels = np.asarray(Image.open(io.BytesIO(draw(of))).convert("RGB")).astype(int)
        self.axes = figure_of([[of]]).axes[0]

    def at(self, x: float, y: float) -> tuple[int, int]:
        """Row and column of a place in the axes."""
        column, up = self.axes.transData.transform((x, y))
        return len(self.pixels) - 1 - round(float(up)), round(float(column))

    def has(self, x: float, y: float, ink: str, reach: int = 2) -> bool:
        """Whether a pixel of that colour lies within `reach` of a place."""
        row, column = self.at(x, y)
        around = self.pixels[row - reach : row + reach + 1, column - reach : column + reach + 1]
        return bool((np.abs(around - colour(ink)).max(axis=2) < 40).any())

    def is_white(self, x: float, y: float) -> bool:
        row, column = self.at(x, y)
        return bool((self.pixels[row, column] == 255).all())


def test_a_line_runs_through_its_points_and_breaks_where_it_is_not_known() -> None:
    """Oracle: by hand; from (1, 1) to (4, 7), nothing until (6, 5), on to (9, 5)."""
    line = Layer(
        "line", array(1, 4, 5, 6, 9), array(1, 7, np.nan, 5, 5), "north", "second", width=3
    )
    drawn = Drawn(chart(line))
    ink = CHART_INKS["second"]
    for x, y in ((1.0, 1.0), (2.5, 4.0), (4.0, 7.0), (7.5, 5.0)):
        assert drawn.has(x, y, ink), (x, y)
    for x, y in ((5.0, 6.0), (2.5, 6.0), (5.5, 5.5)):
        assert not drawn.has(x, y, ink, 4), (x, y)


def test_the_ground_lies_below_a_map_within_its_edges() -> None:
    """Oracle: by hand; a quarter that is red, at 0.6 on white, north-east of (5, 5)."""
    quarters = np.full((64, 64, 3), 255, np.uint8)
    quarters[:32, 32:] = (255, 0, 0)
    below = background_of(quarters, (2.0, 2.0, 8.0, 8.0), "ground.tif")
    drawn = Drawn(chart(Layer("line", array(0, 10), array(0, 10)), map=True, background=below))
    drawn.axes.apply_aspect()
    for x, y, is_red in ((6.5, 7.0, True), (7.8, 5.2, True), (4.0, 7.0, False), (9.0, 7.0, False)):
        assert drawn.has(x, y, "#FF6666", 0) == is_red, (x, y)


@pytest.mark.parametrize("mark", ["dot", "cross", "ring", "square", "triangle"])
def test_points_lie_where_they_are(mark) -> None:
    """Oracle: by hand; a dot is full, a ring empty in the middle."""
    drawn = Drawn(chart(Layer("points", array(2, 7), array(3, 8), ink="third", mark=mark, width=9)))
    for x, y in ((2.0, 3.0), (7.0, 8.0)):
        assert drawn.has(x, y, CHART_INKS["third"], 9), (x, y)
    assert not drawn.has(4.5, 5.5, CHART_INKS["third"], 9)
    assert drawn.has(2.0, 3.0, CHART_INKS["third"], 1) == (mark in ("dot", "cross"))


def test_values_are_colours_with_a_bar() -> None:
    """Oracle: the ends of viridis, violet and yellow; a second pair of axes, with its words."""
    layer = Layer(
        "points",
        array(2, 5, 8),
        array(5, 5, 5),
        value=array(1, 2, 3),
        value_name="sigma, mm",
        width=9,
    )
    drawn = Drawn(chart(layer))
    assert drawn.has(2.0, 5.0, "#440154", 1)
    assert drawn.has(8.0, 5.0, "#fde725", 1)
    assert figure_of([[chart(layer)]]).axes[1].get_ylabel() == "sigma, mm"


def test_colours_end_before_an_outlier() -> None:
    """Oracle: by hand; of a hundred values to 1 and one of 50 colours end at twice the usual."""
    low, high = value_range(np.append(np.linspace(0.5, 1.0, 100), [50.0, np.nan]))
    assert low == 0.5
    assert 1.8 < high < 2.1
    assert value_range(array(2, 2))[1] > 2.0
    assert value_range(array(np.nan)) == (0.0, 1.0)


def test_a_band_is_shaded_between_its_edges() -> None:
    """Oracle: by hand; blue between 2 and 4, paper around, and where an edge is not known."""
    x = array(0, 4, 6, 10)
    drawn = Drawn(chart(Layer("band", x, array(2, 2, np.nan, 2), y2=array(4, 4, 4, 4))))
    row, column = drawn.at(2.0, 3.0)
    red, green, blue = drawn.pixels[row, column]
    assert red < green < blue
    for x, y in ((2.1, 5.1), (2.1, 1.1), (5.1, 3.1)):
        assert drawn.is_white(x, y), (x, y)


def test_steps_stand_over_their_edges() -> None:
    """Oracle: by hand; bars of height 4 and 8 over 1 to 3 and 3 to 6."""
    drawn = Drawn(chart(Layer("steps", array(1, 3, 6), array(4, 8), width=3)))
    for x, y, inside in ((2.1, 3.1, True), (2.1, 5.1, False), (4.6, 7.1, True), (6.6, 3.1, False)):
        assert drawn.is_white(x, y) != inside, (x, y)
    assert drawn.has(4.5, 8.0, CHART_INKS["first"])


def test_arrows_go_from_tail_to_head() -> None:
    """Oracle: by hand; from (2, 2) to (6, 4), the head wider than the shaft."""
    one = Layer("arrows", array(2), array(2), ink="warn", x2=array(6), y2=array(4), width=3)
    drawn = Drawn(chart(one))
    for x, y in ((2.2, 2.1), (4.0, 3.0), (5.8, 3.9)):
        assert drawn.has(x, y, CHART_INKS["warn"]), (x, y)
    assert not drawn.has(7.0, 4.5, CHART_INKS["warn"], 4)


def test_rules_run_across() -> None:
    """Oracle: by hand; at the values of y, and of x where there is no y."""
    level = Drawn(chart(Layer("rules", NONE, array(3), ink="warn", width=3)))
    upright = Drawn(chart(Layer("rules", array(3), NONE, ink="warn", width=3)))
    for along in (1.0, 5.0, 9.0):
        assert level.has(along, 3.0, CHART_INKS["warn"])
        assert upright.has(3.0, along, CHART_INKS["warn"])
    assert not level.has(5.0, 6.0, CHART_INKS["warn"])
    assert not upright.has(6.0, 5.0, CHART_INKS["warn"])


def test_labels_stand_at_their_places() -> None:
    """Oracle: by hand; letters of the ink at the place, none elsewhere, odd characters too."""
    words = Layer(
        "labels", array(3, 7), array(5, 5), ink="warn", texts=["G$1$", r"\frac{"], width=18
    )
    drawn = Drawn(chart(words))
    assert drawn.has(3.0, 5.0, CHART_INKS["warn"], 10)
    assert drawn.has(7.0, 5.0, CHART_INKS["warn"], 10)
    assert not drawn.has(5.0, 5.0, CHART_INKS["warn"], 10)


def test_shades_lie_behind_with_their_numbers() -> None:
    """Oracle: by hand; the shade from 2 to 4, its number at the top, its kind in the legend."""
    line = Layer("line", array(0, 10), array(5, 5), width=3)
    shades = (Shade(2.0, 4.0, "line", "17"), Shade(7.0, 8.0, "outage"))
    of = chart(line, shades=shades)
    drawn = Drawn(of)
    assert drawn.has(3.1, 2.1, SHADES["line"], 0)
    assert drawn.has(7.5, 2.1, SHADES["outage"], 0)
    assert drawn.has(3.1, 5.0, CHART_INKS["first"])
    assert drawn.is_white(5.1, 2.1)
    ax = figure_of([[of]]).axes[0]
    assert "17" in [text.get_text() for text in ax.texts]
    legend = [text.get_text() for text in ax.get_legend().get_texts()]
    assert legend == ["flight line", "no used fix"]


def test_a_map_has_one_scale() -> None:
    """Oracle: by hand; 100 m are as long upwards as to the right, whatever the data span."""
    for x, y in ((array(0, 1000), array(0, 300)), (array(0, 50), array(0, 900))):
        of = Chart("map", "", "", (Panel("north, m", (Layer("line", x, y),)),), "east, m", map=True)
        ax = figure_of([[of]]).axes[0]
        ax.apply_aspect()
        a, b, c = ax.transData.transform([(0, 0), (100, 0), (0, 100)])
        assert b[0] - a[0] == pytest.approx(c[1] - a[1], rel=1e-9)
        (low, high), (down, up) = ax.get_xlim(), ax.get_ylim()
        assert low <= x.min() < x.max() <= high
        assert down <= y.min() < y.max() <= up


def test_logarithmic_axes_have_plain_numbers() -> None:
    """Oracle: by hand; decades as one writes them, at their places."""
    x = np.logspace(-2, 3, 50)
    panel = Panel("deviation", (Layer("line", x, x),), "log")
    figure = figure_of([[Chart("log", "", "", (panel,), "tau, s", "log")]])
    figure.canvas.draw()
    (ax,) = figure.axes
    low, high = ax.get_xlim()
    shown = [text for text in ax.get_xticklabels() if low <= text.get_position()[0] <= high]
    assert {"0.01", "1", "100"} <= {text.get_text() for text in shown}
    assert all(float(text.get_text()) == pytest.approx(text.get_position()[0]) for text in shown)


def three(columns: int) -> Chart:
    x = np.linspace(0, 1, 20)
    panels = [Panel(f"panel {k}, mm", (Layer("line", x, x**k, "same"),)) for k in range(3)]
    return Chart("three", "Three", "How.", panels, "time, s", columns=columns)


def test_panels_stand_below_or_beside_each_other() -> None:
    """Oracle: by hand; in a column over one axis, or row by row, fewer a row on narrow paper."""
    boxes = [ax.get_position() for ax in figure_of([[three(1)]]).axes]
    assert len({round(box.x0, 6) for box in boxes}) == 1
    assert boxes[0].y0 > boxes[1].y1
    beside = [ax.get_position() for ax in figure_of([[three(3)]]).axes]
    assert len({round(box.y0, 6) for box in beside}) == 1
    narrow = [ax.get_position() for ax in figure_of([[three(3)]], paper=COLUMN).axes]
    assert len({round(box.x0, 6) for box in narrow}) == 2


def test_a_name_that_panels_share_stands_in_one_legend() -> None:
    """Oracle: by hand; the same layers below each other are named once."""
    legends = [ax.get_legend() for ax in figure_of([[three(1)]]).axes]
    assert [text.get_text() for text in legends[0].get_texts()] == ["same"]
    assert legends[1:] == [None, None]


def test_several_charts_share_a_sheet() -> None:
    """Oracle: Pillow; as wide as was asked for, as high as the higher column, with both titles."""
    columns = [[three(1)], [chart(), chart()]]
    image = Image.open(io.BytesIO(draw_sheet(columns, "A sheet", "of charts")))
    assert image.width == 1000
    texts = [text.get_text() for text in figure_of(columns, "A sheet", "of charts").texts]
    assert {"A sheet", "of charts", "Three", "A title"} <= set(texts)
    assert Image.open(io.BytesIO(draw_sheet([], "Nothing"))).width == 1000


def test_pdf_is_one_page_as_wide_as_a_column_with_its_letters_embedded() -> None:
    """Oracle: the PDF's own words: one page, 84 mm in points, TrueType fonts with their outlines
    (Type 42), none of Type 3, which journals refuse; the same bytes again.
    """
    pdf = draw(three(1), "pdf", COLUMN)
    assert pdf.startswith(b"%PDF")
    assert len(re.findall(rb"/Type /Page\b", pdf)) == 1
    (width,) = re.findall(rb"/MediaBox \[ 0 0 ([\d.]+) [\d.]+ \]", pdf)
    assert float(width) == pytest.approx(84.0 / 25.4 * 72.0, abs=0.01)
    assert b"/FontFile2" in pdf
    assert b"/Type3" not in pdf
    assert b"/CIDFontType2" in pdf or b"/Subtype /TrueType" in pdf
    assert draw(three(1), "pdf", COLUMN) == pdf


def test_svg_keeps_its_texts() -> None:
    """Oracle: the XML; labels are texts that one can edit, the width is the column's."""
    svg = draw(three(1), "svg", COLUMN)
    root = ElementTree.fromstring(svg)
    texts = {"".join(e.itertext()) for e in root.iter() if e.tag.endswith("}text")}
    assert {"panel 0, mm", "time, s", "same"} <= texts
    assert float(root.get("width").removesuffix("pt")) == pytest.approx(238.11, abs=0.01)
    assert draw(three(1), "svg", COLUMN) == svg


def test_png_has_three_hundred_pixels_to_the_inch() -> None:
    """Oracle: Pillow; 84 mm at 300 pixels to the inch, and the screen's 1000 pixels."""
    assert Image.open(io.BytesIO(draw(three(1), "png", COLUMN))).width == pytest.approx(992, abs=1)
    assert Image.open(io.BytesIO(draw(three(1), "png", SCREEN))).width == 1000
