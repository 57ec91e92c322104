"""Flight log of RealityCapture with accuracies, data_specs/realitycapture.md.

What the columns of accuracies are called in an import format, and from which north yaw counts in a
projected CRS, could not be checked. The standard deviations are those of the axes, correlations
have no place.
"""

from ...records import FramedOrientation
from ...records.framed import GEOGRAPHIC, PROJECTED, TANGENT
from ..bundle.realitycapture import write_log
from ..orientation.exported import check_frame
from ..text.text import Source

UNVERIFIED = (
    "experimental: the accuracies' names in an import format, and the north of yaw in a projected"
    " CRS, are unverified"
)


def write_realitycapture_accuracy(eo: FramedOrientation, path: Source) -> None:
    """Write the pose with its accuracies; projected frames as well.

    They are those along x (east), y (north) and altitude in m, and of yaw, pitch, roll in deg.
    """
    check_frame(eo, "realitycapture_accuracy", GEOGRAPHIC, TANGENT, PROJECTED)
    write_log(eo, path, UNVERIFIED)
