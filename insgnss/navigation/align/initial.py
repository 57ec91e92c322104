"""The state at the first epoch, from which the flight is filtered.

1. A coarse attitude: of a stationary period, where the gyros are good enough for gyrocompassing
   (`standing`), or of a manoeuvre (`coarse`), good to some degrees. Where a window rejects its
   fixes it is solved again with doubtful ones weighed down.
2. The minute around it is estimated as a small flight of its own by filter and smoother, linearised
   again until it stands (a batch least-squares solution with all IMU states). Of the candidates the
   earliest that knows its heading to two degrees is taken.
3. From the start of that window the filter runs backwards in time to the first epoch, where it
   stands with everything that the data up to the manoeuvre say: levelled by the accelerometers on
   the ground, its heading propagated back from the first turn.

The motion read backwards in time obeys the same equations with the velocity, the Earth's rotation,
the gyro rates and their errors of the other sign and the specific force as it is (substitute t ->
-t in S.1), and the IMU error processes are reversible, so the very same kernels do it.

The result serves as the point to linearise about. Its attitude covariance is widened (`WIDEN` times
in sigma), position and velocity start unknown and the IMU states with their a-priori mean and
covariance, since the forward filter sees the same data again: what remains of the double use is one
part in WIDEN^2 of the information on the starting attitude.
"""

from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np

from ...base.errors import DataError
from ...geodesy.rotation import (
    quaternion_from_rotation,
    rotation_from_quaternion,
    rotation_from_rpy,
    rotation_from_vector,
)
from ...records import Array, Increments
from ..filter.codes import (
    ABSENT,
    ACCEL0,
    AZ,
    BIAS,
    DRIFT_CODE,
    IMU0,
    IMU_STATES,
    N_CHANNELS,
    N_NAV,
    POS,
    POSITION_ROW,
    PSI,
    PSI0,
    QUAT,
    TEMPERATURE_CODE,
    VEL,
)
from ..filter.filter import make_history, run_filter
from ..filter.problem import EstimationProblem, InitialState, sub_problem, with_epochs
from ..filter.solution import Solution, solve
from .coarse import CoarseAttitude, coarse_attitudes
from .standing import StandingAttitude, standing_attitude

WIDEN = 10.0  # factor on the attitude's sigma: of its information 1 % is then used twice
FLOOR_RAD = np.radians([0.5, 0.5, 1.0])  # of the starting tilt and heading
# of the widened tilt and heading: more cannot be linearised
CEILING_RAD = np.radians([10.0, 10.0, 60.0])
ALIGNMENT_WINDOW_S = 60.0  # length (s) of the small flight around a coarse attitude (chosen)
# coarse attitudes that are estimated at most, the earliest first (chosen)
MOST_COARSE_ATTITUDES = 5
GOOD_RAD = np.radians(2.0)  # sigma of a heading that ends the search: second-order terms are 0.06 %
# of attitude, one sigma: beyond it second-order terms (1.5 % at one sigma) make it incredible
MOST_ATTITUDE_SIGMA_RAD = np.radians(10.0)
# of a triple: beyond it a fix is weighed down, from a metre at a sigma of centimetres by ten and
# more
HUBER_NIS = 16.0
# median of a triple, expected 2.4: beyond it the window did not converge to the data
MISFIT_NIS = 25.0


@dataclass(frozen=True)
class Alignment:
    """Start of the forward filter.

    Parameters
    ----------
    start : InitialState
        State and covariance at the first epoch.
    window : tuple of float
        Begin and end, s, GPST, of the manoeuvre that gave the heading.
    heading_sigma : float
        Standard deviation of the heading there, rad.
    """

    start: InitialState
    window: tuple[float, float]
    heading_sigma: float


def initial_state(problem: EstimationProblem) -> Alignment:
    """Align at the first epoch from the data alone.

    Parameters
    ----------
    problem : EstimationProblem
        The flight's measurements, increments and layout of states.

    Returns
    -------
    Alignment
        State and covariance at the first epoch.

    Raises
    ------
    DataError
        Where the data do not give a heading.
    """
    first, solution = _aligned_window(problem)
    P = solution.covariance(np.array([0]))[0]
    heading_sigma = float(np.sqrt(P[AZ, AZ]))
    nav, x = solution.nav[0], solution.x[0]
    if first > 0:
        nav, x, P = _run_back(problem, first, nav, x, P)
    att = WIDEN**2 * P[PSI, PSI] + np.diag(FLOOR_RAD**2)
    shrink = np.minimum(1.0, CEILING_RAD / np.sqrt(np.diag(att)))
    start = _start(problem, nav, att * np.outer(shrink, shrink), x)
    return Alignment(start, (solution.time[0], solution.time[-1]), heading_sigma)


def given_attitude(problem: EstimationProblem, rpy: Array, sigma: Array) -> InitialState:
    """Start from a given attitude at the first epoch.

    Parameters
    ----------
    problem : EstimationProblem
        The flight's measurements, increments and layout of states.
    rpy : ndarray, (3,)
        Roll, pitch and heading of the body (FRD) against north, east, down, rad.
    sigma : ndarray, (3,)
        Their standard deviations, rad.

    Returns
    -------
    InitialState
        State and covariance at the first epoch.
    """
    C_lb = problem.frame.C_ln_at(problem.epochs.position[0]) @ rotation_from_rpy(rpy)
    # roll and pitch sigmas are about body axes turned by the heading; the larger one serves both
    tilt = float(np.max(np.asarray(sigma)[:2]))
    nav = _nav(problem, C_lb, _first_velocity(problem))
    return _start(problem, nav, np.diag([tilt**2, tilt**2, float(sigma[2]) ** 2]))


def _aligned_window(problem: EstimationProblem) -> tuple[int, Solution]:
    """Return the first epoch and the smoothed solution of the window to start from.

    It is the earliest whose heading is known well enough, else the one that knows it best.
    """
    solved: list[tuple[int, Solution]] = []
    misfits: list[float] = []  # median NIS of windows that did not converge to the data
    standing = standing_attitude(problem)
    for first, window, start in _candidates(problem, standing):
        solution = _estimate_window(window, start)
        if solution is None:
            continue
        nis = float(np.nanmedian(solution.nis[:, POSITION_ROW]))
        if nis >= MISFIT_NIS:
            misfits.append(nis)
        elif nis < MISFIT_NIS and np.isfinite(solution.nav_covariance()).all():
            if _heading_variance(solution) < GOOD_RAD**2:
                return first, solution
            solved.append((first, solution))
    hopeless = (
        not solved or min(_heading_variance(s) for _, s in solved) > MOST_ATTITUDE_SIGMA_RAD**2
    )
    if misfits and hopeless:
        raise DataError(
            "no initial attitude: GNSS and inertial motion agree in no part of the recording "
            f"(median NIS of the fixes {min(misfits):.0f} at best, limit {MISFIT_NIS:.0f}); check "
            "sign and unit of the heights, lever arm (m), axes, sigmas, time scales and noise "
            "model, or give [initial] attitude"
        )
    if standing is not None and hopeless:
        raise DataError(
            f"heading not observable: {standing.description()} at best (limit "
            f"{np.degrees(MOST_ATTITUDE_SIGMA_RAD):.0f} deg), and no motion improves it; include "
            "a manoeuvre, use gyros of 1 deg/h, or give [initial] attitude"
        )
    if not solved:
        raise DataError(
            "no initial attitude: GNSS and inertial motion agree in no part of the recording, or "
            "there are too few fixes; check axes, units, time scales, sigmas, lever arm and noise "
            "model with `insgnss inspect`, or give [initial] attitude"
        )
    chosen = min(solved, key=lambda f: _heading_variance(f[1]))
    sigma = float(np.sqrt(_heading_variance(chosen[1])))
    if not sigma < MOST_ATTITUDE_SIGMA_RAD:
        raise DataError(
            "heading not observable: the best part of the recording gives the heading to "
            f"{np.degrees(sigma):.0f} deg only (limit {np.degrees(MOST_ATTITUDE_SIGMA_RAD):.0f}), "
            "as there is no turn or change of speed or the noise model is far too wide; include a "
            "manoeuvre or give [initial] attitude"
        )
    return chosen


def _heading_variance(solution: Solution) -> float:
    """Return the variance of the heading at the first epoch, rad^2."""
    return float(solution.nav_covariance(slice(1))[0, AZ, AZ])


def _estimate_window(window: EstimationProblem, start: InitialState) -> Solution | None:
    """Return the window's solution, robust where its fixes are rejected (K.11).

    A start tens of degrees off rejects good fixes, resets its covariance (K.7) and never converges;
    taken all, but weighed down, the fixes turn it round.
    """
    for variant in (window, replace(window, gate=np.inf, huber_threshold=HUBER_NIS)):
        try:
            return solve(variant, start, "on", separations=0, rows=0)
        except DataError:
            continue
    return None


def _candidates(
    problem: EstimationProblem, standing: StandingAttitude | None
) -> Iterator[tuple[int, EstimationProblem, InitialState]]:
    """Yield first epoch, problem and start of the windows to try.

    A stationary period that knows its heading goes first.
    """
    if standing is not None and standing.knows_heading:
        window = sub_problem(problem, standing.first, standing.last)
        tilt_sigma, heading_sigma = standing.tilt_sigma, standing.heading_sigma
        sigma = np.array([tilt_sigma, tilt_sigma, heading_sigma]) + 0.1 * FLOOR_RAD
        nav = _nav(window, standing.C_lb, np.zeros(3))
        yield standing.first, window, _start(window, nav, np.diag(sigma**2))
    for coarse in sorted(coarse_attitudes(problem)[:MOST_COARSE_ATTITUDES], key=lambda c: c.first):
        time = problem.epochs.time
        last = int(np.searchsorted(time, time[coarse.first] + ALIGNMENT_WINDOW_S))
        last = max(coarse.last, min(last, time.size - 1))
        window = sub_problem(problem, coarse.first, last)
        yield coarse.first, window, _coarse_start(window, coarse)


def _coarse_start(window: EstimationProblem, coarse: CoarseAttitude) -> InitialState:
    """Return the start of a window with its heading unknown.

    So what comes out as the heading's sigma is what the data of the window say.
    """
    tilt = np.clip(np.sqrt(np.diag(coarse.cov)[:2]) + FLOOR_RAD[:2], None, np.radians(30.0))
    att = np.diag([*tilt, np.pi]) ** 2
    return _start(window, _nav(window, coarse.C_lb, coarse.velocity), att)


def _nav(problem: EstimationProblem, C_lb: Array, velocity: Array) -> Array:
    """Return the state (10,) at the first epoch, a fix: the IMU where the antenna's fix puts it."""
    position = problem.epochs.position[0] - C_lb @ problem.antenna_lever_b
    return np.concatenate([position, velocity, quaternion_from_rotation(C_lb)])


def _start(
    problem: EstimationProblem, nav: Array, att: Array, x: Array | None = None
) -> InitialState:
    """Return a start with wide position and velocity and the given attitude covariance (3, 3).

    The IMU states are as the noise model has them; x (ns,) are those to linearise about, their
    a-priori mean is zero in any case.
    """
    P = np.zeros((problem.layout.size, problem.layout.size))
    spread = np.sqrt(np.trace(problem.epochs.position_cov[0]))
    P[POS, POS] = np.eye(3) * max(10.0, 10.0 * spread) ** 2
    P[VEL, VEL] = np.eye(3) * max(5.0, 2.0 * spread) ** 2
    P[PSI, PSI] = att
    P[IMU_STATES, IMU_STATES] = np.diag(problem.layout.sigma0**2)
    nominal = np.zeros(problem.layout.size - N_NAV) if x is None else x
    return InitialState(nav, nominal, np.concatenate([np.zeros(N_NAV), -nominal]), P)


def _first_velocity(problem: EstimationProblem) -> Array:
    """Return the velocity (3,), m/s, from the fixes of the first two seconds."""
    ep = problem.epochs
    with_position = np.flatnonzero(ep.has_position)
    if ep.has_velocity[with_position[0]]:
        return ep.velocity[with_position[0]]
    with_position = with_position[
        : max(2, int(np.searchsorted(ep.time[with_position], ep.time[with_position[0]] + 2.0)))
    ]
    A = np.column_stack([np.ones(with_position.size), ep.time[with_position]])
    return np.linalg.lstsq(A, ep.position[with_position], rcond=None)[0][1]


def _reverse_problem(problem: EstimationProblem, last: int) -> EstimationProblem:
    """Return the epochs last..0 of a problem, read against time."""
    epochs = np.arange(last, -1, -1)
    inc, end = problem.inc, problem.epochs.stop[last]
    against = Increments(
        inc.dt[:end][::-1],
        -inc.dtheta[:end][::-1],
        inc.dvel[:end][::-1],
        -inc.marks[epochs],
        end - problem.epochs.stop[epochs],
        -inc.rate[epochs],
        inc.nominal_s,
    )
    back = with_epochs(problem, epochs, against)
    ep = back.epochs
    # of the interval that now ends at the epoch
    gap, step = (
        np.concatenate([np.zeros((1, N_CHANNELS)), values[:-1]])
        for values in (ep.gap, ep.bias_step)
    )
    # nothing is asked of the camera's events, whose covariances would be carried along
    no_event = np.full(epochs.size, ABSENT)
    of_interval = {"gap": gap, "bias_step": step, "event": no_event}
    reversed_arrays = {"velocity": -ep.velocity, "zaru_rate": -ep.zaru_rate, **of_interval}
    return replace(back, backward=True, epochs=ep._replace(**reversed_arrays))


def _run_back(
    problem: EstimationProblem, first: int, nav: Array, x: Array, P: Array
) -> tuple[Array, Array, Array]:
    """Filter from epoch `first` back to epoch 0, with state and covariance in forward signs."""
    layout = problem.layout
    sign = np.ones(layout.size)
    sign[VEL] = -1.0
    gyro = layout.channel < ACCEL0
    # a drift counts time, which turns too
    sign[IMU_STATES][
        (gyro & np.isin(layout.factor, (BIAS, TEMPERATURE_CODE)))
        | (~gyro & (layout.factor == DRIFT_CODE))
    ] = -1.0
    if layout.offset >= 0:
        sign[IMU0 + layout.offset] = -1.0
    back = _reverse_problem(problem, first)
    # what follows a course, and no noise, grows backwards as it decays forwards
    beta = np.where(layout.drive > 0.0, layout.beta, -layout.beta)
    back = replace(back, layout=replace(layout, beta=beta))
    nav = nav.copy()
    nav[VEL] *= -1.0
    start = InitialState(nav, x * sign[IMU_STATES], np.zeros(layout.size), P * np.outer(sign, sign))
    history = make_history(back.epochs, layout, smoothed=False)
    run_filter(back, start, history)
    m = history.m[-1]  # not zero where the filter still held the feedback back
    nav = history.nav[-1].copy()
    nav[:PSI0] += m[:PSI0]
    nav[QUAT] = quaternion_from_rotation(
        rotation_from_vector(m[PSI]) @ rotation_from_quaternion(nav[QUAT])
    )
    nav[VEL] *= -1.0
    x = (history.x[-1] + m[IMU_STATES]) * sign[IMU_STATES]
    x[layout.factor == DRIFT_CODE] = 0.0
    if layout.rate >= 0:  # the offset there, not at the window
        x[layout.offset] -= x[layout.rate] * problem.epochs.time[first]
    return nav, x, history.P[-1] * np.outer(sign, sign)
