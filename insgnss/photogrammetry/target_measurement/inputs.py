"""Exterior orientation, camera and ground points in one frame, and what is predicted of them."""

from dataclasses import dataclass, replace

import numpy as np

from ...base.errors import DataError, InputError
from ...flight.config.block_file import BlockFile, GroundTableInput
from ...io.formats.blocks.camera_toml import read_camera_covariance
from ...io.formats.blocks.ground_points import GroundTable
from ...io.formats.orientation.eo_json import read_one_camera
from ...io.formats.returned.cameras import read_camera
from ...records import ExteriorOrientation
from ...records.block import BrownCamera
from ..block_adjustment.ground import ground_in_plane, ground_of
from ..block_adjustment.inputs import refuse_field_of_view
from ..block_adjustment.vehicle.places import Vehicle, placed_vehicle
from ..targets.prediction import VISIBILITY, Predictions, predict
from .request import TargetRequest


@dataclass(frozen=True, eq=False)
class TargetInputs:
    """A flight and its ground points.

    Parameters
    ----------
    request : TargetRequest
        What was asked for.
    eo : ExteriorOrientation
        The exterior orientation.
    camera : BrownCamera
        The camera of all images.
    ground : GroundTable
        Ground points in the tangent plane.
    surveyed : GroundTable
        The same as their file has them.
    crs : str or None
        CRS of `surveyed`; None of the tangent plane.
    predictions : Predictions
        Pixels of all points in all images, with what was asked to be added to their covariance.
    notes : tuple of str
        What was assumed, sentence by sentence.
    vehicle : Vehicle or None
        Whose target the points are, one an image: point k in its image alone.
    """

    request: TargetRequest
    eo: ExteriorOrientation
    camera: BrownCamera
    ground: GroundTable
    surveyed: GroundTable
    crs: str | None
    predictions: Predictions
    notes: tuple[str, ...]
    vehicle: Vehicle | None = None


def inputs_of(request: TargetRequest) -> TargetInputs:
    """Read and join the files of a request.

    Parameters
    ----------
    request : TargetRequest
        The request.

    Returns
    -------
    TargetInputs
        Of points of which at least one lies in an image.

    Raises
    ------
    InputError
        A file cannot be read, or files do not belong together.
    DataError
        No ground point lies in any image.
    """
    eo = read_one_camera(request.eo, "a search for targets")
    camera = read_camera(request.camera)
    camera_cov = read_camera_covariance(request.camera)
    refuse_field_of_view(camera)
    notes: list[str] = []
    if not len(eo.images):
        raise InputError.in_file(request.eo, "no image; process the flight with its camera")
    vehicle, own_crs = None, None
    if request.vehicle is not None:
        vehicle = _vehicle(request, eo, notes)
        ground = as_read = _as_ground(vehicle)
        row = {name: i for i, name in enumerate(eo.images)}
        image = np.array([row[name] for name in vehicle.images], dtype=np.int64)
        poses = eo.position_m[image], eo.C_mc[image], eo.cov[image]
        places = ground.position_m, ground.cov
        predictions = replace(predict(camera, *poses, *places, camera_cov, own=True), image=image)
    else:
        table = GroundTableInput(file=request.ground, crs=request.crs, geoid=request.geoid)
        read, own_crs = ground_of(request.ground, None)
        in_plane = ground_in_plane(BlockFile(path=request.eo, ground=table), None, eo, notes)
        if in_plane is None or read is None:
            raise InputError.in_file(request.ground, "no ground point; write a line for each point")
        ground, as_read = in_plane, read
        predictions = predict(
            camera, eo.position_m, eo.C_mc, eo.cov, ground.position_m, ground.cov, camera_cov
        )
    if not predictions.visible.any():
        raise DataError(_unseen(eo, ground, camera, predictions))
    extra = request.search_px**2 * np.eye(2)
    widened = replace(predictions, cov=predictions.cov + extra)
    if camera_cov is None:
        notes.append(
            f"{request.camera} has no [sigma]: the camera is taken as free of errors, so the"
            " ellipses are too small by the errors it has"
        )
    crs = None if vehicle is not None else request.crs or own_crs
    return TargetInputs(request, eo, camera, ground, as_read, crs, widened, tuple(notes), vehicle)


def _vehicle(request: TargetRequest, eo: ExteriorOrientation, notes: list[str]) -> Vehicle:
    """Return the vehicle's target at the exposures of all images."""
    assert request.vehicle is not None
    options = replace(request.vehicle, file=request.ground, crs=request.crs, geoid=request.geoid)
    names = [f"{options.target}{image}" for image in eo.images]
    return placed_vehicle(options, eo.images, names, eo, notes)


def _as_ground(vehicle: Vehicle) -> GroundTable:
    """Return the places of a target as ground points, each of its own image."""
    n = len(vehicle.images)
    cov = vehicle.cov.reshape(n, 3, n, 3)[np.arange(n), :, np.arange(n)]
    return GroundTable(vehicle.points, vehicle.exposures.position_m, cov, np.zeros(n, dtype=bool))


def _unseen(
    eo: ExteriorOrientation, ground: GroundTable, camera: BrownCamera, predictions: Predictions
) -> str:
    """Say why no ground point lies in any image."""
    n = len(ground.points)
    why = {word: int((predictions.visibility == k).sum()) for k, word in enumerate(VISIBILITY)}
    # images x points
    distance = np.linalg.norm(ground.position_m[None, :, :2] - eo.position_m[:, None, :2], axis=2)
    i, p = np.unravel_index(int(distance.argmin()), distance.shape)
    above = float(np.median(eo.position_m[:, 2]) - np.median(ground.position_m[:, 2]))
    counts = ", ".join(f"{count} {word}" for word, count in why.items() if count)
    if above <= 0.0:
        advice = (
            f"the images lie {-above:.0f} m below the points: their heights have different"
            " references (geoid, ellipsoid), or the points belong to another place"
        )
    elif why["behind the camera"] > 0.9 * len(predictions):
        advice = "the cameras look upwards: check the camera axes in the mounting of the flight"
    elif distance.min() > 2.0 * above:
        advice = (
            "the points belong to another place or are in another CRS than assumed: name it, --crs"
        )
    else:
        advice = "the camera's axes, mounting or focal length do not fit the images: check them"
    return (
        f"no ground point lies in any image ({n} points, {len(eo.images)} images: {counts}); the"
        f" nearest, {ground.points[p]!r}, is {distance[i, p]:.0f} m from {eo.images[i]!r} and the"
        f" images are {above:.0f} m above the points; {advice}"
    )
