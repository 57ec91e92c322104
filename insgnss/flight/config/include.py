"""The key `include` of a flight file: keys that several flights share, such as those of a wing.

    include = "wing3.toml"

stands at the top of a flight file and takes over the keys of another one: mounting, noise model,
camera of an equipment. What the flight file says itself goes before, key by key in each table; a
value is never mixed, so that `units`, `columns` or a list are of one file. Of keys that say the
same in two ways (`ALTERNATIVES`) the nearest file's counts. An included file may include another.

Paths are relative to the file that names them, but for `output.directory`, which is each flight's.
"""

import os
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from ...base.tables import KeySource, OptionTable, read_toml
from .flight_file import FLIGHT_TABLES

INCLUDE = "include"
MOST_INCLUDED_FILES = 4  # files that a flight file may take keys over from
ALTERNATIVES: Mapping[str, tuple[tuple[str, ...], ...]] = {
    "mounting": (("boresight", "boresight_deg"),),
    "gnss": (("file", "stationary", "rover"),),
}
"""Keys of a table of which one says what another one says as well."""
OF_A_FLIGHT = ("name", "gps_week", "start_tow", "end_tow", "accept")
"""Keys at the top that are of one flight and no equipment's."""


def with_included(
    root: OptionTable, keys: Mapping[str, tuple[str, ...]]
) -> tuple[OptionTable, tuple[Path, ...]]:
    """Return a flight file with the keys of the files that it includes.

    Parameters
    ----------
    root : OptionTable
        The flight file.
    keys : mapping
        The keys that each table may hold.

    Returns
    -------
    tuple of OptionTable and tuple of Path
        The file with their keys, which know where they come from; and the included files, the
        nearest first.

    Raises
    ------
    InputError
        An included file is missing, is no TOML, includes itself, stands at the end of too long a
        chain, or has a key that is of one flight.
    """
    chain = [root.path]
    last = root
    data, sources = dict(root.data), dict(root.sources)
    while INCLUDE in last.data:
        path = last.file(INCLUDE)
        if any(os.path.samefile(path, earlier) for earlier in chain):
            names = " -> ".join(file.name for file in (*chain, path))
            raise last.error(
                INCLUDE, f"the files include each other in a circle, {names}; remove one include"
            )
        if len(chain) > MOST_INCLUDED_FILES:
            problem = f"more than {MOST_INCLUDED_FILES} files include each other; merge two of them"
            raise last.error(INCLUDE, problem)
        chain.append(path)
        last = read_toml(path, keys)
        for key in OF_A_FLIGHT:
            if key in last.data:
                problem = f"belongs to a flight; give it in {root.path.name}, not in a shared file"
                raise last.error(key, problem)
        _take_over(data, last, "", KeySource(path, last.lines), sources)
    merged = OptionTable(root.path, root.lines, keys, "", data, sources)
    return merged, tuple(chain[1:])


def _take_over(
    data: dict[str, Any],
    included: OptionTable,
    table: str,
    source: KeySource,
    sources: dict[str, KeySource],
) -> None:
    """Add the keys of a table that `data` has not; a table within it key by key as well."""
    present = set(data)
    values = included.data
    for key, value in values.items():
        name = f"{table}.{key}" if table else key
        if key == INCLUDE and not table:
            continue
        if name in FLIGHT_TABLES and isinstance(value, dict):
            inner = data.get(key, {})
            if not isinstance(inner, dict):
                continue  # what is no table is refused where the file is read
            data[key] = dict(inner)
            below = OptionTable(included.path, included.lines, included.keys, name, value)
            _take_over(data[key], below, name, source, sources)
            continue
        group = next((g for g in ALTERNATIVES.get(table, ()) if key in g), (key,))
        if not present.intersection(group):
            data[key] = value
            sources[name] = source
