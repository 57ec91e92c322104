"""From a file of any readable format to `Poses`.

The format is found by the file's ending and first bytes, or given by name.
"""

import re
from collections.abc import Callable
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from ...base.errors import InputError, UsageError
from ...base.files import lines_of
from ...base.inputs import first_bytes, opened_text
from ...geodesy.datums import at_epoch
from ...geodesy.rotation import (
    CV_RUB,
    NED_ENU,
    opk_jacobian,
    rotation_from_opk,
    rpy_jacobian,
)
from ...io.formats.blocks.pose_table import is_position_table
from ...io.formats.events.mrk import is_mrk
from ...io.formats.origins import ORIGIN_BYTES, origin_in
from ...io.formats.returned.reading import RETURNED, returned_form
from ...io.formats.text.clock import gps_time
from ...io.formats.text.columns import UnnamedColumns
from ...records import Array, ExteriorOrientation, Trajectory
from ...records.interpolation import columns_at
from ...records.observations import UNKNOWN_MPS
from .hints import Hints, diagonal, globe_of, rotate_covariance
from .of_records import imu_poses, poses_of
from .poses import CoordinateFrame, Poses
from .returned import read_adjusted_poses
from .tables import LAYOUTS, read_table_poses

FORM_HEADERS = {  # of files that other programs take, in lower case
    "pix4d_matic": r"^#?[ \t]*imagename,.*,yaw,pitch,roll",
    "realitycapture": r"^#?[ \t]*name,.*,(yaw|heading),pitch,roll",
    "micmac": r"^#f=n x y z w p k",
    "pix4d_mapper": r"\A[^,#]*\.\w+(,[-+\d.e]+){3}((,[-+\d.e]+){2,3})?\s*$",
    "inpho_ascii": r"^#[ \t]*id e n h omega phi kappa",
    "tum": r"^#[ \t]*time tx ty tz qx qy qz qw",
}
CAMERA_POSITIONS = "image,gps_week,tow,lat_deg"  # first columns of insgnss' own table
# stands in for fixes without standard deviations, and is left out again
SIGMA_PLACEHOLDER_M = 0.98765, 0.98765, 0.98765


def read_poses(
    path: str | Path | ExteriorOrientation | Trajectory,
    form: str | None = None,
    hints: Hints | None = None,
) -> Poses:
    """Poses of a file, or of a record.

    Parameters
    ----------
    form : one of `POSE_FORMS` where the file does not show its format.
    hints : what the file does not say.

    Raises
    ------
    InputError
        With file and line.
    UsageError
        For an unknown format.
    """
    if isinstance(path, ExteriorOrientation | Trajectory):
        if form is not None:
            raise UsageError(f"format {form!r} belongs to a file, but a record is given")
        return poses_of(path)
    if form is not None and form not in POSE_FORMS:
        raise UsageError(
            f"format {form!r} cannot be compared; it is one of {', '.join(POSE_FORMS)}"
        )
    form, hints = form or sniff_poses(path), hints or Hints()
    if hints.undulation_m is not None and form != "gnss":
        raise UsageError(
            f"{path}: is of the format {form}, which says what its heights are; leave the height of"
            " the geoid out"
        )
    try:
        poses = POSE_FORMS[form](Path(path), hints)
        if form != "eo_json" and poses.datum is None:
            datum, epoch = hints.datum, hints.epoch
            if hints.crs is not None and poses.projection is None and poses.plane is None:
                declared = globe_of(hints.crs)[1]
                datum, epoch = at_epoch(declared, epoch) if declared else (datum, epoch)
            poses = replace(poses, datum=datum, epoch=epoch)
        return poses
    except UnnamedColumns as error:
        raise InputError(
            f"{error.location}: {error.problem}; give its format, --format-a or --format-b:"
            f" {', '.join(POSE_FORMS)}"
        ) from None


def sniff_poses(path: str | Path) -> str:
    """Name of a file's format, a key of `POSE_FORMS`; fixes of GNSS where it shows nothing else."""
    directory = Path(path).is_dir()
    head = "" if directory else first_bytes(path, ORIGIN_BYTES).decode("latin-1")
    if form := returned_form(path, head):
        return form
    if directory:
        raise InputError.in_file(
            path,
            "is a directory without poses known here; give that of a COLMAP or OpenSfM model, or of"
            " MicMac's Orientation-*.xml",
        )
    text = head.lower()
    if text.lstrip().startswith("{") and "exterior orientation" in text:
        return "eo_json"
    name = Path(path).name.lower()
    if name.endswith(".sbet") or (name.startswith("sbet") and name.endswith(".out")):
        return "sbet"
    if is_mrk(head.encode("latin-1")):
        return "mrk"
    first = next((line for line in lines_of(text) if line.strip()), "")
    if first.startswith(CAMERA_POSITIONS):
        return "camera_positions"
    if "# frame kind:" in text and "# camera axes:" in text:
        return "generic_ascii"
    if (label := re.search(r"^#?[ \t]*label[,;\t].*", text, re.MULTILINE)) is not None:
        angles = {"omega": "metashape_opk", "yaw": "metashape"}
        return next((angles[k] for k in angles if k in label[0]), "metashape_reference")
    for form, columns in FORM_HEADERS.items():
        if re.search(columns, text, re.MULTILINE):
            return form
    if first.startswith("gps_week,tow,lat_deg"):
        return "trajectory_csv"
    if any(line.startswith("#") and _names_opk(line) for line in lines_of(text)):
        return "eo_local_plane"
    if text.lstrip().startswith("<") and "<gpx" not in text:
        raise InputError.in_file(
            path,
            "is XML without poses known here; give that of Metashape's cameras, BlocksExchange, or"
            " the directory of MicMac's Orientation-*.xml",
        )
    return "positions" if is_position_table(path) else "gnss"


def _names_opk(line: str) -> bool:
    """Tell whether a line names omega, phi and kappa in this order."""
    start = 0
    for name in ("omega", "phi", "kappa"):
        match = re.compile(rf"\b{name}\b").search(line, start)
        if match is None:
            return False
        start = match.end()
    return True


def _eo_json(path: Path, hints: Hints) -> Poses:
    from ...io.formats.orientation.eo_json import read_eo_json

    return poses_of(read_eo_json(path), str(path))


def _eo_local_plane(path: Path, hints: Hints) -> Poses:
    from ...io.formats.orientation.eo_local_plane import read_eo_local_plane

    eo = read_eo_local_plane(path)
    plane = hints.plane or origin_in(path)
    return CoordinateFrame("tangent plane", plane).poses(
        path,
        "eo_local_plane",
        eo.position_m,
        rotation_from_opk(eo.opk) @ CV_RUB,
        cov_position=diagonal(path, eo.sigma_position_m),
        cov_attitude=diagonal(path, eo.sigma_opk, opk_jacobian(eo.opk)),
        images=eo.images,
        angle_set="opk",
        angles=eo.opk,
    )


def _generic_ascii(path: Path, hints: Hints) -> Poses:
    from ...io.formats.orientation.generic_ascii import read_generic_ascii

    eo = read_generic_ascii(path)
    columns, n = eo.columns, len(eo.images)
    axes = ("lon", "lat", "h")
    with opened_text(path, errors="replace") as stream:
        header = next((line for line in stream if line.startswith("# frame:")), "")
    _, datum, epoch = globe_of(header)
    frame = CoordinateFrame("geographic", datum=datum, epoch=epoch)
    if not all(name in columns for name in axes):
        if not all(name in columns for name in "xyz"):
            raise InputError.in_file(
                path, "has no position; the columns x y z or lat lon h are needed"
            )
        axes = ("x", "y", "z")
        plane = hints.plane or origin_in(path)
        projection = hints.projection_in(header if eo.frame_kind == "projected" else "")
        frame = CoordinateFrame(eo.frame_kind, plane, projection, datum, epoch)
    poses = frame.poses(
        path,
        "generic_ascii",
        np.column_stack([columns[name] for name in axes]),
        eo.C_fc,
        cov_position=diagonal(path, eo.block("s_xyz")),
        images=eo.images,
        time=columns.get("tow"),
        gps_week=hints.gps_week if "week" not in columns or not n else int(columns["week"][0]),
    )
    return poses if eo.C_fc is not None else replace(poses, C_Ex=eo.C_Ec)


def _trajectory_csv(path: Path, hints: Hints) -> Poses:
    from ...io.formats.trajectory.trajectory_csv import read_trajectory_csv

    t = read_trajectory_csv(path)
    return _of_track(path, "trajectory_csv", t, t.sigma, t.gps_week)


def _sbet(path: Path, hints: Hints) -> Poses:
    from ...io.formats.trajectory.sbet import read_sbet, read_smrmsg, smrmsg_beside

    t = read_sbet(path)
    sigma = None
    if (beside := smrmsg_beside(path)) is not None:
        s = read_smrmsg(beside)
        table = np.column_stack([s.sigma_position_m, s.sigma_velocity, s.sigma_rpy])
        sigma = columns_at(t.time, s.time, table)
    return _of_track(path, "sbet", t, sigma, hints.gps_week)


def _of_track(
    path: Path, form: str, track: Any, sigma: Array | None, gps_week: int | None
) -> Poses:
    """A trajectory of the IMU; sigma (n, 9) of position, velocity, roll pitch heading."""
    return imu_poses(
        path,
        form,
        track,
        velocity_ned=track.velocity_ned,
        cov_position=None if sigma is None else diagonal(path, sigma[:, :3]),
        cov_attitude=(
            None if sigma is None else diagonal(path, sigma[:, 6:], rpy_jacobian(track.rpy))
        ),
        gps_week=gps_week,
        angle_set="rpy",
        angles=track.rpy,
    )


def _gnss(path: Path, hints: Hints) -> Poses:
    from ...io.formats import read_gnss

    fixes = read_gnss(
        path, gps_week=hints.gps_week, sigma_m=SIGMA_PLACEHOLDER_M, undulation_m=hints.undulation_m
    )
    notes = tuple(f"{check.name}: {check.found}" for check in fixes.notes)
    velocity = None
    if (
        fixes.velocity_ned is not None
        and fixes.velocity_cov_ned is not None
        and fixes.velocity_cov_ned.max() < UNKNOWN_MPS**2
    ):
        velocity = fixes.velocity_ned @ NED_ENU
    return Poses(
        str(path),
        "gnss",
        "antenna",
        fixes.lat,
        fixes.lon,
        fixes.height,
        time=fixes.time,
        gps_week=fixes.gps_week,
        velocity=velocity,
        cov_position=rotate_covariance(NED_ENU, fixes.cov_ned)
        if fixes.sigma_assumed is None
        else None,
        notes=notes,
    )


def _mrk(path: Path, hints: Hints) -> Poses:
    """Cameras of a drone's own solution at the exposures, which are named by their numbers."""
    from ...io.formats.events.mrk import MRK_PLACE, read_mrk

    mrk = read_mrk(path)
    if mrk.camera is None:
        names = ", ".join(name.capitalize() for name in MRK_PLACE)
        raise InputError.in_file(path, f"has times alone and no {names} of the camera")
    week = mrk.week.astype(np.float64) if (mrk.week >= 0).all() else None
    time, gps_week = gps_time(mrk, mrk.tow, week, hints.gps_week)
    lat, lon, height = mrk.camera.T
    sigma = None if mrk.sigma_neu is None else mrk.sigma_neu[:, [1, 0, 2]]
    return Poses(
        str(path),
        "mrk",
        "projection centre",
        np.radians(lat),
        np.radians(lon),
        height,
        images=tuple(map(str, mrk.number.tolist())),
        time=time,
        gps_week=gps_week,
        cov_position=diagonal(path, sigma),
    )


def _camera_positions(path: Path, hints: Hints) -> Poses:
    """Cameras, or antennas, at the exposures by PPK."""
    from ...io.formats.positions.camera_positions import read_camera_positions

    table = read_camera_positions(path)
    return Poses(
        str(path),
        "camera_positions",
        "projection centre" if table.of_camera.all() else "antenna",
        table.lat,
        table.lon,
        table.height,
        images=table.images,
        time=table.time,
        gps_week=table.gps_week,
        cov_position=rotate_covariance(NED_ENU, table.cov_ned),
    )


def _odyn(path: Path, hints: Hints) -> Poses:
    from ...io.formats.trajectory.odyn import read_odyn_poses

    return imu_poses(path, "odyn", read_odyn_poses(path), gps_week=hints.gps_week)


POSE_FORMS: dict[str, Callable[[Path, Hints], Poses]] = {
    "eo_json": _eo_json,
    "eo_local_plane": _eo_local_plane,
    **{form: partial(read_table_poses, form) for form in LAYOUTS},
    "generic_ascii": _generic_ascii,
    "trajectory_csv": _trajectory_csv,
    "sbet": _sbet,
    "gnss": _gnss,
    "mrk": _mrk,
    "camera_positions": _camera_positions,
    "odyn": _odyn,
    **{form: partial(read_adjusted_poses, form) for form in RETURNED},
}
