"""Examples on the pages of data_specs, for the tests of formats that are written only."""

import re
from pathlib import Path

SPECS = Path(__file__).parents[3] / "data_specs"

UNREADABLE = (
    *("2.1e\N{MINUS SIGN}4", "5%", "\N{ARABIC-INDIC DIGIT ONE}2", "1_0", "0x10"),
    *("nan", "inf", "1e308", "1e-400", "1.2.3", ""),
)
"""Texts where a number belongs that are none here, though Python takes some of them for one."""


def on_page(name: str, kind: str = "true") -> str:
    found = re.search(rf"```{kind}\n(.*?)```", (SPECS / f"{name}.md").read_text(), re.DOTALL)
    assert found is not None, f"{name}.md has no {kind} example"
    return found[1]


def without_version(text: str) -> str:
    return re.sub(r"insgnss \d[\w.]*", "insgnss", text).strip()
