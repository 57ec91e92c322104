"""Poses that a bundle adjustment gave back, in the frame that its file, or the caller, names.

A file that names no frame (COLMAP, MicMac, Inpho, Metashape's omega phi kappa) stands in the CRS
that the caller names, else in a tangent plane: that of the caller or of the other file.
"""

from pathlib import Path

import numpy as np

from ...geodesy.crs import is_geographic
from ...geodesy.frames import TangentPlane
from ...io.formats.returned.poses import ReturnedPoses
from ...io.formats.returned.reading import read_returned_poses
from ...records.framed import GEOGRAPHIC, PROJECTED, TANGENT
from .hints import Hints
from .poses import CoordinateFrame, Poses, tangent_frame


def read_adjusted_poses(form: str, path: Path, hints: Hints) -> Poses:
    """Poses of a file of one of `io.formats.returned.reading.RETURNED`.

    Raises
    ------
    InputError
        With file and line; where nothing tells the frame of large coordinates.
    """
    given = read_returned_poses(path, form)
    frame = _frame(given, hints, path)
    x = given.position
    if frame.kind == PROJECTED and frame.projection is not None:
        x = x * frame.projection.unit_m
    elif frame.kind == GEOGRAPHIC and given.kind != GEOGRAPHIC:
        x = np.column_stack([np.radians(x[:, :2]), x[:, 2]])
    return frame.poses(
        path,
        form,
        x,
        given.C,
        given.true_north,
        images=given.images,
        angle_set=given.angle_set,
        angles=given.angles,
        notes=given.notes,
    )


def _frame(given: ReturnedPoses, hints: Hints, path: Path) -> CoordinateFrame:
    """Frame as the file says it, else as the caller does."""
    if given.kind == PROJECTED:
        own = hints.projection if hints.crs is not None else hints.projected(given.crs)
        return CoordinateFrame(PROJECTED, projection=own)
    if given.kind == TANGENT and given.origin:
        return CoordinateFrame(TANGENT, TangentPlane(*given.origin))
    if given.kind:
        return CoordinateFrame(given.kind)
    if hints.crs is not None:
        if is_geographic(hints.crs):
            return CoordinateFrame(GEOGRAPHIC)
        return CoordinateFrame(PROJECTED, projection=hints.projection)
    return tangent_frame(path, given.position, hints.plane)
