"""Filter and smoother, as often as it takes, and what came out.

The first pass is the closed-loop filter followed by the smoother. The smoother's correction psi of the nominal attitude tells how
far off it was linearised. What linear theory leaves out is, with psi split into tilt t and heading c,

    t (c + t / 2)  of the tilt,      c^2 / 2  of the heading                                             (N.1)

Where that exceeds a fifth of the sigma that the filter had at the same epoch, or the start was two degrees off, another pass is run,
linearised about the smoothed flight (`filter`, K.6): a Gauss-Newton step of the batch least-squares problem over the whole flight,
which converges to its solution.
"""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Literal

import numpy as np

from ..geodesy.rotation import rotation_from_quaternion
from ..records import Array, Trajectory
from ._kernels import Store
from .filter import Problem, Start, make_store, run_filter
from .layout import NAV, POS, PSI, VEL
from .smoother import Smoothed, run_smoother

MAX_PASSES = 6
SECOND_ORDER = 0.2  # at 0.1 and below a further pass moved no exposure by more than 0.06 of its sigma
LARGE_RAD = np.radians(2.0)  # from starts 5 to 20 deg wrong one pass left 0.3 sigma to the next while (N.1) was below its limit


@dataclass(frozen=True)
class Solution:
    """Smoothed flight at the epochs of `problem`. Arrays start with the epoch; n states as in `problem.layout`.

    nav (m, 10), x (m, ns), P (m, n, n): smoothed.   filter_sigma (m, n): of the forward filter.
    innovation, innovation_sigma (m, nz) of the triples that were measured, position first, in l, motion of wheels and turn in body axes;
    nis, verdict (m, 4) of each kind (`filter.POSITION` and so on).
    event_cross (events, 9, 9): navigation errors of the event before with those of this one.   passes: forward passes run.
    """

    problem: Problem
    nav: Array
    x: Array
    P: Array
    filter_sigma: Array
    innovation: Array
    innovation_sigma: Array
    nis: Array
    verdict: np.ndarray
    event_cross: Array
    separation_epoch: np.ndarray
    separation: Array
    separation_sigma: Array
    passes: int

    @property
    def time(self) -> Array:
        """(m,) s, GPST, of the epochs."""
        return self.problem.inc.marks

    @property
    def event_epochs(self) -> np.ndarray:
        """Index of the epoch of each camera event, in the order of the events."""
        at = np.flatnonzero(self.problem.epochs.event >= 0)
        return at[np.argsort(self.problem.epochs.event[at])]

    def channel_bias(self, at: np.ndarray) -> tuple[Array, Array]:
        """Smoothed bias of the six channels at epochs `at` (k,), (k, 6) rad/s and m/s^2 in body axes, and its standard deviation."""
        M = self.problem.layout.channel_sum()
        spread = np.einsum("cs,mst,ct->mc", M, self.P[:, 9:, 9:][at], M, optimize=True)
        return self.x[at] @ M.T, np.sqrt(np.maximum(spread, 0.0))


def solve(
    problem: Problem,
    start: Start,
    second_pass: Literal["auto", "on", "off"] = "auto",
    progress: Callable[[str], None] = lambda _: None,
    separations: int = 100,
) -> Solution:
    """Filter and smooth a flight.

    separations : number of epochs at which the forward/backward separation is worked out.
    second_pass : "auto" linearises again while it changes the result, "on" at least once, "off" never.
    Raises DataError where the fixes and the inertial data contradict each other for long.
    """
    store = make_store(problem.epochs, problem.layout)
    progress("filter")
    run_filter(problem, start, store)
    passes = 1
    if second_pass != "off":
        estimate = run_smoother(problem.epochs, store, full=False)
        while passes < MAX_PASSES and (_nonlinear(estimate.delta, store.sigma) or (second_pass == "on" and passes == 1)):
            _move(store.nav, store.x, estimate.delta)
            passes += 1
            progress(f"filter, pass {passes}, linearised about the smoothed flight")
            run_filter(problem, start, store, closed=False)
            estimate = run_smoother(problem.epochs, store, full=False)
    progress("smoother")
    smoothed = run_smoother(problem.epochs, store, separations=separations)
    return _solution(problem, store, smoothed, passes)


def _solution(problem: Problem, store: Store, smoothed: Smoothed, passes: int) -> Solution:
    _move(store.nav, store.x, smoothed.delta)
    return Solution(
        problem,
        store.nav,
        store.x,
        store.P,
        store.sigma,
        store.innovation,
        store.innovation_sigma,
        store.nis,
        store.verdict,
        smoothed.event_cross,
        smoothed.separation_epoch,
        smoothed.separation,
        smoothed.separation_sigma,
        passes,
    )


def _nonlinear(delta: Array, sigma: Array) -> bool:
    """Whether the products of the attitude corrections (N.1) matter against the sigma that the filter had at that epoch."""
    tilt = np.hypot(delta[:, 6], delta[:, 7])
    heading = np.abs(delta[:, 8])
    of_tilt = tilt * (heading + 0.5 * tilt) / sigma[:, 6:8].min(axis=1)
    of_heading = 0.5 * heading**2 / sigma[:, 8]
    return bool(max(of_tilt.max(), of_heading.max()) > SECOND_ORDER or np.hypot(tilt[0], heading[0]) > LARGE_RAD)


def _move(nav: Array, x: Array, delta: Array) -> None:
    """Add the smoothed error estimate to the nominal, in place; attitude from the left (`insgnss`)."""
    nav[:, :6] += delta[:, :6]
    half = 0.5 * delta[:, PSI]
    angle = np.linalg.norm(half, axis=1)
    w = np.cos(angle)
    a, b, c = (half * np.sinc(angle / np.pi)[:, None]).T
    q0, q1, q2, q3 = nav[:, 6:].T.copy()
    nav[:, 6] = w * q0 - a * q1 - b * q2 - c * q3
    nav[:, 7] = w * q1 + a * q0 + b * q3 - c * q2
    nav[:, 8] = w * q2 - a * q3 + b * q0 + c * q1
    nav[:, 9] = w * q3 + a * q2 - b * q1 + c * q0
    x += delta[:, 9:]


def trajectory(solution: Solution, at: np.ndarray, gps_week: int, events: bool = False) -> Trajectory:
    """The smoothed trajectory at epochs `at`, in latitude, longitude, height and axes north, east, down at the point.

    events : `at` are the epochs of all camera events; the cross-covariances of neighbours come along.
    Accelerations are differences of the velocities at `at`, rates those of the gyros at the instant.
    """
    frame = solution.problem.frame
    nav = solution.nav[at]
    lat, lon, height = frame.geodetic_from_position(nav[:, POS])
    C_nl = np.swapaxes(frame.C_ln(lat, lon), -1, -2)
    C_lb = rotation_from_quaternion(nav[:, 6:])
    cov = rotate_blocks(C_nl, solution.P[:, NAV, NAV][at], C_nl)
    cross = rotate_blocks(C_nl[:-1], solution.event_cross[1:], C_nl[1:]) if events else None
    velocity = np.einsum("nij,nj->ni", C_nl, nav[:, VEL])
    time, C_nb = solution.time[at], C_nl @ C_lb
    acceleration = np.einsum("nji,nj->ni", C_nb, np.gradient(velocity, time, axis=0)) if at.size > 1 else None
    cov = 0.5 * (cov + np.swapaxes(cov, -1, -2))
    return Trajectory(time, lat, lon, height, velocity, C_nb, cov, gps_week, acceleration, _body_rate(solution, at, C_lb), cross)


def _body_rate(solution: Solution, at: np.ndarray, C_lb: Array) -> Array:
    """Rate of the body against the Earth, (k, 3) rad/s in body axes, gyro bias taken off."""
    M = solution.problem.layout.channel_sum()[:3]
    return solution.problem.inc.rate[at] - solution.x[at] @ M.T - np.einsum("nij,i->nj", C_lb, solution.problem.frame.earth_rate_l)


def rotate_blocks(C_left: Array, cov: Array, C_right: Array) -> Array:
    """Every 3 x 3 block of cov (n, 3k, 3k) between errors in other axes: C_left block C_right'; C (n, 3, 3)."""
    n, size = cov.shape[:2]
    k = size // 3
    blocks = cov.reshape(n, k, 3, k, 3)
    turned = np.einsum("nij,najbk,nlk->naibl", C_left, blocks, C_right, optimize=True)
    return turned.reshape(n, size, size)
