"""The page that a verb leaves: one style for `tune`, `ppk`, `adjust`, `compare`, `inspect` and
`calibrate`.

The order is that of the questions: what came out, in words with its numbers, and why the bar beside
it has its colour; the charts; tables and checks; from what and with what it was made.
"""

import platform
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from ..base import __version__
from ..base.files import text_sha256
from ..base.inputs import sha256
from ..base.provenance import circumstances
from ..records import Check
from .charts.chart import Chart
from .markup import charted, escape, folded, sentence, table, with_contents
from .markup import whole_page as document

MOST_ROWS = 20  # of a table that is not folded


@dataclass(frozen=True, eq=False)
class VerbPage:
    """What stands on the page.

    Parameters
    ----------
    title : str
        Of the window, and the heading.
    headline : str
        The result in one sentence with its numbers, without full stop.
    mood : str
        "good", "doubtful" or "bad": the colour of the bar beside the headline.
    why : str
        Why it has that colour, without full stop.
    charts : sequence of Chart
        In their order.
    first, parts : sequence of str
        HTML above and below the charts.
    inputs : sequence of Path
        The files that it was made from; those that are there are hashed.
    hashes : mapping
        SHA-256 of inputs by name, where they were hashed before.
    settings : mapping
        What was asked for.
    versions : mapping
        Of programs beside insgnss, Python and numpy.
    twin : str
        Text of the JSON file of the same run; empty where there is none.
    """

    title: str
    headline: str
    mood: str
    why: str
    charts: Sequence[Chart] = ()
    first: Sequence[str] = ()
    parts: Sequence[str] = ()
    inputs: Sequence[Path] = ()
    hashes: Mapping[str, str] = field(default_factory=dict)
    settings: Mapping[str, object] = field(default_factory=dict)
    versions: Mapping[str, str] = field(default_factory=dict)
    twin: str = ""

    def html(self) -> Iterator[str]:
        """Yield the page piece by piece."""
        return document(
            self.title,
            self.headline,
            self.mood,
            self._body(),
            charts=self.charts,
            report_sha256=text_sha256(self.twin) if self.twin else "",
        )

    def _body(self) -> Iterator[str]:
        yield reason(self.mood, self.why)
        yield with_contents("".join(self._sections()), {})

    def _sections(self) -> Iterator[str]:
        yield from self.first
        yield from map(charted, self.charts)
        yield from self.parts
        yield from self._made_from()

    def _made_from(self) -> Iterator[str]:
        """What was asked for, from which files, with which programs, when and where."""
        if self.settings:
            yield _pairs("Settings", self.settings)
        given = [path for path in dict.fromkeys(self.inputs) if path.is_file()]
        files = dict(self.hashes) | {str(path): sha256(path) for path in given}
        if files:
            yield _pairs("Inputs (SHA-256)", files)
        yield _pairs("The run", circumstances())
        own = {"insgnss": __version__, "python": platform.python_version()}
        yield _pairs("Versions", own | {"numpy": np.__version__} | dict(self.versions))


def reason(mood: str, why: str) -> str:
    """Return why the bar beside the headline has its colour.

    Parameters
    ----------
    mood : str
        "good", "doubtful" or "bad".
    why : str
        Without full stop.
    """
    return f'<p class="reason {mood}"><b>{mood.capitalize()}</b>: {escape(why)}.</p>\n'


def listed(title: str, texts: Iterable[str]) -> str:
    """Return sentences as a list under a heading; nothing where there are none.

    Parameters
    ----------
    title : str
        The heading.
    texts : iterable of str
        Without HTML.
    """
    items = "".join(f"<li>{escape(sentence(text))}</li>\n" for text in texts)
    return f"<h2>{escape(title)}</h2>\n<ul>\n{items}</ul>\n" if items else ""


def tabulated(
    title: str, rows: Sequence[Sequence[str]], head: Sequence[str] = (), numbers: bool = False
) -> str:
    """Return a table under a heading, folded where it is long; nothing where it has no rows.

    Parameters
    ----------
    title : str
        The heading.
    rows : sequence of sequence of str
        Cells without HTML.
    head : sequence of str
        Of the columns.
    numbers : bool
        Aligns all columns but the first to the right.
    """
    if not rows:
        return ""
    made = table([[escape(cell) for cell in row] for row in rows], [*map(escape, head)], numbers)
    inside = folded(f"{len(rows)} rows", made) if len(rows) > MOST_ROWS else made
    return f"<h2>{escape(title)}</h2>\n{inside}"


def checks_table(checks: Sequence[Check]) -> str:
    """Return what was checked, with the verdicts in colour.

    Parameters
    ----------
    checks : sequence of Check
        Of the run.
    """
    rows = [
        (
            escape(check.name),
            escape(check.found),
            escape(check.expected),
            f'<span class="{check.verdict}">{check.verdict}</span>',
            escape(check.advice),
        )
        for check in checks
    ]
    if not rows:
        return ""
    head = ("check", "found", "expected", "verdict", "advice")
    return f"<h2>Checks</h2>\n{table(rows, head)}"


def preformatted(title: str, lines: Sequence[str]) -> str:
    """Return lines with their columns as they are under a heading.

    Parameters
    ----------
    title : str
        The heading.
    lines : sequence of str
        Without HTML.
    """
    text = escape("\n".join(lines))
    return f'<h2>{escape(title)}</h2>\n<div class="wide"><pre><code>{text}</code></pre></div>\n'


def _pairs(title: str, of: Mapping[str, object]) -> str:
    rows = [(escape(key), f"<code>{escape(value)}</code>") for key, value in of.items()]
    return f"<h2>{title}</h2>\n{table(rows)}"
