"""The state at the first epoch, from which the flight is filtered.

The coarse attitude of a manoeuvre (`coarse`) starts the filter at the end of its window, backwards in time, to the first epoch. There
it stands with everything that the data up to the manoeuvre say, on the ground too: levelled by the accelerometers, its heading
carried back from the first turn.

The motion read backwards in time obeys the same equations with the velocity, the Earth's rotation, the gyro rates and their errors
of the other sign and the specific force as it is (substitute t -> -t in S.1), and the IMU error processes are reversible, so the
very same kernels do it.

The result serves only as the point to linearise about. Its covariance is widened (`WIDEN` times in sigma), since the forward
filter sees the same data again: what remains of the double use is one part in WIDEN^2 of the information.
"""

from dataclasses import replace

import numpy as np

from ..geodesy.rotation import quaternion_from_rotation, rotation_from_quaternion, rotation_from_rpy, rotation_from_vector
from ..navigation.filter import Problem, Start, make_store, run_filter
from ..navigation.layout import BIAS, DRIFT, PSI, VEL
from ..records import Array, Increments
from .coarse import CoarseAttitude, coarse_attitude

WIDEN = 10.0
FLOOR_RAD = np.radians([0.5, 0.5, 1.0])  # of the starting tilt and heading
CEILING_RAD = np.radians([10.0, 10.0, 60.0])
BACKWARD_FIX_S = 0.5  # spacing of the fixes that the backward run uses


def initial_state(problem: Problem) -> tuple[Start, CoarseAttitude]:
    """Start of the forward filter at the first epoch, and the manoeuvre that gave its attitude.

    Raises DataError where the data do not give a heading.
    """
    coarse = coarse_attitude(problem)
    nav, x, P = _run_back(problem, coarse)
    att = WIDEN**2 * P[6:9, 6:9] + np.diag(FLOOR_RAD**2)
    shrink = np.minimum(1.0, CEILING_RAD / np.sqrt(np.diag(att)))
    return _start(problem, nav, att * np.outer(shrink, shrink), x), coarse


def given_attitude(problem: Problem, rpy: Array, sigma: Array) -> Start:
    """Start from roll, pitch, heading (3,) rad at the first epoch with standard deviations (3,) rad."""
    nav = np.zeros(10)
    C_ln = problem.frame.C_ln_at(problem.epochs.position[0])
    C_lb = C_ln @ rotation_from_rpy(rpy)
    nav[:3] = problem.epochs.position[0] - C_lb @ problem.antenna_lever_b
    nav[3:6] = _first_velocity(problem)
    nav[6:] = quaternion_from_rotation(C_lb)
    # roll and pitch sigmas are about body axes turned by the heading; the larger one serves both
    tilt = float(np.max(np.asarray(sigma)[:2]))
    return _start(problem, nav, np.diag([tilt**2, tilt**2, float(sigma[2]) ** 2]))


def _start(problem: Problem, nav: Array, att: Array, x: Array | None = None) -> Start:
    """Wide position and velocity, the given attitude covariance (3, 3), IMU states as the noise model has them.

    x (ns,): IMU states to linearise about; their a-priori mean is zero in any case.
    """
    P = np.zeros((problem.layout.size, problem.layout.size))
    spread = np.sqrt(np.trace(problem.epochs.position_cov[0]))
    P[:3, :3] = np.eye(3) * max(10.0, 10.0 * spread) ** 2
    P[3:6, 3:6] = np.eye(3) * max(5.0, 2.0 * spread) ** 2
    P[6:9, 6:9] = att
    P[9:, 9:] = np.diag(problem.layout.sigma0**2)
    nominal = np.zeros(problem.layout.size - 9) if x is None else x
    return Start(nav, nominal, np.concatenate([np.zeros(9), -nominal]), P)


def _first_velocity(problem: Problem) -> Array:
    """Velocity at the first epoch from the fixes of the first two seconds, (3,) m/s."""
    ep = problem.epochs
    at = np.flatnonzero(ep.has_position)
    if ep.has_velocity[at[0]]:
        return ep.velocity[at[0]]
    at = at[: max(2, int(np.searchsorted(ep.time[at], ep.time[at[0]] + 2.0)))]
    A = np.column_stack([np.ones(at.size), ep.time[at]])
    return np.linalg.lstsq(A, ep.position[at], rcond=None)[0][1]


def _run_back(problem: Problem, coarse: CoarseAttitude) -> tuple[Array, Array, Array]:
    """Filter from the coarse attitude back to the first epoch: nav (10,), x (ns,) and covariance there, in forward signs."""
    back = _reversed(problem, coarse.last)
    nav = np.zeros(10)
    nav[:3] = problem.epochs.position[coarse.last] - coarse.C_lb @ problem.antenna_lever_b
    nav[3:6] = -coarse.velocity
    nav[6:] = quaternion_from_rotation(coarse.C_lb)
    start = _start(problem, nav, 4.0 * coarse.cov)
    store = make_store(back.epochs, back.layout)
    run_filter(back, start, store)
    end, x, P = store.nav[-1].copy(), store.x[-1].copy(), store.P[-1]
    if store.m[-1].any():  # still held back
        x += store.m[-1, 9:]
        end[:6] += store.m[-1, :6]
        end[6:] = quaternion_from_rotation(rotation_from_vector(store.m[-1, PSI]) @ rotation_from_quaternion(end[6:]))
    end[VEL] *= -1.0
    layout = problem.layout
    x[(layout.channel < 3) & (layout.factor == BIAS)] *= -1.0
    x[layout.factor == DRIFT] = 0.0
    return end, x, P


def _reversed(problem: Problem, last: int) -> Problem:
    """The problem from epoch `last` back to the first, with time running the other way and the fixes thinned."""
    ep, inc = problem.epochs, problem.inc
    wanted = [last]
    for e in range(last - 1, -1, -1):
        if ep.has_position[e] and ep.time[wanted[-1]] - ep.time[e] >= BACKWARD_FIX_S:
            wanted.append(e)
    if wanted[-1] != 0:
        wanted.append(0)
    at = np.array(wanted)
    total = int(ep.stop[last])
    segments = Increments(
        np.ascontiguousarray(inc.dt[:total][::-1]),
        np.ascontiguousarray(-inc.dtheta[:total][::-1]),
        np.ascontiguousarray(inc.dvel[:total][::-1]),
        -inc.marks[at],
        total - ep.stop[at],
        -inc.rate[at],
        inc.nominal_s,
        inc.gaps,
    )
    epochs = ep._replace(
        stop=segments.stop,
        time=ep.time[last] - ep.time[at],
        has_position=ep.has_position[at],
        position=ep.position[at],
        position_cov=ep.position_cov[at],
        has_velocity=ep.has_velocity[at],
        velocity=-ep.velocity[at],
        velocity_cov=ep.velocity_cov[at],
        rate=segments.rate,
        event=np.full(at.size, -1, dtype=np.int64),
    )
    return replace(problem, inc=segments, epochs=epochs, backward=True, aiding_interval_s=BACKWARD_FIX_S)

