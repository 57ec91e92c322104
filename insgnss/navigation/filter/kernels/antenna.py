"""The measurements (K.1, K.2) of the antenna, with the body's rate: innovation and derivative."""

from ....base.compilation import njit
from ....geodesy._kernels import quat_to_matrix
from ..codes import (
    ACCEL0,
    AIDING_ERROR,
    BIAS,
    DRIFT_CODE,
    IMU0,
    PSI0,
    PX,
    PY,
    PZ,
    QUAT,
    TEMPERATURE_CODE,
    VEL0,
    VELOCITY_CODE,
    VX,
    VY,
    VZ,
)


@njit(cache=True, allocates=False)
def antenna(nav, x, lever_b, model, triple):
    """Leave C_lb, and the lever arm with its error states, in the triple.

    Parameters
    ----------
    nav : ndarray
        (10,) nominal position (m) and velocity (m/s) in l, quaternion q_lb (w, x, y, z).
    x : ndarray
        (ns,) nominal values of the other states.
    lever_b : ndarray
        (3,) from the IMU to the antenna's phase centre, body axes, m.
    model : StateModel
        The error states behind those of navigation.
    triple : Triple
        Takes `C_lb` and `lever`.
    """
    quat_to_matrix(nav[QUAT], triple.C_lb)
    lever = triple.lever
    for i in range(3):
        lever[i] = lever_b[i]
        if model.lever >= 0:
            lever[i] += x[model.lever + i]


@njit(cache=True, allocates=False)
def fix_delay(x, elapsed, model):
    """Return by how much a fix was taken later than it is stamped (time offset).

    Parameters
    ----------
    x : ndarray
        (ns,) nominal values of the other states.
    elapsed : float
        Time since the start of the recording, s.
    model : StateModel
        The error states behind those of navigation.

    Returns
    -------
    float
        The delay, s.
    """
    d = x[model.offset]
    if model.rate >= 0:
        d += elapsed * x[model.rate]
    return d


@njit(cache=True, allocates=False)
def minus_skew(H, column, a0, a1, a2):
    """Write a skew matrix into three columns: H[:, column : column + 3] <- -[a x].

    Parameters
    ----------
    H : ndarray
        (3, n) derivative, changed in place but for the zero diagonal.
    column : int
        The first of the columns.
    a0, a1, a2 : float
        The vector a.
    """
    H[0, column + 1], H[0, column + 2] = a2, -a1
    H[1, column], H[1, column + 2] = -a2, a0
    H[2, column], H[2, column + 1] = a1, -a0


@njit(cache=True, allocates=False)
def body_rate(nav, x, epochs, e, rate, model, earth, triple):
    """Leave the body's rate against the Earth and its derivatives in the triple.

    Parameters
    ----------
    nav : ndarray
        (10,) nominal position (m) and velocity (m/s) in l, quaternion q_lb (w, x, y, z).
    x : ndarray
        (ns,) nominal values of the other states.
    epochs : Epochs
        The m epochs of the filter.
    e : int
        The epoch.
    rate : ndarray
        (3,) measured angular rate, body axes, rad/s.
    model : StateModel
        The error states behind those of navigation.
    earth : Earth
        The local frame l.
    triple : Triple
        Takes `C_lb`, `omega` and `gain`.
    """
    C, omega, gain = triple.C_lb, triple.omega, triple.gain
    quat_to_matrix(nav[QUAT], C)
    o = earth.rate_l
    for i in range(3):
        omega[i] = rate[i] - (C[0, i] * o[0] + C[1, i] * o[1] + C[2, i] * o[2])
    for s in range(model.channel.size):
        c = model.channel[s]
        f = model.factor[s]
        if c >= ACCEL0 or f == AIDING_ERROR:
            u = 0.0
        elif f == BIAS:
            u = 1.0
        elif f == DRIFT_CODE:
            u = epochs.time[e]
        elif f == TEMPERATURE_CODE:
            u = epochs.temperature[e]
        else:
            u = rate[f]
        gain[s] = u
        if u != 0.0:
            omega[c] -= x[s] * u


@njit(cache=True, allocates=False)
def position_rows(nav, x, elapsed, lever_b, model, acceleration, z, sigma, group, triple):
    """Fill the triple with the measured position of the antenna (K.1).

    Parameters
    ----------
    nav : ndarray
        (10,) nominal position (m) and velocity (m/s) in l, quaternion q_lb (w, x, y, z).
    x : ndarray
        (ns,) nominal values of the other states.
    elapsed : float
        Time since the start of the recording, s.
    lever_b : ndarray
        (3,) from the IMU to the antenna's phase centre, body axes, m.
    model : StateModel
        The error states behind those of navigation.
    acceleration : ndarray
        (3,) of the IMU in l, m/s^2; with the rate in the triple, for the velocity at the fix's own
        time.
    z : ndarray
        (3,) measured position of the antenna in l, m.
    sigma : ndarray
        (3,) unit of the fix's time-correlated errors, m.
    group : int
        FIXED_GROUP or UNFIXED_GROUP, of the fix.
    triple : Triple
        The measurement, filled in place.
    """
    antenna(nav, x, lever_b, model, triple)
    C, lever, omega, H, nu = triple.C_lb, triple.lever, triple.omega, triple.H, triple.nu
    H[:] = 0.0
    a0 = C[0, 0] * lever[0] + C[0, 1] * lever[1] + C[0, 2] * lever[2]
    a1 = C[1, 0] * lever[0] + C[1, 1] * lever[1] + C[1, 2] * lever[2]
    a2 = C[2, 0] * lever[0] + C[2, 1] * lever[1] + C[2, 2] * lever[2]
    nu[0, 0] = z[0] - nav[PX] - a0
    nu[1, 0] = z[1] - nav[PY] - a1
    nu[2, 0] = z[2] - nav[PZ] - a2
    H[0, PX] = H[1, PY] = H[2, PZ] = 1.0
    minus_skew(H, PSI0, a0, a1, a2)
    if model.lever >= 0:
        for r in range(3):
            for c in range(3):
                H[r, IMU0 + model.lever + c] = C[r, c]
    if model.offset >= 0:
        d = fix_delay(x, elapsed, model)
        l0 = omega[1] * lever[2] - omega[2] * lever[1]
        l1 = omega[2] * lever[0] - omega[0] * lever[2]
        l2 = omega[0] * lever[1] - omega[1] * lever[0]
        # what the offset adds to the position, d C (omega x l), turns with psi and grows with l
        b0 = d * (C[0, 0] * l0 + C[0, 1] * l1 + C[0, 2] * l2)
        b1 = d * (C[1, 0] * l0 + C[1, 1] * l1 + C[1, 2] * l2)
        b2 = d * (C[2, 0] * l0 + C[2, 1] * l1 + C[2, 2] * l2)
        minus_skew(H, PSI0, a0 + b0, a1 + b1, a2 + b2)
        if model.lever >= 0:
            first = IMU0 + model.lever
            for r in range(3):
                H[r, first] += d * (C[r, 1] * omega[2] - C[r, 2] * omega[1])
                H[r, first + 1] += d * (C[r, 2] * omega[0] - C[r, 0] * omega[2])
                H[r, first + 2] += d * (C[r, 0] * omega[1] - C[r, 1] * omega[0])
        for r in range(3):
            v = nav[VEL0 + r] + C[r, 0] * l0 + C[r, 1] * l1 + C[r, 2] * l2
            nu[r, 0] -= v * d + 0.5 * acceleration[r] * d * d
            H[r, VEL0 + r] = d
            H[r, IMU0 + model.offset] = v + acceleration[r] * d
            if model.rate >= 0:
                H[r, IMU0 + model.rate] = elapsed * H[r, IMU0 + model.offset]
    for of_group in range(group + 1):  # of all fixes, and of unfixed ones besides
        first = model.gm[of_group]
        if first >= 0:
            for r in range(3):
                nu[r, 0] -= sigma[r] * x[first + r]
                H[r, IMU0 + first + r] = sigma[r]


@njit(cache=True, allocates=False)
def velocity_rows(nav, x, elapsed, lever_b, model, acceleration, z, triple):
    """Fill the triple with the measured velocity of the antenna (K.2).

    The triple's omega and gain are those that `body_rate` leaves.

    Parameters
    ----------
    nav : ndarray
        (10,) nominal position (m) and velocity (m/s) in l, quaternion q_lb (w, x, y, z).
    x : ndarray
        (ns,) nominal values of the other states.
    elapsed : float
        Time since the start of the recording, s.
    lever_b : ndarray
        (3,) from the IMU to the antenna's phase centre, body axes, m.
    model : StateModel
        The error states behind those of navigation.
    acceleration : ndarray
        (3,) acceleration of the IMU in l, m/s^2.
    z : ndarray
        (3,) measured velocity of the antenna in l, m/s.
    triple : Triple
        The measurement, filled in place.
    """
    antenna(nav, x, lever_b, model, triple)
    C, lever, omega, H, nu = triple.C_lb, triple.lever, triple.omega, triple.H, triple.nu
    H[:] = 0.0
    for s in range(model.channel.size):
        u = triple.gain[s]
        if u == 0.0:
            continue
        c = model.channel[s]
        if c == 0:
            e0, e1, e2 = 0.0, -lever[2], lever[1]
        elif c == 1:
            e0, e1, e2 = lever[2], 0.0, -lever[0]
        else:
            e0, e1, e2 = -lever[1], lever[0], 0.0
        for r in range(3):
            H[r, IMU0 + s] = -u * (C[r, 0] * e0 + C[r, 1] * e1 + C[r, 2] * e2)
    l0 = omega[1] * lever[2] - omega[2] * lever[1]
    l1 = omega[2] * lever[0] - omega[0] * lever[2]
    l2 = omega[0] * lever[1] - omega[1] * lever[0]
    a0 = C[0, 0] * l0 + C[0, 1] * l1 + C[0, 2] * l2
    a1 = C[1, 0] * l0 + C[1, 1] * l1 + C[1, 2] * l2
    a2 = C[2, 0] * l0 + C[2, 1] * l1 + C[2, 2] * l2
    nu[0, 0] = z[0] - nav[VX] - a0
    nu[1, 0] = z[1] - nav[VY] - a1
    nu[2, 0] = z[2] - nav[VZ] - a2
    H[0, VX] = H[1, VY] = H[2, VZ] = 1.0
    minus_skew(H, PSI0, a0, a1, a2)
    if model.lever >= 0:
        first = IMU0 + model.lever
        for r in range(3):
            H[r, first] = C[r, 1] * omega[2] - C[r, 2] * omega[1]
            H[r, first + 1] = C[r, 2] * omega[0] - C[r, 0] * omega[2]
            H[r, first + 2] = C[r, 0] * omega[1] - C[r, 1] * omega[0]
    if model.offset >= 0:
        for r in range(3):
            nu[r, 0] -= acceleration[r] * fix_delay(x, elapsed, model)
            H[r, IMU0 + model.offset] = acceleration[r]
            if model.rate >= 0:
                H[r, IMU0 + model.rate] = elapsed * acceleration[r]
    first = model.gm[VELOCITY_CODE]
    if first >= 0:
        for r in range(3):
            nu[r, 0] -= x[first + r]
            H[r, IMU0 + first + r] = 1.0
