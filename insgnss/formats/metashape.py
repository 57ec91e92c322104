"""Metashape's reference csv for cameras: geographic position and yaw, pitch, roll, data_specs/metashape.md.

Import with columns "nxyzabcXYZABC", delimiter ",", skip_rows 1, a geographic CRS with ellipsoidal heights (EPSG:4979) and
rotation angles yaw, pitch, roll; a GPS/INS offset must stay off, since lever arm and bore-sight are applied.

x is longitude, y latitude. The angles belong to the camera with axes right, up, back in east, north, up *at the camera*
(true north), so the attitude in the tangent plane m moves there with C_mn, NED at the camera into m:

    R = NED_ENU C_mn^T C_mc CV_RUB = Rz(-yaw) Rx(pitch) Ry(roll)                                        (M.1)

and covariances move with A = NED_ENU C_mn^T, A P A^T. The format takes no correlations.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ..files import atomic_write
from ..geodesy.frames import TangentPlane
from ..geodesy.rotation import CV_RUB, NED_ENU, rotation_from_ypr, ypr_from_rotation, ypr_jacobian
from ..records import ExteriorOrientation
from ._columns import Aliases, columns_of
from ._eo import angle_sigma, check_names
from ._text import Source, read_text_table

Array = NDArray[np.float64]

POSE = ("X", "Y", "Z", "Yaw", "Pitch", "Roll")
ACCURACY = tuple(f"{name}_acc" for name in POSE)
COLUMNS = ("Label", *POSE, *ACCURACY)
ALIASES: Aliases = {name: (name.lower(),) for name in COLUMNS}


@dataclass(frozen=True, eq=False)
class MetashapeReference:
    """The content of the file: (n,) latitude, longitude rad, height m; (n, 3) yaw pitch roll rad, accuracies m (east north up), rad."""

    images: tuple[str, ...]
    lat: Array
    lon: Array
    height: Array
    ypr: Array
    accuracy_m: Array
    accuracy_ypr: Array

    @property
    def C_enu_camera(self) -> Array:
        """(n, 3, 3), camera (x image right, y image down, z viewing direction) to east, north, up at the camera."""
        return np.asarray(rotation_from_ypr(self.ypr) @ CV_RUB)


def write_metashape(eo: ExteriorOrientation, path: Source) -> None:
    """Write degrees with 10 decimals (position) and 6 (angles), metres with 4, accuracies 5 and 6."""
    check_names(eo.images, ",")
    plane = TangentPlane(*eo.origin)
    lat, lon, height = plane.geodetic_from_position(eo.position_m)
    A = NED_ENU @ np.swapaxes(plane.C_mn(lat, lon), 1, 2)
    ypr = ypr_from_rotation(A @ eo.C_mc @ CV_RUB)  # (M.1)
    P_position, P_psi = (A @ P @ np.swapaxes(A, 1, 2) for P in (eo.cov[:, :3, :3], eo.cov[:, 3:, 3:]))
    sigma_position = np.sqrt(np.diagonal(P_position, axis1=1, axis2=2))
    sigma_ypr = angle_sigma(ypr, ypr_jacobian, 1, P_psi, eo.images, "yaw pitch roll")
    place = np.column_stack([np.degrees(lon), np.degrees(lat), height])
    table = np.hstack([place, np.degrees(ypr), sigma_position, np.degrees(sigma_ypr)])
    form = "%s,%.10f,%.10f,%.4f" + ",%.6f" * 3 + ",%.5f" * 3 + ",%.6f" * 3 + "\n"
    rows = "".join(form % (name, *row) for name, row in zip(eo.images, table.tolist(), strict=True))
    atomic_write(path, "#" + ",".join(COLUMNS) + "\n" + rows)


def read_metashape(path: Source) -> MetashapeReference:
    """Read the file back; InputError with file and line."""
    table = read_text_table(path)
    index = columns_of(table, ALIASES, COLUMNS, (COLUMNS,))
    lon, lat, height = (table.floats(index[name]) for name in "XYZ")

    def block(names: tuple[str, ...]) -> Array:
        return np.column_stack([table.floats(index[name]) for name in names])

    return MetashapeReference(
        table.strings(index["Label"]),
        np.radians(lat),
        np.radians(lon),
        height,
        np.radians(block(POSE[3:])),
        block(ACCURACY[:3]),
        np.radians(block(ACCURACY[3:])),
    )
