"""Tables whose positions are metres, geocentric or local: looked at as if they were geodetic."""

from dataclasses import replace

import numpy as np

from ....geodesy.frames import TangentPlane, ecef_to_geodetic
from ....io.formats.gnss.cartesian import GEOCENTRIC, GEODETIC_FIELDS, on_earth, position_columns
from .clocks import clocks_by_values
from .names import Roles, UnknownTable

# where local metres are put to look at them: their own point is not known here
ANYWHERE = TangentPlane(np.radians(45.0), np.radians(10.0), 0.0)
LONGEST_FIX_STEP_S = 30.0  # of a clock of fixes: longer ones are no recording of a flight
SIGMAS_OF_METRES = dict(zip(("sd_n", "sd_e", "sd_u"), ("sd_x", "sd_y", "sd_z"), strict=True))


def as_geodetic(grid: UnknownTable) -> tuple[UnknownTable, dict[str, str]] | None:
    """Return a table with latitude, longitude and height in the place of metres.

    Returns
    -------
    tuple of UnknownTable and dict, or None
        The table, and by the names of its columns those of the columns of metres; None where the
        position is not in metres. By values alone it is geocentric or none.
    """
    columns = {name: k for name, k in grid.of_fixes().items() if name not in SIGMAS_OF_METRES}
    names = position_columns(columns)
    if names == GEODETIC_FIELDS and any(name is not None for name in grid.names):
        return None
    if names == GEODETIC_FIELDS:
        first = _geocentric_triple(grid)
        if first is None:
            return None
        names, columns = GEOCENTRIC, {axis: first + k for k, axis in enumerate(GEOCENTRIC)}
    if not set(names) <= columns.keys():
        return None
    of_position = [columns[name] for name in names]
    metres = grid.values[:, of_position]
    if names == GEOCENTRIC:
        if not on_earth(metres):
            return None
        lat, lon, height = ecef_to_geodetic(metres)
    else:
        up = metres[:, 2] if names[2] == "up" else -metres[:, 2]
        local = np.column_stack([metres[:, 1], metres[:, 0], up])
        lat, lon, height = ANYWHERE.geodetic_from_position(local)
    values = grid.values.copy()
    values[:, of_position] = np.column_stack([np.degrees(lat), np.degrees(lon), height])
    renamed = dict(zip(GEODETIC_FIELDS, names, strict=True))
    if names == GEOCENTRIC and set(SIGMAS_OF_METRES.values()) <= columns.keys():
        renamed |= SIGMAS_OF_METRES
    spelled = {columns[name]: geodetic for geodetic, name in renamed.items() if name in columns}
    titles = grid.names
    if any(title is not None for title in titles):
        titles = tuple(spelled.get(k, title) for k, title in enumerate(titles))
    return replace(grid, values=values, names=titles), renamed


def in_metres(roles: Roles, renamed: dict[str, str]) -> Roles:
    """Return the roles of a table of `as_geodetic` for the table that it was made of."""
    columns = {renamed.get(name, name): k for name, k in roles.columns.items()}
    units = {key: unit for key, unit in roles.units.items() if key != "angle"}
    names = [renamed[name] for name in GEODETIC_FIELDS]
    how = f"{roles.how}; {' '.join(names)} are in metres about a local origin"
    if tuple(names) == GEOCENTRIC:
        how = f"by the distance from the Earth's centre; {' '.join(names)} are geocentric"
    return replace(roles, columns=columns, units=units, how=how)


def _geocentric_triple(grid: UnknownTable) -> int | None:
    """Return the first of three neighbouring columns with the Earth's radius, or None."""
    stamps = clocks_by_values(grid, LONGEST_FIX_STEP_S, set())
    for k in range(grid.values.shape[1] - 2):
        if not stamps.keys() & {k, k + 1, k + 2} and on_earth(grid.values[:, k : k + 3]):
            return k
    return None
