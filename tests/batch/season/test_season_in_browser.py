"""The page of a season in a real browser: charts are drawn, links lead to reports, no complaint."""

import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from seasons import row

sys.path.append(str(Path(__file__).parents[2] / "report"))
from test_page_in_browser import PIXELS, browser  # noqa: F401

from insgnss.batch.season.page import charts, page_html, season_document
from insgnss.batch.season.trends import trends
from insgnss.batch.season.work import Task, failed_outcome


@pytest.mark.slow
@pytest.mark.parametrize(("width", "scheme"), [(1200, "light"), (390, "dark")])
def test_it_is_drawn_and_linked(
    browser: Any,  # noqa: F811
    tmp_path: Path,
    width: int,
    scheme: str,
) -> None:
    """Oracle: pixels of the canvases, messages of the browser, a click that opens a report."""
    rng = np.random.default_rng(1)
    rows = [row(k, rng) for k in range(20)]
    for k, one in enumerate(rows):
        one["lever_arm_forward_m"] += 1e-3 * k
    rows[3] = failed_outcome(Task("f003", "f003/flight.toml"), "</script><b>gap", 3, 0.1).row
    judged = trends(rows)
    (tmp_path / "index.html").write_text(
        "".join(page_html(season_document(rows, judged, "20 flights")))
    )
    report = tmp_path / "f011" / "out" / "report.html"
    report.parent.mkdir(parents=True)
    report.write_text("<title>the report of f011</title>")
    context = browser.new_context(viewport={"width": width, "height": 900}, color_scheme=scheme)
    complaints: list[str] = []
    page = context.new_page()
    page.on("console", lambda message: complaints.append(message.text))
    page.on("pageerror", lambda error: complaints.append(str(error)))
    page.goto((tmp_path / "index.html").as_uri())
    for chart in charts(rows, judged):
        page.locator(f"figure#{chart.name}").scroll_into_view_if_needed()
        canvas = page.locator(f"figure#{chart.name} canvas").first
        canvas.wait_for()
        page.wait_for_timeout(100)
        assert canvas.evaluate(PIXELS)[0] > 1000, chart.name
    assert page.evaluate("document.documentElement.scrollWidth") <= width
    assert page.locator("h2").first.inner_text() == "Failed flights"
    assert "drifts by" in page.locator("main").inner_text()
    page.get_by_role("link", name="f011").first.click()
    assert page.title() == "the report of f011"
    assert complaints == []
    context.close()
