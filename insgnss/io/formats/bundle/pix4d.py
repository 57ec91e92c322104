"""Image geolocation files of PIX4Dmatic and PIX4Dmapper, data_specs/pix4d.md.

matic    imagename, coordinate1, coordinate2, z, yaw, pitch, roll, accuracy horizontal, accuracy
         vertical. The coordinates stand in the order of the CRS' own axes: latitude first in WGS
         84. The angles are those of Metashape: 0 with the top of the image to true north and a
             camera that looks down.
mapper   imagename, X, Y, Z, omega, phi, kappa; R = Rx(omega) Ry(phi) Rz(kappa), camera
         right-up-back to the axes of the CRS.

Neither takes standard deviations of angles. The horizontal accuracy is the root mean square of both
axes. Where mapper expects accuracies behind angles is not documented, so they are not written.
"""

import numpy as np

from ....records import FramedOrientation
from ....records.framed import GEOGRAPHIC, PROJECTED, TANGENT
from ..orientation.exported import (
    OPK,
    YPR,
    angles_of,
    check_frame,
    frame_attitude,
    frame_words,
    north_attitude,
    one_line,
    plan_and_height_sigma,
    write_rows,
)
from ..text.text import Source


def write_pix4d_matic(eo: FramedOrientation, path: Source) -> None:
    """Write a geographic or projected frame with yaw, pitch, roll and accuracies.

    Degrees have 10 decimals (position) and 6 (angles), metres 4, accuracies 5.

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
    check_frame(eo, "pix4d_matic", GEOGRAPHIC, PROJECTED)
    ypr, _ = angles_of(eo, *north_attitude(eo), YPR)
    names = ["easting", "northing"] if eo.frame.kind == PROJECTED else ["longitude", "latitude"]
    if northing_first := eo.frame.northing_first:
        names.reverse()
    head = (
        f"#imagename,{names[0]}"
        f" ({one_line(frame_words(eo))}),{names[1]},z,yaw,pitch,roll,accuracyHorz,accuracyVert\n"
    )
    form, numbers = "%.6f,%.6f,%.6f,%.5f,%.5f", (np.degrees(ypr), plan_and_height_sigma(eo))
    write_rows(eo, path, head, ",", form, *numbers, northing_first=northing_first)


def write_pix4d_mapper(eo: FramedOrientation, path: Source) -> None:
    """Write a projected or tangent-plane frame with omega, phi, kappa.

    The file has no accuracies and no header; digits and refusals are those of matic.
    """
    check_frame(eo, "pix4d_mapper", PROJECTED, TANGENT)
    opk, _ = angles_of(eo, *frame_attitude(eo), OPK)
    write_rows(eo, path, "", ",", "%.6f,%.6f,%.6f", np.degrees(opk))
