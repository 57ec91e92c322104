"""relative.csv (paper 003, equations 3 and 4): pairs i, j with an offset and a rotation, quaternion
w x y z.

mapping   X_j - X_i in the frame's axes, C_j C_i^T
camera    C_i^T (X_j - X_i), C_i^T C_j: the pose of j in the axes of i
"""

from pathlib import Path

import numpy as np

from .geometry import Frame, Poses, Table, quaternion, turn
from .lines import rows


def read(path: Path) -> Table:
    """The names are those of the second image of each pair."""
    head, *lines = rows(path, ",")
    column = dict(zip(head, zip(*lines, strict=True), strict=True))
    (form,) = set(column["form"])
    values = {
        name: np.array(column[name], dtype=float)
        for name in ("dx", "dy", "dz", "qw", "qx", "qy", "qz")
    }
    q = np.column_stack([values[f"q{c}"] for c in "wxyz"])
    said = {"form": form} | dict(zip(column["image_j"], column["image_i"], strict=True))
    return Table(list(column["image_j"]), values | {"q": q}, said)


def poses(table: Table, frame: Frame, known: Poses) -> Poses:
    """Each second image from its first one, whose pose is known; of a Cartesian frame, and of a
    projected one over short ways.
    """
    first = [known.names.index(table.said[name]) for name in table.names]
    x = frame.coordinates(known.centre)[first]
    assert known.axes is not None
    C = turn(frame.axes(x)) @ known.axes[first]
    d, turned = table.place("dx", "dy", "dz"), quaternion(table["q"])
    if table.said["form"] == "mapping":
        there, C_there = x + d, turned @ C
    else:
        there, C_there = x + (C @ d[:, :, None])[:, :, 0], C @ turned
    return Poses(table.names, frame.ecef(there), frame.axes(there) @ C_there)
