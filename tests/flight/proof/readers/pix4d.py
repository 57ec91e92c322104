"""Pix4D's geolocation files, formats.md B2.1.

matic    imagename, coordinate1, coordinate2, z, yaw, pitch, roll, accuracies; coordinates in the
         order of the CRS' own axes; yaw 0 with the top of the image to true north, pitch 0 in the
         nadir
mapper   imagename, X, Y, Z, omega, phi, kappa; Rx Ry Rz takes right-up-back into the axes of the
         CRS
"""

from pathlib import Path

from pyproj import CRS

from .case import GLOBE, GRIDS, LOCAL, NORTH_FIRST, Case
from .geometry import D, Frame, Poses, Table, opk, ypr
from .lines import named, rows


def read(path: Path) -> Table:
    return Table(*named(rows(path, ","), "name first second z yaw pitch roll"))


def read_mapper(path: Path) -> Table:
    return Table(*named(rows(path, ","), "name x y z omega phi kappa"))


def poses(table: Table, frame: Frame) -> Poses:
    north_first = CRS(frame.definition).axis_info[0].direction == "north"
    x = table.place("second", "first", "z") if north_first else table.place("first", "second", "z")
    return Poses(
        table.names,
        frame.ecef(x),
        frame.north(x) @ ypr(table["yaw"], table["pitch"], table["roll"]) @ D,
    )


def poses_mapper(table: Table, frame: Frame) -> Poses:
    x = table.place()
    return Poses(
        table.names,
        frame.ecef(x),
        frame.axes(x) @ opk(table["omega"], table["phi"], table["kappa"]) @ D,
    )


CASES = {
    "pix4d_matic": Case(read, poses, (GLOBE, *GRIDS, NORTH_FIRST), "ypr", ("first", "second", "z")),
    "pix4d_mapper": Case(read_mapper, poses_mapper, (LOCAL, *GRIDS), "opk"),
}
