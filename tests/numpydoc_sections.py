"""Read numpydoc sections of docstrings, for the tests of the documentation."""

import inspect
import re
from collections.abc import Callable
from typing import Any

HEADINGS = (
    "Parameters",
    "Returns",
    "Yields",
    "Raises",
    "Warns",
    "Examples",
    "Notes",
    "See Also",
    "Attributes",
)


def sections(documentation: str) -> dict[str, str]:
    """Return the text of each numpydoc section by its heading.

    Parameters
    ----------
    documentation : str
        The docstring as it stands in the source.

    Returns
    -------
    dict
        The text of each section; what stands before the first one has the key "".
    """
    lines = inspect.cleandoc(documentation).splitlines()
    texts: dict[str, list[str]] = {"": []}
    name = ""
    for k, line in enumerate(lines):
        if k + 1 < len(lines) and line in HEADINGS and set(lines[k + 1]) == {"-"}:
            name = line
            texts[name] = []
        elif not (line and set(line) == {"-"} and lines[k - 1] in HEADINGS):
            texts[name].append(line)
    return {heading: "\n".join(text) for heading, text in texts.items()}


def documented(text: str) -> list[str]:
    """Return the names that a section documents, in their order.

    Parameters
    ----------
    text : str
        The section. A name stands at the margin, as `a, b : meaning` or alone.

    Returns
    -------
    list of str
        The names, without the stars of `*args` and `**options`.
    """
    heads = re.findall(r"^([*\w][^:\n]*?)(?: : |$)", text, re.MULTILINE)
    return [name.strip().lstrip("*") for head in heads for name in head.split(",")]


def parameters(of: Callable[..., Any]) -> list[str]:
    """Return the names of the parameters of a function, a class or a compiled kernel.

    Parameters
    ----------
    of : callable
        Whose signature is read; of a numba kernel it is that of the Python function.

    Returns
    -------
    list of str
        The names in their order, without `self` and `cls`.
    """
    signature = inspect.signature(getattr(of, "py_func", of))
    return [name for name in signature.parameters if name not in ("self", "cls")]
