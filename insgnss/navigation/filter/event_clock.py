"""The trajectory at camera events that were stamped by the clock of the fixes.

A fix stamped t was taken at t + d in the IMU's clock, d = o + r (t - t0) with the states o, the
time offset, and r, the clock rate (-1 without: r = 0). So was an event that the receiver stamped.
Its epoch stands at t, and its pose is that at t + d, with specific force f and turn rate omega of
the samples over [t, t + d], less bias, in the axes of l, and g gravity:

    v' = v + a d,    p' = p + v d + a d^2 / 2,    C' = exp([omega d x]) C
    a  = f + g - 2 Omega x v                                                                  (X.1)

Errors e = (dp, dv, psi) at t and c = (do, dr) of the states, g_t = (1, t - t0), make the errors

    e' = A e + u g_t c,    u = (v', a, omega)
    A  = [ 1  d  -[f x] d^2 / 2 ;  0  1  -[f x] d ;  0  0  1 ]                                 (X.2)

psi stands on the left of C and omega is a rate in body axes, hence the third row. What biases move
within d is left out: 1e-4 rad/s of the gyros make 5e-7 rad in 5 ms. With o and r constants, the
same for all events,

    cov(e'_j, e'_k) = A_j cov(e_j, e_k) A_k' + A_j cov(e_j, c) (u_k g_k)'
                     + u_j g_j cov(c, e_k) A_k' + u_j g_j cov(c, c) (u_k g_k)'                (X.3)

for j = k the covariance of an event, with cov(e_j, c) of the epoch of j and cov(e_k, c) of that of
k. The fixes say p + v d, so that the smoother leaves dp and v do of one size and opposite sign: the
middle terms take off what the last one adds. A latency that fixes and events share moves no image.
"""

from dataclasses import replace

import numpy as np

from ...geodesy.earth import normal_gravity
from ...geodesy.rotation import (
    quaternion_from_rotation,
    rotation_from_quaternion,
    rotation_from_vector,
    skew,
)
from ...records import Array, Trajectory
from .codes import N_NAV, POS, PSI, QUAT, VEL
from .problem import channel_biases
from .solution import Solution
from .trajectory import local_trajectory, trajectory


def event_delay(solution: Solution) -> Array:
    """Return how much later than stamped events of the clock of the fixes were.

    Parameters
    ----------
    solution : Solution
        The smoothed flight.

    Returns
    -------
    Array
        (events,) d of each event, s; zeros where no time offset is among the states.
    """
    return _delay(solution, solution.problem.epochs.time[solution.event_epochs])


def delay_at(solution: Solution, time: Array) -> Array:
    """Return how much later than its stamp a fix of the clock of the fixes was taken.

    Parameters
    ----------
    solution : Solution
        The smoothed flight.
    time : Array
        (n,) instants on the clock of the solution, s.

    Returns
    -------
    Array
        (n,) d, s; zeros where no time offset is among the states.
    """
    return _delay(solution, time - solution.time[0] + solution.problem.epochs.time[0])


def _delay(solution: Solution, elapsed: Array) -> Array:
    """Return d at instants of the problem's own time, s."""
    if solution.problem.layout.offset < 0:
        return np.zeros(elapsed.size)
    constants = solution.x[-1, _states(solution) - N_NAV]  # as the last epoch has them
    return np.asarray(_of_constants(solution, elapsed) @ constants)


def receiver_events(solution: Solution, gps_week: int) -> Trajectory:
    """Return the trajectory at camera events that the clock of the fixes stamped (X.1 to X.3).

    Parameters
    ----------
    solution : Solution
        The smoothed flight, whose events stand at the epochs of their stamps.
    gps_week : int
        The week that its times belong to.

    Returns
    -------
    Trajectory
        At the instants t + d of the events in the IMU's clock, with the cross-covariances of
        neighbours; body rates are those at the stamps.
    """
    layout, index = solution.problem.layout, solution.event_epochs
    if layout.offset < 0 or not index.size:
        return trajectory(solution, index, gps_week, events=True)
    d = event_delay(solution)
    nav, A, u = _move_in_time(solution, index, d)
    U = u[:, :, None] * _of_constants(solution, solution.problem.epochs.time[index])[:, None, :]
    states = _states(solution)
    P = solution.covariance(index, np.concatenate([np.arange(N_NAV), states]))
    to_clock, of_clock = P[:, :N_NAV, N_NAV:], P[:, N_NAV:, N_NAV:]
    cov = _propagate_to_events(A, U, P[:, :N_NAV, :N_NAV], to_clock, to_clock, of_clock, A, U)
    cross = _propagate_to_events(
        *(A[:-1], U[:-1], solution.event_cross[1:]),
        *(to_clock[:-1], to_clock[1:], of_clock[1:], A[1:], U[1:]),
    )
    time = solution.time[index] + d
    return local_trajectory(solution, index, time, nav, cov, cross, gps_week)


def at_uncertain_times(exposed: Trajectory, sigma_s: Array) -> Trajectory:
    """Return a trajectory whose instants are uncertain, each by itself.

    Parameters
    ----------
    exposed : Trajectory
        At the exposures.
    sigma_s : Array
        (n,) standard deviations of their times, s.

    Returns
    -------
    Trajectory
        With the covariance of what an error of the time makes of position and attitude, u of (X.2)
        with velocity and turn rate; cross-covariances of neighbours stay.
    """
    u = np.zeros((sigma_s.size, N_NAV))
    u[:, POS] = exposed.velocity_ned
    if exposed.rate_b is not None:
        u[:, PSI] = np.einsum("nij,nj->ni", exposed.C_nb, exposed.rate_b)
    added = u[:, :, None] * u[:, None, :] * sigma_s[:, None, None] ** 2
    return replace(exposed, cov=exposed.cov + added)


def event_derivatives(
    solution: Solution, of_receiver: bool, events: slice | np.ndarray = slice(None)
) -> Array:
    """Return what the errors of all states at the epoch of an event make of its navigation errors.

    Parameters
    ----------
    solution : Solution
        The smoothed flight.
    of_receiver : bool
        Whether the clock of the fixes stamped the events, so that they are moved (X.2).
    events : slice or ndarray
        The events; all where it is left out.

    Returns
    -------
    Array
        (events, 9, n): the errors, in axes north, east, down at the point, of what `trajectory` or
        `receiver_events` gives, by the errors of the n states in l.
    """
    frame, index = solution.problem.frame, solution.event_epochs[events]
    nav, T = solution.nav[index], np.zeros((index.size, N_NAV, solution.problem.layout.size))
    T[:, :, :N_NAV] = np.eye(N_NAV)
    if of_receiver and solution.problem.layout.offset >= 0 and index.size:
        nav, A, u = _move_in_time(solution, index, event_delay(solution)[events])
        T[:, :, :N_NAV] = A
        g = _of_constants(solution, solution.problem.epochs.time[index])
        T[:, :, _states(solution)] = u[:, :, None] * g[:, None, :]
    lat, lon, _ = frame.geodetic_from_position(nav[:, POS])
    C_nl = np.swapaxes(frame.C_ln(lat, lon), -1, -2)
    for block in (POS, VEL, PSI):
        T[:, block] = C_nl @ T[:, block]
    return T


def _states(solution: Solution) -> np.ndarray:
    """Rows of offset and, where there is one, rate among all states."""
    layout = solution.problem.layout
    return N_NAV + np.array([s for s in (layout.offset, layout.rate) if s >= 0])


def _of_constants(solution: Solution, elapsed: Array) -> Array:
    """g_t of (X.2), (k, 1 or 2), at instants of the problem's own time."""
    return np.column_stack([np.ones(elapsed.size), elapsed])[:, : _states(solution).size]


def _move_in_time(solution: Solution, index: np.ndarray, d: Array) -> tuple[Array, Array, Array]:
    """States (k, 10) at t + d (X.1), A (k, 9, 9) and u (k, 9) of (X.2)."""
    frame, nav = solution.problem.frame, solution.nav[index].copy()
    C_lb, v = rotation_from_quaternion(nav[:, QUAT]), nav[:, VEL].copy()
    rate, force = _means(solution, index, d)
    Omega = frame.earth_rate_l
    omega = np.einsum("nij,nj->ni", C_lb, rate) - Omega
    f = np.einsum("nij,nj->ni", C_lb, force)
    lat, lon, height = frame.geodetic_from_position(nav[:, POS])
    gravity = frame.C_ln(lat, lon)[:, :, 2] * normal_gravity(lat, height)[:, None]
    a = f + gravity - 2.0 * np.cross(Omega, v)
    step = d[:, None]
    nav[:, POS] += v * step + 0.5 * a * step**2
    nav[:, VEL] += a * step
    nav[:, QUAT] = quaternion_from_rotation(rotation_from_vector(omega * step) @ C_lb)
    A = np.tile(np.eye(N_NAV), (index.size, 1, 1))
    A[:, POS, VEL] = d[:, None, None] * np.eye(3)
    A[:, POS, PSI] = -0.5 * d[:, None, None] ** 2 * skew(f)
    A[:, VEL, PSI] = -d[:, None, None] * skew(f)
    return nav, A, np.hstack([nav[:, VEL], a, omega])


def _means(solution: Solution, index: np.ndarray, d: Array) -> tuple[Array, Array]:
    """Mean rate and specific force (k, 3) over [t, t + d], or one sample where d is shorter."""
    inc = solution.problem.inc
    bounds = np.concatenate([[0.0], np.cumsum(inc.dt)])
    length = np.maximum(np.abs(d), inc.nominal_s)
    stamp = bounds[inc.stop[index]]
    begin = np.clip(np.where(d < 0.0, stamp - length, stamp), 0.0, bounds[-1] - length)
    end = begin + length
    first = np.searchsorted(bounds, begin, side="right") - 1
    wide = int((np.searchsorted(bounds, end) - first).max(initial=0))
    near = first[:, None] + np.arange(wide)
    beyond = near >= inc.dt.size
    near = np.where(beyond, 0, near)
    within = np.minimum(end[:, None], bounds[near + 1]) - np.maximum(begin[:, None], bounds[near])
    share = np.where(beyond, 0.0, np.maximum(within, 0.0)) / inc.dt[near] / length[:, None]
    mean = np.hstack(
        [np.einsum("kw,kwi->ki", share, values[near]) for values in (inc.dtheta, inc.dvel)]
    )
    mean -= channel_biases(solution.problem, solution.x[index], index)
    return mean[:, :3], mean[:, 3:]


def _propagate_to_events(
    A_j: Array,
    U_j: Array,
    cov: Array,
    to_clock_j: Array,
    to_clock_k: Array,
    of_clock: Array,
    A_k: Array,
    U_k: Array,
) -> Array:
    """Covariances (n, 9, 9) of (X.3) from cov(e_j, e_k), cov(e_j, c), cov(e_k, c), cov(c, c)."""
    A_k_t, U_k_t = np.swapaxes(A_k, -1, -2), np.swapaxes(U_k, -1, -2)
    from_clock = np.swapaxes(to_clock_k, -1, -2)
    moved: Array = (A_j @ cov + U_j @ from_clock) @ A_k_t
    moved += (A_j @ to_clock_j + U_j @ of_clock) @ U_k_t
    return moved
