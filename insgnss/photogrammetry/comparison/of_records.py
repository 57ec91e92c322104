"""Poses of records in memory, for a comparison without files, and positions as records of poses."""

import numpy as np

from ...base.errors import InputError
from ...geodesy.frames import TangentPlane
from ...geodesy.rotation import NED_ENU
from ...records import Array, ExteriorOrientation, Trajectory
from ...records.cameras.camera_positions import CameraPositions
from ...records.qualities import Quality
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
    source = source or repr(record)
    if isinstance(record, ExteriorOrientation):
        return _of_orientation(record, source)
    cov = record.cov
    return Poses(
        source,
        "trajectory",
        "IMU",
        record.lat,
        record.lon,
        record.height,
        time=record.time,
        gps_week=record.gps_week,
        C_Ex=NED_ENU @ record.C_nb,
        x="body",
        velocity=record.velocity_ned @ NED_ENU,
        cov_position=_turned(NED_ENU, cov[:, :3, :3]),
        cov_attitude=_turned(NED_ENU, cov[:, 6:, 6:]),
    )


def _of_orientation(eo: ExteriorOrientation, source: str) -> Poses:
    plane = TangentPlane(*eo.origin)
    lat, lon, h, C_fE = CoordinateFrame("tangent plane", plane).resolved(eo.position_m, source)
    C_Ef = np.swapaxes(C_fE, 1, 2)
    return Poses(
        source,
        "eo_json",
        "projection centre",
        lat,
        lon,
        h,
        images=eo.images,
        time=eo.time,
        gps_week=eo.gps_week,
        C_Ex=C_Ef @ eo.C_mc,
        camera_from_body=eo.C_cb if eo.rig is None else None,  # one for all images
        cov_position=_turned(C_Ef, eo.cov[:, :3, :3]),
        cov_attitude=_turned(C_Ef, eo.cov[:, 3:, 3:]),
        C_fE=C_fE,
        local=eo.position_m,
        plane=plane,
        datum=eo.datum,
        epoch=eo.epoch,
    )


def _turned(C: Array, P: Array) -> Array | None:
    """C P C^T, None where the variances are zero."""
    P = C @ P @ np.swapaxes(C, -1, -2)
    return P if (np.diagonal(P, axis1=1, axis2=2) > 0.0).all() else None


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
