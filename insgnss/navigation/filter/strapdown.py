"""Strapdown mechanization in the local frame l.

l is Cartesian and Earth-fixed (`insgnss.geodesy.frames.LocalFrame`). Its axes do not follow the
vehicle, so there is no transport rate to integrate and no singularity at the poles; what the
transport rate does in a north-east-down mechanization is done here exactly, by rotating the result
into the axes at the point (`C_nl`). With Omega the Earth's rotation in l and g gravity (gravitation
and centrifugal part) at the position:

    dp/dt = v,   dv/dt = C_lb f - 2 Omega x v + g(p)
    dC_lb/dt = C_lb [omega_ib x] - [Omega x] C_lb                                             (S.1)

Over an integration interval of length h with rotation vector phi and velocity increment u
(`navigation.prepare.increments`, bias taken off):

    q_lb <- q(-Omega h) q_lb q(phi)                                                           (S.2)
    u_b  = u + phi x u / 2 + phi x (phi x u) / 6 + phi x (phi x (phi x u)) / 24
           in the axes of the interval's start                                                (S.3)
    u_l  = (1 - [Omega x] h / 2) C_lb u_b                                                     (S.4)
    v    <- v + u_l + h (g(p + v h / 2) - 2 Omega x (v + (u_l + g h) / 2))                    (S.5)
    p    <- p + h (v_before + v_after) / 2                                                    (S.6)

Gravity is evaluated exactly at the start of every block (at most 50 ms) and continued by its
gradient, without the part of it that comes with latitude (8e-9 m/s^2 a metre): below 1e-8 m/s^2
over the metre of a block.

Unaided, the vertical is unstable: gravity decreases with height, so that an error in height feeds
itself and grows as cosh(t sqrt(2 g / R)), e-fold in 570 s and 57-fold in 45 minutes. The 0.85 mm
that an error-free 45-minute flight at 500 Hz ends with are 15 micrometres of integration error so
amplified; horizontally (bounded by Schuler's period) the same flight stays within 0.03 mm.

Savage (1998); Groves (2013) 5.2, 5.4; the term phi x (phi x u) / 6 keeps the vertical from drifting
in turns.
"""

import numpy as np

from ...geodesy.frames import LocalFrame
from ...geodesy.rotation import rotation_from_quaternion, vector_from_rotation
from ...records import Array, Increments
from .codes import N_CHANNELS, N_NOMINAL, PSI0, QUAT
from .kernels.records import Earth, IntegrationIntervals
from .kernels.strapdown import run_strapdown


def kernel_earth(frame: LocalFrame, backward: bool = False) -> Earth:
    """Return the local frame as the kernels take it.

    Parameters
    ----------
    frame : LocalFrame
        The local frame l.
    backward : bool
        Whether the recording is read against time: then the Earth turns the other way.

    Returns
    -------
    Earth
        Origin (m), axes and Earth rotation (rad/s) of l. The axes give directions of gravity and
        heights of a barometer, hence those of the plumb line.
    """
    return Earth(
        np.ascontiguousarray(frame.origin_ecef, dtype=np.float64),
        np.ascontiguousarray(frame.C_el_of_gravity, dtype=np.float64),
        np.ascontiguousarray(
            -frame.earth_rate_l if backward else frame.earth_rate_l, dtype=np.float64
        ),
    )


def kernel_intervals(inc: Increments) -> IntegrationIntervals:
    """Return the increments as the kernels take them.

    Parameters
    ----------
    inc : Increments
        Body increments between marks.

    Returns
    -------
    IntegrationIntervals
        Lengths (s), rotation vectors (rad) and velocity increments (m/s).
    """
    return IntegrationIntervals(inc.dt, inc.dtheta, inc.dvel)


def free_inertial(
    inc: Increments, frame: LocalFrame, nav0: Array, bias: Array | None = None
) -> Array:
    """Integrate from the first mark on, without any aiding.

    Parameters
    ----------
    inc : Increments
        Body increments with m marks.
    frame : LocalFrame
        The local frame l.
    nav0 : Array
        (10,) position (m), velocity (m/s) in l, quaternion q_lb (w, x, y, z) at the first mark.
    bias : Array, optional
        (6,) constant gyro (rad/s) and accelerometer (m/s^2) error to take off, in body axes.

    Returns
    -------
    Array
        (m, 10) the state at every mark.
    """
    out = np.empty((inc.marks.size, N_NOMINAL))
    b = np.zeros(N_CHANNELS) if bias is None else np.ascontiguousarray(bias, dtype=np.float64)
    start = np.ascontiguousarray(nav0, dtype=np.float64)
    run_strapdown(kernel_intervals(inc), inc.stop, start, b, kernel_earth(frame), out)
    return out


def nav_difference(a: Array, b: Array) -> Array:
    """Return the errors of nominal states b against states a, such that a = b + error.

    Parameters
    ----------
    a, b : Array
        (m, 10) position (m), velocity (m/s) in l, quaternion q_lb (w, x, y, z).

    Returns
    -------
    Array
        (m, 9) position, velocity, and psi of C(a) = exp([psi x]) C(b).
    """
    C_a, C_b = rotation_from_quaternion(a[:, QUAT]), rotation_from_quaternion(b[:, QUAT])
    psi = vector_from_rotation(C_a @ np.swapaxes(C_b, -1, -2))
    return np.hstack([a[:, :PSI0] - b[:, :PSI0], psi])
