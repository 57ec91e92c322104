"""What limits a flight, in plain sentences with numbers, the most important first.

The numbers are those of `summary`.

Every rule looks at the figures and yields what it has to say, with a rank: how many times a figure
exceeds what a good flight shows. The rules and their limits are in `fixes`, `accuracy` and
`places`.
"""

import math
from collections.abc import Callable, Iterator, Sequence

from ...base.findings import Finding
from ...records.states import CLOCK_RATE
from . import accuracy as rules_accuracy
from . import fixes as rules_fixes
from . import places as rules_places
from .fixes import consistency_verdict
from .use import USE
from .wording import Figures, degrees, lengths, millimetres, tilt

# rms share of slow errors in the sigma of a fix, of the a-priori probabilities of diagnosis (V.3):
# smoothing hardly reduces it (12.8 mm of a fix of 20 mm where a filter with such an error has 12.7)
USUAL_SHARE = 0.63
SLOWEST_S = 300.0  # correlation time of errors of PPK that is not exceeded as a rule (V.3)
# times the mean rate c^2 / T of a slow error: five minutes of flight that hardly show it do not
# exclude 2.1 to 3.3 (simulated: 1 cm over 20 s to 4 cm over 300 s); of larger shares they do
FASTER, HARDLY_SHOWN = 2.5, 1.0
# s/s, how far clocks drift apart that nobody synchronises: quartzes are within 20 to 50 ppm each
FREE_CLOCK = 5e-5
USUAL_MATTERS = 1.2  # times the sigmas without slow errors, from which on it is said (chosen)
MOST_SENTENCES = 8  # that a reader takes in; the tables below have all (chosen)
NOTHING_STANDS_OUT = (
    "nothing stands out: the GNSS positions and the solutions forward and backward in time agree"
    " within their sigmas, and no image is much less accurate than the others"
)

Rule = Callable[[Figures], Iterator[Finding]]

ON_FIXES: tuple[Rule, ...] = (
    rules_fixes.residuals,
    rules_fixes.rejected_fixes,
    rules_fixes.covariance_resets,
    rules_fixes.nis,
    rules_fixes.whiteness,
    rules_fixes.separation,
    rules_fixes.separation_once,
    rules_fixes.separation_below,
    rules_fixes.time_correlated,
    rules_fixes.barometer,
)
ON_THE_REST: tuple[Rule, ...] = (
    rules_accuracy.standing,
    rules_accuracy.code,
    rules_places.attitude,
    rules_places.position,
    rules_places.worst_image,
    rules_places.outage,
    rules_places.segments,
    rules_places.gaps,
    rules_accuracy.overall_attitude,
    rules_accuracy.heights,
    rules_accuracy.lever_arm,
    rules_accuracy.measured_arm,
    rules_accuracy.states,
    rules_accuracy.gyro_bias,
    rules_accuracy.boresight,
    rules_fixes.checks,
)


def headline(figures: Figures) -> str:
    """One line: what accuracy the run claims, and whether its fixes support the claim."""
    images, fixes = figures["exposures"], figures["counts"]
    claim = figures["trajectory"] if images is None else images
    usable_images = figures["use"]["usable"] if images is not None else None
    if usable_images is not None:
        claim = {**claim, **usable_images}
    position, attitude = lengths(claim["position_mm"]["median"]), claim["attitude_deg"]["median"]
    subject = "trajectory" if images is None else _images(claim["count"])
    if usable_images is not None:
        subject = f"the other {subject}"
    text = (
        f"{subject}: median sigmas {position} ({', '.join(claim['axes'])}), tilt"
        f" {degrees(tilt(attitude))}, heading {degrees(attitude[2])}"
    )
    usable = figures["use"]["verdict"] == USE  # else the verdict counts the weak ones
    if usable and images is not None and (beyond := images["far_worse"])["count"]:
        text += (
            f"; {_images(beyond['count'])} with more than {beyond['times']:g} times the median, up"
            f" to {lengths(claim['position_mm']['max'])}"
        )
    if figures["standing"]:
        return f"{text}; the sensor stands at a given place, no fixes support them"
    support = {
        "consistent": "fit",
        "overconfident": "scatter more than",
        "conservative": "scatter less than",
        "unknown": "do not support",
    }[consistency_verdict(figures["consistency"]["position"])]
    n, used = fixes["fixes"], fixes["fixes_used"]
    which = f"all {n} GNSS positions" if used == n else f"the {used} GNSS positions used of {n}"
    enlarging = ["GNSS sigmas", *(["incorrect fixes"] if used == n else [])]
    adopted = any(check["name"] in enlarging for check in figures["checks"])
    accuracies = "the accuracies adopted for them" if adopted else "their stated accuracies"
    conditions = _if_usual(figures, claim) + _if_clocks_drift(figures, claim)
    return f"{text}; {which} {support} {accuracies}{conditions}"


def _if_usual(figures: Figures, claim: Figures) -> str:
    """Say what the positions are known to if the fixes err as slowly as those of PPK usually do.

    Nothing where slow errors are among the sigmas, or where the flight file excludes them.
    """
    predicted = figures["innovations"]["median_sigma_mm"]
    stated = (figures["flight"].get("gnss") or {}).get("gm_sigma", "auto")
    if stated != "auto" and figures["time_correlated_errors"]:
        return ""
    if figures["time_correlated_errors"]:
        return _if_slower(figures, claim)
    if predicted is None or stated == "off":
        return ""
    north, east, down = predicted
    of_images = claim["position_mm"]["median"]
    of_fixes = _in_axes(claim, north, east, down)
    with_slow = [
        math.hypot(sigma, USUAL_SHARE * math.sqrt(max(fix**2 - sigma**2, 0.0)))
        for sigma, fix in zip(of_images, of_fixes, strict=True)
    ]
    if max(with_slow) < USUAL_MATTERS * max(of_images):
        return ""
    usual = (
        "positions without fixed ambiguities do"
        if max(predicted) > rules_accuracy.CODE_MM
        else "PPK does"
    )
    beyond = _beyond_need(figures, claim, with_slow)
    return (
        f"; if they err slowly, as {usual} as a rule, the sigmas are {lengths(with_slow)}{beyond}"
    )


def _if_slower(figures: Figures, claim: Figures) -> str:
    """Say what the positions are known to if the errors of the fixes last longer than estimated.

    Innovations tell c^2 / T, the share squared over the correlation time, alone, and that roughly
    (`navigation.diagnosis.variances`).
    """
    error = max(figures["time_correlated_errors"], key=lambda one: float(one["fixes"]))
    if error["time_s"] >= SLOWEST_S:
        return ""
    faster = FASTER if max(error["share"]) < HARDLY_SHOWN else 1.0
    longer = faster * SLOWEST_S / error["time_s"] - 1.0
    north, east, down = error["sigma_m"]
    of_fixes = _in_axes(claim, north, east, down)
    of_images = claim["position_mm"]["median"]
    slower = [
        math.hypot(sigma, 1e3 * fix * math.sqrt(longer))
        for sigma, fix in zip(of_images, of_fixes, strict=True)
    ]
    if max(slower) < USUAL_MATTERS * max(of_images):
        return ""
    return (
        f"; this holds for GNSS errors with a correlation time of {error['time_s']:.0f} s; with"
        f" {SLOWEST_S:.0f} s, which no flight can rule out, the sigmas are {lengths(slower)}"
        f"{_beyond_need(figures, claim, slower)}"
    )


def _in_axes(claim: Figures, north: float, east: float, vertical: float) -> tuple[float, ...]:
    """Return three lengths in the order of a claim's axes: N, E, D or E, N, U."""
    return (north, east, vertical) if claim["axes"][0] == "N" else (east, north, vertical)


def _beyond_need(figures: Figures, claim: Figures, sigma_mm: Sequence[float]) -> str:
    """Say that standard deviations in the axes of the claim, mm, are beyond the need."""
    east, north, up = figures["use"]["need_m"]
    needed = _in_axes(claim, north, east, up)
    if all(sigma <= 1e3 * need for sigma, need in zip(sigma_mm, needed, strict=True)):
        return ""
    return ", more than is needed: compare some images with check points"


def _if_clocks_drift(figures: Figures, claim: Figures) -> str:
    """Say what the positions are known to if the clocks of IMU and fixes are free ones.

    Nothing where the flight determines the rate between them, or where it matters to no image.
    """
    rate = next((one for one in figures["states"] if one["name"] == str(CLOCK_RATE)), None)
    if rate is None or rate["observed"] or rate["requested"]:
        return ""
    along = 1e3 * FREE_CLOCK / rate["sigma"] * rate["moves_m"]
    typical = max(claim["position_mm"]["median"])
    if math.hypot(along, typical) < USUAL_MATTERS * typical:
        return ""
    return (
        f"; if the clocks of IMU and GNSS drift apart by {1e6 * FREE_CLOCK:.0f} ppm, which this"
        f" flight would not show, positions along the track are known to {millimetres(along)}"
    )


def _images(count: int) -> str:
    return "1 image" if count == 1 else f"{count} images"


def limits(figures: Figures) -> list[Finding]:
    """All that limits the flight, and remarks, by falling rank."""
    rules = ON_THE_REST if figures["standing"] else ON_FIXES + ON_THE_REST
    return sorted(
        (limit for rule in rules for limit in rule(figures)), key=lambda limit: -limit.rank
    )


def verdict(ranked: Sequence[Finding]) -> list[str]:
    """The first sentences of `limits`.

    Where none of them is more than a remark, one that says so stands before them.
    """
    sentences = [limit.sentence for limit in ranked[:MOST_SENTENCES]]
    return sentences if stands_out(ranked) else [NOTHING_STANDS_OUT, *sentences]


def stands_out(ranked: Sequence[Finding]) -> bool:
    """Whether anything is more than a remark."""
    return any(limit.rank >= 1.0 for limit in ranked)
