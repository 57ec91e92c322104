"""The measurements (K.8-K.10, K.12, K.13) beside those of the antenna, and all of them by kind."""

from ....base.compilation import njit
from ....geodesy._kernels import height_ecef, quat_to_matrix
from ..codes import (
    ABOUT_BIAS,
    ABOUT_STATES,
    AX,
    AY,
    AZ,
    BAROMETER_ROW,
    IMU0,
    N_KINDS,
    N_NAV,
    NO_CONSTRAINT,
    OF_BIAS,
    OF_STATES,
    POSITION_ROW,
    PX,
    PY,
    PZ,
    QUAT,
    VEL0,
    VELOCITY_CODE,
    VELOCITY_CONSTRAINT,
    VELOCITY_ROW,
    VX,
    VY,
    VZ,
    ZARU,
    ZUPT,
)
from .antenna import body_rate, position_rows, velocity_rows
from .copies import copy_matrix
from .update import state_difference


@njit(cache=True, allocates=False)
def zupt_rows(nav, triple):
    """Fill the triple with a zero-velocity update, ZUPT (K.8): the velocity is zero.

    Parameters
    ----------
    nav : ndarray
        (10,) nominal position (m) and velocity (m/s) in l, quaternion q_lb (w, x, y, z).
    triple : Triple
        The measurement, filled in place.
    """
    H, nu = triple.H, triple.nu
    H[:] = 0.0
    for r in range(3):
        nu[r, 0] = -nav[VEL0 + r]
        H[r, VEL0 + r] = 1.0


@njit(cache=True, allocates=False)
def nhc_rows(nav, triple):
    """Fill the triple with the non-holonomic constraint, NHC (K.9); its row 0 stays empty.

    There is no velocity across the forward axis.

    Parameters
    ----------
    nav : ndarray
        (10,) nominal position (m) and velocity (m/s) in l, quaternion q_lb (w, x, y, z).
    triple : Triple
        The measurement, filled in place.
    """
    C, H, nu = triple.C_lb, triple.H, triple.nu
    quat_to_matrix(nav[QUAT], C)
    H[:] = 0.0
    nu[0, 0] = 0.0
    v0, v1, v2 = nav[VX], nav[VY], nav[VZ]
    for r in range(1, 3):
        c0, c1, c2 = C[0, r], C[1, r], C[2, r]
        nu[r, 0] = -(c0 * v0 + c1 * v1 + c2 * v2)
        H[r, VX], H[r, VY], H[r, VZ] = c0, c1, c2
        H[r, AX] = c1 * v2 - c2 * v1
        H[r, AY] = c2 * v0 - c0 * v2
        H[r, AZ] = c0 * v1 - c1 * v0


@njit(cache=True, allocates=False)
def zaru_rows(model, earth, triple):
    """Fill the triple with a zero angular rate update, ZARU (K.10): the body does not turn.

    The triple's omega and gain are those of the mean rate over the stationary period, as
    `body_rate` leaves them.

    Parameters
    ----------
    model : StateModel
        The error states behind those of navigation.
    earth : Earth
        The local frame l.
    triple : Triple
        The measurement, filled in place.
    """
    C, H, nu = triple.C_lb, triple.H, triple.nu
    H[:] = 0.0
    o = earth.rate_l
    for r in range(3):
        nu[r, 0] = triple.omega[r]
        c0, c1, c2 = C[0, r], C[1, r], C[2, r]
        H[r, AX] = c1 * o[2] - c2 * o[1]
        H[r, AY] = c2 * o[0] - c0 * o[2]
        H[r, AZ] = c0 * o[1] - c1 * o[0]
    for s in range(model.channel.size):
        if triple.gain[s] != 0.0:
            H[model.channel[s], IMU0 + s] = triple.gain[s]


@njit(cache=True, allocates=False)
def barometer_rows(nav, x, model, earth, z, triple):
    """Fill the triple with a barometer's height (K.12); its rows 1 and 2 stay empty.

    Parameters
    ----------
    nav : ndarray
        (10,) nominal position (m) and velocity (m/s) in l, quaternion q_lb (w, x, y, z).
    x : ndarray
        (ns,) nominal values of the other states.
    model : StateModel
        The error states behind those of navigation.
    earth : Earth
        The local frame l.
    z : float
        Measured height above the origin of l, m.
    triple : Triple
        The measurement, filled in place.
    """
    H, nu, up = triple.H, triple.nu, triple.omega
    C, o = earth.C_el, earth.origin_ecef
    above = -height_ecef(o[0], o[1], o[2], up)
    p0, p1, p2 = nav[PX], nav[PY], nav[PZ]
    above += height_ecef(
        o[0] + C[0, 0] * p0 + C[0, 1] * p1 + C[0, 2] * p2,
        o[1] + C[1, 0] * p0 + C[1, 1] * p1 + C[1, 2] * p2,
        o[2] + C[2, 0] * p0 + C[2, 1] * p1 + C[2, 2] * p2,
        up,
    )
    gain = 1.0 + x[model.barometer + 1]
    H[:] = 0.0
    for i in range(3):
        H[0, i] = gain * (C[0, i] * up[0] + C[1, i] * up[1] + C[2, i] * up[2])
    H[0, IMU0 + model.barometer] = 1.0
    H[0, IMU0 + model.barometer + 1] = above
    nu[0, 0] = z - x[model.barometer] - gain * above
    nu[1, 0] = nu[2, 0] = 0.0


@njit(cache=True, allocates=False)
def linearised_rows(nav, x, e, number, epochs, model, earth, triple):
    """Fill the triple with a linearised measurement (K.13).

    Parameters
    ----------
    nav : ndarray
        (10,) nominal position (m) and velocity (m/s) in l, quaternion q_lb (w, x, y, z).
    x : ndarray
        (ns,) nominal values of the other states; those of the measurements come last.
    e, number : int
        The epoch, and which of the linearised measurements it is.
    epochs : Epochs
        The m epochs of the filter.
    model : StateModel
        The error states behind those of navigation.
    earth : Earth
        The local frame l.
    triple : Triple
        The measurement, filled in place.
    """
    body_rate(nav, x, epochs, e, epochs.rate[e], model, earth, triple)
    about, of = epochs.linear_about[e], epochs.linear_H[e, number]
    gain, d, H, nu = triple.gain, triple.difference, triple.H, triple.nu
    first = x.size - (about.size - ABOUT_STATES)
    state_difference(nav, x[:0], about, x[:0], d)
    for c in range(3):
        d[OF_BIAS + c] = -about[ABOUT_BIAS + c]
    H[:] = 0.0
    for s in range(first):
        if gain[s] != 0.0:
            d[OF_BIAS + model.channel[s]] += gain[s] * x[s]
            for r in range(3):
                H[r, IMU0 + s] = gain[s] * of[r, OF_BIAS + model.channel[s]]
    for s in range(first, x.size):
        d[OF_STATES + s - first] = x[s] - about[ABOUT_STATES + s - first]
        for r in range(3):
            H[r, IMU0 + s] = of[r, OF_STATES + s - first]
    for r in range(3):
        t = epochs.linear_residual[e, number, r]
        for c in range(of.shape[1]):
            t -= of[r, c] * d[c]
        nu[r, 0] = t
        for c in range(N_NAV):
            H[r, c] = of[r, c]


@njit(cache=True, allocates=False)
def take_scaled(cov, factor, R):
    """Copy a covariance, scaled.

    Parameters
    ----------
    cov : ndarray
        (3, 3) the covariance.
    factor : ndarray
        (3,) of its standard deviations.
    R : ndarray
        (3, 3) the scaled one, filled in place.
    """
    for i in range(3):
        for j in range(3):
            R[i, j] = cov[i, j] * (factor[i] * factor[j])


@njit(cache=True, allocates=False)
def measured_triple(kind, e, epochs, nav, x, lever_b, acceleration, model, earth, triple):
    """Fill the triple with what an epoch measures of one kind.

    Parameters
    ----------
    kind : int
        POSITION_ROW, VELOCITY_ROW, VELOCITY_CONSTRAINT, ZARU, BAROMETER_ROW, or N_KINDS and more.
    e : int
        The epoch.
    epochs : Epochs
        The m epochs of the filter.
    nav : ndarray
        (10,) nominal position (m) and velocity (m/s) in l, quaternion q_lb (w, x, y, z).
    x : ndarray
        (ns,) nominal values of the other states.
    lever_b : ndarray
        (3,) from the IMU to the antenna's phase centre, body axes, m.
    acceleration : ndarray
        (3,) acceleration of the IMU in l, m/s^2.
    model : StateModel
        The error states behind those of navigation.
    earth : Earth
        The local frame l.
    triple : Triple
        The measurement, filled in place.

    Returns
    -------
    bool
        Whether the epoch measures this kind.
    """
    R = triple.R
    if kind == POSITION_ROW:
        if not epochs.has_position[e]:
            return False
        if model.offset >= 0:
            body_rate(nav, x, epochs, e, epochs.rate[e], model, earth, triple)
        group = epochs.group[e]
        z, sigma = epochs.position[e], epochs.sigma[e]
        position_rows(nav, x, epochs.time[e], lever_b, model, acceleration, z, sigma, group, triple)
        take_scaled(epochs.position_cov[e], model.white_scale[group], R)
    elif kind == VELOCITY_ROW:
        if not epochs.has_velocity[e]:
            return False
        body_rate(nav, x, epochs, e, epochs.rate[e], model, earth, triple)
        velocity_rows(
            nav, x, epochs.time[e], lever_b, model, acceleration, epochs.velocity[e], triple
        )
        take_scaled(epochs.velocity_cov[e], model.white_scale[VELOCITY_CODE], R)
    elif kind == VELOCITY_CONSTRAINT:
        if epochs.constraint[e] == NO_CONSTRAINT:
            return False
        if epochs.constraint[e] == ZUPT:
            zupt_rows(nav, triple)
        else:
            nhc_rows(nav, triple)
        copy_matrix(epochs.constraint_cov[e], R)
    elif kind == ZARU:
        if epochs.zaru_variance[e] == 0.0:
            return False
        body_rate(nav, x, epochs, e, epochs.zaru_rate[e], model, earth, triple)
        zaru_rows(model, earth, triple)
        R[:] = 0.0
        for i in range(3):
            R[i, i] = epochs.zaru_variance[e]
    elif kind == BAROMETER_ROW:
        if epochs.barometer_variance[e] == 0.0:
            return False
        barometer_rows(nav, x, model, earth, epochs.barometer_height[e], triple)
        R[:] = 0.0
        R[0, 0] = epochs.barometer_variance[e]
        R[1, 1] = R[2, 2] = 1.0
    else:
        if epochs.linear_cov[e, kind - N_KINDS, 0, 0] == 0.0:
            return False
        linearised_rows(nav, x, e, kind - N_KINDS, epochs, model, earth, triple)
        copy_matrix(epochs.linear_cov[e, kind - N_KINDS], R)
    return True
