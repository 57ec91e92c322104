"""Filter and smoother, as often as it takes, and what came out.

The first pass is the closed-loop filter followed by the smoother. The smoother's correction psi of
the nominal attitude tells how far off it was linearised. What linear theory leaves out is, with psi
split into tilt t and heading c,

    t (c + t / 2)  of the tilt,      c^2 / 2  of the heading                                  (N.1)

Where that exceeds a fifth of the sigma that the filter had at the same epoch, or the start was two
degrees off, another pass is run, linearised about the smoothed flight (`filter`, K.6): a
Gauss-Newton step of the batch least-squares problem over the whole flight, which converges to its
solution.

Measurements given by their prediction (K.13) need a flight to be linearised about. That is the
nominal of a filter without them, where it follows the fixes, else the flight smoothed without them.
"""

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Literal

import numpy as np

from ...base.errors import DataError
from ...records import Array
from .blocks import (
    MOST_COVARIANCE_ROWS,
    BlockwisePasses,
    Follower,
    keeps_events,
)
from .codes import (
    AX,
    AY,
    AZ,
    BIAS,
    IMU_STATES,
    N_CHANNELS,
    N_NAV,
    PSI,
    PSI0,
    QUAT,
    QW,
    QX,
    QY,
    QZ,
)
from .covariances import ChainAgain, SmoothedCovariances
from .event_chain import EventChain, events_of
from .filter import FEEDBACK_RAD
from .linearised import LINEAR_SIGMAS, linearised_about
from .problem import EstimationProblem, InitialState, bias_courses, channel_biases
from .smoother import SharedError, Smoothed, diagonal

LATEST_FEEDBACK = (
    0.1  # share of the flight before which the nominal is to follow the fixes (chosen)
)
UNSETTLED = 0.5  # standard deviations by which a prediction may still move after the last pass
# of filter and smoother, so that a flight that does not converge comes to an end (chosen)
MAX_PASSES = 6
SECOND_ORDER = 0.2  # at 0.1 a further pass moved no exposure by more than 0.06 of its sigma
LARGE_RAD = np.radians(2.0)  # from starts 5 to 20 deg off one pass left 0.3 sigma, (N.1) met


@dataclass(frozen=True)
class Solution:
    """The smoothed flight at the m epochs of its problem, with n states as in its layout.

    Parameters
    ----------
    problem : EstimationProblem
        What was solved.
    nav : Array
        (m, 10) smoothed position (m), velocity (m/s) in l, quaternion q_lb (w, x, y, z).
    x : Array
        (m, ns) smoothed values of the other states.
    covariances : SmoothedCovariances
        Smoothed covariances of the errors; `covariance`, `variance` and `nav_covariance` ask them.
    filter_sigma : Array
        (m, 9) standard deviations of the navigation errors in the forward filter.
    innovation, innovation_sigma : Array
        (m, nz) of the triples that were measured, position first, in l; of NHC and ZARU in body
        axes.
    nis : Array
        (m, 5) normalised innovation squared of each kind of triple (`codes.POSITION` and so on).
    verdict : ndarray
        (m, 5) what became of it: `codes.NOT_MEASURED`, `USED`, `REJECTED`, `COVARIANCE_RESET`.
    event_cross : Array
        (events, 9, 9) navigation errors of the event before with those of this one.
    separation_epoch : ndarray
        (s,) epochs of the forward/backward separation.
    separation, separation_sigma : Array
        (s, 9) backward minus forward of the navigation states, and its standard deviation.
    adjoint, information : Array
        (s, n) and (s, n, n), what the data behind these epochs say (`navigation.filter.smoother`).
    passes : int
        Forward passes run.
    chain : EventChain, ChainAgain or None
        What ties the events, for the covariance of several of them, where the problem asks for it;
        of many of them its parts are worked out again.
    """

    problem: EstimationProblem
    nav: Array
    x: Array
    covariances: SmoothedCovariances
    filter_sigma: Array
    innovation: Array
    innovation_sigma: Array
    nis: Array
    verdict: np.ndarray
    event_cross: Array
    separation_epoch: np.ndarray
    separation: Array
    separation_sigma: Array
    adjoint: Array
    information: Array
    passes: int
    chain: EventChain | ChainAgain | None

    @property
    def time(self) -> Array:
        """Times of the epochs, (m,) s, GPST."""
        return self.problem.inc.marks

    @property
    def event_epochs(self) -> np.ndarray:
        """Index of the epoch of each camera event, in the order of the events."""
        return events_of(self.problem.epochs)

    @property
    def rows(self) -> np.ndarray:
        """The epochs of which the whole covariance is kept: regular ones, and camera events where
        these are not many.
        """
        return self.covariances.own_rows

    @property
    def row_sigma(self) -> Array:
        """Standard deviations of the errors of all states in the forward filter at `rows`."""
        return self.covariances.filter_sigma

    def covariance(self, index: np.ndarray, states: np.ndarray | None = None) -> Array:
        """Return the smoothed covariance of the errors of all states at some epochs.

        At `rows` it is kept; at any other epoch it costs some ten milliseconds a block of epochs.

        Parameters
        ----------
        index : ndarray
            (k,) the epochs.
        states : ndarray, optional
            (n,) the rows and columns that are wanted; all where it is left out.

        Returns
        -------
        Array
            (k, n, n) in l, navigation first.
        """
        return self.covariances.whole(index, states)

    def variance(self, index: np.ndarray) -> Array:
        """Return the smoothed variances of the errors of all states at some epochs.

        Parameters
        ----------
        index : ndarray
            (k,) the epochs.

        Returns
        -------
        Array
            (k, n), navigation first.
        """
        return self.covariances.variance(index)

    def nav_covariance(self, index: np.ndarray | slice = slice(None)) -> Array:
        """Return the smoothed covariance of the navigation errors at some epochs.

        Parameters
        ----------
        index : ndarray or slice
            (k,) the epochs; all of them without it.

        Returns
        -------
        Array
            (k, 9, 9) of position, velocity and attitude errors in l.
        """
        return self.covariances.of_navigation(index)

    def without_increments(self) -> "Solution":
        """Return the solution without increments and event chain, for what only reads results.

        Covariances of all states are those of `rows` then. Nothing reads the chain once the poses
        of the images are known.

        Returns
        -------
        Solution
            The same otherwise.
        """
        inc, none = self.problem.inc, np.zeros((0, 3))
        problem = replace(self.problem, inc=replace(inc, dt=none[:, 0], dtheta=none, dvel=none))
        covariances = replace(self.covariances, again=None)
        return replace(self, problem=problem, covariances=covariances, chain=None)

    def enlarged(self, shared: tuple[SharedError, ...]) -> "Solution":
        """Return the solution with further errors in its covariances.

        Parameters
        ----------
        shared : tuple of SharedError
            What epochs share and no state describes.

        Returns
        -------
        Solution
            The same otherwise; covariances of neighbouring events are changed in place.
        """
        for error in shared:
            inside = error.within(self.event_epochs)
            neighbours = np.flatnonzero(inside[1:] & inside[:-1]) + 1
            self.event_cross[neighbours, error.block, error.block] += error.cov
        chain = self.chain
        if chain is not None:
            chain = replace(chain, shared=(*chain.shared, *shared))
        return replace(self, covariances=self.covariances.enlarged(shared), chain=chain)

    def channel_bias(self, index: np.ndarray) -> tuple[Array, Array]:
        """Return the smoothed bias of the six channels at some epochs.

        Parameters
        ----------
        index : ndarray
            (k,) the epochs.

        Returns
        -------
        bias, sigma : Array
            (k, 6) rad/s and m/s^2 in body axes, and its standard deviation.
        """
        layout = self.problem.layout

        def variance(*factors: int) -> Array:
            M = sum(layout.channel_sum(factor) for factor in factors)
            A = np.concatenate([np.zeros((N_CHANNELS, N_NAV)), M], axis=1)
            return self.covariances.variance_of(index, A)

        # var(a + c b) of a course c, by var(a), var(b) and var(a + b)
        terms = {BIAS: np.ones(len(index))}
        spread = variance(BIAS)
        for factor, course in bias_courses(self.problem).items():
            c = course[index, None]
            spread = spread + c**2 * variance(factor)
            for before, d in terms.items():
                twice_cov = variance(before, factor) - variance(before) - variance(factor)
                spread = spread + c * d[:, None] * twice_cov
            terms[factor] = course[index]
        biases = channel_biases(self.problem, self.x[index], index)
        return biases, np.sqrt(np.maximum(spread, 0.0))


def solve(
    problem: EstimationProblem,
    start: InitialState,
    second_pass: Literal["auto", "on", "off"] = "auto",
    progress: Callable[[str], None] = lambda _: None,
    separations: int | np.ndarray = 100,
    about: Solution | None = None,
    rows: int = MOST_COVARIANCE_ROWS,
    follower: Follower | None = None,
) -> Solution:
    """Filter and smooth a flight.

    Parameters
    ----------
    problem : EstimationProblem
        What is measured, and how.
    start : InitialState
        The state at the first epoch.
    second_pass : {"auto", "on", "off"}
        "auto" linearises again while it changes the result, "on" at least once, "off" never but
        for measurements given by their prediction (K.13).
    progress : callable
        Called with the name of each step.
    separations : int or ndarray
        Number of epochs at which the forward/backward separation is worked out, or which.
    about : Solution, optional
        A solution of the same epochs and states about which the first pass is linearised already.
    rows : int
        Number of regular epochs, at most, of which the whole covariance is kept, besides the first,
        the last and, where they are not many (`event_chain.CHAIN_BYTES`), the camera events.
    follower : Follower, optional
        What goes along with the first pass.

    Returns
    -------
    Solution
        The smoothed flight.

    Raises
    ------
    DataError
        Where the fixes and the inertial data contradict each other for long.
    """
    if about is not None and problem.measurements:
        problem, _ = linearised_about(problem, about.nav, about.x)
    passes = BlockwisePasses(problem, start, _kept_rows(problem, rows), separations)
    history = passes.history
    progress("filter")
    if about is not None:
        history.nav[:], history.x[:] = about.nav, about.x
    passes.filter(about is None, follower)
    if _gives_linearisation(passes.problem, history.sigma):
        passes.problem, _ = linearised_about(passes.problem, history.nav, history.x)
        progress("filter, with the sensors linearised about the solution without them")
        passes.filter()
    count = 1
    while True:
        another = count == 1 and (second_pass == "on" or not passes.problem.linearised)
        if not another:
            progress("smoother")
        smoothed = passes.smooth(full=not another)
        again, change = _about_smoothed(passes, smoothed)
        if count == MAX_PASSES:
            _refuse_unsettled(passes.problem, change)
            break
        moving = second_pass != "off" and _nonlinear(smoothed.delta, history.sigma)
        if not (another or moving or change > LINEAR_SIGMAS):
            break
        inject_errors(history.nav, history.x, smoothed.delta)
        passes.problem = again
        count += 1
        progress(f"filter, pass {count}, linearised about the smoothed flight")
        passes.filter(closed_loop=False)
    refuse_negative_variances(problem, smoothed.nav_cov)
    return _solution(passes, smoothed, count)


def _gives_linearisation(problem: EstimationProblem, filter_sigma: Array) -> bool:
    """Return whether measurements that no pass has seen are linearised about the filter's nominal.

    Where that follows the fixes late or never (K.5), the smoothed flight is needed.
    """
    follows = (filter_sigma[:, PSI] < FEEDBACK_RAD).all(axis=1)
    early = follows[: 1 + round(LATEST_FEEDBACK * follows.size)]
    return not problem.linearised and bool(early.any())


def _refuse_unsettled(problem: EstimationProblem, change: float) -> None:
    """Refuse measurements whose prediction still moves when the passes end.

    Raises
    ------
    DataError
        Where it moves by more than `UNSETTLED` standard deviations.
    """
    if change > UNSETTLED:
        names = ", ".join(one.measurement.name for one in problem.measurements)
        raise DataError(
            f"measurements {names}: after {MAX_PASSES} filter passes the prediction still changes "
            f"by {change:.2g} standard deviations per pass; check that `predict` is a smooth "
            "function of the motion, the values and their sigmas"
        )


def _about_smoothed(passes: BlockwisePasses, smoothed: Smoothed) -> tuple[EstimationProblem, float]:
    """Linearise again about what was smoothed; nothing changes without measurements."""
    if not passes.problem.measurements:
        return passes.problem, 0.0
    nav, x = moved_by(passes.history.nav, passes.history.x, smoothed.delta)
    return linearised_about(passes.problem, nav, x)


def _kept_rows(problem: EstimationProblem, regular: int) -> np.ndarray:
    """Return the epochs of which the whole covariance is kept."""
    epochs = problem.epochs
    m = epochs.stop.size
    stride = -(-m // regular) if regular else m
    ends = np.array([0, m - 1])
    exposed = np.flatnonzero(epochs.event >= 0) if keeps_events(problem) else ends
    return np.unique(np.concatenate([np.arange(0, m, stride), ends, exposed]))


def refuse_negative_variances(problem: EstimationProblem, nav_cov: Array) -> None:
    """Refuse where rounding has used up a variance of the smoothed navigation states.

    Parameters
    ----------
    problem : EstimationProblem
        What was solved.
    nav_cov : Array
        (m, 45) lower triangles of the smoothed covariance.

    Raises
    ------
    DataError
        With the first instant.
    """
    negative = ~(diagonal(nav_cov) >= 0.0).all(axis=1)
    if negative.any():
        first = float(np.abs(problem.inc.marks[int(np.argmax(negative))]))
        raise DataError(
            f"the smoothed covariance has negative variances from {first:.1f} s on: the filter's"
            " covariance is so large there that rounding errors exceed the smoothed covariance;"
            " cut the flight there with start_tow and end_tow"
        )


def _solution(passes: BlockwisePasses, smoothed: Smoothed, count: int) -> Solution:
    """Return the solution: the nominal moved by the smoothed errors, and what both passes left."""
    history, again = passes.history, passes.again()
    covariances = SmoothedCovariances(
        smoothed.nav_cov,
        smoothed.rows,
        smoothed.kept,
        passes.row_sigma,
        again,
        passes.problem.layout.size,
    )
    inject_errors(history.nav, history.x, smoothed.delta)
    return Solution(
        passes.problem,
        history.nav,
        history.x,
        covariances,
        history.sigma,
        history.innovation,
        history.innovation_sigma,
        history.nis,
        history.verdict,
        smoothed.event_cross,
        smoothed.separation_epoch,
        *smoothed.separations(),
        smoothed.adjoint,
        smoothed.information,
        count,
        passes.chain(smoothed, again),
    )


def _nonlinear(delta: Array, sigma: Array) -> bool:
    """Return whether products of attitude corrections (N.1) matter against the filter's sigma."""
    tilt = np.hypot(delta[:, AX], delta[:, AY])
    heading = np.abs(delta[:, AZ])
    of_tilt = tilt * (heading + 0.5 * tilt) / sigma[:, AX:AZ].min(axis=1)
    of_heading = 0.5 * heading**2 / sigma[:, AZ]
    second_order = max(of_tilt.max(), of_heading.max())
    return bool(second_order > SECOND_ORDER or np.hypot(tilt[0], heading[0]) > LARGE_RAD)


def moved_by(nav: Array, x: Array, delta: Array) -> tuple[Array, Array]:
    """Return a nominal that estimates of its errors have moved.

    Parameters
    ----------
    nav, x : Array
        (m, 10) and (m, ns) nominal states.
    delta : Array
        (m, n) their errors.

    Returns
    -------
    nav, x : Array
        The moved states.
    """
    nav, x = nav.copy(), x.copy()
    inject_errors(nav, x, delta)
    return nav, x


def inject_errors(nav: Array, x: Array, delta: Array) -> None:
    """Add estimates of its errors to a nominal, in place; attitude from the left.

    Parameters
    ----------
    nav, x, delta : Array
        As in `moved_by`.
    """
    nav[:, :PSI0] += delta[:, :PSI0]
    half = 0.5 * delta[:, PSI]
    angle = np.linalg.norm(half, axis=1)
    w = np.cos(angle)
    a, b, c = (half * np.sinc(angle / np.pi)[:, None]).T
    q0, q1, q2, q3 = nav[:, QUAT].T.copy()
    nav[:, QW] = w * q0 - a * q1 - b * q2 - c * q3
    nav[:, QX] = w * q1 + a * q0 + b * q3 - c * q2
    nav[:, QY] = w * q2 - a * q3 + b * q0 + c * q1
    nav[:, QZ] = w * q3 + a * q2 - b * q1 + c * q0
    x += delta[:, IMU_STATES]
