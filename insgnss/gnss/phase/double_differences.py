"""Double differences of the phases of rover and base at positions that are fixed: less their
integer ambiguities, so that errors of millimetres show.

A fixed position is known to millimetres, so that with ranges, satellite clocks and the troposphere
taken from them the double differences d_b of the phases of band b, between receivers and to the
highest satellite of the system, are integers but for a part of a cycle:

    N_b = round(d_b),   |d_b - N_b| < 1/4,   y_b = lambda_b (d_b - N_b)                        (P.1)

in each epoch by itself: no arc, no slip and no ambiguity outlives it. What is common to the
satellites of a system in an epoch is arbitrary. GLONASS, of which every satellite has its own
wavelength, has no such integers and is left out. Farther than `FAR_M` from the base the ionosphere
may pass for a cycle.
"""

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from ...geodesy.frames import ecef_to_geodetic, geodetic_to_ecef
from ...geodesy.gpstime import WEEK_S
from ...records import Array, GnssFixes
from ...records.qualities import Quality
from ..rinex.navigation_message import Navigation
from ..satellites.frequencies import ENGINE_BANDS, HERTZ, rows_of_systems
from ..satellites.orbits import LIGHT, emission_states, ranges, sky, unique_satellites
from ..satellites.satellite_geometry import LARGEST_OFFSET_S, Sky, base_rows
from .time_differences import code_ranges
from .troposphere import (
    Atmosphere,
    hydrostatic_layer,
    mapping,
    standard_atmosphere,
    standard_slant_delay,
    wet_layer,
)

if TYPE_CHECKING:
    from ..rinex.observation_record import Observations

Index = NDArray[np.int64]

SHARED_CARRIERS = "GEJC"  # whose satellites share their carriers
LOWER_HERTZ = 1.3e9  # carriers above it are too near to the first for the ionosphere to part them
LARGEST_PART = 0.25  # cycle
MOST_EPOCHS = 3000  # spread over the flight: 10 minutes at 5 Hz tell as much as more (chosen)
LEAST_SATELLITES = 3  # of a system in an epoch
FAR_M = 1e4  # from the base: beyond, a gradient of 5 mm/km is a quarter of a cycle of L1


@dataclass(frozen=True, eq=False)
class DoubleDifferences:
    """Double differences of fixed epochs after (P.1), m rows, by epoch.

    Parameters
    ----------
    time : ndarray, shape (m,)
        s.
    epoch, system, satellite : ndarray of int, shape (m,)
        Numbers from 0.
    parts : ndarray, shape (m, 2)
        m, y of the two bands.
    kappa : ndarray, shape (m, 2)
        Of these bands.
    design : ndarray, shape (m, 3)
        Of `ionosphere_shell.shell_design`.
    azimuth, elevation : ndarray, shape (m,)
        rad.
    rise : ndarray, shape (m,)
        m, of the rover above the base.
    """

    time: Array
    epoch: Index
    system: Index
    satellite: Index
    parts: Array
    kappa: Array
    design: Array
    azimuth: Array
    elevation: Array
    rise: Array


def double_differences(
    fixes: GnssFixes,
    rover: "Observations",
    base: "Observations",
    navigation: Navigation,
    base_ecef: Array,
    satellites: Sky,
    design: Array,
    air: Atmosphere | None = None,
) -> DoubleDifferences:
    """Form the double differences (P.1) at measurable positions, of at most `MOST_EPOCHS` epochs.

    Parameters
    ----------
    fixes : GnssFixes
        Positions of the rover.
    rover, base : Observations
        Observations of both; only epochs that the base has, too, are taken.
    navigation : Navigation
        Broadcast ephemerides.
    base_ecef : ndarray, shape (3,)
        m, position of the base.
    satellites : Sky
        Satellites at the epochs of `fixes`.
    design : ndarray, shape (m, 3)
        Of `ionosphere_shell.shell_design`.
    air : Atmosphere, optional
        At the base, None for the standard one.
    """
    theirs = base_rows(rover, base)[satellites.row]
    rows = _usable(fixes, rover, base, satellites, theirs, base_ecef)
    mine, theirs = satellites.row[rows], theirs[rows]
    if rows.size == 0:
        return _no_differences()
    bands, hertz = _two_bands(rover, base, mine, theirs)
    antenna = geodetic_to_ecef(fixes.lat, fixes.lon, fixes.height)[satellites.epoch[rows]]
    navigation = navigation.of_week(rover.gps_week)
    range_difference = _geometry(rover, mine, navigation, antenna, 0.0)
    range_difference -= _geometry(
        base, theirs, navigation, np.broadcast_to(base_ecef, antenna.shape), _weeks(rover, base)
    )
    rise = fixes.height[satellites.epoch[rows]] - float(ecef_to_geodetic(base_ecef)[2])
    range_difference += _other_air(air, rise, base_ecef) * mapping(satellites.elevation[rows])
    length = LIGHT / hertz
    d = (
        _phases(rover, mine, bands)
        - _phases(base, theirs, bands)
        - range_difference[:, None] / length
    )
    complete = np.flatnonzero(np.isfinite(d).all(axis=1))
    if complete.size == 0:
        return _no_differences()
    group = np.unique(
        satellites.epoch[rows[complete]] * 100 + satellites.system[rows[complete]],
        return_inverse=True,
    )[1]
    fraction = _without_integers(d[complete], group, satellites.elevation[rows[complete]])
    whole = (np.abs(fraction) < LARGEST_PART).all(axis=1)
    many = whole & (np.bincount(group, whole)[group] >= LEAST_SATELLITES)
    kept, fraction, length = rows[complete[many]], fraction[many], length[complete[many]]
    _, epoch = np.unique(satellites.epoch[kept], return_inverse=True)
    _, satellite = unique_satellites(rover.satellite[satellites.row[kept]])
    kappa = (HERTZ["G"]["1"] * length / LIGHT) ** 2
    return DoubleDifferences(
        time=fixes.time[satellites.epoch[kept]],
        epoch=epoch,
        system=satellites.system[kept],
        satellite=satellite,
        parts=fraction * length,
        kappa=kappa,
        design=design[kept],
        azimuth=satellites.azimuth[kept],
        elevation=satellites.elevation[kept],
        rise=rise[complete[many]],
    )


def _no_differences() -> DoubleDifferences:
    none, number, pairs = np.empty(0), np.empty(0, dtype=np.int64), np.empty((0, 2))
    numbers = number, number, number
    return DoubleDifferences(none, *numbers, pairs, pairs, np.empty((0, 3)), none, none, none)


def measurable(fixes: GnssFixes, base_ecef: Array) -> NDArray[np.bool_]:
    """Return which positions (n,) are fixed and up to `FAR_M` from the base."""
    near = (
        np.linalg.norm(geodetic_to_ecef(fixes.lat, fixes.lon, fixes.height) - base_ecef, axis=1)
        <= FAR_M
    )
    return np.asarray(near if fixes.quality is None else near & (fixes.quality == Quality.FIXED))


def _weeks(rover: "Observations", base: "Observations") -> float:
    """What brings the base's times into the rover's week, s."""
    return (base.gps_week - rover.gps_week) * WEEK_S


def _other_air(air: Atmosphere | None, rise: Array, base_ecef: Array) -> Array:
    """Delay in zenith (m,) m that the air between the heights takes less than the standard one: of
    the rover minus the base.
    """
    lat, _, height = (float(x) for x in ecef_to_geodetic(base_ecef))
    usual = standard_atmosphere(height)
    layers = [
        hydrostatic_layer(a, rise, lat, height) + wet_layer(a, rise) for a in (usual, air or usual)
    ]
    return np.asarray(layers[0] - layers[1])


def _usable(
    fixes: GnssFixes,
    rover: "Observations",
    base: "Observations",
    satellites: Sky,
    theirs: Index,
    base_ecef: Array,
) -> Index:
    """Rows of `satellites` at measurable positions and epochs of the base, of systems with two
    bands, of at most `MOST_EPOCHS` epochs.
    """
    separated = (
        base.time[base.epoch[theirs]]
        + _weeks(rover, base)
        - rover.time[rover.epoch[satellites.row]]
    )
    shared = np.isin(rover.satellite[satellites.row].astype("U1"), list(SHARED_CARRIERS))
    good = (theirs >= 0) & (np.abs(separated) <= LARGEST_OFFSET_S) & shared
    rows = np.flatnonzero(good & measurable(fixes, base_ecef)[satellites.epoch])
    epochs = np.unique(satellites.epoch[rows])
    return rows[np.isin(satellites.epoch[rows], epochs[:: max(1, -(-epochs.size // MOST_EPOCHS))])]


def _two_bands(
    rover: "Observations", base: "Observations", mine: Index, theirs: Index
) -> tuple[NDArray[np.str_], Array]:
    """The first band of the system of each row and the second one that most of its rows have (m,
    2), and their carriers, Hz.
    """
    bands, hertz = np.full((mine.size, 2), "", dtype="U1"), np.full((mine.size, 2), np.nan)
    for letter, of in rows_of_systems(rover.satellite[mine]).items():
        first, *further = _bands(letter)
        observed_share = {
            b: np.isfinite(_phase(rover, mine[of], b) + _phase(base, theirs[of], b)).mean()
            for b in further
        }
        for k, band in enumerate((first, max(further, key=lambda b: observed_share[b]))):
            bands[of, k], hertz[of, k] = band, HERTZ[letter][band]
    return bands, hertz


def _bands(letter: str) -> list[str]:
    """Bands of a system: the engine's, and those that it leaves out."""
    bands = ENGINE_BANDS[letter]
    lower = [b for b, hertz in HERTZ[letter].items() if b not in bands and hertz < LOWER_HERTZ]
    return [*bands, *lower]


def _phase(observations: "Observations", rows: Index, band: str) -> Array:
    """Phase (m,), cycles, of the first signal of the band that each row has."""
    out = np.full(rows.size, np.nan)
    for k, signal in enumerate(observations.signals):
        if signal[0] == "L" and signal[1] == band:
            out = np.where(np.isnan(out), observations.values[rows, k], out)
    return out


def _phases(observations: "Observations", rows: Index, bands: NDArray[np.str_]) -> Array:
    """Phases (m, 2), cycles, of rows in bands (m, 2)."""
    out = np.full(bands.shape, np.nan)
    for band in np.unique(bands).tolist():
        out = np.where(bands == band, _phase(observations, rows, band)[:, None], out)
    return out


def _geometry(
    o: "Observations", rows: Index, navigation: Navigation, antenna: Array, shift: float
) -> Array:
    """rho - c dt_s + T (m,) m of rows at antennas (m, 3)."""
    states = emission_states(
        navigation, o.satellite[rows], o.time[o.epoch[rows]] + shift, code_ranges(o)[rows]
    )
    rho, sight = ranges(states.position, antenna)
    lat, _, height = ecef_to_geodetic(antenna)
    return rho - LIGHT * states.clock_s + standard_slant_delay(lat, height, sky(sight, antenna)[1])


def _without_integers(d: Array, group: Index, elevation: Array) -> Array:
    """What (P.1) leaves (m, 2), cycles, against the highest satellite of each group."""
    order = np.lexsort((-elevation, group))
    first = order[np.diff(group[order], prepend=-1) > 0]
    to_first = d - d[first[group]]
    return np.asarray(to_first - np.round(to_first))
