"""The page that a verb leaves: order, escaping, from what it was made."""

import hashlib
import re

import numpy as np

from insgnss.records import Check
from insgnss.report.charts.chart import Chart, Layer, Panel
from insgnss.report.document import (
    Document,
    Drawing,
    Marked,
    Section,
    Table,
    checks_section,
    write_with_page,
)
from insgnss.report.verdict import Verdict, worst_of

EVIL = "</script><b>&"


def filled(tmp_path) -> Document:
    (tmp_path / "in put.csv").write_text("1,2\n")
    layer = Layer("points", np.ones(1), np.ones(1), EVIL, texts=[EVIL])
    chart = Chart("one", EVIL, EVIL, (Panel(EVIL, (layer,)),), EVIL)
    document = Document(
        EVIL,
        "3 of 4 fit",
        Verdict("doubtful", f"one does not{EVIL}"),
        (
            Section("First", [EVIL, Marked(EVIL, "note", help=EVIL)]),
            chart,
            Section("Table", [Table([(EVIL, Marked("1", "ok", link=f"#{EVIL}"))])]),
            checks_section([CHECK]),
            Section("Text", [Marked(EVIL, "soft"), Drawing("<svg></svg>")], "page"),
            Section("Only here", [EVIL], "terminal"),
        ),
        [tmp_path / "in put.csv", tmp_path / "absent.csv"],
        settings={"key": EVIL},
        files=["out.csv"],
        next="next: see",
    )
    return document


def page(tmp_path) -> str:
    return "".join(filled(tmp_path).html())


CHECK = Check("units", "rad/s", "deg/s", "note", EVIL)


def test_headline_reason_charts_tables_provenance_in_this_order(tmp_path) -> None:
    """Oracle: the order of the questions."""
    text = page(tmp_path)
    order = [
        "3 of 4 fit.",
        "<strong>Doubtful</strong>: one does not",
        ">First</h2>",
        '<figure id="one"',
    ]
    titles = ("Table", "Checks", "Text", "Settings", "Inputs (SHA-256)", "The run", "Versions")
    places = [text.index(words) for words in [*order, *(f">{title}</h2>" for title in titles)]]
    assert places == sorted(places)
    assert hashlib.sha256(b"1,2\n").hexdigest() in text
    assert "absent.csv" not in text
    for words in ("operating system", "date (UTC)", "insgnss", "numpy"):
        assert f"<td>{words}</td>" in text, words


def test_no_text_has_a_meaning_to_html(tmp_path) -> None:
    """Oracle: the planted text stands nowhere as it is; scripts are those of the package."""
    text = page(tmp_path)
    assert "<b>&" not in text
    assert text.count("</script>") == 3
    assert not re.search(r"""(src|href)=["'](?!#)""", text)


def test_the_twin_is_named_by_its_hash(tmp_path) -> None:
    """Oracle: hashlib; of a page without a twin the name is empty."""
    write_with_page(filled(tmp_path), {"a": "\u00e9"}, tmp_path / "a.json", tmp_path / "a.html")
    digest = hashlib.sha256((tmp_path / "a.json").read_bytes()).hexdigest()
    assert f'"report_sha256":"{digest}"' in (tmp_path / "a.html").read_text()
    assert '"report_sha256":""' in page(tmp_path)


def test_terminal_and_page_say_the_same(tmp_path) -> None:
    """Oracle: every sentence and cell of the terminal is on the page; each has what is its own."""
    text, html = filled(tmp_path).text(), page(tmp_path)
    lines = text.splitlines()
    assert lines[:2] == ["3 of 4 fit", f"Doubtful: one does not{EVIL}."]
    assert lines[-2:] == ["wrote out.csv", "next: see"]
    assert f"  note  units: rad/s; {EVIL} (expected: deg/s)" in lines
    for title in ("First", "Table", "Checks"):
        assert title in lines
        assert f">{title}</h2>" in html
    assert "Only here" in lines
    assert ">Only here</h2>" not in html
    assert "Text" not in lines
    assert "<svg></svg>" in html


def test_a_table_is_aligned_on_the_terminal() -> None:
    """Oracle: by hand; numbers to the right, the last column of words wrapped below itself."""
    numbers = Table([("a", "1.0", "± 2"), ("bcd", "10.0", "–")], ("", "mean", "sd"), numbers=True)
    assert list(numbers.lines()) == ["     mean    sd", "a     1.0  +- 2", "bcd  10.0     -"]
    words = Table([("a", "word " * 30)], ("x", "long"))
    lines = list(words.lines())
    assert lines[0] == "x  long"
    assert all(len(line) <= 110 for line in lines)
    assert lines[2].startswith("   word")


def test_the_verdict_is_that_of_the_worst_finding() -> None:
    """Oracle: the rule, by hand; no more than three findings are named."""
    assert worst_of("well")[:2] == ("good", "well")
    assert worst_of("well", ["a", "b"])[:2] == ("doubtful", "a; b")
    assert worst_of("well", ["a"], ["c"])[:2] == ("bad", "c")
    assert worst_of("well", list("abcde"))[:2] == ("doubtful", "a; b; c and 2 more")


def test_nothing_to_say_leaves_no_heading() -> None:
    """Oracle: by hand; long tables are folded."""
    for section in (Section("A"), Section("A", [Table([])]), checks_section([])):
        assert section.html() == ""
        assert list(section.lines()) == []
    assert "<details>" in Table([("x",)] * 21).html()
    assert "<details>" not in Table([("x",)] * 20).html()
