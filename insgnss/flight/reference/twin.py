"""The error-state extended Kalman filter over a flight and its smoother, put together.

At every epoch: carry the nominal and predict the error (`error_model`), measure (`measurements`),
test, update, and feed the estimated error back into the nominal, where it starts again from zero.
As long as a component of psi is known to worse than a degree nothing is fed back: a nominal that
followed a heading by tens of degrees would be linearised about the excursion.

Gate. A measurement whose normalised innovation squared (NIS) exceeds the gate is left out:

    NIS = nu' S^-1 nu,   nu = z - H x,   S = H P H' + R                            (T.22)

Robust weight (Huber). Beyond the threshold, yet below the gate, R is enlarged by NIS / threshold.

Covariance reset. When every position of a second (or of 4.5 fix intervals) has been rejected, the
filter may be wrong rather than the fixes: the size d of the innovation is added to the covariance,
d^2 of position, (d / t)^2 of velocity and the tilt that makes d within that time t, to a degree:

    tilt^2 = (d_n^2 + d_e^2) / (g t^2 / 2)^2                                       (T.23)

and the fix is used. For the smoother this is process noise like any other.

The forward pass leaves behind a linear problem about the nominal of each epoch, which `linear`
smooths. Each further pass is linearised about the smoothed nominal (nothing is fed back then):
a Gauss-Newton step of the batch least-squares problem over the whole flight.
"""

from collections.abc import Callable
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from ...base.advance import through
from ...navigation.filter.codes import (
    COVARIANCE_RESET,
    NOT_MEASURED,
    POS,
    POSITION_ROW,
    PSI,
    REJECTED,
    USED,
    VEL,
)
from ...navigation.filter.filter import FEEDBACK_RAD, RESET_AFTER_S, RESET_FIXES
from ...navigation.filter.problem import EstimationProblem, InitialState
from ...records import Array
from .error_model import propagate
from .linear import GaussianStates, LinearProblem, Measurement, new_filter, rts_smoother
from .measurements import measurement
from .strapdown import NominalState

if TYPE_CHECKING:
    from filterpy.kalman import KalmanFilter

HALF_GRAVITY = 4.9  # m/s^2
LARGEST_TILT2 = 3e-4  # rad^2, (1 deg)^2


@dataclass(frozen=True, eq=False)
class ForwardPass:
    """What a forward pass leaves.

    Parameters
    ----------
    states : the nominal of each epoch, after feedback.
    linear : the linear problem about these nominals, with the measurements that were used.
    filtered : the filter's error about these nominals (zero where it was fed back), and covariance.
    nis : (m, kinds) NIS of each kind of measurement, NaN where there was none.
    decision : (m, kinds) `NOT_MEASURED`, `USED`, `REJECTED` or `COVARIANCE_RESET` of
        `navigation.filter.codes`.
    """

    states: list[NominalState]
    linear: LinearProblem
    filtered: GaussianStates
    nis: Array
    decision: np.ndarray


@dataclass(frozen=True, eq=False)
class TwinSolution:
    """The smoothed flight of m epochs and n states.

    Parameters
    ----------
    nav : (m, 10) position, velocity in l, quaternion q_lb.
    x : (m, ns) error states.
    smoothed : error about the last nominal, its covariance P (m, n, n) and the smoother's gains.
    forward : the last forward pass.
    """

    nav: Array
    x: Array
    smoothed: GaussianStates
    forward: ForwardPass


def solve_twin(
    problem: EstimationProblem,
    start: InitialState,
    passes: int = 1,
    progress: Callable[[str], None] = lambda _: None,
) -> TwinSolution:
    """Filter and smooth a flight the textbook way.

    Parameters
    ----------
    problem, start : the estimation problem and its initial state, as the core takes them.
    passes : forward passes, each after the first linearised about the smoothed flight before.
    progress : gets which pass runs.

    Returns
    -------
    TwinSolution
        States, covariances and what the filter decided.
    """
    nominal: list[NominalState] | None = None
    for number in range(1, passes + 1):
        progress(f"reference twin, pass {number} of {passes}")
        forward = run_forward(problem, start, nominal)
        estimate = rts_smoother(forward.linear, forward.filtered)
        errors = zip(forward.states, estimate.mean, strict=True)
        nominal = [state.plus(error) for state, error in errors]
    assert nominal is not None, "at least one pass is needed"
    nav, x = np.array([state.nav() for state in nominal]), np.array([state.x for state in nominal])
    return TwinSolution(nav, x, estimate, forward)


def run_forward(
    problem: EstimationProblem, start: InitialState, nominal: list[NominalState] | None = None
) -> ForwardPass:
    """Run the extended Kalman filter over all epochs.

    Parameters
    ----------
    problem, start : the estimation problem and its initial state.
    nominal : states of all epochs to linearise about; None: the filter's own, with feedback.
    """
    epoch_count, state_count = problem.epochs.stop.size, problem.layout.size
    kf, update = new_filter(start.mean, start.P), _Update(problem)
    state, fed_back, acceleration = NominalState.from_arrays(start.nav, start.x), False, np.zeros(3)
    states: list[NominalState] = []
    Phi, Q, gap = (
        np.tile(np.eye(state_count), (epoch_count, 1, 1)),
        np.zeros((epoch_count, state_count, state_count)),
        np.zeros((epoch_count, state_count)),
    )
    means, covariances, measured = (
        np.zeros((epoch_count, state_count)),
        np.zeros((epoch_count, state_count, state_count)),
        [],
    )
    for epoch in through(range(epoch_count)):
        if epoch:
            interval = propagate(problem, epoch, states[-1])
            state, Phi[epoch], Q[epoch] = interval.state, interval.Phi, interval.Q
            kf.predict(F=Phi[epoch], Q=Q[epoch])
            length = problem.epochs.time[epoch] - problem.epochs.time[epoch - 1]
            acceleration = (state.v - states[-1].v) / length
        if nominal is not None:
            gap[epoch] = state.minus(nominal[epoch])
            state, kf.x = nominal[epoch], kf.x + gap[epoch][:, None]
        used, reset = update(kf, epoch, state, acceleration)
        Q[epoch] += reset
        fed_back = fed_back or kf.P.diagonal()[PSI].max() < FEEDBACK_RAD**2
        if nominal is None and fed_back:
            gap[epoch] = -kf.x[:, 0]
            state, kf.x = state.plus(kf.x[:, 0]), np.zeros((state_count, 1))
            used = [(H, z + H @ gap[epoch], R) for H, z, R in used]
        states.append(state)
        means[epoch], covariances[epoch] = kf.x[:, 0], kf.P
        measured.append(used)
    initial_error = NominalState.from_arrays(start.nav, start.x).minus(states[0]) + start.mean
    linear = LinearProblem(initial_error, start.P + Q[0], Phi, Q, gap, measured)
    return ForwardPass(
        states, linear, GaussianStates(means, covariances), update.nis, update.decision
    )


class _Update:
    """The measurements of an epoch: gate, robust weight, covariance reset, filterpy's update."""

    def __init__(self, problem: EstimationProblem) -> None:
        self.problem, self.gates = problem, problem.gates
        shape = problem.epochs.stop.size, self.gates.size
        self.nis = np.full(shape, np.nan)
        self.decision = np.full(shape, NOT_MEASURED)
        self.reset_s = max(RESET_AFTER_S, RESET_FIXES * problem.aiding_interval_s)
        self.rejected_since: float | None = None

    def __call__(
        self, kf: "KalmanFilter", epoch: int, state: NominalState, acceleration: Array
    ) -> tuple[list[Measurement], Array]:
        """Update `kf` in place; the measurements used, and what a reset added to the covariance."""
        used: list[Measurement] = []
        reset = np.zeros_like(kf.P)
        for kind in range(self.gates.size):
            measured = measurement(self.problem, epoch, kind, state, acceleration)
            if measured is None:
                continue
            H, z, R = measured
            nu = z - H @ kf.x[:, 0]
            nis = float(nu @ np.linalg.solve(H @ kf.P @ H.T + R, nu))  # (T.22)
            self.nis[epoch, kind] = nis
            decision = self._decide(epoch, kind, nis)
            self.decision[epoch, kind] = decision
            if decision == REJECTED:
                continue
            if decision == COVARIANCE_RESET:
                reset = covariance_reset(nu, self.reset_s, kf.P.shape[0])
                kf.P = kf.P + reset
            elif nis > self.problem.huber_threshold:
                R = R * (nis / self.problem.huber_threshold)
            kf.update(z[:, None], R=R, H=H)
            used.append((H, z, R))
        return used, reset

    def _decide(self, epoch: int, kind: int, nis: float) -> int:
        """Return `USED`, `REJECTED`, or `COVARIANCE_RESET` for a position after rejected ones."""
        time = float(self.problem.epochs.time[epoch])
        if kind == POSITION_ROW and self.problem.epochs.withheld[epoch]:
            return REJECTED
        if nis <= self.gates[kind]:
            decision = USED
        elif kind != POSITION_ROW:
            return REJECTED
        else:
            self.rejected_since = time if self.rejected_since is None else self.rejected_since
            decision = REJECTED if time - self.rejected_since < self.reset_s else COVARIANCE_RESET
        if kind == POSITION_ROW and decision != REJECTED:
            self.rejected_since = None
        return decision


def covariance_reset(innovation: Array, seconds: float, n: int) -> Array:
    """Return what a reset adds to the covariance (n, n), (T.23).

    Parameters
    ----------
    innovation : (3,) of the position, m in l.
    seconds : for how long positions were rejected.
    n : number of states.
    """
    added = np.zeros(n)
    added[POS] = innovation**2
    added[VEL] = (innovation / seconds) ** 2
    tilt2 = float(np.sum(innovation[:2] ** 2)) / (HALF_GRAVITY * seconds**2) ** 2
    added[PSI] = min(tilt2, LARGEST_TILT2)
    return np.diag(added)
