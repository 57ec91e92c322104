"""What a person may choose of `insgnss calibrate tripod | similarity | materialise | mounting`.

Standard library only, for the command line.
"""

import math
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Literal, NamedTuple

from ...base.errors import OptionError
from ...base.wording import setting
from ...io.options.kinds import Checked
from ...io.options.schema import argument

_pair = partial(argument, kind="pair", positive=True, metavar="M,DEG")
_sigma = partial(argument, unit="m", low=1e-4, high=10.0)


class PoseSigma(NamedTuple):
    """Standard deviations of poses whose file has none.

    Parameters
    ----------
    position_m : float
        Of each coordinate of a projection centre, m.
    angle_deg : float
        Of the attitude about each axis, deg.
    """

    position_m: float = 0.01
    angle_deg: float = 0.01

    def __str__(self) -> str:
        """Return both in words."""
        return f"{1e3 * self.position_m:g} mm and {self.angle_deg:g} deg"


@dataclass(frozen=True)
class DataOptions(Checked):
    """What the file of a mounting says of its data.

    Parameters
    ----------
    photo : Path or None
        An image of the camera.
    date : str
        Of the data, ISO.
    """

    photo: Path | None = argument(
        None, "an image of the camera; its Exif data name the camera in the file", metavar="IMAGE"
    )
    date: str = argument(
        "", "date of the data, where no file states it", kind="date", metavar="YYYY-MM-DD"
    )


@dataclass(frozen=True)
class PlaceOptions(Checked):
    """How the positions of tables are to be understood.

    Parameters
    ----------
    crs : str or None
        Of coordinates on the Earth whose file does not name it: of poses, and of tables that are
        neither geodetic nor in the frame of the poses.
    geoid : Path or None
        For heights above sea level.
    """

    crs: str | None = argument(
        None,
        "CRS of x y z on the Earth where the file does not name it, such as EPSG:2056+5728",
        usual="local axes",
        metavar="CRS",
    )
    geoid: Path | None = argument(None, "grid of geoid heights, for --crs")


@dataclass(frozen=True)
class FrameOptions(PlaceOptions):
    """How the coordinates of poses of other programs are to be understood.

    Parameters
    ----------
    shift : tuple of float or None
        What was subtracted from them, in the unit of the CRS.
    """

    shift: tuple[float, float, float] | None = argument(
        None,
        "what was subtracted from the coordinates of the poses, in the unit of their CRS",
        kind="pair",
        metavar="E,N,H",
    )


@dataclass(frozen=True)
class PoseOptions(PlaceOptions, DataOptions):
    """Options of calibrations that read poses and positions.

    Parameters
    ----------
    pose_sigma : PoseSigma
        Of poses whose file has no standard deviations.
    """

    pose_sigma: tuple[float, float] = _pair(
        PoseSigma(), "standard deviations of poses whose file has none", usual="0.01,0.01"
    )

    @property
    def sigma_of_poses(self) -> PoseSigma:
        """The standard deviations by name."""
        return PoseSigma(*self.pose_sigma)


@dataclass(frozen=True)
class TripodOptions(PoseOptions):
    """How the files of setups are to be understood.

    Parameters
    ----------
    pin_sigma_m : float
        Of pins whose table has none, m: 1 mm of a theodolite on a few metres.
    """

    pin_sigma_m: float = argument(
        0.001,
        "standard deviation of pins whose table has none",
        unit="m",
        positive=True,
        cli="--pin-sigma",
    )


@dataclass(frozen=True)
class SimilarityOptions(FrameOptions, PoseOptions):
    """What the files of a flight do not say.

    Parameters
    ----------
    antenna_sigma_m : tuple of float or None
        Horizontal and vertical, in the place of what the table has.
    ground : Path or None
        Ground points.
    points : Path or None
        Image observations of ground points, where the poses' file has none.
    camera : Path or None
        camera.toml, where the poses' file has none.
    """

    antenna_sigma_m: tuple[float, float] | None = _pair(
        None,
        "their standard deviations, m, in the place of the file's",
        usual="of a file without: 0.02,0.03",
        cli="--antenna-sigma",
        metavar="H,V",
    )
    ground: Path | None = argument(
        None,
        "ground points measured in the images; give the CAMERAS file again for the markers in it",
    )
    points: Path | None = argument(
        None, "image observations of ground points, where CAMERAS has none"
    )
    camera: Path | None = argument(None, "camera.toml, where CAMERAS has no interior orientation")


@dataclass(frozen=True)
class MaterialiseOptions(DataOptions):
    """What the files of targets do not say.

    Parameters
    ----------
    receiver : tuple of Path
        Sessions of the receiver: its targets and, as `antenna`, its phase centre.
    pose : Path or None
        Pose of the camera's own image, in the axes of the targets on it.
    image : str
        Name of that image.
    after : Path or None
        A second block of the mounted sensors, after the flight.
    antenna_name : str
        Name of the phase centre in the sessions.
    target_sigma_m : float
        Of targets whose table has no standard deviations, m.
    pose_sigma : PoseSigma
        Of a pose without.
    """

    receiver: tuple[Path, ...] = argument(
        ...,
        "one table for each session: targets on the receiver, and its phase centre by"
        " GNSS (row antenna)",
    )
    pose: Path | None = argument(
        None,
        "pose of an image that the camera itself took, in the frame of CAMERA",
        usual="its",
        metavar="POSES",
    )
    image: str = argument("", "name of that image")
    after: Path | None = argument(
        None, "targets as in MOUNTED, measured after the flight, to show whether the mount moved"
    )
    antenna_name: str = argument("antenna", "row of the phase centre")
    target_sigma_m: float = argument(
        2e-4,
        "standard deviation of targets whose table has none",
        unit="m",
        positive=True,
        cli="--target-sigma",
    )
    pose_sigma: tuple[float, float] = _pair(
        PoseSigma(3e-4, 0.05),
        "standard deviations of a pose whose file has none",
        usual="0.0003,0.05",
    )

    @property
    def sigma_of_poses(self) -> PoseSigma:
        """The standard deviations by name."""
        return PoseSigma(*self.pose_sigma)


@dataclass(frozen=True)
class Assumptions(FrameOptions, DataOptions):
    """What is taken as known before the calibration of a flight's mounting.

    Parameters
    ----------
    frame : str
        How the block lies to the flight.
    shift_sigma_m : float or None
        Of a shift between ground control and fixes; None: not known.
    lever_arm_sigma_m, imu_sigma_m : float
        Of the antenna's lever arm from the IMU and of the IMU's from the camera.
    pose_sigma : tuple of float
        What the block's camera calibration moves poses by, m and deg.
    """

    frame: Literal["auto", "similarity", "shift"] = argument(
        "auto",
        "transformation from the block's coordinates to the flight's: similarity; shift"
        " (coordinates of ground control); auto: similarity, but coordinates of another scale"
        " are refused",
    )
    shift_sigma_m: float | None = _sigma(
        None,
        "standard deviation of a shift between ground control and fixes",
        low=1e-6,
        usual="not known",
        cli="--shift-sigma",
    )
    lever_arm_sigma_m: float = _sigma(
        0.3,
        "of the antenna's lever arm from the IMU, as the flight file has it",
        cli="--lever-arm-sigma",
    )
    imu_sigma_m: float = _sigma(
        0.3, "of the IMU's lever arm from the camera, as the flight file has it", cli="--imu-sigma"
    )
    pose_sigma: tuple[float, float] = _pair(
        (0.03, 0.01),
        "errors of the block's poses by its camera calibration, the same for all in camera"
        " axes, where the poses have no covariances",
        usual="0.03,0.01",
    )

    @property
    def alike(self) -> tuple[float, float]:
        """Of errors that all poses of a block have alike in camera axes (L.6), m and rad."""
        return self.pose_sigma[0], math.radians(self.pose_sigma[1])

    def __post_init__(self) -> None:
        super().__post_init__()
        if self.frame == "similarity" and self.shift_sigma_m is not None:
            problem = (
                "is only for poses in the coordinates of ground control; remove it, or remove {}"
            )
            raise OptionError("shift_sigma_m", problem.format(setting("frame", self.frame)))
