"""`insgnss figures`: the charts of a page as files, and pages that are refused."""

import hashlib
import json
import os
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import insgnss
from insgnss.cli.main import main
from insgnss.report.charts.chart import Chart, Layer, Panel
from insgnss.report.charts.encoded import encode_charts
from insgnss.report.charts.files import charts_of
from insgnss.report.document import Document
from insgnss.report.verdict import Verdict

X = np.linspace(0.0, 10.0, 50)


def charts() -> list[Chart]:
    line = Layer("line", X, np.sin(X), "north", texts=())
    dots = Layer("points", X, np.cos(X), "image", "second", texts=[f"{k}.tif" for k in range(50)])
    return [
        Chart("motion", "How it moved", "Read.", (Panel("north, m", (line, dots)),), "minutes"),
        Chart("map", "Where", "Read.", (Panel("north, m", (dots,)),), "east, m", map=True),
    ]


@pytest.fixture
def page(tmp_path: Path) -> Path:
    """A page with two charts, and the JSON document of the same run."""
    twin = json.dumps({"headline": "done"}) + "\n"
    (tmp_path / "report.json").write_text(twin)
    made = Document("flight", "all is well", Verdict("good", "nothing is odd"), charts())
    html = made.html(twin_sha256=hashlib.sha256(twin.encode()).hexdigest())
    (tmp_path / "report.html").write_text("".join(html))
    return tmp_path / "report.html"


def refusal(capsys, code: int, *words: str | Path) -> str:
    assert main(["figures", *map(str, words)]) == code
    (line,) = capsys.readouterr().err.strip().splitlines()
    return line


@pytest.mark.parametrize(
    ("form", "begins"), [("pdf", b"%PDF"), ("svg", b"<?xml"), ("png", b"\x89PNG")]
)
def test_one_file_a_chart_named_by_it(page, capsys, form, begins) -> None:
    """Oracle: the names, and the first bytes of the format; of JSON and page the same."""
    words = ["--format", form, "--width", "84", "-q"]
    assert main(["figures", str(page.with_suffix(".json")), *words]) == 0
    folder = page.parent / "figures"
    assert {path.name for path in folder.iterdir()} == {f"motion.{form}", f"map.{form}"}
    assert (folder / f"map.{form}").read_bytes().startswith(begins)
    out = page.parent / "deep/er"
    assert main(["figures", str(page), *words, "--out", str(out), "--only", "map", "--json"]) == 0
    told = capsys.readouterr().out
    assert json.loads(told[told.index("{") :])["files"] == [str(out / f"map.{form}")]
    assert (out / f"map.{form}").read_bytes() == (folder / f"map.{form}").read_bytes()


def test_charts_come_from_the_page(page) -> None:
    """Oracle: the charts that went in, to float32; a number changed in the page changes the figure,
    and that one alone.
    """
    _, found = charts_of(page)
    for chart, own in zip(found, charts(), strict=True):
        assert (chart.name, chart.title, chart.reading) == (own.name, own.title, own.reading)
        assert chart.panels[0].layers[0].y == pytest.approx(own.panels[0].layers[0].y, abs=1e-6)
    assert found[1].panels[0].layers[0].texts[3] == "3.tif"
    before = insgnss.figures(page, form="svg", out=page.parent / "a")
    motion, where = charts()
    line, dots = motion.panels[0].layers
    moved = replace(line, y=np.where(X[25] == X, 5.0, line.y))
    changed = replace(motion, panels=(replace(motion.panels[0], layers=(moved, dots)),))
    text = page.read_text()
    old, new = (
        encode_charts(of).partition('"arrays":')[2] for of in ((motion, where), (changed, where))
    )
    assert old in text
    text = text.replace(old, new)
    page.write_text(text)
    after = insgnss.figures(page, form="svg", out=page.parent / "b")
    same = [a.read_bytes() == b.read_bytes() for a, b in zip(before, after, strict=True)]
    assert same == [False, True]


def test_a_page_of_another_run_is_refused(page, capsys) -> None:
    """Oracle: the exit code of the contract; the page by itself is drawn."""
    document = page.with_suffix(".json")
    document.write_text(json.dumps({"headline": "another run"}) + "\n")
    assert "another run" in refusal(capsys, 3, document, "-q")
    assert not (page.parent / "figures").exists()
    assert main(["figures", str(page), "-q", "--only", "map"]) == 0


def test_nothing_is_overwritten_in_silence(page, capsys) -> None:
    """Oracle: the bytes of the file in the way, and the exit code of wrong use."""
    folder = page.parent / "figures"
    folder.mkdir()
    (folder / "map.pdf").write_text("mine")
    assert "map.pdf" in refusal(capsys, 2, page, "-q")
    assert [path.name for path in folder.iterdir()] == ["map.pdf"]
    assert (folder / "map.pdf").read_text() == "mine"
    assert main(["figures", str(page), "-q", "--force"]) == 0
    assert (folder / "map.pdf").read_bytes().startswith(b"%PDF")
    assert "is a file" in refusal(capsys, 2, page, "-q", "--out", page)


def test_wrong_use_names_what_there_is(page, capsys) -> None:
    """Oracle: the exit code of wrong use, and the names of the charts."""
    assert "motion" in refusal(capsys, 2, page, "-q", "--only", "motoin")
    assert "width" in refusal(capsys, 2, page, "-q", "--width", "3")
    with pytest.raises(insgnss.UsageError, match="jpg"):
        insgnss.figures(page, form="jpg")


def damaged(page: Path, old: str, new: str) -> None:
    text = page.read_text()
    assert old in text
    page.write_text(text.replace(old, new, 1))


@pytest.mark.parametrize(
    ("old", "new", "words"),
    [
        ('"name":"map"', '"name":"../map"', "other characters"),
        ('"kind":"line"', '"kind":"plot"', "unknown"),
        ('"kind":"line"', '"kind":"band"', "lacks y2"),
        ('"ink":"second"', '"ink":"pink"', "unknown"),
        ('"kind":"line"', '"kind":"steps"', "lengths"),
        ('"arrays":["', '"arrays":["AAAAAA', "cannot be read"),
        ('{"report_sha256"', '{"report', "cannot be read"),
        ('id="charts"', 'id="chars"', "no charts"),
    ],
)
def test_a_damaged_page_is_refused_in_a_line(page, capsys, old, new, words) -> None:
    """Oracle: the exit code of bad input; the line names the page, and nothing is written."""
    damaged(page, old, new)
    line = refusal(capsys, 3, page, "-q")
    assert words in line
    assert "report.html" in line
    assert not (page.parent / "figures").exists()


def test_what_is_no_page_is_refused(page, tmp_path, capsys) -> None:
    """Oracle: the exit code of bad input, whatever is given."""
    (tmp_path / "other.html").write_bytes(b"\x89PNG\xff\xfe")
    (tmp_path / "plain.html").write_text("<html></html>")
    (tmp_path / "lone.json").write_text("{}")
    for name, words in (
        ("other.html", "not text"),
        ("plain.html", "no charts"),
        ("lone.json", "lone.html with its charts does not exist beside it"),
        ("missing.html", "does not exist"),
        (".", "directory"),
    ):
        assert words in refusal(capsys, 3, tmp_path / name, "-q"), name


def test_a_page_without_a_browser_or_over_a_file_is_not_printed(
    page, capsys, monkeypatch, tmp_path
) -> None:
    """Oracle: definition; one line that says what to do, wrong use, and nothing is overwritten."""
    (tmp_path / "report.pdf").write_text("mine")
    assert main(["report", str(page), "-q"]) == 2
    assert "overwrite with --force" in capsys.readouterr().err
    monkeypatch.setenv("PATH", str(tmp_path))
    assert main(["report", str(page), "-q", "--force"]) == 2
    (line,) = capsys.readouterr().err.strip().splitlines()
    assert "is on the path; install one, or print" in line
    assert (tmp_path / "report.pdf").read_text() == "mine"


@pytest.mark.skipif(os.name == "nt", reason="a shell script stands for the browser")
def test_a_browser_that_does_not_print_is_said(page, capsys, monkeypatch, tmp_path) -> None:
    """Oracle: definition; its last line is in ours, and there is no file."""
    fake = tmp_path / "chromium"
    fake.write_text("#!/bin/sh\necho no display >&2\nexit 1\n")
    fake.chmod(0o755)
    monkeypatch.setenv("PATH", str(tmp_path))
    assert main(["report", str(page), "-q"]) == 3
    (line,) = capsys.readouterr().err.strip().splitlines()
    assert "did not print it (no display); print it from a browser" in line
    assert not (tmp_path / "report.pdf").exists()
