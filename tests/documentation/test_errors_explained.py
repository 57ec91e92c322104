"""Checks and messages that docs/guides/errors.md explains are those of the package."""

import re
from pathlib import Path

from insgnss.recognise.plausibility import NAMES

ROOT = Path(__file__).parents[2]
PAGE = ROOT / "docs" / "guides" / "errors.md"


def test_every_check_is_explained() -> None:
    """Oracle: the names that `accept` takes; each has its row, with what to do."""
    text = PAGE.read_text(encoding="utf-8")
    row = r'^\| \*([^*|"]+)\* \| [^|]{20,} \| ([^|]+) \|$'
    rows = dict(re.findall(row, text, re.MULTILINE))
    assert set(rows) == set(NAMES)
    assert all(len(remedy) > 15 for remedy in rows.values())


def test_sentences_of_errors_that_are_explained_are_printed() -> None:
    """Oracle: the sources of the package; a message that has changed is explained no more."""
    text = PAGE.read_text(encoding="utf-8")
    quoted = re.findall(r'^\| \*"([^"]+)"\*', text, re.MULTILINE)
    assert len(quoted) >= 10
    source = "".join(
        re.sub(r'"\s*f?"', "", path.read_text(encoding="utf-8"))
        for path in sorted((ROOT / "insgnss").rglob("*.py"))
    )
    for sentence in quoted:
        for piece in sentence.split(" ... "):
            assert piece in source, f"nothing says {piece!r}"
