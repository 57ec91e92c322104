"""Pieces of HTML: escaped text, tables, the frame of a page."""

import html
import re
from collections.abc import Iterable, Iterator, Sequence
from functools import cache
from pathlib import Path

from .charts.chart import Chart
from .charts.encoded import CHARTS_KEY, encode_charts

Row = Sequence[str]

ASSETS = Path(__file__).parent / "assets"
# nothing is loaded from anywhere, and nothing that a name of a file might hold is run
_POLICY = (
    "default-src 'none'; style-src 'unsafe-inline'; script-src 'unsafe-inline'; img-src data:;"
    " base-uri 'none'; form-action 'none'"
)


def opening(title: str, charts: bool) -> str:
    """The head of a page, and its beginning; charts : whether it draws some."""
    style = asset("uplot/uPlot.min.css") + "\n" + asset("report.css") if charts else ""
    return (
        f'<!DOCTYPE html>\n<html lang="en">\n<head>\n<meta charset="utf-8">\n<title>{escape(title)}'
        "</title>\n"
        '<meta name="viewport" content="width=device-width, initial-scale=1">\n'
        f'<meta http-equiv="Content-Security-Policy" content="{_POLICY}">\n'
        f"<style>\n{style or asset('report.css')}\n</style>\n</head>\n<body>\n<main>\n"
    )


def closing(charts: Sequence[Chart], report_sha256: str) -> Iterator[str]:
    """The end of a page, piece by piece.

    Parameters
    ----------
    charts : what `chart_place` has places for in the page, which draws them itself.
    report_sha256 : SHA-256 of the text of report.json of the same run, for `insgnss figures`.
    """
    yield "</main>\n"
    if charts:
        yield embed_json(CHARTS_KEY, encode_charts(charts, report_sha256))
        licence = asset("uplot/LICENSE").strip()
        library = asset("uplot/uPlot.iife.min.js").strip()
        yield f"<script>\n/*! uPlot, https://github.com/leeoniya/uPlot\n\n{licence}\n*/\n"
        yield f"{library}\n</script>\n<script>\n{asset('report.js')}</script>\n"
    yield "</body>\n</html>\n"


@cache
def asset(name: str) -> str:
    """Return the text of a file that pages hold: style, script, licence."""
    return (ASSETS / name).read_text(encoding="utf-8")


def embed_json(name: str, text: str) -> str:
    """Data of the page: JSON made by `encode_charts` or `script_safe`, under an id."""
    return f'<script type="application/json" id="{name}">{text}</script>\n'


def chart_place(chart: Chart) -> str:
    """The place of a chart with its title and how to read it; the page's script draws it there."""
    return (
        f'<figure id="{escape(chart.name)}" class="chart">\n<h2>{escape(chart.title)}</h2>\n'
        '<div class="plot"></div>\n'
        '<noscript><p class="soft">The page draws this figure itself, and scripts are off here:'
        " <code>insgnss figures report.html</code> writes it as a file.</p></noscript>\n"
        f"<figcaption>{escape(chart.reading)}</figcaption>\n</figure>\n"
    )


def with_contents(body: str, appendix: str = "") -> str:
    """Return a body with a list of contents before it, and an id at each heading.

    A figure is listed by its name, which is shorter than its title. The list ends with the box
    `appendix` that asks for this part in print, where there is one.
    """
    entries = []

    def placed(match: re.Match[str]) -> str:
        figure, title = match.group(1), match.group(3)
        name = match.group(2) or "-".join(re.findall(r"[a-z0-9]+", title.lower()))
        called = name.replace("-", " ").capitalize().replace("Nis ", "NIS ") if figure else title
        entries.append(f'<a href="#{name}">{called}</a>')
        return f"{figure}<h2>{title}</h2>" if figure else f'<h2 id="{name}">{title}</h2>'

    body = re.sub(r'(<figure id="([^"]*)"[^>]*>\n)?<h2>(.*?)</h2>', placed, body)
    if appendix:
        entries.append(
            f'<label><input type="checkbox" id="{appendix}"> print the {appendix} as well</label>'
        )
    return f'<nav class="contents" aria-label="contents">{"".join(entries)}</nav>\n{body}'


def escape(value: object) -> str:
    """Text without meaning to HTML."""
    return html.escape(str(value))


def sentence(text: str) -> str:
    """Text with a capital and a full stop; a key of the flight file at its head stays as it is."""
    first = text.partition(" ")[0].rstrip(",;:.")
    is_key = "." in first or "_" in first
    return f"{text}." if is_key else f"{text[:1].upper()}{text[1:]}."


def table(rows: Iterable[Row], head: Row = (), numbers: bool = False) -> str:
    """Table of cells that are HTML already.

    `numbers` aligns all columns but the first to the right.
    """

    def cells(row: Row, tag: str) -> str:
        mark = ' class="number"' if numbers else ""
        return (
            "<tr>"
            + "".join(f"<{tag}{mark if i else ''}>{cell}</{tag}>" for i, cell in enumerate(row))
            + "</tr>\n"
        )

    top = f"<thead>\n{cells(head, 'th')}</thead>\n" if head else ""
    body = "".join(cells(row, "td") for row in rows)
    kind = "wide" if head else "wide pairs"
    return f'<div class="{kind}"><table>\n{top}<tbody>\n{body}</tbody>\n</table></div>\n'


def fold_content(title: str, content: str) -> str:
    """Content behind a line that opens it."""
    return f"<details><summary>{escape(title)}</summary>\n{content}</details>\n"
