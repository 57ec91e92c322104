"""Names that options had: they keep working for one release, with a warning that tells the new one."""

import warnings
from collections.abc import Mapping
from dataclasses import replace
from typing import Any

from ..tables import Table
from .flight_file import TABLES
from .schema import options_of


def new_names(table: str) -> dict[str, str]:
    """The present name of each option of a table by every name that it had."""
    found = options_of(table, TABLES.get(table, ()))
    return {old: item.name for item in found for old in item.option.retired}


def renewed(root: Table) -> Table:
    """The flight file with its retired keys renamed.

    Raises
    ------
    InputError
        Where an option stands there by both of its names.

    Warns
    -----
    FutureWarning
        Once for each retired key, with the line and the name that took its place.
    """
    lines = dict(root.lines)
    data = _renewed(replace(root, lines=lines), root.data, "", lines)
    return replace(root, data=data, lines=lines)


def _renewed(
    root: Table, data: Mapping[str, Any], name: str, lines: dict[str, int]
) -> dict[str, Any]:
    """The data of the table `name` by present names; `lines` gets these as well."""
    result, names = {}, new_names(name)
    table = replace(root, name=name, data=data)
    for key, value in data.items():
        present = names.get(key, key)
        old, new = (".".join(filter(None, (name, word))) for word in (key, present))
        if present != key:
            if present in data:
                raise table.error(
                    key, f"is the retired name of {new}, which is given as well; keep that"
                )
            _rename(lines, old, new)
            where = f"{root.path}:{lines[new]}" if new in lines else str(root.path)
            what = f"{where}: {old} is called {new} now; the next release will refuse the old name"
            warnings.warn(what, FutureWarning, stacklevel=4)
        result[present] = _of_value(root, value, new, lines)
    return result


def _of_value(root: Table, value: Any, name: str, lines: dict[str, int]) -> Any:
    if isinstance(value, dict):
        return _renewed(root, value, name, lines) if name in TABLES else value
    if isinstance(value, list) and name in TABLES:
        return [
            _renewed(root, item, name, lines) if isinstance(item, dict) else item for item in value
        ]
    return value


def _rename(lines: dict[str, int], old: str, new: str) -> None:
    """Let the lines of a key, and of what stands below it, be found by the new name as well."""
    for name, line in list(lines.items()):
        if name == old or name.startswith(f"{old}."):
            lines.setdefault(new + name[len(old) :], line)
