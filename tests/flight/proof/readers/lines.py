"""Lines of text files."""

import re
from pathlib import Path

import numpy as np

from .geometry import Array


def rows(path: Path, separator: str | None = None) -> list[list[str]]:
    """Fields of the lines that are neither empty nor comments (#)."""
    lines = path.read_text(encoding="utf-8").splitlines()
    return [
        [x.strip() for x in line.split(separator)]
        for line in lines
        if line.strip() and not line.startswith("#")
    ]


def comments(path: Path) -> list[str]:
    """The lines behind #."""
    return [
        line.lstrip("# ").rstrip()
        for line in path.read_text(encoding="utf-8").splitlines()
        if line.startswith("#")
    ]


def named(table: list[list[str]], columns: str) -> tuple[list[str], dict[str, Array]]:
    """Names and numbers of rows whose first fields are `columns`, `name` among them."""
    fields = dict(zip(columns.split(), zip(*table, strict=True), strict=False))
    names = list(fields.pop("name"))
    return names, {key: np.array([float(x) for x in values]) for key, values in fields.items()}


def numbers(text: str) -> list[float]:
    """Numbers within a text."""
    return [float(x) for x in re.findall(r"[-+]?\d+\.?\d*(?:[eE][-+]?\d+)?", text)]
