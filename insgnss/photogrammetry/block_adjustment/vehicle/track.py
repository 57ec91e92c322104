"""Where a vehicle's target was: trajectory.csv, eo.json, or a table of positions.

Errors are position error = B xi with B of each row and xi of correlation rho(t_i, t_j), the same
for all components:

    P_ij = rho_ij B_i B_j^T                                                                  (KI.1)

    trajectory.csv  B = [C_mn diag(sd)   -[C_mv a x] C_mn F diag(sd of roll, pitch, heading)], a the
                    lever arm of the target, F from angles to psi; rho a share that lasts (300 s)
                    and white noise
    a table         B B^T = the covariance of the row, B its symmetric root; rho as before
    eo.json         P is that of the flight lines and of what they share (eo_covariance.npz)

Between rows the target follows the cubic through positions and velocities of both neighbours, (T.1)
of `records.interpolation`; velocities of a table without them are those of the parabola through
three rows. Nothing is extrapolated.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from ....base.errors import InputError
from ....base.inputs import opened_text
from ....flight.config.block_tables.vehicle import VehicleTable
from ....geodesy.frames import TangentPlane
from ....geodesy.gpstime import WEEK_S
from ....geodesy.rotation import (
    rotation_from_vector,
    rpy_jacobian,
    skew,
    vector_from_rotation,
)
from ....io.formats.blocks.ground_points import GroundAxes, GroundTable
from ....io.formats.blocks.joined import match_names
from ....io.formats.orientation.eo_covariance import FILE, read_common_errors, read_eo_covariance
from ....io.formats.orientation.eo_json import read_one_camera
from ....io.formats.trajectory.trajectory_csv import TrajectoryTable, read_trajectory_csv
from ....io.formats.vehicle.target_positions import read_target_positions
from ....records import ExteriorOrientation
from ....records.block import Array
from ....records.interpolation import cubic
from ....records.rows import covariance_of_rows, rows_of
from ...adjust.aerial import chained_covariance
from ...adjust.kinematic import gauss_markov

SLOWEST_MPS = 0.5
"""Below it the course of a vehicle without attitude is not known."""
Rows = NDArray[np.int64]


DRIVEN_MPS, FEWEST_DRIVEN, ACROSS_RAD = 2.0, 10, np.radians(10.0)
"""Where a vehicle goes faster its course is known; how far a heading may lie off it."""


@dataclass(frozen=True, eq=False)
class Track:
    """Places of a target in the axes of the block.

    Parameters
    ----------
    kind : str
        "trajectory", "eo" or "table".
    images : tuple of str or None
        Image of each row, where the file names them.
    time : ndarray or None
        (k,) s, GPST of `week`, increasing; None of a table of images without stamps.
    week : int or None
        GPS week, where the file says it.
    position_m, velocity : ndarray
        (k, 3) of the target, m and m/s.
    C_mv : ndarray
        (k, 3, 3) forward right down of the vehicle to the axes of the block; where its attitude is
        not known, level and along its course.
    arm_m : ndarray
        (3,) lever arm of the target that was applied, from the point of the file.
    root : ndarray or None
        (k, 3, q) B of (KI.1).
    cov : ndarray or None
        (3 k, 3 k) covariance of all rows, where the file says it.
    share, duration_s : float
        Of the errors that last.
    """

    kind: str
    images: tuple[str, ...] | None
    time: Array | None
    week: int | None
    position_m: Array
    velocity: Array
    C_mv: Array
    arm_m: Array
    root: Array | None = None
    cov: Array | None = None
    share: float = 1.0
    duration_s: float = 1.0

    def at(self, time: Array, longest_s: float) -> tuple["Track", NDArray[np.bool_]]:
        """Return the track at some instants.

        Parameters
        ----------
        time : ndarray, (n,)
            Instants, s.
        longest_s : float
            Longest time between rows within which it is interpolated.

        Returns
        -------
        track : Track
            Its rows are the instants; nothing of those outside says anything.
        within : ndarray of bool, (n,)
            Which instants are covered: within the file and no gap.
        """
        assert self.time is not None
        after = np.clip(np.searchsorted(self.time, time, side="right"), 1, len(self.time) - 1)
        first, last = after - 1, after
        h = self.time[last] - self.time[first]
        u = (time - self.time[first]) / h
        at_row = (np.abs(u * h) < SAME_TRACK_STAMP_S) | (np.abs((1.0 - u) * h) < SAME_TRACK_STAMP_S)
        within = (
            (u > -SAME_TRACK_STAMP_S / h)
            & (u < 1.0 + SAME_TRACK_STAMP_S / h)
            & ((h <= longest_s) | at_row)
        )
        s, hs = u[:, None], h[:, None]
        x, v = self.position_m, self.velocity
        a, b = x[first], x[last]
        position = cubic((a, b), (v[first], v[last]), u, h)
        velocity = 6.0 * (s - s**2) * (b - a) / hs
        velocity += (1.0 - 4.0 * s + 3.0 * s**2) * v[first] + (3.0 * s**2 - 2.0 * s) * v[last]
        turn = vector_from_rotation(self.C_mv[last] @ self.C_mv[first].swapaxes(1, 2))
        C = rotation_from_vector(np.clip(s, 0.0, 1.0) * turn) @ self.C_mv[first]
        root = self.root
        if root is not None:
            root = root[first] + np.clip(u, 0.0, 1.0)[:, None, None] * (root[last] - root[first])
        cov = self.cov
        if cov is not None:  # instants are rows
            cov = covariance_of_rows(cov, np.where(u < 0.5, first, last), 3)
        at_times = replace(self, images=None, time=time, position_m=position, velocity=velocity)
        return replace(at_times, C_mv=C, root=root, cov=cov), within

    def rows(self, rows: Rows) -> "Track":
        """Return some rows of the track."""
        fields = ("images", "time", "position_m", "velocity", "C_mv", "root")
        cov = None if self.cov is None else covariance_of_rows(self.cov, rows, 3)
        return replace(self, **rows_of(self, rows, fields), cov=cov)

    def covariance(self, time: Array | None = None) -> Array:
        """Return the covariance of all positions, (3 k, 3 k), m^2 (KI.1).

        Parameters
        ----------
        time : ndarray, (k,), optional
            Instants of the rows, where the track has none.

        Returns
        -------
        ndarray
            Row after row.
        """
        if self.cov is not None:
            return self.cov
        assert self.root is not None
        instants = self.time if self.time is not None else time
        assert instants is not None
        n = len(instants)
        rho = gauss_markov(instants, self.share, self.duration_s)
        P = np.einsum("ij,iak,jbk->iajb", rho, self.root, self.root)
        return np.asarray(P.reshape(3 * n, 3 * n))


SAME_TRACK_STAMP_S = 1e-4
"""Stamps that differ by less are those of one instant: a vehicle at 20 m/s moves by 2 mm."""


def read_track(
    options: VehicleTable, plane: TangentPlane | None, eo: ExteriorOrientation | None
) -> Track:
    """Read where the vehicle's target was.

    Parameters
    ----------
    options : VehicleTable
        Table [vehicle] of the block file.
    plane : TangentPlane, optional
        Whose axes are those of the block.
    eo : ExteriorOrientation, optional
        The aerial control, for its datum.

    Returns
    -------
    Track
        In the axes of the block.

    Raises
    ------
    InputError
        The file cannot be read, or lacks what it needs.
    """
    path = options.file
    assert path is not None
    if path.suffix.lower() == ".json":
        track = _of_eo(options, path, plane, eo)
    elif _is_trajectory(path):
        track = _of_trajectory(options, path, plane)
    else:
        track = _of_table(options, path, plane, eo)
    share, duration_s = options.correlated_share, options.correlation_time_s
    track = replace(track, share=share, duration_s=duration_s)
    if track.time is not None and options.time_offset_s:
        track = replace(track, time=track.time + options.time_offset_s)
    return track


def _is_trajectory(path: Path) -> bool:
    """Whether the file has the columns of trajectory.csv."""
    try:
        with opened_text(path, errors="replace") as stream:
            for line in stream:
                if line.strip() and not line.startswith("#"):
                    return {"lat_deg", "lon_deg", "roll_deg"} <= {
                        f.strip() for f in line.split(",")
                    }
    except OSError as error:
        raise InputError.in_file(
            path, f"cannot be read: {error.strerror or error}; check path and permission"
        ) from None
    return False


def _of_trajectory(options: VehicleTable, path: Path, plane: TangentPlane | None) -> Track:
    table = read_trajectory_csv(path)
    if plane is None:
        raise InputError.in_file(
            path,
            "positions on the globe (lat_deg ...), which need aerial control, whose"
            " tangent plane has the axes of the block; give a table of positions in these axes",
        )
    if options.target_m is None:
        raise InputError.in_file(
            path,
            "positions of the IMU, and vehicle.target_m (targets: --target-m) is missing;"
            " give the vector from IMU to target: forward, right, down, m",
        )
    if len(table.time) < 2:
        raise InputError.in_file(path, "has only one row; a trajectory needs at least two")
    _refuse_radians(path, table)
    arm = np.array(options.target_m)
    C_mn = plane.C_mn(table.lat, table.lon)
    C_mv = C_mn @ table.C_nb
    centre = plane.position_from_geodetic(table.lat, table.lon, table.height)
    v = np.einsum("nij,nj->ni", C_mn, table.velocity_ned)
    offset = C_mv @ arm
    position = centre + offset
    # the target turns with the vehicle: velocity of the arm from the attitudes of neighbours
    v = v + _derivative(table.time, offset)
    tilt = C_mn @ rpy_jacobian(table.rpy) * table.sigma[:, None, 6:]
    root = np.concatenate([C_mn * table.sigma[:, None, :3], -skew(offset) @ tilt], axis=2)
    if not (table.sigma[:, :3] > 0.0).all():
        row = int(np.argmin((table.sigma[:, :3] > 0.0).all(axis=1)))
        raise InputError.at_line(
            path,
            row + 2,
            "a standard deviation of the position is not positive; state what the vehicle has",
        )
    return Track(
        "trajectory",
        None,
        table.time,
        table.gps_week,
        position,
        v,
        C_mv,
        arm,
        root,
    )


def _refuse_radians(path: Path, table: TrajectoryTable) -> None:
    """Refuse headings that follow the way as radians and not as degrees."""
    fast = np.hypot(*table.velocity_ned.T[:2]) > DRIVEN_MPS
    if fast.sum() < FEWEST_DRIVEN:
        return
    course = np.arctan2(table.velocity_ned[fast, 1], table.velocity_ned[fast, 0])
    heading = table.rpy[fast, 2]
    as_degrees, as_radians = (
        float(np.median(np.abs(np.angle(np.exp(1j * (x - course))))))
        for x in (heading, np.degrees(heading))
    )
    if as_degrees > ACROSS_RAD and as_radians < 0.25 * as_degrees and as_radians < ACROSS_RAD:
        raise InputError.in_file(
            path,
            f"headings lie {np.degrees(as_degrees):.0f} deg off the way that the vehicle goes, and"
            f" {np.degrees(as_radians):.0f} deg as radians; give degrees (roll_deg, pitch_deg,"
            " heading_deg)",
        )


def _of_eo(
    options: VehicleTable, path: Path, plane: TangentPlane | None, eo: ExteriorOrientation | None
) -> Track:
    vehicle_eo = read_one_camera(path, "an adjustment")
    arm = np.zeros(3) if options.target_m is None else np.array(options.target_m)
    if not len(vehicle_eo.images):
        raise InputError.in_file(path, "no event; process the vehicle with the exposures")
    if vehicle_eo.velocity_mps is None or vehicle_eo.rate_radps is None:
        raise InputError.in_file(path, "no velocities; process the vehicle again")
    if eo is not None and (vehicle_eo.datum, vehicle_eo.epoch) != (eo.datum, eo.epoch):
        raise InputError.in_file(
            path,
            f"positions in {vehicle_eo.datum or 'WGS 84'} {vehicle_eo.epoch or ''}, those of the"
            f" images in {eo.datum or 'WGS 84'} {eo.epoch or ''}; process both with one gnss.datum",
        )
    if plane is None:
        raise InputError.in_file(
            path, "needs aerial control, whose tangent plane has the axes of the block"
        )
    own_plane = TangentPlane(*vehicle_eo.origin)
    turn = plane.C_em.T @ own_plane.C_em
    geodetic = own_plane.geodetic_from_position(vehicle_eo.position_m)
    C_own = vehicle_eo.C_mc @ vehicle_eo.camera_from_body @ vehicle_eo.boresight  # C_mb of (O.1)
    offset = C_own @ arm
    order = np.argsort(vehicle_eo.time, kind="stable")
    track = Track(
        "eo",
        vehicle_eo.images,
        vehicle_eo.time,
        vehicle_eo.gps_week,
        plane.position_from_geodetic(*geodetic) + offset @ turn.T,
        (vehicle_eo.velocity_mps + np.cross(vehicle_eo.rate_radps, offset)) @ turn.T,
        turn @ C_own,
        arm,
        None,
        _covariance_of(vehicle_eo, path.parent / FILE, offset, turn),
    )
    return track.rows(order)


def _covariance_of(veh: ExteriorOrientation, beside: Path, offset: Array, turn: Array) -> Array:
    """Return the covariance of the target at all events: flight lines, and what they share."""
    n = len(veh.images)
    whole = np.zeros((n, n, 6, 6))
    if beside.is_file():
        common = read_common_errors(beside, veh)
        if common is not None:
            same = common.segment[:, None] == common.segment[None]
            A = common.factor
            whole = same[:, :, None, None] * np.einsum("iaq,jbq->ijab", A, A)
        whole[np.arange(n), np.arange(n)] = veh.cov
        for strip in read_eo_covariance(beside, veh):
            whole[np.ix_(strip.rows, strip.rows)] = strip.blocks
    elif veh.cross is not None:
        whole = chained_covariance(veh).reshape(n, 6, n, 6).transpose(0, 2, 1, 3)
    else:
        whole[np.arange(n), np.arange(n)] = veh.cov
    J = np.concatenate([np.tile(np.eye(3), (n, 1, 1)), -skew(offset)], axis=2)
    J = turn @ J
    P = np.einsum("iab,ijbc,jdc->iajd", J, whole, J, optimize=True)
    return np.asarray(P.reshape(3 * n, 3 * n))


def _of_table(
    options: VehicleTable, path: Path, plane: TangentPlane | None, eo: ExteriorOrientation | None
) -> Track:
    if options.target_m is not None and any(options.target_m):
        raise InputError.in_file(
            path,
            "a table has positions of the target itself, so that vehicle.target_m has no meaning;"
            " leave it out, or give the trajectory.csv of the vehicle",
        )
    positions = read_target_positions(path, options.columns)
    position, cov = positions.position_m, positions.cov
    if options.crs is not None:
        if plane is None:
            raise InputError.in_file(
                path,
                "vehicle.crs needs aerial control, whose tangent plane defines the axes"
                " of the block",
            )
        names = tuple(str(k) for k in range(len(position)))
        axes = GroundAxes(
            options.crs, options.geoid, eo.datum if eo else None, eo.epoch if eo else None
        )
        table = GroundTable(names, position, cov, np.zeros(len(position), dtype=bool), True)
        moved = table.in_plane(axes, plane)
        position, cov = moved.position_m, moved.cov
    values, vectors = np.linalg.eigh(cov)
    root = (vectors * np.sqrt(values)[:, None, :]) @ vectors.swapaxes(1, 2)
    time = positions.time
    velocity = np.zeros_like(position)
    if time is not None and len(time) > 1:
        velocity = _derivative(time, position)
    return Track(
        "table",
        positions.images,
        time,
        positions.gps_week,
        position,
        velocity,
        along_course(velocity),
        np.zeros(3),
        root,
    )


def _derivative(time: Array, x: Array) -> Array:
    """Return the derivative of (n, 3) values at n instants, by parabolas through three of them."""
    return np.asarray(np.gradient(x, time, axis=0, edge_order=2 if len(time) > 2 else 1))


def along_course(velocity: Array) -> Array:
    """Return level attitudes along the course.

    Parameters
    ----------
    velocity : ndarray, (n, 3)
        East, north, up.

    Returns
    -------
    ndarray, (n, 3, 3)
        Forward right down to east north up; of a vehicle that stands, along the course before.
    """
    flat = velocity[:, :2].copy()
    speed = np.linalg.norm(flat, axis=1)
    moving = np.flatnonzero(speed > SLOWEST_MPS)
    if not moving.size:
        flat[:] = (0.0, 1.0)
    else:
        which = np.clip(np.searchsorted(moving, np.arange(len(flat)), side="right") - 1, 0, None)
        flat = flat[moving[which]] / speed[moving[which], None]
    C = np.zeros((len(flat), 3, 3))
    C[:, :2, 0] = flat
    C[:, 0, 1], C[:, 1, 1] = flat[:, 1], -flat[:, 0]
    C[:, 2, 2] = -1.0
    return C


def week_shift(week: int | None, other_week: int | None) -> float:
    """Return the seconds from the start of a GPS week to that of another; 0 of unknown ones."""
    return 0.0 if week is None or other_week is None else (other_week - week) * WEEK_S


def rows_by_name(track: Track, images: Sequence[str]) -> Rows | None:
    """Return the row of each image by its name; None where the file has none of them.

    Parameters
    ----------
    track : Track
        The track.
    images : sequence of str
        Names of images.

    Returns
    -------
    ndarray of int, (n,) or None
        Rows, -1 of images that it does not have.
    """
    if track.images is None:
        return None
    rows = match_names(images, track.images)
    return rows if (rows >= 0).any() else None
