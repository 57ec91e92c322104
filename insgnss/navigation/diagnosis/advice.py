"""The advice to the user: checks of the flight file against what the innovations say, in words.

A lever arm, time offset or clock rate with strong evidence against the flight file
(`constants.STRONG`) contradicts it where it moves positions by more than `NEGLIGIBLE_M`, and makes
a note where it moves them by less: slow errors of PPK fixes of some millimetres, which their sigmas
do not hold, make such ones up. Scale factors and misalignments are estimated, and said in a note,
as are variances. Advice is given for the winner alone, which has been tried: the flight was solved
with it.
"""

from collections.abc import Sequence
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from ...base.findings.remedies import Remedy, SetKey, Step, join_remedies
from ...geodesy.rotation import right_angle_rotations
from ...records import Array, Finding, Question
from ...records.cameras.mounting import Mounting
from ...records.states import (
    AXES,
    CLOCK_RATE,
    LEVER_ARM,
    MISALIGNMENT,
    OF_FIXES,
    OF_LEVER_ARM,
    SCALE_FACTOR,
    TIME_OFFSET,
    State,
)
from ..filter.codes import POS
from ..filter.layout import FixErrors
from ..filter.solution import Solution
from .constants import STRONG, ConstantsEvidence, Hypothesis
from .estimated import constant, rms_speed
from .evidence import NO_CLAIMS, FixClaims

if TYPE_CHECKING:
    from .variances import VarianceHypothesis

NEGLIGIBLE_M = 0.02  # a right lever arm came out 11 mm off on a simulated flight from RINEX
DETERMINED_M = 0.05  # sigma of a lever arm: beyond it slow errors that nobody claims can make it up
SEEN = 4.0  # sigmas of what a flight tells: from there on its log evidence is strong
UNSEEN_M = NEGLIGIBLE_M  # what would contradict the flight file if it were seen
UNSEEN_SIGMA = 3.0  # median sigmas of a position: an error below is within what images state
# log evidence with wide a-priori sigmas that none of 160 right flights of three minutes reached:
# the largest was 2.7
BY_CHANCE = 3.0
TURNED_ELEMENT = 0.5  # of an element of two matrices: these are turned by some right angle
STAMPED = (
    "and check that {camera.clock} is the clock that stamps the exposures (imu or receiver), as "
    "the wrong clock shifts exposures by as much"
)
# of the IMU's interval: samples taken for its mean are late by half of it where they are
# instantaneous, by (1 - 1/k) / 2 where every k-th alone was kept of means over shorter ones
LATE_SAMPLES = (0.25, 0.5)
# factors of driving noise, of accelerometers from which on, of gyros up to which fixes may swing:
# 30 cm over 120 s under a NavChip have 2.4 and less than 1
RESTLESS, STEADY_GYRO = 2.0, 1.5
LATE_SIGMAS = 2.0  # sigmas of the offset, within which it is one of `LATE_SAMPLES` (95 %)


def advice(
    mounting: Mounting,
    solution: Solution,
    suspected: Hypothesis,
    rivals: Sequence[Hypothesis] = (),
    exposures: bool = False,
    delays: Sequence[str] = (),
) -> list[Finding]:
    """Say which constants contradict the flight file, and what would put them right.

    Parameters
    ----------
    mounting : Mounting
        The mounting of the flight file, in whose axes the advice is given.
    solution : Solution
        The flight solved with these constants as states.
    suspected : Hypothesis
        The constants that are suspected.
    rivals : sequence of Hypothesis
        What the flight does not tell apart from it.
    exposures : bool
        Whether there are any: their place depends on that of the IMU in the mounting, of which a
        lever arm tells as much as of the antenna's.
    delays : sequence of str
        Delays of sensors that the flight does not tell apart from it, in words.

    Returns
    -------
    list of Finding
        One for each kind of constant, the most significant first.
    """
    pairs = zip(suspected.value.tolist(), suspected.sigma.tolist(), strict=True)
    values = dict(zip(suspected.states, pairs, strict=True))
    speed = rms_speed(solution)
    minutes = float(solution.time[-1] - solution.time[0]) / 60.0
    names = [" and ".join(map(str, rival.groups)) for rival in rivals]
    either = f"; this flight cannot tell this error from {' or '.join([*names, *delays])}"
    by = f", log evidence {suspected.evidence:.0f}{either if names or delays else ''}"
    beyond_chance = suspected.wide_evidence >= BY_CHANCE
    checks: list[tuple[float, Finding]] = []
    lever = [values.get(state) for state in OF_LEVER_ARM]

    def of_group(group: str) -> dict[State, tuple[float, float]]:
        return {state: value for state, value in values.items() if state.group == group}

    def add(group: str, check: Finding) -> None:
        check = replace(check, beyond_chance=beyond_chance)
        checks.append((max(abs(v) / s for v, s in of_group(group).values()), check))

    if any(lever):
        strong = _is_shown_wrong(LEVER_ARM, suspected, rivals)
        add(LEVER_ARM, _lever_arm(mounting, lever, by, strong, exposures))
    if TIME_OFFSET in values:
        strong = _is_shown_wrong(TIME_OFFSET.group, suspected, rivals)
        check = _time_offset(*values[TIME_OFFSET], speed, by, strong)
        of_samples = _late_samples(*values[TIME_OFFSET], solution.problem.inc.nominal_s)
        add(TIME_OFFSET.group, replace(check, remedy=join_remedies((check.remedy, of_samples), "")))
    if CLOCK_RATE in values:
        strong = _is_shown_wrong(CLOCK_RATE.group, suspected, rivals)
        add(CLOCK_RATE.group, _clock_rate(*values[CLOCK_RATE], minutes, speed, by, strong))
    for group, unit, factor in ((SCALE_FACTOR, "%", 1e2), (MISALIGNMENT, "mrad", 1e3)):
        if of_imu := of_group(group):
            add(group, _of_imu(group, of_imu, unit, factor, by))
    return [check for _, check in sorted(checks, key=lambda one: -one[0])]


def _is_shown_wrong(group: str, suspected: Hypothesis, rivals: Sequence[Hypothesis]) -> bool:
    """Tell whether a kind of constant is shown to be wrong.

    What the flight does not tell from an error of the IMU alone is no contradiction of the flight
    file; a rival that has the same constant as well supports it.
    """
    of_group = {one for one in suspected.groups if one.group == group}
    return suspected.wide_evidence >= STRONG and all(
        of_group <= set(rival.groups) or set(rival.groups) <= set(OF_FIXES) for rival in rivals
    )


def together(suspected: Hypothesis, rivals: Sequence[Hypothesis]) -> tuple[State, ...]:
    """Return the groups that are estimated together, and so in the covariance.

    Parameters
    ----------
    suspected : Hypothesis
        What is suspected.
    rivals : sequence of Hypothesis
        What the flight does not tell from it.

    Returns
    -------
    tuple of State
        Their groups, each once.
    """
    return tuple(dict.fromkeys(g for one in (suspected, *rivals) for g in one.groups))


def as_solved(suspected: Hypothesis, solution: Solution) -> Hypothesis:
    """Return a hypothesis with the values of the solution where they are far from the flight file.

    The evidence is linear in them, and an error of metres is not.

    Parameters
    ----------
    suspected : Hypothesis
        What is suspected.
    solution : Solution
        The flight solved with it.

    Returns
    -------
    Hypothesis
        The same where it is near the flight file.
    """
    if suspected.factor == 1.0:
        return suspected
    states = solution.problem.layout.states
    pairs = np.array([constant(solution, states.index(state)) for state in suspected.states])
    return replace(suspected, value=pairs[:, 0], sigma=pairs[:, 1])


def unseen_constants(
    solution: Solution, constants: ConstantsEvidence, events_with_fixes: bool = False
) -> Finding | None:
    """Say how well a flight by itself tells the constants of its fixes, and what it cannot see.

    Parameters
    ----------
    solution : Solution
        The solved flight.
    constants : ConstantsEvidence
        What its innovations say of the constants.
    events_with_fixes : bool
        Whether the clock of the fixes stamps the exposures, whose poses an offset that both share
        then does not move (`navigation.filter.event_clock`).

    Returns
    -------
    Finding or None
        A note of the errors that could stay unseen (`SEEN` sigmas of what the flight tells) and
        move positions by more than `UNSEEN_M` and `UNSEEN_SIGMA` of their median sigma; of all that
        could where none moves them so far. None where all of them are estimated in any case.
    """
    alone = constants.known_to()
    speed = rms_speed(solution)
    of_position = np.sqrt(np.diagonal(solution.nav_covariance(), axis1=1, axis2=2)[:, POS]).max(
        axis=1
    )
    limit = max(UNSEEN_M, UNSEEN_SIGMA * float(np.median(of_position)))
    errors: list[tuple[float, str, str]] = []  # m, the error, what it does
    if LEVER_ARM not in (*constants.requested, *constants.exact):
        for state in OF_LEVER_ARM:
            size = SEEN * alone.get(state, np.inf)
            text = f"{state} below {millimetres(size)} mm"
            errors.append((size, text, "the lever arm moves the positions by as much"))
    if TIME_OFFSET.group not in constants.requested:
        offset = SEEN * alone.get(TIME_OFFSET, np.inf)
        text = f"{TIME_OFFSET} below {1e3 * offset:.2g} ms"
        along = f"the offset moves the images by up to {millimetres(offset * speed)} mm along track"
        shared = "the offset moves no image, since exposures and fixes have the same clock"
        errors.append((0.0, text, shared) if events_with_fixes else (offset * speed, text, along))
    if not errors:
        return None
    hidden = [error for error in errors if error[0] > limit]
    _, names, effects = zip(*(hidden or errors), strict=True)
    moved = ", ".join(dict.fromkeys(effects))
    text = f"this flight would not reveal errors of {', '.join(names)}: {moved}"
    remedy = Step(
        "measure lever arm and time offset and state their sigmas: {mounting.antenna_sigma_m}, "
        "{gnss.time_sigma_s}; turns, tilts and changes of speed in a flight reveal errors"
    )
    ask = Question("unseen constants", f"errors above {1e3 * limit:.0f} mm would be seen")
    return ask.note(text, remedy, when=hidden)


def millimetres(metres: float) -> str:
    """Return a length in millimetres, three digits at most."""
    return f"{1e3 * metres:.0f}" if metres < 10.0 else "many"


def variance_check(
    suspected: "VarianceHypothesis", claims: FixClaims = NO_CLAIMS, drafted: bool = False
) -> Finding:
    """Say whose noise is larger than its model says.

    Parameters
    ----------
    suspected : VarianceHypothesis
        The family and its factors.
    claims : FixClaims
        What is known beforehand of the sigmas of the fixes.
    drafted : bool
        Whether nobody states the noise of the IMU.

    Returns
    -------
    Finding
        A note: the flight is solved with the larger noise; in order of a draft, and where the
        fixes' sigmas are off by no more than usual of their source.
    """
    evidence = f"log evidence {suspected.evidence:.0f}"
    if suspected.family == "GNSS sigmas":
        kinds = {"fixes.position": "positions", "fixes.velocity": "velocities"}
        adopted = {name: k for name, k in suspected.of_fixes.items() if k != 1.0}
        scatter = " and ".join(
            f"the GNSS {kinds[name]} scatter {factor:.2f} times as much as their sigmas claim"
            for name, factor in adopted.items()
        )
        predicted = ", withheld pieces are predicted" if suspected.narrowed else ""
        expected = f"factors up to {claims.scale.usual:.2g}, usual for this source of positions"
        return Question("GNSS sigmas", expected).note(
            f"{scatter} ({evidence}{predicted}); the result allows for it",
            claims.advised(adopted.get("fixes.position", 1.0)),
            when=max(adopted.values(), default=1.0) > claims.scale.usual,
        )
    if drafted:
        factors = ", ".join(f"{name} {factor:.2g}" for name, factor in suspected.factors.items())
        return Question("IMU noise", "factors of a draft by inspect").ok(
            f"the flight corrects the drafted noise model: {factors} times as large ({evidence})"
        )
    # smaller noise than the model's is not adopted
    larger = {name: factor for name, factor in suspected.factors.items() if factor > 1.0}
    factors = ", ".join(f"{name} {factor:.2f}" for name, factor in larger.items())
    return Question("IMU noise", "factors of one").note(
        f"{suspected.family} times {factors} explains the innovations, {evidence}; solved with it",
        "`insgnss tune --flight` measures it; or mount the IMU softer, away from motors",
    )


def swing_check(suspected: "VarianceHypothesis", errors: FixErrors) -> list[Finding]:
    """Ask whether the fixes swing, where accelerometers alone seem more restless than stated.

    A swing of amplitude A and period P is an acceleration of A (2 pi / P)^2, which larger bias
    noise follows; a Gauss-Markov error of the fixes, rough from fix to fix, cannot win. Temperature
    and vibration move gyros as well. A is not told: tilt takes an unknown share of it.

    Parameters
    ----------
    suspected : VarianceHypothesis
        The variances that are adopted.
    errors : FixErrors
        The errors of the fixes among the states.

    Returns
    -------
    list of Finding
        A note; none where gyros are restless, too, or slow errors of the fixes are states.
    """
    gyro, accel = (suspected.factors.get(f"{one}.driving_noise", 1.0) for one in ("gyro", "accel"))
    slow = errors.gm_sigma or errors.unfixed_gm_sigma
    if slow or accel < RESTLESS or gyro > STEADY_GYRO:
        return []
    note = Question("GNSS swing", "accelerometers that are as restless as gyros").note(
        "either the GNSS positions swing over a minute or two, and all images with them by more"
        f" than their sigmas, or the accelerometer biases are {accel:.1f} times as restless as"
        f" stated (log evidence {suspected.evidence:.0f}); the result takes the positions as right",
        "compare the positions with a second base, or the images with a few ground points; if they"
        " agree, `insgnss tune --flight` gives the noise",
    )
    return [note]


def message(errors: FixErrors) -> str:
    """Describe the time-correlated GNSS error that is estimated, for the history of a run."""
    correlated, white = (
        " / ".join(f"{x:.2f}" for x in values)
        for values in (errors.gm_sigma or (), errors.white_scale)
    )
    return (
        "correlated innovations: a time-correlated (Gauss-Markov) GNSS error estimated, in "
        f"standard deviations of the file (N / E / D): {correlated} with a correlation time of "
        f"{errors.correlation_time_s:.1f} s, and {white} of white noise"
    )


def _lever_arm(
    mounting: Mounting,
    lever: Sequence[tuple[float, float] | None],
    by: str,
    strong: bool,
    exposures: bool,
) -> Finding:
    """Check the antenna lever arm."""
    value: Array = np.array([0.0 if one is None else one[0] for one in lever])
    sigma = max(one[1] for one in lever if one is not None)
    estimate = ", ".join(
        f"{axis} {one[0]:+.3f} +- {one[1]:.3f}"
        for axis, one in zip(AXES, lever, strict=True)
        if one is not None
    )
    contradicts = strong and sigma < DETERMINED_M and float(np.abs(value).max()) > NEGLIGIBLE_M
    exact = mounting.antenna_sigma_m == 0.0
    advised: Remedy = _either(mounting, value, sigma, exposures)
    if exact:
        stated = "mounting.antenna_sigma_m = 0 states an exact arm, so it is not estimated"
        advised = join_remedies((advised, stated), "; ")
    elif not exposures:
        estimated = SetKey("filter.lever_arm", True)
        advised = Step("set {} to have it estimated, or {}", estimated, advised)
    turns = _quarter_turns_that_explain(mounting, lever) if contradicts else []
    if turns:
        matrix = f" = {np.rint(turns[0]).astype(int).tolist()}" if len(turns) == 1 else ""
        first = (
            f"another mounting.camera_from_body{matrix} would explain this with antenna_m "
            "unchanged, and would turn the images as well: check the mounting first, as nothing "
            "else in a flight shows a wrong mounting;"
        )
        advised = join_remedies((first, advised), " else ")
    stated = f"the flight file's{', stated as exact' * exact}, within {NEGLIGIBLE_M:g} m"
    another = "another one explains the innovations, " * exact
    finding = f"{another}the vector from the IMU to the antenna is off by {estimate} m{by}"
    return Question(LEVER_ARM, stated).against(finding, advised, contradicts)


def _either(mounting: Mounting, value: Array, sigma: float, exposures: bool) -> str:
    """Say which places of the antenna, and of the IMU where images depend on it, would be it.

    The flight measures only the vector between them, so that both explain it alike.
    """
    error_m = mounting.C_cb @ value
    antenna, imu = (
        f"[{', '.join(f'{v:.3f}' for v in position)}]"
        for position in (mounting.antenna_m + error_m, mounting.imu_m - error_m)
    )
    how_well = f"antenna_sigma_m = {max(sigma, 1e-3):.3f}"
    if not exposures:
        return f"mounting.antenna_m = {antenna} would correct it, with {how_well}"
    return (
        f"mounting.imu_m = {imu} or mounting.antenna_m = {antenna} would correct it, with "
        f"{how_well}: the flight measures only the vector from IMU to antenna; if imu_m is wrong, "
        f"all images move by {float(np.linalg.norm(value)):.3f} m; measure both before you change "
        "one"
    )


def _quarter_turns_that_explain(
    mounting: Mounting, lever: Sequence[tuple[float, float] | None]
) -> list[Array]:
    """Return the turns T by right angles with which the stated lever arm is the one that was found.

    Where only T is wrong, the flight finds the lever arm (M.2) off by its difference between both.

    Parameters
    ----------
    mounting : Mounting
        The flight file's.
    lever : sequence of (float, float) or None
        What the lever arm is off by in the body's axes and its sigma, m; None where an axis is not
        suspected.
    """
    # an axis that is not suspected is not off by more than what matters
    value = np.array([0.0 if one is None else one[0] for one in lever])
    sigma = np.array([NEGLIGIBLE_M if one is None else one[1] for one in lever])
    limit = np.maximum(SEEN * sigma, NEGLIGIBLE_M)
    estimate = mounting.antenna_lever_b + value
    turns = []
    for T in right_angle_rotations():
        lever_b = replace(mounting, camera_from_body=T).antenna_lever_b
        is_another = np.abs(T - mounting.camera_from_body).max() > TURNED_ELEMENT
        if is_another and (np.abs(lever_b - estimate) < limit).all():
            turns.append(T)
    return turns


def _time_offset(offset: float, sigma: float, speed: float, by: str, strong: bool) -> Finding:
    """Check the time offset of the fixes."""
    contradicts = strong and abs(offset) * speed > NEGLIGIBLE_M
    return Question(str(TIME_OFFSET), f"none, or less than {NEGLIGIBLE_M:g} m").against(
        f"time stamps of the fixes are too {'late' if offset < 0.0 else 'early'} by"
        f" {abs(offset):.4f} +- {sigma:.4f} s, "
        f"{abs(offset) * speed:.2f} m at {speed:.1f} m/s{by}",
        Step(
            f"add {offset:+.4f} to {{gnss.time_offset_s}}, or set {{}} to have it estimated;"
            f" {STAMPED}",
            SetKey("filter.time_offset", True),
        ),
        contradicts,
    )


def _late_samples(offset: float, sigma: float, interval_s: float) -> Remedy:
    """Say that samples which are no means over their intervals would look like this offset."""
    least, most = (share * interval_s for share in LATE_SAMPLES)
    slack = LATE_SIGMAS * sigma
    if not least - slack <= -offset <= most + slack or slack > most:
        return ""
    return Step(
        f"; or the IMU samples are not means over their {1e3 * interval_s:.3g} ms but"
        f" instantaneous ({{}}), or only every k-th sample was kept (give all of them, or their"
        f" means): then the IMU's stamps are late: add {-offset:+.4f} to {{imu.time_offset_s}}"
        " instead, which keeps the exposures right",
        SetKey("imu.quantity", "instant_rate"),
    )


def _clock_rate(
    rate: float, sigma: float, minutes: float, speed: float, by: str, strong: bool
) -> Finding:
    """Check the rate of the IMU's clock against that of the fixes."""
    moves = 0.5 * abs(rate) * 60.0 * minutes * speed
    return Question("clock rate", f"one clock, or less than {NEGLIGIBLE_M:g} m").against(
        f"the clock of the fixes runs {1e6 * rate:+.0f} +- {1e6 * sigma:.0f} ppm faster than the "
        f"IMU's, {moves:.2f} m over half the flight at {speed:.1f} m/s{by}",
        Step(
            f"set {{}}, which estimates offset and rate of the clocks; {STAMPED}",
            SetKey("filter.time_offset", True),
        ),
        strong and moves > NEGLIGIBLE_M,
    )


def _of_imu(
    group: str, values: dict[State, tuple[float, float]], unit: str, factor: float, by: str
) -> Finding:
    """Note scale factors or misalignments of the IMU, which are estimated."""
    largest = sorted(values, key=lambda state: -abs(values[state][0] / values[state][1]))[:3]
    numbers = ", ".join(
        f"{state} {factor * values[state][0]:+.2f} +- {factor * values[state][1]:.2f} {unit}"
        for state in largest
    )
    key = SetKey(f"filter.{group.replace(' ', '_')}", True)
    return Question(f"IMU {group}s", "within the sigmas of the noise model").note(
        f"{numbers}{by}; estimated",
        Step("calibrate the IMU ({imu.calibration}), or set {}", key),
    )
