"""Options of how the sensors are mounted: table [mounting], and the files that it is taken from."""

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

from ...io.options.camera_options import Matrix, angle_sets
from ...io.options.schema import Triple, option

if TYPE_CHECKING:
    from ...io.formats.orientation.mounting_file import MountingFile


@dataclass(frozen=True)
class MountingTable:
    """Table [mounting], of which `records.cameras.mounting.Mounting` is made."""

    antenna_m: Triple = option(
        (0.0, 0.0, 0.0),
        "vector from the camera to the antenna, in camera axes",
        kind="lever",
        unit="m",
    )
    imu_m: Triple = option(
        (0.0, 0.0, 0.0),
        "vector from the camera to the IMU, in camera axes",
        kind="lever",
        unit="m",
    )
    antenna_sigma_m: float | None = option(
        None,
        "standard deviation of each component of the lever arm from the IMU to the antenna's "
        "phase centre, which all covariances include (the default is larger in height, as a "
        "caliper does not reach the phase centre); 0: exact, estimated only with filter.lever_arm",
        unit="m",
        usual="0.005, in height 0.02",
        low=0.0,
        high=10.0,
    )
    camera_from_body: Matrix | None = option(
        None, "T_b'^c", kind="matrix", form="3 rows of 3 numbers", usual="diag(-1, -1, 1)"
    )
    boresight: Matrix | None = option(
        None, "B_b^b'", kind="matrix", form="3 rows of 3 numbers", usual="identity"
    )
    boresight_deg: tuple[str, Triple] | None = option(
        None,
        "bore-sight B_b^b' as angles, { opk = [..] }, { rpy = [..] } or { metashape_ypr = [..] } "
        "(`records.cameras.mounting`)",
        kind="angles",
        unit="deg",
        members=angle_sets,
    )
    file: Path | None = option(
        None,
        "calibrated mounting (mounting_file.md) from `insgnss calibrate` or `insgnss adjust`; the "
        "keys that it gives (of [mounting], camera.time_offset_s) must not be set here",
        kind="file",
    )
    max_age_days: float = option(
        365.0,
        "longest time between the data of mounting.file and the flight; beyond it a note advises "
        "to calibrate the mounting anew, since screws, dampers and lenses change within a season",
        unit="d",
        low=0.0,
    )


@dataclass(frozen=True)
class MountingSource:
    """A file that the mounting of a flight was taken from.

    Parameters
    ----------
    file : Path
        The file.
    keys : tuple of str
        What was taken.
    max_age_days : float
        Days between flight and calibration above which the report tells of them.
    made : MountingFile
        What the file holds.
    """

    file: Path
    keys: tuple[str, ...]
    max_age_days: float
    made: "MountingFile"
