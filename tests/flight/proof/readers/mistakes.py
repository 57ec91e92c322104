"""Wrong conventions, applied to what was read from a right file: what a writer or an importer that
errs would make of it.

What they cost at least, over all formats and frames, as the median of the residuals in the scene,
px (5607 px, 140 m above ground):

    image turned by 90 deg                                         1274
    aircraft's heading for the image's yaw                         1173
    image axes right-down-view for right-up-back                   1280
    kappa of the other sense                                       1112
    yaw of the other sense                                          924
    matrix or quaternion of the other direction                     677
    pitch of the other sign                                         515
    quaternion's scalar first for last                             4097
    coordinates exchanged                                          5496
    omega and phi exchanged                                         445
    height above the geoid for that above the ellipsoid             420
    pitch and roll exchanged                                        224
    degrees taken for gon                                            96
    bore-sight left out                                              89
    lever arm applied twice                                          18
    grid north for true north: UTM 32N 26, LV95                       9
    axes of the plane for those of the place, 3 km                    3
    phi first for omega first                                         1
"""

from collections.abc import Callable, Iterator

import numpy as np

from .geometry import SETS, Array, D, Frame, Poses, Projected, Rz, Table, Tangent, turn

Change = Callable[[Table], Table]
GEOID_M = 49.63


def _on_rotation(name: str, change: Callable[[Array], Array]) -> Change:
    """A change of the matrix that the angles of a set, or the matrix itself, stand for."""
    columns, compose, decompose = SETS[name]
    return lambda t: t.changed(
        **dict(zip(columns, decompose(change(compose(*(t[c] for c in columns)))), strict=True))
    )


def _exchanged(first: str, second: str) -> Change:
    return lambda t: t.changed(**{first: t[second], second: t[first]})


def _scaled(column: str, factor: float) -> Change:
    return lambda t: t.changed(**{column: factor * t[column]})


def _other_order(given: str, read_as: str) -> Change:
    """Angles of one set read as those of another with the same names."""
    columns, compose, _ = SETS[read_as]
    names, _, decompose = SETS[given]
    return lambda t: t.changed(
        **dict(zip(names, decompose(compose(*(t[c] for c in columns))), strict=True))
    )


def of_attitude(kind: str) -> Iterator[tuple[str, Change]]:
    """Mistakes with the attitudes of an angle set, a matrix "R" or a quaternion "q" (w x y z)."""
    if kind == "":
        return
    if kind == "quaternion":
        yield (
            "world to camera for camera to world",
            lambda t: t.changed(q=t["q"] * [1.0, -1.0, -1.0, -1.0]),
        )
        yield "scalar first for scalar last", lambda t: t.changed(q=t["q"][:, [1, 2, 3, 0]])
        return
    yield "world to camera for camera to world", _on_rotation(kind, turn)
    yield "image axes right-down-view for right-up-back", _on_rotation(kind, lambda R: D @ R @ D)
    if kind == "matrix":
        return
    first, second, third = SETS[kind][0]
    if kind == "kml":
        yield "heading and roll exchanged", _exchanged(first, third)
        return
    if kind in ("opk", "pok"):
        yield "omega and phi exchanged", _exchanged("omega", "phi")
        yield "kappa of the other sense", _scaled("kappa", -1.0)
        yield (
            "phi first for omega first, or the other way round",
            _other_order(kind, {"opk": "pok", "pok": "opk"}[kind]),
        )
        yield (
            "degrees taken for gon",
            lambda t: t.changed(**{c: 0.9 * t[c] for c in (first, second, third)}),
        )
    else:
        yield (
            "heading of the aircraft for yaw of the image (90 deg)",
            lambda t: t.changed(yaw=t["yaw"] - 90.0),
        )
        yield "yaw of the other sense", _scaled("yaw", -1.0)
        yield "pitch and roll exchanged", _exchanged("pitch", "roll")
        yield "pitch of the other sign", _scaled("pitch", -1.0)


def of_place(columns: tuple[str, str, str]) -> Iterator[tuple[str, Change]]:
    """Mistakes with the positions in three columns."""
    x, y, z = columns
    yield "first and second coordinate exchanged", _exchanged(x, y)
    yield (
        "height above the geoid for height above the ellipsoid",
        lambda t: t.changed(**{z: t[z] - GEOID_M}),
    )


def other_north(poses: Poses, frame: Frame) -> Poses | None:
    """Axes of the coordinates taken for east, north, up at the place; None where they are the same
    or have no name.
    """
    if poses.axes is None or not isinstance(frame, Projected | Tangent):
        return None
    x = frame.coordinates(poses.centre)
    return Poses(poses.names, poses.centre, frame.local(x) @ turn(frame.axes(x)) @ poses.axes)


def quarter_turn(poses: Poses) -> Poses | None:
    """The image's top taken for its right side."""
    return None if poses.axes is None else Poses(poses.names, poses.centre, poses.axes @ Rz(90.0))


def without_boresight(poses: Poses, boresight: Array, mount: Array) -> Poses | None:
    """The bore-sight left out: C_mc T B T^T (formats.md B1.3)."""
    return (
        None
        if poses.axes is None
        else Poses(poses.names, poses.centre, poses.axes @ mount @ boresight @ mount.T)
    )


def shifted(poses: Poses, lever: Array, true_axes: Array) -> Poses:
    """The lever arm applied a second time."""
    return Poses(poses.names, poses.centre - true_axes @ np.asarray(lever), poses.axes)
