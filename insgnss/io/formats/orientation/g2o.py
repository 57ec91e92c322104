r"""A pose graph in g2o's text format: cameras and relative poses, data_specs/g2o.md.

    VERTEX_SE3:QUAT id  x y z  qx qy qz qw                        camera to frame: T = (p, R)
    EDGE_SE3:QUAT i j   dx dy dz  qx qy qz qw   information       Z = T_i^-1 T_j, upper triangle
                                                                  of 6 x 6

g2o's error of an edge is e = (t, v) of Z^-1 T_i^-1 T_j, v the vector part of its quaternion: half
its rotation vector. With the truth p + dp, exp([psi x]) R in the frame's axes, and a = p_j - p_i,

    T_i^-1 T_j = ( R_i' (a + dp_j - dp_i + [a x] psi_i),
                   R_i' R_j exp([R_j' (psi_j - psi_i) x]) )                                    (G.1)

to first order, so that the error of the estimate Z is

    e = J_i (dp_i, psi_i) + J_j (dp_j, psi_j)                                                  (G.2)
    J_i = [ -R_j'  R_j' [a x] ; 0  -R_j'/2 ],   J_j = [ R_j'  0 ; 0  R_j'/2 ]
    P = J_i P_ii J_i' + J_j P_jj J_j' + J_i P_ij J_j' + (J_i P_ij J_j')'                       (G.3)
    information P^-1

with P_ij the cross-covariance of the smoother: what both poses err alike drops out. The half in
(G.2) makes the information of the rotation four times that of the rotation vector, which GTSAM
takes in its place when it reads the file. The half is left out by default, since most who read such
files today do so through GTSAM, or take the numbers for those of a rotation vector; `rotation =
"quaternion"` keeps it for g2o's own optimiser. The order (t, R) is the file's; GTSAM turns it into
its own.
"""

from typing import Literal

import numpy as np
from numpy.typing import NDArray

from ....base.files import atomic_write
from ....geodesy.rotation import skew
from ....records import Array, FramedOrientation
from ....records.relative import GAP_S
from ..text.text import Source, format_rows
from .exported import check_choice, check_names, comment_lines
from .poses import inverse_covariance, positive
from .tum import wxyz_last

# factor of the rotation vector in the error of an edge (G.2), and what the file calls it
G2O_ROTATIONS = {
    "quaternion": (0.5, "quaternion vector (half the rotation vector, g2o's own error)"),
    "vector": (1.0, "rotation vector (GTSAM's error; g2o's own needs rotation=quaternion)"),
}


def write_g2o(
    eo: FramedOrientation,
    path: Source,
    max_gap_s: float = GAP_S,
    rotation: Literal["quaternion", "vector"] = "vector",
) -> None:
    """Write vertices, numbered from 0 in the order of the images, and edges between neighbours.

    Parameters
    ----------
    eo : FramedOrientation
        The orientation in a Cartesian frame.
    path : path
        The file.
    max_gap_s : float
        Exposures farther apart than this are not joined, s.
    rotation : {"quaternion", "vector"}
        What the information of rotations belongs to (G.2): "vector" for GTSAM, "quaternion" for
        g2o.

    Raises
    ------
    UsageError
        A frame that is not Cartesian, or wrong options.
    DataError
        A pair whose covariance has no inverse.
    """
    check_names(eo.images, "\n")
    check_choice("rotation", rotation, G2O_ROTATIONS)
    factor, description = G2O_ROTATIONS[rotation]
    first, second, cross = _edges(eo, positive(max_gap_s, "max_gap_s", "seconds"))
    measured, P = relative_pose(eo, (first, second), cross, factor)
    named = zip(first, second, strict=True)
    pairs = [f"images {eo.images[i]} and {eo.images[j]}" for i, j in named]
    information = inverse_covariance(P, "the covariance of their relative pose", pairs)
    upper = information[:, *np.triu_indices(6)]
    head = comment_lines(
        eo,
        "VERTEX_SE3:QUAT id x y z qx qy qz qw: camera (x right, y down, z forward) to the frame's"
        " axes",
        "EDGE_SE3:QUAT i j dx dy dz qx qy qz qw + upper triangle of the information, order"
        " translation, rotation,",
        f"of g2o's error of Z^-1 T_i^-1 T_j, the rotation as {description}; neighbours within"
        f" {max_gap_s:g} s",
    )
    names = "".join(f"# {k} {name}\n" for k, name in enumerate(eo.images))
    vertices = np.column_stack([np.arange(len(eo.images)), eo.coordinates, wxyz_last(eo.C_fc)])
    edges = np.column_stack([first, second, measured, upper])
    pose = " %.6f" * 3 + " %.10f" * 4
    atomic_write(
        path,
        [
            head,
            names,
            *format_rows(f"VERTEX_SE3:QUAT %d{pose}\n", vertices),
            *format_rows(f"EDGE_SE3:QUAT %d %d{pose}" + " %.9g" * 21 + "\n", edges),
        ],
    )


def _edges(
    eo: FramedOrientation, max_gap_s: float
) -> tuple[NDArray[np.int64], NDArray[np.int64], Array]:
    """Rows of neighbours, of a rig of one camera, and what they share (G.3)."""
    first, second, cross = [], [], []
    for rows, shared in eo.neighbours:
        near = np.flatnonzero(np.diff(eo.time[rows]) <= max_gap_s)
        first.append(rows[near])
        second.append(rows[near + 1] if near.size else rows[near])
        cross.append(shared[near])
    return np.concatenate(first), np.concatenate(second), np.concatenate(cross)


def relative_pose(
    eo: FramedOrientation,
    pairs: tuple[NDArray[np.int64], NDArray[np.int64]],
    cross: Array,
    factor: float,
) -> tuple[Array, Array]:
    """Return the pose of the second image of each pair in the first, and its covariance (G.3).

    Parameters
    ----------
    eo : FramedOrientation
        The orientation.
    pairs : tuple of ndarray
        (m,) rows of the first images, and of the second ones.
    cross : ndarray
        (m, 6, 6) P_ij.
    factor : float
        1/2 for the vector of the quaternion, 1 for the rotation vector.

    Returns
    -------
    pose : ndarray
        (m, 7) x y z qx qy qz qw.
    cov : ndarray
        (m, 6, 6) covariance of its error.
    """
    i, j = pairs
    R_i_t, R_j_t = eo.C_fc[i].swapaxes(1, 2), eo.C_fc[j].swapaxes(1, 2)
    a = eo.coordinates[j] - eo.coordinates[i]
    J_i, J_j = np.zeros((2, len(i), 6, 6))
    # (G.2)
    J_i[:, :3, :3], J_i[:, :3, 3:], J_i[:, 3:, 3:] = -R_j_t, R_j_t @ skew(a), -factor * R_j_t
    J_j[:, :3, :3], J_j[:, 3:, 3:] = R_j_t, factor * R_j_t
    J_i_t, J_j_t = J_i.swapaxes(1, 2), J_j.swapaxes(1, 2)
    shared = J_i @ cross @ J_j_t
    P = J_i @ eo.cov[i] @ J_i_t + J_j @ eo.cov[j] @ J_j_t + shared + shared.swapaxes(1, 2)  # (G.3)
    translation = (R_i_t @ a[:, :, None])[:, :, 0]
    return np.column_stack([translation, wxyz_last(R_i_t @ eo.C_fc[j])]), 0.5 * (
        P + P.swapaxes(1, 2)
    )
