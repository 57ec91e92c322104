"""Terms of the trade on a page: the first of each leads to its sentence on the same page."""

import re
from pathlib import Path

from insgnss.report.document import Document, Marked, Section, Table
from insgnss.report.terms import TERMS, TermLinks
from insgnss.report.verdict import Verdict

GLOSSARY = Path(__file__).parents[2] / "docs" / "glossary.md"


def test_the_first_of_a_term_is_a_link_and_no_tag_is_touched() -> None:
    """Oracle: by hand; a name of a chart, a heading, code and attributes are no text."""
    links = TermLinks()
    html = '<figure id="NIS"><h2>NIS</h2><code>NIS</code></figure><p title="NIS">NIS, NIS.</p>'
    out = links.within(html)
    start, _, end = out.partition('<a class="term" href="#term-NIS" title="')
    assert start == html.partition(">NIS, NIS")[0] + ">"
    assert end.endswith('">NIS</a>, NIS.</p>')
    assert links.within("<p>NIS</p>") == "<p>NIS</p>"
    assert links.within("<p>titled, TOWER, fixed</p>") == "<p>titled, TOWER, fixed</p>"
    assert [term for _, term, _ in links.rows()] == ["NIS"]


def test_each_link_of_a_page_has_its_sentence() -> None:
    """Oracle: the ids of the page; terms in headline, verdict, sentence and table."""
    parts = ["the lever arm is known", Table([(Marked("tilt", "strong"), "2")], ("NIS", "x"))]
    verdict = Verdict("good", "all biases hold")
    page = "".join(Document("T", "sigmas of 3 mm", verdict, [Section("S", parts)]).html())
    asked = set(re.findall(r'href="#(term-[^"]*)"', page))
    assert asked == {"term-sigma", "term-bias", "term-lever-arm", "term-tilt", "term-NIS"}
    assert asked == set(re.findall(r'<dt id="([^"]*)"', page))
    assert page.count('class="term"') == len(asked)


def test_the_glossary_has_every_term() -> None:
    """Oracle: docs/glossary.md."""
    text = GLOSSARY.read_text(encoding="utf-8").lower()
    assert not [term for term in TERMS if term.lower() not in text]
