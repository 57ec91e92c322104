"""Trimble Inpho, formats.md B9.

prj     $EXT_ORI: date; focal length X Y Z; three rows of (Rx Ry Rz)^T, the map into right-up-back
        of the image
ascii   id E N H omega phi kappa time, blank separated
"""

from pathlib import Path

import numpy as np

from .case import GRIDS, LOCAL, Case
from .geometry import D, Frame, Poses, Table, opk, turn
from .lines import named, numbers, rows


def read_prj(path: Path) -> Table:
    names, table = [], []
    for block in path.read_text(encoding="utf-8").split("$PHOTO\n")[1:]:
        head, _, rest = block.partition("$EXT_ORI :")
        names.append(
            next(
                line.split(":", 1)[1].strip() for line in head.splitlines() if "$PHOTO_FILE" in line
            )
        )
        table.append(numbers(rest.split("$END")[0].partition("\n")[2]))
    values = np.array(table)
    assert values.shape == (len(names), 13)
    return Table(
        names,
        dict(zip("xyz", values[:, 1:4].T, strict=True)) | {"R": values[:, 4:].reshape(-1, 3, 3)},
    )


def poses_prj(table: Table, frame: Frame) -> Poses:
    x = table.place()
    return Poses(table.names, frame.ecef(x), frame.axes(x) @ turn(table["R"]) @ D)


def read(path: Path) -> Table:
    names, columns = named(rows(path), "name x y z omega phi kappa time")
    return Table([f"{name}.tif" for name in names], columns)


def poses(table: Table, frame: Frame) -> Poses:
    x = table.place()
    return Poses(
        table.names,
        frame.ecef(x),
        frame.axes(x) @ opk(table["omega"], table["phi"], table["kappa"]) @ D,
    )


CASES = {
    "inpho_prj": Case(
        read_prj,
        poses_prj,
        (LOCAL, *GRIDS),
        "matrix",
        options={"focal_mm": 7.85, "ground_m": 518.0},
    ),
    "inpho_ascii": Case(read, poses, (LOCAL, *GRIDS), "opk"),
}
