"""Poses of records in memory, for a comparison without files."""

import numpy as np

from ...geodesy.frames import TangentPlane
from ...geodesy.rotation import NED_ENU
from ...records import Array, ExteriorOrientation, Trajectory
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
