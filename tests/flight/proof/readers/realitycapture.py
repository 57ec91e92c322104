"""RealityCapture's flight log, formats.md B7: name, latitude, longitude, altitude, yaw, pitch,
roll; angles as Metashape's.
"""

from pathlib import Path

from .case import GLOBE, LOCAL, Case
from .geometry import D, Frame, Poses, Table, ypr
from .lines import named, rows


def read(path: Path) -> Table:
    """x, y in a tangent plane or a projected CRS, latitude, longitude in a geographic one; the line
    of column names says which.
    """
    geographic = any(
        line.startswith("#name,latitude") for line in path.read_text(encoding="utf-8").splitlines()
    )
    return Table(*named(rows(path, ","), f"name {'y x' if geographic else 'x y'} z yaw pitch roll"))


def poses(table: Table, frame: Frame) -> Poses:
    x = table.place()
    return Poses(
        table.names,
        frame.ecef(x),
        frame.north(x) @ ypr(table["yaw"], table["pitch"], table["roll"]) @ D,
    )


CASES = {
    "realitycapture": Case(read, poses, (LOCAL, GLOBE), "ypr"),
    "realitycapture_accuracy": Case(read, poses, (LOCAL, GLOBE), "ypr"),
}
