"""OpenDroneMap's geo.txt: positions with accuracies, data_specs/odm.md.

    EPSG:4326                        (or the geographic CRS of the datum, such as EPSG:6319)
    # comments from the second line on
    name x y z NaN NaN NaN horizontal vertical

x is longitude or easting. The angles are left out (NaN NaN NaN) on purpose: OpenDroneMap turns yaw,
pitch, roll into omega, phi, kappa with points in ECEF where the world's CRS is meant, which is
right nowhere (data_specs/odm.md), and zeros would be taken for real angles. The accuracies are the
root mean square of the two horizontal standard deviations, and the vertical one, m.
"""

from ....base.errors import UsageError
from ....records import FramedOrientation
from ..orientation.ascii_columns import write_columns
from ..orientation.exported import comment_lines
from ..text.text import Source


def write_odm_geo(eo: FramedOrientation, path: Source) -> None:
    """Write a geographic frame, or a projected one that has a code.

    Degrees have 10 decimals, metres 4, accuracies 5.

    Parameters
    ----------
    eo : FramedOrientation
        The orientation in its frame.
    path : path
        The file.

    Raises
    ------
    UsageError
        A CRS without code.
    InputError
        Names with blanks.
    """
    code = "EPSG:4326" if eo.frame.crs == "EPSG:4979" else eo.frame.crs
    if not code.startswith("EPSG:"):
        raise UsageError(
            f"odm: {eo.frame.name} has no EPSG code, which the first line of geo.txt needs; export"
            " a CRS that has, or geographic"
        )
    columns = (
        "columns: name x y z yaw pitch roll horizontal vertical; angles left out, since the reader"
        " turns them"
    )
    header = f"{code}\n{comment_lines(eo, columns)}"
    write_columns(eo, path, "image xyz NaN NaN NaN s_plan", " ", header)
