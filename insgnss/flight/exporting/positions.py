"""Camera positions without attitude into the files of bundle adjustments."""

from pathlib import Path

import numpy as np

from ...base.errors import InputError, UsageError, near
from ...base.files import atomic_writes
from ...base.output.staging import together
from ...geodesy.crs import undulation
from ...geodesy.projection import MapProjection
from ...geodesy.rotation import NED_ENU
from ...io.formats.exports import function_at
from ...io.formats.orientation.exported import PlacedCameras
from ...io.formats.positions.position_references import POSITION_FORMATS, PositionFormat
from ...records import MapFrame
from ...records.cameras.camera_positions import CameraPositions
from ...records.framed import GEOGRAPHIC, PROJECTED
from .export import Exported, ExportFrame, on_area
from .replacing import remove_stale


def position_format(name: str) -> PositionFormat:
    """Return the format of that name; UsageError for one that needs angles."""
    if name not in POSITION_FORMATS:
        raise UsageError(
            f"export: {name!r} needs attitudes, and camera positions have none;"
            f" {near(name, POSITION_FORMATS)}"
        )
    return POSITION_FORMATS[name]


def export_positions(
    positions: CameraPositions, name: str, path: Path, target: ExportFrame | None = None
) -> Exported:
    """Write camera positions as a format without angles.

    Parameters
    ----------
    positions : CameraPositions
        Positions with their covariances.
    name : str
        One of `POSITION_FORMATS`.
    path : Path
        The file.
    target : ExportFrame, optional
        A projected CRS and its grid of geoid heights; geographic coordinates by default, above the
        geoid of the grid where there is one.

    Raises
    ------
    UsageError
        For a format that needs angles, a tangent or geocentric frame, or heights over a ground.
    InputError
        Where there are no positions.
    """
    form, target = position_format(name), target or ExportFrame()
    if not positions.images:
        raise InputError(f"export: {name}: there are no positions")
    if target.frame not in (None, "geographic", "projected") or target.ground_m is not None:
        raise UsageError(
            f"export: {name} takes camera positions in geographic coordinates or a projected CRS;"
            " leave --frame and --ground out"
        )
    projection = None if target.crs is None else MapProjection(target.crs, target.geoid)
    cameras = _in_export_frame(positions, target, projection)
    with together() as staging:
        form.write(cameras, path)
        helpers = function_at(form.helper)(cameras, path) if form.helper else {}
        atomic_writes(helpers)
        remove_stale(path, staging)
    notes = [f"heights are {cameras.frame.heights}"]
    if projection is not None:
        notes[:0] = on_area(projection, positions.lat, positions.lon)
    if antenna := int((positions.of_camera == 0.0).sum()):
        notes.insert(
            0,
            f"{antenna} of {len(positions.images)} positions are of the antenna, not of the "
            "camera; give the bundle adjustment the lever arm, or estimate it there",
        )
    return Exported(path, cameras.frame.name, tuple(notes), helpers=tuple(helpers), format=name)


def _in_export_frame(
    positions: CameraPositions, target: ExportFrame, projection: MapProjection | None
) -> PlacedCameras:
    lat, lon, height = positions.lat, positions.lon, positions.height
    cov = NED_ENU @ positions.cov_ned @ NED_ENU.T
    if projection is None:
        heights = "above the ellipsoid of WGS84"
        if target.geoid is not None:
            height = height - undulation(target.geoid, lat, lon)
            heights = f"above the geoid of {target.geoid.name}"
        name = "geographic coordinates of WGS84"
        frame = MapFrame(GEOGRAPHIC, name, heights, northing_first=True)
        return PlacedCameras(positions.images, frame, np.column_stack([lon, lat, height]), cov)
    axes = projection.axes(lat, lon, height)
    frame = MapFrame(
        PROJECTED,
        projection.code or projection.name,
        projection.heights,
        projection.code,
        projection.crs.to_wkt(),
        northing_first=projection.northing_first,
    )
    coordinates = projection.forward(lat, lon, height)
    return PlacedCameras(positions.images, frame, coordinates, axes @ cov @ np.swapaxes(axes, 1, 2))
