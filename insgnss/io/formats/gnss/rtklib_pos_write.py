"""Positions as RTKLIB's .pos: of fixes, and of the antenna by a trajectory or images,
data_specs/rtklib_pos_write.md.

With the lever arm l in the axes of the body (IMU to antenna) or of the camera (projection centre to
antenna), C into north, east, down:

    r = p + C l,    cov = J P J',    J = [I  -[C l x]]                                         (A.1)

for position and psi of P. RTKLIB reads fields by their place and wants all fifteen, so the number
of satellites, the age and the ratio, which nobody knows here, are 0. A covariance c is written as
its signed root, sign(c) sqrt(|c|). Positions are those of the smoothed inertial solution, for which
RTKLIB has no code of quality.
"""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from ....base.errors import InputError, UsageError
from ....base.files import atomic_write
from ....geodesy.frames import ecef_to_geodetic, geodetic_to_ecef, rotation_en
from ....geodesy.gpstime import WEEK_S
from ....geodesy.rotation import NED_ENU, skew
from ....records import Array, FramedOrientation, GnssFixes, Trajectory
from ..orientation.poses import local_covariance, vector
from ..text.text import Source, format_rows
from .pos_covariance import DOWN_FROM_UP, signed_roots

POSITION_VELOCITY = np.r_[0:3, 6:9]  # places in a covariance of position, attitude and velocity
CODES = (1, 2, 3, 4, 5, 6)  # codes of quality, from fix to ppp: as RTKLIB's legend lists them
LEGEND = (
    "% (lat/lon/height=WGS84/ellipsoidal,Q=1:fix,2:float,3:sbas,4:dgps,5:single,6:ppp,ns=# of"
    " satellites)\n"
)
POS_HEAD = (
    "%  GPST  latitude(deg) longitude(deg) height(m) Q ns sdn(m) sde(m) sdu(m) sdne(m) sdeu(m)"
    " sdun(m) age(s) ratio"
)
# degrees to 1e-10 (0.01 mm), heights to 0.1 mm, roots to 1e-6 m: below any sigma
FORM = "%4d %{}.6f %14.10f %15.10f %10.4f %3d %3d" + " %10.6f" * 6 + " %6.2f %6.1f"
VELOCITY_HEAD = " vn(m/s) ve(m/s) vu(m/s) sdvn sdve sdvu sdvne sdveu sdvun"
FORM_OF_VELOCITY = " %10.5f" * 3 + " %9.6f" * 6  # velocities to 1e-5 m/s, their roots to 1e-6 m/s


def write_rtklib_pos(
    fixes: GnssFixes,
    path: Source,
    *,
    comments: Sequence[str] = (),
    digits: int = 10,
) -> None:
    """Write fixes as RTKLIB does, the signed roots with 6 decimals instead of 4.

    The columns are week, time of week, degrees, height above the ellipsoid, signed roots.

    Parameters
    ----------
    fixes : GnssFixes
        The fixes.
    path : path
        The file.
    comments : sequence of str
        Lines before the legend.
    digits : int
        Width of the time of week.

    Raises
    ------
    InputError
        Fixes without a GPS week.
    """
    if fixes.gps_week is None:
        raise InputError(
            f"{fixes.source or 'GnssFixes'}: no GPS week, but a .pos file needs one; give gps_week"
        )
    zero = np.zeros(fixes.time.size)
    quality, ns, age, ratios = (
        zero if column is None else np.nan_to_num(column)
        for column in (fixes.quality, fixes.satellites, fixes.age_s, fixes.ratio)
    )
    weeks = np.floor(fixes.time / WEEK_S)
    position = [np.degrees(fixes.lat), np.degrees(fixes.lon), fixes.height]
    table = [fixes.gps_week + weeks, fixes.time - WEEK_S * weeks, *position, quality, ns]
    table += [signed_roots(fixes.cov_ned), age, ratios]
    head, form = POS_HEAD, FORM.format(digits)
    if fixes.velocity_ned is not None and fixes.velocity_cov_ned is not None:
        head, form = head + VELOCITY_HEAD, form + FORM_OF_VELOCITY
        table += [fixes.velocity_ned @ DOWN_FROM_UP, signed_roots(fixes.velocity_cov_ned)]
    lines = (f"% {line}\n" for line in comments)
    rows = format_rows(form + "\n", np.column_stack(table))
    atomic_write(path, [*lines, LEGEND, head + "\n", *rows])


def antenna_fixes(
    source: Trajectory | FramedOrientation, lever_m: str | Sequence[float] | Array
) -> GnssFixes:
    """Compute positions of the antenna and their covariances (A.1).

    Parameters
    ----------
    source : Trajectory or FramedOrientation
        Where the lever arm starts.
    lever_m : (3,) m, or text with commas
        Of a trajectory from the IMU to the antenna in body axes (`Mounting.antenna_lever_b`), of
        images from the projection centre to the antenna in camera axes (`Mounting.antenna_m`).

    Returns
    -------
    GnssFixes
        The positions.

    Raises
    ------
    UsageError
        `lever_m` is not three numbers.
    """
    lever = vector(lever_m, "lever_m")
    if isinstance(source, Trajectory):
        lat, lon, h = source.lat, source.lon, source.height
        C, P = source.C_nb, source.cov[:, POSITION_VELOCITY[:, None], POSITION_VELOCITY]
    else:
        lat, lon, h = source.geodetic.T
        turn = np.kron(np.eye(2), NED_ENU)
        C, P = NED_ENU @ source.C_Ec, turn @ local_covariance(source) @ turn.T
    arm = C @ lever
    J = np.concatenate([np.broadcast_to(np.eye(3), C.shape), -skew(arm)], axis=2)
    r = geodetic_to_ecef(lat, lon, h) + (rotation_en(lat, lon) @ arm[:, :, None])[:, :, 0]
    return GnssFixes(
        source.time, *ecef_to_geodetic(r), J @ P @ J.swapaxes(1, 2), gps_week=source.gps_week
    )


def write_antenna_pos(
    source: Trajectory | FramedOrientation,
    path: Source,
    lever_m: str | Sequence[float] | Array | None = None,
    quality: int = 1,
) -> None:
    """Write week, time of week with 6 decimals, degrees with 10, metres with 4, roots with 6.

    Parameters
    ----------
    source : Trajectory or FramedOrientation
        Where the lever arm starts.
    path : path
        The file.
    lever_m : (3,) m, or text with commas
        As in `antenna_fixes`.
    quality : int
        RTKLIB's Q of every row, 1 to 6.

    Raises
    ------
    UsageError
        No lever arm, or another quality.
    """
    if lever_m is None:
        whence = (
            "from the camera (for a trajectory: from the IMU), such as --set"
            " lever_m=0.462,-0.001,-0.065"
        )
        raise UsageError(
            f"rtklib_pos holds antenna positions; give the lever arm to the antenna {whence}"
        )
    if quality not in CODES:
        raise UsageError(
            f"quality {quality!r} is none of RTKLIB's (1 fix, 2 float, 3 sbas, 4 dgps, 5 single, 6"
            " ppp)"
        )
    fixes = antenna_fixes(source, lever_m)
    fixes = replace(fixes, quality=np.full(fixes.time.size, quality))
    comments = (
        "program   : insgnss",
        f"antenna positions of the smoothed inertial solution; Q is {quality} throughout, ns, age"
        " and ratio are not known",
    )
    write_rtklib_pos(fixes, path, comments=comments, digits=13)
