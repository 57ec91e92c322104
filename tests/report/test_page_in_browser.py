"""The page in a real browser: drawn, zoomed, pointed at, searched, dark, narrow, printed.

Chromium is looked for where systems install it, and driven by playwright's Python package; without
either the tests are skipped and say so.
"""

import dataclasses
import datetime as dt
import io
import shutil
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from insgnss.base.units import time_zone
from insgnss.records import ExteriorOrientation, GnssFixes
from insgnss.records.series import ConstantSeries
from insgnss.records.states import OF_LEVER_ARM, TIME_OFFSET
from insgnss.report.charts.encoded import background_of
from insgnss.report.charts.gnss import fix_series
from insgnss.report.page import write_report
from insgnss.report.printed import print_page

START = 205200.0
BROWSERS = ("chromium", "chromium-browser", "google-chrome", "google-chrome-stable")
ARGUMENTS = [
    *("--no-sandbox", "--disable-gpu", "--disable-background-networking"),
    *("--disable-component-update", "--disable-sync", "--no-first-run"),
    "--disable-smooth-scrolling",  # a scroll that goes on moves the page under the pointer
]
EVIL = "</script><b>&.jpg"
CHARTS = {
    *("map", "motion", "sigmas", "image-sigmas", "innovations", "innovation-distribution"),
    *("nis-distribution", "biases", "constants", "separation", "gnss-solution"),
}

# of a canvas: pixels that are drawn, that have a colour, that are white
PIXELS = """canvas => {
  const { width, height } = canvas;
  if (!width || !height) return [0, 0, 0];
  const copy = new OffscreenCanvas(width, height).getContext("2d", { willReadFrequently: true });
  copy.drawImage(canvas, 0, 0);
  const { data } = copy.getImageData(0, 0, width, height);
  let drawn = 0, coloured = 0, white = 0;
  for (let i = 0; i < data.length; i += 4) {
    if (data[i + 3] < 128) continue;
    drawn++;
    const rgb = data.subarray(i, i + 3), low = Math.min(...rgb), high = Math.max(...rgb);
    coloured += high - low > 60;
    white += low > 240;
  }
  return [drawn, coloured, white];
}"""
MAP = "insgnssReport.shown.find(view => view.chart.map)"
PANEL = "insgnssReport.shown.find(view => view.chart.name === '{}').panels[0]"


@pytest.fixture(scope="module")
def browser() -> Iterator[Any]:
    """A headless Chromium."""
    playwright = pytest.importorskip("playwright.sync_api", reason="playwright is not installed")
    found = next((path for name in BROWSERS if (path := shutil.which(name))), None)
    if found is None:
        pytest.skip(f"no browser: none of {', '.join(BROWSERS)} is on the path")
    with playwright.sync_playwright() as started:
        opened = started.chromium.launch(executable_path=found, args=ARGUMENTS)
        yield opened
        opened.close()


@pytest.fixture(scope="module")
def orientation(eo) -> ExteriorOrientation:
    """The images of the page; the third has a name that is no good HTML."""
    plain = eo()
    return dataclasses.replace(plain, images=(*plain.images[:2], EVIL, *plain.images[3:]))


@pytest.fixture(scope="module")
def page_file(tmp_path_factory, diagnostics, summary, orientation) -> Path:
    """A page of a run with rejected fixes, an outage, constants and all that a `.pos` says."""
    plain = diagnostics()
    n, time = plain.time.size, plain.fix_time
    used = (np.arange(n) % 40 != 0) & ((time < START + 50.0) | (time > START + 62.0))
    constants = ConstantSeries(
        (*OF_LEVER_ARM[:2], TIME_OFFSET),
        np.tile([0.01, -0.02, 0.001], (n, 1)),
        np.full((n, 3), 0.002),
        np.geomspace(0.3, 0.002, n)[:, None] * np.ones(3),
    )
    d = diagnostics(used=used, constants=constants)
    fixes = GnssFixes.from_degrees(
        *(time, np.full(n, 46.0), np.full(n, 7.0), np.full(n, 500.0)),
        sigma_m=(0.02, 0.02, 0.03),
        quality=np.where(np.arange(n) % 300 < 200, 1, 2),
    )
    fixes = dataclasses.replace(
        fixes, satellites=np.full(n, 12.0), ratio=np.full(n, 9.0), pdop=np.full(n, 1.8)
    )
    directory = tmp_path_factory.mktemp("page")
    return write_report(directory, summary(d, orientation), d, orientation, fix_series(fixes))


Opened = Callable[..., Any]


@pytest.fixture
def opened(browser: Any, page_file: Path) -> Iterator[Opened]:
    """Open the page; at the end it must have asked for nothing and complained of nothing."""
    contexts, complaints = [], []

    def open_(width: int = 1200, **options: Any) -> Any:
        context = browser.new_context(viewport={"width": width, "height": 900}, **options)
        contexts.append(context)
        page = context.new_page()
        page.set_default_timeout(10000.0)
        page.on("console", lambda message: complaints.append(message.text))
        page.on("pageerror", lambda error: complaints.append(str(error)))
        page.on("request", lambda request: complaints.append(request.url))
        page.goto(page_file.as_uri())
        assert complaints == [page_file.as_uri()]
        complaints.clear()
        return page

    yield open_
    for context in contexts:
        context.close()
    assert complaints == []


def _seen(page: Any) -> None:
    """Scroll to every figure, as a reader does."""
    for figure in page.query_selector_all("figure"):
        figure.scroll_into_view_if_needed()
        page.wait_for_function("figure => figure.querySelector('canvas')", arg=figure)
    page.wait_for_timeout(50)


def _centre(page: Any, chart: str, across: float, down: float = 0.5) -> tuple[float, float]:
    over = page.query_selector(f"#{chart} .u-over")
    over.scroll_into_view_if_needed()
    box = over.bounding_box()
    return box["x"] + across * box["width"], box["y"] + down * box["height"]


def _on_map(page: Any, image: int) -> tuple[float, float]:
    """Where an image of the map is on the screen."""
    canvas = page.query_selector("#map canvas")
    page.evaluate("document.getElementById('map').scrollIntoView()")
    box = canvas.bounding_box()
    x, y = page.evaluate(f"(v => [v.X(v.shots.x[{image}]), v.Y(v.shots.y[{image}])])({MAP})")
    return box["x"] + x, box["y"] + y


@pytest.mark.slow
def test_every_chart_is_drawn_and_nothing_is_asked_of_anyone(opened: Opened) -> None:
    """Oracle: pixels; each canvas has ink and colour. Requests and complaints are the fixture's."""
    page = opened()
    assert page.evaluate("insgnssReport.shown.filter(view => view.panels || view.frame).length") < 5
    _seen(page)
    assert {figure.get_attribute("id") for figure in page.query_selector_all("figure")} == CHARTS
    for figure in page.query_selector_all("figure"):
        canvases = figure.query_selector_all("canvas")
        assert canvases
        for canvas in canvases:
            drawn, coloured, _ = canvas.evaluate(PIXELS)
            assert drawn > 500, figure.get_attribute("id")
            assert coloured > 20, figure.get_attribute("id")


@pytest.mark.slow
def test_the_ground_moves_with_the_map(
    browser, diagnostics, summary, orientation, tmp_path
) -> None:
    """Oracle: by hand; a red square of 80 m about a place, its corner 40 m away at each zoom."""
    below = background_of(np.full((8, 8, 3), (255, 0, 0), np.uint8), (-40, -40, 40, 40), "g.tif")
    d = diagnostics()
    file = write_report(tmp_path, summary(d, orientation), d, orientation, background=below)
    page = browser.new_page()
    asked: list[str] = []
    page.on("request", lambda request: asked.append(request.url))
    page.goto(file.as_uri())
    page.evaluate("document.getElementById('map').scrollIntoView()")
    page.wait_for_function(f"{MAP}.ground?.complete")
    colour = f"""([x, y]) => {{ const v = {MAP}, s = v.ratio; v.layers.length = 0; v.paint();
        return [...v.canvas.getContext("2d").getImageData(v.X(x) * s, v.Y(y) * s, 1, 1).data]; }}"""
    for zoom in (1.0, 1.6):
        page.evaluate(f"{MAP}.middle = [0, 0]; {MAP}.zoom({zoom})")
        for x, y, is_red in ((36, 33, True), (-33, -36, True), (43, 33, False), (33, -44, False)):
            red, green, *_ = page.evaluate(colour, [x, y])
            assert (red - green > 100) == is_red, (zoom, x, y)
    page.close()
    assert asked == [file.as_uri()]


@pytest.mark.slow
@pytest.mark.parametrize("zone", ["UTC", "America/St_Johns", "+13:45"])
def test_every_image_has_its_clock_time_beside_its_tow(
    browser, diagnostics, summary, orientation, tmp_path, zone: str
) -> None:
    """Oracle: datetime and zoneinfo; images across a midnight, 18 leap seconds behind GPST."""
    time = 345600.0 + 18.0 - 100.0 + np.sort(np.random.default_rng(8).uniform(0.0, 200.0, 30))
    images = dataclasses.replace(orientation, time=time)
    s = summary(diagnostics(), images)
    s["flight"]["output"] = {"time_zone": zone}
    page = browser.new_page()
    page.goto(write_report(tmp_path, s, diagnostics(), images).as_uri())
    page.evaluate("document.getElementById('image-table').scrollIntoView()")
    head = page.locator("#image-table th").all_inner_texts()
    rows = [
        row.locator("td").all_inner_texts()
        for row in page.locator("#image-table tr[data-image]").all()
    ]
    page.close()
    at, utc = head.index("TOW, s"), dt.datetime(1980, 1, 6, tzinfo=dt.UTC)
    assert len(rows) > 10
    for row in rows:
        seconds = images.gps_week * 604800 + float(row[at]) - 18.0
        local = (utc + dt.timedelta(seconds=seconds)).astimezone(time_zone(zone))
        assert row[at - 1] == f"{local:%H:%M:%S}"
        assert head[at - 1] == f"{local:%Z}"


@pytest.mark.slow
def test_a_drag_zooms_all_charts_over_time_and_a_double_click_returns(opened: Opened) -> None:
    """Oracle: by hand; the middle half of two minutes, in a chart that was not touched too."""
    page = opened()
    _seen(page)
    whole = page.evaluate(f"{PANEL.format('sigmas')}.plot.scales.x.max")
    page.mouse.move(*_centre(page, "motion", 0.25))
    page.mouse.down()
    page.mouse.move(*_centre(page, "motion", 0.5), steps=4)
    page.mouse.move(*_centre(page, "motion", 0.75), steps=4)
    page.mouse.up()
    for chart in ("motion", "sigmas", "innovations", "biases"):
        low, high = page.evaluate(f"(s => [s.min, s.max])({PANEL.format(chart)}.plot.scales.x)")
        assert low == pytest.approx(0.25 * whole, abs=0.02 * whole), chart
        assert high == pytest.approx(0.75 * whole, abs=0.02 * whole), chart
    assert page.evaluate(f"{PANEL.format('image-sigmas')}.plot.scales.x.max") > 30.0
    page.mouse.dblclick(*_centre(page, "sigmas", 0.5))
    assert page.evaluate(f"{PANEL.format('motion')}.plot.scales.x.max") == pytest.approx(whole)


@pytest.mark.slow
def test_pointing_at_the_map_shows_the_image_and_its_instant(
    opened: Opened, orientation: ExteriorOrientation
) -> None:
    """Oracle: the exterior orientation; places on the map are an equal-scale picture of its
    positions, the tip names the image that lies there and the charts stand at its time.
    """
    page = opened()
    _seen(page)
    image = 2
    page.mouse.move(*_on_map(page, image))
    tip = page.query_selector("#map .tip").inner_text()
    assert tip.startswith(EVIL)
    assert f"{orientation.time[image]:.3f} s" in tip
    assert "sigma E: 2.0 mm" in tip
    minute = page.evaluate(
        f"(p => p.plot.posToVal(p.plot.cursor.left, 'x'))({PANEL.format('motion')})"
    )
    assert 60.0 * minute == pytest.approx(orientation.time[image] - START, abs=0.3)
    assert EVIL in page.query_selector("tr.here").inner_text()
    east, north = orientation.position_m[:, :2].T
    x = np.array(page.evaluate(f"Array.from({MAP}.shots.x, e => {MAP}.X(e))"))
    y = np.array(page.evaluate(f"Array.from({MAP}.shots.y, n => {MAP}.Y(n))"))
    (scale, left), (down, top) = np.polyfit(east, x, 1), np.polyfit(north, y, 1)
    assert scale == pytest.approx(-down, rel=1e-3)
    np.testing.assert_allclose(left + scale * east, x, atol=0.5)
    np.testing.assert_allclose(top + down * north, y, atol=0.5)


@pytest.mark.slow
def test_pointing_at_a_chart_shows_the_image_on_the_map(opened: Opened) -> None:
    """Oracle: by hand; at the instant of the 11th image."""
    page = opened()
    _seen(page)
    minute = page.evaluate("insgnssReport.images.minutes[10]")
    across = page.evaluate(
        f"(p => p.plot.valToPos({minute}, 'x') / p.plot.over.clientWidth)({PANEL.format('motion')})"
    )
    page.mouse.move(*_centre(page, "motion", across))
    assert page.evaluate(f"{MAP}.image") == 10
    assert page.evaluate(f"{MAP}.instant.length") == 2


@pytest.mark.slow
def test_charts_come_back_after_a_window_of_one_pixel(opened: Opened) -> None:
    """Oracle: the width before. A browser that takes a long page as one picture makes the window
    one pixel wide for a moment.
    """
    page = opened()
    _seen(page)
    width = "document.querySelector('#motion .u-wrap').clientWidth"
    size, before = page.viewport_size, page.evaluate(width)
    assert before > 500
    page.set_viewport_size({"width": 1, "height": 1})
    page.wait_for_timeout(200)
    page.set_viewport_size(size)
    page.wait_for_function(f"() => {width} === {before}")


@pytest.mark.slow
def test_a_wheel_zooms_the_map_about_the_pointer(opened: Opened) -> None:
    """Oracle: definition; what is under the pointer stays there, as near as whole pixels of the
    pointer allow, the scale grows.
    """
    page = opened()
    before = page.evaluate(f"{MAP}.scale")
    page.mouse.move(*_on_map(page, 5))
    page.mouse.wheel(0, 60)
    page.wait_for_function("() => scrollY > 30")  # without the key, the page scrolls
    assert page.evaluate(f"{MAP}.scale") == before
    # The page may still be scrolling: the pointer is where the page heard the wheel.
    page.evaluate(
        "document.querySelector('#map canvas').addEventListener('wheel', event => {"
        f" const view = {MAP};"
        " window.wheel = [[event.offsetX, event.offsetY], [view.X(view.shots.x[5]),"
        " view.Y(view.shots.y[5])], view.scale];"
        "}, { capture: true })"
    )
    page.mouse.move(*_on_map(page, 5))
    page.keyboard.down("Control")
    page.mouse.wheel(0, -600)
    page.keyboard.up("Control")
    page.wait_for_function(f"() => {MAP}.scale > 2 * {before}")
    pointer, image, scale = page.evaluate("wheel")
    x, y, scale_after = page.evaluate(
        f"(v => [v.X(v.shots.x[5]), v.Y(v.shots.y[5]), v.scale])({MAP})"
    )
    away = (np.array(image) - pointer) * (scale_after / scale)  # what is under the pointer stays
    assert (x, y) == pytest.approx(tuple(pointer + away), abs=2.0)


@pytest.mark.slow
def test_images_are_marked_in_map_and_table_by_a_click_on_either(opened: Opened) -> None:
    """Oracle: by hand."""
    page = opened()
    _seen(page)
    page.mouse.click(*_on_map(page, 20))
    page.mouse.move(1, 1)
    rows = [row.inner_text().split("\t")[1] for row in page.query_selector_all("tr.here")]
    assert rows == ["8021.tif"]
    page.click("tr[data-image='16']")
    assert page.evaluate(f"{MAP}.fixed") == 16


@pytest.mark.slow
def test_the_table_searches_sorts_and_copies(
    opened: Opened, orientation: ExteriorOrientation
) -> None:
    """Oracle: by hand; names, times in their order, the clipboard, an outage of 12 s."""
    page = opened(permissions=["clipboard-read", "clipboard-write"])

    def listed() -> list[str]:
        rows = page.query_selector_all("tr[data-image]")
        return [row.inner_text().split("\t")[1] for row in rows]

    count = page.query_selector(".controls .soft")
    assert count.inner_text() == "30 of 30"
    page.fill("input[type=search]", "801")
    assert listed() == [f"{8010 + k}.tif" for k in range(10)]
    page.click("th:has-text('TOW')")
    assert listed()[0] == "8019.tif"
    page.click("th:has-text('TOW')")
    assert listed()[0] == "8010.tif"
    page.click("button.copy")
    page.wait_for_selector("button.copy:has-text('copied')")
    text = page.evaluate("navigator.clipboard.readText()").splitlines()
    assert len(text) == 11
    assert text[0].startswith("no.,image,")
    assert text[1].startswith("10,8010.tif,")
    page.fill("input[type=search]", "")
    after = orientation.time - START
    inside = int(((after > 50.0) & (after < 62.0)).sum())
    page.select_option(".controls select", label=f"in an outage ({inside})")
    assert len(listed()) == inside
    page.fill("input[type=search]", "nothing is called so")
    assert listed() == []


@pytest.mark.slow
def test_a_legend_hides_what_it_names(opened: Opened) -> None:
    """Oracle: pixels; without the fixes most of the colour is gone."""
    page = opened()
    page.evaluate("document.getElementById('innovations').scrollIntoView()")
    page.wait_for_selector("#innovations canvas")
    page.wait_for_timeout(100)
    before = page.query_selector("#innovations canvas").evaluate(PIXELS)[1]
    page.click("#innovations button:has-text('fix') >> nth=0")
    page.wait_for_timeout(50)
    assert page.query_selector("#innovations canvas").evaluate(PIXELS)[1] < 0.5 * before


@pytest.mark.slow
def test_dark_pages_have_no_white_charts_and_follow_a_change(opened: Opened) -> None:
    """Oracle: pixels; hardly any is white, and on a change to light the map's paper is."""
    page = opened(color_scheme="dark")
    _seen(page)
    for canvas in page.query_selector_all("canvas"):
        drawn, _, white = canvas.evaluate(PIXELS)
        assert white < 0.02 * drawn
    page.emulate_media(color_scheme="light")
    page.wait_for_timeout(50)
    drawn, _, white = page.query_selector("#map canvas").evaluate(PIXELS)
    assert white > 0.5 * drawn


@pytest.mark.slow
def test_nothing_overflows_a_phone(opened: Opened) -> None:
    """Oracle: the browser's layout."""
    page = opened(width=390, device_scale_factor=2, has_touch=True, is_mobile=True)
    _seen(page)
    assert page.evaluate("document.scrollingElement.scrollWidth") <= 390
    for canvas in page.query_selector_all("canvas"):
        assert canvas.evaluate(PIXELS)[1] > 20
        box = canvas.bounding_box()
        assert box["x"] + box["width"] <= 391.0


@pytest.mark.slow
def test_a_flight_without_images_has_its_charts(browser, diagnostics, summary, tmp_path) -> None:
    """Oracle: no complaint; the map follows the charts over time all the same."""
    d = diagnostics()
    path = write_report(tmp_path, summary(d, None), d, None)
    page = browser.new_page()
    complaints: list[str] = []
    page.on("pageerror", lambda error: complaints.append(str(error)))
    page.goto(path.as_uri())
    _seen(page)
    page.mouse.move(*_centre(page, "motion", 0.5))
    assert page.evaluate(f"{MAP}.instant.length") == 2
    assert page.query_selector("#image-table") is None
    page.evaluate("document.getElementById('map').scrollIntoView()")
    box = page.query_selector("#map canvas").bounding_box()
    x, y = page.evaluate(f"(v => [v.X(v.track.x[300]), v.Y(v.track.y[300])])({MAP})")
    page.mouse.move(box["x"] + x, box["y"] + y)
    minute = page.evaluate(
        f"(p => p.plot.posToVal(p.plot.cursor.left, 'x'))({PANEL.format('motion')})"
    )
    assert 60.0 * minute == pytest.approx(30.0, abs=1.0)
    assert page.query_selector("#map .tip").inner_text().startswith("minute 0.5")
    page.close()
    assert complaints == []


@pytest.mark.slow
def test_odd_runs_are_drawn_without_complaint(browser, odd_cases, summary, tmp_path) -> None:
    """Oracle: no error of the script, and a canvas in every figure, whatever is missing."""
    page = browser.new_page()
    complaints: list[str] = []
    page.on("pageerror", lambda error: complaints.append(str(error)))
    page.on("console", lambda message: complaints.append(message.text))
    for name, (d, images) in odd_cases.items():
        path = write_report(tmp_path, summary(d, images), d, images)
        page.goto(path.as_uri())
        _seen(page)
        page.mouse.move(*_centre(page, "motion", 0.5))
        page.mouse.dblclick(*_centre(page, "motion", 0.5))
        assert complaints == [], name
    page.close()


@pytest.mark.slow
def test_it_prints_whole(opened: Opened) -> None:
    """Oracle: PDFium, what it reads and draws; every heading is there with something below it on
    its page, all images are there, and so is the ink of the charts.
    """
    pdfium = pytest.importorskip("pypdfium2", reason="pypdfium2 is not installed")
    page = opened()
    page.check("#appendix")
    headings = ["".join(h.inner_text().split()) for h in page.query_selector_all("h2")]
    document = pdfium.PdfDocument(io.BytesIO(page.pdf(format="A4", print_background=True)))
    whole, coloured = "", 0
    for sheet in document:
        text = sheet.get_textpage()
        letters = [
            (k, c) for k in range(text.count_chars()) if (c := text.get_text_range(k, 1)).strip()
        ]
        on_page = "".join(c for _, c in letters)
        pixels = np.asarray(sheet.render(scale=1.0).to_pil().convert("RGB")).astype(int)
        inked = np.flatnonzero((pixels.min(axis=2) < 200).any(axis=1))
        for heading in headings:
            if (k := on_page.rfind(heading)) >= 0:
                below = sheet.get_height() - text.get_charbox(letters[k][0])[1]
                assert inked[-1] > below + 20.0, heading
        whole += on_page
        coloured += int((np.ptp(pixels, axis=2) > 60).any(axis=1).sum() > 60)
    for heading in headings:
        assert heading in whole
    assert "8030.tif" in whole
    assert coloured >= 4
    assert page.evaluate("document.documentElement.classList.contains('printing')") is False


@pytest.mark.slow
def test_the_summary_prints_on_two_pages_and_the_appendix_where_asked_for(
    browser: Any, page_file: Path, tmp_path: Path
) -> None:
    """Oracle: PDFium, what it reads; verdict, map and settings are there, the checks in the
    appendix alone.
    """
    pdfium = pytest.importorskip("pypdfium2", reason="pypdfium2 is not installed")
    read = {}
    for appendix in (False, True):
        pdf = print_page(page_file, tmp_path / f"{appendix}.pdf", appendix).file
        sheets = list(pdfium.PdfDocument(pdf.read_bytes()))
        read[appendix] = len(sheets), "".join(x.get_textpage().get_text_range() for x in sheets)
    for _, text in read.values():
        for heading in ("Use it", "Where the flight went", "What no flight can show", "Settings"):
            assert heading in text
    assert read[False][0] <= 2 < read[True][0]
    assert "Gaps" in read[True][1]
    assert "Gaps" not in read[False][1]
