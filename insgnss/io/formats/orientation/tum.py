"""Poses of the TUM RGB-D benchmark, for evo and many SLAM tools, data_specs/tum.md.

    time tx ty tz qx qy qz qw

the projection centre and the Hamilton quaternion of the matrix that takes the camera (x image
right, y image down, z viewing direction) into the frame's axes. The format holds no covariance.
"""

from typing import Literal

import numpy as np

from ....base.files import atomic_write
from ....geodesy.rotation import quaternion_from_rotation
from ....records import Array, FramedOrientation
from ..text.text import Source, format_rows
from .exported import check_choice, comment_lines
from .poses import unix_seconds

TUM_STAMPS = {
    "tow": "seconds of the GPS week, GPST, going on past its end",
    "unix": "seconds since 1970, UTC",
}


def write_tum(eo: FramedOrientation, path: Source, time: Literal["tow", "unix"] = "tow") -> None:
    """Write seconds with 6 decimals, metres with 6, quaternions with 10, in the order of time.

    Parameters
    ----------
    eo : FramedOrientation
        The orientation in a Cartesian frame.
    path : path
        The file.
    time : {"tow", "unix"}
        Seconds of the GPS week, or since 1970 (UTC).

    Raises
    ------
    UsageError
        A frame that is not Cartesian, or another scale.
    """
    check_choice("time", time, TUM_STAMPS)
    seconds = eo.time if time == "tow" else unix_seconds(eo)
    order = np.argsort(seconds, kind="stable")
    table = np.column_stack([seconds, eo.coordinates, wxyz_last(eo.C_fc)])[order]
    head = comment_lines(
        eo,
        f"time: {TUM_STAMPS[time]}",
        "time tx ty tz qx qy qz qw: camera (x right, y down, z forward) to the frame's axes",
    )
    form = "%.6f %.6f %.6f %.6f %.10f %.10f %.10f %.10f\n"
    atomic_write(path, [head, *format_rows(form, table)])


def wxyz_last(C: Array) -> Array:
    """Return quaternions (n, 4) x, y, z, w of rotations (n, 3, 3)."""
    return np.roll(quaternion_from_rotation(C), -1, axis=-1)
