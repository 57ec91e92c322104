"""Camera poses of any format, and positions that belong to them, in one Cartesian frame."""

import re
from collections.abc import Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from ...base.errors import InputError
from ...base.inputs import is_file
from ...base.units import FOOT_M
from ...base.wording import some
from ...geodesy.crs import is_geographic
from ...geodesy.frames import TangentPlane
from ...geodesy.gpstime import calendar_from_gps
from ...geodesy.projection import MapProjection
from ...geodesy.rotation import NED_ENU
from ...io.formats.blocks.ground_points import GroundAxes, GroundTable
from ...io.formats.blocks.joined import match_names
from ...io.formats.blocks.measured_block import MeasuredBlock
from ...io.formats.blocks.metashape_chunk import read_metashape_references
from ...io.formats.blocks.pose_table import (
    is_pose_table,
    read_pose_table,
    read_position_table,
)
from ...io.formats.blocks.reading import COLMAP_FILE, read_measured_block, recognise_format
from ...io.formats.detect import head_of
from ...io.formats.returned.crs import stated_crs
from ...io.formats.returned.reading import read_returned_poses, returned_form
from ...io.formats.text.layout import decode, quote
from ...records import Array, ExteriorOrientation
from ...records.framed import GEOCENTRIC
from ..comparison.compare import largest_difference
from ..comparison.hints import Hints, rotate_covariance
from ..comparison.poses import FAR_DEG, FarError, Poses, degrees_for_metres
from ..comparison.position import SHIFT_M
from ..comparison.reading import read_poses, sniff_poses
from ..comparison.returned import framed_coordinates, placed_poses
from .options import PlaceOptions
from .records import CameraPoses

# distance of poses and positions (m) from which it is said: lever arms and datums are shorter
NOTED_M = 5.0


def read_camera_poses(path: Path, hints: Hints | None = None, only: bool = True) -> CameraPoses:
    """Read camera poses of any format.

    Parameters
    ----------
    path : Path
        `eo.json`, a table of poses (`poses.csv` of insgnss adjust), a block of Metashape, COLMAP,
        OpenSfM, BINGO or DBAT, MicMac's Ori- directory, or a file that `insgnss compare` reads.
    hints : Hints, optional
        CRS and shift of coordinates whose file does not name them.
    only : bool
        Whether the CRS is of nothing but these poses. Else poses that lie far from its area stand
        in axes of their own, and the CRS is that of a table beside them.

    Returns
    -------
    CameraPoses
        The images with a pose.

    Raises
    ------
    InputError
        With file and line.
    """
    if not path.exists():
        raise InputError.in_file(path, "does not exist; check the path")
    hints = hints or Hints()
    head = "" if path.is_dir() else decode(head_of(path))
    if form := returned_form(path, head):
        return _returned(path, form, hints, only)
    if is_block(path):
        return _of_block(path)
    if head.lstrip().startswith("{") and "exterior orientation" in head.lower():
        from ...io.formats.orientation.eo_json import read_one_camera

        eo = read_one_camera(path, "a calibration")
        lat, lon, h = (float(v) for v in eo.origin)
        on_earth = eo.images, eo.position_m, eo.C_mc, eo.cov, "plane", str(path), ()
        return CameraPoses(*on_earth, TangentPlane(lat, lon, h), date=date_of(eo))
    form = sniff_poses(path)
    # a comment of poses.csv speaks of its angles as EO_local-plane.txt does
    if form in ("gnss", "eo_local_plane") and is_pose_table(path):
        table = read_pose_table(path)
        poses = table.names, table.position, table.C_mc, table.cov
        return CameraPoses(*poses, source=str(path), opk=table.opk)
    if form == "gnss":
        raise InputError.in_file(
            path,
            "no camera poses are known here; read are eo.json, a table image, x, y, z, omega, phi,"
            " kappa, Metashape, COLMAP, OpenSfM, BINGO, DBAT and what insgnss compare reads",
        )
    return _on_the_earth(path, read_poses(path, hints=hints))


def refuse_distant(
    camera: CameraPoses, hints: Hints, position_m: Array, plane: TangentPlane, source: str
) -> tuple[str, ...]:
    """Refuse poses of another place than positions, which a similarity would bring together.

    Parameters
    ----------
    camera : CameraPoses
        Poses; those in axes of their own are of no place.
    hints : Hints
        By which they were read.
    position_m : ndarray, (n, 3)
        Positions of the same images in a tangent plane.
    plane : TangentPlane
        The plane.
    source : str
        Whose positions they are.

    Returns
    -------
    tuple of str
        What explains a distance that a calibration takes for a shift; nothing of a small one.

    Raises
    ------
    InputError
        With what explains the distance.
    """
    if camera.frame == "own":
        return ()
    difference = camera.in_plane(plane).position - position_m
    distance = float(np.median(np.linalg.norm(difference, axis=1)))
    if distance > SHIFT_M:
        raise InputError(compared_with(camera, hints, position_m, plane, source))
    if distance < NOTED_M:
        return ()
    reason = compared_with(camera, hints, position_m, plane, source)
    return (f"poses lie {distance:.1f} m from the positions: {reason or 'nothing explains it'}",)


def compared_with(
    camera: CameraPoses, hints: Hints, position_m: Array, plane: TangentPlane, source: str
) -> str:
    """Return what `insgnss compare` says of the largest difference; empty where it says nothing.

    Parameters
    ----------
    camera, hints, position_m, plane, source
        As of `refuse_distant`.

    Returns
    -------
    str
        With the files that are a and b.
    """
    if camera.frame == "own":
        return ""
    try:
        a = read_poses(camera.source, hints=hints)
    except InputError:  # a tangent plane of the flight
        return ""
    lat, lon, h = plane.geodetic_from_position(position_m)
    b = Poses(source, "gnss", "", lat, lon, h, images=camera.images)
    return largest_difference(a, b)


def date_of(eo: ExteriorOrientation) -> str:
    """Return the day of the first image, ISO."""
    return calendar_from_gps(eo.gps_week, float(eo.time[0])).date().isoformat()


def _returned(path: Path, form: str, hints: Hints, only: bool) -> CameraPoses:
    """Return the poses of a file of another program; in their own axes without a frame."""
    returned = read_returned_poses(path, form)
    if returned.C is None:
        raise InputError.in_file(
            path, "has positions and no attitudes; give poses of an adjustment"
        )
    framed = framed_coordinates(returned, hints, path)

    def block() -> MeasuredBlock:
        return read_measured_block(path)

    if framed.frame is not None and framed.frame.kind != GEOCENTRIC:
        try:
            poses = placed_poses(returned, framed, path, form)
        except FarError:
            if only or returned.kind or hints.shift is not None:
                raise
            if (placeless := _without_place(path, form, hints)) is None:
                raise
            return placeless
        return replace(_on_the_earth(path, poses), load=block)
    cov = _joint_cov(returned.cov_position, returned.cov_attitude)
    frame = "own" if framed.frame is None else "geocentric"
    notes = (*returned.notes, framed.note) if framed.note else returned.notes
    return CameraPoses(
        returned.images, framed.x, returned.C, cov, frame, str(path), notes, load=block
    )


def _without_place(path: Path, form: str, hints: Hints) -> CameraPoses | None:
    """Return poses in axes of their own; None where their values are those of a place."""
    try:
        poses = _returned(path, form, replace(hints, crs=None), False)
    except InputError:
        return None
    return poses if poses.frame == "own" else None


def _joint_cov(position: Array | None, attitude: Array | None) -> Array | None:
    """Return covariances (n, 6, 6) of positions and attitudes that are not correlated."""
    if position is None or attitude is None:
        return None
    cov = np.zeros((len(position), 6, 6))
    cov[:, :3, :3], cov[:, 3:, 3:] = position, attitude
    return cov


def _on_the_earth(path: Path, poses: Poses) -> CameraPoses:
    """Return poses in their tangent plane, else in that at their mean."""
    if poses.C_Ex is None or poses.x != "camera" or not poses.images:
        raise InputError.in_file(
            path, f"{poses.form} has no attitudes of named images; give poses of an adjustment"
        )
    plane = poses.plane or TangentPlane(
        *(float(np.mean(v)) for v in (poses.lat, poses.lon, poses.height))
    )
    R = plane.C_em.T @ poses.C_eE
    return CameraPoses(
        poses.images,
        plane.position_from_geodetic(poses.lat, poses.lon, poses.height),
        R @ poses.C_Ex,
        _joint_cov(
            rotate_covariance(R, poses.cov_position), rotate_covariance(R, poses.cov_attitude)
        ),
        "plane",
        str(path),
        poses.notes,
        plane,
        opk=poses.angles if poses.angle_set == "opk" else None,
    )


def is_block(path: Path) -> bool:
    """Whether a file is that of a photogrammetry program, and no table.

    Parameters
    ----------
    path : Path
        The file or directory.

    Returns
    -------
    bool
        By its name and first bytes.

    Raises
    ------
    InputError
        It is empty.
    """
    if path.is_dir() or path.suffix.lower() in (".psx", ".psz") or COLMAP_FILE.fullmatch(path.name):
        return True
    head = head_of(path)
    if not head:
        raise InputError.in_file(path, "is empty; export the poses again")
    text = decode(head).lstrip()
    if head.startswith(b"PK\x03\x04") or text.startswith("<"):
        return True
    if text.startswith(("{", "[")):
        return "exterior orientation" not in text.lower()
    return bool(re.search(r"^\s*-99\b", text, re.MULTILINE))


def _of_block(path: Path) -> CameraPoses:
    block = read_measured_block(path, recognise_format(path))
    rows = np.flatnonzero(block.oriented)
    if not rows.size:
        raise InputError.in_file(path, "no image has a pose; align the images and export")
    return CameraPoses(
        tuple(block.measured.images[k] for k in rows),
        block.position_m[rows],
        block.C_mc[rows],
        frame="geocentric" if block.geocentric else "own",
        source=str(path),
        notes=block.notes,
        load=lambda: block,
    )


@dataclass(frozen=True, eq=False)
class Positions:
    """Positions by names in a Cartesian frame.

    Parameters
    ----------
    path : Path
        The file.
    names : tuple of str
        (n,) names.
    position : ndarray, (n, 3)
        m.
    cov : ndarray, (n, 3, 3), or None
        m^2; None where the file has none.
    plane : TangentPlane or None
        Where the positions stand on the Earth; None: in axes of their own.
    time : ndarray, (n,), or None
        Seconds of the GPS week.
    poses : CameraPoses or None
        Those of the images that see the positions, where they were intersected.
    """

    path: Path
    names: tuple[str, ...]
    position: Array
    cov: Array | None
    plane: TangentPlane | None = None
    time: Array | None = None
    poses: CameraPoses | None = None

    def with_sigma(self, sigma_m: float | tuple[float, float, float]) -> Array:
        """Return the covariances of the file, those of standard deviations where it has none.

        Parameters
        ----------
        sigma_m : float, or three of them
            Of each axis.

        Returns
        -------
        ndarray, (n, 3, 3)
            m^2.
        """
        if self.cov is not None:
            return self.cov
        return np.tile(np.diag(np.full(3, sigma_m) ** 2), (len(self.names), 1, 1))


def read_positions(
    path: Path, options: PlaceOptions, plane: TangentPlane | None = None
) -> Positions:
    """Read positions by names into east, north, up of a tangent plane where they have a place.

    Parameters
    ----------
    path : Path
        A table (`data_specs/pose_table.md`), or a file of Metashape, of which the references of its
        images are taken.
    options : PlaceOptions
        The CRS of a table.
    plane : TangentPlane, optional
        By default at the mean of the positions.

    Returns
    -------
    Positions
        Local coordinates as they are where neither file nor options say a place.

    Raises
    ------
    InputError
        With file and line.
    """
    if not is_file(path):
        raise InputError.in_file(path, "does not exist; check the path")
    if is_block(path):
        ground, crs = read_metashape_references(path)
        return placed_positions(path, ground, options.crs or crs, options.geoid, plane)
    table = read_position_table(path)
    n = len(table.names)
    cov = np.tile(np.eye(3), (n, 1, 1)) if table.cov is None else table.cov
    if table.geodetic:
        lat, lon, h = table.position.T
        plane = plane or TangentPlane(float(lat.mean()), float(lon.mean()), float(h.mean()))
        R = plane.C_mn(lat, lon) @ NED_ENU.T
        position = plane.position_from_geodetic(lat, lon, h)
        placed = Positions(path, table.names, position, R @ cov @ R.transpose(0, 2, 1), plane)
    else:
        ground = GroundTable(table.names, table.position, cov, np.zeros(n, dtype=np.bool_), True)
        crs = options.crs or stated_crs(path) or ""
        if degrees_for_metres(table.position) and not (crs and is_geographic(crs)):
            problem = "its x and y are degrees: as metres its points would be centimetres apart"
            how = "call the columns lon and lat, or name their CRS, --crs EPSG:4326"
            raise InputError.in_file(path, f"{problem}; {how}")
        placed = placed_positions(path, ground, crs, options.geoid, plane)
    return replace(placed, cov=None if table.cov is None else placed.cov, time=table.time)


def placed_positions(
    path: Path, ground: GroundTable, crs: str, geoid: Path | None, plane: TangentPlane | None
) -> Positions:
    """Return the points of a table of a CRS in a tangent plane, by default that at their mean.

    Parameters
    ----------
    path : Path
        Their file.
    ground : GroundTable
        The points.
    crs : str
        Their CRS; of none, or a local one, they stay as they are.
    geoid : Path or None
        Grid of geoid heights.
    plane : TangentPlane or None
        The plane.

    Returns
    -------
    Positions
        By the names of the points.
    """
    if not crs or "LOCAL_CS" in crs or "ENGCRS" in crs:
        return Positions(path, ground.points, ground.position_m, ground.cov)
    axes = GroundAxes(crs, geoid)
    lat, lon, h = axes.geodetic(ground.position_m)
    if (projection := axes.projection) is not None:
        _refuse_outside(path, ground.position_m, projection, projection.degrees_outside(lat, lon))
    if plane is None:
        plane = TangentPlane(float(lat.mean()), float(lon.mean()), float(h.mean()))
    placed = ground.in_plane(axes, plane)
    return Positions(path, placed.points, placed.position_m, placed.cov, plane)


def _refuse_outside(path: Path, x: Array, projection: MapProjection, far_deg: float) -> None:
    """Refuse positions far from the area of their CRS, where a similarity would stretch them."""
    if far_deg <= FAR_DEG:
        return
    inside = ""
    for reading, y in (("x and y are exchanged", x[:, [1, 0, 2]]), ("they are feet", FOOT_M * x)):
        with suppress(InputError):
            lat, lon, _ = projection.inverse(y)
            if projection.degrees_outside(lat, lon) == 0.0:
                inside = f"; inside it if {reading}"
    raise InputError(
        f"{path}: positions such as {x[0, 0]:.3f} {x[0, 1]:.3f} lie outside the area of"
        f" {projection.name}{inside}; give their own CRS and unit, with --crs, or add what was"
        " subtracted from them"
    )


def join_by_name(
    images: Sequence[str], names: Sequence[str], first: Path, second: Path, fewest: int
) -> tuple[NDArray[np.int64], NDArray[np.int64], tuple[str, ...]]:
    """Join two files by names; endings and folders of images need not be the same.

    Parameters
    ----------
    images, names : sequence of str
        Names of both.
    first, second : Path
        Their files, for messages.
    fewest : int
        How many pairs are needed.

    Returns
    -------
    rows_first, rows_second : ndarray of int
        Rows that belong together, in the order of the first.
    notes : tuple of str
        What has no partner.

    Raises
    ------
    InputError
        Too few pairs.
    """
    rows = match_names(images, names)
    pairs = np.flatnonzero(rows >= 0), rows[rows >= 0]
    if pairs[0].size < fewest:
        raise InputError(
            f"{second}: {pairs[0].size} of its {len(names)} names, such as {quote(names[0])}, are"
            f" among the {len(images)} of {first}, such as {quote(images[0])} ({fewest} are"
            " needed); are the files of one flight, and are images named alike?"
        )
    notes = []
    for path, names_of_file, taken in zip((first, second), (images, names), pairs, strict=True):
        if missing := [
            names_of_file[k] for k in np.setdiff1d(np.arange(len(names_of_file)), taken)
        ]:
            named = f"in {path.name} without partner: {some(missing)}"
            notes.append(f"{len(missing)} of {len(names_of_file)} {named}")
    return *pairs, tuple(notes)
