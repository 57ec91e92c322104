"""Names that options had: they work for one release more, with a warning of the new one."""

import warnings
from collections.abc import Iterator, Mapping
from dataclasses import replace
from typing import Any

from ...base.tables import Table
from ..flight_file import TABLES
from ..schema import options_of


def retired_keys() -> Iterator[tuple[str, str, str]]:
    """Every retired key as (table, old name, present name), those of sub-tables among them."""
    for table, classes in TABLES.items():
        for item in options_of(table, classes):
            for old in item.option.retired:
                yield table, old, item.name
            for old, new in item.option.retired_members.items():
                yield f"{table}.{item.name}", old, new


def renewed(root: Table, inside: str = "") -> Table:
    """A file with its retired keys renamed.

    Parameters
    ----------
    root : Table
        The whole file.
    inside : str
        The table of a flight file that the whole file stands for.

    Raises
    ------
    InputError
        Where an option stands there by both of its names.

    Warns
    -----
    FutureWarning
        Once for each retired key, with the line and the name that took its place.
    """
    names: dict[str, dict[str, str]] = {}
    for table, old, new in retired_keys():
        names.setdefault(table, {})[old] = new
    lines = dict(root.lines)
    data = _Renewal(replace(root, lines=lines), inside, names, lines).table(root.data, "")
    return replace(root, data=data, lines=lines)


class _Renewal:
    """One pass over a file: present names by table, and the lines, which get them as well."""

    def __init__(
        self,
        root: Table,
        inside: str,
        names: Mapping[str, Mapping[str, str]],
        lines: dict[str, int],
    ) -> None:
        self.root, self.inside, self.names, self.lines = root, inside, names, lines

    def table(self, data: Mapping[str, Any], name: str) -> dict[str, Any]:
        """The data of the table `name` by present names."""
        result = {}
        names = self.names.get(_joined(self.inside, name), {})
        for key, value in data.items():
            present = names.get(key, key)
            if present != key:
                self.rename(data, name, key, present)
            result[present] = self.value(value, _joined(name, present))
        return result

    def value(self, value: Any, name: str) -> Any:
        """A value in which all tables have present names."""
        if isinstance(value, dict):
            return self.table(value, name)
        if isinstance(value, list):
            return [self.table(item, name) if isinstance(item, dict) else item for item in value]
        return value

    def rename(self, data: Mapping[str, Any], name: str, key: str, present: str) -> None:
        """Warn of a retired key, and let its line be found by the present name."""
        old, new = _joined(name, key), _joined(name, present)
        if present in data:
            message = f"is the retired name of {new}, which is given as well; keep that"
            raise replace(self.root, name=name, data=data).error(key, message)
        for path, line in list(self.lines.items()):
            if path == old or path.startswith(f"{old}."):
                self.lines.setdefault(new + path[len(old) :], line)
        where = f"{self.root.path}:{self.lines[new]}" if new in self.lines else self.root.path
        message = f"{where}: {old} is called {new} now; the next release will refuse the old name"
        warnings.warn(message, FutureWarning, stacklevel=2)


def _joined(*names: str) -> str:
    return ".".join(filter(None, names))
