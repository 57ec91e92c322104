"""TUM and g2o, formats.md D: poses camera (right, down, view) to world, quaternions x y z w.

TUM   t x y z qx qy qz qw; its images are told by the order of time only
g2o   VERTEX_SE3:QUAT id x y z qx qy qz qw;  EDGE_SE3:QUAT i j d q information, T_i^-1 T_j
"""

from pathlib import Path

import numpy as np

from .case import GRIDS, LOCAL, SPACE, Case
from .geometry import Array, Frame, Poses, Table, quaternion, turn
from .lines import comments, rows


def _q(columns: Array) -> Array:
    """w x y z of x y z w."""
    return columns[:, [3, 0, 1, 2]]


def read_tum(path: Path) -> Table:
    values = np.array(rows(path), dtype=float)
    assert (np.diff(values[:, 0]) > 0.0).all()
    columns = dict(zip("txyz", values[:, :4].T, strict=True)) | {"q": _q(values[:, 4:])}
    return Table([f"{8001 + k}.tif" for k in range(len(values))], columns)


def read_g2o(path: Path) -> Table:
    """Names of vertices stand in comments."""
    name = dict(line.split(" ", 1) for line in comments(path) if line.split(" ", 1)[0].isdigit())
    vertices = [row[1:] for row in rows(path) if row[0] == "VERTEX_SE3:QUAT"]
    edges = np.array([row[1:10] for row in rows(path) if row[0] == "EDGE_SE3:QUAT"], dtype=float)
    values = np.array(vertices, dtype=float)
    columns = dict(zip("xyz", values[:, 1:4].T, strict=True)) | {"q": _q(values[:, 4:])}
    return Table(
        [name[row[0]] for row in vertices],
        columns | {"pair": edges[:, :2].astype(int), "d": edges[:, 2:5], "dq": _q(edges[:, 5:])},
    )


def poses(table: Table, frame: Frame) -> Poses:
    x = table.place()
    return Poses(table.names, frame.ecef(x), frame.axes(x) @ quaternion(table["q"]))


def poses_by_edges(table: Table, frame: Frame) -> Poses:
    """Each image but the first from the one before and the edge between; of a Cartesian frame."""
    x, R, dR = table.place(), quaternion(table["q"]), quaternion(table["dq"])
    names, centre, axes = [], [], []
    for (i, j), d, turned in zip(table["pair"], table["d"], dR, strict=True):
        names.append(table.names[j])
        centre.append(x[i] + R[i] @ d)
        axes.append(R[i] @ turned)
    there = np.array(centre)
    return Poses(names, frame.ecef(there), frame.axes(there) @ np.array(axes))


def world_to_camera(table: Table) -> Table:
    """The table with the inverse rotations."""
    R = turn(quaternion(table["q"]))
    return table.changed(q=np.stack([quaternion_of(r) for r in R]))


def quaternion_of(R: Array) -> Array:
    """w x y z, by the eigenvector of the symmetric matrix of Bar-Itzhack (2000)."""
    K = np.array(
        [
            [R[0, 0] - R[1, 1] - R[2, 2], R[1, 0] + R[0, 1], R[2, 0] + R[0, 2], R[2, 1] - R[1, 2]],
            [R[1, 0] + R[0, 1], R[1, 1] - R[0, 0] - R[2, 2], R[2, 1] + R[1, 2], R[0, 2] - R[2, 0]],
            [R[2, 0] + R[0, 2], R[2, 1] + R[1, 2], R[2, 2] - R[0, 0] - R[1, 1], R[1, 0] - R[0, 1]],
            [R[2, 1] - R[1, 2], R[0, 2] - R[2, 0], R[1, 0] - R[0, 1], np.trace(R)],
        ]
    )
    return np.linalg.eigh(K)[1][[3, 0, 1, 2], 3]


CASES = {
    "tum": Case(read_tum, poses, (LOCAL, SPACE, *GRIDS), "quaternion"),
    "g2o": Case(read_g2o, poses, (LOCAL, SPACE, *GRIDS), "quaternion"),
    "g2o edges": Case(read_g2o, poses_by_edges, (LOCAL, SPACE), "quaternion"),
}
