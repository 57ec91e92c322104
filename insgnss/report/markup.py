"""Pieces of HTML: escaped text, tables, values of three axes."""

import html
from collections.abc import Iterable, Sequence

Row = Sequence[str]


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
