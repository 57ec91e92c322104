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

import numpy as np
from numpy.typing import NDArray

from ...geodesy.frames import ecef_to_geodetic, geodetic_to_ecef
from ...geodesy.gpstime import WEEK_S
from ...records import Array, GnssFixes
from ...records.qualities import Quality
from ..rinex.navigation_message import Navigation
from ..rinex.observation_record import Observations
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
    rover: Observations,
    base: Observations,
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
    rows_in_base = base_rows(rover, base)[satellites.row]
    rows = _usable_rows(fixes, rover, base, satellites, rows_in_base, base_ecef)
    if rows.size == 0:
        return _no_differences()
    rover_rows = satellites.row[rows]
    paired_rows = rows_in_base[rows]
    bands, hertz = _two_bands(rover, base, rover_rows, paired_rows)
    antenna = geodetic_to_ecef(fixes.lat, fixes.lon, fixes.height)[satellites.epoch[rows]]
    navigation = navigation.of_week(rover.gps_week)
    range_difference = _modelled_ranges(rover, rover_rows, navigation, antenna, 0.0)
    range_difference -= _modelled_ranges(
        base,
        paired_rows,
        navigation,
        np.broadcast_to(base_ecef, antenna.shape),
        _week_shift_s(rover, base),
    )
    rise = fixes.height[satellites.epoch[rows]] - float(ecef_to_geodetic(base_ecef)[2])
    range_difference += _delay_difference_in_zenith(air, rise, base_ecef) * mapping(
        satellites.elevation[rows]
    )
    length = LIGHT / hertz
    difference = (
        _phases(rover, rover_rows, bands)
        - _phases(base, paired_rows, bands)
        - range_difference[:, None] / length
    )
    complete = np.flatnonzero(np.isfinite(difference).all(axis=1))
    if complete.size == 0:
        return _no_differences()
    group = np.unique(
        satellites.epoch[rows[complete]] * 100 + satellites.system[rows[complete]],
        return_inverse=True,
    )[1]
    fraction = _fractional_differences(
        difference[complete], group, satellites.elevation[rows[complete]]
    )
    are_measured = (np.abs(fraction) < LARGEST_PART).all(axis=1)
    enough = are_measured & (np.bincount(group, are_measured)[group] >= LEAST_SATELLITES)
    row = rows[complete[enough]]
    length = length[complete[enough]]
    _, epoch = np.unique(satellites.epoch[row], return_inverse=True)
    _, satellite = unique_satellites(rover.satellite[satellites.row[row]])
    kappa = (HERTZ["G"]["1"] * length / LIGHT) ** 2
    return DoubleDifferences(
        time=fixes.time[satellites.epoch[row]],
        epoch=epoch,
        system=satellites.system[row],
        satellite=satellite,
        parts=fraction[enough] * length,
        kappa=kappa,
        design=design[row],
        azimuth=satellites.azimuth[row],
        elevation=satellites.elevation[row],
        rise=rise[complete[enough]],
    )


def _no_differences() -> DoubleDifferences:
    none, number, pairs = np.empty(0), np.empty(0, dtype=np.int64), np.empty((0, 2))
    numbers = number, number, number
    return DoubleDifferences(none, *numbers, pairs, pairs, np.empty((0, 3)), none, none, none)


def measurable(fixes: GnssFixes, base_ecef: Array) -> NDArray[np.bool_]:
    """Return which positions (n,) are fixed and up to `FAR_M` from the base."""
    antenna = geodetic_to_ecef(fixes.lat, fixes.lon, fixes.height)
    within = np.linalg.norm(antenna - base_ecef, axis=1) <= FAR_M
    if fixes.quality is not None:
        within &= fixes.quality == Quality.FIXED
    return np.asarray(within)


def _week_shift_s(rover: Observations, base: Observations) -> float:
    """Return what is added to the base's times, s, to bring them into the rover's week."""
    return (base.gps_week - rover.gps_week) * WEEK_S


def _delay_difference_in_zenith(air: Atmosphere | None, rise: Array, base_ecef: Array) -> Array:
    """Return the zenith delay (m,), m, of the standard air minus that of `air`, base to rover.

    `rise` (m,) is the height of the rover above the base, m.
    """
    lat, _, height = (float(x) for x in ecef_to_geodetic(base_ecef))
    usual = standard_atmosphere(height)
    layers = [
        hydrostatic_layer(a, rise, lat, height) + wet_layer(a, rise) for a in (usual, air or usual)
    ]
    return np.asarray(layers[0] - layers[1])


def _usable_rows(
    fixes: GnssFixes,
    rover: Observations,
    base: Observations,
    satellites: Sky,
    rows_in_base: Index,
    base_ecef: Array,
) -> Index:
    """Return the rows of `satellites`, of at most `MOST_EPOCHS` epochs, that can be differenced.

    They are of measurable positions, epochs of the base, and systems with two bands.
    """
    separated = (
        base.time[base.epoch[rows_in_base]]
        + _week_shift_s(rover, base)
        - rover.time[rover.epoch[satellites.row]]
    )
    has_carriers = np.isin(rover.satellite[satellites.row].astype("U1"), list(SHARED_CARRIERS))
    is_shared = (rows_in_base >= 0) & (np.abs(separated) <= LARGEST_OFFSET_S) & has_carriers
    rows = np.flatnonzero(is_shared & measurable(fixes, base_ecef)[satellites.epoch])
    epochs = np.unique(satellites.epoch[rows])
    return rows[np.isin(satellites.epoch[rows], epochs[:: max(1, -(-epochs.size // MOST_EPOCHS))])]


def _two_bands(
    rover: Observations, base: Observations, rover_rows: Index, paired_rows: Index
) -> tuple[NDArray[np.str_], Array]:
    """Return two bands (m, 2) of each row and their carriers (m, 2), Hz.

    They are the first band of the row's system, and the second one that most of its rows have.
    """
    bands = np.full((rover_rows.size, 2), "", dtype="U1")
    hertz = np.full((rover_rows.size, 2), np.nan)
    for letter, rows in rows_of_systems(rover.satellite[rover_rows]).items():
        primary, *further = _bands(letter)
        observed_share = {}
        for band in further:
            sum_of_phases = _phase(rover, rover_rows[rows], band)
            sum_of_phases += _phase(base, paired_rows[rows], band)
            observed_share[band] = np.isfinite(sum_of_phases).mean()
        for k, band in enumerate((primary, max(further, key=lambda b: observed_share[b]))):
            bands[rows, k] = band
            hertz[rows, k] = HERTZ[letter][band]
    return bands, hertz


def _bands(letter: str) -> list[str]:
    """Return the bands of a system: the engine's, then lower ones that it leaves out."""
    bands = ENGINE_BANDS[letter]
    lower = [b for b, hertz in HERTZ[letter].items() if b not in bands and hertz < LOWER_HERTZ]
    return [*bands, *lower]


def _phase(observations: Observations, rows: Index, band: str) -> Array:
    """Return the phase (m,), cycles, of the first signal of the band that each row has."""
    out = np.full(rows.size, np.nan)
    for k, signal in enumerate(observations.signals):
        if signal[0] == "L" and signal[1] == band:
            out = np.where(np.isnan(out), observations.values[rows, k], out)
    return out


def _phases(observations: Observations, rows: Index, bands: NDArray[np.str_]) -> Array:
    """Return the phases (m, 2), cycles, of rows (m,) in bands (m, 2)."""
    out = np.full(bands.shape, np.nan)
    for band in np.unique(bands).tolist():
        out = np.where(bands == band, _phase(observations, rows, band)[:, None], out)
    return out


def _modelled_ranges(
    o: Observations, rows: Index, navigation: Navigation, antenna: Array, shift: float
) -> Array:
    """Return rho - c dt_s + T (m,), m, of rows (m,) at antennas (m, 3), m ECEF; shift in s."""
    states = emission_states(
        navigation, o.satellite[rows], o.time[o.epoch[rows]] + shift, code_ranges(o)[rows]
    )
    rho, sight = ranges(states.position, antenna)
    lat, _, height = ecef_to_geodetic(antenna)
    return rho - LIGHT * states.clock_s + standard_slant_delay(lat, height, sky(sight, antenna)[1])


def _fractional_differences(d: Array, group: Index, elevation: Array) -> Array:
    """Return (P.1) (m, 2), cycles, less integers, against the highest satellite of each group."""
    order = np.lexsort((-elevation, group))
    reference = order[np.diff(group[order], prepend=-1) > 0]
    double_difference = d - d[reference[group]]
    return np.asarray(double_difference - np.round(double_difference))
