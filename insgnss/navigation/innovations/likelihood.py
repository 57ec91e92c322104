r"""Likelihood of a segment's innovations as a function of its noise, with exact slopes.

It is cheap to evaluate many times.

The segment is linearised once about its smoothed solution (`navigation.filter.filter`, K.6).
Transitions, measured rows and the innovations of the nominal then do not depend on the noise, and
process noise, a-priori covariance and measurement noise are linear in variances v:

    Q_k = Q_k0 + sum_i v_i Q_ki,     P_0 = P_00 + sum_i v_i P_0i,     R_k = v_i R_k0           (L.1)

    white noise of a triad      a share of Q among the navigation states, by (E.7) with that white
                                noise alone
    driving noise of a triad    (E.6) with those states' driving noise alone; Gauss-Markov processes
                                start stationary, so P_0 as well
    errors of the fixes         R of positions, of velocities; of a time-correlated error, Q and P_0
                                of its states                                                 (L.2)

Parameters are theta_i = log f_i, with f_i the factor of a root density or sigma, v_i = f_i^2. (L.3)
With S and y the variance and the innovation of each scalar of a triple whitened by R_k0 (Schweppe
1965), as in (C.1),

    -2 log L = sum over used triples [ log det R_k0 + sum (log S + y^2 / S) ]
               + (gate + log det R_k) for each rejected                                        (L.4)

Slopes go along with the filter (Gupta and Mehra 1974). A scalar update with row h, variance r, gain
k = P h' / S and b = P' h', primes on P, m, r, S, y being derivatives with respect to one theta:

    S' = h b + r',    y' = -h m',    P' <- P' - k b' - b k' + k S' k',
    m' <- m' + (b - k S') y / S + k y'
    d(-2 log L) = S'/S (1 - y^2/S) + 2 y y'/S,
    expected second derivative  S_i' S_j' / S^2 + 2 y_i' y_j' / S                              (L.5)

Twice the inverse of the latter is the covariance of the maximum's theta. Which triples are
rejected, and how far the covariance is reset (K.7), is decided at each evaluation as the filter
does; (L.5) holds the decisions.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from ...base.errors import UsageError
from ...records import Array
from ..filter.codes import (
    BIAS,
    IMU0,
    N_NAV,
    NO_CONSTRAINT,
    NOT_MEASURED,
    POS,
    POSITION_ROW,
    PSI,
    REJECTED,
    USED,
    VEL,
    VELOCITY_ROW,
)
from ..filter.filter import forward_inputs, measured_kinds
from ..filter.kernels.records import ForwardOptions
from ..filter.layout import StateLayout
from ..filter.problem import EstimationProblem, with_epochs
from ..filter.solution import Solution
from ._kernels import Linear, linearise_segment, run_linear

WHITE = {
    "gyro.white_noise": slice(0, 3),
    "accel.white_noise": slice(3, 6),
    "white_noise": slice(0, 6),
}  # the last: one factor for both
DRIVEN = {"gyro.driving_noise": (0, 1, 2), "accel.driving_noise": (3, 4, 5)}
CORRELATED = "fixes.correlated"
CORRELATED_STATES = {
    CORRELATED: "gm",
    "fixes.unfixed_correlated": "unfixed_gm",
    "fixes.velocity_correlated": "velocity_gm",
}
FIX_PARAMETERS = {"fixes.position": POSITION_ROW, "fixes.velocity": VELOCITY_ROW}
IMU_PARAMETERS = (*WHITE, *DRIVEN)
LIKELIHOOD_PARAMETERS = (*IMU_PARAMETERS, *FIX_PARAMETERS, *CORRELATED_STATES)
# of the start, as `navigation.align.initial` has it
WIDEN, FLOOR_RAD, WIDE_M, WIDE_MS = 10.0, np.radians([0.5, 0.5, 1.0]), 10.0, 5.0


@dataclass(frozen=True)
class Evaluated:
    """The likelihood (L.4) at theta, with its slopes.

    Parameters
    ----------
    cost : float
        -2 log L.
    gradient : ndarray, (p,)
        Its gradient.
    information : ndarray, (p, p)
        Its expected second derivative.
    white : ndarray, (k, 3)
        Whitened innovations of the used positions, first components first, of all segments in turn.
    nis : ndarray, (k,)
        Normalised innovations squared of all positions.
    rejected, offered : int
        Numbers of positions.
    """

    cost: float
    gradient: Array
    information: Array
    white: Array
    nis: Array
    rejected: int
    offered: int


@dataclass(frozen=True)
class LinearSegment:
    """A segment linearised about its solution, ready for `evaluate`.

    Parameters
    ----------
    names : tuple of str
        Parameters, in the order of theta.
    linear : Linear
        The linearised segment.
    of_part, of_kind : ndarray of int
        The parameter of each component of the noise and of each kind of measurement, or -1.
    """

    names: tuple[str, ...]
    linear: Linear
    of_part: np.ndarray
    of_kind: np.ndarray


def one_factor_each(names: Sequence[str]) -> None:
    """Refuse two names that are factors of one density.

    Raises
    ------
    UsageError
        Where two of `names` are factors of one density.
    """
    if "white_noise" in names and {"gyro.white_noise", "accel.white_noise"} & set(names):
        raise UsageError(
            "noise parameter 'white_noise' is one factor for gyros and accelerometers; ask for it"
            " or for theirs, not for both"
        )


def available(layout: StateLayout, velocity: bool) -> tuple[str, ...]:
    """Return the parameters that a layout of states has.

    Parameters
    ----------
    layout : StateLayout
        Layout of the filter's states.
    velocity : bool
        Whether velocities are measured.

    Returns
    -------
    tuple of str
        Those of `LIKELIHOOD_PARAMETERS` that act on it.
    """
    driven = {name: _driven_states(layout, name).any() for name in (*DRIVEN, *CORRELATED_STATES)}
    white = {name: bool(layout.white[channels].any()) for name, channels in WHITE.items()}
    return tuple(
        name
        for name in LIKELIHOOD_PARAMETERS
        if {**white, **driven, "fixes.position": True, "fixes.velocity": velocity}[name]
    )


def _driven_states(layout: StateLayout, name: str) -> np.ndarray:
    """Return the states (ns,) bool whose driving noise parameter `name` scales."""
    if name in CORRELATED_STATES:
        states = np.zeros(len(layout.states), dtype=np.bool_)
        first = getattr(layout, CORRELATED_STATES[name])
        if first >= 0:
            states[first : first + 3] = True
        return states
    return (layout.drive > 0.0) & (layout.factor == BIAS) & np.isin(layout.channel, DRIVEN[name])


def linear_segment(solution: Solution, names: Sequence[str]) -> LinearSegment:
    """Linearise a solved segment about its smoothed states, its noise parted by `names`.

    Parameters
    ----------
    solution : Solution
        A smoothed solution.
    names : sequence of str
        Parameters, in the order of theta (L.1, L.2).

    Returns
    -------
    LinearSegment
        The linearised segment.

    Raises
    ------
    UsageError
        For a name that is not among `available`, and for two factors of one density.
    """
    problem, measured = _measured_alone(solution.problem)
    ep, layout = problem.epochs, problem.layout
    possible = available(layout, bool(ep.has_velocity.any()))
    one_factor_each(names)
    for name in names:
        if name not in possible:
            raise UsageError(
                f"noise parameter {name!r} does not exist in the filter of this flight; use"
                f" {', '.join(possible)}"
            )
    driven = [name for name in names if name in DRIVEN or name in CORRELATED_STATES]
    parts = [*driven, *(name for name in names if name in WHITE)]
    intervals, imu, earth, lever, decided_by = forward_inputs(problem, closed_loop=False)
    white, drive = (np.tile(density, (1 + len(parts), 1)) for density in (imu.white, imu.drive))
    white[1:], drive[1:] = 0.0, 0.0
    P0 = np.zeros((1 + len(driven), layout.size, layout.size))
    P0[0] = _start(solution)
    for k, name in enumerate(parts, start=1):
        if name in WHITE:
            white[k, WHITE[name]] = layout.white[WHITE[name]]
            white[0, WHITE[name]] -= layout.white[WHITE[name]]
            continue
        states = _driven_states(layout, name)
        drive[k, states], drive[0, states] = drive[0, states], 0.0
        stationary = IMU0 + np.flatnonzero(states & (layout.beta > 0.0))
        P0[k, stationary, stationary] = P0[0, stationary, stationary]
        P0[0, stationary, stationary] = 0.0
    of_state = np.argmax(drive[: len(P0)] > 0.0, axis=0)
    nav, x = solution.nav[measured], solution.x[measured]
    linear = _linear(problem, len(parts) + 1, P0, of_state, -x[0], decided_by)
    imu = imu._replace(white=white, drive=drive)
    linearise_segment(intervals, ep, imu, earth, lever, nav, x, linear)
    linear.there[ep.withheld] &= linear.kind != POSITION_ROW
    index = {name: i for i, name in enumerate(names)}
    of_part = np.array([-1, *(index[name] for name in parts)], dtype=np.int64)
    kinds = {kind: index.get(name, -1) for name, kind in FIX_PARAMETERS.items()}
    of_kind = np.array([kinds.get(int(kind), -1) for kind in linear.kind], dtype=np.int64)
    return LinearSegment(tuple(names), linear, of_part, of_kind)


def _start(solution: Solution) -> Array:
    """Return the a-priori covariance (n, n).

    The attitude is as the solution has it, widened; position and velocity are unknown; the IMU is
    as the model has it.
    """
    layout = solution.problem.layout
    P = np.diag(np.concatenate([np.zeros(N_NAV), layout.sigma0]) ** 2)
    spread = np.sqrt(np.trace(solution.problem.epochs.position_cov[0]))
    P[POS, POS] = np.eye(3) * max(WIDE_M, 10.0 * spread) ** 2
    P[VEL, VEL] = np.eye(3) * max(WIDE_MS, 2.0 * spread) ** 2
    P[PSI, PSI] = WIDEN**2 * solution.nav_covariance(slice(1))[0, PSI, PSI] + np.diag(FLOOR_RAD**2)
    return P


def _measured_alone(problem: EstimationProblem) -> tuple[EstimationProblem, np.ndarray | slice]:
    """Return the problem without epochs that measure nothing, and the epochs that are left.

    Where these are fewer they stay, so that the epochs are those of the filter; of a camera that is
    much faster than the fixes they would take most of the memory.
    """
    ep = problem.epochs
    needed = ep.has_position | ep.has_velocity | (ep.constraint != NO_CONSTRAINT)
    needed |= (ep.zaru_variance > 0.0) | (ep.barometer_variance > 0.0)
    needed |= (ep.gap > 0.0).any(axis=1) | (ep.bias_step > 0.0).any(axis=1)
    needed |= ep.linear_cov.any(axis=(1, 2, 3))
    needed[[0, -1]] = True
    index = np.flatnonzero(needed)
    if 2 * index.size >= needed.size:
        return problem, slice(None)
    inc = problem.inc
    increments = replace(
        inc, marks=inc.marks[index], stop=inc.stop[index], rate=inc.rate[index], bridged=None
    )
    return with_epochs(problem, index, increments), index


def _linear(
    problem: EstimationProblem,
    parts: int,
    P0: Array,
    of_state: np.ndarray,
    mean0: Array,
    decided_by: ForwardOptions,
) -> Linear:
    """Allocate a segment that is to be linearised."""
    ep, layout = problem.epochs, problem.layout
    present, columns = measured_kinds(ep, layout)
    kind = np.flatnonzero(present)
    m, n, k, driven = ep.stop.size, layout.size, kind.size, len(P0)
    return Linear(
        P0=P0,
        mean0=np.concatenate([np.zeros(N_NAV), mean0]),
        gate=float(problem.gate),
        reset_s=decided_by.reset_after,
        time=ep.time,
        F=np.zeros((m, N_NAV, n)),
        D=np.zeros((m, n - N_NAV)),
        gap=np.zeros((m, n)),
        Q=np.zeros((m, parts, N_NAV, N_NAV)),
        Q_cross=np.zeros((m, N_NAV, n - N_NAV)),
        of_state=of_state,
        Q_states=np.zeros((m, driven, n - N_NAV)),
        kind=kind,
        there=np.zeros((m, k), dtype=np.bool_),
        H=np.zeros((m, k, 3, n)),
        nu=np.zeros((m, k, 3, 1)),
        R=np.zeros((m, k, 3, 3)),
        used=columns[kind].astype(np.int64),
    )


def evaluate(
    segments: Sequence[LinearSegment], theta: Array, free: np.ndarray | None = None
) -> Evaluated:
    """Evaluate (L.4) and (L.5) of all segments together.

    Parameters
    ----------
    segments : sequence of LinearSegment
        The segments.
    theta : ndarray, (p,)
        Logarithms of the factors (L.3).
    free : ndarray of bool, (p,), optional
        The parameters whose slopes are wanted, each of which costs as much as the likelihood; those
        of the others are NaN. All where it is left out.

    Returns
    -------
    Evaluated
        The likelihood and its slopes.
    """
    free = np.ones(theta.size, dtype=np.bool_) if free is None else free
    slope_of = np.where(np.append(free, False), np.cumsum(np.append(free, False)) - 1, -1)
    p = int(np.count_nonzero(free))
    total, cost = np.zeros((1 + p, p)), 0.0
    # the last, of index -1, is that of what stays as it is
    variance = np.exp(2.0 * np.append(theta, 0.0))
    every: list[tuple[Array, Array, np.ndarray]] = []
    for s in segments:
        m, k = s.linear.there.shape
        white, nis = np.empty((m, k, 3)), np.empty((m, k))
        verdict = np.zeros((m, k), dtype=np.int64)
        share, scale = variance[s.of_part], variance[s.of_kind]
        of_part, of_kind = slope_of[s.of_part], slope_of[s.of_kind]
        cost += run_linear(s.linear, share, of_part, scale, of_kind, total, white, nis, verdict)
        measured = verdict[:, POSITION_ROW] != NOT_MEASURED
        every.append((white[measured, 0], nis[measured, 0], verdict[measured, 0]))
    white, nis, verdict = (np.concatenate([arrays[i] for arrays in every]) for i in range(3))
    rejected = int(np.count_nonzero(verdict == REJECTED))
    slopes = np.full((1 + theta.size, theta.size), np.nan)
    slopes[np.ix_(np.append(True, free), free)] = total
    return Evaluated(cost, slopes[0], slopes[1:], white[verdict == USED], nis, rejected, nis.size)
