"""Metashape's reference csv, formats.md B1: columns nxyzabc, delimiter ",", one line skipped.

Yaw, pitch, roll count from true north at the camera (in a LOCAL coordinate system from its axes),
omega, phi, kappa from the grid. x is longitude or easting. A GPS/INS offset rotation turns the
reference attitude: R_reference = R_camera D ypr2mat(rotation) (B1.3).
"""

from pathlib import Path

from .case import EARTH, GLOBE, GRIDS, LOCAL, Case
from .geometry import D, Frame, Poses, Table, opk, turn, ypr
from .lines import named, numbers


def _csv(path: Path, angles: str) -> Table:
    lines = [line.split(",") for line in path.read_text(encoding="utf-8").splitlines()[1:]]
    return Table(*named(lines, f"name x y z {angles}"))


def read(path: Path) -> Table:
    return _csv(path, "yaw pitch roll")


def read_opk(path: Path) -> Table:
    return _csv(path, "omega phi kappa")


def read_offset(path: Path) -> Table:
    """With the offset of the dialog beside it."""
    beside = path.with_name(f"{path.stem}_gps_ins_offset.txt").read_text(encoding="utf-8")
    table = _csv(path, "yaw pitch roll")
    said = dict(
        line.split("(", 1)
        for line in beside.splitlines()
        if line.startswith(("X, Y, Z", "Yaw, Pitch, Roll"))
    )
    return Table(
        table.names,
        table.columns,
        {key.strip(): value.split(":")[1] for key, value in said.items()},
    )


def poses(table: Table, frame: Frame) -> Poses:
    x = table.place()
    return Poses(
        table.names,
        frame.ecef(x),
        frame.north(x) @ ypr(table["yaw"], table["pitch"], table["roll"]) @ D,
    )


def poses_opk(table: Table, frame: Frame) -> Poses:
    x = table.place()
    return Poses(
        table.names,
        frame.ecef(x),
        frame.axes(x) @ opk(table["omega"], table["phi"], table["kappa"]) @ D,
    )


def poses_offset(table: Table, frame: Frame) -> Poses:
    x = table.place()
    assert numbers(table.said["X, Y, Z"]) == [0.0, 0.0, 0.0]
    yaw, pitch, roll = numbers(table.said["Yaw, Pitch, Roll"])
    reference = ypr(table["yaw"], table["pitch"], table["roll"])
    return Poses(
        table.names, frame.ecef(x), frame.north(x) @ reference @ turn(ypr(yaw, pitch, roll)) @ D
    )


CASES = {
    "metashape": Case(read, poses, (LOCAL, GLOBE, *GRIDS), "ypr"),
    "metashape_opk": Case(read_opk, poses_opk, EARTH, "opk"),
    "metashape_offset": Case(read_offset, poses_offset, (LOCAL, GLOBE, *GRIDS), "ypr"),
}
