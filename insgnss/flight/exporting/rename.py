"""Other names of the images in one export, for formats that cannot hold those of the files.

The images themselves have to be renamed alike where the program looks for them: a table of both
names goes beside the export.
"""

import csv
import re
from collections import Counter
from collections.abc import Callable, Sequence
from dataclasses import replace
from itertools import islice
from pathlib import Path, PurePosixPath

from ...base.errors import InputError, UsageError
from ...base.files import atomic_write
from ...base.inputs import opened_text
from ...records import ExteriorOrientation

HEADER = ("old", "new")
_UNSAFE_IN_NAMES = re.compile(r"[^A-Za-z0-9._-]")


def _safe(name: str) -> str:
    """Return a name of letters, digits and . _ - alone, which every format holds."""
    return _UNSAFE_IN_NAMES.sub("_", name)


def _basename(name: str) -> str:
    """Return a name without its folders."""
    return PurePosixPath(name.replace("\\", "/")).name


RULES: dict[str, Callable[[str], str]] = {"safe": _safe, "basename": _basename}
"""Rules that need no list of names."""


def rename_images(
    eo: ExteriorOrientation, rules: Sequence[str | Path]
) -> tuple[ExteriorOrientation, dict[str, str]]:
    """Give images other names.

    Parameters
    ----------
    eo : ExteriorOrientation
        The orientation.
    rules : sequence of str or Path
        One after the other: "safe" (letters, digits and . _ - alone, every other character becomes
        _), "basename" (without folders), "OLD=NEW", or the path of a table old,new as CSV.

    Returns
    -------
    eo : ExteriorOrientation
        With the new names.
    names : dict
        New name by old name, of the images that have another one.

    Raises
    ------
    UsageError
        A rule that is none, or that names no image of these.
    InputError
        A table that cannot be read, or two images that would have the same name.
    """
    images = other_names(eo.images, rules)
    pairs = {old: new for old, new in zip(eo.images, images, strict=True) if old != new}
    return (replace(eo, images=images) if pairs else eo), pairs


def other_names(images: Sequence[str], rules: Sequence[str | Path]) -> tuple[str, ...]:
    """Return the names that images have by rules; see `rename_images`."""
    if not rules:
        return tuple(images)
    names = list(images)
    for rule in rules:
        change = _names_of(rule, names)
        names = [change(name) for name in names]
    if twice := [name for name, count in Counter(names).items() if count > 1]:
        alike = (old for old, new in zip(images, names, strict=True) if new == twice[0])
        first, second = islice(alike, 2)
        raise InputError(
            f"rename: images {first!r} and {second!r} would both be called {twice[0]!r}; give "
            "different names, such as by a table old,new"
        )
    return tuple(names)


def _names_of(rule: str | Path, images: list[str]) -> Callable[[str], str]:
    """Return the function that gives new names by one rule."""
    if isinstance(rule, str) and rule in RULES:
        return RULES[rule]
    if Path(rule).is_file():
        table = read_names(Path(rule))
        if not any(name in table for name in images):
            raise UsageError(
                f"rename: {rule} names none of the {len(images)} images, such as {images[0]!r}; "
                "write the present image names into its first column"
            )
        return lambda name: table.get(name, name)
    text = str(rule)
    if "=" not in text:
        raise UsageError(
            f"rename: {text!r} is neither a file nor OLD=NEW nor one of {', '.join(RULES)}"
        )
    cuts = [k for k, sign in enumerate(text) if sign == "="]  # names may have one too
    pairs = [(text[:k], text[k + 1 :]) for k in cuts if text[:k] in images and text[k + 1 :]]
    if not pairs:
        raise UsageError(f"rename: {text!r}: no image has this name; one is {images[0]!r}")
    return lambda name: pairs[0][1] if name == pairs[0][0] else name


def read_names(path: Path) -> dict[str, str]:
    """Read a table old,new: CSV with or without that header; lines that begin with # are comments.

    Raises
    ------
    InputError
        A line that is none, an empty name or one that stands there twice, with its line.
    """
    names: dict[str, str] = {}
    try:
        with opened_text(path, "utf-8-sig", newline="") as stream:
            reader = csv.reader(stream, strict=True)
            for row in reader:
                if not row or row[0].lstrip().startswith("#") or tuple(row) == HEADER:
                    continue
                if len(row) != 2 or not all(row) or row[0] in names:
                    problem = f"{','.join(row)!r} is not old,new, each old name once"
                    raise InputError.at_line(path, reader.line_num, problem)
                names[row[0]] = row[1]
    except (OSError, UnicodeDecodeError, csv.Error) as error:
        raise InputError.in_file(path, f"is no table old,new: {error}") from None
    if not names:
        raise InputError.in_file(path, "names no image; each line is old,new")
    return names


def write_names(names: dict[str, str], path: Path) -> None:
    """Write the table of old and new names, which `read_names` reads back."""
    quoted = [['"' + name.replace('"', '""') + '"' for name in pair] for pair in names.items()]
    atomic_write(path, "".join(f"{old},{new}\n" for old, new in [HEADER, *quoted]))
