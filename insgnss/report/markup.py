"""Pieces of HTML: escaped text, tables, values of three axes."""

import base64
import html
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass

Row = Sequence[str]

_STYLE = """
:root { color-scheme: light dark; --ink: #1c2430; --paper: #ffffff; --pale: #f3f5f8;
  --rule: #d5dae1; --soft: #5b6675;
  --ok: #00734f; --note: #a65200; --bad: #b3261e; }
@media (prefers-color-scheme: dark) { :root { --ink: #e4e8ee; --paper: #14181e; --pale: #1e242c;
  --rule: #38424f; --soft: #9aa6b5;
  --ok: #4cc9a0; --note: #f0a35a; --bad: #ff8a80; } }
body { font: 15px/1.5 system-ui, sans-serif; color: var(--ink); background: var(--paper);
  max-width: 1040px; margin: 0 auto;
  padding: 1.5rem 1rem 4rem; overflow-wrap: break-word; }
h1 { font-size: 1.7rem; margin: 0; } h2 { font-size: 1.15rem; margin: 2.2rem 0 .5rem; }
.headline { margin: .4rem 0 1.2rem; padding: .7rem 1rem; background: var(--pale);
  border-left: 4px solid var(--ok); }
.headline.doubtful { border-color: var(--note); } .headline.bad { border-color: var(--bad); }
table { border-collapse: collapse; width: 100%; font-variant-numeric: tabular-nums; }
td, th { text-align: left; padding: .25rem .9rem .25rem 0; border-bottom: 1px solid var(--rule);
  vertical-align: top; }
th { color: var(--soft); font-weight: 600; } td.number { text-align: right; white-space: nowrap; }
  th.number { text-align: right; }
.wide { overflow-x: auto; } .ok { color: var(--ok); } .note { color: var(--note); }
  .contradiction { color: var(--bad); font-weight: 600; }
figure { margin: 0 0 1.2rem; } figure img { width: 100%; height: auto; background: #fff;
  border: 1px solid var(--rule); border-radius: 4px; }
figcaption, .soft { color: var(--soft); } code { font: 13px ui-monospace, monospace;
  overflow-wrap: anywhere; }
summary { cursor: pointer; } li { margin: .35rem 0; } .help { color: var(--ok); }
""".strip()


@dataclass(frozen=True)
class Picture:
    """A drawn figure: PNG bytes, title, and how to read it."""

    name: str
    title: str
    reading: str
    png: bytes


def document(
    title: str, headline: str, mood: str, body: Iterable[str], heading: str | None = None
) -> Iterator[str]:
    """A whole page, piece by piece.

    Parameters
    ----------
    title, headline : texts without HTML; the headline without full stop.
    mood : "good", "doubtful" or "bad".
    body : HTML below the headline.
    heading : above the headline, by default the title.
    """
    yield (
        f'<!DOCTYPE html>\n<html lang="en">\n<head>\n<meta charset="utf-8">\n<title>{escape(title)}'
        "</title>\n"
    )
    yield (
        '<meta name="viewport" content="width=device-width,'
        f' initial-scale=1">\n<style>\n{_STYLE}\n</style>\n</head>\n<body>\n<main>\n'
    )
    yield (
        f'<h1>{escape(heading or title)}</h1>\n<p class="headline {mood}">{escape(headline)}.</p>\n'
    )
    yield from body
    yield "</main>\n</body>\n</html>\n"


def pictured(picture: Picture) -> str:
    """A picture with its title and how to read it."""
    title = escape(picture.title)
    return (
        f'<h2>{title}</h2>\n<figure id="{escape(picture.name)}">\n<img alt="{title}"'
        f' src="data:image/png;base64,{base64.b64encode(picture.png).decode("ascii")}">\n'
        f"<figcaption>{escape(picture.reading)}</figcaption>\n</figure>\n"
    )


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
    return f'<div class="wide"><table>\n{top}<tbody>\n{body}</tbody>\n</table></div>\n'


def folded(title: str, content: str) -> str:
    """Content behind a line that opens it."""
    return f"<details><summary>{escape(title)}</summary>\n{content}</details>\n"


def three(values: Sequence[float | None] | None, form: str) -> str:
    """Values of the axes, one beside the other; a dash for what is not determined."""
    return (
        "–"
        if values is None
        else " / ".join("–" if v is None else format(v, f"z{form}") for v in values)
    )
