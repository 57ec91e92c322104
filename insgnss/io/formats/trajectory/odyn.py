"""Text files of ODyN, comma separated without header, data_specs/odyn.md.

IMU.txt (t, gyro, specific force), GPS.txt (t, latitude, longitude, height) and image_timestamps.txt
(image, t) are what `imu_csv`, `gnss_text` and `events` read by default. What ODyN adds is
initial_guess.txt and reference.txt: time, position and the quaternion (w, x, y, z) that takes body
axes into east, north, up; here it becomes C_nb with

    C_nb = C_ned,enu C_enu,b                                                                   (O.1)
"""

from dataclasses import dataclass

import numpy as np

from ....geodesy.rotation import NED_ENU, rotation_from_quaternion
from ....records import Array
from ..names import TIME
from ..text.clock import check_increasing
from ..text.columns import TableSpec
from ..text.order import refuse_rows
from ..text.text import Source

ODYN_COLUMNS = "tow lat lon h qw qx qy qz"
SPEC = TableSpec(
    {name: name for name in ODYN_COLUMNS.split()} | TIME, ODYN_COLUMNS, (ODYN_COLUMNS,)
)
NORM_LIMIT = 1e-3  # by which a quaternion's length may differ from 1: rounding to three decimals


@dataclass(frozen=True, eq=False)
class OdynPoses:
    """Poses of a file.

    Attributes
    ----------
    time : ndarray
        (n,) s, GPST.
    lat, lon, height : ndarray
        (n,) rad, m.
    C_nb : ndarray
        (n, 3, 3) rotations of body axes (of the IMU file) to north, east, down.
    """

    time: Array
    lat: Array
    lon: Array
    height: Array
    C_nb: Array


def read_odyn_poses(path: Source) -> OdynPoses:
    """Read initial_guess.txt or reference.txt.

    Raises
    ------
    InputError
        What cannot be read, or a quaternion that is not of length one, with file and line.
    """
    table = SPEC.read(path)
    if not table.table.complete:
        message = "truncated: the last line has no end; copy the file again"
        raise table.error_at(len(table) - 1, message)
    cols = table.numbers()
    time, _, _ = table.examined_time("trajectory rows", None, "s")
    check_increasing(table, time)
    q = table.block("qw qx qy qz")
    with np.errstate(over="ignore"):  # a length that is no number of this machine is none of one
        norm = np.linalg.norm(q, axis=1)
    message = f"quaternion of length {{:.6g}}, not 1 (limit {NORM_LIMIT:g}); are the columns t"
    message += " lat lon h qw qx qy qz?"
    refuse_rows(table, ~(np.abs(norm - 1.0) < NORM_LIMIT), message, norm)
    for name, limit in (("lat", 90.0), ("lon", 360.0)):
        message = f"{name} {{:.6f}} deg exceeds {limit:.0f}; are the positions in a local frame?"
        refuse_rows(table, np.abs(cols[name]) > limit, message, cols[name])
    C_nb = NED_ENU @ rotation_from_quaternion(q / norm[:, None])  # (O.1)
    return OdynPoses(time, np.radians(cols["lat"]), np.radians(cols["lon"]), cols["h"], C_nb)
