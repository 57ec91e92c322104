"""Sphinx: the documentation as a site, built from the root of the repository.

    sphinx-build -W --keep-going -c docs -b html . OUT      pages; links between them are checked
    sphinx-build -c docs -b linkcheck . OUT                 those that lead outside as well

The root is the source: data_specs/, benchmarks/ and the changelog are pages where they stand, and a
relative link leads to the same place here and in the repository's web view.
"""

import argparse
import sys
from pathlib import Path
from typing import Any

from docutils import nodes
from docutils.parsers.rst import Directive

ROOT = Path(__file__).resolve().parents[1]
sys.path.insert(0, str(ROOT))

project = "insgnss"
root_doc = "docs/index"
extensions = ["myst_parser", "sphinx.ext.autodoc", "sphinx.ext.napoleon"]
include_patterns = [
    "docs/**",
    "data_specs/*.md",
    "benchmarks/*.md",
    "CHANGELOG.md",
    ".github/CONTRIBUTING.md",
]
exclude_patterns = [".*env", "site", "build", "dist", "insgnss", "tests"]  # not even looked through
html_theme = "furo"
html_static_path = ["_static"]
html_css_files = ["narrow.css"]
html_title = "insgnss"
html_show_sphinx = False
html_show_copyright = False
myst_heading_anchors = 4
smartquotes = False  # two dashes are those of an option
# the last: fences such as ```true of data_specs name what an example is, not a language
suppress_warnings = ["misc.highlighting_failure"]
autodoc_member_order = "bysource"
autodoc_typehints = "none"
napoleon_google_docstring = False


class Verbs(Directive):
    """Help of every verb of the command line, from its parser: a section each."""

    def run(self) -> list[nodes.Node]:
        """Return the sections."""
        return [section for name, parser in verbs() for section in [self._section(name, parser)]]

    def _section(self, name: str, parser: argparse.ArgumentParser) -> nodes.Node:
        section = nodes.section(ids=[nodes.make_id(f"insgnss {name}")], names=[name])
        section += nodes.title(text=f"insgnss {name}")
        text = parser.format_help()
        section += nodes.literal_block(text, text, language="text")
        return section


def verbs() -> list[tuple[str, argparse.ArgumentParser]]:
    """Return the verbs with their parsers; those of a verb with kinds follow it."""
    from insgnss.cli import build_parser

    def below(parser: argparse.ArgumentParser, prefix: str) -> list[Any]:
        rows = []
        for action in parser._actions:
            if isinstance(action, argparse._SubParsersAction):
                for name, verb in action.choices.items():
                    verb.complete()
                    verb.formatter_class = Wide(verb.formatter_class)
                    rows += [(prefix + name, verb), *below(verb, f"{prefix}{name} ")]
        return rows

    return below(build_parser(), "")


def Wide(formatter: Any) -> Any:
    """Return a formatter of help of one width, whatever terminal the site is built in."""
    return lambda prog: formatter(prog, width=100)


def outside_the_site(app: Any, doctree: nodes.document) -> None:
    """Links to the package's own files and folders become their names: they are no pages."""
    from sphinx.addnodes import download_reference, pending_xref

    for link in [*doctree.findall(download_reference), *doctree.findall(pending_xref)]:
        target = str(link.get("reftarget", ""))
        page = app.env.doc2path(app.env.docname)
        path = (Path(page).parent / target.partition("#")[0]).resolve()
        if path.is_relative_to(ROOT) and (path.is_dir() or path.suffix in {".py", ".toml", ".cff"}):
            link.replace_self(nodes.literal(text=link.astext()))


def first_page(app: Any, exception: Exception | None) -> None:
    """Write index.html at the top of the site, which leads to the first page."""
    if exception is None and app.builder.name == "html":
        (Path(app.outdir) / "index.html").write_text(
            '<!doctype html><meta charset="utf-8"><title>insgnss</title>'
            '<meta http-equiv="refresh" content="0; url=docs/index.html">'
            '<a href="docs/index.html">insgnss</a>\n',
            encoding="utf-8",
        )


SECTIONS = ("Parameters", "Returns", "Raises", "Yields", "Attributes")


def as_sentences(app: Any, what: str, name: str, obj: Any, options: Any, lines: list[str]) -> None:
    """Put what follows `name :` into the description, where a docstring has sentences there."""
    section, done = "", []
    for line, below in zip(lines, [*lines[1:], ""], strict=True):
        if below and set(below) == {"-"}:
            section = line
        if section not in SECTIONS or line in (section, "") or set(line) == {"-"}:
            done.append(line)
        elif line[0] != " " and " : " in line:
            names, _, words = line.partition(" : ")
            ends = below[:1] == " " and below.strip()[:1].isupper() and words[-1:] not in ".;,"
            done += [names, f"    {words}{'.' if ends else ''}"]
        else:
            done.append(line)
    lines[:] = done


def setup(app: Any) -> dict[str, bool]:
    """Register what stands above."""
    app.add_directive("insgnss-verbs", Verbs)
    app.connect("autodoc-process-docstring", as_sentences, priority=100)  # before napoleon
    app.connect("doctree-read", outside_the_site)
    app.connect("build-finished", first_page)
    return {"parallel_read_safe": True}
