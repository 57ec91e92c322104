"""Poses that a bundle adjustment gave back, in the frame that its file, or the caller, names.

A file that names no frame (COLMAP, MicMac, Inpho, Metashape's omega phi kappa) stands in the CRS
that the caller names, else in a tangent plane: that of the caller or of the other file.
"""

from pathlib import Path

import numpy as np

from ...base.errors import InputError
from ...geodesy.frames import TangentPlane
from ...geodesy.projection import is_geographic
from ...io.formats.returned.poses import ReturnedPoses
from ...io.formats.returned.reading import read_returned_poses
from ...records.framed import GEOGRAPHIC, PROJECTED, TANGENT
from .hints import Hints
from .poses import CoordinateFrame, Poses

PLANE_M = 1e5  # m, coordinates beyond which are of no tangent plane


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
    lat, lon, h, C_fE = frame.resolved(x, path)
    C_Ef = np.swapaxes(C_fE, 1, 2)
    return Poses(
        str(path),
        form,
        "projection centre",
        lat,
        lon,
        h,
        images=given.images,
        C_Ex=given.C if given.true_north else C_Ef @ given.C,
        angle_set=given.angle_set,
        angles=given.angles,
        C_fE=None if given.true_north else C_fE,
        local=x if frame.kind in (TANGENT, PROJECTED) else None,
        plane=frame.plane,
        projection=frame.projection,
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
    if hints.plane is None and float(np.abs(given.position[:, :2]).max()) > PLANE_M:
        x = given.position[0]
        raise InputError.in_file(
            path,
            f"does not say the CRS of its coordinates, {x[0]:.3f} {x[1]:.3f}; give it, --crs"
            " EPSG:2056",
        )
    return CoordinateFrame(TANGENT, hints.plane)
