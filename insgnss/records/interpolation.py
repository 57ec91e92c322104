"""A trajectory between its epochs, and tables between their rows.

With epochs 0 and 1, h apart, and u from 0 to 1 between them, x position and v velocity in the local
frame (axes north-east-down at epoch 0 of the trajectory), C attitude there,

    x(u) = (1 - 3u^2 + 2u^3) x_0 + (3u^2 - 2u^3) x_1
           + h (u - 2u^2 + u^3) v_0 + h (u^3 - u^2) v_1                                        (T.1)
    C(u) = exp(u log(C_1 C_0^T)) C_0                                                           (T.2)

velocity and covariance are linear in u. (T.1) is off by h^4/384 times the fourth derivative of the
path, (T.2) by h^2/8 times the angular acceleration.
"""

from dataclasses import replace
from typing import Any, TypeVar

import numpy as np

from ..base.errors import DataError
from ..geodesy.frames import LocalFrame
from ..geodesy.rotation import rotation_from_vector, vector_from_rotation
from ._checked import Array

Epochs = TypeVar("Epochs", bound=Any)
"""A `Trajectory` of `solutions`, which calls this module."""

LONGEST_BRIDGE_S = 1.0
"""Longest interval that is interpolated: IMU gaps beyond it divide a flight
(`navigation.prepare.gaps`).
"""


def interpolate_trajectory(trajectory: Epochs, time: Array, tolerance_s: float) -> Epochs:
    """Return the trajectory at `time` (k,), s, after (T.1) and (T.2).

    Parameters
    ----------
    trajectory : at least two epochs, unless every instant is that of the one.
    time : (k,) s.
    tolerance_s : by how much an instant may lie outside.

    Returns
    -------
    The trajectory at these instants.

    Raises
    ------
    DataError : an instant is outside, or between epochs more than `LONGEST_BRIDGE_S` apart.
    """
    row_before = _rows_before(trajectory, time, tolerance_s)
    row_after = np.minimum(row_before + 1, len(trajectory) - 1)
    interval_s = np.where(
        row_after > row_before, trajectory.time[row_after] - trajectory.time[row_before], 1.0
    )
    fraction = np.clip((time - trajectory.time[row_before]) / interval_s, 0.0, 1.0)
    _refuse_gaps(time, interval_s, fraction)
    geodetic = (trajectory.lat, trajectory.lon, trajectory.height)
    frame = LocalFrame(*(float(position_l[0]) for position_l in geodetic))
    C_ln = frame.C_ln(trajectory.lat, trajectory.lon)
    position_l = frame.position_from_geodetic(*geodetic)
    velocity_l = np.einsum("nij,nj->ni", C_ln, trajectory.velocity_ned)
    C_lb = C_ln @ trajectory.C_nb
    s = fraction[:, None]
    position = cubic(
        (position_l[row_before], position_l[row_after]),
        (velocity_l[row_before], velocity_l[row_after]),
        fraction,
        interval_s,
    )
    rotation_vector = vector_from_rotation(C_lb[row_after] @ np.swapaxes(C_lb[row_before], 1, 2))
    lat, lon, height = frame.geodetic_from_position(position)
    C_nl = np.swapaxes(frame.C_ln(lat, lon), 1, 2)
    velocity = np.einsum(
        "nij,nj->ni",
        C_nl,
        velocity_l[row_before] + s * (velocity_l[row_after] - velocity_l[row_before]),
    )
    cov = trajectory.cov
    return replace(
        trajectory,
        time=time,
        lat=lat,
        lon=lon,
        height=height,
        velocity_ned=velocity,
        C_nb=C_nl @ rotation_from_vector(s * rotation_vector) @ C_lb[row_before],
        cov=cov[row_before] + fraction[:, None, None] * (cov[row_after] - cov[row_before]),
        acceleration_b=None,
        rate_b=None,
        cross=None,
    )


def cubic(x: tuple[Array, Array], v: tuple[Array, Array], u: Array, h: Array) -> Array:
    """Return positions on the cubic through positions and velocities of both neighbours (T.1).

    Parameters
    ----------
    x, v : (k, 3) positions, m, and velocities, m/s, before and after, in one Cartesian frame.
    u : (k,) from 0 to 1 between them.
    h : (k,) s between them.

    Returns
    -------
    (k, 3) m.
    """
    s, hs = u[:, None], h[:, None]
    position = (1.0 - 3.0 * s**2 + 2.0 * s**3) * x[0] + (3.0 * s**2 - 2.0 * s**3) * x[1]
    position += hs * ((s - 2.0 * s**2 + s**3) * v[0] + (s**3 - s**2) * v[1])
    return np.asarray(position)


def _rows_before(trajectory: Any, time: Array, tolerance_s: float) -> np.ndarray:
    """Index of the epoch before each instant."""
    if not len(trajectory):
        raise DataError("Trajectory: it has no epochs")
    begin, end = trajectory.time[[0, -1]]
    outside = (time < begin - tolerance_s) | (time > end + tolerance_s)
    if outside.any():
        instant = time[int(np.argmax(outside))]
        raise DataError(
            f"Trajectory: {instant:.6f} s is outside {begin:.6f} to {end:.6f} s; "
            "choose instants within"
        )
    row_after = np.searchsorted(trajectory.time, time, side="right")
    return np.clip(row_after - 1, 0, max(len(trajectory) - 2, 0))


def _refuse_gaps(time: Array, h: Array, u: Array) -> None:
    gap = (h > LONGEST_BRIDGE_S) & (u > 0.0) & (u < 1.0)
    if gap.any():
        k = int(np.argmax(gap))
        raise DataError(
            f"Trajectory: {time[k]:.6f} s lies between epochs {h[k]:.3f} s apart (limit "
            f"{LONGEST_BRIDGE_S:g} s); choose instants outside of the gap, or a trajectory of a "
            "higher rate"
        )


def columns_at(time: Array, nodes: Array, values: Array) -> Array:
    """Interpolate the columns of a table linearly.

    Parameters
    ----------
    time : ndarray, (k,)
        Where.
    nodes : ndarray, (n,)
        Increasing, where the values are; beyond them the outermost hold.
    values : ndarray, (n, c)
        The table.

    Returns
    -------
    ndarray, (k, c)
        Its columns at `time`.
    """
    return np.stack([np.interp(time, nodes, column) for column in values.T], axis=1)
