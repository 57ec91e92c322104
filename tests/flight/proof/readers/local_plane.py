"""EO_local-plane.txt, formats.md A.8 candidate (i): image E N U omega phi kappa; Rx(o) Ry(p) Rz(k)
takes right-up-back into the plane.
"""

from pathlib import Path

from .case import LOCAL, Case
from .geometry import D, Frame, Poses, Table, Tangent, opk
from .lines import comments, named, numbers, rows


def read(path: Path) -> Table:
    """The origin stands in a comment."""
    origin = next(line for line in comments(path) if line.startswith("origin"))
    return Table(*named(rows(path), "name x y z omega phi kappa"), {"origin": origin})


def poses(table: Table, frame: Frame) -> Poses:
    lat, lon, height = numbers(table.said["origin"])
    plane = Tangent(lon, lat, height)
    x = table.place()
    return Poses(
        table.names,
        plane.ecef(x),
        plane.axes(x) @ opk(table["omega"], table["phi"], table["kappa"]) @ D,
    )


CASES = {
    "eo_local_plane": Case(read, poses, (LOCAL,), "opk"),
}
