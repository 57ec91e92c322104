"""Elementary matrices, angle sets and frames of formats.md sections 0 and C, for readers that share
nothing with the writers.

Angles are degrees, positions metres. R of an angle set and its angles are inverse to each other;
`SETS` lists them by name. A frame turns what a file says of a place into ECEF, and gives the axes
(columns, in ECEF) that its angles count from:

    axes    of the coordinates: the plane's, the grid's, east north up at the place of geographic
            coordinates
    north   what yaw counts from: true north, in a tangent plane (a LOCAL coordinate system) the
            plane's own
    local   east, north, up at the place

A projected frame is left through the projection: the place by inverting PROJ's forward
transformation in three dimensions, the axes by the azimuth on the grid of a small way north. So
neither scale nor curvature enters: the poses are those in space.
"""

from collections.abc import Callable
from dataclasses import dataclass, field
from functools import cached_property

import numpy as np
from pyproj import CRS, Transformer

Array = np.ndarray

D = np.diag([1.0, -1.0, -1.0])
S = np.array([[0.0, 1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, -1.0]])
GIMBAL = np.array(
    [[0.0, 1.0, 0.0], [0.0, 0.0, 1.0], [1.0, 0.0, 0.0]]
)  # columns: view, right, down of the camera in its CV axes
TO_ECEF = Transformer.from_crs("EPSG:4979", "EPSG:4978", always_xy=True)


def elementary(axis: int, degrees: Array | float) -> Array:
    """Active right-handed rotation about an axis; Rz(90 deg) sends x to y."""
    a = np.radians(np.asarray(degrees, dtype=float))
    j, k = (axis + 1) % 3, (axis + 2) % 3
    out = np.zeros((*a.shape, 3, 3))
    out[..., axis, axis] = 1.0
    out[..., j, j], out[..., k, k], out[..., k, j], out[..., j, k] = (
        np.cos(a),
        np.cos(a),
        np.sin(a),
        -np.sin(a),
    )
    return out


def Rx(a: Array | float) -> Array:
    return elementary(0, a)


def Ry(a: Array | float) -> Array:
    return elementary(1, a)


def Rz(a: Array | float) -> Array:
    return elementary(2, a)


def turn(R: Array) -> Array:
    """The inverse."""
    return np.swapaxes(R, -1, -2)


def opk(o: Array, p: Array, k: Array) -> Array:
    return Rx(o) @ Ry(p) @ Rz(k)


def pok(p: Array, o: Array, k: Array) -> Array:
    return Ry(p) @ Rx(o) @ Rz(k)


def ypr(y: Array, p: Array, r: Array) -> Array:
    """B1.1: right, up, back of the camera into east, north, up."""
    return Rz(-np.asarray(y)) @ Rx(p) @ Ry(r)


def ned(r: Array, p: Array, y: Array) -> Array:
    """Body forward, right, down into north, east, down."""
    return Rz(y) @ Ry(p) @ Rx(r)


def kml(heading: Array, tilt: Array, roll: Array) -> Array:
    """A camera that looks along its -z with y up, turned about z, x, z; right, up, back into east,
    north, up.
    """
    return Rz(-np.asarray(heading)) @ Rx(tilt) @ Rz(roll)


def quaternion(q: Array) -> Array:
    """Hamilton, (n, 4) w x y z."""
    w, x, y, z = q.T / np.linalg.norm(q, axis=1)
    rows = [1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)]
    rows += [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)]
    rows += [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)]
    return np.stack(rows, axis=-1).reshape(-1, 3, 3)


def _deg(*angles: Array) -> tuple[Array, ...]:
    return tuple(np.degrees(a) for a in angles)


def opk_of(R: Array) -> tuple[Array, ...]:
    return _deg(
        np.arctan2(-R[:, 1, 2], R[:, 2, 2]),
        np.arcsin(R[:, 0, 2]),
        np.arctan2(-R[:, 0, 1], R[:, 0, 0]),
    )


def pok_of(R: Array) -> tuple[Array, ...]:
    return _deg(
        np.arctan2(R[:, 0, 2], R[:, 2, 2]),
        np.arcsin(-R[:, 1, 2]),
        np.arctan2(R[:, 1, 0], R[:, 1, 1]),
    )


def ypr_of(R: Array) -> tuple[Array, ...]:
    return _deg(
        np.arctan2(R[:, 0, 1], R[:, 1, 1]),
        np.arcsin(R[:, 2, 1]),
        np.arctan2(-R[:, 2, 0], R[:, 2, 2]),
    )


def ned_of(R: Array) -> tuple[Array, ...]:
    return _deg(
        np.arctan2(R[:, 2, 1], R[:, 2, 2]),
        np.arcsin(-R[:, 2, 0]),
        np.arctan2(R[:, 1, 0], R[:, 0, 0]),
    )


def kml_of(R: Array) -> tuple[Array, ...]:
    return _deg(
        np.arctan2(-R[:, 0, 2], -R[:, 1, 2]),
        np.arccos(R[:, 2, 2]),
        np.arctan2(R[:, 2, 0], R[:, 2, 1]),
    )


SETS: dict[
    str, tuple[tuple[str, ...], Callable[..., Array], Callable[[Array], tuple[Array, ...]]]
] = {
    "opk": (("omega", "phi", "kappa"), opk, opk_of),
    "pok": (("phi", "omega", "kappa"), pok, pok_of),
    "ypr": (("yaw", "pitch", "roll"), ypr, ypr_of),
    "ned": (("roll", "pitch", "yaw"), ned, ned_of),
    "kml": (("heading", "tilt", "roll"), kml, kml_of),
    "matrix": (("R",), lambda R: R, lambda R: (R,)),
}


@dataclass(frozen=True)
class Table:
    """What a file says: names, numbers by column, and words."""

    names: list[str]
    columns: dict[str, Array]
    said: dict[str, str] = field(default_factory=dict)

    def __getitem__(self, column: str) -> Array:
        return self.columns[column]

    def place(self, *names: str) -> Array:
        """(n, 3) of three columns, x y z by default."""
        return np.column_stack([self[name] for name in names or ("x", "y", "z")])

    def changed(self, **columns: Array) -> "Table":
        return Table(self.names, self.columns | columns, self.said)


@dataclass(frozen=True)
class Poses:
    """Projection centres (n, 3) in ECEF, and the camera's axes (right, down, view), columns, in
    ECEF (n, 3, 3), None where not told.
    """

    names: list[str]
    centre: Array
    axes: Array | None


def up_axes(lon: Array, lat: Array) -> Array:
    """East, north, up, columns, in ECEF; degrees."""
    l, b = np.radians(lon), np.radians(lat)
    zero = np.zeros_like(l)
    east = np.stack([-np.sin(l), np.cos(l), zero], axis=-1)
    up = np.stack([np.cos(b) * np.cos(l), np.cos(b) * np.sin(l), np.sin(b)], axis=-1)
    return np.stack([east, np.cross(up, east), up], axis=-1)


class Frame:
    """Geographic: longitude, latitude in degrees, height above the ellipsoid of WGS84 in m."""

    definition = "EPSG:4979"

    def geographic(self, x: Array) -> Array:
        """(n, 3) longitude, latitude, height."""
        return x

    def ecef(self, x: Array) -> Array:
        return np.column_stack(TO_ECEF.transform(*self.geographic(x).T))

    def local(self, x: Array) -> Array:
        return up_axes(*self.geographic(x)[:, :2].T)

    def axes(self, x: Array) -> Array:
        return self.local(x)

    def north(self, x: Array) -> Array:
        return self.local(x)

    def coordinates(self, ecef: Array) -> Array:
        """The inverse of `ecef`."""
        return np.column_stack(TO_ECEF.transform(*ecef.T, direction="INVERSE"))


class Geocentric(Frame):
    """X Y Z of ECEF."""

    definition = "EPSG:4978"

    def geographic(self, x: Array) -> Array:
        return np.column_stack(TO_ECEF.transform(*x.T, direction="INVERSE"))

    def ecef(self, x: Array) -> Array:
        return x

    def axes(self, x: Array) -> Array:
        return np.broadcast_to(np.eye(3), (len(x), 3, 3))

    def coordinates(self, ecef: Array) -> Array:
        return ecef


class Tangent(Frame):
    """East, north, up of a place: longitude, latitude in degrees, height in m."""

    definition = ""

    def __init__(self, lon: float, lat: float, height: float) -> None:
        self.origin = np.array([[lon, lat, height]])

    def ecef(self, x: Array) -> Array:
        return Frame().ecef(self.origin) + x @ Frame().local(self.origin)[0].T

    def geographic(self, x: Array) -> Array:
        return np.column_stack(TO_ECEF.transform(*self.ecef(x).T, direction="INVERSE"))

    def axes(self, x: Array) -> Array:
        return np.broadcast_to(Frame().local(self.origin), (len(x), 3, 3))

    def north(self, x: Array) -> Array:
        return self.axes(x)

    def coordinates(self, ecef: Array) -> Array:
        return (ecef - Frame().ecef(self.origin)) @ Frame().local(self.origin)[0]


class Projected(Frame):
    """Easting, northing of a CRS, height above the ellipsoid of WGS84."""

    def __init__(self, definition: str) -> None:
        self.definition = definition

    @cached_property
    def _there(self) -> Transformer:
        return Transformer.from_crs("EPSG:4979", CRS(self.definition).to_3d(), always_xy=True)

    def forward(self, place: Array) -> Array:
        """(n, 2) easting, northing of longitude, latitude, height."""
        return np.column_stack(self._there.transform(*place.T)[:2])

    def geographic(self, x: Array) -> Array:
        step = 1e-5
        place = np.column_stack([*self._there.transform(*x.T, direction="INVERSE")[:2], x[:, 2]])
        for _ in range(4):
            sides = [
                (self.forward(place + s) - self.forward(place - s)) / (2 * step)
                for s in step * np.eye(3)[:2]
            ]
            J = np.stack(sides, axis=-1)
            place[:, :2] += np.linalg.solve(J, (x[:, :2] - self.forward(place))[:, :, None])[
                :, :, 0
            ]
        return place

    def convergence(self, x: Array) -> Array:
        """Degrees (n,): true north has the azimuth minus this on the grid."""
        place, step = self.geographic(x), np.array([0.0, 1e-5, 0.0])
        east, north = (self.forward(place + step) - self.forward(place - step)).T
        return -np.degrees(np.arctan2(east, north))

    def axes(self, x: Array) -> Array:
        return self.local(x) @ Rz(-self.convergence(x))

    def coordinates(self, ecef: Array) -> Array:
        place = super().coordinates(ecef)
        return np.column_stack([self.forward(place), place[:, 2]])
