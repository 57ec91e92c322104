"""COLMAP, formats.md B6.

images.txt    IMAGE_ID QW QX QY QZ TX TY TZ CAMERA_ID NAME: world to camera (right, down, view), T =
              -R C; a second line of points
database.db   pose_priors: position (3 doubles; system 0 is latitude, longitude, height, 1
              Cartesian), covariance 3 x 3, gravity: down in the camera's axes. No heading: of the
              attitude only the vertical is told
"""

import sqlite3
from pathlib import Path

import numpy as np

from .case import CAMERA, GLOBE, GRIDS, LOCAL, SPACE, Case
from .geometry import Array, Frame, Poses, Table, quaternion, turn
from .lines import comments, named, numbers


def read(path: Path) -> Table:
    """A shift that was subtracted stands in a comment."""
    file = path / "images.txt"
    lines = [
        line for line in file.read_text(encoding="utf-8").splitlines() if not line.startswith("#")
    ]
    names, columns = named(
        [line.split() for line in lines[::2]], "id qw qx qy qz x y z camera name"
    )
    shift = next(line for line in comments(file) if line.startswith("shift:"))
    return Table(
        names,
        columns | {"q": np.column_stack([columns[f"q{c}"] for c in "wxyz"])},
        {"shift": shift},
    )


def poses(table: Table, frame: Frame) -> Poses:
    R = quaternion(table["q"])
    x = -(turn(R) @ table.place()[:, :, None])[:, :, 0] + numbers(table.said["shift"])
    return Poses(table.names, frame.ecef(x), frame.axes(x) @ turn(R))


def read_priors(path: Path) -> Table:
    database = sqlite3.connect(path)
    try:
        what = "images.name, position, position_covariance, gravity, coordinate_system"
        rows = database.execute(
            f"SELECT {what} FROM pose_priors JOIN images ON corr_data_id = image_id ORDER BY"
            " image_id"
        ).fetchall()
    finally:
        database.close()
    names, position, covariance, gravity, system = zip(*rows, strict=True)

    def doubles(blobs: tuple[bytes, ...]) -> Array:
        return np.array([np.frombuffer(blob, dtype="<f8") for blob in blobs])

    columns = dict(zip("xyz", doubles(position).T, strict=True)) | {
        "down": doubles(gravity),
        "system": np.array(system),
    }
    return Table(list(names), columns | {"cov": doubles(covariance).reshape(-1, 3, 3)})


def poses_priors(table: Table, frame: Frame) -> Poses:
    """The column of the covariance is not turned here."""
    geographic = table["system"] == 0
    assert geographic.all() or not geographic.any()
    return Poses(
        table.names,
        frame.ecef(table.place("y", "x", "z") if geographic.all() else table.place()),
        None,
    )


CASES = {
    "colmap": Case(read, poses, (LOCAL, SPACE, *GRIDS), "quaternion", options={"camera": CAMERA}),
    "colmap_priors": Case(
        read_priors, poses_priors, (LOCAL, GLOBE, SPACE, *GRIDS), options={"camera": CAMERA}
    ),
}
