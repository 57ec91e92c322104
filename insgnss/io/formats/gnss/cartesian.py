"""Positions of fixes in metres: geocentric (x y z), or north, east and down or up of a point.

Geocentric ones are told by their radius, which is that of the Earth. Local ones need the point that
they count from, `gnss.reference`, or a comment that names it.
"""

import re
from collections.abc import Collection, Mapping

import numpy as np

from ....geodesy.frames import TangentPlane, ecef_to_geodetic, rotation_en
from ....records import Array
from ..text.order import Lines, refuse_rows
from .heights import comments_in

Position = tuple[float, float, float]

GEODETIC_FIELDS, GEOCENTRIC = ("lat", "lon", "h"), ("x", "y", "z")
# m from the Earth's centre: poles less 10 km, equator and an aircraft above it
NEAREST_M, FARTHEST_M = 6.346e6, 6.399e6
HIGHEST_M = 1e4  # of a reference point's height (m): no ground is higher
_REFERENCE_WORD = re.compile(r"(?i)\b(ref|reference|origin|home|base)\b")
_CARTESIAN_NUMBER = re.compile(r"[-+]?\d+(?:\.\d+)?")


def position_columns(names: Collection[str | None]) -> tuple[str, ...]:
    """Return which columns of these hold the position: geodetic ones where nothing else does."""
    if not {"lat", "lon"} & set(names):
        if set(GEOCENTRIC) <= set(names):
            return GEOCENTRIC
        if {"north", "east"} <= set(names):
            return ("north", "east", "up" if "up" in names else "down")
    return GEODETIC_FIELDS


def on_earth(xyz: Array) -> bool:
    """Tell whether coordinates (n, 3), m, are geocentric ones of points near the ground."""
    radius = np.linalg.norm(xyz, axis=1)
    return bool(((radius > NEAREST_M) & (radius < FARTHEST_M)).all())


def reference_in(path: object) -> Position | None:
    """Return the reference point that a comment of a text names: latitude, longitude, deg, height.

    None where none does.
    """
    for _, text in comments_in(path):
        numbers = _CARTESIAN_NUMBER.findall(text)
        if _REFERENCE_WORD.search(text) and len(numbers) == 3:
            lat, lon, height = map(float, numbers)
            if abs(lat) <= 90.0 and abs(lon) <= 180.0 and abs(height) < HIGHEST_M:
                return lat, lon, height
    return None


def geodetic_columns(
    cols: Mapping[str, Array],
    lines: Lines,
    reference: Position | None,
    angle: float,
    length: float,
) -> dict[str, Array]:
    """Return the columns of fixes with latitude, longitude and height in place of others.

    Parameters
    ----------
    cols : mapping
        Columns (n,) by canonical name.
    lines : Lines
        Where the rows stand, for refusals.
    reference : tuple of float, optional
        (3,) latitude, longitude, deg, height, m, from which local metres count.
    angle, length : float
        Factors of angles and lengths of the columns to rad and m.

    Raises
    ------
    InputError
        Geocentric positions that are none, local ones without a reference.
    """
    names = position_columns(cols)
    if names == GEODETIC_FIELDS:
        return dict(cols)
    position = length * np.column_stack([cols[name] for name in names])
    cols = {name: column for name, column in cols.items() if name not in names}
    if names == GEOCENTRIC:
        radius = np.linalg.norm(position, axis=1)
        message = "x y z lie {:.0f} m from the Earth's centre; they must be geocentric, in m"
        refuse_rows(lines, ~((radius > NEAREST_M) & (radius < FARTHEST_M)), message, radius)
        lat, lon, height = ecef_to_geodetic(position)
        axes = ("sd_x", "sd_y", "sd_z")
        if all(name in cols for name in axes):
            squares = np.column_stack([cols.pop(name) for name in axes]) ** 2
            sigma = np.sqrt(np.einsum("nji,nj->ni", rotation_en(lat, lon) ** 2, squares))
            cols |= dict(zip(("sd_n", "sd_e", "sd_u"), sigma.T, strict=True))
    else:
        if reference is None:
            raise lines.error_at(
                0,
                f"{' '.join(names)} count from a local origin; give this point as gnss.reference ="
                " [latitude deg, longitude deg, ellipsoidal height m]",
            )
        plane = TangentPlane(np.radians(reference[0]), np.radians(reference[1]), reference[2])
        up = position[:, 2] if names[2] == "up" else -position[:, 2]
        lat, lon, height = plane.geodetic_from_position(
            np.column_stack([position[:, 1], position[:, 0], up])
        )
    return {**cols, "lat": lat / angle, "lon": lon / angle, "h": height / length}
