"""camera_positions.csv: positions of PPK at the exposures, data_specs/camera_positions.md.

Standard deviations are along north, east, down; the covariances between them are not in the file.
"""

import numpy as np

from ....base.errors import InputError
from ....base.files import atomic_write
from ....geodesy.gpstime import WEEK_S
from ....records.camera_positions import CameraPositions
from ..orientation.exported import check_names, table_text
from ..text.columns import Aliases, check_increasing, columns_of, gps_time
from ..text.text import Source, read_text_table

PRODUCT = "camera_positions.csv"
NUMBERS = (
    "gps_week",
    "tow",
    "lat_deg",
    "lon_deg",
    "h_m",
    "sd_n_m",
    "sd_e_m",
    "sd_d_m",
    "quality",
    "of_camera",
)
COLUMNS = ("image", *NUMBERS)
ALIASES: Aliases = {name: (name,) for name in COLUMNS}
FORM = "%s,%d,%.7f,%.10f,%.10f,%.4f" + ",%.4f" * 3 + ",%d,%d\n"


def write_camera_positions(positions: CameraPositions, path: Source) -> None:
    """Write positions; times have 7 decimals, degrees 10, metres 4.

    Raises
    ------
    InputError
        Names with commas, or positions without a GPS week.
    """
    check_names(positions.images, ",")
    if positions.gps_week is None:
        raise InputError(f"{positions.source}: the GPS week of the exposures is not known")
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
    atomic_write(path, table_text(",".join(COLUMNS) + "\n", positions.images, FORM, table))


def read_camera_positions(path: Source) -> CameraPositions:
    """Read the file back, with diagonal covariances; InputError with file and line."""
    table = read_text_table(path)
    index = columns_of(table, ALIASES, COLUMNS, (COLUMNS,))
    values = np.column_stack([table.floats(index[name]) for name in NUMBERS])
    time, week = gps_time(table, values[:, 1], values[:, 0], None)
    check_increasing(table, time)
    cov = np.zeros((time.size, 3, 3))
    cov[:, range(3), range(3)] = values[:, 5:8] ** 2
    return CameraPositions(
        table.strings(index["image"]),
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
