"""Pages of the other verbs in a real browser: charts of every kind are drawn, without complaint."""

from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import test_block_figure as block
import test_comparison_figure as comparison
import test_mounting_figure as mounting
import test_noise_figure as noise
import test_recognition_figure as recognition
from test_page_in_browser import PIXELS, browser  # noqa: F401

from insgnss.report.charts.chart import Chart
from insgnss.report.document import Document
from insgnss.report.figures.block import Field, charts
from insgnss.report.figures.comparison import comparison_charts
from insgnss.report.figures.mounting import scatter_panel
from insgnss.report.figures.noise import noise_chart, spectrum_charts
from insgnss.report.verdict import Verdict


def every_chart() -> Iterator[Chart]:
    """A chart of each kind that verbs show: log axes, columns, maps with arrows, labels, bars."""
    yield noise_chart("gyro", [noise.panel([noise.curve(noise.WHITE)])])
    yield from spectrum_charts([noise.spectrum("gyro", "x")])
    yield from comparison_charts(comparison.panels(remaining=True), (comparison.TIME,) * 2)
    yield from recognition.shown().values()
    yield scatter_panel(mounting.scatter(), "setup", "Lever arm of each setup")
    field = Field("cam", (4000, 3000), np.ones((9, 2)), np.ones((9, 2)), np.ones((9, 2)))
    names = {"motion", "map"}  # ids of a page differ
    yield from (c for c in charts(block.FIGURES, [field], block.GROUND) if c.name not in names)


@pytest.fixture(scope="module")
def page_file(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("verbs") / "verb.html"
    page = Document("all verbs", "3 of 3", Verdict("doubtful", "why not"), list(every_chart()))
    path.write_text("".join(page.html()))
    return path


@pytest.mark.slow
@pytest.mark.parametrize(("width", "scheme"), [(1200, "light"), (390, "dark")])
def test_every_chart_has_ink(browser: Any, page_file: Path, width: int, scheme: str) -> None:  # noqa: F811
    """Oracle: pixels of the canvases, messages of the browser, and its width of what is shown."""
    context = browser.new_context(viewport={"width": width, "height": 900}, color_scheme=scheme)
    complaints: list[str] = []
    page = context.new_page()
    page.on("console", lambda message: complaints.append(message.text))
    page.on("pageerror", lambda error: complaints.append(str(error)))
    page.goto(page_file.as_uri())
    for name in [chart.name for chart in every_chart()]:
        page.locator(f"figure#{name}").scroll_into_view_if_needed()
        canvas = page.locator(f"figure#{name} canvas").first
        canvas.wait_for()
        page.wait_for_timeout(100)
        drawn, coloured, white = canvas.evaluate(PIXELS)
        assert drawn > 1000, name
        assert coloured > 20, name
        assert scheme == "light" or white < 0.05 * drawn, name
    assert page.evaluate("document.scrollingElement.scrollWidth") <= width
    context.close()
    assert complaints == []
