"""The field's terms in the names of the code, read from the sources."""

import ast
import re
from collections.abc import Iterator
from functools import cache
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[1]
MODULES = sorted((ROOT / "insgnss").rglob("*.py"))
WINGS = sorted(path.parent.name for path in (ROOT / "insgnss").glob("*/__init__.py"))

# retired word: the standard term that took its place
PARTS = {  # wherever it stands in a name
    "stretch": "segment",
    "stretches": "segments",
    "still": "stationary, ZUPT",
    "rests": "stationary periods",
    "wheel": "non-holonomic constraint",
    "wheels": "non-holonomic constraint",
    "hang": "stuck channel",
    "hangs": "stuck channel",
    "hanging": "stuck channel",
    "lasting": "time-correlated",
    "coloured": "time-correlated",
    "reopen": "covariance reset",
    "reopened": "covariance reset",
    "doubt": "robust (Huber) weight threshold",
    "believed": "validated",
    "hampered": "degraded",
    "lone": "isolated",
    "stray": "outlier",
    "strays": "outliers",
    "told": "message, reported, known from, ...",
    "said": "note, statement, ...",
    "asked": "requested",
    "carried": "propagated",
    "flown": "from_flight_file, recorded, ...",
}
WHOLE = {  # only as a whole name: it says nothing of what it holds
    "found": "finding, match, result, ... what it holds",
    "what": "message, description, ... what it holds",
    "at": "index, rows, epochs, ... what it holds",
    "place": "position, location, path, ... what it holds",
    "known": "what it is",
    "tried": "what it is",
    "searched": "what it is",
    "part": "segment, piece, sub_problem, ... what it is",
    "make": "what it makes",
    "late": "time offset, latency",
    "weak": "unsupported, low C/N0",
    "closed": "closed_loop",
    "hold": "feedback threshold",
    "fed": "feedback",
    "follow": "cross tracking",
    "lost": "rejected since, missing, ...",
    "carry": "propagate",
    "store": "filter_history",
}
FIELDS = {"found", "what", "place"}  # of published records (Check.found, Export.what) they stay
METHODS = {"at"}  # of published records (trajectory.at(t)) they stay as well


def names(tree: ast.Module) -> Iterator[tuple[str, int]]:
    """Names that a module defines: functions, classes, parameters, variables."""
    nodes = list(ast.walk(tree))
    of_classes = [
        statement for node in nodes if isinstance(node, ast.ClassDef) for statement in node.body
    ]
    fields = {
        id(statement.target)
        for statement in of_classes
        if isinstance(statement, ast.AnnAssign)
        and isinstance(statement.target, ast.Name)
        and statement.target.id in FIELDS
    }
    methods = {
        id(statement)
        for statement in of_classes
        if isinstance(statement, ast.FunctionDef) and statement.name in METHODS
    }
    for node in nodes:
        if isinstance(node, ast.FunctionDef | ast.ClassDef) and id(node) not in methods:
            yield node.name, node.lineno
        elif isinstance(node, ast.arg):
            yield node.arg, node.lineno
        elif (
            isinstance(node, ast.Name)
            and isinstance(node.ctx, ast.Store)
            and id(node) not in fields
        ):
            yield node.id, node.lineno


@cache
def retired(name: str) -> str | None:
    """The standard term for a retired word in `name`, None where there is none."""
    words = re.findall(r"[A-Z]+(?![a-z])|[A-Z]?[a-z]+|\d+", name)
    for word in map(str.lower, words):
        if word in PARTS:
            return PARTS[word]
    return WHOLE.get(name.strip("_").lower())


def test_the_rule_sees_retired_words() -> None:
    """Oracle: examples by hand."""
    assert all(
        map(
            retired,
            (
                "solve_stretch",
                "Stretch",
                "STILL_S",
                "_lone",
                "what",
                "unTold",
                "on_wheels",
                "_found",
            ),
        )
    )
    assert not any(
        map(
            retired, ("segment", "what_if", "stillness", "founder", "placed", "atmosphere", "party")
        )
    )


def test_names_are_the_terms_of_the_field() -> None:
    """Oracle: docs/glossary.md's words, by the table of those that they replaced."""
    bad = {
        f"{path.relative_to(ROOT)}:{line}: {name} -> {term}"
        for path in MODULES
        for name, line in names(ast.parse(path.read_text(encoding="utf-8")))
        if (term := retired(name))
    }
    assert MODULES
    assert not bad, "\n".join(sorted(bad))


def test_glossary_points_at_what_is_there() -> None:
    """Oracle: the directory's listing."""
    for page in ("glossary.md", "ARCHITECTURE.md"):
        text = (ROOT / "docs" / page).read_text(encoding="utf-8")
        missing = [p for p in re.findall(r"`(insgnss/[\w./]+)`", text) if not (ROOT / p).exists()]
        assert missing == [], page


@pytest.mark.parametrize("wing", WINGS)
def test_the_docstring_of_a_wing_points_at_what_is_there(wing: str) -> None:
    """Oracle: the directory's listing; a bare name is beside the path before it."""
    folder = beside = ROOT / "insgnss" / wing
    text = ast.get_docstring(ast.parse((folder / "__init__.py").read_text(encoding="utf-8"))) or ""
    for name in re.findall(r"`([\w./]+/[\w.]*|\w+\.(?:py|json))`", text):
        places = [base / name for base in (folder, ROOT, beside) if (base / name).exists()]
        assert places, name
        beside = places[-1] if places[-1].is_dir() else places[-1].parent
    rooms = {path.parent.name for path in folder.glob("*/__init__.py")}
    assert not [room for room in sorted(rooms) if f"{room}/" not in text]
