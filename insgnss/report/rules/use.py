"""Which images of a flight can be used: `use` of report.json, and the colour of the page.

An image can be used where the standard deviations of its exterior orientation are within a need,
component by component: positions east, north, up in m, rotations about these axes in deg. They are
those of the result, enlarged by what the flight itself holds against them,

    s' = sqrt((k s)^2 + d^2)                                                                  (U.1)

with k the factor by which innovations or the separation of forward and backward exceed what the
sigmas promise, and d the length by which the flight's own data stand off, each for the images that
it concerns. A remark that lifts no image beyond its need changes nothing for their user.

The flight file states the need (`output.need_m`, `output.need_deg`). Without it the measure is what
this receiver and this IMU give where all is well: an image is known at least as well as a single
fix is predicted (`NEED_OF_FIX`, in height with a phase centre that is not stated), and turned no
worse than `NEED_OF_MEDIAN` times the median image,
or than a good flight's tilt and heading (`accuracy.GOOD_TILT_DEG`, `GOOD_HEADING_DEG`).
"""

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ...base.wording import some
from ...records import Array
from ...records.cameras.mounting import UNSTATED_PHASE_CENTRE_SIGMA_M
from . import accuracy, fixes, places
from .wording import Figures, at_time, degrees, millimetres, no_fix, span

Rows = NDArray[np.bool_]

USE, EXCEPT, NO = "use", "except", "no"
PHRASES = {USE: "Use it", EXCEPT: "Use it except", NO: "Do not use it"}
STATED_NEED, USUAL_NEED = "stated", "receiver and IMU"  # which need was taken

NEED_OF_FIX = 1.5  # needed sigma over that of a predicted fix: a smoothed image is below 1
# needed sigma over the median image's: tilt is held by every turn, heading by those near in time,
# and a line after which no turn follows has six times the median of a right flight
NEED_OF_MEDIAN = np.array([3.0, 3.0, 10.0])
CHANCE = 3.0  # sigmas of a disagreement at one instant that chance explains: the rest enlarges
AROUND_S = 60.0  # on both sides of such an instant: fixes and IMU drift for seconds to minutes
RESET_S = 30.0  # on both sides of a covariance reset: the filter had lost the fixes by then
MOST_PLACES = 4  # of weak images that get a sentence each, and that are listed in one (chosen)
UNREACHABLE = math.inf  # d of (U.1) where nothing bounds it
ENU_AXES = ("east", "north", "up")
# checks whose notes ask what no data of the flight can answer
OPEN_QUESTIONS = ("exposure clock", "GNSS swing")


@dataclass(frozen=True, eq=False)
class Inflation:
    """What the flight holds against the sigmas of its images, by (U.1).

    Parameters
    ----------
    text, help : str
        What is the case, and what to do about it.
    topic : str
        Of the rule that says the same of the whole flight.
    position, attitude : float or ndarray
        k of the positions east, north, up and of the rotations.
    moves_m : float or ndarray
        d of the positions.
    span : tuple of float, optional
        First and last instant, s, of the images that it concerns; None: all.
    """

    text: str
    help: str
    topic: str
    position: "float | Array" = 1.0
    attitude: float = 1.0
    moves_m: "float | Array" = 0.0
    span: tuple[float, float] | None = None


@dataclass(frozen=True, eq=False)
class JudgedPlaces:
    """What is judged: the images, or without a camera the epochs of the trajectory.

    Parameters
    ----------
    time : ndarray
        (n,) s, GPST.
    position_m, attitude_deg : ndarray
        (n, 3) standard deviations in the axes east, north, up.
    names : sequence of str
        Of the images; empty without a camera.
    """

    time: Array
    position_m: Array
    attitude_deg: Array
    names: Sequence[str] = ()

    def within(self, span: tuple[float, float] | None) -> Rows:
        """Return which are within a span of time."""
        if span is None:
            return np.ones(self.time.size, bool)
        return (self.time >= span[0]) & (self.time <= span[1])

    def listed(self, rows: Rows) -> str:
        """Return how many and which they are, in words."""
        index = np.flatnonzero(rows)
        if not self.names:
            return f"{index.size / self.time.size:.0%} of the trajectory"
        count = f"{index.size} image{'' if index.size == 1 else 's'}"
        if index.size == self.time.size:
            return f"all {count}" if index.size > 1 else count
        runs = np.split(index, np.flatnonzero(np.diff(index) > 1) + 1)
        ends = [dict.fromkeys((self.names[run[0]], self.names[run[-1]])) for run in runs]
        return f"{count} ({some((' ... '.join(pair) for pair in ends), MOST_PLACES)})"


def use(
    figures: Figures,
    judged: JudgedPlaces,
    need_m: Sequence[float] | None = None,
    need_deg: Sequence[float] | None = None,
) -> dict[str, Any]:
    """Return whether and for which images a flight can be used.

    Parameters
    ----------
    figures : mapping
        Figures of the run, of `summary`.
    judged : JudgedPlaces
        The images, or the epochs of the trajectory.
    need_m, need_deg : sequence of float, optional
        (3,) needed standard deviations of positions, m, and rotations, deg; east, north, up.

    Returns
    -------
    dict
        `verdict` ("use", "except", "no"), `sentence`, `images` (names of those not to be used),
        `reasons`, `topics` (of the limits that say the same as the reasons), `usable` (of "except":
        how many others there are, and the medians of their standard deviations), `largest_m` and
        `largest_deg` (of all images, by (U.1)), `need_m`, `need_deg` and `measure` (where the
        needs are from).
    """
    usual = _usual_need(figures, judged)
    needs = [
        np.array(default if stated is None else stated)
        for default, stated in zip(usual, (need_m, need_deg), strict=True)
    ]
    needed = np.hstack(needs)
    sigma = np.hstack([judged.position_m, judged.attitude_deg])
    insufficient = _rows_beyond_need(sigma, needed)
    weakest = list(_insufficient(figures, judged, sigma, needed))
    topics = [topic for _, covered_topics in weakest for topic in covered_topics]
    reasons = [text for text, _ in weakest]
    inflations = [
        (each, *_factor_and_shift(each, judged)) for each in _reasons_of_wide_sigmas(figures)
    ]
    factor, moved = np.ones_like(sigma), np.zeros_like(sigma)
    for _, scale, shift in inflations:
        factor, moved = np.maximum(factor, scale), np.hypot(moved, shift)
    enlarged = np.hypot(factor * sigma, moved)
    beyond = _rows_beyond_need(enlarged, needed)
    for inflation, scale, shift in inflations:
        concerned = beyond & judged.within(inflation.span)
        if (
            concerned & _rows_beyond_need(np.hypot(scale * sigma, shift), needed) & ~insufficient
        ).any():
            reasons.append(f"{inflation.text} ({judged.listed(concerned)}); {inflation.help}")
            topics.append(inflation.topic)
    against = list(_refusals(figures))
    verdict = NO if against or beyond.all() else EXCEPT if beyond.any() else USE
    until = ""
    if verdict != NO and (questions := list(_questions(figures))):
        verdict, reasons, beyond = EXCEPT, [*questions, *reasons], np.ones_like(beyond)
        until = " until the question below is answered"
    return {
        "verdict": verdict,
        "sentence": PHRASES[verdict]
        + (f" {judged.listed(beyond)}{until}" if verdict == EXCEPT else ""),
        "images": [name for name, out in zip(judged.names, beyond, strict=False) if out],
        "reasons": [*against, *reasons],
        "topics": list(dict.fromkeys(topics)),
        "usable": _medians(judged, ~beyond) if verdict == EXCEPT and not beyond.all() else None,
        "largest_m": enlarged[:, :3].max(axis=0).tolist(),
        "largest_deg": enlarged[:, 3:].max(axis=0).tolist(),
        "need_m": needs[0].tolist(),
        "need_deg": needs[1].tolist(),
        "measure": USUAL_NEED if need_m is None and need_deg is None else STATED_NEED,
    }


def _medians(judged: JudgedPlaces, rows: Rows) -> dict[str, Any]:
    """Return how many places are usable, and the medians of their standard deviations."""
    medians = {
        name: {"median": np.median(sigma[rows], axis=0).tolist()}
        for name, sigma in (
            ("position_mm", 1e3 * judged.position_m),
            ("attitude_deg", judged.attitude_deg),
        )
    }
    return {"count": int(rows.sum())} | medians


def _rows_beyond_need(sigma: Array, needed: Array) -> Rows:
    """Return which of n images have a standard deviation beyond the need."""
    rows: Rows = np.logical_or.reduce(sigma > needed, axis=1)
    return rows


def _usual_need(figures: Figures, judged: JudgedPlaces) -> tuple[Array, Array]:
    """Return what receiver and IMU give where all is well: m and deg, east, north, up."""
    median_m = np.median(judged.position_m, axis=0)
    median_deg = np.median(judged.attitude_deg, axis=0)
    good_deg = [accuracy.GOOD_TILT_DEG, accuracy.GOOD_TILT_DEG, accuracy.GOOD_HEADING_DEG]
    need_deg = np.maximum(NEED_OF_MEDIAN * median_deg, good_deg)
    predicted = figures["innovations"]["median_sigma_mm"]
    if predicted is None or figures["standing"]:
        return NEED_OF_MEDIAN[0] * median_m, need_deg
    half_of_fixes = 0.5 * figures["counts"]["fixes"]
    slow_variances = [
        np.square(error["sigma_m"])
        for error in figures["time_correlated_errors"]
        if error["fixes"] > half_of_fixes
    ]
    unstated = figures["flight"].get("mounting", {}).get("antenna_sigma_m") is None
    slow_variances.append(np.square([0.0, 0.0, UNSTATED_PHASE_CENTRE_SIGMA_M * unstated]))
    north, east, down = np.sqrt(np.square(np.array(predicted) * 1e-3) + sum(slow_variances))
    return NEED_OF_FIX * np.array([east, north, down]), need_deg


def _factor_and_shift(inflation: Inflation, judged: JudgedPlaces) -> tuple[Array, Array]:
    """Return k and d (n, 6) of (U.1) of one inflation."""
    rows = judged.within(inflation.span)
    k, d = np.ones((judged.time.size, 6)), np.zeros((judged.time.size, 6))
    k[rows, :3], k[rows, 3:] = inflation.position, inflation.attitude
    d[rows, :3] = inflation.moves_m
    return k, d


def _refusals(figures: Figures) -> Iterator[str]:
    """Yield what forbids the use of all images, whatever their sigmas are."""
    for check in figures["checks"]:
        if check["verdict"] == "contradiction":
            advice = f"; {check['advice']}" if check["advice"] else ""
            yield (
                f"the data contradict the flight file, {check['name']}: {check['found']} (expected:"
                f" {check['expected']}){advice}"
            )
    if not figures["counts"]["fixes_used"]:
        yield "no GNSS position was used, nothing supports the images; check clock, axes and week"


def _questions(figures: Figures) -> Iterator[str]:
    """Yield what no data of the flight can answer, and all images depend on."""
    for check in figures["checks"]:
        accepted = check["name"] in (figures["flight"].get("accept") or ())
        if check["verdict"] == "note" and check["name"] in OPEN_QUESTIONS and not accepted:
            yield f"{check['name']}: {check['found']}; {check['advice']}"


def _reasons_of_wide_sigmas(figures: Figures) -> Iterator[Inflation]:
    """Yield what the flight holds against its sigmas, and what that does to the images."""
    if figures["standing"]:
        return
    yield from _scatter(figures)
    yield from _separations(figures)
    yield from _whiteness(figures)
    yield from _offsets_from_fixes(figures)
    for time in figures["covariance_resets_s"]:
        yield Inflation(
            f"the filter lost the GNSS positions before {at_time(figures, time)} and began anew"
            " there",
            "check the GNSS positions before this time; if they jump, leave these out",
            "covariance resets",
            moves_m=UNREACHABLE,
            span=(time - RESET_S, time + RESET_S),
        )
    for finding in accuracy.lever_arm(figures):
        arm = {axis: abs(state["value"]) for axis, state in accuracy.arm_states(figures).items()}
        level = math.hypot(arm.get("forward", 0.0), arm.get("right", 0.0))
        moves_m = np.array([level, level, arm.get("down", 0.0)])
        yield Inflation(finding.found, finding.advice, finding.name, moves_m=moves_m)


def _scatter(figures: Figures) -> Iterator[Inflation]:
    """Yield positions and velocities that scatter more than their sigmas."""
    for quantity in ("position", "velocity"):
        consistency = figures["consistency"][quantity]
        if consistency is not None and fixes.consistency_verdict(consistency) == "overconfident":
            scatter = consistency["size"]
            text = (
                f"the GNSS {'positions' if quantity == 'position' else 'velocities'} scatter"
                f" {scatter:.1f} times as much as their sigmas say, and so may the images"
            )
            yield Inflation(
                text,
                "check lever arm and clocks, then raise the sigmas of the fixes",
                "innovations",
                scatter if quantity == "position" else 1.0,
                scatter,
            )


def _offsets_from_fixes(figures: Figures) -> Iterator[Inflation]:
    """Yield the times in which the trajectory differs in the mean from its own fixes."""
    residuals = figures["residuals"]
    for piece in residuals["pieces"] if residuals is not None else ():
        mean, sigma = np.array(piece["mean_mm"]), np.array(piece["sigma_mm"])
        beyond = np.where(np.abs(mean) > residuals["limit"] * sigma, np.abs(mean), 0.0)
        if beyond.any():
            yield Inflation(
                "the trajectory differs from its own GNSS positions by"
                f" {millimetres(beyond.max())} in the mean of"
                f" {span(figures, piece['begin_s'], piece['end_s'])}",
                "find the cause before these images are used",
                "residuals",
                moves_m=1e-3 * beyond[[1, 0, 2]],
                span=(piece["begin_s"], piece["end_s"]),
            )


def _separations(figures: Figures) -> Iterator[Inflation]:
    """Yield the disagreement of forward and backward: on the whole, or at one instant."""
    separation = figures["separation"]
    k = dict.fromkeys(separation["normalised_rms"], 1.0)
    for _, _, state, ratio in fixes.apart(figures):
        k[state] = max(k[state], ratio)
    if max(k.values()) > 1.0:
        yield Inflation(
            f"the solutions forward and backward in time disagree by {max(k.values()):.1f} times"
            " what their sigmas say",
            "check the IMU's noise model, the sigmas of the fixes, lever arm and clocks",
            "separation",
            k["position"],
            max(k["attitude"], k["velocity"]),
        )
        return
    largest = separation["largest"]
    if largest is not None and largest["sigmas"] > fixes.SEPARATION_ONCE:
        once = largest["sigmas"] / CHANCE
        yield Inflation(
            f"the solutions forward and backward in time disagree by {largest['sigmas']:.1f} sigmas"
            f" in {largest['state']} at {at_time(figures, largest['time_s'])}",
            "look at the quality of the fixes there, and at the IMU's temperature",
            "separation",
            once if largest["state"] == "position" else 1.0,
            once if largest["state"] != "position" else 1.0,
            span=(largest["time_s"] - AROUND_S, largest["time_s"] + AROUND_S),
        )


def _whiteness(figures: Figures) -> Iterator[Inflation]:
    """Yield innovations with a mean, or with errors that stay from fix to fix.

    The mean of n variables of autocorrelation r^j scatters sqrt((1 + r) / (1 - r)) times as much as
    that of independent ones.
    """
    i = figures["innovations"]
    if i["rms_mm"] is None:
        return
    mean, rms = np.abs(i["mean_mm"]), np.array(i["rms_mm"])
    beyond = np.where(mean > max(fixes.MEAN_MATTERS, i["lag1_bound_99"]) * rms, mean, 0.0)
    if beyond.any():
        yield Inflation(
            f"the GNSS positions differ from their prediction by {millimetres(beyond.max())} in"
            " the mean of the whole flight",
            "look for an error of lever arm, clock or datum",
            "mean",
            moves_m=1e-3 * beyond[[1, 0, 2]],
        )
    lags = np.array([lag or 0.0 for lag in i["lag1"]])
    lags[lags <= max(fixes.LAG_ONE_MATTERS, i["lag1_bound_99"])] = 0.0
    if lags.any():
        k = np.sqrt((1.0 + lags) / np.maximum(1.0 - lags, 1e-3))
        yield Inflation(
            "errors of consecutive GNSS positions are correlated (correlation"
            f" {lags.max():.2f}), which the sigmas of the images do not include",
            'gnss.gm_sigma = "auto" estimates them',
            "correlation",
            k[[1, 0, 2]],
        )


def _insufficient(
    figures: Figures, judged: JudgedPlaces, sigma: Array, needed: Array
) -> Iterator[tuple[str, list[str]]]:
    """Yield where the images are beyond their need by the result's own sigmas, and why.

    The topics are those of the limits that say the same.
    """
    beyond = _rows_beyond_need(sigma, needed)
    edges = np.flatnonzero(np.diff(np.concatenate([[False], beyond, [False]]).astype(int)))
    runs = edges.reshape(-1, 2)
    if len(runs) > MOST_PLACES:
        runs = np.array([[runs[0, 0], runs[-1, 1]]])
    faults: dict[tuple[int, str, str, float], list[tuple[float, str, Rows]]] = {}
    for begin, end in runs:
        rows = np.zeros_like(beyond)
        rows[begin:end] = beyond[begin:end]
        row, column = _weakest(sigma / needed, rows)
        cause = _cause(figures, float(judged.time[begin]), float(judged.time[end - 1]), column)
        ratio = float((sigma / needed)[row, column])
        fault = column, cause.help, cause.topic, cause.since_s
        faults.setdefault(fault, []).append((ratio, cause.why, rows))
    for (_, help_, topic, _), places_of_it in faults.items():  # one fault, one sentence
        rows = np.logical_or.reduce([rows for _, _, rows in places_of_it])
        _, why, _ = max(places_of_it, key=lambda run: run[0])
        row, column = _weakest(sigma / needed, rows)
        if column < 3:
            known_to, needed_text = (
                millimetres(1e3 * values[column]) for values in (sigma[row], needed)
            )
            quantity, topics = f"position {ENU_AXES[column]}", ["horizontal", "image"]
        else:
            known_to, needed_text = degrees(sigma[row, column]), degrees(needed[column])
            quantity = "heading" if column == 5 else "tilt"
            topics = [quantity, "image"]
        topics += [topic] if topic else []
        text = (
            f"{quantity} is known to {known_to} only, needed are {needed_text}, in"
            f" {judged.listed(rows)}"
        )
        yield f"{text}{why}{help_}", topics


def _weakest(ratio: Array, rows: Rows) -> tuple[int, int]:
    """Return row and column of the largest ratio (n, 6) among some rows."""
    row, column = np.unravel_index(int(np.where(rows[:, None], ratio, 0.0).argmax()), ratio.shape)
    return int(row), int(column)


@dataclass(frozen=True)
class Cause:
    """Why images are weak and what helps, each after a separator; nothing where unknown.

    Parameters
    ----------
    topic : str
        Of the remark that says the same.
    since_s : float
        When it began, where it may come twice.
    """

    why: str
    help: str
    topic: str = ""
    since_s: float = 0.0


def _cause(figures: Figures, begin: float, end: float, column: int) -> Cause:
    """Return why images between two instants are weak in a column of their sigmas."""
    weighed = "or weigh them by their sigmas in the adjustment"
    left_out = f"; leave these images out, {weighed}"
    for check in figures["checks"] if column < 3 else ():
        if any(span[0] <= end and span[1] >= begin for span in check.get("spans_s", ())):
            help_ = f"; {check['advice']}{left_out}"
            return Cause(f": {check['found']}", help_, check["name"])
    outages = [o for o in figures["outages"] if o["time_s"] <= end + 1.0]
    outages = [o for o in outages if o["time_s"] + o["length_s"] >= begin - 1.0]
    if outages:
        o = max(outages, key=lambda outage: float(outage["length_s"]))
        help_ = f"; fly these images again, leave them out, {weighed}"
        return Cause(f": {no_fix(figures, o)}", help_, "outage", o["time_s"])
    if accuracy.by_stamps(figures, "position" if column < 3 else "attitude"):
        stamps = figures["exposures"]["stamps"]
        path = (
            f", {millimetres(1e3 * stamps['path_m'])} along the path in the median"
            if column < 3
            else ""
        )
        return Cause(
            f": the exposures' stamps are known to {stamps['sigma_s']:.2g} s only{path}",
            "; give stamps with all their digits, or let the receiver record the exposures",
            "exposure times",
        )
    lines = [line for line in figures["lines"] if line["start_s"] <= end and line["end_s"] >= begin]
    if column == 5 and len(lines) == 1:
        why, help_ = places.why(figures, lines[0])
        return Cause(f": {why}", f"; {help_}")
    exposures = figures["exposures"]
    if column > 2 and exposures is not None and begin <= exposures["first_time_s"]:
        why, help_ = places.why_first(figures, "heading" if column == 5 else "tilt")
        return Cause(f": {why}", f"; {help_}")
    return Cause("", left_out)
