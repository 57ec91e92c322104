"""What an engine's solution says of itself: numbers, series for figures, a verdict in words.

Epochs by class (`navigation.prepare.fix_covariance.classes`), satellites, ratio, age of the base's
observations, distance to the base, forward against backward; and, with the rover's observations,
slips, C/N0 and multipath (`phase.signal_quality`). Each cause has a check with a limit and an
advice; the verdict is that of the share of the rover's epochs that are fixed and confirmed, and
names the checks that have something to say. An epoch that the engine leaves out counts as one that
is not fixed. What shifts all positions together shows in no share: a doubt of the base
(`BASE_CHECKS`), or a contradiction between inputs, makes of "good" a "usable with care".
"""

from collections.abc import Collection, Iterable, Mapping
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ...base.errors import InputError
from ...base.files import pick_attributes
from ...io.formats.gnss.pos_covariance import (
    SIGMAS_ASSUMED,
    covariance_of_roots,
    without_inverse,
)
from ...io.formats.gnss.pos_header import ROOTS
from ...io.formats.gnss.rtklib_pos import PosRows, fixes_of_rows
from ...io.formats.read_options import ReadOptions
from ...navigation.prepare.fix_covariance.classes import (
    DEGRADED,
    ISOLATED,
    UNSUPPORTED,
    VALIDATED,
    Index,
    Separation,
)
from ...navigation.prepare.fix_covariance.numbers import FIX_CLASSES, UNKNOWN_SIGMA_M
from ...records import Array, Finding, GnssFixes, Question
from ...records.qualities import Quality
from ..phase.signal_quality import Signals, median

GOOD_RATE, FAIR_RATE = 0.99, 0.90  # share of fixed epochs: good above, poor below (chosen)
FEW_SATELLITES = 8  # of all systems: below it one lost satellite is felt (chosen)
MUCH_MULTIPATH_M = 0.8  # of code, rms: survey antennas under open sky have half of it (chosen)
# C/N0 on band 1, and on the others, where GPS L2 is tracked without its code
LOW_DBHZ, LOW_SECOND_DBHZ = 38.0, 30.0
MANY_SLIPS = 20.0  # an hour and satellite
LONG_BASELINE_M = 15e3  # from the base: beyond, the ionosphere takes integers away (chosen)
OLD_S = 5.0  # of a base epoch: satellite clocks wander by 5 mm meanwhile
# s without a position: longer ones leave the receiver's clock and the path between to guesses
LONG_GAP_S = 2.0
APART_SHARE = 0.005  # of the epochs, whose forward and backward positions contradict (chosen)
BASE_CHECKS = ("base coordinates", "base point", "base antenna")
SOLUTION_COLUMNS = ("ns", "age", "ratio")  # columns of a solution


@dataclass(frozen=True, eq=False)
class EngineSolution:
    """A `.pos` of an engine, as it gives it.

    Parameters
    ----------
    fixes : GnssFixes
        The engine's positions.
    satellites, age_s, ratio : ndarray, shape (n,)
        Number of satellites, age of the base's observations (s) and ambiguity ratio of each fix.
    """

    fixes: GnssFixes
    satellites: Array
    age_s: Array
    ratio: Array


def solution_of(rows: PosRows) -> EngineSolution:
    """Return the solution that the rows of a `.pos` hold.

    Engines that lose their numbers (dynamics at rare epochs) write standard deviations of zero, and
    roots that belong to no covariance: such epochs get `UNKNOWN_SIGMA_M`, are single (quality 5),
    and counted in a note.

    Raises
    ------
    InputError
        With file and line, as `io.formats.gnss.rtklib_pos` raises it.
    """
    columns, roots = rows.columns, ROOTS[rows.header.kind]
    if missing := [name for name in (*roots, *SOLUTION_COLUMNS) if name not in columns]:
        raise InputError.in_file(
            rows.table.path,
            f"the header does not name {missing[0]}; is it a solution of an engine?",
        )
    incomplete = _covariance_missing(np.column_stack([columns[name] for name in roots]))
    fixes = (
        _fixes_with_unknown_sigmas(rows, incomplete) if incomplete.any() else fixes_of_rows(rows)
    )
    if fixes.quality is not None:
        fixes = replace(fixes, quality=np.where(incomplete, Quality.SINGLE, fixes.quality))
    return EngineSolution(fixes, *(columns[name] for name in SOLUTION_COLUMNS))


def _covariance_missing(roots: Array) -> NDArray[np.bool_]:
    """Return which (n,) of the signed roots (n, 6), m, belong to no covariance matrix."""
    cov = covariance_of_roots(roots)
    missing = (roots[:, :3] <= 0.0).any(axis=1)
    cov[missing] = np.eye(3)
    return np.asarray(missing | without_inverse(cov))


def _fixes_with_unknown_sigmas(rows: PosRows, incomplete: NDArray[np.bool_]) -> GnssFixes:
    """Return the fixes of the rows, those `incomplete` (n,) with `UNKNOWN_SIGMA_M`, and a note."""
    zeroed = {
        name: np.where(incomplete, 0.0, rows.columns[name]) for name in ROOTS[rows.header.kind]
    }
    fixes = fixes_of_rows(
        replace(rows, columns=rows.columns | zeroed), ReadOptions(sigma_m=UNKNOWN_SIGMA_M)
    )
    finding = (
        f"{int(incomplete.sum())} epochs have no covariance: standard deviations of zero, or"
        " correlations beyond one"
    )
    sigmas = ", ".join(f"{s:g}" for s in UNKNOWN_SIGMA_M)
    advice = (
        f"these epochs get standard deviations of {sigmas} m and count as single-point solutions;"
        " an engine's dynamics model needs an epoch about every second"
    )
    note = Question("GNSS covariance", "a covariance each").note(finding, advice)
    other_notes = tuple(check for check in fixes.notes if check.topic != SIGMAS_ASSUMED)
    return replace(fixes, notes=(*other_notes, note))


def solution_series(
    solution: EngineSolution,
    kind: Index,
    distance_m: Array,
    height_difference_m: Array,
    separation: Separation | None,
    signals: Signals | None,
) -> dict[str, Any]:
    """Return arrays by name, as `report.charts.gnss` draws them."""
    series: dict[str, Any] = {"time": solution.fixes.time, "kind": kind}
    series |= pick_attributes(solution, "satellites", "ratio", "age_s")
    series |= {"distance_m": distance_m, "height_difference_m": height_difference_m}
    if separation is not None:
        sigma = np.sqrt(np.diagonal(separation.cov, axis1=1, axis2=2))
        series |= {"separation_m": separation.ned, "separation_sigma_m": sigma}
    if signals is not None:
        series |= pick_attributes(signals, "gaps", "slip_time")
        series |= {"slip_satellite": signals.slip_satellite.tolist()}
        series |= {"cn0_time": signals.cn0_time, "cn0": dict(signals.cn0)}
    return series


def solution_numbers(
    solution: EngineSolution,
    calibrated: GnssFixes,
    kind: Index,
    distance_m: Array,
    height_difference_m: Array,
    separation: Separation | None,
    gate: float,
) -> dict[str, Any]:
    """Return figures of merit of the solution as plain numbers.

    Epochs and fix_rate are of the solved epochs (those of `coverage_numbers` are of the rover's).

    Parameters
    ----------
    solution : EngineSolution
        The combined solution.
    calibrated : GnssFixes
        Its fixes with the covariances of `navigation.prepare.fix_covariance.classes`.
    kind : ndarray of int, shape (n,)
        Their classes, as indices of `FIX_CLASSES`.
    distance_m, height_difference_m : ndarray, shape (n,)
        From the base, m.
    separation : Separation, optional
        Of the forward and the backward run.
    gate : float
        Normalised square of a separation beyond which two runs contradict each other.
    """
    fixes = solution.fixes
    quality = np.zeros(kind.size, dtype=np.int64) if fixes.quality is None else fixes.quality
    sigma = np.sqrt(np.diagonal(calibrated.cov_ned, axis1=1, axis2=2))
    fixed = np.isin(kind, VALIDATED)
    numbers: dict[str, Any] = {
        "epochs": kind.size,
        "span_s": [float(fixes.time[0]), float(fixes.time[-1])],
        "engine_fixed": int((quality == Quality.FIXED).sum()),
        "classes": {name: int((kind == k).sum()) for k, name in enumerate(FIX_CLASSES)},
        "fix_rate": float(fixed.mean()),
        "satellites": {
            "median": float(np.median(solution.satellites)),
            "least": int(solution.satellites.min()),
        },
        "ratio_median": median(solution.ratio[fixed]),
        "age_s": {
            "median": float(np.median(solution.age_s)),
            "largest": float(np.abs(solution.age_s).max()),
        },
        "base_distance_m": {"least": float(distance_m.min()), "largest": float(distance_m.max())},
        "height_above_base_m": [float(height_difference_m.min()), float(height_difference_m.max())],
        "sigma_m": {
            "fixed_median": [median(s) for s in sigma[fixed].T],
            "largest": sigma.max(axis=0).tolist(),
        },
        "longest_gap_s": float(np.diff(fixes.time).max(initial=0.0)),
    }
    if separation is not None:
        numbers["separation"] = _separation_numbers(separation, gate)
    return numbers


def coverage_numbers(
    time: Array, solved: NDArray[np.bool_], fixed: NDArray[np.bool_]
) -> dict[str, Any]:
    """Return how many of the rover's epochs have a solution, as plain numbers.

    Parameters
    ----------
    time : ndarray, shape (n,)
        s, of the rover's epochs.
    solved, fixed : ndarray of bool, shape (n,)
        Which of them are in the solution, and which are fixed and confirmed.

    Returns
    -------
    dict
        Among others `unsolved_s`, first and last epoch of the longest period without a solution,
        None without any.
    """
    edges = np.flatnonzero(np.diff(np.concatenate([[False], ~solved, [False]])))
    start, end = edges[::2], edges[1::2] - 1
    unsolved_s = None
    if start.size:
        longest = int(np.argmax(time[end] - time[start]))
        unsolved_s = [float(time[start[longest]]), float(time[end[longest]])]
    return {
        "epochs_observed": time.size,
        "unsolved": int((~solved).sum()),
        "unsolved_share": float((~solved).mean()),
        "unsolved_periods": start.size,
        "unsolved_s": unsolved_s,
        "fix_rate_observed": float(fixed.mean()),
        "longest_without_fixed_s": longest_without(time, fixed),
    }


def _separation_numbers(separation: Separation, gate: float) -> dict[str, Any]:
    """Return counts and sizes (north, east, down, m) of the forward-backward separations."""
    finite = np.isfinite(separation.ned).all(axis=1)
    fixed_ned = separation.ned[separation.fixed]
    rms = np.sqrt(np.mean(fixed_ned**2, axis=0)).tolist() if fixed_ned.size else None
    largest = np.abs(fixed_ned).max(axis=0).tolist() if fixed_ned.size else None
    return {
        "epochs": int(finite.sum()),
        "both_fixed": int(separation.fixed.sum()),
        "contradicting": int(separation.beyond(gate).sum()),
        "fixed_rms_m": rms,
        "fixed_largest_m": largest,
    }


def longest_without(time: Array, good: NDArray[np.bool_]) -> float:
    """Return the longest time, s, within the epochs `time` (n,) without a `good` one."""
    marks = np.concatenate([time[:1], time[good], time[-1:]])
    return float(np.diff(marks).max(initial=0.0))


def _doubting_checks(before: Iterable[Finding]) -> list[Finding]:
    """Return the checks of inputs and steps that contradict the grade "good"."""
    return [
        check
        for check in before
        if check.verdict == "contradiction"
        or (check.verdict == "note" and check.name in BASE_CHECKS)
    ]


def grade(numbers: Mapping[str, Any], before: Iterable[Finding] = ()) -> str:
    """Return "good", "usable with care" or "poor", of the arguments of `verdict`."""
    rate = numbers["fix_rate_observed"]
    if rate < FAIR_RATE:
        return "poor"
    return "usable with care" if rate < GOOD_RATE or _doubting_checks(before) else "good"


def verdict(
    numbers: Mapping[str, Any], before: Collection[Finding] = ()
) -> tuple[str, tuple[Finding, ...]]:
    """Return one sentence for the whole, and a check for each of its causes.

    Parameters
    ----------
    numbers : mapping
        Of `solution_numbers` and `coverage_numbers`, and those of `signal_numbers` under "signals".
    before : iterable of Finding
        Checks of inputs and steps.
    """
    checks = [_check_rate(numbers), _check_unsolved(numbers), _check_degraded(numbers)]
    checks += [_check_satellites(numbers), _check_distance(numbers), _check_age(numbers)]
    if "separation" in numbers:
        checks.append(_check_separation(numbers["separation"], numbers["epochs"]))
    if "signals" in numbers:
        checks += _check_signals(numbers["signals"])
    percent = 100 * numbers["fix_rate_observed"]
    summary = f"{grade(numbers, before)}: {percent:.1f} % of {numbers['epochs_observed']} epochs"
    summary += " are fixed and confirmed"
    if degraded := numbers["classes"][FIX_CLASSES[DEGRADED]]:
        summary += f", {degraded} of them degraded"
    summary += f", {numbers['unsolved']} have no solution" if numbers["unsolved"] else ""
    sigma = numbers["sigma_m"]["fixed_median"]
    if sigma and None not in sigma:
        summary += f", standard deviations north, east, down {_in_mm(sigma)}"
    remaining = [
        check.name.removeprefix("GNSS ")
        for check in (*_doubting_checks(before), *checks)
        if check.verdict != "ok" and check.name != "GNSS fix rate"
    ]
    summary += f"; look at {', '.join(dict.fromkeys(remaining))}" if remaining else ""
    return summary, tuple(checks)


def _in_mm(metres: Iterable[float]) -> str:
    return f"{', '.join(f'{1e3 * x:.0f}' for x in metres)} mm"


def _check_rate(numbers: Mapping[str, Any]) -> Finding:
    isolated = (
        numbers["classes"][FIX_CLASSES[ISOLATED]] + numbers["classes"][FIX_CLASSES[UNSUPPORTED]]
    )
    finding = f"{100 * numbers['fix_rate_observed']:.2f} % fixed, {isolated} isolated epochs"
    finding += f", longest time without a fixed epoch {numbers['longest_without_fixed_s']:.1f} s"
    advice = (
        "check base coordinates, antenna, navigation files and the mask; float epochs have errors"
        " of decimetres, and the IMU must bridge them"
    )
    ask = Question("GNSS fix rate", f"{100 * GOOD_RATE:.0f} % at least")
    return ask.note(finding, advice, when=numbers["fix_rate_observed"] < GOOD_RATE)


def _check_unsolved(numbers: Mapping[str, Any]) -> Finding:
    expected = f"{100 * GOOD_RATE:.0f} % with one at least, and no {LONG_GAP_S:.0f} s without"
    ask = Question("GNSS epochs", expected)
    finding = f"{numbers['unsolved']} of {numbers['epochs_observed']} epochs have no solution"
    periods = numbers["unsolved_periods"]
    if numbers["unsolved_s"] is None:
        return ask.ok(finding)
    start, end = numbers["unsolved_s"]
    finding += (
        f", {'' if periods == 1 else f'in {periods} periods, the longest '}from {start:.1f} s"
        f" to {end:.1f} s"
    )
    too_long = numbers["unsolved_share"] > 1.0 - GOOD_RATE or end - start > LONG_GAP_S
    advice = (
        "too few satellites, or no epoch of the base within max_age_s: does the base's file cover"
        " the whole flight?"
    )
    return ask.note(finding, advice, when=too_long)


def _check_degraded(numbers: Mapping[str, Any]) -> Finding:
    degraded = numbers["classes"][FIX_CLASSES[DEGRADED]]
    finding = f"{degraded} fixed epochs, in minutes in which a good part of the epochs is not fixed"
    advice = (
        "obstructions and reflections there also shift fixed positions by centimetres: their"
        " standard deviations were enlarged to that size"
    )
    return Question("GNSS degraded fixes", "none").note(finding, advice, when=degraded > 0)


def _check_satellites(numbers: Mapping[str, Any]) -> Finding:
    count = numbers["satellites"]
    finding = f"{count['median']:.0f} in the median, {count['least']} at least"
    advice = (
        "few satellites make incorrect ambiguity fixes likely: use all systems that rover and base"
        " have in common, or a lower mask"
    )
    ask = Question("GNSS satellites", f"{FEW_SATELLITES} at least")
    return ask.note(finding, advice, when=count["least"] < FEW_SATELLITES)


def _check_distance(numbers: Mapping[str, Any]) -> Finding:
    distance = numbers["base_distance_m"]
    low, high = numbers["height_above_base_m"]
    finding = (
        f"{1e-3 * distance['least']:.2f} to {1e-3 * distance['largest']:.2f} km,"
        f" {low:.0f} to {high:.0f} m above the base"
    )
    advice = (
        "the atmosphere differs over such a distance: use a nearer or a virtual reference station"
    )
    ask = Question("GNSS base distance", f"below {1e-3 * LONG_BASELINE_M:.0f} km")
    return ask.note(finding, advice, when=distance["largest"] > LONG_BASELINE_M)


def _check_age(numbers: Mapping[str, Any]) -> Finding:
    finding = f"base observations at most {numbers['age_s']['largest']:.1f} s from the rover's"
    advice = "the base has gaps, or its rate is low: the atmosphere changes between its epochs"
    ask = Question("GNSS base age", f"below {OLD_S:.0f} s")
    return ask.note(finding, advice, when=numbers["age_s"]["largest"] > OLD_S)


def _check_separation(numbers: Mapping[str, Any], epochs: int) -> Finding:
    rms = numbers["fixed_rms_m"]
    finding = f"{numbers['contradicting']} of {numbers['epochs']} epochs contradict each other"
    if rms is not None:
        finding += f", rms where both are fixed {_in_mm(rms)} north, east, down"
    advice = (
        "one of the two runs had an incorrect ambiguity fix there: the standard deviations"
        " of these epochs cover the whole difference"
    )
    ask = Question("GNSS forward and backward", f"{100 * APART_SHARE:.1f} % at most")
    return ask.note(finding, advice, when=numbers["contradicting"] > APART_SHARE * epochs)


def _check_signals(numbers: Mapping[str, Any]) -> list[Finding]:
    """Return the checks of `signal_numbers`: slips, gaps, C/N0 and multipath where measured."""
    checks = [_check_slips(numbers), _check_gaps(numbers)]
    levels = {band: level for band, level in numbers["cn0_dbhz"].items() if level is not None}
    if levels:
        checks.append(_check_cn0(levels))
    if numbers["multipath_m"]:
        checks.append(_check_multipath(numbers["multipath_m"]))
    return checks


def _check_slips(numbers: Mapping[str, Any]) -> Finding:
    slips = numbers["cycle_slips"]
    rate = numbers["cycle_slips_per_satellite_hour"]
    finding = (
        f"{slips['flagged']} flagged by the receiver, {slips['unflagged']} seen in L1 - L2 alone"
    )
    finding += "" if rate is None else f", {rate:.1f} an hour and satellite"
    advice = (
        "vibration, shading by the airframe or interference: look at when and on which satellites"
        " they come"
    )
    ask = Question("GNSS cycle slips", f"{MANY_SLIPS:.0f} an hour and satellite at most")
    return ask.note(finding, advice, when=(rate or 0.0) > MANY_SLIPS)


def _check_gaps(numbers: Mapping[str, Any]) -> Finding:
    gaps = "1 gap" if numbers["gaps"] == 1 else f"{numbers['gaps']} gaps"
    finding = f"{gaps}, the longest {numbers['longest_gap_s']:.1f} s"
    finding += f", at an interval of {numbers['interval_s']:g} s"
    advice = (
        "observations are missing in the file: was the memory too slow, or was the receiver"
        " restarted?"
    )
    ask = Question("GNSS gaps", f"{LONG_GAP_S:.0f} s at most")
    return ask.note(finding, advice, when=numbers["longest_gap_s"] > LONG_GAP_S)


def _check_cn0(levels: Mapping[str, float]) -> Finding:
    """Compare the median C/N0, dB-Hz, of each band with its limit."""
    medians = ", ".join(f"{band} {level:.1f}" for band, level in levels.items())
    advice = (
        "antenna, its ground plane and cable, or a transmitter aboard (video link, USB 3, payload)"
    )
    limits = {"band 1": LOW_DBHZ}
    is_low = any(level < limits.get(band, LOW_SECOND_DBHZ) for band, level in levels.items())
    expected = f"{LOW_DBHZ:.0f} dB-Hz on band 1 and {LOW_SECOND_DBHZ:.0f} on others at least"
    ask = Question("GNSS C/N0", expected)
    return ask.note(f"{medians} dB-Hz in the median", advice, when=is_low)


def _check_multipath(rms_m: Mapping[str, float]) -> Finding:
    """Compare the rms multipath, m, of each code with its limit."""
    finding = ", ".join(f"{code} {rms:.2f}" for code, rms in rms_m.items()) + " m rms of code"
    ask = Question("GNSS multipath", f"below {MUCH_MULTIPATH_M:g} m")
    advice = "reflections near the antenna, or a low C/N0"
    return ask.note(finding, advice, when=max(rms_m.values()) > MUCH_MULTIPATH_M)
