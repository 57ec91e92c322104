"""The table of changes to the covariance model: [gnss.covariance] of a flight file, or a TOML file of its own.

Keys are the fields of `covariance.CovarianceModel`. `scale` and `floor_m` are tables by class; a triple (north, east, down) may be one
number for all three.

    ppm = [1.0, 1.0, 2.0]
    [floor_m]
    fixed = [0.002, 0.002, 0.004]
"""

import re
from collections.abc import Mapping
from dataclasses import fields
from pathlib import Path
from typing import Any

from ..errors import InputError, UsageError
from ..tables import Table, read_toml
from .covariance import CLASSES, MODEL, CovarianceModel

KEYS: dict[str, tuple[str, ...]] = {"": tuple(f.name for f in fields(CovarianceModel)), "scale": CLASSES, "floor_m": CLASSES}


def read_covariance(path: Path) -> CovarianceModel:
    """The model with the changes of a file. Raises InputError with file and line."""
    if not path.is_file():
        raise InputError.at(path, None, "does not exist; give a TOML file of the fields of the covariance model")
    root = read_toml(path, KEYS)
    if headed := next((name for name in root.lines if re.match(r"gnss\b|covariance\b", name)), None):
        what = f"{headed}: this file is the table gnss.covariance itself; its keys stand at the top, and [scale] and [floor_m] below them"
        raise InputError.at(path, root.lines[headed], what)
    root.check_keys()
    return covariance_of(root)


def covariance_of(table: Table) -> CovarianceModel:
    """The model with the changes of a table, each of the kind that its default has. Raises InputError with file and line."""
    changes: dict[str, Any] = {}
    for key in table.data:
        default = getattr(MODEL, key)
        if isinstance(default, Mapping):
            classes = table.table(key)
            changes[key] = {name: _triple(classes, name) for name in classes.data}
            for name, value in changes[key].items():
                _check(classes, name, {key: {name: value}})
            continue
        changes[key] = _triple(table, key) if isinstance(default, tuple) else table.number(key)
        if isinstance(default, int):
            if changes[key] != int(changes[key]):
                raise table.error(key, f"{changes[key]:g} is no whole number")
            changes[key] = int(changes[key])
        _check(table, key, {key: changes[key]})
    return MODEL.with_changes(changes)


def _triple(table: Table, key: str) -> tuple[float, ...]:
    """North, east, down, or one number for all of them."""
    values: tuple[float, ...] = table.numbers(key, 3) if isinstance(table.data[key], list) else (table.number(key),) * 3
    return values


def _check(table: Table, key: str, change: Mapping[str, Any]) -> None:
    try:
        MODEL.with_changes(change)
    except UsageError as refusal:
        raise table.error(key, str(refusal).partition(": ")[2]) from None
