"""The page that a verb leaves: order, escaping, from what it was made."""

import hashlib
import re

import numpy as np

from insgnss.records import Check
from insgnss.report.charts.chart import Axes, Chart, Layer
from insgnss.report.verb_page import VerbPage, checks_table, listed, preformatted, tabulated

EVIL = "</script><b>&"


def page(tmp_path, **options) -> str:
    (tmp_path / "in put.csv").write_text("1,2\n")
    layer = Layer("points", np.ones(1), np.ones(1), EVIL, texts=[EVIL])
    chart = Chart("one", EVIL, EVIL, (Axes(EVIL, (layer,)),), EVIL)
    made = VerbPage(
        EVIL,
        "3 of 4 fit",
        "doubtful",
        f"one does not{EVIL}",
        [chart],
        (listed("First", [EVIL]),),
        (tabulated("Table", [(EVIL, "1")]), checks_table([CHECK]), preformatted("Text", [EVIL])),
        [tmp_path / "in put.csv", tmp_path / "absent.csv"],
        settings={"key": EVIL},
        **options,
    )
    return "".join(made.html())


CHECK = Check("units", "rad/s", "deg/s", "note", EVIL)


def test_headline_reason_charts_tables_provenance_in_this_order(tmp_path) -> None:
    """Oracle: the order of the questions."""
    text = page(tmp_path)
    order = ["3 of 4 fit.", "<b>Doubtful</b>: one does not", ">First</h2>", '<figure id="one"']
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
    twin = '{"a": "\u00e9"}\n'
    digest = hashlib.sha256(twin.encode()).hexdigest()
    assert f'"report_sha256":"{digest}"' in page(tmp_path, twin=twin)
    assert '"report_sha256":""' in page(tmp_path)


def test_nothing_to_say_leaves_no_heading() -> None:
    """Oracle: by hand; long tables are folded."""
    assert listed("A", []) == tabulated("A", []) == checks_table([]) == ""
    assert "<details>" in tabulated("A", [("x",)] * 21)
    assert "<details>" not in tabulated("A", [("x",)] * 20)
