"""camera_positions.csv: positions of PPK at the exposures, data_specs/camera_positions.md.

Standard deviations are along north, east, down; the covariances between them are not in the file.
"""

import numpy as np

from ....base.errors import InputError
from ....geodesy.gpstime import WEEK_S
from ....records.cameras.camera_positions import CameraPositions
from ..orientation.exported import check_names
from ..text.clock import check_increasing, gps_time
from ..text.columns import TableOut, TableSpec
from ..text.text import Source

PRODUCT = "camera_positions.csv"
OUT = TableOut(
    "image gps_week=%d tow=%.7f lat_deg=%.10f lon_deg=%.10f h_m=%.4f sd_n_m=%.4f sd_e_m=%.4f"
    " sd_d_m=%.4f quality=%d of_camera=%d"
)
SPEC = TableSpec.exactly(OUT.names, text=True)


def write_camera_positions(positions: CameraPositions, path: Source) -> None:
    """Write positions; times have 7 decimals, degrees 10, metres 4.

    Raises
    ------
    InputError
        Names with commas, or positions without a GPS week.
    """
    check_names(positions.images, ",")
    if positions.gps_week is None:
        problem = "the GPS week of the exposures is not known; give gps_week where they are read"
        raise InputError(f"{positions.source}: {problem}")
    weeks = np.floor(positions.time / WEEK_S)
    table = np.column_stack(
        [
            positions.gps_week + weeks,
            positions.time - WEEK_S * weeks,
            np.degrees(positions.lat),
            np.degrees(positions.lon),
            positions.height,
            np.sqrt(np.diagonal(positions.cov_ned, axis1=1, axis2=2)),
            positions.quality,
            positions.of_camera,
        ]
    )
    OUT.write(path, table, positions.images)


def read_camera_positions(path: Source) -> CameraPositions:
    """Read the file back, with diagonal covariances; InputError with file and line."""
    table = SPEC.read(path)
    values = table.block(OUT.names.removeprefix("image "))
    time, week = gps_time(table, values[:, 1], values[:, 0], None)
    check_increasing(table, time)
    cov = np.zeros((time.size, 3, 3))
    cov[:, range(3), range(3)] = values[:, 5:8] ** 2
    return CameraPositions(
        table.strings("image"),
        time,
        np.radians(values[:, 2]),
        np.radians(values[:, 3]),
        values[:, 4],
        cov,
        values[:, 8],
        values[:, 9],
        week,
        str(path),
    )
