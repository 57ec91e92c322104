"""The pages data_specs/flight_file.md and block_file.md, as far as the schema knows what they say,
and the formats of docs/guides/exports.md.

Prose is written by hand; what stands between two comments of the page is rendered:

    <!-- rendered: keys -->
    ...
    <!-- end of rendered -->

`python scripts/render_options.py` renders the pages of the working directory anew, or those that it
is given. A test holds the pages against `rendered`.
"""

import re
import sys
import textwrap
from collections.abc import Callable, Iterable, Mapping
from pathlib import Path
from typing import Any

from insgnss.base.files import atomic_write
from insgnss.base.wording import phrase
from insgnss.flight.config.block_file import BLOCK_TABLES
from insgnss.flight.config.flight_file import FLIGHT_TABLES
from insgnss.gnss.covariance_model import MODEL, CovarianceModel
from insgnss.io.formats import EXPORTS
from insgnss.io.options.camera_options import OF_FURTHER
from insgnss.io.options.schema import Declared, declared_options, options_of

PAGES = tuple(
    Path(name)
    for name in ("data_specs/flight_file.md", "data_specs/block_file.md", "docs/guides/exports.md")
)
WIDTH = 120
AS_ABOVE = ("imu.further", OF_FURTHER)  # tables with the keys of that above them

_BLOCK = re.compile(r"(<!-- rendered: (\w+) -->\n).*?(<!-- end of rendered -->)", re.DOTALL)
_FORMS = {
    "axes": "text",
    "columns": "list or table",
    "engine": "auto, pyrtklib5 or rnx2rtkp",
    "file": "file",
    "files": "list of files",
    "flag": "true or false",
    "name": "text",
    "names": "list of texts",
    "noise": "text",
    "formats": "list of texts",
    "number": "number",
    "origin": "[latitude deg, longitude deg, ellipsoidal height m]",
    "place": "[latitude deg, longitude deg, ellipsoidal height m]",
    "text": "text",
    "texts": "list of texts",
    "triple": "one number or three",
    "whole": "whole number",
}


def rendered(page: str) -> str:
    """The page with its rendered parts as the schema has them now.

    Parameters
    ----------
    page : str
        Text of the page.

    Returns
    -------
    str
        The same text with the parts between the comments replaced.
    """
    return _BLOCK.sub(lambda block: f"{block[1]}{PARTS[block[2]]()}{block[3]}", page)


def _keys() -> str:
    """Every key but those of gnss.covariance, in one table."""
    rows = []
    for table, classes in FLIGHT_TABLES.items():
        if table == "gnss.covariance":
            continue
        for item in options_of(table, classes):
            if table in AS_ABOVE and item.option.only != table:
                continue  # as in [imu] and [camera]
            key = ".".join(filter(None, (table, item.name)))
            rows.append([f"`{key}`", value_words(item), default_words(item), item.option.meaning])
    return _table(["key", "value", "default", "meaning"], rows)


def _block_keys() -> str:
    """Every key of a block file."""
    rows = []
    for table, classes in BLOCK_TABLES.items():
        for item in options_of(table, classes):
            key = ".".join(filter(None, (table, item.name)))
            rows.append([f"`{key}`", value_words(item), default_words(item), item.option.meaning])
    return _table(["key", "value", "default", "meaning"], rows)


def _covariance() -> str:
    """The keys of gnss.covariance."""
    rows = [
        [f"`{item.name}`", value_words(item), default_words(item), item.option.meaning]
        for item in declared_options(CovarianceModel).values()
    ]
    return _table(["key of the table", "value", "default", "meaning"], rows)


def _classes() -> str:
    """Factor and floor of each class."""
    rows = [
        [f"`{name}`", _literal(_one(MODEL.scale[name])), _literal(_one(MODEL.floor_m[name]))]
        for name in MODEL.scale
    ]
    return _table(["class", "scale", "floor_m"], rows)


def _one(triple: tuple[float, ...]) -> Any:
    """One number where all three are the same."""
    return triple[0] if len(set(triple)) == 1 else triple


def _checks() -> str:
    """The names of the checks."""
    from insgnss.records.verdicts import CHECKS

    whole = (f'"{name}",'.replace(" ", "\0") for name in CHECKS)
    lines = textwrap.wrap(" ".join(whole).rstrip(","), WIDTH, break_on_hyphens=False)
    return "\n".join(lines).replace("\0", " ") + "\n"


def _exports() -> str:
    """The formats of an exterior orientation."""
    rows = [[f"`{name}`", f"`{form.product}`", form.what] for name, form in EXPORTS.items()]
    return _table(["format", "file", "content"], rows)


PARTS: Mapping[str, Callable[[], str]] = {
    "keys": _keys,
    "block_keys": _block_keys,
    "covariance": _covariance,
    "classes": _classes,
    "checks": _checks,
    "exports": _exports,
}


def _table(head: list[str], rows: Iterable[list[str]]) -> str:
    lines = [head, ["---"] * len(head), *rows]
    return "".join(f"| {' | '.join(words)} |\n" for words in lines)


def value_words(item: Declared) -> str:
    """What a value of an option looks like: form, unit and range."""
    stated, kind = item.option, item.kind
    if kind in ("choice", "letters") or (kind == "whole" and item.choices):
        words = [_choices(item)]
    elif stated.form:
        words = [stated.form]
    elif stated.members is not None:
        words = [f"table of {', '.join(stated.members())}"]
    elif kind == "gm_sigma":
        words = [f"number, {phrase([_literal(word) for word in item.choices])}"]
    else:
        words = [_FORMS.get(kind) or f"{item.count} numbers"]
    if stated.unit:
        words.append(stated.unit)
    words.append("greater than 0" if stated.positive or kind == "sigmas" else _range(item))
    return ", ".join(filter(None, words))


def _choices(item: Declared) -> str:
    if item.kind == "letters":
        return f"letters of {''.join(map(str, item.choices))}"
    return phrase([_literal(word) for word in item.choices])


def _range(item: Declared) -> str:
    low, high = item.option.low, item.option.high
    if item.choices and item.kind == "whole":
        return ""
    if abs(low) == float("inf"):
        return ""
    return f"from {low:g}" if high == float("inf") else f"{low:g} to {high:g}"


def default_words(item: Declared) -> str:
    """The default of an option as a flight file writes it, or in words."""
    if item.option.usual:
        return item.option.usual
    if item.required:
        return "-"
    return "none" if item.default is None else _literal(item.default)


def _literal(value: Any) -> str:
    """A value as TOML has it."""
    if isinstance(value, bool):
        return str(value).lower()
    if isinstance(value, int | float):
        return f"{value:g}"
    if isinstance(value, list | tuple):
        return f"[{', '.join(map(_literal, value))}]"
    if isinstance(value, Mapping):
        return "{}" if not value else str(dict(value))
    return f'"{value}"'


def main(*pages: Path) -> None:
    """Render pages anew."""
    for page in pages:
        atomic_write(page, rendered(page.read_text(encoding="utf-8")))


if __name__ == "__main__":
    main(*(map(Path, sys.argv[1:]) if sys.argv[1:] else PAGES))
