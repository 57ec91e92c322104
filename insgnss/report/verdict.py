"""What limits a flight, in plain sentences with numbers, from the figures of `summary`.

A sentence is said where a figure leaves what a good flight shows by enough to matter to its user, not where a test of a hundred
thousand fixes can tell it from perfection; the limits stand below.
"""

from collections.abc import Callable, Iterator, Mapping
from typing import Any

FIRST_IMAGE_RATIO = 1.5  # sigma of the first image over the median
WORST_IMAGE_RATIO = 3.0
TURN_DEG = 60.0  # heading range that counts as a turn
NIS_MATTERS = (0.64, 1.56)  # mean NIS per degree of freedom: sigmas off by more than a quarter
LAG_ONE_MATTERS = 0.3
MEAN_MATTERS = 0.5  # of the rms
REJECTED_MATTERS = 0.01  # share of the fixes
OUTAGE_MATTERS = 5.0  # times the median interval of the fixes
SHORT_OUTAGE_S = 0.2  # an interval below which the same number of missing fixes does not matter
SEPARATION_MATTERS = 1.5  # normalised rms
NOTHING_STANDS_OUT = "nothing stands out: innovations, forward/backward separation and the sigmas of all images are those of a good flight"

Figures = Mapping[str, Any]


def headline(figures: Figures) -> str:
    """One line: what accuracy the run claims, and whether its innovations support the claim."""
    images, fixes = figures["exposures"], figures["counts"]
    claim = figures["trajectory"] if images is None else images
    position = " / ".join(millimetres(x, unit=False) for x in claim["position_mm"]["median"])
    tilt, heading = _tilt(claim["attitude_deg"]["median"]), claim["attitude_deg"]["median"][2]
    what = "trajectory" if images is None else f"{images['count']} images"
    support = {
        "consistent": "the innovations agree with them",
        "overconfident": "the innovations are larger than they say",
        "conservative": "the innovations are smaller than they say",
        "unknown": "no fix supports them",
    }[_judged(figures["consistency"]["position"])]
    if figures["reopened_s"] or any(
        r > SEPARATION_MATTERS for ratios in figures["separation"]["normalised_rms"].values() for r in ratios if r
    ):
        support = "but parts of the flight contradict them"
    return (
        f"{what}: median sigmas {position} mm ({', '.join(claim['axes'])}), tilt {degrees(tilt)}, heading {degrees(heading)}; {support} "
        f"({fixes['fixes_used']} of {fixes['fixes']} fixes used)"
    )


def limits(figures: Figures) -> list[str]:
    """Sentences on what limits the flight; one that says so where nothing stands out."""
    rules: tuple[Callable[[Figures], Iterator[str]], ...] = (
        _fixes,
        _reopened,
        _nis,
        _innovations,
        _separation,
        _first_image,
        _worst_image,
        _outage,
        _gaps,
        _checks,
    )
    said = [sentence for rule in rules for sentence in rule(figures)]
    return said or [NOTHING_STANDS_OUT]


def millimetres(x: float, unit: bool = True) -> str:
    """Length in mm with two significant digits at least, in m from 10 m on where the unit is told."""
    if unit and abs(x) >= 1e4:
        return f"{x / 1e3:.1f} m"
    return f"{x:z.1f}{' mm' if unit else ''}" if abs(x) < 100 else f"{x:.0f}{' mm' if unit else ''}"


def degrees(x: float) -> str:
    """Angle in deg with two significant digits."""
    return f"{x:.2g} deg" if abs(x) < 10 else f"{x:.0f} deg"


def _tilt(attitude: list[float]) -> float:
    return max(attitude[:2])


def _judged(consistency: Figures) -> str:
    """Verdict where it matters: within NIS_MATTERS the sigmas agree for all that their user can tell."""
    ratio = consistency["mean_per_dof"]
    if ratio is not None and NIS_MATTERS[0] <= ratio <= NIS_MATTERS[1]:
        return "consistent"
    return str(consistency["verdict"])


def _fixes(f: Figures) -> Iterator[str]:
    for total, rejected in (("fixes", "fixes_rejected"), ("velocities", "velocities_rejected")):
        n, out = f["counts"].get(total, 0), f["counts"].get(rejected, 0)
        if n and out == n:
            yield f"all {n} {total} were rejected: they contradict the inertial data; check clock, axes and lever arm"
        elif n and out > REJECTED_MATTERS * n:
            yield f"{out} of {n} {total} ({100 * out / n:.1f} %) were rejected by the gate: their sigmas do not describe their errors"


def _reopened(f: Figures) -> Iterator[str]:
    times = f["reopened_s"]
    if times:
        at = ", ".join(f"{time:.1f}" for time in times[:5]) + (" ..." if len(times) > 5 else "")
        yield f"the filter lost the fixes and was opened again {len(times)} times (TOW {at} s): only later fixes support it there"


def _nis(f: Figures) -> Iterator[str]:
    for what in ("position", "velocity"):
        c = f["consistency"][what]
        if c is None or _judged(c) in ("consistent", "unknown"):
            continue
        nis = "NIS {:.2f} per degree of freedom, 99 % bounds {:.3f} to {:.3f}".format(c["mean_per_dof"], *c["bounds_99"])
        told = f"{what} innovations are {c['size']:.2f} times what their sigmas say ({nis})"
        if c["verdict"] == "overconfident":
            why = "the sigmas of GNSS or IMU, and so those of the images, are too small, or the lever arm or a clock is wrong"
            yield f"overconfident: {told}; {why}"
        else:
            yield f"conservative: {told}; the sigmas of GNSS or IMU are too large"


def _innovations(f: Figures) -> Iterator[str]:
    i = f["innovations"]
    if i["rms_mm"] is None:
        return
    for axis, mean, rms, lag in zip(("north", "east", "down"), i["mean_mm"], i["rms_mm"], i["lag1"], strict=True):
        if abs(mean) > max(MEAN_MATTERS, i["lag1_bound_99"]) * rms:
            told = f"innovations {axis} have a mean of {millimetres(mean)} (rms {millimetres(rms)})"
            yield f"{told}: look for an error of lever arm, clock or datum"
        if lag is not None and abs(lag) > max(LAG_ONE_MATTERS, i["lag1_bound_99"]):
            why = (
                "errors of GNSS last from fix to fix, which the smoothed sigmas do not know" if lag > 0 else "the GNSS sigmas are too small"
            )
            yield f"innovations {axis} correlate {lag:+.2f} with those of the fix before (99 % bound {i['lag1_bound_99']:.2f}): {why}"


def _separation(f: Figures) -> Iterator[str]:
    for state, ratios in f["separation"]["normalised_rms"].items():
        known = [(r, axis) for r, axis in zip(ratios, f["separation"]["axes"], strict=True) if r is not None]
        if known and max(known)[0] > SEPARATION_MATTERS:
            ratio, axis = max(known)
            told = f"forward and backward disagree by {ratio:.1f} sigma (rms) in {state} {axis}"
            yield f"{told}: the IMU noise model or the GNSS sigmas are too small, or the lever arm or a clock is wrong"


def _first_image(f: Figures) -> Iterator[str]:
    e = f["exposures"]
    if e is None:
        return
    first, median = e["attitude_deg"]["first"], e["attitude_deg"]["median"]
    if first[2] > FIRST_IMAGE_RATIO * median[2]:
        turn = e["heading_range_before_first_deg"]
        why = "no turn before it" if turn < TURN_DEG else f"although the heading turned over {turn:.0f} deg before it"
        yield f"heading sigma {degrees(first[2])} at the first image, {degrees(median[2])} in the median: {why}"
    if _tilt(first) > FIRST_IMAGE_RATIO * _tilt(median):
        yield f"tilt sigma {degrees(_tilt(first))} at the first image, {degrees(_tilt(median))} in the median: too little flight before it"


def _worst_image(f: Figures) -> Iterator[str]:
    e = f["exposures"]
    if e is None:
        return
    for name, told, key in (("position", millimetres, "position_mm"), ("attitude", degrees, "attitude_deg")):
        worst, median = e[key]["worst"], e[key]["median"]
        if max(worst["sigma"]) > WORST_IMAGE_RATIO * max(median) and worst["image"] != e["first_image"]:
            sigmas = f"{told(max(worst['sigma']))} against {told(max(median))} in the median"
            yield f"worst {name} at image {worst['image']} (TOW {worst['time_s']:.1f} s): sigma {sigmas}"


def _outage(f: Figures) -> Iterator[str]:
    o, used = f["longest_outage"], f["counts"]["fixes_used"]
    if used and o["median_interval_s"] is not None and o["length_s"] > OUTAGE_MATTERS * max(o["median_interval_s"], SHORT_OUTAGE_S):
        sigmas = f"{millimetres(o['horizontal_mm'])} horizontally, {millimetres(o['down_mm'])} down"
        yield f"no used fix for {o['length_s']:.1f} s from TOW {o['time_s']:.1f} s on: smoothed sigmas reach {sigmas} there"


def _gaps(f: Figures) -> Iterator[str]:
    gaps = f["imu_gaps"]
    if gaps:
        longest = max(gaps, key=lambda gap: gap["length_s"])
        told = "1 gap of the IMU was bridged," if len(gaps) == 1 else f"{len(gaps)} gaps of the IMU were bridged, the longest"
        yield f"{told} of {longest['length_s']:.3f} s at TOW {longest['time_s']:.1f} s"


def _checks(f: Figures) -> Iterator[str]:
    for check in f["checks"]:
        if check["verdict"] != "ok":
            advice = f"; {check['advice']}" if check["advice"] else ""
            yield f"{check['name']}: found {check['found']}, expected {check['expected']}{advice}"
