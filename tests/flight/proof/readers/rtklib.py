"""RTKLIB .pos, formats.md B11: comments %, week tow, latitude, longitude, height (the header says
ellipsoidal), Q, ns, deviations; GPST.
"""

from pathlib import Path

import numpy as np
import scene

from .case import GLOBE, LV95, Case
from .geometry import Frame, Poses, Table


def read(path: Path) -> Table:
    lines = path.read_text(encoding="utf-8").splitlines()
    head = [line for line in lines if line.startswith("%")]
    assert any("ellipsoidal" in line for line in head)
    assert "GPST" in head[-1]
    values = np.array([line.split() for line in lines if not line.startswith("%")], dtype=float)
    assert values.shape[1] == 15
    columns = dict(zip(("week", "tow", "y", "x", "z"), values[:, :5].T, strict=True))
    return Table([f"{8001 + k}.tif" for k in range(len(values))], columns)


def poses(table: Table, frame: Frame) -> Poses:
    """The antenna's positions."""
    return Poses(table.names, Frame().ecef(table.place()), None)


CASES = {
    "rtklib_pos": Case(read, poses, (GLOBE, LV95), options={"lever_m": scene.LEVER_C}),
}
