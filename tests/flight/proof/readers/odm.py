"""OpenDroneMap's geo.txt, formats.md B3: the CRS in line 1, then name x y z, angles NaN where
absent, accuracies; positions only.
"""

from pathlib import Path

import numpy as np

from .case import GLOBE, GRIDS, Case
from .geometry import Frame, Poses, Projected, Table
from .lines import named, rows


def read(path: Path) -> Table:
    head, *lines = rows(path)
    return Table(
        *named(lines, "name x y z yaw pitch roll horizontal vertical"), {"crs": " ".join(head)}
    )


def poses(table: Table, frame: Frame) -> Poses:
    own = Frame() if table.said["crs"] == "EPSG:4326" else Projected(table.said["crs"])
    assert np.isnan(table.place("yaw", "pitch", "roll")).all()
    return Poses(table.names, own.ecef(table.place()), None)


CASES = {
    "odm": Case(read, poses, (GLOBE, *GRIDS)),
}
