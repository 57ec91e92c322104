"""A clock that steps in mid flight: from some instant on the stamps are off by so much more.

A logger that loses a block of samples and counts on, a receiver that sets its clock, a leap second
that one side takes: the time offset of the fixes is one number before and another after. The search
for constants (`constants`) knows no such thing. It has an offset and a rate, and calls half a step
a rate, with all the evidence of the step.

Where an offset or a rate is suspected, or estimated, one pass with both as states follows beside
the filter what a step at each of `INSTANTS` instants does to the innovations (`sensitivity`): with
J and j of (Y.2) and D the sigma a priori, a step at t explains in log evidence

    F(t) = j^2 / (J + D^-2) / 2 - log(1 + J D^2) / 2                                          (Z.1)

beyond offset and rate. Two passes more look between the neighbours of the best instant, down to the
interval of the fixes. An IMU's clock that steps ahead leaves a gap in its stamps, which is bridged
as if the flight had gone on meanwhile. A logger that loses samples and counts on, or has those left
out whose stamps went back, leaves none: its stamps fall behind. Such a step puts the position off
by -v as well, so that flying straight on shows nothing of it. Each gap is a candidate besides, for
a step as long as it is, each instant one for lost samples.

The step is then tried: the fixes from t on are moved along the flight by

    z(t) <- z(t) - [p(t + s) - p(t)]                                                          (Z.2)

p the antenna of the solution, a gap is closed, and the flight is solved again, which is what mended
stamps would give. Of lost samples instant and length are looked for again by the misfit of the
whole flight, with as much time inserted, which is bridged and has the variance (G.1) of
`navigation.prepare.gaps`, worked out from the increments around. A step is shown where that follows
the fixes without a covariance reset, which fixes that jump to one side would need as well, and its
likelihood of all innovations (`evidence.misfit`) is better than that of whatever was adopted
without it by `SHOWN_GAIN`.
"""

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Literal

import numpy as np

from ...base.errors import DataError
from ...base.findings.remedies import Step
from ...geodesy.rotation import rotation_from_quaternion
from ...records import Array, Finding, Question
from ...records.interpolation import columns_at
from ..filter.blocks import BlockwisePasses
from ..filter.codes import (
    N_CHANNELS,
    N_NAV,
    NHC,
    POS,
    QUAT,
    VEL,
)
from ..filter.layout import StateLayout
from ..filter.problem import EstimationProblem, InitialState
from ..filter.solution import Solution, solve
from .advice import NEGLIGIBLE_M
from .candidates import FAR_FACTOR, WIDE_TIME_OFFSET_S, widen_layout, without_other_aiding
from .estimated import fix_counts, rms_speed
from .evidence import follows, misfit, misfit_of_pass
from .sensitivity import Constants, Sensitivity

WIDE_STEP_S = FAR_FACTOR * WIDE_TIME_OFFSET_S  # a-priori sigma of a step (s)
CLOCK_STEP = "clock step"
INSTANTS = 48  # of a pass, at which a step is looked for
REFINEMENTS = 3  # of which each looks at the neighbourhood of the best of the one before
INTERVALS_AROUND = 2  # intervals on either side that are looked at again
LACKING_INTERVALS = 1.5  # nominal ones, beyond which one is a gap (`navigation.prepare.gaps`)
GAPS = 16  # of the IMU, the longest, that may be a step of its clock
REFINED = 3  # times that the size is estimated with the fixes moved
# log evidence of a step beyond what was adopted without it. Of rates and offsets that are none the
# best of a hundred instants reaches 6 by chance, slow errors of the fixes somewhat more
SHOWN_GAIN = 20.0
EDGE_FIXES = 20  # on either side of a step, without which it is a matter of the ends
# s between instants that are tried for lost samples, from the one that (Z.1) shows on: as far as
# the misfit falls, and beyond by so many; then around the best, from one spacing to the next
SPACINGS_S, BEYOND = (2.0, 0.5, 0.1), 6
BRIDGED_AROUND_S = 30.0  # s on either side, whose motion shows how well lost samples are bridged
INSTANT_DECIMALS = 7  # decimals of a second, to which two instants are one


@dataclass(frozen=True)
class ClockStep:
    """A step of a clock that explains a flight.

    Parameters
    ----------
    before, after : float
        The last fix before it and the first one after, s, GPST.
    size, sigma : float
        What the stamps of the fixes lack from then on, more than before, and its sigma, s.
    evidence : float
        Logarithm, against what was adopted without a step.
    of_imu : bool
        Whether it is the IMU's clock that steps, as its stamps show.
    missing : int
        Number of the samples that the IMU lost, whose stamps count on without them.
    solution : Solution
        The flight with the fixes after it moved.
    """

    before: float
    after: float
    size: float
    sigma: float
    evidence: float
    of_imu: bool
    missing: int
    solution: Solution


def find_clock_step(
    problem: EstimationProblem,
    start: InitialState,
    layout: StateLayout,
    against: Solution | None,
    second_pass: Literal["auto", "on", "off"] = "auto",
    progress: Callable[[str], None] = lambda _: None,
) -> ClockStep | None:
    """Look for a step of a clock that explains a flight better than whatever was adopted.

    Parameters
    ----------
    problem, start : EstimationProblem, InitialState
        The flight, and the state that it starts from.
    layout : StateLayout
        Its states with a wide time offset of the fixes and its rate among them.
    against : Solution or None
        What was adopted without a step; None where there is no solution.
    second_pass : {"auto", "on", "off"}
        Of the solution with the step, as `navigation.filter.solution.solve` takes it.
    progress : callable
        Receives the name of each step.

    Returns
    -------
    ClockStep or None
        None where no step is shown, or where it moves the positions by less than matters.
    """
    progress("whether a clock steps")
    # fixes that were withheld for standing apart may do so by the step alone
    every = problem.epochs._replace(withheld=np.zeros_like(problem.epochs.withheld))
    problem = replace(problem, epochs=every)
    posed = widen_layout(problem, start, layout)
    try:
        candidate = _strongest(*posed)
        if candidate is None:
            return None
        mended = _with_samples if candidate.loses_samples else _refine_step
        stepped, since, step_s, sigma = mended(*posed, candidate)
        solution = solve(stepped, posed[1], second_pass, progress)
    except DataError:
        return None
    if fix_counts(solution.verdict)[2]:
        return None  # positions jump as well, or instead
    gained = np.inf if against is None else 0.5 * (misfit(against) - misfit(solution))
    if (
        not follows(solution)
        or gained < SHOWN_GAIN
        or abs(step_s) * rms_speed(solution) < NEGLIGIBLE_M
    ):
        return None
    missing = round(-step_s / problem.inc.nominal_s) if candidate.loses_samples else 0
    epochs, begin = problem.epochs, float(problem.inc.marks[0])
    fixes = epochs.time[epochs.has_position]
    k = int(np.searchsorted(fixes, since))
    before, after = begin + float(fixes[k - 1]), begin + float(fixes[k])
    of_imu = candidate.loses_samples or candidate.lapse is not None
    return ClockStep(before, after, step_s, sigma, float(gained), of_imu, missing, solution)


@dataclass(frozen=True)
class _Lapse:
    """A gap at which the clock of the IMU steps ahead.

    `epochs` are those that it was bridged at, `intervals` are put right, by `step_s` in all.
    """

    epochs: np.ndarray
    intervals: np.ndarray
    step_s: float


@dataclass(frozen=True)
class _Candidate:
    """What shows a step best: the instant, its size, and a gap or lost samples of the IMU."""

    solution: Solution
    since: float
    step_s: float
    lapse: _Lapse | None = None
    loses_samples: bool = False


def _strongest(problem: EstimationProblem, start: InitialState) -> _Candidate | None:
    """Return the instant that shows a step best; None where none shows one."""
    time, has = problem.epochs.time, problem.epochs.has_position
    fixes = time[has]
    if fixes.size < 2 * EDGE_FIXES:
        return None
    first, last = float(fixes[EDGE_FIXES]), float(fixes[-EDGE_FIXES])
    opened = _fixes_alone(problem)
    solution = solve(opened, start, "off", separations=0)
    velocity = solution.nav[:, VEL]
    gaps = _gaps(problem)
    at_gap = np.array([float(time[gap.epochs[-1]]) for gap in gaps])
    low, high, of_imu = first, last, np.repeat([False, True], INSTANTS)
    for round_ in range(REFINEMENTS):
        grid = np.tile(np.linspace(low, high, INSTANTS), of_imu.size // INSTANTS)
        more = at_gap if round_ == 0 else at_gap[:0]
        instants, kind = np.append(grid, more), np.append(of_imu, more > 0.0)
        jump = np.zeros((instants.size, N_NAV))
        epochs = np.minimum(np.searchsorted(time, instants[kind]), time.size - 1)
        jump[kind, POS] = -velocity[epochs]
        _, size, _, evidence = _step_statistics(opened, start, instants, jump)
        evidence[: grid.size][of_imu & (size[: grid.size] > 0.0)] = -np.inf  # ahead without a gap
        k = int(np.argmax(evidence))
        if evidence[k] < SHOWN_GAIN:
            return None
        best, step_s = float(instants[k]), float(size[k])
        if k >= grid.size:
            gap = gaps[k - grid.size]
            return _Candidate(solution, best, gap.step_s, gap)
        of_imu = np.full(INSTANTS, kind[k])
        reach = INTERVALS_AROUND * (high - low) / (INSTANTS - 1)
        low, high = max(best - reach, first), min(best + reach, last)
    return _Candidate(solution, best, step_s, loses_samples=bool(of_imu[0]))


def _refine_step(
    problem: EstimationProblem, start: InitialState, candidate: _Candidate
) -> tuple[EstimationProblem, float, float, float]:
    """Return the problem with a step mended, its instant, its size and its sigma."""
    since, step_s, solution = candidate.since, candidate.step_s, candidate.solution
    problem = problem if candidate.lapse is None else _without_lapse(problem, candidate.lapse)
    instants, none = np.array([since]), np.zeros((1, N_NAV))
    for _ in range(REFINED):
        stepped = _move_fixes(problem, solution, since, step_s)
        solution, size, sigma, _ = _scan_steps(_fixes_alone(stepped), start, instants, none)
        step_s += float(size[0])
        if abs(size[0]) < sigma[0]:
            break
    return _move_fixes(problem, solution, since, step_s), since, step_s, float(sigma[0])


def _with_samples(
    problem: EstimationProblem, start: InitialState, candidate: _Candidate
) -> tuple[EstimationProblem, float, float, float]:
    """Return the problem with lost samples bridged, the instant, the step and its sigma."""
    time, velocity = problem.epochs.time, candidate.solution.nav[:, VEL]

    def outcome(since: float, step_s: float) -> tuple[float, float, float, float]:
        jump = np.zeros((1, N_NAV))
        jump[0, POS] = -velocity[np.searchsorted(time, since)]
        bridged = _fixes_alone(_insert_lost_time(problem, since, -step_s))
        unexplained, size, sigma, _ = _step_statistics(bridged, start, np.array([since]), jump)
        # of the misfit, with the step that this one shows
        gain = float(size[0] / sigma[0]) ** 2
        step_s = min(step_s + float(size[0]), -problem.inc.nominal_s)
        return unexplained - gain, since, step_s, float(sigma[0])

    coarse, *finer = SPACINGS_S
    best = outcome(candidate.since, candidate.step_s)
    for spacing in (-coarse, coarse):
        since, in_vain = best[1], 0
        while in_vain < BEYOND and coarse < since + spacing < time[-1] - coarse:
            since += spacing
            one = outcome(since, best[2])
            in_vain = in_vain + 1 if one > best else 0
            best = min(best, one)
    reach = coarse
    for spacing in finer:
        around = np.clip(best[1] + np.arange(-reach, reach, spacing), coarse, time[-1] - coarse)
        best = min(outcome(float(since), best[2]) for since in around)
        reach = spacing
    _, since, step_s, sigma = best
    return _insert_lost_time(problem, since, -step_s), since, step_s, sigma


def _insert_lost_time(problem: EstimationProblem, since: float, lost_s: float) -> EstimationProblem:
    """Return the problem with time inserted at an instant, after which the stamps fall behind."""
    inc, epochs = problem.inc, problem.epochs
    old = np.concatenate([[0.0], np.cumsum(inc.dt)])
    sums = np.cumsum(np.hstack([inc.dtheta, inc.dvel]), axis=0)
    sums = np.concatenate([np.zeros((1, N_CHANNELS)), sums])
    k = int(np.argmin(np.abs(old - since)))

    one = inc.nominal_s
    begin = max(old[k] - BRIDGED_AROUND_S, one)
    end = min(old[k] + BRIDGED_AROUND_S, old[-1] - lost_s - one)
    around = np.arange(begin, end, 0.25 * lost_s)
    edges = [columns_at(around + after, old, sums) for after in (-one, 0.0, lost_s, lost_s + one)]
    first, within, last = np.diff(edges, axis=0)
    variance = np.mean((0.5 * lost_s / one * (first + last) - within) ** 2, axis=0)
    ends = columns_at(old[k] + one * np.array([-1.0, 1.0]), old, sums)
    nodes = np.concatenate([old[: k + 1], old[k:] + lost_s])
    sums = np.concatenate([sums[: k + 1], sums[k:] + 0.5 * lost_s / one * (ends[1] - ends[0])])
    time = np.round(epochs.time, INSTANT_DECIMALS)
    every = np.unique(np.round(np.concatenate([nodes, time]), INSTANT_DECIMALS))
    every = every[every <= time[-1]]
    stop = np.searchsorted(every, time)
    change = np.diff(columns_at(every, nodes, sums), axis=0)
    dtheta, dvel = (np.ascontiguousarray(half) for half in np.hsplit(change, 2))
    before = np.where(time > old[k], np.maximum(time - lost_s, old[k]), time)
    rate = columns_at(before, epochs.time, inc.rate)
    inside = np.clip(time, old[k], old[k] + lost_s)
    share = np.diff(inside, prepend=inside[0]) / lost_s
    inc = replace(inc, dt=np.diff(every), dtheta=dtheta, dvel=dvel, stop=stop, rate=rate)
    epochs = epochs._replace(stop=stop, rate=rate, gap=epochs.gap + np.outer(share, variance))
    return replace(problem, inc=inc, epochs=epochs)


def step_check(step: ClockStep) -> Finding:
    """Say that a clock steps, and how to mend it.

    Parameters
    ----------
    step : ClockStep
        The step.

    Returns
    -------
    Finding
        A contradiction: one time scale holds for a whole flight.
    """
    speed = rms_speed(step.solution)
    moves = f"{abs(step.size) * speed:.2f} m at {speed:.1f} m/s"
    if not np.isinf(step.evidence):
        moves += f", log evidence {step.evidence:.0f} of a step over any steady clock drift"
    to_imu = f"{-step.size:+.4f} s to the IMU's stamps"
    whose = ""
    mended = (
        f"add {step.size:+.4f} s to the stamps of the fixes from there on if the receiver's clock "
        f"stepped, {to_imu} if the IMU's did, and correct the events on that clock as well"
    )
    if step.of_imu:
        whose = "; the IMU's stamps have an equally long gap there, so the IMU's clock stepped"
        mended = f"add {to_imu} from there on, and to the events that the IMU's clock stamped"
    parts = (
        f"; or process two flight files, one with end_tow = {step.before:.2f}, one with"
        f" start_tow = {step.after:.2f} and {step.size:+.4f} added to {{gnss.time_offset_s}}"
    )
    sentence = (
        f"from {step.after:.2f} s on the time stamps of the fixes are"
        f" {'later' if step.size < 0.0 else 'earlier'} by {abs(step.size):.4f} +-"
        f" {step.sigma:.4f} s than before, {moves}{whose}"
    )
    if step.missing:
        parts = ""
        about = "about " if step.sigma > 0.5 * step.solution.problem.inc.nominal_s else ""
        sentence = (
            f"{about}{step.missing} IMU sample{'s were' if step.missing > 1 else ' was'} lost "
            f"shortly before {step.after:.2f} s, and the time stamps go on without this gap: from "
            f"there on the IMU's stamps are {-step.size:.4f} +- {step.sigma:.4f} s behind, {moves}"
        )
    ask = Question(CLOCK_STEP, f"no clock step, or one of less than {NEGLIGIBLE_M:g} m")
    advice = Step(f"{mended}: solved with this step, the flight follows its fixes{parts}")
    return ask.contradiction(sentence, advice)


def _fixes_alone(problem: EstimationProblem) -> EstimationProblem:
    """Return the problem with its gate open and the measurements of the fixes alone."""
    epochs = problem.epochs
    if (epochs.constraint == NHC).any() or (epochs.barometer_variance > 0.0).any():
        problem = without_other_aiding(problem)
    return replace(problem, gate=np.inf, huber_threshold=np.inf)


def _scan_steps(
    problem: EstimationProblem, start: InitialState, since: Array, jump: Array
) -> tuple[Solution, Array, Array, Array]:
    """Return the solution, and of a step at each instant its size, its sigma and (Z.1)."""
    steps = _steps(problem, since, jump)
    solution = solve(problem, start, "off", separations=0, follower=steps.through)
    return solution, *_shown_steps(steps)


def _step_statistics(
    problem: EstimationProblem, start: InitialState, since: Array, jump: Array
) -> tuple[float, Array, Array, Array]:
    """Return the misfit, and of a step at each instant its size, its sigma and (Z.1).

    Nothing is smoothed, unless measurements are linearised about what is.
    """
    if problem.measurements:
        solution, size, sigma, evidence = _scan_steps(problem, start, since, jump)
        return misfit(solution), size, sigma, evidence
    steps = _steps(problem, since, jump)
    passes = BlockwisePasses(problem, start, np.zeros(0, dtype=np.int64), 0)
    passes.filter(follower=steps.through)
    return misfit_of_pass(passes.history, problem.gate), *_shown_steps(steps)


def _steps(problem: EstimationProblem, since: Array, jump: Array) -> Sensitivity:
    wide = Constants.steps(problem.layout, since, jump, WIDE_STEP_S)
    return Sensitivity.before(problem, wide)


def _shown_steps(steps: Sensitivity) -> tuple[Array, Array, Array]:
    """Return size, sigma and (Z.1) of the step at each instant."""
    J, j = np.diag(steps.information), steps.vector
    weight = J + WIDE_STEP_S**-2
    evidence = 0.5 * j**2 / weight - 0.5 * np.log(weight * WIDE_STEP_S**2)
    return j / weight, weight**-0.5, evidence


def _gaps(problem: EstimationProblem) -> list[_Lapse]:
    """Return the longest bridged gaps of the IMU, `GAPS` at most."""
    stop, dt = problem.epochs.stop, problem.inc.dt
    longer = LACKING_INTERVALS * problem.inc.nominal_s
    rows = np.flatnonzero((problem.epochs.gap > 0.0).any(axis=1))
    gaps = []
    for epochs in np.split(rows, np.flatnonzero(np.diff(rows) > 1) + 1):
        if epochs.size == 0:
            continue
        inside = np.arange(stop[max(epochs[0] - 1, 0)], stop[epochs[-1]])
        intervals = inside[dt[inside] > longer]
        if intervals.size:
            step_s = float(dt[intervals].sum()) - problem.inc.nominal_s
            gaps.append(_Lapse(epochs, intervals, step_s))
    return sorted(gaps, key=lambda gap: -gap.step_s)[:GAPS]


def _without_lapse(problem: EstimationProblem, lapse: _Lapse) -> EstimationProblem:
    """Return the problem whose IMU's clock does not lapse.

    A gap is one sample, as no time went by in it.
    """
    inc, k = problem.inc, lapse.intervals
    share = 1.0 - lapse.step_s / float(inc.dt[k].sum())
    dt, dtheta, dvel = inc.dt.copy(), inc.dtheta.copy(), inc.dvel.copy()
    for values in (dt, dtheta, dvel):
        values[k] *= share
    variance, has = problem.epochs.gap.copy(), problem.epochs.has_position.copy()
    variance[lapse.epochs] = 0.0
    has[lapse.epochs[:-1]] = False  # fixes of instants that its clock left out
    epochs = problem.epochs._replace(gap=variance, has_position=has)
    return replace(problem, inc=replace(inc, dt=dt, dtheta=dtheta, dvel=dvel), epochs=epochs)


def _move_fixes(
    problem: EstimationProblem, solution: Solution, since: float, step_s: float
) -> EstimationProblem:
    """Return the problem with its fixes from an instant on moved by a step (Z.2)."""
    epochs = problem.epochs
    after = (epochs.time >= since) & epochs.has_position
    index = np.flatnonzero(after)
    time, velocity = epochs.time, solution.nav[:, VEL]
    arm = rotation_from_quaternion(solution.nav[:, QUAT]) @ problem.antenna_lever_b
    then = time[index] + step_s
    before = np.clip(np.searchsorted(time, then, side="right") - 1, 0, time.size - 2)
    length = time[before + 1] - time[before]
    tau = (then - time[before])[:, None]
    within = (then >= time[0]) & (then <= time[-1])
    grows = (velocity[before + 1] - velocity[before]) * (within / length)[:, None]
    along = np.diff(time)[:, None] * (velocity[1:] + velocity[:-1]) / 2.0
    path = np.concatenate([np.zeros((1, 3)), np.cumsum(along, axis=0)])
    way = path[before] + tau * (velocity[before] + 0.5 * tau * grows) - path[index]
    turned = arm[before] + tau / length[:, None] * (arm[before + 1] - arm[before]) - arm[index]
    position, fix_velocity = epochs.position.copy(), epochs.velocity.copy()
    position[index] -= way + turned
    fix_velocity[index] -= velocity[before] + tau * grows - velocity[index]
    return replace(problem, epochs=epochs._replace(position=position, velocity=fix_velocity))
