"""OpenSfM's exif_overrides.json and reference_lla.json, formats.md B4: world to camera (right,
down, view) is D Rz(-k) Ry(-p) Rx(-o).

The world is east, north, up of the reference.
"""

import json
from pathlib import Path

import numpy as np

from .case import LOCAL, Case
from .geometry import D, Frame, Poses, Rx, Ry, Rz, Table, Tangent, turn


def read(path: Path) -> Table:
    overrides = json.loads(path.read_text(encoding="utf-8"))
    reference = json.loads((path.parent / "reference_lla.json").read_text(encoding="utf-8"))
    fields = {"lon": ("gps", "longitude"), "lat": ("gps", "latitude"), "z": ("gps", "altitude")}
    fields |= {name: ("opk", name) for name in ("omega", "phi", "kappa")}
    columns = {
        key: np.array([shot[a][b] for shot in overrides.values()]) for key, (a, b) in fields.items()
    }
    columns |= {f"reference_{key}": np.array([value]) for key, value in reference.items()}
    return Table(list(overrides), columns)


def poses(table: Table, frame: Frame) -> Poses:
    reference = Tangent(
        *(float(table[f"reference_{key}"][0]) for key in ("longitude", "latitude", "altitude"))
    )
    x = table.place("lon", "lat", "z")
    world_to_camera = D @ Rz(-table["kappa"]) @ Ry(-table["phi"]) @ Rx(-table["omega"])
    return Poses(table.names, Frame().ecef(x), reference.axes(x) @ turn(world_to_camera))


CASES = {
    "opensfm": Case(read, poses, (LOCAL,), "opk", ("lon", "lat", "z")),
}
