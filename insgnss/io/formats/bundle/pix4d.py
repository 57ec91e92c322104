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

from ....records import FramedOrientation
from ....records.framed import PROJECTED
from ..orientation.ascii_columns import write_columns
from ..orientation.exported import frame_words, one_line
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
    InputError
        Names with commas.
    DataError
        Pitch is +-90 deg.
    """
    names = ["easting", "northing"] if eo.frame.kind == PROJECTED else ["longitude", "latitude"]
    plan = "x y"
    if eo.frame.northing_first:
        names.reverse()
        plan = "y x"
    header = (
        f"#imagename,{names[0]}"
        f" ({one_line(frame_words(eo))}),{names[1]},z,yaw,pitch,roll,accuracyHorz,accuracyVert\n"
    )
    write_columns(eo, path, f"image {plan} z ypr s_plan", ",", header)


def write_pix4d_mapper(eo: FramedOrientation, path: Source) -> None:
    """Write a projected or tangent-plane frame with omega, phi, kappa.

    The file has no accuracies and no header; digits and refusals are those of matic.
    """
    write_columns(eo, path, "image xyz opk", ",")
