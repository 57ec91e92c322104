"""The docstrings of the public API and of the rooms that hold its mathematics."""

import ast
import builtins
import inspect
import re
from collections.abc import Iterator
from enum import Enum
from importlib import import_module
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numpydoc_sections import documented, parameters, sections

import insgnss
import insgnss.base.errors

ROOT = Path(insgnss.__file__).parent
ROOMS = ("records", "geodesy", "navigation/orient", "navigation/filter", "photogrammetry/adjust")
OF_TYPES = ("Parameters", "Attributes", "Returns", "Yields", "Raises")
NO_CLASSES = {"Hz", "ArduPilot", "Autel", "NovAtel", "Latitude", "Latitudes"}
"""Words of the field that stand where a type does."""
FEWEST = 150
"""Functions and classes there are at least; fewer mean that the search is broken."""


def modules() -> Iterator[str]:
    """Yield the names of the rooms' modules, without private ones."""
    for room in ROOMS:
        for path in sorted((ROOT / room).rglob("*.py")):
            if not path.stem.startswith("_"):
                yield ".".join(("insgnss", *path.relative_to(ROOT).with_suffix("").parts))


def has_documentation(thing: Any) -> bool:
    """Tell whether a value is a function, a compiled kernel or a class that takes arguments."""
    if inspect.isclass(thing):
        return not issubclass(thing, Enum | Exception) and not getattr(thing, "_is_protocol", False)
    return inspect.isfunction(getattr(thing, "py_func", thing))


def public() -> dict[str, Any]:
    """Return the functions and classes by where they are defined."""
    things = [getattr(insgnss, name) for name in insgnss.__all__]
    for name in modules():
        own = vars(import_module(name))
        things += [
            value
            for key, value in own.items()
            if not key.startswith("_") and getattr(value, "__module__", "") == name
        ]
    return {
        f"{thing.__module__}.{thing.__name__}": thing
        for thing in things
        if has_documentation(thing)
    }


PUBLIC = public()


def methods() -> dict[str, Any]:
    """Return the public methods of the classes by class and name, class methods included."""
    return {
        f"{name}.{key}": function
        for name, thing in PUBLIC.items()
        if inspect.isclass(thing)
        for key, value in vars(thing).items()
        if not key.startswith("_")
        and inspect.isfunction(function := getattr(value, "__func__", value))
    }


METHODS = methods()


def difference(thing: Any) -> tuple[list[str], list[str]]:
    """Return the parameters that the docstring documents, and those of the signature."""
    text = sections(thing.__doc__ or "")
    return documented(text.get("Parameters", "")), parameters(thing)


def test_documented_parameters_are_those_of_the_signature() -> None:
    """Oracle: the signatures."""
    compared = {name: difference(thing) for name, thing in (PUBLIC | METHODS).items()}
    assert {name: pair for name, pair in compared.items() if pair[0] != pair[1]} == {}


def test_a_function_that_returns_something_says_what() -> None:
    """Oracle: the annotations of what they return."""
    returning = [
        name
        for name, thing in PUBLIC.items()
        if not inspect.isclass(thing)
        and inspect.signature(getattr(thing, "py_func", thing)).return_annotation
        not in (None, "None", inspect._empty)
    ]
    assert returning
    silent = [
        name
        for name in returning
        if not sections(PUBLIC[name].__doc__ or "").get("Returns", "").strip()
    ]
    assert silent == []


def test_the_search_finds_the_functions_and_classes() -> None:
    """Oracle: names that are there, and a number that is not reached by a broken search."""
    assert len(PUBLIC) > FEWEST
    for name in ("records.solutions.Trajectory", "geodesy.rotation.skew", "api.verbs.process"):
        assert f"insgnss.{name}" in PUBLIC


def bound(tree: ast.Module) -> set[str]:
    """The names that a module defines, assigns or imports."""
    names: set[str] = set()
    for node in ast.walk(tree):
        if isinstance(node, ast.ClassDef | ast.FunctionDef):
            names.add(node.name)
        elif isinstance(node, ast.Import | ast.ImportFrom):
            names |= {alias.asname or alias.name for alias in node.names}
        elif isinstance(node, ast.Name) and isinstance(node.ctx, ast.Store):
            names.add(node.id)
    return names


def documented_types(tree: ast.Module) -> Iterator[tuple[str, str]]:
    """Yield what documents a type in numpydoc sections, and each class that it names: what stands
    at the margin, in Returns and Yields with or without a name before.
    """
    for node in ast.walk(tree):
        if not isinstance(node, ast.ClassDef | ast.FunctionDef):
            continue
        for heading, text in sections(ast.get_docstring(node, clean=False) or "").items():
            lines = [line for line in text.splitlines() if re.match(r"\S", line)]
            for line in lines if heading in OF_TYPES else ():
                name, colon, stated = line.partition(" : ")
                kind = stated if colon else name
                for atom in re.split(r",| or | of | and | to |\|", re.split("[(:;]", kind)[0]):
                    if re.fullmatch(r"[A-Z]\w*[a-z]\w*", atom.strip()):
                        yield node.name, atom.strip()


@pytest.mark.slow
def test_types_in_docstrings_are_classes_that_the_module_knows() -> None:
    """Oracle: what the module binds, the classes of its wing, the errors, Python and numpy."""
    general = {*dir(builtins), *dir(np), *dir(np.random), *dir(insgnss.base.errors), *NO_CLASSES}
    classes: dict[str, set[str]] = {}
    stated: list[tuple[str, str, str, set[str]]] = []
    for path in sorted(ROOT.rglob("*.py")):
        tree, place = ast.parse(path.read_text("utf-8")), path.relative_to(ROOT)
        names = bound(tree)
        classes.setdefault(place.parts[0], set()).update(
            node.name for node in ast.walk(tree) if isinstance(node, ast.ClassDef)
        )
        stated += [(str(place), *pair, names) for pair in documented_types(tree)]
    assert len(stated) > FEWEST
    unknown = {
        (place, name, kind)
        for place, name, kind, names in stated
        if kind not in names | classes[Path(place).parts[0]] | general
    }
    assert unknown == set()


def test_a_parameter_that_is_missing_in_the_docstring_is_seen() -> None:
    """Oracle: examples by hand."""

    def forgets(time_s: float, rate_hz: float) -> None:
        """Do something.

        Parameters
        ----------
        time_s : float
            Seconds.
        """

    def invents() -> None:
        """Do something.

        Parameters
        ----------
        time_s : float
            Seconds.
        """

    for wrong in (forgets, invents):
        stated, actual = difference(wrong)
        assert stated != actual
