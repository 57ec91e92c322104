"""What a solution says of the constants and the GNSS errors that it estimates besides biases.

A state is observed where the flight reduces its standard deviation to less than a third of the
a-priori one.
"""

from collections.abc import Collection, Mapping, Sequence
from types import MappingProxyType

import numpy as np

from ...records import Array, Estimate, TimeCorrelatedError
from ...records.states import State
from ..filter.codes import (
    BIAS,
    COVARIANCE_RESET,
    DRIFT_CODE,
    NAV,
    NOT_MEASURED,
    POSITION_ROW,
    REJECTED,
    TEMPERATURE_CODE,
    VEL,
)
from ..filter.solution import Solution

MOVED_SIGMAS = 2.0  # of a constant that is zero, which 5 % of flights reach
MOVED_M = 0.01  # smaller errors move images by less than two of their sigmas
# s: 15 mm at 15 m/s; a smaller sigma states an IMU on the receiver's PPS, which has no rate
MOVED_S = 1e-3
BESIDE_RATE = 3e-5  # s/s, a-priori sigma of a clock's rate: tolerance of a quartz
UNSEEN_RATE = 1e-5  # s/s, where nothing speaks for one: more would spoil good flights in circles
UNDETERMINED = 0.7  # of the a-priori sigma of an offset: the flight tells no more than that did


def constant(solution: Solution, state: int) -> tuple[float, float]:
    """Return the smoothed value of a constant error state and its sigma, at the last epoch.

    Parameters
    ----------
    solution : Solution
        The solved flight.
    state : int
        The index of the state among those behind navigation, as `StateLayout` counts them.

    Returns
    -------
    tuple of float
        Value and standard deviation, SI.
    """
    row = NAV.stop + state
    variance = max(float(solution.variance(np.array([-1]))[0, row]), 0.0)
    return float(solution.x[-1, state]), float(np.sqrt(variance))


def has_moved(solution: Solution, state: int, least: float) -> bool:
    """Tell whether the smoothed value of a constant error state has left zero.

    Parameters
    ----------
    solution : Solution
        The solved flight.
    state : int
        The index of the state among those behind navigation.
    least : float
        The smallest value that counts, SI.

    Returns
    -------
    bool
        Whether it is beyond that and `MOVED_SIGMAS` of its sigma.
    """
    value, sigma = constant(solution, state)
    return abs(value) > max(least, MOVED_SIGMAS * sigma)


def missing_rate(solution: Solution) -> float:
    """Return which rate the clock of the fixes may have beside a time offset without one.

    Parameters
    ----------
    solution : Solution
        The solved flight.

    Returns
    -------
    float
        Its a-priori sigma, s/s: `BESIDE_RATE` where the offset is beyond its a-priori sigma,
        `UNSEEN_RATE` where the flight, a straight one say, does not determine it; 0 where neither,
        or the sigma of the offset states that the clocks are synchronised.
    """
    layout, offset = solution.problem.layout, solution.problem.layout.offset
    prior = float(layout.sigma0[offset])
    if offset < 0 or layout.rate >= 0 or prior < MOVED_S:
        return 0.0
    if has_moved(solution, offset, prior):
        return BESIDE_RATE
    length_s = float(solution.time[-1] - solution.time[0])
    moves_m = UNSEEN_RATE * length_s * rms_speed(solution)
    undetermined = constant(solution, offset)[1] > UNDETERMINED * prior and moves_m > MOVED_M
    return UNSEEN_RATE if undetermined else 0.0


def constant_states(
    solution: Solution, stated: Mapping[str, float] = MappingProxyType({})
) -> list[int]:
    """Return the states of a solution that are constants besides biases.

    Parameters
    ----------
    solution : Solution
        The solved flight.
    stated : mapping of str to float
        A-priori sigma of groups of constants that are carried as the flight file states them and
        were not asked for; they are left out.

    Returns
    -------
    list of int
        Their indices among the states behind navigation.
    """
    layout = solution.problem.layout
    return [
        s
        for s, state in enumerate(layout.states)
        if layout.beta[s] == 0.0
        and layout.drive[s] == 0.0
        and layout.factor[s] not in (BIAS, DRIFT_CODE, TEMPERATURE_CODE)
        and layout.sigma0[s] > stated.get(state.group, -np.inf)
    ]


def state_verdicts(
    solution: Solution,
    moved_s: float = 0.0,
    stated: Mapping[str, float] = MappingProxyType({}),
    requested: Collection[str] | None = None,
) -> tuple[Estimate, ...]:
    """Judge all constants that the flight estimates besides biases.

    Parameters
    ----------
    solution : Solution
        The solved flight.
    moved_s : float
        By how much the stamps of the fixes were moved before, s; a part of the time offset.
    stated : mapping of str to float
        A-priori sigma of groups of constants that are carried as the flight file states them and
        were not asked for; they are left out.
    requested : collection of str, optional
        Groups of those that the flight file asks for; all by default.

    Returns
    -------
    tuple of Estimate
        Value, sigma and observability of each constant.
    """
    layout = solution.problem.layout
    speed, length_s = rms_speed(solution), float(solution.time[-1] - solution.time[0])
    verdicts = []
    for s in constant_states(solution, stated):
        state = layout.states[s]
        (value, sigma), prior = constant(solution, s), float(layout.sigma0[s])
        moves_m = None
        if layout.lever >= 0 and layout.lever <= s < layout.lever + 3:
            moves_m = sigma
        elif s == layout.offset:
            value, moves_m = value + moved_s, sigma * speed
        elif s == layout.rate:
            moves_m = sigma * length_s * speed
        of_file = requested is None or state.group in requested
        estimate = Estimate(state, value, sigma, prior, moves_m, of_file)
        if 0 <= layout.barometer == s - 1 and not estimate.observed:
            continue  # at one height nobody asks for it
        verdicts.append(estimate)
    return tuple(verdicts)


def time_correlated_errors(solution: Solution) -> tuple[TimeCorrelatedError, ...]:
    """List the time-correlated GNSS errors among the states.

    Parameters
    ----------
    solution : Solution
        The solved flight.

    Returns
    -------
    tuple of TimeCorrelatedError
        That of all fixes, and that of the fixes whose errors stay for minutes, as far as estimated.
    """
    layout, epochs = solution.problem.layout, solution.problem.epochs
    both_groups = (
        (layout.gm, layout.white_scale, 0),
        (layout.unfixed_gm, (layout.unfixed_white_scale,) * 3, 1),
    )
    errors = []
    for first, white, least_group in both_groups:
        rows = epochs.has_position & (epochs.group >= least_group)
        if first < 0 or not rows.any():
            continue
        share = layout.sigma0[first : first + 3]
        sigma_m = share * usual_sigma(epochs.position_cov[rows])
        triples = (tuple(float(x) for x in values) for values in (sigma_m, share, white))
        errors.append(
            TimeCorrelatedError(float(1.0 / layout.beta[first]), int(rows.sum()), *triples)
        )
    return tuple(errors)


def fix_counts(verdict: np.ndarray) -> tuple[int, int, int]:
    """Return how many fixes a filter was offered and rejected, and how often it was reset.

    Parameters
    ----------
    verdict : ndarray
        (m, kinds) the verdicts of a solution or of a filter's history.

    Returns
    -------
    tuple of int
        Positions that were measured, that were rejected, and covariance resets after such ones.
    """
    of_positions = verdict[:, POSITION_ROW]
    kinds = of_positions != NOT_MEASURED, of_positions == REJECTED, of_positions == COVARIANCE_RESET
    offered, rejected, resets = (int(np.count_nonzero(kind)) for kind in kinds)
    return offered, rejected, resets


def rms_speed(solution: Solution) -> float:
    """Return the root mean square speed of the flight, m/s."""
    return float(np.sqrt(np.mean(np.sum(solution.nav[:, VEL] ** 2, axis=1))))


def usual_sigma(cov: Array) -> Array:
    """Return the median standard deviations (3,), m, of fixes with covariances (n, 3, 3), m^2."""
    return np.sqrt(np.median(np.diagonal(cov, axis1=1, axis2=2), axis=0))


def combine_estimates(of_segments: Sequence[Sequence[Estimate]]) -> tuple[Estimate, ...]:
    """Return the estimates of several segments of one flight as one each, by their weights.

    Each is a correction of the flight file's one value, whatever a segment was solved with. Where
    segments differ by more than their sigmas, the sigma of the mean grows by as much, as in (T.2)
    of `batch.season.trends`.

    Parameters
    ----------
    of_segments : sequence of sequence of Estimate
        What each segment says, independently of the others.

    Returns
    -------
    tuple of Estimate
        One of each constant, in the order in which they first occur.
    """
    by_state: dict[State, list[Estimate]] = {}
    for estimates in of_segments:
        for one in estimates:
            by_state.setdefault(one.state, []).append(one)
    joined = []
    for state, several in by_state.items():
        weight = np.array([one.sigma**-2 for one in several])
        values = np.array([one.value for one in several])
        mean = float(weight @ values / weight.sum())
        excess = float(weight @ (values - mean) ** 2) / max(1, len(several) - 1)
        sigma = float((max(1.0, excess) / weight.sum()) ** 0.5)
        joined.append(Estimate(state, mean, sigma))
    return tuple(joined)
