"""A file of mounting constants in the place of those of the flight file."""

from dataclasses import fields, replace
from pathlib import Path

from ..base.errors import InputError
from ..base.tables import read_toml
from ..orient.mounting import Mounting
from .flight_file import Flight
from .load import known_keys, mounting_of

OF_CAMERA = "time_offset_s"


def remounted(flight: Flight, path: Path) -> Flight:
    """Return a flight whose mounting is that of a file, as far as the file names it.

    Parameters
    ----------
    flight : Flight
        The flight file.
    path : Path
        The file: a table [mounting] with keys of that of a flight file, and [camera] with
        time_offset_s; others of its keys stay as the flight file has them.

    Returns
    -------
    Flight
        The flight otherwise.

    Raises
    ------
    InputError
        The file is missing or no TOML, or a key or a value in it is wrong.
    """
    if not path.is_file():
        raise InputError.at_line(path, None, "does not exist; give mounting.toml of insgnss adjust")
    keys = {name: own for name, own in known_keys().items() if name.startswith("mounting")}
    root = read_toml(path, {"": ("mounting", "camera"), **keys, "camera": (OF_CAMERA,)})
    root.check_keys()
    if not root.data:
        raise InputError.at_line(path, None, "is empty; a table [mounting] is expected")
    table = root.table("mounting")
    given = mounting_of(table)
    named = {"boresight" if key == "boresight_deg" else key for key in table.data}
    own = {f.name: getattr(given, f.name) for f in fields(Mounting) if f.name in named}
    changed = replace(flight, mounting=replace(flight.mounting, **own))
    offset = root.table("camera").number(OF_CAMERA, None)
    if offset is None:
        return changed
    if changed.camera is None:
        raise root.table("camera").error(OF_CAMERA, "the flight file has no [camera]")
    return replace(changed, camera=replace(changed.camera, time_offset_s=offset))
