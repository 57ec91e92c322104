"""Text files of ODyN, comma separated without header, data_specs/odyn.md.

IMU.txt (t, gyro, specific force), GPS.txt (t, latitude, longitude, height) and image_timestamps.txt
(image, t) are what `imu_csv`, `gnss_text` and `events` read by default. What ODyN adds is
initial_guess.txt and reference.txt: time, position and the quaternion (w, x, y, z) that takes body
axes into east, north, up; here it becomes C_nb with

    C_nb = C_ned,enu C_enu,b                                                                   (O.1)
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ....geodesy.rotation import rotation_from_quaternion
from ..text.columns import TIME, Aliases, check_increasing, columns_of, gps_time
from ..text.text import Source, read_table

Array = NDArray[np.float64]

NED_FROM_ENU = np.array([[0.0, 1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, -1.0]])
POSE = ("tow", "lat", "lon", "h", "qw", "qx", "qy", "qz")
ALIASES: Aliases = {**TIME, **{name: (name,) for name in POSE[1:]}}
NORM_LIMIT = 1e-3


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
    table = read_table(path)
    if not table.complete:
        raise table.error_at(
            len(table.values) - 1, "truncated: the last line has no end; copy the file again"
        )
    index = columns_of(table, ALIASES, POSE, (POSE,))
    cols = {name: np.ascontiguousarray(table.values[:, index[name]]) for name in POSE}
    time, _ = gps_time(table, cols["tow"], None, None)
    check_increasing(table, time)
    q = np.column_stack([cols[name] for name in POSE[4:]])
    with np.errstate(over="ignore"):  # a length that is no number of this machine is none of one
        norm = np.linalg.norm(q, axis=1)
    if (bad := ~(np.abs(norm - 1.0) < NORM_LIMIT)).any():
        row = int(np.argmax(bad))
        raise table.error_at(
            row,
            f"quaternion of length {norm[row]:.6g}, not 1 (limit {NORM_LIMIT:g}); are the columns t"
            " lat lon h qw qx qy qz?",
        )
    for name, limit in (("lat", 90.0), ("lon", 360.0)):
        if (beyond := np.abs(cols[name]) > limit).any():
            row = int(np.argmax(beyond))
            raise table.error_at(
                row,
                f"{name} {cols[name][row]:.6f} deg exceeds {limit:.0f}; are the positions in a"
                " local frame?",
            )
    C_nb = NED_FROM_ENU @ rotation_from_quaternion(q / norm[:, None])  # (O.1)
    return OdynPoses(time, np.radians(cols["lat"]), np.radians(cols["lon"]), cols["h"], C_nb)
