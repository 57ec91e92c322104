"""Checks and messages that docs/guides/errors.md explains are those of the package."""

import argparse
import ast
import re
from pathlib import Path

from insgnss.records.verdicts import CHECKS

ROOT = Path(__file__).parents[2]
PAGE = ROOT / "docs" / "guides" / "errors.md"
ERRORS = ("InputError", "DataError", "UsageError", "OptionError")
SHARE_WITHOUT = 0.26  # messages of one case alone, which no family holds


def test_every_check_is_explained() -> None:
    """Oracle: the names that `accept` takes; each has its row, with what to do."""
    text = PAGE.read_text(encoding="utf-8")
    row = r'^\| \*([^*|"]+)\* \| [^|]{20,} \| ([^|]+) \|$'
    rows = dict(re.findall(row, text, re.MULTILINE))
    assert set(rows) == set(CHECKS)
    assert all(len(remedy) > 15 for remedy in rows.values())


def quoted() -> list[str]:
    """The words by which the page tells messages: what the first cells of its rows quote."""
    text = PAGE.read_text(encoding="utf-8")
    cells = re.findall(r'^\| (\*".+?"\*) \| [^|]{15,} \| [^|]{15,} \|$', text, re.MULTILINE)
    return [piece for cell in cells for piece in re.findall(r'\*"(.+?)"\*', cell)]


def sources() -> str:
    return "".join(
        re.sub(r'"\s*f?"', "", path.read_text(encoding="utf-8"))
        for path in sorted((ROOT / "insgnss").rglob("*.py"))
    )


def test_sentences_of_errors_that_are_explained_are_printed() -> None:
    """Oracle: the sources of the package; a message that has changed is explained no more."""
    words, source = quoted(), sources() + Path(argparse.__file__).read_text(encoding="utf-8")
    assert len(words) >= 100
    assert not [piece for piece in words if piece not in source]


def written(node: ast.AST) -> str:
    """What an expression says in any case, its values as {}."""
    if isinstance(node, ast.Constant):
        return str(node.value)
    if isinstance(node, ast.JoinedStr):
        return "".join(map(written, node.values))
    if isinstance(node, ast.BinOp):
        return written(node.left) + written(node.right)
    return "{}"


def messages() -> list[str]:
    """Every message of an error of the package that is written where it is raised."""
    found = []
    for path in sorted((ROOT / "insgnss").rglob("*.py")):
        for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
            if not isinstance(node, ast.Call):
                continue
            name = ast.unparse(node.func)
            if name.split(".")[0] in ERRORS or name.endswith("error_at"):
                text = " ".join(map(written, node.args))
                if len(re.sub(r"\{\}|\W", "", text)) > 25:
                    found.append(text)
    return found


def test_most_messages_have_their_family() -> None:
    """Oracle: the raise sites; who has a message finds it by words that it has."""
    words, every = quoted(), messages()
    assert len(every) > 500
    strange = [text for text in every if not any(piece in text for piece in words)]
    assert len(strange) < SHARE_WITHOUT * len(every), "\n".join(strange)
