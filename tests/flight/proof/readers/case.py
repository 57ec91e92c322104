"""How the file of an export is proven: the reader that knows nothing of its writer, and in which
frames.
"""

from collections.abc import Callable
from dataclasses import dataclass, field
from functools import partial
from pathlib import Path
from typing import Any

import scene

from insgnss.io.formats import EXPORTS
from insgnss.io.formats.exports import Export

from .geometry import Frame, Poses, Table

LOCAL, GLOBE, SPACE, LV95, UTM, NORTH_FIRST = (
    "tangent plane",
    "geographic",
    "geocentric",
    "EPSG:2056",
    "EPSG:32632",
    "EPSG:3044",
)
GRIDS = (LV95, UTM)
EVERY = (LOCAL, GLOBE, SPACE, *GRIDS)
EARTH = (LOCAL, GLOBE, *GRIDS, NORTH_FIRST)
CAMERA = "PINHOLE 5120 3840 5607 5607 2590.4 1971.9"
XYZ = ("x", "y", "z")


@dataclass(frozen=True)
class Case:
    """One way to read one format.

    read, poses : of the reader.
    frames : to be proven in.
    attitude : key of `mistakes.of_attitude`.
    place : columns of the coordinates.
    options : of the writer.
    """

    read: Callable[[Path], Table]
    poses: Callable[[Table, Frame], Poses]
    frames: tuple[str, ...]
    attitude: str = ""
    place: tuple[str, ...] = XYZ
    options: dict[str, Any] = field(default_factory=dict)


def export_of(name: str) -> Export:
    """The export that a case is of: the first word of its name."""
    return EXPORTS[name.split()[0]]


def at_sea(poses: Callable[..., Poses]) -> Callable[[Table, Frame], Poses]:
    return partial(poses, undulation_m=scene.UNDULATION_M)
