"""Poses of an adjusted block of any readable program, beside those of a flight.

Poses with a place on the Earth are taken to the tangent plane of the flight, rigidly; so are those
of axes of their own that lie where the flight's do. Others are tied by a similarity.
"""

from dataclasses import replace
from pathlib import Path

import numpy as np

from ...base.errors import InputError
from ...base.inputs import opened_text, read_text
from ...geodesy.frames import TangentPlane
from ...io.formats.blocks.joined import match_names
from ...io.formats.orientation.pose_covariance import POSES_COVARIANCE_FILE, read_pose_covariance
from ...records import ExteriorOrientation
from ...records.block import Array
from .records import CameraPoses, Rows

SAME_PLANE_M = 2.0e3  # of the mean position from the flight's: coordinates of its tangent plane
RELATIVE_EXTENTS = 0.5, 2.0  # extent over that of the flight


def block_poses(poses_read: CameraPoses, eo: ExteriorOrientation) -> CameraPoses:
    """Return the poses of an adjusted block beside those of a flight.

    Parameters
    ----------
    poses_read : CameraPoses
        As `read_camera_poses` returns them.
    eo : ExteriorOrientation
        Whose tangent plane has the axes of what is georeferenced.

    Returns
    -------
    CameraPoses
        All images with a pose.

    Raises
    ------
    InputError
        With file and line.
    """
    path, notes = Path(poses_read.source), poses_read.notes
    plane = TangentPlane(*(float(x) for x in eo.origin))
    if poses_read.frame != "own":
        poses_read = poses_read.in_plane(plane)
    elif _near(poses_read.position, eo):
        poses_read = replace(poses_read, frame="plane", plane=plane)
        notes += (f"{path.name} names no frame; the tangent plane of the flight is taken",)
    if _with_aerial_control(path):
        notes += (
            f"{path.name} was adjusted with aerial control: if that came from this flight, the"
            " flight counts twice, and standard deviations are too small; leave"
            " aerial_control.file out, or take the mounting.toml of that adjustment",
        )
    whole = path.parent / POSES_COVARIANCE_FILE
    if path.is_file() and whole.is_file():
        poses_read = replace(
            poses_read, cov=read_pose_covariance(whole, poses_read.images, poses_read.cov)
        )
        notes += (f"covariance of all poses together from {whole.name}",)
    return replace(poses_read, notes=notes)


def _with_aerial_control(path: Path) -> bool:
    """Tell whether poses say of themselves that a trajectory helped to adjust them."""
    if not path.is_file():
        return False
    if path.suffix.lower() == ".json":
        return '"adjusted with ' in read_text(path, errors="replace")
    with opened_text(path, errors="replace") as stream:
        lines = [line.rstrip("\n") for line in stream if not line.startswith("#")][:100000]
    head = lines[0].split(",") if lines else []
    if "aerial_control" not in head:
        return False
    column = head.index("aerial_control")
    return any(line.split(",")[column : column + 1] == ["yes"] for line in lines[1:])


def _near(X: Array, eo: ExteriorOrientation) -> bool:
    """Tell whether coordinates look like those of the flight's tangent plane."""
    distance = X.mean(axis=0) - eo.position_m.mean(axis=0)
    size, size_of_eo = (float(np.linalg.norm(np.std(x, axis=0))) for x in (X, eo.position_m))
    low, high = RELATIVE_EXTENTS
    return bool(
        np.linalg.norm(distance) < SAME_PLANE_M and low < size / max(size_of_eo, 1e-9) < high
    )


def common_images(block: CameraPoses, eo: ExteriorOrientation) -> tuple[CameraPoses, Rows]:
    """Return the images that both know.

    Parameters
    ----------
    block : CameraPoses
        The block.
    eo : ExteriorOrientation
        The flight.

    Returns
    -------
    block : CameraPoses
        These images, in the order of the flight.
    rows : ndarray
        Their rows in the flight's orientation, increasing.

    Raises
    ------
    InputError
        None is common.
    """
    row = match_names(block.images, eo.images)
    common = np.flatnonzero(row >= 0)
    if not common.size:
        raise InputError(
            f"{block.source}: none of its {len(block.images)} images ({block.images[0]}, ...) is of"
            f" this flight ({eo.images[0]}, ...); names are compared without directory, ending and"
            " case"
        )
    common = common[np.argsort(row[common])]
    return block.taken(common), row[common]
