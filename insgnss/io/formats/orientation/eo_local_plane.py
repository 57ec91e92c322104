"""EO_local-plane.txt: orientation in the tangent plane, data_specs/eo_local_plane.md.

    image E N U omega phi kappa sE sN sU sOmega sPhi sKappa

R = Rx(omega) Ry(phi) Rz(kappa) takes the camera with axes right, up, back into east, north, up: R =
C_mc CV_RUB.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ....base import __version__
from ....geodesy.rotation import CV_RUB, rotation_from_opk
from ....records import FramedOrientation
from ..text.columns import Columns, TableOut, TableSpec
from ..text.text import Source
from .ascii_columns import numbers_of
from .exported import quoted_names

Array = NDArray[np.float64]

POSE_COLUMNS, SIGMA_COLUMNS = "E N U omega phi kappa", "sE sN sU sOmega sPhi sKappa"
OUT = TableOut(
    "image E=%.4f N=%.4f U=%.4f omega=%.6f phi=%.6f kappa=%.6f sE=%.5f sN=%.5f sU=%.5f"
    " sOmega=%.6f sPhi=%.6f sKappa=%.6f",
    " ",
)
SPEC = TableSpec(
    {
        "image": "image img photo name label filename",
        **{
            name: f"{name.lower()} {name.lower()}_m {name.lower()}_deg"
            for name in f"{POSE_COLUMNS} {SIGMA_COLUMNS}".split()
        },
    },
    required=f"image {POSE_COLUMNS}",
    layouts=(OUT.names, f"image {POSE_COLUMNS}"),
    text=True,
)


@dataclass(frozen=True, eq=False)
class LocalPlaneEo:
    """The content of the file: arrays (n, 3), m and rad.

    The standard deviations are None where the file has none.
    """

    images: tuple[str, ...]
    position_m: Array
    opk: Array
    sigma_position_m: Array | None = None
    sigma_opk: Array | None = None

    @property
    def C_mc(self) -> Array:
        """(n, 3, 3) rotations of camera axes into the tangent plane.

        Camera axes are x image right, y image down, z viewing direction.
        """
        return np.asarray(rotation_from_opk(self.opk) @ CV_RUB)


def write_eo_local_plane(eo: FramedOrientation, path: Source) -> None:
    """Write a tangent plane: metres with 4 decimals (standard deviations 5), degrees with 6.

    Raises
    ------
    InputError
        A name with a line end; others that would not stand for themselves are quoted.
    DataError
        phi is +-90 deg.
    """
    images = quoted_names(eo.images, None)
    table = numbers_of(eo, "xyz opk s_xyz s_opk")
    OUT.write(path, table, images, comments=comments(eo))


def comments(eo: FramedOrientation) -> list[str]:
    """Return the comment lines: frame, origin, angle set, what was applied."""
    lat, lon = np.degrees(eo.frame.origin[:2])
    return [
        (
            f"insgnss {__version__}: exterior orientation of {len(eo.images)} images, GPS week"
            f" {eo.gps_week}"
        ),
        f"frame: tangent plane, east north up, {eo.frame.datum_name}",
        (
            f"origin: latitude {lat:.10f} deg, longitude {lon:.10f} deg, ellipsoidal height"
            f" {eo.frame.origin[2]:.4f} m"
        ),
        "position: projection centre, m; lever arm and bore-sight applied",
        (
            "angles: omega phi kappa, deg; R = Rx(omega) Ry(phi) Rz(kappa) takes the camera (x"
            " right, y up, z back) to east north up"
        ),
        "sigmas: one standard deviation, m and deg",
        *(f"done: {' '.join(sentence.split())}" for sentence in eo.history),
    ]


def read_eo_local_plane(path: Source, columns: Columns = None) -> LocalPlaneEo:
    """Read the file back, with or without standard deviations.

    Raises
    ------
    InputError
        What cannot be read, with file and line.
    """
    table = SPEC.read(path, columns)
    pose, images = table.block(POSE_COLUMNS), table.strings("image")
    position_m, opk = pose[:, :3], np.radians(pose[:, 3:])
    if any(name not in table for name in SIGMA_COLUMNS.split()):
        return LocalPlaneEo(images, position_m, opk)
    sigma = table.block(SIGMA_COLUMNS)
    return LocalPlaneEo(images, position_m, opk, sigma[:, :3], np.radians(sigma[:, 3:]))
