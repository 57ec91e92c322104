"""Flight log of RealityCapture, trajectory of RealityScan, data_specs/realitycapture.md.

    name, latitude, longitude, altitude, yaw, pitch, roll

with x, y for latitude, longitude in a tangent plane.

R = Rz(-yaw) Rx(pitch) Ry(roll) takes the camera (right, up, back) to east, north, up at the image,
as Metashape's. Lines that begin with `#` are skipped by the program. Its own omega, phi, kappa are
another set of angles than everybody's (data_specs/realitycapture.md), so they are not written.
The log with accuracies has the standard deviations of the axes; correlations have no place.
"""

from ....records import FramedOrientation
from ....records.framed import GEOGRAPHIC
from ..orientation.ascii_columns import write_columns
from ..orientation.exported import comment_lines
from ..text.text import Source

ANGLES_REMARK = (
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
    InputError
        Names with commas.
    DataError
        Pitch is +-90 deg.
    """
    _write(eo, path, accuracies=False)


def write_realitycapture_accuracy(eo: FramedOrientation, path: Source) -> None:
    """Write as `write_realitycapture` does, with standard deviations at the end of each line.

    They are those along x (east), y (north) and altitude in m, and of yaw, pitch, roll in deg.
    """
    _write(eo, path, accuracies=True)


def _write(eo: FramedOrientation, path: Source, accuracies: bool) -> None:
    plan, plan_header = (
        ("y x", "latitude,longitude") if eo.frame.kind == GEOGRAPHIC else ("x y", "x,y")
    )
    columns, header = f"image {plan} z ypr", f"#name,{plan_header},altitude,yaw,pitch,roll"
    if accuracies:
        columns += " s_xyz s_ypr"
        header += ",accX,accY,accZ,accYaw,accPitch,accRoll"
    write_columns(eo, path, columns, ",", f"{comment_lines(eo, ANGLES_REMARK)}{header}\n")
