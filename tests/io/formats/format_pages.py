"""Examples on the pages of data_specs, for the tests of formats that are written only."""

import re
import shlex
from dataclasses import dataclass
from pathlib import Path
from typing import Any

SPECS = Path(__file__).parents[3] / "data_specs"

UNREADABLE = (
    *("2.1e\N{MINUS SIGN}4", "5%", "\N{ARABIC-INDIC DIGIT ONE}2", "1_0", "0x10"),
    *("nan", "inf", "1e308", "1e-400", "1.2.3", ""),
)
"""Texts where a number belongs that are none here, though Python takes some of them for one."""


def on_page(name: str, kind: str = "true") -> str:
    """The first block of this kind; its first line may say more than the kind."""
    text = (SPECS / f"{name}.md").read_text()
    found = re.search(rf"^```{kind}\b[^\n]*\n(.*?)```", text, re.DOTALL | re.MULTILINE)
    assert found is not None, f"{name}.md has no {kind} example"
    return found[1]


def without_version(text: str) -> str:
    return re.sub(r"insgnss \d[\w.]*", "insgnss", text).strip()


@dataclass(frozen=True)
class Example:
    """What a page of data_specs shows of an export, by the line above its block: its kind, then
    `export=NAME frame=FRAME`, a `file` beside the product, and options of the writer.
    """

    page: str
    kind: str
    export: str
    frame: str
    options: dict[str, Any]
    file: str


def examples() -> list[Example]:
    """Every such block of every page."""
    shown = []
    for path in sorted(SPECS.glob("*.md")):
        for line in re.findall(r"^```(\w+ export=.*)$", path.read_text(), re.MULTILINE):
            kind, *pairs = shlex.split(line)
            keys = dict(pair.split("=", 1) for pair in pairs)
            export, frame, file = (keys.pop(key, "") for key in ("export", "frame", "file"))
            options = {key: _number(value) for key, value in keys.items()}
            shown.append(Example(path.stem, kind, export, frame, options, file))
    return shown


def _number(value: str) -> float | str:
    try:
        return float(value)
    except ValueError:
        return value
