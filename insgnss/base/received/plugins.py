"""What packages that are installed beside this one add by their entry points."""

from collections.abc import Mapping
from functools import cache
from typing import Any

from ..errors import UsageError


@cache
def installed_plugins(group: str) -> Mapping[str, Any]:
    """Return the entry points of a group by name, not yet loaded.

    Parameters
    ----------
    group : str
        The group, such as "insgnss.formats".

    Returns
    -------
    mapping
        `importlib.metadata.EntryPoint` by name, read once a process.
    """
    from importlib.metadata import entry_points  # costs `insgnss --help` 15 ms

    return {entry.name: entry for entry in entry_points(group=group)}


def load_installed(group: str, name: str) -> Any:
    """Import what an entry point names.

    Parameters
    ----------
    group, name : str
        The group and the name of the entry point.

    Returns
    -------
    object
        What it names.

    Raises
    ------
    UsageError
        Where it cannot be imported.
    """
    entry = installed_plugins(group)[name]
    try:
        return entry.load()
    except (ImportError, AttributeError) as error:
        problem = f"entry point {name} = {entry.value} of the group {group}: {error}"
        raise UsageError(f"{problem}; install its package anew, or remove it") from error
