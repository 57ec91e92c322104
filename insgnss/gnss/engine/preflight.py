"""Can this rover, this base and this navigation give a position? Asked before the engine runs for
minutes, and answered in one line.

The engine itself says nothing: with a base of another day, without a second frequency or
ephemerides it writes a file without epochs. Whether the base stands, and where its coordinates say,
is asked in `base_coordinates`.
"""

from dataclasses import replace
from datetime import UTC, datetime
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from ...base.errors import DataError, InputError
from ...base.wording import setting, spell
from ...geodesy.gpstime import GPS_EPOCH_UNIX_S, WEEK_S
from ...records import Array, Finding, Question
from ..options import EngineOptions
from ..rinex.header import RinexHeader
from ..rinex.navigation_message import TOE, Navigation
from ..rinex.observation_record import Observations
from ..satellites.frequencies import engine_phases

# satellites of an epoch from which it counts: 4, because fewer give no position
FEWEST_SATELLITES = 4
# share of the epochs with that many satellites: 0.5, because below it phases are not recorded
# rather than shadowed
FEWEST_SHARE = 0.5
# age of an ephemeris (s): 4 hours, twice the interval of GPS ephemerides, because they serve that
# long
EPHEMERIS_AGE_S = 4 * 3600.0
DAY_S = 86400.0  # s, of a day of GPS time
# the second frequency by system, in the words of a refusal
SECOND = "L2, of Galileo E5b, of BeiDou B2"


def check_observations(
    rover: Observations, base: Observations, options: EngineOptions
) -> tuple[Finding, ...]:
    """Check frequencies and common time of rover and base.

    Returns
    -------
    tuple of Finding
        Notes for epochs that stay without base.

    Raises
    ------
    InputError, DataError
        For observations by which no ambiguity can be resolved.
    """
    if rover.header.path == base.header.path:
        raise InputError.in_file(
            rover.header.path, "is given as rover and as base; give the base's own file"
        )
    for observations in (rover, base):
        _check_frequencies(observations, options)
    return (*_check_third(rover, base, options), *_check_base_times(rover, base, options.max_age_s))


def within_navigation(observations: Observations, navigation: Navigation) -> Observations:
    """Return the observations on the days of the navigation, with a note on others.

    The first epochs of a receiver that does not know the date yet are of 1980 or another year. No
    epoch is left out where none would stay, which `check_navigation` refuses.
    """
    toe = navigation.gps_week * WEEK_S + navigation.table[:, TOE]
    time = absolute(observations)
    start = DAY_S * (toe.min() // DAY_S)
    end = DAY_S * (toe.max() // DAY_S + 1.0)
    inside = (time > start - EPHEMERIS_AGE_S) & (time < end + EPHEMERIS_AGE_S)
    if inside.all() or not inside.any():
        return observations
    outside_s = time[~inside]
    finding = (
        f"{outside_s.size} of {time.size} epochs of {observations.header.path} left out, of"
        f" {_date(outside_s[0])} to {_date(outside_s[-1])}: the navigation file has no data of"
        " these days"
    )
    advice = (
        "the receiver did not know the date yet; if the dates are right, add the navigation files"
        " of these days"
    )
    check = Finding("epochs", finding, "days of the navigation", "note", advice)
    kept = observations.only(np.flatnonzero(inside))
    return replace(kept, notes=(*kept.notes, check))


def _check_base_times(
    rover: Observations, base: Observations, max_age_s: float
) -> tuple[Finding, ...]:
    """A note where epochs of the rover are without one of the base, InputError where all are."""
    time, reference = absolute(rover), absolute(base)
    pace = interval(base)
    has_base = _has_epoch_within(time, reference, max_age_s)
    has_base_at_pace = _has_epoch_within(time, reference, max(max_age_s, pace))
    rare = f"raise max_age_s (--max-age) to {pace:g} s at least"
    rare += f": the base has epochs every {pace:g} s"
    if not has_base_at_pace.any():
        message = (
            f"has epochs {_span(base)}, but the rover {rover.header.path} {_span(rover)}: no common"
            " time; is this the base file of another day?"
        )
        raise InputError.in_file(base.header.path, message)
    if not has_base.any():
        message = (
            f"has no epoch within max_age_s = {max_age_s:g} s of any epoch of the rover"
            f" {rover.header.path}; {rare}"
        )
        raise InputError.in_file(base.header.path, message)
    if has_base.all():
        return ()
    finding = f"{has_base.mean():.1%} of {has_base.size} epochs; the base's file is {_span(base)}"
    inside = (time >= reference[0]) & (time <= reference[-1])
    reasons = {
        rare: inside & has_base_at_pace,
        "the base has gaps: give another, or raise max_age_s (--max-age)": inside
        & ~has_base_at_pace,
        "give base files that cover the whole flight": ~inside,
    }
    advice = "; ".join(reason for reason, those in reasons.items() if (those & ~has_base).any())
    return (Question("epochs with a base", f"all within {max_age_s:g} s").note(finding, advice),)


def absolute(observations: Observations) -> Array:
    """Return the stamps (n,) in s since the beginning of GPS time."""
    return observations.gps_week * WEEK_S + observations.time


def interval(observations: Observations) -> float:
    """Return the median interval between epochs, s; 1 where there are fewer than two."""
    return float(np.median(np.diff(observations.time))) if observations.time.size > 1 else 1.0


def _has_epoch_within(time: Array, base: Array, age: float) -> NDArray[np.bool_]:
    """Return which of `time` (n,) have an epoch of `base` (m,) within `age`, all in s."""
    following = np.searchsorted(base, time)
    age_of_previous = np.abs(time - base[np.maximum(following - 1, 0)])
    return np.asarray(
        np.minimum(age_of_previous, np.abs(base[np.minimum(following, base.size - 1)] - time))
        <= age
    )


def _span(observations: Observations) -> str:
    first, last = (_date(float(t)) for t in absolute(observations)[[0, -1]])
    return f"of {first} to {last[11:] if last[:10] == first[:10] else last} GPST"


def _date(seconds: float) -> str:
    return datetime.fromtimestamp(GPS_EPOCH_UNIX_S + seconds, UTC).strftime("%Y-%m-%d %H:%M:%S")


def _check_frequencies(observations: Observations, options: EngineOptions) -> None:
    """Refuse observations whose epochs mostly lack phases of the requested frequencies."""
    path = observations.header.path
    n = observations.time.size
    if n == 0:
        raise InputError.in_file(path, "has no epochs; is the file truncated?")
    rows = satellites_with_phases(observations, options)
    count = np.bincount(observations.epoch[rows], minlength=n)
    share = float(np.mean(count >= FEWEST_SATELLITES))
    if share >= FEWEST_SHARE:
        return
    finding = (
        f"{share:.0%} of its epochs have {FEWEST_SATELLITES} satellites with phases of"
        f" {options.frequencies} frequencies"
    )
    if options.frequencies == 1:
        raise DataError(
            f"{path}: only {finding} (systems {options.systems}; limit {FEWEST_SHARE:.0%}); does"
            " the receiver log carrier phases?"
        )
    advice = (
        "log both frequencies, or set frequencies = 3 for L1 with L5, or 1 for L1 alone, whose"
        " ambiguities are seldom fixed in flight"
    )
    raise DataError(
        f"{path}: only {finding} (systems {options.systems}; limit {FEWEST_SHARE:.0%}; second:"
        f" {SECOND}); single-frequency receiver? {advice}"
    )


def _check_third(
    rover: Observations, base: Observations, options: EngineOptions
) -> tuple[Finding, ...]:
    """A note where a third frequency is asked for, and no system has it in both files."""
    if options.frequencies < 3:
        return ()
    have = [_with_third(observations, options) for observations in (rover, base)]
    if have[0] & have[1]:
        return ()
    lacking = [o.header.path for o, systems in zip((rover, base), have, strict=True) if not systems]
    finding = "no system has its third frequency in both files"
    if lacking:
        finding = f"no phases of a third frequency in {' and '.join(lacking)}"
    advice = f"{setting('gnss.frequencies', 2)} is what can be solved with these files"
    return (Question("frequencies", "systems with three in both").note(finding, advice),)


def _with_third(observations: Observations, options: EngineOptions) -> set[str]:
    """Systems with phases of the engine's third frequency."""
    third = engine_phases(observations, options.frequencies)[:, 2]
    return set(observations.satellite[third].astype("U1")) & set(options.systems)


def satellites_with_phases(observations: Observations, options: EngineOptions) -> NDArray[np.bool_]:
    """Return rows (m,) with phases of the engine's first and, if requested, a further frequency."""
    has = engine_phases(observations, options.frequencies)
    requested = np.isin(observations.satellite.astype("U1"), list(options.systems))
    return np.asarray(
        requested & has[:, 0] & (has[:, 1:].any(axis=1) if options.frequencies > 1 else True)
    )


def check_navigation(
    navigation: Navigation, rover: Observations, options: EngineOptions
) -> tuple[Finding, ...]:
    """Check systems and days of the ephemerides.

    Returns
    -------
    tuple of Finding
        A note for systems other than GPS without ephemerides, and one on mended fields.

    Raises
    ------
    InputError
        Where no ephemeris serves the rover, or none is of GPS.
    """
    toe = navigation.gps_week * WEEK_S + navigation.table[:, TOE]
    first, last = absolute(rover)[[0, -1]]
    current = (toe > first - EPHEMERIS_AGE_S) & (toe < last + EPHEMERIS_AGE_S)
    if not current.any():
        message = (
            f"ephemerides of {_date(toe.min())} to {_date(toe.max())}, but the rover"
            f" {rover.header.path} is {_span(rover)}"
        )
        raise InputError(f"{navigation.source}: {message}; give the navigation of that day")
    have = set(navigation.satellite[current].astype("U1"))
    observed = set(rover.satellite.astype("U1")) & set(options.systems)
    if not observed & have:
        message = (
            f"ephemerides of {' '.join(sorted(have))}, but the rover {rover.header.path} observes"
            f" {' '.join(sorted(observed))}"
        )
        raise InputError(f"{navigation.source}: {message}; give the navigation of these systems")
    missing = sorted(observed - have)
    mended = ", ".join(f"{count} {kind}" for kind, count in navigation.mended)
    advice = (
        "the file was read nevertheless; fetch it from another source if a satellite system is"
        " missing"
    )
    note = Finding("navigation fields", mended, "fields as RINEX has them", "note", advice)
    checks = (note,) if mended else ()
    if not missing:
        return checks
    toe_of = {letter: toe[navigation.satellite.astype("U1") == letter] for letter in missing}
    navigation_systems = "; ".join(
        f"those of {letter} are of {_date(times.min())} to {_date(times.max())}"
        for letter, times in toe_of.items()
        if times.size
    )
    if "G" in missing:
        message = (
            f"no ephemerides of GPS for {_span(rover)[3:]}, which the rover {rover.header.path}"
            " observes"
        )
        remedy = "add its navigation file"
        if toe_of["G"].size:
            remedy = f"{navigation_systems}; give the navigation of that day"
        raise InputError(
            f"{navigation.source}: {message}; {remedy}, or leave G out of {spell('gnss.systems')}"
        )
    finding = f"none of {' '.join(missing)} for {_span(rover)[3:]}: these systems are left out"
    advice = "add their navigation file"
    if navigation_systems:
        finding += f"; {navigation_systems}"
        advice = "give the navigation of that day"
    ask = Question("navigation", "ephemerides of every system observed")
    return (*checks, ask.note(finding, advice))


def check_rover_antenna(options: EngineOptions, rover: RinexHeader) -> tuple[Finding, ...]:
    """Return what is said of the rover's antenna where an ANTEX file is given: that it is not used.

    Parameters
    ----------
    options : EngineOptions
        With the ANTEX file, or without.
    rover : RinexHeader
        Header of the rover.
    """
    if options.antex is None:
        return ()
    antenna = " ".join(rover.antenna.split())
    expected = "a lever arm that ends at the phase centre, not at the reference point below it"
    finding = (
        f"{antenna or 'not named'}: {Path(options.antex).name} is used for the base alone;"
        " positions are of the rover's phase centre"
    )
    return (Question("rover antenna", expected).ok(finding),)
