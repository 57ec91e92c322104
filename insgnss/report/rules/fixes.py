"""Rules on whether the result can be trusted.

Fixes against prediction, forward against backward, the checks of the input.

A sentence is given where a figure leaves what a good flight shows by enough to matter to its user,
not where a test of a hundred thousand fixes can tell it from perfection; the limits stand below.
What contradicts the sigmas weighs `TRUST` times what only enlarges them. None of it says anything
where the fixes were made up for a sensor that stands at a given place.
"""

from collections.abc import Iterator

from ...base.findings import Finding, ranked
from ...base.wording import some
from ...records.verdicts import ADOPTED, CHECKS, REMARK
from .hidden import UNSEEN
from .wording import NED_NAMES, Figures, at_time, lengths, millimetres, span

TRUST = 2.0  # weight of what contradicts the sigmas over what only enlarges them (chosen)
NIS_MATTERS = (0.64, 1.56)  # mean NIS per degree of freedom: sigmas off by more than a quarter
OTHER_UNIT = 0.1  # innovations in sigmas: below it these have another unit than they should
LAG_ONE_MATTERS = 0.3  # correlation of neighbours: a mean scatters 1.4 times its sigma then
MEAN_MATTERS = 0.5  # of the rms
REJECTED_MATTERS = 0.01  # share of the fixes
SEPARATION_MATTERS = 1.5  # normalised rms, where its own bound is not larger
# sigmas at one instant; of a thousand normal variables the largest is beyond once in a million
SEPARATION_ONCE = 6.0
SEPARATION_WIDE = 0.5  # the same of all axes together, where what chance allows is not smaller
# an error that lasts longer is one of the absolute position; share of the fixes
STAYS_S, FEW_MATTER = 300.0, 0.02
# share of a slow error that a flight shows: smaller ones are carried by their odds alone, and are
# no more than a remark
SHOWN_SHARE = 0.36
# ranks: a contradiction that was overruled, and a result that nothing supports
OVERRULED, RANK_UNSUPPORTED = 50.0, 1000.0
ADVICE_ON_COMMON_ERRORS = (
    "use the cross-covariances of eo.json in the adjustment, or in a program that takes none the"
    " absolute sigmas, and ground control"
)


def consistency_verdict(consistency: Figures) -> str:
    """Return the verdict where it matters.

    Within NIS_MATTERS the sigmas agree for all that their user can tell.
    """
    ratio = consistency["mean_per_dof"]
    if ratio is not None and NIS_MATTERS[0] <= ratio <= NIS_MATTERS[1]:
        return "consistent"
    return str(consistency["verdict"])


def residuals(figures: Figures) -> Iterator[Finding]:
    """Yield the minute in which the solution is farthest from its own fixes, beyond all claims."""
    r = figures["residuals"]
    if r is None or r["worst"]["sigmas"] <= r["limit"]:
        return
    worst, beyond, pieces = r["worst"], r["beyond"], len(r["pieces"])
    text = (
        f"the trajectory, and with it the images, is {millimetres(worst['mean_mm'])} "
        f"{worst['axis']} off the GNSS positions in the mean of "
        f"{span(figures, worst['begin_s'], worst['end_s'])}; this is {worst['sigmas']:.1f} times "
        f"what the sigmas allow (limit {r['limit']:.1f}, exceeded by {beyond} of {pieces} pieces)"
    )
    help_ = "do not use positions or sigmas of this time before the cause is found"
    yield ranked("residuals", RANK_UNSUPPORTED + worst["sigmas"], text, help_)


def apart(figures: Figures) -> Iterator[tuple[float, str, str, float]]:
    """Yield the separations that exceed their sigmas: over the bound, text, state, over a sigma."""
    separation = figures["separation"]
    for state, ratios in separation["normalised_rms"].items():
        bounds = separation["bound"][state]
        for ratio, bound, axis in zip(ratios, bounds, separation["axes"], strict=True):
            if ratio is not None and ratio > (limit := max(SEPARATION_MATTERS, bound)):
                yield float(ratio / limit), f"{ratio:.1f} in {state} {axis}", state, float(ratio)


def rejected_fixes(figures: Figures) -> Iterator[Finding]:
    """Yield the fixes and velocities that the gate rejected.

    Fixes that are withheld as incorrect are those of a check, which says why.
    """
    shares, largest_share = [], 0.0
    for total, key in (("fixes", "fixes_rejected"), ("velocities", "velocities_rejected")):
        withheld = figures["counts"]["fixes_withheld"] if total == "fixes" else 0
        count = figures["counts"].get(total, 0)
        rejected_count = figures["counts"].get(key, 0) - withheld
        if count and rejected_count == count:
            text = (
                f"all {count} {total} were rejected, because they contradict the inertial data:"
                " nothing supports the images"
            )
            yield ranked("rejected", RANK_UNSUPPORTED, text, "check clock, axes and lever arm")
        elif count and rejected_count > REJECTED_MATTERS * count:
            shares.append(
                f"{rejected_count} of {count} {total} ({100 * rejected_count / count:.1f} %)"
            )
            largest_share = max(largest_share, rejected_count / count)
    if shares:
        text = (
            f"{' and '.join(shares)} were rejected by the gate and support no image: their sigmas"
            " do not describe their errors"
        )
        help_ = (
            "check the crosses in the figures; use the receiver's sigma of each fix if there is one"
        )
        yield ranked("rejected", largest_share / REJECTED_MATTERS, text, help_)


def covariance_resets(figures: Figures) -> Iterator[Finding]:
    """Yield the covariance resets after rejected fixes."""
    times = figures["covariance_resets_s"]
    if times:
        instants = some((at_time(figures, time) for time in times), 5)
        count = "once" if len(times) == 1 else f"{len(times)} times"
        text = (
            f"the filter rejected the fixes until its covariance was reset {count} ({instants}):"
            " images at these times rely on later fixes only"
        )
        yield ranked(
            "covariance resets",
            TRUST * (1.0 + len(times)),
            text,
            "look at the fixes before these times: if they jump, leave them out there",
        )


def barometer(figures: Figures) -> Iterator[Finding]:
    """Yield heights of a barometer that do not agree with their sigmas."""
    c = figures["consistency"].get("barometer")
    if c is not None and consistency_verdict(c) == "overconfident":
        text = (
            f"the barometer's heights scatter {c['size']:.2f} times as much as their sigmas"
            " say; the heights of the images may be off by more than their sigmas"
        )
        help_ = "raise barometer.sigma_m, or barometer.bias_walk where the heights drift"
        yield ranked("barometer", REMARK, text, help_)


def nis(figures: Figures) -> Iterator[Finding]:
    """Yield innovations that do not agree with their sigmas (NIS)."""
    for quantity in ("position", "velocity"):
        c = figures["consistency"][quantity]
        if c is None or consistency_verdict(c) in ("consistent", "unknown"):
            continue
        numbers = "NIS {:.2f} per degree of freedom, 99 % bounds {:.3f} to {:.3f}".format(
            c["mean_per_dof"], *c["bounds_99"]
        )
        text = (
            f"the GNSS {_plural(quantity)} scatter {c['size']:.2f} times as much as their sigmas"
            f" say ({numbers})"
        )
        if c["verdict"] == "overconfident":
            why = (
                "the sigmas of the images are too small by up to as much, or the lever arm or a"
                " clock is wrong"
            )
            help_ = (
                f"check lever arm and clock, then raise the sigmas of the {_plural(quantity)} or"
                " the noise of the IMU"
            )
            yield ranked(
                "innovations", TRUST * c["mean_per_dof"] / NIS_MATTERS[1], f"{text}; {why}", help_
            )
        else:
            rank = min(NIS_MATTERS[0] / max(c["mean_per_dof"], 1e-3), 3.0)
            rank = RANK_UNSUPPORTED if c["size"] < OTHER_UNIT else rank
            yield ranked("innovations", rank, *_why_conservative(figures, quantity, text))


def _why_conservative(figures: Figures, quantity: str, text: str) -> tuple[str, str]:
    """Small innovations say nothing of the size of time-correlated errors."""
    if figures["consistency"][quantity]["size"] < OTHER_UNIT:
        units = ("mm", "m") if quantity == "position" else ("mm/s", "m/s")
        return f"{text}; are the sigmas in {units[0]}?", f"give them in {units[1]}"
    if quantity == "position" and any(
        lag is not None and lag > LAG_ONE_MATTERS for lag in figures["innovations"]["lag1"] or ()
    ):
        return f"{text}; time-correlated errors do not show in them", ""
    if quantity == "velocity":  # else they are narrowed (`navigation.diagnosis.variances`)
        return f"{text}; innovations do not show errors that last for seconds", ""
    help_ = "set a smaller gnss.sigma_m, to use the full accuracy of the positions"
    return f"{text}; the images are better than their sigmas", help_


def _plural(quantity: str) -> str:
    return "positions" if quantity == "position" else "velocities"


def whiteness(figures: Figures) -> Iterator[Finding]:
    """Yield innovations that are not of zero mean, or time-correlated."""
    i = figures["innovations"]
    if i["rms_mm"] is None:
        return
    for axis, mean, rms in zip(NED_NAMES, i["mean_mm"], i["rms_mm"], strict=True):
        if abs(mean) > max(MEAN_MATTERS, i["lag1_bound_99"]) * rms:
            text = (
                f"the GNSS positions are {millimetres(mean)} {axis} off their prediction in the"
                f" mean (rms {millimetres(rms)}), and the images may be off by as much"
            )
            yield ranked(
                "mean",
                TRUST * abs(mean) / rms / MEAN_MATTERS,
                text,
                "look for an error of lever arm, clock or datum",
            )
    bound = max(LAG_ONE_MATTERS, i["lag1_bound_99"])
    determined = [
        (lag, axis) for lag, axis in zip(i["lag1"], NED_NAMES, strict=True) if lag is not None
    ]
    conservative = figures["consistency"]["position"]["verdict"] == "conservative"
    for sign in (
        (1.0,) if conservative else (1.0, -1.0)
    ):  # too large sigmas alone make negative ones as well
        beyond = [(lag, axis) for lag, axis in determined if sign * lag > bound]
        if not beyond:
            continue
        listed = ", ".join(f"{lag:+.2f} {axis}" for lag, axis in beyond)
        text = (
            f"the errors of a GNSS position correlate with those of the one before by {listed}"
            f" (99 % bound {i['lag1_bound_99']:.2f})"
        )
        yield ranked(
            "correlation",
            max(abs(lag) for lag, _ in beyond) / LAG_ONE_MATTERS,
            *_why_correlated(figures, text, sign),
        )


def _why_correlated(figures: Figures, text: str, sign: float) -> tuple[str, str]:
    if sign < 0:
        text += ": the GNSS sigmas are too small, and so are those of the images"
        return text, "raise the sigmas of the fixes"
    if figures["time_correlated_errors"]:
        return (
            f"{text}: they are time-correlated by more than their estimate explains, and the"
            " sigmas of the images are too small",
            "trust the images relative to each other more than their sigmas",
        )
    help_ = (
        'set gnss.gm_sigma = "auto" to estimate them; where that estimate failed, trust the'
        " sigmas only relative to each other"
    )
    return (
        f"{text}: they are time-correlated, which the sigmas of the images do not include",
        help_,
    )


def separation(figures: Figures) -> Iterator[Finding]:
    """Yield the separation of forward and backward where it exceeds its sigmas."""
    worst = {}
    for size, listed, state, _ in sorted(apart(figures)):
        worst[state] = size, listed  # the largest of each
    if worst:
        by_size = sorted(worst.values(), reverse=True)
        listed = ", ".join(text for _, text in by_size)
        why = (
            "the IMU noise model or the GNSS sigmas are too small, or the lever arm or a clock is"
            " wrong"
        )
        text = (
            f"forward and backward disagree by, in sigmas (rms), {listed}: the sigmas of the images"
            f" are too small by up to as much, because {why}"
        )
        yield ranked("separation", TRUST * by_size[0][0], text, "look in its figure where")


def separation_once(figures: Figures) -> Iterator[Finding]:
    """Yield the instant at which forward and backward disagree, where on the whole they do not."""
    largest = figures["separation"]["largest"]
    if largest is None or largest["sigmas"] <= SEPARATION_ONCE or any(apart(figures)):
        return
    text = (
        f"forward and backward disagree by {largest['sigmas']:.1f} sigmas in {largest['state']} "
        f"{largest['axis']} at {at_time(figures, largest['time_s'])}, and agree on the whole: the "
        "fixes or the IMU drifted at this time, for seconds or minutes, and the images by more "
        "than their sigmas"
    )
    help_ = "look at the quality of the fixes there, and at the IMU's temperature"
    yield ranked("separation", TRUST * largest["sigmas"] / SEPARATION_ONCE, text, help_)


def separation_below(figures: Figures) -> Iterator[Finding]:
    """Yield the separation of forward and backward where it is far below its sigmas."""
    separation, below = figures["separation"], []
    for state, ratio in separation["of_all_axes"].items():
        if ratio is not None and ratio < (
            limit := min(SEPARATION_WIDE, separation["floor"][state])
        ):
            below.append((limit / max(ratio, 1e-2), f"{ratio:.2f} in {state}"))
    if below:
        listed = ", ".join(text for _, text in sorted(below, reverse=True))
        text = (
            "forward and backward agree far better than their sigmas say (rms of the difference"
            f" over sigma: {listed}; expected 1): the sigmas of the images are too large"
        )
        help_ = (
            "look for sigmas of the fixes or a noise model of the IMU that are larger than they"
            " should be"
        )
        yield ranked("separation", max(rank for rank, _ in below), text, help_)


def time_correlated(figures: Figures) -> Iterator[Finding]:
    """Yield time-correlated errors of the fixes; `accuracy.code` reports those that stay."""
    neighbours, fixes = figures["neighbours"], figures["counts"]["fixes"]
    for error in figures["time_correlated_errors"]:
        if error["time_s"] >= STAYS_S or error["fixes"] < FEW_MATTER * fixes:
            continue
        of_all = error["fixes"] > 0.5 * fixes
        whose = (
            "the receiver's errors"
            if of_all
            else f"the errors of {error['fixes']} fixes (float or code)"
        )
        seconds = f"{error['time_s']:.0f}" if error["time_s"] >= 10.0 else f"{error['time_s']:.1f}"
        sigmas = (
            f"{max(error['share']):.2f} of {'its' if of_all else 'their'} sigmas"
            f" ({lengths([1e3 * sigma for sigma in error['sigma_m']])}, N / E / D)"
        )
        text = f"{whose} are taken as time-correlated over {seconds} s, {sigmas}"
        if neighbours is not None:
            median_mm = figures["exposures"]["position_mm"]["median"]
            text += (
                ": neighbouring images share them, and are known to"
                f" {lengths(neighbours['position_mm'])} relative to each other, to"
                f" {lengths(median_mm)} absolutely (E / N / U)"
            )
        yield ranked(
            "time-correlated errors",
            max(error["share"]) + (max(error["share"]) > SHOWN_SHARE),
            text,
            ADVICE_ON_COMMON_ERRORS if neighbours else "",
        )


def checks(figures: Figures) -> Iterator[Finding]:
    """Yield what the checks of the input found, but for what other rules report with its effect."""
    covered = ["IMU rate"] * bool(figures["imu_gaps"] or len(figures["segments"]) > 1) + [
        "GNSS rate"
    ] * bool(figures["outages"])
    covered += ["fixes minus solution", UNSEEN] + ["IMU gaps"] * bool(figures["imu_gaps"])
    covered += ["GNSS speed"] * any(rejected_fixes(figures))
    for check in figures["checks"]:
        made_up = figures["standing"] and "GNSS" in check["name"]
        if check["verdict"] == "ok" or (
            check["verdict"] == "note" and (made_up or check["name"] in covered)
        ):
            continue
        noted = CHECKS.get(check["name"], REMARK)
        rank = noted if check["beyond_chance"] or noted != ADOPTED else REMARK
        if check["verdict"] == "contradiction":
            rank = OVERRULED
        yield ranked(
            "checks",
            rank,
            f"{check['name']}: {check['found']} (expected: {check['expected']})",
            check["advice"],
        )
