"""trajectory.csv: the navigation solution and its sigmas, data_specs/trajectory_csv.md.

Position is that of the IMU's navigation centre, velocity and standard deviations are along north,
east, down, heading is in [0, 360) deg from true north, the week is that of the row.
"""

from dataclasses import dataclass

import numpy as np

from ....geodesy.gpstime import WEEK_S
from ....geodesy.rotation import rpy_from_rotation
from ....records import Array, Trajectory
from ..text.clock import check_increasing, examined_time
from ..text.columns import TableOut, TableSpec
from ..text.text import Source
from .sbet import BodyStates, rpy_sigma

OUT = TableOut(
    "gps_week=%d tow=%.6f lat_deg=%.10f lon_deg=%.10f h_m=%.4f vn=%.5f ve=%.5f vd=%.5f"
    " roll_deg=%.6f pitch_deg=%.6f heading_deg=%.6f sd_n_m=%.5f sd_e_m=%.5f sd_d_m=%.5f"
    " sd_vn=%.5f sd_ve=%.5f sd_vd=%.5f sd_roll_deg=%.6f sd_pitch_deg=%.6f sd_heading_deg=%.6f"
)
SPEC = TableSpec.exactly(OUT.names)


@dataclass(frozen=True, eq=False)
class TrajectoryTable(BodyStates):
    """The content of the file: as `records.Trajectory`, with `sigma` instead of the covariance.

    `sigma` is (n, 9): standard deviations of position m, velocity m/s, roll pitch heading rad.
    """

    sigma: Array
    gps_week: int


def write_trajectory_csv(trajectory: Trajectory, path: Source) -> None:
    """Write a trajectory.

    Times have 6 decimals, degrees of position 10, metres 4, m/s 5, degrees of attitude 6.
    """
    weeks = np.floor(trajectory.time / WEEK_S)
    rpy = np.degrees(rpy_from_rotation(trajectory.C_nb))
    rpy[:, 2] = np.where((heading := np.round(rpy[:, 2] % 360.0, 6)) < 360.0, heading, 0.0)
    sigma = np.sqrt(np.diagonal(trajectory.cov, axis1=1, axis2=2)[:, :6])
    time = [trajectory.gps_week + weeks, trajectory.time - WEEK_S * weeks]
    position = [np.degrees(trajectory.lat), np.degrees(trajectory.lon), trajectory.height]
    table = np.column_stack(
        [*time, *position, trajectory.velocity_ned, rpy, sigma, np.degrees(rpy_sigma(trajectory))]
    )
    OUT.write(path, table)


def read_trajectory_csv(path: Source) -> TrajectoryTable:
    """Read the file back; InputError with file and line."""
    table = SPEC.read(path)
    values = table.block(OUT.names)
    time, week, _ = examined_time(table, values[:, 1], values[:, 0], "trajectory rows", None, "s")
    assert week is not None
    check_increasing(table, time)
    sigma = values[:, 11:] * ([1.0] * 6 + [np.pi / 180.0] * 3)
    lat, lon = np.radians(values[:, 2]), np.radians(values[:, 3])
    return TrajectoryTable(
        time, lat, lon, values[:, 4], values[:, 5:8], np.radians(values[:, 8:11]), sigma, week
    )
