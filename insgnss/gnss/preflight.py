"""Can this rover, this base and this navigation give a position? Asked before the engine runs for minutes, and answered in one line.

The engine itself says nothing: with a base of another day, without a second frequency or ephemerides it writes a file without epochs, and
with rover and base swapped one full of them. Swapped files show in that the base moves, or stands elsewhere than its coordinates say;
two receivers that both stand, within metres of each other, cannot be told apart.
"""

from collections.abc import Sequence
from datetime import UTC, datetime

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ..errors import DataError, InputError
from ..geodesy.gpstime import GPS_EPOCH_UNIX_S, WEEK_S
from ..records import Array, Check
from .navigation_message import TOE, Navigation
from .options import EngineOptions, base_position
from .rinex import Observations
from .rinex_header import RinexHeader

FEWEST_SATELLITES = 4
FEWEST_SHARE = 0.5
EPHEMERIS_AGE_S = 4 * 3600.0
FAR_M = 50.0
MOVES_M = 15.0
# bands whose phases RTKLIB takes as its first, second and third frequency
BANDS = {"G": ("1", "2", "5"), "R": ("14", "26", "3"), "E": ("1", "7", "5"), "J": ("1", "2", "5"), "C": ("12", "7", "5")}
SECOND = "L2, of Galileo E5b, of BeiDou B2"


def check_observations(rover: Observations, base: Observations, options: EngineOptions) -> tuple[Check, ...]:
    """Frequencies and common time; InputError or DataError for what cannot give an ambiguity, notes for what stays without base."""
    if rover.header.path == base.header.path:
        raise InputError.at(rover.header.path, None, "is given as rover and as base; give the base's own file")
    for observations in (rover, base):
        _check_frequencies(observations, options)
    near = _near(absolute(rover), absolute(base), options.max_age_s)
    if not near.any():
        what = f"{_span(base)}, but the rover {rover.header.path} {_span(rover)}: no common time; is it the base of another day?"
        raise InputError.at(base.header.path, None, what)
    if near.all():
        return ()
    found = f"{near.mean():.1%} of {near.size} epochs; the base's file is {_span(base)}"
    return (Check("epochs with a base", found, f"all within {options.max_age_s:g} s", "note", "give a base of the whole flight"),)


def absolute(observations: Observations) -> Array:
    """Stamps (n,) s since the beginning of GPS time."""
    return observations.gps_week * WEEK_S + observations.time


def _near(time: Array, base: Array, age: float) -> NDArray[np.bool_]:
    """Which of `time` have a base epoch within `age` s."""
    after = np.searchsorted(base, time)
    behind = np.abs(time - base[np.maximum(after - 1, 0)])
    return np.asarray(np.minimum(behind, np.abs(base[np.minimum(after, base.size - 1)] - time)) <= age)


def _span(observations: Observations) -> str:
    first, last = (_date(float(t)) for t in absolute(observations)[[0, -1]])
    return f"of {first} to {last[11:] if last[:10] == first[:10] else last} GPST"


def _date(seconds: float) -> str:
    return datetime.fromtimestamp(GPS_EPOCH_UNIX_S + seconds, UTC).strftime("%Y-%m-%d %H:%M:%S")


def _check_frequencies(observations: Observations, options: EngineOptions) -> None:
    path, n = observations.header.path, observations.time.size
    if n == 0:
        raise InputError.at(path, None, "has no epochs; is the file truncated?")
    rows = satellites_with_phases(observations, options)
    count = np.bincount(observations.epoch[rows], minlength=n)
    share = float(np.mean(count >= FEWEST_SATELLITES))
    if share >= FEWEST_SHARE:
        return
    most = f"{share:.0%} of its epochs have {FEWEST_SATELLITES} satellites with phases of {options.frequencies} frequencies"
    if options.frequencies == 1:
        raise DataError(f"{path}: only {most} (limit {FEWEST_SHARE:.0%}); are phases logged?")
    advice = "log both, or set frequencies = 3 for L1 with L5, 1 for L1 alone, which seldom fixes in flight"
    raise DataError(f"{path}: only {most} (limit {FEWEST_SHARE:.0%}; the second is {SECOND}); single-frequency receiver? {advice}")


def satellites_with_phases(observations: Observations, options: EngineOptions) -> NDArray[np.bool_]:
    """Rows (m,) with phases of the first and, where asked for, a further frequency of the engine."""
    system = observations.satellite.astype("U1")
    phase = np.isfinite(observations.values) & (observations.values != 0.0)
    good = np.zeros(system.size, dtype=np.bool_)
    for letter in options.systems:
        has = [phase[:, _columns(observations.signals, bands)].any(axis=1) for bands in BANDS[letter]]
        further = np.logical_or.reduce(has[1 : options.frequencies]) if options.frequencies > 1 else has[0]
        good |= (system == letter) & has[0] & further
    return good


def _columns(signals: Sequence[str], bands: str) -> list[int]:
    """Places of the phases of these bands."""
    return [k for k, signal in enumerate(signals) if signal[0] == "L" and signal[1] in bands]


def check_navigation(navigation: Navigation, rover: Observations, options: EngineOptions) -> tuple[Check, ...]:
    """Systems and days of the ephemerides; InputError where none serves the rover or GPS has none, a note for other systems without."""
    toe = navigation.gps_week * WEEK_S + navigation.table[:, TOE]
    first, last = absolute(rover)[[0, -1]]
    current = (toe > first - EPHEMERIS_AGE_S) & (toe < last + EPHEMERIS_AGE_S)
    if not current.any():
        what = f"ephemerides of {_date(toe.min())} to {_date(toe.max())}, but the rover {rover.header.path} is {_span(rover)}"
        raise InputError(f"{navigation.source}: {what}; give the navigation of that day")
    have = set(navigation.satellite[current].astype("U1"))
    seen = set(rover.satellite.astype("U1")) & set(options.systems)
    if not seen & have:
        what = f"ephemerides of {' '.join(sorted(have))}, but the rover {rover.header.path} observes {' '.join(sorted(seen))}"
        raise InputError(f"{navigation.source}: {what}; give the navigation of these systems")
    missing = sorted(seen - have)
    if "G" in missing:
        what = f"no ephemerides of GPS, which the rover {rover.header.path} observes"
        raise InputError(f"{navigation.source}: {what}; add its navigation file, or leave G out of systems")
    if not missing:
        return ()
    found = f"none of {' '.join(missing)}, which are left out"
    return (Check("navigation", found, "ephemerides of every system observed", "note", "add their navigation file"),)


def check_base_place(points: ArrayLike, options: EngineOptions, base: RinexHeader, rover: RinexHeader) -> tuple[Check, ...]:
    """Whether the base stands, and where it is said to stand.

    points : (n, 3) m ECEF, of the base by codes alone.   InputError where it moves by more than 15 m or stands more than 50 m off.
    """
    place = np.asarray(points, dtype=np.float64)
    middle = np.median(place, axis=0)
    moved = float(np.quantile(np.linalg.norm(place - middle, axis=1), 0.9))
    given = np.array(base_position(options, base)[0])
    off = float(np.linalg.norm(middle - given))
    if moved > MOVES_M:
        what = f"the base moves: {moved:.0f} m about its median (limit {MOVES_M:.0f} m); are rover and base swapped?"
        raise InputError.at(base.path, None, what)
    if off > FAR_M:
        approx = rover.approx_position_m
        swapped = approx is not None and np.linalg.norm(approx - given) < FAR_M
        advice = f"the rover {rover.path} stands there: they are swapped" if swapped else "check them, or are rover and base swapped?"
        raise InputError.at(base.path, None, f"stands {off:.0f} m from the base coordinates (limit {FAR_M:.0f} m); {advice}")
    return _told_coordinates(options, base, off)


def _told_coordinates(options: EngineOptions, base: RinexHeader, off: float) -> tuple[Check, ...]:
    """Notes on coordinates of the header, and on a phase centre that is not applied."""
    checks = []
    _, point = base_position(options, base)
    if options.base_position_m is None:
        found = f"APPROX POSITION XYZ of {base.path}, {off:.1f} m from its position by codes; taken as {point}"
        advice = "give base_position and base_point; every position has the error of these coordinates"
        checks.append(Check("base coordinates", found, "coordinates that are known", "note", advice))
    if point != "apc" and options.antex is None and base.antenna.split()[:1] not in ([], ["NONE"], ["Unknown"]):
        found = f"of the {point}, with no ANTEX file for the antenna {base.antenna}"
        advice = "give antex, or the coordinates of the phase centre; heights are off by its offset, 0.05 to 0.2 m"
        checks.append(Check("base antenna", found, "the phase centre", "note", advice))
    return tuple(checks)
