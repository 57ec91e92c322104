"""Flight log of RealityCapture, trajectory of RealityScan, data_specs/realitycapture.md.

    name, latitude, longitude, altitude, yaw, pitch, roll

with x, y for latitude, longitude in a tangent plane.

R = Rz(-yaw) Rx(pitch) Ry(roll) takes the camera (right, up, back) to east, north, up at the image,
as Metashape's. Lines that begin with `#` are skipped by the program. Its own omega, phi, kappa are
another set of angles than everybody's (data_specs/realitycapture.md), so they are not written.
The log with accuracies has the standard deviations of the axes; correlations have no place.
"""

import numpy as np

from ....records import FramedOrientation
from ....records.framed import GEOGRAPHIC, TANGENT
from ..orientation.exported import (
    YPR,
    angles_of,
    check_frame,
    comment_lines,
    north_attitude,
    places_sigma,
    write_rows,
)
from ..text.text import Source

ANGLES = (
    "angles: yaw pitch roll, deg; R = Rz(-yaw) Rx(pitch) Ry(roll) takes the camera (x right, y up,"
    " z back) to east north up, true north"
)


def write_realitycapture(eo: FramedOrientation, path: Source) -> None:
    """Write a geographic or tangent-plane frame.

    Degrees have 10 decimals (position) and 6 (angles), metres 4.

    Parameters
    ----------
    eo : FramedOrientation
        The orientation in its frame.
    path : path
        The file.

    Raises
    ------
    UsageError
        Another frame.
    InputError
        Names with commas.
    DataError
        Pitch is +-90 deg.
    """
    _write(eo, path, "realitycapture", accuracies=False)


def write_realitycapture_accuracy(eo: FramedOrientation, path: Source) -> None:
    """Write as `write_realitycapture` does, with standard deviations at the end of each line.

    They are those along x (east), y (north) and altitude in m, and of yaw, pitch, roll in deg.
    """
    _write(eo, path, "realitycapture_accuracy", accuracies=True)


def _write(eo: FramedOrientation, path: Source, name: str, accuracies: bool) -> None:
    check_frame(eo, name, GEOGRAPHIC, TANGENT)
    ypr, sigma = angles_of(eo, *north_attitude(eo), YPR)
    geographic = eo.frame.kind == GEOGRAPHIC
    form, numbers = "%.6f,%.6f,%.6f", [np.degrees(ypr)]
    columns = f"#name,{'latitude,longitude' if geographic else 'x,y'},altitude,yaw,pitch,roll"
    if accuracies:
        numbers += [places_sigma(eo), np.degrees(sigma)]
        form += ",%.5f" * 3 + ",%.6f" * 3
        columns += ",accX,accY,accZ,accYaw,accPitch,accRoll"
    head = comment_lines(eo, ANGLES) + columns + "\n"
    write_rows(eo, path, head, ",", form, *numbers, northing_first=geographic)
