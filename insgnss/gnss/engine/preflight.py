"""Can this rover, this base and this navigation give a position? Asked before the engine runs for
minutes, and answered in one line.

The engine itself says nothing: with a base of another day, without a second frequency or
ephemerides it writes a file without epochs, and with rover and base swapped one full of them.
Swapped files show in that the base moves, by its phases (5 mm/s of a receiver that stands, also
from epochs every 30 s) or by its codes; in that it stands elsewhere than its coordinates say, where
the rover stands; or in that the coordinates are, to a decimetre, those of the rover's header. Codes
place a receiver to some metres: of two that both stand within `NEAR_M` of each other neither codes
nor phases show which is which, nor whether the coordinates are metres off.

Every position has the error of the base's coordinates, and nothing else shows it. The median of the
codes at some 60 epochs, with the broadcast ionosphere, lies 0.5 to 3.7 m from the known coordinates
in seven recordings of 2005 to 2024 and a simulated one. From `NEAR_M` on there is a note, and from
`ELSEWHERE_M` on, more than the ionosphere leaves in them, a refusal: so is a height above sea level
in the place of one above the ellipsoid where the two are further apart than that, as in most of
Europe (40 to 55 m).
"""

from collections.abc import Callable
from dataclasses import dataclass, replace
from datetime import UTC, datetime
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from ...base.errors import DataError, InputError
from ...base.units import FOOT_M
from ...base.wording import named, setting
from ...geodesy.frames import ecef_to_geodetic, geodetic_to_ecef
from ...geodesy.gpstime import GPS_EPOCH_UNIX_S, WEEK_S
from ...records import Array, Finding, GnssFixes, Question
from ..options import EngineOptions, base_position
from ..phase.time_differences import VelocityOptions
from ..phase.velocity import time_differenced_velocity
from ..rinex.header import RinexHeader
from ..rinex.navigation_message import TOE, Navigation
from ..rinex.observations import Observations
from ..satellites.frequencies import engine_phases

FEWEST_SATELLITES = 4
FEWEST_SHARE = 0.5
EPHEMERIS_AGE_S = 4 * 3600.0
DAY_S = 86400.0  # s, of a day of GPS time
ELSEWHERE_M, NEAR_M = 20.0, 5.0
MOVES_M = 15.0
MOVES_MPS, MOVES_SHARE = 0.2, 0.05
SIGMAS = 3.0
SAME_COORDINATES_M, OTHER_COORDINATES_M = 0.1, 1.0
ROUGHLY_M = 500.0  # of an epoch between those with a position; its phases then show 0.08 m/s
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
        raise InputError.at_line(
            rover.header.path, None, "is given as rover and as base; give the base's own file"
        )
    for observations in (rover, base):
        _check_frequencies(observations, options)
    return (*_check_third(rover, base, options), *_check_base_times(rover, base, options.max_age_s))


def within_navigation(observations: Observations, navigation: Navigation) -> Observations:
    """Return the observations on the days of the navigation, with a note on others.

    The first epochs of a receiver that does not know the date yet are of 1980 or another year. No
    epoch is left out where none would stay, which `check_navigation` refuses.
    """
    toe, time = navigation.gps_week * WEEK_S + navigation.table[:, TOE], absolute(observations)
    first, last = DAY_S * (toe.min() // DAY_S), DAY_S * (toe.max() // DAY_S + 1.0)
    inside = (time > first - EPHEMERIS_AGE_S) & (time < last + EPHEMERIS_AGE_S)
    if inside.all() or not inside.any():
        return observations
    away = time[~inside]
    finding = (
        f"{away.size} of {time.size} of {observations.header.path} left out, of {_date(away[0])} to"
        f" {_date(away[-1])}, days without navigation"
    )
    advice = "the receiver did not know the date; if it did, add the navigation of these days"
    check = Finding("epochs", finding, "days of the navigation", "note", advice)
    inner = observations.only(inside)
    return replace(inner, notes=(*inner.notes, check))


def _check_base_times(
    rover: Observations, base: Observations, max_age_s: float
) -> tuple[Finding, ...]:
    """A note where epochs of the rover are without one of the base, InputError where all are."""
    time, reference, pace = absolute(rover), absolute(base), interval(base)
    near, within_pace = (
        _near(time, reference, max_age_s),
        _near(time, reference, max(max_age_s, pace)),
    )
    rare = (
        f"raise max_age_s (--max-age) to {pace:g} s at least: the base has epochs every {pace:g} s"
    )
    if not within_pace.any():
        message = (
            f"{_span(base)}, but the rover {rover.header.path} {_span(rover)}: no common time; is"
            " it the base of another day?"
        )
        raise InputError.at_line(base.header.path, None, message)
    if not near.any():
        message = (
            f"no epoch within max_age_s = {max_age_s:g} s of any of the rover {rover.header.path};"
            f" {rare}"
        )
        raise InputError.at_line(base.header.path, None, message)
    if near.all():
        return ()
    finding = f"{near.mean():.1%} of {near.size} epochs; the base's file is {_span(base)}"
    inside = (time >= reference[0]) & (time <= reference[-1])
    reasons = {
        rare: inside & within_pace,
        "the base has gaps: give another, or raise max_age_s (--max-age)": inside & ~within_pace,
        "give a base of the whole flight": ~inside,
    }
    advice = "; ".join(reason for reason, those in reasons.items() if (those & ~near).any())
    return (Question("epochs with a base", f"all within {max_age_s:g} s").note(finding, advice),)


def absolute(observations: Observations) -> Array:
    """Return the stamps (n,) in s since the beginning of GPS time."""
    return observations.gps_week * WEEK_S + observations.time


def interval(observations: Observations) -> float:
    """Return the median interval between epochs, s; 1 where there are fewer than two."""
    return float(np.median(np.diff(observations.time))) if observations.time.size > 1 else 1.0


def _near(time: Array, base: Array, age: float) -> NDArray[np.bool_]:
    """Which of `time` have a base epoch within `age` s."""
    after = np.searchsorted(base, time)
    behind = np.abs(time - base[np.maximum(after - 1, 0)])
    return np.asarray(
        np.minimum(behind, np.abs(base[np.minimum(after, base.size - 1)] - time)) <= age
    )


def _span(observations: Observations) -> str:
    first, last = (_date(float(t)) for t in absolute(observations)[[0, -1]])
    return f"of {first} to {last[11:] if last[:10] == first[:10] else last} GPST"


def _date(seconds: float) -> str:
    return datetime.fromtimestamp(GPS_EPOCH_UNIX_S + seconds, UTC).strftime("%Y-%m-%d %H:%M:%S")


def _check_frequencies(observations: Observations, options: EngineOptions) -> None:
    path, n = observations.header.path, observations.time.size
    if n == 0:
        raise InputError.at_line(path, None, "has no epochs; is the file truncated?")
    rows = satellites_with_phases(observations, options)
    count = np.bincount(observations.epoch[rows], minlength=n)
    share = float(np.mean(count >= FEWEST_SATELLITES))
    if share >= FEWEST_SHARE:
        return
    most = (
        f"{share:.0%} of its epochs have {FEWEST_SATELLITES} satellites with phases of"
        f" {options.frequencies} frequencies"
    )
    if options.frequencies == 1:
        raise DataError(
            f"{path}: only {most} (systems {options.systems}; limit {FEWEST_SHARE:.0%}); are phases"
            " logged?"
        )
    advice = (
        "log both, or set frequencies = 3 for L1 with L5, 1 for L1 alone, which seldom fixes in"
        " flight"
    )
    raise DataError(
        f"{path}: only {most} (systems {options.systems}; limit {FEWEST_SHARE:.0%}; second:"
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
    finding = (
        f"no phases of a third one in {' and '.join(lacking)}"
        if lacking
        else "none whose third one is in both files"
    )
    advice = f"{setting('gnss.frequencies', 2)} says what is solved"
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
    seen = set(rover.satellite.astype("U1")) & set(options.systems)
    if not seen & have:
        message = (
            f"ephemerides of {' '.join(sorted(have))}, but the rover {rover.header.path} observes"
            f" {' '.join(sorted(seen))}"
        )
        raise InputError(f"{navigation.source}: {message}; give the navigation of these systems")
    missing = sorted(seen - have)
    mended = ", ".join(f"{count} {kind}" for kind, count in navigation.mended)
    advice = "read all the same; fetch the file from another source if a system stays out"
    note = Finding("navigation fields", mended, "fields as RINEX has them", "note", advice)
    checks = (note,) if mended else ()
    if not missing:
        return checks
    other = {letter: toe[navigation.satellite.astype("U1") == letter] for letter in missing}
    given = "; ".join(
        f"those of {letter} are of {_date(of.min())} to {_date(of.max())}"
        for letter, of in other.items()
        if of.size
    )
    if "G" in missing:
        message = (
            f"no ephemerides of GPS for {_span(rover)[3:]}, which the rover {rover.header.path}"
            " observes"
        )
        advice = (
            f"{given}; give the navigation of that day"
            if other["G"].size
            else "add its navigation file"
        )
        raise InputError(
            f"{navigation.source}: {message}; {advice}, or leave G out of {named('gnss.systems')}"
        )
    finding = f"none of {' '.join(missing)} for {_span(rover)[3:]}, which are left out" + (
        f"; {given}" if given else ""
    )
    advice = "give the navigation of that day" if given else "add their navigation file"
    ask = Question("navigation", "ephemerides of every system observed")
    return (*checks, ask.note(finding, advice))


@dataclass(frozen=True, eq=False)
class Whereabouts:
    """Where a receiver is, and whether it moves.

    Parameters
    ----------
    points : ndarray, shape (n, 3)
        m ECEF, by codes alone.
    speed, sd : ndarray, shape (m,)
        m/s, by phases between epochs (TDCP), and its standard deviation; both empty where no phases
        are fit for it.
    """

    points: Array
    speed: Array
    sd: Array

    @classmethod
    def of(
        cls, fixes: GnssFixes, observations: Observations, navigation: Navigation
    ) -> "Whereabouts":
        """Build it from positions by codes at some epochs, and the phases."""
        points = geodetic_to_ecef(fixes.lat, fixes.lon, fixes.height)
        limits = VelocityOptions(
            longest_s=max(2.0, 1.5 * interval(observations)), position_sd=ROUGHLY_M
        )
        try:
            velocity = time_differenced_velocity(observations, navigation, fixes, limits)
        except DataError:  # no phases, or of too few satellites: codes alone
            return cls(points, np.empty(0), np.empty(0))
        speed = np.linalg.norm(velocity.velocity_ned, axis=1)
        return cls(points, speed, np.sqrt(np.trace(velocity.cov_ned, axis1=1, axis2=2)))

    @property
    def middle(self) -> Array:
        """Return the median of the points (3,), m ECEF."""
        return np.asarray(np.median(self.points, axis=0))

    def motion(self) -> str:
        """Return how the receiver moves, in words; empty where it stands."""
        moving = self.speed > MOVES_MPS + SIGMAS * self.sd
        if moving.size and moving.mean() > MOVES_SHARE:
            fast = np.quantile(self.speed[moving], 0.9)
            return (
                f"at {fast:.1f} m/s, and in {moving.mean():.0%} of its time (limit"
                f" {MOVES_SHARE:.0%}) above {MOVES_MPS:g} m/s, by phase"
            )
        spread = float(np.quantile(np.linalg.norm(self.points - self.middle, axis=1), 0.9))
        return (
            f"{spread:.0f} m about its median, by codes (limit {MOVES_M:.0f} m)"
            if spread > MOVES_M
            else ""
        )


def check_base_place(
    rover: Observations,
    base: Observations,
    options: EngineOptions,
    whereabouts: Callable[[Observations], Whereabouts],
) -> tuple[Finding, ...]:
    """Check whether the base stands, and where its coordinates say.

    Parameters
    ----------
    rover, base : Observations
        Observations of the two receivers.
    options : EngineOptions
        Hold the coordinates of the base.
    whereabouts : callable
        Finds where a receiver is; the rover's are computed only where the base looks wrong.

    Returns
    -------
    tuple of Finding
        A note where the base stands more than `NEAR_M` off its coordinates.

    Raises
    ------
    InputError
        Where the base moves, stands more than `ELSEWHERE_M` off its coordinates, or the rover is
        where they say.
    """
    location = whereabouts(base)
    given = np.array(base_position(options, base.header)[0])
    off = float(np.linalg.norm(location.middle - given))
    if motion := location.motion():
        raise InputError.at_line(
            base.header.path, None, f"the base moves: {motion}; {_of_moving(rover, whereabouts)}"
        )
    if options.base_position_m is not None:
        if _is_header_of_rover(given, base.header, rover.header):
            message = (
                f"the base coordinates are those of the header of the rover {rover.header.path},"
                " not of its own; are the two swapped?"
            )
            raise InputError.at_line(base.header.path, None, message)
        if off > NEAR_M and _stands_at(given, off, rover, whereabouts):
            message = (
                f"stands {off:.0f} m from the base coordinates, and the rover {rover.header.path}"
                " stands there: they are swapped"
            )
            raise InputError.at_line(base.header.path, None, message)
    if off > ELSEWHERE_M:
        whose = (
            "the base coordinates"
            if options.base_position_m is not None
            else "APPROX POSITION XYZ of its header"
        )
        message = (
            f"stands {off:.0f} m from {whose} (limit {ELSEWHERE_M:.0f} m), by codes at"
            f" {in_degrees(location.middle)}"
        )
        raise InputError.at_line(
            base.header.path, None, f"{message}; {_mistaken(given, location.middle, options)}"
        )
    return _coordinate_notes(options, base.header, off)


def in_degrees(ecef: Array) -> str:
    """Return a position (3,), m ECEF, as text for base_position, to the decimetre.

    It is latitude deg, longitude deg, ellipsoidal height m.
    """
    lat, lon, height = (float(x) for x in ecef_to_geodetic(ecef))
    return f"{np.degrees(lat):.6f},{np.degrees(lon):.6f},{height:.1f}"


def _mistaken(given: Array, code_position: Array, options: EngineOptions) -> str:
    """The mistake that makes coordinates (3,) of the position by codes (3,), else what to try."""
    lat, lon, height = (float(x) for x in ecef_to_geodetic(given))
    if options.base_position_m is None:
        return f"give {_coordinates()}"
    mistakes = {
        "latitude and longitude exchanged": (lon, lat, height),
        "latitude and longitude in radians": (
            float(np.degrees(lat)),
            float(np.degrees(lon)),
            height,
        ),
        "the height in feet": (lat, lon, FOOT_M * height),
    }
    for mistake, taken in mistakes.items():
        if (
            abs(taken[0]) <= np.pi / 2.0
            and np.linalg.norm(geodetic_to_ecef(*taken) - code_position) < NEAR_M
        ):
            return f"with {mistake} they agree"
    above = float(ecef_to_geodetic(code_position)[2]) - height
    if np.linalg.norm(geodetic_to_ecef(lat, lon, height + above) - code_position) < NEAR_M:
        side = "above" if above > 0.0 else "below"
        return (
            f"only the height differs, the codes are {abs(above):.0f} m {side} it: is it above sea"
            " level? it must be above the ellipsoid"
        )
    return "check them, or are rover and base swapped?"


def _coordinates() -> str:
    return f"{named('gnss.base_position')} and {named('gnss.base_point')}"


def _of_moving(rover: Observations, whereabouts: Callable[[Observations], Whereabouts]) -> str:
    """What to try where the base moves."""
    try:
        moves = bool(whereabouts(rover).motion())
    except DataError:
        return "are rover and base swapped?"
    if moves:
        return (
            f"so does the rover {rover.header.path}; a base must stand: cut the file to the time in"
            " which it does"
        )
    return f"the rover {rover.header.path} stands: are rover and base swapped?"


def _stands_at(
    given: Array,
    off: float,
    rover: Observations,
    whereabouts: Callable[[Observations], Whereabouts],
) -> bool:
    """Whether the rover stands where the base is said to, several times closer than the base."""
    try:
        location = whereabouts(rover)
    except DataError:
        return False
    return not location.motion() and float(np.linalg.norm(location.middle - given)) < off / 3.0


def _is_header_of_rover(given: Array, base: RinexHeader, rover: RinexHeader) -> bool:
    """Whether the base's coordinates are those of the rover's header, and not near those of its
    own.
    """
    if (
        rover.approx_position_m is None
        or np.linalg.norm(rover.approx_position_m - given) > SAME_COORDINATES_M
    ):
        return False
    return base.approx_position_m is None or bool(
        np.linalg.norm(base.approx_position_m - given) > OTHER_COORDINATES_M
    )


def check_base_point(options: EngineOptions, base: RinexHeader, chosen: bool = True) -> Finding:
    """Report the base's coordinates that are taken, and the point that they are of.

    It is a note where they are given and nobody has `chosen` what stands there.
    """
    position, point = base_position(options, base)
    name = {
        "apc": "the antenna's phase centre (apc)",
        "arp": "the antenna's reference point (arp)",
        "marker": "the marker (marker)",
    }[point]
    lat, lon, height = (float(x) for x in ecef_to_geodetic(np.array(position)))
    finding = f"{np.degrees(lat):.9f},{np.degrees(lon):.9f},{height:.4f}, taken as {name}"
    ask = Question("base point", "what stands at the coordinates is said")
    if chosen or options.base_position_m is None:
        return ask.ok(finding)
    advice = (
        f"give {named('gnss.base_point')}: published coordinates are mostly of a marker or of the"
        " reference point, and as such 0.05 to 0.2 m below the phase centre"
    )
    return ask.note(f"{finding}, as nothing says", advice)


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


def _coordinate_notes(options: EngineOptions, base: RinexHeader, off: float) -> tuple[Finding, ...]:
    """Notes on coordinates of the header or far from the codes, and on a phase centre that is not
    applied.
    """
    checks = []
    _, point = base_position(options, base)
    if options.base_position_m is None:
        finding = (
            f"APPROX POSITION XYZ of {base.path}, {off:.1f} m from its position by codes; taken as"
            f" {point}"
        )
        advice = f"give {_coordinates()}; every position has the error of these coordinates"
        ask = Question("base coordinates", "coordinates that are known")
        checks.append(ask.note(finding, advice))
    elif off > NEAR_M:
        finding = f"{off:.1f} m from the position of {base.path} by codes"
        advice = "check them, their datum and height (ellipsoidal); every position has their error"
        checks.append(Question("base coordinates", f"within {NEAR_M:.0f} m").note(finding, advice))
    if (
        point != "apc"
        and options.antex is None
        and base.antenna.split()[:1] not in ([], ["NONE"], ["Unknown"])
    ):
        finding = f"of the {point}, with no ANTEX file for the antenna {base.antenna}"
        advice = (
            f"give {named('gnss.antex')}, or the coordinates of the phase centre; heights are off"
            " by its offset, 0.05 to 0.2 m"
        )
        checks.append(Question("base antenna", "the phase centre").note(finding, advice))
    return tuple(checks)
