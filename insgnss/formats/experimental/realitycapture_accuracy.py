"""Flight log of RealityCapture with accuracies, data_specs/realitycapture.md.

From which north yaw counts in a projected CRS could not be checked. The standard deviations are
those of the axes, correlations have no place. The columns are named to the program by the
description beside the file (`bundle.import_helpers`).
"""

from ...records import FramedOrientation
from ...records.framed import GEOGRAPHIC, PROJECTED, TANGENT
from ..bundle.realitycapture import write_log
from ..orientation.exported import check_frame
from ..text.text import Source

UNVERIFIED = "experimental: the north of yaw in a projected CRS is unverified"


def write_realitycapture_accuracy(eo: FramedOrientation, path: Source) -> None:
    """Write the pose with its accuracies; projected frames as well.

    They are those along x (east), y (north) and altitude in m, and of yaw, pitch, roll in deg.
    """
    check_frame(eo, "realitycapture_accuracy", GEOGRAPHIC, TANGENT, PROJECTED)
    write_log(eo, path, UNVERIFIED)
