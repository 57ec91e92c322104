"""The field's terms in the names of the code, and reasons of its numbers, read from the sources.

Retired words stand nowhere. Of names that say nothing of what they hold, and of constants whose
number has no reason beside it, `vocabulary.toml` has the counts of each wing, which only go down:
`python tests/test_vocabulary.py` lowers them to what the sources have.
"""

import ast
import re
import tomllib
from collections.abc import Iterator
from functools import cache
from pathlib import Path

import pytest

from insgnss.batch.installation.limits import limits_of

ROOT = Path(__file__).parents[1]
MODULES = sorted((ROOT / "insgnss").rglob("*.py"))
WINGS = sorted(path.parent.name for path in (ROOT / "insgnss").glob("*/__init__.py"))
TABLE = Path(__file__).with_suffix("").with_name("vocabulary.toml")

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
# only as a whole name, too; those that are left are counted, and what they hold says it better
VAGUE = {"own", "given", "words", "seen", "off", "rest", "odd", "there", "here", "made", "both"}
VAGUE |= {"other", "others", "left", "apart", "thing", "things", "asked"}
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
    seen = ["solve_stretch", "Stretch", "STILL_S", "_lone", "what", "unTold", "on_wheels", "_found"]
    assert all(map(retired, seen))
    terms = ["segment", "what_if", "stillness", "founder", "placed", "atmosphere", "party"]
    assert not any(map(retired, terms))


@cache
def source(path: Path) -> tuple[tuple[tuple[str, int], ...], tuple[str, ...]]:
    """Names that a module defines, and its constants that are numbers without a reason."""
    text = path.read_text(encoding="utf-8")
    tree = ast.parse(text)
    return tuple(names(tree)), tuple(limit.name for limit in limits_of(text) if not limit.reason)


def test_names_are_the_terms_of_the_field() -> None:
    """Oracle: docs/glossary.md's words, by the table of those that they replaced."""
    bad = {
        f"{path.relative_to(ROOT)}:{line}: {name} -> {term}"
        for path in MODULES
        for name, line in source(path)[0]
        if (term := retired(name))
    }
    assert MODULES
    assert not bad, "\n".join(sorted(bad))


def vague_names(path: Path) -> list[str]:
    """Names that a module defines and that say nothing of what they hold."""
    return [name for name, _ in source(path)[0] if name.strip("_") in VAGUE]


KINDS = {"names": vague_names, "constants": lambda path: source(path)[1]}


@cache
def counts() -> dict[str, dict[str, int]]:
    """How many there are of each kind in each wing."""
    out = {kind: dict.fromkeys(WINGS, 0) for kind in KINDS}
    for path in MODULES:
        wing = path.relative_to(ROOT / "insgnss").parts[0]
        for kind, places in KINDS.items():
            if wing in WINGS:
                out[kind][wing] += len(places(path))
    return out


def test_the_counts_see_what_they_count(tmp_path: Path) -> None:
    """Oracle: examples by hand."""
    module = tmp_path / "module.py"
    module.write_text(
        "A = 1.0\nB = 2.0  # m, as the receiver has it\nI = 1\n# s\nC, D = 1.0, radians(2.0)\n"
        'E = 3\n"""Documented."""\nF = np.array([1.0, 2.0])\nG = ("x", 1.0)\nH = 2 * A\n'
        "def own(given, lever):\n    seen = given\n    return [off for off in lever]\n"
    )
    assert KINDS["constants"](module) == ("A", "I", "F", "H")
    assert sorted(vague_names(module)) == ["given", "off", "own", "seen"]


@pytest.mark.parametrize("kind", KINDS)
def test_counts_only_go_down(kind: str) -> None:
    """Oracle: the committed table; where a wing has more, its newest names or numbers need better
    words; where it has fewer, `python tests/test_vocabulary.py` lowers the table.
    """
    assert counts()[kind] == tomllib.loads(TABLE.read_text(encoding="utf-8"))[kind]


def lowered() -> str:
    """The table with the counts of the sources where these are lower."""
    table = tomllib.loads(TABLE.read_text(encoding="utf-8")) if TABLE.exists() else {}
    lines = []
    for kind, here in counts().items():
        limits = table.get(kind, {})
        lines += [f"[{kind}]", *(f"{w} = {min(n, limits.get(w, n))}" for w, n in here.items()), ""]
    return "\n".join(lines)


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


if __name__ == "__main__":
    TABLE.write_text(lowered(), encoding="utf-8")
