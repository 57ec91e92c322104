"""From the relation of IMU and GNSS to answers, each with a confidence and the numbers behind it.

Mathematics: the package's docstring, (R.10).
"""

import math
from dataclasses import dataclass

import numpy as np

from ...geodesy.gpstime import GPS_EPOCH_UNIX_S, LEAP_NOW_S, WEEK_S, leap_seconds
from ...records import Array, Finding
from .axes import Direction, ForwardAxis, imu_word
from .findings import MOST_CONFIDENCE, answer, unknown_property
from .fit import CAUTION
from .propulsion import Propulsion
from .relation import RIVAL_MISFIT_RATIO, Relation
from .units import ForceUnit, gyro_unit

LEAST_LOG_ODDS = 2.2  # odds of 9 to 1, as a logarithm: less is no answer
LEAST_SCORE = 0.3  # less is explained by motions that have nothing in common but their kind
# relative error of a gyro factor that no gyro has; sigma above which the turns do not show it
MOST_SCALE_ERROR, SCALE_SIGMA = 0.25, 0.1
# logarithm within which two counts of a gyro are neighbours, and scale error that tells them apart
NEIGHBOUR, NEIGHBOUR_SCALE_ERROR = 0.3, 0.06
HINT = 0.7  # odds of 2 to 1, as a logarithm: more makes another answer uncertain
# relative error of a gyro, and its ratio to its sigma, beyond which no known unit fits
COUNT_OFF, COUNT_SIGMAS = 0.12, 8.0
# who moves slower may hold the IMU as he likes, and multirotors fly sideways, too: their heading,
# and with it that of all images, is asked about (below 0.9); who flies, mostly flies nose first
SLOW_MS, SLOW_SHARE, NOSE_FIRST = 3.0, 0.85, 0.995
SAME_LAG_S, WHOLE_S = 1.0, 0.5  # lags that count as the same, s; and tolerance of whole seconds


def odds(x: float) -> float:
    """Return the probability of log likelihood ratio x (R.10); 0 below `LEAST_LOG_ODDS`."""
    return (
        min(MOST_CONFIDENCE, 1.0 / (1.0 + math.exp(-min(x, 50.0)))) if x > LEAST_LOG_ODDS else 0.0
    )


def looks_counted(relation: Relation) -> bool:
    """Whether the gyros are further off than any gyro is, as numbers in counts are."""
    if relation.fit is None:
        return False
    error, sigma = float(relation.fit.theta[4]), float(np.sqrt(relation.fit.cov[4, 4]))
    return abs(error) > max(COUNT_OFF, COUNT_SIGMAS * sigma)


def of_gyro(relation: Relation, force: ForceUnit, interval: float) -> tuple[Finding, Finding]:
    """Return the findings of the gyros: unit, and arrangement against the accelerometers.

    `interval`, s, is the nominal one of the samples.
    """
    scan, fit = relation.scan, relation.fit
    size = relation.factors[relation.best]
    others = [
        float(s.score.max())
        for s, factor in zip(relation.scans, relation.factors, strict=True)
        if s is not scan and not _neighbours(factor, size)
    ]
    unit = gyro_unit(size, force.quantity, interval)
    value = unit or f"{size:.4g} rad/s"
    sure = odds(CAUTION * scan.against(max(others, default=0.0)))
    if not scan.score[scan.best] > LEAST_SCORE:
        sure = 0.0
    evidence = (
        f"as {value} the gyros give a propagated specific force that explains"
        f" {_percent(scan.score[scan.best])} of the GNSS accelerations"
    )
    if others:
        evidence += f", as the next best unit {_percent(max(others))}"
    if fit is not None:
        scale, sigma = 1.0 + float(fit.theta[4]), float(np.sqrt(fit.cov[4, 4]))
        evidence += f"; scale fitted {scale:.3f} with sigma {sigma:.3f}"
        if looks_counted(relation):
            count = size * scale * (interval if force.quantity == "increments" else 1.0)
            evidence += (
                f"; no gyro is that far off, so these may be counts of about {count:.4g}"
                f" {gyro_unit(1.0, force.quantity, 1.0)}"
            )
            sure = 0.0
        near = any(_neighbours(factor, size) for factor in relation.factors)
        most = NEIGHBOUR_SCALE_ERROR if near else MOST_SCALE_ERROR
        sure = 0.0 if abs(scale - 1.0) > most or sigma > SCALE_SIGMA else sure
    of_unit = answer("gyro unit", value, sure, evidence)
    triads = min(odds(CAUTION * scan.against(relation.rival)), sure)
    evidence = (
        f"explained {_percent(scan.score[scan.best])}, with the gyros' sense reversed"
        f" {_percent(relation.rival)}"
    )
    return of_unit, answer("gyro triad", triads_words(relation.triads), triads, evidence)


def _neighbours(factor: float, size: float) -> bool:
    """Tell whether two factors of gyros differ by so little that the fitted scale tells them."""
    return 0.0 < abs(math.log(factor / size)) < NEIGHBOUR


def triads_words(triads: Array) -> str:
    """Return "aligned", or which signed gyro readings turn about the accelerometers' axes."""
    if np.array_equal(triads, np.eye(3)):
        return "aligned"
    return "gyro " + " ".join(map(imu_word, triads))


def of_sign(relation: Relation, also: float, mirrored: float) -> tuple[int, Finding]:
    """Find the sign of the force.

    Parameters
    ----------
    relation : Relation
    also : float
        Confidence of the findings that it is based on.
    mirrored : float
        What specific force would explain if latitude and longitude were exchanged, which reverses
        its sign; -inf if that was not tried.

    Returns
    -------
    tuple of int, Finding
        +1 for specific force, -1 for its reverse.
    """
    scan, index = relation.scan, relation.scan.best
    up, down = float(scan.up[index]), float(scan.down[index])
    sign = 1 if up >= down else -1
    this, other = max(up, down), min(up, down)
    agrees = relation.fit is None or relation.fit.sign == sign
    sure = min(odds(CAUTION * scan.against(other, this)), also) if agrees else 0.0
    evidence = f"explained {_percent(up)} as specific force, {_percent(down)} as its reverse"
    if np.isfinite(mirrored):
        evidence += (
            f", {_percent(mirrored)} as specific force with latitude and longitude exchanged"
        )
        x = exchange_odds(relation, mirrored)
        sure = 0.0 if x > LEAST_LOG_ODDS else min(sure, 0.5) if x > HINT else sure
    return sign, answer("force sign", "specific force" if sign > 0 else "reversed", sure, evidence)


def exchange_odds(relation: Relation, mirrored: float) -> float:
    """Return the logarithm of the odds that latitude and longitude are exchanged.

    The alternative is a reversed force; above `LEAST_LOG_ODDS` they are exchanged.
    """
    scan = relation.scan
    left = (1.0 - float(scan.score[scan.best])) / max(1.0 - mirrored, 1e-6)
    return 0.5 * CAUTION * float(scan.samples[scan.best]) * math.log(left)


def of_vertical(vertical: Direction, also: float) -> Finding:
    """Return the finding which axis points down; `also` is the confidence of its basis."""
    sure = min(MOST_CONFIDENCE, vertical.confidence) * also
    evidence = f"down is on average {np.degrees(vertical.off):.0f} deg from {vertical.word}"
    return answer("vertical axis", f"{vertical.word} down", _likely(sure), evidence)


def of_forward(ahead: ForwardAxis, moved: Propulsion, also: float) -> Finding:
    """Return the finding which axis points forward; `also` is the confidence of its basis.

    The axis of motion of who leans to change its speed (`propulsion`) need not be that of its nose.
    """
    free = ahead.speed < SLOW_MS or moved.nose_is_free(ahead.speed)
    sure = ahead.direction.confidence * (SLOW_SHARE if free else NOSE_FIRST) * also
    evidence = f"moves at {ahead.speed:.1f} m/s (sigma {ahead.speed_sigma:.1f}) "
    evidence += f"{np.degrees(ahead.direction.off):.0f} deg from {ahead.direction.word}"
    evidence += f", in wind or drift of {np.hypot(*ahead.wind):.1f} m/s"
    if ahead.speed < SLOW_MS:
        evidence += "; too slow to tell the forward direction from how the sensor was held"
    elif free:
        seen = "leans to change its speed, as" if moved.leans else "may be"
        evidence += f"; {seen} a multirotor, which may fly sideways or backwards"
    return answer("forward axis", f"{ahead.direction.word} forward", _likely(sure), evidence)


@dataclass(frozen=True, eq=False)
class Clock:
    """The clocks of IMU and GNSS.

    Parameters
    ----------
    offset_s, sigma_s : float, s
        Time offset and its sigma.
    scale : str
        Time scale.
    of_offset, of_scale : Finding
    """

    offset_s: float
    sigma_s: float
    scale: str
    of_offset: Finding
    of_scale: Finding


def of_clock(relation: Relation, week: int | None, also: float, shift: float) -> Clock:
    """Find time offset and time scale.

    Parameters
    ----------
    relation : Relation
    week : int or None
        GPS week of the recording, if known.
    also : float
        Confidence of the findings that it is based on.
    shift : float, s
        Added to the GNSS stamps beforehand.

    Returns
    -------
    Clock
    """
    scan, fit = relation.scan, relation.fit
    lag = float(scan.lags[scan.best])
    apart_s = max(SAME_LAG_S, 2.0 * scan.acc.span_s)
    rival = scan.score[np.abs(scan.lags - lag) > apart_s].max(initial=0.0)
    sure = min(odds(scan.margin(apart_s)), also)
    if 1.0 - rival < RIVAL_MISFIT_RATIO * (1.0 - scan.score[scan.best]):
        sure = 0.0
    if (
        fit is None
        or not sure
        or abs(fit.theta[0] - lag) > max(SAME_LAG_S, scan.acc.span_s)
        or scan.best in (0, scan.lags.size - 1)
    ):
        why = (
            f"explained {_percent(scan.score[scan.best])} at {lag:+.2f} s,"
            f" {_percent(rival)} far from it"
        )
        return Clock(
            0.0,
            np.inf,
            "same",
            unknown_property("time offset", why),
            unknown_property("time scale", why),
        )
    offset, sigma = shift + float(fit.theta[0]), relation.lag_sigma
    leap = LEAP_NOW_S if week is None else float(leap_seconds(GPS_EPOCH_UNIX_S + week * WEEK_S))
    offsets = {"same": 0.0, "GNSS in UTC": leap, "IMU in UTC": -leap}
    scale = next(
        (name for name, scale_offset in offsets.items() if abs(offset - scale_offset) < WHOLE_S),
        "other",
    )
    evidence = (
        f"add {offset:+.3f} s (sigma {sigma:.3f} s) to the GNSS stamps; explained"
        f" {_percent(scan.score[scan.best])} there, {_percent(rival)} at best over"
        f" {apart_s:.1f} s away"
    )
    whole = f"offset {offset:+.3f} s; leap seconds {leap:.0f}"
    if scale in ("GNSS in UTC", "IMU in UTC"):
        whole += f", {offset - offsets[scale]:+.3f} s besides"
    return Clock(
        offset,
        sigma,
        scale,
        answer("time offset", f"{offset:+.3f} s", sure, evidence),
        answer("time scale", scale, sure, whole),
    )


def _likely(sure: float) -> float:
    """Return a confidence; zero of what is less likely than its contrary."""
    return sure if sure > 0.5 else 0.0


def _percent(score: float | Array) -> str:
    return f"{100.0 * max(float(score), 0.0):.1f} %"
