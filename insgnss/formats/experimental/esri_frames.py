"""Frames table of ArcGIS (frame camera raster type), data_specs/esri_frames.md.

The columns are those of Esri's page "Frames table schema": omega, phi, kappa in degrees and the
perspective centre in the units of a projected CRS. Which way the angles turn depends on the cameras
table beside it (AngleDirection, PolarityFlag); here they are those of photogrammetry, R = Rx(omega)
Ry(phi) Rz(kappa), camera right-up-back to the axes of the CRS, which no file of ArcGIS confirmed.
"""

import numpy as np

from ...base.files import atomic_write
from ...records import FramedOrientation
from ...records.framed import PROJECTED
from ..orientation.exported import (
    OPK,
    angles_of,
    check_frame,
    check_names,
    frame_attitude,
    places,
    table_text,
)
from ..text.text import Source

HEAD = "ObjectID,Raster,CameraID,PerspectiveX,PerspectiveY,PerspectiveZ,Omega,Phi,Kappa\n"


def write_esri_frames(eo: FramedOrientation, path: Source, camera: str = "camera") -> None:
    """Write a projected frame; `camera` is the CameraID of the cameras table.

    Raises
    ------
    UsageError
        Another frame.
    InputError
        Names with commas.
    """
    check_frame(eo, "esri_frames", PROJECTED)
    check_names((*eo.images, camera), ",")
    opk, _ = angles_of(eo, *frame_attitude(eo), OPK)
    table = np.hstack([np.arange(1.0, len(eo.images) + 1.0)[:, None], places(eo), np.degrees(opk)])
    form = f"%d,%s,{camera.replace('%', '%%')}" + ",%.4f" * 3 + ",%.6f" * 3 + "\n"
    atomic_write(path, table_text(HEAD, eo.images, form, table, 1))
