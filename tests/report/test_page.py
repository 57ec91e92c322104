"""The page: valid, self-contained, escaped, whole or not there."""

import hashlib
import json
import re
from dataclasses import replace
from html.parser import HTMLParser
from pathlib import Path

import numpy as np
import pytest

import insgnss.report.page as page_module
from insgnss.base.errors import UsageError
from insgnss.records import Check, Estimate, MeanResidual, TimeCorrelatedError
from insgnss.records.states import CLOCK_RATE, OF_LEVER_ARM, TIME_OFFSET
from insgnss.report.charts.chart import Chart, Layer, Panel
from insgnss.report.charts.encoded import in_page
from insgnss.report.markup import sentence
from insgnss.report.page import image_table, page, write_report, write_report_json
from insgnss.report.summary import run_summary

VOID = {"meta", "img", "br", "hr", "link", "input"}
CHART = Chart(
    "map",
    "Where <it> went",
    "Dots & lines.",
    (Panel("y, m", (Layer("line", np.arange(3.0), np.arange(3.0)),)),),
    "x, m",
)


class Reader(HTMLParser):
    """Checks that every tag is closed in order, and collects tags, attributes and text."""

    def __init__(self, text: str) -> None:
        super().__init__()
        self.open: list[str] = []
        self.tags: list[str] = []
        self.attributes: list[tuple[str, str | None]] = []
        self.text = ""
        self.feed(text)
        self.close()
        assert not self.open

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.tags.append(tag)
        self.attributes += attrs
        if tag not in VOID:
            self.open.append(tag)

    def handle_endtag(self, tag: str) -> None:
        assert self.open.pop() == tag

    def handle_data(self, data: str) -> None:
        self.text += data


def test_page_is_whole_and_self_contained(tmp_path: Path, diagnostics, eo, summary) -> None:
    """Oracle: html.parser; tags balance, nothing is loaded from elsewhere, every chart has its
    place and its data.
    """
    path = write_report(tmp_path, summary(diagnostics(), eo()), diagnostics(), eo(), None, "ab12")
    assert path == tmp_path / "report.html"
    text = path.read_text(encoding="utf-8")
    reader = Reader(text)
    assert text.startswith("<!DOCTYPE html>")
    assert {"link", "iframe", "img"}.isdisjoint(reader.tags)
    named = [value or "" for name, value in reader.attributes if name in ("src", "href")]
    assert named
    assert all(value.startswith("#") for value in named)
    assert set(re.findall(r"https?://[^\s\"']*", text)) == {"https://github.com/leeoniya/uPlot"}
    charts, digest = in_page(text)
    assert digest == "ab12"
    assert [x.name for x in charts] == re.findall(r'<figure id="([^"]*)"', text)
    assert {"#map", "#image-by-image", "#innovations", "#biases"} <= set(named)
    assert {value[1:] for value in named} <= {v for n, v in reader.attributes if n == "id"}
    assert [p.name for p in tmp_path.iterdir()] == ["report.html"]


def test_licence_of_the_library_is_in_the_page(tmp_path: Path, diagnostics, eo, summary) -> None:
    """Oracle: the licence's own words; they must go wherever the library goes."""
    path = write_report(tmp_path, summary(diagnostics(), eo()), diagnostics(), eo())
    text = path.read_text(encoding="utf-8")
    assert "Copyright (c) 2022 Leon Sorokin" in text
    assert "THE SOFTWARE IS PROVIDED" in text


def test_keys_of_the_flight_file_are_printed_as_they_are() -> None:
    """A key that begins a sentence keeps its small letter: it is copied into the flight file."""
    assert sentence("mounting.antenna_m = [1] would correct it") == (
        "mounting.antenna_m = [1] would correct it."
    )
    assert sentence("measure it, see gnss.sigma_m") == "Measure it, see gnss.sigma_m."


def test_a_clock_rate_is_shown_in_ppm_and_the_first_sentence_is_the_verdict(
    diagnostics, eo, summary
) -> None:
    """Oracle: 2e-5 s/s are 20 ppm; the reason under the headline is that of the terminal."""
    rate = Estimate(CLOCK_RATE, -1.6e-6, 5e-6, 2e-5, None)
    s = summary(diagnostics(states=(rate,)), eo())
    text = "".join(page(s, ()))
    assert "-1.60 ppm" in text
    assert "± 20 ppm" in text
    s["use"] |= {"verdict": "except", "reasons": ["a sentence of its own"]}
    assert "a sentence of its own." in "".join(page(s, ()))


def test_every_run_has_a_page(odd_cases, summary) -> None:
    """Oracle: html.parser; tags balance whatever is missing, and no number is shown as nan or
    None.
    """
    for name, (d, images) in odd_cases.items():
        reader = Reader("".join(page(summary(d, images), [CHART])))
        assert not re.search(r"\b(nan|None|inf)\b", reader.text), name
    assert "none (no camera)" in Reader("".join(page(summary(*odd_cases["no camera"]), []))).text


def test_text_of_others_is_escaped(odd_cases, summary) -> None:
    """Oracle: html.parser; a script in a name is text, no tag."""
    evil = "<script>alert('x')</script>"
    d, images = odd_cases["gaps, checks, resets"]
    name = f"</script>{evil}.tif"
    images = replace(images, images=(name, *images.images[1:]))
    data = {"images": image_table(d, images)}
    whole = "".join(page(summary(d, images, name=evil), [CHART], data))
    reader = Reader(whole)
    assert reader.tags.count("script") == len(["charts", "images", "library", "own"])
    assert "b" not in reader.tags
    assert evil in reader.text
    assert "1.1 s <b>" in reader.text
    assert "Where <it> went" in reader.text
    assert "</script><" not in whole.replace("</script>\n<", "")


def test_page_says_what_a_surveyor_asks(diagnostics, eo, summary) -> None:
    """Oracle: by hand; sigmas, first image, flight file, hash and version stand on the page."""
    text = Reader("".join(page(summary(diagnostics(), eo()), []))).text
    for words in (
        "2.0 / 3.0 / 4.0",
        "First image, 8001.tif",
        "imu.units.gyro",
        "ab" * 32,
        "0.1.0",
        "36.0 ± 9.0",
        "1200, 1200 used, 0 rejected",
    ):
        assert words in text


def test_limits_stand_first_with_what_would_help(diagnostics, eo, summary) -> None:
    """Oracle: by hand; the section comes before all others, in the order of the ranks, remarks
    behind the line that opens them; the heading is the reason of the verdict and no remark.
    """
    checks = tuple(Check(f"rate {k}", "one <i>", "two", "note", "look there") for k in range(4))
    s = summary(diagnostics(2.0, checks=checks), eo(0.31))
    whole = "".join(page(s, []))
    text = Reader(whole).text
    assert re.findall(r"<h2[^>]*>([^<]*)", whole)[0] == "Remarks"
    remarks = [limit["text"][1:] for limit in s["limits"] if limit["topic"] != "heading"]
    places = [text.index(remark) for remark in remarks]
    assert len(remarks) == len(s["limits"]) - 1
    assert places == sorted(places)
    assert text.index("one <i>") < text.index("of less weight") < text.index("rate 3")
    assert text.count("make a turn or a figure of eight before the first line.") == 1


def test_lines_and_constants_have_their_tables(block, summary) -> None:
    """Oracle: by hand; four lines, the worst heading in bold; a time offset in ms, observed, a
    lever arm in m, not observed.
    """
    sigma = block().smoothed_sigma.copy()
    sigma[300:500, 8] = np.radians(0.123)
    states = (
        Estimate(TIME_OFFSET, 0.0125, 0.0009, 0.1, 0.014),
        Estimate(OF_LEVER_ARM[2], -0.05, 0.28, 0.3, 0.28),
    )
    lasting = (
        TimeCorrelatedError(15.0, 1200, (0.018, 0.018, 0.027), (0.9, 0.9, 0.9), (0.4, 0.4, 0.4)),
    )
    rests = np.array([[205200.0, 205204.0]])
    parts = ((205200.0, 205240.0), (205270.0, 205319.9))
    s = summary(
        block(
            smoothed_sigma=sigma,
            states=states,
            time_correlated=lasting,
            stationary=rests,
            segments=parts,
        ),
        None,
    )
    whole = "".join(page(s, []))
    text = Reader(whole).text
    assert whole.count("<b>0.123</b>") == 1
    for words in (
        "Line by line",
        "12.50 ms",
        "0.90 ms",
        "± 100 ms",
        "14.0 mm",
        "-0.0500 m",
        "280 mm",
        "yes",
        "no",
        "correlation time of 15.0 s",
    ):
        assert words in text
    for begin, end, tow in (
        ("08:59:42", "09:00:22", "205200.0 to 205240.0 s"),
        ("09:00:52", "09:01:41", "205270.0 to 205319.9 s"),
    ):
        assert f"{begin} to {end} UTC (TOW {tow})" in text
    assert "1 stationary period, 4 s in all" in text


def test_page_of_a_standing_sensor_has_no_innovations(diagnostics, tmp_path: Path) -> None:
    """Oracle: by hand; where the fixes were made up neither words nor pictures speak of them."""
    d = diagnostics()
    s = run_summary(
        d, None, {"name": "s", "gnss": {"stationary": [46.0, 7.0, 400.0]}}, {}, {}, {}, ()
    )
    text = write_report(tmp_path, s, d, None).read_text(encoding="utf-8")
    assert 'id="innovations"' not in text
    assert 'id="map"' not in text
    assert 'id="sigmas"' in text
    assert not re.search(r"NIS|Rejected|Innovations", Reader(re.sub(r'src="[^"]*"', "", text)).text)
    assert "none: the sensor stands at a given place" in text


@pytest.mark.parametrize(
    ("scale", "heading", "mood"),
    [(1.0, 0.02, "good"), (2.0, 0.02, "good"), (1.0, 0.31, "doubtful")],
)
def test_the_colour_is_that_of_the_use(diagnostics, eo, summary, scale, heading, mood) -> None:
    """Oracle: by hand; innovations of twice their sigma lift no image beyond its need."""
    reader = Reader("".join(page(summary(diagnostics(scale), eo(heading)), [])))
    assert ("class", f"headline {mood}") in reader.attributes


def test_nothing_is_left_of_a_page_that_failed(
    tmp_path: Path, monkeypatch, diagnostics, eo, summary
) -> None:
    """Oracle: the directory; a failure in the middle of writing leaves the former page as it
    was.
    """
    (tmp_path / "report.html").write_text("former")

    def broken(*_: object) -> str:
        raise RuntimeError("in the middle")

    monkeypatch.setattr(page_module, "made_from", broken)
    with pytest.raises(RuntimeError):
        write_report(tmp_path / "report.html", summary(diagnostics(), eo()), diagnostics(), eo())
    assert [(p.name, p.read_text()) for p in tmp_path.iterdir()] == [("report.html", "former")]


def test_json_is_the_summary(tmp_path: Path, diagnostics, eo, summary) -> None:
    """Oracle: json."""
    s = summary(diagnostics(), eo(), name="Évionnaz")
    digest = write_report_json(s, tmp_path / "report.json")
    assert digest == hashlib.sha256((tmp_path / "report.json").read_bytes()).hexdigest()
    text = (tmp_path / "report.json").read_text(encoding="utf-8")
    assert json.loads(text) == s
    assert "Évionnaz" in text


def test_missing_directory_is_told(tmp_path: Path, diagnostics, eo, summary) -> None:
    """Oracle: the exit code of a wrong use."""
    with pytest.raises(UsageError, match="does not exist"):
        write_report_json(summary(diagnostics(), eo()), tmp_path / "none" / "report.json")


def test_fixes_minus_solution_are_listed_and_the_odd_ones_marked(diagnostics, eo, summary) -> None:
    """Oracle: by hand; of two pieces one is 0.4 m of 0.02 m off."""
    pieces = tuple(
        MeanResidual(
            205200.0 + 60 * k, 205259.0 + 60 * k, 600, (0.001, down, -0.002), (0.01, 0.02, 0.03)
        )
        for k, down in enumerate((0.003, 0.4))
    )
    d = diagnostics(residuals=pieces)
    text = "".join(page(summary(d, eo()), ()))
    section = text.split(">Fixes minus solution</h2>")[1].split("<h2")[0]
    assert section.count("<tr>") == 3
    assert re.findall('class="contradiction">([^<]*)<', section) == ["400 mm ± 20.0 mm"]
    assert 'class="headline doubtful"' in text
    assert "Fixes minus solution" not in "".join(page(summary(diagnostics(), eo()), ()))


def test_the_summary_says_whose_flight_it_is_and_the_rest_is_the_appendix(
    diagnostics, eo, summary
) -> None:
    """Oracle: by hand; TOW 205200 s of GPS week 2008 is 3 July 2018, 08:59:42 UTC; what prints
    beside the appendix is what a surveyor hands over.
    """
    output = {"operator": "A. <b>", "equipment": None, "formats": ["metashape"], "crs": None}
    s = summary(diagnostics(), eo(), output=output, included=["../wing3.toml"])
    s["flight"]["output"]["time_zone"] = "+02:00"
    assert "flown 2018-07-03 10:59:42 to 11:01:41 UTC+02:00" in "".join(page(s, []))
    s["flight"]["output"]["time_zone"] = "UTC"
    whole = "".join(page(s, []))
    about = "Operator A. &lt;b&gt;; equipment wing3; flown 2018-07-03 08:59:42 to 09:01:41 UTC"
    assert f'<p class="soft about">{about}' in whole
    brief, appendix = whole.split('<div class="appendix">', 1)
    for text, titles in (
        (brief, {"What no flight can show", "Settings and versions"}),
        (appendix, {"Key numbers", "Gaps", "Versions", "Inputs (SHA-256)"}),
    ):
        assert titles <= set(re.findall(r"<h2[^>]*>([^<]*)", text))
    assert "formats metashape" in brief
