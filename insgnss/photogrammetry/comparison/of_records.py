"""Poses of records in memory, for a comparison without files, and positions as records of poses."""

from typing import Any

import numpy as np

from ...base.errors import InputError
from ...geodesy.frames import TangentPlane
from ...geodesy.rotation import NED_ENU
from ...records import Array, ExteriorOrientation, Trajectory
from ...records.cameras.camera_positions import CameraPositions
from ...records.qualities import Quality
from .hints import rotate_covariance
from .poses import CoordinateFrame, Poses


def poses_of(record: ExteriorOrientation | Trajectory, source: str = "") -> Poses:
    """Return the poses of a record.

    Parameters
    ----------
    record : exterior orientation or trajectory.
    source : where it comes from, for messages; its own short form by default.
    form : name of its format; that of the kind of record by default.

    Returns
    -------
    Its positions, attitudes and covariances; covariances that are zero are taken as not known.
    """
    source, cov = source or repr(record), record.cov
    position, attitude = _nonzero(cov[:, :3, :3]), _nonzero(cov[:, -3:, -3:])
    if isinstance(record, ExteriorOrientation):
        plane = TangentPlane(*record.origin)
        frame = CoordinateFrame("tangent plane", plane, datum=record.datum, epoch=record.epoch)
        return frame.poses(
            source,
            "eo_json",
            record.position_m,
            record.C_mc,
            cov_position=position,
            cov_attitude=attitude,
            images=record.images,
            time=record.time,
            gps_week=record.gps_week,
            camera_from_body=record.C_cb if record.rig is None else None,  # one for all images
        )
    return imu_poses(
        source,
        "trajectory",
        record,
        velocity_ned=record.velocity_ned,
        cov_position=position,
        cov_attitude=attitude,
        gps_week=record.gps_week,
    )


def _nonzero(P: Array) -> Array | None:
    """Covariances, None where the variances are zero."""
    return P if (np.diagonal(P, axis1=1, axis2=2) > 0.0).all() else None


def imu_poses(
    source: object,
    form: str,
    track: Any,
    velocity_ned: Array | None = None,
    cov_position: Array | None = None,
    cov_attitude: Array | None = None,
    **further: Any,
) -> Poses:
    """Return the poses of an IMU along its trajectory.

    Parameters
    ----------
    source : path or str
        Where they come from.
    form : str
        Its format.
    track : Trajectory, or what a reader makes of a file of one
        `time`, `lat`, `lon`, `height` and `C_nb` are taken.
    velocity_ned : ndarray, (n, 3), optional
        m/s.
    cov_position, cov_attitude : ndarray, (n, 3, 3), optional
        North, east, down.
    **further
        Other fields of `Poses`.

    Returns
    -------
    Poses
        In the axes east, north, up.
    """
    return Poses(
        str(source),
        form,
        "IMU",
        track.lat,
        track.lon,
        track.height,
        time=track.time,
        C_Ex=NED_ENU @ track.C_nb,
        x="body",
        velocity=None if velocity_ned is None else velocity_ned @ NED_ENU,
        cov_position=rotate_covariance(NED_ENU, cov_position),
        cov_attitude=rotate_covariance(NED_ENU, cov_attitude),
        **further,
    )


def positions_of(poses: Poses) -> CameraPositions:
    """Return poses of images, or what has no attitude, as camera positions, by time.

    Raises
    ------
    InputError
        A trajectory, and positions without standard deviations.
    """
    if poses.x == "body":
        raise InputError.in_file(
            poses.source, "is a trajectory of the IMU, not of images; give the eo.json beside it"
        )
    if poses.cov_position is None:
        raise InputError.in_file(
            poses.source,
            "has no standard deviations of positions; give positions that have them, such as those"
            " of PPK with --fixes antenna.pos",
        )
    time = np.arange(poses.n, dtype=np.float64) if poses.time is None else poses.time
    images = poses.images or tuple(str(k + 1) for k in range(poses.n))
    order = np.argsort(time, kind="stable")
    return CameraPositions(
        tuple(images[k] for k in order),
        *(time[order], poses.lat[order], poses.lon[order], poses.height[order]),
        NED_ENU @ poses.cov_position[order] @ NED_ENU.T,
        np.full(poses.n, float(Quality.UNKNOWN)),
        np.full(poses.n, float(poses.point == "projection centre")),
        poses.gps_week,
        poses.source,
    )
