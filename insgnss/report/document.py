"""The document of what a verb found, filled once and rendered to the terminal and to a page.

It has a headline, a verdict (`verdict.py`) and sections. A section holds sentences, tables and
drawings in their order; a sentence or cell is a plain text, or `Marked` where the page shows it in
another way. JSON files have numbers of their own, which the verb gives to `write_with_page`.
"""

import platform
import textwrap
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from itertools import groupby
from pathlib import Path
from types import MappingProxyType
from typing import Any, Literal

import numpy as np

from ..base import __version__
from ..base.files import atomic_write, json_text, text_sha256
from ..base.findings import Finding
from ..base.inputs import sha256
from ..base.provenance import circumstances
from .charts.chart import Chart
from .charts.encoded import script_safe
from .markup import (
    chart_place,
    closing,
    embed_json,
    escape,
    fold_content,
    opening,
    sentence,
    table,
    with_contents,
)
from .terms import TermLinks
from .verdict import Verdict

WIDTH = 110  # most characters of a row of a table: 110, because usual terminals wrap wider ones
LEAST_WIDTH = 40  # least characters of the last column: 40, because narrower ones are hard to read
MOST_UNFOLDED_ROWS = 20  # most rows of a table that is not folded: 20, because more fill a screen
# most remarks that are not folded: 3, because they do not hide what stands below them
FEW_REMARKS = 3
Shown = Literal["both", "page", "terminal"]
APPENDIX = "appendix"  # class of what a page prints only where asked for, and the box that asks
VERDICT_MARKS = {"ok": "ok  ", "note": "note", "contradiction": "BAD "}
ASCII_SIGNS = str.maketrans({"±": "+-", "–": "-"})  # consoles of all encodings have these


class Marked(str):
    """A sentence or cell that the page shows in another way than plain text.

    Parameters
    ----------
    text : str
        What stands there.
    kind : str
        "ok", "note", "contradiction", "whole" (not broken into lines), "strong", "code"; of a
        sentence "soft" or "text" for a paragraph instead of an item of a list.
    link : str
        The address that it leads to.
    help : str
        A second sentence: what to do about it.
    """

    __slots__ = ("help", "kind", "link")
    kind: str
    link: str
    help: str

    def __new__(cls, text: object, kind: str = "", *, link: str = "", help: str = "") -> "Marked":
        marked = super().__new__(cls, text)
        marked.kind, marked.link, marked.help = kind, link, help
        return marked


@dataclass(frozen=True)
class Table:
    """A table of texts.

    Parameters
    ----------
    rows : sequence of sequence of str
        Its cells.
    head : sequence of str
        Headings of the columns.
    numbers : bool
        Whether all columns but the first stand to the right.
    name : str
        What its rows are, for the line that opens a folded table.
    """

    rows: Sequence[Sequence[str]]
    head: Sequence[str] = ()
    numbers: bool = False
    name: str = "rows"

    @classmethod
    def of(
        cls, records: Iterable[Any], columns: Mapping[str, Callable[[Any], Any]], **more: Any
    ) -> "Table":
        """Return a table of one row a record.

        Parameters
        ----------
        records : iterable
            What the rows are of.
        columns : mapping
            By its head what a column says of a record.
        more
            Further fields.
        """
        rows = [[cell(record) for cell in columns.values()] for record in records]
        return cls(rows, tuple(columns), **more)

    def html(self) -> str:
        """Return the table for the page, folded where it is long."""
        if not self.rows:
            return ""
        cells = [[_inline(cell) for cell in row] for row in self.rows]
        whole = table(cells, [*map(_inline, self.head)], self.numbers)
        return (
            fold_content(f"{len(cells)} {self.name}", whole)
            if len(cells) > MOST_UNFOLDED_ROWS
            else whole
        )

    def lines(self) -> Iterator[str]:
        """Yield the lines for the terminal, columns aligned, the last one wrapped."""
        rows = [
            [cell.translate(ASCII_SIGNS) for cell in row] for row in (self.head, *self.rows) if row
        ]
        width = [max((len(row[k]) for row in rows), default=0) for k in range(len(rows[-1]) - 1)]
        last_width = max(WIDTH - sum(width) - 2 * len(width), LEAST_WIDTH)
        longest = max(len(row[-1]) for row in rows)
        for row in rows:
            alignments = "<" + (">" if self.numbers else "<") * len(width)
            aligned = (
                f"{cell:{side}{wide}}"
                for cell, side, wide in zip(row[:-1], alignments, width, strict=False)
            )
            cells = textwrap.wrap(
                row[-1], last_width, break_long_words=False, break_on_hyphens=False
            )
            end = f"{row[-1]:>{longest}}" if self.numbers and width else "".join(cells[:1])
            yield "  ".join([*aligned, end]).rstrip()
            if not self.numbers:
                yield from (
                    " " * (sum(width) + 2 * len(width)) + continued for continued in cells[1:]
                )


@dataclass(frozen=True)
class Drawing:
    """A piece of HTML that only the page shows."""

    html: str


@dataclass(frozen=True)
class Section:
    """A section with its title; without parts it appears nowhere.

    Parameters
    ----------
    title : str
        The heading.
    parts : iterable of str, Table or Drawing
        What stands in it.
    on : str
        Whether the terminal, the page or both show it.
    more : sequence of str
        Sentences of less weight, which the page folds away where they are many.
    brief : bool
        Whether it is in the summary that a page prints; the rest is its appendix.
    """

    title: str
    parts: Iterable["str | Table | Drawing"] = ()
    on: Shown = "both"
    more: Sequence[str] = ()
    brief: bool = False

    @property
    def _further(self) -> Sequence[str]:
        return self.more[FEW_REMARKS:]

    @property
    def _number_of_further(self) -> str:
        count = len(self._further)
        return f"and {count} further remark{'s' * (count > 1)} of less weight"

    def html(self) -> str:
        """Return the section of the page."""
        runs = groupby(self.parts, key=_is_item)
        inside = "".join(
            _listed(run) if items else "".join(map(_block, run)) for items, run in runs
        )
        if self.more:
            first, more = map(_soft_paragraph, (self.more[:FEW_REMARKS], self._further))
            inside += first + (fold_content(self._number_of_further, more) if self._further else "")
        return f"<h2>{escape(self.title)}</h2>\n{inside}" if inside else ""

    def lines(self) -> Iterator[str]:
        """Yield the lines for the terminal."""
        more = [self._number_of_further] if self._further else []
        for block in (*self.parts, *self.more[:FEW_REMARKS], *more):
            if isinstance(block, Table) and block.rows:
                yield from block.lines()
            elif isinstance(block, str):
                remedy = block.help if isinstance(block, Marked) else ""
                yield (f"{block}; {remedy}" if remedy else block).translate(ASCII_SIGNS)


@dataclass(frozen=True, eq=False)
class Document:
    """What a verb says.

    Parameters
    ----------
    title : str
        Title of the page.
    headline : str
        The result in one sentence with its numbers, without full stop.
    verdict : Verdict
        How far the result is to be trusted, and why.
    sections : iterable of Section or Chart
        In the order of the questions: what limits the result, how it looks, in numbers.
    inputs : sequence of Path
        The files that it was made from; those that are there are hashed.
    hashes : mapping
        SHA-256 of inputs by name, where they were hashed before.
    settings : mapping
        What was asked for.
    versions : mapping
        Versions of programs beside insgnss, Python and numpy.
    files : sequence of Path
        What was written, which the terminal lists.
    next : str
        What to do with it: the last line on the terminal.
    heading : str
        Heading of the page where it is not the title.
    about : str
        What stands below the heading: whose it is and when; without full stop.
    """

    title: str
    headline: str
    verdict: Verdict
    sections: Iterable[Section | Chart] = ()
    inputs: Sequence[Path] = ()
    hashes: Mapping[str, str] = field(default_factory=dict)
    settings: Mapping[str, object] = field(default_factory=dict)
    versions: Mapping[str, str] = field(default_factory=dict)
    files: Sequence[object] = ()
    next: str = ""
    heading: str = ""
    about: str = ""

    def text(self) -> str:
        """Return the text for the terminal."""
        lines = [self.headline.translate(ASCII_SIGNS), f"{self.verdict}.".translate(ASCII_SIGNS)]
        for section in self.sections:
            if isinstance(section, Section) and section.on != "page":
                inside = [f"  {line}" for line in section.lines()]
                lines += ["", section.title, *inside] if inside else []
        end = [*(f"wrote {file}" for file in self.files), *([self.next] if self.next else [])]
        return "\n".join([*lines, *([""] if end else []), *end])

    def html(
        self,
        made_from: "Sequence[Section] | None" = None,
        data: Mapping[str, Any] = MappingProxyType({}),
        twin_sha256: str = "",
    ) -> Iterator[str]:
        """Yield the page piece by piece.

        Parameters
        ----------
        made_from : sequence of Section, optional
            Takes the place of settings, inputs, run and versions.
        data : mapping
            What the page's script needs besides, by name.
        twin_sha256 : str
            SHA-256 of the JSON file of the same run; empty where there is none.
        """
        shown = [
            section
            for section in self.sections
            if isinstance(section, Chart) or section.on != "terminal"
        ]
        settings, *origins = self._made_from() if made_from is None else made_from
        unabridged = not any(isinstance(section, Section) and section.brief for section in shown)

        def placed(section: Section | Chart) -> str:
            html = chart_place(section) if isinstance(section, Chart) else section.html()
            brief = unabridged or (section.map if isinstance(section, Chart) else section.brief)
            return html if brief or not html else f'<div class="{APPENDIX}">\n{html}</div>\n'

        word, why, _ = self.verdict
        reason = f"<strong>{escape(self.verdict.shown)}</strong>: {escape(why)}."
        terms = TermLinks()
        top = terms.within(
            f'<p class="headline {word}">{escape(self.headline)}.</p>\n'
            f'<p class="reason {word}">{reason}</p>\n'
        )
        body = terms.within("".join(map(placed, shown)))
        body += placed(_meanings(terms)) + placed(settings)
        origin = "".join(map(placed, origins))
        charts = [section for section in shown if isinstance(section, Chart)]
        yield opening(self.title, bool(charts))
        yield f"<h1>{escape(self.heading or self.title)}</h1>\n"
        yield f'<p class="soft about">{escape(sentence(self.about))}</p>\n' if self.about else ""
        yield top
        yield with_contents(body, "" if unabridged else APPENDIX)
        yield origin
        yield from (embed_json(name, script_safe(block)) for name, block in data.items())
        yield from closing(charts, twin_sha256)

    def _made_from(self) -> Iterator[Section]:
        """Settings, input files, programs, date and place."""
        files = [path for path in dict.fromkeys(self.inputs) if path.is_file()]
        run_by = {"insgnss": __version__, "python": platform.python_version()}
        yield pairs("Settings", self.settings)
        yield pairs("Inputs (SHA-256)", dict(self.hashes) | {str(p): sha256(p) for p in files})
        yield pairs("The run", circumstances())
        yield pairs("Versions", run_by | {"numpy": np.__version__} | dict(self.versions))


def _meanings(terms: TermLinks) -> Section:
    """Return the section of the terms that a page links."""
    html = "".join(
        f'<dt id="{anchor}">{escape(term)}</dt><dd>{escape(meaning)}</dd>\n'
        for anchor, term, meaning in terms.rows()
    )
    return Section("Terms", [Drawing(f"<dl>\n{html}</dl>\n")] if html else [], "page")


def write_with_page(
    document: Document, numbers: Mapping[str, Any], json_file: Path, page: Path
) -> None:
    """Write the JSON file of a document's numbers, and its page, which names the file by its hash.

    Parameters
    ----------
    document : Document
        What stands on the page.
    numbers : mapping
        What the JSON file holds.
    json_file, page : Path
        The files; each appears whole or not at all.
    """
    twin = json_text(numbers)
    atomic_write(page, document.html(twin_sha256=text_sha256(twin)))
    atomic_write(json_file, twin)


def write_json(path: Path, numbers: Mapping[str, Any]) -> None:
    """Write what a verb found as a JSON file, whole or not at all."""
    atomic_write(path, json_text(numbers))


def checks_section(checks: Iterable[Finding], title: str = "Checks", on: Shown = "both") -> Section:
    """Return the section of what was checked, with the verdicts in colour.

    Parameters
    ----------
    checks : iterable of Finding
        Checks of the run.
    title : str
        The heading.
    on : str
        Whether the terminal, the page or both show it.
    """
    rows = []
    for c in checks:
        says = f"{c.found}; {c.advice}" if c.advice else c.found
        says += f" (expected: {c.expected})" if c.expected else ""
        rows.append((c.name, Marked(c.verdict, c.verdict), says))
    return Section(title, [_Checks(rows, ("check", "verdict", "found"), name="checks")], on)


class _Checks(Table):
    """The table of checks; on the terminal a sentence a check."""

    def lines(self) -> Iterator[str]:
        """Yield the verdict and the check in one line each."""
        return (f"{VERDICT_MARKS[verdict]}  {name}: {says}" for name, verdict, says in self.rows)


def limit_sentences(limits: Iterable[Finding], worst: str = "") -> list[Marked]:
    """Return what limits a result as sentences, each with what would help.

    Parameters
    ----------
    limits : iterable of Finding
        In their order.
    worst : str
        How the page marks those of rank one and more.
    """
    return [Marked(x.found, worst if x.rank >= 1.0 else "", help=x.advice) for x in limits]


def pairs(title: str, of: Mapping[str, object]) -> Section:
    """Return a section of names and values, which only the page shows.

    Parameters
    ----------
    title : str
        The heading.
    of : mapping
        Values by name.
    """
    rows = [(key, Marked("–" if value is None else value, "code")) for key, value in of.items()]
    return Section(title, [Table(rows, name="keys")], "page")


def dotted_keys(of: Mapping[str, Any], prefix: str = "") -> Iterator[tuple[str, object]]:
    """Yield the values of nested tables by their dotted keys, as in the flight file."""
    for key, value in of.items():
        if isinstance(value, Mapping) and value:
            yield from dotted_keys(value, f"{prefix}{key}.")
        else:
            yield f"{prefix}{key}", value


def strong(text: str, is_strong: bool) -> str:
    """Return a cell that stands out where `is_strong`."""
    return Marked(text, "strong") if is_strong else text


def _is_item(block: "str | Table | Drawing") -> bool:
    """Tell whether a sentence is an item of a list, and no paragraph."""
    kind = block.kind if isinstance(block, Marked) else ""
    return isinstance(block, str) and kind not in ("soft", "text")


def _block(block: "str | Table | Drawing") -> str:
    """Return a table, drawing or paragraph of the page."""
    if isinstance(block, Table):
        return block.html()
    if isinstance(block, Drawing):
        return block.html
    assert isinstance(block, Marked)
    return f'<p class="{block.kind}">{_escaped(sentence(block))}</p>\n'


def _soft_paragraph(texts: Iterable[Any]) -> str:
    """Return the HTML of remarks in the paler ink."""
    return f'<div class="soft">{_listed(texts)}</div>\n'


def _listed(texts: Iterable[Any]) -> str:
    """Return sentences as a list of the page."""
    items = []
    for text in texts:
        marked = text if isinstance(text, Marked) else Marked(text)
        item = _escaped(sentence(text))
        if marked.help:
            item += f' <span class="help">{_escaped(sentence(marked.help))}</span>'
        items.append(f'<li class="{marked.kind}">{item}</li>\n'.replace(' class=""', "", 1))
    return f"<ul>\n{''.join(items)}</ul>\n" if items else ""


def _escaped(text: str) -> str:
    return escape(text.replace("+-", "±"))


def _inline(cell: str) -> str:
    """Return a cell as HTML."""
    text = _escaped(cell)
    if not isinstance(cell, Marked):
        return text
    if cell.link:
        text = f'<a href="{escape(cell.link)}">{text}</a>'
    if cell.kind in ("strong", "code"):
        tag = {"strong": "b", "code": "code"}[cell.kind]
        return f"<{tag}>{text}</{tag}>"
    return f'<span class="{cell.kind}">{text}</span>' if cell.kind else text
