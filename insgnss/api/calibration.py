"""Verbs of the mounting calibration: tripod, similarity in flight, targets, the joint one."""

import os
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Literal

from ..base.advance import heard
from ..base.inputs import reading

if TYPE_CHECKING:
    from ..flight.config.flight_file import Flight
    from ..io.formats.orientation.mounting_file import MountingFile
    from ..photogrammetry.mounting_calibration.products import CalibratedMounting

Source = str | os.PathLike[str]


def read_mounting(path: Source) -> "MountingFile":
    """Read a calibrated mounting, mounting.toml.

    Parameters
    ----------
    path : the file.

    Returns
    -------
    What it determines, with covariances, verdict, date, camera and inputs.

    Raises
    ------
    InputError : the file is missing, or a key or a value in it is wrong.
    """
    from ..io.formats.orientation.mounting_file import read_mounting_file

    return read_mounting_file(path)[0]


@heard
@reading()
def calibrate_tripod(
    poses: Source,
    pins: Source,
    *,
    out: Source | None = None,
    force: bool = False,
    pose_sigma: tuple[float, float] = (0.01, 0.01),
    pin_sigma_m: float = 0.001,
    crs: str | None = None,
    photo: Source | None = None,
    date: str = "",
) -> "CalibratedMounting":
    """Estimate the lever arm from camera to antenna of an aircraft on a tripod in several setups.

    Parameters
    ----------
    poses : camera poses, one a setup: a table, eo.json, a block of Metashape, COLMAP, ...
    pins : tips of the pin in the antenna's place, by the names of the poses.
    out : mounting.toml to write, with a page beside it; None: none.
    force : whether to overwrite a file that was made from other inputs.
    pose_sigma : m and deg, of poses whose file has no standard deviations.
    pin_sigma_m : of pins whose table has none.
    crs : of the pins, where they stand in one.
    photo : an image of the camera, which names it.
    date : of the data, ISO.

    Returns
    -------
    The mounting with verdicts: `mounting`, `summary()`, `as_dict()`.

    Raises
    ------
    InputError : a file is wrong, or both do not belong together.
    """
    from ..photogrammetry.mounting_calibration.options import TripodOptions
    from ..photogrammetry.mounting_calibration.products import written
    from ..photogrammetry.mounting_calibration.tripod_files import calibrate_tripod as calibrate

    options = TripodOptions(
        pose_sigma=pose_sigma, pin_sigma_m=pin_sigma_m, crs=crs, photo=_path(photo), date=date
    )
    result = calibrate(Path(poses), Path(pins), options)
    return result if out is None else written(result, Path(out), force)


@heard
@reading()
def calibrate_similarity(
    cameras: Source,
    antenna: Source,
    *,
    ground: Source | None = None,
    points: Source | None = None,
    camera: Source | None = None,
    out: Source | None = None,
    force: bool = False,
    pose_sigma: tuple[float, float] = (0.01, 0.01),
    antenna_sigma_m: tuple[float, float] | None = None,
    crs: str | None = None,
    geoid: Source | None = None,
    shift: tuple[float, float, float] | None = None,
    photo: Source | None = None,
    date: str = "",
) -> "CalibratedMounting":
    """Estimate the lever arm from camera to antenna of adjusted poses and antenna positions.

    Parameters
    ----------
    cameras : adjusted poses in any frame: Metashape, COLMAP, OpenSfM, eo.json, a table, ...
    antenna : antenna positions at exposures, by image, or the file of Metashape that has them.
    ground : ground points, which are measured in images.
    points : image observations of them, where `cameras` has none.
    camera : camera.toml, where `cameras` has no interior orientation.
    out : mounting.toml to write, with a page beside it; None: none.
    force : whether to overwrite a file that was made from other inputs.
    pose_sigma : m and deg, of poses whose file has no standard deviations.
    antenna_sigma_m : horizontal and vertical, in the place of the table's.
    crs : of poses, antenna positions and ground points whose files do not name it.
    geoid : grid of geoid heights, for `crs`.
    shift : what was subtracted from the coordinates of the poses, in the unit of their CRS.
    photo : an image of the camera, which names it.
    date : of the data, ISO.

    Returns
    -------
    The mounting with verdicts: `mounting`, `summary()`, `as_dict()`.

    Raises
    ------
    InputError : a file is wrong, or they do not belong together.
    """
    from ..photogrammetry.mounting_calibration.options import SimilarityOptions
    from ..photogrammetry.mounting_calibration.products import written
    from ..photogrammetry.mounting_calibration.similarity_files import (
        calibrate_similarity as calibrate,
    )

    options = SimilarityOptions(
        pose_sigma=pose_sigma,
        antenna_sigma_m=antenna_sigma_m,
        ground=_path(ground),
        points=_path(points),
        camera=_path(camera),
        crs=crs,
        geoid=_path(geoid),
        shift=shift,
        photo=_path(photo),
        date=date,
    )
    result = calibrate(Path(cameras), Path(antenna), options)
    return result if out is None else written(result, Path(out), force)


@heard
@reading()
def calibrate_materialise(
    camera: Source,
    mounted: Source,
    receiver: Sequence[Source],
    *,
    pose: Source | None = None,
    image: str = "",
    after: Source | None = None,
    out: Source | None = None,
    force: bool = False,
    photo: Source | None = None,
    date: str = "",
) -> "CalibratedMounting":
    """Estimate the lever arm from camera to antenna by targets on camera and receiver.

    Parameters
    ----------
    camera : targets on the camera in a scaled frame, a table or a block.
    mounted : targets on camera and receiver in one block of the aircraft, before the flight.
    receiver : targets on the receiver and its phase centre (row `antenna`), a table a session.
    pose : pose of an image that the camera itself took, in the frame of `camera`.
    image : name of that image.
    after : as `mounted`, after the flight.
    out : mounting.toml to write, with a page beside it; None: none.
    force : whether to overwrite a file that was made from other inputs.
    photo : an image of the camera, which names it.
    date : of the data, ISO.

    Returns
    -------
    The mounting with verdicts: `mounting`, `summary()`, `as_dict()`.

    Raises
    ------
    InputError : a file is wrong, or they do not belong together.
    UsageError : the pose of the camera's own image is missing.
    """
    from ..photogrammetry.mounting_calibration.materialise_files import (
        calibrate_materialise as calibrate,
    )
    from ..photogrammetry.mounting_calibration.options import MaterialiseOptions
    from ..photogrammetry.mounting_calibration.products import written

    options = MaterialiseOptions(
        receiver=tuple(Path(path) for path in receiver),
        pose=_path(pose),
        image=image,
        after=_path(after),
        photo=_path(photo),
        date=date,
    )
    result = calibrate(Path(camera), Path(mounted), options)
    return result if out is None else written(result, Path(out), force)


def _path(source: Source | None) -> Path | None:
    return None if source is None else Path(source)


@heard
@reading()
def calibrate_mounting(
    flight: "Flight | Source",
    poses: Source,
    *,
    out: Source | None = None,
    force: bool = False,
    frame: Literal["auto", "similarity", "shift"] = "auto",
    shift_sigma_m: float | None = None,
    lever_arm_sigma_m: float = 0.3,
    imu_sigma_m: float = 0.3,
    pose_sigma: tuple[float, float] = (0.03, 0.01),
    crs: str | None = None,
    geoid: Source | None = None,
    shift: tuple[float, float, float] | None = None,
    photo: Source | None = None,
    date: str | None = None,
) -> "CalibratedMounting":
    """Estimate lever arms, bore-sight and camera delay from a flight and the poses of its block.

    Parameters
    ----------
    flight : the flight file, or what `load_flight` made of it.
    poses : adjusted poses of its images, of any readable program.
    out : mounting.toml to write, with a page beside it; None: none.
    force : whether to overwrite a file that was made from other inputs.
    frame : how the block lies to the flight: by a similarity, by a shift alone; "auto": a
        similarity, and coordinates of another scale are refused.
    shift_sigma_m : of a shift between ground control and fixes; None: not known.
    lever_arm_sigma_m : of the antenna's lever arm from the IMU, as the flight file has it.
    imu_sigma_m : of the IMU's lever arm from the camera, as the flight file has it.
    pose_sigma : m and deg, what the block's camera calibration moves poses by, all alike in
        camera axes, where they have no covariances.
    crs : of poses whose file does not name it.
    geoid : grid of geoid heights, for `crs`.
    shift : what was subtracted from the coordinates of the poses, in the unit of their CRS.
    photo : an image of the camera, which names it.
    date : of the data, ISO; by default that of the flight.

    Returns
    -------
    The mounting with verdicts: `mounting`, `summary()`, `as_dict()`.

    Raises
    ------
    InputError : a file is wrong, or the poses are not of this flight.
    DataError : the data do not support the answer.
    """
    from ..flight.config.flight_file import Flight
    from ..flight.config.load import load_flight
    from ..photogrammetry.mounting_calibration.flight_products import calibrated
    from ..photogrammetry.mounting_calibration.in_flight import calibrate_mounting as calibrate
    from ..photogrammetry.mounting_calibration.options import Assumptions
    from ..photogrammetry.mounting_calibration.products import written

    own = flight if isinstance(flight, Flight) else load_flight(Path(flight))
    assumptions = Assumptions(
        frame=frame,
        shift_sigma_m=shift_sigma_m,
        lever_arm_sigma_m=lever_arm_sigma_m,
        imu_sigma_m=imu_sigma_m,
        pose_sigma=pose_sigma,
        crs=crs,
        geoid=_path(geoid),
        shift=shift,
        photo=_path(photo),
        date=date or "",
    )
    solved = calibrate(own, Path(poses), assumptions)
    result = calibrated(solved, own, assumptions.photo, assumptions.date)
    return result if out is None else written(result, Path(out), force)
