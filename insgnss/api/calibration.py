"""Verbs of the mounting calibration: tripod, similarity in flight, targets, the joint one."""

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from ..base.advance import heard
from ..base.inputs import Source, reading
from ..photogrammetry.mounting_calibration.options import (
    Assumptions,
    MaterialiseOptions,
    SimilarityOptions,
    TripodOptions,
)
from .keywords import options_of_record
from .verbs import flight_of

if TYPE_CHECKING:
    from ..flight.config.flight_file import Flight
    from ..io.formats.orientation.mounting_file import MountingFile
    from ..photogrammetry.mounting_calibration.products import CalibratedMounting


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
@options_of_record(TripodOptions)
def calibrate_tripod(
    poses: Source, pins: Source, *, out: Source | None = None, force: bool = False, **options: Any
) -> "CalibratedMounting":
    """Estimate the lever arm from camera to antenna of an aircraft on a tripod in several setups.

    Parameters
    ----------
    poses : camera poses, one a setup: a table, eo.json, a block of Metashape, COLMAP, ...
    pins : tips of the pin in the antenna's place, by the names of the poses.
    out : mounting.toml to write, with a page beside it; None: none.
    force : whether to overwrite a file that was made from other inputs.
    photo : an image of the camera, which names it.
    date : of the data, ISO.
    crs : of the pins, where they stand in one.
    geoid : grid of geoid heights, for `crs`.
    pose_sigma : m and deg, of poses whose file has no standard deviations.
    pin_sigma_m : of pins whose table has none.

    Returns
    -------
    The mounting with verdicts: `mounting`, `summary()`, `as_dict()`.

    Raises
    ------
    InputError : a file is wrong, or both do not belong together.
    """
    from ..photogrammetry.mounting_calibration.tripod_files import calibrate_tripod as calibrate

    return _write_mounting(calibrate(Path(poses), Path(pins), TripodOptions(**options)), out, force)


@heard
@reading()
@options_of_record(SimilarityOptions)
def calibrate_similarity(
    cameras: Source,
    antenna: Source,
    *,
    out: Source | None = None,
    force: bool = False,
    **options: Any,
) -> "CalibratedMounting":
    """Estimate the lever arm from camera to antenna of adjusted poses and antenna positions.

    Parameters
    ----------
    cameras : adjusted poses in any frame: Metashape, COLMAP, OpenSfM, eo.json, a table, ...
    antenna : antenna positions at exposures, by image, or the file of Metashape that has them.
    out : mounting.toml to write, with a page beside it; None: none.
    force : whether to overwrite a file that was made from other inputs.
    photo : an image of the camera, which names it.
    date : of the data, ISO.
    crs : of poses, antenna positions and ground points whose files do not name it.
    geoid : grid of geoid heights, for `crs`.
    pose_sigma : m and deg, of poses whose file has no standard deviations.
    shift : what was subtracted from the coordinates of the poses, in the unit of their CRS.
    antenna_sigma_m : horizontal and vertical, in the place of the table's.
    ground : ground points, which are measured in images.
    points : image observations of them, where `cameras` has none.
    camera : camera.toml, where `cameras` has no interior orientation.

    Returns
    -------
    The mounting with verdicts: `mounting`, `summary()`, `as_dict()`.

    Raises
    ------
    InputError : a file is wrong, or they do not belong together.
    """
    from ..photogrammetry.mounting_calibration.similarity_files import (
        calibrate_similarity as calibrate,
    )

    result = calibrate(Path(cameras), Path(antenna), SimilarityOptions(**options))
    return _write_mounting(result, out, force)


@heard
@reading()
@options_of_record(MaterialiseOptions)
def calibrate_materialise(
    camera: Source,
    mounted: Source,
    receiver: Sequence[Source],
    *,
    out: Source | None = None,
    force: bool = False,
    **options: Any,
) -> "CalibratedMounting":
    """Estimate the lever arm from camera to antenna by targets on camera and receiver.

    Parameters
    ----------
    camera : targets on the camera in a scaled frame, a table or a block.
    mounted : targets on camera and receiver in one block of the aircraft, before the flight.
    receiver : targets on the receiver and its phase centre (row `antenna`), a table a session.
    out : mounting.toml to write, with a page beside it; None: none.
    force : whether to overwrite a file that was made from other inputs.
    photo : an image of the camera, which names it.
    date : of the data, ISO.
    pose : pose of an image that the camera itself took, in the frame of `camera`.
    image : name of that image.
    after : as `mounted`, after the flight.
    antenna_name : row of the phase centre in the tables of `receiver`.
    target_sigma_m : of targets whose table has no standard deviations.
    pose_sigma : m and deg, of a pose whose file has none.

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

    sessions = tuple(Path(path) for path in receiver)
    chosen = MaterialiseOptions(receiver=sessions, **options)
    return _write_mounting(calibrate(Path(camera), Path(mounted), chosen), out, force)


@heard
@reading()
@options_of_record(Assumptions)
def calibrate_mounting(
    flight: "Flight | Source",
    poses: Source,
    *,
    out: Source | None = None,
    force: bool = False,
    **options: Any,
) -> "CalibratedMounting":
    """Estimate lever arms, bore-sight and camera delay from a flight and the poses of its block.

    Parameters
    ----------
    flight : the flight file, or what `load_flight` made of it.
    poses : adjusted poses of its images, of any readable program.
    out : mounting.toml to write, with a page beside it; None: none.
    force : whether to overwrite a file that was made from other inputs.
    photo : an image of the camera, which names it.
    date : of the data, ISO; by default that of the flight.
    crs : of poses whose file does not name it.
    geoid : grid of geoid heights, for `crs`.
    shift : what was subtracted from the coordinates of the poses, in the unit of their CRS.
    frame : how the block lies to the flight: by a similarity, by a shift alone; "auto": a
        similarity, and coordinates of another scale are refused.
    shift_sigma_m : of a shift between ground control and fixes; None: not known.
    lever_arm_sigma_m : of the antenna's lever arm from the IMU, as the flight file has it.
    imu_sigma_m : of the IMU's lever arm from the camera, as the flight file has it.
    pose_sigma : m and deg, what the block's camera calibration moves poses by, all alike in
        camera axes, where they have no covariances.

    Returns
    -------
    The mounting with verdicts: `mounting`, `summary()`, `as_dict()`.

    Raises
    ------
    InputError : a file is wrong, or the poses are not of this flight.
    DataError : the data do not support the answer.
    """
    from ..photogrammetry.mounting_calibration.flight_products import flight_result
    from ..photogrammetry.mounting_calibration.in_flight import calibrate_mounting as calibrate

    recorded, assumptions = flight_of(flight), Assumptions(**options)
    solved = calibrate(recorded, Path(poses), assumptions)
    return _write_mounting(
        flight_result(solved, recorded, assumptions.photo, assumptions.date), out, force
    )


def _write_mounting(
    result: "CalibratedMounting", out: Source | None, force: bool
) -> "CalibratedMounting":
    from ..photogrammetry.mounting_calibration.products import write_mounting

    return result if out is None else write_mounting(result, Path(out), force)
