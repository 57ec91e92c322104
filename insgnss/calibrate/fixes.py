"""What the innovations say of the fixes: correlated errors, a lever arm and a time offset that are not what the flight file has.

A filter whose models hold leaves innovations that are white and as large as it says. Where they are not, three causes come first, and
all of them are states (`navigation.layout.FixErrors`). Estimated together on this very flight they explain each other's share:

    lever arm dl and time offset d       moving the antenna by C_lb dl and v d: seen in turns and in changes of speed
    errors of the fixes themselves       white, k times the sigma of each fix, and a Gauss-Markov process, c times it, that lasts for T

k, c (times a ratio for heights) and T are those of the largest likelihood of the innovations (Schweppe 1965), with S their variances in
whitened units,

    -2 log L = sum over used fixes [ sum (log S_i + y_i^2 / S_i) + log det k^2 R ] + (gate + log det k^2 R) for each rejected      (C.1)

over a stretch of at most `FIXES` fixes. A correlated error is believed where it gains more than `GAIN` in -2 log L. Over such a stretch
the fixes tell how fast the error moves, c^2 / T, better than how far: along that ridge c and T go towards what the file claims,
k^2 + c^2 = 1, as long as the likelihood allows it and k alone does not exhaust the claim. What lasts longer
than the stretch (a wrong base coordinate, the ionosphere of a single-point solution) leaves no trace in innovations.

A state is observed where the flight reduces its standard deviation to less than a third of the a-priori one. A lever arm or time
offset that is taken as known, and comes out different by more than five sigma and by more than the fixes' own sigma, contradicts
the flight file; a lever arm that the flight determines to no better than `DETERMINED_M`, or that is off by less than `TOLD_M`, does not,
and is told only: slow errors of PPK fixes of some millimetres, which their sigmas do not hold, make such ones up.
"""

from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np

from ..errors import DataError
from ..navigation.filter import NOTHING, POSITION, REJECTED, REOPENED, Problem, Start, make_store, part, run_filter
from ..navigation.layout import BIAS, DRIFT, VEL, FixErrors, StateLayout
from ..navigation.solution import Solution
from ..orient.mounting import Mounting
from ..records import Array, Check, LastingError, StateVerdict
from .result import OBSERVED

FIXES = 900
GAIN = 20.0
FEW = 60
GUESSES = ((0.6, 1.0, 20.0), (1.0, 1.0, 20.0), (1.0, 3.0, 20.0), (0.3, 0.7, 20.0), (0.4, 0.8, 3.0))  # k, c, T (s) to start from
CODE_GUESSES = ((0.1, 0.2, 10.0),)
MORE_LOST, LESS_SURE = 0.01, 1.6
WHITE_CLAIM = 0.5  # k^2 beyond which the file's claim is of the uncorrelated error alone
BEYOND = 8.0  # of a logarithm: a factor of 3000 about the start is no error of a fix any more
FAR = np.log(6.0)  # of T, where the search begins again
RIDGE, DOUBTFUL = np.log(1.3), 1.0  # step of T along c^2 / T; rise of -2 log L that one sigma makes
LONGEST_S, LEAST_WHITE, LEAST_CODE = 600.0, 0.2, 0.03  # bounds of T and k: a fix is not believed to less than a fifth of its sigma
SUSPECT_M, SUSPECT_S = 1.0, 0.3  # a-priori sigmas of lever arm and time offset in the search
CLOCK_RATE = 1e-4  # of a quartz that nothing disciplines
SIGNIFICANT, MATTERS = 5.0, 1.0  # sigmas of the estimate, and of the fixes
DETERMINED_M = 0.05  # sigma of a lever arm beyond which slow errors of the fixes that nobody claims can make it up
TOLD_M = 0.02  # of a lever arm, below which it does not stop a run; a right one came out 11 mm off on a simulated flight from RINEX

LayoutWith = Callable[[FixErrors], StateLayout]


def suspicious(solution: Solution, layout_with: LayoutWith, known: FixErrors) -> bool:
    """Whether correlated errors, or a lever arm and a time offset, explain the innovations of a lively stretch better by `GAIN` in (C.1).

    known : what is estimated already.
    """
    if np.count_nonzero(solution.verdict[:, POSITION] != NOTHING) < FEW:
        return False
    problem, start = _window(solution)
    tried = [suspects(known)]
    if known.correlated is None:
        tried += [_errors(known, *guess) for guess in (CODE_GUESSES if _code(problem) else GUESSES)]
    cost = [_minus_two_log_likelihood(*with_layout(problem, start, layout_with(errors))) for errors in (known, *tried)]
    return cost[0] - min(cost[1:]) > GAIN


def suspects(known: FixErrors) -> FixErrors:
    """`known` with lever arm, time offset and its rate as states."""
    lever, offset = known.lever_arm_m or SUSPECT_M, known.time_offset_s or SUSPECT_S
    return replace(known, lever_arm_m=lever, time_offset_s=offset, clock_rate=known.clock_rate or CLOCK_RATE)


def with_layout(problem: Problem, start: Start, layout: StateLayout) -> tuple[Problem, Start]:
    """The same problem with the states of `layout`, those that it had before as they were."""
    old = problem.layout
    place = [old.names.index(name) if name in old.names else -1 for name in layout.names]
    kept = np.array([s for s, k in enumerate(place) if k >= 0], dtype=np.int64)
    source = np.array([k for k in place if k >= 0], dtype=np.int64)
    x, mean = np.zeros(layout.size - 9), np.zeros(layout.size)
    P = np.diag(np.concatenate([np.zeros(9), layout.sigma0**2]))
    x[kept], mean[:9], mean[9 + kept] = start.x[source], start.mean[:9], start.mean[9 + source]
    rows, columns = np.concatenate([np.arange(9), 9 + kept]), np.concatenate([np.arange(9), 9 + source])
    P[np.ix_(rows, rows)] = start.P[np.ix_(columns, columns)]
    return replace(problem, layout=layout), Start(start.nav, x, mean, P)


def correlated_error(solution: Solution, layout_with: LayoutWith, known: FixErrors) -> FixErrors | None:
    """`known` with correlated error and scale of the fixes' sigmas by (C.1), or None where they explain the innovations no better.

    known : the errors of the fixes that are estimated in any case.
    """
    problem, start = _window(solution)
    interval, code = problem.aiding_interval_s, _code(problem)
    least = LEAST_CODE if code else LEAST_WHITE

    def errors(p: Array) -> FixErrors:
        k, c, T, ratio = np.exp(p)
        return _errors(known, max(k, least), c, float(np.clip(T, interval, LONGEST_S)), ratio)

    def cost(p: Array) -> float:
        if np.abs(p).max() > BEYOND:
            return 1e12
        return _minus_two_log_likelihood(*with_layout(problem, start, layout_with(errors(p))))

    without = _minus_two_log_likelihood(*with_layout(problem, start, layout_with(known)))
    guesses = [np.log([*guess, 1.0]) for guess in (CODE_GUESSES if code else GUESSES)]
    first = min(guesses, key=cost)
    best = _descend(cost, first)
    again = _descend(cost, best.x + [0.0, 0.5 * FAR, FAR, 0.0])  # along the ridge: the first may have ended in a hollow
    best = min(best, again, key=lambda found: float(found.fun))
    if without - best.fun < GAIN:
        return None
    p = best.x
    while not code:  # towards what the fixes claim
        claim = np.exp(2.0 * p[0]) + np.exp(2.0 * p[1])
        step = np.sign(1.0 - claim) * np.array([0.0, 0.5 * RIDGE, RIDGE, 0.0])
        after = np.exp(2.0 * p[0]) + np.exp(2.0 * (p[1] + step[1]))
        passes = abs(np.log(after)) > abs(np.log(claim))
        if (
            (claim > 1.0 and np.exp(2.0 * p[0]) > WHITE_CLAIM)
            or passes
            or (p + step)[2] > np.log(LONGEST_S)
            or cost(p + step) > best.fun + DOUBTFUL
        ):
            break
        p = p + step
    return errors(p)


def _descend(cost: Callable[[Array], float], first: Array) -> Any:
    """Nelder and Mead's minimum of `cost` of log k, c, T and the ratio of heights."""
    from scipy.optimize import minimize

    simplex = first + np.array([[0.0, 0, 0, 0], [-1.0, 0, 0, 0], [0, -1.0, 0.7, 0], [-0.5, 0.5, -1.5, 0], [-0.3, 0, 0, -0.7]])
    return minimize(cost, first, method="Nelder-Mead", options={"initial_simplex": simplex, "maxfev": 60, "xatol": 0.05, "fatol": 1.0})


def _errors(known: FixErrors, k: float, c: float, time_s: float, ratio: float = 1.0) -> FixErrors:
    """`known` with an uncorrelated error of k and a correlated one of c standard deviations, times `ratio` in height."""
    return replace(
        known, correlated=(c, c, c * ratio), correlation_time_s=time_s, scale=(k, k, k * ratio), lasting_scale=min(k, known.lasting_scale)
    )


def _code(problem: Problem) -> bool:
    """Whether the errors of all fixes stay for minutes."""
    return bool((problem.epochs.group[problem.epochs.has_position] == 1).all())


def _window(solution: Solution) -> tuple[Problem, Start]:
    """The stretch of `FIXES` fixes in which the velocity varies most as a problem of its own, started at what is known there."""
    at = np.flatnonzero(solution.problem.epochs.has_position)
    count = min(FIXES, at.size - 1)
    v = solution.nav[at, 3:6]
    sums = np.cumsum(np.concatenate([np.zeros((1, 6)), np.hstack([v, v**2])]), axis=0)
    moments = (sums[count:] - sums[:-count]) / count
    k = int(np.argmax(np.sum(moments[:, 3:] - moments[:, :3] ** 2, axis=1)[: at.size - count]))
    first, last = at[k], at[k + count]
    P = 9.0 * solution.P[first]
    P[:6, :6] += np.eye(6)
    nav, x = solution.nav[first], solution.x[first].copy()
    layout = solution.problem.layout
    if layout.rate >= 0:  # time begins anew in the window
        x[layout.offset] += x[layout.rate] * solution.problem.epochs.time[first]
    window = replace(part(solution.problem, int(first), int(last)), doubt=np.inf)  # (C.1) knows no weights
    return window, Start(nav, x, np.zeros(P.shape[0]), P)


def loses_fixes(solution: Solution, before: Solution) -> bool:
    """Whether it rejects a hundredth of the fixes more than `before`, or was opened (K.7) more often."""
    count = [[np.count_nonzero(s.verdict[:, POSITION] == kind) for kind in (REJECTED, REOPENED)] for s in (solution, before)]
    (rejected, reopened), (few, seldom) = count
    offered = np.count_nonzero(before.verdict[:, POSITION] != NOTHING)
    return bool(rejected > few + MORE_LOST * offered or reopened > seldom)


def less_sure(errors: FixErrors) -> FixErrors:
    """The same with more of the fixes' error uncorrelated: heavy tails want it."""
    return replace(errors, scale=tuple(LESS_SURE * k for k in errors.scale), lasting_scale=LESS_SURE * errors.lasting_scale)


def misfit(solution: Solution) -> float:
    """(C.1) of the whole flight from the innovations of its triples, their correlations left out."""
    at = np.flatnonzero(solution.verdict[:, POSITION] != NOTHING)
    rejected = solution.verdict[at, POSITION] == REJECTED
    size = np.where(rejected, solution.problem.gate, np.minimum(solution.nis[at, 0], solution.problem.gate))
    return float(np.sum(size + 2.0 * np.sum(np.log(solution.innovation_sigma[at, :3]), axis=1)))


def _minus_two_log_likelihood(problem: Problem, start: Start) -> float:
    """(C.1)."""
    store = make_store(problem.epochs, problem.layout)
    try:
        run_filter(problem, start, store)
    except DataError:
        return 1e12
    at = np.flatnonzero(store.verdict[:, POSITION] != NOTHING)
    rejected = store.verdict[at, POSITION] == REJECTED
    log_R = np.linalg.slogdet(problem.epochs.position_cov[at])[1] + 2.0 * np.sum(np.log(_scales(problem)[at]), axis=1)
    S, y = store.S[at, :3], store.y[at, :3]
    S = np.where(rejected[:, None], 1.0, S)
    own = np.where(rejected, problem.gate, np.sum(np.log(S) + y**2 / S, axis=1))
    return float(np.sum(own + log_R))


def state_verdicts(solution: Solution, moved_s: float = 0.0) -> tuple[StateVerdict, ...]:
    """Verdicts on all constants that the flight estimates besides biases, from their smoothed values at the last epoch.

    moved_s : by how much the stamps of the fixes were moved before, a part of the time offset.
    """
    layout = solution.problem.layout
    speed = _speed(solution)
    out = []
    for s, name in enumerate(layout.names):
        if layout.beta[s] > 0.0 or layout.drive[s] > 0.0 or layout.factor[s] in (BIAS, DRIFT):
            continue
        value, sigma, prior = float(solution.x[-1, s]), float(np.sqrt(max(solution.P[-1, 9 + s, 9 + s], 0.0))), float(layout.sigma0[s])
        moves = None
        if layout.lever >= 0 and layout.lever <= s < layout.lever + 3:
            moves = sigma
        elif s == layout.offset:
            value, moves = value + moved_s, sigma * speed
        out.append(StateVerdict(name, value, sigma, prior, moves, sigma < OBSERVED * prior))
    return tuple(out)


def contradictions(solution: Solution, mounting: Mounting, lever_known: bool, offset_known: bool) -> list[Check]:
    """Checks "antenna lever arm" and "GNSS time offset" where `solution` estimates what the flight file takes as known.

    mounting : of the flight file, in whose axes the advice is.
    """
    layout, ep = solution.problem.layout, solution.problem.epochs
    fix = _fix_sigma(ep.position_cov[ep.has_position]).max()
    found = []
    if lever_known and layout.lever >= 0:
        at = slice(layout.lever, layout.lever + 3)
        value, sigma = solution.x[-1, at], np.sqrt(np.diag(solution.P[-1, 9:, 9:])[at])
        off = np.abs(value) > np.maximum(SIGNIFICANT * sigma, MATTERS * fix)
        if off.any():
            determined = bool((off & (sigma < DETERMINED_M) & (np.abs(value) > TOLD_M)).any())
            antenna = mounting.antenna_m + mounting.C_cb @ value
            told = ", ".join(f"{v:+.3f} +- {s:.3f}" for v, s in zip(value, sigma, strict=True))
            what = f"from the IMU off by forward, right, down {told} m"
            found.append(
                Check(
                    "antenna lever arm",
                    what,
                    f"within {SIGNIFICANT:g} sigma or {MATTERS * fix:.3f} m of the flight file's",
                    "contradiction" if determined else "note",
                    f"mounting.antenna_m = [{', '.join(f'{v:.3f}' for v in antenna)}] would be it (if imu_m is right), or set "
                    "filter.lever_arm = true to have it estimated",
                )
            )
    if offset_known and layout.offset >= 0:
        late, spread = float(solution.x[-1, layout.offset]), float(np.sqrt(solution.P[-1, 9 + layout.offset, 9 + layout.offset]))
        speed = _speed(solution)
        if abs(late) > SIGNIFICANT * spread and abs(late) * speed > MATTERS * fix:
            found.append(
                Check(
                    "GNSS time offset",
                    f"the fixes' stamps lack {late:+.4f} +- {spread:.4f} s, {abs(late) * speed:.2f} m at {speed:.1f} m/s",
                    f"within {SIGNIFICANT:g} sigma of none, or less than {MATTERS * fix:.3f} m",
                    "contradiction",
                    f"add {late:+.4f} to gnss.time_offset_s, or set filter.time_offset = true to have it estimated",
                )
            )
    return found


def _speed(solution: Solution) -> float:
    """Root mean square speed, m/s."""
    return float(np.sqrt(np.mean(np.sum(solution.nav[:, VEL] ** 2, axis=1))))


def _fix_sigma(cov: Array) -> Array:
    """Usual standard deviations (3,) m of fixes with covariances (n, 3, 3)."""
    return np.sqrt(np.median(np.diagonal(cov, axis1=1, axis2=2), axis=0))


def _scales(problem: Problem) -> Array:
    """(m, 3) factor of the sigmas of the uncorrelated error of each epoch's fix."""
    layout = problem.layout
    return np.where(problem.epochs.group[:, None] == 0, layout.scale, layout.lasting_scale)


def lasting_errors(solution: Solution) -> tuple[LastingError, ...]:
    """The correlated errors of the fixes among the states: of all fixes, and of those whose errors stay for minutes."""
    layout, ep = solution.problem.layout, solution.problem.epochs
    out = []
    for first, white, least in ((layout.coloured, layout.scale, 0), (layout.lasting, (layout.lasting_scale,) * 3, 1)):
        at = ep.has_position & (ep.group >= least)
        if first < 0 or not at.any():
            continue
        share = layout.sigma0[first : first + 3]
        fix = _fix_sigma(ep.position_cov[at])
        told = (tuple(float(x) for x in values) for values in (share * fix, share, white))
        out.append(LastingError(float(1.0 / layout.beta[first]), int(at.sum()), *told))
    return tuple(out)
