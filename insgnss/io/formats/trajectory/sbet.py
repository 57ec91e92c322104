"""SBET trajectory and its accuracies (smrmsg), little-endian doubles, data_specs/sbet.md.

SBET, 17 a record: time (GPST seconds of week), latitude, longitude rad, height m, x y z velocity
m/s, roll, pitch, platform heading, wander angle rad, x y z body acceleration m/s^2, x y z body rate
rad/s. Velocities are along the wander frame (y to the left of x, z up), and heading = platform
heading - wander:

    v_N = x cos w - y sin w,   v_E = -x sin w - y cos w,   v_U = z                             (B.1)

Written with w = 0: x = v_N, y = -v_E, z = -v_D. smrmsg, 10 a record: time, RMS of north east down
m, of their velocities m/s, of roll pitch heading in minutes of arc. It stands beside the SBET:
x.smrmsg of x.sbet, smrmsg_x.out of sbet_x.out; where it is sampled more sparsely its values are
interpolated. With psi = E d(roll, pitch, heading) the attitude's covariance is E diag(s^2) E^T.
"""

from dataclasses import dataclass
from pathlib import Path

import numpy as np

from ....base.errors import InputError
from ....base.files import atomic_write
from ....geodesy.gpstime import unwrap_week
from ....geodesy.rotation import rotation_from_rpy, rpy_from_rotation, rpy_jacobian
from ....records import Array, GnssFixes, Trajectory
from ....records.interpolation import columns_at
from ..gnss.fixes import FIX_SIGMAS, VELOCITY_SIGMA, FixScales, fixes_from_columns
from ..orientation.exported import angle_sigma
from ..read_options import STATED_NOTHING, ReadOptions
from ..text.clock import check_increasing
from ..text.order import NumberedRows, refuse_rows
from ..text.text import Source, load_bytes

SBET_FIELDS, SMRMSG_FIELDS = 17, 10  # doubles of a record: the formats'
_FIELDS = (
    "time latitude longitude height x_velocity y_velocity z_velocity roll pitch platform_heading"
    " wander_angle x_acceleration y_acceleration z_acceleration x_rate y_rate z_rate"
)
FIELDS = tuple(_FIELDS.split())
LARGEST_VALUE = 1e9  # any value of a record: larger ones come of another order of bytes
OVERHANG_S = 1.5  # SBET beyond the span of its smrmsg (s): the latter has 1 Hz
ARC_MINUTE = np.pi / 180.0 / 60.0  # rad, the unit of angles in an smrmsg


@dataclass(frozen=True, eq=False)
class BodyStates:
    """States of a body by their components.

    Attributes
    ----------
    time : ndarray
        (n,) s.
    lat, lon, height : ndarray
        (n,) rad, m.
    velocity_ned : ndarray
        (n, 3) m/s.
    rpy : ndarray
        (n, 3) roll, pitch, (true) heading, rad.
    """

    time: Array
    lat: Array
    lon: Array
    height: Array
    velocity_ned: Array
    rpy: Array

    @property
    def C_nb(self) -> Array:
        """(n, 3, 3), body FRD to NED at the point."""
        return rotation_from_rpy(self.rpy)


@dataclass(frozen=True, eq=False)
class Sbet(BodyStates):
    """The content of an SBET.

    Attributes
    ----------
    acceleration_b, rate_b : ndarray
        (n, 3) body acceleration m/s^2, body rate rad/s.
    """

    acceleration_b: Array
    rate_b: Array


@dataclass(frozen=True, eq=False)
class Smrmsg:
    """The content of an smrmsg.

    Attributes
    ----------
    time : ndarray
        (n,) s.
    sigma_position_m, sigma_velocity, sigma_rpy : ndarray
        (n, 3) standard deviations of position m, velocity m/s (NED), roll pitch heading rad.
    """

    time: Array
    sigma_position_m: Array
    sigma_velocity: Array
    sigma_rpy: Array


def write_sbet(trajectory: Trajectory, path: Source) -> None:
    """Write the SBET of a trajectory; accelerations and rates that it does not hold are zeros."""
    table = np.zeros((trajectory.time.size, SBET_FIELDS), dtype="<f8")
    position = [trajectory.lat, trajectory.lon, trajectory.height]
    table[:, :4] = np.column_stack([trajectory.time, *position])
    table[:, 4:7] = trajectory.velocity_ned * [1.0, -1.0, -1.0]  # (B.1) with w = 0
    table[:, 7:10] = rpy_from_rotation(trajectory.C_nb)
    if trajectory.acceleration_b is not None:
        table[:, 11:14] = trajectory.acceleration_b
    if trajectory.rate_b is not None:
        table[:, 14:17] = trajectory.rate_b
    atomic_write(path, table.tobytes())


def write_smrmsg(trajectory: Trajectory, path: Source) -> None:
    """Write the standard deviations of a trajectory, one record an epoch."""
    table = np.empty((trajectory.time.size, SMRMSG_FIELDS), dtype="<f8")
    table[:, 0] = trajectory.time
    table[:, 1:7] = np.sqrt(np.diagonal(trajectory.cov, axis1=1, axis2=2)[:, :6])
    table[:, 7:10] = rpy_sigma(trajectory) / ARC_MINUTE
    atomic_write(path, table.tobytes())


def rpy_sigma(trajectory: Trajectory) -> Array:
    """Return standard deviations (n, 3), rad, of roll, pitch, heading."""
    rpy = rpy_from_rotation(trajectory.C_nb)
    return angle_sigma(
        rpy,
        rpy_jacobian,
        1,
        trajectory.cov[:, 6:, 6:],
        lambda row: f"epoch {trajectory.time[row]:.3f} s",
        "roll pitch heading",
    )


def read_sbet(path: Source) -> Sbet:
    """Read an SBET with any wander angle."""
    table = _records(path, SBET_FIELDS)
    lat, lon, height = table.T[1:4]
    x, y, wander = table[:, 4], table[:, 5], table[:, 10]
    c, s = np.cos(wander), np.sin(wander)
    velocity = np.column_stack([x * c - y * s, -x * s - y * c, -table[:, 6]])  # (B.1)
    rpy = np.column_stack(
        [table[:, 7:9], np.remainder(table[:, 9] - wander + np.pi, 2.0 * np.pi) - np.pi]
    )
    return Sbet(
        unwrap_week(table[:, 0]), lat, lon, height, velocity, rpy, table[:, 11:14], table[:, 14:17]
    )


def read_smrmsg(path: Source) -> Smrmsg:
    """Read an smrmsg."""
    table = _records(path, SMRMSG_FIELDS)
    return Smrmsg(
        unwrap_week(table[:, 0]), table[:, 1:4], table[:, 4:7], table[:, 7:10] * ARC_MINUTE
    )


def read_gnss_sbet(path: Source, options: ReadOptions = STATED_NOTHING) -> GnssFixes:
    """Read positions and velocities of an SBET as fixes.

    The point is the SBET's own, which is mostly the IMU's navigation centre and not the antenna.

    Parameters
    ----------
    path : path
        The SBET.
    options : ReadOptions
        `sigma_m`, `sigma_velocity`, where no smrmsg stands beside it.

    Returns
    -------
    GnssFixes
        The fixes.
    """
    sbet = read_sbet(path)
    cols = {"tow": sbet.time, "lat": sbet.lat, "lon": sbet.lon, "h": sbet.height}
    cols |= dict(zip(("vn", "ve", "vd"), sbet.velocity_ned.T, strict=True))
    if (beside := smrmsg_beside(path)) is not None:
        sigma = _sigma_at(beside, sbet.time)
        cols |= dict(zip((*FIX_SIGMAS, *VELOCITY_SIGMA), sigma[:, :6].T, strict=True))
    elif options.sigma_m is not None and options.sigma_velocity is None:
        cols = {name: column for name, column in cols.items() if name not in ("vn", "ve", "vd")}
    return fixes_from_columns(cols, NumberedRows(str(path), "record"), FixScales(), options)


def smrmsg_beside(path: Source) -> Path | None:
    """Return the accuracies that stand beside an SBET, by their name; None where there are none."""
    path = Path(path)
    names = [
        path.with_suffix(".smrmsg"),
        path.with_name(path.name.replace("sbet", "smrmsg", 1)),
        path.with_name(path.name.replace("SBET", "SMRMSG", 1)),
    ]
    return next((name for name in names if name != path and name.is_file()), None)


def _sigma_at(path: Path, time: Array) -> Array:
    """Return standard deviations (n, 9) of an smrmsg at times (n,), s, positive, in its span."""
    smrmsg = read_smrmsg(path)
    lines = NumberedRows(str(path), "record")
    check_increasing(lines, smrmsg.time)
    sigma = np.column_stack([smrmsg.sigma_position_m, smrmsg.sigma_velocity, smrmsg.sigma_rpy])
    message = "a standard deviation is not positive; is the file an smrmsg?"
    refuse_rows(lines, np.any(sigma <= 0.0, axis=1), message)
    beyond = max(smrmsg.time[0] - time.min(), time.max() - smrmsg.time[-1])
    if beyond > OVERHANG_S:
        span = f"{smrmsg.time[0]:.3f} to {smrmsg.time[-1]:.3f} s"
        message = (
            f"accuracies from {span}, but the SBET's times exceed them by {beyond:.3f} s (limit"
            f" {OVERHANG_S} s); are both files of the same run?"
        )
        raise InputError.in_file(path, message)
    return columns_at(time, smrmsg.time, sigma)


def _records(path: Source, fields: int) -> Array:
    buf = load_bytes(path)
    size = 8 * fields
    if buf.size % size:
        message = (
            f"{buf.size} bytes are no whole number of records of {size} bytes; it is cut off, or of"
            " another format"
        )
        raise InputError.in_file(path, message)
    table = np.ascontiguousarray(buf.view("<f8").reshape(-1, fields), dtype=np.float64)
    if (bad := ~(np.abs(table) <= LARGEST_VALUE)).any():
        row, k = (int(i) for i in np.argwhere(bad)[0])
        problem = f"record {row + 1}, value {k + 1} is {table[row, k]:g}"
        raise InputError.in_file(path, f"{problem}; is it another format?")
    return table
